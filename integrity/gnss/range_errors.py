"""Standard deviation of a range from what is known of it: elevation and promised accuracy (`positioning.range_sigma_m`), which frequencies
it is made of, how long it was smoothed; and C/N0.

A range of one frequency is off by sqrt(a^2 + (b / sin el)^2) in all: orbit, clock, what the model leaves of the ionosphere, troposphere,
noise and multipath. The last two, of one signal, are sqrt(0.3^2 + (0.3 / sin el)^2) m of it: the share that smoothing makes smaller, and
that a pair of frequencies makes larger (k: `combination.weights_of`). A pair has no ionosphere left, but orbit and clock, 0.6 m, and the
troposphere, 0.12 m / sin el:

sigma^2 = (URA / 2.4 m)^2 (0.6^2 + c^2 + (k 0.3)^2 + (0.12^2 + (k 0.3)^2) / sin^2 el) m2, with k = 2.98 and c = 0.8 m for GPS L1 and L2

c is what GPS sends C/A later or earlier than P(Y), to which its clock belongs: 1 ns rms, 2.55 times in a pair, and LNAV does not tell it.
Half of the noise's variance is taken as independent from epoch to epoch, half as multipath of a fixed antenna, which lasts for minutes: a
filter whose ranges are of mean age A leaves 300 s / (300 s + A) of it.

Sources: RTKLIB 2.4.3, manual, E.6 and the defaults of its options (code noise 0.3 m and 0.3 m by elevation, times 3 free of ionosphere);
Montenbruck, Steigenberger, Hauschild, GPS Solutions 19, 2015 (signal in space of GPS, all of a constellation: 0.7 m, Galileo's later less);
IS-GPS-200, 30.3.3.3.1.1 (inter-signal corrections); RTCA DO-229, A.4.2.4 (troposphere: 0.12 m at the zenith). With C/N0:

sigma^2 = (URA / 2.4 m)^2 (a^2 + (b / sin el)^2) + c 10^(-(C/N0) / 10 dB-Hz)

The first term stands for everything that grows towards the horizon; the second for noise and multipath of a signal weaker than it should
be at its elevation, behind trees, at walls, under interference. It is added where C/N0 was measured, and only if asked for.
Sources: Hartinger, Brunner 1999 (SIGMA-epsilon, for phases); Kuusniemi 2005, User-level reliability and quality monitoring in satellite-
based personal navigation, 5.1, for ranges.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from integrity.gnss.angles import sine_cosine
from integrity.gnss.combination import weights_of
from integrity.gnss.observations import Floats
from integrity.gnss.positioning import LOWEST_MODELLED_RAD, URA_NOMINAL_M

NOISE_A_M, NOISE_B_M = 0.3, 0.3  # of one signal's code, multipath included
SPACE_M = 0.6  # orbit and clock
CODE_BIAS_M = {"G": 0.3}  # rms over the satellites, of the first signal
MULTIPATH_SHARE, MULTIPATH_S = 0.5, 300.0
TROPOSPHERE_M = 0.12  # at the zenith
# A range of one frequency in all where no model takes off the ionosphere: 5 m at the zenith of a middle latitude, three times that low down
# (RTCA DO-229, A.4.4.10.4, of what may be left: 4.5 m, nearer the equator 9 m).
UNMODELLED_A_M, UNMODELLED_B_M = 5.0, 2.2
IONOSPHERE_MPS = 0.001  # by which the delay of L1 may be changing, one sigma: a rising satellite's on an ordinary day. Own choice.

# Kuusniemi's for ranges of C/A code, (150 m)^2 Hz. It is also the thermal noise of a delay lock loop of 1 Hz, half a chip between its arms,
# 293 m a chip: 293^2 * 0.5 * 1 Hz / 2 = 146^2 m2 Hz (Kaplan, Hegarty, Understanding GPS, 2nd edition, 5.6.3).
CODE_M2HZ = 150.0**2


def cn0_variance_m2(cn0_dbhz: Floats, c_m2hz: float) -> Floats:
    """Variance c 10^(-(C/N0) / 10) of ranges, m2; shape of cn0_dbhz. Zero where C/N0 was not measured.

    With `CODE_M2HZ`: 0.7 m2 at 45 dB-Hz, 7 m2 at 35, 71 m2 at 25.
    """
    with np.errstate(over="ignore"):
        variance_m2 = c_m2hz * np.exp(cn0_dbhz * (-0.1 * np.log(10.0)))
    result: Floats = np.where(np.isnan(cn0_dbhz), 0.0, variance_m2)
    return result


def with_cn0_m(sigma_m: Floats, cn0_dbhz: Floats, c_m2hz: float) -> Floats:
    """Standard deviations of ranges, m, by elevation (`sigma_m`) and C/N0; shapes broadcast."""
    result: Floats = np.sqrt(sigma_m * sigma_m + cn0_variance_m2(cn0_dbhz, c_m2hz))
    return result


class Parts(NamedTuple):
    """Variances of ranges of signals (S,), m2: in all, and what of it is noise; each as the term that is the same everywhere, and the one
    that goes with 1 / sin^2 el."""

    a_m2: Floats
    b_m2: Floats
    noise_a_m2: Floats
    noise_b_m2: Floats


class Quality(NamedTuple):
    """Of smoothed ranges (E, R, S): the share of the noise's variance that is left, 1 where nothing was smoothed; and what the ionosphere
    may have moved the range by, one sigma, m."""

    noise_share: Floats
    drift_m: Floats


def parts_of(signals: Sequence[str], a_m: float, b_m: float) -> Parts:
    """For single frequencies with a model of the ionosphere `a_m`, `b_m` in all, or the noise where that is more; for pairs their own."""
    weights = np.array([weights_of(signal) for signal in signals], dtype=np.float64).reshape(-1, 2)
    k2 = (weights * weights).sum(axis=1)
    noise_a_m2, noise_b_m2 = k2 * NOISE_A_M**2, k2 * NOISE_B_M**2
    pair = weights[:, 1] != 0.0
    bias_m = weights[:, 0] * [CODE_BIAS_M.get(signal[0], 0.0) for signal in signals]
    return Parts(
        np.where(pair, SPACE_M**2 + bias_m * bias_m + noise_a_m2, np.maximum(a_m**2, noise_a_m2)),
        np.where(pair, TROPOSPHERE_M**2 + noise_b_m2, np.maximum(b_m**2, noise_b_m2)),
        noise_a_m2,
        noise_b_m2,
    )


def noise_left(white: Floats, age_s: Floats) -> Floats:
    """The share of the noise's variance that smoothing leaves: `white` of what is independent from epoch to epoch, of multipath by the mean
    age of the ranges in it."""
    result: Floats = (1.0 - MULTIPATH_SHARE) * white + MULTIPATH_SHARE * MULTIPATH_S / (MULTIPATH_S + age_s)
    return result


def sigma_of_parts_m(
    el_rad: Floats, parts: Parts, accuracy_m: Floats, noise_share: Floats | float = 1.0, drift_m: Floats | float = 0.0
) -> Floats:
    """Standard deviations of ranges, m; shapes broadcast. As `positioning.range_sigma_m` for ranges of one frequency that are not smoothed.

    `noise_share`: what smoothing has left of the variance of the noise; `drift_m`: what the ionosphere may have moved the range by since.
    """
    sin_el, _ = sine_cosine(np.maximum(el_rad, LOWEST_MODELLED_RAD))
    scale = np.maximum(accuracy_m, URA_NOMINAL_M) / URA_NOMINAL_M
    gone = 1.0 - noise_share
    variance_m2 = parts.a_m2 - gone * parts.noise_a_m2 + (parts.b_m2 - gone * parts.noise_b_m2) / (sin_el * sin_el)
    result: Floats = scale * np.sqrt(variance_m2 + drift_m * drift_m)
    return result


DOPPLER_MPS = 0.05  # of a range rate at the zenith, by Doppler: geodetic receivers are ten times better, small ones in motion as bad


def rate_sigma_mps(el_rad: Floats) -> Floats:
    """Standard deviation of a range rate by Doppler, m/s: 0.05 / sin el, elevations below 3 deg as 3 deg; shape of el_rad. Own choice."""
    sin_el, _ = sine_cosine(np.maximum(el_rad, LOWEST_MODELLED_RAD))
    result: Floats = DOPPLER_MPS / sin_el
    return result
