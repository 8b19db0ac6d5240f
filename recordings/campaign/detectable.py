"""The smallest faults that checks catch with the promised probability, measured through the station's own statistics beside theory.

A miss once in 100,000 epochs cannot be counted: it is sampled where it happens (importance sampling). Errors x are drawn from normal
distributions shifted to where a fault is most easily missed, and each miss counts with the ratio of the true density to that of the
draw, which leaves the mean as it is (Rubinstein, Kroese 2016, Simulation and the Monte Carlo Method, section 5.6). Several ways of being
missed (any one of three receivers) make a mixture with equal parts; the ratio is taken to the whole mixture.

The point: from `near`, the steepest way down of the statistic gives a direction; along it from zero, the first point that passes.
"""

from collections.abc import Callable
from dataclasses import dataclass
from math import log, sqrt
from typing import NamedTuple

import numpy as np

from integrity.gnss.observations import Floats
from recordings.campaign.error_model import UNDER_TEST, ErrorModel

STEP = 1e-3  # of the numerical slope, in sigmas
FARTHEST_SIGMAS = 40.0
FAILS_BY = 1e-9
Z_95 = 1.959964


class Share(NamedTuple):
    """An estimated probability, and the standard error of the estimate."""

    value: float
    error: float


@dataclass(frozen=True, eq=False)
class Case:
    """A check under a fault. `statistic` of errors (N, D), each N(0, 1), and the fault's size; it passes up to `threshold`. `near` (M, D):
    errors from which each way of being missed is found. `theory`: the size that the site promises to catch."""

    check: str
    fault: str
    statistic: Callable[[Floats, float], Floats]
    threshold: float
    near: Floats
    theory: float


class Measured(NamedTuple):
    """The size of a fault that a check misses with the accepted probability, with 95 % bounds."""

    size: float
    low: float
    high: float


def missed(case: Case, size: float, rng: np.random.Generator, samples: int) -> Share:
    """The probability that a fault of this size passes."""
    shifts = _where_missed(case, size)
    ways, dimension = shifts.shape
    x = rng.standard_normal((ways, samples // ways, dimension)) + shifts[:, None]
    x = x.reshape(-1, dimension)
    # log of density of a shifted normal over the true one: x . s - |s|^2 / 2
    log_ratio = np.einsum("nd,md->mn", x, shifts) - 0.5 * (shifts**2).sum(axis=1)[:, None]
    weight = 1.0 / np.exp(log_ratio).mean(axis=0)
    counted = np.where(case.statistic(x, size) <= case.threshold, weight, 0.0)
    return Share(float(counted.mean()), float(counted.std()) / sqrt(len(x)))


def smallest_caught(case: Case, missed_detection: float, samples: int, seed: int) -> Measured:
    """By bisection on the same draws; the bounds from the standard error there and the slope of log P_md."""

    def at(size: float) -> Share:
        return missed(case, size, np.random.default_rng(seed), samples)

    low, high = 0.3 * case.theory, 3.0 * case.theory
    for _ in range(20):
        middle = (low + high) / 2.0
        low, high = (middle, high) if at(middle).value > missed_detection else (low, middle)
    size = (low + high) / 2.0
    found, beyond = at(size), at(1.02 * size)
    slope = log(max(beyond.value, 1e-300) / found.value) / (0.02 * size)
    margin = abs(Z_95 * found.error / found.value / slope)
    return Measured(size, size - margin, size + margin)


def _where_missed(case: Case, size: float) -> Floats:
    """A shift (M, D) for each way of being missed; zero where a fault of this size passes by itself."""
    if case.statistic(np.zeros((1, case.near.shape[1])), size)[0] <= case.threshold:
        return np.zeros((1, case.near.shape[1]))
    return np.stack([_down(case, size, near) for near in case.near])


def _down(case: Case, size: float, near: Floats) -> Floats:
    steps = STEP * np.eye(len(near))
    slope = case.statistic(near + steps, size) - case.statistic(near - steps, size)
    direction = -slope / max(sqrt(float((slope**2).sum())), FAILS_BY)
    low, high = 0.0, FARTHEST_SIGMAS
    for t in np.linspace(0.0, FARTHEST_SIGMAS, 81)[1:]:
        if case.statistic((t * direction)[None], size)[0] <= case.threshold:
            high = float(t)
            break
        low = float(t)
    for _ in range(20):
        middle = (low + high) / 2.0
        passes = case.statistic((middle * direction)[None], size)[0] <= case.threshold
        low, high = (low, middle) if passes else (middle, high)
    return high * direction


def cases(model: ErrorModel) -> tuple[Case, ...]:
    """Every check whose smallest fault a site states."""
    return (*_of_positions(model), _of_collapse(model), *_of_ranges(model))


def residual_case(model: ErrorModel) -> Case:
    """The range of one satellite wrong for all receivers; missed by the one receiver that sees it least."""
    return _of_ranges(model)[0]


def _of_positions(model: ErrorModel) -> tuple[Case, ...]:
    n = model.receivers
    one, all_ = np.eye(n)[0], np.ones(n)
    east, up = np.eye(3)[0], np.eye(3)[2]

    def case(check: str, statistic: str, who: Floats, direction: Floats) -> Case:
        moved = who[:, None] * direction  # (R, 3)

        def of(x: Floats, size: float) -> Floats:
            e_enu_m = model.displacements_m(x[:, :3], x[:, 3:].reshape(-1, n, 3)) + size * moved
            value: Floats = getattr(model.of_triangle(e_enu_m), statistic)
            return value[:, 0] if value.ndim == 2 else value

        stated = model.limits.by_name[check]
        return Case(check, stated.fault_unit, of, stated.value, np.zeros((1, 3 + 3 * n)), _stated(model, check))

    first = f"circle_{model.site.receiver_names[0]}"
    return (
        case(first, "circle_m", one, east),
        case("shape", "shape", one, east),
        case("shape_3d", "shape_3d", one, up),
        case("common", "common", all_, east),
        case("common_3d", "common_3d", all_, up),
    )


def _of_collapse(model: ErrorModel) -> Case:
    """All receivers at one point, of a triangle of this many sigmas."""
    n = model.receivers

    def of(x: Floats, separation: float) -> Floats:
        scaled = model.with_separation(separation)
        e_enu_m = model.displacements_m(x[:, :3], x[:, 3:].reshape(-1, n, 3)) - scaled.triangle.baseline_enu_m
        return scaled.of_triangle(e_enu_m).collapse

    stated = model.limits.by_name["collapse"]
    return Case("collapse", stated.fault_unit, of, stated.value, np.zeros((1, 3 + 3 * n)), _stated(model, "collapse"))


def _of_ranges(model: ErrorModel) -> tuple[Case, ...]:
    n, m = model.receivers, len(model.range_sigma_m)

    def case(check: str, statistic: Callable[[Floats], Floats], who: Floats, near: Floats) -> Case:
        def of(x: Floats, size: float) -> Floats:
            prefit_m = model.ranges_m(x[:, :m], x[:, m:].reshape(-1, n, m))
            prefit_m[:, :, UNDER_TEST] += size * who
            return statistic(prefit_m)

        stated = model.limits.by_name[check]
        return Case(check, stated.fault_unit, of, stated.value, near, _stated(model, check))

    least_at = np.zeros((n, m + n * m))
    for r in range(n):
        least_at[r, m + r * m + UNDER_TEST] = -0.5
    return (
        case("residual", model.worst_residual, np.ones(n), least_at),
        case("b_value", model.worst_b, np.eye(n)[0], np.zeros((1, m + n * m))),
    )


def _stated(model: ErrorModel, check: str) -> float:
    smallest = model.limits.by_name[check].smallest_fault
    assert smallest is not None, f"{check} states no smallest fault"
    return smallest
