"""How much weaker positions are without a satellite: never stronger, much where it was one of few, infinitely where there are none then."""

import numpy as np
import pytest

from integrity.gnss.least_squares import design
from integrity.gnss.observations import Bools
from integrity.monitors.weakening import growth_without
from tests.unit.gnss.skies import made_sky

N_SYSTEMS = 4


def growth(column: int, satellites: int, seed: int = 3) -> float:
    sky = made_sky(seed, (satellites,), epochs=1, receivers=3)
    one: Bools = (np.arange(satellites) == column)[None]
    return float(growth_without(sky.los_enu, sky.sigma_m[:, 0], ~one, one, sky.system_of, N_SYSTEMS)[0])


@pytest.mark.parametrize("column", range(9))
def test_a_satellite_less_is_never_better(column: int) -> None:
    assert growth(column, 9) >= 1.0


def test_of_many_one_is_spared_easily() -> None:
    assert max(growth(column, 24) for column in range(24)) < 1.2


def test_of_few_somebody_is_not() -> None:
    assert max(growth(column, 5) for column in range(5)) > 1.5


def test_where_no_position_is_left_it_cannot_be_spared() -> None:
    assert growth(1, 4) == np.inf


def test_it_is_the_ratio_of_horizontal_standard_deviations() -> None:
    sky = made_sky(5, (7,), epochs=1, receivers=1)
    one: Bools = (np.arange(7) == 2)[None]
    of_each = [design(sky.los_enu, sky.sigma_m, among[:, None], sky.system_of, N_SYSTEMS).cov_enu_m2[0, 0] for among in (~one, ~one | one)]
    without, with_it = (np.sqrt(cov[0, 0] + cov[1, 1]) for cov in of_each)
    assert growth_without(sky.los_enu, sky.sigma_m[:, 0], ~one, one, sky.system_of, N_SYSTEMS)[0] == pytest.approx(without / with_it)
