"""What the header of an observation file says of its records: observation types, scale factors, time system, GLONASS channels.

Which RINEX 3 code an observation type of RINEX 2 is. Where RINEX 2.11 (section 10.1.1) says it, that: C1 is C/A, P1 and P2 of GPS are
the precise code (W: no civil receiver tracks P or Y itself), those of GLONASS P, C2 of GLONASS C/A. Where it says the band only, the
combination of its components (X): L2C (C2 of GPS), and all of Galileo but E1, which is read as 1C, as nearly every receiver has it.
L, D and S of a band belong to C/A on the first and to the precise code on the second, to the other one where the file has no range of
that. BeiDou and QZSS are in no RINEX 2 document; converters write them as later versions number the bands, B1I as 1 or as 2.
Sources: RINEX 2.11, section 5.1 and tables A1, A2; RINEX 3.05, section 6 and tables A2, A3; RINEX 3.02, table A2.
"""

import re
from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from integrity.gnss.gps_time import BDT_BEHIND_GPS_NS, GPS_EPOCH_UNIX_S, NS_PER_S, gps_from_calendar, gps_from_utc
from integrity.gnss.observations import Floats, Ints
from integrity.gnss.signals import SYSTEMS
from recordings.rinex.text import Header, HeaderLine, broken, real

# Codes of a band by type of range, in RINEX 2: the first that the file has takes L, D and S of the band.
RINEX2_CODES: Mapping[str, Mapping[str, Mapping[str, str]]] = {
    "G": {"1": {"C1": "1C", "P1": "1W"}, "2": {"P2": "2W", "C2": "2X"}, "5": {"C5": "5X"}},
    "R": {"1": {"C1": "1C", "P1": "1P"}, "2": {"P2": "2P", "C2": "2C"}},
    "E": {"1": {"C1": "1C"}, "5": {"C5": "5X"}, "6": {"C6": "6X"}, "7": {"C7": "7X"}, "8": {"C8": "8X"}},
    "S": {"1": {"C1": "1C"}, "5": {"C5": "5I"}},
    "J": {"1": {"C1": "1C"}, "2": {"C2": "2X"}, "5": {"C5": "5X"}, "6": {"C6": "6X"}},
    "C": {"2": {"C2": "2I"}, "1": {"C1": "2I"}, "6": {"C6": "6I"}, "7": {"C7": "7I"}},
}
ANOTHER = "?"  # system, none that is read
KINDS = "CLDS"
FACTORS = (1, 10, 100, 1000)
SCALE_OF_SYSTEM = {"R": "GLO", "C": "BDT"}  # where TIME OF FIRST OBS does not say
TIME_SCALES = ("GPS", "GAL", "QZS", "IRN", "GLO", "UTC", "BDT")  # weeks of the first four are counted in RINEX as those of GPS are
UTC_SCALES = ("GLO", "UTC")  # RINEX 3.05, section 8.1: time tags of GLONASS are UTC, not three hours ahead

_TYPE = re.compile(r"[A-Z]\d[A-Z]?", re.ASCII)
_SLOT = re.compile(r"R([ 0][1-9]|[1-9]\d) ( \d|-\d|\d\d) ?", re.ASCII)


class Columns(NamedTuple):
    """The signals of a system in a record of `n_types` fields: `codes` (C,), and of each where range, carrier, Doppler and C/N0 stand,
    `fields` (4, C); `n_types` where the file has no such field. `factors` (n_types,) to divide by, or None."""

    n_types: int
    codes: tuple[str, ...]
    fields: Ints
    factors: Floats | None


@dataclass(frozen=True)
class Format:
    """How epochs are written, until a header line in between changes it. `types` and `factors` are by system, in RINEX 2 by "".

    `first_system` is the letter of satellites that have none, or ANOTHER; `time_scale` one of TIME_SCALES.
    """

    version: float
    first_system: str
    time_scale: str
    types: Mapping[str, tuple[str, ...]]
    factors: Mapping[str, Mapping[str, int]]

    @property
    def rinex2(self) -> bool:
        """Whether records are those of RINEX 2: lists of satellites apart, at most five fields a line."""
        return self.version < 3

    @property
    def lines_each(self) -> int:
        """Lines of a satellite's record."""
        return max(1, -(-len(self.types[""]) // 5)) if self.rinex2 else 1

    def columns(self) -> dict[str, Columns]:
        """By letter of the systems that are read."""
        listed = {system: self.types.get("" if self.rinex2 else system, ()) for system in SYSTEMS}
        found = {system: _columns(self, system, types) for system, types in listed.items()}
        return {system: columns for system, columns in found.items() if columns.codes}

    def day_ns(self, year: int, month: int, day: int) -> int | None:
        """GPS time at which a day of the file's time scale begins; None for no day, and outside 1980 to 2079."""
        try:
            gps_ns = gps_from_calendar(year, month, day, 0, 0, 0)
        except ValueError:
            return None
        if not 1980 <= year < 2080:
            return None
        if self.time_scale in UTC_SCALES:
            return gps_from_utc(gps_ns + GPS_EPOCH_UNIX_S * NS_PER_S)
        return gps_ns + (BDT_BEHIND_GPS_NS if self.time_scale == "BDT" else 0)


def format_of(path: str, header: Header) -> Format:
    """How the epochs after a header are written; DecodeError where it does not say or cannot be right."""
    line = header.first("TIME OF FIRST OBS")
    scale = (line.content[48:51].strip() if line else "") or SCALE_OF_SYSTEM.get(header.system, "GPS")
    if scale not in TIME_SCALES:
        raise broken(path, line.number if line else 1, f"time system {scale}", " or ".join(TIME_SCALES), "convert the file to GPS time")
    first_system = "G" if header.system in (" ", "M") else header.system if header.system in SYSTEMS else ANOTHER
    found = changed(Format(header.version, first_system, scale, {}, {}), path, header.lines)
    if not any(found.types.values()):
        raise broken(path, header.body, "no observation types", "at least one, such as C1 or C1C", "fetch or convert the file again")
    return found


def changed(before: Format, path: str, lines: Iterable[HeaderLine]) -> Format:
    """The format after header lines; DecodeError for types or factors that cannot be right, since all that follows depends on them."""
    types: dict[str, list[str]] = {}
    promised: dict[str, tuple[str, int]] = {}
    factors = {system: dict(of) for system, of in before.factors.items()}
    system, scaled = "", ("", 1)
    for line in lines:
        if line.label == "SYS / SCALE FACTOR":
            scaled = _scaled(path, line, factors, scaled)
        if line.label != ("# / TYPES OF OBSERV" if before.rinex2 else "SYS / # / OBS TYPES"):
            continue
        count = line.content[:6].strip() if before.rinex2 else line.content[3:6].strip()
        if count:
            system = "" if before.rinex2 else line.content[0]
            types[system], promised[system] = [], (count, line.number)
        names = line.content[6:].split()
        wrong = [name for name in names if not _TYPE.fullmatch(name)]
        if wrong:
            found = f"observation type {wrong[0]!r}"
            raise broken(path, line.number, found, "names like C1 or C1C", "fetch or convert the file again")
        types.setdefault(system, []).extend(names)
    for system, names in types.items():
        count, number = promised.get(system, ("none", 1))
        if real(count) != len(names):
            found = f"{len(names)} observation types {system}".rstrip()
            raise broken(path, number, found, f"{count} of them, as the line says", "fetch or convert the file again")
    return replace(before, types=before.types | {system: tuple(names) for system, names in types.items()}, factors=factors)  # type: ignore[operator]


def glonass_channels(header: Header, problems: Counter[str]) -> dict[str, int]:
    """Frequency numbers by satellite, as far as the header says them (RINEX 3.05, table A2: GLONASS SLOT / FRQ #)."""
    channels: dict[str, int] = {}
    for line in header.lines:
        if line.label != "GLONASS SLOT / FRQ #":
            continue
        for k in range(4, 60, 7):
            text = line.content[k : k + 7]
            match = _SLOT.fullmatch(text)
            if match:
                channels["R" + match[1].replace(" ", "0")] = int(match[2])
            elif text.strip():
                problems["GLONASS SLOT / FRQ # not readable"] += 1
    return channels


def _scaled(path: str, line: HeaderLine, factors: dict[str, dict[str, int]], before: tuple[str, int]) -> tuple[str, int]:
    """Enter one line; the system and factor that a line after it continues. No types means all."""
    names = line.content[10:].split()
    if not line.content[:10].strip():
        system, factor = before
    else:
        system, written = line.content[0], line.content[2:6].strip()
        if written not in {str(factor) for factor in FACTORS}:
            found = f"scale factor {written!r}"
            raise broken(path, line.number, found, " or ".join(map(str, FACTORS)), "fetch or convert the file again")
        factor = int(written)
        names = names or [""]
    factors.setdefault(system, {}).update(dict.fromkeys(names, factor))
    return system, factor


def _columns(of: Format, system: str, types: tuple[str, ...]) -> Columns:
    place = {name: k for k, name in reversed(list(enumerate(types)))}
    signals = _rinex2_signals(system, place) if of.rinex2 else _rinex3_signals(of.version, system, place)
    absent = len(types)
    fields = [[place.get(name, absent) for name in names] for names in signals.values()]
    given = of.factors.get(system, {})
    factors = np.array([given.get(name, given.get("", 1)) for name in types], dtype=np.float64)
    scaled = bool((factors != 1.0).any())
    return Columns(absent, tuple(signals), np.array(fields, dtype=np.int64).reshape(-1, 4).T, factors if scaled else None)


def _rinex2_signals(system: str, place: Mapping[str, int]) -> dict[str, tuple[str, ...]]:
    """Names of the four types of each signal by its code; one that does not exist stands for none."""
    signals: dict[str, tuple[str, ...]] = {}
    for band, codes in RINEX2_CODES[system].items():
        with_range = [name for name in codes if name in place]
        for k, name in enumerate(with_range):
            signals.setdefault(codes[name], (name, *(kind + band if k == 0 else "" for kind in KINDS[1:])))
    return signals


def _rinex3_signals(version: float, system: str, place: Mapping[str, int]) -> dict[str, tuple[str, ...]]:
    signals: dict[str, tuple[str, ...]] = {}
    for written in (name[1:] for name in place if name[0] == "C" and len(name) == 3):
        code = written
        if system == "C" and (written in ("1I", "1Q") or (written == "1X" and version == 3.02)):  # B1, before 3.03 made 1 of it B1C
            code = "2" + written[1]
        if code == written or "C" + code not in place:
            signals[code] = tuple(kind + written for kind in KINDS)
    return signals
