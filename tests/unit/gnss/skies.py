"""Made-up skies for tests of least squares: unit vectors, sigmas and ranges from a seed, of satellites of several constellations."""

from typing import NamedTuple

import numpy as np

from integrity.gnss.least_squares import Design, Solution, design, postfit_m, solution
from integrity.gnss.observations import Bools, Floats, Ints

N_SYSTEMS = 4


class MadeSky(NamedTuple):
    """E epochs, R receivers, S satellites; `residual_m` is what ranges of noise `sigma_m` show of `e_enu_m` and `clock_m`."""

    los_enu: Floats  # (3, E, R, S)
    sigma_m: Floats  # (E, R, S)
    residual_m: Floats  # (E, R, S)
    used: Bools  # (E, R, S)
    system_of: Ints  # (S,)

    def design(self, used: Bools | None = None) -> Design:
        return design(self.los_enu, self.sigma_m, self.used if used is None else used, self.system_of, N_SYSTEMS)

    def solved(self, used: Bools | None = None) -> tuple[Design, Solution, Floats]:
        """The design, its solution and the residuals after it."""
        of = self.design(used)
        found = solution(of, self.residual_m)
        return of, found, postfit_m(self.residual_m, self.los_enu, found, self.system_of)


def made_sky(seed: int, satellites: tuple[int, ...] = (8, 6), epochs: int = 5, receivers: int = 2, noise: float = 1.0) -> MadeSky:
    """A sky with so many satellites of each constellation, from 10 deg up; all are used."""
    rng = np.random.default_rng(seed)
    system_of = np.repeat(np.arange(len(satellites)), satellites)
    shape = (epochs, receivers, len(system_of))
    up = rng.uniform(np.sin(np.deg2rad(10.0)), 1.0, shape)
    az_rad = rng.uniform(0.0, 2.0 * np.pi, shape)
    level = np.sqrt(1.0 - up**2)
    los_enu = np.array((level * np.sin(az_rad), level * np.cos(az_rad), up))
    sigma_m = rng.uniform(0.8, 3.0, shape)
    e_enu_m = rng.uniform(-100.0, 100.0, (3, epochs, receivers, 1))
    clock_m = rng.uniform(-1e3, 1e3, (epochs, receivers, N_SYSTEMS))[..., system_of]
    residual_m = clock_m - (los_enu * e_enu_m).sum(axis=0) + noise * sigma_m * rng.standard_normal(shape)
    return MadeSky(los_enu, sigma_m, residual_m, np.ones(shape, dtype=np.bool_), system_of)
