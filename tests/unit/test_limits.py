"""Thresholds that keep what the site promises: the figures of section 1.3 and 2.1, the budget of false stops, the refusals."""

from dataclasses import replace
from math import exp, sqrt

import numpy as np
import pytest

from integrity.assembler import nominal_epoch_ns
from integrity.carrier_thresholds import CARRIER_CHECKS, CORRELATION_S
from integrity.config import IntegrityConfig, ReceiverConfig, SiteConfig
from integrity.episodes import Errors, position_regions, stops_per_look, stops_seen_by_all_per_look
from integrity.errors import ConfigError
from integrity.gnss.frames import ecef_from_geodetic, enu_axes
from integrity.gnss.gps_time import NS_PER_S
from integrity.limits import Limits, alignment_tolerance_ns
from integrity.monitors.slow import gain, mean_run_length
from integrity.probability import chi2_quantile, detectable_noncentrality, episodes_per_look
from integrity.thresholds import ALLOWANCE, STANDING, Promises, collapse_separation
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


OF_POSITIONS = ("circle_A", "circle_B", "circle_C", "common", "common_3d", "shape", "shape_3d", "collapse")
OF_SATELLITES = ("residual", "constellation", "ephemeris", *CARRIER_CHECKS)


def with_promises(**changes: object) -> SiteConfig:
    return replace(SITE, integrity=replace(SITE.integrity, **changes))  # type: ignore[arg-type]


def of_positions(site: SiteConfig, limits: Limits) -> float:
    """Stops a year by circles, common position, shape and collapse together, from their thresholds: a sum over 4,096 paths of each."""
    of, p = Promises(site, reference_triangle(site)), site.integrity
    common_m = p.sigma_common_m, p.sigma_common_m, p.sigma_common_up_m
    own_m = p.sigma_differential_m, p.sigma_differential_m, p.sigma_differential_up_m
    tails = {name: limits.by_name[name].false_alarm_probability for name in OF_POSITIONS}
    regions = position_regions(common_m, own_m, of.triangle.baseline_enu_m.tolist(), {**tails, "circle": tails["circle_A"]})
    thresholds = [limits[name] for name in OF_POSITIONS]
    in_sigmas = [sqrt(t) if 3 <= i < 7 else t / np.hypot(common_m[0], own_m[0]) if i < 3 else t for i, t in enumerate(thresholds)]
    assert [region.threshold for region in regions] == pytest.approx(in_sigmas, rel=1e-9)
    seconds = (p.correlation_common_s,) * 3 + (p.correlation_differential_s,) * 9
    return of.looks_per_year * stops_per_look(regions, Errors(seconds, of.interval_s, of.clear), 4096)


def alarms_a_year(name: str, site: SiteConfig, limits: Limits) -> float:
    """How often alarms of a check by itself begin, from the threshold itself."""
    of, threshold = Promises(site, reference_triangle(site)), limits[name]
    looks = of.looks_per_year
    if name == "slow":  # both sides of three axes of three receivers that stand off as far as they may
        reference = (ALLOWANCE - STANDING) * gain(site.epoch_interval_ns, site.integrity.correlation_differential_s)
        return 18 * looks / mean_run_length(threshold, -reference)
    if name == "residual":
        sigma_m, own_m = of.sky_m
        errors = Errors((of.integrity.correlation_common_s,) + (of.integrity.correlation_differential_s,) * 3, of.interval_s, of.clear)
        commons = (1.0 - (own_m[:-1] / sigma_m[:-1]) ** 2).tolist()
        return of.satellites * looks * stops_seen_by_all_per_look(threshold, commons, 3, errors, 2048)
    dof = 3 if name in ("constellation", "ephemeris") else 1
    p = limits.by_name[name].false_alarm_probability * (2.0 if name == "capture" else 1.0)  # capture: only towards the point
    assert chi2_quantile(p, dof) == pytest.approx(threshold if name == "constellation" else threshold**2, rel=1e-9)
    if name == "ephemeris":  # each set is looked at once
        return of.uploads_per_year * p
    members = {"b_value": of.satellites * 3.0, "constellation": len(of.scales), "capture": 0.5 * 3 * (len(of.scales) + 1)}
    remembers_s = {"constellation": site.integrity.correlation_common_s, **CORRELATION_S}.get(
        name, site.integrity.correlation_differential_s
    )
    correlation = exp(-of.interval_s / remembers_s) if remembers_s else 0.0
    return members.get(name, of.satellites) * looks * episodes_per_look(p, dof, correlation, of.clear)


def statistical(limits: Limits) -> list[str]:
    return [t.name for t in limits.thresholds if t.false_alarm_probability > 0.0 or t.name == "slow"]


PATHS_TO = 0.05  # of a rate that is a sum over paths
INTERVALS_S, PROMISES = [0.1, 1.0, 30.0], [0.1, 1.0, 52.0, 365.25, 3652.5]


@pytest.mark.parametrize("promise", PROMISES)
@pytest.mark.parametrize("interval_s", INTERVALS_S)
def test_all_that_can_stop_stops_as_often_as_promised(promise: float, interval_s: float) -> None:
    site = a_site(interval_s, integrity=IntegrityConfig(false_stops_per_year=promise))
    limits = limits_of(site)
    names = [name for name in statistical(limits) if name not in OF_POSITIONS and name != "b_value"]
    stops = of_positions(site, limits) + sum(alarms_a_year(name, site, limits) for name in names)
    assert stops == pytest.approx(promise, rel=PATHS_TO)


@pytest.mark.parametrize("promise", PROMISES)
@pytest.mark.parametrize("interval_s", INTERVALS_S)
def test_false_exclusions_have_a_budget_of_their_own(promise: float, interval_s: float) -> None:
    promises = IntegrityConfig(on_satellite_fault="exclude", false_stops_per_year=1.0, false_exclusions_per_year=promise)
    site = a_site(interval_s, integrity=promises)
    limits = limits_of(site)
    assert sum(alarms_a_year(name, site, limits) for name in (*OF_SATELLITES, "b_value")) == pytest.approx(promise, rel=PATHS_TO)


SIGMAS = {"sigma_common_m": 0.2, "sigma_common_up_m": 0.4, "sigma_differential_m": 1.0, "sigma_differential_up_m": 2.0}


@pytest.mark.parametrize(
    "changes",
    [{}, SIGMAS, {"sigma_common_m": 2.5, "sigma_common_up_m": 5.0}, {"correlation_common_s": 3.0}, {"correlation_common_s": 600.0}],
)
@pytest.mark.parametrize("recover_after_s", [5.0, 30.0, 600.0])
def test_where_satellites_are_excluded_the_other_checks_share_the_stops(changes: dict[str, float], recover_after_s: float) -> None:
    site = with_promises(on_satellite_fault="exclude", recover_after_s=recover_after_s, **changes)
    limits = limits_of(site)
    stops = of_positions(site, limits) + alarms_a_year("capture", site, limits) + alarms_a_year("slow", site, limits)
    assert stops == pytest.approx(1.0, rel=PATHS_TO)


def test_a_range_that_is_left_out_stops_nothing_and_costs_no_stops() -> None:
    # The B-value leaves out one range, whatever the policy: its threshold follows the false exclusions alone.
    values = {limits_of(with_promises(false_stops_per_year=stops))["b_value"] for stops in (0.01, 1.0, 100.0)}
    assert len(values) == 1


def test_one_constellation_alone_leaves_its_share_to_the_others() -> None:
    site = with_promises(on_satellite_fault="stop", systems=("Galileo",))
    limits = limits_of(site)
    names = [name for name in statistical(limits) if name not in (*OF_POSITIONS, "b_value", "constellation")]
    assert of_positions(site, limits) + sum(alarms_a_year(name, site, limits) for name in names) == pytest.approx(1.0, rel=PATHS_TO)


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
    stricter = limits_of(with_promises(false_stops_per_year=fewer, false_exclusions_per_year=fewer))
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
