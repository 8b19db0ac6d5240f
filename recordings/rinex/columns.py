"""Numbers in fixed columns, F14.3 and the two digits after them, many at once.

A field of 16 bytes is two words of eight, and all its bytes are worked on at the same time: digits become numbers by three
multiplications a word. What the columns hold is checked as strictly as by the expression ` *-?[0-9]*[.][0-9]{3}` for the whole of the
14 columns, and the number is the one that Python reads in them, to the last bit: at most thirteen digits, divided once.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from integrity.gnss.observations import Bools, Floats, Ints

Bytes = NDArray[np.uint8]
Words = NDArray[np.uint64]

FIELD_BYTES = 16
FIELDS_PER_SLICE = 16_384  # what is left behind on the way stays in the cache

_LITTLE = np.dtype("<u8")
_ALL = np.uint64(0xFFFF_FFFF_FFFF_FFFF)
_SPACES = np.uint64(0x2020_2020_2020_2020)
_SIX = np.uint64(0x0000_FFFF_FFFF_FFFF)  # columns 8 to 13 in the second word
_HIGH = np.uint64(0x8080_8080_8080_8080)
_ZEROS = np.uint64(0x3030_3030_3030_3030)
_ZEROS_AND_POINT = np.uint64(0x0000_3030_302E_3030)  # "00.000"
_BEYOND_9 = np.uint64(0x7676_7676_7676_7676)  # carries what is greater than nine into the high bit,
_BEYOND_9_AND_0 = np.uint64(0x0000_7676_767F_7676)  # and in the column of the point whatever is not the point
_SPACE = np.uint64(0x1010_1010_1010_1010)  # a space, once "0" is taken from it
_MINUS = np.uint64(0x0D0D_0D0D_0D0D_0D0D)  # a minus, once a space is taken from that
_TWO = np.uint64(0xFFFF)  # columns 8 and 9 in the second word
_BLANK_SECOND = np.uint64(0x0000_1010_100E_1010)

_PAIRS, _IN_PAIRS = np.uint64(1 + (10 << 8)), np.uint64(0x00FF_00FF_00FF_00FF)
_FOURS, _IN_FOURS = np.uint64(1 + (100 << 16)), np.uint64(0x0000_FFFF_0000_FFFF)
_EIGHTS = np.uint64(1 + (10_000 << 32))
_THREES, _SIXES = np.uint64(1 + (10 << 16)), np.uint64(1 + (1000 << 32))  # the same across the point
_U1, _U7, _U8, _U16, _U32, _U48 = (np.uint64(n) for n in (1, 7, 8, 16, 32, 48))

# The bytes of a word that are within a line of which 0 to 16 bytes of the field are left: first and second word.
_WITHIN = np.array([[(1 << 8 * min(8, max(0, n - first))) - 1 for n in range(FIELD_BYTES + 1)] for first in (0, 8)], dtype=np.uint64)


class Fields(NamedTuple):
    """Numbers, NaN where there is none; where the columns hold something else than a number or blanks; the byte that follows them."""

    value: Floats
    wrong: Bools
    indicator: Bytes

    def columns(self, which: slice) -> "Fields":
        """Views of some of the fields of records (n, k)."""
        return Fields(self.value[:, which], self.wrong[:, which], self.indicator[:, which])


def read_fields(data: Bytes, start: Ints, left: Ints, out: Fields) -> None:
    """Read fields that stand side by side in `data` from `start` (n,) on into arrays (n, k), of lines of which `left` (n,) bytes are there.

    Beyond the end of a line are blanks. `data` must go on for k fields beyond every start. Zero is "not measured": NaN.
    """
    n, n_fields = out.value.shape
    width = FIELD_BYTES * n_fields
    anywhere = np.ndarray((len(data) - width + 1,), np.dtype(f"V{width}"), data, 0, (1,))
    begins = FIELD_BYTES * np.arange(n_fields)
    step = max(1, FIELDS_PER_SLICE // n_fields)
    for first in range(0, n, step):
        few = slice(first, first + step)
        words = anywhere[start[few]].view(_LITTLE).reshape(-1, n_fields, 2)
        head, tail = np.ascontiguousarray(words[..., 0]), np.ascontiguousarray(words[..., 1])
        if left[few].min() < width:
            within = _WITHIN[:, np.clip(left[few][:, None] - begins, 0, FIELD_BYTES)]
            head, tail = ((word & inside) | (_SPACES & ~inside) for word, inside in zip((head, tail), within, strict=True))
        out.value[few], out.wrong[few] = _numbers(head, tail)
        out.indicator[few] = tail >> _U48


def _numbers(head: Words, tail: Words) -> tuple[Floats, Bools]:
    """Values and what is wrong. Columns 0 to 7 are the bytes of `head`, the first the lowest; 8 to 13 are in `tail`, 10 is the point."""
    a = head ^ _ZEROS
    b = (tail & _SIX) ^ _ZEROS_AND_POINT
    # Bytes that are no digit, as masks of whole bytes: they must be the first ones.
    no_a = (((a + _BEYOND_9 | a) & _HIGH) >> _U7) * np.uint64(0xFF)
    no_b = (((b + _BEYOND_9_AND_0 | b) & _HIGH) >> _U7) * np.uint64(0xFF)
    odd_a, odd_b = (a ^ _SPACE) & no_a, (b ^ _SPACE) & no_b  # zero where all of them are spaces
    minus_a, minus_b = (no_a ^ no_a >> _U8) & _MINUS, (no_b ^ no_b >> _U8) & _MINUS  # where the last of them is a minus
    more_b = no_b != 0
    is_odd_a, is_odd_b = odd_a != 0, odd_b != 0
    wrong = (no_a & (no_a + _U1)) != 0
    wrong |= (no_b & (no_b + _U1)) != 0
    wrong |= no_b > _TWO
    wrong |= more_b & (no_a != _ALL)
    wrong |= is_odd_a & ((odd_a != minus_a) | more_b)
    wrong |= is_odd_b & (odd_b != minus_b)
    wrong &= ~((head == _SPACES) & (b == _BLANK_SECOND))

    a &= ~no_a
    a = (a * _PAIRS >> _U8) & _IN_PAIRS
    a = (a * _FOURS >> _U16) & _IN_FOURS
    a = a * _EIGHTS >> _U32
    b &= ~no_b
    b = (b * _PAIRS >> _U8) & _IN_PAIRS
    b = (b * _THREES >> _U16) & _IN_FOURS
    b = b * _SIXES >> _U32  # the five digits of columns 8, 9, 11, 12, 13, and a zero
    value: Floats = (a * np.uint64(1_000_000) + b).astype(np.float64)
    value /= 10_000.0
    np.negative(value, out=value, where=is_odd_a | is_odd_b)
    value[(value == 0.0) | wrong] = np.nan
    return value, wrong


def whole_numbers(data: Bytes, start: Ints, end: Ints, most_digits: int) -> tuple[NDArray[np.int64], Bools]:
    """Whole numbers that stand from `start` to `end` in `data`, with a minus or none, and where there is one of `most_digits` at most.

    `data` must begin FIELD_BYTES before every end; up to 16 digits.
    """
    anywhere = np.ndarray((len(data) - FIELD_BYTES + 1,), np.dtype(f"V{FIELD_BYTES}"), data, 0, (1,))
    words = anywhere[end - FIELD_BYTES].view(_LITTLE).reshape(*end.shape, 2)
    negative = data[start] == ord("-")
    digits = end - start - negative
    outside = _WITHIN[:, np.clip(FIELD_BYTES - digits, 0, FIELD_BYTES)]
    values, odd = [], np.zeros(end.shape, dtype=np.uint64)
    for k in (0, 1):
        word = (words[..., k] ^ _ZEROS) & ~outside[k]
        odd |= (word + _BEYOND_9 | word) & _HIGH
        word = (word * _PAIRS >> _U8) & _IN_PAIRS
        word = (word * _FOURS >> _U16) & _IN_FOURS
        values.append(word * _EIGHTS >> _U32)
    number = (values[0] * np.uint64(10**8) + values[1]).astype(np.int64)
    return np.where(negative, -number, number), (odd == 0) & (digits >= 1) & (digits <= most_digits)
