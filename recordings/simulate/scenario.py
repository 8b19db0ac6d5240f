"""A scenario file: when, how long, which site, which faults. Read whole, refused with everything that is wrong at once.

`[scenario]` is read here, the tables of the site as in a site file, `[[fault]]` by the parser of faults.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from pydantic import AfterValidator, Field

from integrity.gnss.gps_time import DAY_S, NS_PER_S, parse_utc
from recordings.site_file import SiteFile, resolve_site
from recordings.site_schema import SECTIONS, Section, read_section, unknown_key
from recordings.toml_file import ConfigProblems, Problem, TomlDocument, format_toml, parse_toml, read_toml


def _a_time(text: str) -> str:
    parse_utc(text)
    return text


class ScenarioSection(Section):
    """`[scenario]`: UTC of the first epoch, length, seed of everything random, epochs per second; on how many frequencies receivers
    measure, by default on as many as the site decides on."""

    start: Annotated[str, AfterValidator(_a_time), Field(description='a UTC time in quotes, such as "2026-03-02T03:00:00Z"')]
    duration_s: Annotated[float, Field(ge=1, le=DAY_S, description=f"seconds, from 1 to {DAY_S}")]
    seed: Annotated[int, Field(ge=0, lt=2**63, description="a whole number, 0 or above, below 2^63")]
    rate_hz: Annotated[float, Field(gt=0, le=20, description="epochs per second, above 0 and at most 20")] = 1.0
    frequencies: Annotated[int | None, Field(ge=1, le=2, description="1 or 2, on which receivers measure")] = None


@dataclass(frozen=True)
class Scenario:
    """A scenario that can be simulated. `start_ns` is GPS time.

    `faults` is the file's text with everything but the `[[fault]]` tables left blank, so that its lines keep their numbers.
    """

    start_ns: int
    duration_s: float
    seed: int
    rate_hz: float
    frequencies: int
    site: SiteFile
    faults: str


def load_scenario(path: Path) -> Scenario:
    """Read a scenario file; ConfigProblems with every error (and warning of the site) if it cannot be used."""
    return resolve_scenario(read_toml(path))


def parse_scenario(text: str, file: str) -> Scenario:
    """The same for text that is not in a file of its own; `file` is the name that problems carry."""
    return resolve_scenario(parse_toml(text, file))


def resolve_scenario(document: TomlDocument) -> Scenario:
    """The scenario that a parsed file describes; ConfigProblems with every error (and warning of the site) if it cannot be used."""
    scenario, problems = read_section(document, ("scenario",), ScenarioSection)
    known = ("scenario", "fault", *SECTIONS)
    problems += [document.problem((key,), unknown_key(key, known)) for key in document.values if key not in known]
    problems += _shape_of_faults(document)

    of_site = {key: value for key, value in document.values.items() if key in SECTIONS}
    site: SiteFile | None = None
    warnings: tuple[Problem, ...] = ()
    try:
        site = resolve_site(TomlDocument(document.file, format_toml(of_site), of_site, document.lines))
    except ConfigProblems as error:
        problems, warnings = [*problems, *error.problems], error.warnings
    if site is not None and not any(problem.key.startswith("scenario") for problem in problems):
        problems += _wrong_rate(document, scenario, site)
    if problems or site is None:
        raise ConfigProblems(problems, warnings)
    return Scenario(
        start_ns=parse_utc(scenario.start),
        duration_s=scenario.duration_s,
        seed=scenario.seed,
        rate_hz=scenario.rate_hz,
        frequencies=scenario.frequencies or site.config.integrity.frequencies,
        site=site,
        faults=_text_of_faults(document),
    )


def _shape_of_faults(document: TomlDocument) -> list[Problem]:
    faults = document.values.get("fault", [])
    if isinstance(faults, list) and all(isinstance(fault, dict) for fault in faults):
        return []
    return [document.problem(("fault",), "expected tables: write [[fault]], in double brackets, and the keys of each fault below it")]


def _wrong_rate(document: TomlDocument, scenario: ScenarioSection, site: SiteFile) -> list[Problem]:
    """The station lines rows up at its own interval: at any other rate it would drop them or call the streams silent."""
    interval_ns = site.config.epoch_interval_ns
    if round(NS_PER_S / scenario.rate_hz) == interval_ns:
        return []
    message = (
        f"expected {NS_PER_S / interval_ns:g}, one epoch per epoch_interval_s of the site ({interval_ns / NS_PER_S:g} s); "
        f"or write epoch_interval_s = {1.0 / scenario.rate_hz:g} in [site]"
    )
    return [document.problem(("scenario", "rate_hz"), message)]


def _text_of_faults(document: TomlDocument) -> str:
    """Lines from a `fault` key to the next key of anything else; the others blank."""
    of_fault = {line: key == "fault" or key.startswith("fault.") for key, line in document.lines.items()}
    kept, inside = [], False
    for number, line in enumerate(document.text.split("\n"), 1):
        inside = of_fault.get(number, inside)
        kept.append(line if inside else "")
    return "\n".join(kept)
