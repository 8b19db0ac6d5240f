"""Navigation messages as whole numbers, and tables of where in them a value stands: one table reads and writes a message.

Bits count from 0 at the first one sent. A field may stand in several parts; its value is an integer times `unit`.
"""

import math
from collections.abc import Mapping
from typing import NamedTuple

SEMICIRCLE_RAD = math.pi
HEARD_AT_ONCE = 512  # messages of all satellites in view: every receiver of a site hears the same ones


class Part(NamedTuple):
    """Consecutive bits of a message."""

    first: int
    bits: int


class Field(NamedTuple):
    """Where a value stands, most significant part first, and the unit of its last bit (None: a number as it is, no quantity).

    `signed`: by two's complement; `sign_bit`: one bit for the sign, then the magnitude.
    """

    parts: tuple[Part, ...]
    unit: float | None = None
    signed: bool = False
    sign_bit: bool = False

    @property
    def bits(self) -> int:
        """Of all parts together."""
        return sum(part.bits for part in self.parts)

    def range(self) -> tuple[int, int]:
        """The least and the greatest integer that fit."""
        if self.signed or self.sign_bit:
            most = (1 << self.bits - 1) - 1
            return (-most if self.sign_bit else -most - 1), most
        return 0, (1 << self.bits) - 1


class Layout(NamedTuple):
    """A message of `bits` bits and its named fields."""

    bits: int
    fields: Mapping[str, Field]

    def integer(self, message: int, name: str) -> int:
        """The bits of a field as an integer, with the sign that the field gives it."""
        field = self.fields[name]
        value = bits = 0
        for part in field.parts:
            value = value << part.bits | message >> self.bits - part.first - part.bits & (1 << part.bits) - 1
            bits += part.bits
        if not (field.signed or field.sign_bit) or not value >> bits - 1:
            return value
        return (1 << bits - 1) - value if field.sign_bit else value - (1 << bits)

    def mask(self, *names: str) -> int:
        """Ones where these fields stand."""
        ones = 0
        for part in (part for name in names for part in self.fields[name].parts):
            ones |= (1 << part.bits) - 1 << self.bits - part.first - part.bits
        return ones

    def quantities(self, message: int) -> dict[str, float]:
        """Every field that has a unit, in the units of `Ephemeris`."""
        return {name: self.integer(message, name) * field.unit for name, field in self.fields.items() if field.unit is not None}

    def message(self, values: Mapping[str, float]) -> int:
        """The message with these values, quantities rounded to their units, and zeros elsewhere; ValueError for one that does not fit."""
        message = 0
        for name, value in values.items():
            field = self.fields[name]
            number = round(value if field.unit is None else value / field.unit)
            low, high = field.range()
            if not low <= number <= high or (field.unit is None and number != value):
                raise ValueError(
                    f"{name} = {value!r} does not fit its {field.bits} bits, which hold {low} to {high} times {field.unit or 1}"
                )
            if field.sign_bit and number < 0:
                number = (1 << field.bits - 1) - number
            for part in reversed(field.parts):
                message |= (number & (1 << part.bits) - 1) << self.bits - part.first - part.bits
                number >>= part.bits
        return message


def in_order(*fields: tuple[str, Field]) -> Layout:
    """A layout of fields that follow each other without a gap."""
    placed, first = {}, 0
    for name, field in fields:
        placed[name] = field._replace(parts=(Part(first, field.bits),))
        first += field.bits
    return Layout(first, placed)


def plain(bits: int, unit: float | None = None) -> Field:
    """An unsigned field at the beginning of a message, for `in_order`."""
    return Field((Part(0, bits),), unit)


def signed(bits: int, unit: float) -> Field:
    """A field by two's complement at the beginning of a message, for `in_order`."""
    return Field((Part(0, bits),), unit, signed=True)


def sign_and_magnitude(bits: int, unit: float) -> Field:
    """A field with a sign bit at the beginning of a message, for `in_order`."""
    return Field((Part(0, bits),), unit, sign_bit=True)


def nearest_ns(time_ns: int, reference_ns: int, period_ns: int) -> int:
    """The time nearest to the reference of those that differ from `time_ns` by whole periods: for times sent as a remainder."""
    return time_ns + (reference_ns - time_ns + period_ns // 2) // period_ns * period_ns
