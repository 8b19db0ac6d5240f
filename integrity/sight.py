"""What the station sees in a block of epochs: step 2 of the main path, memoryless."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from integrity.assembler import AlignedEpoch
from integrity.config import SiteConfig
from integrity.exclusion import SatelliteInputs
from integrity.gnss.atmosphere import Klobuchar
from integrity.gnss.ephemeris.states import Ephemerides, SatelliteStates, accuracy_m, satellite_states, usable
from integrity.gnss.ephemeris.store import EphemerisStore
from integrity.gnss.observations import Bools, Floats, Ints, Layout, ObservationBlock, build_block, layout_of
from integrity.gnss.positioning import Expected, Points, Prefit, compared, expected, range_accuracy_m, range_sigma_m, state_time_ns
from integrity.gnss.signals import TIME_SCALES, bands_of, first_codes_of, preference, satellite_of, time_scale_index
from integrity.limits import Limits
from integrity.monitors.residuals import without_lone_satellites


@dataclass(frozen=True, eq=False)
class Sky:
    """What is known of a block's satellites before anything is measured: `healthy` (E, S), sigmas of ranges (E, S), which constellation;
    `in_view` (E, S), above the mask of all receivers, and `high` (E, R, S), where a receiver does not lose it by itself: all healthy."""

    ephemerides: Ephemerides
    signals: tuple[str, ...]  # (S,)
    arrived: tuple[int, ...]  # ephemerides known at each epoch, (E,)
    klobuchar: Klobuchar | None
    states: SatelliteStates
    expected: Expected
    healthy: Bools
    in_view: Bools
    high: Bools
    sigma_m: Floats
    sigma_differential_m: Floats
    system_of: Ints

    def is_of(
        self, signals: tuple[str, ...], epoch_ns: Ints, arrived: tuple[int, ...], klobuchar: Klobuchar | None, store: EphemerisStore
    ) -> bool:
        """Whether it is the sky of these epochs."""
        same = self.signals == signals and self.arrived == arrived and self.klobuchar == klobuchar
        return same and self.ephemerides is store.ephemerides and np.array_equal(self.states.t_ns, state_time_ns(epoch_ns))


@dataclass(frozen=True, eq=False)
class Sight:
    """A block under its sky; `satellites` feed walk A."""

    layout: Layout
    block: ObservationBlock
    sky: Sky
    at_points: Prefit
    satellites: SatelliteInputs


def sky_of(
    signals: tuple[str, ...],
    epoch_ns: Ints,
    arrived: tuple[int, ...],
    klobuchar: Klobuchar | None,
    store: EphemerisStore,
    points: Points,
    site: SiteConfig,
    limits: Limits,
) -> Sky:
    """The sky at epochs, as the surveyed points see it."""
    ephemerides = store.ephemerides
    satellites = [satellite_of(s) for s in signals]
    index = store.choose(satellites, epoch_ns, np.array(arrived))
    states = satellite_states(ephemerides, index, state_time_ns(epoch_ns), signals)
    seen = expected(states, epoch_ns, points, klobuchar)
    promises = site.integrity
    el_rad = seen.el_rad.mean(axis=1)
    healthy = usable(ephemerides, index)
    promised_m = range_accuracy_m(states, accuracy_m(ephemerides, index))
    return Sky(
        ephemerides,
        signals,
        arrived,
        klobuchar,
        states,
        seen,
        healthy=healthy,
        in_view=(seen.el_rad >= limits.elevation_mask_rad).all(axis=1) & healthy,
        high=(seen.el_rad >= limits.loss_elevation_rad) & healthy[:, None, :],
        sigma_m=range_sigma_m(el_rad, promises.sigma_range_m, promises.sigma_range_low_m, promised_m),
        sigma_differential_m=range_sigma_m(el_rad, promises.sigma_range_differential_m, promises.sigma_range_differential_low_m),
        system_of=np.array([time_scale_index(s) for s in satellites], dtype=np.int64),
    )


def observe(
    epochs: Sequence[AlignedEpoch],
    store: EphemerisStore,
    points: Points,
    site: SiteConfig,
    limits: Limits,
    remembered_signals: tuple[str, ...],
    before: Layout | None,
    ahead: Sky | None,
) -> Sight:
    """Block, sky, residuals at the surveyed points, screening. All epochs share one set of ionospheric terms.

    The layout of the block `before`, and a sky that was computed `ahead`, are used if they are those of these epochs.
    """
    codes = first_codes_of(site.integrity.systems)
    layout = layout_of((row for x in epochs for row in x.rows), remembered_signals, before, codes)
    block = build_block(site.receiver_names, [x.epoch_ns for x in epochs], [x.rows for x in epochs], layout)
    where = (block.signals, block.epoch_ns, tuple(x.arrived for x in epochs), epochs[0].klobuchar, store)
    sky = ahead if ahead is not None and ahead.is_of(*where) else sky_of(*where, points, site, limits)
    at_points = compared(block, sky.expected)
    satellites = SatelliteInputs(
        prefit_m=at_points.residual_m,
        sigma_m=sky.sigma_m,
        sigma_differential_m=sky.sigma_differential_m,
        screened=screen(block, at_points, sky.in_view, sky.system_of, limits),
        system_of=sky.system_of,
        n_systems=len(TIME_SCALES),
    )
    return Sight(layout, block, sky, at_points, satellites)


def screen(block: ObservationBlock, at_points: Prefit, in_view: Bools, system_of: Ints, limits: Limits) -> Bools:
    """The common set (E, S): one signal per satellite, of one band per clock, in view, measured by all receivers, plausible, not too weak,
    not alone in its constellation."""
    low_m, high_m = limits.pseudorange_range_m
    rho, cn0 = block.pseudorange_m, block.cn0_dbhz
    good = (rho >= low_m) & (rho <= high_m) & ~(cn0 < limits.min_cn0_dbhz) & np.isfinite(at_points.residual_m)
    screened: Bools = good.all(axis=1) & in_view
    for bands in _bands_by_clock(block.signals):
        count = np.stack([screened[:, columns].sum(axis=1) for columns in bands])
        chosen = count.argmax(axis=0)  # the preferred one of equals
        for k, columns in enumerate(bands):
            screened[:, columns] &= (chosen == k)[:, None]
    first = 0
    for s in range(1, len(block.satellites)):
        if block.satellites[s] != block.satellites[first]:
            first = s
        else:
            screened[:, s] &= ~screened[:, first:s].any(axis=1)
    return without_lone_satellites(screened, system_of, len(TIME_SCALES))


@lru_cache(maxsize=256)
def _bands_by_clock(signals: tuple[str, ...]) -> tuple[tuple[list[int], ...], ...]:
    """Of each clock with signals of several bands (B1I and B3I), their columns by band, the preferred band first.

    Receivers delay bands differently, by metres that no message tells: where one lacks a signal, another band of that satellite alone
    would look like a fault of the satellite.
    """
    clocks: dict[int, dict[str, list[int]]] = {}
    for column in sorted(range(len(signals)), key=lambda s: preference(signals[s])[1:]):
        bands = clocks.setdefault(time_scale_index(satellite_of(signals[column])), {})
        bands.setdefault(bands_of(signals[column])[0], []).append(column)
    return tuple(tuple(bands.values()) for bands in clocks.values() if len(bands) > 1)
