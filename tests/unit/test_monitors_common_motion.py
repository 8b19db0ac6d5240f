"""A few satellites or everything: each explanation fits what it explains and nothing else, and noise deceives as rarely as it should."""

import numpy as np
import pytest
from scipy.special import chdtrc

from integrity.gnss.observations import Bools, Floats
from integrity.limits import NAMED_RATHER
from integrity.monitors.common_motion import Measured, displaced, is_displaced, may_be_named, standing
from tests.unit.gnss.skies import made_sky

N_SYSTEMS = 4
AWAY_M = np.array([6.0, -4.0, 9.0])


def measured(moved_m: Floats, epochs: int, satellites: tuple[int, ...] = (9, 7), seed: int = 3) -> Measured:
    """`moved_m` (E, S) on top of clocks, under one sky; sigmas of 1 m."""
    sky = made_sky(seed, satellites, epochs=1, receivers=1)
    shape = (epochs, sum(satellites))
    towards = np.broadcast_to(sky.los_enu[:, 0], (3, *shape))
    clock_m = 100.0 * (1.0 + sky.system_of)
    return Measured(moved_m + clock_m, towards, np.ones(shape), np.ones(shape, dtype=np.bool_), sky.system_of, N_SYSTEMS)


def noise(seed: int, epochs: int = 1, satellites: int = 16) -> Floats:
    return np.random.default_rng(seed).standard_normal((epochs, satellites))


def one(column: int, epochs: int = 1, satellites: int = 16) -> Bools:
    return np.broadcast_to(np.arange(satellites) == column, (epochs, satellites))


def dragged(epochs: int = 1) -> Floats:
    """A triangle that stands elsewhere: a range shrinks when it moves towards the satellite."""
    away_m: Floats = -np.einsum("ies,i->es", measured(np.zeros((epochs, 16)), epochs).towards, AWAY_M)
    return away_m


def test_a_displacement_leaves_nothing_of_what_it_is() -> None:
    assert displaced(measured(dragged(), 1))[0] == pytest.approx(0.0, abs=1e-9)


def test_degrees_of_freedom_are_ranges_less_a_position_and_two_clocks() -> None:
    assert displaced(measured(dragged(), 1))[1].tolist() == [16 - 3 - 2]


def test_what_noise_leaves_of_ranges_has_as_many_degrees_of_freedom_as_it_says() -> None:
    """Mean of a chi-square within four standard errors."""
    misfit, dof = displaced(measured(noise(1, 4000), 4000))
    assert misfit.mean() == pytest.approx(dof[0], abs=4.0 * np.sqrt(2.0 * dof[0] / 4000))


def test_without_the_suspect_the_others_stand() -> None:
    wrong = np.where(one(4), 30.0, 0.0)
    assert standing(measured(wrong, 1), one(4)) == pytest.approx(0.0, abs=1e-9)


def test_with_it_they_do_not() -> None:
    wrong = np.where(one(4), 30.0, 0.0)
    assert standing(measured(wrong, 1), np.zeros((1, 16), dtype=np.bool_))[0] > 700.0


@pytest.mark.parametrize("column", range(16))
def test_a_satellite_that_is_wrong_may_be_named(column: int) -> None:
    wrong = noise(2) + np.where(one(column), 12.0, 0.0)
    assert may_be_named(measured(wrong, 1), one(column), NAMED_RATHER).all()


@pytest.mark.parametrize("column", range(16))
def test_of_a_sky_that_is_dragged_away_no_satellite_may_be_named(column: int) -> None:
    assert not may_be_named(measured(dragged() + noise(3), 1), one(column), NAMED_RATHER).any()


def test_a_sky_that_is_dragged_away_is_displaced() -> None:
    assert is_displaced(measured(dragged() + noise(4), 1), NAMED_RATHER).all()


def test_a_satellite_that_is_wrong_is_no_displacement() -> None:
    assert not is_displaced(measured(noise(5) + np.where(one(4), 30.0, 0.0), 1), NAMED_RATHER).any()


def test_noise_is_taken_for_a_displacement_as_rarely_as_it_should_be() -> None:
    """A gain of 2 ln 1000 by three parameters: 3.2e-3, within four standard errors."""
    expected = chdtrc(3, 2.0 * NAMED_RATHER)
    share = is_displaced(measured(noise(6, 20_000), 20_000), NAMED_RATHER).mean()
    assert share == pytest.approx(expected, abs=4.0 * np.sqrt(expected / 20_000))


def test_noise_names_a_given_satellite_even_more_rarely() -> None:
    """Less often than a single normal value exceeds sqrt(2 ln 1000): 2.0e-4."""
    assert may_be_named(measured(noise(7, 20_000), 20_000), one(4, 20_000), NAMED_RATHER).mean() <= chdtrc(1, 2.0 * NAMED_RATHER)


def test_where_satellites_give_no_position_nobody_may_be_named() -> None:
    few = measured(np.where(np.arange(4) == 1, 50.0, 0.0)[None], 1, (4,))
    assert not may_be_named(few._replace(among=few.among & ~one(3, 1, 4)), one(1, 1, 4), NAMED_RATHER).any()


def test_who_does_not_count_changes_nothing() -> None:
    among = ~one(7)
    of, other = (measured(noise(7) + np.where(one(7), far_m, 0.0), 1)._replace(among=among) for far_m in (0.0, np.nan))
    assert displaced(of)[0] == displaced(other)[0] and standing(of, one(2)) == standing(other, one(2))
