"""Do two receivers hear one transmitter? Asked of their ranges, pair by pair (section 2.6), without any solved position.

Theory of operation. Of a pair A, B, each satellite gives one single difference: prefit of A minus prefit of B, both at their surveyed
points. Of satellites in the sky it is the difference of the two clocks. Of one transmitter, which both hear over one path but for a
constant, it is that plus g, the range from B less the range from A: the pair stands at one point, whichever it is and however it moves. A
clock per constellation is taken out of both with the same weights. What remains of the differences, r, is compared with g:

    Lambda = sum w g^2,  S = sum w r g / sqrt(Lambda),  w = 1 / (2 sigma_d^2):  N(0, 1) of the sky, N(sqrt(Lambda), 1) of one transmitter,
    misfit = sum w (r - g)^2:  chi-square of one transmitter, n satellites less the clocks degrees of freedom

for each constellation, since a transmitter may repeat one of them, and for all together. A receiver that is off by itself moves r too, by
its displacement along the lines of sight: S grows with the part of it that points to the other receiver, and reaches sqrt(Lambda) only
where it stands at the other's point. The middle between the two is the threshold where the pair is far enough apart; the misfit tells a
captured pair from one that happens to be pulled that way.
"""

from itertools import combinations
from typing import NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from integrity.gnss.angles import sine_cosine
from integrity.gnss.observations import Bools, Floats, Ints
from integrity.monitors.residuals import ClockDesign, clock_design, without_clocks
from integrity.probability import chi2_quantile

Number = TypeVar("Number", np.float64, np.int64)


class PairDesign(NamedTuple):
    """The pairs (P) before anything is measured, for the constellations present (L), then all together: `separation` is sqrt(Lambda)."""

    receivers: tuple[tuple[int, int], ...]
    clocks: ClockDesign
    member: Bools  # (L, E, 1, S): satellites used, by constellation
    w: Floats  # (E, 1, S)
    range_m: Floats  # (E, P, S), from the second receiver of the pair less from the first
    g_m: Floats  # the same, clocks taken out, 0 where not used
    separation: Floats  # (E, P, L + 1)
    dof: Ints  # (E, 1, L + 1)


class PairStatistics(NamedTuple):
    """(E, P, L + 1), the last column for all constellations together: `collapse` is S, and `misfit` to one transmitter; see the module."""

    collapse: Floats
    misfit: Floats
    separation: Floats
    dof: Ints


def pair_design(range_m: Floats, sigma_differential_m: Floats, used: Bools, system_of: Ints, n_systems: int) -> PairDesign:
    """What follows from the ranges expected at the surveyed points (E, R, S), m, and the satellites `used` (E, S), with the standard
    deviation (E, S), m, of what one receiver measures differently from the others."""
    pairs = tuple(combinations(range(range_m.shape[1]), 2))
    clocks = clock_design(np.sqrt(2.0) * sigma_differential_m, used, system_of, n_systems)
    a, b = ([pair[side] for pair in pairs] for side in (0, 1))
    difference_m = range_m[:, b] - range_m[:, a]
    g_m = _centred(clocks, difference_m)
    present = np.flatnonzero(np.bincount(system_of, minlength=n_systems))
    member = clocks.determines[present]
    Lambda = _with_total(_sums(member, clocks.w * g_m * g_m))
    count = member.sum(axis=-1)  # (L, E, 1)
    dof = _with_total(np.moveaxis(np.maximum(count - 1, 0), 0, -1))
    return PairDesign(pairs, clocks, member, clocks.w, difference_m, g_m, np.sqrt(Lambda), dof)


def pair_statistics(of: PairDesign, prefit_m: Floats) -> PairStatistics:
    """What prefit residuals (E, R, S), m, say of the pairs; every satellite used is measured by all receivers."""
    a, b = ([pair[side] for pair in of.receivers] for side in (0, 1))
    r_m = _centred(of.clocks, prefit_m[:, a] - prefit_m[:, b])
    along = _with_total(_sums(of.member, of.w * r_m * of.g_m))
    misfit = _with_total(_sums(of.member, of.w * (r_m - of.g_m) ** 2))
    S = along / np.where(of.separation > 0.0, of.separation, np.nan)
    return PairStatistics(S, misfit, of.separation, of.dof)


def capture(statistics: PairStatistics, k: float, least_separation: float) -> Floats:
    """The statistic of the check, (E, P), in sigmas: passes where at most k, that is, where S is at most k or half the separation, the
    larger; the worst of a pair's constellations and of all together. NaN where none separates by `least_separation`."""
    separation = statistics.separation
    with np.errstate(divide="ignore"):
        scaled = statistics.collapse * np.minimum(1.0, 2.0 * k / separation)
    worst: Floats = np.where(separation >= least_separation, scaled, -np.inf).max(axis=-1)
    return np.where(np.isinf(worst), np.nan, worst)


def captured(statistics: PairStatistics, k: float, least_separation: float, missed_detection: float) -> Bools:
    """Pairs (E, P) of which one transmitter is the explanation: some constellation, or all together, is beyond the threshold and fits one
    transmitter as well as all but `missed_detection` of captured pairs do."""
    dofs = statistics.dof
    most = np.array([0.0, *(chi2_quantile(missed_detection, n) for n in range(1, int(dofs.max(initial=0)) + 1))])
    beyond = (statistics.separation >= least_separation) & ~(statistics.collapse <= np.maximum(k, statistics.separation / 2.0))
    result: Bools = np.any(beyond & (dofs > 0) & (statistics.misfit <= most[dofs]), axis=-1)
    return result


def phase_agreement(
    pair: PairDesign, prefit_m: Floats, carrier_ahead_m: Floats, wavelength_m: Floats, least_tail: float
) -> tuple[Floats, Floats]:
    """Do the carrier phases say one transmitter, too? Statistic and threshold, (E, P): they do where the first is beyond the second.

    `carrier_ahead_m` (E, R, S): carrier less pseudorange, m, NaN where no phase is known to the cycle; `wavelength_m` (S,), the same for
    all of a constellation (no channels of GLONASS). Over one path both receivers measure phases that differ by one fraction of a cycle,
    the same for all satellites of a constellation, whatever their whole cycles and however well the points are known; under the sky the
    baseline makes fractions of every size. 2 n R^2 of n such fractions, R the length of their mean as unit vectors, is chi-square with 2
    degrees of freedom then (Rayleigh), and about 2 n over one path; summed over constellations. A receiver's bias never aligns phases.
    NaN where no constellation has two satellites with phases.
    """
    a, b = ([p[side] for p in pair.receivers] for side in (0, 1))
    phase_m = prefit_m + carrier_ahead_m
    turns = (phase_m[:, a] - phase_m[:, b] - pair.range_m) / wavelength_m
    known = np.isfinite(turns)
    sine, cosine = sine_cosine(2.0 * np.pi * np.where(known, turns - np.rint(turns), 0.0))
    member = pair.member & known
    n = np.moveaxis(member.sum(axis=-1), 0, -1)  # (E, P, L)
    length2 = _sums(member, sine) ** 2 + _sums(member, cosine) ** 2
    several = n >= 2
    statistic = np.where(several, 2.0 * length2 / np.maximum(n, 1), 0.0).sum(axis=-1)
    dof = 2 * several.sum(axis=-1)
    threshold = np.array([np.nan, *(chi2_quantile(least_tail, k) for k in range(1, 2 * len(pair.member) + 1))])[dof]
    return np.where(dof > 0, statistic, np.nan), threshold


def captured_receivers(pairs: Bools, n_receivers: int) -> Bools:
    """Receivers (E, R) of the captured pairs (E, P): never fewer than two, never one that hears the sky."""
    result = np.zeros((len(pairs), n_receivers), dtype=np.bool_)
    for p, pair in enumerate(combinations(range(n_receivers), 2)):
        result[:, pair] |= pairs[:, p, None]
    return result


def _centred(clocks: ClockDesign, values_m: Floats) -> Floats:
    """Values (E, P, S) less the weighted mean of their constellation; 0 where not used."""
    result: Floats = np.where(clocks.used[:, None], without_clocks(clocks, values_m).residual_m, 0.0)
    return result


def _sums(member: Bools, terms: Floats) -> Floats:
    """Sums over the satellites of each constellation, (E, P, L), of terms (E, P, S)."""
    return np.moveaxis(np.where(member, terms, 0.0).sum(axis=-1), 0, -1)


def _with_total(sums: NDArray[Number]) -> NDArray[Number]:
    return np.concatenate((sums, sums.sum(axis=-1, keepdims=True)), axis=-1)
