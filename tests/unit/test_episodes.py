"""Stops of several checks together: regions against the station's statistics, rates against formulas, counts and plain draws."""

from math import exp, sqrt

import numpy as np
import pytest
from scipy.special import ndtri

from integrity.episodes import (
    STEPS,
    Errors,
    Region,
    looks,
    position_regions,
    stops_per_look,
    stops_seen_by_all_per_look,
    tail_missed_by_one,
    tail_seen_by_all,
)
from integrity.gnss.observations import Floats
from integrity.probability import episodes_per_look
from recordings.campaign.error_model import error_model
from tests.unit.streams import SITE, TRIANGLE

N, PATHS = 3, 4096
COMMON_M, OWN_M = (1.2, 1.2, 2.4), (0.5, 0.5, 1.0)
TAILS = {"circle": 1e-3, "common": 2e-3, "common_3d": 3e-3, "shape": 4e-3, "shape_3d": 5e-3, "collapse": 6e-3}
NAMES = ("circle_A", "circle_B", "circle_C", "common", "common_3d", "shape", "shape_3d", "collapse")


def regions() -> list[Region]:
    return position_regions(COMMON_M, OWN_M, [tuple(row) for row in TRIANGLE.baseline_enu_m.tolist()], TAILS)


@pytest.mark.parametrize(("i", "name"), list(enumerate(NAMES)))
def test_a_region_fails_where_the_station_s_statistic_does(i: int, name: str) -> None:
    model, region = error_model(SITE), regions()[i]
    x = 1.6 * np.random.default_rng(1).standard_normal((3 + 3 * N, 4000))
    found = model.of_triangle(model.displacements_m(x[:3].T, x[3:].reshape(N, 3, -1).transpose(2, 0, 1)))
    sigmas = found.circle_m[:, i] / sqrt(1.2**2 + 0.5**2) if name.startswith("circle") else getattr(found, name)
    statistic = np.sqrt(sigmas) if name.startswith(("common", "shape")) else sigmas
    fails = region.fails(x)
    assert 20 < fails.sum() < 3980
    np.testing.assert_array_equal(fails, statistic > region.threshold)


def of_one(dof: int, tail: float, dimension: int = 6, first: int = 0) -> Region:
    return Region(np.eye(dimension)[first : first + dof], tail)


@pytest.mark.parametrize("dof", [2, 4, 6])
@pytest.mark.parametrize(("tau_s", "interval_s", "clear"), [(30.0, 1.0, 31), (300.0, 1.0, 31), (10.0, 30.0, 2), (100.0, 1.0, 301)])
def test_one_check_stops_as_often_as_by_the_formula(dof: int, tau_s: float, interval_s: float, clear: int) -> None:
    found = stops_per_look([of_one(dof, 1e-6)], Errors((tau_s,) * 6, interval_s, clear), PATHS)
    assert found == pytest.approx(episodes_per_look(1e-6, dof, exp(-interval_s / tau_s), clear), rel=0.06)  # 5 % the one, 2 % the other


ERRORS = Errors((30.0,) * 6, 1.0, 31)


def test_what_two_checks_see_alike_counts_once() -> None:
    one = of_one(3, 1e-5)
    assert stops_per_look([one, one], ERRORS, PATHS) == pytest.approx(stops_per_look([one], ERRORS, PATHS), rel=0.05)


def test_checks_of_errors_of_their_own_add_up() -> None:
    one, other = of_one(3, 1e-5), of_one(3, 1e-5, first=3)
    alone = stops_per_look([one], ERRORS, PATHS) + stops_per_look([other], ERRORS, PATHS)
    assert stops_per_look([one, other], ERRORS, PATHS) == pytest.approx(alone, rel=0.05)


def walked(x: Floats, a: Floats, rng: np.random.Generator) -> Floats:
    result: Floats = a * x + np.sqrt(1.0 - a * a) * rng.standard_normal(x.shape)
    return result


def test_positions_stop_as_often_as_counted() -> None:
    """2,000 triangles for 2,000 looks, from the stationary state on."""
    rng, errors, of = np.random.default_rng(3), Errors((200.0,) * 3 + (10.0,) * 9, 1.0, 11), regions()
    of = [region._replace(tail=region.tail / 40.0) for region in of]
    a = np.exp(-1.0 / np.array(errors.seconds))[:, None]
    x = rng.standard_normal((12, 2000))
    silent, stops, epochs = np.full(2000, errors.clear), 0, 2000
    for _ in range(epochs):
        x = walked(x, a, rng)
        fails = np.logical_or.reduce([region.fails(x) for region in of])
        stops += int((fails & (silent >= errors.clear)).sum())
        silent = np.where(fails, 0, silent + 1)
    # Clusters: at most three times the variance of Poisson; the sum over paths to 2 %.
    assert stops == pytest.approx(2000 * epochs * stops_per_look(of, errors, PATHS), abs=4.0 * sqrt(3.0 * stops) + 0.02 * stops)


@pytest.mark.parametrize("common", [0.5, 0.9])
def test_a_satellite_is_blamed_as_often_as_counted(common: float) -> None:
    rng, errors, k = np.random.default_rng(4), Errors((300.0, 10.0, 10.0, 10.0), 1.0, 11), 2.9
    a = np.exp(-1.0 / np.array(errors.seconds))[:, None]
    x = rng.standard_normal((4, 10_000))
    silent, stops, epochs = np.full(10_000, errors.clear), 0, 700
    for _ in range(epochs):
        x = walked(x, a, rng)
        of_each = sqrt(common) * x[0] + sqrt(1.0 - common) * x[1:]
        fails = (of_each.min(axis=0) > k) | (of_each.max(axis=0) < -k)
        stops += int((fails & (silent >= errors.clear)).sum())
        silent = np.where(fails, 0, silent + 1)
    expected = 10_000 * epochs * stops_seen_by_all_per_look(k, [common], N, errors, PATHS)
    assert stops == pytest.approx(expected, abs=4.0 * sqrt(3.0 * stops) + 0.03 * stops)


@pytest.mark.parametrize("common", [0.3, 0.7, 0.95])
def test_tails_of_what_all_or_one_of_the_receivers_see(common: float) -> None:
    x = np.random.default_rng(5).standard_normal((4, 1_000_000))
    of_each = sqrt(common) * x[0] + sqrt(1.0 - common) * x[1:]
    all_, one = float((of_each.min(axis=0) > 1.5).mean()), float((of_each.max(axis=0) > 1.5).mean())
    assert (tail_seen_by_all(1.5, common, N), tail_missed_by_one(1.5, common, N)) == pytest.approx((all_, one), abs=4.0 * sqrt(one / 1e6))


def test_receivers_that_share_everything_see_what_one_sees() -> None:
    assert tail_seen_by_all(float(-ndtri(1e-7)), 1.0 - 1e-6, N) == pytest.approx(1e-7, rel=0.02)


@pytest.mark.parametrize("clear", [2, 31, STEPS, STEPS + 1, 301, 6001])
def test_looks_lead_from_the_first_to_the_last(clear: int) -> None:
    taken = looks(clear)
    assert (taken[0], taken[-1], list(taken)) == (1, clear, sorted(set(taken)))
    assert len(taken) == (clear if clear <= STEPS else len(taken)) <= STEPS


@pytest.mark.parametrize("clear", [301, 601])
def test_looks_that_are_left_out_are_made_up_for(clear: int, monkeypatch: pytest.MonkeyPatch) -> None:
    errors = Errors((3000.0,) * 3 + (30.0,) * 9, 0.1, clear)
    of = [region._replace(tail=region.tail / 1000.0) for region in regions()]
    few = stops_per_look(of, errors, PATHS)
    monkeypatch.setattr("integrity.episodes.looks", lambda clear: tuple(range(1, clear + 1)))
    assert few == pytest.approx(stops_per_look(of, errors, PATHS), rel=0.04)
