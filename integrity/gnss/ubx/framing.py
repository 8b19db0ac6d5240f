"""UBX frames out of a byte stream in which NMEA, RTCM and noise may stand between them.

A frame is sync B5 62, class, id, length of the payload (u2, little endian), payload, and a checksum over class to payload: 8-bit
Fletcher (RFC 1145). Source: u-blox F9 HPG 1.51 interface description, "UBX frame structure" and the message tables; older lengths:
u-blox 8 / M8 and u-blox 6 protocol specifications.

What is not a sound frame is searched again from the byte after its sync, so that a corrupt length swallows no sound frame. At most
it delays them: until as many bytes have come as it announces. Messages of a known length are therefore refused as soon as their
header, and where there is one their count of blocks, contradicts it.

Every decision is taken as soon as the bytes it needs are there and depends on these bytes alone. So the frames and counters do not
depend on how the stream was cut.
"""

import struct
from typing import NamedTuple

import numpy as np

SYNC = b"\xb5\x62"
MOST_PAYLOAD_BYTES = 8192  # the longest that u-blox receivers send; RXM-RAWX with 255 measurements has 8176
HEADER_BYTES = 6
FRAME_BYTES = 8  # of a frame around its payload
MOST_PENDING_BYTES = FRAME_BYTES + MOST_PAYLOAD_BYTES - 1
PIECE_BYTES = 1 << 16  # the running sums of a piece stay in the cache


class Counted(NamedTuple):
    """A payload of `fixed` bytes, and `block` bytes as often as the byte at `count_at` says."""

    fixed: int
    block: int
    count_at: int


FIXED: dict[tuple[int, int], tuple[int, ...]] = {
    (0x01, 0x03): (16,),  # NAV-STATUS
    (0x01, 0x07): (92, 84),  # NAV-PVT; 84 in u-blox 7
    (0x02, 0x11): (42,),  # RXM-SFRB, u-blox 7 and before
    (0x0A, 0x09): (60, 68),  # MON-HW; 68 in u-blox 6
}
COUNTED: dict[tuple[int, int], Counted] = {
    (0x01, 0x35): Counted(8, 12, 5),  # NAV-SAT
    (0x01, 0x43): Counted(8, 16, 5),  # NAV-SIG
    (0x02, 0x10): Counted(8, 24, 6),  # RXM-RAW, u-blox 7 and before
    (0x02, 0x13): Counted(8, 4, 4),  # RXM-SFRBX
    (0x02, 0x15): Counted(16, 32, 11),  # RXM-RAWX
    (0x0A, 0x31): Counted(4, 272, 1),  # MON-SPAN
    (0x0A, 0x38): Counted(4, 24, 1),  # MON-RF
}
# What a header (class, id, length) is checked against: the allowed lengths, and where the count stands.
_ALLOWED: dict[tuple[int, int], frozenset[int]] = {key: frozenset((0, *lengths)) for key, lengths in FIXED.items()} | {
    key: frozenset((0, *range(c.fixed, MOST_PAYLOAD_BYTES + 1, c.block))) for key, c in COUNTED.items()
}  # 0: somebody asks for the message

_header = struct.Struct("<BBH").unpack_from


class Frame(NamedTuple):
    """A message whose checksum was right; its payload has 0 to 8192 bytes."""

    message_class: int
    message_id: int
    payload: bytes


class Framer:
    """Takes bytes as they come, gives the sound frames in order. `pending` is all that it remembers besides its counters.

    `bad_frames` counts syncs whose length or checksum was wrong, `skipped_bytes` bytes that stand in no sound frame.
    """

    def __init__(self, pending: bytes = b"") -> None:
        self._pending = pending
        self.bad_frames = 0
        self.skipped_bytes = 0

    @property
    def pending(self) -> bytes:
        """The bytes that are not decided yet, at most `MOST_PENDING_BYTES`: a new framer that starts with them goes on as this one."""
        return self._pending

    def feed(self, data: bytes) -> list[Frame]:
        """The frames that these bytes complete. Any bytes are fine; nothing is raised."""
        if len(data) <= PIECE_BYTES:
            return self._piece(data)
        frames: list[Frame] = []
        for begin in range(0, len(data), PIECE_BYTES):
            frames += self._piece(data[begin : begin + PIECE_BYTES])
        return frames

    def _piece(self, data: bytes) -> list[Frame]:
        buffer = self._pending + data
        size = len(buffer)
        frames: list[Frame] = []
        sum_a = sum_b = b""
        at = 0
        while True:
            sync = buffer.find(SYNC, at)
            if sync < 0:
                sync = size - 1 if size > at and buffer[-1] == SYNC[0] else size
                self.skipped_bytes += sync - at
                break
            self.skipped_bytes += sync - at
            at = sync
            end = _end_of_payload(buffer, sync, size)
            if end is None:
                break
            if end and end + 2 > size:
                break
            if end:
                if not sum_a:
                    sum_a, sum_b = _running_sums(buffer)
                begin = sync + 2
                before = sum_a[begin - 1]
                if (
                    buffer[end] == (sum_a[end - 1] - before) & 0xFF
                    and buffer[end + 1] == (sum_b[end - 1] - sum_b[begin - 1] - (end - begin) * before) & 0xFF
                ):
                    frames.append(Frame(buffer[begin], buffer[begin + 1], buffer[sync + HEADER_BYTES : end]))
                    at = end + 2
                    continue
            self.bad_frames += 1
            self.skipped_bytes += len(SYNC)
            at = sync + len(SYNC)
        self._pending = buffer[sync:]
        return frames


def _end_of_payload(buffer: bytes, sync: int, size: int) -> int | None:
    """Where the payload ends that begins after this sync; 0 where its length is wrong, None where too few bytes are there to say."""
    if size - sync < HEADER_BYTES:
        return None
    message_class, message_id, length = _header(buffer, sync + 2)
    payload = sync + HEADER_BYTES
    if length > MOST_PAYLOAD_BYTES:
        return 0
    allowed = _ALLOWED.get((message_class, message_id))
    if allowed is not None:
        if length not in allowed:
            return 0
        counted = COUNTED.get((message_class, message_id))
        if counted is not None and length:
            if size <= payload + counted.count_at:
                return None
            if length != counted.fixed + counted.block * buffer[payload + counted.count_at]:
                return 0
    return int(payload + length)


def _running_sums(buffer: bytes) -> tuple[bytes, bytes]:
    """Sums modulo 256 of the bytes up to each, and of these sums: the checksum of any stretch follows from its two ends."""
    sum_a = np.add.accumulate(np.frombuffer(buffer, np.uint8), dtype=np.uint8)
    return sum_a.tobytes(), np.add.accumulate(sum_a, dtype=np.uint8).tobytes()


def fletcher(data: bytes) -> tuple[int, int]:
    """The two checksum bytes over class, id, length and payload."""
    if not data:
        return 0, 0
    sum_a, sum_b = _running_sums(data)
    return sum_a[-1], sum_b[-1]


def frame_bytes(message_class: int, message_id: int, payload: bytes) -> bytes:
    """A whole frame, sync to checksum; ValueError for a payload that no frame can hold."""
    if len(payload) > MOST_PAYLOAD_BYTES:
        raise ValueError(f"UBX payload of {len(payload)} bytes; a frame holds at most {MOST_PAYLOAD_BYTES}: send less")
    body = struct.pack("<BBH", message_class, message_id, len(payload)) + payload
    return SYNC + body + bytes(fletcher(body))
