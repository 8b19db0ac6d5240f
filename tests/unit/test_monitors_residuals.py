"""Satellites seen from known points: clocks, residuals, B-values against formulas written out, and Monte Carlo of their variances."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from integrity.gnss.observations import Bools, Floats
from integrity.monitors.residuals import (
    KnownPointResiduals,
    b_values_m,
    known_point_residuals,
    normalised_b_values,
    seen_by_all,
    worst,
)

SYSTEM_OF = np.array([0, 0, 0, 0, 0, 1, 1, 1])
N = len(SYSTEM_OF)
SIGMA = np.array([1.0, 1.2, 0.8, 2.0, 1.5, 1.0, 3.0, 1.1])
EVERY = np.ones((1, N), dtype=np.bool_)
CLOCKS = np.array([[100.0, 250.0], [-40.0, 110.0], [7e5, 7e5 + 150.0]])  # of receiver and constellation, m


def residuals(prefit_m: Floats, used: Bools = EVERY) -> KnownPointResiduals:
    epochs = len(prefit_m)
    return known_point_residuals(prefit_m, np.tile(SIGMA, (epochs, 1)), np.broadcast_to(used, (epochs, N)), SYSTEM_OF, 2)


def with_clocks(errors_m: Floats) -> Floats:
    """Prefit residuals (E, 3, S) of errors behind receiver clocks."""
    return np.asarray(errors_m + CLOCKS[:, SYSTEM_OF])


QUIET = with_clocks(np.zeros((1, 3, N)))
NOISE = np.random.default_rng(1).standard_normal((100_000, 1, N)) * SIGMA  # common to the receivers


def test_clocks_are_found() -> None:
    assert residuals(QUIET).clock_m[0] == pytest.approx(CLOCKS, abs=1e-9)


def test_clocks_are_taken_out() -> None:
    assert residuals(QUIET).residual_m == pytest.approx(np.zeros((1, 3, N)), abs=1e-9)


def test_a_clock_is_the_weighted_mean_of_its_constellation() -> None:
    ranges = with_clocks(np.random.default_rng(2).normal(0.0, 3.0, (1, 3, N)))
    gps = SYSTEM_OF == 0
    expected = np.average(ranges[0][:, gps], axis=1, weights=1.0 / SIGMA[gps] ** 2)
    assert residuals(ranges).clock_m[0, :, 0] == pytest.approx(expected)


@given(st.floats(-1e6, 1e6), st.integers(0, 2), st.integers(0, 1))
def test_a_clock_of_one_receiver_and_constellation_moves_no_residual(clock_m: float, receiver: int, system: int) -> None:
    moved = np.array(QUIET)
    moved[0, receiver, system == SYSTEM_OF] += clock_m
    assert residuals(moved).residual_m == pytest.approx(residuals(QUIET).residual_m, abs=1e-6)


def test_a_satellite_that_is_not_used_does_not_pull_the_clock() -> None:
    faulty = np.array(QUIET)
    faulty[..., 2] += 1000.0
    assert residuals(faulty, np.arange(N) != 2).clock_m[0] == pytest.approx(CLOCKS, abs=1e-9)


def test_a_satellite_that_is_not_used_keeps_its_whole_residual() -> None:
    faulty = np.array(QUIET)
    faulty[..., 2] += 1000.0
    assert residuals(faulty, np.arange(N) != 2).residual_m[0, :, 2] == pytest.approx(np.full(3, 1000.0))


# Every residual in sigmas has variance one, used or not: 100,000 epochs, four standard errors of a variance.
@pytest.mark.parametrize("used", [EVERY, np.arange(N) != 2, np.arange(N) != 7], ids=["all used", "GPS one out", "Galileo one out"])
def test_residuals_are_normalised(used: Bools) -> None:
    variance = residuals(with_clocks(np.repeat(NOISE, 3, axis=1)), used).normalised[:, 0].var(axis=0)
    assert variance == pytest.approx(np.ones(N), abs=4.0 * np.sqrt(2.0 / len(NOISE)))


def test_a_satellite_alone_in_its_constellation_says_nothing() -> None:
    used = (SYSTEM_OF == 0) | (np.arange(N) == 5)
    assert np.isnan(residuals(QUIET, used).normalised[0, :, 5]).all()


def test_a_constellation_without_used_satellites_says_nothing() -> None:
    assert np.isnan(residuals(QUIET, SYSTEM_OF == 0).normalised[0][:, SYSTEM_OF == 1]).all()


def test_a_satellite_not_seen_by_one_receiver_says_nothing_there() -> None:
    unseen = np.array(QUIET)
    unseen[0, 1, 4] = np.nan
    assert np.isnan(residuals(unseen, np.arange(N) != 4).normalised[0, :, 4]).tolist() == [False, True, False]


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_no_number_at_a_satellite_not_used_leaves_the_others(value: float) -> None:
    spoiled = np.array(QUIET)
    spoiled[0, 1, 4] = value
    others = np.arange(N) != 4
    assert residuals(spoiled, others).residual_m[..., others] == pytest.approx(np.zeros((1, 3, N - 1)), abs=1e-9)


@pytest.mark.parametrize(
    ("of_receivers", "expected"),
    [
        ((5.0, 4.0, 6.0), 4.0),
        ((-5.0, -4.0, -6.0), 4.0),
        ((5.0, 4.0, -6.0), 0.0),
        ((5.0, 0.0, 6.0), 0.0),
        ((50.0, 0.5, 0.2), 0.2),
        ((np.inf, 4.0, 6.0), 4.0),
    ],
    ids=["all above", "all below", "signs differ", "one at zero", "one receiver's fault", "infinite at one"],
)
def test_seen_by_all_is_the_smallest_where_signs_agree(of_receivers: tuple[float, ...], expected: float) -> None:
    assert seen_by_all(np.array(of_receivers)[None, :, None]).item() == expected


@pytest.mark.parametrize("of_receivers", [(np.nan, 4.0, 6.0), (np.nan, -4.0, 6.0), (np.nan, np.nan, np.nan)])
def test_seen_by_all_says_nothing_where_one_receiver_says_nothing(of_receivers: tuple[float, ...]) -> None:
    assert np.isnan(seen_by_all(np.array(of_receivers)[None, :, None]).item())


@given(st.permutations(range(3)))
def test_order_of_receivers_changes_nothing_that_all_see(order: list[int]) -> None:
    values = np.random.default_rng(3).normal(0.0, 5.0, (50, 3, N))
    assert seen_by_all(values[:, order]).tolist() == seen_by_all(values).tolist()


def test_b_values_are_mean_minus_mean_without() -> None:
    r = np.random.default_rng(4).normal(0.0, 1.0, (4, 3, N))
    # Section 2.3, with the sign of the receiver's own excess.
    expected = np.stack([np.delete(r, j, axis=1).mean(axis=1) - r.mean(axis=1) for j in range(3)], axis=1)
    assert b_values_m(r) == pytest.approx(-expected)


def test_a_bias_of_one_of_three_shows_as_a_third() -> None:
    r = np.zeros((1, 3, N))
    r[0, 1, 3] = 6.0
    assert b_values_m(r)[0, :, 3] == pytest.approx([-1.0, 2.0, -1.0])


@given(st.floats(-1e5, 1e5))
def test_what_all_receivers_share_is_not_in_the_b_values(common_m: float) -> None:
    r = np.random.default_rng(5).normal(0.0, 1.0, (1, 3, N))
    assert b_values_m(r + common_m) == pytest.approx(b_values_m(r), abs=1e-9)


def test_b_values_are_normalised() -> None:
    sigma_d = np.full((100_000, N), 0.4)
    own = np.random.default_rng(6).normal(0.0, 0.4, (100_000, 3, N))
    variance = normalised_b_values(b_values_m(own), sigma_d).var(axis=0)
    # Four standard errors of a variance, and some room for the largest of 24.
    assert variance == pytest.approx(np.ones((3, N)), abs=5.0 * np.sqrt(2.0 / 100_000))


@pytest.mark.parametrize(
    ("statistic", "used", "expected"),
    [
        ((1.0, 3.0, 2.0), (1, 1, 1), 3.0),
        ((1.0, 3.0, 2.0), (1, 0, 1), 2.0),
        ((1.0, np.nan, 2.0), (1, 0, 1), 2.0),
        ((1.0, np.nan, 2.0), (1, 1, 1), np.nan),
        ((1.0, np.inf, 2.0), (1, 1, 1), np.nan),
        ((1.0, 3.0, 2.0), (0, 0, 0), np.nan),
        ((), (), np.nan),
    ],
    ids=["largest", "of the used", "unused without number", "used without number", "infinite", "none used", "none at all"],
)
def test_worst(statistic: tuple[float, ...], used: tuple[int, ...], expected: float) -> None:
    found = worst(np.array(statistic, dtype=np.float64)[None], np.array(used, dtype=np.bool_)[None])
    assert found[0] == pytest.approx(expected, nan_ok=True)
