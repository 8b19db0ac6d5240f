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
from typing import NamedTuple

import numpy as np

from integrity.gnss.gps_time import NS_PER_S
from integrity.gnss.observations import Bools, Floats, Ints, ObservationBlock, freeze
from integrity.gnss.range_errors import cn0_variance_m2

SHELL2 = (6378.1363 / (6378.1363 + 350.0)) ** 2  # Earth's radius over that of the ionospheric shell, RTCA DO-229, A.4.4.10.4
CLIMB_RADPS = 1.6e-4  # no satellite climbs faster while the slant still changes: 3.9 km/s at the horizon, 25,800 km away, is 1.5e-4
LOWEST_SINE = 0.05  # 3 deg: below, no model of the atmosphere holds
LEAST_FOR_CLOCK = 3  # of two satellites nobody knows which one stepped
NEAR_SIGMAS = 4.0  # from their mean; who is further away says nothing of the clock
Columns = slice | Ints


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
    """What moves signals without a fault, (E, 1, S): variances of a phase and a code, m2; of how fast the delays of ionosphere and
    troposphere change, m2/s2."""

    phase_m2: Floats
    code_m2: Floats
    ionosphere_m2ps2: Floats
    troposphere_m2ps2: Floats


def nature(sin_el: Floats, cn0_dbhz: Floats, ionosphere: Floats, noise: Floats, errors: SignalErrors) -> Nature:
    """For all receivers what the one has that sees the satellite lowest, and weakest.

    sin_el (E, R, S): `los_enu[2]` of the surveyed points; cn0_dbhz (E, R, S), NaN where not measured; ionosphere (E, S), by how much more
    than L1 it delays the signal (`SatelliteStates`); noise (S,): 1 of single signals, of pairs how much more noise they have
    (`combination.weights_of`).
    Slants of a satellite that climbs as fast as it can: of a thin shell F = 1 / sqrt(1 - (r cos el)^2), dF/del = -r^2 sin el cos el F^3
    (DO-229, A.4.4.10.4); of the troposphere m = 1.001 / sqrt(0.002001 + sin^2 el), dm/del = -sin el cos el m^3 / 1.001^2 (A.4.2.4).
    """
    s = np.maximum(np.minimum.reduce(sin_el, axis=1), LOWEST_SINE)
    s2 = s * s
    thermal = cn0_variance_m2(np.minimum.reduce(cn0_dbhz, axis=1), 1.0)
    always, low, of_thermal = _noise_m2(errors)
    phase_m2, code_m2 = (always + low / s2 + of_thermal * thermal) * (noise * noise)
    F2 = 1.0 / (1.0 - SHELL2 * (1.0 - s2))
    m2 = 1.002 / (0.002001 + s2)
    turn2 = s2 * (1.0 - s2) * CLIMB_RADPS**2
    of_shell = ((errors.ionosphere_zenith_m * SHELL2) ** 2 * turn2 * F2 * F2 + errors.ionosphere_mps**2) * F2
    troposphere_m2ps2 = errors.troposphere_zenith_m**2 * turn2 * m2 * m2 * m2
    return Nature(phase_m2[:, None], code_m2[:, None], (ionosphere * ionosphere * of_shell)[:, None], troposphere_m2ps2[:, None])


@lru_cache(maxsize=4)
def _noise_m2(errors: SignalErrors) -> Floats:
    """Variances of phase and code, (3, 2, 1, 1): at any elevation, over sin^2 el, over 10^(-(C/N0) / 10)."""
    phase_m2 = errors.phase_m**2, errors.phase_low_m**2, errors.phase_m2hz
    code_m2 = errors.code_m**2, errors.code_low_m**2, errors.code_m2hz
    return np.array((phase_m2, code_m2)).T[..., None, None]


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
    lock_s = np.concatenate((before.lock_s[None], block.lock_s[:-1]))
    half_cycle = np.concatenate((before.half_cycle[None], block.half_cycle[:-1]))
    dt_s = (block.receive_time_ns - np.concatenate((before.receive_time_ns[None], block.receive_time_ns[:-1])))[..., None] / NS_PER_S
    broken = (block.lock_s < np.fmax(lock_s, lock_share * dt_s)) | (half_cycle != block.half_cycle) | block.slip
    after = TrackingMemory(block.signals, block.receive_time_ns[-1].copy(), block.lock_s[-1].copy(), block.half_cycle[-1].copy())
    return after, ~broken & (dt_s > 0.0)


def ages(goes_on: Bools, before: Ints) -> Ints:
    """For how many epochs each signal has continued, (E, R, S); `before` (R, S) up to the block; 0 where an arc begins, or nothing is."""
    n = len(goes_on)
    age: Ints = (before + np.arange(1, n + 1)[:, None, None]) * goes_on
    if n > 1:
        broken = np.logical_and.reduce(goes_on, axis=0) != np.logical_or.reduce(goes_on, axis=0)  # somewhere, and going on elsewhere
        epoch = np.arange(n)[:, None]
        last = np.maximum.accumulate(np.where(goes_on[:, broken], -1, epoch), axis=0)
        age[:, broken] = np.where(last < 0, before[broken] + 1 + epoch, epoch - last)
    return age


class Changes(NamedTuple):
    """Changes of residuals, m, the receiver's clock taken out, and their variances, m2, as far as they were given; NaN where nothing can be
    said."""

    change_m: Floats
    variance_m2: Floats


def without_clocks(change_m: Floats, variance_m2: Floats, system_of: Ints) -> Changes:
    """Changes (..., S) less what their constellation has in common; variance_m2, broadcast to (..., S), of each change itself.

    Common is the weighted mean of all; where some are away from it, of the majority that agrees: a satellite that steps has no hold on the
    others. What is left has variance sigma^2 - 1 / W, W the sum of weights, and is taken to have sigma^2; of one that is away from the
    others it has sigma^2 + 1 / W. NaN where the constellation has fewer than three, or no majority agrees. Sums are made one by one, so
    that signals which are not seen change no bit.
    """
    groups, place = _constellations(system_of.tobytes())
    known = np.isfinite(change_m)
    terms = np.empty((3, *change_m.shape))  # weights, weighted changes, counts
    terms[0] = np.where(known, 1.0 / variance_m2, 0.0)
    np.multiply(np.where(known, change_m, 0.0), terms[0], out=terms[1])
    terms[2] = known
    by_signal = terms.reshape(-1, len(place)).T.copy()  # (S, 3 N): sums of rows are made one by one, and fast
    sums = np.empty((len(groups), by_signal.shape[1]))
    for k, columns in enumerate(groups):
        np.add.reduce(by_signal[columns], axis=0, out=sums[k])
    total, weighted, count = sums.reshape(len(groups), 3, -1).transpose(1, 2, 0)  # (N, L) each
    mean_m = weighted / np.where(count >= LEAST_FOR_CLOCK, total, np.nan)
    left_m = change_m - mean_m.take(place, axis=-1).reshape(change_m.shape)
    away = left_m * left_m > NEAR_SIGMAS**2 * variance_m2
    return _without_those_away(change_m, left_m, variance_m2, away, groups) if away.any() else Changes(left_m, variance_m2)


def _without_those_away(change_m: Floats, left_m: Floats, variance_m2: Floats, away: Bools, groups: Sequence[Columns]) -> Changes:
    """The same, of constellations with some that are `away` (..., S) from the mean; `left_m` is what is left of all others."""
    left_m2 = np.broadcast_to(variance_m2, change_m.shape).copy()
    for columns in groups:
        for row in zip(*np.nonzero(away[..., columns].any(axis=-1)), strict=True):
            left_m[row][columns], left_m2[row][columns] = _agreeing(change_m[row][columns], left_m2[row][columns])
    return Changes(left_m, left_m2)


def _agreeing(change_m: Floats, variance_m2: Floats) -> Changes:
    """The same of one constellation at one receiver, (M,). Who is furthest away by w = r^2 / (sigma^2 - 1 / W) goes first: where one is at
    fault it is that one, whatever its weight (Baarda 1968, data snooping)."""
    in_mean = np.isfinite(change_m)
    needed = max(LEAST_FOR_CLOCK - 1, in_mean.sum() // 2 + 1)
    while in_mean.sum() >= needed:
        weight = np.where(in_mean, 1.0 / variance_m2, 0.0)
        total = np.add.accumulate(weight)[-1]
        left_m = change_m - np.add.accumulate(weight * np.where(in_mean, change_m, 0.0))[-1] / total
        away = in_mean & (left_m * left_m > NEAR_SIGMAS**2 * variance_m2)
        if not away.any():
            return Changes(left_m, np.where(in_mean, variance_m2, variance_m2 + 1.0 / total))
        in_mean[np.argmax(np.where(in_mean, left_m * left_m / (variance_m2 - 1.0 / total), -1.0))] = False
    return Changes(np.full(change_m.shape, np.nan), variance_m2)


@lru_cache(maxsize=256)
def _constellations(system_of: bytes) -> tuple[tuple[Columns, ...], Ints]:
    """Columns of the signals of each constellation; of each signal its constellation's place among these, (S,)."""
    numbers = np.frombuffer(system_of, dtype=np.int64)
    systems, place = np.unique(numbers, return_inverse=True)
    members = [np.flatnonzero(place == k) for k in range(len(systems))]
    return tuple(slice(m[0], m[-1] + 1) if m[-1] - m[0] + 1 == len(m) else m for m in members), place
