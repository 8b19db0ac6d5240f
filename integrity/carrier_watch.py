"""What carriers show of satellites: from a block to `Watched` entries, for five checks (`carrier_thresholds`).

step, ramp, acceleration   `monitors.carrier_motion`, of carriers at the surveyed points
innovation, divergence     `monitors.divergence`, of code against carrier

All signals of a block are watched that are in view, screened or not: whether a signal is screened may change from epoch to epoch, and its
filters go on. Another set of a satellite that begins to serve moves what is expected of its range; that is no motion of the satellite.
Numbers are the same to the bit however a stream is cut into blocks, which long blocks make use of: they go in parts that fit the cache.
"""

from dataclasses import dataclass
from functools import lru_cache
from math import hypot
from typing import Any, NamedTuple

import numpy as np

from integrity.carrier_thresholds import CARRIER_CHECKS, MOTION_CHECKS, CarrierDesign
from integrity.gnss.combination import weights_of
from integrity.gnss.constants import SPEED_OF_LIGHT_MPS
from integrity.gnss.ephemeris.broadcast import Ephemeris
from integrity.gnss.ephemeris.content import content_crc32
from integrity.gnss.ephemeris.states import Ephemerides, satellite_states
from integrity.gnss.observations import ROW_ARRAYS, Bools, Floats, Ints, ObservationBlock, slices
from integrity.gnss.positioning import Points, expected, state_time_ns
from integrity.gnss.signals import TIME_SCALES, bands_of, carrier_hz
from integrity.monitors import carrier_motion, divergence
from integrity.monitors.carrier_motion import MotionInputs, MotionMemory, MotionStatistics
from integrity.monitors.carrier_residuals import TrackingMemory, carrier_residual_m, code_minus_carrier_m, continuing, nature
from integrity.monitors.common_motion import Measured, named_or_moved
from integrity.monitors.divergence import DivergenceInputs, DivergenceMemory
from integrity.monitors.residuals import seen_by_all
from integrity.satellites import Watched
from integrity.sight import Sight, Sky

WORTH_LEAVING_OUT = 0.8  # signals in view among those listed: to pick out more than that costs more than it saves


@dataclass(frozen=True, eq=False)
class CarrierMemory:
    """What is remembered of carriers; `serving`: of each of `signals` the set that served in the last epoch, None where none did."""

    signals: tuple[str, ...]
    serving: tuple[Ephemeris | None, ...]
    tracking: TrackingMemory
    motion: MotionMemory
    divergence: DivergenceMemory

    @staticmethod
    def empty(n_receivers: int, half_epochs: int) -> "CarrierMemory":
        """Before the first epoch; `half_epochs` as in `MotionDesign`."""
        return CarrierMemory(
            (), (), TrackingMemory.empty(n_receivers), MotionMemory.empty(n_receivers, half_epochs), DivergenceMemory.empty(n_receivers)
        )

    def serving_on(self, signals: tuple[str, ...]) -> tuple[Ephemeris | None, ...]:
        """The sets that served other signals."""
        if signals == self.signals:
            return self.serving
        of = dict(zip(self.signals, self.serving, strict=True))
        return tuple(of.get(signal) for signal in signals)


class _Signals(NamedTuple):
    """Of signals (S,): how much more noise they have than one that stands alone; carriers, and their change from channel to channel, Hz;
    wavelengths, None where some depend on the channel."""

    noise: Floats
    carrier_hz: Floats
    channel_hz: Floats
    wavelength_m: Floats | None


def watch(memory: CarrierMemory, sight: Sight, points: Points, design: CarrierDesign) -> tuple[CarrierMemory, tuple[Watched, ...]]:
    """The memory after a block, and what carriers show of the satellites of `sight.block`, (E, S) each; `points`: the surveyed ones."""
    block, sky = sight.block, sight.sky
    jump_m, serving = _ephemeris_jumps(memory.serving_on(block.signals), sky, block.epoch_ns, points)
    n_epochs, n_receivers, n_signals = block.carrier_cycles.shape
    shown = np.empty((len(CARRIER_CHECKS), n_epochs, n_signals))
    names, everything = np.zeros((2, len(MOTION_CHECKS), n_epochs), dtype=np.bool_)
    tracking, motion, apart = memory.tracking, memory.motion, memory.divergence
    most = np.array([design.thresholds[name] for name in MOTION_CHECKS])[:, None, None]
    for few in slices(n_epochs, n_receivers * n_signals):
        seen = _seen(sight, few, jump_m)
        tracking, continues = continuing(tracking, seen.part, design.lock_share)
        of_motion, of_code = _inputs(seen, continues, design)
        motion, moved = carrier_motion.advance(motion, of_motion, design.motion)
        apart, left = divergence.advance(apart, of_code, design.divergence)
        found = seen_by_all(np.concatenate((moved.sigmas, left.sigmas)))
        if (found[: len(MOTION_CHECKS)] > most).any():
            names[:, few], everything[:, few] = _of_satellites_or_all(found, moved, sight, few, seen, design)
        if seen.columns is None:
            shown[:, few] = found
        else:
            shown[:, few] = np.nan
            shown[:, few, seen.columns] = found
    by_motion = dict(zip(MOTION_CHECKS, zip(names, everything, strict=True), strict=True))
    watched = tuple(
        Watched(name, of, design.thresholds[name], *by_motion.get(name, ())) for name, of in zip(CARRIER_CHECKS, shown, strict=True)
    )
    served = serving if seen.columns is None else tuple(serving[s] for s in seen.columns.tolist())
    return CarrierMemory(seen.part.signals, served, tracking, motion, apart), watched


def _of_satellites_or_all(
    found: Floats, moved: MotionStatistics, sight: Sight, few: slice, seen: "_Seen", design: CarrierDesign
) -> tuple[Bools, Bools]:
    """By check of motion and epoch (3, E), where one exceeds its threshold: whether satellites may be named, all their signals together,
    and whether everything moved."""
    part, n = seen.part, moved.sigmas.shape[2]
    names, everything = np.zeros((2, len(MOTION_CHECKS), len(part.epoch_ns)), dtype=np.bool_)
    los = sight.sky.expected.los_enu if seen.columns is None else sight.sky.expected.los_enu[..., seen.columns]
    towards = np.add.reduce(los[:, few], axis=2) / n
    sigma_m = np.broadcast_to(moved.sigma, moved.sigmas.shape)[:, :, 0]
    moved_m = np.add.reduce(moved.sigmas, axis=2) / n * sigma_m
    same = np.array(part.satellites)[:, None] == np.array(part.satellites)
    for c, name in enumerate(MOTION_CHECKS):
        exceeds = found[c] > design.thresholds[name]
        where = np.flatnonzero(exceeds.any(axis=-1))
        if len(where):
            suspects = (exceeds[where][:, :, None] & same).any(axis=1)
            at = moved_m[c, where], np.ascontiguousarray(towards[:, where]), sigma_m[c, where], np.isfinite(moved_m[c, where])
            of = Measured(*at, seen.system_of, len(TIME_SCALES))
            names[c, where], everything[c, where] = named_or_moved(of, suspects, design.log_likelihood_ratio)
    return names, everything


class _Seen(NamedTuple):
    """Some epochs of a sight, of all signals, or of those `columns` that are in view in some of them."""

    columns: Ints | None
    part: ObservationBlock
    residual_m: Floats  # of ranges, (E, R, S)
    sin_el: Floats  # (E, R, S)
    in_view: Bools  # (E, S)
    served_by: Ints  # (E, S), into the ephemerides
    ionosphere: Floats
    ionosphere_m: Floats  # broadcast to (E, R, S)
    system_of: Ints
    jump_m: Floats | None
    channel: Ints  # of the ephemerides


def _seen(sight: Sight, few: slice, jump_m: Floats | None) -> _Seen:
    """The epochs `few`. What is in view in none of them says nothing, and is forgotten: its arcs end here anyway."""
    block, sky = sight.block, sight.sky
    n_epochs, n_signals = sky.in_view.shape
    channel = sky.ephemerides.channel
    whole = _Seen(
        None,
        block,
        sight.at_points.residual_m,
        sky.expected.los_enu[2],
        sky.in_view,
        sky.index,
        sky.states.ionosphere,
        sky.expected.ionosphere_m,
        sky.system_of,
        jump_m,
        channel,
    )
    if n_epochs == 1:
        return whole
    columns, some = None, np.flatnonzero(np.logical_or.reduce(sky.in_view[few], axis=0))
    if len(some) < WORTH_LEAVING_OUT * n_signals:
        columns = some
    jumps_m = None if jump_m is None else _of(jump_m, few, columns)
    return _Seen(
        columns,
        _part(block, few, columns),
        _of(whole.residual_m, few, columns),
        _of(whole.sin_el, few, columns),
        _of(whole.in_view, few, columns),
        _of(whole.served_by, few, columns),
        _of(whole.ionosphere, few, columns),
        _of(whole.ionosphere_m, few, columns),
        sky.system_of if columns is None else sky.system_of[columns],
        jumps_m if jumps_m is not None and jumps_m.any() else None,
        channel,
    )


def _inputs(seen: _Seen, continues: Bools, design: CarrierDesign) -> tuple[MotionInputs, DivergenceInputs]:
    """What the monitors need of some epochs."""
    part, of = seen.part, _of_signals(seen.part.signals)
    natural = nature(seen.sin_el, part.cn0_dbhz, seen.ionosphere, of.noise, design.errors)
    wavelength_m = of.wavelength_m
    if wavelength_m is None:
        wavelength_m = SPEED_OF_LIGHT_MPS / (of.carrier_hz + of.channel_hz * seen.channel[seen.served_by])
    c_m = code_minus_carrier_m(part, np.where(seen.in_view, wavelength_m, np.nan))
    residual_m = carrier_residual_m(seen.residual_m, c_m, seen.ionosphere_m)
    return (
        MotionInputs(part.signals, part.epoch_ns, residual_m, continues, seen.jump_m, natural, seen.system_of),
        DivergenceInputs(part.signals, part.epoch_ns, c_m, continues, natural, seen.system_of),
    )


def _ephemeris_jumps(
    before: tuple[Ephemeris | None, ...], sky: Sky, epoch_ns: Ints, points: Points
) -> tuple[Floats | None, tuple[Ephemeris | None, ...]]:
    """By how much a set that begins to serve moves expected ranges against the one before, m (E, S), NaN where there is none, 0 elsewhere,
    or None where none begins; and the sets that serve in the last epoch. `before` are those of the epoch before the first."""
    sets, index = sky.ephemerides, sky.index
    first = _sets_at(sets, index[0])
    last = first if len(index) == 1 else _sets_at(sets, index[-1])
    changed = [] if before == first else [(0, s, old) for s, (old, new) in enumerate(zip(before, first, strict=True)) if old is not new]
    if len(index) > 1:
        changes = np.argwhere(index[1:] != index[:-1]).tolist()
        changed += [(e + 1, s, sets[index[e, s]] if index[e, s] >= 0 else None) for e, s in changes]
    if not changed:
        return None, last
    jump_m, others = np.zeros(index.shape), list[tuple[int, int, Ephemeris]]()
    for e, s, old in changed:
        new = sets[index[e, s]] if index[e, s] >= 0 else None
        if old is None or new is None:
            jump_m[e, s] = np.nan
        elif content_crc32(old) != content_crc32(new):
            others.append((e, s, old))
    if others:
        _put_jumps(others, sky, epoch_ns, points, jump_m)
    return jump_m, last


def _put_jumps(others: list[tuple[int, int, Ephemeris]], sky: Sky, epoch_ns: Ints, points: Points, jump_m: Floats) -> None:
    """Expected ranges less those by other sets at epochs and columns, the mean over the receivers, into `jump_m` (E, S)."""
    epochs, row = np.unique([e for e, _, _ in others], return_inverse=True)
    columns, column = np.unique([s for _, s, _ in others], return_inverse=True)
    index = np.full((len(epochs), len(columns)), -1)
    index[row, column] = np.arange(len(others))
    sets, signals = Ephemerides(old for _, _, old in others), [sky.signals[s] for s in columns]
    states = satellite_states(sets, index, state_time_ns(epoch_ns[epochs]), signals)
    range_m = expected(states, epoch_ns[epochs], points, sky.klobuchar).range_m
    moved_m = sky.expected.range_m[epochs][..., columns] - range_m
    mean_m = np.add.reduce(moved_m, axis=1) / moved_m.shape[1]
    jump_m[epochs[row], columns[column]] = mean_m[row, column]


def _sets_at(sets: Ephemerides, index: Ints) -> tuple[Ephemeris | None, ...]:
    return tuple(sets[k] if k >= 0 else None for k in index.tolist())


def _of(values: Any, few: slice, columns: Ints | None) -> Any:
    """Some epochs of an array (E, ..., S), and columns; where there is one of either, it is that of all."""
    of_epochs = values if len(values) == 1 else values[few]
    return of_epochs if columns is None or values.shape[-1] == 1 else of_epochs.take(columns, axis=-1)


def _part(block: ObservationBlock, few: slice, columns: Ints | None) -> ObservationBlock:
    """Some epochs of a block, and columns."""
    signals, satellites = block.signals, block.satellites
    if columns is not None:
        signals, satellites = (tuple(of[s] for s in columns.tolist()) for of in (signals, satellites))
    per_signal = {name: _of(getattr(block, name), few, columns) for name in ROW_ARRAYS}
    return ObservationBlock(block.receivers, signals, satellites, block.epoch_ns[few], block.receive_time_ns[few], **per_signal)


@lru_cache(maxsize=256)
def _of_signals(signals: tuple[str, ...]) -> _Signals:
    carriers = np.array([carrier_hz(signal[:1], bands_of(signal)[0]) or (np.nan, np.nan) for signal in signals]).reshape(-1, 2)
    noise = np.array([hypot(*weights_of(signal)) for signal in signals])
    return _Signals(
        noise, carriers[:, 0].copy(), carriers[:, 1].copy(), None if carriers[:, 1].any() else SPEED_OF_LIGHT_MPS / carriers[:, 0]
    )
