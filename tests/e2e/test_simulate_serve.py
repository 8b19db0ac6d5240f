"""Simulated receivers over TCP: real processes, real sockets, the same bytes as the recording's, on time."""

import os
import signal
import socket
import statistics
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path

import pytest

from integrity.errors import LinkError
from integrity.events import RawBytes
from integrity.gnss.gps_time import NS_PER_S
from integrity.gnss.ubx.framing import Framer, frame_bytes
from integrity.gnss.ubx.sfrbx import RXM_SFRBX
from recordings.reader import read_recording
from recordings.replay import replayable
from recordings.simulate.observations import antennas_of, simulate
from recordings.simulate.receiver import as_bytes
from recordings.simulate.server import ReceiverServer
from tests.unit.sites import UBX_SITE as SITE_TEXT
from tests.unit.streams import SITE, START_NS, a_site

ROOT = Path(__file__).parents[2]
SECONDS, SPEED = 60, 20.0
SCENARIO = f"""\
[scenario]
start = "2026-03-02T03:00:00Z"
duration_s = {SECONDS}
seed = 1
{SITE_TEXT.replace("tolerance_m = 20.0", "")}"""
TIMEOUT_S = 60.0


@dataclass
class Client:
    """Everything that a port sends, until it closes the connection, and when how many bytes had come."""

    port: int
    data: bytearray = field(default_factory=bytearray)
    arrived: list[tuple[int, int]] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.connection = socket.create_connection(("127.0.0.1", self.port), TIMEOUT_S)
        self._thread = threading.Thread(target=self._read)
        self._thread.start()

    def _read(self) -> None:
        with self.connection:
            while piece := self.connection.recv(1 << 16):
                self.data += piece
                self.arrived.append((len(self.data), time.monotonic_ns()))

    def everything(self) -> bytes:
        self._thread.join(TIMEOUT_S)
        return bytes(self.data)

    def wait_for(self, size: int) -> None:
        deadline = time.monotonic() + TIMEOUT_S
        while len(self.data) < size and time.monotonic() < deadline:
            time.sleep(0.005)


def command(*arguments: object) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, "-m", "wayside", "simulate", *map(str, arguments)],
        cwd=ROOT,
        env=os.environ | {"PYTHONPATH": str(ROOT)},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


def ended(process: subprocess.Popen[str]) -> tuple[int, str]:
    """Exit code, and what was said on stderr."""
    _, said = process.communicate(timeout=TIMEOUT_S)
    return process.returncode, said


def ports_of(process: subprocess.Popen[str]) -> dict[str, int]:
    """Free ports are data: on stdout."""
    assert process.stdout is not None
    lines = [process.stdout.readline().split(" at tcp://127.0.0.1:") for _ in "ABC"]
    return {receiver: int(port) for receiver, port in lines}


def words_of(data: bytes) -> list[bytes]:
    return [frame_bytes(*frame) for frame in Framer().feed(data) if frame[:2] == RXM_SFRBX]


@pytest.fixture
def scenario(tmp_path: Path) -> Path:
    path = tmp_path / "scenario.toml"
    path.write_text(SCENARIO, "utf-8")
    return path


@dataclass(frozen=True)
class Story:
    """A scenario recorded and served, with a client at each receiver, a second one at A, and a third that comes late and one that goes."""

    sent: dict[str, list[RawBytes]]
    got: dict[str, bytes]
    second: bytes
    late: bytes
    code: int
    said: str


@pytest.fixture(scope="module")
def story(tmp_path_factory: pytest.TempPathFactory) -> Story:
    folder = tmp_path_factory.mktemp("served")
    path, recording = folder / "scenario.toml", folder / "out.mcap"
    path.write_text(SCENARIO, "utf-8")
    process = command(path, "-o", recording, "--serve", "127.0.0.1:0", "--speed", SPEED)
    ports = ports_of(process)
    second = Client(ports["A"])
    clients = {receiver: Client(port) for receiver, port in ports.items()}
    with socket.create_connection(("127.0.0.1", ports["B"])) as hasty:
        hasty.recv(100)
    events = replayable(read_recording(recording)).events
    sent = {r: [e for e in events if isinstance(e, RawBytes) and e.receiver == r] for r in ports}
    clients["A"].wait_for(sum(len(burst.data) for burst in sent["A"][:40]))
    late = Client(ports["A"])
    code, said = ended(process)
    return Story(sent, {r: c.everything() for r, c in clients.items()}, second.everything(), late.everything(), code, said)


def test_clients_get_the_bytes_of_the_recording(story: Story) -> None:
    assert story.got == {receiver: b"".join(burst.data for burst in bursts) for receiver, bursts in story.sent.items()}


def test_a_receiver_serves_several_clients(story: Story) -> None:
    assert story.second == story.got["A"]


def test_a_client_that_goes_away_is_no_error(story: Story) -> None:
    assert story.code == 0


def test_people_are_told_what_happens(story: Story) -> None:
    assert story.said.splitlines()[1:] == ["waiting for a client of every receiver", "started", "ended"]


def test_a_late_client_first_gets_the_words_of_the_last_half_minute(story: Story) -> None:
    """And then the running stream, from the next burst on."""
    bursts = story.sent["A"]
    (joined,) = [
        k for k in range(len(bursts)) if story.late.endswith(b"".join(b.data for b in bursts[k:])) and burst_begins(story.late, bursts, k)
    ]
    assert 40 <= joined < len(bursts)
    before = story.late[: len(story.late) - sum(len(b.data) for b in bursts[joined:])]
    assert before == b"".join(word for burst in bursts[joined - 30 : joined] for word in words_of(burst.data))


def burst_begins(late: bytes, bursts: list[RawBytes], k: int) -> bool:
    """Whether what stands before the bursts from k on is words alone."""
    before = late[: len(late) - sum(len(b.data) for b in bursts[k:])]
    return b"".join(words_of(before)) == before


def test_a_port_in_use_is_refused_with_what_to_do(scenario: Path) -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        code, said = ended(command(scenario, "--serve", f"127.0.0.1:{port}"))
    assert code == 5
    assert said.startswith(f"wayside: cannot serve receiver A at 127.0.0.1:{port}: Address already in use; end what listens there, or ")


@pytest.mark.parametrize(
    ("arguments", "word"),
    [
        ([], "nothing to do: give -o OUT.mcap"),
        (["--serve", "20001"], "--serve 20001: expected HOST:PORT"),
        (["--serve", "127.0.0.1:65534"], "--serve 127.0.0.1:65534: expected HOST:PORT with 3 ports"),
        (["--serve", "127.0.0.1:0", "--speed", "0"], "--speed 0: expected a number above 0"),
    ],
)
def test_what_cannot_be_served_is_refused(scenario: Path, arguments: list[str], word: str) -> None:
    code, said = ended(command(scenario, *arguments))
    assert (code, said.startswith(f"wayside: {word}")) == (2, True)


def test_an_interrupted_server_leaves_its_ports(scenario: Path) -> None:
    process = command(scenario, "--serve", "127.0.0.1:0")
    port = ports_of(process)["A"]
    process.send_signal(signal.SIGINT)
    assert ended(process)[0] == 130
    with pytest.raises(ConnectionRefusedError):
        socket.create_connection(("127.0.0.1", port))


# The server itself


@pytest.fixture
def server() -> Iterator[ReceiverServer]:
    with ReceiverServer(SITE.receiver_names, "127.0.0.1", 0) as one:
        yield one


def test_bursts_are_sent_at_their_times(server: ReceiverServer) -> None:
    """Ten a second, and lateness does not add up. On a quiet machine 99 of 100 are less than 1 ms late; here it is busy."""
    events = as_bytes(simulate(a_site(0.1), START_NS, 3.0, 10.0, 1), antennas_of(SITE))
    clients = {receiver: Client(port) for receiver, (_, port) in server.addresses.items()}
    handed: list[tuple[str, int, int]] = []
    server.wait_for_clients()
    server.play(events, sent=lambda receiver, epoch_ns, mono_ns: handed.append((receiver, epoch_ns, mono_ns)))
    server.close()
    got = {receiver: client.everything() for receiver, client in clients.items()}
    assert got == {r: b"".join(e.data for e in events if isinstance(e, RawBytes) and e.receiver == r) for r in "ABC"}
    assert [receiver for receiver, _, _ in handed] == ["A", "B", "C"] * 30
    late_ms = [(mono_ns - handed[0][2] - (epoch_ns - START_NS)) / 1e6 for _, epoch_ns, mono_ns in handed]
    assert statistics.median(late_ms) < 5.0
    assert min(late_ms) > -20.0  # as early as the first one was late
    assert min(late_ms[-30:]) < 5.0
    spread_ms = [(c[2] - a[2]) / 1e6 for a, c in zip(handed[0::3], handed[2::3], strict=True)]
    assert statistics.median(spread_ms) < 1.0


def test_the_clock_starts_when_every_receiver_has_had_a_client(server: ReceiverServer) -> None:
    clients = [Client(server.addresses[receiver][1]) for receiver in "AB"]
    waiting = threading.Thread(target=server.wait_for_clients)
    waiting.start()
    waiting.join(0.3)
    assert waiting.is_alive()
    clients.append(Client(server.addresses["C"][1]))
    waiting.join(TIMEOUT_S)
    assert not waiting.is_alive()
    server.close()
    assert [client.everything() for client in clients] == [b"", b"", b""]


def test_a_client_that_does_not_read_is_dropped_and_holds_nobody_up(server: ReceiverServer) -> None:
    """20 MB in 2 s; who reads gets all of it, who does not gets what the system and the server hold for it: 8 MB and some."""
    stalled = socket.create_connection(("127.0.0.1", server.addresses["A"][1]))
    clients = {receiver: Client(port) for receiver, (_, port) in server.addresses.items()}
    events = [RawBytes(START_NS + k * NS_PER_S // 10, r, bytes(size)) for k in range(20) for r, size in (("A", 1 << 20), ("B", 1000))]
    server.wait_for_clients()
    server.play(events)
    with stalled:
        stalled.settimeout(TIMEOUT_S)
        assert sum(map(len, iter(lambda: received(stalled), b""))) < 20 << 20  # to its end, though the server is still there
    server.close()
    assert [len(clients[receiver].everything()) for receiver in "ABC"] == [20 << 20, 20_000, 0]


def received(connection: socket.socket) -> bytes:
    try:
        return connection.recv(1 << 20)
    except ConnectionResetError:
        return b""


def test_ports_follow_each_other_and_are_free_again() -> None:
    with ReceiverServer(["A", "B", "C"], "127.0.0.1", 0) as first:
        free = max(port for _, port in first.addresses.values()) + 1
    for _ in range(2):
        with ReceiverServer(["A", "B", "C"], "127.0.0.1", free) as again:
            ports = [port for _, port in again.addresses.values()]
    assert [b - a for a, b in pairwise(ports)] == [1, 1]


def test_a_host_that_is_not_ours_is_refused() -> None:
    with pytest.raises(LinkError, match=r"cannot serve receiver A at 192\.0\.2\.1:20001: .*serve at another address or port"):
        ReceiverServer(["A"], "192.0.2.1", 20001)
