"""Changed measurements written back into the MSM messages that they came from, kinds 4 to 7; each message stays of its kind.

Numbers are shifted by what has changed, in units of the message: what has not changed keeps its bits, and what cannot be named (reserved
satellites and signals) stays. Ranges and carriers of a satellite are told as a rough range and what each signal adds to it: the rough one
moves where what is added would not fit any more. Source of the layout: RTCM 10403.3, as of `integrity.gnss.rtcm.msm`.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from integrity.errors import ConfigError
from integrity.gnss.constants import SPEED_OF_LIGHT_MPS
from integrity.gnss.gps_time import DAY_S, WEEK_S
from integrity.gnss.navigation.bits import Layout
from integrity.gnss.observations import Floats, ObservationRow
from integrity.gnss.rtcm.masks import SATELLITE_BITS, SIGNAL_BITS, bits_of, places_of
from integrity.gnss.rtcm.measurements import LEAST_LOCK_S
from integrity.gnss.rtcm.msm import (
    CELL_FIELDS,
    FINE_RATE,
    HEADER,
    NO_CN0,
    NO_WHOLE_MS,
    RATE,
    SATELLITE_FIELDS,
    header_of,
    none_of,
    table_of,
)
from integrity.gnss.rtcm.msm_writer import encode_msm

LIGHT_MS_M = SPEED_OF_LIGHT_MPS / 1000.0
ROUGH_PER_MS = 1024  # of DF398
FINE_RATES = 10_000  # of DF404 in 1 m/s
GLONASS_MS_BITS = 27
LAYOUT_OF_HEADER = tuple(name for name, _ in HEADER if name not in ("number", "satellites", "signals"))

Numbers = dict[str, int]
Place = tuple[int, int]  # bits of satellite and signal


@dataclass
class _Msm:
    """A message as numbers: by name those of its header, by bit those of its satellites, by both bits those of its cells."""

    number: int
    header: Numbers
    satellites: dict[int, Numbers]
    cells: dict[Place, Numbers]
    rest: bytes  # behind all that is known

    @property
    def kind(self) -> int:
        """4 to 7."""
        return self.number % 10

    def of_satellite(self, bit: int) -> dict[Place, Numbers]:
        """The cells of one satellite."""
        return {place: cell for place, cell in self.cells.items() if place[0] == bit}


class _Delta:
    """What has become of one signal: metres and metres per second, NaN where nothing can be said; lock and C/N0, None where as before."""

    def __init__(self, was: ObservationRow, before: int, now: ObservationRow, after: int, wavelength_m: float) -> None:
        self.range_m = float(now.pseudorange_m[after] - was.pseudorange_m[before])
        self.phase_m = float(now.carrier_cycles[after] - was.carrier_cycles[before]) * wavelength_m
        self.rate_mps = -float(now.doppler_hz[after] - was.doppler_hz[before]) * wavelength_m
        self.cn0_dbhz = _news(was.cn0_dbhz[before], now.cn0_dbhz[after])
        self.lock_s = _news(was.lock_s[before], now.lock_s[after])

    @property
    def anything(self) -> bool:
        """Whether anything has changed that can be written."""
        shifted = any(np.isfinite(x) and x != 0.0 for x in (self.range_m, self.phase_m, self.rate_mps))
        return shifted or self.cn0_dbhz is not None or self.lock_s is not None


def _news(was: float, now: float) -> float | None:
    return float(now) if np.isfinite(now) and now != was else None


def rewritten_msm(message: bytes, was: ObservationRow, now: ObservationRow, wavelengths_m: Floats) -> bytes:
    """The message with its measurements as they are `now`, where it is one of those that decode to `was`; `wavelengths_m` are those by
    which the carriers of `was` were changed.

    ConfigError where a number does not fit the message.
    """
    header = header_of(message)
    assert header is not None
    shift_ms = round((now.receive_time_ns - was.receive_time_ns) / 1e6)
    after = {signal: i for i, signal in enumerate(now.signals)}
    before = {signal: i for i, signal in enumerate(was.signals)}
    mine = [signal for signal in header.signals if signal in before]
    lost = {places_of(signal) for signal in mine if signal not in after}
    deltas: dict[Place, _Delta] = {}
    for signal in mine:
        place = places_of(signal)
        if place is not None and signal in after:
            delta = _Delta(was, before[signal], now, after[signal], float(wavelengths_m[before[signal]]))
            if delta.anything:
                deltas[place] = delta
    if not (lost or deltas or shift_ms):
        return message
    msm = _read(message)
    msm.header["time"] = _later(msm.header["time"], shift_ms, header.system)
    names = {places_of(signal): signal for signal in mine}
    for bit in sorted({satellite for satellite, _ in deltas}):
        _change_satellite(msm, bit, {place: delta for place, delta in deltas.items() if place[0] == bit}, names)
    msm.cells = {place: cell for place, cell in msm.cells.items() if place not in lost}
    tracked = {satellite for satellite, _ in msm.cells}
    gone = {place[0] for place in lost if place is not None} - tracked
    msm.satellites = {bit: numbers for bit, numbers in msm.satellites.items() if bit not in gone}
    return _written(msm)


@lru_cache(maxsize=64)
def _table(number: int, n_satellites: int, n_signals: int, n_cells: int) -> Layout:
    return table_of(number, n_satellites, n_signals, n_cells)


def _read(message: bytes) -> _Msm:
    bits = int.from_bytes(message, "big")
    number = message[0] << 4 | message[1] >> 4
    kind, head = number % 10, _table(number, 0, 0, 0)
    first = bits >> 8 * len(message) - head.bits
    satellites = bits_of(head.integer(first, "satellites"), SATELLITE_BITS)
    signals = bits_of(head.integer(first, "signals"), SIGNAL_BITS)
    pairs = [(satellite, signal) for satellite in satellites for signal in signals]
    n_head = head.bits + len(pairs)
    mask = bits >> 8 * len(message) - n_head & (1 << len(pairs)) - 1
    cells = [pairs[bit - 1] for bit in bits_of(mask, len(pairs))]
    table = _table(number, len(satellites), len(signals), len(cells))
    whole, size = bits >> 8 * len(message) - table.bits, (table.bits + 7) // 8
    return _Msm(
        number,
        {name: table.integer(whole, name) for name in LAYOUT_OF_HEADER},
        {bit: {name: table.integer(whole, f"{name}_{i}") for name, _ in SATELLITE_FIELDS[kind]} for i, bit in enumerate(satellites)},
        {place: {name: table.integer(whole, f"{name}_{i}") for name, _ in CELL_FIELDS[kind]} for i, place in enumerate(cells)},
        message[size:],
    )


def _written(msm: _Msm) -> bytes:
    units = {name: field.unit or 1 for name, field in (*SATELLITE_FIELDS[msm.kind], *CELL_FIELDS[msm.kind])}

    def told(numbers: Mapping[str, int]) -> dict[str, float]:
        return {name: number * units[name] for name, number in numbers.items()}

    satellites = {bit: told(numbers) for bit, numbers in msm.satellites.items()}
    return encode_msm(msm.number, msm.header, satellites, {place: told(cell) for place, cell in msm.cells.items()}) + msm.rest


def _later(time: int, shift_ms: int, system: str) -> int:
    """The time of a header so many ms later; of GLONASS a day of the week (7: not told) and ms of the day, of the others ms of the week."""
    if system != "R":
        return (time + shift_ms) % (WEEK_S * 1000)
    days, ms = divmod((time & (1 << GLONASS_MS_BITS) - 1) + shift_ms, DAY_S * 1000)
    day = time >> GLONASS_MS_BITS
    return (day if day == 7 else (day + days) % 7) << GLONASS_MS_BITS | ms


def _change_satellite(msm: _Msm, bit: int, deltas: Mapping[Place, _Delta], names: Mapping[Place | None, str]) -> None:
    """Write the changes of one satellite's cells; all its others stand on the same rough range and rate."""
    satellite, cells = msm.satellites[bit], msm.of_satellite(bit)
    units = {name: field.unit or 1.0 for name, field in CELL_FIELDS[msm.kind]}
    for place, delta in deltas.items():
        cell = cells[place]
        if delta.cn0_dbhz is not None:
            most = (1 << dict(CELL_FIELDS[msm.kind])["cn0_dbhz"].bits) - 1
            cell["cn0_dbhz"] = min(max(NO_CN0 + 1, round(delta.cn0_dbhz / units["cn0_dbhz"])), most)
        if delta.lock_s is not None:
            cell["lock"] = max(0, int(np.searchsorted(LEAST_LOCK_S[msm.kind], delta.lock_s, "right")) - 1)
    if satellite["whole_ms"] != NO_WHOLE_MS:
        rough = satellite["whole_ms"] * ROUGH_PER_MS + satellite["part_ms"]
        sums = {
            "range_ms": _sums(msm, "range_ms", cells, rough, {place: delta.range_m for place, delta in deltas.items()}),
            "phase_ms": _sums(msm, "phase_ms", cells, rough, {place: delta.phase_m for place, delta in deltas.items()}),
        }
        rough = _rough(msm, rough, sums)
        if not 0 <= rough < NO_WHOLE_MS * ROUGH_PER_MS:
            raise _unfit(msm, names, next(iter(deltas)), f"a range of {rough / ROUGH_PER_MS * LIGHT_MS_M:.0f} m", "0 to 76,000 km")
        satellite["whole_ms"], satellite["part_ms"] = divmod(rough, ROUGH_PER_MS)
        for name, of_cells in sums.items():
            for place, total in of_cells.items():
                cells[place][name] = _added(msm, name, total - rough * _steps(msm, name), place, names)
    if "fine_rate_mps" in units and satellite["rate_mps"] != none_of(RATE[1]):
        _change_rates(msm, satellite, cells, deltas, names)


def _steps(msm: _Msm, name: str) -> int:
    """Units of a fine range in one of the rough range."""
    return round(1.0 / (ROUGH_PER_MS * (dict(CELL_FIELDS[msm.kind])[name].unit or 1.0)))


def _sums(msm: _Msm, name: str, cells: Mapping[Place, Numbers], rough: int, shift_m: Mapping[Place, float]) -> dict[Place, int]:
    """Rough and fine range together, in units of the fine one, of the cells that tell one, with what is known of their shifts."""
    field = dict(CELL_FIELDS[msm.kind])[name]
    unit_m = (field.unit or 1.0) * LIGHT_MS_M
    sums = {place: rough * _steps(msm, name) + cell[name] for place, cell in cells.items() if cell[name] != none_of(field)}
    for place, more_m in shift_m.items():
        if place in sums and np.isfinite(more_m):
            sums[place] += round(more_m / unit_m)
    return sums


def _rough(msm: _Msm, rough: int, sums: Mapping[str, Mapping[Place, int]]) -> int:
    """The rough range as it was, or in the middle of the ranges where one of these is out of its reach."""
    if all(_fits(msm, name, total - rough * _steps(msm, name)) for name, of_cells in sums.items() for total in of_cells.values()):
        return rough
    name = "range_ms" if sums["range_ms"] else "phase_ms"
    totals = sums[name].values()
    return round((min(totals) + max(totals)) / 2 / _steps(msm, name))


def _fits(msm: _Msm, name: str, number: int) -> bool:
    """None of them may be the number that says that nothing was told."""
    return abs(number) < -none_of(dict(CELL_FIELDS[msm.kind])[name])


def _added(msm: _Msm, name: str, number: int, place: Place, names: Mapping[Place | None, str]) -> int:
    if _fits(msm, name, number):
        return number
    field = dict(CELL_FIELDS[msm.kind])[name]
    unit_m = (field.unit or 1.0) * LIGHT_MS_M
    what = "range" if name == "range_ms" else "carrier"
    raise _unfit(msm, names, place, f"a {what} {number * unit_m:.1f} m from the rough range", f"at most {-none_of(field) * unit_m:.1f} m")


def _change_rates(
    msm: _Msm, satellite: Numbers, cells: Mapping[Place, Numbers], deltas: Mapping[Place, _Delta], names: Mapping[Place | None, str]
) -> None:
    """Rough rates are whole metres per second, what a cell adds 0.1 mm/s."""
    none = none_of(FINE_RATE[1])
    sums = {
        place: satellite["rate_mps"] * FINE_RATES + cell["fine_rate_mps"] for place, cell in cells.items() if cell["fine_rate_mps"] != none
    }
    for place, delta in deltas.items():
        if place in sums and np.isfinite(delta.rate_mps):
            sums[place] += round(delta.rate_mps * FINE_RATES)
    rough = satellite["rate_mps"]
    if not all(_fits(msm, "fine_rate_mps", total - rough * FINE_RATES) for total in sums.values()):
        rough = round((min(sums.values()) + max(sums.values())) / 2 / FINE_RATES)
    most = -none_of(RATE[1]) - 1
    for place, total in sums.items():
        if abs(rough) > most or not _fits(msm, "fine_rate_mps", total - rough * FINE_RATES):
            raise _unfit(msm, names, place, f"a rate of {total / FINE_RATES:.1f} m/s", f"at most {most} m/s, and 1.6 m/s between signals")
        cells[place]["fine_rate_mps"] = total - rough * FINE_RATES
    satellite["rate_mps"] = rough


def _unfit(msm: _Msm, names: Mapping[Place | None, str], place: Place, what: str, room: str) -> ConfigError:
    return ConfigError(
        f"{names.get(place, 'a satellite')} cannot be told in RTCM message {msm.number}: {what} does not fit, which has room for {room}; "
        "make the fault smaller or shorter"
    )
