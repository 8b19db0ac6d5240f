"""Every threshold, derived from what the site promises; the only file in which a threshold is set.

The promise of false stops is split evenly over the families of checks that can stop (circles, common position, shape, collapse,
B-values, and satellite residuals where the site stops for a satellite), then over the members of each family. Each share becomes a
probability per look by the rate at which correlated errors cross a threshold (`probability.tail_for_alarm_rate`).
Section numbers are those of the project's notes on ground integrity; "own choice" marks what no source prescribes.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from math import exp, log, sqrt

import numpy as np

from integrity.config import SiteConfig
from integrity.errors import ConfigError
from integrity.gnss.gps_time import NS_PER_S
from integrity.gnss.observations import Bools, Floats, Ints
from integrity.probability import chi2_quantile, detectable_noncentrality, gauss_quantile, tail_for_alarm_rate
from integrity.states import Outcome
from integrity.triangle import ReferenceTriangle

YEAR_S = 31_557_600.0
# Of each system, satellites at once above 5 deg where most of them are: they share the budget of the checks per satellite. Own count.
MOST_IN_VIEW = {"GPS": 13, "Galileo": 11, "BeiDou": 25, "QZSS": 5, "GLONASS": 11}
REFERENCE_ELEVATION_RAD = np.deg2rad(45.0)  # for the smallest faults per satellite that `check` prints


@dataclass(frozen=True)
class Threshold:
    """One check: it passes only where statistic <= value. `smallest_fault` is caught with 1 - missed_detection in one epoch."""

    name: str
    value: float
    unit: str
    required: bool
    false_alarm_probability: float
    smallest_fault: float | None
    fault_unit: str
    reason: str
    source: str


@dataclass(frozen=True)
class Limits:
    """What `derive` makes of a site. Besides the checks: limits of screening, naming, and time."""

    thresholds: tuple[Threshold, ...]
    radius_m: float
    isolation: float  # naming (i), on t_j, chi-square with 3 degrees of freedom
    pair: float  # naming (ii), on T_pair
    log_likelihood_ratio: float  # naming (iv)
    jump_log_likelihood_ratio: float  # the same for what moved: stricter, since it comes on top of (iv)
    collapse_fit: float  # the solved points are one point: chi-square with 6 degrees of freedom
    undetected_sigmas: float  # of a satellite's range: what residuals miss with the accepted probability; section 2.3, E_i
    min_common_satellites: int
    max_exclusions_per_epoch: int
    elevation_mask_rad: float
    min_cn0_dbhz: float
    pseudorange_range_m: tuple[float, float]
    remember_satellite_ns: int
    loss_elevation_rad: float
    alignment_tolerance_ns: int
    same_time_ns: int  # receivers of one kind tag an epoch within a few ms of each other; own choice
    silence_ns: int
    recover_after_ns: int
    recover_epochs: int
    by_name: Mapping[str, Threshold] = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "by_name", {t.name: t for t in self.thresholds})
        for array in (self.values, self.required, self.without_result):
            array.setflags(write=False)

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Of all checks, (C,)."""
        return tuple(t.name for t in self.thresholds)

    @cached_property
    def values(self) -> Floats:
        """Thresholds of all checks, (C,)."""
        return np.array([t.value for t in self.thresholds])

    @cached_property
    def required(self) -> Bools:
        """Which checks must have a result, (C,)."""
        return np.array([t.required for t in self.thresholds])

    @cached_property
    def without_result(self) -> Ints:
        """The `Outcome` of each check that has no result, (C,)."""
        return np.where(self.required, int(Outcome.UNKNOWN), int(Outcome.NOT_MONITORED))

    def __getitem__(self, name: str) -> float:
        """The threshold of a check."""
        return self.by_name[name].value


@lru_cache(maxsize=16)
def derive(site: SiteConfig, triangle: ReferenceTriangle) -> Limits:
    """All limits of a site; ConfigError where its promises contradict each other or its triangle."""
    promises = site.integrity
    interval_s = site.epoch_interval_ns / NS_PER_S
    looks = YEAR_S / interval_s
    a_common, a_differential = (exp(-interval_s / tau) for tau in (promises.correlation_common_s, promises.correlation_differential_s))
    var_c, var_d = promises.sigma_common_m**2, promises.sigma_differential_m**2
    sigma_circle = sqrt(var_c + var_d)
    sigma_mean, sigma_mean_up = sqrt(var_c + var_d / 3.0), sqrt(promises.sigma_common_up_m**2 + promises.sigma_differential_up_m**2 / 3.0)
    a_circle = (var_c * a_common + var_d * a_differential) / (var_c + var_d)
    a_mean = (var_c * a_common + var_d / 3.0 * a_differential) / (var_c + var_d / 3.0)
    p_md = promises.missed_detection
    k_md = gauss_quantile(p_md)

    full = promises.rule == "full"
    stops_for_satellite = promises.on_satellite_fault == "stop"
    families = 5 + stops_for_satellite  # whatever the rule: the triangle alone is judged by the same thresholds
    share = promises.false_stops_per_year / families
    exclusions = share if stops_for_satellite else promises.false_exclusions_per_year
    n = len(site.receivers)

    def tail(alarms_per_year: float, dof: int, correlation: float) -> float:
        return tail_for_alarm_rate(alarms_per_year, looks, dof, correlation)

    checks: list[Threshold] = []

    def add(
        name: str, value: float, unit: str, p: float, smallest: float | None, fault_unit: str, reason: str, source: str, required: bool
    ) -> None:
        checks.append(Threshold(name, value, unit, required, p, smallest, fault_unit, reason, source))

    add("data", 0.0, "satellites missing", 0.0, None, "", "five common satellites", "2.2; own choice of five", True)
    add("repeat", 0.0, "receivers", 0.0, None, "", "a receiver whose ranges all repeat is frozen", "own choice", False)

    p = tail(share / n, 2, a_circle)
    k_circle = sqrt(chi2_quantile(p, 2))
    radius = k_circle * sigma_circle
    fault = sigma_circle * sqrt(detectable_noncentrality(k_circle**2, 2, p_md))
    for name in site.receiver_names:
        reason = "tolerance circle: solved position from surveyed point, horizontal"
        add(f"circle_{name}", radius, "m", p, fault, "m at one receiver", reason, "2.1", True)
    _refuse_beyond_tolerance(promises.tolerance_m, radius, k_circle, k_md, sigma_circle)

    for name, dof, correlation, sigma, fault_unit in (
        ("common", 2, a_mean, sigma_mean, "m of the whole triangle, horizontal"),
        ("common_3d", 3, a_mean, sigma_mean_up, "m of the whole triangle, up"),
    ):
        p = tail(share / 2.0, dof, correlation)
        T = chi2_quantile(p, dof)
        fault = sigma * sqrt(detectable_noncentrality(T, dof, p_md))
        add(name, T, "chi-square", p, fault, fault_unit, "mean of the three displacements", "2.2, T_c", full)
    for name, dof, sigma, fault_unit in (
        ("shape", 4, promises.sigma_differential_m, "m at one receiver, horizontal"),
        ("shape_3d", 6, promises.sigma_differential_up_m, "m at one receiver, up"),
    ):
        p = tail(share / 2.0, dof, a_differential)
        T = chi2_quantile(p, dof)
        fault = sigma * sqrt(1.5 * detectable_noncentrality(T, dof, p_md))
        add(name, T, "chi-square", p, fault, fault_unit, "solved against reference triangle", "2.2, T_d", full or name == "shape")

    p_two_sided = tail(2.0 * share, 1, a_differential)
    k_collapse = sqrt(chi2_quantile(p_two_sided, 1))
    separation = collapse_separation(site, triangle)
    if separation < k_collapse + k_md:
        raise ConfigError(
            f"the collapse test cannot keep its promise: the triangle separates one transmitter from three receivers by {separation:.1f} "
            f"sigma, {k_collapse + k_md:.1f} are needed; move the receivers apart by a factor {(k_collapse + k_md) / separation:.1f}, "
            "or show with data that sigma_differential_m is smaller"
        )
    reason = f"all receivers see one transmitter; the triangle is {separation:.0f} sigma of S away from that"
    add("collapse", k_collapse, "sigma", p_two_sided / 2.0, k_collapse + k_md, "sigma between triangle and point", reason, "2.6, S", full)

    satellites = sum(MOST_IN_VIEW[system] for system in promises.systems)
    p = tail(exclusions / satellites, 1, a_common)
    k_residual = sqrt(chi2_quantile(p, 1))
    sin_el = np.sin(REFERENCE_ELEVATION_RAD)
    sigma_range = sqrt(promises.sigma_range_m**2 + (promises.sigma_range_low_m / sin_el) ** 2)
    fault = (k_residual + k_md) * sigma_range
    reason = "smallest of the receivers' normalised residuals of one satellite: what all of them see"
    add("residual", k_residual, "sigma", p, fault, "m of range, 45 deg, URA 2.4 m", reason, "2.4; 4", full)

    p = tail(share / (satellites * n), 1, a_differential)
    k_b = sqrt(chi2_quantile(p, 1))
    sigma_range_d = sqrt(promises.sigma_range_differential_m**2 + (promises.sigma_range_differential_low_m / sin_el) ** 2)
    fault = (k_b + k_md) * sigma_range_d / sqrt(n * (n - 1)) * n
    add("b_value", k_b, "sigma", p, fault, "m of range at one receiver, 45 deg", "one receiver's range against the others", "2.3", full)

    reason = "drop of C/N0 against the last minutes, second worst receiver"
    add("cn0", 6.0, "dB", 0.0, None, "", reason, "own choice: three times the day-to-day spread of a clear site", False)
    reason = "share of tracked satellites above 15 deg that vanished, second worst receiver"
    add("loss", 0.5, "of satellites", 0.0, None, "", reason, "own choice", False)

    return Limits(
        thresholds=tuple(checks),
        radius_m=radius,
        isolation=chi2_quantile(share / looks, 3),
        pair=chi2_quantile(1e-3, 3),
        log_likelihood_ratio=log(1000.0),
        jump_log_likelihood_ratio=log(10_000.0),
        collapse_fit=chi2_quantile(min(p_md, 1e-5), 6),
        undetected_sigmas=k_residual + gauss_quantile(p_md / n),  # any one of the receivers may be the one that misses it
        min_common_satellites=5,
        max_exclusions_per_epoch=3,
        elevation_mask_rad=float(np.deg2rad(promises.elevation_mask_deg)),
        min_cn0_dbhz=25.0,
        pseudorange_range_m=(1.0e7, 1.0e8),
        remember_satellite_ns=600 * NS_PER_S,
        loss_elevation_rad=float(np.deg2rad(15.0)),
        same_time_ns=NS_PER_S // 100,
        alignment_tolerance_ns=alignment_tolerance_ns(site.epoch_interval_ns),
        silence_ns=max(2 * site.epoch_interval_ns, 2 * NS_PER_S),
        recover_after_ns=round(promises.recover_after_s * NS_PER_S),
        recover_epochs=2,
    )


def alignment_tolerance_ns(epoch_interval_ns: int) -> int:
    """How far from a nominal epoch a receiver's time tag may lie: 0.1 s, at high rates a fifth of the interval. Own choice."""
    return min(NS_PER_S // 10, epoch_interval_ns // 5)


def collapse_separation(site: SiteConfig, triangle: ReferenceTriangle) -> float:
    """sqrt(Lambda): how many sigma of S lie between the reference triangle and a single point (section 2.6)."""
    sigma_d = np.array([site.integrity.sigma_differential_m] * 2 + [site.integrity.sigma_differential_up_m])
    return float(np.sqrt(((triangle.baseline_enu_m / sigma_d) ** 2).sum()))


def _refuse_beyond_tolerance(tolerance_m: float | None, radius_m: float, k_fa: float, k_md: float, sigma_m: float) -> None:
    """Both sides of a radius (section 2.1): few false stops, and a fault larger than the line tolerates is caught."""
    needed_m = radius_m + k_md * sigma_m
    if tolerance_m is None or needed_m <= tolerance_m:
        return
    raise ConfigError(
        f"tolerance_m = {tolerance_m:g} cannot be kept: the promised false stops ask for a radius of {radius_m:.2f} m ({k_fa:.2f} sigma), "
        f"and the promised detection for {k_md:.2f} sigma more: {needed_m:.2f} m. What would do: tolerance_m = {needed_m:.1f}, or a total "
        f"horizontal sigma of {tolerance_m / (k_fa + k_md):.2f} m instead of {sigma_m:.2f} m, or weaker promises"
    )
