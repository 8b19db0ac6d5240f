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
from typing import NamedTuple

import numpy as np

from integrity.carrier_thresholds import CARRIER_CHECKS, CarrierDesign
from integrity.gnss.combination import weights_of
from integrity.gnss.constants import SPEED_OF_LIGHT_MPS
from integrity.gnss.ephemeris.broadcast import Ephemeris
from integrity.gnss.ephemeris.content import content_crc32
from integrity.gnss.ephemeris.states import Ephemerides, satellite_states
from integrity.gnss.observations import Bools, Floats, Ints, ObservationBlock, slices
from integrity.gnss.positioning import Points, expected, state_time_ns
from integrity.gnss.signals import bands_of, carrier_hz
from integrity.monitors import carrier_motion, divergence
from integrity.monitors.carrier_motion import MotionInputs, MotionMemory
from integrity.monitors.carrier_residuals import TrackingMemory, carrier_residual_m, code_minus_carrier_m, continuing, nature
from integrity.monitors.divergence import DivergenceInputs, DivergenceMemory
from integrity.monitors.residuals import seen_by_all
from integrity.satellites import Watched
from integrity.sight import Sight, Sky


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
    """Of signals (S,): how much more noise they have than one that stands alone; carriers, and their change from channel to channel, Hz."""

    noise: Floats
    carrier_hz: Floats
    channel_hz: Floats


def watch(memory: CarrierMemory, sight: Sight, points: Points, design: CarrierDesign) -> tuple[CarrierMemory, tuple[Watched, ...]]:
    """The memory after a block, and what carriers show of the satellites of `sight.block`, (E, S) each; `points`: the surveyed ones."""
    block, sky = sight.block, sight.sky
    jump_m, serving = _ephemeris_jumps(memory.serving_on(block.signals), sky, block.epoch_ns, points)
    n_epochs, n_receivers, n_signals = block.carrier_cycles.shape
    shown = np.empty((len(CARRIER_CHECKS), n_epochs, n_signals))
    tracking, motion, apart = memory.tracking, memory.motion, memory.divergence
    for few in slices(n_epochs, n_receivers * n_signals):
        part = block if n_epochs == 1 else _epochs(block, few)
        tracking, continues = continuing(tracking, part, design.lock_share)
        of_motion, of_code = _inputs(part, continues, jump_m[few], sight, few, design)
        motion, moved = carrier_motion.advance(motion, of_motion, design.motion)
        apart, left = divergence.advance(apart, of_code, design.divergence)
        shown[:3, few] = seen_by_all(moved.sigmas.reshape(-1, n_receivers, n_signals)).reshape(3, -1, n_signals)
        shown[3:, few] = seen_by_all(left.sigmas.reshape(-1, n_receivers, n_signals)).reshape(2, -1, n_signals)
    watched = tuple(Watched(name, of, design.thresholds[name]) for name, of in zip(CARRIER_CHECKS, shown, strict=True))
    return CarrierMemory(block.signals, serving, tracking, motion, apart), watched


def _inputs(
    part: ObservationBlock, continues: Bools, jump_m: Floats, sight: Sight, few: slice, design: CarrierDesign
) -> tuple[MotionInputs, DivergenceInputs]:
    """What the monitors need of the epochs `few`."""
    sky, of = sight.sky, _of_signals(part.signals)
    natural = nature(sky.expected.los_enu[2, few], part.cn0_dbhz, sky.states.ionosphere[few], of.noise, design.errors)
    carriers_hz = of.carrier_hz + of.channel_hz * sky.ephemerides.channel[sky.index[few]] if of.channel_hz.any() else of.carrier_hz
    wavelength_m = np.where(sky.in_view[few], SPEED_OF_LIGHT_MPS / carriers_hz, np.nan)
    c_m = code_minus_carrier_m(part, wavelength_m)
    ionosphere_m = sky.expected.ionosphere_m
    residual_m = carrier_residual_m(
        sight.at_points.residual_m[few], c_m, ionosphere_m[few] if len(ionosphere_m) == len(sky.index) else ionosphere_m
    )
    return (
        MotionInputs(part.signals, part.epoch_ns, residual_m, continues, jump_m, natural, sky.system_of),
        DivergenceInputs(part.signals, part.epoch_ns, c_m, continues, natural, sky.system_of),
    )


def _ephemeris_jumps(
    before: tuple[Ephemeris | None, ...], sky: Sky, epoch_ns: Ints, points: Points
) -> tuple[Floats, tuple[Ephemeris | None, ...]]:
    """By how much a set that begins to serve moves expected ranges against the one before, m (E, S), NaN where there is none, 0 elsewhere;
    and the sets that serve in the last epoch. `before` are those of the epoch before the first."""
    jump_m, sets, index = np.zeros(sky.index.shape), sky.ephemerides, sky.index
    first = _sets_at(sets, index[0])
    last = first if len(index) == 1 else _sets_at(sets, index[-1])
    changed: dict[int, dict[int, Ephemeris | None]] = {}  # by epoch and column, the set before
    if any(old is not new for old, new in zip(before, first, strict=True)):
        changed[0] = {s: old for s, (old, new) in enumerate(zip(before, first, strict=True)) if old is not new}
    if len(index) > 1:
        for e, s in np.argwhere(index[1:] != index[:-1]).tolist():
            changed.setdefault(e + 1, {})[s] = sets[index[e, s]] if index[e, s] >= 0 else None
    for e, of in changed.items():
        for s, old in of.items():
            new = sets[index[e, s]] if index[e, s] >= 0 else None
            jump_m[e, s] = np.nan if old is None or new is None or content_crc32(old) != content_crc32(new) else 0.0
        others = {s: old for s, old in of.items() if old is not None and index[e, s] >= 0 and np.isnan(jump_m[e, s])}
        if others:
            jump_m[e, list(others)] = _jumps_m(others, sky, epoch_ns, e, points)
    return jump_m, last


def _jumps_m(old: dict[int, Ephemeris], sky: Sky, epoch_ns: Ints, e: int, points: Points) -> Floats:
    """Expected ranges less those by the sets `old` by column, at an epoch, the mean over the receivers, (N,)."""
    columns, now_ns = list(old), epoch_ns[e : e + 1]
    states = satellite_states(
        Ephemerides(old.values()), np.arange(len(old))[None], state_time_ns(now_ns), [sky.signals[s] for s in columns]
    )
    range_m = expected(states, now_ns, points, sky.klobuchar).range_m[0]
    moved_m = sky.expected.range_m[e][:, columns] - range_m
    result: Floats = np.add.reduce(moved_m, axis=0) / len(moved_m)
    return result


def _sets_at(sets: Ephemerides, index: Ints) -> tuple[Ephemeris | None, ...]:
    return tuple(sets[k] if k >= 0 else None for k in index.tolist())


def _epochs(block: ObservationBlock, few: slice) -> ObservationBlock:
    """Some epochs of a block."""
    per_epoch = {n: getattr(block, n)[few] for n in block.__dataclass_fields__ if n not in ("receivers", "signals", "satellites")}
    return ObservationBlock(block.receivers, block.signals, block.satellites, **per_epoch)


@lru_cache(maxsize=256)
def _of_signals(signals: tuple[str, ...]) -> _Signals:
    carriers = np.array([carrier_hz(signal[:1], bands_of(signal)[0]) or (np.nan, np.nan) for signal in signals]).reshape(-1, 2)
    return _Signals(np.array([hypot(*weights_of(signal)) for signal in signals]), carriers[:, 0].copy(), carriers[:, 1].copy())
