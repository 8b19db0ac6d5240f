"""RTCM 3 frames out of a byte stream in which anything else may stand between them.

A frame is the preamble D3, six zero bits, the length of the message in ten bits, the message, and its CRC-24Q over all before it.
Source: RTCM 10403.3, section 4 (transport layer). A message begins with its number in twelve bits; one of no bytes only fills the line.

What is not a sound frame is searched again from the byte after its preamble, so that a corrupt length swallows no sound frame. At most
it delays them: until as many bytes have come as it announces. Every decision is taken as soon as the bytes it needs are there and
depends on these bytes alone. So the messages and counters do not depend on how the stream was cut.
"""

from integrity.gnss.crc import CRC24Q_BYTES, crc24q

PREAMBLE = b"\xd3"
HEADER_BYTES = 3
MOST_MESSAGE_BYTES = 1023
MOST_PENDING_BYTES = HEADER_BYTES + MOST_MESSAGE_BYTES + CRC24Q_BYTES - 1


class RtcmFramer:
    """Takes bytes as they come, gives the messages of sound frames in order. `pending` is all that it remembers besides its counters.

    `bad_frames` counts preambles whose length or CRC was wrong, `skipped_bytes` bytes that stand in no sound frame.
    """

    def __init__(self, pending: bytes = b"") -> None:
        self._pending = pending
        self.bad_frames = 0
        self.skipped_bytes = 0

    @property
    def pending(self) -> bytes:
        """The bytes that are not decided yet, at most `MOST_PENDING_BYTES`: a new framer that starts with them goes on as this one."""
        return self._pending

    def feed(self, data: bytes) -> list[bytes]:
        """The messages, without header and CRC, whose frames end in `data`; bytes before them may have come in earlier calls."""
        buffer = self._pending + data
        size = len(buffer)
        messages: list[bytes] = []
        at = 0
        while True:
            preamble = buffer.find(PREAMBLE, at)
            if preamble < 0:
                preamble = size
            self.skipped_bytes += preamble - at
            at = preamble
            if size - at < 2:
                break
            if buffer[at + 1] <= MOST_MESSAGE_BYTES >> 8:  # the six zero bits
                if size - at < HEADER_BYTES:
                    break
                end = at + HEADER_BYTES + (buffer[at + 1] << 8 | buffer[at + 2])
                if end + CRC24Q_BYTES > size:
                    break
                if crc24q(buffer[at : end + CRC24Q_BYTES]) == 0:
                    messages.append(buffer[at + HEADER_BYTES : end])
                    at = end + CRC24Q_BYTES
                    continue
            self.bad_frames += 1
            self.skipped_bytes += 1
            at += 1
        self._pending = buffer[at:]
        return messages


def frame_bytes(message: bytes) -> bytes:
    """A whole frame, preamble to CRC; ValueError for a message that no frame can hold."""
    if len(message) > MOST_MESSAGE_BYTES:
        raise ValueError(f"RTCM message of {len(message)} bytes; a frame holds at most {MOST_MESSAGE_BYTES}: send less")
    framed = PREAMBLE + len(message).to_bytes(2, "big") + message
    return framed + crc24q(framed).to_bytes(CRC24Q_BYTES, "big")


def message_number(message: bytes) -> int | None:
    """The number in the first twelve bits; None where a message is too short to have one."""
    return message[0] << 4 | message[1] >> 4 if len(message) >= 2 else None
