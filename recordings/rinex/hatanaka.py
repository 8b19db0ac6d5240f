"""Compact RINEX (CRINEX 1 and 3) after Hatanaka, expanded to the RINEX 2, 3 or 4 it was made of.

Numbers are differences of an order up to nine from epoch to epoch, each satellite and type for itself, begun again by `order&value`.
Epoch lines and the two digits after each number are told by what has changed: a blank stands for what stood there, `&` for a blank.
A file has no check sums: a digit changed in a difference changes all numbers up to the next beginning, which nobody can notice. What
can be noticed is given up until it begins again: a number that is no number, a line missing or too many.
Source: Hatanaka (2008), A Compression Format and Tools for GNSS Observation Data, Bulletin of the GSI 55; the text is that of CRX2RNX.
"""

import re
from collections import Counter
from collections.abc import Iterable, Iterator
from itertools import chain, islice
from typing import NamedTuple

import numpy as np

from recordings.rinex.columns import FIELD_BYTES
from recordings.rinex.differences import Known, Records, expanded_records
from recordings.rinex.text import broken

LABEL = b"CRINEX VERS   / TYPE"
VERSIONS = (b"1.0", b"3.0", b"3.1")
NAME_BYTES = 3
LINE_2_BYTES = 80
CELLS_AT_ONCE = 600_000  # epochs x satellites x types: what bounds the memory

_EVENT = re.compile(rb"[2-6]")
_COUNT = re.compile(rb"[0-9]{1,3}")
_WHOLE = re.compile(rb"-?[0-9]{1,15}")
_CLOCK = re.compile(rb" *(?:(?:[0-9]&)?-?[0-9]{1,15})? *")
_BEGUN = re.compile(rb"([0-9])&(-?[0-9]{1,15})")
_EPOCH_2 = re.compile(rb" [ \d]\d [ \d]\d [ \d]\d [ \d]\d [ \d]\d[ \d]{3}\.\d{7}  [01]([ \d]{2}\d)((?:[A-Z ][ \d]\d)*) *")
_EPOCH_3 = re.compile(rb"> \d{4} [ \d]\d [ \d]\d [ \d]\d [ \d]\d[ \d]{3}\.\d{7}  [01]([ \d]{2}\d) {6}((?:[A-Z][ \d]\d)*) *")


class _Form(NamedTuple):
    """Where RINEX 2 and RINEX 3 differ: first byte of an epoch line that stands for itself, and what it is then; columns; decimals."""

    begun: bytes
    first: bytes
    flag: int
    list_begins: int
    clock_decimals: int
    epoch: re.Pattern[bytes]


_FORM = {1: _Form(b"&", b" ", 28, 32, 9, _EPOCH_2), 3: _Form(b">", b">", 31, 41, 12, _EPOCH_3)}


class _Clock:
    """The receiver's clock and its differences: `stack[k]` is the difference of order k, up to `order`."""

    def __init__(self) -> None:
        self._order = 0
        self._stack: list[int] | None = None

    def moved(self, text: bytes) -> int | None:
        """The next value, from a difference of the highest order there is or a beginning; None where it cannot be known."""
        begun, number = _BEGUN.fullmatch(text), _WHOLE.fullmatch(text)
        if begun:
            self._order, self._stack = int(begun[1]), [int(begun[2])]
        elif number and self._stack is not None:
            self._stack = [*self._stack, int(text)] if len(self._stack) <= self._order else [*self._stack[:-1], int(text)]
            for k in reversed(range(len(self._stack) - 1)):
                self._stack[k] += self._stack[k + 1]
        else:
            self._stack = None
        return None if self._stack is None else self._stack[0]


def is_compact(first_piece: bytes) -> bool:
    """Whether a file begins as Compact RINEX does."""
    return first_piece.partition(b"\n")[0][60:80] == LABEL


def expanded(path: str, pieces: Iterable[bytes], problems: Counter[str]) -> Iterator[bytes]:
    """The text of RINEX, as pieces of whole lines, of the pieces of a Compact RINEX file; DecodeError for a version that is not known."""
    lines = chain.from_iterable(piece.split(b"\n")[:-1] for piece in pieces)
    version = next(lines)[:9].strip()
    if version not in VERSIONS:
        raise broken(path, 1, f"version {version.decode('latin-1')!r}", "CRINEX 1.0 or 3.0", "expand the file with CRX2RNX first")
    next(lines, b"")  # program and date
    yield from _Expansion(int(version[:1]), lines, problems).pieces()


class _Expansion:
    """The state of an expansion: types by system (RINEX 2: all under ""), the last epoch line, and what is known of clock and satellites.

    Lines are gathered as long as epochs follow each other, then expanded at once: `_text` has them in order, where a number stands for as
    many records.
    """

    def __init__(self, version: int, lines: Iterator[bytes], problems: Counter[str]) -> None:
        self._form = _FORM[version]
        self._is_2 = version == 1
        self._lines = lines
        self._problems = problems
        self._n_types: dict[bytes, int] = {}
        self._epoch = bytearray()
        self._clock = _Clock()
        self._known: dict[bytes, Known] = {}
        self._text: list[bytes | int] = []
        self._names: list[bytes] = []
        self._record_lines: list[bytes] = []
        self._n_records: list[int] = []  # of each epoch
        self._satellites: set[bytes] = set()
        self._last_text = 0  # where the last epoch begins in it

    def pieces(self) -> Iterator[bytes]:
        """The text in pieces of whole lines."""
        for of_header in self._lines:
            self._header_line(of_header)
            if of_header[60:].strip() == b"END OF HEADER":
                break
        line: bytes | None = next(self._lines, None)
        while line is not None:
            begun = line[:1] == self._form.begun
            if line[:1] == b"&" and not self._is_2:  # an escape: nothing is known to stand in such lines
                line = next(self._lines, None)
            elif begun and _EVENT.match(line, self._form.flag):
                yield self._gathered()
                self._forget()
                line = self._event(line)
            else:
                if begun:
                    yield self._gathered()
                    self._forget()
                names = self._next_epoch(line)
                if names is not None:
                    if self._cells(names) > CELLS_AT_ONCE:
                        yield self._gathered()
                    line = self._one_epoch(names)
                else:
                    self._problems["compressed epochs without a beginning"] += 1
                    self._drop_last_epoch()
                    line = next((later for later in self._lines if later[:1] == self._form.begun), None)
        yield self._gathered()

    def _header_line(self, line: bytes) -> None:
        """The line itself; types are counted on the way."""
        label = line[60:80].rstrip()
        count = line[:6].strip() if self._is_2 else line[3:6].strip()
        if label == (b"# / TYPES OF OBSERV" if self._is_2 else b"SYS / # / OBS TYPES") and _COUNT.fullmatch(count):
            self._n_types[b"" if self._is_2 else line[:1]] = int(count)
        self._text.append(line.rstrip(b" "))

    def _event(self, line: bytes) -> bytes | None:
        """An epoch line of special records and these, which stand as they are; the line that follows."""
        self._text.append((self._form.first + line[1:]).rstrip(b" "))
        count = line[self._form.flag + 1 : self._form.flag + 4].strip()
        for _ in range(int(count) if _COUNT.fullmatch(count) else 0):
            special = next(self._lines, None)
            if special is None or special[:1] == self._form.begun:
                return special  # an epoch that begins anew: the count was damaged
            self._header_line(special)
        return next(self._lines, None)

    def _forget(self) -> None:
        """All that differences and changes go by."""
        self._epoch, self._clock, self._known = bytearray(), _Clock(), {}

    def _cells(self, names: list[bytes]) -> int:
        """What there is to expand at once with another epoch of the satellites."""
        self._satellites.update(names)
        return (len(self._n_records) + 1) * len(self._satellites) * max(self._n_types.values(), default=0)

    def _next_epoch(self, line: bytes) -> list[bytes] | None:
        """Bring the epoch line up to date: the names in its list, or None where it cannot be one, such as that of the epoch before."""
        before = bytes(self._epoch)
        _repair(self._epoch, line if before else self._form.first + line[1:])
        match = self._form.epoch.fullmatch(self._epoch)
        if match is None or self._epoch == before:
            return None
        count, listed = int(match[1].replace(b" ", b"0")), match[2]
        names = [listed[k : k + NAME_BYTES] for k in range(0, len(listed), NAME_BYTES)]
        known = self._is_2 or all(name[:1] in self._n_types for name in names)
        return names if len(names) == count == len(set(names)) and known else None

    def _one_epoch(self, names: list[bytes]) -> bytes | None:
        """Gather the lines of an epoch, as far as there are lines for it; returns the line after it, or None."""
        clock_line = next(self._lines, b"")
        if not _CLOCK.fullmatch(clock_line):
            return clock_line
        self._last_text = len(self._text)
        self._epoch_lines(names, clock_line)
        lines = list(islice(self._lines, len(names)))
        begun = next((k for k, line in enumerate(lines) if line[:1] == self._form.begun), None)
        if begun is not None:
            lines, self._lines = lines[:begun], chain(lines[begun:], self._lines)
        self._record_lines += lines
        self._names += names[: len(lines)]
        self._n_records.append(len(lines))
        self._text.append(len(lines))
        return next(self._lines, None)

    def _drop_last_epoch(self) -> None:
        """Leave out the epoch before a line that should begin one and does not: its lines may have been those of others."""
        if self._n_records:
            n = self._n_records.pop()
            del self._record_lines[len(self._record_lines) - n :], self._names[len(self._names) - n :], self._text[self._last_text :]

    def _epoch_lines(self, names: list[bytes], clock_line: bytes) -> None:
        line, clock = bytes(self._epoch).rstrip(b" "), _clock_text(self._clock.moved(clock_line.strip()), self._form.clock_decimals)
        if not self._is_2:
            self._text.append((line[:41].ljust(41) + clock).rstrip(b" "))
            return
        self._text.append(line[:68].ljust(68) + clock if clock else line[:68])
        self._text += [b" " * 32 + b"".join(names[k : k + 12]) for k in range(12, len(names), 12)]

    def _gathered(self) -> bytes:
        """The text of what has been gathered; it is known from then on."""
        n_of = {name: self._n_types.get(b"" if self._is_2 else name[:1], 0) for name in set(self._names)}
        n_types = np.array([n_of[name] for name in self._names], dtype=np.int64)
        epochs = np.repeat(np.arange(len(self._n_records)), self._n_records)
        texts = [b""] * len(self._names)
        known: dict[bytes, Known] = {}
        for n in sorted(set(n_of.values())):
            which = np.flatnonzero(n_types == n)
            places = which.tolist()
            records = Records(n, [self._record_lines[k] for k in places], [self._names[k] for k in places], epochs[which])
            fields = b""
            if n:
                array, after = expanded_records(records, len(self._n_records), self._known, digits_of_blanks=not self._is_2)
                fields, known = array.tobytes(), known | after
            for k, text in zip(places, self._records_text(records, fields), strict=True):
                texts[k] = text
        if self._n_records:
            self._known = known
        lines: list[bytes] = []
        at = 0
        for line in self._text:
            if isinstance(line, bytes):
                lines.append(line)
            else:
                lines += texts[at : at + line]
                at += line
        self._text, self._names, self._record_lines, self._n_records, self._satellites = [], [], [], [], set()
        return b"\n".join([*lines, b""])

    def _records_text(self, records: Records, fields: bytes) -> Iterator[bytes]:
        """The lines of each record, of the fields of all of them."""
        width = records.n_types * FIELD_BYTES
        for k, name in enumerate(records.names):
            mine = fields[k * width : (k + 1) * width]
            if self._is_2:
                yield b"\n".join(mine[at : at + LINE_2_BYTES].rstrip(b" ") for at in range(0, max(1, width), LINE_2_BYTES))
            else:
                yield (name + mine).rstrip(b" ")


def _clock_text(value: int | None, decimals: int) -> bytes:
    """A clock offset without a zero before the point; empty where there is none, or no room for it."""
    if value is None:
        return b""
    digits = b"%0*d" % (decimals, abs(value))
    text = (b"-" if value < 0 else b"") + digits[:-decimals]
    return text.rjust(2) + b"." + digits[-decimals:] if len(text) <= 2 else b""


def _repair(text: bytearray, change: bytes) -> None:
    """Change a text: a blank keeps what stands there, `&` is a blank."""
    if len(change) > len(text):
        text.extend(b" " * (len(change) - len(text)))
    for k, byte in enumerate(change):
        if byte != 32:
            text[k] = 32 if byte == 38 else byte
