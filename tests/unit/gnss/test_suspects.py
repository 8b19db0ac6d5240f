"""Leaving out all that cannot be told apart: of a constellation of two, both."""

import numpy as np
import pytest

from integrity.gnss.detection import Checked, Finding, criteria, detect_and_exclude
from integrity.gnss.suspects import without_suspects
from tests.unit.gnss.skies import MadeSky, made_sky

LIMITS = criteria(false_alarm=1e-7, most_excluded=3, confusable=0.85, confusion=1e-3)
PAIR = [8, 9]  # the columns of the second constellation


def faulty(satellites: tuple[int, ...] = (8, 2)) -> MadeSky:
    """100 m on the last satellite of all."""
    sky = made_sky(1, satellites)
    residual_m = sky.residual_m.copy()
    residual_m[..., -1] += 100.0
    return sky._replace(residual_m=residual_m)


def chosen(sky: MadeSky) -> tuple[Checked, Checked]:
    """Before and after."""
    of = sky.design()
    before = detect_and_exclude(of, sky.los_enu, sky.residual_m, LIMITS)
    return before, without_suspects(before, of, sky.los_enu, sky.residual_m, LIMITS)


def test_of_two_alike_both_go() -> None:
    before, after = chosen(faulty())
    assert (before.finding == Finding.AMBIGUOUS).all()
    np.testing.assert_array_equal(after.excluded, np.isin(np.arange(10), PAIR) & np.ones(after.excluded.shape, dtype=np.bool_))


def test_the_position_is_that_without_both() -> None:
    sky = faulty()
    _, found, _ = sky.solved(sky.used & ~np.isin(np.arange(10), PAIR))
    np.testing.assert_allclose(chosen(sky)[1].found.e_enu_m, found.e_enu_m, atol=1e-9)


def test_nobody_is_suspected_any_more() -> None:
    assert not chosen(faulty())[1].suspects.any()


@pytest.mark.parametrize("satellites", [(4, 2), (2, 2, 2)])
def test_what_cannot_be_checked_without_them_stays_ambiguous(satellites: tuple[int, ...]) -> None:
    before, after = chosen(faulty(satellites))
    np.testing.assert_array_equal(after.finding, before.finding)


def test_without_doubt_nothing_changes() -> None:
    before, after = chosen(made_sky(1))
    assert after is before
