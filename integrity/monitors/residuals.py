"""Satellites seen from known points: receiver clocks, normalised residuals, B-values (sections 2.3, 2.4 and 4).

At a surveyed point only the receiver's clock is unknown, one per constellation. What remains of a satellite's range is the fault of
the satellite where all receivers see it alike, and of a receiver where one differs from the others.
"""

from functools import reduce
from math import sqrt
from typing import NamedTuple

import numpy as np

from integrity.gnss.observations import Bools, Floats, Ints


class KnownPointResiduals(NamedTuple):
    """`clock_m` (E, R, K); `residual_m` (E, R, S), clock taken out; `normalised` (E, R, S), in sigmas, NaN where it says nothing."""

    clock_m: Floats
    residual_m: Floats
    normalised: Floats


class ClockDesign(NamedTuple):
    """The clocks at known points before anything is measured: all that follows from which satellites are `used`."""

    used: Bools  # (E, S)
    system_of: Ints  # (S,)
    determines: Bools  # (K, E, 1, S): satellites used, by constellation
    w: Floats  # (E, 1, S)
    weight: Floats  # (K, E, 1); NaN where none of the constellation is used
    scale_m: Floats  # (E, 1, S): standard deviation of what remains of a range, NaN where that says nothing


def known_point_residuals(prefit_m: Floats, sigma_m: Floats, used: Bools, system_of: Ints, n_systems: int) -> KnownPointResiduals:
    """Clocks from the satellites `used` (E, S), weighted by `sigma_m` (E, S); residuals of every satellite seen (E, R, S).

    A satellite that is used pulls the clock towards itself: its residual has variance sigma^2 (1 - h), h its share of the weight; one
    that is not used, sigma^2 (1 + h). A satellite that alone determines its clock says nothing.
    """
    return without_clocks(clock_design(sigma_m, used, system_of, n_systems), prefit_m)


def clock_design(sigma_m: Floats, used: Bools, system_of: Ints, n_systems: int) -> ClockDesign:
    """The part of `known_point_residuals` that needs no measurement."""
    w = np.where(used, 1.0 / sigma_m**2, 0.0)
    member = (system_of == np.arange(n_systems)[:, None])[:, None]  # (K, 1, S)
    weight = np.where(member, w, 0.0).sum(axis=-1)  # (K, E)
    weight = np.where(weight > 0.0, weight, np.nan)
    with np.errstate(invalid="ignore"):
        h = 1.0 / (sigma_m**2 * weight.T[:, system_of])
        spread = np.where(used, 1.0 - h, 1.0 + h)
        scale_m = sigma_m * np.sqrt(np.where(spread > 1e-9, spread, np.nan))
    return ClockDesign(used, system_of, (member & used)[:, :, None], w[:, None], weight[..., None], scale_m[:, None])


def without_clocks(of: ClockDesign, prefit_m: Floats) -> KnownPointResiduals:
    """What ranges (E, R, S) make of a design: clocks, and what remains."""
    clock_m = (np.add.reduce(of.w * np.where(of.determines, prefit_m, 0.0), axis=-1) / of.weight).transpose(1, 2, 0)
    residual_m = prefit_m - clock_m.take(of.system_of, axis=-1)
    return KnownPointResiduals(clock_m, residual_m, residual_m / of.scale_m)


def seen_by_all(normalised: Floats) -> Floats:
    """The satellite's statistic (..., S) of (..., R, S): the smallest of the receivers' |residuals|, 0 where their signs differ, NaN where
    one is missing.

    A fault of the satellite shows in every receiver; a fault of one or two receivers leaves the smallest where it was.
    """
    of = [normalised[..., r, :] for r in range(normalised.shape[-2])]
    above, below = reduce(np.minimum, of), -reduce(np.maximum, of)  # by how much all are beyond zero
    statistic: Floats = np.maximum(np.maximum(above, below), 0.0)
    return statistic


def b_values_m(residual_m: Floats) -> Floats:
    """B(i, j) (E, R, S), m: mean over all receivers minus the mean without receiver j, here with the sign of receiver j's excess.

    A bias b of one of three receivers shows as b / 3. Source: section 2.3 (GBAS).
    """
    n = residual_m.shape[1]
    b_m: Floats = (residual_m - np.add.reduce(residual_m, axis=1, keepdims=True) / n) / (n - 1)
    return b_m


def normalised_b_values(b_m: Floats, sigma_differential_m: Floats) -> Floats:
    """B-values (E, R, S) over their standard deviation sigma_d / sqrt(R (R - 1)), with sigma_d (E, S) per satellite."""
    n = b_m.shape[1]
    normalised: Floats = b_m * sqrt(n * (n - 1)) / sigma_differential_m[:, None, :]
    return normalised


def without_lone_satellites(used: Bools, system_of: Ints, n_systems: int) -> Bools:
    """`used` (E, S) less satellites alone in their constellation: one determines a clock, nothing else, and nothing checks it."""
    member = system_of == np.arange(n_systems)[:, None]
    alone = np.add.reduce(used[:, None] & member, axis=-1) == 1  # (E, K)
    kept: Bools = used & ~alone.take(system_of, axis=1)
    return kept


def worst(statistic: Floats, used: Bools) -> Floats:
    """Largest statistic of the satellites used, (E,); NaN where none is used or one of them has none."""
    largest: Floats = np.maximum.reduce(statistic, axis=-1, initial=-np.inf, where=used)
    largest[~np.isfinite(largest)] = np.nan
    return largest
