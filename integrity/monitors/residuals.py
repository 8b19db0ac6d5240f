"""Satellites seen from known points: receiver clocks, normalised residuals, B-values (sections 2.3, 2.4 and 4).

At a surveyed point only the receiver's clock is unknown, one per constellation. What remains of a satellite's range is the fault of
the satellite where all receivers see it alike, and of a receiver where one differs from the others.
"""

from typing import NamedTuple

import numpy as np

from integrity.gnss.observations import Bools, Floats, Ints


class KnownPointResiduals(NamedTuple):
    """`clock_m` (E, R, K); `residual_m` (E, R, S), clock taken out; `normalised` (E, R, S), in sigmas, NaN where it says nothing."""

    clock_m: Floats
    residual_m: Floats
    normalised: Floats


def known_point_residuals(prefit_m: Floats, sigma_m: Floats, used: Bools, system_of: Ints, n_systems: int) -> KnownPointResiduals:
    """Clocks from the satellites `used` (E, S), weighted by `sigma_m` (E, S); residuals of every satellite seen (E, R, S).

    A satellite that is used pulls the clock towards itself: its residual has variance sigma^2 (1 - h), h its share of the weight; one
    that is not used, sigma^2 (1 + h). A satellite that alone determines its clock says nothing.
    """
    w = np.where(used, 1.0 / sigma_m**2, 0.0)
    y = np.where(used[:, None, :], prefit_m, 0.0)
    members = [system_of == k for k in range(n_systems)]
    weight = np.stack([np.where(m, w, 0.0).sum(axis=-1) for m in members], axis=-1)  # (E, K)
    with np.errstate(invalid="ignore", divide="ignore"):
        clock_m = np.stack([(w[:, None, :] * np.where(m, y, 0.0)).sum(axis=-1) for m in members], axis=-1) / weight[:, None, :]
        h = 1.0 / (sigma_m**2 * weight[:, system_of])
        spread = np.where(used, 1.0 - h, 1.0 + h)
        residual_m = prefit_m - clock_m[..., system_of]
        normalised = residual_m / (sigma_m * np.sqrt(np.where(spread > 1e-9, spread, np.nan)))[:, None, :]
    return KnownPointResiduals(clock_m, residual_m, normalised)


def seen_by_all(normalised: Floats) -> Floats:
    """The satellite's statistic (E, S): the smallest of the receivers' |residuals|, 0 where their signs differ, NaN where one is missing.

    A fault of the satellite shows in every receiver; a fault of one or two receivers leaves the smallest where it was.
    """
    same_sign = np.abs(np.sign(normalised).sum(axis=1)) == normalised.shape[1]
    smallest = np.abs(normalised).min(axis=1)
    statistic: Floats = np.where(same_sign | np.isnan(smallest), smallest, 0.0)
    return statistic


def b_values_m(residual_m: Floats) -> Floats:
    """B(i, j) (E, R, S), m: mean over all receivers minus the mean without receiver j, here with the sign of receiver j's excess.

    A bias b of one of three receivers shows as b / 3. Source: section 2.3 (GBAS).
    """
    n = residual_m.shape[1]
    b_m: Floats = (residual_m - residual_m.sum(axis=1, keepdims=True) / n) / (n - 1)
    return b_m


def normalised_b_values(b_m: Floats, sigma_differential_m: Floats) -> Floats:
    """B-values (E, R, S) over their standard deviation sigma_d / sqrt(R (R - 1)), with sigma_d (E, S) per satellite."""
    n = b_m.shape[1]
    normalised: Floats = b_m * np.sqrt(n * (n - 1)) / sigma_differential_m[:, None, :]
    return normalised


def without_lone_satellites(used: Bools, system_of: Ints, n_systems: int) -> Bools:
    """`used` (E, S) less satellites alone in their constellation: one determines a clock, nothing else, and nothing checks it."""
    kept = np.array(used)
    for k in range(n_systems):
        member = system_of == k
        alone = (used & member).sum(axis=1) == 1
        kept &= ~(alone[:, None] & member)
    return kept


def worst(statistic: Floats, used: Bools) -> Floats:
    """Largest statistic of the satellites used, (E,); NaN where none is used or one of them has none."""
    largest = np.where(used, np.where(np.isnan(statistic), np.inf, statistic), -np.inf).max(axis=-1, initial=-np.inf)
    result: Floats = np.where(np.isfinite(largest), largest, np.nan)
    return result
