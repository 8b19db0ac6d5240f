"""How much of a satellite's range error the residual check may miss: a line after the one that GAST-D sets for landing aircraft.

Of a differential range error |E| in metres, P_md <= 1 below 0.75 m, <= 10^(-2.56 |E| + 1.92) up to 2.7 m, <= 1e-5 beyond (section 2.7;
numbers from knowledge of the standard, not re-opened). A railway has another tolerance than a runway: here |E| is measured in units of
the tolerance R_t of the track position so that 2.7 m become half of it, and with that 1.6 m, the error of which a landing must be safe,
0.3 of it. The fractions are this project's proposal; no authority has set them.
"""

from typing import NamedTuple

import numpy as np

from recordings.campaign.detectable import Share, missed, residual_case
from recordings.campaign.error_model import ErrorModel

FREE_M, STRICT_M = 0.75, 2.7
SLOPE_PER_M, OFFSET = -2.56, 1.92
FLOOR = 1e-5
STRICT_OF_TOLERANCE = 0.5
SIZES = 24
Z_ONE_SIDED_95 = 1.644854


class Point(NamedTuple):
    """What is missed of a range error of `size_m`, and what may be."""

    size_m: float
    missed: Share
    allowed: float


class Acceptance(NamedTuple):
    """`passes` where the 95 % upper bound is nowhere above the line; `least_tolerance_m`: the smallest tolerance for which it is."""

    tolerance_m: float
    points: tuple[Point, ...]
    passes: bool
    least_tolerance_m: float


def allowed_missed_detection(error_m: float, tolerance_m: float) -> float:
    """The line, for a tolerance of the track position."""
    landing_m = abs(error_m) * STRICT_M / (STRICT_OF_TOLERANCE * tolerance_m)
    if landing_m < FREE_M:
        return 1.0
    return float(10.0 ** (SLOPE_PER_M * landing_m + OFFSET)) if landing_m < STRICT_M else FLOOR


def acceptance(model: ErrorModel, tolerance_m: float, samples: int, seed: int) -> Acceptance:
    """The residual check of a satellite at 45 deg against the line, from small errors to beyond what is surely caught."""
    case = residual_case(model)
    sizes = np.linspace(0.05, 1.3, SIZES) * case.theory
    shares = [missed(case, float(size), np.random.default_rng(seed), samples) for size in sizes]
    points = tuple(Point(float(x), p, allowed_missed_detection(float(x), tolerance_m)) for x, p in zip(sizes, shares, strict=True))
    return Acceptance(
        tolerance_m,
        points,
        all(_at_most(of.missed) <= of.allowed for of in points),
        max(_least_tolerance_m(of.size_m, _at_most(of.missed)) for of in points),
    )


def _at_most(share: Share) -> float:
    return min(1.0, share.value + Z_ONE_SIDED_95 * share.error)


def _least_tolerance_m(error_m: float, missed_detection: float) -> float:
    """The tolerance for which an error missed with this probability lies on the line; zero where any would do."""
    if missed_detection <= FLOOR:
        return 0.0
    landing_m = FREE_M if missed_detection >= 1.0 else (np.log10(missed_detection) - OFFSET) / SLOPE_PER_M
    return float(error_m * STRICT_M / (STRICT_OF_TOLERANCE * min(max(landing_m, FREE_M), STRICT_M)))
