"""What was recorded before any fault: every row with what was known when it came, and the geometry that follows from it."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from itertools import groupby
from typing import NamedTuple

import numpy as np

from integrity.assembler import nominal_epoch_ns
from integrity.config import SiteConfig
from integrity.events import EphemerisReceived, Heard, IonosphereReceived, ObservationsReceived
from integrity.gnss.atmosphere import Klobuchar
from integrity.gnss.constants import SPEED_OF_LIGHT_MPS
from integrity.gnss.ephemeris.broadcast import GlonassEphemeris
from integrity.gnss.ephemeris.states import SatelliteStates, satellite_states
from integrity.gnss.ephemeris.store import EphemerisStore
from integrity.gnss.gps_time import NS_PER_S
from integrity.gnss.observations import Floats, Ints, ObservationBlock, ObservationRow, build_block, layout_of
from integrity.gnss.positioning import TRAVEL_TIME_NS, Points, points_at, prefit, state_time_ns
from integrity.gnss.signals import L1_HZ, bands_of, carrier_hz, satellite_of
from integrity.station_monitor import Snapshot

MOST_ROWS_PER_RUN = 1024  # bounds the memory of a fault that lasts for hours
NOMINAL_RANGE_M = SPEED_OF_LIGHT_MPS * TRAVEL_TIME_NS / NS_PER_S  # where only the carrier was measured
RANGE_ITERATIONS = 2  # a satellite moves 1 m in the millisecond by which 300 km change its time of transmission; then 3 um


@dataclass(frozen=True, eq=False)
class RecordedRow:
    """A row at its `place` in the events, with its nominal epoch, and the ephemerides `arrived` and the ionosphere known by then."""

    place: int
    mono_ns: int
    epoch_ns: int
    row: ObservationRow
    arrived: int
    klobuchar: Klobuchar | None


@dataclass(frozen=True, eq=False)
class Truth:
    """The rows of a recording in the order of its events, and the ephemerides in the order of their arrival."""

    site: SiteConfig
    rows: tuple[RecordedRow, ...]
    store: EphemerisStore

    @cached_property
    def channels(self) -> dict[str, int]:
        """GLONASS frequency numbers by satellite, as the ephemerides have them."""
        return {eph.satellite: eph.channel for eph in self.store.ephemerides if isinstance(eph, GlonassEphemeris)}

    def wavelengths_m(self, signals: tuple[str, ...]) -> Floats:
        """Of carriers (n,). Without ephemeris a GLONASS channel counts as the middle one: 0.25 % off at most."""
        return _wavelengths_m(signals, tuple(self.channels.get(satellite_of(s), 0) if s[0] == "R" else 0 for s in signals))

    def covered(self, covers: Callable[[int], bool], receivers: Sequence[str]) -> list[RecordedRow]:
        """Rows of some receivers (of all where none is named) in the epochs that `covers` accepts."""
        names = receivers or self.site.receiver_names
        return [seen for seen in self.rows if covers(seen.epoch_ns) and seen.row.receiver in names]


@lru_cache(maxsize=1024)
def _wavelengths_m(signals: tuple[str, ...], channels: tuple[int, ...]) -> Floats:
    """Rows of one receiver have the same signals for minutes."""
    found = []
    for signal, channel in zip(signals, channels, strict=True):
        carrier = carrier_hz(signal[:1], bands_of(signal)[0])
        first_hz, step_hz = (L1_HZ, 0.0) if carrier is None else carrier
        found.append(SPEED_OF_LIGHT_MPS / (first_hz + step_hz * channel))
    wavelengths = np.array(found)
    wavelengths.setflags(write=False)
    return wavelengths


class RangeChange(NamedTuple):
    """Per signal of a row (n,): `delta_m` longer, growing by `rate_mps`; NaN where no ephemeris says where the satellite is."""

    delta_m: Floats
    rate_mps: Floats


def truth_of(events: Sequence[Heard], site: SiteConfig, snapshot: Snapshot | None) -> Truth:
    """Go through the events once; `snapshot` holds what was known before them."""
    store = EphemerisStore(snapshot.ephemerides if snapshot else ())
    rows: list[RecordedRow] = []
    klobuchar = snapshot.assembler.klobuchar if snapshot else None
    for place, event in enumerate(events):
        match event:
            case ObservationsReceived(mono_ns, row) if row.receiver in site.receiver_names:
                epoch_ns = nominal_epoch_ns(row.receive_time_ns, site.epoch_interval_ns)
                rows.append(RecordedRow(place, mono_ns, epoch_ns, row, len(store), klobuchar))
            case EphemerisReceived(_, ephemeris) if ephemeris.implausibility() is None:
                store.add(ephemeris)
            case IonosphereReceived():
                klobuchar = event.klobuchar
    return Truth(site, tuple(rows), store)


def runs(rows: Iterable[RecordedRow]) -> Iterator[list[RecordedRow]]:
    """The rows by receiver and ionosphere, in runs that are computed at once."""
    by_receiver = sorted(rows, key=lambda seen: seen.row.receiver)
    for _, group in groupby(by_receiver, key=lambda seen: (seen.row.receiver, seen.klobuchar)):
        run = list(group)
        for first in range(0, len(run), MOST_ROWS_PER_RUN):
            yield run[first : first + MOST_ROWS_PER_RUN]


def surveyed(truth: Truth, receiver: str) -> Points:
    """The surveyed point of a receiver, as points of one epoch and one receiver."""
    return _point(next(r.position_ecef_m for r in truth.site.receivers if r.name == receiver))


@lru_cache(maxsize=64)
def _point(pos_ecef_m: tuple[float, float, float]) -> Points:
    """Asked for with every row; its axes and heights cost as much as all the rest of a row."""
    found = points_at(np.array([pos_ecef_m]))
    for part in found:
        part.setflags(write=False)
    return found


def elevations_rad(truth: Truth, run: Sequence[RecordedRow]) -> list[Floats]:
    """Elevation of each row's signals at the surveyed point; NaN without ephemeris."""
    block, states = _block_and_states(truth, run)
    el_rad = prefit(block, states, surveyed(truth, run[0].row.receiver), None).el_rad
    return _by_row(block, run, el_rad)


def range_changes(
    truth: Truth, run: Sequence[RecordedRow], there: Points, velocity_ecef_mps: Floats, longer_m: float = 0.0
) -> list[RangeChange]:
    """What the ranges would be `there` minus what they are at the surveyed point; rows of one receiver, points and velocities (E, 1, 3).

    `longer_m`: what the signals come later by, or the receiver's clock is ahead, so that all of them were sent that much earlier.

    Distance and the Earth's rotation exactly (to 0.01 mm), troposphere and ionosphere by the models of the monitor at the latitude,
    longitude and height that `there` states: with those of the surveyed point only the slant differs, 0.1 mm per 100 m. Of every signal as
    on L1: what the ionosphere changes more on other bands is centimetres over 100 km. Rates to 0.01 mm/s per km of displacement.
    """
    here = surveyed(truth, run[0].row.receiver)
    block, states = _block_and_states(truth, run)
    klobuchar = run[0].klobuchar
    at_here = prefit(block, states, here, klobuchar)
    delta_m = np.zeros_like(at_here.residual_m)
    at_there = at_here
    for _ in range(RANGE_ITERATIONS):
        at_there = prefit(replace(block, pseudorange_m=block.pseudorange_m + delta_m), states, there, klobuchar)
        delta_m = delta_m + at_here.residual_m + longer_m - at_there.residual_m
    satellite_mps = states.vel_ecef_mps[:, :, None, :]
    antenna_mps = np.moveaxis(velocity_ecef_mps, -1, 0)[..., None]
    approach_here = (_in_ecef(at_here.los_enu, here) * satellite_mps).sum(axis=0)
    approach_there = (_in_ecef(at_there.los_enu, there) * (satellite_mps - antenna_mps)).sum(axis=0)
    pairs = zip(_by_row(block, run, delta_m), _by_row(block, run, approach_there - approach_here), strict=True)
    return [RangeChange(delta, rate) for delta, rate in pairs]


def residuals(truth: Truth, run: Sequence[RecordedRow]) -> list[Floats]:
    """Of each row, measured minus modelled ranges at the surveyed point, m, the clock left in; NaN without range or ephemeris."""
    block, states = _block_and_states(truth, run)
    residual_m = prefit(block, states, surveyed(truth, run[0].row.receiver), run[0].klobuchar).residual_m
    by_row = _by_row(block, run, residual_m)
    return [np.where(np.isfinite(seen.row.pseudorange_m), mine, np.nan) for seen, mine in zip(run, by_row, strict=True)]


class Tracks(NamedTuple):
    """Where the satellites of a row's signals are, and how they move, (3, n) in ECEF; NaN without ephemeris."""

    pos_ecef_m: Floats
    vel_ecef_mps: Floats


def tracks(truth: Truth, run: Sequence[RecordedRow]) -> list[Tracks]:
    """Of each row, a travel time before it was measured."""
    block, states = _block_and_states(truth, run)
    axes = [_by_row(block, run, axis[:, None]) for axis in (*states.pos_ecef_m, *states.vel_ecef_mps)]
    return [Tracks(np.array(parts[:3]), np.array(parts[3:])) for parts in zip(*axes, strict=True)]


def _block_and_states(truth: Truth, run: Sequence[RecordedRow]) -> tuple[ObservationBlock, SatelliteStates]:
    """The rows of one receiver as a block, each at its own time; ranges that were not measured are those of another signal of the
    satellite, or a nominal one."""
    receiver = run[0].row.receiver
    layout = layout_of((seen.row for seen in run), codes=None)
    block = build_block((receiver,), [seen.row.receive_time_ns for seen in run], [[seen.row] for seen in run], layout)
    index = truth.store.choose(block.satellites, block.epoch_ns, np.array([seen.arrived for seen in run], dtype=np.int64))
    states = satellite_states(truth.store.ephemerides, index, state_time_ns(block.epoch_ns))
    ranges_m = np.array(block.pseudorange_m)
    for satellite in dict.fromkeys(block.satellites):
        columns = [s for s, other in enumerate(block.satellites) if other == satellite]
        any_m = np.fmax.reduce(ranges_m[:, :, columns], axis=-1, keepdims=True)
        ranges_m[:, :, columns] = np.where(np.isfinite(ranges_m[:, :, columns]), ranges_m[:, :, columns], any_m)
    return replace(block, pseudorange_m=np.where(np.isfinite(ranges_m), ranges_m, NOMINAL_RANGE_M)), states


def _by_row(block: ObservationBlock, run: Sequence[RecordedRow], values: Floats) -> list[Floats]:
    """Values (E, 1, S) of a block, per row in the order of its own signals."""
    column_of = {signal: i for i, signal in enumerate(block.signals)}
    columns: list[Ints] = [np.array([column_of[signal] for signal in seen.row.signals], dtype=np.int64) for seen in run]
    return [values[e, 0, column] for e, column in enumerate(columns)]


def _in_ecef(los_enu: Floats, points: Points) -> Floats:
    """Unit vectors (3, E, 1, S) turned from the axes of the points to ECEF."""
    axes = points.enu[..., None]
    return np.stack([sum((axes[:, :, i, k] * los_enu[i] for i in range(3)), np.zeros(())) for k in range(3)])
