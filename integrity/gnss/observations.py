"""What receivers measured: one row per receiver and time, and the block that lines rows up.

Signs. A pseudorange is c times (time of reception by the receiver's clock minus time of transmission by the satellite's clock):
it grows with the receiver's clock bias and shrinks with the satellite's. Carrier phase, in cycles, grows with the range as the
pseudorange does. Doppler, in hertz, is positive for an approaching satellite.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from integrity.gnss.signals import MONITORED_CODES, Codes, preference, satellite_of

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]
Ints = NDArray[np.int64]


BEYOND_MEASURE = 1e12  # of metres, cycles, hertz, seconds: no receiver reports it
ELEMENTS_PER_SLICE = 12_000  # 96 kB an array


def slices(n_epochs: int, width: int) -> list[slice]:
    """Runs of epochs for arrays of `width` numbers an epoch: what long formulas leave behind stays in the cache. Never changes a result."""
    step = max(1, ELEMENTS_PER_SLICE // max(1, width))
    return [slice(e, e + step) for e in range(0, n_epochs, step)]


def freeze(values: object) -> None:
    """Make every array in a frozen dataclass read-only; called from its `__post_init__`."""
    for value in vars(values).values():
        if isinstance(value, np.ndarray):
            value.setflags(write=False)


@dataclass(frozen=True, eq=False)
class ObservationRow:
    """One receiver at one time: arrays of shape (n,), one entry per signal, NaN where a quantity was not measured.

    `receive_time_ns` is GPS time by the receiver's own clock. `lock_s` is how long the carrier has been tracked;
    `slip` marks a possible cycle slip since the row before, `half_cycle` an unresolved half cycle.
    """

    receiver: str
    receive_time_ns: int
    signals: tuple[str, ...]
    pseudorange_m: Floats
    carrier_cycles: Floats
    doppler_hz: Floats
    cn0_dbhz: Floats
    lock_s: Floats
    slip: Bools
    half_cycle: Bools

    def __post_init__(self) -> None:
        n = len(self.signals)
        if len(set(self.signals)) != n:
            raise ValueError(f"receiver {self.receiver}: a signal stands twice in one row")
        for name in ROW_ARRAYS:
            array = getattr(self, name)
            if array.shape != (n,):
                raise ValueError(f"receiver {self.receiver}: {name} has shape {array.shape}, expected ({n},)")
            array.setflags(write=False)


ROW_FLOATS = ("pseudorange_m", "carrier_cycles", "doppler_hz", "cn0_dbhz", "lock_s")
ROW_FLAGS = ("slip", "half_cycle")
ROW_ARRAYS = ROW_FLOATS + ROW_FLAGS


def same_measurements(a: ObservationRow, b: ObservationRow) -> bool:
    """Whether two rows say the same, to the last bit; NaN equals NaN."""
    same = a.receive_time_ns == b.receive_time_ns and a.signals == b.signals
    return same and all(getattr(a, name).tobytes() == getattr(b, name).tobytes() for name in ROW_ARRAYS)


@dataclass(frozen=True, eq=False)
class ObservationBlock:
    """What R receivers saw of S signals over E epochs; read-only arrays (E, R, S), NaN where nothing was seen.

    `epoch_ns` (E,) is the nominal GPS time, `receive_time_ns` (E, R) each receiver's own. Signals are sorted by satellite,
    of each satellite the preferred one first.
    """

    receivers: tuple[str, ...]
    signals: tuple[str, ...]
    satellites: tuple[str, ...]  # of each signal, (S,)
    epoch_ns: Ints
    receive_time_ns: Ints
    pseudorange_m: Floats
    carrier_cycles: Floats
    doppler_hz: Floats
    cn0_dbhz: Floats
    lock_s: Floats
    slip: Bools
    half_cycle: Bools

    def __post_init__(self) -> None:
        freeze(self)


class Layout(NamedTuple):
    """Where the signals of rows stand in a block: `columns` for each different tuple of signals, the last for those passed over."""

    row_signals: tuple[tuple[str, ...], ...]
    more_signals: tuple[str, ...]
    signals: tuple[str, ...]
    satellites: tuple[str, ...]
    columns: dict[tuple[str, ...], Ints]


def layout_of(
    rows: Iterable[ObservationRow], more_signals: tuple[str, ...] = (), before: Layout | None = None, codes: Codes | None = MONITORED_CODES
) -> Layout:
    """The layout of a block of rows; `more_signals` get a column even where no row has them. It is the one `before` where that serves,
    which must be of the same `codes`. Signals of other codes are passed over; None: all are taken.
    """
    row_signals = tuple(dict.fromkeys(row.signals for row in rows))
    if before is not None and before.row_signals == row_signals and before.more_signals == more_signals:
        return before
    seen = {s for signals in row_signals for s in signals if codes is None or s.partition(".")[2] in codes.get(s[:1], ())}
    signals = tuple(sorted(seen | set(more_signals), key=preference))
    column_of = {signal: i for i, signal in enumerate(signals)}
    columns = {mine: np.array([column_of.get(s, len(signals)) for s in mine], dtype=np.int64) for mine in row_signals}
    return Layout(row_signals, more_signals, signals, tuple(satellite_of(s) for s in signals), columns)


def build_block(
    receivers: Sequence[str], epoch_ns: Sequence[int], rows: Sequence[Sequence[ObservationRow]], layout: Layout | None = None
) -> ObservationBlock:
    """Line up `rows[e][r]` (one per epoch and receiver) in a block, by their own layout or the one given.

    What is not finite, or beyond measure, counts as not measured.
    """
    in_order = [row for epoch in rows for row in epoch]
    layout = layout or layout_of(in_order)
    shape = (len(epoch_ns), len(receivers), len(layout.signals) + 1)  # a last column for what is passed over
    places = np.concatenate([layout.columns[row.signals] + k * shape[2] for k, row in enumerate(in_order)])
    floats = np.full((len(ROW_FLOATS), *shape), np.nan)
    flags = np.zeros((len(ROW_FLAGS), *shape), dtype=np.bool_)
    measured = np.concatenate([getattr(row, name) for name in ROW_FLOATS for row in in_order]).reshape(len(ROW_FLOATS), -1)
    flagged = np.concatenate([getattr(row, name) for name in ROW_FLAGS for row in in_order]).reshape(len(ROW_FLAGS), -1)
    floats.reshape(len(ROW_FLOATS), -1)[:, places] = np.where(np.abs(measured) < BEYOND_MEASURE, measured, np.nan)
    flags.reshape(len(ROW_FLAGS), -1)[:, places] = flagged
    return ObservationBlock(
        tuple(receivers),
        layout.signals,
        layout.satellites,
        np.array(epoch_ns, dtype=np.int64),
        np.array([row.receive_time_ns for row in in_order], dtype=np.int64).reshape(shape[:2]),
        *floats[..., :-1].copy(),
        *flags[..., :-1].copy(),
    )
