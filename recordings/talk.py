"""Words to people while a program runs: on stderr, so that stdout stays data."""

import sys
from datetime import UTC, datetime


def say(line: str) -> None:
    """One line per change; with the clock on a terminal, without it where a journal has its own."""
    clock = f"{datetime.now(UTC):%H:%M:%S}  " if sys.stderr.isatty() else ""
    sys.stderr.write(f"{clock}{line}\n")  # in one piece: several threads speak
    sys.stderr.flush()
