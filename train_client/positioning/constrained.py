"""Where antennas are along their track: one unknown along the line, and a clock per constellation [000 3.5].

The path: `solve_on_track` compares a block with what would be seen where given segments begin; `line.sums_of` boils the satellites of
each epoch and antenna down to what any line needs; `follow` hops from segment to segment until the solution lies on the one that it was
made for. Where that is far from the point of linearisation, it is linearised again.

Nothing is clamped: a solution beyond the end of the map, or beyond a switch, is refused with that reason.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum
from typing import Any, NamedTuple, TypeVar

import numpy as np

from integrity.gnss.atmosphere import Klobuchar
from integrity.gnss.ephemeris.states import SatelliteStates
from integrity.gnss.observations import Bools, Floats, Ints, ObservationBlock, freeze
from integrity.gnss.positioning import Expected, Points, compared, expected, points_at
from train_client.limits import TrainLimits
from train_client.positioning.line import Along, Near, along, clocks_m, dot, sums_of, time_dilution
from train_client.track.locus import AT_SWITCH, Locus


class Why(IntEnum):
    """Why an antenna has no place, or SOLVED."""

    SOLVED = 0
    TOO_FEW_SATELLITES = 1
    POOR_GEOMETRY = 2
    OFF_MAP_END = 3
    AT_SWITCH = 4  # beyond the segment several continue
    NOT_ON_TRACK = 5  # what was measured fits no place here: an anomaly of signals, or another track
    NO_CONVERGENCE = 6


# Plain numbers for arrays: members of an enumeration are taken five times slower.
SOLVED, TOO_FEW_SATELLITES, POOR_GEOMETRY, OFF_MAP_END, SWITCH_AHEAD, NOT_ON_TRACK, NO_CONVERGENCE = (int(why) for why in Why)
HOPS_ON = -1  # no reason to end yet


@dataclass(frozen=True, eq=False)
class OnTrack:
    """Antennas on their loci, (E, R): `d_m` from the beginning of `segment`, metres of locus, with `sigma_m`; `clock_m`, `ttdop` (E, R, K).

    NaN unless SOLVED; `segment` is then the last one tried, and `sse` (weighted), `tpdop`, `dof`, `n_used` tell why. `dof` is
    n - 1 - C, with C clocks.
    """

    segment: Ints
    d_m: Floats
    clock_m: Floats
    sigma_m: Floats
    tpdop: Floats
    ttdop: Floats
    sse: Floats
    dof: Ints
    n_used: Ints
    why: Ints

    def __post_init__(self) -> None:
        freeze(self)

    @property
    def tgdop(self) -> Floats:
        """Dilution of place and clocks together, (E, R): sqrt(TPDOP^2 + sum TTDOP^2); 1.6."""
        result: Floats = np.sqrt(self.tpdop**2 + np.nansum(self.ttdop**2, axis=-1))
        return result

    @property
    def solved(self) -> Bools:
        """Where there is a place, (E, R)."""
        result: Bools = self.why == SOLVED
        return result


@dataclass(frozen=True, eq=False)
class Paths:
    """Loci of R antennas side by side, their G segments numbered through from `begins` (R,); `points` at all segments' beginnings (G, ...);
    `before`, `after` (G,) numbered through, or negative as in `Locus`."""

    loci: tuple[Locus, ...]
    begins: Ints
    points: Points
    along_ecef: Floats
    length_m: Floats
    before: Ints
    after: Ints

    def __post_init__(self) -> None:
        freeze(self)


class Ranges(NamedTuple):
    """What antennas measured, and what is known of it: the block, `states` at `state_time_ns` of its epochs, broadcast ionosphere; sigmas
    and which may be `used`, both broadcast to (E, R, S); `system_of` (S,) numbers the constellation, of `n_systems`."""

    block: ObservationBlock
    states: SatelliteStates
    klobuchar: Klobuchar | None
    sigma_m: Floats
    used: Bools
    system_of: Ints
    n_systems: int


class Followed(NamedTuple):
    """Where hopping ended (n,): a segment, numbered through, and the solution on it."""

    segment: Ints
    why: Ints
    along: Along


def paths_of(loci: Sequence[Locus]) -> Paths:
    """Loci side by side, one per antenna in the order of the block's receivers."""
    begins = np.cumsum([0, *(len(locus.length_m) for locus in loci[:-1])])

    def joined(name: str) -> Floats:
        return np.concatenate([getattr(locus, name) for locus in loci])

    def numbered(name: str) -> Ints:
        return np.concatenate([np.where(n < 0, n, n + b) for n, b in zip([getattr(x, name) for x in loci], begins, strict=True)])

    points = Points(*(p[0] for p in points_at(joined("pos_ecef_m"))))
    return Paths(tuple(loci), begins, points, joined("along_ecef"), joined("length_m"), numbered("before"), numbered("after"))


def solve_on_track(ranges: Ranges, paths: Paths, segment: Ints, limits: TrainLimits, sight: Expected | None = None) -> OnTrack:
    """Places of a block's antennas, sought from `segment` (E, R) on.

    `sight` is what `sight_at` gives for these epochs and segments, where it was computed ahead; it changes no bit of the result.
    Satellites below the mask are not used. First order in the distance from the point of linearisation: below 1 mm. `sigma_m` of the
    result holds for the sigmas given.
    """
    block, states, klobuchar, sigma_m, used, system_of, n_systems = ranges

    def near(at: Points, sight: Expected | None = None) -> Near:
        seen = compared(block, sight or expected(states, block.epoch_ns, at, klobuchar))
        high = used & (seen.el_rad >= limits.elevation_mask_rad)
        sums = sums_of(seen.residual_m, seen.los_enu, sigma_m, high, system_of, n_systems)
        return Near(at.pos_ecef_m.reshape(-1, 3), at.enu.reshape(-1, 3, 3), sums)

    here = near(_begins(paths, segment), sight)
    found = follow(paths, here, (segment + paths.begins).ravel(), limits)
    for _ in range(limits.most_linearisations - 1):
        pos, far = _far(paths, here, found, limits)
        if not far.any():
            break
        again = near(points_at(np.where(far[:, None], pos, here.pos_ecef_m).reshape(*segment.shape, 3)))
        found = _merged(far, follow(paths, again, found.segment, limits), found)
        here = _merged(far, again, here)
    else:
        _, far = _far(paths, here, found, limits)
        found = found._replace(why=np.where(far & (found.why == SOLVED), NO_CONVERGENCE, found.why))
    return _on_track(paths, here, found, segment.shape, limits)


def sight_at(paths: Paths, segment: Ints, states: SatelliteStates, epoch_ns: Ints, klobuchar: Klobuchar | None) -> Expected:
    """What would be seen where the segments (E, R) begin: nothing measured is needed, so that it can be known before an epoch comes."""
    return expected(states, epoch_ns, _begins(paths, segment), klobuchar)


def _begins(paths: Paths, segment: Ints) -> Points:
    through = segment + paths.begins
    return Points(*(p[through] for p in paths.points))


def follow(paths: Paths, near: Near, start: Ints, limits: TrainLimits) -> Followed:
    """Hop from segments `start` (n,) until each solution lies on the segment that it was made for.

    At a corner two segments may each refer to the other: then the one stays whose end is nearer to its own solution, which lies outside
    by no more than (angle of the corner) x (error across the track).
    """
    line = along(near, paths.points.pos_ecef_m[start], paths.along_ecef[start])
    outside_m, onward = _beyond(paths, line, start)
    why = np.where(near.sums.dof >= limits.min_redundancy, _ended(line, outside_m, onward, limits), TOO_FEW_SATELLITES)
    active = np.flatnonzero(why == HOPS_ON)
    if not len(active):
        return Followed(start, why, line)
    segment, values, came_from, here = start.copy(), np.array(line), start[active], onward[active]
    for _ in range(limits.most_hops):
        line = along(near.some(active), paths.points.pos_ecef_m[here], paths.along_ecef[here])
        beyond_m, onward = _beyond(paths, line, here)
        back = onward == came_from
        better = ~(back & (beyond_m >= outside_m[active]))
        kept = active[better]
        segment[kept], outside_m[kept], values[:, kept] = here[better], beyond_m[better], np.array(line)[:, better]
        ended = _ended(line, beyond_m, onward, limits)
        at_corner = np.where(outside_m[active] <= limits.most_outside_m, SOLVED, NO_CONVERGENCE)
        ended = np.where(back & (ended == HOPS_ON), at_corner, ended)
        why[active] = ended
        goes_on = ended == HOPS_ON
        active, came_from, here = active[goes_on], here[goes_on], onward[goes_on]
        if not len(active):
            break
    why[active] = NO_CONVERGENCE
    return Followed(segment, why, Along(*values))


def _beyond(paths: Paths, line: Along, here: Ints) -> tuple[Floats, Ints]:
    """How far solutions lie outside their segments (negative inside), m, and the segment or the end on that side."""
    beyond_m = np.maximum(-line.d_m, line.d_m - paths.length_m[here])
    return beyond_m, np.where(line.d_m < 0.0, paths.before[here], paths.after[here])


def _ended(line: Along, beyond_m: Floats, onward: Ints, limits: TrainLimits) -> Ints:
    """Why a search ends on a segment, or HOPS_ON, (n,)."""
    ended = np.where(onward >= 0, HOPS_ON, np.where(onward == AT_SWITCH, SWITCH_AHEAD, OFF_MAP_END))
    ended = np.where(beyond_m <= 0.0, SOLVED, ended)
    result: Ints = np.where(line.tpdop <= limits.most_tpdop, ended, POOR_GEOMETRY)
    return result


def _far(paths: Paths, near: Near, found: Followed, limits: TrainLimits) -> tuple[Floats, Bools]:
    """The points (n, 3) of the segments nearest to the solutions, and which lie too far from where they were linearised."""
    segment = found.segment
    on_m = np.minimum(np.maximum(found.along.d_m, 0.0), paths.length_m[segment])
    pos = paths.points.pos_ecef_m[segment] + on_m[:, None] * paths.along_ecef[segment]
    away = pos - near.pos_ecef_m
    far = dot(away, away) > limits.relinearise_beyond_m**2
    return pos, far & (found.why != NO_CONVERGENCE)


def _on_track(paths: Paths, near: Near, found: Followed, shape: tuple[int, ...], limits: TrainLimits) -> OnTrack:
    """The outcome in the shape of the block; what does not fit is refused."""
    segment, why, (d_m, s_aa, sse, tpdop) = found
    fits = sse <= limits.residual_limit(near.sums.dof)
    why = np.where((why == SOLVED) & ~fits, NOT_ON_TRACK, why)
    solved = why == SOLVED
    d_m = np.where(solved, d_m, np.nan)
    place = paths.points.pos_ecef_m[segment] + d_m[:, None] * paths.along_ecef[segment]
    clock_m = clocks_m(near, place)
    return OnTrack(
        segment=segment.reshape(shape) - paths.begins,
        d_m=d_m.reshape(shape),
        clock_m=clock_m.reshape(*shape, clock_m.shape[-1]),
        sigma_m=np.sqrt(1.0 / np.where(solved, s_aa, np.nan)).reshape(shape),
        tpdop=tpdop.reshape(shape),
        ttdop=time_dilution(near, paths.along_ecef[segment], found.along).reshape(*shape, clock_m.shape[-1]),
        sse=sse.reshape(shape),
        dof=near.sums.dof.reshape(shape),
        n_used=near.sums.n_used.reshape(shape),
        why=why.reshape(shape),
    )


T = TypeVar("T", Near, Followed)


def _merged(chosen: Bools, a: T, b: T) -> T:
    """`a` where `chosen` (n,), else `b`, in every array (n, ...) they hold."""

    def merged(x: Any, y: Any) -> Any:
        if isinstance(x, tuple):
            return type(x)(*(merged(*pair) for pair in zip(x, y, strict=True)))
        return np.where(chosen.reshape(-1, *(1,) * (x.ndim - 1)), x, y)

    result: T = merged(a, b)
    return result
