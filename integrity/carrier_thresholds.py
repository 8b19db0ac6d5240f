"""Error model, windows and thresholds of what carriers show of satellites (`carrier_watch`).

Two families share the promise of false exclusions with the others that name a satellite: "motion" (step, ramp, acceleration) and
"code_carrier" (innovation, divergence). All numbers here are our own choice where no source stands beside them.
"""

from collections.abc import Mapping
from math import exp, sqrt
from typing import NamedTuple

import numpy as np

from integrity.gnss.observations import Floats
from integrity.monitors.carrier_motion import MotionDesign, bend_m2, change_m2
from integrity.monitors.carrier_residuals import SignalErrors, nature
from integrity.monitors.divergence import DivergenceDesign, divergence_m2ps2, innovation_m2
from integrity.probability import chi2_quantile
from integrity.thresholds import REFERENCE_ELEVATION_RAD, Promises, Threshold

MOTION_CHECKS = ("step", "ramp", "acceleration")
CODE_CARRIER_CHECKS = ("innovation", "divergence")
CARRIER_CHECKS = MOTION_CHECKS + CODE_CARRIER_CHECKS

ERRORS = SignalErrors(
    phase_m=0.003,
    phase_low_m=0.003,
    phase_m2hz=0.0165,
    code_m=0.3,
    code_low_m=0.3,
    code_m2hz=75.0**2,
    code_correlation_s=30.0,
    clock_m=0.012,
    ionosphere_zenith_m=5.0,
    ionosphere_mps=0.0004,
    troposphere_zenith_m=0.1,
)
HALF_S, MOST_HALF_EPOCHS = 30.0, 60  # of the window for ramps; at high rates it is kept short: each epoch of it is remembered
LONGEST_S = 65.0  # two epochs of 30 s and what their times may differ
WINDOW_S, WARM_UP_S = 100.0, 200.0  # of divergence
LOCK_SHARE = 0.5  # lock times of MSM are a lower bound, at most twice too short: RTCM 10403.3, DF402, DF407
CORRELATION_S = {"step": 0.0, "ramp": 30.0, "acceleration": 15.0, "innovation": 30.0, "divergence": 60.0}
RETURN_S = 3600.0  # of a satellite that moved: how long nothing must be found of it
REFERENCE_CN0_DBHZ = 45.0
NOISE_OF_PAIR = 3.0  # GPS L1 and L2: `combination.weights_of`
DIVERGENCE = DivergenceDesign(WINDOW_S, WARM_UP_S, LONGEST_S, ERRORS.code_correlation_s)
FOUND = {
    "step": ("m of range, 45 deg", "the carrier against the epoch before: it steps", "2.4, MQM"),
    "ramp": ("m/s of range, 45 deg", "the carrier over a window: it drifts", "2.4, MQM"),
    "acceleration": ("m/s2 of range, 45 deg", "the carrier's rate, half a window against the other", "2.4, MQM"),
    "innovation": ("m of code, 45 deg", "code against what its carrier carries on", "2.4, MQM"),
    "divergence": ("m/s between code and carrier, 45 deg", "code and carrier drift apart", "2.4, CCD"),
}


class CarrierDesign(NamedTuple):
    """The error model and the windows of the monitors; `lock_share`: the share of the true tracking time that a lock time says at least;
    `thresholds` of `CARRIER_CHECKS`, in sigmas; `log_likelihood_ratio`: how much likelier than a common motion a satellite's own must be
    where it is named."""

    errors: SignalErrors
    motion: MotionDesign
    divergence: DivergenceDesign
    lock_share: float
    thresholds: Mapping[str, float]
    log_likelihood_ratio: float


def motion_design(interval_s: float) -> MotionDesign:
    """For epochs so far apart."""
    half_epochs = min(max(1, round(HALF_S / interval_s)), MOST_HALF_EPOCHS)
    return MotionDesign(half_epochs, longest_half_s=LONGEST_S, longest_gap_s=LONGEST_S, clock_m=ERRORS.clock_m)


def carrier_design(interval_s: float, thresholds: Mapping[str, float], log_likelihood_ratio: float) -> CarrierDesign:
    """For epochs so far apart, and thresholds by check."""
    of_carriers = {name: thresholds[name] for name in CARRIER_CHECKS}
    return CarrierDesign(ERRORS, motion_design(interval_s), DIVERGENCE, LOCK_SHARE, of_carriers, log_likelihood_ratio)


def clean_for_s(check: str, recover_after_s: float) -> float:
    """How long a satellite that a check excluded must be clean before it comes back.

    One that stepped looks clean at once, though its range stays wrong by what it moved. In an hour its residual has been looked at from
    many sides, and mostly another set serves, whose change against the old one is checked; what may remain is too small for the residual,
    like any other error of a satellite that is used. So it is where positions are much weaker without it: there it comes back like all
    others (`limits.most_growth`).
    """
    return max(RETURN_S, recover_after_s) if check in MOTION_CHECKS else recover_after_s


def carrier_thresholds(of: Promises) -> list[Threshold]:
    """Satellites, by their carriers; none is required: a receiver may have none, and filters warm up."""
    sigma = smallest_sigmas(of.interval_s, of.integrity.frequencies)
    found = []
    for family in (MOTION_CHECKS, CODE_CARRIER_CHECKS):
        for name in family:
            stays_s = CORRELATION_S[name]
            correlation = exp(-of.interval_s / stays_s) if stays_s > 0.0 else 0.0
            p = of.tail(of.exclusions / len(family) / of.satellites, 1, correlation)
            k = sqrt(chi2_quantile(p, 1))
            found.append(Threshold(name, k, "sigma", False, p, (k + of.k_md) * sigma[name], *FOUND[name]))
    return found


def smallest_sigmas(interval_s: float, frequencies: int) -> dict[str, float]:
    """One sigma of each statistic, of a satellite at 45 deg and 45 dB-Hz, filters settled."""
    one = np.ones((1, 1))
    sin_el, cn0 = one[None] * np.sin(REFERENCE_ELEVATION_RAD), one[None] * REFERENCE_CN0_DBHZ
    alone = frequencies == 1
    natural = nature(sin_el, cn0, one * alone, np.array([1.0 if alone else NOISE_OF_PAIR]), ERRORS)
    motion = motion_design(interval_s)
    dt_s, half_s, window_s = (np.full((1, 1, 1), n * interval_s) for n in (1, motion.half_epochs, 2 * motion.half_epochs))
    a = np.minimum(dt_s / WINDOW_S, 1.0)
    variances: dict[str, Floats] = {
        "step": change_m2(natural, dt_s, motion),
        "ramp": change_m2(natural, window_s, motion) / window_s**2,
        "acceleration": bend_m2(natural, half_s, motion) / half_s**4,
        "innovation": innovation_m2(natural, a, np.full((1, 1, 1), WINDOW_S)),
        "divergence": divergence_m2ps2(natural, dt_s, DIVERGENCE),
    }
    return {name: sqrt(variance.item()) for name, variance in variances.items()}
