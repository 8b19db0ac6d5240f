"""Simulated measurements as RINEX 3.04 text, so that the import can be tested without the data of others.

Source: RINEX 3.04, tables A2, A3, A5, A6 and A8. What the format cannot carry is lost: 1 mm of range and carrier, 1e-3 Hz and dB-Hz,
100 ns of the time tag, thirteen digits of an ephemeris (below 0.1 mm of range).
"""

import math
from collections.abc import Iterable, Sequence
from pathlib import Path

from integrity.events import EphemerisReceived, Event, IonosphereReceived, ObservationsReceived
from integrity.gnss.atmosphere import Klobuchar
from integrity.gnss.ephemeris.broadcast import KeplerEphemeris
from integrity.gnss.gps_time import GPS_EPOCH_UNIX_S, NS_PER_S, WEEK_NS, format_calendar
from integrity.gnss.observations import ObservationRow
from integrity.gnss.signals import satellite_of

LEAP_SECONDS = 18  # since 2017-01-01
GALILEO_INAV_E1_AND_E5B = 517  # data sources of table A8: I/NAV E1-B and E5b-I, clock for E5b and E1
BLANK = " " * 16
Xyz = tuple[float, float, float]


def observation_text(
    rows: Iterable[ObservationRow], position_ecef_m: Xyz = (0.0, 0.0, 0.0), interval_s: float = 1.0, leap_seconds: int = LEAP_SECONDS
) -> str:
    """One receiver's rows, in the order given, as an observation file."""
    listed = list(rows)
    first_ns = listed[0].receive_time_ns if listed else 0
    header = [
        _labelled("     3.04           OBSERVATION DATA    M", "RINEX VERSION / TYPE"),
        _labelled("simulated", "PGM / RUN BY / DATE"),
        _labelled(listed[0].receiver if listed else "", "MARKER NAME"),
        _labelled("".join(f"{x:14.4f}" for x in position_ecef_m), "APPROX POSITION XYZ"),
        *(_labelled(f"{system}    4 C1C L1C D1C S1C", "SYS / # / OBS TYPES") for system in "GE"),
        _labelled(f"{interval_s:10.3f}", "INTERVAL"),
        _labelled("".join(f"{v:6d}" for v in _parts(first_ns)[:5]) + f"{_parts(first_ns)[5]:5d}.0000000     GPS", "TIME OF FIRST OBS"),
        _labelled(f"{leap_seconds:6d}", "LEAP SECONDS"),
        _labelled("", "END OF HEADER"),
    ]
    return "\n".join(header + [line for row in listed for line in epoch_lines(row)]) + "\n"


def epoch_lines(row: ObservationRow) -> list[str]:
    """The epoch line of a row and a line per satellite."""
    year, month, day, hour, minute, second = _parts(row.receive_time_ns)
    tenths_of_us = row.receive_time_ns % NS_PER_S // 100
    head = f"> {year:4d} {month:02d} {day:02d} {hour:02d} {minute:02d} {second:2d}.{tenths_of_us:07d}  0{len(row.signals):3d}"
    return [head, *(_record(row, i) for i in range(len(row.signals)))]


def navigation_text(ephemerides: Iterable[KeplerEphemeris], klobuchar: Klobuchar | None = None, leap_seconds: int = LEAP_SECONDS) -> str:
    """Broadcast sets, in the order given, as a mixed navigation file."""
    terms = [] if klobuchar is None else [("GPSA", klobuchar.alpha), ("GPSB", klobuchar.beta)]
    header = [
        _labelled("     3.04           N: GNSS NAV DATA    M", "RINEX VERSION / TYPE"),
        _labelled("simulated", "PGM / RUN BY / DATE"),
        *(_labelled(f"{name} " + "".join(f"{x:12.4E}" for x in values), "IONOSPHERIC CORR") for name, values in terms),
        _labelled(f"{leap_seconds:6d}", "LEAP SECONDS"),
        _labelled("", "END OF HEADER"),
    ]
    return "\n".join(header + [line for eph in ephemerides for line in _record_of_ephemeris(eph)]) + "\n"


def rows_of(events: Iterable[Event], receiver: str) -> list[ObservationRow]:
    return [e.row for e in events if isinstance(e, ObservationsReceived) and e.row.receiver == receiver]


def navigation_of(events: Iterable[Event]) -> tuple[list[KeplerEphemeris], Klobuchar | None]:
    """Ephemerides, and the ionosphere that came last."""
    listed = list(events)
    ionospheres = [e.klobuchar for e in listed if isinstance(e, IonosphereReceived)]
    told = (e.ephemeris for e in listed if isinstance(e, EphemerisReceived))
    return [eph for eph in told if isinstance(eph, KeplerEphemeris)], ionospheres[-1] if ionospheres else None


def write_rinex(directory: Path, events: Sequence[Event], receivers: Sequence[str], interval_s: float = 1.0) -> dict[str, Path]:
    """A file per receiver and `nav`, by name."""
    paths = {name: directory / f"{name}.rnx" for name in (*receivers, "nav")}
    for name in receivers:
        paths[name].write_text(observation_text(rows_of(events, name), interval_s=interval_s), "ascii")
    paths["nav"].write_text(navigation_text(*navigation_of(events)), "ascii")
    return paths


def _labelled(content: str, label: str) -> str:
    return content.ljust(60) + label


def _record(row: ObservationRow, i: int) -> str:
    indicator = str(int(row.slip[i]) + 2 * int(row.half_cycle[i])).replace("0", " ")
    code, carrier, doppler, cn0 = (_observed(values[i]) for values in (row.pseudorange_m, row.carrier_cycles, row.doppler_hz, row.cn0_dbhz))
    return satellite_of(row.signals[i]) + code + carrier[:14] + indicator + " " + doppler + cn0


def _observed(value: float) -> str:
    return BLANK if math.isnan(value) else f"{value:14.3f}  "


def _record_of_ephemeris(eph: KeplerEphemeris) -> list[str]:
    galileo = eph.satellite[0] == "E"
    toe_s, transmission_s = eph.toe_ns % WEEK_NS / NS_PER_S, eph.transmission_ns % WEEK_NS / NS_PER_S
    week, issue = float(eph.toe_ns // WEEK_NS), float(eph.issue)
    accuracy_m = -1.0 if eph.accuracy_m is None else eph.accuracy_m
    delays = (eph.group_delay_2_s or 0.0, eph.group_delay_s) if galileo else (eph.group_delay_s, issue)
    orbits = [
        (issue, eph.crs, eph.delta_n, eph.m0),
        (eph.cuc, eph.e, eph.cus, eph.sqrt_a),
        (toe_s, eph.cic, eph.omega0, eph.cis),
        (eph.i0, eph.crc, eph.omega, eph.omega_dot),
        (eph.i_dot, float(GALILEO_INAV_E1_AND_E5B if galileo else 1), week, 0.0),
        (accuracy_m, 0.0 if eph.healthy else 1.0, *delays),
        (transmission_s, 0.0 if galileo else eph.fit_half_s / 1800.0),
    ]
    year, month, day, hour, minute, second = _parts(eph.toc_ns)
    head = f"{eph.satellite} {year:4d} {month:02d} {day:02d} {hour:02d} {minute:02d} {second:02d}"
    return [head + _reals((eph.af0, eph.af1, eph.af2)), *("    " + _reals(values) for values in orbits)]


def _reals(values: Sequence[float]) -> str:
    return "".join(f"{v:19.12E}".replace("E", "D") for v in values)


def _parts(gps_ns: int) -> tuple[int, ...]:
    """Year to second on the GPS scale."""
    text = format_calendar(gps_ns // NS_PER_S * NS_PER_S + GPS_EPOCH_UNIX_S * NS_PER_S)
    return tuple(int(part) for part in text.replace("T", "-").replace(":", "-").split("-"))
