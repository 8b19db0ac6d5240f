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
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from integrity.gnss.carrier.smoothing import MOST_APART_M
from integrity.gnss.gps_time import NS_PER_S
from integrity.gnss.observations import Bools, Floats, Ints, freeze
from integrity.monitors.carrier_residuals import Changes, Nature, ages, by_signal, without_clocks

NEVER = np.iinfo(np.int64).max
RATES_STAY_S = 300.0  # for so long the atmosphere goes on as it does; waves in the ionosphere take 15 minutes and more


class MotionInputs(NamedTuple):
    """Of a block: `epoch_ns` (E,); `residual_m` (E, R, S) of carriers; `continues` (E, R, S), no slip that the receiver knows of;
    `jump_m` (E, S), by how much another ephemeris than that of the epoch before changed the expected ranges, NaN where nobody knows, None
    where none changed;
    `nature` of the signals; `system_of` (S,), constellations."""

    signals: tuple[str, ...]
    epoch_ns: Ints
    residual_m: Floats
    continues: Bools
    jump_m: Floats | None
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
    `sigma`, broadcast to that: what one is, m, of a ramp over the whole window; `half_s` (E,)."""

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
    since_ns = epoch_ns[2 * h :] - epoch_ns.take(_places(len(inputs.epoch_ns), h))
    spans = _spans(since_ns.tobytes(), design)
    moved_m = np.empty((2, *inputs.residual_m.shape))  # over half a window, since the epoch before
    np.subtract(residual_m[h:], residual_m[:-h], out=moved_m[0])
    np.subtract(residual_m[h:], residual_m[h - 1 : -1], out=moved_m[1])
    goes_on = np.isfinite(moved_m[1])
    goes_on &= inputs.continues
    goes_on &= spans.near
    if inputs.jump_m is not None:
        _by_new_sets(inputs.jump_m, residual_m, moved_m, h)
        goes_on &= np.isfinite(inputs.jump_m)[:, None]

    age, known = ages(goes_on, before.age), np.empty(moved_m.shape, dtype=np.bool_)
    np.greater_equal(age, spans.least_age, out=known[0])
    known[1] = goes_on
    model_m2 = _variance_m2(inputs.nature.by_signal(), spans.terms)  # (4, S, 1, E)
    moved_m, known = by_signal(np.where(known, moved_m, 0.0)), by_signal(known)
    left = without_clocks(moved_m, known, model_m2[:2], inputs.system_of)
    if left.far and (far := np.abs(left.change_m[1]) > MOST_APART_M).any():  # is told once, and another arc begins
        age = ages(goes_on & ~by_signal(far), before.age)
        half = without_clocks(moved_m[:1], known[:1] & by_signal(age >= h), model_m2[:1], inputs.system_of)
        left.change_m[:1], left.variance_m2[:1] = half.change_m, half.variance_m2
    half_m, step_m = left.change_m
    halves_m = np.concatenate((before.half_m, half_m.T))
    half_ago_m = by_signal(halves_m[:-h])

    sigma = _sigma(left, model_m2)
    shown = np.empty((3, *step_m.shape))
    np.divide(step_m, sigma[0], out=shown[0])
    np.add(half_m, half_ago_m, out=shown[1])
    np.subtract(half_m, half_ago_m, out=shown[2])
    shown[1:] /= sigma[1:]
    after = MotionMemory(inputs.signals, epoch_ns[-2 * h :], residual_m[-h:], halves_m[-h:], np.minimum(age[-1], h))
    return after, MotionStatistics(shown.swapaxes(1, 3), sigma.swapaxes(1, 3), spans.half_s)


def _sigma(left: Changes, model_m2: Floats) -> Floats:
    """Standard deviations (3, S, 1 or R, E) of step, ramp, acceleration, of the model's variances; `left` of the change over h, and of the
    step."""
    if not left.far:
        return np.sqrt(model_m2[1:])
    of_clocks = left.variance_m2[:1] / model_m2[:1]  # 1 but for what is away from the others
    return np.sqrt(np.concatenate((left.variance_m2[1:], of_clocks * model_m2[2:])))


def _by_new_sets(jump_m: Floats, residual_m: Floats, moved_m: Floats, h: int) -> None:
    """Puts right what moved over h and since the epoch before (2, E, R, S) where sets changed, and leaves residuals (H + E, R, S) as if the
    sets that serve last had served before: what was expected by them is more by the jump, what was left is less. Jump after jump, as it
    would be epoch by epoch."""
    for s in np.flatnonzero(np.nan_to_num(jump_m).any(axis=0)):
        now_m = residual_m[h:, :, s].copy()
        last_m, half_ago_m = residual_m[h - 1 : -1, :, s].copy(), residual_m[:-h, :, s].copy()
        for e in np.flatnonzero(np.nan_to_num(jump_m[:, s])).tolist():
            last_m[e] -= jump_m[e, s]
            half_ago_m[e : e + h] -= jump_m[e, s]
            residual_m[: h + e, :, s] -= jump_m[e, s]
        moved_m[0, ..., s], moved_m[1, ..., s] = now_m - half_ago_m, now_m - last_m


class _Terms(NamedTuple):
    """A variance is `of_phase` times that of the phase, `of_rate` (s2) times that of the atmosphere's rate, and what the clock adds."""

    of_phase: Floats
    of_rate: Floats
    of_clock: Floats


class _Spans(NamedTuple):
    """What follows from the times of epochs: which are near the one before (E, 1, 1); how old an arc must be for ramps; h (E,); terms
    (4, 1, 1, E) of the change over h, step, ramp, acceleration."""

    near: Bools
    least_age: Ints
    half_s: Floats
    terms: _Terms


def change_m2(nature: Nature, dt_s: Floats, design: MotionDesign) -> Floats:
    """Variance of a residual's change over dt_s; all broadcast together."""
    return _variance_m2(nature, _change_terms(dt_s, design))


def bend_m2(nature: Nature, dt_s: Floats, design: MotionDesign) -> Floats:
    """Variance of the difference of its changes over dt_s before and after an epoch: rates hardly change."""
    return _variance_m2(nature, _bend_terms(dt_s, design))


def _variance_m2(nature: Nature, of: _Terms) -> Floats:
    return of.of_phase * nature.phase_m2 + of.of_rate * nature.atmosphere_m2ps2 + of.of_clock


def _change_terms(dt_s: Floats, design: MotionDesign) -> _Terms:
    return _Terms(np.full(dt_s.shape, 2.0), dt_s * dt_s, design.clock_m**2 * dt_s)


def _bend_terms(dt_s: Floats, design: MotionDesign) -> _Terms:
    change = _change_terms(dt_s, design)
    bending = -2.0 * np.expm1(-dt_s / RATES_STAY_S)
    return _Terms(3.0 * change.of_phase, bending * change.of_rate, 2.0 * change.of_clock)


@lru_cache(maxsize=64)
def _spans(since_ns: bytes, design: MotionDesign) -> _Spans:
    """Of times (3, E) since the epochs h, 1 and 2h before: of epochs at equal intervals they are always the same."""
    since_s = np.frombuffer(since_ns, dtype=np.int64).reshape(3, 1, 1, -1) / NS_PER_S
    half_s, dt_s, _ = since_s.reshape(3, -1)
    pairs = zip(_change_terms(since_s, design), _bend_terms(since_s[:1], design), strict=True)
    least_age = np.where(half_s <= design.longest_half_s, design.half_epochs, NEVER)
    terms = _Terms(*(np.concatenate(pair) for pair in pairs))
    return _Spans((dt_s <= design.longest_gap_s)[:, None, None], least_age[:, None, None], half_s, terms)


@lru_cache(maxsize=64)
def _places(n_epochs: int, h: int) -> Ints:
    """Where the epochs h, 1 and 2h before stand (3, E), of epochs that begin at place 2h."""
    places: Ints = 2 * h + np.arange(n_epochs) - np.array([h, 1, 2 * h])[:, None]
    return places
