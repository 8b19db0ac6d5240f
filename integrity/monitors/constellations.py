"""Each constellation by itself: where its satellites alone, with a clock of their own, would put the triangle.

An error of a whole constellation's orbits or frame moves all its ranges as if the ground had moved. Each residual may stay small, and the
position made of all constellations moves by a part of it only. A step of the constellation's clock is no error: its clock is solved for.
"""

from typing import NamedTuple

import numpy as np

from integrity.gnss.least_squares import design, postfit_m, solution
from integrity.gnss.observations import Bools, Floats, Ints


class ConstellationStatistics(NamedTuple):
    """Per constellation (E, K): `displacement`, squared, of the triangle by its satellites alone, in sigmas: chi-square, 3 degrees of
    freedom; `misfit`, what such a displacement does not explain of its ranges: chi-square, `dof` degrees of freedom. NaN where unsolved."""

    displacement: Floats
    misfit: Floats
    dof: Ints


def constellation_statistics(
    los_enu: Floats, prefit_m: Floats, sigma_m: Floats, used: Bools, system_of: Ints, n_systems: int, common_m2: Floats, mean_m2: Floats
) -> ConstellationStatistics:
    """Of each constellation by itself.

    los_enu (3, E, R, S), prefit_m (E, R, S), sigma_m and used (E, S). The site promises variances of the error that its receivers share,
    `common_m2` (3,), and of their mean, `mean_m2` (3,): where a constellation's own geometry is poorer, axis by axis, they grow by as much
    (`triangles.variances`). No displacement where no other constellation is there to tell it from the triangle.
    """
    of_each = used[:, None] & (system_of == np.arange(n_systems)[:, None])  # (E, K, S): constellations in the place of receivers
    n = prefit_m.shape[1]
    towards = np.broadcast_to((np.add.reduce(los_enu, axis=2) / n)[:, :, None], (3, *of_each.shape))
    measured_m = np.broadcast_to((np.add.reduce(prefit_m, axis=1) / n)[:, None], of_each.shape)
    of = design(towards, sigma_m[:, None], of_each & np.isfinite(measured_m), system_of, n_systems)
    found = solution(of, measured_m)
    left_m = np.where(of.used, postfit_m(measured_m, towards, found, system_of), 0.0)
    misfit = np.where(found.solved, np.add.reduce(of.w * left_m * left_m, axis=-1), np.nan)
    promised = np.diagonal(found.cov_enu_m2, axis1=-2, axis2=-1)
    squares = found.e_enu_m**2 / (mean_m2 * np.maximum(promised / common_m2, 1.0))
    several = found.solved.sum(axis=1, keepdims=True) > 1
    displacement = np.where(several, squares[..., 0] + squares[..., 1] + squares[..., 2], np.nan)
    return ConstellationStatistics(displacement, misfit, np.maximum(found.n_used - 4, 0))
