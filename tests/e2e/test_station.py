"""The station as it runs: processes, sockets, signals, disks."""

import shutil
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from integrity.messages import wayside_pb2 as pb
from integrity.messages.key_expressions import HEALTH, site_key
from integrity.messages.verification import HealthVerifier
from recordings.keys import keys_of, read_trusted
from recordings.link import Arrival, dial_link
from recordings.reader import read_recording
from recordings.replay import complaints, decide, replayable
from recordings.simulate.server import ReceiverServer
from recordings.summary import decisions_sha256
from tests.benchmarks.kill import kill_some
from tests.e2e.field import REPOSITORY, SITE_ID, Field, Plug, make_field, measured, playing, running_station, until
from tests.unit.streams import reports

SECONDS = 8.0


class Heard:
    """Health of a station as another process's listener gets it."""

    def __init__(self, field: Field) -> None:
        self._verifier = HealthVerifier(SITE_ID, keys_of(read_trusted(field.trusted), SITE_ID, field.trusted), 3000)
        self.refused: list[str] = []
        self.health: list[pb.Health] = []

    def take(self, arrival: Arrival) -> None:
        received = self._verifier.health(arrival.key_expr, arrival.data, arrival.mono_ns)
        if received.health is None:
            self.refused.append(received.refusal)
        else:
            self.health.append(received.health)

    @property
    def states(self) -> list[int]:
        return [h.state for h in self.health]


@contextmanager
def listening(field: Field) -> Iterator[Heard]:
    heard = Heard(field)
    with dial_link([field.endpoint], lambda: None) as link:
        link.subscribe(site_key(SITE_ID, HEALTH), heard.take)
        yield heard


@contextmanager
def served(folder: Path, interval_s: float = 0.2, more: str = "") -> Iterator[tuple[Field, ReceiverServer]]:
    """A site whose receivers are simulated."""
    with ReceiverServer("ABC", "127.0.0.1", 0) as server:
        sources = {r: f"tcp://{host}:{port}" for r, (host, port) in server.addresses.items()}
        yield make_field(folder, sources, interval_s, more=more), server


def talk(field: Field) -> str:
    return (field.folder / "station.log").read_text()


def stopped(station: subprocess.Popen[str]) -> int:
    station.send_signal(signal.SIGTERM)
    return station.wait(10.0)


@pytest.fixture(scope="module")
def ran(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[Field, Heard, int]]:
    """A station that ran through a simulated scenario and was told to stop."""
    with served(tmp_path_factory.mktemp("ran")) as (field, server), running_station(field) as station, listening(field) as heard:
        server.wait_for_clients()
        server.play(measured(field.site, SECONDS))
        until(lambda: len(heard.health) >= SECONDS / 0.2, 5.0)
        yield field, heard, stopped(station)


def test_it_stops_cleanly_when_told_to(ran: tuple[Field, Heard, int]) -> None:
    assert ran[2] == 0


def test_every_epoch_has_its_verified_health(ran: tuple[Field, Heard, int]) -> None:
    epochs = [h.gps_time_ns for h in ran[1].health if h.HasField("gps_time_ns")]
    assert (len(set(epochs)), ran[1].refused) == (round(SECONDS / 0.2), [])


def test_it_gets_to_normal(ran: tuple[Field, Heard, int]) -> None:
    assert ran[1].states[-1] == pb.NORMAL


def test_its_recording_is_whole(ran: tuple[Field, Heard, int]) -> None:
    (path,) = ran[0].recordings()
    assert (path.suffix, complaints(read_recording(path))) == (".mcap", [])


def test_its_recording_is_named_by_the_time_of_the_receivers(ran: tuple[Field, Heard, int]) -> None:
    (path,) = ran[0].recordings()
    assert path.name.startswith(f"{SITE_ID}-20260302T03")


def test_replay_decides_as_the_running_station_did(ran: tuple[Field, Heard, int]) -> None:
    (path,) = ran[0].recordings()
    again = subprocess.run(
        [sys.executable, "-m", "wayside", "replay", str(path), "--diff"], cwd=REPOSITORY, capture_output=True, text=True, check=False
    )
    assert again.returncode == 0, again.stderr


def test_the_same_bytes_are_decided_alike_live_and_from_a_file(ran: tuple[Field, Heard, int]) -> None:
    field = ran[0]
    (path,) = field.recordings()
    live = replayable(read_recording(path))
    outputs, _ = decide(live.site, live.events, live.snapshot)
    from_file, _ = decide(field.site, measured(field.site, SECONDS))
    assert decisions_sha256(reports(outputs)) == decisions_sha256(reports(from_file))


def test_it_says_a_line_per_change_and_no_more(ran: tuple[Field, Heard, int]) -> None:
    lines = talk(ran[0]).splitlines()
    assert (any("NORMAL" in line for line in lines), len(lines) <= 12) == (True, True)


def test_an_unplugged_receiver_stops_trust_at_once_and_comes_back(tmp_path: Path) -> None:
    with ReceiverServer("ABC", "127.0.0.1", 0) as server, Plug(server.addresses["B"]) as plug:
        addresses = server.addresses | {"B": plug.address}
        field = make_field(tmp_path, {r: f"tcp://{host}:{port}" for r, (host, port) in addresses.items()}, 0.2)
        with running_station(field), listening(field) as heard:
            server.wait_for_clients()
            with playing(server, measured(field.site, 60.0)):
                assert until(lambda: heard.states[-1:] == [pb.NORMAL], 15.0)
                plug.pull()
                assert until(lambda: heard.states[-1:] == [pb.NOT_CONFIRMABLE], 4.0)
                assert (heard.health[-1].cause, list(heard.health[-1].subjects)) == (pb.DATA, ["B"])
                count = len(heard.health)
                assert until(lambda: len(heard.health) >= count + 2, 3.0)  # a heartbeat each second
                plug.push()
                assert until(lambda: heard.states[-1:] == [pb.NORMAL], 15.0)


def test_a_station_that_hears_nothing_says_so_each_second(tmp_path: Path) -> None:
    with served(tmp_path) as (field, _), running_station(field), listening(field) as heard:
        assert until(lambda: len(heard.health) >= 3, 15.0)
        assert {h.state for h in heard.health} == {pb.NOT_CONFIRMABLE}
        apart_s = (heard.health[2].issued_mono_ns - heard.health[0].issued_mono_ns) / 1e9
        assert apart_s == pytest.approx(2.0, abs=0.3)


def test_a_frozen_station_publishes_nothing_and_comes_back(tmp_path: Path) -> None:
    with served(tmp_path) as (field, server), running_station(field) as station, listening(field) as heard:
        server.wait_for_clients()
        with playing(server, measured(field.site, 60.0)):
            assert until(lambda: heard.states[-1:] == [pb.NORMAL], 15.0)
            station.send_signal(signal.SIGSTOP)
            time.sleep(0.3)  # what was on its way
            count, said = len(heard.health), len(talk(field))
            time.sleep(3.0)
            assert len(heard.health) == count
            station.send_signal(signal.SIGCONT)
            assert until(lambda: "NOT_CONFIRMABLE" in talk(field)[said:], 3.0)  # on the air it may come before the link is up again
            assert until(lambda: len(heard.health) > count and heard.states[-1] == pb.NORMAL, 15.0)


def test_what_a_station_says_after_a_standstill_is_as_old_as_its_epochs(tmp_path: Path) -> None:
    with served(tmp_path) as (field, server), running_station(field) as station, listening(field) as heard:
        server.wait_for_clients()
        with playing(server, measured(field.site, 30.0)):
            assert until(lambda: heard.states[-1:] == [pb.NORMAL], 15.0)
            station.send_signal(signal.SIGSTOP)
            time.sleep(1.2)
            station.send_signal(signal.SIGCONT)
            count = len(heard.health)
            assert until(lambda: len(heard.health) >= count + 10, 5.0)
        assert stopped(station) == 0
    (path,) = field.recordings()
    health = [entry.message for entry in read_recording(path).entries if isinstance(entry.message, pb.Health)]
    offsets_ns: dict[int, int] = {}  # by epoch; a heartbeat names the one before it again
    for message in health:
        offsets_ns.setdefault(message.gps_time_ns, message.issued_mono_ns - message.gps_time_ns)
    settled_ns = list(offsets_ns.values())[5:]
    assert max(settled_ns) - min(settled_ns) < 250_000_000
    assert any("later than others" in reason for message in health for reason in message.reasons)


def test_a_full_disk_stops_the_recording_and_nothing_else(tmp_path: Path) -> None:
    with served(tmp_path) as (field, server):
        limited = (
            "import resource, signal, sys, wayside\n"
            "signal.signal(signal.SIGXFSZ, signal.SIG_IGN)\n"
            "resource.setrlimit(resource.RLIMIT_FSIZE, (60_000, 60_000))\n"
            f"sys.exit(wayside.run(['station', 'run', {str(field.site_file)!r}]))"
        )
        with (field.folder / "station.log").open("w") as log:
            station = subprocess.Popen([sys.executable, "-c", limited], stdout=log, stderr=log, cwd=REPOSITORY, text=True)
        try:
            with listening(field) as heard:
                server.wait_for_clients()
                server.play(measured(field.site, 12.0))
                assert until(lambda: len(heard.health) >= 60, 5.0)
                assert heard.states[-1] == pb.NORMAL
                assert "recording" in talk(field)
                assert stopped(station) == 0
        finally:
            station.kill()
            station.wait()


def test_it_tells_systemd_that_it_is_ready_and_alive(tmp_path: Path) -> None:
    with served(tmp_path) as (field, _), socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as systemd:
        address = tmp_path / "notify"
        systemd.bind(str(address))
        systemd.settimeout(15.0)
        with running_station(field, environment={"NOTIFY_SOCKET": str(address)}) as station:
            said = [systemd.recv(1000).decode() for _ in range(3)]
            stopped(station)
            while said[-1] != "STOPPING=1":
                said.append(systemd.recv(1000).decode())
    assert (said[0], "WATCHDOG=1" in said) == ("READY=1", True)


def test_stations_that_are_killed_lose_at_most_a_second_and_a_half() -> None:
    losses = kill_some(seed=7, n=3)
    assert all(loss.lost_s <= 1.5 and loss.whole for loss in losses), losses


def test_the_unit_file_is_accepted_by_systemd(tmp_path: Path) -> None:
    if shutil.which("systemd-analyze") is None:
        pytest.skip("systemd-analyze is not installed")
    unit = tmp_path / "wayside@.service"
    unit.write_text((REPOSITORY / "station" / "wayside@.service").read_text().replace("/opt/wayside/bin/wayside", sys.executable))
    verified = subprocess.run(["systemd-analyze", "verify", str(unit)], capture_output=True, text=True, check=False)
    assert (verified.returncode, verified.stderr) == (0, "")


def test_the_unit_file_exposes_little() -> None:
    if shutil.which("systemd-analyze") is None:
        pytest.skip("systemd-analyze is not installed")
    unit = REPOSITORY / "station" / "wayside@.service"
    scored = subprocess.run(
        ["systemd-analyze", "security", "--offline=true", "--threshold=30", str(unit)], capture_output=True, text=True, check=False
    )
    assert scored.returncode == 0, scored.stdout[-500:]
