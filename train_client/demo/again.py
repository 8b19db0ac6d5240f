"""The two recordings of the demo, decided again: rows of the table like the others."""

from collections.abc import Sequence
from pathlib import Path

from recordings import replay as of_station
from recordings.diff import differences, recorded_reports
from recordings.reader import read_recording
from recordings.summary import in_window
from train_client import replay as of_train
from train_client.demo.row import Row

EXPECTED = "decided again: as it did"


def saved(path: Path) -> Path:
    """The recording; where it was cut, a whole one beside it of what was written until then."""
    if path.suffix != ".part":
        return path
    whole = path.with_suffix("")
    of_station.recover(path, whole)
    return whole


def station_row(recordings: Sequence[Path]) -> Row:
    """Every epoch that was recorded. The last one of a killed station may have been cut off before its decision: it has none to differ."""
    epochs, unmet = 0, [] if recordings else ["there is no recording"]
    for path in recordings:
        contents = read_recording(path)
        todo = of_station.replayable(contents, of_station.recorded_site(contents), None, None)
        outputs, _ = of_station.decide(todo.site, todo.events, todo.snapshot, 1000)
        recorded = recorded_reports(contents, None, None)
        last_ns = max((report.gps_time_ns for report in recorded), default=0)
        decided = [report for report in in_window(outputs, None, None)[0] if report.gps_time_ns <= last_ns]
        epochs += len(recorded)
        unmet += differences(recorded, decided)
    return _row("station's recording", f"{epochs} epochs", epochs, unmet)


def train_row(recordings: Sequence[Path]) -> Row:
    """Every position that was recorded."""
    positions, unmet = 0, [] if recordings else ["there is no recording"]
    for path in recordings:
        done = of_train.replay(read_recording(path), None, None)
        positions += len(done.recorded)
        unmet += of_train.differences(done.recorded, done.positions)
    return _row("train's recording", f"{positions} positions", positions, unmet)


def _row(name: str, what: str, count: int, unmet: Sequence[str]) -> Row:
    nothing = ["nothing was recorded"] if not count and not unmet else []
    shown = (*nothing, *unmet[:3], *([f"and {len(unmet) - 3} more"] if len(unmet) > 3 else []))
    return Row(name, EXPECTED, f"{what}, {f'{len(unmet)} differences' if unmet else 'no difference'}", shown)
