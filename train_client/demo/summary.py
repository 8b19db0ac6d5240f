"""What stands at the end: the table, the recordings, the commands that decide them again; for people and for machines."""

import shlex
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from train_client.demo.row import Row

NAME_COLUMNS = 27


@dataclass(frozen=True)
class Summary:
    """Of one demo."""

    folder: Path
    endpoint: str
    began_mono_ns: int
    duration_s: float
    rows: tuple[Row, ...]
    station_recordings: tuple[Path, ...]
    train_recordings: tuple[Path, ...]

    @property
    def failed(self) -> tuple[str, ...]:
        """Names of rows that are not as expected."""
        return tuple(row.name for row in self.rows if row.unmet)

    @property
    def commands(self) -> tuple[str, ...]:
        """That decide the recordings again."""
        return tuple(
            f"wayside {command} {shlex.quote(str(path))} --diff"
            for command, paths in (("replay", self.station_recordings), ("train replay", self.train_recordings))
            for path in paths
        )


def render(summary: Summary) -> str:
    """The table in words, two lines a row, and where everything lies."""
    lines = ["", "Expected against seen", ""]
    for row in summary.rows:
        lines.append(f"  {row.name:<{NAME_COLUMNS}}  expected  {row.expected}")
        lines.append(f"  {'NOT AS EXPECTED' if row.unmet else '':<{NAME_COLUMNS}}  seen      {row.seen}")
        lines += [f"  {'':<{NAME_COLUMNS}}  but       {unmet}" for unmet in row.unmet]
    lines += ["", *_verdict(summary), ""]
    lines += [f"Recording of the {who}: {path}" for who, path in _recordings(summary)]
    lines += ["Decide them again:", *(f"  {command}" for command in summary.commands)]
    return "\n".join(lines)


def as_json_object(summary: Summary) -> dict[str, Any]:
    """What `--json` prints."""
    return {
        "folder": str(summary.folder),
        "endpoint": summary.endpoint,
        "as_expected": not summary.failed,
        "began_mono_ns": summary.began_mono_ns,
        "duration_s": summary.duration_s,
        "rows": [
            {"name": row.name, "expected": row.expected, "seen": row.seen, "as_expected": not row.unmet, "unmet": list(row.unmet)}
            for row in summary.rows
        ],
        "recordings": {
            "station": [str(path) for path in summary.station_recordings],
            "train": [str(path) for path in summary.train_recordings],
        },
        "replay": list(summary.commands),
    }


def _verdict(summary: Summary) -> Sequence[str]:
    if summary.failed:
        return [f"{len(summary.failed)} of {len(summary.rows)} rows not as expected: {', '.join(summary.failed)}"]
    return [f"All {len(summary.rows)} rows as expected."]


def _recordings(summary: Summary) -> list[tuple[str, Path]]:
    return [("station", path) for path in summary.station_recordings] + [("train", path) for path in summary.train_recordings]
