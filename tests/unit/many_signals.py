"""What receivers measure that track all signals of six systems: exact ranges by the broadcast models, at the test site."""

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cache

import numpy as np

from integrity.events import EphemerisReceived, Event, ObservationsReceived, RawBytes, Tick
from integrity.gnss.constants import EARTH_ROTATION_RADPS, SPEED_OF_LIGHT_MPS
from integrity.gnss.ephemeris.broadcast import Ephemeris, GeoEphemeris, GlonassEphemeris, KeplerEphemeris
from integrity.gnss.ephemeris.states import satellite_states
from integrity.gnss.gps_time import NS_PER_S, WEEK_NS, leap_seconds_at_gps, utc_from_gps
from integrity.gnss.observations import Floats, ObservationRow
from integrity.gnss.positioning import expected, points_at, state_time_ns
from integrity.gnss.rtcm.framing import frame_bytes as rtcm_frame
from integrity.gnss.rtcm.msm_writer import encode_row
from integrity.gnss.rtcm.navigation import encode_ephemeris, ephemeris_of
from integrity.gnss.signals import carrier_hz, satellite_of
from integrity.gnss.ubx.framing import frame_bytes
from integrity.gnss.ubx.identifiers import SIGNALS
from integrity.gnss.ubx.rawx import RAWX_DTYPE, RAWX_HEADER, RXM_RAWX
from recordings.simulate.constellation import constellation
from tests.unit.streams import POINTS, SEED, TRIANGLE

CODES = {
    "G": ("1C", "2W", "2L", "5Q"),
    "E": ("1C", "1B", "5Q", "7Q"),
    "C": ("2I", "6I", "7I"),
    "J": ("1C", "2L", "5Q"),
    "R": ("1C", "2C"),
    "S": ("1C",),
}
CLOCKS_M = {"A": 300.0, "B": -900.0, "C": 2000.0}
EPOCHS = 20
MASK_RAD = math.radians(10.0)
CHANNELS = {"R02": -4, "R03": 5, "R17": 4, "R18": -3}

More = Callable[[str, str, int], float | None]
"""Metres that a receiver measures of a signal besides its range, in an epoch by number; None where it does not measure it."""


def nothing_more(receiver: str, signal: str, epoch: int) -> float | None:
    return 0.0


@cache
def sets_in_force(event_ns: int) -> tuple[Ephemeris, ...]:
    """Ephemerides that serve around an event; those of GPS, Galileo, BeiDou and QZSS as their messages can carry them."""
    hour_ns = event_ns // (3600 * NS_PER_S) * 3600 * NS_PER_S
    found = {eph.satellite: eph for eph in constellation(SEED, hour_ns - 60 * NS_PER_S, hour_ns - 60 * NS_PER_S)}
    galileo = [found[satellite] for satellite in sorted(found) if satellite[0] == "E"]
    numbers = (*range(7, 19), *range(21, 33))  # of both generations of BeiDou
    kepler = [*found.values(), *(_beidou(eph, number, hour_ns) for eph, number in zip(galileo, numbers, strict=True))]
    kepler += [_qzss(galileo[0], number, m0, hour_ns) for number, m0 in ((2, 2.3), (3, 3.1), (4, 3.9))]
    seen = [ephemeris_of(encode_ephemeris(eph), event_ns, event_ns - 600 * NS_PER_S) for eph in kepler]
    return (*(eph for eph in seen if eph is not None), *_glonass(hour_ns, event_ns), _sbas(event_ns))


def _beidou(like: KeplerEphemeris, number: int, hour_ns: int) -> KeplerEphemeris:
    toe_ns = hour_ns + 14 * NS_PER_S
    orbit = replace(
        like, satellite=f"C{number:02d}", message="D1", issue=1, toe_ns=toe_ns, toc_ns=toe_ns, fit_half_s=7200.0, accuracy_m=2.4
    )
    return replace(orbit, sqrt_a=5282.6, m0=math.remainder(like.m0 + 0.4, math.tau), group_delay_s=3.2e-9, group_delay_2_s=-4.1e-9)


def _qzss(like: KeplerEphemeris, number: int, m0: float, hour_ns: int) -> KeplerEphemeris:
    """North of Japan for most of its day."""
    place = replace(like, satellite=f"J{number:02d}", message="LNAV", issue=number, toe_ns=hour_ns, toc_ns=hour_ns, fit_half_s=5400.0)
    node = 0.9 + EARTH_ROTATION_RADPS * (hour_ns % WEEK_NS / NS_PER_S)
    shape = replace(place, sqrt_a=6493.4, e=0.075, i0=0.72, omega=-1.57, omega0=math.remainder(node, math.tau), accuracy_m=2.4)
    return replace(shape, m0=math.remainder(m0, math.tau), group_delay_2_s=None)


def _glonass(hour_ns: int, event_ns: int) -> list[GlonassEphemeris]:
    """In four directions, 30 deg from the zenith at the centre of the Earth, moving east."""
    utc_ns = utc_from_gps(hour_ns + 3600 * NS_PER_S // 2) // (900 * NS_PER_S) * 900 * NS_PER_S
    toe_ns = event_ns + utc_ns - utc_from_gps(event_ns)
    up = np.array(POINTS["A"]) / np.linalg.norm(POINTS["A"])
    east = np.cross((0.0, 0.0, 1.0), up) / np.linalg.norm(np.cross((0.0, 0.0, 1.0), up))
    north = np.cross(up, east)
    found = []
    for satellite, turn in zip(CHANNELS, (0.3, 1.9, 3.5, 5.1), strict=True):
        side = math.sin(turn) * east + math.cos(turn) * north
        radius_m, across = 25_508_000.0, np.cross(side, up)
        pos = radius_m * (math.cos(0.5) * up + math.sin(0.5) * side)
        x, y, z, vx, vy, vz = (float(v) for v in (*pos, *(3400.0 * across)))
        found.append(
            GlonassEphemeris(
                satellite, CHANNELS[satellite], 1, True, 4.0, toe_ns, toe_ns, 1200.0, x, y, z, vx, vy, vz, 0.0, 0.0, 0.0, 1e-5, 0.0, 2e-9
            )
        )
    return found


def _sbas(event_ns: int) -> GeoEphemeris:
    x, y = 42_164_000.0 * math.cos(math.radians(137.0)), 42_164_000.0 * math.sin(math.radians(137.0))
    toe_ns = event_ns - 60 * NS_PER_S
    return GeoEphemeris("S29", 5, True, 4.0, toe_ns, toe_ns, 360.0, x, y, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


@cache
def ranges(event_ns: int) -> tuple[tuple[str, ...], list[int], Floats]:
    """Signals, epochs (1 s apart, the event in their middle) and ranges (E, R, S) with the receivers' clocks; NaN below 10 deg.

    A signal whose group delay no message tells has the range of the satellite's first.
    """
    sets = sets_in_force(event_ns)
    epochs = [event_ns + (k - EPOCHS // 2) * NS_PER_S for k in range(EPOCHS)]
    signals = [f"{eph.satellite}.{code}" for eph in sets for code in CODES[eph.satellite[0]]]
    of_set = {eph.satellite: k for k, eph in enumerate(sets)}
    first = [f"{satellite_of(s)}.{CODES[s[0]][0]}" for s in signals]
    index = np.tile([of_set[satellite_of(s)] for s in signals], (EPOCHS, 1))
    t_ns = np.array(epochs)
    clock_m = np.array([CLOCKS_M[receiver] for receiver in POINTS])[:, None]
    told = []
    for of in (signals, first):
        sight = expected(satellite_states(sets, index, state_time_ns(t_ns), of), t_ns, points_at(TRIANGLE.pos_ecef_m), None)
        rho = np.full(sight.range_m.shape, 2.3e7)
        for _ in range(4):
            dt = (t_ns - sight.t_ns)[:, None, None] / NS_PER_S - rho / SPEED_OF_LIGHT_MPS - sight.clock_s
            rho = sight.range_m + dt * (sight.rate_mps + dt * sight.half_acc_mps2) + clock_m
        told.append(np.where(sight.el_rad >= MASK_RAD, rho, np.nan))
    return tuple(signals), epochs, np.where(np.isnan(told[0]), told[1], told[0])


def rows(event_ns: int, more: More = nothing_more) -> tuple[Event, ...]:
    """Ephemerides, then a row of each receiver and a tick per epoch."""
    signals, epochs, rho = ranges(event_ns)
    events: list[Event] = [EphemerisReceived(epochs[0], eph) for eph in sets_in_force(event_ns)]
    for e, epoch_ns in enumerate(epochs):
        for r, receiver in enumerate(POINTS):
            added = [more(receiver, s, e) if np.isfinite(m) else None for s, m in zip(signals, rho[e, r].tolist(), strict=True)]
            kept = [i for i, m in enumerate(added) if m is not None]
            row_m = rho[e, r, kept] + np.array([added[i] for i in kept], dtype=np.float64)
            events.append(ObservationsReceived(epoch_ns, _row(receiver, epoch_ns, [signals[i] for i in kept], row_m)))
        events.append(Tick(epoch_ns, utc_from_gps(epoch_ns), None))
    return tuple(events)


def _row(receiver: str, epoch_ns: int, signals: Sequence[str], rho: Floats) -> ObservationRow:
    n = len(signals)
    no = np.zeros(n, dtype=np.bool_)
    carriers = np.array([_hz(signal) for signal in signals])
    cycles = rho * carriers / SPEED_OF_LIGHT_MPS
    return ObservationRow(receiver, epoch_ns, tuple(signals), rho, cycles, np.zeros(n), np.full(n, 44.0), np.full(n, 500.0), no, no)


def _hz(signal: str) -> float:
    found = carrier_hz(signal[0], signal[4])
    assert found is not None
    return found[0] + found[1] * CHANNELS.get(satellite_of(signal), 0)


def as_rawx(events: Sequence[Event]) -> tuple[Event, ...]:
    """Rows as RXM-RAWX, signals that u-blox receivers do not track left out; ephemerides stay."""
    number = {(f.system, f.code): (gnss, sig, f.less) for (gnss, sig), f in reversed(SIGNALS.items())}

    def frame(row: ObservationRow) -> bytes:
        known = [i for i, s in enumerate(row.signals) if (s[0], s[4:]) in number]
        m = np.zeros(len(known), dtype=RAWX_DTYPE)
        for k, i in enumerate(known):
            signal = row.signals[i]
            gnss, sig, less = number[signal[0], signal[4:]]
            m[k]["gnss_id"], m[k]["sv_id"], m[k]["sig_id"] = gnss, int(signal[1:3]) + less, sig
        m["pr_m"], m["cp_cycles"], m["do_hz"] = row.pseudorange_m[known], row.carrier_cycles[known], row.doppler_hz[known]
        m["cno_dbhz"], m["locktime_ms"], m["trk_stat"] = 44, 64_500, 0b111
        t_ns = row.receive_time_ns
        header = RAWX_HEADER.pack(t_ns % WEEK_NS / NS_PER_S, t_ns // WEEK_NS, leap_seconds_at_gps(t_ns), len(m), 1, 1)
        return frame_bytes(*RXM_RAWX, header + m.tobytes())

    return tuple(
        RawBytes(event.mono_ns, event.row.receiver, frame(event.row)) if isinstance(event, ObservationsReceived) else event
        for event in events
    )


def as_msm(events: Sequence[Event]) -> tuple[Event, ...]:
    """Rows as MSM7 of each system, the first ones after the ephemerides, of which SBAS has no message."""
    sets = [e.ephemeris for e in events if isinstance(e, EphemerisReceived) and not isinstance(e.ephemeris, GeoEphemeris)]
    told = {receiver: b"".join(rtcm_frame(encode_ephemeris(eph)) for eph in sets) for receiver in POINTS}
    found: list[Event] = []
    for event in events:
        if isinstance(event, ObservationsReceived):
            messages = encode_row(event.row, 7, 1, CHANNELS)
            data = told.pop(event.row.receiver, b"") + b"".join(rtcm_frame(message) for message in messages)
            found.append(RawBytes(event.mono_ns, event.row.receiver, data))
        elif isinstance(event, Tick):
            found.append(event)
    return tuple(found)
