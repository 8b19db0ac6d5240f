"""What is asked of a block beside positions: whether its ranges fit together and which do not, velocities, the residual of every range.

Tests are linear at points; a receiver that is far from the block's point, or was thought to be because of a fault, is looked at again from
where it is.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from integrity.gnss.detection import MOST_SATELLITES, Checked, Criteria, Finding, detect_and_exclude, normalised_outside
from integrity.gnss.least_squares import Solution, design, postfit_m, solution
from integrity.gnss.leave_one_out import normalised, shares, without_each
from integrity.gnss.observations import Bools, Floats, Ints
from integrity.gnss.positioning import RELINEARISE_BEYOND_M, Points, points_at
from integrity.gnss.range_errors import rate_sigma_mps
from integrity.gnss.signals import TIME_SCALES
from integrity.gnss.suspects import without_suspects
from integrity.gnss.velocity import rates_mps, velocity_design, wavelengths_m
from recordings.solve.results import Motion, Names, Place, Ranges, Tested, Track, Why
from recordings.solve.sky import Seen, Sky, View

MOST_VIEWS = 3  # the first, that from where all satellites say the receiver is, that from where the good ones do
NEAR_FOR_RATES_M = 10.0  # 0.2 mm/s a metre
WHY_OF = {
    Finding.UNEXPLAINED: Why.UNEXPLAINED,
    Finding.AMBIGUOUS: Why.AMBIGUOUS,
    Finding.TOO_MANY: Why.TOO_MANY,
    Finding.UNVERIFIED: Why.UNVERIFIED,
}


class _Verdict(NamedTuple):
    """A solution from a view; `checked` if tests were asked for, `excluded` (E, R, S) by them."""

    found: Solution
    excluded: Bools
    checked: Checked | None


def detailed(
    track: Track,
    seen: Seen,
    view: View,
    seen_from: Callable[[Points], View],
    criteria: Criteria | None,
    velocity: bool,
    ranges: bool,
    sky: Sky,
) -> Track:
    """The track with what was asked for. A position stays as it is, to the bit, unless a range was excluded; where the tests found a fault
    and not which range has it, there is none."""
    view, verdict = _settled(track, view, seen_from, criteria, NEAR_FOR_RATES_M if velocity else RELINEARISE_BEYOND_M)
    if verdict.checked is not None:
        track = _tested(track, seen, view, verdict, verdict.checked, criteria)
    if velocity:
        track = track._replace(motion=_motion(track, seen, view, verdict, criteria, sky))
    return track._replace(ranges=_ranges(seen, view, verdict)) if ranges else track


def _settled(
    track: Track, view: View, seen_from: Callable[[Points], View], criteria: Criteria | None, within_m: float
) -> tuple[View, _Verdict]:
    """The block from points that are near every receiver: from the first view, if it is, else from where it says the receiver is, without
    what it excludes; if that is far from the first, from where all satellites say."""
    here_m = np.broadcast_to(view.points.pos_ecef_m[:, 0], track.pos_ecef_m.shape)
    verdict = _judged(view, criteria)
    moved_m = _positions(view, verdict.found)
    near = np.all(np.abs(moved_m - here_m) <= RELINEARISE_BEYOND_M, axis=1)
    target_m = np.where(near[:, None], moved_m, track.pos_ecef_m)
    for _ in range(MOST_VIEWS - 1):
        away: Bools = np.any(np.abs(target_m - here_m) > within_m, axis=1)  # False where it is nowhere
        if not away.any():
            break
        here_m = np.where(away[:, None], target_m, here_m)
        view = seen_from(points_at(here_m[:, None]))
        verdict = _judged(view, criteria)
        target_m = _positions(view, verdict.found)
    return view, verdict


def _judged(view: View, criteria: Criteria | None) -> _Verdict:
    if criteria is None:
        return _Verdict(solution(view.of, view.first.residual_m), np.zeros(view.of.used.shape, dtype=np.bool_), None)
    ranges = view.of, view.first.los_enu, view.first.residual_m
    checked = without_suspects(detect_and_exclude(*ranges, criteria), *ranges, criteria)
    return _Verdict(checked.found, checked.excluded, checked)


def _positions(view: View, found: Solution) -> Floats:
    """ECEF (E, 3), NaN where unsolved."""
    enu = np.broadcast_to(view.points.enu[:, 0], (len(found.why), 3, 3))
    pos_ecef_m: Floats = view.points.pos_ecef_m[:, 0] + np.einsum("eji,ej->ei", enu, found.e_enu_m[:, 0])
    return pos_ecef_m


def _tested(track: Track, seen: Seen, view: View, verdict: _Verdict, checked: Checked, criteria: Criteria | None) -> Track:
    assert criteria is not None
    finding = checked.finding[:, 0]
    excluded = finding == Finding.EXCLUDED
    why = track.why.copy()
    for of, said in WHY_OF.items():
        why[(finding == of) & track.solved] = said
    why[excluded] = Why.SOLVED  # also where with all of them it was not
    n_left = verdict.found.n_used[:, 0]
    limits = (
        criteria.chi2[np.clip(checked.dof[:, 0], 0, MOST_SATELLITES)],
        criteria.largest[np.minimum(n_left, MOST_SATELLITES)],
    )
    statistics = checked.chi2[:, 0], checked.largest[:, 0]
    chi2_limit, largest_limit = (np.where(np.isnan(x), np.nan, limit) for x, limit in zip(statistics, limits, strict=True))
    pos_ecef_m = np.where(excluded[:, None], _positions(view, verdict.found), track.pos_ecef_m)
    pos_ecef_m[why != Why.SOLVED] = np.nan
    satellites = seen.block.satellites
    tested = Tested(
        finding,
        _names(checked.excluded[:, 0], satellites),
        _names(checked.suspects[:, 0], satellites),
        statistics[0],
        chi2_limit,
        statistics[1],
        largest_limit,
    )
    return Track(track.time_ns, pos_ecef_m, np.where(excluded, n_left, track.n_used), why, tested=tested)


def _names(chosen: Bools, satellites: tuple[str, ...]) -> Names:
    """Satellites (S,) chosen in each epoch (E, S), with blanks between."""
    names = [""] * len(chosen)
    for e in np.flatnonzero(chosen.any(axis=1)).tolist():
        names[e] = " ".join(satellites[s] for s in np.flatnonzero(chosen[e]))
    return np.array(names, dtype=np.str_)


def _motion(track: Track, seen: Seen, view: View, verdict: _Verdict, criteria: Criteria | None, sky: Sky) -> Motion:
    """Velocities by the satellites that the position is from, in epochs that have one; with their own tests, if there are tests."""
    channel = sky.store.ephemerides.channel[seen.ephemeris]
    rate_mps = rates_mps(seen.block, view.sight, wavelengths_m(seen.block.signals, channel))
    used = view.of.used & ~verdict.excluded & np.isfinite(rate_mps) & track.solved[:, None, None]
    of = velocity_design(view.first.los_enu, rate_sigma_mps(view.first.el_rad), used)
    if criteria is None:
        found, good = solution(of, rate_mps), np.ones(len(track.why), dtype=np.bool_)
    else:
        checked = detect_and_exclude(of, view.first.los_enu, rate_mps, criteria)
        found, good = checked.found, checked.finding[:, 0] <= Finding.UNCHECKED
    good = good & found.solved[:, 0]
    variance = np.einsum("eii->ei", found.cov_enu_m2[:, 0])
    drift_m2 = 1.0 / of.safe[:, 0, 0] + np.einsum("ie,eij,je->e", of.u_mean[:, :, 0, 0], found.cov_enu_m2[:, 0], of.u_mean[:, :, 0, 0])
    values = found.e_enu_m[:, 0], np.sqrt(variance), found.clock_m[:, 0, 0], np.sqrt(drift_m2)
    v, sigma, drift, drift_sigma = (np.where(good.reshape(-1, *[1] * (x.ndim - 1)), x, np.nan) for x in values)
    return Motion(v, sigma, drift, drift_sigma, np.where(good, found.n_used[:, 0], 0))


def _ranges(seen: Seen, view: View, verdict: _Verdict) -> Ranges:
    measured = np.isfinite(seen.block.pseudorange_m[:, 0])
    allowed = view.of.used
    of, found = view.of, verdict.found
    if verdict.excluded.any():
        of = design(view.first.los_enu, view.sigma_m, allowed & ~verdict.excluded, seen.system_of, len(TIME_SCALES))
    left_m = postfit_m(view.first.residual_m, view.first.los_enu, found, seen.system_of)
    parts = shares(of, view.first.los_enu)
    w = np.where(of.used, normalised(of, parts, left_m), normalised_outside(of, view.first.los_enu, view.sigma_m, left_m))
    without = without_each(of, parts, found, left_m).e_enu_m - found.e_enu_m.transpose(2, 0, 1)[..., None]
    unusable = ~seen.usable | ~np.isfinite(view.first.residual_m[:, 0])
    place: Ints = np.select(
        [~measured, verdict.excluded[:, 0], allowed[:, 0], unusable],
        [-1, Place.EXCLUDED, Place.USED, Place.UNUSABLE],
        Place.BELOW_MASK,
    )
    return Ranges(
        seen.block.epoch_ns,
        seen.block.signals,
        place,
        view.first.el_rad[:, 0],
        view.first.az_rad[:, 0],
        left_m[:, 0],
        np.broadcast_to(view.sigma_m, measured[:, None].shape)[:, 0],
        w[:, 0],
        np.where(of.used, without, np.nan)[:, :, 0],
    )
