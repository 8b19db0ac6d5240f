"""Navigation words of hand-made RXM-SFRBX payloads."""

import struct

import pytest

from integrity.gnss.ubx.sfrbx import NavigationWords, decode_sfrbx


def sfrbx(gnss_id: int, sv_id: int, sig_id: int, words: int, version: int = 2) -> bytes:
    header = struct.pack("<8B", gnss_id, sv_id, sig_id, 0, words, 0, version, 0)
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
    ],
    ids=["gps", "gps_v1", "e1b", "e5b", "e1b_without_sig_id_v1", "e1b_without_sig_id_v2"],
)
def test_signals_that_carry_what_is_needed(payload: bytes, satellite: str, signal: str) -> None:
    decoded = decode_sfrbx(payload)
    assert decoded is not None
    assert (decoded.satellite, decoded.signal) == (satellite, signal)


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
        sfrbx(2, 5, 3, 8),
        sfrbx(1, 131, 0, 8),
        sfrbx(6, 5, 0, 4),
        sfrbx(0, 5, 0, 10, version=3),
    ],
    ids=[
        "empty", "no_header", "short", "long", "gps_9_words", "galileo_9_words", "g00", "g33", "e37", "l2cm", "e5a", "sbas", "glonass",
        "unknown_version",
    ],
)  # fmt: skip
def test_anything_else_is_none(payload: bytes) -> None:
    assert decode_sfrbx(payload) is None
