"""A train under attack: its process, and all that it said, each with when it came; afterwards, what it wrote down."""

import signal
import subprocess
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from recordings.reader import Entry, salvage
from tests.e2e.train_field import train_process

NORMAL = "TRUST_NORMAL"
END_WITHIN_S = 10.0


@dataclass(frozen=True)
class Said:
    """One position. `told_ns`: when the line was read, of the one monotonic clock of this machine; `mono_ns`: when it was decided."""

    told_ns: int
    mono_ns: int
    trust: str
    status: str
    refused: int
    valid_for_ns: int
    gps_time_ns: int | None

    @property
    def trusts(self) -> bool:
        return self.trust == NORMAL


@dataclass
class Aboard:
    """`said` grows while the train runs."""

    process: subprocess.Popen[str]
    folder: Path
    said: list[Said]

    def until(self, condition: Callable[[Said], bool], within_s: float) -> Said | None:
        """The first position from now on for which the condition holds; None if none comes in time."""
        k = len(self.said)
        deadline_s = time.monotonic() + within_s
        while time.monotonic() < deadline_s:
            while k < len(self.said):
                if condition(self.said[k]):
                    return self.said[k]
                k += 1
            time.sleep(0.01)
        return None

    @property
    def trusts(self) -> bool:
        return bool(self.said) and self.said[-1].trusts

    def log(self) -> str:
        """What it says to people."""
        return (self.folder / "train.log").read_text()

    def end(self) -> int:
        """Ask it to end, as a service manager would; its exit code."""
        self.process.send_signal(signal.SIGTERM)
        return self.process.wait(END_WITHIN_S)

    def recorded(self) -> tuple[Entry, ...]:
        """Everything that it recorded, in order; it has ended."""
        return tuple(e for path in sorted((self.folder / "train-recordings").glob("*.mcap")) for e in salvage(path).entries)


@contextmanager
def aboard(train_file: Path) -> Iterator[Aboard]:
    """`wayside train run --json`. Killed at the end if it still runs."""
    said: list[Said] = []
    with train_process(train_file, lambda position: said.append(_said(position, time.monotonic_ns()))) as process:
        yield Aboard(process, train_file.parent, said)


def _said(position: dict[str, Any], told_ns: int) -> Said:
    return Said(
        told_ns,
        int(position["mono_ns"]),
        position.get("trust", "TRUST_UNSPECIFIED"),
        position["status"],
        int(position["refused_messages"]),
        int(position.get("valid_for_ms", 0)) * 1_000_000,
        int(position["gps_time_ns"]) if "gps_time_ns" in position else None,
    )
