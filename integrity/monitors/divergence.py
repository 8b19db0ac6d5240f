"""Code against carrier: what leaves suddenly (innovation), and what drifts apart (divergence), from one filter of two stages.

c(t): code minus carrier of a signal, in which geometry, clocks and troposphere cancel; what is left are the ambiguity, noise and multipath
of the code, and twice the ionosphere. With a = 1 / n for the n-th difference of an arc until the window tau is full, then dt / tau:

    first stage    i(t) = (1 - a) i(t - dt) + c(t) - c(t - dt)
    second stage   D(t) = D(t - dt) + dt / tau (i(t) / tau - D(t - dt))

i is the innovation of a Hatch filter with window tau: what the code is away from what the carrier carries on (c(t) less the mean of the
c before it); i / tau the first, D the second of two equal filters of the rate of c, as GBAS has them for GAST-D.

Innovation: one look. The rule "2 of 3 successive epochs" of GBAS comes an epoch late, and buys its quiet from noise that is independent
from epoch to epoch; here three receivers must agree in sign and size in one epoch, which buys more.

Receivers let code and carrier of all signals run apart together: by jumps of their clock in the code alone (1 ms is 300 km), or, as a log
shows, by 0.9 m/s for ten minutes. What a receiver's signals have in common is taken out of the differences, as a mean, whose noise does not
add up from epoch to epoch as that of a median would; and out of both stages once more, by the median of each constellation, on which a
faulty satellite has no hold. A signal that alone moves by more than `MOST_APART_M` is told once, and its filter begins anew.

Sources: section 2.4 of the project's notes on ground integrity. Two stages and a window of 100 s are those of GAST-D as far as we know; its
limit of 0.0125 m/s is not used: thresholds follow from the error model, which is our own choice.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from integrity.gnss.carrier.smoothing import MOST_APART_M
from integrity.gnss.gps_time import NS_PER_S
from integrity.gnss.observations import Bools, Floats, Ints, freeze
from integrity.monitors.carrier_residuals import Nature, ages, without_clocks


class DivergenceInputs(NamedTuple):
    """Of a block: `epoch_ns` (E,); `code_minus_carrier_m` (E, R, S); `continues` (E, R, S), no slip known to the receiver; `nature`;
    `system_of` (S,), constellations."""

    signals: tuple[str, ...]
    epoch_ns: Ints
    code_minus_carrier_m: Floats
    continues: Bools
    nature: Nature
    system_of: Ints


class DivergenceDesign(NamedTuple):
    """`window_s`: tau; `warm_up_s`: D says nothing for so long; `longest_gap_s`: beyond it nothing continues; `correlation_s`: how long
    multipath of the code stays."""

    window_s: float
    warm_up_s: float
    longest_gap_s: float
    correlation_s: float


@dataclass(frozen=True, eq=False)
class DivergenceMemory:
    """After an epoch: c, both stages, for how many epochs each signal has continued and since when (R, S)."""

    signals: tuple[str, ...]
    epoch_ns: int
    code_minus_carrier_m: Floats
    innovation_m: Floats
    rate_mps: Floats
    age: Ints
    since_ns: Ints

    def __post_init__(self) -> None:
        freeze(self)

    @staticmethod
    def empty(n_receivers: int) -> "DivergenceMemory":
        """Before the first epoch."""
        none = np.zeros((n_receivers, 0))
        never = none.astype(np.int64)
        return DivergenceMemory((), 0, none, none, none, never, never)

    def on(self, signals: tuple[str, ...]) -> "DivergenceMemory":
        """The same memory for another list of signals: new ones have no past, those not listed are forgotten."""
        if signals == self.signals:
            return self
        column = {s: i for i, s in enumerate(self.signals)}
        source = [column.get(s, -1) for s in signals]  # -1: an extra last column
        nothing = np.zeros((len(self.age), 1))
        unknown, never = nothing + np.nan, nothing.astype(np.int64)
        return DivergenceMemory(
            signals,
            self.epoch_ns,
            np.concatenate((self.code_minus_carrier_m, unknown), axis=-1)[..., source],
            np.concatenate((self.innovation_m, nothing), axis=-1)[..., source],
            np.concatenate((self.rate_mps, nothing), axis=-1)[..., source],
            np.concatenate((self.age, never), axis=-1)[..., source],
            np.concatenate((self.since_ns, never), axis=-1)[..., source],
        )


class DivergenceStatistics(NamedTuple):
    """In sigmas, signed, (2, E, R, S): innovation and divergence; NaN where nothing can be said. `sigma`, broadcast to that: what one is, m
    and m/s."""

    sigmas: Floats
    sigma: Floats

    @property
    def innovation(self) -> Floats:
        """(E, R, S), in sigmas."""
        result: Floats = self.sigmas[0]
        return result

    @property
    def divergence(self) -> Floats:
        """(E, R, S), in sigmas."""
        result: Floats = self.sigmas[1]
        return result


def advance(memory: DivergenceMemory, inputs: DivergenceInputs, design: DivergenceDesign) -> tuple[DivergenceMemory, DivergenceStatistics]:
    """The memory after a block, and how far code and carrier are apart in it; epochs increase."""
    before, tau_s, c_m = memory.on(inputs.signals), design.window_s, inputs.code_minus_carrier_m
    dt_s = ((inputs.epoch_ns - np.append(before.epoch_ns, inputs.epoch_ns[:-1])) / NS_PER_S)[:, None, None]

    changed_m = np.empty(c_m.shape)
    np.subtract(c_m[:1], before.code_minus_carrier_m, out=changed_m[:1])
    np.subtract(c_m[1:], c_m[:-1], out=changed_m[1:])
    np.copyto(changed_m, np.nan, where=~(inputs.continues & (dt_s <= design.longest_gap_s)))
    together = np.zeros(len(inputs.signals), dtype=np.int64)  # all signals of a receiver
    changed_m = without_clocks(changed_m, 2.0 * inputs.nature.code_m2, together).change_m
    far = np.abs(changed_m) > MOST_APART_M  # is told once, and another arc begins
    goes_on = np.isfinite(changed_m) & ~far
    age = ages(goes_on, before.age)
    begun_ns = np.where(goes_on, 0, inputs.epoch_ns[:, None, None])
    np.maximum(begun_ns[0], before.since_ns, out=begun_ns[0])
    since_ns = np.maximum.accumulate(begun_ns) if len(c_m) > 1 else begun_ns
    full = np.maximum(tau_s / dt_s, 1.0)  # epochs in the window
    n = np.minimum(np.maximum(age, 1), full)  # of them so far; 1 where an arc begins

    told, told_m2 = np.empty((2, *c_m.shape)), np.empty((2, len(c_m), 1, c_m.shape[-1]))
    told[0] = changed_m
    np.copyto(told[0], 0.0, where=~goes_on)
    _carry_on(before.innovation_m, 1.0 - 1.0 / n, told[0])
    np.multiply(told[0], 1.0 / (full * tau_s), out=told[1])
    _carry_on(before.rate_mps, goes_on * (1.0 - 1.0 / full), told[1])
    first_m, second_mps = told[0, -1].copy(), told[1, -1].copy()
    np.copyto(told[0], np.nan if not far.any() else np.where(far, changed_m, np.nan), where=~goes_on)
    np.copyto(told[1], np.nan, where=since_ns > inputs.epoch_ns[:, None, None] - round(design.warm_up_s * NS_PER_S))
    fewest, most = np.minimum.reduce(n, axis=1, keepdims=True), np.maximum.reduce(n, axis=1, keepdims=True)
    told_m2[0] = innovation_m2(inputs.nature, 1.0 / fewest, most * dt_s)
    told_m2[1] = divergence_m2ps2(inputs.nature, dt_s, design)
    left, left_m2 = without_clocks(told, told_m2, inputs.system_of)
    sigma = np.sqrt(left_m2)
    after = DivergenceMemory(
        inputs.signals,
        int(inputs.epoch_ns[-1]),
        c_m[-1].copy(),
        first_m,
        second_mps,
        age[-1].copy(),
        since_ns[-1].copy(),
    )
    return after, DivergenceStatistics(left / sigma, sigma)


def innovation_m2(nature: Nature, a: Floats, age_s: Floats) -> Floats:
    """Variance (E, 1, S) of the first stage, of signals that have continued for age_s, at most tau."""
    return nature.code_m2 * (1.0 + a) + 4.0 * nature.ionosphere_m2ps2 * (age_s * age_s)


def divergence_m2ps2(nature: Nature, dt_s: Floats, design: DivergenceDesign) -> Floats:
    """Variance (E, 1, S) of the second stage: multipath that both stages leave, and the ionosphere."""
    tau_s, stays_s = design.window_s, design.correlation_s + 0.5 * dt_s
    return nature.code_m2 * (stays_s / (2.0 * tau_s * (tau_s + stays_s) ** 2)) + 4.0 * nature.ionosphere_m2ps2


def _carry_on(before: Floats, keep: Floats, new: Floats) -> None:
    """x(t) = keep(t) x(t - dt) + new(t), (E, R, S), into the place of `new`."""
    kept = np.empty(before.shape)
    for keep_now, now in zip(keep, new, strict=True):
        np.multiply(keep_now, before, out=kept)
        before = np.add(now, kept, out=now)
