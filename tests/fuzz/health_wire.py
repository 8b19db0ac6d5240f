"""Protocol buffers by hand, beside the library that the code uses: fields read from bytes, and fields at their limits written to bytes.

Source: protobuf.dev, Encoding: a tag is field number << 3 | wire type, as a varint; of a field that stands several times the last counts.
"""

import struct
from collections.abc import Iterator
from random import Random
from typing import Any, NamedTuple

from google.protobuf.descriptor import FieldDescriptor
from google.protobuf.message import Message

from tests.fuzz.mutations import ODD_DOUBLES, ODD_FLOATS

VARINT, EIGHT_BYTES, LENGTH, GROUP, END_OF_GROUP, FOUR_BYTES = range(6)
MOST_NESTED = 100
MEGABYTE = 1 << 20
EDGES = (
    0,
    1,
    2,
    127,
    128,
    (1 << 31) - 1,
    1 << 31,
    (1 << 32) - 1,
    1 << 32,
    (1 << 32) + 1,
    (1 << 63) - 1,
    1 << 63,
    (1 << 64) - 2,
    (1 << 64) - 1,
)
TEXTS = (b"", b"\0", b"G05", b"G05.1C", b"?" * 15, b"?" * 16, b"?" * 17, b"\xff\xfe", b"\xed\xa0\x80", "駅".encode() * 100)
UNKNOWN_NUMBERS = (17, 18, 60, 100, 18_999, 20_000, (1 << 29) - 1)


class Field(NamedTuple):
    """As it stands: a varint's number, or the bytes of anything else; `whole` is all of it, tag included."""

    number: int
    kind: int
    value: int | bytes
    whole: bytes


class Unreadable(Exception):
    """Bytes that are no message."""


def fields_of(data: bytes) -> list[Field]:
    """All fields in their order. Raises Unreadable."""
    found, at = [], 0
    while at < len(data):
        field, end = _field(data, at, 0)
        found.append(field)
        at = end
    return found


def _field(data: bytes, at: int, depth: int) -> tuple[Field, int]:
    tag, end = _varint(data, at)
    number, kind = tag >> 3, tag & 7
    value: int | bytes = b""
    if not 1 <= number < 1 << 29 or kind > FOUR_BYTES or depth > MOST_NESTED:
        raise Unreadable(f"tag {tag}")
    if kind == VARINT:
        value, end = _varint(data, end)
    elif kind == GROUP:
        inner, end = _field(data, end, depth + 1)
        while inner.kind != END_OF_GROUP or inner.number != number:
            inner, end = _field(data, end, depth + 1)
    elif kind != END_OF_GROUP:
        size, end = _varint(data, end) if kind == LENGTH else (4 if kind == FOUR_BYTES else 8, end)
        value, end = data[end : end + size], end + size
        if end > len(data):
            raise Unreadable("cut")
    if depth == 0 and kind == END_OF_GROUP:
        raise Unreadable("the end of nothing")
    return Field(number, kind, value, data[at:end]), end


def _varint(data: bytes, at: int) -> tuple[int, int]:
    if at < len(data) and data[at] < 0x80:
        return data[at], at + 1
    number = 0
    for shift in range(0, 70, 7):
        if at >= len(data):
            raise Unreadable("cut")
        byte, at = data[at], at + 1
        number |= (byte & 0x7F) << shift
        if byte < 0x80:
            return number & (1 << 64) - 1, at
    raise Unreadable("a number of more than ten bytes")


def varint(number: int) -> bytes:
    """Of a number from 0 to 2^64 - 1."""
    found = bytearray()
    while number > 0x7F:
        found.append(number & 0x7F | 0x80)
        number >>= 7
    return bytes((*found, number))


def written(number: int, kind: int, value: int | bytes) -> bytes:
    """A field."""
    size = varint(len(value)) if kind == LENGTH and isinstance(value, bytes) else b""
    return varint(number << 3 | kind) + size + (varint(value) if isinstance(value, int) else value)


def without(data: bytes, number: int) -> bytes:
    """A message without a field."""
    return b"".join(field.whole for field in fields_of(data) if field.number != number)


def field_of(kind: type[Message], name: str) -> FieldDescriptor:
    """What the contract says of a field."""
    found: Any = kind.DESCRIPTOR.fields_by_name[name]  # of one class or another, as the library was built
    assert found.name == name
    return found  # type: ignore[no-any-return]


def limits_of(field: FieldDescriptor) -> Iterator[bytes]:
    """The field at each of its limits and beyond them, of its own wire type and of the others, short of what is large."""
    number = field.number
    match field.cpp_type:
        case FieldDescriptor.CPPTYPE_DOUBLE:
            yield from (written(number, EIGHT_BYTES, value) for value in ODD_DOUBLES)
        case FieldDescriptor.CPPTYPE_FLOAT:
            yield from (written(number, FOUR_BYTES, value) for value in ODD_FLOATS)
            yield written(number, LENGTH, b"".join(ODD_FLOATS))
        case FieldDescriptor.CPPTYPE_STRING:
            yield from (written(number, LENGTH, text) for text in TEXTS)
        case FieldDescriptor.CPPTYPE_MESSAGE:
            assert field.message_type is not None
            yield from (written(number, LENGTH, one) for inner in field.message_type.fields for one in limits_of(inner))
        case FieldDescriptor.CPPTYPE_ENUM:
            assert field.enum_type is not None
            yield from (written(number, VARINT, n) for n in range(max(v.number for v in field.enum_type.values) + 2))
    if field.type == FieldDescriptor.TYPE_FIXED32:
        yield from (written(number, FOUR_BYTES, struct.pack("<I", n)) for n in (0, 1, (1 << 32) - 1))
    yield from (written(number, VARINT, n) for n in EDGES)
    yield varint(number << 3 | VARINT) + b"\x81" + b"\x80" * 8 + b"\x00"  # 1, in as many bytes as can be
    yield written(number, EIGHT_BYTES, b"\xff" * 8)
    yield written(number, FOUR_BYTES, b"\x01\0\0\0")
    yield written(number, GROUP, b"") + written(number, END_OF_GROUP, b"")
    yield written(number, LENGTH, b"\x01")


def large_of(field: FieldDescriptor) -> Iterator[bytes]:
    """The field a megabyte long, and ten thousand times."""
    yield written(field.number, LENGTH, b"G" * MEGABYTE)
    yield 10_000 * written(field.number, LENGTH, b"G05.1C" if field.cpp_type == FieldDescriptor.CPPTYPE_STRING else b"\x0a\x06G05.1C")
    yield 10_000 * written(field.number, VARINT, 1)


def unknown(rng: Random) -> bytes:
    """A field that no version has yet."""
    kind = rng.choice((VARINT, EIGHT_BYTES, LENGTH, FOUR_BYTES))
    value = rng.choice(EDGES) if kind == VARINT else rng.randbytes({EIGHT_BYTES: 8, FOUR_BYTES: 4}.get(kind, rng.choice((0, 1, 40))))
    return written(rng.choice(UNKNOWN_NUMBERS), kind, value)


def with_limits(rng: Random, kind: type[Message], data: bytes, kept: frozenset[str]) -> bytes:
    """A message with one to three of its fields, but for those `kept`, at a limit: instead of what they were, or besides."""
    names = [name for name in kind.DESCRIPTOR.fields_by_name if name not in kept]
    for name in rng.sample(names, min(len(names), rng.randint(1, 3))):
        field = field_of(kind, name)
        ends = list(limits_of(field))
        data = data if rng.random() < 0.3 else without(data, field.number)
        data += rng.choice(ends) if rng.random() < 0.9 else b""
        data = data if rng.random() < 0.95 else data + rng.randint(1, 2000) * rng.choice(ends)
    return data
