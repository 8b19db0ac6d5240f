"""A spoiled stream, what was recorded and decided of it, and how it is decided again."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from integrity.events import Event
from integrity.gnss.gps_time import NS_PER_S
from integrity.gnss.observations import ObservationRow
from integrity.outputs import EpochReport, Output
from recordings.reader import Contents, read_recording
from recordings.replay import decide, decide_and_record, replayable
from recordings.site_file import SiteFile, override_site, parse_site
from tests.unit.sites import ALL_UBX, edited
from tests.unit.streams import START_NS, epoch_of, reports, rows_changed, stream, with_more

SECONDS = 40
SLOW_EPOCHS, SLOW_INTERVAL_S = 270, 30  # two hours and a quarter: three snapshots, new ephemerides on the way
EDITS = (ALL_UBX, ("recover_after_s = 30.0", "recover_after_s = 5.0"), ('fault = "stop"', 'fault = "exclude"'))
SITE = parse_site(edited(*EDITS), "site.toml")
SLOW_SITE = override_site(SITE, [f"epoch_interval_s={SLOW_INTERVAL_S}.0", "recover_after_s=90.0"])


def off(row: ObservationRow, satellite: str, metres: float) -> ObservationRow:
    columns = [i for i, s in enumerate(row.signals) if s.startswith(satellite)]
    return with_more(row, "pseudorange_m", metres, columns)


def spoiled(row: ObservationRow) -> ObservationRow | None:
    """A satellite off, then one receiver off, then the same receiver silent."""
    second = epoch_of(row)
    if 8 <= second < 12:
        return off(row, "G07", 40.0)
    if 16 <= second < 18 and row.receiver == "B":
        return with_more(row, "pseudorange_m", 30.0, slice(0, 6))
    return None if 24 <= second < 29 and row.receiver == "B" else row


EVENTS = rows_changed(stream(SECONDS), spoiled)


def spoiled_around_the_second_snapshot(row: ObservationRow) -> ObservationRow:
    """A satellite off from 55 to 75 minutes: it is out when the snapshot of the first hour is taken. All signals 15 dB down from 62 to 64
    minutes, which only shows against what C/N0 was before the snapshot."""
    minute = epoch_of(row) / 60
    row = with_more(row, "cn0_dbhz", -15.0) if 62 <= minute < 64 else row
    return off(row, "G07", 40.0) if 55 <= minute < 75 else row


@dataclass(frozen=True)
class Recorded:
    """A recording, and what was decided while it was made."""

    path: Path
    contents: Contents
    outputs: Sequence[Output]


def recorded(path: Path, site: SiteFile, events: Sequence[Event]) -> Recorded:
    outputs, _ = decide_and_record(path, site, events, {"truth": {"faults": "as in the test\n"}})
    return Recorded(path, read_recording(path), outputs)


def replayed(contents: Contents, block_epochs: int = 1000, start_ns: int | None = None, end_ns: int | None = None) -> list[EpochReport]:
    todo = replayable(contents, None, start_ns, end_ns)
    outputs, _ = decide(todo.site, todo.events, todo.snapshot, block_epochs)
    return reports(outputs)


def minutes(after: int) -> int:
    return START_NS + after * 60 * NS_PER_S


def cut(path: Path, target: Path, size: int) -> Path:
    target.write_bytes(path.read_bytes()[:size])
    return target
