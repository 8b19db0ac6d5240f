"""Listeners on NTRIP casters: bytes arrive whole, lost streams come back, and what is wrong is said with what to do, without secrets."""

import re
import time
from pathlib import Path

import pytest

from integrity.errors import ConfigError
from recordings.sources import ntrip
from recordings.sources.inbox import Inbox
from recordings.sources.kinds import parse_source
from recordings.sources.links import Wake
from recordings.sources.listener import Listener, listener_of
from recordings.sources.ntrip import NtripSource
from tests.e2e.caster import Caster, Mount, certificate
from tests.e2e.links import DATA, Heard, listening, tcp_server, until

USER = "some%40one:p%3Ass%2Fw"  # some@one, and p:ss/w
PLAIN_USER = "some@one:p:ss/w"


def listens(caster: Caster, name: str = "MOUNT") -> bool:
    return until(lambda: bool(caster.mounts[name].listeners))


def fed(mount: Mount) -> Mount:
    mount.send(b"x")
    return mount


# Bytes


@pytest.mark.parametrize("version", [1, 2])
def test_bytes_arrive_whole_and_in_order(version: int) -> None:
    with Caster(version=version) as caster, listening(caster.url()) as heard:
        assert listens(caster)
        for begin in range(0, len(DATA), 70_000):
            caster.mounts["MOUNT"].send(DATA[begin : begin + 70_000])
        assert until(lambda: len(heard.data) >= len(DATA))
    assert heard.data == DATA


def test_bytes_that_come_with_the_answer_are_not_left_lying() -> None:
    """The descriptor shows nothing any more once they have been read with the answer."""
    with Caster(answer=b"HTTP/1.1 200 OK\r\nTransfer-Encoding: chunked\r\n\r\n5\r\nwhole\r\n") as caster, listening(caster.url()) as heard:
        assert until(lambda: heard.data == b"whole")


def test_bytes_over_tls_arrive_whole(tmp_path: Path) -> None:
    tls, ca = certificate(tmp_path)
    with Caster(tls=tls) as caster, listening(caster.url(options=f"?ca={ca}")) as heard:
        assert listens(caster)
        caster.mounts["MOUNT"].send(DATA)
        assert until(lambda: len(heard.data) >= len(DATA))
    assert heard.data == DATA


@pytest.mark.parametrize("most_bytes", [64, 65536])
def test_what_is_decrypted_already_does_not_wait_for_more(most_bytes: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Where a read takes less than a record, the descriptor shows nothing of the rest."""
    monkeypatch.setattr(ntrip, "MOST_BYTES", most_bytes)
    tls, ca = certificate(tmp_path)
    with Caster(tls=tls) as caster, listening(caster.url(options=f"?ca={ca}")) as heard:
        assert listens(caster)
        for size in (10, 1000, 100):
            caster.mounts["MOUNT"].send(b"x" * size)
        assert until(lambda: len(heard.data) == 1110), len(heard.data)


def test_a_caster_is_told_user_and_password_as_they_are() -> None:
    with Caster(user=PLAIN_USER) as caster, listening(caster.url(user=USER)) as heard:
        assert listens(caster), heard.said


def test_a_position_is_told_with_the_request_and_after_the_answer() -> None:
    with Caster(version=1) as caster, listening(caster.url(options="?gga=-35.5,139.25,65.7")):
        assert until(lambda: caster.mounts["MOUNT"].said.endswith(b"\r\n"))
    place = ",3530.000000,S,13915.000000,E,1,"
    assert (place in caster.requests[0], place in caster.mounts["MOUNT"].said.decode()) == (True, True)


def test_a_position_is_told_again_while_bytes_come(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(ntrip, "GGA_EVERY_S", 0.05)
    with Caster() as caster, listening(caster.url(options="?gga=35.5,139.25,65.7")):
        assert listens(caster)
        mount = caster.mounts["MOUNT"]
        assert until(lambda: fed(mount).said.count(b"$GPGGA") >= 3)


# Streams that end


def test_a_caster_that_comes_back_is_found_again() -> None:
    with Caster() as caster, listening(caster.url()) as heard:
        assert listens(caster)
        caster.mounts["MOUNT"].send(b"before")
        assert until(lambda: heard.data == b"before")
        caster.__exit__(None, None, None)
        assert until(lambda: any("Connection refused" in line for line in heard.said))
        with Caster(port=caster.port) as restarted:
            assert listens(restarted)
            restarted.mounts["MOUNT"].send(b" after")
            assert until(lambda: heard.data == b"before after")
    url = f"ntrip://127.0.0.1:{caster.port}/MOUNT"
    assert heard.said[:3] == [f"A: connected to {url}", "A: bytes come in", "A: link lost: closed by the other end; next try in 0.05 s"]


def test_a_stream_that_falls_silent_is_asked_for_again() -> None:
    with Caster() as caster, listening(caster.url(), silent_after_s=0.3) as heard:
        assert listens(caster)
        caster.mounts["MOUNT"].send(b"once")
        assert until(lambda: len(caster.requests) == 2)
    assert "A: link lost: open, but silent for 0.3 s; next try in 0.05 s" in heard.said


def test_what_came_of_a_chunk_before_the_end_is_kept() -> None:
    with Caster() as caster, listening(caster.url()) as heard:
        assert listens(caster)
        caster.mounts["MOUNT"].send_as_it_is(b"ffff\r\nwhat there is")
        caster.mounts["MOUNT"].hang_up()
        assert until(lambda: any("closed by the other end" in line for line in heard.said))
    assert heard.data == b"what there is"


@pytest.mark.parametrize(
    ("sent", "said"),
    [
        (b"0\r\n\r\n", "link lost: the caster has ended the stream;"),
        (b"3\r\nabcd\r\n", "link lost: what came is no chunk: 'd';"),
        (b"3\r\nabc\r\n$GPGGA\r\n", "link lost: what came is no chunk: '$GPGGA';"),
    ],
)
def test_a_body_that_is_over_is_a_loss(sent: bytes, said: str) -> None:
    with Caster() as caster, listening(caster.url()) as heard:
        assert listens(caster)
        caster.mounts["MOUNT"].send_as_it_is(sent)
        assert until(lambda: any(said in line for line in heard.said)), heard.said


# Streams that do not begin: what the caster answers, and what must be said.

REFUSALS = {
    "403": (b"HTTP/1.1 403 Forbidden\r\n\r\n", "the caster answers 403 Forbidden: this user may not have MOUNT"),
    "503": (
        b"HTTP/1.1 503 Service Unavailable\r\n\r\n",
        "503 Service Unavailable: the caster is out of order or overloaded, or nothing feeds",
    ),
    "moved": (b"HTTP/1.1 301 Moved\r\nLocation: x\r\n\r\n", "301 Moved: it has moved: ask who runs the caster"),
    "version 1 password": (b"ERROR - Bad Password\r\n", "401 ERROR - Bad Password: user or password is wrong"),
    "a web server": (
        b"HTTP/1.1 200 OK\r\nContent-Type: text/html\r\n\r\n<html>",
        "not an NTRIP caster, it sends text/html: is the port right?",
    ),
    "a mail server": (b"220 mail.example ESMTP\x1b[2J\r\n", "not an NTRIP caster, it says '220 mail.example ESMTP.[2J': is the port right"),
    "a receiver": (b"\xb5\x62\x01\x07", "not an NTRIP caster, it says '.b..': is the port right"),
    "a line without end": (b"x" * 300, f"not an NTRIP caster, it says '{'x' * 60}…'"),
    "a head without end": (b"HTTP/1.1 200 OK\r\n" + b"a: b\r\n" * 2000, "not an NTRIP caster, its answer 'HTTP/1.1 200 OK' has no end"),
}


def refused(url: str, silent_after_s: float = 2.0) -> str:
    """The first loss that a listener tells of."""
    with listening(url, silent_after_s=silent_after_s, first_wait_s=5.0) as heard:
        assert until(lambda: bool(heard.waits_s())), heard.said
    return heard.said[0]


@pytest.mark.parametrize("what", REFUSALS)
def test_a_caster_that_refuses_is_understood(what: str) -> None:
    answer, said = REFUSALS[what]
    with Caster(answer=answer) as caster:
        line = refused(caster.url(user=USER))
    assert re.match(r"A: ntrip://127\.0\.0\.1:\d+/MOUNT: ", line) and said in line, line


@pytest.mark.parametrize(
    ("user", "said"),
    [
        ("", "it wants user and password: write ntrip://user:password@127.0.0.1:"),
        ("x:y", "user or password is wrong; characters such as @"),
    ],
)
def test_a_caster_that_wants_another_password_is_understood(user: str, said: str) -> None:
    with Caster(user=PLAIN_USER) as caster:
        assert f"the caster answers 401 Unauthorized: {said}" in refused(caster.url(user=user))


@pytest.mark.parametrize("version", [1, 2])
def test_a_mount_point_that_does_not_exist_is_told_with_the_nearest(version: int) -> None:
    with Caster(["TOKYO01", "TOKYO02", "KYOTO"], version=version) as caster:
        line = refused(caster.url("tokio02"))
    assert line.startswith(f"A: {caster.url('tokio02')}: the caster has no mount point tokio02: did you mean TOKYO02 or TOKYO01")


def test_a_caster_that_accepts_and_says_nothing_is_given_up() -> None:
    with Caster(answer=b"") as caster:
        assert "accepts connections, but has not answered for 0.3 s: try later" in refused(caster.url(), silent_after_s=0.3)


def test_a_caster_that_hangs_up_is_asked_about() -> None:
    with tcp_server() as server, listening(f"ntrip://127.0.0.1:{server.getsockname()[1]}/M") as heard:
        connection = server.accept()[0]
        connection.recv(4096)
        connection.close()
        assert until(lambda: any("closed by the other end before it answered: is this a caster" in line for line in heard.said)), heard.said


def test_a_certificate_that_nobody_vouches_for_is_refused(tmp_path: Path) -> None:
    tls, _ = certificate(tmp_path)
    with Caster(tls=tls) as caster:
        line = refused(caster.url(user=USER))
        assert "its certificate cannot be trusted (self-signed certificate)" in line and "add ?ca=FILE" in line, line


def test_a_certificate_of_another_host_is_refused(tmp_path: Path) -> None:
    tls, ca = certificate(tmp_path, host="10.9.9.9")
    with Caster(tls=tls) as caster:
        assert "IP address mismatch" in refused(caster.url(options=f"?ca={ca}"))


def test_a_password_is_not_sent_before_the_certificate_is_trusted(tmp_path: Path) -> None:
    tls, _ = certificate(tmp_path)
    with Caster(tls=tls) as caster:
        refused(caster.url(user=USER))
    assert caster.requests == []


def test_a_port_without_tls_is_told() -> None:
    with tcp_server() as server, listening(f"ntrips://127.0.0.1:{server.getsockname()[1]}/M") as heard, server.accept()[0] as connection:
        connection.sendall(b"HTTP/1.1 400 Bad Request\r\n\r\n")
        assert until(lambda: bool(heard.said))
    assert "no TLS there (WRONG_VERSION_NUMBER): is this the port for TLS? Without TLS it is ntrip://" in heard.said[0]


def test_a_missing_file_of_certificates_is_told(tmp_path: Path) -> None:
    with Caster() as caster:
        line = refused(f"ntrips://127.0.0.1:{caster.port}/MOUNT?ca={tmp_path / 'none.pem'}")
    assert "none.pem: No such file or directory: expected a PEM file" in line


# Addresses


def test_an_address() -> None:
    assert parse_source("ntrips://some%40one:p%3A%20@[::1]:2102/M?ca=a.pem&gga=1.5,-2.5,30") == NtripSource(
        "ntrips://[::1]:2102/M", "::1", 2102, "M", ("some@one", "p: "), True, "a.pem", (1.5, -2.5, 30.0)
    )


def test_a_file_of_certificates_lies_where_the_site_file_does(tmp_path: Path) -> None:
    listener = listener_of("A", "ntrips://h:1/M?ca=ca.pem", tmp_path, Inbox[object](), 1, print)
    listener.stop()
    assert isinstance(listener.source, NtripSource) and listener.source.ca == str(tmp_path / "ca.pem")


def test_neither_user_nor_password_is_in_what_people_get_to_see() -> None:
    assert re.search("some|ss", repr(parse_source(f"ntrip://{USER}@caster.example:2101/M"))) is None


def test_neither_is_in_what_a_malformed_address_is_told_with() -> None:
    with pytest.raises(ConfigError) as raised:
        parse_source(f"ntrip://{USER}@caster.example/M")
    assert re.search("some|ss%2Fw", str(raised.value)) is None


def test_a_listener_that_waits_for_an_answer_stops_at_once() -> None:
    with Caster(answer=b"") as caster:
        listener = Listener("A", parse_source(caster.url()), Heard().deliver, Heard().say)
        listener.start()
        assert until(lambda: len(caster.requests) == 1)
        stopped_s = time.monotonic()
        listener.stop()
        assert not listener.is_alive() and time.monotonic() - stopped_s < 0.3


def test_a_connection_that_was_refused_is_closed() -> None:
    descriptors = Path("/proc/self/fd")
    with Caster(answer=b"HTTP/1.1 403 Forbidden\r\n\r\n") as caster:
        source = parse_source(caster.url())
        wake = Wake()
        before = len(list(descriptors.iterdir()))
        for _ in range(3):
            with pytest.raises(Exception, match="403"):
                source.open(wake, print)
        wake.close()
        caster.__exit__(None, None, None)
        assert len(list(descriptors.iterdir())) <= before
