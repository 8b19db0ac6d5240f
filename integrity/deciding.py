"""Steps 2 to 4 of the main path: from aligned epochs to checks. Functions of what is remembered; nothing here remembers.

`decide` gives a block as it was decided, and the memory after it. A block may be computed in part before it is there (`ahead_of`): that
changes no number, only how soon the numbers are there.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from integrity.assembler import AlignedEpoch
from integrity.checks import BlockChecks, Geometry, Surroundings, check, geometry_of
from integrity.config import SiteConfig
from integrity.exclusion import Table, Walk, walk, without_channels
from integrity.gnss.ephemeris.store import EphemerisStore
from integrity.gnss.observations import Bools, Floats, Layout
from integrity.gnss.positioning import Points, points_at
from integrity.limits import Limits, derive
from integrity.monitors.triangles import suspects
from integrity.receiver_watch import ReceiverMemory, heard_with
from integrity.satellite_watch import SatelliteMemory, watch_satellites
from integrity.satellites import SatelliteStatistics
from integrity.sight import Sight, Sky, observe, sky_of
from integrity.stream_memory import StreamMemory, StreamStatistics, advance
from integrity.triangle import ReferenceTriangle, reference_triangle
from integrity.verdict import clean_epochs, fails_only


class Place(NamedTuple):
    """What is surveyed of a site and promised there, and what follows from it; `middle_ecef_m` (3,) of the triangle."""

    site: SiteConfig
    triangle: ReferenceTriangle
    limits: Limits
    points: Points
    middle_ecef_m: Floats


def place_of(site: SiteConfig) -> Place:
    """Of a site file; ConfigError where its promises contradict each other or its triangle."""
    triangle = reference_triangle(site)
    return Place(site, triangle, derive(site, triangle), points_at(triangle.pos_ecef_m), triangle.pos_ecef_m.mean(axis=0))


class Memory(NamedTuple):
    """What blocks hand on to each other."""

    streams: StreamMemory
    satellites: SatelliteMemory
    receivers: ReceiverMemory
    exclusions: Table


@dataclass(frozen=True, eq=False)
class Decided:
    """A block after step 4: with the satellites in use (`full`), and with all of them, which is what the triangle alone goes by.

    `clean`, `clean_alone` (E,): epochs without a failing check; `suspected` (E, R): whom rules (i) to (iii) of naming point at; `memory`
    after the block.
    """

    epochs: Sequence[AlignedEpoch]
    sight: Sight
    around: Surroundings
    walked: Walk
    full: BlockChecks
    alone: BlockChecks
    clean: Bools
    clean_alone: Bools
    suspected: Bools
    memory: Memory

    @property
    def streams(self) -> StreamStatistics:
        """What the streams show."""
        return self.around.streams


class Last(NamedTuple):
    """What the next epoch probably shares with the last one: its signals, and satellites used (1, S), with and without exclusions."""

    layout: Layout
    sky: Sky
    used: tuple[Bools, ...]


class Ahead(NamedTuple):
    """What was computed before an epoch was there."""

    sky: Sky
    geometries: tuple[Geometry, ...]


def last_of(decided: Decided) -> Last:
    """Of a block."""
    alone, full = decided.alone.used[-1:], decided.full.used[-1:]
    return Last(decided.sight.layout, decided.sight.sky, (full,) if np.array_equal(alone, full) else (full, alone))


def ahead_of(last: Last, next_ns: int, place: Place, store: EphemerisStore) -> Ahead:
    """What the epoch at `next_ns` is going to need, should it go on as the last one did."""
    epoch_ns, arrived = np.array([next_ns]), (len(store),)
    sky = sky_of(last.sky.signals, epoch_ns, arrived, last.sky.klobuchar, store, place.points, place.site, place.limits)
    return Ahead(sky, tuple(geometry_of(sky, used, place.site.integrity, place.triangle) for used in last.used))


def decide(
    epochs: Sequence[AlignedEpoch], place: Place, store: EphemerisStore, memory: Memory, last: Last | None, ahead: Ahead | None
) -> Decided:
    """A block of epochs that share one set of ionospheric terms."""
    site, limits = place.site, place.limits
    remembered = memory.streams.signals_since(epochs[0].epoch_ns - limits.remember_satellite_ns)
    layout, sky = last and last.layout, ahead and ahead.sky
    sight = observe(epochs, store, place.points, site, limits, remembered, layout, sky)
    after, streams = advance(memory.streams, sight.heard, sight.heard_high, sight.bands, limits)
    satellites, watched = watch_satellites(memory.satellites, sight, place.points, place.middle_ecef_m, limits)
    sight = replace(sight, satellites=sight.satellites._replace(watched=watched))
    heard = heard_with(epochs, sight.block.epoch_ns, site.receiver_names, site.host_clock)
    around = Surroundings(streams, heard, watched, memory.receivers)
    known = ahead.geometries if ahead else ()
    of_screened = _geometry(known, sight.sky, sight.satellites.screened, place)
    on_screened = sight.satellites.statistics_by(of_screened.clocks, of_screened.of_each)
    walked = _walk(memory.exclusions, sight, on_screened, place)

    def checked_by(geometry: Geometry, shown: SatelliteStatistics) -> BlockChecks:
        return check(sight, geometry, shown, around, place.points, place.triangle, site, limits)

    def checked(used: Bools) -> BlockChecks:
        geometry = _geometry(known, sight.sky, used, place)
        return checked_by(geometry, sight.satellites.statistics_by(geometry.clocks, geometry.of_each))

    alone = checked_by(of_screened, on_screened)
    full = alone if np.array_equal(walked.used, sight.satellites.screened) else checked(walked.used)
    if any(walked.channels):
        walked, full = _leave_out_channels(sight, walked, full, checked)
    clean, clean_alone = clean_epochs(full.checks, "full"), clean_epochs(alone.checks, "triangle")
    nobody = np.zeros(full.solution.why.shape, dtype=np.bool_)
    suspected = nobody if clean.all() else suspects(full.triangle.circle_m, full.naming, limits)
    then = Memory(after, satellites, full.memory, walked.table)
    return Decided(epochs, sight, around, walked, full, alone, clean, clean_alone, suspected, then)


def _geometry(known: tuple[Geometry, ...], sky: Sky, used: Bools, place: Place) -> Geometry:
    """The one that was computed ahead, if it is of these satellites."""
    for geometry in known:
        if geometry.is_of(sky, used):
            return geometry
    return geometry_of(sky, used, place.site.integrity, place.triangle)


def _walk(table: Table, sight: Sight, on_screened: SatelliteStatistics, place: Place) -> Walk:
    if place.site.integrity.rule == "triangle":
        n = len(sight.block.epoch_ns)
        return Walk(sight.satellites.screened, [{}] * n, [()] * n, {})
    block = sight.block
    return walk(table, sight.satellites, on_screened, block.receivers, block.satellites, block.epoch_ns, place.limits)


def _leave_out_channels(sight: Sight, walked: Walk, full: BlockChecks, checked: Callable[[Bools], BlockChecks]) -> tuple[Walk, BlockChecks]:
    """Leave channels out where nothing but the B-value fails with them, and nothing fails without them; see `exclusion`."""
    could_help = fails_only(full.checks, "b_value") & np.array([bool(channels) for channels in walked.channels])
    satellites = sight.block.satellites
    if not could_help.any():
        return without_channels(walked, satellites, could_help), full
    without = checked(without_channels(walked, satellites, could_help).used)
    kept_out = without_channels(walked, satellites, could_help & clean_epochs(without.checks, "full"))
    return kept_out, checked(kept_out.used)
