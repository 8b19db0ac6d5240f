"""`wayside station check`: everything wrong with a site file at once, and what its promises come to."""

import math
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from integrity.config import SiteConfig
from integrity.errors import ConfigError
from integrity.limits import Limits, derive
from integrity.thresholds import Threshold
from integrity.triangle import ReferenceTriangle, reference_triangle
from recordings.site_checks import open_endpoints
from recordings.site_file import SiteFile, examine_site, load_site, missing_sources
from recordings.toml_file import ConfigProblems, Problem, TomlDocument, by_line, read_toml


@dataclass(frozen=True)
class SiteFacts:
    """What follows from sound coordinates and error models. `limits` is None where the promises contradict each other."""

    config: SiteConfig
    sides_m: dict[str, float]  # by the names of the two ends, `A-B`
    angles_deg: dict[str, float]  # inner angle at each receiver
    limits: Limits | None


@dataclass(frozen=True)
class CheckReport:
    """Findings on one site file, by line; `facts` is None where errors leave nothing to compute from."""

    file: str
    errors: tuple[Problem, ...]
    warnings: tuple[Problem, ...]
    facts: SiteFacts | None

    @property
    def ok(self) -> bool:
        """A station can run with this file; warnings do not count."""
        return not self.errors


def check_site(path: Path) -> CheckReport:
    """Read a site file as a station would. Never raises for what the file holds: that is what the report is for."""
    try:
        document = read_toml(path)
    except ConfigProblems as error:
        return CheckReport(str(path), error.problems, (), None)
    findings = examine_site(document)
    errors = [*findings.problems, *missing_sources(document)]
    facts = None
    if findings.config is not None:
        triangle = reference_triangle(findings.config)
        limits = _limits(document, findings.config, triangle, errors)
        facts = SiteFacts(findings.config, _sides_m(triangle), _angles_deg(triangle), limits)
    warnings = [*findings.warnings, *open_endpoints(document, findings.publish, findings.tls)]
    return CheckReport(document.file, by_line(errors), by_line(warnings), facts)


def sound_site(path: Path) -> SiteFile:
    """The site that a station runs with; ConfigProblems with everything that is wrong with the file."""
    report = check_site(path)
    if report.errors:
        raise ConfigProblems(report.errors, report.warnings)
    return load_site(path)


def _limits(document: TomlDocument, config: SiteConfig, triangle: ReferenceTriangle, errors: list[Problem]) -> Limits | None:
    """The limits, or None with one more error: the tolerance against the radius, or else the triangle against the collapse test."""
    try:
        return derive(config, triangle)
    except ConfigError as error:
        message = str(error)
    problem = document.problem(("integrity", "tolerance_m") if message.startswith("tolerance_m") else ("receivers",), message)
    if all(problem.key != found.key for found in errors):  # the file's own check of the triangle may have said it already
        errors.append(problem)
    return None


def _sides_m(triangle: ReferenceTriangle) -> dict[str, float]:
    return {f"{a}-{b}": side_m for (a, b), side_m in triangle.sides_m.items()}


def _angles_deg(triangle: ReferenceTriangle) -> dict[str, float]:
    """Inner angle at each vertex by the law of cosines; a flat triangle has 0, 0 and 180."""
    a, b, c = triangle.names
    side = {frozenset(ends): side_m for ends, side_m in triangle.sides_m.items()}
    angles = {}
    for vertex, left, right in ((a, b, c), (b, c, a), (c, a, b)):
        p, q, opposite = side[frozenset((vertex, left))], side[frozenset((vertex, right))], side[frozenset((left, right))]
        angles[vertex] = math.degrees(math.acos(max(-1.0, min(1.0, (p * p + q * q - opposite * opposite) / (2.0 * p * q)))))
    return angles


def render(report: CheckReport) -> str:
    """The report for a person: a line per finding, then the facts, then the outcome; ends with a newline."""
    lines = [f"error: {problem}" for problem in report.errors] + [f"warning: {problem}" for problem in report.warnings]
    if report.facts is not None:
        lines += [""] * bool(lines) + [*_facts_lines(report.facts, report.ok), ""]
    outcome = "can be used" if report.ok else "refused"
    lines.append(f"{report.file}: {_count(report.errors, 'error')}, {_count(report.warnings, 'warning')}: {outcome}")
    return "\n".join(lines) + "\n"


def _count(problems: tuple[Problem, ...], word: str) -> str:
    return f"{len(problems)} {word}" + "s" * (len(problems) != 1)


def _facts_lines(facts: SiteFacts, ok: bool) -> list[str]:
    config = facts.config
    lines = [
        f"site           {config.site_id}",
        f"frame          {config.frame}, epoch {'unstated' if config.frame_epoch is None else f'{config.frame_epoch:.2f}'}",
        f"configuration  {config.config_sha256 if ok else 'none: the file is refused'}",
        f"systems        {', '.join(config.integrity.systems)}",
        f"frequencies    {'2: pairs of signals, free of the ionosphere' if config.integrity.frequencies == 2 else '1'}",
        f"sides          {', '.join(f'{ends} {side_m:.2f} m' for ends, side_m in facts.sides_m.items())}",
        f"angles         {', '.join(f'{name} {angle_deg:.1f} deg' for name, angle_deg in facts.angles_deg.items())}",
    ]
    if facts.limits is not None:
        lines += [f"circle radius  {facts.limits.radius_m:.2f} m", "", *_threshold_lines(facts.limits.thresholds)]
    return lines


def _threshold_lines(thresholds: tuple[Threshold, ...]) -> list[str]:
    rows = [("check", "required", "threshold", "false alarm", "smallest fault caught", "what it watches")]
    for t in thresholds:
        fault = "-" if t.smallest_fault is None else f"{_plain(t.smallest_fault)} {t.fault_unit}"
        false_alarm = f"{t.false_alarm_probability:.1e}" if t.false_alarm_probability > 0 else "-"
        rows.append((t.name, "yes" if t.required else "no", f"{_plain(t.value)} {t.unit}", false_alarm, fault, t.reason))
    widths = [max(len(row[column]) for row in rows) for column in range(len(rows[0]))]
    return ["  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip() for row in rows]


def _plain(value: float) -> str:
    """Two decimals; of what is small two digits: faults of m/s2 are not zero."""
    return f"{value:.2f}" if value == 0.0 or abs(value) >= 0.1 else f"{value:.2g}"


def as_json(report: CheckReport) -> dict[str, Any]:
    """The report for a machine; what could not be computed is null."""
    facts = report.facts
    limits = facts.limits if facts else None
    return {
        "ok": report.ok,
        "errors": [_problem_json(problem) for problem in report.errors],
        "warnings": [_problem_json(problem) for problem in report.warnings],
        "site": facts.config.site_id or None if facts else None,
        "frame": facts.config.frame if facts else None,
        "epoch": facts.config.frame_epoch if facts else None,
        "config_sha256": facts.config.config_sha256 if facts and report.ok else None,
        "sides_m": facts.sides_m if facts else None,
        "angles_deg": facts.angles_deg if facts else None,
        "radius_m": limits.radius_m if limits else None,
        "thresholds": [asdict(threshold) for threshold in limits.thresholds] if limits else None,
    }


def _problem_json(problem: Problem) -> dict[str, Any]:
    return {**asdict(problem), "text": str(problem)}
