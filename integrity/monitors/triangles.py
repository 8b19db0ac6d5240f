"""The solved triangle against the reference triangle: circles, common position, shape, collapse, and who is to blame.

e_j is solved minus surveyed position of receiver j, east, north, up. Error model (section 2.2): e_j = c + d_j, with c common to all
receivers (Sigma_c) and d_j each receiver's own (Sigma_d), both diagonal. The site states both for its usual geometry; in an epoch
whose satellites promise less (a satellite excluded, few in sight), both variances grow by the same factor, axis by axis. The circles
do not grow: what the line tolerates does not depend on the sky. NaN in, NaN out: a check on NaN does not pass.
"""

from itertools import combinations, permutations
from typing import NamedTuple

import numpy as np

from integrity.config import IntegrityConfig
from integrity.gnss.observations import Bools, Floats
from integrity.limits import Limits
from integrity.triangle import ReferenceTriangle


class TriangleStatistics(NamedTuple):
    """Per epoch: `circle_m` (E, R), `common`, `common_3d`, `shape`, `shape_3d`, `collapse` (E,)."""

    circle_m: Floats
    common: Floats
    common_3d: Floats
    shape: Floats
    shape_3d: Floats
    collapse: Floats


class NamingStatistics(NamedTuple):
    """What is asked where something failed. Per receiver, (E, R): `isolation` t_j, `pair` T_pair of the others, `log_likelihood_ratio`;
    per epoch, (E,): `collapse_fit`, how well one point fits all solved ones."""

    isolation: Floats
    pair: Floats
    log_likelihood_ratio: Floats
    collapse_fit: Floats


class Variances(NamedTuple):
    """m2, east, north, up, each (E, 3): diagonals of Sigma_c and Sigma_d, and variances of the mean displacement of the receivers;
    `separation` (E,), sqrt(Lambda) of section 2.6: how many sigma of S lie between the reference triangle and a single point."""

    common: Floats
    differential: Floats
    mean: Floats
    separation: Floats


def promised_m2(promises: IntegrityConfig) -> tuple[Floats, Floats]:
    """Diagonals (3,) of Sigma_c and Sigma_d as the site states them, m2: east, north, up."""
    common = np.array([promises.sigma_common_m, promises.sigma_common_m, promises.sigma_common_up_m]) ** 2
    differential = np.array([promises.sigma_differential_m, promises.sigma_differential_m, promises.sigma_differential_up_m]) ** 2
    return common, differential


def variances(cov_enu_m2: Floats, promises: IntegrityConfig, triangle: ReferenceTriangle) -> Variances:
    """The site's variances, grown where the covariance of the solutions (E, R, 3, 3), mean over receivers, exceeds the common one."""
    common, differential = promised_m2(promises)
    promised = np.diagonal(cov_enu_m2, axis1=-2, axis2=-1).mean(axis=1)
    growth = np.maximum(promised / common, 1.0)
    return variances_of(common * growth, differential * growth, triangle)


def variances_of(common: Floats, differential: Floats, triangle: ReferenceTriangle) -> Variances:
    """All that follows from the variances of the errors that are common, and of each receiver's own (E, 3)."""
    Lambda = (triangle.baseline_enu_m**2 / differential[:, None, :]).sum(axis=2).sum(axis=1)
    return Variances(common, differential, common + differential / len(triangle.names), np.sqrt(Lambda))


def triangle_statistics(e_enu_m: Floats, var: Variances, triangle: ReferenceTriangle) -> TriangleStatistics:
    """The statistics of all checks of displacements (E, R, 3)."""
    n = e_enu_m.shape[1]
    mean = np.add.reduce(e_enu_m, axis=1) / n
    own = e_enu_m - mean[:, None, :]
    var_d = var.differential[:, None, :]

    common = np.add.accumulate(mean**2 / var.mean, axis=-1)  # east, then with north, then with up
    shape = np.add.accumulate(np.add.reduce(own**2 / var_d, axis=1), axis=-1)
    return TriangleStatistics(
        circle_m=np.hypot(e_enu_m[..., 0], e_enu_m[..., 1]),
        common=common[:, 1],
        common_3d=common[:, 2],
        shape=shape[:, 1],
        shape_3d=shape[:, 2],
        collapse=collapse_statistic(own, triangle.baseline_enu_m, var),
    )


def naming_statistics(e_enu_m: Floats, var: Variances, triangle: ReferenceTriangle) -> NamingStatistics:
    """What displacements (E, R, 3) say of who is off."""
    n = e_enu_m.shape[1]
    own = e_enu_m - e_enu_m.sum(axis=1, keepdims=True) / n
    var_d = var.differential[:, None, :]
    return NamingStatistics(
        isolation=n / (n - 1) * (own**2 / var_d).sum(axis=-1),
        pair=_spread(e_enu_m[:, _others(n)], var_d[:, None]),
        log_likelihood_ratio=log_likelihood_ratio(e_enu_m, var.common[:, None, :], var_d),
        collapse_fit=_spread(solved_points_m(e_enu_m, triangle), var_d),
    )


def log_likelihood_ratio(e_enu_m: Floats, var_common: Floats, var_d: Floats) -> Floats:
    """For each receiver (E, R): that it alone is off, against that all others are off alike; rule (iv) of section 2.2."""
    n = e_enu_m.shape[1]
    others = (e_enu_m.sum(axis=1, keepdims=True) - e_enu_m) / (n - 1)  # e_kl
    one_alone = (e_enu_m**2 / (var_common + var_d)).sum(axis=-1)
    the_others = (others**2 / (var_common + var_d / (n - 1))).sum(axis=-1)
    ratio: Floats = 0.5 * (one_alone - the_others)
    return ratio


def collapse_statistic(own_m: Floats, baseline_m: Floats, var: Variances) -> Floats:
    """S (E,) of section 2.6: the matched filter for "all receivers stand at one point"; N(0, 1) without, N(sqrt(Lambda), 1) with."""
    along = np.add.reduce(own_m * baseline_m / var.differential[:, None, :], axis=2)  # axis by axis: the order of a sum never depends on E
    S: Floats = -np.add.reduce(along, axis=1) / var.separation
    return S


def solved_points_m(e_enu_m: Floats, triangle: ReferenceTriangle) -> Floats:
    """Solved positions (E, R, 3) in the axes of the first receiver, from the centroid of the reference triangle, m."""
    result: Floats = triangle.baseline_enu_m + np.einsum("ij,erj->eri", triangle.enu[0], _moved_ecef_m(e_enu_m, triangle))
    return result


def _moved_ecef_m(e_enu_m: Floats, triangle: ReferenceTriangle) -> Floats:
    """Displacements (..., R, 3), each in the axes of its receiver, in ECEF."""
    moved_m: Floats = np.einsum("rij,...ri->...rj", triangle.enu, e_enu_m)
    return moved_m


def _spread(points_m: Floats, var_d: Floats) -> Floats:
    """Sum of squared distances (...) of points (..., n, 3) from their mean, in sigmas; for two points T_pair of section 2.2."""
    mean_m = points_m.sum(axis=-2, keepdims=True) / points_m.shape[-2]
    total: Floats = ((points_m - mean_m) ** 2 / var_d).sum(axis=-1).sum(axis=-1)
    return total


def _others(n: int) -> list[list[int]]:
    """For each of n receivers the other ones."""
    return [[k for k in range(n) if k != j] for j in range(n)]


def suspects(circle_m: Floats, statistics: NamingStatistics, limits: Limits) -> Bools:
    """The receiver (E, R) that rules (i) to (iii) of section 2.2 point at, if any.

    (i) it is the furthest from the others, and its own statistic exceeds, (ii) the others agree, (iii) the others are inside their
    circles. It may be named when (iv) one faulty receiver is also a thousand times likelier than two that fail alike.
    """
    n = statistics.isolation.shape[1]
    inside = circle_m <= limits.radius_m
    others_inside = inside[:, _others(n)].all(axis=-1)
    furthest = statistics.isolation == statistics.isolation.max(axis=1, keepdims=True)
    suspected: Bools = furthest & (statistics.isolation > limits.isolation) & (statistics.pair <= limits.pair) & others_inside
    return suspected


def swapped_receivers(e_enu_m: Floats, triangle: ReferenceTriangle, limits: Limits) -> str:
    """In words, the exchange of surveyed points that explains displacements (R, 3) of one epoch; empty when none does, or none is needed.

    For people only: antennas connected to each other's receivers, or coordinates entered for the wrong one.
    """
    solved_ecef_m = triangle.pos_ecef_m + _moved_ecef_m(e_enu_m, triangle)
    fits = np.linalg.norm(solved_ecef_m[:, None] - triangle.pos_ecef_m[None], axis=-1) <= 2.0 * limits.radius_m
    names = triangle.names
    if fits.diagonal().any() and not fits.diagonal().all():
        pairs = [(a, b) for a, b in combinations(range(len(names)), 2) if fits[a, b] and fits[b, a] and not fits[a, a] and not fits[b, b]]
        return "".join(
            f"receivers {names[a]} and {names[b]} stand at each other's points: antennas or coordinates exchanged?" for a, b in pairs
        )
    if not fits.diagonal().any() and any(all(fits[i, p[i]] for i in range(len(names))) for p in permutations(range(len(names)))):
        return "every receiver stands at another one's point: antennas or coordinates exchanged?"
    return ""
