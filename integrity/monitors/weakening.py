"""How much weaker the sky is without a satellite: geometry alone, before anything is measured."""

import numpy as np

from integrity.gnss.least_squares import design
from integrity.gnss.observations import Bools, Floats, Ints


def growth_without(los_enu: Floats, sigma_m: Floats, used: Bools, satellite: Bools, system_of: Ints, n_systems: int) -> Floats:
    """By how much horizontal positions from the satellites `used` (E, S) are more uncertain than with the `satellite` (E, S) too: ratio of
    standard deviations, (E,); inf where there is no position without it.

    los_enu (3, E, R, S), the mean over receivers counts; sigma_m (E, S).
    """
    towards = (np.add.reduce(los_enu, axis=2) / los_enu.shape[2])[:, :, None]
    without, with_it = (
        design(towards, sigma_m[:, None], among[:, None], system_of, n_systems).cov_enu_m2[:, 0] for among in (used, used | satellite)
    )
    horizontal = (without[:, 0, 0] + without[:, 1, 1]) / (with_it[:, 0, 0] + with_it[:, 1, 1])
    return np.where(np.isfinite(horizontal), np.sqrt(np.maximum(horizontal, 0.0)), np.inf)
