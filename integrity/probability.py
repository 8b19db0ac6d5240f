"""Tails of chi-square statistics, and how often a correlated one crosses its threshold.

A statistic here is a sum of squares of `dof` independent first-order Gauss-Markov processes of unit variance, looked at once an
epoch. It exceeds its threshold in episodes: several looks in a row count as one alarm, so that the rate of alarms is
P (1 - P(exceeds at the next look | exceeds)) per look, not P.
"""

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
    """The probability P per look for which episodes come at the given rate; solved by bisection in log P between 1e-15 and 0.1."""
    low, high = -15.0, -1.0
    for _ in range(50):
        middle = (low + high) / 2.0
        tail = 10.0**middle
        episodes = looks_per_year * tail * (1.0 - exceeds_again(chi2_quantile(tail, dof), dof, correlation))
        low, high = (middle, high) if episodes < alarms_per_year else (low, middle)
    return float(10.0**low)


def detectable_noncentrality(threshold: float, dof: int, missed_detection: float) -> float:
    """Noncentrality of a chi-square statistic that stays below `threshold` with the given probability; bisection, 1e-9 relative."""
    low, high = 0.0, (np.sqrt(threshold) + gauss_quantile(missed_detection) + 5.0) ** 2
    for _ in range(60):
        middle = (low + high) / 2.0
        low, high = (middle, high) if chndtr(threshold, float(dof), middle) > missed_detection else (low, middle)
    return float(high)
