"""The receiver's own part of the error: noise, multipath, divergence of the smoothing filter. Replace the numbers by those of a vehicle.

Source: RTCA DO-229D, J.2.4 (airborne accuracy designator A, worst case: no divergence, noise at its bound); multipath: DO-229D, J.2.4.
"""

from dataclasses import dataclass
from math import radians

import numpy as np

from integrity.gnss.observations import Floats


@dataclass(frozen=True)
class NoiseModel:
    """sigma^2 = noise^2 + divergence^2 + (floor + rise exp(-el / scale))^2, in m and rad. By default that of aviation: not of a railway,
    where structures beside the track reflect more."""

    noise_m: float = 0.36
    divergence_m: float = 0.0
    multipath_floor_m: float = 0.13
    multipath_rise_m: float = 0.53
    multipath_scale_rad: float = radians(10.0)

    def variance_m2(self, el_rad: Floats) -> Floats:
        """sigma^2_air; shape of el_rad."""
        multipath_m = self.multipath_floor_m + self.multipath_rise_m * np.exp(-el_rad / self.multipath_scale_rad)
        variance: Floats = self.noise_m**2 + self.divergence_m**2 + multipath_m * multipath_m
        return variance


AVIATION = NoiseModel()
