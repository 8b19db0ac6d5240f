"""Which line belongs to which satellite and epoch.

An epoch's line is told by its form, and what stands up to the next one is its own: a segment. Nearly all segments have as many lines
as they say, and are read side by side; the others one by one, by the same rules. An epoch with a line missing is dropped: in RINEX 2
only the count tells which satellite a line belongs to. Source: RINEX 2.11, table A2; RINEX 3.05, table A3.
"""

import re
from collections import Counter
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from integrity.gnss.gps_time import NS_PER_S
from integrity.gnss.observations import Bools, Ints
from recordings.rinex.columns import Bytes
from recordings.rinex.header import Format
from recordings.rinex.text import HeaderLine, header_line

NAME_BYTES, PER_LISTING_LINE, LIST_BEGINS = 3, 12, 32

_TIME = r" ([ \d]\d) ([ \d]\d) ([ \d]\d) ([ \d]\d)([ \d]{3})\.(\d{7})"
_FLAG_AND_COUNT = r"  ([0-6])(  \d| \d\d|\d{3})"
_EPOCH_2 = re.compile(rf"(?: ([ \d]\d){_TIME}| {{26}}){_FLAG_AND_COUNT}", re.ASCII)
_EPOCH_3 = re.compile(rf">(?: (\d{{4}}){_TIME}| {{28}}){_FLAG_AND_COUNT}", re.ASCII)
_SATELLITE = re.compile(r"[A-Z ](?:[ 0][1-9]|[1-9]\d)", re.ASCII)

# The form as one mark a column, of what is read side by side: d a digit, _ a digit or a space, others themselves.
_FORM_2 = " _d _d _d _d _d _d.ddddddd  d__d"
_FORM_3 = "> dddd _d _d _d _d _d.ddddddd  d__d"
_MARKS = {mark: 1 << k for k, mark in enumerate(" d.>")}
_FITS = {mark: _MARKS[mark] for mark in " d.>"} | {"_": _MARKS[" "] | _MARKS["d"]}
_MARK_OF = np.zeros(256, dtype=np.uint8)
_MARK_OF[ord("0") : ord("9") + 1] = _MARKS["d"]
_MARK_OF[[ord(mark) for mark in " .>"]] = [_MARKS[mark] for mark in " .>"]


class Text(NamedTuple):
    """A piece of text: its bytes, with blanks behind them, where its lines begin and how long they are; `number` of the first line."""

    data: Bytes
    start: Ints
    length: Ints
    number: int

    def line(self, k: int) -> str:
        """One column per byte, whatever language comments are in."""
        return self.data[self.start[k] : self.start[k] + self.length[k]].tobytes().decode("latin-1")

    def columns(self, lines: Ints, first: int, width: int) -> Bytes:
        """Columns of lines that are long enough to have them, (n, width)."""
        anywhere = np.ndarray((len(self.data) - width + 1,), np.dtype(f"V{width}"), self.data, 0, (1,))
        return anywhere[self.start[lines] + first].view(np.uint8).reshape(-1, width)


class Epochs(NamedTuple):
    """Times and power failures (E,); of each record its epoch, the bytes of its satellite's name (n, 3) and its first line, (n,)."""

    time_ns: Ints
    power_failed: Bools
    epoch: Ints
    name: Bytes
    line: Ints


class Segments(NamedTuple):
    """Lines `begin` to `end` (m,) of each epoch's segment; `plain` where the time and the rest below could be read side by side."""

    begin: Ints
    end: Ints
    plain: Bools
    time_ns: Ints
    flag: Ints
    n_records: Ints

    def part(self, which: slice) -> "Segments":
        """Some of them."""
        return Segments(*(values[which] for values in self))  # type: ignore[arg-type]


def text_of(piece: bytes, blanks: int, number: int) -> Text:
    """A piece of whole lines, with room for records of `blanks` bytes from any line on."""
    data = np.frombuffer(piece + b" " * blanks, dtype=np.uint8)
    ends = np.flatnonzero(data == ord("\n"))
    start = np.concatenate(([0], ends[:-1] + 1)) if len(ends) else ends
    return Text(data, start, ends - start, number)


def segments_of(text: Text, of: Format, first: int = 0) -> Segments:
    """The segments of a piece, from line `first` on."""
    shift = 0 if of.rinex2 else 3
    form = _FORM_2 if of.rinex2 else _FORM_3
    lines = first + np.flatnonzero(text.length[first:] >= len(form))
    if of.rinex2:  # columns 26 to 28 of a record are the point of a number and a digit, or three blanks
        flags = text.columns(lines, 26, 3)
        lines = lines[(flags[:, 0] == ord(" ")) & (flags[:, 1] == ord(" ")) & (flags[:, 2] != ord(" "))]
    else:
        lines = lines[text.data[text.start[lines]] == ord(">")]
    columns = text.columns(lines, 0, len(form))
    marks = np.array([_FITS[mark] for mark in form], dtype=np.uint8)
    plain = ((_MARK_OF[columns] & marks) != 0).all(axis=1) & ~((columns[:, -3] != ord(" ")) & (columns[:, -2] == ord(" ")))
    plain &= columns[:, -4] <= ord("6")  # flags
    epoch_line = _EPOCH_2 if of.rinex2 else _EPOCH_3
    is_epoch = plain.copy()
    for k in np.flatnonzero(~plain).tolist():
        is_epoch[k] = epoch_line.match(columns[k].tobytes().decode("latin-1")) is not None
    lines, columns, plain = lines[is_epoch], columns[is_epoch], plain[is_epoch]

    digits = (columns & 15).astype(np.int64)  # a space counts as zero
    digits[columns == ord(" ")] = 0
    year = digits[:, 2:6] @ np.array([1000, 100, 10, 1]) if shift else _two(digits, 1)
    year = year if shift else year + np.where(year >= 80, 1900, 2000)
    month, day, hour, minute, second = (_two(digits, k + shift) for k in (4, 7, 10, 13, 16))
    fraction = digits[:, 19 + shift : 26 + shift] @ 10 ** np.arange(6, -1, -1)
    days, which = np.unique((year * 100 + month) * 100 + day, return_inverse=True)
    begins = [of.day_ns(int(d) // 10_000, int(d) // 100 % 100, int(d) % 100) for d in days]
    day_ns = np.array([-1 if begin is None else begin for begin in begins], dtype=np.int64)[which]
    plain &= (day_ns >= 0) & (hour < 24) & (minute < 60) & (second < 60)
    time_ns = day_ns + (hour * 3600 + minute * 60 + second) * NS_PER_S + fraction * 100
    count = digits[:, -3:] @ np.array([100, 10, 1])
    return Segments(lines, np.append(lines[1:], len(text.start)), plain, time_ns, digits[:, 28 + shift], count)


def epochs_of(text: Text, segments: Segments, of: Format, problems: Counter[str]) -> tuple[Epochs, int, tuple[HeaderLine, ...]]:
    """The epochs of segments up to the first that changes the header; how many segments that is, and the header's lines."""
    lines = segments.end - segments.begin
    listing = np.maximum(1, -(-segments.n_records // PER_LISTING_LINE)) if of.rinex2 else np.ones_like(segments.n_records)
    whole = segments.plain & (segments.flag <= 1) & (lines == listing + segments.n_records * of.lines_each)
    if of.rinex2:
        whole &= _listed_well(text, segments, np.flatnonzero(whole), listing)
    odd: dict[int, Epochs] = {}
    header: tuple[HeaderLine, ...] = ()
    stop = len(lines)
    for k in np.flatnonzero(~whole).tolist():
        found, header = _one_by_one(text, int(segments.begin[k]), int(segments.end[k]), of, problems)
        if found is not None:
            odd[k] = found
        if header:
            stop = k + 1
            break
    several = np.flatnonzero(whole[:stop])
    parts = _side_by_side(text, segments, several, listing, of)
    return _in_order(parts, several, odd), stop, header


def leftover(text: Text, begin: int, end: int, problems: Counter[str]) -> None:
    """Count lines that belong to no epoch: once, unless they begin with a blank one."""
    if begin < end and text.line(begin).strip():
        problems["epoch line not readable"] += 1


def _two(digits: Ints, first: int) -> Ints:
    result: Ints = 10 * digits[:, first] + digits[:, first + 1]
    return result


def _listed_well(text: Text, segments: Segments, which: Ints, listing: Ints) -> Bools:
    """Whether the list of a RINEX 2 epoch, of `listing` lines, names as many satellites as it says, (m,); False where not asked for."""
    well = np.zeros(len(segments.begin), dtype=np.bool_)
    well[which] = True
    for line in range(int(listing[which].max(initial=0))):
        here = which[listing[which] > line]
        names = _listing(text, segments.begin[here] + line)
        wanted = np.arange(PER_LISTING_LINE) < (segments.n_records[here] - line * PER_LISTING_LINE)[:, None]
        blank = (names == ord(" ")).all(axis=-1)
        well[here] &= np.where(wanted, is_name(names), blank).all(axis=1)
    return well


def _listing(text: Text, lines: Ints) -> Bytes:
    """The twelve names of lines of a RINEX 2 list, (n, 12, 3), blank where the line has ended."""
    width = PER_LISTING_LINE * NAME_BYTES
    columns = text.columns(lines, LIST_BEGINS, width).copy()
    columns[np.arange(LIST_BEGINS, LIST_BEGINS + width) >= text.length[lines][:, None]] = ord(" ")
    return columns.reshape(-1, PER_LISTING_LINE, NAME_BYTES)


def is_name(name: Bytes) -> Bools:
    """Whether bytes (..., 3) have the form `G 5`, `G05` or ` 05`."""
    letter, ten, one = name[..., 0], name[..., 1], name[..., 2]
    is_digit = (one >= ord("0")) & (one <= ord("9"))
    first_ten = ((ten == ord(" ")) | (ten == ord("0"))) & (one != ord("0"))
    named: Bools = (((letter >= ord("A")) & (letter <= ord("Z"))) | (letter == ord(" "))) & is_digit
    named &= first_ten | ((ten >= ord("1")) & (ten <= ord("9")))
    return named


def _side_by_side(text: Text, segments: Segments, which: Ints, listing: Ints, of: Format) -> Epochs:
    """The epochs of whole segments."""
    count = segments.n_records[which]
    epoch = np.repeat(np.arange(len(which)), count)
    place = np.arange(len(epoch)) - np.repeat(np.cumsum(count) - count, count)  # of a record in its epoch
    line = (segments.begin[which] + listing[which])[epoch] + place * of.lines_each
    if of.rinex2:
        name = np.empty((len(epoch), NAME_BYTES), dtype=np.uint8)
        for k in range(-(-int(count.max(initial=0)) // PER_LISTING_LINE)):
            here = np.flatnonzero(place // PER_LISTING_LINE == k)
            several, which_of = np.unique(epoch[here], return_inverse=True)
            name[here] = _listing(text, segments.begin[which[several]] + k)[which_of, place[here] - k * PER_LISTING_LINE]
    else:
        name = text.columns(line, 0, NAME_BYTES).copy()
        name[text.length[line] < NAME_BYTES] = 0
    return Epochs(segments.time_ns[which], segments.flag[which] == 1, epoch, name, line)


def _in_order(parts: Epochs, several: Ints, odd: dict[int, Epochs]) -> Epochs:
    """Epochs read side by side, which were the segments `several`, and those read one by one, in the order of the file."""
    if not odd:
        return parts
    numbers = np.concatenate((several, list(odd)))
    order = np.argsort(numbers, kind="stable")
    new_place = np.empty(len(order), dtype=np.int64)
    new_place[order] = np.arange(len(order))
    records = [new_place[parts.epoch], *(np.full(len(one.line), new_place[len(several) + k]) for k, one in enumerate(odd.values()))]
    epoch = np.concatenate(records)
    by_epoch = np.argsort(epoch, kind="stable")
    every = (parts, *odd.values())
    return Epochs(
        np.concatenate([e.time_ns for e in every])[order],
        np.concatenate([e.power_failed for e in every])[order],
        epoch[by_epoch],
        np.concatenate([e.name for e in every])[by_epoch],
        np.concatenate([e.line for e in every])[by_epoch],
    )


def _one_by_one(text: Text, begin: int, end: int, of: Format, problems: Counter[str]) -> tuple[Epochs | None, tuple[HeaderLine, ...]]:
    """The epoch of one segment, or None; and the header lines in it (flag 4)."""
    match = (_EPOCH_2 if of.rinex2 else _EPOCH_3).match(text.line(begin))
    assert match is not None, "segments begin where the line of an epoch is"
    flag, count = match[8], int(match[9])
    special = flag in "2345"  # special records, `count` of them; in flag 4 they are header lines
    listing_lines = 1 if special or not of.rinex2 else max(1, -(-count // PER_LISTING_LINE))
    first = begin + listing_lines
    stop = first + count * (1 if special else of.lines_each)
    if stop > end:
        problems["epoch cut off"] += 1
        return None, ()
    if special or flag == "6":
        leftover(text, stop, end, problems)
        header = (header_line(text.number + k, text.line(k)) for k in range(first, stop))
        return None, tuple(header) if flag == "4" else ()
    if of.rinex2 and stop < end and "." in text.line(stop)[10::16]:
        problems["epoch longer than it says"] += 1  # one more data line: it cannot be told which one is too many
        return None, ()
    leftover(text, stop, end, problems)
    time_ns = _time_ns(match.groups()[:7], of) if match[1] else None
    lines = range(first, stop, of.lines_each)
    names = _names_2(text, begin, first, len(lines)) if of.rinex2 else [text.line(k)[:NAME_BYTES].ljust(NAME_BYTES, "\0") for k in lines]
    if time_ns is None:
        problems["epoch time not readable"] += 1
        return None, ()
    if names is None:
        problems["satellite list not readable"] += 1
        return None, ()
    name = np.frombuffer("".join(names).encode("latin-1"), dtype=np.uint8).reshape(-1, NAME_BYTES)
    return Epochs(
        np.array([time_ns]), np.array([flag == "1"]), np.zeros(len(lines), dtype=np.int64), name, np.array(lines, dtype=np.int64)
    ), ()


def _time_ns(fields: Sequence[str], of: Format) -> int | None:
    """GPS time of year, month, day, hour, minute, second and seven decimals; None where there is no such time."""
    try:
        year, month, day, hour, minute, second = (int(field) for field in fields[:6])
    except ValueError:
        return None
    if of.rinex2:
        year += 1900 if year >= 80 else 2000
    day_ns = of.day_ns(year, month, day)
    if day_ns is None or hour > 23 or minute > 59 or second > 59:
        return None
    return day_ns + (hour * 3600 + minute * 60 + second) * NS_PER_S + int(fields[6]) * 100


def _names_2(text: Text, begin: int, first: int, n: int) -> list[str] | None:
    """Names in the list of a RINEX 2 epoch; None where one cannot be read, or where they are not `n`: no record is sure to be whose."""
    lines: Iterator[str] = (text.line(k) for k in range(begin, first))
    listed = "".join(line[LIST_BEGINS : LIST_BEGINS + PER_LISTING_LINE * NAME_BYTES].ljust(36) for line in lines).rstrip()
    names = [listed[k : k + NAME_BYTES] for k in range(0, len(listed), NAME_BYTES)]
    return names if len(names) == n and all(map(_SATELLITE.fullmatch, names)) else None
