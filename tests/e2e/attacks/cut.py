"""A wire that fails: a TCP proxy on loopback between a train and whoever it dials. It knows nothing of Zenoh, it sees bytes.

A cut holds back what is on its way, in both directions, and what is dialled meanwhile, as a path does that loses every packet: TCP sends
all of it again when there is a path, and nobody is told. What waits for too long fills the sender's buffers.
"""

import random
import socket
import threading
import time
from contextlib import suppress
from queue import Full, Queue

PIECE_BYTES = 1 << 16
MOST_PIECES = 16  # on their way in one direction: 1 MiB, then nothing is read any more
FLIP_SEED = 1
LOOK_EVERY_S = 0.1  # whether it is over

Pieces = Queue[tuple[float, bytes]]


class Wire:
    """From `endpoint`, which is to be dialled, to `upstream` (both `tcp/127.0.0.1:PORT`). By `with`."""

    def __init__(self, upstream: str) -> None:
        self._upstream = int(upstream.rpartition(":")[2])
        self._server = socket.create_server(("127.0.0.1", 0))
        self.endpoint = f"tcp/127.0.0.1:{self._server.getsockname()[1]}"
        self.delay_s = 0.0  # of every byte, in each direction
        self.flip_every = 0  # one bit of every so many pieces that come down; 0: none
        self._up, self._down = threading.Event(), threading.Event()  # set: open
        self.mend()
        self._ended = False
        self._sockets: list[socket.socket] = []
        self._random = random.Random(FLIP_SEED)
        self._pieces_down = 0

    def __enter__(self) -> "Wire":
        threading.Thread(target=self._serve, daemon=True).start()
        return self

    def __exit__(self, *_: object) -> None:
        self._ended = True
        self.mend()
        self._server.close()
        for end in self._sockets:
            _shut(end)

    def cut(self) -> None:
        """Nothing gets through from now on."""
        self._up.clear()
        self._down.clear()

    def stall(self) -> None:
        """Nothing comes down from now on; what goes up arrives, so that those above believe that somebody is there."""
        self._down.clear()

    def mend(self) -> None:
        """Everything that waits goes on."""
        self._up.set()
        self._down.set()

    def _serve(self) -> None:
        with suppress(OSError):
            while True:
                caller, _ = self._server.accept()
                self._sockets.append(caller)
                threading.Thread(target=self._connect, args=(caller,), daemon=True).start()

    def _connect(self, caller: socket.socket) -> None:
        self._up.wait()
        try:
            called = socket.create_connection(("127.0.0.1", self._upstream))
        except OSError:
            caller.close()
            return
        self._sockets.append(called)
        for end in (caller, called):
            end.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        for source, sink, is_open in ((caller, called, self._up), (called, caller, self._down)):
            pieces: Pieces = Queue(MOST_PIECES)
            threading.Thread(target=self._read, args=(source, pieces, is_open is self._down), daemon=True).start()
            threading.Thread(target=self._write, args=(sink, pieces, is_open), daemon=True).start()

    def _read(self, source: socket.socket, pieces: Pieces, down: bool) -> None:
        data = b"?"
        while data:
            try:
                data = source.recv(PIECE_BYTES)
            except OSError:
                data = b""
            if down:
                data = self._flipped(data)
            item = (time.monotonic() + self.delay_s, data)
            while not self._ended:
                with suppress(Full):
                    pieces.put(item, timeout=LOOK_EVERY_S)
                    break

    def _write(self, sink: socket.socket, pieces: Pieces, is_open: threading.Event) -> None:
        """Until the other end has closed, or this one has."""
        with suppress(OSError):
            while True:
                due_s, data = pieces.get()
                time.sleep(max(0.0, due_s - time.monotonic()))
                is_open.wait()
                if not data:
                    break
                sink.sendall(data)
        _shut(sink)

    def _flipped(self, data: bytes) -> bytes:
        self._pieces_down += 1
        if not (self.flip_every and data) or self._pieces_down % self.flip_every:
            return data
        at = self._random.randrange(len(data))
        return data[:at] + bytes([data[at] ^ 1 << self._random.randrange(8)]) + data[at + 1 :]


def _shut(end: socket.socket) -> None:
    with suppress(OSError):
        end.shutdown(socket.SHUT_RDWR)
    end.close()
