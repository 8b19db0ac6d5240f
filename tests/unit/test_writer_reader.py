"""What is written is read again, to the byte; what is cut, damaged or foreign is never taken for what was written."""

import random
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from google.protobuf.descriptor_pb2 import FileDescriptorSet
from google.protobuf.descriptor_pool import DescriptorPool
from google.protobuf.message import Message
from google.protobuf.message_factory import GetMessageClass
from mcap.opcode import Opcode
from mcap.reader import make_reader
from mcap.records import Chunk
from mcap.stream_reader import StreamReader
from mcap.writer import Writer

from integrity.errors import DecodeError, RecordingError
from integrity.events import Event, RawBytes
from integrity.gnss.frames import ecef_from_geodetic
from integrity.gnss.gps_time import NS_PER_S, utc_from_gps
from integrity.gnss.observations import ObservationRow
from integrity.messages import wayside_pb2 as pb
from integrity.messages.fixes import location_fixes
from integrity.messages.inputs import decode_event, encode_event
from integrity.messages.location_fix_pb2 import LocationFix
from integrity.messages.outputs import encode_output
from integrity.messages.snapshots import decode_snapshot, encode_snapshot
from integrity.station_monitor import StationMonitor
from recordings.channels import ENCODING, PROFILE, STATION_TOPICS, is_input, schema_bytes, topic_of
from recordings.reader import Contents, Entry, read_recording, salvage
from recordings.replay import decide_and_record
from recordings.site_file import parse_site
from recordings.writer import CHUNK_BYTES, RecordingWriter
from tests.unit.sites import SITE as SITE_TEXT
from tests.unit.streams import RECOVER_AFTER_S, SITE, START_NS, TRIANGLE, epoch_of, rows_changed, stream, with_more

SECONDS = 12
FLIPS = 200
METADATA = {"truth": {"faults": "none\n"}, "import": {"dropped": "{}"}}
SITE_FILE = parse_site(SITE_TEXT.replace("recover_after_s = 30.0", f"recover_after_s = {RECOVER_AFTER_S}"), "site.toml")


def stepped(row: ObservationRow) -> ObservationRow:
    """From the eighth second on, a satellite 40 m off: excluded, alerted."""
    return with_more(row, "pseudorange_m", 40.0, [row.signals.index("G07.1C")]) if epoch_of(row) >= 8 else row


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A recording in which every kind of message stands."""
    path = tmp_path_factory.mktemp("whole") / "whole.mcap"
    decide_and_record(path, SITE_FILE, rows_changed(stream(SECONDS), stepped), METADATA)
    return path


@pytest.fixture(scope="module")
def contents(whole: Path) -> Contents:
    return read_recording(whole)


def messages() -> list[tuple[Message, int]]:
    """One or more of each topic, with the monotonic time at which it is written."""
    monitor = StationMonitor(SITE)
    events = rows_changed(stream(SECONDS), stepped)
    outputs = monitor.feed(events)
    listed: list[tuple[Message, int]] = [(pb.Started(site="test", software="wayside test", gps_time_ns=START_NS), START_NS)]
    listed.append((encode_snapshot(monitor.snapshot(), SITE.receiver_names, START_NS), START_NS))
    listed += [(encode_event(e), e.mono_ns) for e in events if not isinstance(e, RawBytes)]
    listed.append((pb.InputLost(mono_ns=events[-1].mono_ns, receiver="B", chunks=7), events[-1].mono_ns))
    listed += [(encode_output(o, SITE, "wayside test"), o.mono_ns) for o in outputs]
    return sorted(listed, key=lambda item: item[1])


def write(path: Path, listed: Sequence[tuple[Message, int]], metadata: dict[str, dict[str, str]] | None = None) -> None:
    with RecordingWriter(path, "wayside test", START_NS, START_NS, metadata or {}) as writer:
        for message, mono_ns in listed:
            writer.write(message, mono_ns)


def data(message: Message) -> bytes:
    """For comparison: NaN, "not measured", does not equal itself."""
    found: bytes = message.SerializeToString(deterministic=True)
    return found


def encoded(event: Event) -> bytes:
    assert not isinstance(event, RawBytes)
    return data(encode_event(event))


def facts(entries: Sequence[Entry]) -> list[tuple[str, int, bytes]]:
    return [(e.topic, e.log_ns, e.data) for e in entries]


def names_in(directory: Path) -> list[str]:
    return sorted(path.name for path in directory.iterdir())


def chunks(path: Path) -> list[Chunk]:
    with path.open("rb") as file:
        return [record for record in StreamReader(file, emit_chunks=True).records if isinstance(record, Chunk)]


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


# Positions


def test_a_fix_is_the_surveyed_point_and_what_was_solved_beside_it(contents: Contents) -> None:
    """By the other way: the fix back to ECEF, its offset from the surveyed point along the axes there, is what the report says."""
    reports = [e.message for e in contents.entries if isinstance(e.message, pb.EpochReport)]
    fixes = {(f.timestamp.ToNanoseconds(), f.frame_id): f for e in contents.entries if isinstance(f := e.message, LocationFix)}
    assert len(fixes) == 3 * SECONDS
    for report in reports:
        for r, vertex in enumerate(report.triangle):
            fix = fixes[utc_from_gps(report.gps_time_ns), f"kokubunji-1/{vertex.receiver}"]
            pos_ecef_m = ecef_from_geodetic(np.radians(fix.latitude), np.radians(fix.longitude), fix.altitude)
            e_enu_m = TRIANGLE.enu[r] @ (pos_ecef_m - TRIANGLE.pos_ecef_m[r])
            np.testing.assert_allclose(e_enu_m, (vertex.east_m, vertex.north_m, vertex.up_m), atol=1e-6)  # 1e-8 m: pymap3d and back


def test_a_receiver_without_a_position_has_no_fix(contents: Contents) -> None:
    report = pb.EpochReport()
    report.CopyFrom(next(e.message for e in contents.entries if isinstance(e.message, pb.EpochReport)))
    for name in ("east_m", "north_m", "up_m"):
        report.triangle[1].ClearField(name)
    (fixes,) = location_fixes([report], TRIANGLE, "x")
    assert [fix.frame_id for fix in fixes] == ["x/A", "x/C"]


def test_fixes_stand_in_the_channels_of_their_receivers(contents: Contents) -> None:
    ids = {(e.topic, e.message.frame_id) for e in contents.entries if isinstance(e.message, LocationFix)}
    assert ids == {(f"/receiver/{r}/fix", f"kokubunji-1/{r}") for r in "ABC"}


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


# Damage: every flipped bit is noticed, or changes nothing


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


def test_bytes_of_a_message_that_are_none_are_damage(tmp_path: Path) -> None:
    foreign(tmp_path / "x.mcap", message=b"\xff\xff\xff")
    with pytest.raises(RecordingError, match=r"x\.mcap: .*wayside\.v1\.Tick"):
        read_recording(tmp_path / "x.mcap")


# Files of others


OURS = {"profile": PROFILE, "topic": "/tick", "schema": "wayside.v1.Tick", "encoding": ENCODING}


def foreign(path: Path, otherwise: Mapping[str, str] | None = None, message: bytes = b"") -> None:
    """A file of the MCAP library that is ours but for what is said otherwise."""
    said = OURS | dict(otherwise or {})
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start(profile=said["profile"], library="another")
        schema = writer.register_schema(said["schema"], said["encoding"], schema_bytes(pb.Tick))
        channel = writer.register_channel(said["topic"], said["encoding"], schema)
        writer.add_message(channel, log_time=1, publish_time=1, data=message)
        writer.finish()


def test_a_file_that_is_ours_in_everything_is_read(tmp_path: Path) -> None:
    foreign(tmp_path / "x.mcap")
    assert [e.topic for e in read_recording(tmp_path / "x.mcap").entries] == ["/tick"]


FOREIGN = {
    "profile": {"profile": "wayside.v2"},
    "profile of ROS": {"profile": "ros2"},
    "no profile": {"profile": ""},
    "topic": {"topic": "/odometer"},
    "schema": {"schema": "wayside.v1.Epoch"},
    "schema of another": {"schema": "foxglove.LocationFix"},
    "encoding": {"encoding": "json"},
    "bytes of a receiver": {"topic": "/receiver/A/raw"},  # which have no schema
    "another topic of a receiver": {"topic": "/receiver/A/imu"},
}


@pytest.mark.parametrize("what", FOREIGN)
def test_an_unknown_schema_is_refused_not_guessed(tmp_path: Path, what: str) -> None:
    foreign(tmp_path / "x.mcap", FOREIGN[what])
    with pytest.raises(RecordingError):
        salvage(tmp_path / "x.mcap")


@pytest.mark.parametrize("what", FOREIGN)
def test_the_refusal_names_the_file_and_what_was_found(tmp_path: Path, what: str) -> None:
    foreign(tmp_path / "x.mcap", FOREIGN[what])
    with pytest.raises(RecordingError) as refused:
        salvage(tmp_path / "x.mcap")
    (found,) = FOREIGN[what].values()
    assert str(refused.value).startswith(f"{tmp_path / 'x.mcap'}: ")
    assert found in str(refused.value)


NO_RECORDINGS = {
    "empty": b"",
    "one byte": b"\x89",
    "text": b"site 1\nsite 2\n" * 100,
    "zeros": bytes(10_000),
    "magic alone": b"\x89MCAP0\r\n",
    "another version of MCAP": b"\x89MCAP1\r\n" + bytes(100),
}


@pytest.mark.parametrize("what", NO_RECORDINGS)
def test_what_is_no_recording_is_refused_by_name(tmp_path: Path, what: str) -> None:
    path = tmp_path / "x.mcap"
    path.write_bytes(NO_RECORDINGS[what])
    with pytest.raises(RecordingError, match=rf"^{path}: .*not an MCAP recording"):
        salvage(path)


REMEDIES = ("give ", "read it with", "open it with", "install", "recover", "expected")


@pytest.mark.parametrize("what", [*FOREIGN, *NO_RECORDINGS])
def test_the_refusal_says_what_to_do(tmp_path: Path, what: str) -> None:
    path = tmp_path / "x.mcap"
    if what in FOREIGN:
        foreign(path, FOREIGN[what])
    else:
        path.write_bytes(NO_RECORDINGS[what])
    with pytest.raises(RecordingError) as refused:
        salvage(path)
    assert any(word in str(refused.value) for word in REMEDIES), str(refused.value)


def test_a_recording_without_a_message_is_refused(tmp_path: Path) -> None:
    write(tmp_path / "x.mcap", [])
    with pytest.raises(RecordingError, match="nothing to decide"):
        salvage(tmp_path / "x.mcap")


def test_an_input_that_cannot_be_one_is_refused() -> None:
    good = next(m for m, _ in messages() if isinstance(m, pb.Observations))
    good.pseudorange_m.pop()
    with pytest.raises(DecodeError, match="pseudorange_m"):
        decode_event(good)


def test_a_snapshot_whose_parts_do_not_fit_is_refused() -> None:
    snapshot = encode_snapshot(replace(StationMonitor(SITE).snapshot(), sequence=3), SITE.receiver_names, START_NS)
    snapshot.state = pb.NORMAL  # with the cause of a start
    with pytest.raises(DecodeError, match="snapshot"):
        decode_snapshot(snapshot)


# Self-describing: another reader needs nothing of ours


def test_the_reader_of_the_mcap_library_finds_our_messages_sound(whole: Path, contents: Contents) -> None:
    with whole.open("rb") as file:
        found = [(channel.topic, message.log_time) for _, channel, message in make_reader(file, validate_crcs=True).iter_messages()]
    assert sorted(found) == sorted((e.topic, e.log_ns) for e in contents.entries)


def test_the_statistics_count_every_message(whole: Path, contents: Contents) -> None:
    with whole.open("rb") as file:
        summary = make_reader(file).get_summary()
    assert summary.statistics.message_count == len(contents.entries)


def decoded_by_their_own_schema(path: Path) -> list[Message]:
    """Messages by the file alone: the descriptor of each is built from the schema that it carries."""
    found: list[Message] = []
    classes: dict[int, type[Message]] = {}
    with path.open("rb") as file:
        for schema, _, message in make_reader(file, validate_crcs=True).iter_messages(log_time_order=False):
            if schema.id not in classes:
                pool = DescriptorPool()
                for description in FileDescriptorSet.FromString(schema.data).file:
                    pool.AddSerializedFile(description.SerializeToString())
                classes[schema.id] = GetMessageClass(pool.FindMessageTypeByName(schema.name))
            found.append(classes[schema.id].FromString(message.data))
    return found


def test_messages_are_decoded_from_the_embedded_schema_alone(whole: Path, contents: Contents) -> None:
    assert [data(m) for m in decoded_by_their_own_schema(whole)] == [e.data for e in contents.entries]


def test_no_field_is_unknown_to_the_embedded_schema(whole: Path, contents: Contents) -> None:
    named = [[field.name for field, _ in m.ListFields()] for m in decoded_by_their_own_schema(whole)]
    ours = [e.message for e in contents.entries if isinstance(e.message, Message)]
    assert named == [[field.name for field, _ in message.ListFields()] for message in ours]
