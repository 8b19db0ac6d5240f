"""Listeners on serial ports, files, pipes and UDP: bytes arrive whole, and what stands in the way is said."""

import os
import socket
import time
import tty
from pathlib import Path

import pytest

from integrity.errors import LinkError
from recordings.sources.kinds import parse_source
from recordings.sources.links import Wake
from recordings.sources.listener import Listener
from tests.e2e.links import DATA, PATIENCE_S, Heard, free_udp_port, listening, until, url_of


def _pty() -> tuple[int, int]:
    try:
        ours, theirs = os.openpty()
    except OSError as error:
        pytest.skip(f"no pseudo-terminals here: {error}")
    tty.setraw(theirs)
    return ours, theirs


def test_serial_bytes_arrive_whole_and_the_port_comes_back_under_its_name(tmp_path: Path) -> None:
    """As a USB receiver that is pulled out and plugged in: the name stays, the device behind it is another."""
    port = tmp_path / "receiver"
    ours, theirs = _pty()
    port.symlink_to(os.ttyname(theirs))
    with listening(f"serial://{port}?baud=460800") as heard:
        assert until(lambda: bool(heard.said))
        for at in range(0, 32768, 1024):
            os.write(ours, DATA[at : at + 1024])
        assert until(lambda: len(heard.data) == 32768)
        os.close(ours)
        os.close(theirs)
        assert until(lambda: len(heard.waits_s()) > 0)
        port.unlink()
        ours, theirs = _pty()
        port.symlink_to(os.ttyname(theirs))
        assert until(lambda: heard.said.count(f"A: connected to serial://{port}?baud=460800") == 2)
        os.write(ours, DATA[32768:33000])
        assert until(lambda: len(heard.data) == 33000)
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
    with listening(url) as heard:
        assert until(lambda: bool(heard.said))
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
    with listening(f"file:{path}") as heard:
        assert until(lambda: bool(heard.said))
        with path.open("wb", buffering=0) as pipe:
            pipe.write(b"one")
            assert until(lambda: heard.data == b"one")
            pipe.write(b"two")
            assert until(lambda: heard.data == b"onetwo")
        assert until(lambda: heard.said[-1] == f"A: end of file:{path}")


def test_a_udp_port_takes_one_sender_until_that_falls_silent() -> None:
    url = f"udp://127.0.0.1:{free_udp_port()}"
    here = ("127.0.0.1", int(url.rpartition(":")[2]))
    with socket.socket(type=socket.SOCK_DGRAM) as first, socket.socket(type=socket.SOCK_DGRAM) as second:
        with listening(url, silent_after_s=0.4) as heard:
            assert until(lambda: bool(heard.said))
            second.sendto(b"", here)  # an empty datagram takes no port
            for piece in (b"1", b"2"):
                first.sendto(piece, here)
                second.sendto(b"x", here)
            first.sendto(b"3", here)
            assert until(lambda: heard.data == b"123")
            time.sleep(0.5)
            second.sendto(b"4", here)
            assert until(lambda: heard.data == b"1234")
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
        url = url_of(taken, "udp")
        with listening(url) as heard:
            assert until(lambda: len(heard.said) == 2)
            taken.close()
            assert until(lambda: heard.said[-1] == f"A: listening on {url}")
    assert "another program has this port" in heard.said[0]
