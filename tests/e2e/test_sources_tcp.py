"""Listeners on TCP: bytes arrive whole, in order and stamped, and lost links come back without hammering."""

import socket
import statistics
import time
from contextlib import suppress

from tests.e2e.links import DATA, listening, tcp_server, until, url_of


def test_tcp_bytes_arrive_whole_and_in_order() -> None:
    with tcp_server() as server, listening(url_of(server)) as heard:
        with server.accept()[0] as connection:
            connection.sendall(DATA)
        assert until(lambda: len(heard.data) == len(DATA))
        assert heard.data == DATA


def test_bytes_are_stamped_as_soon_as_they_are_there() -> None:
    """Loopback TCP, from before the send to the stamp: tens of microseconds; 5 ms is far from that, and nearer than any polling."""
    sent_ns: list[int] = []
    with tcp_server() as server, listening(url_of(server)) as heard, server.accept()[0] as connection:
        connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        for _ in range(200):
            time.sleep(0.002)
            sent_ns.append(time.monotonic_ns())
            connection.send(b"x" * 1000)
            assert until(lambda: len(heard.pieces) == len(sent_ns))
    latencies_us = sorted((mono_ns - sent) / 1000 for (_, mono_ns, _), sent in zip(heard.pieces, sent_ns, strict=True))
    print(f"p50 {statistics.median(latencies_us):.0f} us, p95 {latencies_us[190]:.0f} us")
    assert latencies_us[0] > 0
    assert statistics.median(latencies_us) < 5000


def test_a_tcp_server_that_comes_back_is_found_again() -> None:
    server = tcp_server()
    port = server.getsockname()[1]
    with listening(url_of(server)) as heard:
        with server, server.accept()[0] as connection:
            connection.send(b"before")
            assert until(lambda: heard.data == b"before")
        assert until(lambda: any("Connection refused" in line for line in heard.said))
        with tcp_server(port) as restarted, restarted.accept()[0] as connection:
            connection.send(b" after")
            assert until(lambda: heard.data == b"before after")
    url = f"tcp://127.0.0.1:{port}"
    assert heard.said[:3] == [f"A: connected to {url}", "A: bytes come in", "A: link lost: closed by the other end; next try in 0.05 s"]


def test_waits_double_up_to_the_longest_and_are_said_once_each() -> None:
    with tcp_server() as server:
        url = url_of(server)
    with listening(url, first_wait_s=0.02, longest_wait_s=0.1) as heard:
        time.sleep(0.8)
    assert heard.waits_s() == [0.02, 0.04, 0.08, 0.1]


def test_only_bytes_bring_the_wait_back_to_the_first() -> None:
    with tcp_server() as server, listening(url_of(server), first_wait_s=0.02, longest_wait_s=10.0) as heard:
        for greeting in (b"", b"", b"$", b"", b""):
            with server.accept()[0] as connection:
                connection.send(greeting)
        assert until(lambda: len(heard.waits_s()) == 5)
    assert heard.waits_s() == [0.02, 0.04, 0.02, 0.04, 0.08]


def test_a_server_that_hangs_up_at_once_is_not_hammered() -> None:
    """Waits of 0.05, 0.1, 0.2, 0.2 ... s: about 7 tries in 1.2 s."""
    accepted = 0
    with tcp_server() as server, listening(url_of(server)):
        server.settimeout(0.05)
        until_s = time.monotonic() + 1.2
        while time.monotonic() < until_s:
            with suppress(TimeoutError):
                server.accept()[0].close()
                accepted += 1
    assert 3 <= accepted <= 8


def test_a_connection_that_falls_silent_is_opened_again() -> None:
    with tcp_server() as server, listening(url_of(server), silent_after_s=0.3) as heard, server.accept()[0] as first:
        first.send(b"before")
        with server.accept()[0] as second:
            second.send(b" after")
            assert until(lambda: heard.data == b"before after")
    assert "A: link lost: open, but silent for 0.3 s; next try in 0.05 s" in heard.said
