"""JSON of unknown origin, taken apart value by value: whatever is wrong is collected, nothing is guessed, nothing else is raised."""

import json
import re
from collections.abc import Callable, Collection, Mapping
from typing import Any

from integrity.gnss.gps_time import parse_utc
from recordings.toml_file import SHOWN_CHARACTERS, ConfigProblems, Problem, did_you_mean

MOST_LISTED = 10  # problems with the elements of one list; the rest is counted
MOST_COMPARED, LONGEST_ID = 200, 64
ID = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.-]{0,63}")

Kind = Callable[[Any], Any]  # gives the value of a sound one; ValueError with what would be right for any other
Table = dict[str, Any]


class Reading:
    """One file: its name, and what was found wrong with it so far. Keys of problems are dotted: `edges.main.points.17`."""

    def __init__(self, file: str) -> None:
        self.file = file
        self.problems: list[Problem] = []

    def note(self, key: str, value: object, message: str) -> None:
        """One more problem; `value` is shown as JSON, unless it is a table or `...` (there is none)."""
        shown = "" if value is ... or isinstance(value, dict) else _shown(value)
        self.problems.append(Problem(self.file, None, key, shown, message))

    def table(self, key: str, value: object, kinds: Mapping[str, Kind], defaults: Mapping[str, Any]) -> Table | None:
        """The values of an object by their keys, those left out by default; None if anything is wrong with it."""
        if not isinstance(value, dict):
            self.note(key, value, f"expected an object with {', '.join(kinds)}")
            return None
        before = len(self.problems)
        inside = f"{key}." if key else ""
        unknown = sorted(set(value) - set(kinds))
        for other in unknown[:MOST_LISTED]:
            self.note(f"{inside}{_shown(other)[1:-1]}", ..., f"no such key: expected {', '.join(kinds)}{_hint(other, kinds)}")
        if len(unknown) > MOST_LISTED:
            self.note(key, ..., f"{len(unknown) - MOST_LISTED} more keys that are none: expected {', '.join(kinds)}")
        found: Table = {}
        for name, kind in kinds.items():
            if name in value:
                try:
                    found[name] = kind(value[name])
                except ValueError as wrong:
                    self.note(f"{inside}{name}", value[name], f"expected {wrong}")
            elif name in defaults:
                found[name] = defaults[name]
            else:
                self.note(f"{inside}{name}", ..., f'missing: add "{name}"')
        return found if len(self.problems) == before else None

    def tables(self, key: str, values: list[Any], kinds: Mapping[str, Kind], defaults: Mapping[str, Any]) -> list[Table]:
        """The sound ones of a list of objects."""
        found = [self.table(place(key, index, value), value, kinds, defaults) for index, value in enumerate(values)]
        return [table for table in found if table is not None]

    def listed(self, key: str, wrong: list[tuple[int, object, str]]) -> None:
        """Problems with elements of a list, by index; of very many only the first."""
        for index, value, message in wrong[:MOST_LISTED]:
            self.note(f"{key}.{index}", value, message)
        if len(wrong) > MOST_LISTED:
            self.note(key, ..., f"{len(wrong) - MOST_LISTED} more like these, the last at {wrong[-1][0]}")

    def ids(self, key: str, values: list[Any]) -> set[str]:
        """The ids of a list of objects, wrong as these may be in other ways; what stands twice is noted."""
        found = [value["id"] for value in values if isinstance(value, dict) and isinstance(value.get("id"), str)]
        self.once(key, found, "give each an id of its own")
        return set(found)

    def once(self, key: str, names: list[str], remedy: str) -> None:
        """Note names that stand twice."""
        seen: set[str] = set()
        for name in names:
            if name in seen:
                self.note(key, name, f"stands twice: {remedy}")
            seen.add(name)


def read_json(text: str, reading: Reading) -> Any:
    """The values of a JSON text; keys that stand twice are noted, NaN comes through. ConfigProblems where it is not JSON."""

    def table(pairs: list[tuple[str, Any]]) -> Table:
        values = dict(pairs)
        if len(values) < len(pairs):
            reading.once("", [name for name, _ in pairs], "an object has each key once")
        return values

    try:
        return json.loads(text.removeprefix("\ufeff"), object_pairs_hook=table)
    except json.JSONDecodeError as error:
        hint = "text and keys stand in double quotes, a decimal has a point, a comma between any two and none after the last"
        message = f"not JSON ({error.msg} at column {error.colno}): {hint}"
        raise ConfigProblems([Problem(reading.file, error.lineno, "", "", message)]) from error
    except (ValueError, RecursionError) as error:  # a whole number of thousands of digits; thousands of brackets in each other
        message = f"cannot be read ({type(error).__name__}): numbers of thousands of digits and as many nested brackets are no map"
        raise ConfigProblems([Problem(reading.file, None, "", "", f"{message}; get the file again")]) from error


def place(key: str, index: int, value: Any) -> str:
    """`edges.main`, or `edges.3` where there is no good id."""
    own = value.get("id") if isinstance(value, dict) else None
    return f"{key}.{own}" if isinstance(own, str) and ID.fullmatch(own) else f"{key}.{index}"


def is_number(value: object, low: float, high: float) -> bool:
    """Whether a JSON value is a number from `low` to `high`; NaN, text and true are not."""
    return type(value) in (int, float) and low <= value <= high  # type: ignore[operator]


def name(value: Any) -> str:
    """An id."""
    if not isinstance(value, str) or not ID.fullmatch(value):
        raise ValueError('a name of up to 64 letters, digits, "-", "_" and ".", such as "main-1"')
    return value


def optional_name(value: Any) -> str | None:
    """An id or null."""
    return None if value is None else name(value)


def text(value: Any) -> str:
    """A line of text."""
    if not isinstance(value, str) or not value.strip() or not value.isprintable():
        raise ValueError('text in quotes, not empty, such as "JGD2011"')
    return value


def utc(value: Any) -> str:
    """A UTC time, as it was written."""
    expected = 'a UTC time in quotes, such as "2026-03-01T00:00:00Z"'
    if not isinstance(value, str) or not value.isascii():
        raise ValueError(expected)
    try:
        parse_utc(value)
    except ValueError as error:
        raise ValueError(expected) from error
    return value


def sha256(value: Any) -> str:
    """A hash, in small letters."""
    if not isinstance(value, str) or not re.fullmatch("[0-9A-Fa-f]{64}", value):
        raise ValueError("64 hex digits: SHA-256 of the map without this key, as JSON with sorted keys and no spaces")
    return value.lower()


def array(value: Any) -> list[Any]:
    """A list, whatever is in it."""
    if not isinstance(value, list):
        raise ValueError("a list, in [ ]")
    return value


def pairs(member: Kind) -> Kind:
    """A list of pairs."""

    def kind(value: Any) -> tuple[tuple[Any, Any], ...]:
        if not isinstance(value, list) or not value or not all(isinstance(pair, list) and len(pair) == 2 for pair in value):
            raise ValueError('pairs of edge ids that may be passed one into the other, such as [["main", "left"], ["main", "right"]]')
        for one in (one for pair in value for one in pair):
            try:
                member(one)
            except ValueError as wrong:
                raise ValueError(f"for {_shown(one)} {wrong}") from wrong
        return tuple((a, b) for a, b in value)

    return kind


def metres_within(most: float) -> Kind:
    """A number of metres."""

    def kind(value: Any) -> float:
        if not is_number(value, -most, most):
            raise ValueError("a number in metres, without quotes")
        return float(value)

    return kind


def one_of(*options: object) -> Kind:
    """A value that is one of a few."""

    def kind(value: Any) -> Any:
        if not any(type(value) is type(option) and value == option for option in options):
            listed = " or ".join(json.dumps(option) for option in options)
            raise ValueError(listed + _hint(value, [option for option in options if isinstance(option, str)]))
        return value

    return kind


def known(ids: Collection[str], what: str) -> Kind:
    """The id of something that the file has."""

    def kind(value: Any) -> str:
        if not isinstance(value, str) or value not in ids:
            raise ValueError(f"the id of {what} of this map{_hint(value, ids)}; add it there or correct the id")
        return value

    return kind


def _hint(value: object, options: Collection[str]) -> str:
    """What may have been meant, where looking for it takes no time."""
    if not isinstance(value, str) or len(value) > LONGEST_ID or len(options) > MOST_COMPARED:
        return ""
    return did_you_mean(value, [option for option in options if ID.fullmatch(option)])


def _shown(value: object) -> str:
    """As JSON in plain ASCII, not too much of it."""
    if isinstance(value, list) and len(value) > 10:
        return f"[{len(value)} elements]"
    try:
        written = json.dumps(value)
    except (ValueError, RecursionError):
        return "…"
    return written if len(written) <= SHOWN_CHARACTERS else written[: SHOWN_CHARACTERS - 1] + "…"
