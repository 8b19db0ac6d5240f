"""A point on the ground as the commands take it."""

import math

from integrity.errors import ConfigError

NEAREST_M, FARTHEST_M = 6.3e6, 6.5e6  # from the centre of the Earth: the ground, with a margin


def ground_point_ecef_m(text: str) -> tuple[float, float, float]:
    """The value of `--position`; ConfigError for what is no place on the ground."""
    try:
        x, y, z = (float(part) for part in text.split(","))
    except ValueError:
        x = y = z = math.nan
    if not NEAREST_M <= math.hypot(x, y, z) <= FARTHEST_M:
        raise ConfigError(
            f"--position {text!r}: expected X,Y,Z in ECEF metres of a place on the ground, such as -3962108.7,3381309.6,3668678.7"
        )
    return x, y, z
