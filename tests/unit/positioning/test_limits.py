"""Limits against the printed table, and at their edges."""

import numpy as np
import pytest

from tests.unit.positioning.field import LIMITS


@pytest.mark.parametrize(("dof", "printed"), [(1, 15.14), (2, 18.42), (3, 21.11), (4, 23.51), (5, 25.74), (6, 27.86), (8, 31.83)])
def test_squares_have_the_limits_of_the_digest(dof: int, printed: float) -> None:
    assert LIMITS.residual_limit(np.array([dof]))[0] == pytest.approx(printed, abs=0.005)  # section 1.8, to two decimals


@pytest.mark.parametrize("dof", [0, -1, -3])
def test_without_a_degree_of_freedom_nothing_passes(dof: int) -> None:
    assert not (LIMITS.residual_limit(np.array([dof])) >= 0.0).any()


def test_beyond_the_table_it_is_stricter_than_it_need_be() -> None:
    assert LIMITS.residual_limit(np.array([75]))[0] == LIMITS.residual_limit(np.array([60]))[0]
