"""TOML with line numbers: what stands where, what is wrong with it, and what would be right.

`tomllib` reads the values; a scanner of statements finds the line of each key. It only has to know where a statement ends (strings,
brackets and comments hide newlines and signs), so it stays small, and a file that tomllib refuses does not stop it.
"""

import difflib
import json
import re
import tomllib
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from integrity.errors import ConfigError

Parts = tuple[str, ...]

SHOWN_CHARACTERS = 100  # of a value: three coordinates fit, a runaway string does not
BARE_KEY = re.compile(r"[A-Za-z0-9_-]+")
_KEY_PART = re.compile(r"""[ \t]*("(?:\\.|[^"\\\n])*"|'[^'\n]*'|[A-Za-z0-9_-]+)[ \t]*""")
_TOKEN = re.compile(
    r'"""(?:\\.|[^\\])*?(?:"""(?:"{0,2})|\Z)'  # a multi-line string may end in two quotes of its own
    r"|'''.*?(?:'''(?:'{0,2})|\Z)"
    r'|"(?:\\.|[^"\\\n])*"'
    r"|'[^'\n]*'"
    r"|#[^\n]*"
    r"|[^\n\"'#\[\]{}]+"
    r"|.",
    re.DOTALL,
)
_PLACE = re.compile(r" \(at (?:line (\d+), column (\d+)|end of document)\)")
_PASSWORD = re.compile(r"(?<=://)([^:/@\s]*):[^\s\"]*@")


@dataclass(frozen=True)
class Problem:
    """One thing wrong in a file: `key` is dotted, `value` is TOML text (empty if there is none), `message` says what would be right."""

    file: str
    line: int | None
    key: str
    value: str
    message: str

    def __str__(self) -> str:
        place = self.file if self.line is None else f"{self.file}:{self.line}"
        what = " = ".join(text for text in (self.key, self.value) if text)
        return ": ".join(text for text in (place, what, self.message) if text)


class ConfigProblems(ConfigError):
    """Everything wrong with one file, by line, problems without a line last; `warnings` were found on the way and stop nothing."""

    def __init__(self, problems: Iterable[Problem], warnings: Iterable[Problem] = ()) -> None:
        self.problems = by_line(problems)
        self.warnings = by_line(warnings)
        super().__init__(self.problems, self.warnings)  # as they came, so that the error crosses to another process whole

    def __str__(self) -> str:
        return "\n".join(str(problem) for problem in self.problems)


def by_line(problems: Iterable[Problem]) -> tuple[Problem, ...]:
    """In the order of their lines; without a line last; those of one line stay as they came."""
    return tuple(sorted(problems, key=lambda problem: (problem.line is None, problem.line or 0)))


@dataclass(frozen=True)
class TomlDocument:
    """A parsed file: `lines` holds the line (from 1) of every key and table by its dotted name, such as `fault.0.kind`."""

    file: str
    text: str
    values: dict[str, Any]
    lines: dict[str, int]

    def line_of(self, *parts: str) -> int | None:
        """Line of a key, else of the nearest table around it that the file has, else None."""
        around = (dotted(parts[:length]) for length in range(len(parts), 0, -1))
        return next((self.lines[key] for key in around if key in self.lines), None)

    def problem(self, parts: Parts, message: str) -> Problem:
        """A problem with the value at a key, there or missing. A password in a URL is not repeated."""
        return Problem(self.file, self.line_of(*parts), dotted(parts), _shortened(self._value_text(parts)), message)

    def _value_text(self, parts: Parts) -> str:
        value: Any = self.values
        for part in parts:
            if isinstance(value, list) and part.isdigit() and int(part) < len(value):
                value = value[int(part)]
            elif isinstance(value, dict) and part in value:
                value = value[part]
            else:
                return ""
        try:
            return "" if isinstance(value, dict) else format_value(value)
        except (ValueError, RecursionError):  # a whole number of thousands of digits; tables of thousands in each other
            return "…"


def read_toml(path: Path) -> TomlDocument:
    """Read a file. Raises ConfigProblems if it cannot be read, is not UTF-8, or is not TOML."""
    try:
        data = path.read_bytes()
    except OSError as error:
        message = f"cannot be read ({error.strerror}): give the path of a readable TOML file"
        raise ConfigProblems([Problem(str(path), None, "", "", message)]) from error
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        message = f"byte 0x{data[error.start]:02x} is not UTF-8: save the file as UTF-8"
        raise ConfigProblems([Problem(str(path), data.count(b"\n", 0, error.start) + 1, "", "", message)]) from error
    return parse_toml(text, str(path))


def parse_toml(text: str, file: str) -> TomlDocument:
    """Parse TOML; `file` is the name that problems carry. Raises ConfigProblems: every repeated key, and the first syntax error."""
    text = text.removeprefix("\ufeff")
    places = _Places()
    for line, statement in _statements(text):
        places.note(line, statement)
    try:
        values = tomllib.loads(text)
    except (ValueError, RecursionError) as error:
        repeats = [
            Problem(file, line, key, value, f"stands twice, first in line {places.lines[key]}: keep one of them")
            for line, key, value in places.repeats
        ]
        syntax = _syntax_problem(file, str(error), places)
        raise ConfigProblems(repeats + [syntax] * all(syntax.line != repeat.line for repeat in repeats)) from error
    return TomlDocument(file, text, values, places.lines)


@dataclass
class _Places:
    """Follows the statements of a file and notes the line of every key, table and implied table."""

    lines: dict[str, int] = field(default_factory=dict)
    stated: list[tuple[int, str, str]] = field(default_factory=list)  # line, key and value of each statement
    repeats: list[tuple[int, str, str]] = field(default_factory=list)  # of those, the ones whose key stood before
    _keys: set[str] = field(default_factory=set)
    _table: Parts = ()
    _array_length: dict[Parts, int] = field(default_factory=dict)

    def note(self, line: int, statement: str) -> None:
        parts, rest = split_key(statement.lstrip("["))
        if not parts:
            self.stated.append((line, "", _shortened(statement)))
        elif statement.startswith("["):
            path = (*self._through_arrays(parts[:-1]), parts[-1])
            if statement.startswith("[["):
                self.lines.setdefault(dotted(path), line)
                index = self._array_length.get(path, 0)
                self._array_length[path] = index + 1
                path += (str(index),)
            self._table = path
            self._state(line, path, "")
        else:
            self._state(line, self._table + parts, rest.removeprefix("=").strip())

    def _through_arrays(self, parts: Parts) -> Parts:
        """The path with the index of the table that an array of tables is at: `[fault.train]` belongs to the last `[[fault]]`."""
        path: Parts = ()
        for part in parts:
            path += (part,)
            if path in self._array_length:
                path += (str(self._array_length[path] - 1),)
        return path

    def _state(self, line: int, path: Parts, value: str) -> None:
        for length in range(1, len(path)):
            self.lines.setdefault(dotted(path[:length]), line)
        key = dotted(path)
        statement = (line, key, _shortened(value))
        self.stated.append(statement)
        if key in self._keys:
            self.repeats.append(statement)
        else:
            self._keys.add(key)
            self.lines[key] = line


def _statements(text: str) -> Iterator[tuple[int, str]]:
    """Headers, key/value pairs and lone comments, each with the line it begins in. A newline in a string or a bracket ends none."""
    line, depth, begun_at, begun_line = 1, 0, -1, 0
    for token in _TOKEN.finditer(text):
        piece = token.group()
        if piece == "\n" and depth == 0 and begun_at >= 0:
            yield begun_line, text[begun_at : token.start()]
            begun_at = -1
        elif begun_at < 0 and piece.strip():
            begun_at, begun_line = token.start() + len(piece) - len(piece.lstrip()), line
        if len(piece) == 1:
            depth = max(0, depth + (piece in "[{") - (piece in "]}"))
        line += piece.count("\n")
    if begun_at >= 0:
        yield begun_line, text[begun_at:]


def split_key(text: str) -> tuple[Parts, str]:
    """The dotted key that a text begins with, and what follows it: `a."b c" = 1` gives `("a", "b c")` and `= 1`."""
    parts: Parts = ()
    position = 0
    while match := _KEY_PART.match(text, position):
        parts += (_unquoted(match[1]),)
        position = match.end()
        if not text.startswith(".", position):
            break
        position += 1
    return parts, text[position:]


def _unquoted(part: str) -> str:
    if part[0] not in "\"'":
        return part
    try:
        return str(tomllib.loads(f"key = {part}")["key"])
    except tomllib.TOMLDecodeError:  # a wrong escape: parse_toml refuses the file
        return part


def _syntax_problem(file: str, error: str, places: _Places) -> Problem:
    place = _PLACE.search(error)
    stated = places.stated or [(1, "", "")]
    line = int(place[1]) if place and place[1] else stated[-1][0]
    begun_line, key, value = next((statement for statement in reversed(stated) if statement[0] <= line), stated[0])
    column = f" at column {place[2]}" if place and place[2] else ""
    inside = f", in what begins in line {begun_line}" if begun_line != line else ""
    hint = 'text stands in "quotes", a decimal has a point, brackets and quotes are closed, one key = value stands on a line'
    return Problem(file, line, key, value, f"not TOML ({_PLACE.sub('', error)}{column}{inside}): {hint}")


def dotted(parts: Iterable[str]) -> str:
    """The name of a key; a part that TOML would quote is quoted."""
    return ".".join(part if BARE_KEY.fullmatch(part) else _quoted(part) for part in parts)


def did_you_mean(word: str, options: Iterable[str]) -> str:
    """`; did you mean "full"?` if an option is close, else nothing."""
    close = difflib.get_close_matches(word.lower(), list(options), n=1)
    return f'; did you mean "{close[0]}"?' if close else ""


def format_value(value: Any) -> str:
    """A value as TOML, on one line."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return _quoted(value)
    if isinstance(value, list | tuple):
        return "[" + ", ".join(format_value(element) for element in value) + "]"
    if isinstance(value, dict):
        return "{" + ", ".join(f"{dotted([key])} = {format_value(element)}" for key, element in value.items()) + "}"
    return str(value)


def format_toml(tables: Mapping[str, Any], inside: Parts = ()) -> str:
    """Nested tables as TOML text that parses to the same values; an array of tables is written inline."""
    plain = [f"{dotted([key])} = {format_value(value)}\n" for key, value in tables.items() if not isinstance(value, dict)]
    nested = [format_toml(value, (*inside, key)) for key, value in tables.items() if isinstance(value, dict)]
    header = [f"[{dotted(inside)}]\n"] if inside and (plain or not nested) else []
    return "".join(header + plain + nested)


def _quoted(text: str) -> str:
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007F")  # JSON's escapes are TOML's, but for DEL


def _shortened(text: str) -> str:
    line = _PASSWORD.sub(r"\1:***@", " ".join(text.split()))
    return line if len(line) <= SHOWN_CHARACTERS else line[: SHOWN_CHARACTERS - 1] + "…"
