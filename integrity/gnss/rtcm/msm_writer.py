"""MSM messages from measurements, by the tables that read them: for tests and for a caster."""

from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from integrity.gnss.constants import SPEED_OF_LIGHT_MPS
from integrity.gnss.gps_time import BDT_BEHIND_GPS_NS, DAY_S, GLONASS_AHEAD_OF_UTC_NS, NS_PER_S, WEEK_NS, utc_from_gps
from integrity.gnss.navigation.bits import Field
from integrity.gnss.observations import ObservationRow
from integrity.gnss.rtcm.masks import NUMBER_OF, SATELLITE_BITS, SIGNAL_BITS, places_of
from integrity.gnss.rtcm.measurements import LEAST_LOCK_S
from integrity.gnss.rtcm.msm import (
    CELL_FIELDS,
    FIRST_CHANNEL,
    MOST_CELL_BITS,
    NO_CHANNEL,
    NO_CN0,
    NO_WHOLE_MS,
    SATELLITE_FIELDS,
    none_of,
    table_of,
)
from integrity.gnss.signals import bands_of, carrier_hz

LIGHT_MS_M = SPEED_OF_LIGHT_MPS / 1000.0
ROUGH_MS = 2.0**-10
Values = Mapping[str, float | None]


def encode_msm(number: int, header: Mapping[str, int], satellites: Mapping[int, Values], cells: Mapping[tuple[int, int], Values]) -> bytes:
    """A message from the fields of its satellites, by bit in the mask, and of its cells, by satellite and signal bit, in their units.

    None: could not be told; of `header` and of the fields what is not given is zero. ValueError where a value or the mask does not fit.
    """
    signals = sorted({signal for _, signal in cells})
    pairs = [(satellite, signal) for satellite in sorted(satellites) for signal in signals]
    if len(pairs) > MOST_CELL_BITS:
        raise ValueError(f"{len(satellites)} satellites with {len(signals)} signals: a cell mask has {MOST_CELL_BITS} bits; split them")
    told = [pair for pair in pairs if pair in cells]
    values: dict[str, float] = {
        "number": number,
        **header,
        "satellites": sum(1 << SATELLITE_BITS - bit for bit in satellites),
        "signals": sum(1 << SIGNAL_BITS - bit for bit in signals),
        "cells": sum(1 << len(pairs) - 1 - i for i, pair in enumerate(pairs) if pair in cells),
    }
    for i, satellite in enumerate(sorted(satellites)):
        values |= {f"{name}_{i}": _number(name, field, satellites[satellite]) for name, field in SATELLITE_FIELDS[number % 10]}
    for i, pair in enumerate(told):
        values |= {f"{name}_{i}": _number(name, field, cells[pair]) for name, field in CELL_FIELDS[number % 10]}
    table = table_of(number, len(satellites), len(signals), len(told))
    size = (table.bits + 7) // 8
    return (table.message(values) << 8 * size - table.bits).to_bytes(size, "big")


def _number(name: str, field: Field, values: Values) -> float:
    """A value in its unit, or what stands for none."""
    value = values.get(name, 0.0)
    if value is not None:
        return value
    return (
        none_of(field) * (field.unit or 1) if field.signed else {"whole_ms": NO_WHOLE_MS, "channel": NO_CHANNEL, "cn0_dbhz": NO_CN0}[name]
    )


def encode_row(row: ObservationRow, kind: int, station: int = 0, channels: Mapping[str, int] | None = None) -> list[bytes]:
    """A row as MSM 4, 5, 6 or 7, of each system as many messages as it needs; the last says that no more follow.

    `channels` of GLONASS satellites by name; without it no carrier is told. Signals that RTCM has no bit for are left out, and so is a
    carrier more than 1.1 km from the range: whole cycles must have been taken off before. Times are told to the millisecond.
    """
    by_system: dict[str, dict[tuple[int, int], int]] = {}
    for i, signal in enumerate(row.signals):
        places = places_of(signal)
        if places is not None:
            by_system.setdefault(signal[0], {})[places] = i
    parts = [(system, part) for system in NUMBER_OF if system in by_system for part in _parts(by_system[system])]
    messages = []
    for k, (system, part) in enumerate(parts):
        header = {"station": station, "time": _time(system, row.receive_time_ns), "more": int(k + 1 < len(parts))}
        satellites: dict[int, Values] = {}
        cells: dict[tuple[int, int], Values] = {}
        for bit in sorted({satellite for satellite, _ in part}):
            mine = {place: i for place, i in part.items() if place[0] == bit}
            satellites[bit], told = _satellite(row, list(mine.values()), kind, channels or {})
            cells |= dict(zip(mine, told, strict=True))
        messages.append(encode_msm(NUMBER_OF[system] + kind, header, satellites, cells))
    return messages


def _parts(places: Mapping[tuple[int, int], int]) -> Iterable[dict[tuple[int, int], int]]:
    """Runs of satellites that a cell mask has room for."""
    n_signals = len({signal for _, signal in places})
    satellites = sorted({satellite for satellite, _ in places})
    room = MOST_CELL_BITS // n_signals
    for begin in range(0, len(satellites), room):
        chosen = satellites[begin : begin + room]
        yield {place: i for place, i in sorted(places.items()) if place[0] in chosen}


def _time(system: str, gps_ns: int) -> int:
    """As a message of this system tells it."""
    if system != "R":
        return (gps_ns - (BDT_BEHIND_GPS_NS if system == "C" else 0)) % WEEK_NS // 1_000_000
    days, of_day_ns = divmod(utc_from_gps(gps_ns) + GLONASS_AHEAD_OF_UTC_NS, DAY_S * NS_PER_S)
    return (days - 3) % 7 << 27 | of_day_ns // 1_000_000  # 1970-01-04 was a Sunday


def _satellite(row: ObservationRow, mine: Sequence[int], kind: int, channels: Mapping[str, int]) -> tuple[Values, list[Values]]:
    """The fields of a satellite, and of its cells in order."""
    satellite = row.signals[mine[0]].partition(".")[0]
    channel = channels.get(satellite)
    khz = [_khz(row.signals[i], channel) for i in mine]
    ranges_ms = row.pseudorange_m[mine] / LIGHT_MS_M
    rates_mps = -row.doppler_hz[mine] * LIGHT_MS_M / np.array(khz)
    rough = next((round(ms / ROUGH_MS) for ms in ranges_ms.tolist() if ms == ms), None)
    rate_mps = next((float(round(mps)) for mps in rates_mps.tolist() if mps == mps), None)
    fields = {
        "whole_ms": None if rough is None else rough // 1024,
        "part_ms": 0.0 if rough is None else rough % 1024 * ROUGH_MS,
        "channel": 0 if satellite[0] != "R" else None if channel is None else channel - FIRST_CHANNEL,
        "rate_mps": rate_mps,
    }
    rough_ms = np.nan if rough is None else rough * ROUGH_MS
    units = dict(CELL_FIELDS[kind])
    cells: list[Values] = [
        {
            "range_ms": _within(units["range_ms"], float(range_ms) - rough_ms),
            "phase_ms": _within(units["phase_ms"], float(row.carrier_cycles[i]) / k - rough_ms),
            "lock": max(0, int(np.searchsorted(LEAST_LOCK_S[kind], row.lock_s[i], "right")) - 1) if row.lock_s[i] >= 0.0 else 0,
            "half_cycle": int(row.half_cycle[i]),
            "cn0_dbhz": float(row.cn0_dbhz[i]) if row.cn0_dbhz[i] > 0.0 else None,
            "fine_rate_mps": _within(units["fine_rate_mps"], float(rate) - (rate_mps or 0.0)) if "fine_rate_mps" in units else None,
        }
        for i, range_ms, rate, k in zip(mine, ranges_ms, rates_mps, khz, strict=True)
    ]
    return fields, cells


def _khz(signal: str, channel: int | None) -> float:
    first_hz, step_hz = carrier_hz(signal[0], bands_of(signal)[0]) or (np.nan, np.nan)
    return (first_hz + step_hz * (np.nan if channel is None else channel) if step_hz else first_hz) / 1000.0


def _within(field: Field, value: float) -> float | None:
    """A value that the field can hold, None for any other."""
    number = value / (field.unit or 1.0)
    return value if abs(number) < -none_of(field) - 0.5 else None
