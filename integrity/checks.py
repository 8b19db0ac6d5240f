"""Positions, every statistic, every check of a block: step 4 of the main path, memoryless."""

from dataclasses import dataclass

import numpy as np

from integrity.config import SiteConfig
from integrity.exclusion import SatelliteStatistics
from integrity.gnss.observations import Bools, Floats
from integrity.gnss.positioning import Points, Solution, positions
from integrity.limits import Limits
from integrity.monitors.residuals import worst
from integrity.monitors.streams import missing_satellites, second_worst
from integrity.monitors.triangles import TriangleStatistics, Variances, triangle_statistics, variances
from integrity.sight import Sight
from integrity.stream_memory import StreamStatistics
from integrity.triangle import ReferenceTriangle
from integrity.verdict import Checks, judge


@dataclass(frozen=True, eq=False)
class BlockChecks:
    """What was computed on the satellites `used` (E, S): solution, statistics, checks; per satellite `residual_sigmas` (E, S),
    the normalised residual that all receivers share, and `b_m` (E, R, S)."""

    used: Bools
    solution: Solution
    var: Variances
    triangle: TriangleStatistics
    checks: Checks
    residual_sigmas: Floats
    b_m: Floats


def check(
    sight: Sight,
    used: Bools,
    shown: SatelliteStatistics,
    streams: StreamStatistics,
    points: Points,
    triangle: ReferenceTriangle,
    site: SiteConfig,
    limits: Limits,
) -> BlockChecks:
    """All checks of a block on the satellites `used` (E, S), which make the satellites show `shown`."""
    s = sight.satellites
    solution = positions(
        sight.block,
        sight.sky.states,
        points,
        sight.sky.klobuchar,
        sight.at_points,
        s.sigma_m[:, None, :],
        used[:, None, :],
        s.system_of,
        s.n_systems,
    )
    var = variances(solution.cov_enu_m2, site.integrity)
    of_triangle = triangle_statistics(solution.e_enu_m, var, triangle)
    statistics = {f"circle_{name}": of_triangle.circle_m[:, r] for r, name in enumerate(site.receiver_names)} | {
        "data": missing_satellites(used, limits.min_common_satellites),
        "repeat": streams.repeating.sum(axis=1).astype(np.float64),
        "common": of_triangle.common,
        "common_3d": of_triangle.common_3d,
        "shape": of_triangle.shape,
        "shape_3d": of_triangle.shape_3d,
        "collapse": of_triangle.collapse,
        "residual": worst(shown.residual_sigmas, used),
        "b_value": worst(np.abs(shown.b_sigmas).max(axis=1), used),
        "cn0": second_worst(streams.cn0_drop_db),
        "loss": second_worst(streams.lost_share),
    }
    return BlockChecks(used, solution, var, of_triangle, judge(statistics, limits), shown.residual_sigmas, shown.b_m)
