"""Navigation files: broadcast ephemerides of all systems and the ionospheres of GPS and Galileo, from RINEX 2, 3 and 4.

A record runs to the line that begins the next one, whatever the system; of a damaged file what is beyond doubt is taken and the rest is
counted. Source: RINEX 2.11, section 5 and tables A3, A10, A15; RINEX 3.05, table A5 and section 6; RINEX 4.02, section 5.
"""

import math
import re
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

from integrity.gnss.atmosphere import GalileoIonosphere, Klobuchar
from integrity.gnss.ephemeris.broadcast import Ephemeris, KeplerEphemeris
from integrity.gnss.gps_time import BDT_BEHIND_GPS_NS, NS_PER_S
from integrity.gnss.signals import SYSTEMS
from recordings.rinex.navigation_fields import Record, begins_record, epoch_ns, numbers
from recordings.rinex.navigation_kepler import kepler_of
from recordings.rinex.navigation_vectors import geo_of, glonass_of
from recordings.rinex.text import Header, RinexText, read_header, read_text, reals

VERSIONS = ((2.00, 2.12), (3.00, 3.05), (4.00, 4.02))
VERSIONS_2 = VERSIONS[:1]
SYSTEM_OF_KIND = {"N": "G", "G": "R", "H": "S"}  # RINEX 2 has a kind of file for each system

LINES = {"R": 4, "S": 4}  # of a record
KEPLER_LINES = 8
GLONASS_LINES = 5  # since RINEX 3.05

# What RINEX 4 calls the messages that we read; it has others ("CNAV", "L3OC") and other records (STO, EOP).
MESSAGES = {"G": ("LNAV",), "J": ("LNAV",), "E": ("INAV", "FNAV"), "C": ("D1", "D2"), "R": ("FDMA",), "S": ("SBAS",)}
NOTHING_DISTURBED = 0  # the headers of RINEX 3 leave the storm flags out
IONOSPHERES = {("G", "LNAV"), ("G", "CNVX"), ("E", "IFNV")}
_HEAD_4 = re.compile(r"> (EPH|STO|EOP|ION) ([A-Z]\d\d) ([A-Z0-9]{2,4})(?: .*)?", re.ASCII)


@dataclass(frozen=True)
class NavigationFile:
    """A navigation file as read, ephemerides in file order, repeated ones included; `problems` counts what was dropped and why.

    `ephemerides` hold what decisions are made of: of Galileo the sets of I/NAV, while those of F/NAV are `fnav_ephemerides`.
    """

    path: str
    version: float
    ephemerides: tuple[Ephemeris, ...]
    klobuchar: Klobuchar | None
    leap_seconds: int | None
    problems: dict[str, int]
    fnav_ephemerides: tuple[Ephemeris, ...] = ()
    galileo_ionosphere: GalileoIonosphere | None = None


class _Record(NamedTuple):
    """The lines of one record, from that with the epoch on, as many as there are; `message` is None where RINEX does not name it."""

    satellite: str
    message: str | None
    lines: Record
    ionosphere: bool = False


def read_navigation(path: Path) -> NavigationFile:
    """Read a navigation file, plain or gzipped: GPS, QZSS, Galileo, BeiDou, GLONASS, SBAS.

    DecodeError where the file is not RINEX 2, 3 or 4 navigation data, OSError where it cannot be opened.
    """
    text = read_text(path)
    kind = _kind(text.lines[0])
    header = read_header(text, kind, VERSIONS if kind == "N" else VERSIONS_2)
    problems: Counter[str] = Counter()
    klobuchar, galileo_ionosphere = _klobuchar(header, problems), _galileo_ionosphere(header, problems)
    ephemerides: list[Ephemeris] = []
    fnav_ephemerides: list[Ephemeris] = []
    for record in _records(text, header, SYSTEM_OF_KIND[kind], problems):
        values = numbers(record.lines, header.version)
        found = _ionosphere(record, values) if record.ionosphere else _ephemeris(record, values, header.version)
        match found:
            case str():
                problems[found] += 1
            case Klobuchar():
                klobuchar = klobuchar or found
            case GalileoIonosphere():
                galileo_ionosphere = galileo_ionosphere or found
            case KeplerEphemeris(message="FNAV"):
                fnav_ephemerides.append(found)
            case _:
                ephemerides.append(found)
    if text.cut:
        problems["file cut off"] += 1
    return NavigationFile(
        path=text.path,
        version=header.version,
        ephemerides=tuple(ephemerides),
        klobuchar=klobuchar,
        leap_seconds=_leap_seconds(header, problems),
        problems=dict(problems),
        fnav_ephemerides=tuple(fnav_ephemerides),
        galileo_ionosphere=galileo_ionosphere,
    )


def _kind(line: str) -> str:
    """The kind of navigation file that a first line names; `N`, whose errors say what is wrong, where it names none."""
    kind = line[20:21].upper()
    return kind if kind in SYSTEM_OF_KIND and line[60:80].strip() == "RINEX VERSION / TYPE" else "N"


def _leap_seconds(header: Header, problems: Counter[str]) -> int | None:
    """GPS - UTC as the header says; files of BeiDou alone count from the beginning of its time. RINEX 3.04, table A5."""
    leap_s, line = header.leap_seconds(problems), header.first("LEAP SECONDS")
    of_beidou = line is not None and (header.system == "C" or line.content[24:27] == "BDS")
    return leap_s + BDT_BEHIND_GPS_NS // NS_PER_S if leap_s is not None and of_beidou else leap_s


def _klobuchar(header: Header, problems: Counter[str]) -> Klobuchar | None:
    if header.version < 3:
        alpha, beta = (header.numbers(label, range(2, 50, 12), problems) for label in ("ION ALPHA", "ION BETA"))
    else:
        alpha, beta = (_correction(header, name, range(5, 53, 12), problems) for name in ("GPSA", "GPSB"))
    return None if alpha is None or beta is None else _klobuchar_of((*alpha, *beta))


def _galileo_ionosphere(header: Header, problems: Counter[str]) -> GalileoIonosphere | None:
    values = _correction(header, "GAL ", range(5, 41, 12), problems) if header.version >= 3 else None
    return None if values is None else GalileoIonosphere(values[0], values[1], values[2], NOTHING_DISTURBED)


def _correction(header: Header, name: str, columns: range, problems: Counter[str]) -> tuple[float, ...] | None:
    """The first ionospheric correction of a name in a header of RINEX 3; None where missing, or unreadable (counted)."""
    line = next((line for line in header.lines if line.label == "IONOSPHERIC CORR" and line.content[:4] == name), None)
    if line is None:
        return None
    values = reals(line.content, columns)
    if values is None:
        problems[f"IONOSPHERIC CORR {name.strip()} not readable"] += 1
    return values


def _klobuchar_of(values: Sequence[float]) -> Klobuchar:
    """From alpha0 to alpha3, beta0 to beta3."""
    return Klobuchar(alpha=(values[0], values[1], values[2], values[3]), beta=(values[4], values[5], values[6], values[7]))


def _ionosphere(record: _Record, values: Sequence[float] | None) -> Klobuchar | GalileoIonosphere | str:
    """Of an ION record of RINEX 4, or why there is none."""
    needed = 8 if record.satellite[0] == "G" else 3
    if values is None or len(values) < needed or any(math.isnan(v) for v in values[:needed]):
        return "ionosphere not readable"
    if record.satellite[0] == "G":
        return _klobuchar_of(values)
    flags = values[3] if len(values) > 3 else math.nan
    return GalileoIonosphere(values[0], values[1], values[2], int(flags) if 0.0 <= flags < 32.0 else NOTHING_DISTURBED)


def _ephemeris(record: _Record, values: Sequence[float] | None, version: float) -> Ephemeris | str:
    """The ephemeris in a record, or why there is none."""
    at_ns = epoch_ns(record.lines[0], version)
    if at_ns is None:
        return "epoch not readable"
    if values is None:
        return "field not a number"
    match record.satellite[0]:
        case "R":
            found: Ephemeris | str = glonass_of(record.satellite, at_ns, values)
        case "S":
            found = geo_of(record.satellite, at_ns, values)
        case _:
            found = kepler_of(record.satellite, record.message, at_ns, values)
    return found if isinstance(found, str) else found.implausibility() or found


def _records(text: RinexText, header: Header, system_2: str, problems: Counter[str]) -> Iterator[_Record]:
    """The records of systems and messages that we read, each with as many lines as it should have."""
    version, lines = header.version, text.lines[header.body :]
    for record in _found_4(lines, problems) if version >= 4 else _found(lines, version, system_2, problems):
        if record.ionosphere:
            yield record._replace(lines=_written(record.lines))
            continue
        system = record.satellite[0]
        expected = GLONASS_LINES if system == "R" and version >= 3.05 else LINES.get(system, KEPLER_LINES)
        found = _written(record.lines)
        if expected == GLONASS_LINES and len(found) == expected - 1 and not "".join(record.lines[expected - 1 : expected]).strip():
            found += record.lines[expected - 1 : expected]  # nothing in this line need be known
        surplus = found[expected : expected + 1]
        if surplus:
            problems["record longer than it should be"] += 1
        if len(found) < expected:
            problems["record cut off"] += 1
        elif not surplus or surplus[0][:3].strip():  # else one more data line: it cannot be told which one is too many
            yield record._replace(lines=found[:expected])


def _written(lines: Sequence[str]) -> list[str]:
    """Lines that are not blank: some files have blank ones between the others, or at their end."""
    return [line for line in lines if line.strip()]


def _found(lines: Sequence[str], version: float, system_2: str, problems: Counter[str]) -> Iterator[_Record]:
    """The records of RINEX 2, all of one system, and 3."""
    starts = [k for k, line in enumerate(lines) if begins_record(line, version)]
    _count_lines_before(lines[: starts[0] if starts else None], problems)
    for start, stop in pairwise([*starts, len(lines)]):
        name = system_2 + lines[start][:2] if version < 3 else lines[start][:3]
        if name[0] in SYSTEMS:
            yield _Record(name.replace(" ", "0"), None, lines[start:stop])
        else:
            problems[f"system {name[0]}, not used"] += 1


def _count_lines_before(lines: Sequence[str], problems: Counter[str]) -> None:
    """Of the first record."""
    if outside := len(_written(lines)):
        problems["line outside a record"] += outside


def _found_4(lines: Sequence[str], problems: Counter[str]) -> Iterator[_Record]:
    """The records of RINEX 4, each under a line that says what it is."""
    starts = [k for k, line in enumerate(lines) if line[:1] == ">"]
    _count_lines_before(lines[: starts[0] if starts else None], problems)
    for start, stop in pairwise([*starts, len(lines)]):
        head, body = _HEAD_4.fullmatch(lines[start].rstrip()), lines[start + 1 : stop]
        if head is None:
            problems["head of a record not readable"] += 1
            continue
        kind, satellite, message = head.groups()
        system = satellite[0]
        if kind == "ION" and (system, message) in IONOSPHERES:
            yield _Record(satellite, message, body, ionosphere=True)
        elif kind != "EPH" or message not in MESSAGES.get(system, ()):
            problems[f"{kind} {message} of system {system}, not used"] += 1
        elif not body or not begins_record(body[0], 4.0) or body[0][:3].replace(" ", "0") != satellite:
            problems["record differs from its head"] += 1
        else:
            yield _Record(satellite, message, body)
