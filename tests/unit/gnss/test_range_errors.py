"""Sigmas by C/N0: numbers of the model's source, and what must hold for any."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from integrity.gnss.range_errors import CODE_M2HZ, cn0_variance_m2, with_cn0_m


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
