"""How large correlated errors are, from a stretch of them: standard deviations with upper bounds, correlation times, overbounds of tails.

A series is (K, N): N columns of one kind of error, each of its own size, on a regular grid of epochs, NaN where there is none. The model
behind every bound is a stationary process that forgets with one correlation time tau (1/e), first-order Gauss-Markov where a formula is
needed: the mean over T has variance sigma^2 g(T / tau), a sample variance the relative variance 2 g(2 T / tau), with
g(n) = 2 (n - 1 + exp(-n)) / n^2 (section 2.5 of the notes on ground integrity). So T holds 1 / g(T / tau) independent samples for a mean
and nu = 1 / g(2 T / tau) for a variance: 12 h of errors with tau = 3000 s about 7 and 15.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.special import chdtri, stdtrit

from integrity.gnss.observations import Floats
from integrity.probability import tail_for_alarm_rate

CONFIDENCE = 0.95
LONGEST_LAG_SHARE = 0.4  # of the record: beyond, too few pairs
LARGEST_TAIL = 0.3  # overbounding looks at tails, not at the middle


class Correlation(NamedTuple):
    """`tau_s`: 1/e time, and `lower_s`, `upper_s`: bounds of 95 % each (the upper one of 90 % below 30 correlation times); `lag_one`:
    correlation from epoch to epoch; `mean_share`: g(T / tau), the share of the variance that the mean over the record takes; `integral_s`:
    the time that counts for variances, at least tau."""

    tau_s: float
    lower_s: float
    upper_s: float
    lag_one: float
    mean_share: float
    integral_s: float


@dataclass(frozen=True)
class Size:
    """A standard deviation: `estimate`, upper bound of 95 %, overbound of the empirical tails; from how much."""

    estimate: float
    upper: float
    overbound: float
    epochs: int
    hours: float
    effective: float

    @property
    def promised(self) -> float:
        """What may be promised: the larger of both bounds."""
        return max(self.upper, self.overbound)


def mean_variance_share(n: Floats | float) -> Floats:
    """g(n): variance of the mean of a Gauss-Markov process over n correlation times, in variances."""
    n = np.maximum(n, 1e-3)
    share: Floats = 2.0 * (n + np.expm1(-n)) / (n * n)
    return share


def autocovariance(x: Floats) -> tuple[Floats, Floats]:
    """Mean lagged products (L,) over all columns, each scaled to unit mean square, and the number of pairs (L,); no mean is removed."""
    x = x[:, np.isfinite(x).any(axis=0)]
    known = np.isfinite(x)
    size = np.sqrt(np.nanmean(x * x, axis=0))
    z = np.where(known, x / np.where(size > 0.0, size, 1.0), 0.0)
    n_lags = max(2, int(LONGEST_LAG_SHARE * len(x)))
    n_fft = 1 << (len(x) + n_lags).bit_length()

    def lagged(values: Floats) -> Floats:
        total = np.zeros(n_lags)
        for column in values.T:
            total += np.fft.irfft(np.abs(np.fft.rfft(column, n_fft)) ** 2, n_fft)[:n_lags]
        return total

    pairs = np.round(lagged(known.astype(np.float64)))
    return lagged(z) / np.maximum(pairs, 1.0), pairs


def correlation(x: Floats, interval_s: float, mean_removed: bool) -> Correlation | None:
    """Correlation times of a series; None where it is too short to show one.

    Where the mean was removed, the covariance at every lag is too small by the variance of that mean: rho_hat = (rho - g) / (1 - g).
    The 1/e time is where rho_hat falls to (1/e - g(T / tau)) / (1 - g(T / tau)), g for that very time. Its own uncertainty, relative,
    1.6 sqrt(2 tau / (T N)) (the factor by simulation, 8 to 100 correlation times).
    """
    rho, pairs = autocovariance(x)
    if not rho[0] > 0.0:
        return None  # no errors at all
    rho = rho / rho[0]
    lag_s = interval_s * np.arange(len(rho))
    span_s = interval_s * np.isfinite(x).sum(axis=0).max()
    with np.errstate(divide="ignore", over="ignore"):
        g = mean_variance_share(span_s / np.maximum(lag_s, 1e-9)) if mean_removed else np.zeros(len(rho))
    below = np.flatnonzero((rho <= (np.exp(-1.0) - g) / (1.0 - g)) & (pairs > 0))
    if not len(below):
        return None
    k = int(below[0])
    f = (np.exp(-1.0) - g[k]) / (1.0 - g[k])
    tau_s = max(float(lag_s[k - 1]) + interval_s * _part_of_the_way(float(rho[k - 1]), float(rho[k]), float(f)), 0.2 * interval_s)
    share = float(mean_variance_share(span_s / tau_s)) if mean_removed else 0.0
    true_rho = rho * (1.0 - share) + share
    end = int(np.argmax(true_rho <= 0.0)) or len(rho)
    end = min(end, int(5.0 * tau_s / interval_s) + 2)
    integral_s = interval_s * (2.0 * float((true_rho[:end] ** 2).sum()) - 1.0)
    spread = 1.6 * 1.645 * np.sqrt(2.0 * tau_s / (interval_s * np.isfinite(x).sum()))
    return Correlation(
        tau_s=tau_s,
        lower_s=tau_s * float(np.exp(-spread)),
        upper_s=tau_s * float(np.exp(spread)),
        lag_one=float(true_rho[1]),
        mean_share=share,
        integral_s=max(integral_s, tau_s),
    )


def _part_of_the_way(above: float, below: float, level: float) -> float:
    """Where between two lags a correlation falls to a level: as an exponential does, or straight where that is none."""
    if min(below, level) > 0.0:
        return float(np.log(above / level) / np.log(above / below)) if above > below else 0.0
    return (above - level) / max(above - below, 1e-12)


def effective_samples(epochs: Floats | float, interval_s: float, of: Correlation) -> Floats:
    """nu of epochs in a row, not more than there are epochs; the correlation time is taken larger by most of the way to its upper bound.

    With it, bounds from series of 10 to 1000 correlation times cover the truth in 94 to 98 % (by simulation).
    """
    tau_s = of.integral_s * (of.upper_s / of.tau_s) ** 0.75
    nu: Floats = np.minimum(1.0 / mean_variance_share(2.0 * np.asarray(epochs) * interval_s / tau_s), np.maximum(epochs, 1.0))
    return nu


def upper_factor(effective: float) -> float:
    """By how much a standard deviation from so many independent samples may be too small: sqrt(nu / chi2), chi2 at 5 %."""
    return float(np.sqrt(effective / chdtri(effective, CONFIDENCE)))


def size(column: Floats, interval_s: float, of: Correlation) -> Size:
    """Of one column (K,) that is about zero, its mean removed if `of` says so."""
    known = column[np.isfinite(column)]
    n = len(known)
    effective = float(effective_samples(float(n), interval_s, of))
    estimate = float(np.sqrt(np.mean(known**2) / (1.0 - of.mean_share)))
    return Size(
        estimate,
        estimate * upper_factor(effective),
        tail_scale(known**2, 1, of.lag_one) / float(np.sqrt(1.0 - of.mean_share)),
        n,
        n * interval_s / 3600.0,
        effective,
    )


def tail_scale(squares: Floats, dof: int, lag_one: float) -> float:
    """The smallest factor on a sigma with which no tail of a statistic exceeds that of chi-square; `squares` (n,) sums of `dof` squares in
    units of that sigma.

    Looked at: tails from 0.3 down to the one that n correlated epochs reach once on average (`probability.tail_for_alarm_rate`), where the
    largest value must lie. A zero-mean Gaussian stretched so is a symmetric overbound of the empirical distribution (DeCleene 2000, ION
    GPS; sums of errors stay overbounded if these are symmetric and unimodal). Further out nothing was seen: that the Gaussian holds
    there is the promise. Rife's paired overbound (2004, with mean) is not used: the checks are about zero. Own choice of levels.
    """
    n = len(squares)
    down = np.sort(squares)[::-1]
    tail = np.arange(1, n + 1) / n
    least = tail_for_alarm_rate(1.0, float(n), dof, min(max(lag_one, 0.0), 0.999999))
    looked = (tail >= least) & (tail <= LARGEST_TAIL)
    ratio = float(down[0] / chdtri(dof, least))
    return float(np.sqrt(max(ratio, float((down[looked] / chdtri(dof, tail[looked])).max(initial=0.0)))))


def mean_bound(of: Size, correlation_of: Correlation) -> float:
    """Half the width of the 95 % interval of a mean whose errors have this size."""
    share = float(mean_variance_share(of.hours * 3600.0 / correlation_of.upper_s))
    return of.estimate * float(np.sqrt(share)) * float(stdtrit(of.effective, 0.5 + CONFIDENCE / 2.0))
