"""Positions, every statistic, every check of a block: step 4 of the main path, memoryless."""

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from integrity.config import IntegrityConfig, SiteConfig
from integrity.exclusion import SatelliteStatistics
from integrity.gnss.least_squares import Design, Solution, design, solution
from integrity.gnss.observations import Bools
from integrity.gnss.positioning import Points, relinearised
from integrity.gnss.signals import TIME_SCALES
from integrity.limits import Limits
from integrity.monitors.residuals import ClockDesign, clock_design
from integrity.monitors.streams import missing_satellites, second_worst
from integrity.monitors.triangles import NamingStatistics, TriangleStatistics, Variances, naming_statistics, triangle_statistics, variances
from integrity.sight import Sight, Sky
from integrity.stream_memory import StreamStatistics
from integrity.triangle import ReferenceTriangle
from integrity.verdict import Checks, judge


class Geometry(NamedTuple):
    """What the satellites `used` (E, S) of a sky promise before anything is measured: how clocks and positions follow from ranges, and
    the variances of those positions."""

    sky: Sky
    used: Bools
    clocks: ClockDesign
    position: Design
    var: Variances

    def is_of(self, sky: Sky, used: Bools) -> bool:
        """Whether it is the geometry of these satellites in this very sky."""
        return self.sky is sky and np.array_equal(self.used, used)


def geometry_of(sky: Sky, used: Bools, promises: IntegrityConfig, triangle: ReferenceTriangle) -> Geometry:
    """The geometry of satellites, all of which every receiver measures."""
    position = design(sky.expected.los_enu, sky.sigma_m[:, None, :], used[:, None, :], sky.system_of, len(TIME_SCALES))
    clocks = clock_design(sky.sigma_m, used, sky.system_of, len(TIME_SCALES))
    return Geometry(sky, used, clocks, position, variances(position.cov_enu_m2, promises, triangle))


@dataclass(frozen=True, eq=False)
class BlockChecks:
    """What was computed on the satellites `used` (E, S): solution, statistics, checks, and what the satellites show."""

    used: Bools
    solution: Solution
    var: Variances
    reference: ReferenceTriangle
    triangle: TriangleStatistics
    checks: Checks
    satellites: SatelliteStatistics

    @cached_property
    def naming(self) -> NamingStatistics:
        """Asked only where something failed."""
        return naming_statistics(self.solution.e_enu_m, self.var, self.reference)


def check(
    sight: Sight,
    geometry: Geometry,
    shown: SatelliteStatistics,
    streams: StreamStatistics,
    points: Points,
    triangle: ReferenceTriangle,
    site: SiteConfig,
    limits: Limits,
) -> BlockChecks:
    """All checks of a block on the satellites of `geometry`, which make the satellites show `shown`."""
    sky, position = sight.sky, geometry.position
    found = relinearised(solution(position, sight.at_points.residual_m), position, sight.block, sky.states, points, sky.klobuchar)
    as_designed = found.cov_enu_m2 is position.cov_enu_m2
    var = geometry.var if as_designed else variances(found.cov_enu_m2, site.integrity, triangle)
    of_triangle = triangle_statistics(found.e_enu_m, var, triangle)
    statistics = {f"circle_{name}": of_triangle.circle_m[:, r] for r, name in enumerate(site.receiver_names)} | {
        "data": missing_satellites(geometry.used, limits.min_common_satellites),
        "repeat": streams.repeating.sum(axis=1).astype(np.float64),
        "common": of_triangle.common,
        "common_3d": of_triangle.common_3d,
        "shape": of_triangle.shape,
        "shape_3d": of_triangle.shape_3d,
        "collapse": of_triangle.collapse,
        "residual": shown.worst_residual,
        "b_value": shown.worst_b,
        "cn0": second_worst(streams.cn0_drop_db),
        "loss": second_worst(streams.lost_share),
    }
    checks = judge(statistics, limits)
    return BlockChecks(geometry.used, found, var, triangle, of_triangle, checks, shown)
