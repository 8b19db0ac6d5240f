"""Acceleration, ramp and step of a satellite, by its carrier: what it does before a range can show it (MQM of GBAS).

X(t): residual of the carrier at the surveyed point, the receiver's clock taken out (`carrier_residuals`). With h, half a window:

    step           X(t) - X(t - dt)                       against the epoch before: decimetres, in the first epoch
    ramp           (X(t) - X(t - 2h)) / 2h
    acceleration   (X(t) - 2 X(t - h) + X(t - 2h)) / h^2

each over its standard deviation. These differences of a few values are within a tenth as good as a parabola fitted to ten samples (GBAS)
as long as noise is white, and better against the random walk of a satellite's clock. At known points a step needs no prediction: ramps
that nature makes are a few mm/s.

Where h is longer than `longest_half_s`, ramp and acceleration are not monitored, and need not be: the step from epoch to epoch contains
them. A step is seen for one epoch, in ramp and acceleration for 2h; after that a satellite looks clean though its range stays wrong.
Whoever lets it come back must know that.

The numbers do not depend on how a stream is cut into blocks: each is made of the same values in the same order.
Source: section 2.4 of the project's notes on ground integrity; windows and thresholds are our own choice.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from integrity.gnss.carrier.smoothing import MOST_APART_M
from integrity.gnss.gps_time import NS_PER_S
from integrity.gnss.observations import Bools, Floats, Ints, freeze
from integrity.monitors.carrier_residuals import Nature, ages, without_clocks

RATES_STAY_S = 300.0  # for so long the atmosphere goes on as it does; waves in the ionosphere take 15 minutes and more


class MotionInputs(NamedTuple):
    """Of a block: `epoch_ns` (E,); `residual_m` (E, R, S) of carriers; `continues` (E, R, S), no slip that the receiver knows of;
    `jump_m` (E, S), by how much another ephemeris than that of the epoch before changed the expected ranges, NaN where nobody knows;
    `nature` of the signals; `system_of` (S,), constellations."""

    signals: tuple[str, ...]
    epoch_ns: Ints
    residual_m: Floats
    continues: Bools
    jump_m: Floats
    nature: Nature
    system_of: Ints


class MotionDesign(NamedTuple):
    """`half_epochs`: h in epochs; `longest_half_s`: h takes no longer, gaps included; `longest_gap_s`: beyond it nothing continues;
    `clock_m`: see `SignalErrors`."""

    half_epochs: int
    longest_half_s: float
    longest_gap_s: float
    clock_m: float


@dataclass(frozen=True, eq=False)
class MotionMemory:
    """Times of the last 2h epochs (2H,); of the last h (H, R, S) residuals by the sets that served last, and changes over h, NaN where
    there is none; for how many epochs each signal has continued, at most h (R, S)."""

    signals: tuple[str, ...]
    epoch_ns: Ints
    residual_m: Floats
    half_m: Floats
    age: Ints

    def __post_init__(self) -> None:
        freeze(self)

    @staticmethod
    def empty(n_receivers: int, half_epochs: int) -> "MotionMemory":
        """Before the first epoch."""
        past = np.zeros((half_epochs, n_receivers, 0))
        age = np.zeros((n_receivers, 0), dtype=np.int64)
        return MotionMemory((), np.zeros(2 * half_epochs, dtype=np.int64), past, past, age)

    def on(self, signals: tuple[str, ...]) -> "MotionMemory":
        """The same memory for another list of signals: new ones have no past, those not listed are forgotten."""
        if signals == self.signals:
            return self
        column = {s: i for i, s in enumerate(self.signals)}
        source = [column.get(s, -1) for s in signals]  # -1: an extra last column
        unknown = np.full((*self.residual_m.shape[:-1], 1), np.nan)
        return MotionMemory(
            signals,
            self.epoch_ns,
            np.concatenate((self.residual_m, unknown), axis=-1)[..., source],
            np.concatenate((self.half_m, unknown), axis=-1)[..., source],
            np.concatenate((self.age, np.zeros((len(self.age), 1), dtype=np.int64)), axis=-1)[..., source],
        )


class MotionStatistics(NamedTuple):
    """In sigmas, signed, (3, E, R, S): step, ramp and acceleration; NaN where nothing can be said: no carrier, or not for long enough.
    `sigma`, broadcast to that: what one is, m, of a ramp over the whole window; `half_s` (E, 1, 1)."""

    sigmas: Floats
    sigma: Floats
    half_s: Floats

    @property
    def step(self) -> Floats:
        """(E, R, S), in sigmas."""
        result: Floats = self.sigmas[0]
        return result

    @property
    def ramp(self) -> Floats:
        """(E, R, S), in sigmas."""
        result: Floats = self.sigmas[1]
        return result

    @property
    def acceleration(self) -> Floats:
        """(E, R, S), in sigmas."""
        result: Floats = self.sigmas[2]
        return result


def advance(memory: MotionMemory, inputs: MotionInputs, design: MotionDesign) -> tuple[MotionMemory, MotionStatistics]:
    """The memory after a block, and how its satellites move; epochs increase."""
    before, h = memory.on(inputs.signals), design.half_epochs
    residual_m = np.concatenate((before.residual_m, inputs.residual_m))  # (H + E, R, S)
    epoch_ns = np.concatenate((before.epoch_ns, inputs.epoch_ns))  # (2H + E,)
    dt_s, half_s, window_s = (_since(epoch_ns, 2 * h, back) for back in (1, h, 2 * h))
    continues = inputs.continues & (np.isfinite(inputs.jump_m)[:, None] & (dt_s <= design.longest_gap_s))

    moved_m, moved_m2 = np.empty((2, *inputs.residual_m.shape)), np.empty((2, len(dt_s), 1, len(inputs.signals)))
    np.subtract(residual_m[h:], residual_m[h - 1 : -1], out=moved_m[0])  # since the epoch before
    np.subtract(residual_m[h:], residual_m[:-h], out=moved_m[1])  # over half a window
    if inputs.jump_m.any():
        _by_new_sets(inputs.jump_m, residual_m, moved_m, h)
    goes_on = continues & np.isfinite(moved_m[0])
    age = ages(goes_on, before.age)
    np.copyto(moved_m[0], np.nan, where=~goes_on)
    np.copyto(moved_m[1], np.nan, where=(age < h) | (half_s > design.longest_half_s))
    moved_m2[0], moved_m2[1] = change_m2(inputs.nature, dt_s, design), change_m2(inputs.nature, half_s, design)
    (step_m, half_m), (step_m2, half_m2) = without_clocks(moved_m, moved_m2, inputs.system_of)
    far = np.abs(step_m) > MOST_APART_M  # is told once, and another arc begins
    if far.any():
        age = ages(goes_on & ~far, before.age)
        moved_m[1][age < h] = np.nan
        half_m, half_m2 = without_clocks(moved_m[1], moved_m2[1], inputs.system_of)
        step_m2, half_m2 = (np.broadcast_to(m2, step_m.shape) for m2 in (step_m2, half_m2))
    halves_m = np.concatenate((before.half_m, half_m))

    of_clocks = half_m2 / moved_m2[1]  # 1 but for what is away from the others
    sigma, shown = np.empty((3, *half_m2.shape)), np.empty((3, *step_m.shape))
    sigma[0] = step_m2
    np.multiply(of_clocks, change_m2(inputs.nature, window_s, design), out=sigma[1])
    np.multiply(of_clocks, bend_m2(inputs.nature, half_s, design), out=sigma[2])
    np.sqrt(sigma, out=sigma)
    shown[0] = step_m
    np.add(half_m, halves_m[:-h], out=shown[1])
    np.subtract(half_m, halves_m[:-h], out=shown[2])
    shown /= sigma
    last = slice(-h, None)
    after = MotionMemory(
        inputs.signals,
        epoch_ns[-2 * h :].copy(),
        residual_m[last].copy(),
        halves_m[last].copy(),
        np.minimum(age[-1], h),
    )
    return after, MotionStatistics(shown, sigma, half_s)


def _by_new_sets(jump_m: Floats, residual_m: Floats, moved_m: Floats, h: int) -> None:
    """Puts right what moved (2, E, R, S) where sets changed, and leaves residuals (H + E, R, S) as if the sets that serve last had served
    before: what was expected by them is more by the jump, what was left is less. Jump after jump, as it would be epoch by epoch."""
    for s in np.flatnonzero(np.nan_to_num(jump_m).any(axis=0)):
        now_m = residual_m[h:, :, s].copy()
        last_m, half_ago_m = residual_m[h - 1 : -1, :, s].copy(), residual_m[:-h, :, s].copy()
        for e in np.flatnonzero(np.nan_to_num(jump_m[:, s])).tolist():
            last_m[e] -= jump_m[e, s]
            half_ago_m[e : e + h] -= jump_m[e, s]
            residual_m[: h + e, :, s] -= jump_m[e, s]
        moved_m[0, ..., s], moved_m[1, ..., s] = now_m - last_m, now_m - half_ago_m


def change_m2(nature: Nature, dt_s: Floats, design: MotionDesign) -> Floats:
    """Variance (E, 1, S) of a residual's change over dt_s (E, 1, 1)."""
    slope_m2ps2 = nature.ionosphere_m2ps2 + nature.troposphere_m2ps2
    return 2.0 * nature.phase_m2 + (slope_m2ps2 * dt_s + design.clock_m**2) * dt_s


def bend_m2(nature: Nature, dt_s: Floats, design: MotionDesign) -> Floats:
    """Variance (E, 1, S) of the difference of its changes over dt_s (E, 1, 1) before and after an epoch: rates hardly change."""
    slope_m2ps2 = nature.ionosphere_m2ps2 + nature.troposphere_m2ps2
    return 6.0 * nature.phase_m2 + (-2.0 * np.expm1(-dt_s / RATES_STAY_S) * slope_m2ps2 * dt_s + 2.0 * design.clock_m**2) * dt_s


def _since(epoch_ns: Ints, first: int, back: int) -> Floats:
    """Seconds (E, 1, 1) since the epoch `back` places before, for epochs from place `first` on."""
    n = len(epoch_ns)
    result: Floats = ((epoch_ns[first:] - epoch_ns[first - back : n - back]) / NS_PER_S)[:, None, None]
    return result
