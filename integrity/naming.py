"""Which receiver may be named faulty: the rules of section 2.2, and what moved since all was well.

Theory of operation. Three receivers cannot vote out two: the same fault on two of them makes the healthy third look wrong. Only the
error common to all tells the cases apart, and it is known in two ways. Its size: one receiver far from its point while two are near
theirs (rule iv, without memory). Its change: it is slow, so that a receiver that jumped since the last clean epoch, while the others
stayed, is the one that is off. The second counts from where each receiver was then, not from its surveyed point: two receivers that
drift away alike, slowly, never make the third look as if it had jumped.

And its ranges must be those of an antenna that stands elsewhere. What comes between some satellites and one receiver, a front in the
ionosphere that has reached it and not the others, moves its position too, and is no fault of the receiver: a displacement does not explain
its ranges.
"""

from dataclasses import dataclass
from math import sqrt

import numpy as np

from integrity.config import IntegrityConfig
from integrity.gnss.gps_time import NS_PER_S
from integrity.gnss.least_squares import design, postfit_m, solution
from integrity.gnss.observations import Bools, Floats, Ints, freeze
from integrity.limits import Limits
from integrity.monitors.triangles import log_likelihood_ratio


@dataclass(frozen=True, eq=False)
class LastClean:
    """Where the receivers were, `e_enu_m` (R, 3), in the last epoch without a failing check; GPS time."""

    gps_ns: int
    e_enu_m: Floats

    def __post_init__(self) -> None:
        freeze(self)


def named_receiver(
    suspected: Bools,
    ratio: Floats,
    e_enu_m: Floats,
    var_common: Floats,
    var_d: Floats,
    last: LastClean | None,
    gps_ns: int,
    promises: IntegrityConfig,
    limits: Limits,
) -> Bools:
    """Of one epoch, for each receiver (R,): may it be named? `ratio` (R,) of rule (iv); variances (3,)."""
    certain = ratio > limits.log_likelihood_ratio
    if last is not None:
        certain = certain | (jump_ratio(e_enu_m, var_common, var_d, last, gps_ns, promises) > limits.jump_log_likelihood_ratio)
    named: Bools = suspected & certain
    return named


def jump_ratio(e_enu_m: Floats, var_common: Floats, var_d: Floats, last: LastClean, gps_ns: int, promises: IntegrityConfig) -> Floats:
    """Rule (iv) on the change since the last clean epoch, (R,): differences have twice the variance, less what the correlation keeps."""
    dt_s = (gps_ns - last.gps_ns) / NS_PER_S
    change_common = 2.0 * var_common * -np.expm1(-dt_s / promises.correlation_common_s)
    ratio: Floats = log_likelihood_ratio((e_enu_m - last.e_enu_m)[None], change_common, 2.0 * var_d)[0]
    return ratio


def stands_elsewhere(
    los_enu: Floats, prefit_m: Floats, sigma_differential_m: Floats, used: Bools, system_of: Ints, n_systems: int, limits: Limits
) -> Bools:
    """Of one epoch, for each receiver (R,): a displacement explains by how much its ranges differ from the others'. False where too few
    satellites could contradict that.

    los_enu (3, 1, R, S), prefit_m (1, R, S), sigma_differential_m and used (1, S). Differences from the mean of the others have the
    variance sigma_d^2 R / (R - 1).
    """
    n = prefit_m.shape[1]
    own_m = (prefit_m - prefit_m.sum(axis=1, keepdims=True) / n) * (n / (n - 1))
    sigma_m = sigma_differential_m[:, None] * sqrt(n / (n - 1))
    of = design(los_enu, sigma_m, used[:, None] & np.isfinite(own_m), system_of, n_systems)
    found = solution(of, own_m)
    left_m = np.where(of.used, postfit_m(own_m, los_enu, found, system_of), 0.0)
    misfit = (of.w * left_m * left_m).sum(axis=-1)[0]
    dof = of.n_used[0] - 3 - (of.n_of[0] > 0).sum(axis=-1)
    return np.array([n_left > 0 and chi2 <= limits.misfit(n_left) for chi2, n_left in zip(misfit.tolist(), dof.tolist(), strict=True)])
