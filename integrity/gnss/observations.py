"""What receivers measured: one row per receiver and time, and the block that lines rows up.

Signs. A pseudorange is c times (time of reception by the receiver's clock minus time of transmission by the satellite's clock):
it grows with the receiver's clock bias and shrinks with the satellite's. Carrier phase, in cycles, grows with the range as the
pseudorange does. Doppler, in hertz, is positive for an approaching satellite.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from integrity.gnss.signals import SYSTEMS, preference

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


def build_block(
    receivers: Sequence[str], epoch_ns: Sequence[int], rows: Sequence[Sequence[ObservationRow]], more_signals: Sequence[str] = ()
) -> ObservationBlock:
    """Line up `rows[e][r]` (one per epoch and receiver) in a block; `more_signals` get a column even where no row has them.

    Signals of other systems than `SYSTEMS` are passed over; what is not finite, or beyond measure, counts as not measured.
    """
    seen = {s for epoch in rows for row in epoch for s in row.signals if s[:1] in SYSTEMS}
    signals = tuple(sorted(seen | set(more_signals), key=preference))
    column_of = {signal: i for i, signal in enumerate(signals)}
    nowhere = len(signals)
    shape = (len(epoch_ns), len(receivers), len(signals) + 1)  # a last column for what is passed over
    floats = np.full((len(ROW_FLOATS), *shape), np.nan)
    flags = np.zeros((len(ROW_FLAGS), *shape), dtype=np.bool_)
    receive_time_ns = np.zeros(shape[:2], dtype=np.int64)
    columns_of: dict[tuple[str, ...], Ints] = {}
    for e, epoch in enumerate(rows):
        for r, row in enumerate(epoch):
            columns = columns_of.get(row.signals)
            if columns is None:
                columns = columns_of[row.signals] = np.array([column_of.get(s, nowhere) for s in row.signals], dtype=np.int64)
            receive_time_ns[e, r] = row.receive_time_ns
            floats[:, e, r, columns] = (row.pseudorange_m, row.carrier_cycles, row.doppler_hz, row.cn0_dbhz, row.lock_s)
            flags[:, e, r, columns] = (row.slip, row.half_cycle)
    floats[~(np.abs(floats) < BEYOND_MEASURE)] = np.nan
    floats, flags = floats[..., :nowhere], flags[..., :nowhere]
    return ObservationBlock(
        receivers=tuple(receivers),
        signals=signals,
        satellites=tuple(s.partition(".")[0] for s in signals),
        epoch_ns=np.array(epoch_ns, dtype=np.int64),
        receive_time_ns=receive_time_ns,
        **dict(zip(ROW_ARRAYS, (*floats.copy(), *flags.copy()), strict=True)),
    )
