"""Damage: to bytes, to fields of a bit table, to the order of frames. Nothing here knows a checksum: who calls redoes it."""

import struct
from collections.abc import Sequence
from random import Random
from typing import TypeVar

from integrity.gnss.navigation.bits import Layout

_T = TypeVar("_T")
FILLS = (b"\x00", b"\xff", b"\x7f", b"\x80", b"\x01", b"\xaa")
# Numbers as they stand in binary messages: no numbers at all, beyond any, about nothing, and a signalling NaN.
ODD_DOUBLES = [struct.pack("<d", x) for x in (float("nan"), float("inf"), float("-inf"), 0.0, -0.0, 5e-324, 1e300, -1e300, 1e7, 4e7, 5.5e7)]
ODD_DOUBLES += [struct.pack("<Q", 0x7FF0000000000001), struct.pack("<Q", 0xFFF4000000000000)]
ODD_FLOATS = [struct.pack("<f", x) for x in (float("nan"), float("inf"), float("-inf"), 0.0, -0.0, 1e38, 3e4, -3e4)]
ODD_FLOATS += [struct.pack("<I", 0x7F800001)]


def damaged(rng: Random, data: bytes, often: int = 3) -> bytes:
    """Bytes changed in one to `often` ways."""
    for _ in range(rng.randint(1, often)):
        data = rng.choice(WAYS)(rng, data)
    return data


def stretch(rng: Random, size: int, most: int = 40) -> tuple[int, int]:
    """Where a run of places begins and ends, perhaps at once."""
    begin = rng.randint(0, size)
    return begin, min(size, begin + rng.randint(0, most))


def bits_flipped(rng: Random, data: bytes) -> bytes:
    found = bytearray(data)
    for _ in range(rng.choice((1, 1, 2, 3, 8)) if data else 0):
        found[rng.randrange(len(found))] ^= 1 << rng.randrange(8)
    return bytes(found)


def cut(rng: Random, data: bytes) -> bytes:
    place = rng.randint(0, len(data))
    return data[:place] if rng.random() < 0.7 else data[place:]


def with_less(rng: Random, data: bytes) -> bytes:
    begin, end = stretch(rng, len(data))
    return data[:begin] + data[end:]


def with_more(rng: Random, data: bytes) -> bytes:
    place, n = rng.randint(0, len(data)), rng.choice((1, 1, 2, 4, 30, 300))
    return data[:place] + (rng.randbytes(n) if rng.random() < 0.5 else rng.choice(FILLS) * n) + data[place:]


def doubled(rng: Random, data: bytes) -> bytes:
    begin, end = stretch(rng, len(data))
    return data[:end] + data[begin:]


def swapped(rng: Random, data: bytes) -> bytes:
    a, b, c, d = sorted(rng.randint(0, len(data)) for _ in range(4))
    return data[:a] + data[c:d] + data[b:c] + data[a:b] + data[d:]


def filled(rng: Random, data: bytes) -> bytes:
    begin, end = stretch(rng, len(data), 12)
    return data[:begin] + rng.choice(FILLS) * (end - begin) + data[end:]


WAYS = (bits_flipped, bits_flipped, cut, with_less, with_more, doubled, swapped, filled)


def with_extremes(rng: Random, layout: Layout, message: int, kept: Sequence[str] = ()) -> int:
    """A message with one to three of its fields, but for those `kept`, at an end of their range, beside it, or anything."""
    names = [name for name in layout.fields if name not in kept]
    for name in rng.sample(names, min(len(names), rng.randint(1, 3))):
        field = layout.fields[name]
        low, high = field.range()
        number = rng.choice((low, high, low + 1, high - 1, 0, min(1, high), max(low, -1), rng.randint(low, high)))
        message = message & ~layout.mask(name) | layout.message({name: number * (field.unit or 1)})
    return message


def random_message(rng: Random, layout: Layout, kept: Sequence[str], message: int) -> int:
    """A message of chance, but for the fields that are `kept`."""
    keep = layout.mask(*kept)
    return message & keep | rng.getrandbits(layout.bits) & ~keep


def in_other_order(rng: Random, pieces: list[_T]) -> list[_T]:
    """Most often as it is; else with runs of pieces repeated, left out or in another place."""
    for _ in range(rng.choice((0, 0, 1, 3))):
        begin, end = stretch(rng, len(pieces), max(1, len(pieces) // 4))
        taken = pieces[begin:end]
        what = rng.randrange(3)
        if what:
            pieces = pieces[:begin] + pieces[end:]
        if what < 2:
            place = rng.randint(0, len(pieces))
            pieces = pieces[:place] + taken + pieces[place:]
    return pieces


def cuts(rng: Random, data: bytes, most: int = 3000) -> list[bytes]:
    """The same bytes in pieces of up to `most` bytes, some empty."""
    found, at = [], 0
    while at < len(data):
        size = rng.choice((0, 1, 2, 3, rng.randint(1, 60), rng.randint(1, most)))
        found.append(data[at : at + size])
        at += size
    return found
