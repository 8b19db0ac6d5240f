"""Thresholds that keep what the site promises: the figures of section 1.3 and 2.1, the budget of false stops, the refusals."""

from dataclasses import replace
from math import exp, sqrt

import numpy as np
import pytest

from integrity.assembler import nominal_epoch_ns
from integrity.config import IntegrityConfig, ReceiverConfig, SiteConfig
from integrity.errors import ConfigError
from integrity.gnss.frames import ecef_from_geodetic, enu_axes
from integrity.gnss.gps_time import NS_PER_S
from integrity.gnss.signals import TIME_SCALES
from integrity.limits import Limits, alignment_tolerance_ns
from integrity.monitors.slow import gain, mean_run_length
from integrity.probability import chi2_quantile, detectable_noncentrality, exceeds_again
from integrity.thresholds import ALLOWANCE, MOST_IN_VIEW, STANDING, UPLOADS_PER_YEAR, YEAR_S, collapse_separation
from integrity.triangle import reference_triangle
from tests.unit.streams import LIMITS, SITE, a_site, limits_of

# The example of section 1.3: sigma_c 1.0 m, sigma_d 0.5 m, P_fa 1e-7, P_md 1e-5.
SIGMA_C, SIGMA_D, P_FA, P_MD = 1.0, 0.5, 1e-7, 1e-5
SIGMA_CIRCLE = sqrt(SIGMA_C**2 + SIGMA_D**2)


def test_example_radius() -> None:
    radius_m = SIGMA_CIRCLE * sqrt(chi2_quantile(P_FA / 3.0, 2))  # P_FA over three circles
    assert radius_m == pytest.approx(6.6, abs=0.05)


def test_example_smallest_fault_of_the_circle() -> None:
    fault_m = SIGMA_CIRCLE * sqrt(detectable_noncentrality(chi2_quantile(P_FA / 3.0, 2), 2, P_MD))
    assert fault_m == pytest.approx(11.3, abs=0.06)


def test_example_smallest_fault_of_the_shape() -> None:
    # lambda = (2/3) b^2 / sigma_d^2 for one receiver.
    fault_m = SIGMA_D * sqrt(1.5 * detectable_noncentrality(chi2_quantile(P_FA, 4), 4, P_MD))
    assert fault_m == pytest.approx(6.3, abs=0.06)


OF_SATELLITES = ("residual", "ephemeris")


def with_promises(**changes: object) -> SiteConfig:
    return replace(SITE, integrity=replace(SITE.integrity, **changes))  # type: ignore[arg-type]


def correlation(name: str, site: SiteConfig) -> float:
    """From look to look, of one component of a check's statistic, by the variances that it is made of."""
    p, interval_s = site.integrity, site.epoch_interval_ns / NS_PER_S
    a_c, a_d = exp(-interval_s / p.correlation_common_s), exp(-interval_s / p.correlation_differential_s)
    var_c, var_d = p.sigma_common_m**2, p.sigma_differential_m**2
    if name.startswith("circle_"):
        return (var_c * a_c + var_d * a_d) / (var_c + var_d)
    if name.startswith("common"):
        return (var_c * a_c + var_d / 3.0 * a_d) / (var_c + var_d / 3.0)
    return a_c if name in ("residual", "constellation") else a_d


def alarms_a_year(name: str, site: SiteConfig, limits: Limits) -> float:
    """How often a check crosses its threshold, from the threshold itself."""
    looks, threshold = YEAR_S * NS_PER_S / site.epoch_interval_ns, limits[name]
    if name == "slow":  # both sides of three axes of three receivers that stand off as far as they may
        reference = (ALLOWANCE - STANDING) * gain(site.epoch_interval_ns, site.integrity.correlation_differential_s)
        return 18 * looks / mean_run_length(threshold, -reference)
    dof = {"common": 2, "common_3d": 3, "shape": 4, "shape_3d": 6, "constellation": 3, "ephemeris": 3}.get(name, 1)
    value = threshold**2
    if name in ("common", "common_3d", "shape", "shape_3d", "constellation"):
        value = threshold
    if name.startswith("circle_"):
        dof = 2
    if name.startswith("circle_"):
        value /= site.integrity.sigma_common_m**2 + site.integrity.sigma_differential_m**2
    one_sided = name in ("collapse", "capture")  # only towards the point
    p = limits.by_name[name].false_alarm_probability * (2.0 if one_sided else 1.0)
    assert chi2_quantile(p, dof) == pytest.approx(value, rel=1e-9)
    if name == "ephemeris":  # each set is looked at once
        return UPLOADS_PER_YEAR * p
    sides = 0.5 if one_sided else 1.0
    satellites = sum(MOST_IN_VIEW[system] for system in SITE.integrity.systems)
    scales = len(TIME_SCALES)
    members = {"residual": satellites, "b_value": satellites * 3, "constellation": scales, "capture": 3 * (scales + 1)}.get(name, 1)
    return sides * members * looks * p * (1.0 - exceeds_again(value, dof, correlation(name, site)))


def statistical(limits: Limits) -> list[str]:
    return [t.name for t in limits.thresholds if t.false_alarm_probability > 0.0 or t.name == "slow"]


@pytest.mark.parametrize("promise", [0.1, 1.0, 52.0, 365.25])
@pytest.mark.parametrize("interval_s", [0.1, 1.0, 30.0])
def test_all_checks_together_stop_as_often_as_promised(promise: float, interval_s: float) -> None:
    site = a_site(interval_s, integrity=IntegrityConfig(false_stops_per_year=promise))
    limits = limits_of(site)
    assert sum(alarms_a_year(name, site, limits) for name in statistical(limits)) == pytest.approx(promise, rel=1e-6)


def test_false_exclusions_have_a_budget_of_their_own() -> None:
    site = with_promises(on_satellite_fault="exclude", false_stops_per_year=1.0, false_exclusions_per_year=12.0)
    limits = limits_of(site)
    assert sum(alarms_a_year(name, site, limits) for name in OF_SATELLITES) == pytest.approx(12.0, rel=1e-6)


def test_where_satellites_are_excluded_the_other_checks_share_the_stops() -> None:
    site = with_promises(on_satellite_fault="exclude", false_stops_per_year=1.0, false_exclusions_per_year=12.0)
    limits = limits_of(site)
    stops = sum(alarms_a_year(name, site, limits) for name in statistical(limits) if name not in OF_SATELLITES)
    assert stops == pytest.approx(1.0, rel=1e-6)


def test_the_rule_of_the_source_uses_the_thresholds_of_full() -> None:
    # The promise of `rule = "triangle"`: circles and shape, thresholds as in `full`.
    by_rule = [{t.name: t.value for t in limits_of(with_promises(rule=rule)).thresholds} for rule in ("full", "triangle")]
    assert by_rule[0] == by_rule[1]


REQUIRED = {"data", "circle_A", "circle_B", "circle_C", "common", "common_3d", "shape", "shape_3d", "collapse", "residual", "b_value"}


@pytest.mark.parametrize(("rule", "expected"), [("full", REQUIRED), ("triangle", {"data", "circle_A", "circle_B", "circle_C", "shape"})])
def test_required_checks(rule: str, expected: set[str]) -> None:
    assert {t.name for t in limits_of(with_promises(rule=rule)).thresholds if t.required} == expected


def test_radius_is_the_threshold_of_every_circle() -> None:
    assert {LIMITS[f"circle_{name}"] for name in "ABC"} == {LIMITS.radius_m}


def test_radius_is_proportional_to_the_total_sigma() -> None:
    # The same share of common error keeps the correlation, hence k.
    twice = limits_of(with_promises(sigma_common_m=2.4, sigma_differential_m=1.0))
    assert twice.radius_m == pytest.approx(2.0 * LIMITS.radius_m, rel=1e-9)


@pytest.mark.parametrize("fewer", [0.1, 0.01])
def test_fewer_false_stops_raise_every_statistical_threshold(fewer: float) -> None:
    stricter = limits_of(with_promises(false_stops_per_year=fewer))
    assert all(stricter[name] > LIMITS[name] for name in statistical(LIMITS))


def test_better_detection_raises_the_smallest_faults_only() -> None:
    better, at_once = limits_of(with_promises(missed_detection=1e-7)), [n for n in statistical(LIMITS) if n != "slow"]
    assert all((better.by_name[n].smallest_fault or 0.0) > (LIMITS.by_name[n].smallest_fault or 0.0) for n in at_once)
    assert [better[n] for n in statistical(LIMITS)] == [LIMITS[n] for n in statistical(LIMITS)]


def test_the_sample_that_must_be_refused() -> None:
    # Section 2.1: tolerance 6.0 m with sigma_c 1.0, sigma_d 0.5.
    with pytest.raises(ConfigError, match=r"tolerance_m = 6 cannot be kept"):
        limits_of(with_promises(tolerance_m=6.0, sigma_common_m=1.0, sigma_differential_m=0.5))


def test_a_refused_tolerance_names_one_that_would_do() -> None:
    with pytest.raises(ConfigError) as refusal:
        limits_of(with_promises(tolerance_m=6.0))
    offered_m = float(str(refusal.value).split("What would do: tolerance_m = ")[1].split(",")[0])
    assert limits_of(with_promises(tolerance_m=offered_m + 0.05)).radius_m == LIMITS.radius_m


@pytest.mark.parametrize(("ulps", "kept"), [(-1, False), (0, True), (1, True)])
def test_tolerance_at_its_bound(ulps: int, kept: bool) -> None:
    sigma_m, k_md = sqrt(SITE.integrity.sigma_common_m**2 + SITE.integrity.sigma_differential_m**2), 4.264890793922825
    bound_m = LIMITS.radius_m + k_md * sigma_m
    tolerance_m = bound_m if ulps == 0 else float(np.nextafter(bound_m, np.inf * ulps))
    try:
        limits_of(with_promises(tolerance_m=tolerance_m))
    except ConfigError:
        assert not kept
    else:
        assert kept


def equilateral(side_m: float) -> SiteConfig:
    """A level equilateral triangle with its corner A near Tokyo."""
    lat, lon = np.deg2rad(35.7), np.deg2rad(139.5)
    origin, axes = ecef_from_geodetic(lat, lon, 100.0), enu_axes(np.array(lat), np.array(lon))
    corners = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.5, sqrt(0.75), 0.0]]) * side_m
    points = (tuple((origin + corner @ axes).tolist()) for corner in corners)
    return replace(SITE, receivers=tuple(ReceiverConfig(name, point) for name, point in zip("ABC", points, strict=True)))


@pytest.mark.parametrize("side_m", [6.0, 20.0, 120.0])
def test_collapse_separation_of_an_equilateral_triangle(side_m: float) -> None:
    site = equilateral(side_m)
    # Section 2.6: L / sigma_d.
    assert collapse_separation(site, reference_triangle(site)) == pytest.approx(side_m / site.integrity.sigma_differential_m, rel=1e-6)


def test_collapse_separation_of_any_triangle_is_that_of_its_sides() -> None:
    site = replace(SITE, integrity=replace(SITE.integrity, sigma_differential_up_m=SITE.integrity.sigma_differential_m))
    triangle = reference_triangle(site)
    sides = np.array(list(triangle.sides_m.values()))
    # Section 2.6: Lambda = (a^2 + b^2 + c^2) / (3 sigma_d^2).
    expected = sqrt((sides**2).sum() / 3.0) / site.integrity.sigma_differential_m
    assert collapse_separation(site, triangle) == pytest.approx(expected, rel=1e-9)


def test_a_triangle_too_small_for_the_collapse_test_is_refused() -> None:
    with pytest.raises(ConfigError, match="collapse test cannot keep its promise"):
        limits_of(equilateral(4.0))


def test_six_metres_are_enough_for_the_collapse_test() -> None:
    assert limits_of(equilateral(6.0))["collapse"] < 6.0


@pytest.mark.parametrize(("interval_s", "silent_s"), [(0.1, 2.0), (1.0, 2.0), (30.0, 60.0)])
def test_a_stream_is_silent_after_two_intervals_or_two_seconds(interval_s: float, silent_s: float) -> None:
    assert limits_of(a_site(interval_s)).silence_ns == silent_s * NS_PER_S


@pytest.mark.parametrize("interval_s", [0.05, 0.1, 0.2, 1.0, 30.0])
def test_a_row_within_tolerance_belongs_to_one_epoch_only(interval_s: float) -> None:
    interval_ns = round(interval_s * NS_PER_S)
    late = 10**18 // interval_ns * interval_ns + alignment_tolerance_ns(interval_ns)
    assert nominal_epoch_ns(late, interval_ns) == 10**18 // interval_ns * interval_ns


def test_an_unknown_check_has_no_threshold() -> None:
    with pytest.raises(KeyError):
        LIMITS["circle_D"]
