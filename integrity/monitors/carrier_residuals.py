"""What carriers show at known points: residuals, how far honest signals move, clocks of receivers taken out of their changes.

A carrier sees what a satellite does hundreds of times finer than the code, but only as change: every statistic made of it is a
difference over time, divided by how far an honest signal may move in that time (`Nature`): noise and multipath, the satellite's clock,
and what the atmosphere adds while the satellite rises or the ionosphere itself changes.

No model of the ionosphere is taken out: its broadcast terms change in steps, may be false, and halve the error at best.
Source: section 2.4 of the project's notes on ground integrity (MQM of GBAS); the error model is our own choice, term by term below.
"""

from functools import lru_cache
from typing import NamedTuple

import numpy as np

from integrity.gnss.carrier.slips import Arcs, Slip
from integrity.gnss.observations import Bools, Floats, Ints, ObservationBlock
from integrity.gnss.range_errors import cn0_variance_m2

SHELL2 = (6378.1363 / (6378.1363 + 350.0)) ** 2  # Earth's radius over that of the ionospheric shell, RTCA DO-229, A.4.4.10.4
CLIMB_RADPS = 1.6e-4  # no satellite climbs faster while the slant still changes: 3.9 km/s at the horizon, 25,800 km away, is 1.5e-4
LOWEST_SINE = 0.05  # 3 deg: below, no model of the atmosphere holds
LEAST_FOR_CLOCK = 3  # of two satellites nobody knows which one stepped
NEAR_SIGMAS = 5.0  # to others of the same clock; those further away do not say what it is
FOUND_BY_US = int(Slip.GEOMETRY_FREE | Slip.DOPPLER)


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
    s = np.maximum(sin_el.min(axis=1), LOWEST_SINE)
    s2 = s * s
    low = 1.0 / s2
    thermal = cn0_variance_m2(cn0_dbhz.min(axis=1), 1.0)
    k2 = noise * noise
    F2 = 1.0 / (1.0 - SHELL2 * (1.0 - s2))
    m2 = 1.002 / (0.002001 + s2)
    turn2 = s2 * (1.0 - s2) * CLIMB_RADPS**2
    of_shell = ((errors.ionosphere_zenith_m * SHELL2) ** 2 * turn2 * F2 * F2 + errors.ionosphere_mps**2) * F2
    parts = (
        k2 * (errors.phase_m**2 + errors.phase_low_m**2 * low + errors.phase_m2hz * thermal),
        k2 * (errors.code_m**2 + errors.code_low_m**2 * low + errors.code_m2hz * thermal),
        ionosphere * ionosphere * of_shell,
        errors.troposphere_zenith_m**2 * turn2 * m2 * m2 * m2,
    )
    return Nature(*(part[:, None] for part in parts))


def carrier_residual_m(block: ObservationBlock, residual_m: Floats, wavelength_m: Floats, ionosphere_m: Floats | float) -> Floats:
    """Residuals of carriers (E, R, S), m: measured minus modelled, receiver clock and ambiguity left in.

    residual_m (E, R, S): those of the ranges (`Prefit`); wavelength_m (E, S); ionosphere_m, broadcast to (E, R, S): the delay that is
    in the expected ranges, which is taken out again. NaN where range or phase was not measured.
    """
    result: Floats = residual_m + (wavelength_m[:, None] * block.carrier_cycles - block.pseudorange_m) + ionosphere_m
    return result


def continuing(arcs: Arcs) -> Bools:
    """Where a phase continues as far as the receiver itself says, (E, R, S).

    A satellite that steps looks like a slip to all receivers: what `find_slips` suspects by Doppler, or between frequencies, is just
    what is monitored here. A slip at one receiver alone is never blamed on the satellite.
    """
    result: Bools = arcs.measured & ((arcs.slip & ~FOUND_BY_US) == 0)
    return result


def going_on(measured: Bools, continues: Bools) -> Bools:
    """Where signals were measured in an epoch and in the one before, and continue, (E, R, S); measured (E + 1, R, S)."""
    result: Bools = continues & measured[1:] & measured[:-1]
    return result


def ages(goes_on: Bools, before: Ints) -> Ints:
    """For how many epochs each signal has continued, (E, R, S); `before` (R, S) up to the block; 0 where an arc begins, or nothing is."""
    if len(goes_on) == 1:
        return np.where(goes_on, before + 1, 0)
    epoch = np.arange(len(goes_on))[:, None, None]
    broken = np.maximum.accumulate(np.where(goes_on, -1, epoch), axis=0)
    result: Ints = epoch - broken + np.where(broken < 0, before, 0)
    return result


class Changes(NamedTuple):
    """Changes of residuals, m, the receiver's clock taken out, and their variances, m2; NaN where nothing can be said."""

    change_m: Floats
    variance_m2: Floats


def without_clocks(change_m: Floats, variance_m2: Floats, system_of: Ints) -> Changes:
    """Changes (..., S) less what their constellation has in common; variance_m2, broadcast to (..., S), of each change itself.

    Common is the weighted mean of all, where all are near it; else of those near the median, and those must be more than half: a
    satellite that steps has no hold on the others. What is in the mean has variance sigma^2 - 1 / W, what is not sigma^2 + 1 / W, W the
    sum of weights. NaN where the constellation has fewer than three, or no majority agrees.
    Sums are made one by one, so that signals which are not seen change no bit.
    """
    groups, place = _constellations(system_of.tobytes())
    known = np.isfinite(change_m)
    both = np.empty((2, *change_m.shape))
    both[0] = np.where(known, 1.0 / variance_m2, 0.0)
    np.multiply(both[0], np.where(known, change_m, 0.0), out=both[1])
    sums, count = np.empty((2, *change_m.shape[:-1], len(groups))), np.empty((*change_m.shape[:-1], len(groups)), dtype=np.int64)
    for k, columns in enumerate(groups):
        sums[..., k] = np.add.accumulate(both[..., columns], axis=-1)[..., -1]
        count[..., k] = np.add.reduce(known[..., columns], axis=-1)
    of_mean_m2 = 1.0 / np.where(count < LEAST_FOR_CLOCK, np.nan, sums[0])
    left_m = change_m - (sums[1] * of_mean_m2).take(place, axis=-1)
    left_m2 = variance_m2 - of_mean_m2.take(place, axis=-1)
    away = left_m * left_m > NEAR_SIGMAS**2 * variance_m2
    if away.any():
        everywhere_m2 = np.broadcast_to(variance_m2, change_m.shape)
        for columns in groups:
            rows = np.nonzero(away[..., columns].any(axis=-1))
            if len(rows[0]):
                few = tuple(axis[:, None] for axis in rows) + (np.arange(len(place))[columns],)
                left_m[few], left_m2[few] = _less_majority(change_m[few], everywhere_m2[few])
    return Changes(left_m, left_m2)


def _less_majority(change_m: Floats, variance_m2: Floats) -> Changes:
    """The same of rows (n, M) with some that are away."""
    known = np.isfinite(change_m)
    count = np.add.reduce(known, axis=-1, keepdims=True)
    median_m = np.take_along_axis(np.sort(change_m, axis=-1), np.maximum(count - 1, 0) // 2, axis=-1)  # NaN last
    off_m = np.where(known, change_m - median_m, np.inf)
    near = off_m * off_m <= NEAR_SIGMAS**2 * variance_m2
    weight = np.where(near, 1.0 / variance_m2, 0.0)
    weighted_m = weight * np.where(near, change_m, 0.0)
    enough = 2 * np.add.reduce(near, axis=-1, keepdims=True) > np.maximum(count, LEAST_FOR_CLOCK - 1)
    of_mean_m2 = 1.0 / np.where(enough, np.add.accumulate(weight, axis=-1)[..., -1:], np.nan)
    mean_m = np.add.accumulate(weighted_m, axis=-1)[..., -1:] * of_mean_m2
    return Changes(change_m - mean_m, np.where(near, variance_m2 - of_mean_m2, variance_m2 + of_mean_m2))


@lru_cache(maxsize=256)
def _constellations(system_of: bytes) -> tuple[tuple[slice | Ints, ...], Ints]:
    """Columns of the signals of each constellation; of each signal its constellation's place among these, (S,)."""
    numbers = np.frombuffer(system_of, dtype=np.int64)
    systems, place = np.unique(numbers, return_inverse=True)
    members = [np.flatnonzero(place == k) for k in range(len(systems))]
    return tuple(slice(m[0], m[-1] + 1) if m[-1] - m[0] + 1 == len(m) else m for m in members), place
