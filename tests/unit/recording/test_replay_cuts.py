"""A recording is recovered, and decided as it was, up to wherever it was cut or damaged."""

import random
from dataclasses import replace
from pathlib import Path

import pytest
from mcap.reader import make_reader

from integrity.errors import RecordingError
from integrity.gnss.gps_time import NS_PER_S, utc_from_gps
from recordings.diff import differences, recorded_reports
from recordings.reader import read_recording, salvage
from recordings.replay import complaints, recover, span_utc, started
from recordings.summary import decisions_sha256
from tests.unit.recording.replayed import Recorded, cut, replayed
from tests.unit.streams import reports

CUTS = 50


def test_a_recording_whose_head_is_missing_is_refused(fast: Recorded) -> None:
    headless = replace(fast.contents, entries=fast.contents.entries[1:])
    with pytest.raises(RecordingError, match="begins with /snapshot, expected /started"):
        started(headless)


def chunk_seconds(path: Path) -> list[tuple[int, int]]:
    """For each chunk, in order, where it ends in the file and the second of recorded time that it holds; by the MCAP library's index."""
    with path.open("rb") as file:
        indexes = make_reader(file).get_summary().chunk_indexes
    return sorted((i.chunk_start_offset + i.chunk_length, i.message_start_time // NS_PER_S) for i in indexes)


def cuts(path: Path) -> list[int]:
    """Places in the head and the first chunk, in the summary at the end, in the chunks between, and around the ends of some."""
    rng = random.Random(50)
    ends = [end for end, _ in chunk_seconds(path)]
    parts = [(0, ends[0])] * 5 + [(ends[-1], path.stat().st_size)] * 5 + [(ends[0], ends[-1])] * (CUTS - 19)
    return [rng.randrange(*part) for part in parts] + [end + by for end in (ends[0], ends[20], ends[-1]) for by in (-1, 0, 1)]


@pytest.fixture(scope="module")
def cut_places(fast: Recorded) -> list[tuple[int, int]]:
    """Sizes of cut files, each with the second of recorded time in which the cut fell."""
    seconds = chunk_seconds(fast.path)
    return [(size, next((s for end, s in seconds if end > size), seconds[-1][1] + 1)) for size in cuts(fast.path)]


def test_cuts_fall_into_the_first_second_and_many_others(cut_places: list[tuple[int, int]]) -> None:
    seconds = {second for _, second in cut_places}
    assert len(cut_places) == CUTS
    assert len(seconds) > 20


def first_second(fast: Recorded) -> int:
    return fast.contents.entries[0].log_ns // NS_PER_S


def test_a_cut_file_is_recovered_up_to_the_second_of_the_cut(fast: Recorded, cut_places: list[tuple[int, int]], tmp_path: Path) -> None:
    for size, second in cut_places:
        if second == first_second(fast):
            continue
        recover(cut(fast.path, tmp_path / "cut.mcap", size), tmp_path / "saved.mcap")
        saved = [(e.topic, e.log_ns, e.data) for e in read_recording(tmp_path / "saved.mcap").entries]
        whole = [(e.topic, e.log_ns, e.data) for e in fast.contents.entries if e.log_ns // NS_PER_S < second]
        assert saved == whole, size


def test_a_recovered_file_is_decided_as_the_original_was_up_to_the_cut(
    fast: Recorded, cut_places: list[tuple[int, int]], tmp_path: Path
) -> None:
    originally = reports(fast.outputs)
    for size, second in cut_places:
        if second == first_second(fast):
            continue
        recover(cut(fast.path, tmp_path / "cut.mcap", size), tmp_path / "saved.mcap")
        again = replayed(read_recording(tmp_path / "saved.mcap"))
        until = [r for r in originally if utc_from_gps(r.gps_time_ns) // NS_PER_S < second]
        assert decisions_sha256(again) == decisions_sha256(until), size


def test_a_recovered_file_differs_nowhere_from_its_own_record(fast: Recorded, tmp_path: Path) -> None:
    size = fast.path.stat().st_size * 2 // 3
    recover(cut(fast.path, tmp_path / "cut.mcap", size), tmp_path / "saved.mcap")
    saved = read_recording(tmp_path / "saved.mcap")
    assert differences(recorded_reports(saved, None, None), replayed(saved)) == []


def test_a_file_cut_in_its_first_second_is_refused_by_name(fast: Recorded, cut_places: list[tuple[int, int]], tmp_path: Path) -> None:
    early = [size for size, second in cut_places if second == first_second(fast)]
    assert early
    for size in early:
        with pytest.raises(RecordingError, match=r"cut\.mcap: .*(nothing to decide|not an MCAP recording)"):
            recover(cut(fast.path, tmp_path / "cut.mcap", size), tmp_path / "saved.mcap")
        assert not (tmp_path / "saved.mcap").exists()


def test_recovering_a_whole_file_gives_the_same_bytes(fast: Recorded, tmp_path: Path) -> None:
    recover(fast.path, tmp_path / "saved.mcap")
    assert (tmp_path / "saved.mcap").read_bytes() == fast.path.read_bytes()


def test_recovering_keeps_the_truth(fast: Recorded, tmp_path: Path) -> None:
    recover(cut(fast.path, tmp_path / "cut.mcap", fast.path.stat().st_size // 2), tmp_path / "saved.mcap")
    assert read_recording(tmp_path / "saved.mcap").metadata == fast.contents.metadata


def test_a_recovery_that_fails_leaves_the_file_that_was_there(fast: Recorded, tmp_path: Path) -> None:
    (tmp_path / "saved.mcap").write_bytes(b"precious")
    with pytest.raises(RecordingError):
        recover(cut(fast.path, tmp_path / "cut.mcap", 5000), tmp_path / "saved.mcap")
    assert (tmp_path / "saved.mcap").read_bytes() == b"precious"


def damaged_in_second_20(fast: Recorded, target: Path) -> Path:
    end, _ = chunk_seconds(fast.path)[20]
    content = bytearray(fast.path.read_bytes())
    content[end - 30] ^= 0xFF
    target.write_bytes(content)
    return target


def test_of_a_file_damaged_in_its_middle_all_but_that_second_is_recovered(fast: Recorded, tmp_path: Path) -> None:
    recover(damaged_in_second_20(fast, tmp_path / "damaged.mcap"), tmp_path / "saved.mcap")
    lost = first_second(fast) + 20
    saved = [(e.topic, e.log_ns) for e in read_recording(tmp_path / "saved.mcap").entries]
    assert saved == [(e.topic, e.log_ns) for e in fast.contents.entries if e.log_ns // NS_PER_S != lost]


def test_before_the_damage_is_decided_as_it_was(fast: Recorded, tmp_path: Path) -> None:
    recover(damaged_in_second_20(fast, tmp_path / "damaged.mcap"), tmp_path / "saved.mcap")
    again = replayed(read_recording(tmp_path / "saved.mcap"))
    assert decisions_sha256(again[:20]) == decisions_sha256(reports(fast.outputs)[:20])


def test_damage_is_told(fast: Recorded, tmp_path: Path) -> None:
    found = complaints(salvage(damaged_in_second_20(fast, tmp_path / "damaged.mcap")))
    assert len(found) == 1
    assert "damaged" in found[0]


def test_of_a_whole_file_there_is_nothing_to_complain(fast: Recorded) -> None:
    assert complaints(fast.contents) == []


def test_a_file_without_its_snapshot_is_a_complaint(fast: Recorded) -> None:
    entries = tuple(e for e in fast.contents.entries if e.topic != "/snapshot")
    assert complaints(replace(fast.contents, entries=entries)) == ["begins with /started and /ionosphere, expected /started and /snapshot"]


def test_log_time_that_steps_back_is_a_complaint(fast: Recorded) -> None:
    entries = fast.contents.entries
    assert complaints(replace(fast.contents, entries=(*entries, entries[1]))) == ["log time steps back"]


def test_the_span_is_that_of_first_and_last_message(fast: Recorded) -> None:
    assert span_utc(fast.contents) == ("2026-03-02T03:00:00Z", "2026-03-02T03:00:39Z")
