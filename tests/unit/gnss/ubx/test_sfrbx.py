"""Navigation words of hand-made RXM-SFRBX payloads."""

import struct

import pytest

from integrity.gnss.ubx.sfrbx import NavigationWords, decode_sfrbx


def sfrbx(gnss_id: int, sv_id: int, sig_id: int, words: int, version: int = 2, freq_id: int = 0) -> bytes:
    header = struct.pack("<8B", gnss_id, sv_id, sig_id, freq_id, words, 0, version, 0)
    return header + struct.pack(f"<{words}I", *(0x8B000000 + i for i in range(words)))


def test_words_stand_as_in_the_message() -> None:
    payload = bytes.fromhex("0005 0000 0a17 0200") + bytes.fromhex("0100c022") + bytes(32) + bytes.fromhex("ffffffff")
    assert decode_sfrbx(payload) == NavigationWords("G05", "1C", (0x22C00001, *[0] * 8, 0xFFFFFFFF))


@pytest.mark.parametrize(
    ("payload", "satellite", "signal"),
    [
        (sfrbx(0, 32, 0, 10), "G32", "1C"),
        (sfrbx(0, 1, 0, 10, version=1), "G01", "1C"),
        (sfrbx(2, 36, 1, 8), "E36", "1B"),
        (sfrbx(2, 1, 5, 8), "E01", "7I"),
        (sfrbx(2, 3, 0, 8, version=1), "E03", "1B"),
        (sfrbx(2, 3, 0, 8), "E03", "1B"),
        (sfrbx(2, 3, 3, 8), "E03", "5I"),
        (sfrbx(3, 63, 0, 10), "C63", "2I"),
        (sfrbx(3, 1, 1, 10), "C01", "2I"),
        (sfrbx(3, 6, 2, 10), "C06", "7I"),
        (sfrbx(3, 5, 3, 10), "C05", "7I"),
        (sfrbx(3, 6, 4, 10), "C06", "6I"),
        (sfrbx(3, 59, 10, 10), "C59", "6I"),
        (sfrbx(5, 1, 0, 10), "J01", "1C"),
        (sfrbx(5, 10, 0, 10), "J10", "1C"),
        (sfrbx(6, 24, 0, 4), "R24", "1C"),
        (sfrbx(6, 1, 2, 4), "R01", "2C"),
        (sfrbx(1, 129, 0, 8), "S29", "1C"),
    ],
    ids=[
        "gps", "gps_v1", "e1b", "e5b", "e1b_without_sig_id_v1", "e1b_without_sig_id_v2", "e5a", "b1i", "b1i_d2", "b2i", "b2i_d2",
        "b3i", "b3i_d2", "qzss", "qzss_last", "l1of", "l2of", "sbas",
    ],
)  # fmt: skip
def test_signals_that_carry_what_is_needed(payload: bytes, satellite: str, signal: str) -> None:
    decoded = decode_sfrbx(payload)
    assert decoded is not None
    assert (decoded.satellite, decoded.signal) == (satellite, signal)


@pytest.mark.parametrize(("freq_id", "channel"), [(0, -7), (7, 0), (13, 6), (14, None), (255, None)])
def test_the_channel_of_glonass_is_in_the_header(freq_id: int, channel: int | None) -> None:
    decoded = decode_sfrbx(sfrbx(6, 5, 0, 4, freq_id=freq_id))
    assert decoded is not None
    assert decoded.channel == channel


def test_other_systems_have_no_channel() -> None:
    assert decode_sfrbx(sfrbx(0, 5, 0, 10, freq_id=3)) == NavigationWords("G05", "1C", tuple(0x8B000000 + i for i in range(10)), None)


@pytest.mark.parametrize(
    "payload",
    [
        b"",
        sfrbx(0, 5, 0, 10)[:7],
        sfrbx(0, 5, 0, 10)[:-1],
        sfrbx(0, 5, 0, 10) + b"\0",
        sfrbx(0, 5, 0, 9),
        sfrbx(2, 5, 1, 9),
        sfrbx(0, 0, 0, 10),
        sfrbx(0, 33, 0, 10),
        sfrbx(2, 37, 1, 8),
        sfrbx(0, 5, 4, 10),
        sfrbx(0, 5, 6, 10),
        sfrbx(2, 5, 3, 9),
        sfrbx(2, 5, 4, 8),
        sfrbx(2, 5, 8, 16),
        sfrbx(3, 0, 0, 10),
        sfrbx(3, 64, 0, 10),
        sfrbx(3, 22, 6, 10),
        sfrbx(3, 22, 8, 10),
        sfrbx(5, 11, 0, 10),
        sfrbx(5, 2, 1, 9),
        sfrbx(6, 255, 0, 4),
        sfrbx(6, 5, 0, 5),
        sfrbx(1, 119, 0, 8),
        sfrbx(1, 131, 0, 7),
        sfrbx(7, 5, 0, 10),
        sfrbx(0, 5, 0, 10, version=3),
    ],
    ids=[
        "empty", "no_header", "short", "long", "gps_9_words", "galileo_9_words", "g00", "g33", "e37", "l2cm", "l5", "e5a_9_words",
        "e5a_pilot", "e6b", "c00", "c64", "b1c", "b2a", "j11", "l1s", "glonass_unknown", "glonass_5_words", "sbas_119", "sbas_7_words",
        "navic", "unknown_version",
    ],
)  # fmt: skip
def test_anything_else_is_none(payload: bytes) -> None:
    assert decode_sfrbx(payload) is None
