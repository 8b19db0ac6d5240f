"""Tails of chi-square statistics, and how often a correlated one crosses its threshold.

A statistic here is a sum of squares of `dof` independent first-order Gauss-Markov processes of unit variance, looked at once an
epoch. It exceeds its threshold in alarms: several looks in a row count as one, so that the rate of alarms is
P (1 - P(exceeds at the next look | exceeds)) per look, not P. Alarms come in clusters, since what has just exceeded is near its threshold:
those of one episode have at most a stated number of `clear` looks between them.
"""

from collections.abc import Callable
from math import exp, pi, sqrt

import numpy as np
from scipy.special import chdtrc, chdtri, chndtr, ndtr, ndtri

from integrity.gnss.observations import Floats

_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(48)
_TAIL_FRACTIONS, _TAIL_WEIGHTS = (_NODES + 1.0) / 2.0, _WEIGHTS / 2.0


def gauss_quantile(tail: float) -> float:
    """k with P(x > k) = tail for a standard normal x."""
    return float(-ndtri(tail))


def chi2_quantile(tail: float, dof: int) -> float:
    """T with P(chi2 > T) = tail."""
    return float(chdtri(dof, tail))


def exceeds_again(threshold: float, dof: int, correlation: float) -> float:
    """P(statistic exceeds at the next look | it exceeds now), for the correlation of one component from look to look.

    The next value, given |x|^2 = q, is (1 - a^2) times a noncentral chi-square with noncentrality a^2 q / (1 - a^2); averaged over the
    tail of q by Gauss-Legendre quadrature in its probability. Beyond noncentrality 1e4 the radius is taken as normal.
    """
    a2 = correlation**2
    if a2 <= 0.0:
        return float(chdtrc(dof, threshold))
    q = chdtri(dof, chdtrc(dof, threshold) * _TAIL_FRACTIONS)
    noncentrality = a2 * q / (1.0 - a2)
    x = threshold / (1.0 - a2)
    exact = 1.0 - chndtr(x, float(dof), np.minimum(noncentrality, 1e4))
    mean_radius = np.sqrt(noncentrality) + (dof - 1) / (2.0 * np.sqrt(noncentrality))
    survival: Floats = np.where(noncentrality < 1e4, exact, ndtr(mean_radius - np.sqrt(x)))
    return float((survival * _TAIL_WEIGHTS).sum())


def tail_for_alarm_rate(alarms_per_year: float, looks_per_year: float, dof: int, correlation: float) -> float:
    """The probability P per look for which alarms come at the given rate; between 1e-15 and 0.1."""
    return _tail_for(
        alarms_per_year / looks_per_year, lambda tail: tail * (1.0 - exceeds_again(chi2_quantile(tail, dof), dof, correlation))
    )


def episodes_per_look(tail: float, dof: int, correlation: float, clear: int) -> float:
    """How often per look a statistic exceeds the threshold of `tail` after at least `clear` looks at which it did not; clear >= 1.

    Near its threshold b the length of the vector moves like a random walk: in n looks back by D = b - (dof - 1) / b times 1 - a^n, with
    variance 1 - a^(2 n). Of its alarms, the share that is the last one for n looks is G(y_n) / G(y_1) with

        y_n = D sqrt((1 - a^n) / (1 + a^n)),  G(y) = Phi(y) + phi(y) / y,

    exact in continuous time (excursions of a drifting Brownian motion below a level; for n without bound the rate is f(b) D / tau, that of
    the Poisson clumping heuristic, Aldous 1989) and for n = 1; for walks in between within 2 %, by Spitzer's identity. For n without bound
    the share is the approximation of Siegmund's nu (Siegmund, Yakir 2007, The Statistics of Gene Mapping). Against simulated processes
    within 5 % for P <= 1e-3, dof 1 to 6, time constants of a third of a look to 300 looks.
    """
    b = sqrt(chi2_quantile(tail, dof))
    drift = b - (dof - 1) / b

    def G(looks: int) -> float:
        a = correlation**looks
        y = drift * sqrt((1.0 - a) / (1.0 + a))
        return float(ndtr(y)) + exp(-0.5 * y * y) / (sqrt(2.0 * pi) * y)

    return tail * (1.0 - exceeds_again(b * b, dof, correlation)) * G(clear) / G(1)


def tail_for_episode_rate(episodes_per_year: float, looks_per_year: float, dof: int, correlation: float, clear: int) -> float:
    """The probability P per look for which episodes come at the given rate; between 1e-15 and 0.1."""
    return _tail_for(episodes_per_year / looks_per_year, lambda tail: episodes_per_look(tail, dof, correlation, clear))


def _tail_for(per_look: float, rate: Callable[[float], float]) -> float:
    """Rates are nearly proportional to tails: a dozen steps by their ratio lead to 1e-9."""
    tail = per_look
    for _ in range(12):
        tail = min(max(tail * per_look / rate(tail), 1e-15), 0.1)
    return tail


def detectable_noncentrality(threshold: float, dof: int, missed_detection: float) -> float:
    """Noncentrality of a chi-square statistic that stays below `threshold` with the given probability; bisection, 1e-9 relative."""
    low, high = 0.0, (np.sqrt(threshold) + gauss_quantile(missed_detection) + 5.0) ** 2
    for _ in range(60):
        middle = (low + high) / 2.0
        low, high = (middle, high) if chndtr(threshold, float(dof), middle) > missed_detection else (low, middle)
    return float(high)
