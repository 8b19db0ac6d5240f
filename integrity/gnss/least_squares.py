"""Weighted least squares of a displacement and a clock per constellation, for all receivers and epochs of a block at once.

Each clock is eliminated by subtracting its constellation's weighted mean, which leaves 3 x 3 normal equations that are inverted
in closed form: no linear-algebra library, so that every machine computes the same. What does not depend on the measurements is a
`Design`, which can be made before they come.
"""

from dataclasses import dataclass
from enum import IntEnum
from typing import NamedTuple

import numpy as np

from integrity.gnss.observations import Bools, Floats, Ints, freeze

MOST_PDOP = 100.0
# The six cofactors of a symmetric 3 x 3 matrix, xx, xy, xz, yy, yz, zz, are a b - c d: which of its nine entries; and how they fill it.
COFACTOR_A, COFACTOR_B = [4, 2, 1, 0, 1, 0], [8, 5, 5, 8, 2, 4]
COFACTOR_C, COFACTOR_D = [5, 1, 2, 2, 0, 1], [5, 8, 4, 2, 5, 1]
SQUARE = [[0, 1, 2], [1, 3, 4], [2, 4, 5]]


class Unsolved(IntEnum):
    """Why there is no position, or SOLVED."""

    SOLVED = 0
    TOO_FEW_SATELLITES = 1
    POOR_GEOMETRY = 2
    DIVERGED = 3


class Design(NamedTuple):
    """A solution before anything is measured: all of it that follows from where the satellites `used` are. Symbols as in `design`."""

    used: Bools  # (E, R, S)
    sigma_m: Floats  # as given
    system_of: Ints  # (S,)
    member: Floats  # (S, K): one where the satellite is of the constellation
    clocks: Ints  # (L,): the constellations that the block has, numbers among the K; no other costs anything
    groups: Floats  # (L, S): their rows of `member`
    place: Ints  # (S,): of the satellite's constellation among the L
    w: Floats  # (E, R, S)
    wu: Floats  # (3, E, R, S)
    n_of: Floats  # (E, R, L): satellites used of the constellation
    safe: Floats  # (E, R, L): their weight, one where there are none
    u_mean: Floats  # (3, E, R, L), NaN where there are none
    C: Floats  # (3, 3, E, R), NaN where unsolved
    cov_enu_m2: Floats  # this and the rest go into the `Solution` as they are
    n_used: Ints
    why: Ints


@dataclass(frozen=True, eq=False)
class Solution:
    """Displacements from the points: `e_enu_m` and, in order of `TIME_SCALES`, `clock_m`; (E, R, 3) and (E, R, K); NaN where unsolved.

    `cov_enu_m2` (E, R, 3, 3) is the covariance of the position when the sigmas are right, m2; `why` (E, R) holds `Unsolved`.
    """

    e_enu_m: Floats
    clock_m: Floats
    cov_enu_m2: Floats
    n_used: Ints
    why: Ints

    def __post_init__(self) -> None:
        freeze(self)

    @property
    def solved(self) -> Bools:
        """Where there is a position, (E, R)."""
        result: Bools = self.why == Unsolved.SOLVED
        return result


def solve(residual_m: Floats, los_enu: Floats, sigma_m: Floats, used: Bools, system_of: Ints, n_systems: int) -> Solution:
    """Weighted least squares of displacement and a clock per constellation, for every epoch and receiver.

    residual_m (E, R, S); los_enu (3, E, R, S); sigma_m, used broadcast to (E, R, S); system_of (S,) numbers the constellation.
    A satellite alone in its constellation determines only a clock. Geometry is refused where its weighted PDOP, sqrt(tr(C) mean(w)),
    exceeds 100.
    """
    return solution(design(los_enu, sigma_m, used & np.isfinite(residual_m), system_of, n_systems), residual_m)


def design(los_enu: Floats, sigma_m: Floats, used: Bools, system_of: Ints, n_systems: int) -> Design:
    """The part of `solve` that needs no measurement, for satellites `used` all of which will have been measured."""
    used = np.broadcast_to(used, los_enu.shape[1:])
    w = np.where(used, 1.0 / sigma_m**2, 0.0)
    u = np.where(used, los_enu, 0.0)

    member = (system_of[:, None] == np.arange(n_systems)).astype(np.float64)  # (S, K)
    clocks = np.flatnonzero(member.any(axis=0))
    groups = np.ascontiguousarray(member.T[clocks])  # (L, S)
    weight = _per_system(w, groups)  # (E, R, L)
    n_of = _per_system(used.astype(np.float64), groups)
    safe = np.where(weight > 0.0, weight, 1.0)
    wu = w * u
    u_mean = _per_system(wu, groups) / safe  # (3, E, R, L)

    N = _products(wu, u) - _products(weight * u_mean, u_mean)
    C, determinant = _inverse(N)

    n_used = used.sum(axis=-1)
    n_clocks = (n_of > 0).sum(axis=-1)
    with np.errstate(invalid="ignore"):
        pdop2 = (C[0, 0] + C[1, 1] + C[2, 2]) * weight.sum(axis=-1) / np.maximum(n_used, 1)
        poor = ~((determinant > 0.0) & (pdop2 <= MOST_PDOP**2))
    why = np.where(n_used < 3 + n_clocks, Unsolved.TOO_FEW_SATELLITES, np.where(poor, Unsolved.POOR_GEOMETRY, Unsolved.SOLVED))
    C[:, :, why != Unsolved.SOLVED] = np.nan
    return Design(
        used=used,
        sigma_m=sigma_m,
        system_of=system_of,
        member=member,
        clocks=clocks,
        groups=groups,
        place=np.searchsorted(clocks, system_of),
        w=w,
        wu=wu,
        n_of=n_of,
        safe=safe,
        u_mean=np.where(n_of > 0, u_mean, np.nan),
        C=C,
        cov_enu_m2=C.transpose(2, 3, 0, 1),
        n_used=n_used,
        why=why,
    )


def solution(of: Design, residual_m: Floats) -> Solution:
    """What the residuals (E, R, S) make of a design."""
    y = np.where(of.used, residual_m, 0.0)
    y_mean = _per_system(of.w * y, of.groups) / of.safe
    dy = y - y_mean.take(of.place, axis=-1)
    b = -np.einsum("iers,ers->ier", of.wu, dy)  # a range shrinks when the receiver moves towards the satellite
    e = (of.C * b).sum(axis=1)
    clock = np.full((*y.shape[:-1], of.member.shape[1]), np.nan)
    clock[..., of.clocks] = y_mean + (of.u_mean * e[..., None]).sum(axis=0)
    found = Solution(e.transpose(1, 2, 0), clock, of.cov_enu_m2, of.n_used, of.why)
    return found if np.isfinite(e).all() else _without_infinite(found)


def _without_infinite(found: Solution) -> Solution:
    """A displacement beyond all numbers is none: its geometry was poorer than its PDOP said."""
    broken: Bools = ~np.all(np.isfinite(found.e_enu_m), axis=-1)
    if not (broken & found.solved).any():
        return found
    return Solution(
        e_enu_m=np.where(broken[..., None], np.nan, found.e_enu_m),
        clock_m=np.where(broken[..., None], np.nan, found.clock_m),
        cov_enu_m2=np.where(broken[..., None, None], np.nan, found.cov_enu_m2),
        n_used=found.n_used,
        why=np.where(broken & found.solved, Unsolved.POOR_GEOMETRY, found.why),
    )


def postfit_m(residual_m: Floats, los_enu: Floats, solution: Solution, system_of: Ints) -> Floats:
    """Residuals (E, R, S) after the solution, m, of every satellite seen whose constellation has a clock, used or not."""
    moved_m = np.einsum("iers,eri->ers", los_enu, solution.e_enu_m)
    result: Floats = residual_m + moved_m - solution.clock_m.take(system_of, axis=-1)
    return result


def _per_system(v: Floats, groups: Floats) -> Floats:
    """Sums of (..., S) over the satellites of each constellation, (..., L); rows of `groups` (L, S) are ones and zeros."""
    sums: Floats = np.einsum("...s,ks->...k", v, groups)
    return sums


def _products(a: Floats, b: Floats) -> Floats:
    """Sums over the last axis of a_i b_j, (3, 3, E, R), for a, b (3, E, R, n)."""
    sums: Floats = np.einsum("iern,jern->ijer", a, b)
    return sums


def _inverse(N: Floats) -> tuple[Floats, Floats]:
    """Inverse (3, 3, ...) and determinant (...) of symmetric matrices by cofactors; NaN where the determinant is not positive."""
    N = N.reshape(9, *N.shape[2:])
    C = N[COFACTOR_A] * N[COFACTOR_B] - N[COFACTOR_C] * N[COFACTOR_D]
    determinant = (N[:3] * C[:3]).sum(axis=0)
    positive = determinant > 0.0
    return (C / np.where(positive, determinant, np.nan))[SQUARE], determinant
