"""`wayside station plan`: which promises a triangle can keep, and what would have to change for others.

`check` asks of a file with one set of promises whether a station may run with it. A plan asks of the same triangle and error models what
could be promised: it stands beside the check, not in it, since it has no errors of its own and answers for a file that is refused too.
"""

from dataclasses import asdict, dataclass, replace
from math import ceil, hypot, log2
from pathlib import Path
from typing import Any

from integrity.config import SiteConfig
from integrity.limits import derive
from integrity.thresholds import Promises, collapse_separation
from integrity.triangle import ReferenceTriangle, reference_triangle
from recordings.site_checks import COLLAPSE_SIGMAS, LONG_SIDE_M, PAIR_SIGMAS
from recordings.site_file import examine_site
from recordings.toml_file import ConfigProblems, Problem, read_toml

FALSE_STOPS_PER_YEAR = (0.1, 1.0, 10.0, 100.0)
MISSED_DETECTION = (1e-3, 1e-5, 1e-7)
# Nearer antennas share multipath, as reference antennas of GBAS do: the order of 100 m between those is from knowledge of their siting, not
# re-opened; that it should be so here is this project's own choice.
INDEPENDENT_M = 100.0
AMPLE = 1000.0  # sigmas: a smaller triangle is scaled to these so that its thresholds can be derived: none depends on its size


@dataclass(frozen=True)
class Promise:
    """One pair of promises, and what follows. `least_tolerance_m`: what the line must tolerate. Faults surely caught in one epoch, m: at
    one receiver by its circle and by the shape, of the whole triangle, of a satellite's range, of one range at one receiver. `separation`:
    what the triangle needs for the collapse test, in sigmas. `broken` says why it cannot be kept; empty where it can."""

    false_stops_per_year: float
    missed_detection: float
    radius_m: float
    least_tolerance_m: float
    circle_m: float
    shape_m: float
    common_m: float
    residual_m: float
    b_value_m: float
    separation: float
    broken: tuple[str, ...]


@dataclass(frozen=True)
class Side:
    """Two receivers: how far apart, and what that is too short or too long for."""

    ends: str
    length_m: float
    remarks: tuple[str, ...]


@dataclass(frozen=True)
class SitePlan:
    """Of a site file: `promised` is what it states, `promises` all that is considered; `changes` what would keep the tolerance wanted.

    `false_exclusions_per_year` is what the file states: `by_exclusions` are the columns of the table that go by it, not by the stops.
    """

    file: str
    site: str
    errors: tuple[Problem, ...]
    separation: float
    sides: tuple[Side, ...]
    wanted_m: float | None
    false_exclusions_per_year: float
    by_exclusions: tuple[str, ...]
    promised: Promise
    promises: tuple[Promise, ...]
    changes: tuple[str, ...]


def plan_site(path: Path) -> SitePlan:
    """The plan of a site file. ConfigProblems where coordinates or error models leave nothing to compute from."""
    document = read_toml(path)
    findings = examine_site(document)
    config = findings.config
    if config is None:
        raise ConfigProblems(findings.problems, findings.warnings)
    triangle = reference_triangle(config)
    stated = config.integrity
    promised = promise(config, triangle, stated.false_stops_per_year, stated.missed_detection)
    promises = tuple(promise(config, triangle, stops, missed) for stops in FALSE_STOPS_PER_YEAR for missed in MISSED_DETECTION)
    return SitePlan(
        file=document.file,
        site=config.site_id,
        errors=findings.problems,
        separation=collapse_separation(config, triangle),
        sides=tuple(_side(f"{a}-{b}", m, stated.sigma_differential_m) for (a, b), m in triangle.sides_m.items()),
        wanted_m=stated.tolerance_m,
        false_exclusions_per_year=stated.false_exclusions_per_year,
        by_exclusions=("one range",) if stated.on_satellite_fault == "stop" else ("satellite", "one range"),
        promised=promised,
        promises=promises,
        changes=_changes(config, triangle, promised, promises),
    )


def promise(config: SiteConfig, triangle: ReferenceTriangle, false_stops_per_year: float, missed_detection: float) -> Promise:
    """What follows of a pair of promises for a site; its own tolerance, if it states one, is what has to be kept."""
    stated = config.integrity
    promises = replace(stated, false_stops_per_year=false_stops_per_year, missed_detection=missed_detection, tolerance_m=None)
    separation = collapse_separation(config, triangle)
    of = Promises(replace(config, integrity=promises), _ample(triangle, separation))
    limits = derive(of.site, of.triangle)

    def caught(check: str) -> float:
        smallest = limits.by_name[check].smallest_fault
        assert smallest is not None, f"{check} states no smallest fault"
        return smallest

    needed = max(caught("collapse"), COLLAPSE_SIGMAS)  # `check` asks for the second, whatever is promised
    least_m = limits.radius_m + of.k_md * hypot(stated.sigma_common_m, stated.sigma_differential_m)  # both sides of a radius: section 2.1
    broken = []
    if separation < needed:
        broken.append(f"collapse needs {needed:.1f} sigma, the triangle has {separation:.1f}")
    if stated.tolerance_m is not None and least_m > stated.tolerance_m:
        broken.append(f"needs a tolerance of {least_m:.2f} m, the line has {stated.tolerance_m:g}")
    return Promise(
        false_stops_per_year=false_stops_per_year,
        missed_detection=missed_detection,
        radius_m=limits.radius_m,
        least_tolerance_m=least_m,
        circle_m=caught(f"circle_{config.receiver_names[0]}"),
        shape_m=caught("shape"),
        common_m=caught("common"),
        residual_m=caught("residual"),
        b_value_m=caught("b_value"),
        separation=needed,
        broken=tuple(broken),
    )


def _ample(triangle: ReferenceTriangle, separation: float) -> ReferenceTriangle:
    """The triangle that no check is too small for; scaled by a power of two, which changes no bit of what follows from its form."""
    return replace(triangle, baseline_enu_m=triangle.baseline_enu_m * 2.0 ** max(ceil(log2(AMPLE / max(separation, 1e-3))), 0))


def _side(ends: str, length_m: float, sigma_differential_m: float) -> Side:
    pair_m = PAIR_SIGMAS * sigma_differential_m
    remarks = []
    if length_m < pair_m:
        remarks.append(f"under 17 sigma_differential_m = {pair_m:.1f} m: this pair alone cannot tell one transmitter from two antennas")
    if length_m < INDEPENDENT_M:
        remarks.append(f"under {INDEPENDENT_M:.0f} m: the antennas may share multipath, and fail together")
    if length_m > LONG_SIDE_M:
        remarks.append(f"over {LONG_SIDE_M / 1000.0:.0f} km: the atmosphere differs; measure sigma_differential_m at this site")
    return Side(ends, length_m, tuple(remarks))


def _changes(config: SiteConfig, triangle: ReferenceTriangle, promised: Promise, promises: tuple[Promise, ...]) -> tuple[str, ...]:
    """Each alone would do, as far as it says; nothing where what is promised is kept."""
    if not promised.broken:
        return ()
    stated, wanted_m = config.integrity, config.integrity.tolerance_m
    changes = []
    separation = collapse_separation(config, triangle)
    if separation < promised.separation:
        factor = promised.separation / separation
        up, level = (_below(sigma_m / factor) for sigma_m in (stated.sigma_differential_up_m, stated.sigma_differential_m))
        sigmas = f"sigma_differential_m = {level} and sigma_differential_up_m = {up}, shown with data"
        changes.append(f"for the collapse test: sides {_above(factor, 100)} times as long, or {sigmas}")
    if wanted_m is not None and promised.least_tolerance_m > wanted_m:
        common_m = _common_that_would_do_m(config, triangle, wanted_m)
        changes.append(f"for the circles: tolerance_m = {_above(promised.least_tolerance_m, 10)}")
        if common_m > 0.0:
            changes.append(f"for the circles: sigma_common_m = {_below(common_m)}, shown with data (`replay --calibrate`)")
        else:
            changes.append("for the circles: no sigma_common_m alone would do; sigma_differential_m is too large for this tolerance")
    kept = [f"{p.false_stops_per_year:g} stops a year with {p.missed_detection:g} missed" for p in promises if not p.broken]
    changes.append("promises that this site keeps: " + (", ".join(kept) or "none of those above"))
    return tuple(changes)


def _common_that_would_do_m(config: SiteConfig, triangle: ReferenceTriangle, wanted_m: float) -> float:
    """The largest sigma_common_m with which the circles keep the file's promises, by bisection; zero where none does."""
    stated = config.integrity
    low, high = 0.0, stated.sigma_common_m
    for _ in range(12):
        middle = (low + high) / 2.0
        tried = replace(config, integrity=replace(stated, sigma_common_m=middle))
        least_m = promise(tried, triangle, stated.false_stops_per_year, stated.missed_detection).least_tolerance_m
        low, high = (middle, high) if least_m <= wanted_m else (low, middle)
    return low


def _above(value: float, parts: int) -> str:
    """Rounded up to so many parts of one."""
    return f"{ceil(value * parts) / parts:g}"


def _below(value: float) -> str:
    """Two decimals, rounded down."""
    return f"{int(value * 100.0) / 100.0:.2f}"


def render(plan: SitePlan) -> str:
    """The plan for a person; ends with a newline."""
    wanted = "none stated" if plan.wanted_m is None else f"{plan.wanted_m:g} m"
    lines = [f"error: {problem}" for problem in plan.errors] + [""] * bool(plan.errors)
    lines += [f"site {plan.site}, tolerance of the line {wanted}, triangle {plan.separation:.0f} sigma from a point", "", *_table(plan), ""]
    lines += [f"side {side.ends}  {side.length_m:.1f} m" + "".join(f"; {remark}" for remark in side.remarks) for side in plan.sides]
    if plan.promised.broken:
        lines += ["", f"what the file promises cannot be kept: {'; '.join(plan.promised.broken)}. What would do:"]
        lines += [f"  {change}" for change in plan.changes]
    return "\n".join(lines) + "\n"


def _table(plan: SitePlan) -> list[str]:
    """A row for each pair of promises; the file's own first, whether or not it is among them."""
    rows: list[tuple[str, ...]] = [
        (
            "stops a year",
            "missed",
            "radius",
            "tolerance",
            "one receiver",
            "its shape",
            "triangle",
            "satellite",
            "one range",
            "separation",
            "",
        )
    ]
    for i, of in enumerate((plan.promised, *plan.promises)):
        verdict = "kept" if not of.broken else "; ".join(of.broken)
        metres = (of.radius_m, of.least_tolerance_m, of.circle_m, of.shape_m, of.common_m, of.residual_m, of.b_value_m)
        own = " (the file's)" * (i == 0)
        numbers = (f"{of.false_stops_per_year:g}", f"{of.missed_detection:g}", *(f"{value:.1f} m" for value in metres))
        rows.append((*numbers, f"{of.separation:.1f}", verdict + own))
    widths = [max(len(row[column]) for row in rows) for column in range(len(rows[0]) - 1)]
    head = "promises, and what follows: radius of the circles, tolerance that the line needs, smallest faults caught in one epoch"
    exclusions = f"{' and '.join(plan.by_exclusions)}: by {plan.false_exclusions_per_year:g} false exclusions a year, as the file promises"
    return [head, exclusions, *("  ".join([*(c.rjust(w) for c, w in zip(row, widths, strict=False)), row[-1]]).rstrip() for row in rows)]


def as_json(plan: SitePlan) -> dict[str, Any]:
    """The plan for a machine."""
    return asdict(plan) | {"errors": [{**asdict(problem), "text": str(problem)} for problem in plan.errors]}
