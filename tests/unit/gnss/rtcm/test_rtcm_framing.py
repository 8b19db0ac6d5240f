"""RTCM 3 frames. The example frame is that of RTCM 10403.3, section 4; CRCs are compared with a division bit by bit."""

import pytest

from integrity.gnss.crc import CRC24Q_POLYNOMIAL, LOOP_BYTES, PIECE_BYTES, crc24q
from integrity.gnss.rtcm.framing import MOST_PENDING_BYTES, RtcmFramer, frame_bytes, message_number
from integrity.gnss.rtcm.station import AntennaPosition, encode_position, position_of

EXAMPLE = bytes.fromhex("D300133ED7D30202980EDEEF34B4BD62AC0941986F33360B98")
SOUND = frame_bytes(b"\x3e\xd0sound")


def crc_by_division(data: bytes) -> int:
    value = int.from_bytes(data, "big") << 24
    for bit in reversed(range(24, 8 * len(data) + 24)):
        if value >> bit & 1:
            value ^= CRC24Q_POLYNOMIAL << bit - 24
    return value


def assert_same(found: AntennaPosition | None, expected: AntennaPosition) -> None:
    """To the rounding of 0.1 mm times a number."""
    assert found is not None
    assert (found.station, found.real) == (expected.station, expected.real)
    assert (found.x_m, found.y_m, found.z_m) == pytest.approx((expected.x_m, expected.y_m, expected.z_m), abs=1e-8)
    assert found.height_m == (None if expected.height_m is None else pytest.approx(expected.height_m, abs=1e-8))


def test_the_example_of_the_standard() -> None:
    framer = RtcmFramer()
    (message,) = framer.feed(EXAMPLE)
    assert message_number(message) == 1005
    assert_same(position_of(message), AntennaPosition(2003, True, 1114104.5999, -4850729.7108, 3975521.4643, None))
    assert frame_bytes(message) == EXAMPLE
    assert (framer.bad_frames, framer.skipped_bytes, framer.pending) == (0, 0, b"")


@pytest.mark.parametrize("height_m", [None, 0.0, 1.5, 6.5535])
def test_positions_come_back(height_m: float | None) -> None:
    sent = AntennaPosition(17, False, -3962108.6731, 3381309.5742, 3668678.6383, height_m)
    assert_same(position_of(encode_position(sent)), sent)


def test_a_position_cut_short_is_none() -> None:
    assert position_of(encode_position(AntennaPosition(1, True, 1.0, 2.0, 3.0, 1.5))[:-1]) is None


@pytest.mark.parametrize(
    "size", [0, 1, 2, 3, LOOP_BYTES, LOOP_BYTES + 1, PIECE_BYTES - 1, PIECE_BYTES, PIECE_BYTES + 1, 2 * PIECE_BYTES, 2 * PIECE_BYTES + 2]
)
def test_crc_is_the_remainder_of_a_division(size: int) -> None:
    data = bytes(i * i * 7 + 3 & 0xFF for i in range(size))
    assert crc24q(data) == crc_by_division(data)
    assert crc24q(data + crc24q(data).to_bytes(3, "big")) == 0


@pytest.mark.parametrize("size", [0, 1, 1023])
def test_messages_of_any_length(size: int) -> None:
    message = bytes(i & 0xFF for i in range(size))
    assert RtcmFramer().feed(frame_bytes(message)) == [message]


def test_a_message_too_long_for_a_frame() -> None:
    with pytest.raises(ValueError, match="1024 bytes"):
        frame_bytes(bytes(1024))


def test_a_message_too_short_for_a_number() -> None:
    assert [message_number(message) for message in (b"", b"\x3e", b"\x3e\xd0")] == [None, None, 1005]


@pytest.mark.parametrize(
    "noise", [b"\xd3", b"\xd3\xd3", b"\xd3\x03", b"\xd3\x03\xff", b"\xd3\x04\x00", b"$GPGGA\r\n", b"\xd3\x00\x08" + b"\xd3" * 9]
)
def test_noise_before_a_frame_loses_no_frame(noise: bytes) -> None:
    framer = RtcmFramer()
    found = framer.feed(noise + SOUND + bytes(MOST_PENDING_BYTES))
    assert found == [SOUND[3:-3]]
    assert framer.skipped_bytes == len(noise) + MOST_PENDING_BYTES
    assert framer.bad_frames == noise.count(0xD3)


def test_a_frame_inside_a_broken_one_is_found() -> None:
    outside = bytearray(frame_bytes(b"\x43\x50" + SOUND))
    outside[-1] ^= 1
    assert RtcmFramer().feed(bytes(outside)) == [SOUND[3:-3]]


def test_a_preamble_with_reserved_bits_is_refused_before_its_length_has_come() -> None:
    framer = RtcmFramer()
    assert framer.feed(b"\xd3\x04") == []
    assert (framer.pending, framer.bad_frames, framer.skipped_bytes) == (b"", 1, 2)


def test_a_new_framer_goes_on_with_what_is_pending() -> None:
    framer = RtcmFramer()
    assert framer.feed(SOUND[:5]) == []
    assert RtcmFramer(framer.pending).feed(SOUND[5:]) == [SOUND[3:-3]]
