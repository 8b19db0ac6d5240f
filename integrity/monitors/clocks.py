"""Clocks: each receiver's against its own prediction, constellations against each other, GNSS time against the host's.

A step of a receiver's clock or of a constellation's moves no position where every constellation has a clock of its own: these two only
explain. GNSS time that leaves an independent clock on all receivers is another matter: a triangle whose time is pushed keeps its shape.
Clocks are those at the surveyed points (`residuals.KnownPointResiduals`), in the order of `signals.TIME_SCALES`.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from integrity.config import HostClock
from integrity.events import Tick
from integrity.gnss.constants import SPEED_OF_LIGHT_MPS
from integrity.gnss.gps_time import NS_PER_S, gps_from_utc
from integrity.gnss.observations import Floats, Ints, freeze
from integrity.gnss.signals import TIME_SCALES
from integrity.monitors.residuals import seen_by_all

MILLISECOND_M = SPEED_OF_LIGHT_MPS / 1e3
# Receivers keep their clocks near GPS time by steps of whole milliseconds. A crystal good to 2.5 ppm runs 0.15 ms in a minute: nearer to
# a whole number of milliseconds than this counts as one, and longer than a minute nothing is predicted.
NEAR_A_MILLISECOND_M = 0.3 * MILLISECOND_M
LONGEST_STEP_NS = 60 * NS_PER_S
# What a crystal's rate changes by from one step to the next, whatever their length (flicker floor), over sqrt(2): c times the Allan
# deviation, 1e-9 of a temperature-compensated crystal (manual of the Novus NR2310D). Seen of receivers: 5.5 m in 30 s, 2.1 m in 1 s.
FLICKER_MPS = 1e-9 * SPEED_OF_LIGHT_MPS
REMEMBERED = 2  # epochs before the block: two make a rate

OF_OWN_TIME: tuple[HostClock, ...] = ("ntp", "ptp")  # not disciplined by the satellites that are judged
# Host time minus GNSS time when measurements have come: from -1 s (a leap second that one of the two does not know of) to 3 s (2 s on the
# way through receiver, serial line or caster, and a leap second the other way). Own choice: nothing tells the delay on the way.
MIDDLE_S, HALF_WIDTH_S = 1.0, 2.0
OLDEST_TICK_NS = 60 * NS_PER_S
MOST_SLEW = 5e-4  # of the monotonic clock against UTC: what adjtimex(2) allows


@dataclass(frozen=True, eq=False)
class ClockMemory:
    """The last `REMEMBERED` epochs, oldest first: GPS time (2,), 0 where there was none, clocks (2, R, K), and their sigmas (2, K), m."""

    epoch_ns: Ints
    clock_m: Floats
    sigma_m: Floats

    def __post_init__(self) -> None:
        freeze(self)

    @staticmethod
    def empty(n_receivers: int) -> "ClockMemory":
        """Before the first epoch."""
        nothing = np.full((REMEMBERED, n_receivers, len(TIME_SCALES)), np.nan)
        return ClockMemory(np.zeros(REMEMBERED, dtype=np.int64), nothing, nothing[:, 0].copy())


class ClockStatistics(NamedTuple):
    """NaN where nothing is predicted. Per receiver (E, R): `innovation_m`, clock minus prediction less whole milliseconds, `innovation`
    the same in sigmas, `jump_ms` those milliseconds. `all_alike` (E,): the smallest of the receivers' innovations, in sigmas, 0 where
    their signs differ: a step of GNSS time. `constellation_m` (E, K): step against the first constellation that all receivers have, mean
    over receivers; `constellation` (E, K): the smallest of the receivers', in sigmas."""

    innovation_m: Floats
    innovation: Floats
    jump_ms: Floats
    all_alike: Floats
    constellation_m: Floats
    constellation: Floats


def advance(memory: ClockMemory, epoch_ns: Ints, clock_m: Floats, sigma_m: Floats) -> tuple[ClockMemory, ClockStatistics]:
    """The memory after a block, and what its clocks show; `clock_m` (E, R, K), `sigma_m` (E, K), of what the noise of ranges leaves in
    the clocks: 1 / sqrt(weight) of `residuals.ClockDesign`, for every receiver."""
    t_ns = np.concatenate((memory.epoch_ns, epoch_ns))
    clock = np.concatenate((memory.clock_m, clock_m))
    sigma = np.concatenate((memory.sigma_m, sigma_m))
    after = ClockMemory(t_ns[-REMEMBERED:].copy(), clock[-REMEMBERED:].copy(), sigma[-REMEMBERED:].copy())
    dt_ns = t_ns[1:] - t_ns[:-1]
    dt_s = np.where((dt_ns > 0) & (dt_ns <= LONGEST_STEP_NS), dt_ns / NS_PER_S, np.nan)[:, None]
    step_m = clock[1:] - clock[:-1]  # (E + 1, R, K)
    innovation_m, innovation, jump_ms = _innovations(dt_s, step_m, sigma * sigma)
    constellation_m, constellation = _constellations(np.where(np.isnan(dt_s[1:]), np.nan, sigma[1:-1]), sigma[2:], step_m[1:])
    all_alike = seen_by_all(innovation[:, :, None])[:, 0]
    return after, ClockStatistics(innovation_m, innovation, jump_ms, all_alike, constellation_m, constellation)


def _innovations(dt_s: Floats, step_m: Floats, variance: Floats) -> tuple[Floats, Floats, Floats]:
    """Each clock against the line through its last two values, (E, R), for dt_s (E + 1, 1), steps (E + 1, R, K), variances (E + 2, K); of
    the first constellation that has all three."""
    jump_ms = np.rint(step_m * (1.0 / MILLISECOND_M))
    rest_m = step_m - jump_ms * MILLISECOND_M
    rest_m = np.where(np.abs(rest_m) <= NEAR_A_MILLISECOND_M, rest_m, step_m)
    ratio = dt_s[1:] / dt_s[:-1]
    innovation_m = rest_m[1:] - ratio[..., None] * rest_m[:-1]
    noise = variance[2:] + (1.0 + ratio) ** 2 * variance[1:-1] + ratio**2 * variance[:-2]
    sigma_m = np.sqrt(noise + 2.0 * (FLICKER_MPS * dt_s[1:]) ** 2)[:, None]
    n_epochs, n_receivers, n_scales = innovation_m.shape
    first = np.isfinite(innovation_m).argmax(axis=-1).ravel() + n_scales * np.arange(n_epochs * n_receivers)
    chosen_m, sigmas, chosen_ms = (
        values.ravel()[first].reshape(n_epochs, n_receivers) for values in (innovation_m, innovation_m / sigma_m, jump_ms[1:])
    )
    return chosen_m, sigmas, np.where(np.isnan(chosen_m), np.nan, chosen_ms)


def _constellations(before_m: Floats, sigma_m: Floats, step_m: Floats) -> tuple[Floats, Floats]:
    """Steps of constellations (E, K) from epoch to epoch, for sigmas (E, K) of the clocks before and after, and their steps (E, R, K)."""
    n_epochs, n_receivers, _ = step_m.shape
    variance = before_m * before_m + sigma_m * sigma_m  # NaN after a gap
    total = step_m.sum(axis=1) + variance
    reference = np.isfinite(total).argmax(axis=-1)
    e = np.arange(n_epochs)
    against_m = step_m - step_m[e, :, reference][..., None]
    against_m[e, :, reference] = np.nan
    sigma_against_m = np.sqrt(variance + variance[e, reference][:, None])
    mean_m = np.where(np.isnan(sigma_against_m), np.nan, against_m.sum(axis=1) / n_receivers)
    return mean_m, seen_by_all(against_m / sigma_against_m[:, None])


def host_disagreement_s(epoch_ns: Ints, arrived_mono_ns: Ints, ticks: Sequence[Tick | None], host_clock: HostClock) -> Floats:
    """By how much GNSS time and the host's differ on the receiver on which they differ least, less what the host does not vouch for, (E,).

    In s, from the middle of what delays and leap seconds explain: beyond `HALF_WIDTH_S` GNSS time is wrong on all receivers, or the
    host's. `arrived_mono_ns` (E, R): when each receiver's measurements had come; `ticks` (E,): the last one before each epoch was
    complete. NaN where nobody vouches for the host's time, or its clock is not independent.
    """
    result = np.full(len(epoch_ns), np.nan)
    if host_clock not in OF_OWN_TIME:
        return result
    for e, tick in enumerate(ticks):
        if tick is not None and tick.utc_uncertainty_ns is not None:
            since_ns = [mono_ns - tick.mono_ns for mono_ns in arrived_mono_ns[e].tolist()]
            if max(map(abs, since_ns)) <= OLDEST_TICK_NS:
                host_ahead_ns = gps_from_utc(tick.utc_ns) - int(epoch_ns[e])
                off_s = min(abs((host_ahead_ns + ns) / NS_PER_S - MIDDLE_S) - MOST_SLEW * abs(ns) / NS_PER_S for ns in since_ns)
                result[e] = off_s - tick.utc_uncertainty_ns / NS_PER_S
    return result


def remarks(statistics: ClockStatistics, e: int, receivers: Sequence[str], most_sigmas: float) -> tuple[str, ...]:
    """Of epoch e, in words for people: clocks that jumped or left their prediction."""
    found = []
    for receiver, ms, sigmas, m in zip(receivers, statistics.jump_ms[e], statistics.innovation[e], statistics.innovation_m[e], strict=True):
        if abs(ms) >= 1.0:
            found.append(f"{receiver}: its clock was set by {ms:+.0f} ms")
        if abs(sigmas) > most_sigmas:
            found.append(f"{receiver}: its clock stepped by {m:+.1f} m, {abs(sigmas):.1f} sigma")
    if statistics.all_alike[e] > most_sigmas:
        found.append(f"the clocks of all receivers stepped alike, {statistics.all_alike[e]:.1f} sigma: GNSS time itself?")
    for scale, sigmas, m in zip(TIME_SCALES, statistics.constellation[e], statistics.constellation_m[e], strict=True):
        if sigmas > most_sigmas:
            found.append(f"{scale}: its clock stepped by {m:+.1f} m against the others, {sigmas:.1f} sigma")
    return tuple(found)
