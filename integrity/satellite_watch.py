"""What monitors with memory watch of satellites, whichever of them are used: step 3 of the main path begins with it."""

from typing import NamedTuple

from integrity.gnss.observations import Floats
from integrity.limits import Limits
from integrity.monitors import navigation
from integrity.satellites import Watched
from integrity.sight import Sight


class SatelliteMemory(NamedTuple):
    """What is remembered of satellites: the sets that serve, by satellite."""

    navigation: navigation.Table


def watch_satellites(
    memory: SatelliteMemory, sight: Sight, site_ecef_m: Floats, limits: Limits
) -> tuple[SatelliteMemory, tuple[Watched, ...]]:
    """The memory after a block, and what it shows of its satellites; `site_ecef_m` (3,) is the middle of the triangle."""
    sky, block = sight.sky, sight.block
    most = (limits["ephemeris"], limits["orbit"])
    table, sets = navigation.advance(memory.navigation, block.satellites, sky.ephemerides, sky.index, block.epoch_ns, site_ecef_m, *most)
    watched = (
        Watched("ephemeris", sets.change, limits["ephemeris"]),
        Watched("reissued", sets.reissued_m, limits["reissued"]),
        Watched("orbit", sets.orbit, limits["orbit"]),
    )
    return SatelliteMemory(table), watched
