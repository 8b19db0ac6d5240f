"""An open link: a serial port, a TCP or UDP socket or a file, all of them file descriptors that one `poll` waits on.

A read returns as soon as bytes are there, with all that are there: no timer runs on the way of the data. The same `poll` waits on
a `Wake`, so that whoever waits for bytes, for a connection or for the next try can be stopped at once.
"""

import contextlib
import errno
import os
import select
import socket
import time
from collections.abc import Callable
from typing import Any

from integrity.errors import LinkError

MOST_BYTES = 65536  # of one read; no datagram is longer
WRITE_TIMEOUT_S = 2.0
CONNECT_TIMEOUT_S = 5.0
SILENT_AFTER_S = 10.0


class Wake:
    """A flag that is raised once, from any thread, and ends every wait on it, now and later."""

    def __init__(self) -> None:
        self.is_set = False
        self._end, self._other_end = socket.socketpair()

    def set(self) -> None:
        """Raise the flag."""
        self.is_set = True
        with contextlib.suppress(OSError):  # closed: nobody waits any more
            self._other_end.send(b"\0")

    def fileno(self) -> int:
        """What `poll` waits on: readable once the flag is raised."""
        return self._end.fileno()

    def wait(self, timeout_s: float) -> None:
        """Return after this time, or as soon as the flag is raised."""
        wait_for(self, select.POLLIN, timeout_s)

    def close(self) -> None:
        """Give the descriptors back; nobody may wait any more."""
        self._end.close()
        self._other_end.close()


def wait_for(waitable: int | Wake | socket.socket, event: int, timeout_s: float, wake: Wake | None = None) -> bool:
    """True once the event (or an error) is there, False after the time or where the wake came first."""
    poll = select.poll()
    poll.register(waitable, event)
    if wake is not None:
        poll.register(wake, select.POLLIN)
    ready = poll.poll(1000.0 * timeout_s)
    return bool(ready) and (wake is None or not wake.is_set)


class Link:
    """An open link. Where it is of no more use, `read` and `write` raise LinkError."""

    def __init__(
        self,
        fd: int,
        receive: Callable[[], bytes | None],
        close: Callable[[], None],
        wake: Wake,
        silent_after_s: float | None = None,
        has_more: Callable[[], bool] = lambda: False,
    ) -> None:
        """`receive` takes what is there, without waiting. With `silent_after_s`, so long a silence counts as the loss of the link.

        `has_more`: whether `receive` has something that the descriptor does not show, since it was read from there already.
        """
        self.close = close
        self._fd = fd
        self._receive = receive
        self._has_more = has_more
        self._silent_after_s = silent_after_s
        self._heard_s = time.monotonic()
        self._poll = select.poll()
        self._poll.register(fd, select.POLLIN)
        self._poll.register(wake, select.POLLIN)

    def read(self, timeout_s: float | None) -> bytes | None:
        """The bytes that are there, as soon as there are any; b"" where none came in time (or the wake did); None at the end of a file."""
        limits_s = [] if timeout_s is None else [timeout_s]
        if self._silent_after_s is not None:
            limits_s.append(self._heard_s + self._silent_after_s - time.monotonic())
        more = self._has_more()
        ready = [] if more else self._poll.poll(1000.0 * max(0.0, min(limits_s)) if limits_s else None)
        if more or any(fd == self._fd for fd, _ in ready):
            data = self._received()
            if data is None or data:
                self._heard_s = time.monotonic()
            return data
        if self._silent_after_s is not None and time.monotonic() - self._heard_s >= self._silent_after_s:
            raise LinkError(f"open, but silent for {self._silent_after_s:g} s")
        return b""

    def _received(self) -> bytes | None:
        try:
            return self._receive()
        except BlockingIOError:  # poll may be wrong about a socket
            return b""
        except OSError as error:
            raise LinkError(reason(error)) from None

    def write(self, data: bytes) -> None:
        """Send all of the bytes; LinkError where the link takes none for two seconds."""
        try:
            while data:
                if not wait_for(self._fd, select.POLLOUT, WRITE_TIMEOUT_S):
                    raise LinkError(f"takes no bytes for {WRITE_TIMEOUT_S:g} s")
                data = data[os.write(self._fd, data) :]
        except OSError as error:
            raise LinkError(reason(error)) from None


def connect_tcp(url: str, host: str, port: int, remedy: str, wake: Wake) -> socket.socket:
    """A connection to the first address that answers, which never blocks; LinkError in the name of `url` where none does."""
    try:
        addresses = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)
    except (OSError, UnicodeError) as error:
        raise LinkError(f"{url}: no address for {host}: {reason(error)}") from None
    refusals = []
    for family, kind, protocol, _, address in addresses:
        connection = socket.socket(family, kind, protocol)
        try:
            _connect(connection, address, wake)
            connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            connection.setsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1)
        except OSError as error:
            connection.close()
            refusals.append(reason(error))
            continue
        return connection
    raise LinkError(f"{url}: {refusals[-1]}: {remedy}")


def _connect(connection: socket.socket, address: tuple[object, ...], wake: Wake) -> None:
    connection.setblocking(False)
    code = connection.connect_ex(address)
    if code == errno.EINPROGRESS:
        if not wait_for(connection, select.POLLOUT, CONNECT_TIMEOUT_S, wake):
            raise TimeoutError(errno.ETIMEDOUT, f"no answer in {CONNECT_TIMEOUT_S:g} s")
        code = connection.getsockopt(socket.SOL_SOCKET, socket.SO_ERROR)
    if code:
        raise OSError(code, os.strerror(code))


def read_stream(fd: int) -> bytes:
    """What is there on a port or a connection, which never end by themselves: no bytes mean that the other end is gone."""
    data = os.read(fd, MOST_BYTES)
    if not data:
        raise LinkError("closed by the other end")
    return data


class OneSender:
    """Datagrams of one sender only: the first, until it has been silent for `silent_after_s`. Those of others are refused and counted."""

    def __init__(self, bound: socket.socket, tell: Callable[[str], None], silent_after_s: float) -> None:
        self._socket = bound
        self._tell = tell
        self._silent_after_s = silent_after_s
        self._sender: Any = None
        self._heard_s = 0.0
        self._refused = 0

    def receive(self) -> bytes:
        """The next datagram; b"" where it is refused or empty."""
        data, sender = self._socket.recvfrom(MOST_BYTES)
        now_s = time.monotonic()
        if not data:
            return b""
        if sender != self._sender:
            if self._sender is not None and now_s - self._heard_s < self._silent_after_s:
                self._refuse(sender)
                return b""
            self._tell_refused()
            self._sender = sender
            self._tell(f"takes the datagrams of {_sender_name(sender)}")
        self._heard_s = now_s
        return data

    def _refuse(self, sender: Any) -> None:
        if self._refused == 0:
            taken = _sender_name(self._sender)
            self._tell(f"refuses datagrams of {_sender_name(sender)}, this port takes those of {taken}: two receivers on one port?")
        self._refused += 1

    def _tell_refused(self) -> None:
        if self._refused:
            self._tell(f"refused {self._refused} datagrams that were not of {_sender_name(self._sender)}")
        self._refused = 0

    def close(self) -> None:
        """Close the port, and tell how many datagrams were refused."""
        self._socket.close()
        self._tell_refused()


def _sender_name(sender: Any) -> str:
    return f"{sender[0]}:{sender[1]}"


def reason(error: Exception) -> str:
    """The system's words for an error, without its number and file."""
    return getattr(error, "strerror", None) or str(error)
