"""What carriers show at known points: residuals, how far honest signals move, clocks of receivers taken out of their changes.

A carrier sees what a satellite does hundreds of times finer than the code, but only as change: every statistic made of it is a
difference over time, divided by how far an honest signal may move in that time (`Nature`): noise and multipath, the satellite's clock,
and what the atmosphere adds while the satellite rises or the ionosphere itself changes.

No model of the ionosphere is taken out: its broadcast terms change in steps, may be false, and halve the error at best.
Source: section 2.4 of the project's notes on ground integrity (MQM of GBAS); the error model is our own choice, term by term below.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from integrity.gnss.carrier.smoothing import MOST_APART_M
from integrity.gnss.gps_time import NS_PER_S
from integrity.gnss.observations import Bools, Floats, Ints, ObservationBlock, freeze

SHELL2 = (6378.1363 / (6378.1363 + 350.0)) ** 2  # Earth's radius over that of the ionospheric shell, RTCA DO-229, A.4.4.10.4
CLIMB_RADPS = 1.6e-4  # no satellite climbs faster while the slant still changes: 3.9 km/s at the horizon, 25,800 km away, is 1.5e-4
LOWEST_SINE = 0.05  # 3 deg: below, no model of the atmosphere holds
LEAST_EXPONENT = 600.0  # of a C/N0 that no receiver reports: its variance is beyond measure, and still a number
LEAST_FOR_CLOCK = 3  # of two satellites nobody knows which one stepped
NEAR_SIGMAS = 4.0  # from their mean; who is further away says nothing of the clock
# Numbers as arrays without axes: read in half the time, which is half of what blocks of one epoch cost.
ONE, UNKNOWN, LEAST = np.array(1.0), np.array(np.nan), np.array(float(LEAST_FOR_CLOCK))
NEAR2, FAR2 = np.array(NEAR_SIGMAS**2), np.array(MOST_APART_M**2)
Columns = slice | Ints
Value = TypeVar("Value", bound=np.generic)


class SignalErrors(NamedTuple):
    """Standard deviations that overbound what signals do without a fault.

    `phase_m`, `phase_low_m`: of one phase, sqrt(a^2 + (b / sin el)^2), multipath included. `phase_m2hz`: its thermal noise, as variance
    over 10^(-(C/N0) / 10); a loop of 18 Hz at L1 has (19 cm / 2 pi)^2 18 Hz = 0.0165 m2 Hz (Kaplan, Hegarty, 2nd edition, 5.6.1).
    `code_m`, `code_low_m`, `code_m2hz`: the same of the code; `code_correlation_s`: how long its multipath stays.
    `clock_m`: of a satellite's clock after one second, growing with the square root of time (white frequency noise: caesium and rubidium
    of GPS up to 100 s; Senior, Ray, Beard, GPS Solutions 12, 2008).
    `ionosphere_zenith_m`: delay of L1 in the zenith, seen under a changing slant; `ionosphere_mps`: how fast it changes itself, in the
    zenith; `troposphere_zenith_m`: what the model leaves in the zenith.
    """

    phase_m: float
    phase_low_m: float
    phase_m2hz: float
    code_m: float
    code_low_m: float
    code_m2hz: float
    code_correlation_s: float
    clock_m: float
    ionosphere_zenith_m: float
    ionosphere_mps: float
    troposphere_zenith_m: float


class Nature(NamedTuple):
    """What moves signals without a fault, (E, 1, S): variances of a phase and a code, m2; of how fast the delay of the ionosphere changes,
    and that of the whole atmosphere, m2/s2."""

    phase_m2: Floats
    code_m2: Floats
    ionosphere_m2ps2: Floats
    atmosphere_m2ps2: Floats

    def by_signal(self) -> "Nature":
        """The same, (S, 1, E)."""
        return Nature(self.phase_m2.T, self.code_m2.T, self.ionosphere_m2ps2.T, self.atmosphere_m2ps2.T)


def nature(sin_el: Floats, cn0_dbhz: Floats, ionosphere: Floats, noise: Floats, errors: SignalErrors) -> Nature:
    """For all receivers what the one has that sees the satellite lowest, and weakest.

    sin_el (E, R, S): `los_enu[2]` of the surveyed points; cn0_dbhz (E, R, S), NaN where not measured; ionosphere (E, S), by how much more
    than L1 it delays the signal (`SatelliteStates`); noise (S,): 1 of single signals, of pairs how much more noise they have
    (`combination.weights_of`).
    Slants of a satellite that climbs as fast as it can: of a thin shell F = 1 / sqrt(1 - (r cos el)^2), dF/del = -r^2 sin el cos el F^3
    (DO-229, A.4.4.10.4); of the troposphere m = 1.001 / sqrt(0.002001 + sin^2 el), dm/del = -sin el cos el m^3 / 1.001^2 (A.4.2.4).
    Computed by signal, (S, E), as the monitors need them.
    """
    of = _terms(errors)
    s = np.fmax(np.minimum.reduce(sin_el, axis=1).T.copy(), of.lowest)
    s2 = s * s
    over_s2 = ONE / s2
    thermal = np.exp(np.minimum(np.minimum.reduce(cn0_dbhz, axis=1).T * of.nepers_per_db, of.most))  # 10^(-(C/N0) / 10)
    np.fmax(thermal, of.nothing, out=thermal)
    more = (noise * noise)[:, None]
    phase_m2 = (of.phase_m2 + of.phase_low_m2 * over_s2 + of.phase_m2hz * thermal) * more
    code_m2 = (of.code_m2 + of.code_low_m2 * over_s2 + of.code_m2hz * thermal) * more
    turn2 = s2 - s2 * s2
    F2 = ONE / (of.flat + of.shell2 * s2)
    m2 = of.troposphere / (of.low + s2)
    ionosphere_m2ps2 = (of.ionosphere_m2 * turn2 * F2 * F2 + of.ionosphere_m2ps2) * F2 * np.square(ionosphere.T)
    np.fmax(ionosphere_m2ps2, of.nothing, out=ionosphere_m2ps2)
    atmosphere_m2ps2 = ionosphere_m2ps2 + of.troposphere_m2 * turn2 * m2 * m2 * m2
    return Nature(phase_m2.T[:, None], code_m2.T[:, None], ionosphere_m2ps2.T[:, None], atmosphere_m2ps2.T[:, None])


class _Terms(NamedTuple):
    """Numbers of the error model as arrays without axes, which are read in half the time."""

    phase_m2: Floats
    phase_low_m2: Floats
    phase_m2hz: Floats
    code_m2: Floats
    code_low_m2: Floats
    code_m2hz: Floats
    ionosphere_m2: Floats
    ionosphere_m2ps2: Floats
    troposphere_m2: Floats
    shell2: Floats
    flat: Floats
    low: Floats
    troposphere: Floats
    nepers_per_db: Floats
    most: Floats
    nothing: Floats
    lowest: Floats


@lru_cache(maxsize=4)
def _terms(errors: SignalErrors) -> _Terms:
    numbers = (
        errors.phase_m**2,
        errors.phase_low_m**2,
        errors.phase_m2hz,
        errors.code_m**2,
        errors.code_low_m**2,
        errors.code_m2hz,
        (errors.ionosphere_zenith_m * SHELL2 * CLIMB_RADPS) ** 2,
        errors.ionosphere_mps**2,
        (errors.troposphere_zenith_m * CLIMB_RADPS) ** 2,
        SHELL2,
        1.0 - SHELL2,
        0.002001,
        1.002,
        -0.1 * np.log(10.0),
        LEAST_EXPONENT,
        0.0,
        LOWEST_SINE,
    )
    return _Terms(*(np.array(number) for number in numbers))


def carrier_residual_m(residual_m: Floats, code_minus_carrier_m: Floats, ionosphere_m: Floats) -> Floats:
    """Residuals of carriers (E, R, S), m: measured minus modelled, receiver clock and ambiguity left in.

    residual_m (E, R, S): those of the ranges (`Prefit`); ionosphere_m, broadcast to (E, R, S): the delay that is in the expected ranges,
    which is taken out again (`Expected`). NaN where range or phase was not measured.
    """
    result: Floats = residual_m - code_minus_carrier_m + ionosphere_m
    return result


def code_minus_carrier_m(block: ObservationBlock, wavelength_m: Floats) -> Floats:
    """c (E, R, S), m; wavelength_m (E, S)."""
    result: Floats = block.pseudorange_m - wavelength_m[:, None] * block.carrier_cycles
    return result


@dataclass(frozen=True, eq=False)
class TrackingMemory:
    """What receivers said of their tracking in the last epoch: when it was by their clocks, ns (R,); lock times, half cycles (R, S)."""

    signals: tuple[str, ...]
    receive_time_ns: Ints
    lock_s: Floats
    half_cycle: Bools

    def __post_init__(self) -> None:
        freeze(self)

    @staticmethod
    def empty(n_receivers: int) -> "TrackingMemory":
        """Before the first epoch."""
        nothing = np.zeros((n_receivers, 0))
        return TrackingMemory((), np.zeros(n_receivers, dtype=np.int64), nothing, nothing.astype(np.bool_))

    def on(self, signals: tuple[str, ...]) -> "TrackingMemory":
        """The same memory for another list of signals: of new ones nothing was said."""
        if signals == self.signals:
            return self
        column = {s: i for i, s in enumerate(self.signals)}
        source = [column.get(s, -1) for s in signals]  # -1: an extra last column
        nothing = np.full((len(self.lock_s), 1), np.nan)
        lock_s = np.concatenate((self.lock_s, nothing), axis=-1)[..., source]
        return TrackingMemory(signals, self.receive_time_ns, lock_s, np.concatenate((self.half_cycle, nothing < 0.0), axis=-1)[..., source])


def continuing(memory: TrackingMemory, block: ObservationBlock, lock_share: float) -> tuple[TrackingMemory, Bools]:
    """The memory after a block, and where signals that were measured in an epoch and in the one before continue as far as the receiver
    says, (E, R, S): not flagged, tracked for no less than before and for at least `lock_share` of the time since, half cycle as it was.

    A satellite that steps looks like a slip to all receivers: what Doppler or another frequency makes of it (`find_slips`) is just what is
    monitored here. A slip at one receiver alone is never blamed on the satellite.
    """
    before = memory.on(block.signals)
    lock_s, half_cycle = _before(before.lock_s, block.lock_s), _before(before.half_cycle, block.half_cycle)
    dt_s = ((block.receive_time_ns - _before(before.receive_time_ns, block.receive_time_ns)) / NS_PER_S)[..., None]
    broken = block.lock_s < lock_s
    broken |= block.lock_s < lock_share * dt_s
    broken |= half_cycle != block.half_cycle
    broken |= block.slip
    broken |= dt_s <= 0.0
    after = TrackingMemory(block.signals, block.receive_time_ns[-1].copy(), block.lock_s[-1].copy(), block.half_cycle[-1].copy())
    return after, ~broken


def _before(first: NDArray[Value], values: NDArray[Value]) -> NDArray[Value]:
    """Of each epoch the values of the one before, that of the first being `first`."""
    return first[None] if len(values) == 1 else np.concatenate((first[None], values[:-1]))


def ages(goes_on: Bools, before: Ints) -> Ints:
    """For how many epochs each signal has continued, (E, R, S); `before` (R, S) up to the block; 0 where an arc begins, or nothing is."""
    n = len(goes_on)
    if n == 1:
        return (before + 1)[None] * goes_on
    epoch = np.arange(n)[:, None]
    age: Ints = (before + 1 + epoch[..., None]) * goes_on
    broken = np.logical_and.reduce(goes_on, axis=0) != np.logical_or.reduce(goes_on, axis=0)  # somewhere, and going on elsewhere
    if broken.any():
        last = np.maximum.accumulate(np.where(goes_on[:, broken], -1, epoch), axis=0)
        age[:, broken] = np.where(last < 0, before[broken] + 1 + epoch, epoch - last)
    return age


def by_signal(values: NDArray[Value]) -> NDArray[Value]:
    """(..., E, R, S) as (..., S, R, E), one signal after the other."""
    return values.swapaxes(-1, -3).copy()


class Changes(NamedTuple):
    """Changes of residuals, m, the receiver's clock taken out, and their variances, m2, as far as they were given; NaN where nothing can be
    said. `far`: whether any may be further than `MOST_APART_M` from the others."""

    change_m: Floats
    variance_m2: Floats
    far: bool


def without_clocks(change_m: Floats, known: Bools, variance_m2: Floats, system_of: Ints) -> Changes:
    """Changes (L, S, R, E), of L kinds, less what their constellation has in common; NaN where they are not `known`, though they are
    finite there too. variance_m2 (L, S, 1, E), of each change itself, finite.

    Common is the weighted mean of all; where some are away from it, of the majority that agrees: a satellite that steps has no hold on the
    others. What is left has variance sigma^2 - 1 / W, W the sum of weights, and is taken to have sigma^2; of one that is away from the
    others it has sigma^2 + 1 / W. NaN where the constellation has fewer than three, or no majority agrees. Sums are made one by one, so
    that signals which are not seen change no bit.
    """
    groups, place = _constellations(system_of.tobytes())
    terms = np.empty((3, *change_m.shape))  # counts, weights, weighted changes
    count, weight, weighted = terms
    count[...] = known
    np.multiply(count, ONE / variance_m2, out=weight)
    np.multiply(weight, change_m, out=weighted)
    sums = np.empty((*terms.shape[:2], len(groups), *terms.shape[3:]))
    for k, columns in enumerate(groups):
        np.add.reduce(terms[:, :, columns], axis=2, out=sums[:, :, k])  # row by row, as long as there are several receivers
    mean_m = sums[2] / np.where(sums[0] >= LEAST, sums[1], UNKNOWN)
    left_m = np.where(known, change_m - mean_m.take(place, axis=1), UNKNOWN)
    suspect = left_m * left_m > np.minimum(NEAR2 * variance_m2, FAR2)
    if np.count_nonzero(suspect) == 0:
        return Changes(left_m, variance_m2, False)
    return _without_those_away(change_m, left_m, variance_m2, suspect, groups)


def _without_those_away(change_m: Floats, left_m: Floats, variance_m2: Floats, suspect: Bools, groups: Sequence[Columns]) -> Changes:
    """The same, of constellations with some that are `suspect` (L, S, R, E) of being away from it; `left_m` is what is left of all."""
    left_m2 = np.broadcast_to(variance_m2, change_m.shape).copy()
    for kind in range(len(change_m)):
        for columns in groups:
            some = np.logical_or.reduce(suspect[kind, columns], axis=0)
            if some.any():
                mine_m, mine_m2 = left_m[kind, columns], left_m2[kind, columns]
                x_m = np.where(np.isnan(mine_m), np.nan, change_m[kind, columns])
                mine_m[:, some], mine_m2[:, some] = _agreeing(x_m[:, some], mine_m2[:, some])
                left_m[kind, columns], left_m2[kind, columns] = mine_m, mine_m2
    return Changes(left_m, left_m2, True)


def _agreeing(change_m: Floats, variance_m2: Floats) -> tuple[Floats, Floats]:
    """The same of one constellation, (M, N), N times. Who is furthest away by w = r^2 / (sigma^2 - 1 / W) goes first: where one is at
    fault it is that one, whatever its weight (Baarda 1968, data snooping)."""
    left_m, left_m2 = np.full(change_m.shape, np.nan), variance_m2.copy()
    in_mean, n = np.isfinite(change_m), np.arange(change_m.shape[1])  # n: those that are not done
    needed = np.maximum(LEAST_FOR_CLOCK - 1, in_mean.sum(axis=0) // 2 + 1)
    while (n := n[in_mean[:, n].sum(axis=0) >= needed[n]]).size:
        mine, x_m, sigma2 = in_mean[:, n], change_m[:, n], variance_m2[:, n]
        weight = np.where(mine, 1.0 / sigma2, 0.0)
        total = np.add.accumulate(weight)[-1]
        r_m = x_m - np.add.accumulate(weight * np.where(mine, x_m, 0.0))[-1] / total
        away = mine & (r_m * r_m > NEAR_SIGMAS**2 * sigma2)
        some = np.logical_or.reduce(away, axis=0)
        left_m[:, n[~some]] = r_m[:, ~some]
        left_m2[:, n[~some]] = np.where(mine, sigma2, sigma2 + 1.0 / total)[:, ~some]
        n = n[some]
        furthest = np.argmax(np.where(mine, r_m * r_m / (sigma2 - 1.0 / total), -1.0)[:, some], axis=0)
        in_mean[furthest, n] = False
    return left_m, left_m2


@lru_cache(maxsize=256)
def _constellations(system_of: bytes) -> tuple[tuple[Columns, ...], Ints]:
    """Columns of the signals of each constellation; of each signal its constellation's place among these, (S,)."""
    numbers = np.frombuffer(system_of, dtype=np.int64)
    systems, place = np.unique(numbers, return_inverse=True)
    members = [np.flatnonzero(place == k) for k in range(len(systems))]
    return tuple(slice(m[0], m[-1] + 1) if m[-1] - m[0] + 1 == len(m) else m for m in members), place
