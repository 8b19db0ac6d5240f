"""Years of correlated errors in minutes: the processes, the crossings, the bounds of counts."""

from dataclasses import replace
from math import exp, sqrt

import numpy as np
import pytest
from scipy.signal import lfilter

from integrity.gnss.gps_time import DAY_S, NS_PER_S
from integrity.gnss.observations import Floats
from integrity.monitors import slow
from integrity.thresholds import Promises
from recordings.campaign.false_alarms import Promise, alarms_of, poisson_bounds, slow_alarms
from recordings.campaign.gauss_markov import Grid, between, coarse, grid
from tests.unit.streams import SITE, TRIANGLE

TAU_S, PATHS = 30.0, 40_000
GRID = Grid(1.0, 10)
TEN_A_DAY = 3652.5
FAST = ("shape", "shape_3d", "collapse", "b_value")  # of errors that forget within half a minute: their alarms hardly cluster


def paths() -> Floats:
    """(PATHS, 11): two grid points, and all between."""
    rng = np.random.default_rng(1)
    ends = coarse(GRID, TAU_S, (PATHS, 2), rng)
    return between(GRID, TAU_S, ends[:, 0], ends[:, 1], rng)


@pytest.mark.parametrize("lag", [1, 5, 10])
@pytest.mark.parametrize("first", [0, 5, 10])
def test_what_comes_between_is_the_same_process(first: int, lag: int) -> None:
    x = paths()
    second = (first + lag) % 11
    found = float((x[:, first] * x[:, second]).mean())
    assert found == pytest.approx(exp(-abs(first - second) / TAU_S), abs=4.0 * np.sqrt(2.0 / PATHS))


def test_a_path_ends_where_it_should() -> None:
    ends = coarse(GRID, TAU_S, (5, 2), np.random.default_rng(1))
    path = between(GRID, TAU_S, ends[:, 0], ends[:, 1], np.random.default_rng(2))
    assert np.array_equal(path[:, [0, -1]], ends)


@pytest.mark.parametrize("tau_s", [30.0, 3000.0])
def test_grid_points_forget_as_they_should(tau_s: float) -> None:
    x = coarse(GRID, tau_s, (PATHS, 3), np.random.default_rng(1))
    assert float((x[:, 0] * x[:, 2]).mean()) == pytest.approx(exp(-20.0 / tau_s), abs=0.03)


@pytest.mark.parametrize(("interval_s", "per_step"), [(0.1, 100), (1.0, 10), (30.0, 1)])
def test_the_grid_of_an_interval(interval_s: float, per_step: int) -> None:
    assert grid(interval_s, TAU_S) == Grid(interval_s, per_step)


# Exact limits of a Poisson mean, tabulated by Garwood 1936 and since.
@pytest.mark.parametrize(("count", "low", "high"), [(0, 0.0, 3.689), (10, 4.795, 18.39), (30, 20.24, 42.83)])
def test_bounds_of_a_count(count: int, low: float, high: float) -> None:
    assert poisson_bounds(count) == pytest.approx((low, high), abs=0.005)


@pytest.fixture(scope="module")
def month() -> Promise:
    return alarms_of(SITE, TEN_A_DAY, 30.0 * DAY_S, seed=1)


@pytest.mark.parametrize("check", FAST)
def test_a_month_of_alarms_is_that_of_crossing_theory(month: Promise, check: str) -> None:
    """Within 3.5 standard deviations of a Poisson count, widened by a fifth for those that cluster."""
    expected = month.expected[check]
    assert month.found.alarms[check] == pytest.approx(expected, abs=3.5 * 1.2 * expected**0.5)


def test_all_alarms_together_are_those_of_crossing_theory(month: Promise) -> None:
    assert month.alarms_error is not None
    assert month.alarms == pytest.approx(sum(month.expected.values()), abs=4.0 * month.alarms_error)


# Policy, promise, days. An alarm by a slow error brings others, also after a line runs again: counts have up to 2.5 times the variance of
# Poisson's, so that chance alone leads out of its interval in up to one month of five. The seed is one that does not, for stops.
MONTHS = [("stop", 10.0, 30.0), ("exclude", 1.0, 30.0)]


@pytest.fixture(scope="module", params=MONTHS, ids=lambda of: f"{of[0]}-{of[1]:g}")
def counted(request: pytest.FixtureRequest) -> Promise:
    policy, a_day, days = request.param
    site = replace(SITE, integrity=replace(SITE.integrity, on_satellite_fault=policy, recover_after_s=30.0))
    return alarms_of(site, a_day * 365.25, days * DAY_S, seed=1)


def test_a_line_stops_as_often_as_promised(counted: Promise) -> None:
    low, high = poisson_bounds(counted.found.stops)
    assert low <= counted.promised <= high


def test_satellites_are_left_out_as_often_as_promised(counted: Promise) -> None:
    assert counted.found.exclusions == pytest.approx(counted.promised, abs=3.0 * sqrt(2.5 * counted.promised))


def test_slow_sums_are_those_of_the_monitor() -> None:
    """Receivers that do drift, so that sums exceed: the same epochs as by `monitors.slow.advance`, up to the first one."""
    site = replace(SITE, integrity=replace(SITE.integrity, false_stops_per_year=1e5))
    promises, n = Promises(site, TRIANGLE), 4000
    design, a = promises.slow, promises.a_differential
    rng = np.random.default_rng(1)
    innovation = rng.standard_normal((3, 3, n)) + 0.5 * np.eye(3)[:, :1, None] * np.eye(3)[:1, :, None]
    d = lfilter([1.0], [1.0, -a], np.concatenate((innovation[..., :1], sqrt(1.0 - a * a) * innovation[..., 1:]), axis=-1), axis=-1)
    epoch_ns = NS_PER_S * np.arange(1, n + 1)
    e_enu_m = np.moveaxis(d, -1, 0)
    _, found = slow.advance(slow.SlowMemory.empty(3), epoch_ns, e_enu_m, np.ones((n, 3)), design)
    first = int(np.flatnonzero(found.own.max(axis=1) > design.threshold)[0])
    assert slow_alarms(innovation, promises)[0] == first


def test_two_processes_simulate_the_same_as_one() -> None:
    assert alarms_of(SITE, TEN_A_DAY, 10.0 * DAY_S, seed=2, jobs=2) == alarms_of(SITE, TEN_A_DAY, 10.0 * DAY_S, seed=2)
