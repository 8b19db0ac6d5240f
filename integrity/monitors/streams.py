"""The streams themselves: enough satellites, ranges that move, signals that stay (causes `data` and `jamming`)."""

from math import expm1

import numpy as np

from integrity.gnss.observations import Bools, Floats, Ints

CN0_TIME_CONSTANT_S = 300.0  # the baseline follows the slow rise and fall of a satellite
CN0_TIME_CONSTANT_LOW_S = 3600.0  # and hardly moves while the signals are low
CN0_LOW_DB = 3.0


def missing_satellites(used: Bools, needed: int) -> Floats:
    """How many satellites short of `needed` the common set (E, S) is, (E,)."""
    result: Floats = np.maximum(needed - np.add.reduce(used, axis=-1), 0).astype(np.float64)
    return result


def repeating_receivers(pseudorange_m: Floats, before_m: Floats) -> Bools:
    """Receivers (E, R) all of whose ranges are to the bit those of the aligned epoch before; `before_m` (R, S) precedes the block.

    Satellites move: one equal range is a rare chance, all of them mean that the receiver is frozen.
    """
    before = np.concatenate((before_m[None], pseudorange_m[:-1]))
    seen = np.isfinite(pseudorange_m)
    result: Bools = np.logical_or.reduce(seen, axis=-1) & np.logical_and.reduce((pseudorange_m == before) | ~seen, axis=-1)
    return result


def last_seen(seen: Bools, epoch_ns: Ints, before_ns: Ints) -> Ints:
    """When each receiver saw each signal last, up to and including each epoch: (E + 1, R, S), row 0 being `before_ns` (R, S)."""
    times = np.where(seen, epoch_ns[:, None, None], before_ns)
    result: Ints = np.maximum.accumulate(np.concatenate((before_ns[None], times)), axis=0)
    return result


def lost_share(seen: Bools, expected: Bools) -> Floats:
    """Share (E, R) of the expected signals (E, R, S) that a receiver does not see; NaN where fewer than four are expected."""
    count = np.add.reduce(expected, axis=-1)
    lost = np.add.reduce(expected & ~seen, axis=-1)
    result: Floats = np.where(count >= 4, lost / np.maximum(count, 1), np.nan)
    return result


def cn0_drop_db(cn0_dbhz: Floats, recent: Bools, epoch_ns: Ints, baseline_dbhz: Floats, before_ns: int) -> tuple[Floats, Floats]:
    """Mean drop (E, R) of a receiver's C/N0 below its slow baseline, dB, and the baseline (R, S) after the block.

    A signal without a baseline starts one where it is; one that was not seen of late, not `recent` (E, R, S), loses its own. NaN where
    a receiver says nothing of C/N0.
    """
    heard = np.logical_or.reduce(np.isfinite(cn0_dbhz), axis=-1)
    baseline = np.array(baseline_dbhz)
    if not heard.any() and np.isnan(baseline).all():
        return np.full(heard.shape, np.nan), baseline
    drop = np.empty(heard.shape)
    for e, cn0 in enumerate(cn0_dbhz):
        dt_s = (int(epoch_ns[e]) - (int(epoch_ns[e - 1]) if e else before_ns)) / 1e9
        baseline = np.where(recent[e], baseline, np.nan)
        below = baseline - cn0
        known = np.isfinite(below)
        drop[e] = np.add.reduce(np.where(known, below, 0.0), axis=-1) / np.maximum(np.add.reduce(known, axis=-1), 1)
        gain = np.where(drop[e] > CN0_LOW_DB, -expm1(-dt_s / CN0_TIME_CONSTANT_LOW_S), -expm1(-dt_s / CN0_TIME_CONSTANT_S))
        step = gain[:, None] * below
        baseline = np.where(known, baseline - step, np.fmax(baseline, cn0))  # one of the two is missing, the other is taken
    drop[~heard] = np.nan
    return drop, baseline


def second_worst(per_receiver: Floats) -> Floats:
    """The second largest over receivers (E,): what at least two of them show; NaN where fewer than two say anything."""
    downwards: Floats = -np.sort(-per_receiver, axis=-1)  # NaN last
    return downwards[:, 1]
