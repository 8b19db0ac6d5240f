"""What each satellite does to a solution: its residual's redundancy, and the position without it, of all satellites at once.

Nothing is solved again: with M the inverse of the normal equations, a_i the row and w_i the weight of satellite i, v_i its residual and
h_i = w_i a_i' M a_i its hat value, the solution without it is x - M a_i w_i v_i / (1 - h_i). With the clocks eliminated, the position part
of M a_i is -C (u_i - mean u of its constellation), and h_i = w_i (1 / W + (u_i - mean u)' C (u_i - mean u)).
Source: Sherman, Morrison 1950; Belsley, Kuh, Welsch, Regression Diagnostics, 1980, 2.1; the elimination as in `least_squares`.
"""

from typing import NamedTuple

import numpy as np

from integrity.gnss.least_squares import MOST_PDOP, Design, Solution, Unsolved
from integrity.gnss.observations import Bools, Floats, Ints

LEAST_REDUNDANCY = 1e-9  # below, rounding is larger than what a residual has left of an error


class Shares(NamedTuple):
    """The satellites' parts in a design, before anything is measured; none where a satellite is not used."""

    u: Floats  # (3, E, R, S): unit vectors less the weighted mean of their constellation, `u_i - mean u`
    pull: Floats  # (3, E, R, S): C u, how the position answers to one unit of weighted residual
    redundancy: Floats  # (E, R, S): 1 - h_i, the share of a range's error that its residual shows; NaN where no other range checks it
    gain: Floats  # (E, R, S): w_i / (1 - h_i)
    alone: Bools  # (E, R, S): the only one used of its constellation: it determines a clock, and nothing else; its gain is zero


class WithoutEach(NamedTuple):
    """The solution were satellite i not used: what solving again without it gives, for every i, those included that are not used.

    `e_enu_m` (3, E, R, S), NaN where it cannot be solved; `why` (E, R, S) holds `Unsolved`. Where all satellites together have no solution,
    there is none without one of them either, and the reason is the same.
    """

    e_enu_m: Floats
    why: Ints


def shares(of: Design, los_enu: Floats) -> Shares:
    """The shares of all satellites of a design; `los_enu` (3, E, R, S) as it was designed with."""
    alone: Bools = of.used & (of.n_of == 1.0).take(of.place, axis=-1)
    u = np.where(of.used, los_enu - of.u_mean.take(of.place, axis=-1), 0.0)
    pull = np.einsum("ijer,jers->iers", of.C, u)
    left = 1.0 - of.w * ((1.0 / of.safe).take(of.place, axis=-1) + np.einsum("iers,iers->ers", u, pull))
    redundancy = np.where(of.used & (left > LEAST_REDUNDANCY), left, np.nan)
    return Shares(u, pull, redundancy, np.where(of.used & ~alone, of.w / redundancy, 0.0), alone)


def normalised(of: Design, parts: Shares, postfit_m: Floats) -> Floats:
    """Residuals (E, R, S) after the solution over their standard deviations sigma_i sqrt(1 - h_i); NaN where nothing checks a range.

    Source: Baarda 1968 (the w-test).
    """
    result: Floats = postfit_m * np.sqrt(of.w / parts.redundancy)
    return result


def without_each(of: Design, parts: Shares, found: Solution, postfit_m: Floats) -> WithoutEach:
    """Positions without each satellite, from the solution and its residuals (E, R, S)."""
    step = parts.gain * np.where(of.used, postfit_m, 0.0)
    why = _why(of, parts)
    if why.any():
        step[why != Unsolved.SOLVED] = np.nan
    return WithoutEach(parts.pull * step + found.e_enu_m.transpose(2, 0, 1)[..., None], why)


def separation_sigma_m(parts: Shares) -> Floats:
    """Standard deviation (3, E, R, S), east, north, up, of the position without satellite i less that with it, when the sigmas are right.

    Its variance is that of the former less that of the latter: pull^2 w_i / (1 - h_i). NaN where there is no position without it.
    Source: Blanch et al. 2012, Advanced RAIM user algorithm description, section 5.
    """
    result: Floats = np.abs(parts.pull) * np.sqrt(parts.gain)
    return result


def _why(of: Design, parts: Shares) -> Ints:
    """`Unsolved` without each satellite, by the rules of `least_squares.design`."""
    n_clocks = (of.n_of > 0.0).sum(axis=-1)
    with np.errstate(invalid="ignore"):
        trace = np.einsum("iers,iers->ers", parts.pull, parts.pull) * parts.gain + (of.C[0, 0] + of.C[1, 1] + of.C[2, 2])[..., None]
        weight_limit = MOST_PDOP**2 * np.maximum(of.n_used - 1, 1)  # one satellite less: a mean over n - 1
        poor = ~(trace * (of.w.sum(axis=-1)[..., None] - of.w) <= weight_limit[..., None])
    why: Ints = poor * np.int64(Unsolved.POOR_GEOMETRY)
    tight = of.n_used == 3 + n_clocks
    if tight.any():
        why[tight[..., None] & ~parts.alone] = Unsolved.TOO_FEW_SATELLITES
    solved = (of.why == Unsolved.SOLVED)[..., None]
    return np.where(of.used & solved, why, of.why[..., None])
