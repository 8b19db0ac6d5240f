"""A listener stops at once wherever it waits, gives everything back, and opens only addresses that can be opened."""

import errno
import os
import socket
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from integrity.errors import ConfigError
from recordings.sources.kinds import FileSource, SerialSource, TcpSource, UdpSource, parse_source
from recordings.sources.listener import Listener
from tests.e2e.links import Heard, free_udp_port, listening, tcp_server, until, url_of

STOP_S = 0.5


def test_an_error_in_whoever_takes_the_bytes_costs_the_link_not_the_thread() -> None:
    data: list[bytes] = []

    def deliver(receiver: str, mono_ns: int, piece: bytes) -> None:
        data.append(piece)
        if len(data) == 1:
            raise KeyError("a bug")

    heard = Heard()
    with tcp_server() as server:
        listener = Listener("A", parse_source(url_of(server)), deliver, heard.say, first_wait_s=0.02)
        listener.start()
        for _ in range(2):
            with server.accept()[0] as connection:
                connection.send(b"x")
        assert until(lambda: len(data) == 2)
        listener.stop()
    assert "A: link lost: unexpected KeyError: 'a bug'; next try in 0.02 s" in heard.said


def _backing_off(tmp_path: Path) -> str:
    return f"file:{tmp_path}/nothing"


def _pipe_without_a_writer(tmp_path: Path) -> str:
    os.mkfifo(tmp_path / "pipe")
    return f"file:{tmp_path}/pipe"


def _quiet_udp(tmp_path: Path) -> str:
    return f"udp://127.0.0.1:{free_udp_port()}"


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
        _stops(Listener("A", parse_source(url_of(server)), heard.deliver, heard.say))
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
    with tcp_server() as server:
        url = url_of(server)
        with listening(url) as heard, server.accept()[0] as connection:
            connection.send(b"x")
            assert until(lambda: heard.data == b"x")
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


@pytest.mark.parametrize("url", ["ntrip://user:secret@caster.example:2101", "tcp://10.0.0.1"])
def test_an_address_that_cannot_be_opened_is_refused(url: str) -> None:
    with pytest.raises(ConfigError) as raised:
        parse_source(url)
    assert "secret" not in str(raised.value)
