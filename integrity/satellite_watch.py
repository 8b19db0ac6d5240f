"""What monitors with memory watch of satellites, whichever of them are used: step 3 of the main path begins with it."""

from typing import NamedTuple

from integrity.carrier_watch import CarrierMemory, watch
from integrity.gnss.observations import Floats
from integrity.gnss.positioning import Points
from integrity.limits import Limits
from integrity.monitors import navigation
from integrity.satellites import Watched
from integrity.sight import Sight


class SatelliteMemory(NamedTuple):
    """What is remembered of satellites: the sets that serve, by satellite, and their carriers."""

    navigation: navigation.Table
    carriers: CarrierMemory

    def of_windows(self, half_epochs: int, n_receivers: int) -> "SatelliteMemory":
        """The same for windows of so many epochs: of others, as a site with another interval has them, nothing is remembered."""
        same = len(self.carriers.motion.epoch_ns) == 2 * half_epochs
        return self if same else self._replace(carriers=CarrierMemory.empty(n_receivers, half_epochs))


def watch_satellites(
    memory: SatelliteMemory, sight: Sight, points: Points, site_ecef_m: Floats, limits: Limits
) -> tuple[SatelliteMemory, tuple[Watched, ...]]:
    """The memory after a block, and what it shows of its satellites; the surveyed points, and `site_ecef_m` (3,), their middle."""
    sky, block = sight.sky, sight.block
    most = (limits["ephemeris"], limits["orbit"])
    table, sets = navigation.advance(memory.navigation, block.satellites, sky.ephemerides, sky.index, block.epoch_ns, site_ecef_m, *most)
    carriers, by_carrier = watch(memory.carriers, sight, points, limits.carriers)
    watched = (
        Watched("ephemeris", sets.change, limits["ephemeris"]),
        Watched("reissued", sets.reissued_m, limits["reissued"]),
        Watched("orbit", sets.orbit, limits["orbit"]),
        *by_carrier,
    )
    return SatelliteMemory(table, carriers), watched
