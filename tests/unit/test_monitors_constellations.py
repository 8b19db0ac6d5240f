"""Each constellation by itself: a displaced frame shows where it is, a clock step nowhere, and Monte Carlo of the distribution."""

import numpy as np
import pytest
from scipy.stats import chi2

from integrity.gnss.least_squares import design
from integrity.gnss.observations import Bools, Floats
from integrity.monitors.constellations import constellation_design, displacements, misfits
from tests.unit.gnss.skies import MadeSky, made_sky

N_SYSTEMS = 4
GPS, GALILEO = 0, 1
SMALL_M2 = np.full(3, 1e-3)  # a site that promises more than any geometry: it is the geometry that counts
DISPLACED_M = np.array([12.0, -9.0, 20.0])


def quiet_sky(satellites: tuple[int, ...] = (9, 7), epochs: int = 1) -> MadeSky:
    """One sky for all epochs, three receivers at nearly one place; nothing is measured but zeros."""
    one = made_sky(3, satellites, epochs=1, receivers=1)
    shape = (epochs, 3, len(one.system_of))
    return MadeSky(
        np.ascontiguousarray(np.broadcast_to(one.los_enu, (3, *shape))),
        np.ascontiguousarray(np.broadcast_to(one.sigma_m, shape)),
        np.zeros(shape),
        np.ones(shape, dtype=np.bool_),
        one.system_of,
    )


def statistics(sky: MadeSky, prefit_m: Floats, used: Bools | None = None, promised_m2: Floats | None = None) -> Floats:
    chosen = sky.used if used is None else sky.used & used
    promised = SMALL_M2 if promised_m2 is None else promised_m2
    of = constellation_design(sky.los_enu, sky.sigma_m[:, 0], chosen[:, 0], sky.system_of, N_SYSTEMS)
    return displacements(of, prefit_m, promised, promised)


def of_system(sky: MadeSky, system: int) -> Bools:
    mine: Bools = sky.system_of == system
    return mine


def displaced(sky: MadeSky, system: int) -> Floats:
    """Ranges with the orbits of one constellation off by a vector: all its ranges change by its part along the line of sight."""
    along_m = np.einsum("iers,i->ers", sky.los_enu, DISPLACED_M)
    return np.where(of_system(sky, system), along_m, 0.0)


def test_a_displaced_constellation_stands_where_it_is_displaced_to() -> None:
    sky = quiet_sky()
    own = design(sky.los_enu, sky.sigma_m, sky.used & of_system(sky, GALILEO), sky.system_of, N_SYSTEMS).cov_enu_m2[0, 0]
    expected = np.sum(DISPLACED_M**2 / np.diagonal(own))
    assert statistics(sky, displaced(sky, GALILEO))[0, GALILEO] == pytest.approx(expected)


def test_the_other_constellation_stays() -> None:
    sky = quiet_sky()
    assert statistics(sky, displaced(sky, GALILEO))[0, GPS] == pytest.approx(0.0, abs=1e-12)


def test_a_clock_step_of_a_constellation_is_no_displacement() -> None:
    sky = quiet_sky()
    stepped = np.where(of_system(sky, GALILEO), 300.0, 0.0) + np.zeros(sky.residual_m.shape)
    assert statistics(sky, stepped)[0, :2] == pytest.approx([0.0, 0.0], abs=1e-12)


def test_a_constellation_alone_is_not_judged() -> None:
    sky = quiet_sky()
    assert np.isnan(statistics(sky, displaced(sky, GPS), of_system(sky, GPS))).all()


def test_three_satellites_of_a_constellation_are_not_judged() -> None:
    sky = quiet_sky((9, 3))
    assert np.isnan(statistics(sky, displaced(sky, GALILEO))[0, GALILEO])


def test_a_constellation_that_is_not_there_is_not_judged() -> None:
    assert np.isnan(statistics(quiet_sky(), quiet_sky().residual_m)[0, 2:]).all()


def test_noise_of_the_ranges_is_chi_square_or_smaller() -> None:
    """Independent errors of exactly the sigmas: axis by axis unit variance, the axes of one geometry correlated."""
    sky = quiet_sky(epochs=20_000)
    rng = np.random.default_rng(5)
    noise_m = rng.standard_normal((20_000, 1, len(sky.system_of))) * sky.sigma_m
    found = statistics(sky, noise_m + np.zeros(sky.residual_m.shape))
    assert found[:, GPS].mean() == pytest.approx(3.0, rel=0.05)


def test_a_sky_with_larger_sigmas_of_the_site_is_judged_by_these() -> None:
    sky, large = quiet_sky(), np.full(3, 400.0)
    assert statistics(sky, displaced(sky, GALILEO), promised_m2=large)[0, GALILEO] == pytest.approx(np.sum(DISPLACED_M**2) / 400.0)


def test_the_statistic_of_an_exceeding_frame_exceeds_a_false_alarm_threshold() -> None:
    sky = quiet_sky()
    assert statistics(sky, displaced(sky, GALILEO))[0, GALILEO] > chi2.isf(1e-9, 3)


def misfit_of(sky: MadeSky, prefit_m: Floats) -> float:
    of = constellation_design(sky.los_enu, sky.sigma_m[:, 0], sky.used[:, 0], sky.system_of, N_SYSTEMS)
    return float(misfits(of, prefit_m)[0][0, GALILEO])


def test_a_displacement_leaves_no_misfit() -> None:
    sky = quiet_sky()
    assert misfit_of(sky, displaced(sky, GALILEO)) == pytest.approx(0.0, abs=1e-9)


def test_a_step_of_one_satellite_leaves_a_misfit() -> None:
    sky = quiet_sky()
    stepped = np.array(sky.residual_m)
    stepped[..., -1] += 30.0
    assert misfit_of(sky, stepped) > chi2.isf(1e-3, 3)


def test_ranges_beyond_position_and_clock_are_its_degrees_of_freedom() -> None:
    sky = quiet_sky((9, 7))
    of = constellation_design(sky.los_enu, sky.sigma_m[:, 0], sky.used[:, 0], sky.system_of, N_SYSTEMS)
    assert misfits(of, sky.residual_m)[1][0, :2].tolist() == [5, 3]
