"""Sigmas by C/N0: numbers of the model's source, and what must hold for any."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from integrity.gnss.positioning import range_sigma_m
from integrity.gnss.range_errors import (
    CODE_M2HZ,
    cn0_variance_m2,
    noise_left,
    parts_of,
    rate_sigma_mps,
    sigma_of_parts_m,
    with_cn0_m,
)


@pytest.mark.parametrize(("cn0_dbhz", "variance_m2"), [(45.0, 0.7115), (35.0, 7.115), (25.0, 71.15)])
def test_the_variance_is_that_of_the_source(cn0_dbhz: float, variance_m2: float) -> None:
    """150^2 10^(-C/N0 / 10)."""
    assert cn0_variance_m2(np.array([cn0_dbhz]), CODE_M2HZ).item() == pytest.approx(variance_m2, rel=1e-3)


def test_variances_add_up() -> None:
    assert with_cn0_m(np.array([3.0]), np.array([np.nan, 10.0]), 160.0) == pytest.approx([3.0, 5.0])


def test_without_c_n0_the_sigma_is_that_of_the_elevation() -> None:
    sigma_m = np.array([0.9, 2.4])
    np.testing.assert_array_equal(with_cn0_m(sigma_m, np.full(2, np.nan), CODE_M2HZ), sigma_m)


@given(st.floats(0.1, 100.0), st.floats(-1000.0, 70.0), st.floats(0.0, 1000.0))
def test_a_weaker_signal_is_never_trusted_more(sigma_m: float, cn0_dbhz: float, less_db: float) -> None:
    weaker = with_cn0_m(np.array([sigma_m]), np.array([cn0_dbhz - less_db]), CODE_M2HZ).item()
    assert weaker >= with_cn0_m(np.array([sigma_m]), np.array([cn0_dbhz]), CODE_M2HZ).item()


EL_RAD = np.deg2rad([10.0, 30.0, 90.0])
URA_M = np.full(3, 2.4)


def sigma_m(signal: str, noise_share: float = 1.0, drift_m: float = 0.0) -> list[float]:
    parts = parts_of([signal] * 3, 0.9, 0.4)
    return [float(sigma) for sigma in sigma_of_parts_m(EL_RAD, parts, URA_M, noise_share, drift_m)]


def test_one_frequency_has_the_sigma_of_a_and_b() -> None:
    assert sigma_m("G05.1C") == pytest.approx(range_sigma_m(EL_RAD, 0.9, 0.4).tolist())


def test_a_pair_has_the_sigma_of_the_formula() -> None:
    """0.6^2 + 0.76^2 + 0.89^2 everywhere, 0.12^2 + 0.89^2 over sin^2 el: 1.32^2 and 0.90^2 m2."""
    assert sigma_m("G05.1C+2W") == pytest.approx([5.357, 2.234, 1.599], abs=0.01)


def test_a_pair_without_bias_between_codes_is_better() -> None:
    assert sigma_m("E11.1C+5Q")[2] == pytest.approx(np.sqrt(0.6**2 + 0.12**2 + 2 * (2.588 * 0.3) ** 2), abs=1e-3)


def test_smoothing_takes_the_noise_and_leaves_the_rest() -> None:
    """Of 0.9^2 + 0.4^2 at the zenith 0.3^2 + 0.3^2 are noise."""
    assert sigma_m("G05.1C", noise_share=0.0)[2] == pytest.approx(np.sqrt(0.97 - 0.18))


def test_what_the_ionosphere_moved_adds_up() -> None:
    assert sigma_m("G05.1C", drift_m=2.0)[2] == pytest.approx(np.sqrt(0.97 + 4.0))


def test_an_accuracy_twice_as_bad_is_a_sigma_twice_as_large() -> None:
    parts = parts_of(["G05.1C+2W"] * 3, 0.9, 0.4)
    assert sigma_of_parts_m(EL_RAD, parts, 2.0 * URA_M) == pytest.approx(2.0 * sigma_of_parts_m(EL_RAD, parts, URA_M))


@pytest.mark.parametrize(("white", "age_s", "left"), [(1.0, 0.0, 1.0), (0.0, 0.0, 0.5), (0.0, 300.0, 0.25), (0.1, 300.0, 0.3)])
def test_half_of_the_noise_lasts_for_minutes(white: float, age_s: float, left: float) -> None:
    assert noise_left(np.array(white), np.array(age_s)) == pytest.approx(left)


def test_a_rate_low_down_is_worse() -> None:
    assert rate_sigma_mps(np.deg2rad([1.0, 3.0, 30.0, 90.0])) == pytest.approx([0.9554, 0.9554, 0.1, 0.05], abs=1e-4)
