"""Streams for tests: a site of three antennas 120 m apart, and what its receivers would have measured; then ways to spoil it."""

from collections.abc import Callable, Sequence
from copy import deepcopy
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np

from integrity.config import IntegrityConfig, ReceiverConfig, SiteConfig
from integrity.events import EphemerisReceived, Event, ObservationsReceived, Tick
from integrity.gnss.ephemeris.states import satellite_states
from integrity.gnss.ephemeris.store import EphemerisStore
from integrity.gnss.gps_time import NS_PER_S, parse_utc
from integrity.gnss.observations import ROW_ARRAYS, ObservationRow
from integrity.gnss.positioning import state_time_ns
from integrity.limits import Limits, derive
from integrity.outputs import Alert, EpochReport, HealthReport, Output
from integrity.station_monitor import StationMonitor
from integrity.triangle import reference_triangle
from recordings.simulate.observations import simulate
from tests.unit.sites import A_ECEF_M, B_ECEF_M, C_ECEF_M

START_NS = parse_utc("2026-03-02T03:00:00Z")
SEED = 1
POINTS = {"A": A_ECEF_M, "B": B_ECEF_M, "C": C_ECEF_M}
RECOVER_AFTER_S = 5.0


def a_site(interval_s: float = 1.0, names: Sequence[str] = ("A", "B", "C"), integrity: IntegrityConfig | None = None) -> SiteConfig:
    """`names` of the receivers at A, B and C; the site lists them sorted by name. Start-up takes 5 s."""
    receivers = sorted((ReceiverConfig(name, point) for name, point in zip(names, POINTS.values(), strict=True)), key=lambda r: r.name)
    promises = integrity or IntegrityConfig(recover_after_s=RECOVER_AFTER_S)
    return SiteConfig("test", "WGS 84", 2026.2, round(interval_s * NS_PER_S), "none", tuple(receivers), promises, 3000, "0" * 64)


SITE = a_site()
TRIANGLE = reference_triangle(SITE)


def limits_of(site: SiteConfig) -> Limits:
    return derive(site, reference_triangle(site))


LIMITS = limits_of(SITE)


@cache
def stream(seconds: float = 20.0, interval_s: float = 1.0) -> tuple[Event, ...]:
    """A sound stream of `SITE`: ionosphere, ephemerides, then rows of A, B, C and a tick per epoch."""
    return simulate(a_site(interval_s), START_NS, seconds, 1.0 / interval_s, SEED)


@cache
def _new_monitor(site: SiteConfig) -> StationMonitor:
    return StationMonitor(site)


def new_monitor(site: SiteConfig = SITE) -> StationMonitor:
    """A monitor that has seen nothing; a copy, since deriving its limits takes longer than deciding a stream."""
    return deepcopy(_new_monitor(site))


def rows_changed(events: Sequence[Event], change: Callable[[ObservationRow], ObservationRow | None]) -> tuple[Event, ...]:
    """Each row replaced by what `change` makes of it, or left out for None."""
    changed: list[Event] = []
    for event in events:
        if isinstance(event, ObservationsReceived):
            row = change(event.row)
            changed += [] if row is None else [replace(event, row=row)]
        else:
            changed.append(event)
    return tuple(changed)


def with_values(row: ObservationRow, name: str, value: float, columns: Sequence[int] | slice = slice(None)) -> ObservationRow:
    """The row with one of its arrays set to a value."""
    changed: dict[str, Any] = {name: np.array(getattr(row, name))}
    changed[name][columns] = value
    return replace(row, **changed)


def with_more(row: ObservationRow, name: str, more: float, columns: Sequence[int] | slice = slice(None)) -> ObservationRow:
    """The row with something added to one of its arrays."""
    changed: dict[str, Any] = {name: np.array(getattr(row, name))}
    changed[name][columns] += more
    return replace(row, **changed)


@cache
def _cosines(azimuth_rad: float) -> dict[str, float]:
    """Of the angle between a horizontal direction and each signal, at A in the first epoch: good for minutes and kilometres."""
    sets = [e.ephemeris for e in stream() if isinstance(e, EphemerisReceived)]
    satellites = sorted({eph.satellite for eph in sets})
    epoch_ns = np.array([START_NS])
    index = EphemerisStore(sets).choose(satellites, epoch_ns, np.array([len(sets)]))
    los = satellite_states(sets, index, state_time_ns(epoch_ns)).pos_ecef_m[:, 0] - TRIANGLE.pos_ecef_m[0][:, None]
    east, north, _ = TRIANGLE.enu[0] @ (los / np.linalg.norm(los, axis=0))
    return dict(zip((f"{s}.1C" for s in satellites), (np.sin(azimuth_rad) * east + np.cos(azimuth_rad) * north).tolist(), strict=True))


def moved(row: ObservationRow, size_m: float, azimuth_rad: float) -> ObservationRow:
    """The row with its ranges as if the antenna stood elsewhere."""
    cosine = np.array([_cosines(azimuth_rad).get(s, 0.0) for s in row.signals])
    changed: dict[str, Any] = {"pseudorange_m": row.pseudorange_m - size_m * cosine}
    return replace(row, **changed)


def with_signals(row: ObservationRow, kept: Callable[[str], bool]) -> ObservationRow:
    """The row with some of its signals only."""
    columns = [i for i, s in enumerate(row.signals) if kept(s)]
    arrays: dict[str, Any] = {name: getattr(row, name)[columns] for name in ROW_ARRAYS}
    return replace(row, signals=tuple(row.signals[i] for i in columns), **arrays)


def ticks_only(after: Event, seconds: int) -> tuple[Tick, ...]:
    """A tick per second, the first one second after an event."""
    return tuple(Tick(after.mono_ns + k * NS_PER_S, 0, None) for k in range(1, seconds + 1))


def epoch_of(row: ObservationRow) -> int:
    """Seconds since the beginning of the stream."""
    return (row.receive_time_ns - START_NS) // NS_PER_S


def reports(outputs: Sequence[Output]) -> list[EpochReport]:
    return [o for o in outputs if isinstance(o, EpochReport)]


def health(outputs: Sequence[Output]) -> list[HealthReport]:
    return [o for o in outputs if isinstance(o, HealthReport)]


def alerts(outputs: Sequence[Output]) -> list[Alert]:
    return [o for o in outputs if isinstance(o, Alert)]
