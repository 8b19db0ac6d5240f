"""Detection and exclusion on made-up skies: which satellite must go, and what is refused. Thresholds are checked with tables."""

import numpy as np
import pytest

from integrity.gnss.detection import Checked, Criteria, Finding, criteria, detect_and_exclude, told_apart
from integrity.gnss.least_squares import Unsolved, solution
from integrity.gnss.observations import Bools, Floats
from tests.unit.gnss.skies import N_SYSTEMS, MadeSky, made_sky

LIMITS = criteria(false_alarm=1e-7, most_excluded=3, confusable=0.85, confusion=1e-3)


def checked(sky: MadeSky, limits: Criteria = LIMITS) -> Checked:
    return detect_and_exclude(sky.design(), sky.los_enu, sky.residual_m, limits)


def with_faults(sky: MadeSky, **fault_m: float) -> MadeSky:
    """The sky with ranges that are too long: `s3=100.0` that of satellite 3."""
    residual_m = sky.residual_m.copy()
    for name, metres in fault_m.items():
        residual_m[..., int(name[1:])] += metres
    return sky._replace(residual_m=residual_m)


def only(sky: MadeSky, *satellites: int) -> Bools:
    expected = np.zeros_like(sky.used)
    expected[..., satellites] = True
    return expected


def test_chi_square_thresholds_are_those_of_the_tables() -> None:
    """At twice 1e-4, half of which is the chi-square's: 15.14, 18.42, 21.11, 23.51, 25.74, 27.86 for 1 to 6 degrees of freedom."""
    np.testing.assert_allclose(criteria(2e-4, 1, 0.85, 1e-3).chi2[1:7], [15.14, 18.42, 21.11, 23.51, 25.74, 27.86], atol=0.005)


def test_the_largest_residual_of_ten_has_a_tenth_of_the_false_alarms() -> None:
    """Two-sided 1e-5 is 4.417 sigma (tables of the normal distribution)."""
    assert criteria(2e-4, 1, 0.85, 1e-3).largest[10] == pytest.approx(4.4172, abs=1e-4)


def test_good_ranges_pass() -> None:
    assert (checked(made_sky(1, epochs=200)).finding == Finding.PASSED).all()


@pytest.mark.parametrize("satellites", [(8, 6), (9,), (7, 5, 4, 3)])
@pytest.mark.parametrize("fault_m", [60.0, -60.0, 1e7])
def test_the_faulty_satellite_goes_and_no_other(satellites: tuple[int, ...], fault_m: float) -> None:
    sky = with_faults(made_sky(2, satellites, epochs=1, noise=0.3), s2=fault_m)
    np.testing.assert_array_equal(checked(sky).excluded, only(sky, 2))


def test_two_faults_go() -> None:
    sky = with_faults(made_sky(3, (12, 10), noise=0.3), s1=80.0, s15=-200.0)
    np.testing.assert_array_equal(checked(sky).excluded, only(sky, 1, 15))


def test_what_remains_is_solved_as_without_them() -> None:
    sky = with_faults(made_sky(3, (12, 10), noise=0.3), s1=80.0, s15=-200.0)
    again = solution(sky.design(sky.used & ~only(sky, 1, 15)), sky.residual_m)
    found = checked(sky).found
    for name in ("e_enu_m", "clock_m", "cov_enu_m2", "n_used", "why"):
        np.testing.assert_allclose(getattr(found, name), getattr(again, name), rtol=0.0, atol=1e-9, err_msg=name)


def test_the_statistics_are_those_of_what_remains() -> None:
    sky = with_faults(made_sky(3, (12, 10), noise=0.3), s1=80.0, s15=-200.0)
    _, _, postfit = sky.solved(sky.used & ~only(sky, 1, 15))
    normalised = np.where(only(sky, 1, 15), 0.0, postfit / sky.sigma_m)
    np.testing.assert_allclose(checked(sky).chi2, (normalised**2).sum(axis=-1), rtol=1e-9)


def test_one_large_residual_is_not_hidden_among_sixty() -> None:
    """Seven sigma in one range of sixty: the sum of squares, near 100 with a threshold of 146, does not show it."""
    sky = made_sky(4, (30, 30), epochs=1, receivers=1, noise=0.0)
    sky = with_faults(sky, s5=7.0 * float(sky.sigma_m[0, 0, 5]) * 1.05)
    assert checked(sky).excluded[0, 0, 5]


def test_faults_beyond_the_limit_are_too_many() -> None:
    sky = with_faults(made_sky(5, (14, 12), epochs=1, receivers=1, noise=0.1), s0=300.0, s4=-500.0, s9=800.0, s20=-1200.0)
    assert checked(sky).finding.item() == Finding.TOO_MANY


def test_ranges_none_of_which_stands_out_are_unexplained() -> None:
    """Sigmas four times too small for all: the sum of squares fails, no single residual is beyond its threshold."""
    sky = made_sky(6, (8, 6), epochs=1, receivers=1)
    result = checked(sky, Criteria(LIMITS.chi2 / 100.0, LIMITS.largest, 3, 0.85, LIMITS.margin))
    assert result.finding.item() == Finding.UNEXPLAINED


def test_with_one_range_more_than_unknowns_nobody_can_be_told_apart() -> None:
    """One degree of freedom: all residuals are the same number, their correlations are one."""
    sky = with_faults(made_sky(7, (5,), epochs=1, receivers=1, noise=0.3), s2=1e4)
    assert checked(sky).finding.item() == Finding.AMBIGUOUS


@pytest.mark.parametrize("fault_m", [1e4, 1e6, 1e9])
def test_rounding_tells_nobody_apart(fault_m: float) -> None:
    sky = with_faults(made_sky(7, (5,), epochs=100, receivers=1, noise=0.3), s2=fault_m)
    assert (checked(sky).finding == Finding.AMBIGUOUS).all()


def test_all_who_cannot_be_told_apart_are_suspects() -> None:
    sky = with_faults(made_sky(7, (5,), epochs=1, receivers=1, noise=0.3), s2=1e4)
    assert checked(sky).suspects.all()


def twins(fault_sigmas: float) -> tuple[MadeSky, int]:
    """A sky of six satellites, two of which have residuals with a correlation of 0.9 to 0.97, and the first of these two.

    Without noise; the fault of that one is `fault_sigmas` of its residual.
    """
    for seed in range(1000):
        sky = made_sky(seed, (6,), epochs=1, receivers=1, noise=0.0)
        A = np.hstack((-sky.los_enu[:, 0, 0].T, np.ones((6, 1)))) / sky.sigma_m[0, 0][:, None]
        S = np.eye(6) - A @ np.linalg.inv(A.T @ A) @ A.T
        correlation = np.abs(S) / np.sqrt(np.outer(np.diag(S), np.diag(S))) - np.eye(6)
        j = int(correlation.max(axis=1).argmax())
        if 0.9 < correlation[j].max() < 0.97:
            fault_m = fault_sigmas * sky.sigma_m[0, 0, j] / np.sqrt(S[j, j])
            return with_faults(sky, **{f"s{j}": float(fault_m)}), j
    raise AssertionError("no such sky")


def test_of_two_correlated_residuals_nearly_as_large_none_is_left_out() -> None:
    assert checked(twins(8.0)[0]).finding.item() == Finding.AMBIGUOUS


def test_a_fault_large_enough_is_told_from_its_twin() -> None:
    sky, j = twins(80.0)
    np.testing.assert_array_equal(checked(sky).excluded, only(sky, j))


def test_no_exclusion_without_redundancy_left_to_check_it() -> None:
    """Two faults in seven ranges of one constellation: the second exclusion would leave one degree of freedom, the third none."""
    sky = with_faults(made_sky(9, (6,), epochs=40, receivers=1, noise=0.1), s0=500.0, s3=-700.0)
    assert not (checked(sky).finding == Finding.PASSED).any()


def test_what_remains_without_redundancy_is_not_verified() -> None:
    """Were residuals with a correlation of one told apart, an exclusion would leave as many ranges as unknowns."""
    sky = with_faults(made_sky(7, (5,), epochs=1, receivers=1, noise=0.3), s2=1e4)
    assert checked(sky, Criteria(LIMITS.chi2, LIMITS.largest, 3, 2.0, LIMITS.margin)).finding.item() == Finding.UNVERIFIED


def test_what_remains_with_a_poor_geometry_is_not_verified() -> None:
    """A ring at one elevation, but for a thousandth, and one satellite above, without which height and clock are one."""
    az_rad = np.arange(8) * (2.0 * np.pi / 7.0)
    up = 0.2 + 1e-3 * np.cos(2.0 * az_rad)
    up[7] = 1.0
    level = np.sqrt(1.0 - up**2)
    los_enu = np.array((level * np.sin(az_rad), level * np.cos(az_rad), up))[:, None, None]
    sky = made_sky(6, (8,), epochs=1, receivers=1, noise=0.0)
    still = sky._replace(los_enu=los_enu, sigma_m=np.ones((1, 1, 8)), residual_m=np.zeros((1, 1, 8)))
    assert checked(with_faults(still, s7=1e6)).finding.item() == Finding.UNVERIFIED


@pytest.mark.parametrize(("satellites", "kept"), [((8, 1), 8), ((8, 2), 8), ((8, 3), 11), ((2, 2), 0)])
def test_constellations_of_one_or_two_are_left_out(satellites: tuple[int, int], kept: int) -> None:
    sky = made_sky(12, satellites)
    assert (told_apart(sky.used, sky.system_of, N_SYSTEMS).sum(axis=-1) == kept).all()


def test_of_two_in_a_constellation_nobody_is_named() -> None:
    sky = with_faults(made_sky(12, (8, 2), noise=0.3), s9=100.0)
    assert (checked(sky).finding == Finding.AMBIGUOUS).all()


def test_as_many_ranges_as_unknowns_are_unchecked() -> None:
    assert (checked(made_sky(10, (4,))).finding == Finding.UNCHECKED).all()


def test_too_few_ranges_are_unchecked() -> None:
    result = checked(made_sky(10, (3,)))
    assert (result.found.why == Unsolved.TOO_FEW_SATELLITES).all()
    assert (result.finding == Finding.UNCHECKED).all()


def on_boundary(steps: int) -> int:
    """The finding with a chi-square threshold so many ulps from the statistic."""
    sky = made_sky(11, (8, 6), epochs=1, receivers=1)
    statistic: Floats = checked(sky).chi2.ravel()
    threshold = statistic.copy()
    for _ in range(abs(steps)):
        threshold = np.nextafter(threshold, np.inf if steps > 0 else -np.inf)
    limits = Criteria(np.full_like(LIMITS.chi2, threshold[0]), LIMITS.largest, 3, 0.85, LIMITS.margin)
    return int(checked(sky, limits).finding.item())


@pytest.mark.parametrize(("steps", "finding"), [(-1, Finding.UNEXPLAINED), (0, Finding.PASSED), (1, Finding.PASSED)])
def test_at_the_threshold_a_position_passes(steps: int, finding: Finding) -> None:
    assert on_boundary(steps) == finding
