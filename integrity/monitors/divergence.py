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
from functools import lru_cache, reduce
from typing import NamedTuple

import numpy as np

from integrity.gnss.carrier.smoothing import MOST_APART_M
from integrity.gnss.gps_time import NS_PER_S
from integrity.gnss.observations import Bools, Floats, Ints, freeze
from integrity.monitors.carrier_residuals import Nature, ages, by_signal, without_clocks

NEVER_NS = np.iinfo(np.int64).max


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
    before, epoch_ns, natural = memory.on(inputs.signals), inputs.epoch_ns, inputs.nature.by_signal()
    dt_ns = epoch_ns - before.epoch_ns if len(epoch_ns) == 1 else np.diff(epoch_ns, prepend=before.epoch_ns)
    spans = _spans(dt_ns.tobytes(), design)
    changed_m, told, far = _changes(before, inputs, natural, spans.near)
    goes_on = told if far is None else told & ~far
    age = ages(goes_on, before.age)
    n = np.minimum(np.maximum(age, 1), spans.full)  # epochs of the window so far; 1 where an arc begins

    stages = np.empty((2, *n.shape))
    stages[0] = np.where(goes_on, changed_m, 0.0)
    _carry_on(before.innovation_m, 1.0 - 1.0 / n, stages[0])
    np.multiply(stages[0], spans.share_ps, out=stages[1])
    _carry_on(before.rate_mps, goes_on * spans.keep, stages[1])
    since_ns, warm = _since(goes_on, age, epoch_ns, before.since_ns, round(design.warm_up_s * NS_PER_S))
    last = inputs.code_minus_carrier_m[-1].copy(), stages[0, -1].copy(), stages[1, -1].copy()
    after = DivergenceMemory(inputs.signals, int(epoch_ns[-1]), *last, age[-1].copy(), since_ns)

    says = np.empty(stages.shape, dtype=np.bool_)
    says[0], says[1] = told, warm
    if far is not None:
        np.copyto(stages[0], changed_m, where=far)
    stages_m2 = np.empty((2, n.shape[2], 1, len(n)))
    receivers = [n[:, r] for r in range(n.shape[1])]
    fewest, most = (reduce(extreme, receivers).T.copy()[:, None] for extreme in (np.minimum, np.maximum))
    stages_m2[0] = innovation_m2(natural, 1.0 / fewest, most * spans.dt_s)
    stages_m2[1] = _second_m2ps2(natural, spans.of_code_ps2)
    left, left_m2, _ = without_clocks(by_signal(stages), by_signal(says), stages_m2, inputs.system_of)
    sigma = np.sqrt(left_m2)
    left /= sigma
    return after, DivergenceStatistics(left.swapaxes(1, 3), sigma.swapaxes(1, 3))


def _changes(before: DivergenceMemory, inputs: DivergenceInputs, natural: Nature, near: Bools) -> tuple[Floats, Bools, Bools | None]:
    """Changes of c (E, R, S) without what all signals of a receiver have in common; where there are any; which of them are too large to go
    on, None where no one is. `near` (E, 1, 1): the epoch before was not too long ago."""
    c_m = np.concatenate((before.code_minus_carrier_m[None], inputs.code_minus_carrier_m))
    changed_m = c_m[1:] - c_m[:-1]
    known = np.isfinite(changed_m)
    known &= inputs.continues
    known &= near
    together = np.zeros(len(inputs.signals), dtype=np.int64)
    known_m = by_signal(np.where(known, changed_m, 0.0))[None]
    left = without_clocks(known_m, by_signal(known)[None], 2.0 * natural.code_m2[None], together)
    changed_m = by_signal(left.change_m[0])
    far = np.abs(changed_m) > MOST_APART_M if left.far else None
    return changed_m, np.isfinite(changed_m), far


def _since(goes_on: Bools, age: Ints, epoch_ns: Ints, before_ns: Ints, warm_up_ns: int) -> tuple[Ints, Bools]:
    """When the arcs of the last epoch began (R, S), and whose arcs began long enough ago (E, R, S). Arcs that go on from before the block
    began at before_ns (R, S)."""
    begun_ns = epoch_ns - warm_up_ns  # and not later
    if len(age) == 1:
        since_ns: Ints = np.where(goes_on[0], before_ns, epoch_ns)
        return since_ns, (since_ns <= begun_ns)[None]
    last = len(age) - 1 - age[-1]  # the epoch where they began
    since_ns = np.where(last >= 0, epoch_ns.take(last, mode="clip"), before_ns)
    earlier = np.searchsorted(epoch_ns, begun_ns, side="right")  # epochs of the block that are early enough; then all before it are
    warm: Bools = age > (np.arange(len(age)) - earlier)[:, None, None]
    warm &= before_ns <= np.where(earlier > 0, NEVER_NS, begun_ns)[:, None, None]
    return since_ns, warm


def innovation_m2(nature: Nature, a: Floats, age_s: Floats) -> Floats:
    """Variance of the first stage, of signals that have continued for age_s, at most tau; all broadcast together."""
    return nature.code_m2 * (1.0 + a) + 4.0 * nature.ionosphere_m2ps2 * (age_s * age_s)


def divergence_m2ps2(nature: Nature, dt_s: Floats, design: DivergenceDesign) -> Floats:
    """Variance of the second stage: multipath that both stages leave, and the ionosphere; all broadcast together."""
    return _second_m2ps2(nature, _of_code_ps2(dt_s, design))


def _of_code_ps2(dt_s: Floats, design: DivergenceDesign) -> Floats:
    """The share of the code's variance that the second stage has."""
    tau_s, stays_s = design.window_s, design.correlation_s + 0.5 * dt_s
    result: Floats = stays_s / (2.0 * tau_s * (tau_s + stays_s) ** 2)
    return result


def _second_m2ps2(nature: Nature, of_code_ps2: Floats) -> Floats:
    return nature.code_m2 * of_code_ps2 + 4.0 * nature.ionosphere_m2ps2


class _Spans(NamedTuple):
    """What follows from the times of epochs: dt (E,); which are near the one before (E, 1, 1); epochs in the window; the share of the first
    stage that enters the second; what this keeps; the share of the code's variance in it (E,)."""

    dt_s: Floats
    near: Bools
    full: Floats
    share_ps: Floats
    keep: Floats
    of_code_ps2: Floats


@lru_cache(maxsize=64)
def _spans(dt_ns: bytes, design: DivergenceDesign) -> _Spans:
    """Of times (E,) since the epoch before: of epochs at equal intervals they are always the same."""
    dt_s = np.frombuffer(dt_ns, dtype=np.int64) / NS_PER_S
    near, full = (dt_s <= design.longest_gap_s)[:, None, None], np.maximum(design.window_s / dt_s, 1.0)[:, None, None]
    return _Spans(dt_s, near, full, 1.0 / (full * design.window_s), 1.0 - 1.0 / full, _of_code_ps2(dt_s, design))


def _carry_on(before: Floats, keep: Floats, new: Floats) -> None:
    """x(t) = keep(t) x(t - dt) + new(t), (E, R, S), into the place of `new`."""
    kept = np.empty(before.shape)
    for keep_now, now in zip(keep, new, strict=True):
        np.multiply(keep_now, before, out=kept)
        before = np.add(now, kept, out=now)
