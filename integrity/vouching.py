"""What a train needs of each signal that it may use, beyond its name: which ephemeris is vouched for, what no check would have seen of
its range, what the ground measured. Memoryless."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import sqrt

import numpy as np

from integrity.checks import BlockChecks
from integrity.gnss.ephemeris.broadcast import Ephemeris
from integrity.gnss.ephemeris.content import content_crc32
from integrity.gnss.observations import Bools, Floats, Ints
from integrity.limits import Limits
from integrity.sight import Sight


@dataclass(frozen=True)
class MonitoredSignal:
    """One signal that a train may use, with the ephemeris of this issue and content (`ephemeris.content`).

    `undetected_range_m`: an error of its range as large as this stays below the check of residuals with the probability that the site
    accepts (E_i of section 2.3). `correction_m` is to be added to a range measured now, but for what is common to all signals of the
    constellation; `correction_sigma_m` is what the receivers' own errors leave in it. `b_m`: B-values, in the order of the receivers.
    """

    signal: str
    issue: int
    ephemeris_crc32: int
    undetected_range_m: float
    correction_m: float
    correction_sigma_m: float
    b_m: tuple[float, ...]


def vouched_for(sight: Sight, found: BlockChecks, e: int, limits: Limits) -> tuple[MonitoredSignal, ...]:
    """The signals that decided epoch e of a block."""
    sky, shown = sight.sky, found.satellites
    undetected_m = undetected_range_m(sky.sigma_m[e], shown.scale_m[e, 0], limits.undetected_sigmas)
    return monitored_signals(
        sky.signals,
        found.used[e],
        sky.ephemerides,
        sky.index[e],
        undetected_m,
        shown.known.residual_m[e],
        shown.b_m[e],
        sky.sigma_differential_m[e],
    )


def monitored_signals(
    signals: Sequence[str],
    used: Bools,
    ephemerides: Sequence[Ephemeris],
    index: Ints,
    undetected_range_m: Floats,
    residual_m: Floats,
    b_m: Floats,
    sigma_differential_m: Floats,
) -> tuple[MonitoredSignal, ...]:
    """Of the signals `used` (S,) in one epoch; `index` (S,) into the ephemerides, residuals and B-values (R, S), sigmas (S,).

    A satellite of which nobody can say what would be missed is not vouched for.
    """
    n = len(residual_m)
    columns = np.flatnonzero(used & np.isfinite(undetected_range_m))
    sets = [ephemerides[k] for k in index[columns].tolist()]
    return tuple(
        MonitoredSignal(signals[s], eph.issue, content_crc32(eph), undetected, -residual, sigma, tuple(b))
        for s, eph, undetected, residual, sigma, b in zip(
            columns.tolist(),
            sets,
            undetected_range_m[columns].tolist(),
            (residual_m[:, columns].sum(axis=0) / n).tolist(),
            (sigma_differential_m[columns] / sqrt(n)).tolist(),
            b_m[:, columns].T.tolist(),
            strict=True,
        )
    )


def undetected_range_m(sigma_m: Floats, scale_m: Floats, undetected_sigmas: float) -> Floats:
    """E_i (...) of satellites with range sigmas `sigma_m` (...) whose residuals have the standard deviation `scale_m` (...).

    A range error b leaves b (1 - h) in a residual of standard deviation sigma sqrt(1 - h): sqrt(1 - h) b / sigma of its sigmas, h being
    the satellite's share of its clock. `undetected_sigmas` is the threshold plus the quantile of missed detection (`limits`).
    """
    E: Floats = undetected_sigmas * sigma_m * sigma_m / scale_m
    return E
