"""What is remembered of every receiver's signals from epoch to epoch: when seen last, last range, usual strength."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from integrity.gnss.observations import Bools, Floats, Ints, ObservationBlock, freeze
from integrity.limits import Limits
from integrity.monitors.streams import cn0_drop_db, last_seen, lost_share, repeating_receivers


class StreamStatistics(NamedTuple):
    """Of a block, each (E, R): receivers that repeat themselves, drop of C/N0 in dB, share of expected signals lost."""

    repeating: Bools
    cn0_drop_db: Floats
    lost_share: Floats


@dataclass(frozen=True, eq=False)
class StreamMemory:
    """Arrays (R, S) by `signals`: GPS time when seen last (0: never), last pseudorange, C/N0 baseline; `epoch_ns` of the last epoch."""

    signals: tuple[str, ...]
    epoch_ns: int
    last_seen_ns: Ints
    pseudorange_m: Floats
    cn0_baseline_dbhz: Floats

    def __post_init__(self) -> None:
        freeze(self)

    @staticmethod
    def empty(n_receivers: int) -> "StreamMemory":
        """Before the first epoch."""
        shape = (n_receivers, 0)
        return StreamMemory((), 0, np.zeros(shape, dtype=np.int64), np.zeros(shape), np.zeros(shape))

    def signals_since(self, gps_ns: int) -> tuple[str, ...]:
        """Signals that some receiver saw at or after a GPS time."""
        recent: Bools = np.logical_or.reduce(self.last_seen_ns >= gps_ns, axis=0)
        return self.signals if recent.all() else tuple(s for s, keep in zip(self.signals, recent, strict=True) if keep)

    def on(self, signals: tuple[str, ...]) -> "StreamMemory":
        """The same memory for another list of signals: new ones were never seen, those not listed are forgotten."""
        if signals == self.signals:
            return self
        column = {s: i for i, s in enumerate(self.signals)}
        source = [column.get(s, -1) for s in signals]  # -1: the extra last column, "never"
        n = len(self.last_seen_ns)
        return StreamMemory(
            signals,
            self.epoch_ns,
            np.hstack((self.last_seen_ns, np.zeros((n, 1), dtype=np.int64)))[:, source],
            np.hstack((self.pseudorange_m, np.full((n, 1), np.nan)))[:, source],
            np.hstack((self.cn0_baseline_dbhz, np.full((n, 1), np.nan)))[:, source],
        )


def advance(
    memory: StreamMemory, block: ObservationBlock, high: Bools, bands: Sequence[slice | Ints], limits: Limits
) -> tuple[StreamMemory, StreamStatistics]:
    """The memory after a block, and what the streams show in it; `high` (E, R, S): satellites that no receiver loses by itself.

    Signals are watched by `bands`, columns that are disturbed together: what counts is the worst of them.
    """
    before = memory.on(block.signals)
    seen = np.isfinite(block.pseudorange_m)
    seen_ns = last_seen(seen, block.epoch_ns, before.last_seen_ns)
    recent = seen_ns[:-1] >= block.epoch_ns[:, None, None] - limits.remember_satellite_ns
    lost_of = recent & high
    baseline = np.empty(before.cn0_baseline_dbhz.shape)
    shown = []
    for band in bands:
        cn0, usual = block.cn0_dbhz[..., band], before.cn0_baseline_dbhz[:, band]
        drop_db, baseline[:, band] = cn0_drop_db(cn0, recent[..., band], block.epoch_ns, usual, before.epoch_ns)
        repeating = repeating_receivers(block.pseudorange_m[..., band], before.pseudorange_m[:, band])
        shown.append(StreamStatistics(repeating, drop_db, lost_share(seen[..., band], lost_of[..., band])))
    after = StreamMemory(block.signals, int(block.epoch_ns[-1]), np.array(seen_ns[-1]), np.array(block.pseudorange_m[-1]), baseline)
    return after, shown[0] if len(shown) == 1 else _worst(shown)


def _worst(of_bands: Sequence[StreamStatistics]) -> StreamStatistics:
    """Of several bands; a band without a statistic says nothing."""
    repeating, drop_db, lost = zip(*of_bands, strict=True)
    return StreamStatistics(np.logical_or.reduce(repeating), np.fmax.reduce(drop_db), np.fmax.reduce(lost))
