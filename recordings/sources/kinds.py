"""The kinds of source that a site file can name, each with what its address says and how it is opened.

`open` waits no longer than it must, ends early when woken, and raises LinkError with what to do where there is no link.
"""

import errno
import os
import socket
import termios
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import ClassVar
from urllib.parse import parse_qs, urlsplit

from serial import Serial, SerialException

from integrity.errors import ConfigError, LinkError
from recordings.site_schema import source_problem
from recordings.sources.links import MOST_BYTES, SILENT_AFTER_S, Link, OneSender, Wake, connect_tcp, read_stream, reason
from recordings.sources.ntrip import NtripSource, parse_ntrip

DEFAULT_BAUD = 38400  # how UART1 of a u-blox F9 comes up; a USB port ignores it

Tell = Callable[[str], None]


@dataclass(frozen=True)
class SerialSource:
    """A serial port, 8N1, for this program alone."""

    url: str
    path: str
    baud: int
    opened: ClassVar[str] = "connected to"

    def open(self, wake: Wake, tell: Tell, silent_after_s: float = SILENT_AFTER_S) -> Link:
        """Open the port. Bytes that it received before are dropped. A silent port stays open: a device that is gone shows itself."""
        try:
            port = Serial(self.path, self.baud, timeout=0, exclusive=True)
        except (SerialException, OSError, ValueError, termios.error) as error:
            raise LinkError(f"{self.path}: {self._remedy(error)}") from None
        return Link(port.fileno(), partial(read_stream, port.fileno()), port.close, wake)

    def _remedy(self, error: Exception) -> str:
        code = getattr(error, "errno", None)
        if code in (errno.ENOENT, errno.ENODEV, errno.ENXIO):
            return "no such port: is the receiver plugged in and switched on? `ls -l /dev/serial/by-id` lists what is there"
        if code in (errno.EACCES, errno.EPERM):
            return "this user may not open the port: add the user to the group dialout (`sudo usermod -aG dialout USER`) and log in again"
        if code in (errno.EAGAIN, errno.EBUSY):
            return f"another program has the port: stop it first (`fuser {self.path}` names it; gpsd and ModemManager are usual)"
        return f"cannot be used as a serial port at {self.baud} baud: {error}"


@dataclass(frozen=True)
class TcpSource:
    """A receiver, or a serial server, that listens for TCP connections."""

    url: str
    host: str
    port: int
    opened: ClassVar[str] = "connected to"

    def open(self, wake: Wake, tell: Tell, silent_after_s: float = SILENT_AFTER_S) -> Link:
        """Connect to the first address that answers. So long a silence counts as a loss: a half-open connection looks like that."""
        connection = connect_tcp(self.url, self.host, self.port, "is the receiver switched on, the cable in, the port right?", wake)
        return Link(connection.fileno(), partial(read_stream, connection.fileno()), connection.close, wake, silent_after_s)


@dataclass(frozen=True)
class UdpSource:
    """Datagrams to a port of this machine: at one of its addresses, or at all where `host` is empty."""

    url: str
    host: str
    port: int
    opened: ClassVar[str] = "listening on"

    def open(self, wake: Wake, tell: Tell, silent_after_s: float = SILENT_AFTER_S) -> Link:
        """Bind the port. One sender is listened to, see `OneSender`; a silent port stays open."""
        try:
            family, kind, protocol, _, address = socket.getaddrinfo(self.host or "0.0.0.0", self.port, type=socket.SOCK_DGRAM)[0]
            port = socket.socket(family, kind, protocol)
        except (OSError, UnicodeError) as error:
            raise LinkError(f"{self.url}: {reason(error)}") from None
        try:
            port.setblocking(False)
            port.bind(address)
        except OSError as error:
            port.close()
            raise LinkError(f"{self.url}: {self._remedy(error)}") from None
        sender = OneSender(port, tell, silent_after_s)
        return Link(port.fileno(), sender.receive, sender.close, wake)

    def _remedy(self, error: OSError) -> str:
        if error.errno == errno.EADDRINUSE:
            return "another program has this port: stop it first (`ss -lunp` names it), or give the receiver a port of its own"
        if error.errno == errno.EADDRNOTAVAIL:
            return f"{self.host} is no address of this machine: write udp://:{self.port} to take datagrams at any address"
        return reason(error)


@dataclass(frozen=True)
class FileSource:
    """A file, read as fast as it is consumed, or a named pipe, read as it is written. Either ends once."""

    url: str
    path: str
    opened: ClassVar[str] = "reading"

    def open(self, wake: Wake, tell: Tell, silent_after_s: float = SILENT_AFTER_S) -> Link:
        """Open it for reading; a pipe that nobody writes to yet is waited for by the first read."""
        try:
            fd = os.open(self.path, os.O_RDONLY | os.O_NONBLOCK)
        except OSError as error:
            raise LinkError(f"{self.url}: {reason(error)}: a relative path counts from where the site file lies") from None
        return Link(fd, lambda: os.read(fd, MOST_BYTES) or None, partial(os.close, fd), wake)


Source = SerialSource | TcpSource | UdpSource | FileSource | NtripSource


def parse_source(url: str) -> Source:
    """The source at an address; ConfigError where it is malformed."""
    problem = source_problem(url)
    if problem is not None:
        raise ConfigError(f"source {url.rpartition('@')[2]!r}: {problem}")
    scheme, _, rest = url.partition(":")
    if scheme == "file":  # taken as it stands: a path may hold "?", "#" and "%"
        return FileSource(url, rest.removeprefix("//"))
    if scheme in ("ntrip", "ntrips"):
        return parse_ntrip(url)
    parts = urlsplit(url)
    if scheme == "serial":
        return SerialSource(url, parts.netloc + parts.path, int(parse_qs(parts.query).get("baud", [str(DEFAULT_BAUD)])[0]))
    assert parts.port is not None  # the form was checked above
    kind = TcpSource if scheme == "tcp" else UdpSource
    return kind(url, parts.hostname or "", parts.port)
