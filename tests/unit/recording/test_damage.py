"""Every flipped bit is noticed, or changes nothing; what is cut or damaged is never taken for what was written."""

import random
from collections.abc import Callable, Sequence
from pathlib import Path

import pytest
from mcap.opcode import Opcode
from mcap.reader import make_reader

from integrity.errors import RecordingError
from integrity.gnss.gps_time import NS_PER_S, utc_from_gps
from recordings.reader import Contents, Entry, read_recording, salvage
from tests.unit.streams import START_NS

FLIPS = 200


def facts(entries: Sequence[Entry]) -> list[tuple[str, int, bytes]]:
    return [(e.topic, e.log_ns, e.data) for e in entries]


def chunk_places(path: Path) -> list[tuple[int, int]]:
    """Offset and length of each chunk record, by the index of the MCAP library."""
    with path.open("rb") as file:
        summary = make_reader(file).get_summary()
    return sorted((index.chunk_start_offset, index.chunk_length) for index in summary.chunk_indexes)


def spoiled(path: Path, target: Path, place: int, change: Callable[[int], int]) -> Path:
    content = bytearray(path.read_bytes())
    content[place] = change(content[place])
    target.write_bytes(content)
    return target


@pytest.fixture(scope="module")
def flipped(whole: Path, tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    """Copies with one bit flipped, at pseudo-random places."""
    rng, directory = random.Random(20260302), tmp_path_factory.mktemp("flipped")
    size = whole.stat().st_size
    places = [(rng.randrange(size), rng.randrange(8)) for _ in range(FLIPS)]
    return [spoiled(whole, directory / f"{at}.{bit}", at, lambda byte, bit=bit: byte ^ 1 << bit) for at, bit in places]  # type: ignore[misc]


def test_a_flipped_bit_is_refused_or_changes_no_message(flipped: list[Path], contents: Contents) -> None:
    for path in flipped:
        try:
            read = facts(read_recording(path).entries)
        except RecordingError:
            continue
        assert read == facts(contents.entries), path.name


def test_what_is_salvaged_after_a_flipped_bit_are_messages_that_were_written_in_their_order(
    flipped: list[Path], contents: Contents
) -> None:
    for path in flipped:
        try:
            kept = facts(salvage(path).entries)
        except RecordingError:
            continue
        written = iter(facts(contents.entries))
        assert all(entry in written for entry in kept), path.name


@pytest.mark.parametrize("bit", range(8))
def test_a_chunk_whose_kind_was_flipped_is_missed(whole: Path, contents: Contents, tmp_path: Path, bit: int) -> None:
    start, _ = chunk_places(whole)[5]
    path = spoiled(whole, tmp_path / "x.mcap", start, lambda byte: byte ^ 1 << bit)
    assert whole.read_bytes()[start] == Opcode.CHUNK
    try:
        read = facts(read_recording(path).entries)
    except RecordingError:
        return
    assert read == facts(contents.entries)


def test_metadata_with_a_flipped_bit_is_noticed(whole: Path, tmp_path: Path) -> None:
    place = whole.read_bytes().index(b"none\n")
    with pytest.raises(RecordingError):
        read_recording(spoiled(whole, tmp_path / "x.mcap", place, lambda byte: byte ^ 1))


def test_a_damaged_chunk_is_counted(whole: Path, tmp_path: Path) -> None:
    start, length = chunk_places(whole)[5]
    damaged = salvage(spoiled(whole, tmp_path / "x.mcap", start + length - 20, lambda byte: byte ^ 1))
    assert damaged.skipped_chunks == 1


def test_a_damaged_chunk_takes_its_own_messages_with_it_and_no_others(whole: Path, contents: Contents, tmp_path: Path) -> None:
    start, length = chunk_places(whole)[5]
    damaged = salvage(spoiled(whole, tmp_path / "x.mcap", start + length - 20, lambda byte: byte ^ 1))
    lost = utc_from_gps(START_NS) // NS_PER_S + 5
    assert facts(damaged.entries) == [f for f in facts(contents.entries) if f[1] // NS_PER_S != lost]


def test_a_damaged_recording_is_refused_with_the_command_that_saves_it(whole: Path, tmp_path: Path) -> None:
    start, length = chunk_places(whole)[5]
    path = spoiled(whole, tmp_path / "x.mcap", start + length - 20, lambda byte: byte ^ 1)
    with pytest.raises(RecordingError, match=rf"x\.mcap: a chunk is damaged .*`wayside recording recover {path} -o"):
        read_recording(path)


def test_a_cut_recording_is_refused_with_the_command_that_saves_it(whole: Path, tmp_path: Path) -> None:
    path = tmp_path / "x.mcap"
    path.write_bytes(whole.read_bytes()[:-1000])
    with pytest.raises(RecordingError, match=rf"`wayside recording recover {path} -o"):
        read_recording(path)


def test_a_recording_cut_between_two_records_is_cut(whole: Path, tmp_path: Path) -> None:
    start, length = chunk_places(whole)[7]
    path = tmp_path / "x.mcap"
    path.write_bytes(whole.read_bytes()[: start + length])
    assert salvage(path).damage
