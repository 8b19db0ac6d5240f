"""A few satellites, or everything? What moves all receivers alike, a counterfeit sky that is dragged away, lies in the ranges of all
satellites, and the first that exceed a threshold are innocent.

Two explanations of the same ranges, or changes of carriers, of one epoch, a clock of each constellation solved for in both:

    D   all satellites are right, and the triangle was displaced: misfit chi2_D
    F   the triangle stands, and these few satellites are wrong: misfit chi2_F of the others

A satellite may be named where F is over a thousand times likelier than D, (chi2_D - chi2_F) / 2 > ln 1000, as rule (iv) of naming has it
for receivers (section 2.2). Where D leaves no more than noise, it is the explanation. In between nobody knows.
"""

from typing import NamedTuple

import numpy as np

from integrity.gnss.least_squares import design, postfit_m, solution
from integrity.gnss.observations import Bools, Floats, Ints
from integrity.probability import chi2_quantile

MISFIT = 1e-3  # noise leaves more in one case of a thousand; own choice


class Measured(NamedTuple):
    """Of all receivers together: `moved_m` (E, S), ranges less what is expected of them, or changes of that; `towards` (3, E, S),
    directions; `sigma_m` (E, S); `among` (E, S), which count; constellations."""

    moved_m: Floats
    towards: Floats
    sigma_m: Floats
    among: Bools
    system_of: Ints
    n_systems: int


def displaced(of: Measured) -> tuple[Floats, Ints]:
    """chi2_D (E,), NaN where the satellites give no position, and its degrees of freedom."""
    towards, one = of.towards[:, :, None], of.moved_m[:, None]
    position = design(towards, of.sigma_m[:, None], of.among[:, None], of.system_of, of.n_systems)
    found = solution(position, one)
    left_m = np.where(position.used, postfit_m(one, towards, found, of.system_of), 0.0)
    misfit = np.add.reduce(position.w * left_m * left_m, axis=-1)
    dof = found.n_used - 3 - (position.n_of > 0).sum(axis=-1)
    return np.where(found.solved, misfit, np.nan)[:, 0], np.maximum(dof, 0)[:, 0]


def standing(of: Measured, but: Bools) -> Floats:
    """chi2_F (E,), of all but these satellites (E, S)."""
    w = np.where(of.among & ~but, 1.0 / (of.sigma_m * of.sigma_m), 0.0)
    x = np.where(w > 0.0, of.moved_m, 0.0)
    misfit = np.zeros(len(x))
    for k in range(of.n_systems):
        of_k = np.where(of.system_of == k, w, 0.0)
        weight = np.add.reduce(of_k, axis=-1)
        clock = np.add.reduce(of_k * x, axis=-1) / np.where(weight > 0.0, weight, 1.0)
        misfit += np.add.reduce(of_k * (x - clock[:, None]) ** 2, axis=-1)
    return misfit


def may_be_named(of: Measured, suspects: Bools, log_likelihood_ratio: float) -> Bools:
    """Epochs (E,) in which nothing but a fault of the suspects (E, S) explains what was measured."""
    return _named(displaced(of)[0], of, suspects, log_likelihood_ratio)


def is_displaced(of: Measured, log_likelihood_ratio: float) -> Bools:
    """Epochs (E,) in which a displacement explains everything that was measured, and nothing else does."""
    return _moved(*displaced(of), of, log_likelihood_ratio)


def named_or_moved(of: Measured, suspects: Bools, log_likelihood_ratio: float) -> tuple[Bools, Bools]:
    """Both, (E,) each."""
    misfit, dof = displaced(of)
    return _named(misfit, of, suspects, log_likelihood_ratio), _moved(misfit, dof, of, log_likelihood_ratio)


def _named(misfit: Floats, of: Measured, suspects: Bools, log_likelihood_ratio: float) -> Bools:
    named: Bools = 0.5 * (misfit - standing(of, suspects)) > log_likelihood_ratio
    return named


def _moved(misfit: Floats, dof: Ints, of: Measured, log_likelihood_ratio: float) -> Bools:
    noise = np.array([chi2_quantile(MISFIT, n) if n else 0.0 for n in dof.tolist()])
    moved: Bools = (misfit <= noise) & (0.5 * (standing(of, np.zeros_like(of.among)) - misfit) > log_likelihood_ratio)
    return moved
