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
from integrity.gnss.observations import Bools, Floats, Ints, ObservationBlock, freeze
from integrity.monitors.carrier_residuals import LEAST_FOR_CLOCK, Nature, ages, going_on, without_clocks

NEAR_SIGMAS = 4.0  # of a difference of two codes


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
    """In sigmas, signed, (E, R, S), NaN where nothing can be said; and what one sigma is: `innovation_m`, `divergence_mps`."""

    innovation: Floats
    divergence: Floats
    innovation_m: Floats
    divergence_mps: Floats


def code_minus_carrier_m(block: ObservationBlock, wavelength_m: Floats) -> Floats:
    """c (E, R, S), m; wavelength_m (E, S)."""
    result: Floats = block.pseudorange_m - wavelength_m[:, None] * block.carrier_cycles
    return result


def advance(memory: DivergenceMemory, inputs: DivergenceInputs, design: DivergenceDesign) -> tuple[DivergenceMemory, DivergenceStatistics]:
    """The memory after a block, and how far code and carrier are apart in it; epochs increase."""
    before, tau_s = memory.on(inputs.signals), design.window_s
    c_m = np.concatenate((before.code_minus_carrier_m[None], inputs.code_minus_carrier_m))
    dt_s = (np.diff(inputs.epoch_ns, prepend=before.epoch_ns) / NS_PER_S)[:, None, None]

    connected = going_on(np.isfinite(c_m), inputs.continues & (dt_s <= design.longest_gap_s))
    changed_m = np.where(connected, c_m[1:] - c_m[:-1], np.nan)
    changed_m = changed_m - common_m(changed_m, inputs.nature.code_m2)
    far = np.abs(changed_m) > MOST_APART_M  # is told once, and another arc begins
    goes_on = np.isfinite(changed_m) & ~far
    age = ages(goes_on, before.age)
    a = np.minimum(np.maximum(1.0 / np.maximum(age, 1), dt_s / tau_s), 1.0)  # 1 where an arc begins
    first_m, second_mps = _filtered(before, np.where(goes_on, changed_m, 0.0), a, goes_on, dt_s, tau_s)
    begun_ns = np.where(goes_on, 0, inputs.epoch_ns[:, None, None])
    since_ns = np.maximum.accumulate(np.concatenate((before.since_ns[None], begun_ns)))[1:]
    age_s = (inputs.epoch_ns[:, None, None] - since_ns) / NS_PER_S

    drift_m2ps2 = 4.0 * inputs.nature.ionosphere_m2ps2
    innovation_m = np.sqrt(inputs.nature.code_m2 * (1.0 + a) + drift_m2ps2 * np.minimum(age_s, tau_s) ** 2)
    stays_s = design.correlation_s + 0.5 * dt_s
    divergence_mps = np.sqrt(inputs.nature.code_m2 * (stays_s / (2.0 * tau_s * (tau_s + stays_s) ** 2)) + drift_m2ps2)
    told_m = np.where(goes_on, first_m, np.where(far, changed_m, np.nan))
    told_mps = np.where(goes_on & (age_s >= design.warm_up_s), second_mps, np.nan)
    both = without_clocks(
        np.stack((told_m, told_mps)), np.stack((innovation_m, np.broadcast_to(divergence_mps, innovation_m.shape))), inputs.system_of
    )
    after = DivergenceMemory(
        inputs.signals,
        int(inputs.epoch_ns[-1]),
        *(array[-1].copy() for array in (c_m, first_m, second_mps, age, since_ns)),
    )
    return after, DivergenceStatistics(*(both.change_m / both.sigma_m), *both.sigma_m)


def common_m(changed_m: Floats, code_m2: Floats) -> Floats:
    """What the signals of each receiver have in common of their changes (E, R, S), (E, R, 1): the weighted mean of those near the median.

    code_m2 (E, 1, S): variances of the code. NaN where fewer than three are near it.
    """
    ordered = np.sort(changed_m, axis=-1)  # NaN last
    n = np.isfinite(ordered).sum(axis=-1, keepdims=True)
    lower = np.arange(n.size).reshape(n.shape) * ordered.shape[-1] + np.maximum(n - 1, 0) // 2
    off_m = changed_m - ordered.take(lower)
    near = off_m * off_m <= NEAR_SIGMAS**2 * 2.0 * code_m2
    weight = np.where(near, 1.0 / code_m2, 0.0)
    sums = np.add.accumulate(np.stack((weight, np.where(near, off_m * weight, 0.0))), axis=-1)[..., -1:]  # signals not seen change no bit
    with np.errstate(invalid="ignore"):
        mean_m = ordered.take(lower) + sums[1] / sums[0]
    result: Floats = np.where(near.sum(axis=-1, keepdims=True) >= LEAST_FOR_CLOCK, mean_m, np.nan)
    return result


def _filtered(before: DivergenceMemory, changed_m: Floats, a: Floats, goes_on: Bools, dt_s: Floats, tau_s: float) -> tuple[Floats, Floats]:
    """Both stages (E, R, S); changed_m is 0 where an arc begins, or nothing is."""
    first, second = np.empty(changed_m.shape), np.empty(changed_m.shape)
    i, D = before.innovation_m, before.rate_mps
    b = np.minimum(dt_s / tau_s, 1.0)
    keep, keep_rate, gain = np.where(goes_on, 1.0 - a, 0.0), np.where(goes_on, 1.0 - b, 0.0), np.where(goes_on, b / tau_s, 0.0)
    for e in range(len(changed_m)):
        i = np.add(np.multiply(keep[e], i, out=first[e]), changed_m[e], out=first[e])
        D = np.add(np.multiply(keep_rate[e], D, out=second[e]), gain[e] * i, out=second[e])
    return first, second
