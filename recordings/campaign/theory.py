"""What trials cannot reach, at the level of statistics: rare misses, rare wrong names, years of false alarms. As one JSON object."""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from integrity.config import SiteConfig
from integrity.gnss.gps_time import DAY_S
from integrity.thresholds import YEAR_S
from recordings.campaign.acceptance_line import Acceptance, acceptance
from recordings.campaign.detectable import Case, Measured, cases, smallest_caught
from recordings.campaign.error_model import ErrorModel, error_model
from recordings.campaign.false_alarms import Promise, alarms_of, poisson_bounds
from recordings.campaign.namings import KINDS, Named, namings, total
from recordings.campaign.tally import bounded, rounded

AGREES_WITHIN = 0.15  # measured beside theory
NOTE_ON_LINE = "the line of section 2.7 (after GAST-D) in fractions of the tolerance: a proposal of this project, no authority's"


class Effort(NamedTuple):
    """Draws of each estimate, trials of each size, and the days simulated for each promise, by stops a year."""

    samples: int
    namings: int
    days: Mapping[float, float]


ONE_A_DAY, TEN_A_DAY = YEAR_S / DAY_S, 10.0 * YEAR_S / DAY_S
SMALL = Effort(2000, 4000, {TEN_A_DAY: 30.0, ONE_A_DAY: 30.0, 1.0: 60.0})
FULL = Effort(20_000, 20_000, {TEN_A_DAY: 360.0, ONE_A_DAY: 360.0, 1.0: 3652.5})


def theory(site: SiteConfig, tolerance_m: float, effort: Effort, seed: int, jobs: int = 1) -> dict[str, Any]:
    """All of it, of one site. The same seed, the same result, however many processes."""
    model = error_model(site)
    p_md = site.integrity.missed_detection
    caught = [(case, smallest_caught(case, p_md, effort.samples, seed)) for case in cases(model)]
    return {
        "site": site.site_id,
        "missed_detection": p_md,
        "smallest_faults": [_of_fault(case, measured) for case, measured in caught],
        "naming": _of_naming(namings(model, effort.namings, seed)),
        "line": _of_line(acceptance(model, tolerance_m, effort.samples, seed), model),
        "false_alarms": [_of_promise(alarms_of(site, per_year, days * DAY_S, seed, jobs)) for per_year, days in effort.days.items()],
    }


def _of_fault(case: Case, measured: Measured) -> dict[str, Any]:
    ratio = measured.size / case.theory
    return {
        "check": case.check,
        "fault": case.fault,
        "measured": rounded(measured.size),
        "low": rounded(measured.low),
        "high": rounded(measured.high),
        "theory": rounded(case.theory),
        "ratio": round(ratio, 3),
        "agrees": abs(ratio - 1.0) <= AGREES_WITHIN,
    }


def _of_naming(found: tuple[Named, ...]) -> dict[str, Any]:
    return {
        "wrong": bounded(total(found)),
        "kinds": {kind: bounded(total(found, (kind,))) for kind in KINDS},
        "sizes": [
            {"kind": of.kind, "size_m": of.size_m, "wrong": bounded(of.wrong), "right": rounded(of.right.count / of.right.of)}
            for of in found
        ],
    }


def _of_line(found: Acceptance, model: ErrorModel) -> dict[str, Any]:
    promises = model.site.integrity
    share = min(1.0, found.tolerance_m / found.least_tolerance_m)
    return {
        "note": NOTE_ON_LINE,
        "tolerance_m": rounded(found.tolerance_m),
        "passes": found.passes,
        "least_tolerance_m": rounded(found.least_tolerance_m),
        "sigma_range_m_that_would_do": rounded(promises.sigma_range_m * share),
        "points": [
            {"size_m": rounded(of.size_m), "missed": rounded(of.missed.value), "allowed": rounded(of.allowed)} for of in found.points
        ],
    }


def _of_promise(of: Promise) -> dict[str, Any]:
    stops_low, stops_high = poisson_bounds(of.found.stops)
    alarms_low, alarms_high = poisson_bounds(of.alarms)
    exclusions_low, exclusions_high = poisson_bounds(of.found.exclusions)
    return {
        "per_year": rounded(of.per_year),
        "days": rounded(of.found.seconds / DAY_S),
        "promised": rounded(of.promised),
        "stops": of.found.stops,
        "stops_low": rounded(stops_low),
        "stops_high": rounded(stops_high),
        "kept": stops_low <= of.promised <= stops_high,
        "exclusions": of.found.exclusions,
        "exclusions_low": rounded(exclusions_low),
        "exclusions_high": rounded(exclusions_high),
        "alarms": of.alarms,
        "alarms_low": rounded(alarms_low),
        "alarms_high": rounded(alarms_high),
        "alarms_error": None if of.alarms_error is None else rounded(of.alarms_error),
        "alarms_by_theory": rounded(sum(of.expected.values())),
        "checks": {
            check: {"alarms": count, "by_theory": rounded(of.expected[check]) if check in of.expected else None}
            for check, count in of.found.alarms.items()
        },
    }


def explain_theory(found: Mapping[str, Any]) -> list[str]:
    """The same for people, line by line."""
    naming, line = found["naming"], found["line"]
    verdict = "passes" if line["passes"] else f"fails, and would pass for {line['least_tolerance_m']:g} m"
    return [
        "",
        f"smallest faults caught with errors exactly as the site states them, missed once in {1.0 / found['missed_detection']:,.0f}:",
        *(
            f"  {of['check']:<12}{of['measured']:>8g} measured {of['theory']:>8g} stated {of['ratio']:>7.2f}  {of['fault']}"
            for of in found["smallest_faults"]
        ),
        f"one or two receivers off by 0.5 to 50 m: a sound one named in {_count(naming['wrong'])}",
        *(f"  {kind:<13} {_count(share)}" for kind, share in naming["kinds"].items()),
        f"residual check against the line for a tolerance of {line['tolerance_m']:g} m: {verdict} ({line['note']})",
        "false alarms of sound receivers with correlated errors:",
        *_alarm_lines(found["false_alarms"]),
    ]


def _alarm_lines(promises: Sequence[Mapping[str, Any]]) -> list[str]:
    return [
        f"  {of['per_year']:g} a year for {of['days']:g} days: {of['promised']:g} stops promised, {of['stops']} came "
        f"({of['stops_low']:g} to {of['stops_high']:g} at 95 %); of as many exclusions {of['exclusions']} ({of['exclusions_low']:g} to "
        f"{of['exclusions_high']:g}); alarms of single checks: {of['alarms']}, {of['alarms_by_theory']:g} by theory"
        for of in promises
    ]


def _count(share: Mapping[str, Any]) -> str:
    return f"{share['count']} of {share['of']} (at most {100 * share['at_most']:.2g} % at 95 % confidence)"
