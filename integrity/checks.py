"""Positions, every statistic, every check of a block: step 4 of the main path."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from integrity.config import IntegrityConfig, SiteConfig
from integrity.gnss.least_squares import Design, Solution, design, solution
from integrity.gnss.observations import Bools, Floats
from integrity.gnss.positioning import Points, relinearised
from integrity.gnss.signals import TIME_SCALES
from integrity.limits import Limits
from integrity.monitors.constellations import ConstellationDesign, constellation_design
from integrity.monitors.residuals import ClockDesign, clock_design
from integrity.monitors.single_differences import PairDesign, PairStatistics, capture, pair_design, pair_statistics
from integrity.monitors.streams import missing_satellites, second_worst
from integrity.monitors.triangles import NamingStatistics, TriangleStatistics, Variances, naming_statistics, triangle_statistics, variances
from integrity.receiver_watch import Heard, ReceiverMemory, ReceiverStatistics, watch_receivers
from integrity.satellites import SatelliteStatistics, Watched
from integrity.sight import Sight, Sky
from integrity.stream_memory import StreamStatistics
from integrity.triangle import ReferenceTriangle
from integrity.verdict import Checks, judge


class Geometry(NamedTuple):
    """What the satellites `used` (E, S) of a sky promise before anything is measured: how clocks and positions follow from ranges, the
    variances of those positions, each constellation by itself, and what pairs of receivers would measure of one transmitter."""

    sky: Sky
    used: Bools
    clocks: ClockDesign
    position: Design
    var: Variances
    of_each: ConstellationDesign
    pairs: PairDesign

    def is_of(self, sky: Sky, used: Bools) -> bool:
        """Whether it is the geometry of these satellites in this very sky."""
        return self.sky is sky and np.array_equal(self.used, used)


def geometry_of(sky: Sky, used: Bools, promises: IntegrityConfig, triangle: ReferenceTriangle) -> Geometry:
    """The geometry of satellites, all of which every receiver measures."""
    position = design(sky.expected.los_enu, sky.sigma_m[:, None, :], used[:, None, :], sky.system_of, len(TIME_SCALES))
    clocks = clock_design(sky.sigma_m, used, sky.system_of, len(TIME_SCALES))
    pairs = pair_design(sky.expected.range_m, sky.sigma_differential_m, used, sky.system_of, len(TIME_SCALES))
    of_each = constellation_design(sky.expected.los_enu, sky.sigma_m, used, sky.system_of, len(TIME_SCALES))
    return Geometry(sky, used, clocks, position, variances(position.cov_enu_m2, promises, triangle), of_each, pairs)


class Surroundings(NamedTuple):
    """What else is known of a block, whichever satellites are used: what its streams show, what came with it, what is `watched` of its
    satellites, and the memory of its receivers from before it."""

    streams: StreamStatistics
    heard: Heard
    watched: tuple[Watched, ...]
    receivers: ReceiverMemory


@dataclass(frozen=True, eq=False)
class BlockChecks:
    """What was computed on the satellites `used` (E, S): solution, statistics, checks, what satellites, pairs of receivers and receivers
    show; `memory` of the receivers after the block."""

    used: Bools
    solution: Solution
    var: Variances
    reference: ReferenceTriangle
    triangle: TriangleStatistics
    checks: Checks
    satellites: SatelliteStatistics
    pairs: PairStatistics
    receivers: ReceiverStatistics
    memory: ReceiverMemory

    @cached_property
    def naming(self) -> NamingStatistics:
        """Asked only where something failed."""
        return naming_statistics(self.solution.e_enu_m, self.var, self.reference)


def check(
    sight: Sight,
    geometry: Geometry,
    shown: SatelliteStatistics,
    around: Surroundings,
    points: Points,
    triangle: ReferenceTriangle,
    site: SiteConfig,
    limits: Limits,
) -> BlockChecks:
    """All checks of a block on the satellites of `geometry`, which make the satellites show `shown`."""
    sky, position, streams = sight.sky, geometry.position, around.streams
    found = relinearised(solution(position, sight.at_points.residual_m), position, sight.block, sky.states, points, sky.klobuchar)
    as_designed = found.cov_enu_m2 is position.cov_enu_m2
    var = geometry.var if as_designed else variances(found.cov_enu_m2, site.integrity, triangle)
    of_triangle = triangle_statistics(found.e_enu_m, var, triangle)
    pairs = pair_statistics(geometry.pairs, sight.at_points.residual_m)
    statistics = _of_satellites(geometry, shown, around.watched) | {
        "data": missing_satellites(geometry.used, limits.min_common_satellites),
        "repeat": streams.repeating.sum(axis=1).astype(np.float64),
        **{f"circle_{name}": of_triangle.circle_m[:, r] for r, name in enumerate(site.receiver_names)},
        "common": of_triangle.common,
        "common_3d": of_triangle.common_3d,
        "shape": of_triangle.shape,
        "shape_3d": of_triangle.shape_3d,
        "collapse": of_triangle.collapse,
        "capture": largest_known(capture(pairs, limits["capture"], limits.least_separation)),
        "cn0": second_worst(streams.cn0_drop_db),
        "loss": second_worst(streams.lost_share),
        "host_time": around.heard.host_s,
        "told": around.heard.fed.max(axis=1),
    }
    quiet = np.logical_and.reduce([~(statistic > limits[name]) for name, statistic in statistics.items()])
    memory, receivers = watch_receivers(
        around.receivers, sight.block.epoch_ns, around.heard, quiet, found.e_enu_m, var, shown.known.clock_m, geometry.clocks, limits
    )
    statistics["slow"] = largest_known(receivers.slow.own)
    checks = judge(statistics, limits)
    return BlockChecks(geometry.used, found, var, triangle, of_triangle, checks, shown, pairs, receivers, memory)


def _of_satellites(geometry: Geometry, shown: SatelliteStatistics, watched: Sequence[Watched]) -> dict[str, Floats]:
    """Statistics (E,) of the satellites used, and of their constellations."""
    return {of.check: largest_known(np.where(geometry.used, of.statistic, np.nan)) for of in watched} | {
        "residual": shown.worst_residual,
        "b_value": shown.worst_b,
        "constellation": largest_known(shown.displacements),
    }


def largest_known(statistic: Floats) -> Floats:
    """The largest of those that say anything, over the last axis; NaN where none does."""
    result: Floats = np.fmax.reduce(statistic, axis=-1, initial=np.nan)
    return result
