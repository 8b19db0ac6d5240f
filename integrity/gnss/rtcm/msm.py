"""MSM, the multiple signal messages 4, 5, 6 and 7: how they are laid out, and which cells a message has.

A message is a header with masks of satellites and signals, a mask of cells (which satellite has which signal), the fields of all
satellites, and the fields of all cells; each field stands for all of them before the next one begins. A range or a carrier is the
satellite's rough range, in milliseconds of light, plus what the cell adds to it. What could not be told has a number of its own.
Source: RTCM 10403.3, 3.5.16 and table 3.5-78; data fields DF393 to DF420.
"""

from functools import lru_cache
from typing import NamedTuple

from integrity.gnss.navigation.bits import Field, Layout, Part, in_order, plain, signed
from integrity.gnss.rtcm.masks import SATELLITE_BITS, SIGNAL_BITS, SYSTEMS, bits_of, satellite_name

MOST_CELL_BITS = 64  # of satellites times signals: DF396

# `time`: ms of the GPS, Galileo or BeiDou week; of GLONASS three bits day of the week, 27 bits ms of the day, both of Moscow.
HEADER = (
    ("number", plain(12)),
    ("station", plain(12)),
    ("time", plain(30)),
    ("more", plain(1)),  # DF393: another message of the same time follows
    ("issue", plain(3)),
    ("reserved", plain(7)),
    ("clock_steering", plain(2)),
    ("external_clock", plain(2)),
    ("divergence_free", plain(1)),
    ("smoothing", plain(3)),
    ("satellites", plain(SATELLITE_BITS)),
    ("signals", plain(SIGNAL_BITS)),
)
_HEADER = in_order(*HEADER)
_READ = [  # shift and ones, as read of every message
    (_HEADER.bits - part.first - part.bits, (1 << part.bits) - 1)
    for name in ("number", "station", "time", "more", "satellites", "signals")
    for part in _HEADER.fields[name].parts
]
_HEADER_BYTES, _CELLS_BYTE, _CELLS_BYTES = 22, 21, 9  # the header ends in the first bit of byte 21, the cells at most in byte 29

WHOLE, PART = ("whole_ms", plain(8)), ("part_ms", plain(10, 2.0**-10))  # DF397, DF398
CHANNEL, RATE = ("channel", plain(4)), ("rate_mps", signed(14, 1.0))  # DF419 (extended information of other systems), DF399
_HALF, FINE_RATE = ("half_cycle", plain(1)), ("fine_rate_mps", signed(15, 1e-4))  # DF420, DF404
_SHORT = (  # DF400, DF401, DF402, DF420, DF403
    ("range_ms", signed(15, 2.0**-24)),
    ("phase_ms", signed(22, 2.0**-29)),
    ("lock", plain(4)),
    _HALF,
    ("cn0_dbhz", plain(6, 1.0)),
)
_LONG = (  # DF405, DF406, DF407, DF420, DF408
    ("range_ms", signed(20, 2.0**-29)),
    ("phase_ms", signed(24, 2.0**-31)),
    ("lock", plain(10)),
    _HALF,
    ("cn0_dbhz", plain(10, 2.0**-4)),
)
NamedFields = tuple[tuple[str, Field], ...]
SATELLITE_FIELDS: dict[int, NamedFields] = {
    4: (WHOLE, PART),
    5: (WHOLE, CHANNEL, PART, RATE),
    6: (WHOLE, PART),
    7: (WHOLE, CHANNEL, PART, RATE),
}
CELL_FIELDS: dict[int, NamedFields] = {4: _SHORT, 5: (*_SHORT, FINE_RATE), 6: _LONG, 7: (*_LONG, FINE_RATE)}
MSM_NUMBERS = frozenset(first + kind for first in SYSTEMS for kind in CELL_FIELDS)

NO_WHOLE_MS, NO_CN0, NO_CHANNEL = 255, 0, 15
CHANNELS_SENT, FIRST_CHANNEL = 14, -7


def none_of(field: Field) -> int:
    """The number by which a signed field says that it could not be told: its least."""
    return -(1 << field.bits - 1)


class Begins(NamedTuple):
    """The first bit of each field of the first satellite or cell, by name, and how many bits the whole message has."""

    first: dict[str, int]
    bits: int


def begins_of(kind: int, n_satellites: int, n_signals: int, n_cells: int) -> Begins:
    """Where the fields behind the cell mask begin."""
    first, begin = {}, _HEADER.bits + n_satellites * n_signals
    for named, count in ((SATELLITE_FIELDS[kind], n_satellites), (CELL_FIELDS[kind], n_cells)):
        for name, field in named:
            first[name] = begin
            begin += field.bits * count
    return Begins(first, begin)


def table_of(number: int, n_satellites: int, n_signals: int, n_cells: int) -> Layout:
    """A whole message: the header, `cells`, and each field with the place of its satellite or cell, from 0: `whole_ms_0`."""
    kind = number % 10
    begins = begins_of(kind, n_satellites, n_signals, n_cells)
    fields = {**_HEADER.fields, "cells": Field((Part(_HEADER.bits, n_satellites * n_signals),))}
    for named, count in ((SATELLITE_FIELDS[kind], n_satellites), (CELL_FIELDS[kind], n_cells)):
        for name, field in named:
            parts = [Part(begins.first[name] + i * field.bits, field.bits) for i in range(count)]
            fields |= {f"{name}_{i}": field._replace(parts=(part,)) for i, part in enumerate(parts)}
    return Layout(begins.bits, fields)


class Masks(NamedTuple):
    """All that tells how a message is laid out, and its size in bytes."""

    number: int
    satellites: int
    signals: int
    cells: int
    size: int

    @property
    def kind(self) -> int:
        """4 to 7."""
        return self.number % 10


class MsmHeader(NamedTuple):
    """What is read of a message at once; `signals` are the names of those of its cells that are known."""

    system: str
    station: int
    time: int
    more: bool
    masks: Masks
    signals: tuple[str, ...]


def header_of(message: bytes) -> MsmHeader | None:
    """The header of a message whose number is in `MSM_NUMBERS`; None where the masks or the length are wrong."""
    if len(message) < _HEADER_BYTES:
        return None
    head = int.from_bytes(message[:_HEADER_BYTES], "big") >> 8 * _HEADER_BYTES - _HEADER.bits
    number, station, time, more, satellites, signals = [head >> shift & ones for shift, ones in _READ]
    n_pairs = satellites.bit_count() * signals.bit_count()
    if n_pairs > MOST_CELL_BITS:
        return None
    after = int.from_bytes(message[_CELLS_BYTE : _CELLS_BYTE + _CELLS_BYTES].ljust(_CELLS_BYTES, b"\0"), "big")
    cells = after >> 8 * (_CELLS_BYTE + _CELLS_BYTES) - _HEADER.bits - n_pairs & (1 << n_pairs) - 1
    masks = Masks(number, satellites, signals, cells, len(message))
    contents = contents_of(masks)
    if 8 * len(message) < contents.begins.bits:
        return None
    return MsmHeader(SYSTEMS[number - masks.kind].letter, station, time, bool(more), masks, contents.signals)


class Contents(NamedTuple):
    """The cells of a message that are known: names, and of each the place of its satellite and its own among all."""

    signals: tuple[str, ...]
    places: tuple[tuple[int, int], ...]
    begins: Begins


@lru_cache(maxsize=512)
def contents_of(masks: Masks) -> Contents:
    """What a message with these masks holds; reserved satellites and signals are passed over."""
    system = SYSTEMS[masks.number - masks.kind]
    satellites, signals = bits_of(masks.satellites, SATELLITE_BITS), bits_of(masks.signals, SIGNAL_BITS)
    cells = [divmod(bit - 1, len(signals)) for bit in bits_of(masks.cells, len(satellites) * len(signals))]
    known = {}
    for cell, (s, k) in enumerate(cells):
        satellite, code = satellite_name(system, satellites[s]), system.codes.get(signals[k])
        if satellite is not None and code is not None:
            known[f"{satellite}.{code}"] = s, cell
    return Contents(tuple(known), tuple(known.values()), begins_of(masks.kind, len(satellites), len(signals), len(cells)))
