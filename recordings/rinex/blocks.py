"""From records to blocks: what stands in the columns, which of it can have been measured, and its place among the signals of a block."""

from collections import Counter
from collections.abc import Iterator, Mapping
from typing import NamedTuple

import numpy as np

from integrity.gnss.observations import ROW_ARRAYS, Bools, Floats, Ints, ObservationBlock
from integrity.gnss.signals import SYSTEMS, preference, satellite_of
from recordings.rinex.columns import Fields, read_fields
from recordings.rinex.epochs import NAME_BYTES, Epochs, Text, is_name
from recordings.rinex.header import Columns, Format

EPOCHS_PER_BLOCK = 1024

# From 20,200 km (GPS in the zenith) to 42,000 km (geostationary), with a receiver clock of up to 30 ms either way.
PSEUDORANGE_MIN_M, PSEUDORANGE_MAX_M = 1.0e7, 1.0e8
CN0_MAX_DBHZ = 70.0  # the strongest signals from orbit stay below 60 dB-Hz

NUMBERS = 100  # of satellites in a system, 0 included
FIELDS_PER_LINE_2 = 5  # of RINEX 2

_SYSTEM_OF = np.full(256, -1, dtype=np.int64)
_SYSTEM_OF[[ord(letter) for letter in SYSTEMS]] = range(len(SYSTEMS))
_LOST_LOCK, _HALF_CYCLE = (np.isin(np.arange(256), [ord(digit) for digit in digits]) for digits in ("1357", "2367"))  # bits 0 and 1


class _Measured(NamedTuple):
    """What records of one system hold, an entry per range: its epoch, satellite (as a number) and signal (as a place in `Columns`)."""

    epoch: Ints
    satellite: Ints
    signal: Ints
    values: tuple[Floats, ...]  # range, carrier, Doppler, C/N0
    slip: Bools
    half_cycle: Bools


def blocks_of(receiver: str, text: Text, epochs: Epochs, of: Format, problems: Counter[str]) -> Iterator[ObservationBlock]:
    """Blocks of at most EPOCHS_PER_BLOCK epochs, in the order of the file."""
    columns = of.columns()
    for first in range(0, len(epochs.time_ns), EPOCHS_PER_BLOCK):
        few = slice(first, first + EPOCHS_PER_BLOCK)
        records = slice(*np.searchsorted(epochs.epoch, (first, first + EPOCHS_PER_BLOCK)))
        part = Epochs(
            epochs.time_ns[few], epochs.power_failed[few], epochs.epoch[records] - first, epochs.name[records], epochs.line[records]
        )
        satellite, kept = _satellites(part, of, columns, problems)
        found = {}
        for k, system in enumerate(SYSTEMS):
            mine = np.flatnonzero(satellite // NUMBERS == k)
            if len(mine):
                records_of = kept[mine]
                found[system] = _measured(
                    text, part.epoch[records_of], satellite[mine], part.line[records_of], of, columns[system], problems
                )
        yield _block(receiver, part.time_ns, part.power_failed, found, columns)


def _satellites(epochs: Epochs, of: Format, columns: Mapping[str, Columns], problems: Counter[str]) -> tuple[Ints, Ints]:
    """Satellites as numbers, NUMBERS a system, of the records (n,) that are kept: readable, of a system that is read, once an epoch."""
    letter, ten, one = epochs.name.T
    named = is_name(epochs.name)
    _count(problems, "satellite name not readable", np.count_nonzero(~named))
    of_letter = _SYSTEM_OF.copy()
    of_letter[ord(" ")] = _SYSTEM_OF[ord(of.first_system)]
    of_letter[[ord(letter) for letter in SYSTEMS if letter not in columns]] = -1
    if of.first_system not in columns:
        of_letter[ord(" ")] = -1
    system = of_letter[letter]
    kept = np.flatnonzero(named & (system >= 0))
    satellite = (NUMBERS * system + 10 * (ten & 15) + (one & 15))[kept]  # a space counts as zero
    once = _first_of_each(epochs.epoch[kept] * (NUMBERS * len(SYSTEMS)) + satellite)
    if once is None:
        return satellite, kept
    _count(problems, "satellite listed twice", np.count_nonzero(~once))
    return satellite[once], kept[once]


def _first_of_each(key: Ints) -> Bools | None:
    """Where a key stands for the first time; None where all do."""
    if (np.diff(key) > 0).all():  # as most files have it
        return None
    # Each writes its own place where its key says, the first of them last: who finds another's came later.
    place = np.arange(len(key), dtype=np.int32)
    first_place = np.empty(int(key.max()) + 1, dtype=np.int32)
    first_place[key[::-1]] = place[::-1]
    first: Bools = first_place[key] == place
    return None if first.all() else first


def _measured(text: Text, epoch: Ints, satellite: Ints, line: Ints, of: Format, columns: Columns, problems: Counter[str]) -> _Measured:
    """What the records of one system hold; what is no number or cannot have been measured is counted."""
    value, wrong, indicator = _fields(text, line, of, columns)
    ranges = columns.fields[0]
    rho = value[:, ranges]
    with np.errstate(invalid="ignore"):
        possible = (rho >= PSEUDORANGE_MIN_M) & (rho <= PSEUDORANGE_MAX_M)
    _count(problems, "absurd pseudorange", np.count_nonzero(~np.isnan(rho)) - np.count_nonzero(possible))
    record, signal = np.nonzero(possible)
    places = [record * value.shape[1] + of_kind[signal] for of_kind in columns.fields]
    if wrong.any():
        not_numbers = np.count_nonzero(wrong[:, ranges]) + sum(np.count_nonzero(wrong.reshape(-1)[place]) for place in places[1:])
        _count(problems, "field not a number", not_numbers)
    values = tuple(value.reshape(-1)[place] for place in places)
    absurd = (values[3] < 0.0) | (values[3] > CN0_MAX_DBHZ)
    if absurd.any():
        _count(problems, "absurd C/N0", np.count_nonzero(absurd))
        values[3][absurd] = np.nan
    lock = indicator.reshape(-1)[places[1]]
    return _Measured(epoch[record], satellite[record], signal, values, _LOST_LOCK[lock], _HALF_CYCLE[lock])


def _count(problems: Counter[str], reason: str, n: int | np.signedinteger) -> None:
    if n:
        problems[reason] += int(n)


def _fields(text: Text, line: Ints, of: Format, columns: Columns) -> Fields:
    """Every field of records (n, n_types + 1), scaled; the last column is that of types which the file does not have."""
    n, shape = columns.n_types, (len(line), columns.n_types + 1)
    fields = Fields(np.empty(shape), np.empty(shape, dtype=np.bool_), np.empty(shape, dtype=np.uint8))
    for every, none in ((fields.value, np.nan), (fields.wrong, False), (fields.indicator, 0)):
        every[:, n] = none
    before, per_line = (0, FIELDS_PER_LINE_2) if of.rinex2 else (NAME_BYTES, n)
    for k, first in enumerate(range(0, n, per_line)):
        here = slice(first, min(first + per_line, n))
        read_fields(text.data, text.start[line + k] + before, text.length[line + k] - before, fields.columns(here))
    if columns.factors is not None:
        fields.value[:, :n] /= columns.factors
    return fields


def _block(
    receiver: str, time_ns: Ints, power_failed: Bools, found: Mapping[str, _Measured], columns: Mapping[str, Columns]
) -> ObservationBlock:
    """A block of the signals that were measured in it."""
    names: dict[str, tuple[int, int]] = {}  # of each signal, its satellite as a number and its place in `Columns`
    for system, measured in found.items():
        codes = columns[system].codes
        for key in np.flatnonzero(np.bincount(measured.satellite * len(codes) + measured.signal)).tolist():
            satellite, k = divmod(key, len(codes))
            names[f"{system}{satellite % NUMBERS:02d}.{codes[k]}"] = satellite, k
    signals = tuple(sorted(names, key=preference))
    most = max((len(of.codes) for of in columns.values()), default=1)
    place_of = np.zeros((NUMBERS * len(SYSTEMS), most), dtype=np.int64)
    for place, signal in enumerate(signals):
        place_of[names[signal]] = place
    shape = (len(time_ns), 1, len(signals))
    floats = np.full((4, *shape), np.nan)
    flags = np.zeros((2, *shape), dtype=np.bool_)
    for measured in found.values():
        at = measured.epoch * len(signals) + place_of[measured.satellite, measured.signal]
        for out, values in zip(floats, measured.values, strict=True):
            out.reshape(-1)[at] = values
        for out, set_where in zip(flags, (measured.slip, measured.half_cycle), strict=True):
            out.reshape(-1)[at[set_where]] = True
    flags[0] |= power_failed[:, None, None] & ~np.isnan(floats[0])
    lock_s = np.broadcast_to(np.nan, shape)
    arrays = dict(zip(ROW_ARRAYS, (*floats, lock_s, *flags), strict=True))
    satellites = tuple(satellite_of(signal) for signal in signals)
    return ObservationBlock((receiver,), signals, satellites, time_ns, time_ns[:, None].copy(), **arrays)
