"""The numbers and digits of Compact RINEX for many epochs at once: from differences back to what was measured, and to text.

A line has a field for each type, a difference or `order&value`, and behind them what has changed of the two digits after each number.
Fields are laid out as (epochs, satellites x types): a sum along the epochs undoes a difference, as many times as the order says.
Source: Hatanaka (2008), A Compression Format and Tools for GNSS Observation Data, Bulletin of the GSI 55.
"""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from integrity.gnss.observations import Bools, Ints
from recordings.rinex.columns import FIELD_BYTES, Bytes, whole_numbers

MOST_ORDER = 9
MOST_DIGITS = 15  # of a field; thirteen fit into the columns of RINEX
BLANK, STAR, MINUS, POINT, AMPERSAND = (np.uint8(ord(character)) for character in " *-.&")
NOTHING, DIFFERENCE, BEGINNING, WRONG = range(4)

_INTEGER_COLUMNS, _NUMBER_COLUMNS = 10, 14
_THREE_DIGITS = np.array([list(b"%03d" % k) for k in range(1000)], dtype=np.uint8)
_SMALLEST = 10 ** np.arange(12, 2, -1)  # number in thousandths from which on a digit stands in a column


class Records(NamedTuple):
    """Lines of `n_types` fields each, the satellites they are of and their epochs, 0 and on, in the order of the file."""

    n_types: int
    lines: list[bytes]
    names: list[bytes]
    epochs: Ints


class Known(NamedTuple):
    """What an epoch leaves behind for the next, of one satellite: by type its value and differences (MOST_ORDER, n), the order, how many
    epochs since the beginning (all where there is none: -1), and the digits (2 n,)."""

    levels: Ints
    order: Ints
    steps: Ints
    digits: Bytes


class Fields(NamedTuple):
    """Of each line and type: what stands there, its number and the order at a beginning, (N, n); what has changed of the digits (N, 2 n),
    blank where nothing has."""

    kind: Bytes
    number: Ints
    order: Ints
    change: Bytes


def expanded_records(
    records: Records, n_epochs: int, before: Mapping[bytes, Known], digits_of_blanks: bool
) -> tuple[Bytes, dict[bytes, Known]]:
    """The fields of records as they stand in RINEX (N, 16 n), and what is known of the satellites in the last epoch.

    `before`: what was known before the first. `digits_of_blanks`: whether a type without a number keeps its digits (CRINEX 3). Where
    a number cannot be known stand stars.
    """
    n = records.n_types
    fields = _fields(records.lines, n)
    satellites = {name: k for k, name in enumerate(dict.fromkeys(records.names))}
    satellite, epoch = np.array([satellites[name] for name in records.names]), records.epochs
    shape = (n_epochs, len(satellites))
    last = np.full(shape[1], -1)
    known = [before.get(name) for name in satellites]
    kind, value, levels, order, steps = _integrated(fields, epoch, satellite, known, shape, n)
    digits = _digits(fields, epoch, satellite, known, shape, n, digits_of_blanks)
    at_last = np.flatnonzero(epoch == n_epochs - 1)
    last[satellite[at_last]] = at_last
    after = {name: Known(levels[:, k], order[k], steps[k], digits[last[k]]) for name, k in satellites.items() if last[k] >= 0}
    return _text(kind, value, digits.reshape(*value.shape, 2)), after


def _fields(lines: Sequence[bytes], n: int) -> Fields:
    """Cut lines at their first n blanks; a line that ends before goes on with blanks."""
    length = np.array([len(line) for line in lines])
    data = np.frombuffer(b" " * FIELD_BYTES + (b" " * n).join(lines) + b" " * (n + 2 * n + FIELD_BYTES), dtype=np.uint8)
    begin = FIELD_BYTES + np.concatenate(([0], np.cumsum(length + n)[:-1]))
    blanks = np.flatnonzero(data == BLANK)
    end = blanks[np.searchsorted(blanks, begin)[:, None] + np.arange(n)]
    start = np.concatenate((begin[:, None], end[:, :-1] + 1), axis=1)

    begun = (end - start >= 2) & (data[start + 1] == AMPERSAND)
    order = data[start].astype(np.int64) - ord("0")
    number, whole = whole_numbers(data, start + 2 * begun, end, MOST_DIGITS)
    whole &= ~begun | ((order >= 0) & (order <= MOST_ORDER))
    kind = np.where(end == start, NOTHING, np.where(whole, np.where(begun, BEGINNING, DIFFERENCE), WRONG)).astype(np.uint8)

    first = end[:, -1:] + 1
    kind[begin + length > first[:, 0] + 2 * n] = WRONG  # longer than any record can be
    places = first + np.arange(2 * n)
    change = np.where(places < (begin + length)[:, None], data[np.minimum(places, len(data) - 1)], BLANK)
    return Fields(kind, number, order, change)


def _integrated(
    fields: Fields, epoch: Ints, satellite: Ints, known: Sequence[Known | None], shape: tuple[int, int], n: int
) -> tuple[Bytes, Ints, Ints, Ints, Ints]:
    """Of each line and type its kind and value; of each satellite at the end the levels (MOST_ORDER, S, n), order and steps (S, n)."""
    n_epochs, n_satellites = shape
    kind = np.zeros((MOST_ORDER + n_epochs, n_satellites, n), dtype=np.uint8)
    number, order = np.zeros(kind.shape, dtype=np.int64), np.zeros(kind.shape, dtype=np.int64)
    for s, one in enumerate(known):
        if one is not None:
            _begin_again(one, kind[:MOST_ORDER, s], number[:MOST_ORDER, s], order[:MOST_ORDER, s])
    at = (MOST_ORDER + epoch, satellite)
    kind[at], number[at], order[at] = fields.kind, fields.number, fields.order

    # The last event of each number: at 2 e it ended, at 2 e + 1 it began.
    row = np.arange(len(kind))[:, None, None]
    event = np.where(kind == BEGINNING, 2 * row + 1, np.where(kind == DIFFERENCE, 0, 2 * row))
    event = np.maximum.accumulate(event, axis=0)
    alive, start = event % 2 == 1, event // 2
    steps = np.where(alive, row - start, -1)
    order = np.take_along_axis(order, start, axis=0)
    levels = np.zeros((MOST_ORDER, n_satellites, n), dtype=np.int64)
    levels[0] = number[-1]
    for k in reversed(range(int(order[alive].max(initial=0)))):
        summed = (order > k) & (steps >= k)
        sums = np.cumsum(np.where(summed, number, 0), axis=0)
        before = np.take_along_axis(np.concatenate((np.zeros_like(sums[:1]), sums)), start, axis=0)
        number = np.where(summed, sums - before, number)
        levels[k] = np.where(summed[-1], number[-1], levels[k])
    kind[(kind == DIFFERENCE) & ~alive] = WRONG
    return kind[at], number[at], levels, order[-1], steps[-1]


def _begin_again(one: Known, kind: Bytes, number: Ints, order: Ints) -> None:
    """Put in front of the first epoch beginnings and differences (MOST_ORDER, n) that lead to what is known."""
    level = one.levels.copy()
    n_levels = np.maximum(1, np.minimum(one.steps + 1, one.order))
    for back in range(MOST_ORDER):
        k = n_levels - 1 - back  # the difference that stands `back` epochs before the last
        here = np.flatnonzero((one.steps >= 0) & (k >= 0))
        number[-1 - back, here] = level[k[here], here]
        kind[-1 - back, here] = np.where(k[here] == 0, BEGINNING, DIFFERENCE)
        order[-1 - back, here] = one.order[here]
        level[:-1] -= level[1:] * (np.arange(MOST_ORDER - 1)[:, None] < k)


def _digits(
    fields: Fields, epoch: Ints, satellite: Ints, known: Sequence[Known | None], shape: tuple[int, int], n: int, of_blanks: bool
) -> Bytes:
    """The digits after the numbers of each line, (N, 2 n): those of the epoch before but for what has changed."""
    n_epochs, n_satellites = shape
    stands = np.full((1 + n_epochs, n_satellites, 2 * n), BLANK, dtype=np.uint8)
    for s, one in enumerate(known):
        if one is not None:
            stands[0, s] = one.digits
    seen = np.zeros((1 + n_epochs, n_satellites), dtype=np.bool_)
    seen[0] = [one is not None for one in known]
    seen[1 + epoch, satellite] = True
    changed = np.zeros(stands.shape, dtype=np.bool_)
    changed[1:] = ~(seen[1:] & seen[:-1])[..., None]  # a satellite that was not there has no digits
    change, gone = fields.change, np.repeat((fields.kind == NOTHING) & (not of_blanks), 2, axis=1)
    at = (1 + epoch, satellite)
    stands[at] = np.where(gone | (change == AMPERSAND), BLANK, change)
    changed[at] |= (change != BLANK) | gone
    row = np.arange(1 + n_epochs)[:, None, None]
    latest = np.maximum.accumulate(np.where(changed, row, 0), axis=0)
    result: Bytes = np.take_along_axis(stands, latest, axis=0)[at]
    return result


def _text(kind: Bytes, value: Ints, digits: Bytes) -> Bytes:
    """Fields F14.3 without a zero before the point, and the two digits after them, (N, 16 n)."""
    size = np.abs(value)
    groups = []
    rest = size
    for _ in range(5):
        rest, group = np.divmod(rest, 1000)
        groups.append(_THREE_DIGITS[group])
    text = np.empty((*value.shape, FIELD_BYTES), dtype=np.uint8)
    text[..., 0] = groups[4][..., 2]
    for k, first in ((3, 1), (2, 4), (1, 7), (0, 11)):
        text[..., first : first + 3] = groups[k]
    text[..., _INTEGER_COLUMNS] = POINT
    stands: Bools = size[..., None] >= _SMALLEST
    text[..., :_INTEGER_COLUMNS][~stands] = BLANK
    negative = np.nonzero(value < 0)
    before = _INTEGER_COLUMNS - 1 - stands[negative].sum(axis=-1)
    text[(*negative, np.maximum(before, 0))] = MINUS
    too_long = (size >= 10**13) | ((value < 0) & (size >= 10**12)) | (size < 0)  # the last: what has no absolute value
    text[kind == NOTHING, :_NUMBER_COLUMNS] = BLANK
    text[(kind == WRONG) | (too_long & (kind != NOTHING)), :_NUMBER_COLUMNS] = STAR
    text[..., _NUMBER_COLUMNS:] = digits
    return text.reshape(len(text), -1)
