"""Leaving satellites out without solving again, compared with solving again, and with the hat matrix that numpy inverts."""

import numpy as np
import pytest

from integrity.gnss.least_squares import Unsolved, solution
from integrity.gnss.leave_one_out import normalised, separation_sigma_m, shares, without_each
from integrity.gnss.observations import Bools, Floats
from tests.unit.gnss.skies import MadeSky, made_sky


def narrow(epochs: int = 300) -> MadeSky:
    """Skies of seven satellites in a cone of 14 deg around the zenith: weighted PDOPs around 100, some of which one satellite decides."""
    sky = made_sky(8, (7,), epochs=epochs, receivers=1)
    level = np.array((sky.los_enu[0], sky.los_enu[1])) * 0.24
    return sky._replace(los_enu=np.array((*level, np.sqrt(1.0 - (level**2).sum(axis=0)))))


SKIES = {
    "narrow": narrow(),
    "two constellations": made_sky(1),
    "four": made_sky(2, (7, 5, 4, 3)),
    "a lone satellite": made_sky(3, (8, 1)),
    "as many satellites as unknowns": made_sky(4, (4, 1)),
    "one more": made_sky(5, (5,)),
}


def less(sky: MadeSky, i: int) -> Bools:
    """All of the sky's satellites but one."""
    used = sky.used.copy()
    used[..., i] = False
    return used


@pytest.mark.parametrize("sky", SKIES.values(), ids=SKIES.keys())
def test_positions_are_those_of_solving_again_to_a_nanometre(sky: MadeSky) -> None:
    of, found, postfit = sky.solved()
    without = without_each(of, shares(of, sky.los_enu), found, postfit)
    again = np.array([solution(sky.design(less(sky, i)), sky.residual_m).e_enu_m for i in range(len(sky.system_of))])
    expected = np.where(found.solved[..., None], np.moveaxis(again, (0, 3), (3, 0)), np.nan)
    rounding_m = 1e-6 if sky is SKIES["narrow"] else 1e-9  # it grows with the square of the dilution, 100 there
    np.testing.assert_allclose(without.e_enu_m, expected, rtol=0.0, atol=rounding_m)


@pytest.mark.parametrize("sky", SKIES.values(), ids=SKIES.keys())
def test_reasons_are_those_of_solving_again(sky: MadeSky) -> None:
    of, found, postfit = sky.solved()
    without = without_each(of, shares(of, sky.los_enu), found, postfit)
    again = np.array([solution(sky.design(less(sky, i)), sky.residual_m).why for i in range(len(sky.system_of))])
    expected = np.where(found.solved[..., None], np.moveaxis(again, 0, -1), found.why[..., None])
    np.testing.assert_array_equal(without.why, expected)


def test_without_one_of_as_many_as_unknowns_there_are_too_few() -> None:
    sky = SKIES["as many satellites as unknowns"]
    of, found, postfit = sky.solved()
    assert (without_each(of, shares(of, sky.los_enu), found, postfit).why[..., :4] == Unsolved.TOO_FEW_SATELLITES).all()


def test_a_satellite_that_alone_holds_the_height_leaves_a_poor_geometry() -> None:
    flat = made_sky(6, (8,), epochs=1, receivers=1)
    az_rad = np.arange(8) * (2.0 * np.pi / 7.0)
    los = np.array((np.sin(az_rad), np.cos(az_rad), np.zeros(8))) * np.sqrt(1.0 - 0.2**2)
    los[2] = 0.2  # a ring at one elevation: height and clock cannot be told apart
    los[:, 7] = (0.0, 0.0, 1.0)
    sky = flat._replace(los_enu=los[:, None, None])
    of, found, postfit = sky.solved()
    why = without_each(of, shares(of, sky.los_enu), found, postfit).why[0, 0]
    np.testing.assert_array_equal(why, [Unsolved.SOLVED] * 7 + [Unsolved.POOR_GEOMETRY])


def test_narrow_skies_are_on_both_sides_of_the_largest_pdop() -> None:
    of, found, postfit = SKIES["narrow"].solved()
    without = without_each(of, shares(of, SKIES["narrow"].los_enu), found, postfit)
    assert 0.1 < (without.why == Unsolved.POOR_GEOMETRY).mean() < 0.9


def test_satellites_not_used_change_nothing() -> None:
    sky = made_sky(7)
    sky.los_enu[..., 3] = np.nan
    sky.residual_m[..., 3] = np.nan
    of, found, postfit = sky.solved(less(sky, 3))
    without = without_each(of, shares(of, sky.los_enu), found, postfit)
    np.testing.assert_array_equal(without.e_enu_m[..., 3], np.moveaxis(found.e_enu_m, -1, 0))


def dense(sky: MadeSky) -> tuple[Floats, Floats]:
    """Hat values and normalised residuals (E, R, S) by numpy's inverse of the whole normal equations."""
    hat, w = np.empty(sky.sigma_m.shape), np.empty(sky.sigma_m.shape)
    clocks = (sky.system_of[:, None] == np.unique(sky.system_of)).astype(np.float64)
    for e, r in np.ndindex(*hat.shape[:2]):
        A = np.hstack((-sky.los_enu[:, e, r].T, clocks)) / sky.sigma_m[e, r][:, None]
        y = sky.residual_m[e, r] / sky.sigma_m[e, r]
        H = A @ np.linalg.inv(A.T @ A) @ A.T
        hat[e, r] = np.diag(H)
        w[e, r] = (y - H @ y) / np.sqrt(1.0 - np.diag(H))
    return hat, w


def test_redundancies_are_those_of_the_dense_hat_matrix() -> None:
    sky = SKIES["four"]
    of = sky.design()
    np.testing.assert_allclose(shares(of, sky.los_enu).redundancy, 1.0 - dense(sky)[0], atol=1e-12)


def test_normalised_residuals_are_those_of_the_dense_hat_matrix() -> None:
    sky = SKIES["four"]
    of, _, postfit = sky.solved()
    np.testing.assert_allclose(normalised(of, shares(of, sky.los_enu), postfit), dense(sky)[1], atol=1e-9)


def test_a_lone_satellite_has_no_normalised_residual() -> None:
    sky = SKIES["a lone satellite"]
    of, _, postfit = sky.solved()
    assert np.isnan(normalised(of, shares(of, sky.los_enu), postfit)[..., -1]).all()


def test_separation_variances_are_differences_of_covariances() -> None:
    sky = SKIES["two constellations"]
    of, found, _ = sky.solved()
    sigma_m = separation_sigma_m(shares(of, sky.los_enu))
    for i in range(len(sky.system_of)):
        less_variance = solution(sky.design(less(sky, i)), sky.residual_m).cov_enu_m2 - found.cov_enu_m2
        np.testing.assert_allclose(sigma_m[..., i] ** 2, np.moveaxis(np.diagonal(less_variance, axis1=-2, axis2=-1), -1, 0), atol=1e-9)


def test_a_lone_satellite_separates_nothing() -> None:
    sky = SKIES["a lone satellite"]
    assert (separation_sigma_m(shares(sky.design(), sky.los_enu))[..., -1] == 0.0).all()
