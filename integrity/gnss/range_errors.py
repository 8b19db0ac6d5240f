"""Standard deviation of a range from what is known of it: elevation and promised accuracy (`positioning.range_sigma_m`), and C/N0.

sigma^2 = (URA / 2.4 m)^2 (a^2 + (b / sin el)^2) + c 10^(-(C/N0) / 10 dB-Hz)

The first term stands for everything that grows towards the horizon; the second for noise and multipath of a signal weaker than it should
be at its elevation, behind trees, at walls, under interference. It is added where C/N0 was measured, and only if asked for.
Sources: Hartinger, Brunner 1999 (SIGMA-epsilon, for phases); Kuusniemi 2005, User-level reliability and quality monitoring in satellite-
based personal navigation, 5.1, for ranges.
"""

import numpy as np

from integrity.gnss.observations import Floats

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
