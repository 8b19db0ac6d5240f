"""What the station sees in a block of epochs: step 2 of the main path, memoryless."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from integrity.assembler import AlignedEpoch
from integrity.config import SiteConfig
from integrity.exclusion import SatelliteInputs
from integrity.gnss.atmosphere import Klobuchar
from integrity.gnss.ephemeris import Ephemeris, EphemerisStore, SatelliteStates, accuracy_m, satellite_states, usable
from integrity.gnss.observations import Bools, Ints, ObservationBlock, build_block
from integrity.gnss.positioning import Points, Prefit, prefit, range_sigma_m, state_time_ns
from integrity.gnss.signals import SYSTEMS, system_index
from integrity.limits import Limits
from integrity.monitors.residuals import without_lone_satellites


@dataclass(frozen=True, eq=False)
class Sight:
    """A block with its satellites: `healthy` (E, S); `ephemeris_index` (E, S) into `ephemerides`; `satellites` feed walk A."""

    block: ObservationBlock
    klobuchar: Klobuchar | None
    ephemerides: Sequence[Ephemeris]
    ephemeris_index: Ints
    states: SatelliteStates
    at_points: Prefit
    healthy: Bools
    satellites: SatelliteInputs


def observe(
    epochs: Sequence[AlignedEpoch],
    store: EphemerisStore,
    points: Points,
    site: SiteConfig,
    limits: Limits,
    remembered_signals: Sequence[str],
) -> Sight:
    """Block, satellite states, residuals at the surveyed points, sigmas, screening. All epochs share one set of ionospheric terms."""
    block = build_block(site.receiver_names, [x.epoch_ns for x in epochs], [x.rows for x in epochs], remembered_signals)
    ephemerides = store.ephemerides
    index = store.choose(block.satellites, block.epoch_ns, np.array([x.arrived for x in epochs]))
    states = satellite_states(ephemerides, index, state_time_ns(block.epoch_ns))
    at_points = prefit(block, states, points, epochs[0].klobuchar)
    healthy = usable(ephemerides, index)

    system_of = np.array([system_index(s) for s in block.satellites], dtype=np.int64)
    promises = site.integrity
    el_rad = at_points.el_rad.mean(axis=1)
    satellites = SatelliteInputs(
        prefit_m=at_points.residual_m,
        sigma_m=range_sigma_m(el_rad, promises.sigma_range_m, promises.sigma_range_low_m, accuracy_m(ephemerides, index)),
        sigma_differential_m=range_sigma_m(el_rad, promises.sigma_range_differential_m, promises.sigma_range_differential_low_m),
        screened=screen(block, at_points, healthy, system_of, limits),
        system_of=system_of,
        n_systems=len(SYSTEMS),
    )
    return Sight(block, epochs[0].klobuchar, ephemerides, index, states, at_points, healthy, satellites)


def screen(block: ObservationBlock, at_points: Prefit, healthy: Bools, system_of: Ints, limits: Limits) -> Bools:
    """The common set (E, S): one signal per satellite, measured by all receivers, healthy, above the mask, plausible, not too weak,
    not alone in its constellation."""
    low_m, high_m = limits.pseudorange_range_m
    rho, cn0 = block.pseudorange_m, block.cn0_dbhz
    good = (rho >= low_m) & (rho <= high_m) & ~(cn0 < limits.min_cn0_dbhz) & (at_points.el_rad >= limits.elevation_mask_rad)
    screened: Bools = (good & np.isfinite(at_points.residual_m)).all(axis=1) & healthy
    first = 0
    for s in range(1, len(block.satellites)):
        if block.satellites[s] != block.satellites[first]:
            first = s
        else:
            screened[:, s] &= ~screened[:, first:s].any(axis=1)
    return without_lone_satellites(screened, system_of, len(SYSTEMS))
