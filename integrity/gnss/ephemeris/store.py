"""The ephemerides that have arrived, and which of them serves a satellite at an epoch."""

from collections.abc import Iterable, Sequence
from math import inf
from typing import NamedTuple

import numpy as np

from integrity.gnss.ephemeris.broadcast import Ephemeris, KeplerEphemeris
from integrity.gnss.ephemeris.states import Ephemerides
from integrity.gnss.gps_time import NS_PER_S
from integrity.gnss.observations import Ints


class _Serving(NamedTuple):
    """All sets in order of precedence: by satellite, the one that serves first last. `first_of` a satellite is where its sets begin."""

    number: Ints  # index into the ephemerides, (n,)
    begin_ns: Ints  # GPS times from which, and up to which it may be used
    end_ns: Ints
    of: dict[str, slice]


class EphemerisStore:
    """The ephemerides that have arrived, in order of arrival, and which of them serves a satellite at an epoch.

    Of those of a satellite that had arrived and are within their fit interval, the one transmitted last serves (then the later
    reference time, then the higher issue): the order in which receivers deliver the same data makes no difference.
    """

    def __init__(self, arrived: Iterable[Ephemeris] = ()) -> None:
        self._arrived = dict.fromkeys(arrived)
        self._ephemerides: Ephemerides | None = None  # side by side, once they are needed
        self._serving: _Serving | None = None
        self._first_end_ns = min((_end_ns(eph) for eph in self._arrived), default=inf)

    def __len__(self) -> int:
        return len(self._arrived)

    @property
    def ephemerides(self) -> Ephemerides:
        """In order of arrival; `len` of it is the count that a later `choose` takes as "arrived by then"."""
        if self._ephemerides is None:
            self._ephemerides, self._serving = Ephemerides(self._arrived), None
        return self._ephemerides

    def add(self, ephemeris: Ephemeris) -> None:
        """Keep an ephemeris; one that is already here changes nothing."""
        if ephemeris not in self._arrived:
            self._arrived[ephemeris] = None
            self._ephemerides = None
            self._first_end_ns = min(self._first_end_ns, _end_ns(ephemeris))

    def forget_before(self, gps_ns: int) -> None:
        """Drop what no epoch at or after `gps_ns` can use. Call between blocks only: earlier counts of arrivals lose their meaning."""
        if self._first_end_ns < gps_ns:
            self._arrived = {eph: None for eph in self._arrived if _end_ns(eph) >= gps_ns}
            self._ephemerides = None
            self._first_end_ns = min((_end_ns(eph) for eph in self._arrived), default=inf)

    def choose(self, satellites: Sequence[str], epoch_ns: Ints, arrived: Ints) -> Ints:
        """Index (E, S) into `ephemerides`, -1 for none; `epoch_ns` and `arrived` (E,) do not decrease, the latter is how many had arrived
        when each epoch was complete.

        Each set serves a run of epochs, which two searches find; a set of higher precedence overwrites what stands in its run.
        """
        sets = self.ephemerides
        if self._serving is None:
            self._serving = _serving(sets)
        serving = self._serving
        begins = np.maximum(np.searchsorted(epoch_ns, serving.begin_ns, "left"), np.searchsorted(arrived, serving.number, "right"))
        ends = np.searchsorted(epoch_ns, serving.end_ns, "right")
        index = np.full((len(epoch_ns), len(satellites)), -1, dtype=np.int64)
        columns: dict[str, Ints] = {}
        for s, satellite in enumerate(satellites):
            if satellite not in columns:
                columns[satellite] = _column(serving, serving.of.get(satellite, slice(0)), begins, ends, len(epoch_ns))
            index[:, s] = columns[satellite]
        return index

    def of_issue(self, satellite: str, issue: int, gps_ns: int) -> int:
        """Index into `ephemerides` of the set of that issue which serves first at a GPS time, -1 for none."""
        sets = self.ephemerides
        if self._serving is None:
            self._serving = _serving(sets)
        serving = self._serving
        for place in reversed(range(*serving.of.get(satellite, slice(0)).indices(len(serving.number)))):
            k = int(serving.number[place])
            if sets[k].issue == issue and serving.begin_ns[place] <= gps_ns <= serving.end_ns[place]:
                return k
        return -1


def _serving(sets: Ephemerides) -> _Serving:
    order = sorted(range(len(sets)), key=lambda k: _precedence(sets[k]))
    half_ns = [round(sets[k].fit_half_s * NS_PER_S) for k in order]
    begin_ns = np.array([sets[k].toe_ns - half for k, half in zip(order, half_ns, strict=True)], dtype=np.int64)
    end_ns = np.array([sets[k].toe_ns + half for k, half in zip(order, half_ns, strict=True)], dtype=np.int64)
    of: dict[str, slice] = {}
    for place, k in enumerate(order):
        of[sets[k].satellite] = slice(of.get(sets[k].satellite, slice(place, 0)).start, place + 1)
    return _Serving(np.array(order, dtype=np.int64), begin_ns, end_ns, of)


def _column(serving: _Serving, mine: slice, begins: Ints, ends: Ints, n_epochs: int) -> Ints:
    """Which set serves one satellite, (E,)."""
    column = np.full(n_epochs, -1, dtype=np.int64)
    for number, begin, end in zip(serving.number[mine].tolist(), begins[mine].tolist(), ends[mine].tolist(), strict=True):
        column[begin:end] = number
    return column


def _precedence(eph: Ephemeris) -> tuple[str, int, int, int, float, float]:
    """Sort key: by satellite, the set that serves first last; the last two settle what no satellite should send."""
    detail = (eph.m0, eph.af0) if isinstance(eph, KeplerEphemeris) else (eph.x_m, eph.y_m)
    return (eph.satellite, eph.transmission_ns, eph.toe_ns, eph.issue, *detail)


def _end_ns(eph: Ephemeris) -> float:
    """GPS time up to which a set may be used."""
    return eph.toe_ns + eph.fit_half_s * NS_PER_S
