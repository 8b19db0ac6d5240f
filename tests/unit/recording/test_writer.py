"""How a recording is written: the time of each message, a chunk a second, and no final name before it is complete."""

import random
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path

import pytest
from google.protobuf.message import Message
from mcap.records import Chunk
from mcap.stream_reader import StreamReader

from integrity.gnss.gps_time import NS_PER_S, utc_from_gps
from integrity.messages import wayside_pb2 as pb
from recordings.reader import read_recording, salvage
from recordings.writer import CHUNK_BYTES, RecordingWriter
from tests.unit.recording.written import SECONDS, data, messages, write
from tests.unit.streams import START_NS


def names_in(directory: Path) -> list[str]:
    return sorted(path.name for path in directory.iterdir())


def chunks(path: Path) -> list[Chunk]:
    with path.open("rb") as file:
        return [record for record in StreamReader(file, emit_chunks=True).records if isinstance(record, Chunk)]


# Time


def test_log_time_is_utc_at_the_start_plus_elapsed_monotonic_time(tmp_path: Path) -> None:
    boot_ns = 12_345  # a monotonic clock begins anywhere
    with RecordingWriter(tmp_path / "x.mcap", "test", START_NS, boot_ns, {}) as writer:
        for elapsed_ns in (0, 7, NS_PER_S):
            writer.write(pb.Tick(mono_ns=boot_ns + elapsed_ns), boot_ns + elapsed_ns)
    logged = [e.log_ns - utc_from_gps(START_NS) for e in read_recording(tmp_path / "x.mcap").entries]
    assert logged == [0, 7, NS_PER_S]


def test_log_time_never_steps_back(tmp_path: Path) -> None:
    times = [START_NS + s * NS_PER_S for s in (0, 5, 3, 4, 6)]
    write(tmp_path / "x.mcap", [(pb.Tick(mono_ns=t), t) for t in times])
    logged = [e.log_ns for e in read_recording(tmp_path / "x.mcap").entries]
    assert [b >= a for a, b in pairwise(logged)] == [True] * 4


def test_messages_keep_their_order_where_time_would_step_back(tmp_path: Path) -> None:
    times = [START_NS + s * NS_PER_S for s in (0, 5, 3, 4, 6)]
    write(tmp_path / "x.mcap", [(pb.Tick(mono_ns=t), t) for t in times])
    read = [e.message for e in read_recording(tmp_path / "x.mcap").entries]
    assert [m.mono_ns for m in read if isinstance(m, pb.Tick)] == times


# Chunks


def test_no_chunk_reaches_over_a_second_of_recorded_time(whole: Path) -> None:
    assert all(c.message_start_time // NS_PER_S == c.message_end_time // NS_PER_S for c in chunks(whole))


def test_every_second_of_recorded_time_has_a_chunk(whole: Path) -> None:
    seconds = [c.message_end_time // NS_PER_S - utc_from_gps(START_NS) // NS_PER_S for c in chunks(whole)]
    assert sorted(set(seconds)) == list(range(SECONDS))


def test_a_busy_second_is_cut_at_the_size_of_a_chunk(tmp_path: Path) -> None:
    site_toml = random.Random(1).randbytes(20_000).hex()  # 40 kB a message
    write(tmp_path / "x.mcap", [(pb.Started(site_toml=site_toml), START_NS)] * 20)
    assert max(c.uncompressed_size for c in chunks(tmp_path / "x.mcap")) <= CHUNK_BYTES + 41_000


# The name of the file


def test_the_file_grows_under_the_name_part(tmp_path: Path) -> None:
    with RecordingWriter(tmp_path / "x.mcap", "test", START_NS, START_NS, {}) as writer:
        writer.write(pb.Tick(), START_NS)
        assert names_in(tmp_path) == ["x.mcap.part"]


def test_the_file_has_its_own_name_when_it_is_complete(tmp_path: Path) -> None:
    write(tmp_path / "x.mcap", messages())
    assert names_in(tmp_path) == ["x.mcap"]


def interrupted(path: Path, listed: Sequence[tuple[Message, int]]) -> None:
    with pytest.raises(ZeroDivisionError), RecordingWriter(path, "test", START_NS, START_NS, {}) as writer:
        for message, mono_ns in listed:
            writer.write(message, mono_ns)
        raise ZeroDivisionError


def test_an_exception_leaves_the_part_and_no_final_file(tmp_path: Path) -> None:
    interrupted(tmp_path / "x.mcap", messages())
    assert names_in(tmp_path) == ["x.mcap.part"]


def test_an_exception_leaves_the_file_that_was_there_before(tmp_path: Path) -> None:
    write(tmp_path / "x.mcap", messages())
    before = (tmp_path / "x.mcap").read_bytes()
    interrupted(tmp_path / "x.mcap", messages())
    assert (tmp_path / "x.mcap").read_bytes() == before


def test_what_an_exception_leaves_is_salvaged_up_to_the_last_second(tmp_path: Path) -> None:
    listed = messages()
    interrupted(tmp_path / "x.mcap", listed)
    kept = [e.data for e in salvage(tmp_path / "x.mcap.part").entries]
    assert kept == [data(m) for m, mono_ns in listed if mono_ns < START_NS + (SECONDS - 1) * NS_PER_S]
