"""How long signals have been tracked, from row to row: whether a carrier may have slipped."""

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from integrity.gnss.gps_time import NS_PER_S
from integrity.gnss.observations import Bools, Floats, Ints


class SignalLock(NamedTuple):
    """A signal, when the last row that had it was, and the least time of lock in it; NaN: not told."""

    signal: str
    time_ns: int
    lock_s: float


class Locks:
    """How long each signal had been tracked in the last row that had it."""

    def __init__(self, memory: Iterable[SignalLock]) -> None:
        known = tuple(memory)
        self._place = {signal: i for i, (signal, _, _) in enumerate(known)}
        self._time_ns = np.array([time_ns for _, time_ns, _ in known], dtype=np.int64)
        self._lock_s = np.array([lock_s for _, _, lock_s in known], dtype=np.float64)
        self._last: tuple[tuple[str, ...], Ints] = ((), np.array([], dtype=np.int64))

    def memory(self) -> tuple[SignalLock, ...]:
        """For a snapshot."""
        return tuple(map(SignalLock, self._place, self._time_ns.tolist(), self._lock_s.tolist()))

    def slips(self, signals: tuple[str, ...], time_ns: int, lock_s: Floats) -> Bools:
        """Where the carrier may have slipped since the row before: what is told is the least time of lock, and it must reach back to that
        row and not have gone down. A signal that no row had may have.
        """
        places = self._places(signals)
        since_s = (time_ns - self._time_ns[places]) / NS_PER_S
        held = (since_s >= 0.0) & (lock_s >= since_s) & (lock_s >= self._lock_s[places])
        self._time_ns[places], self._lock_s[places] = time_ns, lock_s
        return ~held

    def _places(self, signals: tuple[str, ...]) -> Ints:
        if signals is not self._last[0]:
            new = [signal for signal in signals if signal not in self._place]
            self._place |= {signal: len(self._place) + i for i, signal in enumerate(new)}
            self._time_ns = np.concatenate([self._time_ns, np.zeros(len(new), dtype=np.int64)])
            self._lock_s = np.concatenate([self._lock_s, np.full(len(new), np.nan)])
            self._last = signals, np.array([self._place[signal] for signal in signals], dtype=np.int64)
        return self._last[1]
