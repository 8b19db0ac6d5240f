"""Observation files: RINEX 2.10 to 2.12 and 3.00 to 3.05 (4.0x is written like 3), of which L1 and E1 of GPS and Galileo are read.

A damaged file gives what in it is beyond doubt: numbers must stand in their columns (F14.3), a RINEX 2 epoch must have as many lines
as it says, since there only the count tells which satellite a line belongs to. Whatever is dropped is counted.
Source: RINEX 2.11, section 5 and tables A1, A2; RINEX 3.05, section 6 and tables A2, A3.
"""

import math
import re
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np

from integrity.gnss.observations import ObservationRow
from integrity.gnss.signals import FIRST_CODES
from recordings.rinex.text import Header, HeaderLine, RinexText, broken, calendar_ns, header_lines, read_header, read_text, real

VERSIONS = ((2.10, 2.12), (3.00, 3.05), (4.00, 4.02))

# From 20,200 km (GPS in the zenith) to 29,000 km (Galileo at the horizon), with a receiver clock of up to 30 ms either way.
PSEUDORANGE_MIN_M, PSEUDORANGE_MAX_M = 1.0e7, 1.0e8
CN0_MAX_DBHZ = 70.0  # the strongest signals from orbit stay below 60 dB-Hz

RINEX2_TYPES = {"1C": ("C1", "L1", "D1", "S1")}  # RINEX 2 does not say of which code L1, D1 and S1 are
GPS_SCALES = ("GPS", "GAL")  # Galileo's weeks are counted in RINEX as those of GPS are
SCALE_OF_SYSTEM = {"R": "GLO", "C": "BDT"}  # where TIME OF FIRST OBS does not say

_TIME = r" ([ \d]\d) ([ \d]\d) ([ \d]\d) ([ \d]\d)([ \d]{3})\.(\d{7})"
_FLAG_AND_COUNT = r"  ([0-6])(  \d| \d\d|\d{3})"
_TYPE = re.compile(r"[A-Z]\d[A-Z]?", re.ASCII)
_EPOCH_2 = re.compile(rf"(?: ([ \d]\d){_TIME}| {{26}}){_FLAG_AND_COUNT}", re.ASCII)
_EPOCH_3 = re.compile(rf">(?: (\d{{4}}){_TIME}| {{28}}){_FLAG_AND_COUNT}", re.ASCII)
_FIELD = re.compile(r" *-?\d*\.\d{3}", re.ASCII)
_SATELLITE = re.compile(r"[A-Z ](?:[ 0][1-9]|[1-9]\d)", re.ASCII)

_ABSENT = 1_000_000  # a column beyond the end of every line: reads as blank
_LOST_LOCK, _HALF_CYCLE = frozenset("1357"), frozenset("2367")  # bits 0 and 1 of the loss-of-lock indicator


@dataclass(frozen=True)
class ObservationFile:
    """An observation file as read: `rows` in file order, repeated and backward epochs included; `problems` counts what was dropped.

    `interval_s`, `leap_seconds` and `approx_position_ecef_m` are what the header says, None where it does not.
    """

    path: str
    version: float
    marker: str
    interval_s: float | None
    leap_seconds: int | None
    approx_position_ecef_m: tuple[float, float, float] | None
    rows: tuple[ObservationRow, ...]
    problems: dict[str, int]


class _Columns(NamedTuple):
    """Where a satellite's record has the quantities of one signal."""

    code: str
    pseudorange: int
    carrier: int
    doppler: int
    cn0: int


_Layout = Mapping[str, Sequence[_Columns]]  # by system letter


def read_observations(path: Path, receiver: str) -> ObservationFile:
    """Read an observation file, plain or gzipped; its rows get the name `receiver`.

    Ranges in metres, carrier in cycles, Doppler in hertz, C/N0 in dB-Hz (from S observations; the one-digit signal strength is not
    C/N0). Blank and 0.0 are "not measured". Times are the receiver's own; the clock offset of an epoch line is not applied.
    DecodeError where nothing can be read safely, OSError where the file cannot be opened.
    """
    text = read_text(path)
    header = read_header(text, "O", VERSIONS)
    _require_gps_scale(text, header)
    types = _observation_types(text, header.lines, header.version)
    if not any(types.values()):
        raise broken(text.path, header.body, "no observation types", "at least one, such as C1 or C1C", "fetch or convert the file again")
    problems: Counter[str] = Counter()
    rows = _read_rows(text, header, types, receiver, problems)
    if text.cut:
        problems["file cut off"] += 1
    marker = header.first("MARKER NAME")
    interval_s = header.numbers("INTERVAL", range(0, 10, 10), problems)
    xyz = header.numbers("APPROX POSITION XYZ", range(0, 42, 14), problems)
    return ObservationFile(
        path=text.path,
        version=header.version,
        marker=marker.content.strip() if marker else "",
        interval_s=interval_s[0] if interval_s and interval_s[0] > 0.0 else None,
        leap_seconds=header.leap_seconds(problems),
        approx_position_ecef_m=(xyz[0], xyz[1], xyz[2]) if xyz and any(xyz) else None,
        rows=tuple(rows),
        problems=dict(problems),
    )


def _require_gps_scale(text: RinexText, header: Header) -> None:
    line = header.first("TIME OF FIRST OBS")
    scale = (line.content[48:51].strip() if line else "") or SCALE_OF_SYSTEM.get(header.system, "GPS")
    if scale not in GPS_SCALES:
        number = line.number if line else 1
        raise broken(text.path, number, f"time system {scale}", "GPS or GAL", "convert the file to GPS time")


def _observation_types(text: RinexText, lines: Iterable[HeaderLine], version: float) -> dict[str, list[str]]:
    """Observation types by system letter, in RINEX 2 under the empty one."""
    types: dict[str, list[str]] = {}
    promised: dict[str, tuple[str, int]] = {}
    system = ""
    for number, label, content in lines:
        if label == "SYS / SCALE FACTOR" and content[0] in "GE" and content[2:6].strip() not in ("", "1"):
            found = f"scale factor {content[2:6].strip()}"
            raise broken(text.path, number, found, "observations stored unscaled", "convert the file to one without scale factors")
        if label != ("# / TYPES OF OBSERV" if version < 3 else "SYS / # / OBS TYPES"):
            continue
        count = content[:6].strip() if version < 3 else content[3:6].strip()
        if count:
            system = "" if version < 3 else content[0]
            types[system], promised[system] = [], (count, number)
        names = content[6:].split()
        wrong = [name for name in names if not _TYPE.fullmatch(name)]
        if wrong:
            found = f"observation type {wrong[0]!r}"
            raise broken(text.path, number, found, "names like C1 or C1C", "fetch or convert the file again")
        types.setdefault(system, []).extend(names)
    for system, codes in types.items():
        count, number = promised.get(system, ("none", 1))
        if real(count) != len(codes):
            found = f"{len(codes)} observation types {system}".rstrip()
            raise broken(text.path, number, found, f"{count} of them, as the line says", "fetch or convert the file again")
    return types


def _layout(types: Mapping[str, Sequence[str]], version: float) -> _Layout:
    """Columns of the L1 and E1 signals in a satellite's record, RINEX 2 continuation lines joined at 80 columns."""
    layout: dict[str, list[_Columns]] = {}
    for system in "GE":
        start, listed = (0, types[""]) if version < 3 else (3, types.get(system, ()))
        column_of = {name: start + 16 * k for k, name in enumerate(listed)}
        for code in FIRST_CODES[system]:
            names = RINEX2_TYPES.get(code) if version < 3 else tuple(kind + code for kind in "CLDS")
            if names and names[0] in column_of:
                layout.setdefault(system, []).append(_Columns(code, *(column_of.get(name, _ABSENT) for name in names)))
    return layout


def _read_rows(text: RinexText, header: Header, types: dict[str, list[str]], receiver: str, problems: Counter[str]) -> list[ObservationRow]:
    lines, rinex2, at = text.lines, header.version < 3, header.body
    epoch_line = _EPOCH_2 if rinex2 else _EPOCH_3
    default_system = "G" if header.system in (" ", "M") else header.system  # of RINEX 2 satellites without a letter
    layout, rows = _layout(types, header.version), []

    def next_epoch(start: int) -> int:
        return next((k for k in range(start, len(lines)) if epoch_line.match(lines[k])), len(lines))

    while at < len(lines):
        match = epoch_line.match(lines[at])
        if match is None:
            if lines[at].strip():
                problems["epoch line not readable"] += 1
            at = next_epoch(at + 1)
            continue
        flag, count = match[8], int(match[9])
        special = flag in "2345"  # special records, `count` of them; in flag 4 they are header lines
        listing_lines = 1 if special or not rinex2 else max(1, -(-count // 12))
        lines_each = 1 if special or not rinex2 else max(1, -(-len(types[""]) // 5))
        first = at + listing_lines
        stop = first + count * lines_each
        reached = min(next_epoch(at + 1), stop)
        if reached < stop:
            problems["epoch cut off"] += 1
            at = reached
            continue
        if flag == "4":
            types = types | _observation_types(text, header_lines(text, first, stop), header.version)
            layout = _layout(types, header.version)
        if special or flag == "6":
            at = stop
            continue
        if rinex2 and stop < len(lines) and "." in lines[stop][10::16]:
            problems["epoch longer than it says"] += 1  # one more data line: it cannot be told which one is too many
            at = next_epoch(stop)
            continue
        time_ns = calendar_ns(match.groups()[:6], int(match[7]) * 100) if match[1] else None
        records = _records(lines, at, first, stop, lines_each, rinex2)
        if time_ns is None:
            problems["epoch time not readable"] += 1
        elif records is None:
            problems["satellite list not readable"] += 1
        else:
            rows.append(_row(receiver, time_ns, records, default_system, layout, flag == "1", problems))
        at = stop
    return rows


def _records(lines: Sequence[str], at: int, first: int, stop: int, lines_each: int, rinex2: bool) -> list[tuple[str, str]] | None:
    """Name (three columns) and record of each satellite of the epoch whose line is `at` and whose records are `first` to `stop`.

    None where the list of a RINEX 2 epoch has a name that cannot be read, too few or too many: then no record is sure to be whose.
    """
    if not rinex2:
        return [(line[:3], line) for line in lines[first:stop]]
    listed = "".join(line[32:68].ljust(36) for line in lines[at:first]).rstrip()
    names = [listed[k : k + 3] for k in range(0, len(listed), 3)]
    records = ["".join(line[:80].ljust(80) for line in lines[k : k + lines_each]) for k in range(first, stop, lines_each)]
    if len(names) != len(records) or not all(map(_SATELLITE.fullmatch, names)):
        return None
    return list(zip(names, records, strict=True))


def _row(
    receiver: str,
    time_ns: int,
    records: Iterable[tuple[str, str]],
    default_system: str,
    layout: _Layout,
    power_failed: bool,
    problems: Counter[str],
) -> ObservationRow:
    """One epoch from its satellites' names and records."""
    signals: list[str] = []
    numbers: list[tuple[float, float, float, float]] = []
    lock_indicators: list[str] = []
    seen: set[str] = set()
    for name, record in records:
        if not _SATELLITE.fullmatch(name):
            problems["satellite name not readable"] += 1
            continue
        satellite = name.replace(" ", "0") if name[0] != " " else default_system + name[1:].replace(" ", "0")
        if satellite[0] not in layout:
            continue
        if satellite in seen:
            problems["satellite listed twice"] += 1
            continue
        seen.add(satellite)
        for columns in layout[satellite[0]]:
            pseudorange_m = _field(record, columns.pseudorange, problems)
            if math.isnan(pseudorange_m):
                continue
            if not PSEUDORANGE_MIN_M <= pseudorange_m <= PSEUDORANGE_MAX_M:
                problems["absurd pseudorange"] += 1
                continue
            carrier_cycles = _field(record, columns.carrier, problems)
            doppler_hz = _field(record, columns.doppler, problems)
            cn0_dbhz = _field(record, columns.cn0, problems)
            if cn0_dbhz < 0.0 or cn0_dbhz > CN0_MAX_DBHZ:
                problems["absurd C/N0"] += 1
                cn0_dbhz = math.nan
            signals.append(f"{satellite}.{columns.code}")
            numbers.append((pseudorange_m, carrier_cycles, doppler_hz, cn0_dbhz))
            lock_indicators.append(record[columns.carrier + 14 : columns.carrier + 15])
    table = np.array(numbers, dtype=np.float64).reshape(-1, 4).T.copy()
    return ObservationRow(
        receiver=receiver,
        receive_time_ns=time_ns,
        signals=tuple(signals),
        pseudorange_m=table[0],
        carrier_cycles=table[1],
        doppler_hz=table[2],
        cn0_dbhz=table[3],
        lock_s=np.full(len(signals), np.nan),
        slip=np.array([power_failed or lli in _LOST_LOCK for lli in lock_indicators], dtype=np.bool_),
        half_cycle=np.array([lli in _HALF_CYCLE for lli in lock_indicators], dtype=np.bool_),
    )


def _field(record: str, column: int, problems: Counter[str]) -> float:
    """A number F14.3 of a record; NaN for blank and 0.0 (not measured), and for anything else, which is counted.

    A number that is short of its 14 columns or out of place was cut or shifted: its digits may look right and be wrong.
    """
    text = record[column : column + 14]
    if not text or text.isspace():
        return math.nan
    if len(text) != 14 or not _FIELD.fullmatch(text):
        problems["field not a number"] += 1
        return math.nan
    return float(text) or math.nan
