"""One line of the table at the end."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Row:
    """One line of the table. `unmet` says what was not as expected; empty where everything was."""

    name: str
    expected: str
    seen: str
    unmet: tuple[str, ...]
