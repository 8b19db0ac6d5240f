"""Where on the map an antenna may be at all: every place that fits, not only the best one [000 3.4].

`search` scores all points of a locus and returns where a solution may begin; `locate` solves from each. Two satellites never locate
anything, since at least one degree of freedom is asked for: they fit several places on a curved line (section 1.7).
"""

from enum import Enum
from typing import NamedTuple

import numpy as np

from integrity.gnss.observations import BEYOND_MEASURE, Bools, Floats, Ints, slices
from integrity.gnss.positioning import Points, Prefit, compared, expected
from train_client.limits import TrainLimits
from train_client.positioning.constrained import NO_CONVERGENCE, OnTrack, Paths, Ranges, Why, solve_on_track
from train_client.positioning.line import Near, along, sums_of


class Search(Enum):
    """What came of looking over the whole map."""

    LOCATED = "located"
    AMBIGUOUS = "several places fit"
    REFUSED = "no place"


class Hypothesis(NamedTuple):
    """A place that fits: `d_m` from the beginning of `segment`, metres of locus; `sse` and its degrees of freedom."""

    segment: int
    d_m: float
    sigma_m: float
    sse: float
    dof: int


class Located(NamedTuple):
    """All places that fit, the best one first; none is preferred under AMBIGUOUS. `why` (SOLVED but for REFUSED) is that of the nearest
    miss."""

    outcome: Search
    why: Why
    hypotheses: tuple[Hypothesis, ...]


def scores(residual_m: Floats, sigma_m: Floats, used: Bools, system_of: Ints, n_systems: int) -> Floats:
    """Weighted squares about the mean of each constellation, (G,), of residuals (G, S) at points; sigma_m, used (S,).

    Equal to generalised least squares of single differences: no satellite is the reference; section 1.4.
    """
    w = np.where(used, 1.0 / (sigma_m * sigma_m), 0.0)
    y = np.where(used, residual_m, 0.0)
    total = np.zeros(len(y))
    for k in range(n_systems):
        of_system = np.where(system_of == k, w, 0.0)
        weight = of_system.sum()
        if weight > 0.0:
            about_mean = y - (of_system * y).sum(axis=1, keepdims=True) / weight
            total += (of_system * about_mean * about_mean).sum(axis=1)
    return total


def reference_satellite_score(residual_m: Floats, used: Bools, reference: int) -> Floats:
    """The thesis's score (G,): squares of the residuals (G, S) less that of one satellite; one constellation, used (S,) [000 3.4]."""
    differences = residual_m[:, used] - residual_m[:, reference, None]
    total: Floats = (differences * differences).sum(axis=1)
    return total


def search(
    ranges: Ranges,
    paths: Paths,
    limits: TrainLimits,
    among: Ints | None = None,
) -> Ints:
    """Segments (M,) from which to solve one epoch of one antenna (ranges and paths of one each; sigma_m, used (S,)), the best score first.

    `among`: only where these segments begin. All local minima of the score are returned of which the line
    through them leaves no more than the margin above the least score: what it leaves is a lower bound, the least score an upper one.
    """
    block, states, klobuchar, sigma_m, used, system_of, n_systems = ranges
    segments = np.arange(len(paths.length_m)) if among is None else np.unique(among)
    if not len(segments):
        return segments

    def seen_from(some: Ints) -> Prefit:
        there = Points(*(p[None, some] for p in paths.points))
        return compared(block, expected(states, block.epoch_ns, there, klobuchar))

    residual_m, el_rad = np.empty((2, len(segments), len(system_of)))
    for few in slices(*residual_m.shape):
        seen = seen_from(segments[few])
        residual_m[few], el_rad[few] = seen.residual_m[0], seen.el_rad[0]
    high = (el_rad >= limits.elevation_mask_rad).all(axis=0)  # the same satellites everywhere
    good = used & high & (np.abs(residual_m) < BEYOND_MEASURE).all(axis=0) & (sigma_m > 0.0) & (sigma_m < np.inf)
    score = np.full(len(paths.length_m), np.inf)
    score[segments] = scores(residual_m, np.where(good, sigma_m, 1.0), good, system_of, n_systems)

    local = _local_minima(paths, score)
    seen = seen_from(local)
    sums = sums_of(seen.residual_m, seen.los_enu, sigma_m, good, system_of, n_systems)
    near = Near(paths.points.pos_ecef_m[local], paths.points.enu[local], sums)
    at_least = along(near, near.pos_ecef_m, paths.along_ecef[local]).sse
    fits = local[~(at_least > score[local].min() + limits.search_margin)]
    best_first: Ints = fits[np.argsort(score[fits], kind="stable")]
    return best_first


def locate(
    ranges: Ranges,
    paths: Paths,
    limits: TrainLimits,
    among: Ints | None = None,
) -> Located:
    """The places of one epoch of one antenna that fit; arguments as of `search`. Beyond a switch, the branches have places of their own."""
    candidates = search(ranges, paths, limits, among)
    if not len(candidates):
        return Located(Search.REFUSED, Why.NOT_ON_TRACK, ())
    found = solve_on_track(ranges, paths, candidates[None], limits)
    best_first = np.argsort(found.sse[0], kind="stable")
    solved = best_first[found.solved[0, best_first]]
    if not len(solved):
        return Located(Search.REFUSED, Why(int(found.why[0, _nearest_miss(found, best_first)])), ())
    fits = [k for k in solved if found.sse[0, k] <= found.sse[0, solved[0]] + limits.search_margin]
    distinct: list[int] = []
    for k in fits:
        if not any(_same(paths, found, k, other, limits) for other in distinct):
            distinct.append(int(k))
    hypotheses = tuple(_hypothesis(found, k) for k in distinct)
    return Located(Search.LOCATED if len(hypotheses) == 1 else Search.AMBIGUOUS, Why.SOLVED, hypotheses)


def _local_minima(paths: Paths, score: Floats) -> Ints:
    """Where the score is not above that of the points before and after (infinite beyond ends, at switches, and where not scored)."""
    padded = np.append(score, np.inf)  # what is negative in `before` and `after` reads the last
    before, after = (np.where(n < 0, len(score), n) for n in (paths.before, paths.after))
    minima: Ints = np.flatnonzero((score <= padded[before]) & (score <= padded[after]) & (score < np.inf))
    return minima


def _nearest_miss(found: OnTrack, best_first: Ints) -> int:
    """The candidate that says most about why there is no place: the least squares of those that came to an end."""
    ended = [int(k) for k in best_first if found.why[0, k] != NO_CONVERGENCE]
    return ended[0] if ended else int(best_first[0])


def _same(paths: Paths, found: OnTrack, k: int, other: int, limits: TrainLimits) -> bool:
    """Whether two solutions are one place: on one segment, or at the corner between two that continue each other."""
    a, b = int(found.segment[0, k]), int(found.segment[0, other])
    if a == b:
        return True
    linked = b in (paths.before[a], paths.after[a]) or a in (paths.before[b], paths.after[b])
    apart = _place(paths, found, k) - _place(paths, found, other)
    return linked and float(np.sqrt((apart * apart).sum())) <= 2.0 * limits.most_outside_m


def _place(paths: Paths, found: OnTrack, k: int) -> Floats:
    segment = found.segment[0, k]
    place: Floats = paths.points.pos_ecef_m[segment] + found.d_m[0, k] * paths.along_ecef[segment]
    return place


def _hypothesis(found: OnTrack, k: int) -> Hypothesis:
    return Hypothesis(
        int(found.segment[0, k]), float(found.d_m[0, k]), float(found.sigma_m[0, k]), float(found.sse[0, k]), int(found.dof[0, k])
    )
