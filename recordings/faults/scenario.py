"""`[[fault]]` tables: when, which kind, how large; refused with everything that is wrong at once."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, Any

from pydantic import Field, ValidationError

from integrity.config import SiteConfig
from integrity.gnss.gps_time import NS_PER_S, format_utc, parse_utc
from recordings.faults.kinds import KINDS, AntennaMoved, Effect, LinkEffect
from recordings.site_schema import Section
from recordings.toml_file import ConfigProblems, Parts, Problem, TomlDocument, did_you_mean, dotted, parse_toml

RECEIVER_KEYS = ("receiver", "receivers", "from_receiver", "to_receivers")
UNBOUNDED = (AntennaMoved.kind,)  # kinds that last to the end of the recording where no duration is given


@dataclass(frozen=True)
class Fault:
    """One fault: epochs from `start_ns` to before `end_ns` (GPS time; None: to the end of the recording) are faulty by `effect`."""

    start_ns: int
    end_ns: int | None
    effect: Effect

    def __post_init__(self) -> None:
        if self.end_ns is not None and self.end_ns <= self.start_ns:
            raise ValueError(f"{self.kind}: the fault ends at {self.end_ns}, before or when it starts, {self.start_ns}")

    @property
    def kind(self) -> str:
        """The name of the kind, as in the file."""
        return self.effect.kind

    def covers(self, epoch_ns: int) -> bool:
        """Whether an epoch is faulty."""
        return self.start_ns <= epoch_ns and (self.end_ns is None or epoch_ns < self.end_ns)

    def elapsed_s(self, epoch_ns: int) -> float:
        """Since the start, at an epoch."""
        return (epoch_ns - self.start_ns) / NS_PER_S

    def __str__(self) -> str:
        end = "the end of the recording" if self.end_ns is None else format_utc(self.end_ns)
        return f"{self.kind} from {format_utc(self.start_ns)} to {end}"


def at_link(fault: Fault) -> bool:
    """Whether a fault acts between a receiver and the station, on what the receiver has sent."""
    return isinstance(fault.effect, LinkEffect)


class _When(Section):
    start: Annotated[str | None, Field(description='a UTC time in quotes, such as "2010-03-18T05:20:00Z"')] = None
    start_s: Annotated[float | None, Field(ge=-1e9, le=1e9, description="seconds after the first epoch")] = None
    duration_s: Annotated[float | None, Field(gt=0, le=1e9, description="seconds, above 0")] = None


def parse_faults(text: str, file: str, first_epoch_ns: int, site: SiteConfig) -> tuple[Fault, ...]:
    """The faults of a file of `[[fault]]` tables; `start_s` counts from `first_epoch_ns`. ConfigProblems with everything that is wrong."""
    document = parse_toml(text, file)
    faults, problems = read_faults(document, first_epoch_ns, site)
    problems += [
        document.problem((key,), "no such table: a file of faults holds [[fault]] tables, nothing else")
        for key in document.values
        if key != "fault"
    ]
    if not faults and not problems:
        problems = [Problem(file, None, "fault", "", f"missing: write [[fault]] and below it kind = one of {', '.join(KINDS)}")]
    if problems:
        raise ConfigProblems(problems)
    return tuple(faults)


def read_faults(document: TomlDocument, first_epoch_ns: int, site: SiteConfig) -> tuple[list[Fault], list[Problem]]:
    """The sound `[[fault]]` tables of a file that may hold more, and what is wrong with the others."""
    tables = document.values.get("fault", [])
    if not isinstance(tables, list) or not all(isinstance(table, dict) for table in tables):
        return [], [document.problem(("fault",), "expected tables: write [[fault]] and its keys below it")]
    faults: list[Fault] = []
    problems: list[Problem] = []
    for i, table in enumerate(tables):
        parts = ("fault", str(i))
        effect, wrong = _effect(document, parts, table, site.receiver_names)
        times, wrong_times = _times(document, parts, table, first_epoch_ns)
        problems += wrong + wrong_times
        if effect is not None and times is not None:
            faults.append(Fault(*times, effect))
    return faults, problems


def _effect(
    document: TomlDocument, parts: Parts, table: Mapping[str, Any], receivers: Sequence[str]
) -> tuple[Effect | None, list[Problem]]:
    kind = table.get("kind")
    if not isinstance(kind, str) or kind not in KINDS:
        hint = did_you_mean(kind, KINDS) if isinstance(kind, str) else ""
        message = f"{'no such kind' if 'kind' in table else 'missing: add kind'}: expected one of {', '.join(KINDS)}{hint}"
        return None, [document.problem((*parts, "kind"), message)]
    own = {key: value for key, value in table.items() if key != "kind" and key not in _When.model_fields}
    try:
        effect = KINDS[kind].model_validate(own)
    except ValidationError as error:
        return None, _problems(document, parts, KINDS[kind], own, error)
    problems = [
        problem for key in RECEIVER_KEYS if key in own for problem in _receiver_problems(document, (*parts, key), own[key], receivers)
    ]
    return (None if problems else effect), problems


def _receiver_problems(document: TomlDocument, at: Parts, named: str | Sequence[str], receivers: Sequence[str]) -> list[Problem]:
    names = [named] if isinstance(named, str) else named
    problems = [
        document.problem(at, f'the site has no receiver "{name}": expected {" or ".join(receivers)}{did_you_mean(name, receivers)}')
        for name in dict.fromkeys(names)
        if name not in receivers
    ]
    if len(set(names)) < len(names):
        problems.append(document.problem(at, "a receiver stands twice: name each once"))
    return problems


def _times(
    document: TomlDocument, parts: Parts, table: Mapping[str, Any], first_epoch_ns: int
) -> tuple[tuple[int, int | None] | None, list[Problem]]:
    """Start and end in GPS time, and what is wrong with them."""
    own = {key: table[key] for key in _When.model_fields if key in table}
    try:
        when = _When.model_validate(own)
    except ValidationError as error:
        return None, _problems(document, parts, _When, own, error)
    problems: list[Problem] = []
    start_ns = first_epoch_ns
    if (when.start is None) == (when.start_s is None):
        message = "give one of start (a UTC time) and start_s (seconds after the first epoch)"
        problems.append(document.problem((*parts, "start"), message if when.start else f"missing: {message}"))
    elif when.start is not None:
        try:
            start_ns = parse_utc(when.start)
        except ValueError:
            problems.append(document.problem((*parts, "start"), f"expected {_When.model_fields['start'].description}"))
    elif when.start_s is not None:
        start_ns += round(when.start_s * NS_PER_S)
    if when.duration_s is None and table.get("kind") not in UNBOUNDED and table.get("kind") in KINDS:
        problems.append(document.problem((*parts, "duration_s"), "missing: add duration_s, seconds, above 0"))
    end_ns = None if when.duration_s is None else start_ns + max(1, round(when.duration_s * NS_PER_S))
    return (None if problems else (start_ns, end_ns)), problems


def _problems(
    document: TomlDocument, parts: Parts, model: type[Section], table: Mapping[str, Any], error: ValidationError
) -> list[Problem]:
    """One problem per bad key, and those of the table as a whole."""
    whole = [document.problem(parts, str(found["msg"]).removeprefix("Value error, ")) for found in error.errors() if not found["loc"]]
    bad = dict.fromkeys(str(found["loc"][0]) for found in error.errors() if found["loc"])
    return [document.problem((*parts, key), _expectation(model, key, table)) for key in bad] + whole


def _expectation(model: type[Section], key: str, table: Mapping[str, Any]) -> str:
    if key not in model.model_fields:
        known = (*model.model_fields, *_When.model_fields)
        return "no such key" + (did_you_mean(key, known) or f": expected one of {', '.join(dotted([name]) for name in known)}")
    description = model.model_fields[key].description
    return f"expected {description}" if key in table else f"missing: add {key}, {description}"
