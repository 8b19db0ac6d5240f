"""Simulated measurements as RINEX text (observations 3.04, navigation 3.05), so that the import can be tested without the data of others.

Source: RINEX 3.05, tables A2, A3, A5, A6, A8, A10, A12, A14 and A16. What the format cannot carry is lost: 1 mm of range and carrier,
1e-3 Hz and dB-Hz, 100 ns of the time tag, thirteen digits of an ephemeris (below 0.1 mm of range), GLONASS issues and accuracies that
do not follow from the times and the table of F_T.
"""

import math
from collections.abc import Iterable, Sequence
from pathlib import Path

from integrity.events import EphemerisReceived, Event, IonosphereReceived, ObservationsReceived
from integrity.gnss.atmosphere import Klobuchar
from integrity.gnss.ephemeris.broadcast import Ephemeris, GeoEphemeris, GlonassEphemeris, KeplerEphemeris
from integrity.gnss.gps_time import BDT_BEHIND_GPS_NS, GPS_EPOCH_UNIX_S, NS_PER_S, WEEK_NS, format_calendar, utc_from_gps
from integrity.gnss.observations import ObservationRow
from integrity.gnss.signals import satellite_of

LEAP_SECONDS = 18  # since 2017-01-01
SOURCES = {"INAV": 517.0, "FNAV": 258.0}  # of table A8: I/NAV E1-B and E5b-I, clock for E5b and E1; F/NAV, clock for E5a and E1
UNHEALTHY = {"INAV": 1.0, "FNAV": 8.0, "LNAV": 32.0, "D1": 1.0, "D2": 1.0}
F_T_M = (1.0, 2.0, 2.5, 4.0, 5.0, 7.0, 10.0, 12.0, 14.0, 16.0, 32.0, 64.0, 128.0, 256.0, 512.0)  # GLONASS ICD 5.1, table 4.4
BDT_FIRST_WEEK = 1356  # GPS week in which BeiDou's weeks begin to count
UNKNOWN = 0.9999e9
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


def navigation_text(ephemerides: Iterable[Ephemeris], klobuchar: Klobuchar | None = None, leap_seconds: int = LEAP_SECONDS) -> str:
    """Broadcast sets, in the order given, as a mixed navigation file."""
    terms = [] if klobuchar is None else [("GPSA", klobuchar.alpha), ("GPSB", klobuchar.beta)]
    header = [
        _labelled("     3.05           N: GNSS NAV DATA    M", "RINEX VERSION / TYPE"),
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


def _record_of_ephemeris(eph: Ephemeris) -> list[str]:
    match eph:
        case KeplerEphemeris():
            return _kepler_record(eph)
        case GlonassEphemeris():
            return _glonass_record(eph)
        case GeoEphemeris():
            last = ((0.0 if eph.healthy else 1.0), _metres(eph.accuracy_m), float(eph.issue))
            return _lines(eph.satellite, eph.toe_ns, (eph.af0, eph.af1, _seconds_of_week(eph.transmission_ns)), _vectors(eph, last))


def _kepler_record(eph: KeplerEphemeris) -> list[str]:
    beidou = BDT_BEHIND_GPS_NS if eph.satellite[0] == "C" else 0
    toe_s, transmission_s = _seconds_of_week(eph.toe_ns - beidou), _seconds_of_week(eph.transmission_ns - beidou)
    week, issue = float((eph.toe_ns - beidou) // WEEK_NS - (BDT_FIRST_WEEK if beidou else 0)), float(eph.issue)
    delays = (eph.group_delay_s, issue if eph.message == "LNAV" else eph.group_delay_2_s or 0.0)
    orbits = [
        (issue, eph.crs, eph.delta_n, eph.m0),
        (eph.cuc, eph.e, eph.cus, eph.sqrt_a),
        (toe_s, eph.cic, eph.omega0, eph.cis),
        (eph.i0, eph.crc, eph.omega, eph.omega_dot),
        (eph.i_dot, SOURCES.get(eph.message, 1.0), week, 0.0),
        (_metres(eph.accuracy_m), 0.0 if eph.healthy else UNHEALTHY[eph.message], *(delays[::-1] if eph.message == "INAV" else delays)),
        (transmission_s, eph.fit_half_s / 1800.0 if eph.satellite[0] == "G" else 0.0),
    ]
    return _lines(eph.satellite, eph.toc_ns - beidou, (eph.af0, eph.af1, eph.af2), orbits)


def _glonass_record(eph: GlonassEphemeris) -> list[str]:
    utc_ns, frame_ns = (utc_from_gps(t) - GPS_EPOCH_UNIX_S * NS_PER_S for t in (eph.toe_ns, eph.transmission_ns))
    orbits = _vectors(eph, (0.0 if eph.healthy else 1.0, float(eph.channel), 0.0))
    delta_tau_n_s = UNKNOWN if eph.delta_tau_n_s is None else eph.delta_tau_n_s
    status = (UNKNOWN, delta_tau_n_s, float(F_T_M.index(eph.accuracy_m)) if eph.accuracy_m in F_T_M else UNKNOWN, UNKNOWN)
    return _lines(eph.satellite, utc_ns, (-eph.tau_n_s, eph.gamma_n, _seconds_of_week(frame_ns)), [*orbits, status])


def _vectors(eph: GlonassEphemeris | GeoEphemeris, last: tuple[float, float, float]) -> list[tuple[float, ...]]:
    axes = [(eph.x_m, eph.vx_mps, eph.ax_mps2), (eph.y_m, eph.vy_mps, eph.ay_mps2), (eph.z_m, eph.vz_mps, eph.az_mps2)]
    return [(*(value / 1000.0 for value in axis), more) for axis, more in zip(axes, last, strict=True)]


def _lines(satellite: str, epoch_ns: int, clock: Sequence[float], orbits: Iterable[Sequence[float]]) -> list[str]:
    year, month, day, hour, minute, second = _parts(epoch_ns)
    head = f"{satellite} {year:4d} {month:02d} {day:02d} {hour:02d} {minute:02d} {second:02d}"
    return [head + _reals(clock), *("    " + _reals(values) for values in orbits)]


def _metres(accuracy_m: float | None) -> float:
    return -1.0 if accuracy_m is None else accuracy_m


def _seconds_of_week(time_ns: int) -> float:
    return time_ns % WEEK_NS / NS_PER_S


def _reals(values: Sequence[float]) -> str:
    return "".join(f"{v:19.12E}".replace("E", "D") for v in values)


def _parts(gps_ns: int) -> tuple[int, ...]:
    """Year to second on the GPS scale."""
    text = format_calendar(gps_ns // NS_PER_S * NS_PER_S + GPS_EPOCH_UNIX_S * NS_PER_S)
    return tuple(int(part) for part in text.replace("T", "-").replace(":", "-").split("-"))
