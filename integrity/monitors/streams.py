"""The streams themselves: enough satellites, ranges that move, signals that stay (causes `data` and `jamming`)."""

import numpy as np

from integrity.gnss.observations import Bools, Floats, Ints

CN0_TIME_CONSTANT_S = 300.0  # the baseline follows the slow rise and fall of a satellite
CN0_TIME_CONSTANT_LOW_S = 3600.0  # and hardly moves while the signals are low
CN0_LOW_DB = 3.0


def missing_satellites(used: Bools, needed: int) -> Floats:
    """How many satellites short of `needed` the common set (E, S) is, (E,)."""
    result: Floats = np.maximum(needed - used.sum(axis=-1), 0).astype(np.float64)
    return result


def repeating_receivers(pseudorange_m: Floats, before_m: Floats) -> Bools:
    """Receivers (E, R) all of whose ranges are to the bit those of the aligned epoch before; `before_m` (R, S) precedes the block.

    Satellites move: one equal range is a rare chance, all of them mean that the receiver is frozen.
    """
    before = np.concatenate((before_m[None], pseudorange_m[:-1]))
    seen = np.isfinite(pseudorange_m)
    result: Bools = seen.any(axis=-1) & ((pseudorange_m == before) | ~seen).all(axis=-1)
    return result


def last_seen(seen: Bools, epoch_ns: Ints, before_ns: Ints) -> Ints:
    """When each receiver saw each signal last, up to and including each epoch: (E + 1, R, S), row 0 being `before_ns` (R, S)."""
    times = np.where(seen, epoch_ns[:, None, None], before_ns)
    result: Ints = np.maximum.accumulate(np.concatenate((before_ns[None], times)), axis=0)
    return result


def lost_share(seen: Bools, expected: Bools) -> Floats:
    """Share (E, R) of the expected signals (E, R, S) that a receiver does not see; NaN where fewer than four are expected."""
    count = expected.sum(axis=-1)
    lost = (expected & ~seen).sum(axis=-1)
    result: Floats = np.where(count >= 4, lost / np.maximum(count, 1), np.nan)
    return result


def cn0_drop_db(cn0_dbhz: Floats, recent: Bools, epoch_ns: Ints, baseline_dbhz: Floats, before_ns: int) -> tuple[Floats, Floats]:
    """Mean drop (E, R) of a receiver's C/N0 below its slow baseline, dB, and the baseline (R, S) after the block.

    A signal without a baseline starts one where it is; one that was not seen of late, not `recent` (E, R, S), loses its own. NaN where
    a receiver says nothing of C/N0.
    """
    drop = np.full(cn0_dbhz.shape[:2], np.nan)
    baseline = np.array(baseline_dbhz)
    if np.isnan(cn0_dbhz).all() and np.isnan(baseline).all():
        return drop, baseline
    dt_s = np.diff(epoch_ns, prepend=before_ns) / 1e9
    for e, cn0 in enumerate(cn0_dbhz):
        baseline = np.where(recent[e], baseline, np.nan)
        below = baseline - cn0
        known = np.isfinite(below)
        count = known.sum(axis=-1)
        mean = np.where(known, below, 0.0).sum(axis=-1) / np.maximum(count, 1)
        drop[e] = np.where(count > 0, mean, np.where(np.isfinite(cn0).any(axis=-1), 0.0, np.nan))
        tau_s = np.where(mean > CN0_LOW_DB, CN0_TIME_CONSTANT_LOW_S, CN0_TIME_CONSTANT_S)
        gain = -np.expm1(-dt_s[e] / tau_s)[:, None]
        baseline = np.where(known, baseline - gain * below, np.where(np.isnan(baseline), cn0, baseline))
    return drop, baseline


def second_worst(per_receiver: Floats) -> Floats:
    """The second largest over receivers (E,): what at least two of them show; NaN where fewer than two say anything."""
    ordered = np.sort(np.where(np.isnan(per_receiver), -np.inf, per_receiver), axis=-1)
    result: Floats = np.where(np.isfinite(ordered[:, -2]), ordered[:, -2], np.nan)
    return result
