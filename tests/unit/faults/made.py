"""A small made-up stream for faults: 20 epochs of 30 s, three receivers (C 100 km away), 24 satellites in circles and G32, which has no
ephemeris."""

from collections.abc import Sequence

import numpy as np
import pytest

from integrity.config import IntegrityConfig, ReceiverConfig, SiteConfig
from integrity.events import EphemerisReceived, Event, ObservationsReceived, Tick
from integrity.gnss.constants import EARTH_ROTATION_RADPS, SPEED_OF_LIGHT_MPS
from integrity.gnss.ephemeris.broadcast import KeplerEphemeris
from integrity.gnss.ephemeris.states import satellite_states
from integrity.gnss.frames import ecef_from_geodetic, enu_axes, geodetic_from_ecef
from integrity.gnss.gps_time import NS_PER_S, gps_from_calendar, utc_from_gps
from integrity.gnss.observations import Floats, ObservationRow, build_block
from integrity.gnss.positioning import points_at, prefit, state_time_ns
from integrity.gnss.signals import L1_HZ
from recordings.faults import Fault, inject
from recordings.faults.kinds import (
    Effect,
)

STEP_NS = 30 * NS_PER_S
FIRST_NS = gps_from_calendar(2010, 3, 18, 5, 0, 0)
EPOCHS = [FIRST_NS + k * STEP_NS for k in range(20)]
START_NS, END_NS = EPOCHS[5], EPOCHS[15]  # of every fault
CLOCK_M = 900.0  # of every receiver, 3 us
WAVELENGTH_M = SPEED_OF_LIGHT_MPS / L1_HZ


def point(lat_deg: float, lon_deg: float, height_m: float) -> tuple[float, float, float]:
    x, y, z = ecef_from_geodetic(np.deg2rad(lat_deg), np.deg2rad(lon_deg), height_m)
    return float(x), float(y), float(z)


POINTS = {"A": point(41.40, 2.10, 150.0), "B": point(41.401, 2.10, 152.0), "C": point(42.20, 2.60, 900.0)}
SITE = SiteConfig(
    "made-up", "none", None, STEP_NS, "none", tuple(ReceiverConfig(r, p) for r, p in POINTS.items()), IntegrityConfig(), 3000, ""
)


def ephemeris(number: int, transmission_ns: int = FIRST_NS - 600 * NS_PER_S, issue: int = 7) -> KeplerEphemeris:
    plane, slot = divmod(number - 1, 4)
    zeros = dict.fromkeys(("delta_n", "i_dot", "cuc", "cus", "crc", "crs", "cic", "cis", "af1", "af2", "group_delay_s"), 0.0)
    return KeplerEphemeris(
        satellite=f"G{number:02d}",
        message="LNAV",
        issue=issue,
        healthy=True,
        accuracy_m=2.4,
        transmission_ns=transmission_ns,
        toe_ns=FIRST_NS + 3600 * NS_PER_S,
        toc_ns=FIRST_NS + 3600 * NS_PER_S,
        fit_half_s=7200.0,
        sqrt_a=5153.7,
        e=0.01,
        i0=0.96,
        omega0=plane * np.pi / 3.0,
        omega=0.4,
        m0=(slot + plane / 6.0) * np.pi / 2.0,
        omega_dot=-8e-9,
        af0=1e-5 * number,
        **zeros,
    )


EPHEMERIDES = [ephemeris(n) for n in range(1, 25)]


def measured(receiver: str, epoch_ns: int) -> ObservationRow:
    """Exact ranges by the broadcast model with a clock of 3 us; C/N0 is unknown to C; G32 stands still."""
    index = np.arange(24)[None]
    states = satellite_states(EPHEMERIDES, index, state_time_ns(np.array([epoch_ns])))
    signals = [f"G{n:02d}.1C" for n in range(1, 25)]
    rho = np.full(24, 2.3e7)
    here = points_at(np.array([POINTS[receiver]]))
    for _ in range(4):
        row = made_row(receiver, epoch_ns, tuple(signals), rho)
        at_point = prefit(build_block((receiver,), [epoch_ns], [[row]]), states, here, None)
        rho = rho - at_point.residual_m[0, 0] + CLOCK_M
    up = at_point.el_rad[0, 0] > np.deg2rad(5.0)
    kept = [s for s, keep in zip(signals, up, strict=True) if keep]
    return made_row(receiver, epoch_ns, (*kept, "G32.1C"), np.append(rho[up], 2.2e7))


def made_row(receiver: str, epoch_ns: int, signals: tuple[str, ...], rho: Floats) -> ObservationRow:
    n = len(signals)
    no = np.zeros(n, dtype=np.bool_)
    cn0 = np.full(n, np.nan if receiver == "C" else 44.0)
    return ObservationRow(receiver, epoch_ns, signals, rho, rho / WAVELENGTH_M, np.full(n, 1000.0), cn0, np.full(n, 500.0), no, no)


def made_stream() -> tuple[Event, ...]:
    events: list[Event] = [EphemerisReceived(FIRST_NS, eph) for eph in EPHEMERIDES]
    for epoch_ns in EPOCHS:
        events += [ObservationsReceived(epoch_ns, measured(r, epoch_ns)) for r in POINTS]
        events.append(Tick(epoch_ns, utc_from_gps(epoch_ns), None))
    return tuple(events)


STREAM = made_stream()


def with_fault(effect: Effect, end_ns: int | None = END_NS, seed: int = 0) -> tuple[Event, ...]:
    return inject(STREAM, [Fault(START_NS, end_ns, effect)], SITE, seed)


def rows_of(events: Sequence[Event], receiver: str) -> dict[int, ObservationRow]:
    return {e.row.receive_time_ns: e.row for e in events if isinstance(e, ObservationsReceived) and e.row.receiver == receiver}


Change = dict[str, float]
SEEN = sorted(set.intersection(*(set(rows_of(STREAM, r)[t].signals) for r in POINTS for t in EPOCHS)))[:-1]  # the last is G32


def changes(events: Sequence[Event], receiver: str, quantity: str = "pseudorange_m") -> dict[int, Change]:
    """What became of a quantity, by epoch and signal."""
    was, now = rows_of(STREAM, receiver), rows_of(events, receiver)
    return {
        t: dict(zip(row.signals, getattr(row, quantity) - getattr(was[t], quantity), strict=True))
        for t, row in now.items()
        if row.signals == was[t].signals
    }


def faulty(epoch_ns: int) -> bool:
    return START_NS <= epoch_ns < END_NS


def range_m(row: ObservationRow, signal: str, antenna_ecef_m: Floats) -> float:
    """Distance from the satellite at transmission, turned with the Earth while the signal travels, worked out from first principles."""
    eph = ephemeris(int(signal[1:3]))
    travel_s = (row.pseudorange_m[row.signals.index(signal)] - CLOCK_M) / SPEED_OF_LIGHT_MPS + eph.af0
    sent_ns = row.receive_time_ns - round((travel_s + CLOCK_M / SPEED_OF_LIGHT_MPS) * NS_PER_S)
    x, y, z = satellite_states([eph], np.array([[0]]), np.array([sent_ns])).pos_ecef_m[:, 0, 0]
    turn = EARTH_ROTATION_RADPS * travel_s
    turned = np.array([x * np.cos(turn) + y * np.sin(turn), y * np.cos(turn) - x * np.sin(turn), z])
    return float(np.linalg.norm(turned - antenna_ecef_m))


def moved_point(receiver: str, offset_enu_m: Sequence[float]) -> Floats:
    lat, lon, _ = geodetic_from_ecef(np.array(POINTS[receiver]))
    return np.array(POINTS[receiver]) + np.array(offset_enu_m) @ enu_axes(lat, lon)


def assert_antenna_elsewhere(events: Sequence[Event], receiver: str, offset_enu_m: Sequence[float], epochs: Sequence[int]) -> None:
    """Ranges and carriers of every satellite with an ephemeris changed by the geometry: to 0.1 mm, and 1 ppm for the air's new slant."""
    tolerance_m = 1e-4 + 1e-6 * float(np.linalg.norm(offset_enu_m))
    was, now = rows_of(STREAM, receiver), rows_of(events, receiver)
    code, carrier = changes(events, receiver), changes(events, receiver, "carrier_cycles")
    for t in epochs:
        for signal in SEEN:
            expected = range_m(now[t], signal, moved_point(receiver, offset_enu_m)) - range_m(was[t], signal, np.array(POINTS[receiver]))
            assert code[t][signal] == pytest.approx(expected, abs=tolerance_m)
            assert carrier[t][signal] * WAVELENGTH_M == pytest.approx(expected, abs=tolerance_m)


def assert_untouched(events: Sequence[Event], receiver: str, epochs: Sequence[int]) -> None:
    was, now = rows_of(STREAM, receiver), rows_of(events, receiver)
    assert all(now[t] is was[t] for t in epochs)


OUTSIDE = [t for t in EPOCHS if not faulty(t)]
INSIDE = [t for t in EPOCHS if faulty(t)]
