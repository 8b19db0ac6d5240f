"""RINEX files as numbered lines, and what observation and navigation files have in common: header and numbers.

Source: RINEX 2.11, section 5, and RINEX 3.05, sections 5 and 6; columns in the text count from 0, as Python does.
"""

import math
import re
import zlib
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

from integrity.errors import DecodeError
from integrity.gnss.gps_time import gps_from_calendar

GZIP_MAGIC = b"\x1f\x8b"
KINDS = {"O": "observation data", "N": "navigation data"}

# Fortran reals: exponents with D, and no zero needed before the point. Python's own float() also takes "nan", "inf" and "1_0".
_REAL = re.compile(r" *[-+]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[DdEe][-+]?[0-9]{1,3})? *")
_VERSION = re.compile(r" *([0-9]\.?[0-9]{0,2}) *")


@dataclass(frozen=True)
class RinexText:
    """The lines of a file without their ends; `cut` where a gzip stream ends early: the line it broke off in is left out."""

    path: str
    lines: tuple[str, ...]
    cut: bool


class HeaderLine(NamedTuple):
    """One line of a header: its number in the file (from 1), its label (columns 60 to 79), its content (columns 0 to 59)."""

    number: int
    label: str
    content: str


@dataclass(frozen=True)
class Header:
    """A header, its lines in order; `system` is the letter of the file (blank for GPS), `body` the index of the line after it."""

    version: float
    system: str
    lines: tuple[HeaderLine, ...]
    body: int

    def first(self, label: str) -> HeaderLine | None:
        """The first line with a label, or None."""
        return next((line for line in self.lines if line.label == label), None)

    def numbers(self, label: str, columns: range, problems: Counter[str]) -> tuple[float, ...] | None:
        """Numbers under a label, in columns that begin at `columns` and are a step wide; None where missing, or unreadable (counted)."""
        line = self.first(label)
        if line is None:
            return None
        values = reals(line.content, columns)
        if values is None:
            problems[f"{label} not readable"] += 1
        return values

    def leap_seconds(self, problems: Counter[str]) -> int | None:
        """GPS - UTC in seconds as the header says, None where it does not."""
        values = self.numbers("LEAP SECONDS", range(0, 6, 6), problems)
        return round(values[0]) if values else None


def broken(path: str, line_number: int, found: str, expected: str, remedy: str) -> DecodeError:
    """The error for a file that cannot be used: where, what was found, what would be right, what to do."""
    return DecodeError(f"{path}, line {line_number}: found {found}; expected {expected}; {remedy}")


def real(text: str) -> float | None:
    """A finite Fortran real such as `-.603D-02`, or None for anything else, blanks included."""
    if not _REAL.fullmatch(text):
        return None
    value = float(text.replace("D", "E").replace("d", "e"))
    return value if math.isfinite(value) else None


def reals(text: str, columns: range) -> tuple[float, ...] | None:
    """Reals in columns that begin at `columns`, each a step wide, or None if one of them cannot be read."""
    values = [real(text[k : k + columns.step]) for k in columns]
    return None if None in values else tuple(v for v in values if v is not None)


def calendar_ns(fields: Sequence[str], ns: int) -> int | None:
    """GPS time in nanoseconds of year, month, day, hour, minute, second and a fraction; None where there is no such time.

    A year of two digits means 1980 to 2079 (RINEX 2.11, 6.5), and no other year is accepted with four.
    """
    try:
        year, month, day, hour, minute, second = (int(field) for field in fields)
        if len(fields[0]) == 2:
            year += 1900 if year >= 80 else 2000
        return gps_from_calendar(year, month, day, hour, minute, second, ns) if 1980 <= year < 2080 else None
    except ValueError:
        return None


def read_text(path: Path) -> RinexText:
    """The lines of a plain or gzipped file; DecodeError for an empty file or a damaged gzip stream, OSError as `open` does."""
    data, cut = path.read_bytes(), False
    if data.startswith(GZIP_MAGIC):
        data, cut = _unpacked(path, data)
    # Latin 1: one column per byte, whatever language the comments are in.
    lines = data.decode("latin-1").replace("\r\n", "\n").replace("\r", "\n").split("\n")
    if cut or not lines[-1]:
        lines.pop()
    if not any(line.strip() for line in lines):
        raise broken(str(path), 1, "an empty file", "a RINEX file", "fetch the file again")
    return RinexText(str(path), tuple(lines), cut)


def _unpacked(path: Path, data: bytes) -> tuple[bytes, bool]:
    """Content of all members of a gzip file, and whether the last of them ends early. Source: RFC 1952, 2.2."""
    members: list[bytes] = []
    while data.startswith(GZIP_MAGIC):
        stream = zlib.decompressobj(wbits=zlib.MAX_WBITS | 16)
        try:
            members.append(stream.decompress(data))
        except zlib.error as error:
            found = f"a damaged gzip stream ({error})"
            raise broken(str(path), 1, found, "an intact gzip file or plain text", "fetch the file again") from error
        if not stream.eof:
            return b"".join(members), True
        data = stream.unused_data
    return b"".join(members), False


def read_header(text: RinexText, kind: str, versions: Sequence[tuple[float, float]]) -> Header:
    """The header of a file of a kind (`O` or `N`) whose version is in one of the ranges; DecodeError for any other file."""
    number, label, content = header_line(1, text.lines[0])
    if label == "CRINEX VERS   / TYPE":
        raise broken(text.path, number, "Hatanaka-compressed RINEX", KINDS[kind] + " as plain RINEX", "expand the file with CRX2RNX first")
    if label != "RINEX VERSION / TYPE":
        found = repr(text.lines[0][:80])
        raise broken(text.path, number, found, "RINEX VERSION / TYPE in columns 61 to 80", f"give a RINEX file with {KINDS[kind]}")
    match = _VERSION.fullmatch(content[:9])
    version = float(match[1]) if match else math.nan
    if not any(low <= version <= high for low, high in versions):
        expected = " or ".join(f"{low:.2f} to {high:.2f}" for low, high in versions)
        raise broken(text.path, number, f"version {content[:9].strip()!r}", f"RINEX {expected}", "convert the file to RINEX 3.05")
    if content[20].upper() != kind:
        found = f"file type {content[20:40].strip()!r}"
        raise broken(text.path, number, found, f"{kind!r} for {KINDS[kind]}", f"give the file with the {KINDS[kind]}")
    header: list[HeaderLine] = []
    for number, raw in enumerate(text.lines, start=1):
        header.append(header_line(number, raw))
        if header[-1].label == "END OF HEADER":
            return Header(version, content[40].upper(), tuple(header), body=number)
    raise broken(text.path, len(text.lines), "the end of the file", "END OF HEADER before it", "fetch the file again")


def header_line(number: int, raw: str) -> HeaderLine:
    """A line of a header, or of header lines among observations (event flag 4), by its number in the file."""
    return HeaderLine(number, raw[60:80].strip(), raw[:60].ljust(60))
