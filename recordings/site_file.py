"""The site file: read whole, refused with everything that is wrong at once, and turned into the configuration that the core decides by."""

import hashlib
import json
import re
import tomllib
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

from integrity.config import SIGMAS_OF_PAIRS_M, SIGMAS_OF_SIGNALS_M, IntegrityConfig, ReceiverConfig, SiteConfig
from integrity.gnss.gps_time import NS_PER_S
from recordings import site_checks
from recordings.site_checks import EcefPoint
from recordings.site_schema import (
    NAME_PATTERN,
    SECTIONS,
    IntegritySection,
    PageSection,
    PublishSection,
    ReceiverSection,
    RecordSection,
    SiteSection,
    TlsSection,
    protocol_of,
    read_section,
    read_tls,
    unknown_key,
    without_certificates,
)
from recordings.toml_file import (
    ConfigProblems,
    Parts,
    Problem,
    TomlDocument,
    by_line,
    dotted,
    format_toml,
    parse_toml,
    read_toml,
    split_key,
)

COMMAND_LINE = "--set"
HARMLESS_KEYS = {"site.id", "site.frame", "site.epoch", "site.host_clock", "integrity.rule", "integrity.on_satellite_fault"}
EXAMPLE_SETTING = "integrity.rule=triangle"


@dataclass(frozen=True)
class SiteFile:
    """A site file that can be used. `text` parses to the same settings again; `sources` is None where a receiver has none yet."""

    file: str
    text: str
    config: SiteConfig
    sources: dict[str, str | None]
    warnings: tuple[Problem, ...]
    publish: PublishSection
    tls: TlsSection | None
    record: RecordSection
    page: PageSection


def load_site(path: Path) -> SiteFile:
    """Read a site file; ConfigProblems with every error (and warning) if it cannot be used."""
    return resolve_site(read_toml(path))


def parse_site(text: str, file: str) -> SiteFile:
    """The same for text that is not in a file of its own (a recording holds one); `file` is the name that problems carry."""
    return resolve_site(parse_toml(text, file))


def resolve_site(document: TomlDocument) -> SiteFile:
    """The site that a parsed file describes; ConfigProblems with every error (and warning) if it cannot be used."""
    findings = examine_site(document)
    if findings.problems or findings.config is None:
        raise ConfigProblems(findings.problems, findings.warnings)
    publish = findings.publish
    return SiteFile(
        file=document.file,
        text=document.text,
        config=findings.config,
        sources={name: receiver.source for name, receiver in findings.receivers.items()},
        warnings=findings.warnings,
        publish=publish if publish.key else publish.model_copy(update={"key": f"keys/{findings.config.site_id}.pem"}),
        tls=findings.tls,
        record=findings.record,
        page=findings.page,
    )


@dataclass(frozen=True)
class SiteFindings:
    """All that a site file says. `config` is None unless coordinates and error models are sound; with problems it must not decide."""

    problems: tuple[Problem, ...]
    warnings: tuple[Problem, ...]
    config: SiteConfig | None
    receivers: dict[str, ReceiverSection]
    publish: PublishSection
    tls: TlsSection | None
    record: RecordSection
    page: PageSection


def examine_site(document: TomlDocument) -> SiteFindings:
    """Everything that can be found in a parsed file in one pass; raises nothing."""
    site, site_problems = read_section(document, ("site",), SiteSection)
    integrity, integrity_problems = read_section(document, ("integrity",), IntegritySection)
    publish, publish_problems = read_section(document, ("publish",), PublishSection)
    tls, tls_problems = read_tls(document)
    record, record_problems = read_section(document, ("record",), RecordSection)
    page, page_problems = read_section(document, ("page",), PageSection)
    receivers, receiver_problems = _read_receivers(document)
    points, point_problems = _read_points(document, receivers)
    problems = site_problems + integrity_problems + publish_problems + tls_problems + record_problems + page_problems
    problems += receiver_problems + point_problems
    problems += [document.problem((key,), unknown_key(key, SECTIONS)) for key in document.values if key not in SECTIONS]
    problems += site_checks.source_problems(document, receivers)
    if tls is None:
        problems += without_certificates(document, {"listen": publish.listen, "connect": publish.connect})
        problems += site_checks.readers_without_tls(document, publish)
    warnings = [*site_checks.site_warnings(document, site), *site_checks.sharing_warnings(document, receivers)]

    # A slip in an error model must not be held against the triangle or the tolerance as well.
    unsound = {problem.key for problem in site_problems + integrity_problems} - HARMLESS_KEYS
    config = None
    if not unsound and not point_problems and len(points) == len(receivers) == 3:
        config = _site_config(site, receivers, points, integrity, publish)
        problems += site_checks.collapse_impossible(document, points, config.integrity)
        warnings += site_checks.spacing_warnings(document, points, config.integrity.sigma_differential_m)
        warnings += site_checks.pair_warnings(document, config.integrity)
    refused = {problem.key for problem in problems}
    warnings = [warning for warning in warnings if warning.key not in refused]
    return SiteFindings(by_line(problems), by_line(warnings), config, receivers, publish, tls, record, page)


def _read_points(document: TomlDocument, receivers: dict[str, ReceiverSection]) -> tuple[dict[str, EcefPoint], list[Problem]]:
    """Surveyed points by receiver, and what is wrong with them one by one and with each other."""
    points: dict[str, EcefPoint] = {}
    problems: list[Problem] = []
    for name, receiver in receivers.items():
        point, wrong = site_checks.surveyed_point(document, name, receiver)
        problems += wrong
        if point is not None:
            points[name] = point
    return points, problems + list(site_checks.coinciding(document, points))


def _read_receivers(document: TomlDocument) -> tuple[dict[str, ReceiverSection], list[Problem]]:
    """Receivers in the order of their names."""
    tables = document.values.get("receivers", {})
    receivers: dict[str, ReceiverSection] = {}
    problems: list[Problem] = []
    names = sorted(tables) if isinstance(tables, dict) else []
    if len(names) != 3:
        message = (
            f"{len(names)} receiver{'s' * (len(names) != 1)}: expected exactly three, as [receivers.A], [receivers.B] and [receivers.C]"
        )
        problems.append(document.problem(("receivers",), message))
    for name in names:
        parts = ("receivers", name)
        if not re.fullmatch(NAME_PATTERN, name):
            problems.append(document.problem(parts, 'expected a name of letters, digits, "-" and "_", such as "A"'))
        receiver, found = read_section(document, parts, ReceiverSection)
        problems += found
        if isinstance(tables[name], dict):
            receivers[name] = receiver
    return receivers, problems


def _site_config(
    site: SiteSection,
    receivers: dict[str, ReceiverSection],
    points: dict[str, EcefPoint],
    integrity: IntegritySection,
    publish: PublishSection,
) -> SiteConfig:
    config = SiteConfig(
        site_id=site.id,
        frame=site.frame,
        frame_epoch=site.epoch,
        epoch_interval_ns=round(site.epoch_interval_s * NS_PER_S),
        host_clock=site.host_clock,
        receivers=tuple(
            ReceiverConfig(
                name,
                points[name],
                receiver.model,
                receiver.supply,
                receiver.mast,
                receiver.switch,
                protocol_of(receiver.protocol, receiver.source),
            )
            for name, receiver in receivers.items()
        ),
        integrity=_promises(integrity),
        valid_for_ms=publish.valid_for_ms,
        config_sha256="",
        map_sha256=publish.map_sha256,
    )
    return replace(config, config_sha256=config_sha256(config))


def _promises(integrity: IntegritySection) -> IntegrityConfig:
    """With the sigmas that are left out."""
    promises = integrity.model_dump()
    for name, sigma_m in (SIGMAS_OF_PAIRS_M if integrity.frequencies == 2 else SIGMAS_OF_SIGNALS_M).items():
        if promises[name] is None:
            promises[name] = sigma_m
    for name in ("sigma_common", "sigma_differential"):
        if promises[f"{name}_up_m"] is None:
            promises[f"{name}_up_m"] = 2.0 * promises[f"{name}_m"]
    return IntegrityConfig(**promises)


def config_sha256(config: SiteConfig) -> str:
    """SHA-256 (hex) of what decisions depend on: the configuration as JSON with sorted keys, without itself and what is only said."""
    content = asdict(config)
    del content["config_sha256"], content["map_sha256"]
    return hashlib.sha256(json.dumps(content, sort_keys=True, separators=(",", ":"), allow_nan=False).encode()).hexdigest()


def missing_sources(document: TomlDocument) -> list[Problem]:
    """Receivers without a source: import and replay need none, a station does."""
    tables = document.values.get("receivers", {})
    message = "missing: add the address of the receiver's bytes, such as serial:///dev/ttyACM0?baud=460800 or tcp://host:port"
    return [
        document.problem(("receivers", name, "source"), message)
        for name, table in (tables.items() if isinstance(tables, dict) else ())
        if isinstance(table, dict) and "source" not in table
    ]


def override_site(site: SiteFile, settings: Sequence[str]) -> SiteFile:
    """The site with `KEY=VALUE` settings laid over it, all of them at once; ConfigProblems of the file `--set` if they do not fit.

    KEY is dotted (`integrity.rule`), or bare where only one section has it. VALUE is TOML, or else taken as text.
    """
    original = parse_toml(site.text, site.file)
    values = tomllib.loads(original.text)
    problems: list[Problem] = []
    overridden: set[str] = set()
    for setting in settings:
        parts = _setting_parts(setting)
        if isinstance(parts, Problem):
            problems.append(parts)
            continue
        value = setting.partition("=")[2].strip()
        overridden.add(dotted(parts))
        if not _put(values, parts, _setting_value(value)):
            problems.append(Problem(COMMAND_LINE, None, dotted(parts), value, f"expected a key in a table, such as {EXAMPLE_SETTING}"))
    if problems:
        raise ConfigProblems(problems)
    try:
        resolved = resolve_site(TomlDocument(site.file, format_toml(values), values, original.lines))
    except ConfigProblems as error:  # the file alone was sound, so whatever is wrong now comes from the settings
        raise ConfigProblems([replace(p, file=COMMAND_LINE, line=None) for p in error.problems]) from None
    warnings = [replace(p, file=COMMAND_LINE, line=None) if p.key in overridden else p for p in resolved.warnings]
    return replace(resolved, file=f"{site.file} with {COMMAND_LINE}", warnings=by_line(warnings))


def _setting_parts(setting: str) -> Parts | Problem:
    """The key of a `KEY=VALUE` in full, or why there is none."""
    key, equals, value = (text.strip() for text in setting.partition("="))
    parts, rest = split_key(key)
    if not equals or not parts or rest:
        return Problem(COMMAND_LINE, None, key, value, f"expected KEY=VALUE, such as {EXAMPLE_SETTING}")
    if len(parts) > 1:
        return parts
    fields = {name: model.model_fields for name, model in SECTIONS.items() if name != "receivers"}
    homes = [name for name in fields if parts[0] in fields[name]]
    if len(homes) == 1:
        return (*homes[0].split("."), *parts)
    known = [field for section in fields.values() for field in section]
    several = f"several sections have this key: write {' or '.join(f'{home}.{key}' for home in homes)}"
    return Problem(COMMAND_LINE, None, key, value, several if homes else unknown_key(parts[0], known))


def _setting_value(text: str) -> Any:
    try:
        parsed = tomllib.loads(f"value = {text}")
    except ValueError:
        return text
    return parsed["value"] if len(parsed) == 1 else text


def _put(values: dict[str, Any], parts: Parts, value: Any) -> bool:
    """Set a value in nested tables, making those that are missing; False where the way leads through something else."""
    table: Any = values
    for part in parts[:-1]:
        table = table.setdefault(part, {})
        if not isinstance(table, dict):
            return False
    table[parts[-1]] = value
    return True
