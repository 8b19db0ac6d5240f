"""A station whose receivers are the mount points of a caster: it gets to NORMAL on RTCM, and its recording is decided again as it was."""

import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from integrity.events import RawBytes
from integrity.messages import wayside_pb2 as pb
from recordings.channels import raw_topic
from recordings.reader import Contents, read_recording
from recordings.replay import complaints, decide, recover, replayable
from recordings.simulate.server import ReceiverServer
from recordings.summary import decisions_sha256
from tests.e2e.caster import Caster, certificate
from tests.e2e.field import REPOSITORY, Field, make_field, measured, playing, running_station, until
from tests.unit.streams import reports

SECONDS, INTERVAL_S = 8.0, 0.2
SECRET = "hunter2"


def play(caster: Caster, field: Field, seconds: float) -> None:
    """Each burst to the listeners of its mount point, when its epoch is due."""
    bursts = [event for event in measured(field.site, seconds) if isinstance(event, RawBytes)]
    began_s = time.monotonic()
    for burst in bursts:
        time.sleep(max(0.0, began_s + (burst.mono_ns - bursts[0].mono_ns) / 1e9 - time.monotonic()))
        caster.mounts[burst.receiver].send(burst.data)


@contextmanager
def fed(folder: Path) -> Iterator[tuple[Field, Caster]]:
    tls, ca = certificate(folder / "tls")
    with Caster("ABC", user=f"station:{SECRET}", tls=tls) as caster:
        sources = {name: caster.url(name, f"station:{SECRET}", f"?ca={ca}") for name in "ABC"}
        yield make_field(folder, sources, INTERVAL_S), caster


@pytest.fixture(scope="module")
def ran(tmp_path_factory: pytest.TempPathFactory) -> tuple[Field, int]:
    """A station that heard a caster over TLS for some seconds, and its exit code."""
    with fed(tmp_path_factory.mktemp("ntrip")) as (field, caster), running_station(field) as station:
        assert until(lambda: all(mount.listeners for mount in caster.mounts.values()), 10.0), (field.folder / "station.log").read_text()
        play(caster, field, SECONDS)
        time.sleep(0.5)
        station.send_signal(signal.SIGTERM)
        return field, station.wait(10.0)


@pytest.fixture(scope="module")
def recorded(ran: tuple[Field, int]) -> Contents:
    (path,) = ran[0].recordings()
    return read_recording(path)


def test_it_stops_cleanly_when_told_to(ran: tuple[Field, int]) -> None:
    assert ran[1] == 0


def test_every_epoch_is_decided_and_it_gets_to_normal(recorded: Contents) -> None:
    health = [entry.message for entry in recorded.entries if isinstance(entry.message, pb.Health)]
    epochs_ns = {h.gps_time_ns for h in health if h.HasField("gps_time_ns")}
    assert (len(epochs_ns), health[-1].state) == (round(SECONDS / INTERVAL_S), pb.NORMAL)


def test_its_recording_is_whole(recorded: Contents) -> None:
    assert complaints(recorded) == []


def test_its_channels_say_that_they_hold_rtcm(recorded: Contents) -> None:
    assert recorded.protocols == dict.fromkeys("ABC", "rtcm3")


def test_what_the_caster_sent_is_recorded_to_the_byte(ran: tuple[Field, int], recorded: Contents) -> None:
    sent = b"".join(e.data for e in measured(ran[0].site, SECONDS) if isinstance(e, RawBytes) and e.receiver == "B")
    assert b"".join(entry.data for entry in recorded.entries if entry.topic == raw_topic("B")) == sent


def test_replay_decides_as_the_running_station_did(ran: tuple[Field, int]) -> None:
    (path,) = ran[0].recordings()
    again = subprocess.run(
        [sys.executable, "-m", "wayside", "replay", str(path), "--diff"], cwd=REPOSITORY, capture_output=True, text=True, check=False
    )
    assert again.returncode == 0, again.stderr


def test_the_same_bytes_are_decided_alike_live_and_from_a_file(ran: tuple[Field, int], recorded: Contents) -> None:
    live = replayable(recorded)
    outputs, _ = decide(live.site, live.events, live.snapshot)
    from_file, _ = decide(ran[0].site, measured(ran[0].site, SECONDS))
    assert decisions_sha256(reports(outputs)) == decisions_sha256(reports(from_file))


def test_a_recording_that_is_recovered_is_the_same(ran: tuple[Field, int], recorded: Contents, tmp_path: Path) -> None:
    (path,) = ran[0].recordings()
    recover(path, tmp_path / "again.mcap")
    again = read_recording(tmp_path / "again.mcap")
    assert (again.protocols, again.entries) == (recorded.protocols, recorded.entries)


def test_the_password_is_nowhere(ran: tuple[Field, int], recorded: Contents) -> None:
    log = (ran[0].folder / "station.log").read_bytes()
    assert SECRET.encode() not in log + b"".join(entry.data for entry in recorded.entries)


def test_rtcm_over_tcp_gets_to_normal(tmp_path: Path) -> None:
    with ReceiverServer("ABC", "127.0.0.1", 0) as server:
        sources = {receiver: f"tcp://{host}:{port}" for receiver, (host, port) in server.addresses.items()}
        field = make_field(tmp_path, sources, INTERVAL_S, of_receivers='protocol = "rtcm3"')
        with running_station(field):
            server.wait_for_clients()
            with playing(server, measured(field.site, 30.0)):
                assert until(lambda: " NORMAL" in (tmp_path / "station.log").read_text(), 15.0)
