"""The sigmas and correlation times of a site, measured on its recording: upper bounds and overbounds, for the `[integrity]` table.

e_j = c + d_j (section 2.2 of the notes on ground integrity). The mean over receivers stands for c: its variance is sigma_c^2 +
sigma_d^2 / 3, and is promised whole. (e_j - mean) sqrt(3/2) stands for d_j, each receiver by itself, so that the worst one is covered.
Of both the mean over the recording is taken out and reported: a mean is an error of survey or frame, or what the atmosphere did in
these hours, and never becomes a sigma. What taking it out costs of the variance is given back (`calibrate_statistics.correlation`).
Residuals of satellites are about zero, as the checks are: satellites come and go, and a satellite's mean over a pass is error.

What no recording can show is stated in the text that is written: tails below one in the epochs seen, and another day's ionosphere.
"""

from dataclasses import dataclass
from itertools import pairwise
from math import ceil, exp, floor, log, log10, sqrt
from typing import NamedTuple

import numpy as np

from integrity.config import SiteConfig
from integrity.errors import ConfigError
from integrity.gnss.observations import Floats
from recordings.calibrate_samples import Samples
from recordings.calibrate_statistics import (
    Correlation,
    Size,
    correlation,
    effective_samples,
    mean_bound,
    size,
    tail_scale,
    upper_factor,
)

LEAST_EFFECTIVE = 5.0  # the bound is then 2.1 times the estimate; own choice
LEAST_EFFECTIVE_IN_BIN = 4.0
MOST_LEFT_OUT = 0.1  # of the epochs after start-up: what was refused may have been the tails; own choice
EDGES_DEG = (0.0, 10.0, 15.0, 20.0, 30.0, 45.0, 60.0, 90.0)
AXES = ("east", "north", "up")
LEAST_RANGE_M = 0.01
SURVEY_M = 0.10  # two independent determinations of a point agree within this


class Mean(NamedTuple):
    """Mean displacement in metres, with half the width of its 95 % interval, each east, north, up; `what` it is of."""

    what: str
    mean_m: tuple[float, ...]
    bound_m: tuple[float, ...]

    @property
    def significant(self) -> bool:
        """Whether some axis is off by more than its bound, and by more than points are surveyed to."""
        return any(abs(m) > max(b, SURVEY_M) for m, b in zip(self.mean_m, self.bound_m, strict=True))


class Bin(NamedTuple):
    """Ranges between two elevations: mean of 1 / sin^2 el; standard deviation, its 95 % bound, and from how much."""

    low_deg: float
    high_deg: float
    inverse_sine2: float
    estimate_m: float
    upper_m: float
    samples: int
    effective: float


class Ranges(NamedTuple):
    """sqrt(a^2 + (b / sin el)^2): the model above the bounds of all `bins`, times `stretch`, so that its tails are above those seen."""

    bins: tuple[Bin, ...]
    stretch: float
    a_m: float
    b_m: float


@dataclass(frozen=True)
class Calibration:
    """What was measured: sizes by axis (the worst receiver of differential ones), correlation times, ranges by elevation; `values` are
    what to promise, by key of the site file. `epochs`, `hours` were sound, `left_out` counts the others."""

    values: dict[str, float]
    common: tuple[Size, ...]
    differential: tuple[Size, ...]
    correlation_common: Correlation
    correlation_differential: Correlation
    correlation_range: Correlation
    correlation_range_differential: Correlation
    ranges: Ranges
    differential_ranges: Ranges
    means: tuple[Mean, ...]
    start_ns: int
    end_ns: int
    epochs: int
    hours: float
    left_out: dict[str, int]


def calibrate(found: Samples | None, site: SiteConfig) -> Calibration:
    """Measure; ConfigError where there is too little to say anything, or too much was refused."""
    promises = site.integrity
    if found is None:
        raise ConfigError(
            "nothing to calibrate with: no epoch of the recording is NORMAL without an exclusion; see what `replay` says of it"
        )
    _refuse_many_left_out(found)
    n = len(found.receivers)
    hours = found.taken * found.interval_s / 3600.0
    mean_m = np.nanmean(found.e_enu_m, axis=0)  # (R, 3)
    varying = found.e_enu_m - mean_m
    c = varying.mean(axis=1)
    d = (varying - c[:, None]) * sqrt(n / (n - 1))  # (K, R, 3)

    of_c = correlation(c, found.interval_s, mean_removed=True)
    if of_c is None or effective_samples(float(found.taken), found.interval_s, of_c) < LEAST_EFFECTIVE:
        raise _too_short(hours, promises.correlation_common_s if of_c is None else of_c.upper_s)
    of_d = correlation(_contrasts(varying), found.interval_s, mean_removed=True)
    of_r = correlation(found.range_m.mean(axis=1), found.interval_s, mean_removed=False)
    of_b = correlation(found.range_differential_m.reshape(len(d), -1), found.interval_s, mean_removed=False)
    if of_d is None or of_r is None or of_b is None:
        raise _too_short(hours, promises.correlation_common_s)

    common = tuple(size(c[:, i], found.interval_s, of_c) for i in range(3))
    by_receiver = [[size(d[:, r, i], found.interval_s, of_d) for r in range(n)] for i in range(3)]
    differential = tuple(max(sizes, key=lambda s: s.promised) for sizes in by_receiver)
    shared_m = found.range_m.mean(axis=1, keepdims=True)
    ranges = _ranges(found.range_m, shared_m, found.el_rad, found.interval_s, of_r)
    differential_ranges = _ranges(found.range_differential_m, found.range_differential_m, found.el_rad, found.interval_s, of_b)
    c_h, c_up = _covering([c], [s.promised for s in common], of_c)
    d_h, d_up = _covering([d[:, r] / sqrt(n / (n - 1)) for r in range(n)], [s.promised for s in differential], of_d)
    values = {
        "sigma_common_m": c_h,
        "sigma_common_up_m": c_up,
        "sigma_differential_m": d_h,
        "sigma_differential_up_m": d_up,
        "sigma_range_m": ranges.a_m,
        "sigma_range_low_m": ranges.b_m,
        "sigma_range_differential_m": differential_ranges.a_m,
        "sigma_range_differential_low_m": differential_ranges.b_m,
    }
    times = {
        "correlation_common_s": of_c.lower_s,
        "correlation_differential_s": min(of_d.lower_s, _from_lag_one(of_d, found.interval_s)),
    }
    return Calibration(
        values={k: _up(v) for k, v in values.items()} | {k: _down(v) for k, v in times.items()},
        common=common,
        differential=differential,
        correlation_common=of_c,
        correlation_differential=of_d,
        correlation_range=of_r,
        correlation_range_differential=of_b,
        ranges=ranges,
        differential_ranges=differential_ranges,
        means=_means(found.receivers, mean_m, common, by_receiver, of_c, of_d),
        start_ns=found.start_ns,
        end_ns=found.start_ns + round((len(d) - 1) * found.interval_s * 1e9),
        epochs=found.taken,
        hours=hours,
        left_out=found.left_out,
    )


def _too_short(hours: float, tau_s: float) -> ConfigError:
    needed = LEAST_EFFECTIVE * tau_s / 3600.0
    return ConfigError(
        f"{hours:.2g} h of sound epochs are too little to calibrate with: they hold fewer than {LEAST_EFFECTIVE:.0f} independent samples "
        f"of the common error. What would do: about {max(needed, 1.5 * hours):.2g} h, by a correlation time of {tau_s:.0f} s; better a day"
    )


def _refuse_many_left_out(found: Samples) -> None:
    refused = {reason: count for reason, count in found.left_out.items() if reason != "starting up"}
    total = sum(refused.values())
    if total <= MOST_LEFT_OUT * (found.taken + total):
        return
    listed = ", ".join(f"{count} x {reason}" for reason, count in sorted(refused.items()))
    raise ConfigError(
        f"{total} of {found.taken + total} epochs after start-up are not sound ({listed}): what they leave out may be the tails that are "
        "to be measured. What would do: a window without faults (--from, --to); or, if the sigmas of the site file are too small, larger "
        "ones: --set integrity.sigma_common_m=..."
    )


def _contrasts(varying: Floats) -> Floats:
    """Columns (K, (R - 1) 3) of independent errors of variance sigma_d^2: each receiver against the mean of those before it (Helmert)."""
    columns = []
    for r in range(1, varying.shape[1]):
        against = varying[:, r] - varying[:, :r].mean(axis=1)
        columns.append(against * sqrt(r / (r + 1.0)))
    return np.concatenate(columns, axis=1)


def _covering(parts: list[Floats], promised: list[float], of: Correlation) -> tuple[float, float]:
    """Horizontal and vertical sigma such that the sum over `parts` (K, 3) of squares in sigmas is overbounded as well: the axes of one
    epoch share their satellites, so that a poor geometry stretches all of them at once."""
    horizontal, up = max(promised[:2]), promised[2]
    n = 1 if len(parts) == 1 else len(parts) - 1
    squares = np.stack([sum(p[:, i] ** 2 for p in parts) for i in range(3)], axis=1) / (1.0 - of.mean_share)
    squares = squares[np.isfinite(squares).all(axis=1)]
    flat = (squares[:, 0] + squares[:, 1]) / horizontal**2
    horizontal *= max(1.0, tail_scale(flat, 2 * n, of.lag_one))
    whole = (squares[:, 0] + squares[:, 1]) / horizontal**2 + squares[:, 2] / up**2
    return horizontal, up * max(1.0, tail_scale(whole, 3 * n, of.lag_one))


def _means(
    receivers: tuple[str, ...],
    mean_m: Floats,
    common: tuple[Size, ...],
    by_receiver: list[list[Size]],
    of_c: Correlation,
    of_d: Correlation,
) -> tuple[Mean, ...]:
    """Of the triangle, and of each receiver against the mean of all."""
    whole = mean_m.mean(axis=0)
    n = len(receivers)
    bound_c = tuple(mean_bound(s, of_c) for s in common)
    found = [Mean("the whole triangle", tuple(whole.tolist()), bound_c)]
    for r, name in enumerate(receivers):
        bound_d = tuple(mean_bound(by_receiver[i][r], of_d) * sqrt((n - 1) / n) for i in range(3))
        found.append(Mean(f"receiver {name} against the mean of all", tuple((mean_m[r] - whole).tolist()), bound_d))
    return tuple(found)


def _ranges(x: Floats, tails: Floats, el_rad: Floats, interval_s: float, of: Correlation) -> Ranges:
    """Of ranges (K, R, N); the tails of (K, R or 1, N) are covered: what a check looks at.

    All elevations are stretched alike: in one bin a single large value would make the model as flat as the bin is high.
    """
    bins = _by_elevation(x, el_rad, interval_s, of)
    if not bins:
        raise ConfigError("no satellite was long enough at one elevation to calibrate ranges with: record for longer")
    a2, b2 = _model_over(bins)
    squares = tails**2 / (a2 + b2 / np.sin(el_rad) ** 2)[:, None]
    stretch = max(1.0, *(tail_scale(row[np.isfinite(row)], 1, of.lag_one) for row in np.moveaxis(squares, 1, 0)))
    return Ranges(bins, stretch, max(stretch * sqrt(a2), LEAST_RANGE_M), max(stretch * sqrt(b2), LEAST_RANGE_M))


def _by_elevation(x: Floats, el_rad: Floats, interval_s: float, of: Correlation) -> tuple[Bin, ...]:
    """Sizes between elevations; satellites are independent of each other, receivers of one satellite are not."""
    bins = []
    for low_deg, high_deg in pairwise(EDGES_DEG):
        inside = (el_rad >= np.deg2rad(low_deg)) & (el_rad < np.deg2rad(high_deg)) & np.isfinite(x).all(axis=1)  # (K, N)
        count = inside.sum(axis=0)
        effective = float(effective_samples(count[count > 0].astype(np.float64), interval_s, of).sum())
        if effective >= LEAST_EFFECTIVE_IN_BIN:
            estimate_m = sqrt(float(np.mean(np.moveaxis(x, 1, 0)[:, inside] ** 2)))
            inverse_sine2 = float(np.mean(1.0 / np.sin(el_rad[inside]) ** 2))
            upper_m = estimate_m * upper_factor(effective)
            bins.append(Bin(low_deg, high_deg, inverse_sine2, estimate_m, upper_m, int(count.sum()), effective))
    return tuple(bins)


def _model_over(bins: tuple[Bin, ...]) -> tuple[float, float]:
    """The least a^2, b^2 with a^2 + b^2 / sin^2 el above every bin's bound: least in the sum over bins, at one of the corners of what is
    allowed (a linear programme)."""
    q = np.array([x.inverse_sine2 for x in bins])
    u2 = np.array([x.upper_m**2 for x in bins])
    corners = [(float(u2.max()), 0.0), (0.0, float((u2 / q).max()))]
    for i in range(len(bins)):
        for j in range(i):
            b2 = (u2[i] - u2[j]) / (q[i] - q[j])
            corners.append((float(u2[i] - b2 * q[i]), float(b2)))
    allowed = [(a2, b2) for a2, b2 in corners if a2 >= 0.0 and b2 >= 0.0 and (a2 + b2 * q >= u2 * (1.0 - 1e-9)).all()]
    return min(allowed, key=lambda corner: corner[0] * len(bins) + corner[1] * float(q.sum()))


def _from_lag_one(of: Correlation, interval_s: float) -> float:
    """The time constant that has the correlation from one epoch to the next: what the count of looks goes by."""
    return interval_s / -log(min(max(of.lag_one, exp(-5.0)), 1.0 - 1e-9))


def _up(value: float) -> float:
    return ceil(value * 100.0 - 1e-9) / 100.0


def _down(value: float) -> float:
    """To two significant digits."""
    step = 10.0 ** (floor(log10(value)) - 1)
    return round(floor(value / step + 1e-9) * step, 6)
