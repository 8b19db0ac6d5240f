"""Which receiver may be named faulty: the rules of section 2.2, and what moved since all was well.

Theory of operation. Three receivers cannot vote out two: the same fault on two of them makes the healthy third look wrong. Only the
error common to all tells the cases apart, and it is known in two ways. Its size: one receiver far from its point while two are near
theirs (rule iv, without memory). Its change: it is slow, so that a receiver that jumped since the last clean epoch, while the others
stayed, is the one that is off. The second counts from where each receiver was then, not from its surveyed point: two receivers that
drift away alike, slowly, never make the third look as if it had jumped.
"""

from dataclasses import dataclass

import numpy as np

from integrity.config import IntegrityConfig
from integrity.gnss.gps_time import NS_PER_S
from integrity.gnss.observations import Bools, Floats, freeze
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
