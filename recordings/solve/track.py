"""Positions of one receiver over its recording, block by block: what `integrity.gnss` makes of a file without a station around it.

Broadcast orbits, weighted least squares; of each satellite the code that was measured most often. A block of pairs
(`combination.ionosphere_free`) is solved like any other, with the codes of pairs. Tests and exclusion, velocities, the residual of every
range, and smoothing by the carrier come on top, and cost nothing where they are not asked for.
"""

from collections.abc import Iterable, Iterator, Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from integrity.gnss.least_squares import Unsolved, solution
from integrity.gnss.observations import ObservationBlock
from integrity.gnss.positioning import RELINEARISE_BEYOND_M, Points, points_at, relinearised
from integrity.gnss.signals import MONITORED_CODES, Codes
from recordings.solve.results import Track, nothing_found, taken
from recordings.solve.sky import Seen, Sky, View, Weights, epochs_of, few_epochs, seen_of, view_of

if TYPE_CHECKING:
    from integrity.gnss.detection import Criteria
    from recordings.solve.smoothing import Smoother

EARTH_RADIUS_M = 6_371_000.0
EVERYWHERE_RAD = -np.pi / 2  # a mask that nothing is below
EPOCHS_TRIED = 10


class Wanted(NamedTuple):
    """What is asked for beside positions: tests and exclusion by these criteria, velocities, smoothed ranges, every range."""

    criteria: "Criteria | None" = None
    velocity: bool = False
    smoother: "Smoother | None" = None
    ranges: bool = False


POSITIONS = Wanted()


def solved(
    blocks: Iterable[ObservationBlock],
    sky: Sky,
    weights: Weights,
    approx_position_ecef_m: Sequence[float] | None,
    codes: Codes = MONITORED_CODES,
    wanted: Wanted = POSITIONS,
) -> Iterator[Track]:
    """A track for each block of one receiver, in its order; the ranges, if asked for, in the order of time.

    Positions are linearised at the given point, or where the receiver was last, once it is over 1 km away; within a block again where
    it is that far. Without a point, an epoch with as many satellites as any finds one.
    """
    points = None if approx_position_ecef_m is None else points_at(np.array([approx_position_ecef_m], dtype=np.float64))
    for block in blocks:
        order = np.argsort(block.epoch_ns, kind="stable")
        in_order = bool((np.diff(order) == 1).all())
        seen = seen_of(block if in_order else few_epochs(block, order), codes, sky, wanted.smoother)
        start = _found(seen, sky, weights, wanted) if points is None else points
        if start is None:
            too_few = np.full(len(order), Unsolved.TOO_FEW_SATELLITES, dtype=np.int64)
            yield nothing_found(block.epoch_ns, too_few, wanted.velocity, wanted.criteria is not None)
            continue
        track = _track(seen, sky, weights, start, wanted)
        known = np.flatnonzero(track.solved)
        if len(known):
            last_m = track.pos_ecef_m[known[-1]]
            away_m = np.abs(last_m - start.pos_ecef_m[0, 0]).max()
            points = points_at(last_m[None]) if away_m > RELINEARISE_BEYOND_M else start
        yield track if in_order else taken(track, np.argsort(order))._replace(ranges=track.ranges)


def _track(seen: Seen, sky: Sky, weights: Weights, points: Points, wanted: Wanted) -> Track:
    view = view_of(seen, sky, weights, points)
    found = relinearised(solution(view.of, view.first.residual_m), view.of, seen.block, seen.states, points, sky.ionosphere)
    pos_ecef_m = points.pos_ecef_m[0] + np.einsum("ji,ej->ei", points.enu[0, 0], found.e_enu_m[:, 0])
    track = Track(seen.block.epoch_ns, pos_ecef_m, found.n_used[:, 0], found.why[:, 0])
    if wanted.criteria is None and not wanted.velocity and not wanted.ranges:
        return track
    from recordings.solve.details import detailed  # and with it scipy, which takes as long as an hour of data

    def seen_from(elsewhere: Points) -> View:
        return view_of(seen, sky, weights, elsewhere)

    return detailed(track, seen, view, seen_from, wanted.criteria, wanted.velocity, wanted.ranges, sky)


def _found(seen: Seen, sky: Sky, weights: Weights, wanted: Wanted) -> Points | None:
    """Where the receiver is, from below the satellites of the epochs that have most, by one that passes the tests, if they are asked for;
    if none of these can be solved, below those of the first of them: then each epoch shall say for itself why it cannot. None where no
    satellite was seen."""
    measured = np.isfinite(seen.block.pseudorange_m[:, 0]) & seen.usable
    count = measured.sum(axis=1)
    anywhere = None
    only_tests = Wanted(wanted.criteria)
    for e in np.argsort(-count, kind="stable")[:EPOCHS_TRIED].tolist():
        if not count[e]:
            break
        one = epochs_of(seen, slice(e, e + 1), sky)
        below = one.states.pos_ecef_m[:, 0, measured[e]].mean(axis=1)
        point = points_at((EARTH_RADIUS_M * below / np.sqrt((below * below).sum()))[None])
        track = _track(one, sky, weights._replace(mask_rad=EVERYWHERE_RAD), point, only_tests)
        if track.solved[0]:
            return points_at(track.pos_ecef_m)
        anywhere = anywhere or point
    return anywhere
