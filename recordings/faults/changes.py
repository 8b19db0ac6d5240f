"""What a fault adds to the measurements of a row: on code, on carrier, and the rate of the carrier, which is what Doppler measures."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from integrity.gnss.observations import ROW_ARRAYS, Bools, Floats, ObservationRow
from recordings.faults.truth import RangeChange

MEASURED = ("pseudorange_m", "carrier_cycles", "doppler_hz")
Rows = Mapping[int, ObservationRow]  # by place in the events, with the faults so far


class Change(NamedTuple):
    """Per signal of a recorded row (n,): code and carrier longer by so many metres, the carrier growing by `rate_mps`."""

    code_m: Floats
    carrier_m: Floats
    rate_mps: Floats


def alike(change: RangeChange) -> Change:
    """Code and carrier change together; nothing where it is not known."""
    delta_m, rate_mps = (np.where(np.isfinite(part), part, 0.0) for part in change)
    return Change(delta_m, delta_m, rate_mps)


def moved(row: ObservationRow, signals: Sequence[str], change: Change, wavelengths_m: Floats) -> ObservationRow:
    """The row with a change of these signals, the same object where none of its numbers changes. Signals that are lost stay lost."""
    if row.signals != tuple(signals):
        place = {signal: i for i, signal in enumerate(signals)}
        columns = np.array([place[signal] for signal in row.signals], dtype=np.int64)
        change, wavelengths_m = Change(*(part[columns] for part in change)), wavelengths_m[columns]
    now = replace(
        row,
        pseudorange_m=row.pseudorange_m + change.code_m,
        carrier_cycles=row.carrier_cycles + change.carrier_m / wavelengths_m,
        doppler_hz=row.doppler_hz - change.rate_mps / wavelengths_m,
    )
    return row if all(_same(getattr(row, name), getattr(now, name)) for name in MEASURED) else now


def only(row: ObservationRow, kept: Bools) -> ObservationRow:
    """The row without some of its signals."""
    signals = tuple(signal for signal, keep in zip(row.signals, kept, strict=True) if keep)
    return replace(row, signals=signals, **{name: getattr(row, name)[kept] for name in ROW_ARRAYS})


def _same(was: Floats, now: Floats) -> bool:
    return bool(np.array_equal(was, now, equal_nan=True))
