"""What the listeners hand to the thread that decides: one queue, bounded, in the order of arrival."""

import time
from collections import Counter
from collections.abc import Mapping
from queue import Empty, SimpleQueue
from threading import BoundedSemaphore
from typing import Generic, TypeVar

from integrity.events import RawBytes

MOST_PIECES = 4096  # over a minute of three receivers at 10 Hz
FILE_PIECE_BYTES = 4096  # a file is read far faster than time passes: in small pieces,
FILE_PIECES = 4  # and so few of them ahead, that the files of three receivers stay together


E = TypeVar("E")


class Inbox(Generic[E]):
    """Of bytes of receivers and events E: any thread puts, one takes. What does not fit is dropped and counted, and told to who decides.

    `shares`: how many pieces of a sender may wait at most, where strangers speak through it: what others bring shall not wait for theirs.
    """

    def __init__(self, most_pieces: int = MOST_PIECES, shares: Mapping[str, int] | None = None) -> None:
        self._queue: SimpleQueue[tuple[str, E | RawBytes] | None] = SimpleQueue()
        self._most_pieces = most_pieces
        self._shares = {sender: BoundedSemaphore(most) for sender, most in (shares or {}).items()}
        self._dropped: Counter[str] = Counter()
        self._told: Counter[str] = Counter()
        self._room: dict[str, BoundedSemaphore] = {}
        self._closed = False

    def put(self, receiver: str, mono_ns: int, data: bytes) -> None:
        """Bytes as read at `mono_ns`. Never waits."""
        self.put_event(receiver, RawBytes(mono_ns, receiver, data))

    def put_event(self, sender: str, event: E | RawBytes) -> None:
        """What a sender brings. Never waits."""
        share = self._shares.get(sender)
        if self._queue.qsize() >= self._most_pieces or (share is not None and not share.acquire(blocking=False)):
            self._dropped[sender] += 1
        else:
            self._queue.put((sender, event))

    def put_of_file(self, receiver: str, mono_ns: int, data: bytes) -> None:
        """For a source that can wait: waits until there is room."""
        room = self._room.setdefault(receiver, BoundedSemaphore(FILE_PIECES))
        for begin in range(0, len(data), FILE_PIECE_BYTES):
            while not room.acquire(timeout=0.1):
                if self._closed:
                    return
            self._queue.put((receiver, RawBytes(time.monotonic_ns(), receiver, data[begin : begin + FILE_PIECE_BYTES])))

    def take(self, until_mono_ns: int) -> E | RawBytes | None:
        """The next piece; None if none has come by then, or when woken."""
        try:
            taken = self._queue.get(timeout=max(0.0, (until_mono_ns - time.monotonic_ns()) / 1e9))
        except Empty:
            return None
        if taken is None:
            return None
        sender, piece = taken
        for room in (self._room.get(sender), self._shares.get(sender)):
            if room is not None:
                room.release()
        return piece

    def dropped(self) -> dict[str, int]:
        """Pieces dropped since this was asked last, by receiver."""
        now = Counter(self._dropped)
        new = now - self._told
        self._told = now
        return dict(new)

    def wake(self) -> None:
        """End the wait of `take`; safe in a signal handler."""
        self._queue.put(None)

    def close(self) -> None:
        """Nobody takes any more."""
        self._closed = True
