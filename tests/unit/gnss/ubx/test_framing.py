"""Frames out of a byte stream; expected checksums are computed by hand, byte by byte."""

import pytest

from integrity.gnss.ubx.framing import MOST_PAYLOAD_BYTES, MOST_PENDING_BYTES, PIECE_BYTES, Frame, Framer, fletcher, frame_bytes

# ACK-ACK of CFG-MSG: class 05, id 01, two bytes 06 01.
# a: 05 06 08 08 0E 0F; b: 05 0B 13 1B 29 38.
ACK = bytes.fromhex("b562 0501 0200 0601 0f38")
ACK_FRAME = Frame(0x05, 0x01, b"\x06\x01")
NMEA = b"$GNGGA,042500.00,4533.1,N,07336.9,W,1,12,0.6,45.0,M,-32.0,M,,*5C\r\n"


def test_a_frame_is_built_as_the_description_says() -> None:
    assert frame_bytes(0x05, 0x01, b"\x06\x01") == ACK


def test_the_checksum_wraps_at_256() -> None:
    # 300 times 255: a = 300 * 255 mod 256 = 212; b = 255 * 300 * 301 / 2 mod 256 = 162
    assert fletcher(b"\xff" * 300) == (212, 162)


def test_a_payload_that_no_frame_holds_is_refused() -> None:
    with pytest.raises(ValueError, match="8193 bytes; a frame holds at most 8192"):
        frame_bytes(0x0A, 0x99, bytes(MOST_PAYLOAD_BYTES + 1))


def test_frames_come_out_between_other_protocols() -> None:
    framer = Framer()
    assert framer.feed(NMEA + ACK + b"\xd3\x00\x04abcdefg" + ACK + ACK + NMEA) == [ACK_FRAME] * 3
    assert (framer.bad_frames, framer.skipped_bytes, framer.pending) == (0, 2 * len(NMEA) + 10, b"")


def test_the_longest_payload_comes_out() -> None:
    payload = bytes(range(256)) * 32
    framer = Framer()
    assert framer.feed(frame_bytes(0x0A, 0x99, payload)) == [Frame(0x0A, 0x99, payload)]


def test_a_longer_length_is_refused_at_the_header() -> None:
    framer = Framer()
    framer.feed(bytes.fromhex("b562 0a99 0120"))  # 0x2001
    assert (framer.bad_frames, framer.pending) == (1, b"")


@pytest.mark.parametrize("at", [2, 3, 6, 7, 8, 9], ids=["class", "id", "payload", "payload_end", "ck_a", "ck_b"])
def test_a_changed_byte_is_noticed_and_costs_no_other_frame(at: int) -> None:
    bad = bytearray(ACK)
    bad[at] ^= 0x40
    framer = Framer()
    assert framer.feed(bytes(bad) + ACK) == [ACK_FRAME]
    assert (framer.bad_frames, framer.skipped_bytes) == (1, len(ACK))


def test_a_corrupt_length_delays_a_sound_frame_and_does_not_swallow_it() -> None:
    bad = bytes.fromhex("b562 0a99 6400") + bytes(10)  # announces 100 bytes
    framer = Framer()
    assert framer.feed(bad + ACK) == []
    assert framer.feed(bytes(91 - len(ACK))) == []  # one byte short of the announced end
    assert framer.feed(bytes(1)) == [ACK_FRAME]


@pytest.mark.parametrize(
    ("start", "whole"),
    [
        ("b562 0107 5b00", 6),  # NAV-PVT of 91 bytes
        ("b562 0103 1100", 6),  # NAV-STATUS of 17
        ("b562 0215 1100", 6),  # RXM-RAWX of 17: no count of measurements gives it
        ("b562 0215 5000 0000000000000000 0000 00 03", 18),  # RXM-RAWX of 80 bytes with 3 measurements, not 2
        ("b562 0213 3000 0005 0000 09", 11),  # RXM-SFRBX of 48 bytes with 9 words, not 10
        ("b562 0a38 3400 00 01", 8),  # MON-RF of 52 bytes with 1 block, not 2
    ],
    ids=["pvt", "status", "rawx_length", "rawx_count", "sfrbx_count", "rf_count"],
)
def test_what_contradicts_a_known_message_is_refused_as_soon_as_it_is_seen(start: str, whole: int) -> None:
    data = bytes.fromhex(start)
    framer = Framer()
    framer.feed(data[: whole - 1])
    assert framer.bad_frames == 0
    framer.feed(data[whole - 1 :])
    assert framer.bad_frames == 1


def test_a_request_for_a_known_message_is_a_frame() -> None:
    assert Framer().feed(frame_bytes(0x02, 0x15, b"")) == [Frame(0x02, 0x15, b"")]


def test_half_a_sync_waits_for_its_other_half() -> None:
    framer = Framer()
    assert framer.feed(b"\x00\xb5") == []
    assert (framer.pending, framer.skipped_bytes) == (b"\xb5", 1)
    assert framer.feed(ACK[1:]) == [ACK_FRAME]


def test_a_framer_goes_on_from_the_pending_bytes_of_another() -> None:
    first = Framer()
    first.feed(ACK + ACK[:7])
    assert Framer(first.pending).feed(ACK[7:]) == [ACK_FRAME]


def test_pending_is_bounded() -> None:
    framer = Framer()
    framer.feed(bytes.fromhex("b562 0a99 0020") + bytes(MOST_PENDING_BYTES - 6))
    assert len(framer.pending) == MOST_PENDING_BYTES
    framer.feed(b"\x01")
    assert framer.pending == b""


def test_frames_across_the_pieces_of_a_long_buffer_come_out() -> None:
    one = Frame(0x0A, 0x99, bytes(997))
    count = 3 * PIECE_BYTES // 1005
    framer = Framer()
    assert framer.feed(frame_bytes(*one) * count) == [one] * count
    assert (framer.skipped_bytes, framer.pending) == (0, b"")
