"""Words of hand-made RXM-SFRB payloads, against the words that RXM-SFRBX would have."""

import struct

import pytest

from integrity.gnss.crc import crc24q
from integrity.gnss.navigation.lnav import HEAD, subframe_of
from integrity.gnss.ubx.rxm_sfrb import decode_sfrb
from integrity.gnss.ubx.sfrbx import NavigationWords
from recordings.simulate.navigation_words import subframe_words

MESSAGE = HEAD.message({"preamble": 0x8B, "next_tow_count": 4711, "subframe": 3}) | 0x5A3C_96E1_0F7B << 30
AS_SFRBX = subframe_words(MESSAGE)


def sfrb(sv: int, words: tuple[int, ...]) -> bytes:
    return struct.pack("<BB10I", 7, sv, *words)


def data_bits(words: tuple[int, ...], above: int = 0) -> tuple[int, ...]:
    """Without parity, with anything above."""
    return tuple(word >> 6 & 0xFFFFFF | above << 24 for word in words)


@pytest.mark.parametrize("above", [0x00, 0xFF, 0xA5])
def test_a_subframe_gets_the_words_that_it_was_sent_with(above: int) -> None:
    assert decode_sfrb(sfrb(5, data_bits(AS_SFRBX, above))) == NavigationWords("G05", "1C", AS_SFRBX)


def test_the_words_are_a_subframe() -> None:
    words = decode_sfrb(sfrb(193, data_bits(AS_SFRBX)))
    assert words is not None
    assert (words.satellite, subframe_of(words.words)) == ("J01", subframe_of(AS_SFRBX))


def sbas_block() -> bytes:
    """250 bits: preamble 53, type 2, a pattern, and the CRC, at the end of 32 bytes."""
    data = 0x53 << 218 | 2 << 212 | 0x123_4567_89AB_CDEF << 40
    return (data << 24 | crc24q(data.to_bytes(29, "big"))).to_bytes(32, "big")


@pytest.mark.parametrize("above", [0x00, 0x3F, 0x15])
def test_an_sbas_message_stands_as_in_sfrbx(above: int) -> None:
    block = int.from_bytes(sbas_block(), "big")
    words = tuple(block >> 218 - 32 * i & 0xFFFFFFFF for i in range(7))
    decoded = decode_sfrb(sfrb(129, (*words, block & 0x3FFFFFF | above << 26, 99, 98)))
    assert decoded == NavigationWords("S29", "1C", struct.unpack(">8I", (block << 6).to_bytes(32, "big")))


@pytest.mark.parametrize(
    "payload",
    [
        b"",
        sfrb(5, data_bits(AS_SFRBX))[:-1],
        sfrb(5, data_bits(AS_SFRBX)) + b"\0",
        sfrb(0, data_bits(AS_SFRBX)),
        sfrb(65, data_bits(AS_SFRBX)),
    ],
    ids=["empty", "short", "long", "no_satellite", "glonass"],
)
def test_what_is_no_words(payload: bytes) -> None:
    assert decode_sfrb(payload) is None
