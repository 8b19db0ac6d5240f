"""Frames of a whole log at once, against a `Framer` that is fed the same bytes."""

import numpy as np
import pytest

from integrity.gnss.ubx.framing import MOST_PAYLOAD_BYTES, Framer, frame_bytes
from integrity.gnss.ubx.located import PIECE_BYTES, Located, locate

ACK = bytes.fromhex("b562 0501 0200 0601 0f38")
NMEA = b"$GNGGA,042500.00,4533.1,N,07336.9,W,1,12,0.6,45.0,M,-32.0,M,,*5C\r\n"
WITH_ACK_INSIDE = frame_bytes(0x0A, 0x99, b"\1\2" + ACK + b"\3")
BAD = WITH_ACK_INSIDE[:-1] + bytes((WITH_ACK_INSIDE[-1] ^ 1,))
LONGEST = frame_bytes(0x0A, 0x99, bytes(range(256)) * 32)
OPEN = bytes.fromhex("b562 0a99 6400") + bytes(10)  # announces 100 bytes


def rawx(size: int, count: int) -> bytes:
    """RXM-RAWX, of 16 bytes and 32 for each measurement, with sound checksums whatever its size."""
    return frame_bytes(0x02, 0x15, (bytes(11) + bytes((count,)) + bytes(size))[:size])


LOGS = {
    "nothing": b"",
    "one byte": b"\xb5",
    "frames between other protocols": NMEA + ACK + b"\xd3\x00\x04abcdefg" + ACK + ACK + NMEA,
    "a frame in a frame": WITH_ACK_INSIDE + ACK,
    "a frame in a damaged frame": BAD + ACK,
    "a frame that reaches into another": frame_bytes(0x0A, 0x99, ACK[:4]) + ACK,
    "a payload of 8193 bytes": bytes.fromhex("b562 0a99 0120") + ACK + bytes(9000),
    "a count that is the length": rawx(80, 2) + ACK,
    "a count that contradicts the length": rawx(80, 3) + ACK,
    "an open frame whose count contradicts its length": rawx(80, 3)[:60] + ACK,
    "a length that no count gives": rawx(85, 2) + ACK,
    "a length shorter than the message": rawx(8, 0) + ACK,
    "a length shorter than the message at the end": ACK + rawx(8, 0),
    "a length shorter than the message, and no more": ACK + bytes.fromhex("b562 0213 0400"),
    "a length that a message never has": frame_bytes(0x01, 0x07, bytes(91)) + ACK,
    "a request": frame_bytes(0x02, 0x15, b"") + ACK,
    "an open frame with frames in it": ACK + OPEN + ACK + ACK,
    "a frame with an open one in it": frame_bytes(0x0A, 0x99, OPEN) + ACK,
    "an open count": ACK + bytes.fromhex("b562 0215 5000 00"),
    "an open length": ACK + bytes.fromhex("b562 02"),
    "half a sync": ACK + b"\0\xb5",
    "a frame that ends in half a sync": frame_bytes(0x0A, 0x99, bytes.fromhex("f8 01")) + b"\xb5",
    "longest frames": LONGEST * 3 + ACK,
    "longer than a piece": (WITH_ACK_INSIDE + NMEA) * (2 * PIECE_BYTES // 90),
    "a sync across two pieces": bytes(PIECE_BYTES - 1) + ACK + bytes(PIECE_BYTES - len(ACK) - 1) + ACK,
}


def located(log: bytes) -> Located:
    return locate(np.frombuffer(log, np.uint8))


@pytest.mark.parametrize("log", LOGS)
def test_the_frames_are_those_of_a_framer(log: str) -> None:
    framer = Framer()
    expected = [frame_bytes(*frame) for frame in framer.feed(LOGS[log])]
    found = located(LOGS[log])
    assert [LOGS[log][begin:end] for begin, end in zip(found.begin, found.end, strict=True)] == expected


@pytest.mark.parametrize("log", LOGS)
def test_the_counters_are_those_of_a_framer(log: str) -> None:
    framer, found = Framer(), located(LOGS[log])
    framer.feed(LOGS[log])
    assert (found.bad_frames, found.skipped_bytes, LOGS[log][found.decided_bytes :]) == (
        framer.bad_frames,
        framer.skipped_bytes,
        framer.pending,
    )


def test_the_message_is_told() -> None:
    assert located(ACK + WITH_ACK_INSIDE).kind.tolist() == [0x0501, 0x0A99]


@pytest.mark.parametrize("size", [0, 1, 255, 256, 257, MOST_PAYLOAD_BYTES])
def test_checksums_of_frames_of_any_length_are_taken(size: int) -> None:
    payload = (b"\xff\xfe\x80" * MOST_PAYLOAD_BYTES)[:size]
    frame = frame_bytes(0x0A, 0x99, payload)
    wrong = [frame[:-2] + bytes((frame[-2] ^ 1, frame[-1])), frame[:-1] + bytes((frame[-1] ^ 0x80,))]
    assert [len(located(b"?" + log).begin) for log in (frame, *wrong)] == [1, 0, 0]
