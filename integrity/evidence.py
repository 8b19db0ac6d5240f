"""What an epoch that is not clean has to say beyond its checks: who may be named, who hears one transmitter, who stands on whose point."""

import numpy as np

from integrity.checks import BlockChecks
from integrity.deciding import Decided, Place
from integrity.exclusion import Exclusion
from integrity.gnss.observations import Bools
from integrity.limits import Limits
from integrity.monitors.common_motion import is_displaced
from integrity.monitors.single_differences import PairStatistics, captured, captured_receivers
from integrity.monitors.triangles import swapped_receivers
from integrity.naming import LastClean, named_receiver, stands_elsewhere
from integrity.verdict import Evidence


def evidence_of(decided: Decided, e: int, exclusions: tuple[Exclusion, ...], last: LastClean | None, place: Place) -> Evidence:
    """Of epoch e of a block; `last` is the clean epoch before it."""
    full, limits = decided.full, place.limits
    return Evidence(
        receivers=place.site.receiver_names,
        repeating=decided.streams.repeating[e],
        short=_short(decided, e, exclusions, limits),
        named=_named(decided, e, last, place),
        collapsed=bool(full.naming.collapse_fit[e] <= limits.collapse_fit),
        captured=_captured(full, e, limits),
        displaced=_displaced(decided, e, limits),
        fed=decided.around.heard.fed[e] > limits["told"],
        exclusions=exclusions,
        acute=tuple(x for x in exclusions if x.is_acute(int(decided.sight.block.epoch_ns[e]), limits)),
        enough_without_exclusion=bool(decided.alone.solution.n_used[e].min() >= limits.min_common_satellites),
        swapped=swapped_receivers(full.solution.e_enu_m[e], place.triangle, limits),
    )


def _short(decided: Decided, e: int, exclusions: tuple[Exclusion, ...], limits: Limits) -> Bools:
    """The receiver (R,) without which the others would share enough satellites; none where that is so of several, or of none."""
    sight = decided.sight
    satellites = np.array(sight.block.satellites)
    wanted = sight.sky.in_view[e] & ~np.isin(satellites, [x.satellite for x in exclusions])
    measured = np.isfinite(sight.at_points.residual_m[e]) & wanted
    shared = [len(np.unique(satellites[np.delete(measured, r, axis=0).all(axis=0)])) for r in range(len(measured))]
    enough = np.array(shared) >= limits.min_common_satellites
    short: Bools = enough & (enough.sum() == 1)
    return short


def _named(decided: Decided, e: int, last: LastClean | None, place: Place) -> Bools:
    """The receiver (R,) that may be named, if any."""
    full, of, limits = decided.full, decided.sight.satellites.epoch(e), place.limits
    ratio, gps_ns = full.naming.log_likelihood_ratio[e], int(decided.sight.block.epoch_ns[e])
    variances, promises = (full.var.common[e], full.var.differential[e]), place.site.integrity
    named = named_receiver(decided.suspected[e], ratio, full.solution.e_enu_m[e], *variances, last, gps_ns, promises, limits)
    if not named.any():
        return named
    used = full.used[e : e + 1]
    return named & stands_elsewhere(of.los_enu, of.prefit_m, of.sigma_differential_m, used, of.system_of, of.n_systems, limits)


def _displaced(decided: Decided, e: int, limits: Limits) -> bool:
    """Whether ranges, or carriers that moved, are those of a triangle that is dragged away."""
    used = decided.full.used[e : e + 1]
    of = decided.sight.satellites.epoch(e)
    by_carrier = any(w.everything is not None and w.everything[0] and (w.exceeds & used).any() for w in of.watched)
    return by_carrier or bool(is_displaced(of.measured(used), limits.log_likelihood_ratio)[0])


def _captured(full: BlockChecks, e: int, limits: Limits) -> Bools:
    """Receivers (R,) of the pairs that hear one transmitter: those of them that are off, since one at its own point may be what the other
    is drawn to; all where none is."""
    collapse, misfit, separation, dof = full.pairs
    one = slice(e, e + 1)
    of_epoch = PairStatistics(collapse[one], misfit[one], separation[one], dof[one])
    pairs = captured(of_epoch, limits["capture"], limits.least_separation, limits.missed_detection)
    circle_m = full.triangle.circle_m[e]
    receivers: Bools = captured_receivers(pairs, len(circle_m))[0]
    off = receivers & ~(circle_m <= limits.radius_m)
    return off if np.any(off) else receivers
