"""The disk of a recorder: a directory that cannot be or goes, and a disk that is too slow; a file never hides a gap."""

import shutil
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from integrity.errors import ConfigError
from integrity.events import Event
from recordings import recorder as module
from recordings.reader import read_recording
from recordings.recorder import Recorder, check_directory
from recordings.replay import complaints
from tests.e2e.recorder.recorded import FIRST, GPS_NS, MONO_NS, SNAPSHOT, files, numbers, piece


def until(true: Callable[[], bool], within_s: float = 10.0) -> None:
    end = time.monotonic() + within_s
    while not true():
        assert time.monotonic() < end, "waited in vain"
        time.sleep(0.01)


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
