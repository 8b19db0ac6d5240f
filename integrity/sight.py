"""What the station sees in a block of epochs: step 2 of the main path, memoryless."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from integrity.assembler import AlignedEpoch
from integrity.config import SiteConfig
from integrity.gnss.atmosphere import Klobuchar
from integrity.gnss.combination import ionosphere_free
from integrity.gnss.ephemeris.states import Ephemerides, SatelliteStates, accuracy_m, satellite_states, usable
from integrity.gnss.ephemeris.store import EphemerisStore
from integrity.gnss.observations import Bools, Floats, Ints, Layout, ObservationBlock, build_block, layout_of
from integrity.gnss.positioning import Expected, Points, Prefit, compared, expected, range_accuracy_m, range_sigma_m, state_time_ns
from integrity.gnss.signals import (
    TIME_SCALES,
    bands_of,
    first_codes_of,
    is_in_lower_band,
    is_pair,
    pair_codes_of,
    preference,
    satellite_of,
    time_scale_index,
)
from integrity.limits import Limits
from integrity.monitors.residuals import without_lone_satellites
from integrity.monitors.triangles import promised_m2
from integrity.satellites import SatelliteInputs

Columns = slice | Ints
WHOLE: tuple[Columns, ...] = (slice(None),)


@dataclass(frozen=True, eq=False)
class Sky:
    """What is known of a block's satellites before anything is measured: `healthy` (E, S), sigmas of ranges (E, S), which constellation;
    `in_view` (E, S), above the mask of all receivers, and `high` (E, R, S), where a receiver does not lose it by itself: all healthy."""

    ephemerides: Ephemerides
    index: Ints  # (E, S) into the ephemerides, -1 for none
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
    """What was heard, and what is decided on under its sky: the same, or pairs of it. `layout` is of `heard`; `satellites` feed walk A."""

    layout: Layout
    heard: ObservationBlock
    block: ObservationBlock
    sky: Sky
    at_points: Prefit
    satellites: SatelliteInputs

    @property
    def heard_high(self) -> Bools:
        """`Sky.high` of the signals heard, (E, R, S); False for satellites that nothing is decided on."""
        if self.heard is self.block:
            return self.sky.high
        nowhere = np.zeros((*self.sky.high.shape[:2], 1), dtype=np.bool_)
        high: Bools = np.concatenate((self.sky.high, nowhere), axis=-1)[..., _columns_of(self.heard.satellites, self.block.satellites)]
        return high

    @property
    def bands(self) -> tuple[Columns, ...]:
        """Signals heard that are disturbed together, whose streams are watched apart from the others."""
        return WHOLE if self.heard is self.block else _halves(self.heard.signals)

    def lacking(self, e: int, needed: int) -> tuple[str, ...]:
        """Where receivers share pairs of fewer satellites than are `needed`: which pairs each has, in words. Nothing of single signals."""
        if self.heard is self.block or np.isfinite(self.block.pseudorange_m[e]).all(axis=0).sum() >= needed:
            return ()
        told = ", ".join(f"{name} {_pairs_of(self.block, e, r)}" for r, name in enumerate(self.block.receivers))
        return (
            f"frequencies = 2 needs the same pairs of {needed} satellites from all receivers, and they have: {told}; "
            "have those that lack them track a second band, or write frequencies = 1",
        )


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
        index,
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
    promises = site.integrity
    in_pairs = promises.frequencies == 2
    codes = pair_codes_of(promises.systems) if in_pairs else first_codes_of(promises.systems)
    remembered = _of_codes(remembered_signals, promises.systems, in_pairs)
    layout = layout_of((row for x in epochs for row in x.rows), remembered, before, codes)
    heard = build_block(site.receiver_names, [x.epoch_ns for x in epochs], [x.rows for x in epochs], layout)
    block = ionosphere_free(heard) if in_pairs else heard
    where = (block.signals, block.epoch_ns, tuple(x.arrived for x in epochs), epochs[0].klobuchar, store)
    sky = ahead if ahead is not None and ahead.is_of(*where) else sky_of(*where, points, site, limits)
    at_points = compared(block, sky.expected)
    common_m2, differential_m2 = promised_m2(promises)
    satellites = SatelliteInputs(
        prefit_m=at_points.residual_m,
        los_enu=at_points.los_enu,
        sigma_m=sky.sigma_m,
        sigma_differential_m=sky.sigma_differential_m,
        screened=screen(block, at_points, sky.in_view, sky.system_of, limits),
        system_of=sky.system_of,
        n_systems=len(TIME_SCALES),
        common_m2=common_m2,
        mean_m2=common_m2 + differential_m2 / len(site.receivers),
    )
    return Sight(layout, heard, block, sky, at_points, satellites)


def screen(block: ObservationBlock, at_points: Prefit, in_view: Bools, system_of: Ints, limits: Limits) -> Bools:
    """The common set (E, S): one signal per satellite, of one band per clock (or one pair, of one pair of codes), in view, measured by all
    receivers, plausible, not too weak, not alone in its constellation."""
    low_m, high_m = limits.pseudorange_range_m
    rho, cn0 = block.pseudorange_m, block.cn0_dbhz
    good = (rho >= low_m) & (rho <= high_m) & ~(cn0 < limits.min_cn0_dbhz) & np.isfinite(at_points.residual_m)
    screened: Bools = good.all(axis=1) & in_view
    for alike in _alike_by_clock(block.signals):
        count = np.stack([screened[:, columns].sum(axis=1) for columns in alike])
        chosen = count.argmax(axis=0)  # the preferred one of equals
        for k, columns in enumerate(alike):
            screened[:, columns] &= (chosen == k)[:, None]
    first = 0
    for s in range(1, len(block.satellites)):
        if block.satellites[s] != block.satellites[first]:
            first = s
        else:
            screened[:, s] &= ~screened[:, first:s].any(axis=1)
    return without_lone_satellites(screened, system_of, len(TIME_SCALES))


@lru_cache(maxsize=256)
def _alike_by_clock(signals: tuple[str, ...]) -> tuple[tuple[list[int], ...], ...]:
    """Of each clock with signals of several bands (B1I and B3I) their columns by band, with pairs of several codes (E1 with E5a, or with
    E5b; L2C or P(Y)) their columns by codes, the preferred ones first.

    Receivers delay bands differently, by metres that no message tells: where one lacks a signal, another band of that satellite alone
    would look like a fault of the satellite. A pair multiplies what receivers and satellites delay codes of one band differently, so that
    GPS satellites with P(Y) on L2 stand 1.5 to 2 m apart from those with L2C (of four receivers of one make).
    """
    clocks: dict[int, dict[str, list[int]]] = {}
    for column in sorted(range(len(signals)), key=lambda s: preference(signals[s])[1:]):
        signal = signals[column]
        alike = signal.partition(".")[2] if is_pair(signal) else bands_of(signal)[0]
        clocks.setdefault(time_scale_index(satellite_of(signal)), {}).setdefault(alike, []).append(column)
    return tuple(tuple(alike.values()) for alike in clocks.values() if len(alike) > 1)


@lru_cache(maxsize=256)
def _of_codes(signals: tuple[str, ...], systems: tuple[str, ...], in_pairs: bool) -> tuple[str, ...]:
    """Remembered signals that decisions are made of: a site that is replayed otherwise than it was run remembers others too."""
    codes = pair_codes_of(systems) if in_pairs else first_codes_of(systems)
    return tuple(signal for signal in signals if signal.partition(".")[2] in codes.get(signal[:1], ()))


@lru_cache(maxsize=256)
def _columns_of(satellites: tuple[str, ...], among: tuple[str, ...]) -> Ints:
    """Where each satellite stands first among others, -1 where it does not."""
    place = {satellite: column for column, satellite in reversed(list(enumerate(among)))}
    columns = np.array([place.get(satellite, -1) for satellite in satellites], dtype=np.int64)
    columns.setflags(write=False)
    return columns


@lru_cache(maxsize=256)
def _halves(signals: tuple[str, ...]) -> tuple[Columns, ...]:
    """Columns of the signals around L1, and of those below: a jammer of one band leaves the other as it was."""
    lower = np.array([is_in_lower_band(signal) for signal in signals], dtype=np.bool_)
    return np.flatnonzero(~lower), np.flatnonzero(lower)


def _pairs_of(block: ObservationBlock, e: int, r: int) -> str:
    """How many satellites a receiver measures in pairs, and of which codes."""
    measured = np.flatnonzero(np.isfinite(block.pseudorange_m[e, r])).tolist()
    if not measured:
        return "none"
    codes = sorted({block.signals[s][0] + block.signals[s].partition(".")[2] for s in measured})
    return f"{len({block.satellites[s] for s in measured})} ({' '.join(codes)})"
