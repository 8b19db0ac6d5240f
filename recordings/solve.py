"""Positions of one receiver over its recording, block by block: what `integrity.gnss` makes of a file without a station around it.

Broadcast orbits, weighted least squares, nothing excluded; of each satellite the code that was measured most often. A block of pairs
(`combination.ionosphere_free`) is solved like any other, with the codes of pairs.
"""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from integrity.gnss.atmosphere import Ionosphere
from integrity.gnss.ephemeris.broadcast import Ephemeris
from integrity.gnss.ephemeris.states import SatelliteStates, accuracy_m, satellite_states, usable
from integrity.gnss.ephemeris.store import EphemerisStore
from integrity.gnss.least_squares import Unsolved
from integrity.gnss.observations import ROW_ARRAYS, Floats, Ints, ObservationBlock
from integrity.gnss.positioning import (
    RELINEARISE_BEYOND_M,
    Points,
    points_at,
    positions,
    prefit,
    range_accuracy_m,
    range_sigma_m,
    state_time_ns,
)
from integrity.gnss.signals import MONITORED_CODES, TIME_SCALES, Codes, time_scale_index

EARTH_RADIUS_M = 6_371_000.0
EVERYWHERE_RAD = -np.pi / 2  # a mask that nothing is below
EPOCHS_TRIED = 10


class Weights(NamedTuple):
    """The range sigma that is expected, sqrt(a^2 + (b / sin el)^2), and the elevation from which on satellites are used."""

    a_m: float
    b_m: float
    mask_rad: float


class Track(NamedTuple):
    """Positions in ECEF at the times of the receiver's clock, in the order of the file: (E,), (E, 3), (E,); NaN where `why` says so."""

    time_ns: Ints
    pos_ecef_m: Floats
    n_used: Ints
    why: Ints  # `Unsolved`


class Sky:
    """Broadcast data of a recording: each epoch uses what had been transmitted by then, or, where that is nothing, what came later."""

    def __init__(self, ephemerides: Iterable[Ephemeris], ionosphere: Ionosphere | None) -> None:
        in_order = sorted(dict.fromkeys(ephemerides), key=lambda eph: eph.transmission_ns)
        self.store = EphemerisStore(in_order)
        self.ionosphere = ionosphere
        self._transmission_ns = np.array([eph.transmission_ns for eph in in_order], dtype=np.int64)

    def choose(self, satellites: Sequence[str], epoch_ns: Ints) -> Ints:
        """Index (E, S) into the store's ephemerides, -1 for none; `epoch_ns` (E,) does not decrease."""
        index = self.store.choose(satellites, epoch_ns, np.searchsorted(self._transmission_ns, epoch_ns, "right"))
        if (index >= 0).all():
            return index
        return np.where(index >= 0, index, self.store.choose(satellites, epoch_ns, np.full(len(epoch_ns), len(self.store))))


def solved(
    blocks: Iterable[ObservationBlock],
    sky: Sky,
    weights: Weights,
    approx_position_ecef_m: Sequence[float] | None,
    codes: Codes = MONITORED_CODES,
) -> Iterator[Track]:
    """A track for each block of one receiver.

    Positions are linearised at the given point, or where the receiver was last, once it is over 1 km away; within a block again where
    it is that far. Without a point, an epoch with as many satellites as any finds one.
    """
    points = None if approx_position_ecef_m is None else points_at(np.array([approx_position_ecef_m], dtype=np.float64))
    for block in blocks:
        order = np.argsort(block.epoch_ns, kind="stable")
        chosen = _one_signal_each(block, codes, order)
        index = sky.choose(chosen.satellites, chosen.epoch_ns)
        states = satellite_states(sky.store.ephemerides, index, state_time_ns(chosen.epoch_ns), chosen.signals)
        start = _found(chosen, index, sky, weights) if points is None else points
        if start is None:
            yield _nowhere(block.epoch_ns)
            continue
        track = _track(chosen, states, index, sky, weights, start)
        known = np.flatnonzero(track.why == Unsolved.SOLVED)
        if len(known):
            last_m = track.pos_ecef_m[known[-1]]
            away_m = np.abs(last_m - start.pos_ecef_m[0, 0]).max()
            points = points_at(last_m[None]) if away_m > RELINEARISE_BEYOND_M else start
        back = np.argsort(order)
        yield Track(track.time_ns[back], track.pos_ecef_m[back], track.n_used[back], track.why[back])


def _nowhere(time_ns: Ints) -> Track:
    n = len(time_ns)
    return Track(time_ns, np.full((n, 3), np.nan), np.zeros(n, dtype=np.int64), np.full(n, Unsolved.TOO_FEW_SATELLITES, dtype=np.int64))


def _one_signal_each(block: ObservationBlock, codes: Codes, order: Ints) -> ObservationBlock:
    """The epochs of a block in the order of time, with the signal of each satellite that was measured most often, the first of equals."""
    place = {signal: s for s, signal in enumerate(block.signals)}
    measured = np.isfinite(block.pseudorange_m).sum(axis=(0, 1))
    found = {}
    for satellite in dict.fromkeys(block.satellites):
        named = (f"{satellite}.{code}" for code in codes.get(satellite[0], ()))
        found[satellite] = max((place[signal] for signal in named if signal in place), key=measured.__getitem__, default=None)
    columns = [s for s in found.values() if s is not None]
    in_order = bool((np.diff(order) == 1).all())
    if in_order and len(columns) == len(block.signals):
        return block
    arrays: dict[str, Any] = {name: np.take(getattr(block, name), columns, axis=2) for name in ROW_ARRAYS}
    if not in_order:
        arrays = {name: array[order] for name, array in arrays.items()}
    return replace(
        block,
        signals=tuple(block.signals[s] for s in columns),
        satellites=tuple(block.satellites[s] for s in columns),
        epoch_ns=block.epoch_ns[order],
        receive_time_ns=block.receive_time_ns[order],
        **arrays,
    )


def _track(block: ObservationBlock, states: SatelliteStates, index: Ints, sky: Sky, weights: Weights, points: Points) -> Track:
    ephemerides = sky.store.ephemerides
    first = prefit(block, states, points, sky.ionosphere)
    sigma_m = range_sigma_m(first.el_rad, weights.a_m, weights.b_m, range_accuracy_m(states, accuracy_m(ephemerides, index))[:, None])
    used = (first.el_rad >= weights.mask_rad) & usable(ephemerides, index)[:, None]
    system_of = np.array([time_scale_index(s) for s in block.satellites], dtype=np.int64)
    found = positions(block, states, points, sky.ionosphere, first, sigma_m, used, system_of, len(TIME_SCALES))
    pos_ecef_m = points.pos_ecef_m[0] + np.einsum("ji,ej->ei", points.enu[0, 0], found.e_enu_m[:, 0])
    return Track(block.epoch_ns, pos_ecef_m, found.n_used[:, 0], found.why[:, 0])


def _found(block: ObservationBlock, index: Ints, sky: Sky, weights: Weights) -> Points | None:
    """Where the receiver is, from below the satellites of the epochs that have most; if none of these can be solved, below those of the
    first of them: then each epoch shall say for itself why it cannot. None where no satellite was seen."""
    seen = np.isfinite(block.pseudorange_m[:, 0]) & usable(sky.store.ephemerides, index)
    count = seen.sum(axis=1)
    anywhere = None
    for e in np.argsort(-count, kind="stable")[:EPOCHS_TRIED].tolist():
        if not count[e]:
            break
        few = slice(e, e + 1)
        one = replace(block, **{name: getattr(block, name)[few] for name in ("epoch_ns", "receive_time_ns", *ROW_ARRAYS)})
        states = satellite_states(sky.store.ephemerides, index[few], state_time_ns(one.epoch_ns), one.signals)
        below = states.pos_ecef_m[:, 0, seen[e]].mean(axis=1)
        point = points_at((EARTH_RADIUS_M * below / np.sqrt((below * below).sum()))[None])
        track = _track(one, states, index[few], sky, weights._replace(mask_rad=EVERYWHERE_RAD), point)
        if track.why[0] == Unsolved.SOLVED:
            return points_at(track.pos_ecef_m)
        anywhere = anywhere or point
    return anywhere
