"""The thresholds of all checks, family by family, each from its share of what the site promises.

What a false alarm does decides which promise it counts against:

    stops the line     circles, common, shape, collapse share the false stops evenly; capture and slow, which sound receivers hardly ever
                       set off, get `RARE_SHARE` each
    names a satellite  residual, constellation, ephemeris, motion, code_carrier: where the site stops for a satellite, families like the
                       four above; where it leaves the satellite out, they share the false exclusions
    names one range    b_value: that of one receiver is left out of the epoch; a false exclusion, whatever the policy

A family's share is split evenly over its members: receivers, satellites, constellations. What counts is how often stops begin, not how
often a threshold is crossed: alarms that follow each other before the line runs again are one stop. For a check that sees errors of its
own this has a formula (`probability.episodes_per_look`). Circles, common, shape and collapse see the same errors, most of all the common
ones: one displacement sets off several of them, so all their tails are raised by one factor until together they stop as often as their
shares say (`episodes.stops_per_look`). Between other families the sum is taken (Bonferroni): they see errors of other ranges, clocks and
times.

Section numbers are those of the project's notes on ground integrity; "own choice" marks what no source prescribes.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from math import ceil, exp, sqrt

import numpy as np

from integrity.config import IntegrityConfig, SiteConfig
from integrity.episodes import Errors, missed_by_one, position_tails, residual_threshold, tail_seen_by_all
from integrity.errors import ConfigError
from integrity.gnss.gps_time import DAY_S, NS_PER_S
from integrity.gnss.observations import Floats
from integrity.gnss.positioning import range_sigma_m
from integrity.gnss.signals import TIME_SCALES
from integrity.monitors.slow import SlowDesign, slow_design, time_to_detect_s
from integrity.probability import chi2_quantile, detectable_noncentrality, gauss_quantile, tail_for_episode_rate
from integrity.triangle import ReferenceTriangle

YEAR_S = 31_557_600.0
# Of each system, satellites at once above 5 deg where most of them are: they share the budget of the checks per satellite. Own count.
MOST_IN_VIEW = {"GPS": 13, "Galileo": 11, "BeiDou": 25, "QZSS": 5, "GLONASS": 11}
REFERENCE_ELEVATION_RAD = np.deg2rad(45.0)  # for the smallest faults per satellite that `check` prints
# The sky that smallest faults are stated for, of one constellation: eight satellites evenly spread over it above 5 deg, and last the one at
# fault. Own choice.
REFERENCE_SKY_RAD = np.append(np.arcsin(np.sin(np.deg2rad(5.0)) + (np.arange(8) + 0.5) / 8 * (1.0 - np.sin(np.deg2rad(5.0)))), np.pi / 4)
POSITION_FAMILIES = ("circles", "common", "shape", "collapse")
RARE_FAMILIES = ("capture", "slow")
SATELLITE_FAMILIES = ("residual", "constellation", "ephemeris", "motion", "code_carrier")
# Of the false stops, for a family of `RARE_FAMILIES`. Receivers that stand off as far as `slow` allows for, or pairs so close that
# `capture` needs its least threshold, use it up; others leave 2 % of the promise unused. Own choice.
RARE_SHARE = 0.01
RECOVER_EPOCHS = 2  # at least, without an alarm
SETS_A_DAY = {
    "GPS": 12,
    "Galileo": 144,
    "BeiDou": 24,
    "QZSS": 24,
    "GLONASS": 48,
}  # of a satellite, that begin to serve; by navigation files
EPHEMERIS_REISSUED_M = 0.01  # the last bit of an orbit is 0.03 m: IS-GPS-200, table 20-III
STANDING, ALLOWANCE = 0.5, 1.0  # of `monitors.slow`: what real receivers stand off for good, and what is promised to be found. Own choice
HOST_TIME_S = 2.0  # half of what delays and leap seconds explain: `monitors.clocks`


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
class Promises:
    """What a site promises, as the thresholds need it: shares of false stops, correlations from look to look, sigmas, m."""

    site: SiteConfig
    triangle: ReferenceTriangle

    @property
    def integrity(self) -> IntegrityConfig:
        """Of the site file."""
        return self.site.integrity

    @property
    def n(self) -> int:
        """Receivers."""
        return len(self.site.receivers)

    @property
    def interval_s(self) -> float:
        """Between looks."""
        return self.site.epoch_interval_ns / NS_PER_S

    @property
    def looks_per_year(self) -> float:
        """One an epoch."""
        return YEAR_S / self.interval_s

    @property
    def stops_for_satellite(self) -> bool:
        """Whether a satellite that is named stops the line."""
        return self.integrity.on_satellite_fault == "stop"

    @property
    def scales(self) -> tuple[str, ...]:
        """Constellations that are solved for by themselves: with a time scale of their own."""
        systems = self.integrity.systems
        return tuple(of for of in TIME_SCALES if of.split("-")[0] in systems or (of == "GPS" and "QZSS" in systems))

    @property
    def satellite_families(self) -> tuple[str, ...]:
        """Those that name a satellite of this site: one constellation alone has no other one to be told from."""
        return tuple(of for of in SATELLITE_FAMILIES if of != "constellation" or len(self.scales) > 1)

    @property
    def share(self) -> float:
        """False stops a year of one family; whatever the rule, since the triangle alone is judged by the same thresholds."""
        families = len(POSITION_FAMILIES) + self.stops_for_satellite * len(self.satellite_families)
        return self.integrity.false_stops_per_year * (1.0 - RARE_SHARE * len(RARE_FAMILIES)) / families

    @property
    def rare(self) -> float:
        """False stops a year of one family of `RARE_FAMILIES`."""
        return self.integrity.false_stops_per_year * RARE_SHARE

    @property
    def exclusions(self) -> float:
        """False alarms a year of one family that names a satellite: stops or exclusions, as the site decides."""
        return self.share if self.stops_for_satellite else self.ranges

    @property
    def ranges(self) -> float:
        """False exclusions a year of single ranges, by the B-values."""
        families = 1 + (not self.stops_for_satellite) * len(self.satellite_families)
        return self.integrity.false_exclusions_per_year / families

    @property
    def satellites(self) -> int:
        """That share a budget."""
        return sum(MOST_IN_VIEW[system] for system in self.integrity.systems)

    @property
    def uploads_per_year(self) -> float:
        """Ephemerides that begin to serve, of all satellites in view."""
        return YEAR_S / DAY_S * sum(MOST_IN_VIEW[system] * SETS_A_DAY[system] for system in self.integrity.systems)

    @property
    def sky_m(self) -> tuple[Floats, Floats]:
        """Standard deviations of ranges of the reference sky, and of each receiver's own part of it, m."""
        promised = self.integrity
        return (
            range_sigma_m(REFERENCE_SKY_RAD, promised.sigma_range_m, promised.sigma_range_low_m),
            range_sigma_m(REFERENCE_SKY_RAD, promised.sigma_range_differential_m, promised.sigma_range_differential_low_m),
        )

    @property
    def k_md(self) -> float:
        """Sigmas beyond a threshold from which a fault is missed no more often than accepted."""
        return gauss_quantile(self.integrity.missed_detection)

    @property
    def a_common(self) -> float:
        """Correlation of the common errors from look to look."""
        return exp(-self.interval_s / self.integrity.correlation_common_s)

    @property
    def a_differential(self) -> float:
        """Correlation of each receiver's own errors."""
        return exp(-self.interval_s / self.integrity.correlation_differential_s)

    @property
    def clear(self) -> int:
        """Looks without an alarm before the line runs again, and the next alarm is another stop: `health`."""
        return max(RECOVER_EPOCHS, ceil(self.integrity.recover_after_s / self.interval_s - 1e-9) + 1)

    def tail(self, alarms_per_year: float, dof: int, correlation: float) -> float:
        """Probability per look of a chi-square statistic that begins to alarm so often."""
        return tail_for_episode_rate(alarms_per_year, self.looks_per_year, dof, correlation, self.clear)

    def errors(self, common: int, differential: int) -> Errors:
        """So many components that receivers share, and so many of their own, as time goes on."""
        promised = self.integrity
        seconds = (promised.correlation_common_s,) * common + (promised.correlation_differential_s,) * differential
        return Errors(seconds, self.interval_s, self.clear)

    @property
    def positions(self) -> Mapping[str, float]:
        """Tails of the checks of solved positions, which see the same errors: "circle" of each, "collapse" to one side."""
        promised = self.integrity
        common_m = promised.sigma_common_m, promised.sigma_common_m, promised.sigma_common_up_m
        differential_m = promised.sigma_differential_m, promised.sigma_differential_m, promised.sigma_differential_up_m
        baseline_m = tuple(tuple(row) for row in self.triangle.baseline_enu_m.tolist())
        return position_tails(common_m, differential_m, baseline_m, self.share / self.looks_per_year, self.errors(3, 3 * self.n))

    def mixed(self, var_common: float, var_differential: float) -> float:
        """Correlation from look to look of a sum of common and differential errors."""
        return (var_common * self.a_common + var_differential * self.a_differential) / (var_common + var_differential)

    @cached_property
    def slow(self) -> SlowDesign:
        """Of the sums that find slow shifts."""
        tau_s = self.integrity.correlation_differential_s
        return slow_design(STANDING, ALLOWANCE, self.rare, self.looks_per_year, self.interval_s, tau_s)


def of_data(of: Promises) -> list[Threshold]:
    """The streams themselves."""
    return [
        Threshold("data", 0.0, "satellites missing", True, 0.0, None, "", "five common satellites", "2.2; own choice of five"),
        Threshold("repeat", 0.0, "receivers", False, 0.0, None, "", "a receiver whose ranges all repeat is frozen", "own choice"),
    ]


def of_circles(of: Promises) -> list[Threshold]:
    """A circle around each surveyed point; ConfigError where the tolerance cannot be kept."""
    promised, p = of.integrity, of.positions["circle"]
    sigma = sqrt(promised.sigma_common_m**2 + promised.sigma_differential_m**2)
    k = sqrt(chi2_quantile(p, 2))
    fault = sigma * sqrt(detectable_noncentrality(k**2, 2, promised.missed_detection))
    _refuse_beyond_tolerance(promised.tolerance_m, k * sigma, k, of.k_md, sigma)
    reason = "tolerance circle: solved position from surveyed point, horizontal"
    return [
        Threshold(f"circle_{name}", k * sigma, "m", True, p, fault, "m at one receiver", reason, "2.1") for name in of.site.receiver_names
    ]


def of_common(of: Promises) -> list[Threshold]:
    """The mean of the three displacements."""
    promised = of.integrity
    sigma = sqrt(promised.sigma_common_m**2 + promised.sigma_differential_m**2 / of.n)
    sigma_up = sqrt(promised.sigma_common_up_m**2 + promised.sigma_differential_up_m**2 / of.n)
    found = []
    for name, dof, of_axis, unit in (
        ("common", 2, sigma, "m of the whole triangle, horizontal"),
        ("common_3d", 3, sigma_up, "m of the whole triangle, up"),
    ):
        p = of.positions[name]
        T = chi2_quantile(p, dof)
        fault = of_axis * sqrt(detectable_noncentrality(T, dof, promised.missed_detection))
        required = promised.rule == "full"
        found.append(Threshold(name, T, "chi-square", required, p, fault, unit, "mean of the three displacements", "2.2, T_c"))
    return found


def of_shape(of: Promises) -> list[Threshold]:
    """The solved triangle against the reference triangle."""
    promised = of.integrity
    found = []
    for name, dof, sigma, unit in (
        ("shape", 4, promised.sigma_differential_m, "m at one receiver, horizontal"),
        ("shape_3d", 6, promised.sigma_differential_up_m, "m at one receiver, up"),
    ):
        p = of.positions[name]
        T = chi2_quantile(p, dof)
        fault = sigma * sqrt(1.5 * detectable_noncentrality(T, dof, promised.missed_detection))
        required = promised.rule == "full" or name == "shape"
        found.append(Threshold(name, T, "chi-square", required, p, fault, unit, "solved against reference triangle", "2.2, T_d"))
    return found


def of_collapse(of: Promises) -> list[Threshold]:
    """One transmitter in the place of three points; ConfigError where the triangle cannot tell."""
    p = of.positions["collapse"]
    k = gauss_quantile(p)
    separation, needed = collapse_separation(of.site, of.triangle), k + of.k_md
    if separation < needed:
        raise ConfigError(
            f"the collapse test cannot keep its promise: the triangle separates one transmitter from three receivers by {separation:.1f} "
            f"sigma, {needed:.1f} are needed; move the receivers apart by a factor {needed / separation:.1f}, "
            "or show with data that sigma_differential_m is smaller"
        )
    reason = f"all receivers see one transmitter; the triangle is {separation:.0f} sigma of S away from that"
    required = of.integrity.rule == "full"
    return [Threshold("collapse", k, "sigma", required, p, needed, "sigma between triangle and point", reason, "2.6, S")]


def of_satellites(of: Promises) -> list[Threshold]:
    """Satellites, and satellites at one receiver, by their ranges."""
    promised, full, n = of.integrity, of.integrity.rule == "full", of.n
    sky_m, sky_own_m = of.sky_m
    commons = tuple((1.0 - (sky_own_m / sky_m) ** 2).tolist())
    k = residual_threshold(of.exclusions / of.satellites / of.looks_per_year, commons[:-1], n, of.errors(1, n))
    p = 2.0 * sum(tail_seen_by_all(k, common, n) for common in commons[:-1]) / (len(commons) - 1)
    left = 1.0 - float(sky_m[-1] ** -2 / (sky_m**-2).sum())  # of a range's error in its residual: the rest is in the clock
    fault = (k + missed_by_one(promised.missed_detection, commons[-1], n)) * float(sky_m[-1]) / sqrt(left)
    reason = "smallest of the receivers' normalised residuals of one satellite: what all of them see"
    residual = Threshold("residual", k, "sigma", full, p, fault, "m of range, 45 deg, URA 2.4 m", reason, "2.4; 4")

    p = of.tail(of.ranges / (of.satellites * n), 1, of.a_differential)
    k = sqrt(chi2_quantile(p, 1))
    fault = (k + of.k_md * sqrt(left)) * float(sky_own_m[-1]) * n / sqrt(n * (n - 1)) / left
    reason = "one receiver's range against the others"
    b_value = Threshold("b_value", k, "sigma", full, p, fault, "m of range at one receiver, 45 deg", reason, "2.3")
    return [residual, b_value]


def of_constellations(of: Promises) -> list[Threshold]:
    """A constellation by itself."""
    p = of.tail(of.exclusions / max(len(of.scales), 1), 3, of.a_common)
    T = chi2_quantile(p, 3)
    sigma = sqrt(of.integrity.sigma_common_m**2 + of.integrity.sigma_differential_m**2 / of.n)
    fault = sigma * sqrt(detectable_noncentrality(T, 3, of.integrity.missed_detection))
    reason = "where one constellation alone puts the triangle"
    return [Threshold("constellation", T, "chi-square", False, p, fault, "m of its frame, horizontal", reason, "own choice; 2.2")]


def of_ephemerides(of: Promises) -> list[Threshold]:
    """What satellites send of their orbits; no set is looked at twice."""
    p = of.exclusions / of.uploads_per_year
    k = sqrt(chi2_quantile(p, 3))
    fault = (k + of.k_md) * sqrt(2.0) * 2.4
    changed = "a new ephemeris against the one before, now and two hours on"
    return [
        Threshold("ephemeris", k, "sigma", False, p, fault, "m of orbit and clock, URA 2.4 m", changed, "2.4; own choice"),
        Threshold(
            "reissued", EPHEMERIS_REISSUED_M, "m", False, 0.0, None, "", "another content under the same issue", "IS-GPS-200, 20.3.4.4"
        ),
        Threshold("orbit", 1.0, "tolerances", False, 0.0, None, "", "an orbit that its system flies", "own choice"),
    ]


def of_pairs(of: Promises) -> list[Threshold]:
    """Two receivers that hear one transmitter, by their ranges: each pair, each constellation, and all together."""
    p_two_sided = of.tail(2.0 * of.rare / (of.n * (of.n - 1) / 2.0 * (len(of.scales) + 1)), 1, of.a_differential)
    k = sqrt(chi2_quantile(p_two_sided, 1))
    reason = "two receivers hear one transmitter, by their ranges"
    return [Threshold("capture", k, "sigma", False, p_two_sided / 2.0, k + of.k_md, "sigma between pair and point", reason, "2.6")]


def of_slow_shifts(of: Promises) -> list[Threshold]:
    """One receiver that moves away slowly."""
    found_m = 2.0 * of.integrity.sigma_differential_m * sqrt(1.5)
    minutes = time_to_detect_s(2.0, of.slow, of.interval_s) / 60.0
    reason = f"a receiver that stands off for long: {found_m:.2g} m in {minutes:.0f} min on average"
    return [Threshold("slow", of.slow.threshold, "sigma, summed", False, 0.0, found_m, "m at one receiver, in time", reason, "2.4, CUSUM")]


def of_reception(of: Promises) -> list[Threshold]:
    """Signals, and time."""
    drop = "drop of C/N0 against the last minutes, second worst receiver"
    loss = "share of tracked satellites above 15 deg that vanished, second worst receiver"
    host = "GNSS time against the host's clock, beyond what that vouches for, least of the receivers"
    return [
        Threshold("cn0", 6.0, "dB", False, 0.0, None, "", drop, "own choice: three times the day-to-day spread of a clear site"),
        Threshold("loss", 0.5, "of satellites", False, 0.0, None, "", loss, "own choice"),
        Threshold("host_time", HOST_TIME_S, "s", False, 0.0, HOST_TIME_S + 1.0, "s of GNSS time", host, "own choice"),
        Threshold(
            "told",
            1.0,
            "satellites",
            False,
            0.0,
            None,
            "",
            "satellites of which one receiver is told otherwise",
            "own choice: one may be damage",
        ),
    ]


FAMILIES = (
    of_data,
    of_circles,
    of_common,
    of_shape,
    of_collapse,
    of_satellites,
    of_constellations,
    of_ephemerides,
    of_pairs,
    of_slow_shifts,
    of_reception,
)


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
