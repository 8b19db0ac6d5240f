"""A mount point of an NTRIP caster as a source of bytes: asked for as version 2, taken as version 1 where the caster answers so.

Whoever has the address has the password: neither user nor password stands in `url`, which is what people and logs get to see.
"""

import select
import socket
import ssl
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field
from functools import partial
from typing import ClassVar, TypeVar
from urllib.parse import parse_qs, unquote

from integrity import SOFTWARE
from integrity.errors import DecodeError, LinkError
from recordings.site_schema import SOURCE_FORMS
from recordings.sources.links import MOST_BYTES, SILENT_AFTER_S, Link, Wake, connect_tcp, reason, wait_for
from recordings.sources.ntrip_messages import (
    MOST_TABLE_BYTES,
    Answer,
    body_of,
    gga_sentence,
    mount_points,
    nearest,
    parse_answer,
    printable,
    request,
)

ANSWER_WITHIN_S = 10.0
GGA_EVERY_S = 10.0

T = TypeVar("T")


@dataclass(frozen=True)
class NtripSource:
    """A mount point. `ca`: a file of certificates to trust instead of the system's; `gga_deg_m`: the position that the caster is told.

    That is for casters that choose a station near it. A virtual reference station is no antenna: it cannot be vouched for by a triangle.
    """

    url: str
    host: str
    port: int
    mount: str
    credentials: tuple[str, str] | None = field(default=None, repr=False)
    tls: bool = False
    ca: str | None = None
    gga_deg_m: tuple[float, float, float] | None = None
    opened: ClassVar[str] = "connected to"

    def open(self, wake: Wake, tell: Callable[[str], None], silent_after_s: float = SILENT_AFTER_S) -> Link:
        """Ask for the stream; the answer must be there before so long a silence, or within ten seconds."""
        until_s = time.monotonic() + min(silent_after_s, ANSWER_WITHIN_S)
        connection, answer = self._asked(self.mount, until_s, wake)
        try:
            if not answer.is_stream:
                raise LinkError(f"{self.url}: {self._refusal(answer, connection, until_s, wake)}")
            stream = _Stream(connection, answer, self._gga)
        except LinkError:
            connection.close()
            raise
        except OSError as error:
            connection.close()
            raise LinkError(f"{self.url}: {reason(error)}") from None
        return Link(connection.fileno(), stream.receive, connection.close, wake, silent_after_s, stream.has_more)

    def _gga(self) -> str:
        return "" if self.gga_deg_m is None else gga_sentence(*self.gga_deg_m, time.time())

    def _asked(self, mount: str, until_s: float, wake: Wake) -> tuple[socket.socket, Answer]:
        """A connection on which a mount point was asked for, and the head of the answer."""
        connection = self._connected(until_s, wake)
        try:
            _send(
                connection, request(self.host, self.port, mount, SOFTWARE.replace(" ", "/"), self.credentials, self._gga()), until_s, wake
            )
            received = b""
            while (answer := parse_answer(received)) is None:
                data = _received(connection, until_s, wake)
                if not data:
                    raise LinkError("closed by the other end before it answered: is this a caster, and does it speak TLS (ntrips)?")
                received += data
        except DecodeError as error:
            connection.close()
            raise LinkError(f"{self.url}: not an NTRIP caster, {error}: is the port right, and does it speak TLS (ntrips)?") from None
        except (LinkError, OSError) as error:
            connection.close()
            raise LinkError(f"{self.url}: {reason(error)}") from None
        return connection, answer

    def _connected(self, until_s: float, wake: Wake) -> socket.socket:
        tls = self._trusting() if self.tls else None
        connection = connect_tcp(self.url, self.host, self.port, "is the caster running, the port right, a firewall in between?", wake)
        if tls is None:
            return connection
        try:
            connection = tls.wrap_socket(connection, server_hostname=self.host, do_handshake_on_connect=False)
            _waiting(connection, connection.do_handshake, select.POLLIN, until_s, wake)
        except (LinkError, OSError, ValueError) as error:
            connection.close()
            raise LinkError(f"{self.url}: {_tls_remedy(error)}") from None
        return connection

    def _trusting(self) -> ssl.SSLContext:
        try:
            return ssl.create_default_context(cafile=self.ca)
        except OSError as error:
            raise LinkError(f"{self.url}: ca={self.ca}: {reason(error)}: expected a PEM file of the certificates to trust") from None

    def _refusal(self, answer: Answer, connection: socket.socket, until_s: float, wake: Wake) -> str:
        """Why there is no stream, and what to do."""
        if answer.is_table and answer.code == 200:
            return self._no_mount(_table(connection, answer, until_s, wake))
        said = f"the caster answers {answer.code} {answer.words}".rstrip()
        match answer.code:
            case 200:
                return f"not an NTRIP caster, it sends {printable(answer.headers['content-type'])}: is the port right?"
            case 401 if self.credentials is None:
                return f"{said}: it wants user and password: write {'ntrips' if self.tls else 'ntrip'}://user:password@{self.host}:..."
            case 401:
                return f"{said}: user or password is wrong; characters such as @ : / % in them are written as %40 %3A %2F %25"
            case 403:
                return f"{said}: this user may not have {self.mount}, or too many use the account: ask who runs the caster"
            case 404:
                return self._no_mount(self._fetched_table(until_s, wake))
            case code if 300 <= code < 400:
                return f"{said}: it has moved: ask who runs the caster for the new address"
            case code if code >= 500:
                return f"{said}: the caster is out of order or overloaded, or nothing feeds {self.mount} now"
            case _:
                return f"{said}: ask who runs the caster"

    def _no_mount(self, table: bytes) -> str:
        return ": ".join(
            words for words in (f"the caster has no mount point {self.mount}", nearest(self.mount, mount_points(table))) if words
        )

    def _fetched_table(self, until_s: float, wake: Wake) -> bytes:
        """The source table; nothing where it cannot be had."""
        try:
            connection, answer = self._asked("", until_s, wake)
        except LinkError:
            return b""
        with connection:
            return _table(connection, answer, until_s, wake)


def parse_ntrip(url: str) -> NtripSource:
    """The source at a well-formed address."""
    scheme, _, rest = url.partition(":")
    found = SOURCE_FORMS[scheme][1].fullmatch(rest)
    assert found is not None  # the form was checked
    options = parse_qs(found["options"] or "")
    gga = tuple(float(number) for number in options["gga"][0].split(",")) if "gga" in options else None
    credentials = None
    if found["credentials"] is not None:
        user, _, password = found["credentials"].partition(":")
        credentials = unquote(user), unquote(password)
    return NtripSource(
        url=f"{scheme}://{found['host']}:{found['port']}/{found['mount']}",
        host=found["host"].strip("[]"),
        port=int(found["port"]),
        mount=found["mount"],
        credentials=credentials,
        tls=scheme == "ntrips",
        ca=options["ca"][0] if "ca" in options else None,
        gga_deg_m=(gga[0], gga[1], gga[2]) if gga else None,
    )


class _Stream:
    """The bytes of a mount point. A position is sent at once, and when bytes come ten seconds or more after the last one was."""

    def __init__(self, connection: socket.socket, answer: Answer, gga: Callable[[], str]) -> None:
        self._connection = connection
        self._body = body_of(answer)
        self._ready = self._body.feed(answer.rest)
        self._gga = gga
        self._tell_position()

    def has_more(self) -> bool:
        """Whether bytes, or the end, are here that the descriptor does not show."""
        held = isinstance(self._connection, ssl.SSLSocket) and self._connection.pending() > 0
        return held or bool(self._ready) or self._body.over is not None

    def receive(self) -> bytes:
        """What is there, without waiting; LinkError where nothing more will come."""
        if not self._ready:
            if self._body.over is not None:
                raise LinkError(self._body.over)
            try:
                data = self._connection.recv(MOST_BYTES)
            except (ssl.SSLWantReadError, ssl.SSLWantWriteError):  # a record that is not complete
                return b""
            if not data:
                raise LinkError("closed by the other end")
            self._ready = self._body.feed(data)
            if time.monotonic() - self._position_s >= GGA_EVERY_S:
                self._tell_position()
        ready, self._ready = self._ready, b""
        return ready

    def _tell_position(self) -> None:
        """80 bytes: where there is no room for them, the other end has been gone for long."""
        self._position_s = time.monotonic()
        sentence = self._gga().encode()
        try:
            sent = self._connection.send(sentence) if sentence else 0
        except (BlockingIOError, ssl.SSLWantReadError, ssl.SSLWantWriteError):
            sent = 0
        if sent != len(sentence):
            raise LinkError("takes no bytes")


def _waiting(connection: socket.socket, act: Callable[[], T], event: int, until_s: float, wake: Wake) -> T:
    """What `act` returns once it need not wait (for `event`, or for what TLS wants); LinkError where that takes too long."""
    began_s = time.monotonic()
    while True:
        try:
            return act()
        except BlockingIOError:
            wanted = event
        except ssl.SSLWantReadError:
            wanted = select.POLLIN
        except ssl.SSLWantWriteError:
            wanted = select.POLLOUT
        if not wait_for(connection, wanted, max(0.0, until_s - time.monotonic()), wake):
            raise LinkError(f"accepts connections, but has not answered for {time.monotonic() - began_s:.1f} s: try later")


def _send(connection: socket.socket, data: bytes, until_s: float, wake: Wake) -> None:
    while data:
        data = data[_waiting(connection, partial(connection.send, data), select.POLLOUT, until_s, wake) :]


def _received(connection: socket.socket, until_s: float, wake: Wake) -> bytes:
    return _waiting(connection, partial(connection.recv, MOST_BYTES), select.POLLIN, until_s, wake)


def _table(connection: socket.socket, answer: Answer, until_s: float, wake: Wake) -> bytes:
    """A source table, as much of it as comes in time; nothing where the answer is none."""
    if not answer.is_table:
        return b""
    body = body_of(answer)
    table = body.feed(answer.rest)
    with suppress(LinkError, OSError):
        while b"ENDSOURCETABLE" not in table and body.over is None and len(table) < MOST_TABLE_BYTES:
            data = _received(connection, until_s, wake)
            if not data:
                break
            table += body.feed(data)
    return table


def _tls_remedy(error: Exception) -> str:
    if isinstance(error, ssl.SSLCertVerificationError):
        return (
            f"its certificate cannot be trusted ({error.verify_message}): is the host the one that the certificate names? Where the "
            "caster has a certificate authority of its own, add ?ca=FILE with its certificate"
        )
    if isinstance(error, ssl.SSLError):
        return f"no TLS there ({error.reason or reason(error)}): is this the port for TLS? Without TLS it is ntrip://"
    return reason(error)
