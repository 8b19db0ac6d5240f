"""The recorder of a station, on a real disk: killed, full, gone, too slow; a file never hides a gap, and who decides never waits."""

import random
import shutil
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

import pytest

from integrity.errors import ConfigError
from integrity.events import Event, RawBytes
from integrity.gnss.gps_time import NS_PER_S, parse_utc
from integrity.messages.outputs import encode_output
from integrity.messages.snapshots import encode_snapshot
from integrity.outputs import EpochReport, Output
from integrity.station_monitor import StationMonitor
from recordings import recorder as module
from recordings.diff import differences, recorded_reports
from recordings.reader import Contents, read_recording, salvage
from recordings.recorder import Recorder, check_directory
from recordings.replay import complaints, decide, recover, replayable, started
from recordings.simulate.observations import antennas_of
from recordings.simulate.receiver import as_bytes
from recordings.site_file import parse_site
from recordings.summary import decisions_sha256
from station.recording import manner_of
from tests.unit.sites import edited
from tests.unit.streams import new_monitor, stream

SITE = parse_site(edited(("recover_after_s = 30.0", "recover_after_s = 5.0")), "site.toml")
GPS_NS = parse_utc("2026-03-02T03:59:49.9Z")
FIRST, SECOND = "kokubunji-1-20260302T035949Z", "kokubunji-1-20260302T040000Z"
BOOT_ID = bytes(range(16))
MONO_NS = 55 * NS_PER_S
KILLS = 10
MOST_LOST_S = 1.5
SNAPSHOT = encode_snapshot(new_monitor(SITE.config).snapshot(), SITE.config.receiver_names, 0)


@pytest.fixture
def said() -> list[str]:
    return []


@pytest.fixture
def recorder(tmp_path: Path, said: list[str]) -> Iterator[Recorder[Event]]:
    made = Recorder(tmp_path / "rec", manner_of(SITE, BOOT_ID), said.append)
    yield made
    made.close()


def piece(number: int, mono_ns: int = MONO_NS, size: int = 8) -> RawBytes:
    return RawBytes(mono_ns, "A", number.to_bytes(8, "big") + bytes(size - 8))


def numbers(contents: Contents) -> list[int]:
    return [int.from_bytes(e.message[:8], "big") for e in contents.entries if isinstance(e.message, bytes)]


def until(true: Callable[[], bool], within_s: float = 10.0) -> None:
    end = time.monotonic() + within_s
    while not true():
        assert time.monotonic() < end, "waited in vain"
        time.sleep(0.01)


def files(directory: Path) -> list[str]:
    return sorted(path.name for path in directory.iterdir())


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


# Killed


CHILD = """
import sys, time
from pathlib import Path
from integrity.events import RawBytes
from integrity.messages.wayside_pb2 import Snapshot
from recordings.site_file import parse_site
from recordings.recorder import Recorder
from station.recording import manner_of
from tests.unit.sites import SITE

recorder = Recorder(Path(sys.argv[1]), manner_of(parse_site(SITE, "site.toml"), bytes(16)), print)
recorder.begin(Snapshot(), time.monotonic_ns(), 1_456_459_190_000_000_000)
number = 0
while True:
    for _ in range(3):
        recorder.event(RawBytes(time.monotonic_ns(), "A", number.to_bytes(8, "big") + bytes(1000)))
        print(number, time.monotonic(), flush=True)
        number += 1
    time.sleep(0.1)
"""


def killed(directory: Path, after_s: float) -> list[tuple[int, float]]:
    """Numbers that a recording process had handed over when it was killed, and when; read until nothing comes any more."""
    with subprocess.Popen([sys.executable, "-c", CHILD, str(directory)], stdout=subprocess.PIPE, text=True) as child:
        assert child.stdout is not None
        first = child.stdout.readline()
        time.sleep(after_s)
        child.kill()
        lines = [first, *child.stdout.readlines()]
    return [(int(number), float(when)) for number, when in (line.split() for line in lines if line.endswith("\n"))]


@pytest.fixture(scope="module")
def kills(tmp_path_factory: pytest.TempPathFactory) -> list[tuple[Path, list[tuple[int, float]]]]:
    """At random moments, several processes at a time."""
    rng = random.Random(9)
    work = [(tmp_path_factory.mktemp("killed"), rng.uniform(1.5, 3.5)) for _ in range(KILLS)]
    with ThreadPoolExecutor(KILLS) as pool:
        handed_over = list(pool.map(lambda item: killed(*item), work))
    return [(next(directory.iterdir()), what) for (directory, _), what in zip(work, handed_over, strict=True)]


def test_after_a_kill_the_file_is_recovered_to_a_whole_one(kills: list[tuple[Path, list[tuple[int, float]]]], tmp_path: Path) -> None:
    for k, (part, _) in enumerate(kills):
        recover(part, tmp_path / f"{k}.mcap")
        assert complaints(read_recording(tmp_path / f"{k}.mcap")) == []


def test_a_kill_costs_the_last_second_and_a_half_at_most(kills: list[tuple[Path, list[tuple[int, float]]]]) -> None:
    for part, handed_over in kills:
        kept = set(numbers(salvage(part)))
        lost = [when for number, when in handed_over if number not in kept]
        assert not lost or handed_over[-1][1] - lost[0] <= MOST_LOST_S


def test_a_kill_leaves_no_hole(kills: list[tuple[Path, list[tuple[int, float]]]]) -> None:
    for part, _ in kills:
        kept = numbers(salvage(part))
        assert kept == list(range(len(kept)))


# The disk is full: in a process of its own, which may write a file of 100 kB and no larger

FULL = """
import resource, signal, sys, time
from pathlib import Path
from tests.e2e import test_recorder as t

t.module.RETRY_AFTER_S = 0.2
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
_, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
resource.setrlimit(resource.RLIMIT_FSIZE, (100_000, hard))
recorder = t.Recorder(Path(sys.argv[1]), t.manner_of(t.SITE, t.BOOT_ID), lambda line: print("said", line, flush=True))
random, slowest, began = t.random.Random(3), 0.0, time.monotonic()
for number in range(400):
    if number == 240:
        resource.setrlimit(resource.RLIMIT_FSIZE, (hard, hard))
    now_ns = time.monotonic_ns()
    if recorder.wants_file(now_ns):
        recorder.begin(t.SNAPSHOT, now_ns, t.GPS_NS)
    event = t.RawBytes(now_ns, "A", number.to_bytes(8, "big") + random.randbytes(3000))
    before = time.monotonic()
    recorder.event(event)
    slowest = max(slowest, time.monotonic() - before)
    time.sleep(0.01)
recorder.close()
print("lost", recorder.lost)
print("slowest", slowest)
"""


@pytest.fixture(scope="module")
def full(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, list[str]]:
    directory = tmp_path_factory.mktemp("full")
    done = subprocess.run([sys.executable, "-c", FULL, str(directory)], capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 0, done.stderr
    return directory, done.stdout.splitlines()


def test_a_full_disk_is_said_once_with_what_to_do_and_so_is_that_it_goes_on(full: tuple[Path, list[str]]) -> None:
    said = [line for line in full[1] if line.startswith("said")]
    assert len(said) == 2
    assert "File too large): make room on the disk; recording stops, decisions go on" in said[0]
    assert ".mcap: recording again; " in said[1]


def test_what_a_full_disk_cost_is_counted_and_the_rest_is_in_files(full: tuple[Path, list[str]]) -> None:
    directory, printed = full
    kept = [number for path in directory.iterdir() for number in numbers(salvage(path))]
    assert len(set(kept)) == len(kept)
    assert printed[-2] == f"lost {400 - len(kept)}"


def test_the_file_after_a_full_disk_is_whole_and_decidable_alone(full: tuple[Path, list[str]]) -> None:
    (whole,) = full[0].glob("*.mcap")
    contents = read_recording(whole)
    assert complaints(contents) == []
    assert numbers(contents) == list(range(numbers(contents)[0], 400))


def test_a_full_disk_keeps_nobody_waiting(full: tuple[Path, list[str]]) -> None:
    assert float(full[1][-1].removeprefix("slowest ")) < 0.1


# The directory


@pytest.mark.parametrize("below", ["file", "file/deeper"])
def test_a_directory_that_cannot_be_is_refused_before_the_start(tmp_path: Path, below: str) -> None:
    (tmp_path / "file").write_text("no directory")
    with pytest.raises(ConfigError, match=r"\[record\] directory .*file.*: cannot be written to \(.*\); give a directory"):
        check_directory(tmp_path / below)


def test_a_directory_that_may_not_be_written_to_is_refused() -> None:
    with pytest.raises(ConfigError, match=r"\[record\] directory /proc/self: cannot be written to"):
        check_directory(Path("/proc/self"))


def test_a_directory_is_made_and_left_empty(tmp_path: Path) -> None:
    check_directory(tmp_path / "var" / "wayside")
    assert files(tmp_path / "var" / "wayside") == []


def test_a_directory_that_goes_while_it_records_is_noticed_and_used_again(
    recorder: Recorder[Event], said: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(module, "RETRY_AFTER_S", 0.1)
    recorder.begin(SNAPSHOT, MONO_NS, GPS_NS)
    recorder.event(piece(0))
    until(lambda: recorder.file is not None)
    shutil.rmtree(tmp_path / "rec")
    (tmp_path / "rec").write_text("in the way")
    until(lambda: recorder.file is None)
    for _ in range(3):  # tried in vain
        until(lambda: recorder.wants_file(MONO_NS))
        recorder.begin(SNAPSHOT, MONO_NS, GPS_NS)
    until(lambda: recorder.wants_file(MONO_NS))
    (tmp_path / "rec").unlink()
    recorder.begin(SNAPSHOT, MONO_NS, GPS_NS)
    recorder.event(piece(1))
    until(lambda: len(said) == 2)
    recorder.close()
    assert numbers(read_recording(tmp_path / "rec" / f"{FIRST}.mcap")) == [1]
    assert [" recording stops" in line for line in said] == [True, False]


def test_a_failed_disk_is_left_alone_for_a_while(recorder: Recorder[Event], tmp_path: Path) -> None:
    (tmp_path / "rec").write_text("in the way")
    recorder.begin(SNAPSHOT, MONO_NS, GPS_NS)
    time.sleep(0.5)
    assert not recorder.wants_file(MONO_NS)


# The queue


@pytest.fixture
def overflowed(recorder: Recorder[Event], tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> tuple[Recorder[Event], Path]:
    """Eight large pieces at once, of which the queue takes two; two more when there is room again."""
    monkeypatch.setattr(module, "MOST_BYTES", 16_000_000)
    recorder.begin(SNAPSHOT, MONO_NS, GPS_NS)
    until(lambda: recorder.file is not None)
    for k in range(8):
        recorder.event(piece(k, size=8_000_000))
    until(lambda: recorder.wants_file(MONO_NS))
    recorder.begin(SNAPSHOT, MONO_NS, GPS_NS)
    for k in (8, 9):
        recorder.event(piece(k))
    recorder.close()
    return recorder, tmp_path / "rec"


def test_what_the_queue_did_not_take_ends_the_file_that_says_how_much_is_missing(overflowed: tuple[Recorder[Event], Path]) -> None:
    recorder, directory = overflowed
    contents = read_recording(directory / f"{FIRST}.mcap")
    kept = numbers(contents)
    assert kept == list(range(len(kept)))
    assert contents.metadata["recorder"] == {"dropped": str(8 - len(kept))}
    assert recorder.lost == 8 - len(kept) > 0


def test_after_a_gap_a_new_file_begins_with_a_snapshot(overflowed: tuple[Recorder[Event], Path]) -> None:
    contents = read_recording(overflowed[1] / f"{FIRST}-1.mcap")
    assert complaints(contents) == []
    assert numbers(contents) == [8, 9]


def test_a_gap_is_said_once_and_so_is_its_end(overflowed: tuple[Recorder[Event], Path], said: list[str]) -> None:
    assert [("too slow" in line, "recording again" in line) for line in said] == [(True, False), (False, True)]


def test_what_is_on_the_disk_is_counted(overflowed: tuple[Recorder[Event], Path]) -> None:
    recorder, directory = overflowed
    assert recorder.bytes_written == sum(path.stat().st_size for path in directory.iterdir())
