"""Slow shifts of one receiver against the others: an antenna that leans, a survey error, a ramp too slow for one epoch (CUSUM).

What is watched of displacements e_j (solved minus surveyed; east, north, up), in sigmas of the site's differential error:

    own of receiver j     u = (e_j - mean of the others) / (sigma_d sqrt(R / (R - 1)))
    pair of j and k       u = (e_j - e_k) / (sigma_d sqrt(2))

Errors forget with the differential correlation time: a = exp(-dt / tau). Whitened, y = (u - a u') / sqrt(1 - a^2) with u' of the epoch
before, N(0, 1) from epoch to epoch; a lasting shift D of u moves its mean by D g, g = sqrt((1 - a) / (1 + a)). Two sums per channel,

    C+ = max(0, C+ + y - k g),   C- = max(0, C- - y - k g),   alarm where C > h.

How far real receivers may stand off for good (their surveys, multipath that stays) is m, `standing`; k, `allowance`, lies midway between m
and the shift that is found soonest. h follows from the promised rate of false alarms of receivers that stand off by m, by Siegmund's
formula for the drift -(k - m) g. A shift beyond k is found, the further the sooner; one between m and k raises false alarms.

Own choices: each y counts at most 4 sigma, so that one jump is no slow shift (the other checks see it at once) and the end of a fault
does not alarm the other side; C stops at 1.1 h, so that after a fault of any length a sum is below h again in 0.1 h / (k g) epochs on
average; after a gap of ten minutes all begins anew.
Sources: Page 1954, Biometrika 41; Siegmund 1985, Sequential Analysis, chapter II (run lengths, overshoot); section 2.4 of the notes on
ground integrity.
"""

from dataclasses import dataclass
from functools import lru_cache
from itertools import combinations, pairwise
from math import exp, expm1, sqrt
from typing import NamedTuple

import numpy as np

from integrity.gnss.gps_time import NS_PER_S
from integrity.gnss.observations import Bools, Floats, Ints, freeze

OVERSHOOT = 1.166  # 2 x 0.583: mean excess of a normal random walk over both of its boundaries, Siegmund 1985
MOST_SIGMAS = 4.0
SATURATION = 1.1  # of the threshold
BEGIN_ANEW_NS = 600 * NS_PER_S
NO_EPOCH = 0


class SlowDesign(NamedTuple):
    """`standing` m and `allowance` k in sigmas of u, `threshold` h in sigmas of y, `correlation_s` of the differential errors."""

    standing: float
    allowance: float
    threshold: float
    correlation_s: float


@dataclass(frozen=True, eq=False)
class SlowMemory:
    """After an epoch: `u` (P, 3) of the channels of `channels`, and both sums `cusum` (2, P, 3); `epoch_ns` 0 before the first one."""

    epoch_ns: int
    u: Floats
    cusum: Floats

    def __post_init__(self) -> None:
        freeze(self)

    @staticmethod
    def empty(n_receivers: int) -> "SlowMemory":
        """Before the first epoch."""
        n = len(channels(n_receivers))
        return SlowMemory(NO_EPOCH, np.zeros((n, 3)), np.zeros((2, n, 3)))


class SlowStatistics(NamedTuple):
    """The larger of both sums over east, north and up: of each receiver `own` (E, R), and of the pair of the others `pair` (E, R); NaN
    where some receiver has no position."""

    own: Floats
    pair: Floats


@lru_cache(maxsize=4)
def channels(n_receivers: int) -> Floats:
    """Rows that make own displacements, then pairs, of displacements, for unit sigma_d: (P, R). The i-th pair leaves out receiver i."""
    if n_receivers != 3:
        raise ValueError(f"slow shifts are told apart among three receivers, not {n_receivers}")
    own = (np.eye(3) * 3.0 - 1.0) / 2.0 / sqrt(1.5)
    pairs = np.zeros((3, 3))
    for row, (j, k) in zip(pairs, reversed(list(combinations(range(3), 2))), strict=True):
        row[j], row[k] = sqrt(0.5), -sqrt(0.5)
    both = np.concatenate((own, pairs))
    both.setflags(write=False)
    return both


def slow_design(
    standing: float, allowance: float, false_alarms_per_year: float, looks_per_year: float, interval_s: float, correlation_s: float
) -> SlowDesign:
    """The threshold for false alarms of all receivers, axes and sides together; each has its share, and stands off by `standing`."""
    g = gain(round(interval_s * NS_PER_S), correlation_s)
    run_length = 3 * 3 * 2 * looks_per_year / false_alarms_per_year
    return SlowDesign(standing, allowance, threshold_for(run_length, (allowance - standing) * g), correlation_s)


def mean_run_length(threshold: float, drift: float) -> float:
    """Epochs until a one-sided sum of N(drift, 1) first exceeds the threshold, from 0, on average.

    (exp(-2 D b) + 2 D b - 1) / (2 D^2), b = h + 1.166; b^2 for D = 0. Within 2 % of the integral equation for |D| <= 0.5, h >= 4.
    Source: Siegmund 1985, chapter II.
    """
    b = threshold + OVERSHOOT
    if abs(drift * b) < 1e-4:
        return b * b
    return (expm1(-2.0 * drift * b) + 2.0 * drift * b) / (2.0 * drift * drift)


def threshold_for(run_length: float, reference: float) -> float:
    """h for which a sum of N(0, 1) less `reference` each epoch runs that long on average; by bisection, at least 1."""
    low, high = 1.0, 1.0 + 400.0 / reference
    for _ in range(80):
        middle = (low + high) / 2.0
        low, high = (middle, high) if mean_run_length(middle, -reference) < run_length else (low, middle)
    return high


def time_to_detect_s(shift: float, design: SlowDesign, interval_s: float) -> float:
    """Seconds until a shift of u, in its sigmas, that comes slowly or was there from the start is found, on average; beyond k."""
    g = gain(round(interval_s * NS_PER_S), design.correlation_s)
    return mean_run_length(design.threshold, (shift - design.allowance) * g) * interval_s


@lru_cache(maxsize=4096)
def _kept(dt_ns: int, correlation_s: float) -> float:
    return exp(-dt_ns / NS_PER_S / correlation_s)


def gain(dt_ns: int, correlation_s: float) -> float:
    """g: by how much a lasting shift of u by one moves the mean of y, for epochs dt apart."""
    a = _kept(dt_ns, correlation_s)
    return sqrt((1.0 - a) / (1.0 + a))


def advance(
    memory: SlowMemory, epoch_ns: Ints, e_enu_m: Floats, var_differential_m2: Floats, design: SlowDesign
) -> tuple[SlowMemory, SlowStatistics]:
    """The memory after the epochs (E,), and what they show, of displacements (E, R, 3) and variances of the differential error (E, 3)."""
    n_epochs, n_receivers = e_enu_m.shape[:2]
    statistics = SlowStatistics(np.full((n_epochs, n_receivers), np.nan), np.full((n_epochs, n_receivers), np.nan))
    solved = np.flatnonzero(np.isfinite(e_enu_m).all(axis=(1, 2)) & np.isfinite(var_differential_m2).all(axis=1))
    if not len(solved):
        return memory, statistics
    u = _standing_off(e_enu_m[solved], var_differential_m2[solved])
    times = [memory.epoch_ns, *epoch_ns[solved].tolist()]
    y, reference = _whitened(times, np.concatenate((memory.u[None], u)), design)
    sums = _sums(memory.cusum, times, y, reference, design.threshold * SATURATION)
    worst = sums.max(axis=-1).max(axis=1)  # over axes, then sides: (E, P)
    statistics.own[solved], statistics.pair[solved] = worst[:, :n_receivers], worst[:, n_receivers:]
    return SlowMemory(times[-1], np.array(u[-1]), np.array(sums[-1])), statistics


def _standing_off(e_enu_m: Floats, var_differential_m2: Floats) -> Floats:
    """u (E, P, 3); one product after the other, so that it does not depend on E."""
    rows = channels(e_enu_m.shape[1])
    u: Floats = sum(rows[:, j, None] * e_enu_m[:, None, j] for j in range(e_enu_m.shape[1])) / np.sqrt(var_differential_m2)[:, None]
    return u


def _whitened(times: list[int], u: Floats, design: SlowDesign) -> tuple[Floats, Floats]:
    """y (E, P, 3) and k g (E,); `times` and `u` begin with the epoch before, of which a first epoch knows nothing."""
    steps = [t - s if s != NO_EPOCH and 0 < t - s <= BEGIN_ANEW_NS else None for s, t in pairwise(times)]
    a = np.array([0.0 if step is None else _kept(step, design.correlation_s) for step in steps])
    y = (u[1:] - a[:, None, None] * u[:-1]) / np.sqrt(1.0 - a * a)[:, None, None]
    return np.minimum(np.maximum(y, -MOST_SIGMAS), MOST_SIGMAS), design.allowance * np.sqrt((1.0 - a) / (1.0 + a))


def _sums(before: Floats, times: list[int], y: Floats, reference: Floats, most: float) -> Floats:
    """Both sums after each epoch, (E, 2, P, 3)."""
    steps = np.stack((y, -y), axis=1) - reference[:, None, None, None]
    now = np.array(before)
    for e, step in enumerate(steps):
        if times[e] == NO_EPOCH or not 0 < times[e + 1] - times[e] <= BEGIN_ANEW_NS:
            now[:] = 0.0
        now += step
        np.maximum(now, 0.0, out=now)
        np.minimum(now, most, out=now)
        step[:] = now
    return steps


def shifted_receivers(statistics: SlowStatistics, log_likelihood_ratio: Floats, design: SlowDesign, least_log_ratio: float) -> Bools:
    """Who has shifted (E, R), where that is sure; nobody in most epochs that alarm.

    A shift of one receiver and the opposite shift of both others look the same against each other. A receiver is named only if (i) its own
    sum is the largest and exceeds, (ii) that of the pair of the others is below half the threshold, and (iv) it alone being off is as much
    likelier than both others being off alike as `least_log_ratio` says (`triangles.log_likelihood_ratio` of the epoch, (E, R)): it must
    stand far outside the common error, which a small shift never does.
    """
    largest = statistics.own == statistics.own.max(axis=1, keepdims=True)
    exceeds = largest & (statistics.own > design.threshold)
    named: Bools = exceeds & (statistics.pair <= 0.5 * design.threshold) & (log_likelihood_ratio >= least_log_ratio)
    return named
