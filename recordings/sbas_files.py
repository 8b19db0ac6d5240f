"""Recorded SBAS messages: EMS of ESA (`.ems`), the text of RTKLIB (`.sbs`), and logs of u-blox receivers; plain or gzipped.

`.ems`: PRN, year, month, day, hour, minute, second, type, 256 bits as 64 hexadecimal digits: the frame and six bits of padding.
`.sbs`: GPS week, time of week, PRN, type, colon, 232 bits as 58 digits: the message without its CRC and six bits, which are zero or where
the CRC begins. Both are in GPS time and name the second at whose beginning a message had been sent: one after that in which its first
bit was sent. So gLAB reads `.ems`, and in recordings of MSAS the preamble, which keeps step with GPS time (DO-229D, A.4.3.3), says the
same. RTKLIB writes the `.sbs` of some receivers one second earlier; nothing in such a file tells them apart.
Sources: ESA EMS user interface document, E-RD-SYS-E31-010; RTKLIB manual 2.4.2, appendix; for UBX see `integrity.gnss.sbas.words`.
"""

import re
import zlib
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

from integrity.gnss.crc import crc24q
from integrity.gnss.gps_time import NS_PER_S, WEEK_NS, gps_from_calendar
from integrity.gnss.sbas.messages import CRC_BITS, FIRST_PRN, LAST_PRN, MESSAGE_BITS, PREAMBLES, SbasMessage, message_of
from integrity.gnss.sbas.words import measured_ns, message_of_words
from integrity.gnss.ubx.framing import Frame, Framer
from integrity.gnss.ubx.rxm_sfrb import RXM_SFRB, decode_sfrb
from integrity.gnss.ubx.sfrbx import RXM_SFRBX, NavigationWords, decode_sfrbx
from recordings.rinex.text import GZIP_MAGIC, broken

TAG_AFTER_SENT_NS = NS_PER_S
PADDING_BITS = 6
LAST_WEEK = 7168  # 2117: beyond any recording

_EMS = re.compile(r" *(\d{3}) +(\d\d) +(\d\d?) +(\d\d?) +(\d\d?) +(\d\d?) +(\d\d?)(?:\.(\d{1,9}))? +(\d\d?) +([0-9A-Fa-f]{64}) *", re.ASCII)
_SBS = re.compile(r" *(\d{1,4}) +(\d{1,6})(?:\.(\d{1,9}))? +(\d{3}) +(\d\d?) *: *([0-9A-Fa-f]{58}) *", re.ASCII)


@dataclass(frozen=True)
class SbasFile:
    """What a file holds: messages in order of time, each once; `problems` counts what was dropped, by reason."""

    path: str
    form: str
    messages: tuple[SbasMessage, ...]
    problems: dict[str, int]


def read_sbas(path: Path) -> SbasFile:
    """Read a file of any of the three forms, told by its content. DecodeError where it is none of them, OSError where it does not open."""
    problems: Counter[str] = Counter()
    data = _content(path, problems)
    form, found = _messages(path, data, problems)
    messages: dict[tuple[int, int], SbasMessage] = {}
    for message in sorted(found, key=lambda one: (one.sent_ns, one.prn)):
        key = (message.sent_ns, message.prn)
        if key in messages:
            problems["message repeated" if messages[key] == message else "two messages at one time"] += 1
        else:
            messages[key] = message
    return SbasFile(str(path), form, tuple(messages.values()), dict(problems))


def _content(path: Path, problems: Counter[str]) -> bytes:
    """The bytes of a plain file, or of all members of a gzipped one, which may end early: counted. Source: RFC 1952, 2.2."""
    data = path.read_bytes()
    if not data.startswith(GZIP_MAGIC):
        return data
    members = []
    try:
        while data.startswith(GZIP_MAGIC):
            stream = zlib.decompressobj(wbits=zlib.MAX_WBITS | 16)
            members.append(stream.decompress(data))
            data = stream.unused_data
            if not stream.eof:
                problems["file cut off"] += 1
    except zlib.error as error:
        raise broken(
            str(path), 1, f"a damaged gzip stream ({error})", "an intact gzip file or a plain one", "fetch the file again"
        ) from error
    return b"".join(members)


def _messages(path: Path, data: bytes, problems: Counter[str]) -> tuple[str, list[SbasMessage]]:
    """The form of a file, and what is in it; DecodeError where that is nothing."""
    lines = data.decode("latin-1").splitlines()
    text = next(((form, pattern, of_line) for form, pattern, of_line in _TEXTS if any(map(pattern.fullmatch, lines))), None)
    dropped: Counter[str] = Counter()
    if text is None:
        form, messages = "UBX", list(_of_ubx(data, dropped))
    else:
        form, pattern, of_line = text
        messages = list(_of_lines(lines, pattern, of_line, dropped))
    if not messages:
        said = ", ".join(f"{name} x {n}" for name, n in dropped.items())
        first = repr(lines[0][:70]) if lines else "an empty file"
        expected = "sound SBAS messages as .ems, .sbs, or UBX with RXM-SFRBX or RXM-SFRB and measurements"
        raise broken(str(path), 1, f"{first} ({said})" if said else first, expected, "give the file of these messages")
    problems.update(dropped)
    return form, messages


def _of_lines(lines: Iterable[str], pattern: "re.Pattern[str]", of_line: "_OfLine", problems: Counter[str]) -> Iterator[SbasMessage]:
    for line in lines:
        match = pattern.fullmatch(line)
        message = of_line(match) if match else "line not readable"
        if isinstance(message, SbasMessage):
            yield message
        elif line.strip():
            problems[message] += 1


def _of_ems(match: "re.Match[str]") -> SbasMessage | str:
    prn, year, month, day, hour, minute, second = (int(field) for field in match.groups()[:7])
    try:
        tag_ns = gps_from_calendar(2000 + year, month, day, hour, minute, second)
    except ValueError:
        return "no such time"
    bits = message_of(int(match[10], 16) >> PADDING_BITS)
    return bits if isinstance(bits, str) else _message(prn, tag_ns, int(match[9]), bits)


def _of_sbs(match: "re.Match[str]") -> SbasMessage | str:
    week, tow_s, prn, kind = int(match[1]), int(match[2]), int(match[4]), int(match[5])
    if not (0 < week <= LAST_WEEK and tow_s * NS_PER_S < WEEK_NS):
        return "no such time"
    whole = int(match[6], 16)
    bits, behind = whole >> PADDING_BITS, whole & (1 << PADDING_BITS) - 1
    if bits >> MESSAGE_BITS - 8 not in PREAMBLES:
        return "preamble wrong"
    if behind not in (0, crc24q(bits.to_bytes(-(-MESSAGE_BITS // 8), "big")) >> CRC_BITS - PADDING_BITS):
        return "CRC wrong"
    return _message(prn, week * WEEK_NS + tow_s * NS_PER_S, kind, bits)


def _message(prn: int, tag_ns: int, kind: int, bits: int) -> SbasMessage | str:
    """Fractions of a second in a time are passed over: messages begin with the second."""
    if not FIRST_PRN <= prn <= LAST_PRN:
        return "PRN of no SBAS"
    message = SbasMessage(prn, tag_ns - TAG_AFTER_SENT_NS, bits)
    return message if message.kind == kind else "type is not that of the message"


def _of_ubx(data: bytes, problems: Counter[str]) -> Iterator[SbasMessage]:
    framer = Framer()
    last_ns: int | None = None
    for frame in framer.feed(data):
        last_ns = measured_ns(*frame) or last_ns
        words = _words(frame)
        if words is None or words.satellite[0] != "S":
            continue
        if last_ns is None:
            problems["message before the time was known"] += 1
            continue
        message = message_of_words(words, last_ns)
        if isinstance(message, SbasMessage):
            yield message
        else:
            problems[message] += 1
    if framer.bad_frames:
        problems["bad frames"] += framer.bad_frames
    if framer.pending:
        problems["bytes of a frame that does not end"] += len(framer.pending)


def _words(frame: Frame) -> NavigationWords | None:
    kind = frame.message_class, frame.message_id
    if kind == RXM_SFRBX:
        return decode_sfrbx(frame.payload)
    return decode_sfrb(frame.payload) if kind == RXM_SFRB else None


_OfLine = Callable[["re.Match[str]"], SbasMessage | str]
_TEXTS: tuple[tuple[str, "re.Pattern[str]", _OfLine], ...] = (("EMS", _EMS, _of_ems), ("SBS", _SBS, _of_sbs))
