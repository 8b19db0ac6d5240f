"""What must hold of a framer, whatever the bytes: frames that nobody touched are found, in order; cuts change nothing; little is kept."""

from bisect import bisect_left
from collections.abc import Callable, Sequence
from random import Random
from typing import Any, Protocol

from tests.fuzz.mutations import cuts
from tests.fuzz.target import Piece


class AnyFramer(Protocol):
    """`UbxFramer` or `RtcmFramer`."""

    bad_frames: int
    skipped_bytes: int

    @property
    def pending(self) -> bytes: ...

    def feed(self, data: bytes) -> Sequence[Any]: ...


def assert_framed(
    pieces: Sequence[Piece],
    rng: Random,
    new_framer: Callable[[bytes], AnyFramer],
    raw: Callable[[Any], bytes],
    is_sound: Callable[[bytes], bool],
    most_pending: int,
) -> list[Any]:
    """The frames of the pieces; `raw` gives the bytes of one. Zeros at the end complete whatever a corrupt length still waits for."""
    stream = b"".join(piece.data for piece in pieces) + bytes(most_pending)
    at_once, framer = new_framer(b""), new_framer(b"")
    found: list[Any] = []
    for part in cuts(rng, stream):
        found += framer.feed(part)
        assert len(framer.pending) <= most_pending
        if rng.random() < 0.05:  # one that begins with what is pending goes on as if nothing had been
            framer, before = new_framer(framer.pending), framer
            framer.bad_frames, framer.skipped_bytes = before.bad_frames, before.skipped_bytes
    assert list(at_once.feed(stream)) == found
    assert (framer.pending, framer.bad_frames, framer.skipped_bytes) == (b"", at_once.bad_frames, at_once.skipped_bytes)
    assert framer.skipped_bytes + sum(len(raw(frame)) for frame in found) == len(stream)
    _assert_nothing_untouched_is_lost(pieces, [raw(frame) for frame in found], stream, is_sound)
    return found


def _assert_nothing_untouched_is_lost(
    pieces: Sequence[Piece], found: list[bytes], stream: bytes, is_sound: Callable[[bytes], bool]
) -> None:
    """Damage may happen to be a sound frame that reaches into an untouched one: accepted only where brute force finds it."""
    ends: dict[int, int] = {}
    at = 0
    for frame in found:
        begin = stream.find(frame, at)
        assert begin >= at, "a frame that does not stand in the stream"
        at = begin + len(frame)
        ends[begin] = at
    begins, at = list(ends), 0
    for data, untouched in pieces:
        if untouched and ends.get(at) != at + len(data):
            before = begins[bisect_left(begins, at) - 1]
            assert before < at < ends[before], f"the frame at byte {at} is lost and nothing reaches into it"
            assert is_sound(stream[before : ends[before]])
        at += len(data)
