"""Each constellation by itself: where its satellites alone, with a clock of their own, would put the triangle.

An error of a whole constellation's orbits or frame moves all its ranges as if the ground had moved. Each residual may stay small, and the
position made of all constellations moves by a part of it only. A step of the constellation's clock is no error: its clock is solved for.
"""

from typing import NamedTuple

import numpy as np

from integrity.gnss.least_squares import Design, design, postfit_m, solution
from integrity.gnss.observations import Bools, Floats, Ints


class ConstellationDesign(NamedTuple):
    """Constellations before anything is measured: `towards` (3, E, K, S), mean over receivers, and a solution of each, in the place of a
    receiver (E, K)."""

    towards: Floats
    position: Design


def constellation_design(los_enu: Floats, sigma_m: Floats, used: Bools, system_of: Ints, n_systems: int) -> ConstellationDesign:
    """For directions (3, E, R, S), sigmas and satellites used (E, S)."""
    of_each = used[:, None] & (system_of == np.arange(n_systems)[:, None])
    towards = np.broadcast_to((np.add.reduce(los_enu, axis=2) / los_enu.shape[2])[:, :, None], (3, *of_each.shape))
    return ConstellationDesign(towards, design(towards, sigma_m[:, None], of_each, system_of, n_systems))


def displacements(of: ConstellationDesign, prefit_m: Floats, common_m2: Floats, mean_m2: Floats) -> Floats:
    """Per constellation (E, K) the squared displacement of the triangle by its ranges (E, R, S) alone, in sigmas: chi-square, 3 degrees of
    freedom.

    The site promises variances of the error that its receivers share, `common_m2` (3,), and of their mean, `mean_m2` (3,): where a
    constellation's own geometry is poorer, axis by axis, they grow by as much (`triangles.variances`). NaN where it gives no position, or
    no other one is there to tell it from the triangle.
    """
    found = solution(of.position, _mean_of(prefit_m, of))
    promised = np.diagonal(found.cov_enu_m2, axis1=-2, axis2=-1)
    squares = found.e_enu_m**2 / (mean_m2 * np.maximum(promised / common_m2, 1.0))
    several = np.add.reduce(found.solved, axis=1, keepdims=True) > 1
    statistic: Floats = np.where(several, squares[..., 0] + squares[..., 1] + squares[..., 2], np.nan)
    return statistic


def misfits(of: ConstellationDesign, prefit_m: Floats) -> tuple[Floats, Ints]:
    """What such a displacement does not explain of a constellation's ranges, (E, K): chi-square, and its degrees of freedom; NaN where
    unsolved."""
    measured_m = _mean_of(prefit_m, of)
    found = solution(of.position, measured_m)
    left_m = np.where(of.position.used, postfit_m(measured_m, of.towards, found, of.position.system_of), 0.0)
    misfit = np.where(found.solved, np.add.reduce(of.position.w * left_m * left_m, axis=-1), np.nan)
    return misfit, np.maximum(found.n_used - 4, 0)


def _mean_of(prefit_m: Floats, of: ConstellationDesign) -> Floats:
    """Mean over receivers (E, K, S), for every constellation."""
    mean_m = np.add.reduce(prefit_m, axis=1) / prefit_m.shape[1]
    return np.broadcast_to(mean_m[:, None], of.position.used.shape)
