"""The queue between listeners and the thread that decides."""

import threading
import time

from integrity.events import RawBytes
from recordings.sources.inbox import FILE_PIECE_BYTES, FILE_PIECES, Inbox

SOON_NS = 5_000_000_000


def take(inbox: Inbox[RawBytes]) -> RawBytes | None:
    return inbox.take(time.monotonic_ns() + SOON_NS)


def test_pieces_come_in_the_order_of_arrival() -> None:
    inbox = Inbox[RawBytes]()
    pieces = [RawBytes(1, "A", b"a"), RawBytes(2, "B", b"b"), RawBytes(3, "A", b"c")]
    for piece in pieces:
        inbox.put(piece.receiver, piece.mono_ns, piece.data)
    assert [take(inbox) for _ in pieces] == pieces


def test_what_does_not_fit_is_dropped_and_counted_once() -> None:
    inbox = Inbox[RawBytes](most_pieces=2)
    for k in range(5):
        inbox.put("A" if k < 4 else "B", k, b"")
    assert (inbox.dropped(), inbox.dropped()) == ({"A": 2, "B": 1}, {})


def test_there_is_room_again() -> None:
    inbox = Inbox[RawBytes](most_pieces=1)
    for k in range(3):
        inbox.put("A", k, b"")
        assert take(inbox) is not None
    assert inbox.dropped() == {}


def test_a_wait_ends_at_its_time() -> None:
    assert Inbox[RawBytes]().take(time.monotonic_ns() - 1) is None


def test_a_wait_ends_when_woken() -> None:
    inbox = Inbox[RawBytes]()
    threading.Timer(0.05, inbox.wake).start()
    assert take(inbox) is None


def test_a_file_is_read_no_faster_than_it_is_decided() -> None:
    inbox = Inbox[RawBytes]()
    data = bytes(range(256)) * (10 * FILE_PIECE_BYTES // 256)
    reader = threading.Thread(target=inbox.put_of_file, args=("A", 0, data))
    reader.start()
    first = [take(inbox)]
    reader.join(0.3)
    assert reader.is_alive()  # FILE_PIECES more are waiting, and no more than that
    while (piece := inbox.take(time.monotonic_ns() + 300_000_000)) is not None:
        first.append(piece)
    reader.join()
    assert b"".join(piece.data for piece in first if piece) == data


def test_a_closed_inbox_lets_the_reader_of_a_file_go() -> None:
    inbox = Inbox[RawBytes]()
    reader = threading.Thread(target=inbox.put_of_file, args=("A", 0, bytes((FILE_PIECES + 2) * FILE_PIECE_BYTES)))
    reader.start()
    inbox.close()
    reader.join(2.0)
    assert not reader.is_alive()


def test_a_sender_with_a_share_leaves_room_for_others() -> None:
    inbox = Inbox[RawBytes](shares={"air": 2})
    for sender in ("air", "air", "air", "A"):
        inbox.put(sender, 1, sender.encode())
    assert ([take(inbox).data for _ in range(3)], inbox.dropped()) == ([b"air", b"air", b"A"], {"air": 1})  # type: ignore[union-attr]


def test_what_was_taken_makes_room_in_the_share() -> None:
    inbox = Inbox[RawBytes](shares={"air": 1})
    for n in range(5):
        inbox.put("air", n, b"")
        assert take(inbox) is not None
    assert inbox.dropped() == {}


def test_what_the_whole_inbox_has_no_room_for_takes_nothing_of_the_share() -> None:
    inbox = Inbox[RawBytes](most_pieces=1, shares={"air": 1})
    inbox.put("A", 1, b"")
    inbox.put("air", 1, b"")
    assert (take(inbox) is not None, inbox.dropped()) == (True, {"air": 1})
    inbox.put("air", 2, b"")
    assert take(inbox) is not None
