"""What is not ours is refused by name, with what was found and what to do; it is never guessed."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import pytest
from mcap.writer import Writer

from integrity.errors import DecodeError, RecordingError
from integrity.messages import wayside_pb2 as pb
from integrity.messages.inputs import decode_event
from integrity.messages.snapshots import decode_snapshot, encode_snapshot
from integrity.station_monitor import StationMonitor
from recordings.channels import ENCODING, PROFILE, schema_bytes
from recordings.reader import read_recording, salvage
from tests.unit.recording.written import messages, write
from tests.unit.streams import SITE, START_NS


def test_bytes_of_a_message_that_are_none_are_damage(tmp_path: Path) -> None:
    foreign(tmp_path / "x.mcap", message=b"\xff\xff\xff")
    with pytest.raises(RecordingError, match=r"x\.mcap: .*wayside\.v1\.Tick"):
        read_recording(tmp_path / "x.mcap")


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
