"""The recorder of a station: a file an hour, each of them decided alone as it was in the row."""

import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import pytest

from integrity.events import Event, RawBytes
from integrity.gnss.gps_time import NS_PER_S, parse_utc
from integrity.messages.outputs import encode_output
from integrity.messages.snapshots import encode_snapshot
from integrity.outputs import EpochReport, Output
from integrity.station_monitor import StationMonitor
from recordings.diff import differences, recorded_reports
from recordings.reader import read_recording, salvage
from recordings.recorder import Recorder
from recordings.replay import complaints, decide, replayable, started
from recordings.simulate.observations import antennas_of
from recordings.simulate.receiver import as_bytes
from recordings.summary import decisions_sha256
from station.recording import manner_of
from tests.e2e.recorder.recorded import BOOT_ID, FIRST, GPS_NS, MONO_NS, MOST_LOST_S, SECOND, SITE, SNAPSHOT, files, numbers, piece
from tests.unit.streams import stream

# A file of its own


def test_a_file_begins_with_who_records_and_what_is_remembered(recorder: Recorder[Event], tmp_path: Path) -> None:
    recorder.begin(SNAPSHOT, MONO_NS, GPS_NS)
    recorder.close()
    contents = read_recording(tmp_path / "rec" / f"{FIRST}.mcap")
    assert (complaints(contents), started(contents).boot_id, started(contents).mono_ns) == ([], BOOT_ID, MONO_NS)


def test_bytes_are_replayed_as_they_came_and_when(recorder: Recorder[Event], tmp_path: Path) -> None:
    pieces = [piece(k, MONO_NS + k * 123_456_789) for k in range(20)]
    recorder.begin(SNAPSHOT, MONO_NS, GPS_NS)
    for event in pieces:
        recorder.event(event)
    recorder.close()
    assert replayable(read_recording(tmp_path / "rec" / f"{FIRST}.mcap")).events == tuple(pieces)


def test_a_name_that_is_taken_gets_a_number_and_nothing_is_overwritten(tmp_path: Path, said: list[str]) -> None:
    for _ in range(3):
        one = Recorder(tmp_path, manner_of(SITE, BOOT_ID), said.append)
        one.begin(SNAPSHOT, MONO_NS, GPS_NS)
        one.close()
    assert files(tmp_path) == [f"{FIRST}-1.mcap", f"{FIRST}-2.mcap", f"{FIRST}.mcap"]


def test_what_nothing_follows_reaches_the_disk_all_the_same(recorder: Recorder[Event], tmp_path: Path) -> None:
    recorder.begin(SNAPSHOT, MONO_NS, GPS_NS)
    for k in range(5):
        recorder.event(piece(k))
    time.sleep(MOST_LOST_S)
    assert numbers(salvage(tmp_path / "rec" / f"{FIRST}.mcap.part")) == [0, 1, 2, 3, 4]


# The hour


@pytest.fixture(scope="module")
def arrived() -> list[Event]:
    """Twenty seconds of UBX bytes. Each burst comes in two halves 0.2 s apart; the hour ends between those of the eleventh."""
    found: list[Event] = []
    for event in as_bytes(stream(20), antennas_of(SITE.config)):
        if isinstance(event, RawBytes):
            half = len(event.data) // 2 + 1
            later_ns = event.mono_ns + NS_PER_S // 5
            found += [replace(event, data=event.data[:half]), replace(event, mono_ns=later_ns, data=event.data[half:])]
    return sorted(found, key=lambda event: event.mono_ns)


def recorded_live(recorder: Recorder[Event], events: Sequence[Event]) -> list[Output]:
    """What the thread that decides does, event by event."""
    monitor, outputs = StationMonitor(SITE.config), []
    gps_ahead_ns = GPS_NS - events[0].mono_ns
    for event in events:
        if recorder.wants_file(event.mono_ns):
            memory = encode_snapshot(monitor.snapshot(), SITE.config.receiver_names, event.mono_ns)
            recorder.begin(memory, event.mono_ns, event.mono_ns + gps_ahead_ns)
        recorder.event(event)
        for output in monitor.feed([event]):
            recorder.output(encode_output(output, SITE.config, "test"))
            outputs.append(output)
    recorder.close()
    return outputs


def reports(outputs: Sequence[Output]) -> list[EpochReport]:
    return [o for o in outputs if isinstance(o, EpochReport)]


def test_a_file_ends_with_the_hour(recorder: Recorder[Event], arrived: list[Event], tmp_path: Path) -> None:
    recorded_live(recorder, arrived)
    assert files(tmp_path / "rec") == [f"{FIRST}.mcap", f"{SECOND}.mcap"]


def test_an_hour_that_has_begun_does_not_begin_once_more(recorder: Recorder[Event]) -> None:
    """The clock of a file comes from the last epoch before it: a few milliseconds earlier or later than that of the file before."""
    hour_ns = parse_utc("2026-03-02T04:00:00Z")
    recorder.begin(SNAPSHOT, MONO_NS, hour_ns - 10 * NS_PER_S)
    crossed_ns = MONO_NS + 10 * NS_PER_S + 1
    assert recorder.wants_file(crossed_ns)
    recorder.begin(SNAPSHOT, crossed_ns, hour_ns - 5_000_000)
    assert [recorder.wants_file(crossed_ns + after_ns) for after_ns in (0, 1_000_000, 10_000_000)] == [False] * 3


def test_each_hour_alone_is_decided_as_it_was_in_the_row(recorder: Recorder[Event], arrived: list[Event], tmp_path: Path) -> None:
    live = reports(recorded_live(recorder, arrived))
    assert len(live) == 20
    again = []
    for path in sorted((tmp_path / "rec").iterdir()):
        contents = read_recording(path)
        todo = replayable(contents)
        hour = reports(decide(todo.site, todo.events, todo.snapshot)[0])
        assert differences(recorded_reports(contents, None, None), hour) == []
        again += hour
    assert decisions_sha256(again) == decisions_sha256(live)


def test_outputs_stand_after_what_was_decided_on_and_with_their_fixes(
    recorder: Recorder[Event], arrived: list[Event], tmp_path: Path
) -> None:
    recorded_live(recorder, arrived[:54])  # nine seconds
    topics = [e.topic for e in read_recording(tmp_path / "rec" / f"{FIRST}.mcap").entries]
    last = len(topics) - topics[::-1].index("/epoch") - 1
    fixes = [f"/receiver/{r}/fix" for r in "ABC"]
    assert topics[last - 1 :] == ["/receiver/C/raw", "/epoch", *fixes, "/health"]
