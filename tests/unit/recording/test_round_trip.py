"""What is written is read again, to the byte: messages, snapshots, and bytes of receivers."""

import random
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from google.protobuf.message import Message
from mcap.reader import make_reader

from integrity.events import Event, RawBytes
from integrity.gnss.gps_time import utc_from_gps
from integrity.messages import wayside_pb2 as pb
from integrity.messages.inputs import decode_event, encode_event
from integrity.messages.snapshots import decode_snapshot, encode_snapshot
from integrity.station_monitor import StationMonitor
from recordings.channels import STATION_TOPICS, is_input, topic_of
from recordings.reader import Contents, read_recording
from recordings.replay import decide_and_record
from recordings.writer import RecordingWriter
from tests.unit.recording.written import METADATA, SECONDS, SITE_FILE, data, messages, stepped, write
from tests.unit.streams import SITE, START_NS, rows_changed, stream


def encoded(event: Event) -> bytes:
    assert not isinstance(event, RawBytes)
    return data(encode_event(event))


# Round trip


def test_there_is_a_message_of_every_topic_in_the_round_trip() -> None:
    assert {topic_of(message) for message, _ in messages()} == set(STATION_TOPICS)


def test_every_message_is_read_as_it_was_written(tmp_path: Path) -> None:
    listed = messages()
    write(tmp_path / "x.mcap", listed)
    read = [(e.topic, e.data) for e in read_recording(tmp_path / "x.mcap").entries]
    assert read == [(topic_of(message), data(message)) for message, _ in listed]


def test_metadata_is_read_as_it_was_written(contents: Contents) -> None:
    assert contents.metadata == METADATA


def test_a_whole_recording_has_no_damage(contents: Contents) -> None:
    assert (contents.damage, contents.skipped_chunks) == ("", 0)


def test_counts_are_of_each_topic(contents: Contents) -> None:
    counts = contents.counts()
    assert (counts["/observations"], counts["/tick"], counts["/epoch"]) == (3 * SECONDS, SECONDS, SECONDS)


def test_inputs_are_read_as_the_events_they_were(contents: Contents) -> None:
    events = rows_changed(stream(SECONDS), stepped)
    inputs = [e.message for e in contents.entries if is_input(e.topic) and isinstance(e.message, Message)]
    read = [decode_event(m) for m in inputs]
    assert [encoded(e) for e in read] == [encoded(e) for e in events]


def test_a_snapshot_is_read_as_the_memory_it_was() -> None:
    message = next(m for m, _ in messages() if isinstance(m, pb.Snapshot))
    again = encode_snapshot(decode_snapshot(message), tuple(message.receiver), message.mono_ns)
    assert data(again) == data(message)


def test_the_same_events_give_the_same_bytes(tmp_path: Path, whole: Path) -> None:
    again = tmp_path / "again.mcap"
    decide_and_record(again, SITE_FILE, rows_changed(stream(SECONDS), stepped), METADATA)
    assert again.read_bytes() == whole.read_bytes()


@pytest.mark.parametrize("name", ["last_seen_ns", "pseudorange_m", "cn0_baseline_dbhz"])
def test_what_is_remembered_of_streams_is_read_to_the_bit(name: str) -> None:
    monitor = StationMonitor(SITE)
    monitor.feed(stream(SECONDS))
    was = monitor.snapshot()
    now = decode_snapshot(encode_snapshot(was, SITE.receiver_names, START_NS))
    assert now.streams.signals == was.streams.signals != ()
    np.testing.assert_array_equal(getattr(now.streams, name), getattr(was.streams, name))


# Bytes of receivers

BOOT_NS = 98_765_432_101  # a monotonic clock begins anywhere
PIECES = [  # odd times and lengths, two at one moment, one that is no text and one that is no UBX
    RawBytes(BOOT_NS, "A", b"\xb5\x62"),
    RawBytes(BOOT_NS, "B", bytes(range(256))),
    RawBytes(BOOT_NS + 1, "A", b"$GNGGA,"),
    RawBytes(BOOT_NS + 999_999_999, "north-1", b"\x00"),
    RawBytes(BOOT_NS + 7_000_000_003, "B", random.Random(2).randbytes(70_001)),
]


def raw_recording(path: Path, receivers: Sequence[str]) -> Contents:
    with RecordingWriter(path, "wayside test", START_NS, BOOT_NS, {}, receivers) as writer:
        for piece in PIECES:
            writer.write_event(piece)
    return read_recording(path)


@pytest.mark.parametrize("announced", [("A", "B", "north-1"), ()], ids=["announced", "not announced"])
def test_bytes_of_receivers_are_read_as_they_came(tmp_path: Path, announced: Sequence[str]) -> None:
    contents = raw_recording(tmp_path / "x.mcap", announced)
    assert [(e.topic, e.message) for e in contents.entries] == [(f"/receiver/{p.receiver}/raw", p.data) for p in PIECES]


def test_bytes_of_receivers_are_logged_to_the_nanosecond_of_their_arrival(tmp_path: Path) -> None:
    contents = raw_recording(tmp_path / "x.mcap", ())
    assert [e.log_ns - utc_from_gps(START_NS) + BOOT_NS for e in contents.entries] == [p.mono_ns for p in PIECES]


def test_receivers_with_channels_are_known_without_a_message(tmp_path: Path) -> None:
    assert raw_recording(tmp_path / "x.mcap", ("A", "B", "C")).receivers == ("A", "B", "C", "north-1")


def test_bytes_older_than_what_was_recorded_are_refused(tmp_path: Path) -> None:
    with RecordingWriter(tmp_path / "x.mcap", "test", START_NS, BOOT_NS, {}) as writer:
        writer.write_raw("A", b"later", BOOT_NS + 5)
        with pytest.raises(ValueError, match=r"x\.mcap: bytes of receiver B are 2 ns older"):
            writer.write_raw("B", b"earlier", BOOT_NS + 3)


def test_another_reader_is_told_that_bytes_are_ubx_without_a_schema(tmp_path: Path) -> None:
    raw_recording(tmp_path / "x.mcap", ("A",))
    with (tmp_path / "x.mcap").open("rb") as file:
        channels = make_reader(file).get_summary().channels.values()
    assert {(c.message_encoding, c.schema_id) for c in channels if c.topic.endswith("/raw")} == {("ubx", 0)}
