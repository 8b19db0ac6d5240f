"""Listeners on real links: bytes arrive whole, in order and stamped, lost links come back, and nothing runs idle or refuses to stop."""

import errno
import os
import re
import socket
import statistics
import time
import tty
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path

import pytest

from integrity.errors import ConfigError, LinkError
from recordings.sources.kinds import FileSource, SerialSource, TcpSource, UdpSource, parse_source
from recordings.sources.links import Wake
from recordings.sources.listener import Listener

PATIENCE_S = 5.0
STOP_S = 0.5
DATA = bytes(range(256)) * 4096  # 1 MiB: more than any buffer on the way


@dataclass
class Heard:
    """What a listener delivered and said."""

    pieces: list[tuple[str, int, bytes]] = field(default_factory=list)
    said: list[str] = field(default_factory=list)

    @property
    def data(self) -> bytes:
        return b"".join(data for _, _, data in self.pieces)

    def deliver(self, receiver: str, mono_ns: int, data: bytes) -> None:
        self.pieces.append((receiver, mono_ns, data))

    def say(self, receiver: str, line: str) -> None:
        self.said.append(f"{receiver}: {line}")

    def waits_s(self) -> list[float]:
        """The announced waits before the next try."""
        return [float(wait) for line in self.said for wait in re.findall(r"next try in (\S+) s", line)]


def _until(true: Callable[[], bool]) -> bool:
    """True as soon as the condition is, False after some seconds."""
    until_s = time.monotonic() + PATIENCE_S
    while not true():
        if time.monotonic() > until_s:
            return False
        time.sleep(0.002)
    return True


@contextmanager
def _listening(url: str, silent_after_s: float = 10.0, first_wait_s: float = 0.05, longest_wait_s: float = 0.2) -> Iterator[Heard]:
    heard = Heard()
    listener = Listener(
        "A",
        parse_source(url),
        heard.deliver,
        heard.say,
        first_wait_s=first_wait_s,
        longest_wait_s=longest_wait_s,
        silent_after_s=silent_after_s,
    )
    listener.start()
    try:
        yield heard
    finally:
        listener.stop()
        assert not listener.is_alive()


def _server(port: int = 0) -> socket.socket:
    server = socket.create_server(("127.0.0.1", port))
    server.settimeout(PATIENCE_S)
    return server


def _url(bound: socket.socket, scheme: str = "tcp") -> str:
    return f"{scheme}://127.0.0.1:{bound.getsockname()[1]}"


def _free_udp_port() -> int:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as bound:
        bound.bind(("127.0.0.1", 0))
        return int(bound.getsockname()[1])


def _pty() -> tuple[int, int]:
    try:
        ours, theirs = os.openpty()
    except OSError as error:
        pytest.skip(f"no pseudo-terminals here: {error}")
    tty.setraw(theirs)
    return ours, theirs


def test_tcp_bytes_arrive_whole_and_in_order() -> None:
    with _server() as server, _listening(_url(server)) as heard:
        with server.accept()[0] as connection:
            connection.sendall(DATA)
        assert _until(lambda: len(heard.data) == len(DATA))
        assert heard.data == DATA


def test_bytes_are_stamped_as_soon_as_they_are_there() -> None:
    """Loopback TCP, from before the send to the stamp: tens of microseconds; 5 ms is far from that, and nearer than any polling."""
    sent_ns: list[int] = []
    with _server() as server, _listening(_url(server)) as heard, server.accept()[0] as connection:
        connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        for _ in range(200):
            time.sleep(0.002)
            sent_ns.append(time.monotonic_ns())
            connection.send(b"x" * 1000)
            assert _until(lambda: len(heard.pieces) == len(sent_ns))
    latencies_us = sorted((mono_ns - sent) / 1000 for (_, mono_ns, _), sent in zip(heard.pieces, sent_ns, strict=True))
    print(f"p50 {statistics.median(latencies_us):.0f} us, p95 {latencies_us[190]:.0f} us")
    assert latencies_us[0] > 0
    assert statistics.median(latencies_us) < 5000


def test_a_tcp_server_that_comes_back_is_found_again() -> None:
    server = _server()
    port = server.getsockname()[1]
    with _listening(_url(server)) as heard:
        with server, server.accept()[0] as connection:
            connection.send(b"before")
            assert _until(lambda: heard.data == b"before")
        assert _until(lambda: any("Connection refused" in line for line in heard.said))
        with _server(port) as restarted, restarted.accept()[0] as connection:
            connection.send(b" after")
            assert _until(lambda: heard.data == b"before after")
    url = f"tcp://127.0.0.1:{port}"
    assert heard.said[:3] == [f"A: connected to {url}", "A: bytes come in", "A: link lost: closed by the other end; next try in 0.05 s"]


def test_waits_double_up_to_the_longest_and_are_said_once_each() -> None:
    with _server() as server:
        url = _url(server)
    with _listening(url, first_wait_s=0.02, longest_wait_s=0.1) as heard:
        time.sleep(0.8)
    assert heard.waits_s() == [0.02, 0.04, 0.08, 0.1]


def test_only_bytes_bring_the_wait_back_to_the_first() -> None:
    with _server() as server, _listening(_url(server), first_wait_s=0.02, longest_wait_s=10.0) as heard:
        for greeting in (b"", b"", b"$", b"", b""):
            with server.accept()[0] as connection:
                connection.send(greeting)
        assert _until(lambda: len(heard.waits_s()) == 5)
    assert heard.waits_s() == [0.02, 0.04, 0.02, 0.04, 0.08]


def test_a_server_that_hangs_up_at_once_is_not_hammered() -> None:
    """Waits of 0.05, 0.1, 0.2, 0.2 ... s: about 7 tries in 1.2 s."""
    accepted = 0
    with _server() as server, _listening(_url(server)):
        server.settimeout(0.05)
        until_s = time.monotonic() + 1.2
        while time.monotonic() < until_s:
            with suppress(TimeoutError):
                server.accept()[0].close()
                accepted += 1
    assert 3 <= accepted <= 8


def test_a_connection_that_falls_silent_is_opened_again() -> None:
    with _server() as server, _listening(_url(server), silent_after_s=0.3) as heard, server.accept()[0] as first:
        first.send(b"before")
        with server.accept()[0] as second:
            second.send(b" after")
            assert _until(lambda: heard.data == b"before after")
    assert "A: link lost: open, but silent for 0.3 s; next try in 0.05 s" in heard.said


def test_serial_bytes_arrive_whole_and_the_port_comes_back_under_its_name(tmp_path: Path) -> None:
    """As a USB receiver that is pulled out and plugged in: the name stays, the device behind it is another."""
    port = tmp_path / "receiver"
    ours, theirs = _pty()
    port.symlink_to(os.ttyname(theirs))
    with _listening(f"serial://{port}?baud=460800") as heard:
        assert _until(lambda: bool(heard.said))
        for at in range(0, 32768, 1024):
            os.write(ours, DATA[at : at + 1024])
        assert _until(lambda: len(heard.data) == 32768)
        os.close(ours)
        os.close(theirs)
        assert _until(lambda: len(heard.waits_s()) > 0)
        port.unlink()
        ours, theirs = _pty()
        port.symlink_to(os.ttyname(theirs))
        assert _until(lambda: heard.said.count(f"A: connected to serial://{port}?baud=460800") == 2)
        os.write(ours, DATA[32768:33000])
        assert _until(lambda: len(heard.data) == 33000)
        assert heard.data == DATA[:33000]
    os.close(ours)
    os.close(theirs)


def _problem(url: str) -> str:
    wake = Wake()
    try:
        with pytest.raises(LinkError) as raised:
            parse_source(url).open(wake, print)
    finally:
        wake.close()
    return str(raised.value)


def test_a_serial_port_is_for_one_program() -> None:
    ours, theirs = _pty()
    url = f"serial://{os.ttyname(theirs)}"
    with _listening(url) as heard:
        assert _until(lambda: bool(heard.said))
        assert "another program has the port: stop it first" in _problem(url)
    os.close(ours)
    os.close(theirs)


def test_a_serial_port_that_this_user_may_not_open_says_what_to_do() -> None:
    ours, theirs = _pty()
    path = os.ttyname(theirs)
    Path(path).chmod(0)
    root = os.geteuid() == 0
    if root:
        os.seteuid(65534)
    try:
        problem = _problem(f"serial://{path}")
    finally:
        if root:
            os.seteuid(0)
    assert "add the user to the group dialout" in problem
    os.close(ours)
    os.close(theirs)


def test_a_file_is_read_whole_and_ends_once(tmp_path: Path) -> None:
    path = tmp_path / "day 1 #50%?.ubx"
    path.write_bytes(DATA)
    heard = Heard()
    listener = Listener("A", parse_source(f"file:{path}"), heard.deliver, heard.say)
    listener.start()
    listener.join(PATIENCE_S)
    listener.stop()
    assert heard.data == DATA
    assert heard.said == [f"A: reading file:{path}", "A: bytes come in", f"A: end of file:{path}"]


def test_a_named_pipe_is_read_as_it_is_written(tmp_path: Path) -> None:
    path = tmp_path / "pipe"
    os.mkfifo(path)
    with _listening(f"file:{path}") as heard:
        assert _until(lambda: bool(heard.said))
        with path.open("wb", buffering=0) as pipe:
            pipe.write(b"one")
            assert _until(lambda: heard.data == b"one")
            pipe.write(b"two")
            assert _until(lambda: heard.data == b"onetwo")
        assert _until(lambda: heard.said[-1] == f"A: end of file:{path}")


def test_a_udp_port_takes_one_sender_until_that_falls_silent() -> None:
    url = f"udp://127.0.0.1:{_free_udp_port()}"
    here = ("127.0.0.1", int(url.rpartition(":")[2]))
    with socket.socket(type=socket.SOCK_DGRAM) as first, socket.socket(type=socket.SOCK_DGRAM) as second:
        with _listening(url, silent_after_s=0.4) as heard:
            assert _until(lambda: bool(heard.said))
            second.sendto(b"", here)  # an empty datagram takes no port
            for piece in (b"1", b"2"):
                first.sendto(piece, here)
                second.sendto(b"x", here)
            first.sendto(b"3", here)
            assert _until(lambda: heard.data == b"123")
            time.sleep(0.5)
            second.sendto(b"4", here)
            assert _until(lambda: heard.data == b"1234")
        a, b = (f"127.0.0.1:{sender.getsockname()[1]}" for sender in (first, second))
    assert heard.said == [
        f"A: listening on {url}",
        f"A: takes the datagrams of {a}",
        "A: bytes come in",
        f"A: refuses datagrams of {b}, this port takes those of {a}: two receivers on one port?",
        f"A: refused 2 datagrams that were not of {a}",
        f"A: takes the datagrams of {b}",
    ]


def test_a_udp_port_that_is_taken_is_said_and_tried_again() -> None:
    with socket.socket(type=socket.SOCK_DGRAM) as taken:
        taken.bind(("127.0.0.1", 0))
        url = _url(taken, "udp")
        with _listening(url) as heard:
            assert _until(lambda: len(heard.said) == 2)
            taken.close()
            assert _until(lambda: heard.said[-1] == f"A: listening on {url}")
    assert "another program has this port" in heard.said[0]


def test_an_error_in_whoever_takes_the_bytes_costs_the_link_not_the_thread() -> None:
    data: list[bytes] = []

    def deliver(receiver: str, mono_ns: int, piece: bytes) -> None:
        data.append(piece)
        if len(data) == 1:
            raise KeyError("a bug")

    heard = Heard()
    with _server() as server:
        listener = Listener("A", parse_source(_url(server)), deliver, heard.say, first_wait_s=0.02)
        listener.start()
        for _ in range(2):
            with server.accept()[0] as connection:
                connection.send(b"x")
        assert _until(lambda: len(data) == 2)
        listener.stop()
    assert "A: link lost: unexpected KeyError: 'a bug'; next try in 0.02 s" in heard.said


def _backing_off(tmp_path: Path) -> str:
    return f"file:{tmp_path}/nothing"


def _pipe_without_a_writer(tmp_path: Path) -> str:
    os.mkfifo(tmp_path / "pipe")
    return f"file:{tmp_path}/pipe"


def _quiet_udp(tmp_path: Path) -> str:
    return f"udp://127.0.0.1:{_free_udp_port()}"


@pytest.mark.parametrize("state", [_backing_off, _pipe_without_a_writer, _quiet_udp])
def test_a_listener_stops_within_half_a_second(state: Callable[[Path], str], tmp_path: Path) -> None:
    listener = Listener("A", parse_source(state(tmp_path)), Heard().deliver, Heard().say, first_wait_s=60.0)
    _stops(listener)


def test_a_listener_stops_within_half_a_second_while_it_connects() -> None:
    """The queue of a server that accepts nobody is full: the system leaves the next connection unanswered."""
    with socket.socket() as server:
        server.bind(("127.0.0.1", 0))
        server.listen(0)
        waiting = [socket.socket() for _ in range(4)]
        for other in waiting:
            other.setblocking(False)
            assert other.connect_ex(server.getsockname()) == errno.EINPROGRESS
        heard = Heard()
        _stops(Listener("A", parse_source(_url(server)), heard.deliver, heard.say))
        for other in waiting:
            other.close()
    assert heard.said == []


def _stops(listener: Listener) -> None:
    listener.start()
    time.sleep(0.2)
    assert listener.is_alive()
    began_s = time.monotonic()
    listener.stop()
    assert time.monotonic() - began_s < STOP_S
    assert not listener.is_alive()


def test_a_listener_that_ends_gives_every_descriptor_back() -> None:
    descriptors = Path("/proc/self/fd")
    if not descriptors.is_dir():
        pytest.skip("the system does not show open descriptors")
    before = set(descriptors.iterdir())
    with _server() as server:
        url = _url(server)
        with _listening(url) as heard, server.accept()[0] as connection:
            connection.send(b"x")
            assert _until(lambda: heard.data == b"x")
        Listener("A", parse_source(url), heard.deliver, heard.say).stop()
    assert set(descriptors.iterdir()) <= before


@pytest.mark.parametrize(
    ("url", "source"),
    [
        ("serial:///dev/ttyACM0?baud=460800", SerialSource("serial:///dev/ttyACM0?baud=460800", "/dev/ttyACM0", 460800)),
        ("serial:///dev/ttyACM0", SerialSource("serial:///dev/ttyACM0", "/dev/ttyACM0", 38400)),
        ("tcp://[fe80::1]:2000", TcpSource("tcp://[fe80::1]:2000", "fe80::1", 2000)),
        ("udp://:5000", UdpSource("udp://:5000", "", 5000)),
        ("udp://10.0.0.1:5000", UdpSource("udp://10.0.0.1:5000", "10.0.0.1", 5000)),
        ("file:a/b.ubx", FileSource("file:a/b.ubx", "a/b.ubx")),
        ("file:///a/b.ubx", FileSource("file:///a/b.ubx", "/a/b.ubx")),
    ],
    ids=lambda value: value if isinstance(value, str) else "",
)
def test_addresses(url: str, source: object) -> None:
    assert parse_source(url) == source


@pytest.mark.parametrize("url", ["ntrip://user:secret@caster.example:2101/MOUNT", "tcp://10.0.0.1"])
def test_an_address_that_cannot_be_opened_is_refused(url: str) -> None:
    with pytest.raises(ConfigError) as raised:
        parse_source(url)
    assert "secret" not in str(raised.value)
