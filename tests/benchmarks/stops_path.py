"""The way between a train and its station: a TCP proxy that can be cut without closing anything."""

import contextlib
import socket
import threading
import time
from enum import Enum


class Passage(Enum):
    """What happens to bytes, and to who dials. While it is cut, neither a new connection nor the end of an old one gets through."""

    OPEN = "open"
    STANDING = "cut: what is under way waits where it is, and goes on afterwards"
    LOSING = "cut: what is under way is lost, and so are the connections afterwards"
    REFUSING = "connections go on, new ones are refused: nobody is there"


CUT = (Passage.STANDING, Passage.LOSING)


class Path:
    """From `address` to a TCP server that need not be there yet."""

    def __init__(self, upstream: tuple[str, int]) -> None:
        self._upstream = upstream
        self._server = socket.create_server(("127.0.0.1", 0))
        self.address: tuple[str, int] = self._server.getsockname()
        self._passage = Passage.OPEN
        self._changed = threading.Condition()
        self._ends: set[socket.socket] = set()

    def __enter__(self) -> "Path":
        threading.Thread(target=self._serve, daemon=True).start()
        return self

    def __exit__(self, *_: object) -> None:
        self.become(Passage.REFUSING)
        _shut(self._server)
        self._server.close()
        with self._changed:
            self._end_all()

    def become(self, passage: Passage) -> int:
        """From now on; the moment on the monotonic clock, ns. After the moment of a cut no byte has been passed on."""
        with self._changed:
            if self._passage is Passage.LOSING:
                self._end_all()
            self._passage = passage
            self._changed.notify_all()
            return time.monotonic_ns()

    def _serve(self) -> None:
        with contextlib.suppress(OSError):
            while True:
                client, _ = self._server.accept()
                self._connect(client)

    def _connect(self, client: socket.socket) -> None:
        self._wait_while(*CUT)
        try:
            if self._passage is Passage.REFUSING:
                raise ConnectionRefusedError
            station = socket.create_connection(self._upstream)
        except OSError:
            client.close()
            return
        pair = (client, station)
        for end in pair:
            end.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        with self._changed:
            self._ends.update(pair)
        for source, sink in (pair, pair[::-1]):
            threading.Thread(target=self._forward, args=(source, sink), daemon=True).start()

    def _forward(self, source: socket.socket, sink: socket.socket) -> None:
        """Until the source ends; then both do. Each thread closes the end that it alone reads."""
        with contextlib.suppress(OSError):
            while data := source.recv(1 << 16):
                with self._changed:
                    self._changed.wait_for(lambda: self._passage is not Passage.STANDING)
                    if self._passage is not Passage.LOSING:
                        sink.sendall(data)
        self._wait_while(*CUT)
        with self._changed:
            self._ends -= {source, sink}
        _shut(source)
        _shut(sink)
        source.close()

    def _wait_while(self, *passages: Passage) -> None:
        with self._changed:
            self._changed.wait_for(lambda: self._passage not in passages)

    def _end_all(self) -> None:
        for end in tuple(self._ends):
            _shut(end)


def _shut(end: socket.socket) -> None:
    """Both directions: whoever waits for it in another thread wakes up."""
    with contextlib.suppress(OSError):
        end.shutdown(socket.SHUT_RDWR)
