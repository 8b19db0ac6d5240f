"""Simulated receivers on TCP: what each of them sends, at the time at which it would send it.

One thread and one selector; nothing in it waits for a client. Deadlines count from the start, so that lateness does not add up.
"""

import selectors
import socket
import time
from collections import deque
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from itertools import groupby

from integrity.errors import LinkError
from integrity.events import Event, RawBytes
from integrity.gnss.gps_time import NS_PER_S
from integrity.gnss.ubx.framing import Framer, frame_bytes
from integrity.gnss.ubx.sfrbx import RXM_SFRBX

WORDS_KEPT_NS = 30 * NS_PER_S  # in which every satellite says everything: `receiver`
MOST_WAITING_BYTES = 4 << 20  # of one client, besides what the system holds for it
LAST_BYTES_WITHIN_S = 5.0

Sent = Callable[[str, int, int], None]
"""Receiver, GPS time of the epoch, and monotonic time when its last byte had been handed to the socket; both in ns."""


@dataclass(eq=False)
class _Client:
    receiver: str
    connection: socket.socket
    waiting: bytearray = field(default_factory=bytearray)


class ReceiverServer:
    """Listens from the beginning: `wait_for_clients`, then `play`. Each receiver may have several clients; what they send is ignored."""

    def __init__(self, receivers: Sequence[str], host: str, port: int) -> None:
        """The first receiver at `port`, the others at those that follow; at free ports for port 0. LinkError where one is not to be had."""
        # select() takes microseconds where epoll takes whole milliseconds.
        self._selector = selectors.SelectSelector()
        self._clients: list[_Client] = []
        self._met: set[str] = set()
        self._words: dict[str, deque[tuple[int, bytes]]] = {receiver: deque() for receiver in receivers}
        self.addresses: dict[str, tuple[str, int]] = {}
        for k, receiver in enumerate(receivers):
            try:
                listener = _listener(receiver, host, port + k if port else 0)
            except LinkError:
                self.close()
                raise
            self._selector.register(listener, selectors.EVENT_READ, receiver)
            self.addresses[receiver] = (host, listener.getsockname()[1])

    def __enter__(self) -> "ReceiverServer":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """End all connections; the ports are free."""
        for key in list(self._selector.get_map().values()):
            self._selector.unregister(key.fileobj)
            assert isinstance(key.fileobj, socket.socket)
            key.fileobj.close()
        self._clients.clear()

    def wait_for_clients(self) -> None:
        """Until every receiver has had one."""
        while len(self._met) < len(self._words):
            self._attend(None)

    def play(self, events: Iterable[Event], speed: float = 1.0, sent: Sent | None = None) -> None:
        """Send bursts, `speed` times as fast as they were measured, to whoever is connected. Returns when the last byte is on its way."""
        began_ns: int | None = None
        first_ns = 0
        bursts = (event for event in events if isinstance(event, RawBytes))
        for epoch_ns, group in groupby(bursts, key=lambda burst: burst.mono_ns):
            together = list(group)
            if began_ns is None:
                began_ns, first_ns = time.monotonic_ns(), epoch_ns
            self._attend_until(began_ns + round((epoch_ns - first_ns) / speed))
            for burst in together:
                for client in [c for c in self._clients if c.receiver == burst.receiver]:
                    self._send(client, burst.data)
                if sent is not None:
                    sent(burst.receiver, epoch_ns, time.monotonic_ns())
            for burst in together:
                self._remember_words(burst)
        self._send_what_waits()

    def _attend_until(self, deadline_ns: int) -> None:
        """At least once, so that clients come and go even where the deadline has passed."""
        while True:
            left_ns = deadline_ns - time.monotonic_ns()
            self._attend(max(left_ns, 0) / NS_PER_S)
            if time.monotonic_ns() >= deadline_ns:
                return

    def _attend(self, timeout_s: float | None) -> None:
        """Whoever comes, goes, or can take more."""
        for key, ready in self._selector.select(timeout_s):
            assert isinstance(key.fileobj, socket.socket)
            if isinstance(key.data, str):
                self._welcome(key.fileobj, key.data)
            elif ready & selectors.EVENT_READ and not _listened(key.fileobj):
                self._drop(key.data)
            elif ready & selectors.EVENT_WRITE:
                self._send(key.data, b"")

    def _welcome(self, listener: socket.socket, receiver: str) -> None:
        """A client that comes late first gets the navigation words that it has missed."""
        try:
            connection, _ = listener.accept()
        except OSError:
            return  # gone already
        connection.setblocking(False)
        connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        client = _Client(receiver, connection)
        self._selector.register(connection, selectors.EVENT_READ, client)
        self._clients.append(client)
        self._met.add(receiver)
        self._send(client, b"".join(words for _, words in self._words[receiver]))

    def _send(self, client: _Client, data: bytes) -> None:
        """What the system takes now; the rest when it takes more. A client that takes too little, or is gone, is dropped."""
        client.waiting += data
        if not client.waiting:
            return
        try:
            del client.waiting[: client.connection.send(client.waiting)]
        except BlockingIOError:
            pass
        except OSError:
            self._drop(client)
            return
        if len(client.waiting) > MOST_WAITING_BYTES:
            self._drop(client)
            return
        wanted = selectors.EVENT_READ | (selectors.EVENT_WRITE if client.waiting else 0)
        if self._selector.get_key(client.connection).events != wanted:
            self._selector.modify(client.connection, wanted, client)

    def _drop(self, client: _Client) -> None:
        self._selector.unregister(client.connection)
        client.connection.close()
        self._clients.remove(client)

    def _remember_words(self, burst: RawBytes) -> None:
        words = self._words[burst.receiver]
        frames = Framer().feed(burst.data)
        words.append((burst.mono_ns, b"".join(frame_bytes(*frame) for frame in frames if frame[:2] == RXM_SFRBX)))
        while words[0][0] <= burst.mono_ns - WORDS_KEPT_NS:
            words.popleft()

    def _send_what_waits(self) -> None:
        deadline_ns = time.monotonic_ns() + round(LAST_BYTES_WITHIN_S * NS_PER_S)
        while any(client.waiting for client in self._clients) and time.monotonic_ns() < deadline_ns:
            self._attend(0.1)


def _listener(receiver: str, host: str, port: int) -> socket.socket:
    try:
        listener = socket.create_server((host, port), family=socket.AF_INET6 if ":" in host else socket.AF_INET)
    except OSError as error:
        why = str(error.strerror or error).partition(" (while")[0]  # the address stands before it
        raise LinkError(
            f"cannot serve receiver {receiver} at {host}:{port}: {why}; end what listens there, or serve at another address or port "
            "(port 0: free ones)"
        ) from None
    listener.setblocking(False)
    return listener


def _listened(connection: socket.socket) -> bool:
    """Take what a client sends; False where it has gone."""
    try:
        return bool(connection.recv(1 << 16))
    except BlockingIOError:
        return True
    except OSError:
        return False
