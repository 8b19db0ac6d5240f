"""Shadow faults of carriers: pasts in which one satellite moves, or its code leaves its carrier, as `carrier_watch` sees them.

Each past is made of copies of the epoch, in which all that is measured stays as it is while the signals are tracked on, and has a memory of
its own. One satellite is at fault at all receivers in all ways that its past can show, by the sizes of the promise (`shadows`):

motion         of 2h + 1 epochs, an interval of the site apart: a ramp, which bends and ends in a step, so that each of the three
               statistics is what its own check must catch
code, carrier  of epochs `SLOWLY_S` apart until filters are warm: code drifts from the carrier, and jumps after all
"""

from dataclasses import replace
from math import ceil, sqrt
from typing import NamedTuple

import numpy as np

from integrity.carrier_thresholds import CARRIER_CHECKS, CODE_CARRIER_CHECKS, MOTION_CHECKS
from integrity.carrier_watch import CarrierMemory, watch
from integrity.copies import copies_of
from integrity.gnss.combination import weights_of
from integrity.gnss.gps_time import NS_PER_S
from integrity.gnss.observations import Floats
from integrity.gnss.positioning import Points
from integrity.limits import Limits
from integrity.monitors.carrier_motion import bend_m2, change_m2
from integrity.monitors.carrier_residuals import Nature, nature
from integrity.monitors.divergence import divergence_m2ps2, innovation_m2
from integrity.satellites import Watched
from integrity.shadows import Turn
from integrity.sight import Sight

SLOWLY_S = 10.0  # no longer: what runs apart by more than `smoothing.MOST_APART_M` from epoch to epoch begins anew
WINDOWS = 5.0  # of divergence: both stages have settled within 5 %
TRACKED_S = 3600.0  # when the past begins


class Seen(NamedTuple):
    """What a check says of the satellite in a column that was put at fault."""

    check: str
    column: int
    statistic: float


def carriers_shown(turn: Turn, watched: tuple[Watched, ...], points: Points, limits: Limits) -> list[Seen]:
    """Of each check that says something of a satellite in use, what it says of one of these that is at fault."""
    used = turn.full.used[turn.e]
    known = {of.check: np.flatnonzero(used & np.isfinite(of.statistic[turn.e])) for of in watched if of.check in CARRIER_CHECKS}
    found = []
    for checks, past in ((MOTION_CHECKS, _moving), (CODE_CARRIER_CHECKS, _leaving)):
        in_all = sorted(set.intersection(*(set(known[check].tolist()) for check in checks)))
        of_any = in_all or sorted({s for check in checks for s in known[check].tolist()})
        if of_any:
            column = turn.among(of_any)
            shown = _shown(past(turn, column, limits), points, limits)
            found += [Seen(check, column, shown[check][column]) for check in checks]
    return found


def _shown(past: Sight, points: Points, limits: Limits) -> dict[str, Floats]:
    """What is watched at the end of a past, (S,) by check."""
    empty = CarrierMemory.empty(len(past.block.receivers), limits.carriers.motion.half_epochs)
    _, watched = watch(empty, past, points, limits.carriers)
    return {of.check: of.statistic[-1 - (of.check == "divergence")] for of in watched}  # a jump may begin it anew


def _moving(turn: Turn, column: int, limits: Limits) -> Sight:
    """A satellite that goes away, range and carrier alike."""
    design, interval_s = limits.carriers.motion, turn.faults.interval_s
    h, natural = design.half_epochs, _nature(turn, column, limits)
    half_s, whole_s, dt_s = (np.full((1, 1, 1), n * interval_s) for n in (h, 2 * h, 1))
    step_m = turn.faults.step * sqrt(change_m2(natural, dt_s, design).item())
    ramp_m = turn.faults.ramp * sqrt(change_m2(natural, whole_s, design).item())
    bend_m = turn.faults.acceleration * sqrt(bend_m2(natural, half_s, design).item())
    end_m = max(ramp_m, step_m, bend_m)
    middle_m = (end_m - bend_m) / 2.0
    x_m = np.interp(np.arange(2 * h + 1), (0, h, 2 * h), (0.0, middle_m, end_m))
    x_m[-2] = min(x_m[-2], end_m - step_m)
    return _past(turn, column, interval_s, x_m, np.zeros(len(x_m)))


def _leaving(turn: Turn, column: int, limits: Limits) -> Sight:
    """A satellite whose code leaves its carrier."""
    design, dt_s = limits.carriers.divergence, SLOWLY_S
    natural, tau_s = _nature(turn, column, limits), design.window_s
    one = np.ones((1, 1, 1))
    rate_mps = turn.faults.divergence * sqrt(divergence_m2ps2(natural, dt_s * one, design).item())
    away_m = turn.faults.innovation * sqrt(innovation_m2(natural, min(dt_s / tau_s, 1.0) * one, tau_s * one).item())
    y_m = rate_mps * dt_s * np.arange(ceil(WINDOWS * tau_s / dt_s) + 1.0)
    y_m[-1] += max(away_m - rate_mps * tau_s, 0.0)
    return _past(turn, column, dt_s, np.zeros(len(y_m)), y_m)


def _past(turn: Turn, column: int, dt_s: float, carrier_m: Floats, code_m: Floats) -> Sight:
    """Copies of the epoch, dt_s apart, in which the carrier of one signal is away by carrier_m (E,), its code by code_m more."""
    n = len(carrier_m)
    of_code, more_m = (np.zeros((n, *turn.sight.at_points.residual_m.shape[1:])) for _ in range(2))
    of_code[:, :, column] = code_m[:, None]
    more_m[:, :, column] = (carrier_m + code_m)[:, None]
    past = copies_of(turn.sight, turn.e, more_m)
    since_s = dt_s * np.arange(n)
    since_ns = (since_s * NS_PER_S).astype(np.int64) - round(since_s[-1] * NS_PER_S)
    block = past.block
    tracked = replace(
        block,
        epoch_ns=block.epoch_ns + since_ns,
        receive_time_ns=block.receive_time_ns + since_ns[:, None],
        pseudorange_m=block.pseudorange_m + of_code,
        lock_s=np.broadcast_to((TRACKED_S + since_s)[:, None, None], block.lock_s.shape),
        slip=np.zeros(block.slip.shape, dtype=np.bool_),
    )
    return replace(past, block=tracked)


def _nature(turn: Turn, column: int, limits: Limits) -> Nature:
    """Of one signal in the epoch."""
    sight, one = turn.sight, slice(column, column + 1)
    e = slice(turn.e, turn.e + 1)
    ionosphere = sight.sky.states.ionosphere
    return nature(
        sight.sky.expected.los_enu[2, e, :, one],
        sight.block.cn0_dbhz[e, :, one],
        ionosphere[e if len(ionosphere) > 1 else slice(1), one],
        np.array([sqrt(sum(weight * weight for weight in weights_of(sight.block.signals[column])))]),
        limits.carriers.errors,
    )
