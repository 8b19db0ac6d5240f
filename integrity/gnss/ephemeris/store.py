"""The ephemerides that have arrived, and which of them serves a satellite at an epoch."""

from bisect import bisect_left, bisect_right
from collections.abc import Iterable, Iterator, Sequence
from itertools import pairwise
from math import inf
from typing import NamedTuple

import numpy as np

from integrity.gnss.ephemeris.broadcast import Ephemeris, KeplerEphemeris
from integrity.gnss.ephemeris.content import content_crc32
from integrity.gnss.ephemeris.states import Ephemerides
from integrity.gnss.gps_time import NS_PER_S
from integrity.gnss.observations import Ints

MOST_TIME_NS = 2**62  # of GPS, 146 years


class _Sets(NamedTuple):
    """The sets of one satellite by when their use begins: index into the ephemerides, first and last GPS time of use, precedence (the
    highest serves first). `longest_ns` is the longest use of any; `in_order` where precedence grows with the beginning, as it should, and
    `tidy` where arrival and the end of use do so, too: then `arrays` (3, n) are the first three.
    """

    number: list[int]
    begin_ns: list[int]
    end_ns: list[int]
    precedence: list[int]
    longest_ns: int
    in_order: bool
    tidy: bool
    arrays: Ints

    def between(self, first_ns: int, last_ns: int) -> range:
        """Places of those that may be used between two times: one or two steps from where they are found."""
        return range(bisect_left(self.begin_ns, first_ns - self.longest_ns), bisect_right(self.begin_ns, last_ns))

    def serving_first(self, first_ns: int, last_ns: int) -> Iterator[int]:
        """The same, the one that serves first first."""
        places = self.between(first_ns, last_ns)
        return reversed(places) if self.in_order else iter(sorted(places, key=self.precedence.__getitem__, reverse=True))


class EphemerisStore:
    """The ephemerides that have arrived, in order of arrival, and which of them serves a satellite at an epoch.

    Of those of a satellite that had arrived and are within their fit interval, the one transmitted last serves (then the later
    reference time, then the higher issue): the order in which receivers deliver the same data makes no difference.
    """

    def __init__(self, arrived: Iterable[Ephemeris] = ()) -> None:
        self._arrived: dict[Ephemeris, None] = {}
        self._numbers: dict[str, list[int]] = {}  # by satellite, indices into the ephemerides
        self._sets: dict[str, _Sets] = {}  # the same in order, of those satellites that were asked for
        self._ephemerides: Ephemerides | None = None  # side by side, once they are needed
        self._first_end_ns = inf
        for ephemeris in arrived:
            self.add(ephemeris)

    def __len__(self) -> int:
        return len(self._arrived)

    @property
    def ephemerides(self) -> Ephemerides:
        """In order of arrival; `len` of it is the count that a later `choose` takes as "arrived by then"."""
        if self._ephemerides is None:
            self._ephemerides = Ephemerides(self._arrived)
        return self._ephemerides

    def add(self, ephemeris: Ephemeris) -> None:
        """Keep an ephemeris; one that is already here changes nothing."""
        if ephemeris not in self._arrived:
            self._numbers.setdefault(ephemeris.satellite, []).append(len(self._arrived))
            self._sets.pop(ephemeris.satellite, None)
            self._arrived[ephemeris] = None
            self._ephemerides = None
            self._first_end_ns = min(self._first_end_ns, _end_ns(ephemeris))

    def forget_before(self, gps_ns: int) -> None:
        """Drop what no epoch at or after `gps_ns` can use. Call between blocks only: earlier counts of arrivals lose their meaning."""
        if self._first_end_ns < gps_ns:
            kept = EphemerisStore(eph for eph in self._arrived if _end_ns(eph) >= gps_ns)
            self._arrived, self._numbers, self._first_end_ns = kept._arrived, kept._numbers, kept._first_end_ns
            self._sets, self._ephemerides = {}, None

    def choose(self, satellites: Sequence[str], epoch_ns: Ints, arrived: Ints) -> Ints:
        """Index (E, S) into `ephemerides`, -1 for none; `epoch_ns` and `arrived` (E,) do not decrease, the latter is how many had arrived
        when each epoch was complete. Each set serves a run of epochs, found by searches, less what those that serve before it take.
        """
        rows = {satellite: row for row, satellite in enumerate(dict.fromkeys(satellites))}
        known = {row: self._sets_of(satellite) for satellite, row in rows.items() if satellite in self._numbers and len(epoch_ns)}
        index = _choose_among_tidy({row: sets for row, sets in known.items() if sets.tidy}, len(rows), epoch_ns, arrived)
        if not all(sets.tidy for sets in known.values()):
            times_ns, counts = epoch_ns.tolist(), arrived.tolist()
            for row, sets in known.items():
                if not sets.tidy:
                    _choose(sets, times_ns, counts, index[row])
        return np.ascontiguousarray(index[np.array([rows[satellite] for satellite in satellites], dtype=np.int64)].T)

    def of_issue(self, satellite: str, issue: int, gps_ns: int) -> int:
        """Index into `ephemerides` of the set of that issue which serves first at a GPS time, -1 for none."""
        if satellite in self._numbers:
            ephemerides, sets = self.ephemerides, self._sets_of(satellite)
            for place in sets.serving_first(gps_ns, gps_ns):
                if ephemerides[sets.number[place]].issue == issue and gps_ns <= sets.end_ns[place]:
                    return sets.number[place]
        return -1

    def of_content(self, satellite: str, crc32: int, gps_ns: int, arrived: int) -> int:
        """Index into `ephemerides` of the set with that content (`content_crc32`) which may serve at a GPS time and is among the first
        `arrived`, -1 for none; of several that differ in nothing else the one sent last."""
        ephemerides = self.ephemerides
        found = [
            (ephemerides[k].transmission_ns, k)
            for k in self._numbers.get(satellite, ())
            if k < arrived and gps_ns <= _end_ns(ephemerides[k]) and content_crc32(ephemerides[k]) == crc32
        ]
        return max(found, default=(0, -1))[1]

    def _sets_of(self, satellite: str) -> _Sets:
        if satellite not in self._sets:
            self._sets[satellite] = _in_order(self.ephemerides, self._numbers[satellite])
        return self._sets[satellite]


def _in_order(ephemerides: Ephemerides, mine: Sequence[int]) -> _Sets:
    precedence = {number: rank for rank, number in enumerate(sorted(mine, key=lambda k: _precedence(ephemerides[k])))}
    half_ns = {k: round(ephemerides[k].fit_half_s * NS_PER_S) for k in mine}
    order = sorted(mine, key=lambda k: (ephemerides[k].toe_ns - half_ns[k], precedence[k]))
    ranks = [precedence[k] for k in order]
    begin_ns, end_ns = ([ephemerides[k].toe_ns + sign * half_ns[k] for k in order] for sign in (-1, 1))
    in_order = all(a < b for a, b in pairwise(ranks))
    arrays_hold_them = all(abs(t) <= MOST_TIME_NS for t in begin_ns + end_ns)
    tidy = in_order and arrays_hold_them and all(a < b for a, b in pairwise(order)) and all(a <= b for a, b in pairwise(end_ns))
    return _Sets(
        number=order,
        begin_ns=begin_ns,
        end_ns=end_ns,
        precedence=ranks,
        longest_ns=2 * max(half_ns.values()),
        in_order=in_order,
        tidy=tidy,
        arrays=np.array((order, begin_ns, end_ns) if tidy else (), dtype=np.int64),
    )


def _choose(sets: _Sets, times_ns: list[int], arrived: list[int], row: Ints) -> None:
    """Into a row of -1 (E,) which set serves one satellite at each time."""
    free = len(times_ns)
    for place in sets.serving_first(times_ns[0], times_ns[-1]):
        begin = max(bisect_left(times_ns, sets.begin_ns[place]), bisect_right(arrived, sets.number[place]))
        run = row[begin : bisect_right(times_ns, sets.end_ns[place])]
        empty = run < 0
        run[empty] = sets.number[place]
        free -= int(np.count_nonzero(empty))
        if not free:
            return


def _choose_among_tidy(sets_of: dict[int, _Sets], n_rows: int, epoch_ns: Ints, arrived: Ints) -> Ints:
    """Which sets serve the satellites of rows (n_rows, E), -1 where none does, of satellites with tidy sets, in the order of rows: a set
    serves from where its use has begun and it has arrived to where its use ends or its successor serves."""
    n_epochs = len(epoch_ns)
    places = {row: sets.between(int(epoch_ns[0]), int(epoch_ns[-1])) for row, sets in sets_of.items()}
    which = [sets_of[row].arrays[:, some.start : some.stop] for row, some in places.items()]
    number, begin_ns, end_ns = np.concatenate([*which, np.empty((3, 0), dtype=np.int64)], axis=1)
    row_start = np.repeat(n_epochs * np.array(list(places), dtype=np.int64), [len(some) for some in places.values()])
    begin = row_start + np.maximum(np.searchsorted(epoch_ns, begin_ns, "left"), np.searchsorted(arrived, number, "right"))
    end = row_start + np.searchsorted(epoch_ns, end_ns, "right")
    end[:-1] = np.minimum(end[:-1], begin[1:])
    runs = np.diff(np.stack((begin, np.maximum(begin, end)), axis=1).reshape(-1), prepend=0, append=n_rows * n_epochs)
    chosen = np.full(len(runs), -1)
    chosen[1::2] = number
    return np.repeat(chosen, runs).reshape(n_rows, n_epochs)


def _precedence(eph: Ephemeris) -> tuple[int | bool | float, ...]:
    """Sort key of the sets of a satellite: the set that serves first last. Of two that differ in what they promise alone (files that leave
    times of transmission out have such) the one that promises less; the last two settle what no satellite should send."""
    detail = (eph.m0, eph.af0) if isinstance(eph, KeplerEphemeris) else (eph.x_m, eph.y_m)
    worst_m = inf if eph.accuracy_m is None else eph.accuracy_m
    return (eph.transmission_ns, eph.toe_ns, eph.issue, not eph.healthy, worst_m, -eph.fit_half_s, *detail)


def _end_ns(eph: Ephemeris) -> float:
    """GPS time up to which a set may be used."""
    return eph.toe_ns + eph.fit_half_s * NS_PER_S
