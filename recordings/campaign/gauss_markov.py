"""Correlated errors over years: exact first-order Gauss-Markov processes on a coarse grid, and every epoch where it matters.

A statistic that is far below its threshold at both ends of a few seconds has not crossed it in between: with a grid of a third of the
shorter time constant, and `CANDIDATE` of the threshold, one crossing in 100,000 is lost. So a process is drawn at the grid's points by its
exact recursion, and the epochs between two points only where a statistic comes near its threshold, given both ends: a path drawn freely
from the first end, plus what bends it to the second (Gaussian bridge; exact, since covariance with the far end decides the bend).
"""

from math import exp, expm1, sqrt
from typing import NamedTuple

import numpy as np
from scipy.signal import lfilter

from integrity.gnss.observations import Floats

GRID_OF_TAU = 1.0 / 3.0
CANDIDATE = 0.6  # of the threshold, both in sigmas


class Grid(NamedTuple):
    """`per_step` epochs of `interval_s` to a step."""

    interval_s: float
    per_step: int


def grid(interval_s: float, shortest_tau_s: float) -> Grid:
    """Steps of about a third of the shortest time constant, at least an epoch."""
    return Grid(interval_s, max(1, int(GRID_OF_TAU * shortest_tau_s / interval_s)))


def coarse(of: Grid, tau_s: float, shape: tuple[int, ...], rng: np.random.Generator) -> Floats:
    """Processes of unit variance along the last axis of `shape`, at the grid's points."""
    x = rng.standard_normal(shape)
    a = _kept(of.per_step, of, tau_s)
    x[..., 1:] *= sqrt(1.0 - a * a)
    path: Floats = lfilter([1.0], [1.0, -a], x, axis=-1)
    return path


def between(of: Grid, tau_s: float, first: Floats, last: Floats, rng: np.random.Generator) -> Floats:
    """All epochs from one grid point to the next, (..., per_step + 1), given the values (...) of processes at both; both included."""
    m = of.per_step
    a = _kept(1, of, tau_s)
    free = rng.standard_normal((*first.shape, m + 1)) * sqrt(1.0 - a * a)
    free[..., 0] = first
    free = lfilter([1.0], [1.0, -a], free, axis=-1)
    j = np.arange(m + 1)
    bend = np.exp(-(m - j) * of.interval_s / tau_s) * np.expm1(-2.0 * j * of.interval_s / tau_s) / expm1(-2.0 * m * of.interval_s / tau_s)
    path: Floats = free + bend * (last - free[..., m])[..., None]
    path[..., m] = last  # to the last bit
    return path


def _kept(epochs: int, of: Grid, tau_s: float) -> float:
    return exp(-epochs * of.interval_s / tau_s)
