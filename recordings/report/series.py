"""The reports of a replay as arrays over time, the spans in which something holds, and lines thinned to what a pixel can show."""

from collections.abc import Hashable, Iterable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from integrity.gnss.gps_time import NS_PER_S
from integrity.gnss.observations import Floats, Ints, freeze
from integrity.outputs import EpochReport

Span = tuple[int, int]  # GPS time in nanoseconds, from and to


@dataclass(frozen=True, eq=False)
class Series:
    """E epochs in order of time: `gps_ns` (E,); `until_ns` (E,), how long each holds; `e_enu_m` (E, R, 3); `horizontal_m` (E, R).

    An epoch holds until the next, or for one interval where the next is missing.
    """

    reports: tuple[EpochReport, ...]
    interval_ns: int
    gps_ns: Ints
    until_ns: Ints
    e_enu_m: Floats
    horizontal_m: Floats

    def __post_init__(self) -> None:
        freeze(self)

    def ratio(self, *checks: str) -> Floats:
        """Statistic over threshold (E,), the larger of several checks; NaN where none has a value."""
        names = self.reports[0].check_names
        columns = [names.index(check) for check in checks]
        statistic = np.array([[report.statistic[c] for c in columns] for report in self.reports])
        ratios = statistic / self.reports[0].threshold[columns]
        result: Floats = np.fmax.reduce(ratios, axis=1)
        return result

    def spans(self, epochs: Sequence[int]) -> list[Span]:
        """The times that some epochs (ascending) cover; what touches is one span."""
        joined: list[Span] = []
        for e in epochs:
            start_ns, end_ns = int(self.gps_ns[e]), int(self.until_ns[e])
            if joined and joined[-1][1] == start_ns:
                joined[-1] = (joined[-1][0], end_ns)
            else:
                joined.append((start_ns, end_ns))
        return joined

    def runs(self) -> Ints:
        """The number of the unbroken run to which each epoch belongs (E,)."""
        missing = np.diff(self.gps_ns) != (self.until_ns - self.gps_ns)[:-1]
        return np.concatenate([[0], np.cumsum(missing)])


def series(reports: Sequence[EpochReport]) -> Series:
    """Arrays of at least one report, in order of time. The interval is the commonest step; of a single epoch, one second."""
    if not reports:
        raise ValueError("no epoch was decided: there is nothing to draw")
    gps_ns = np.array([report.gps_time_ns for report in reports], dtype=np.int64)
    steps, counts = np.unique(np.diff(gps_ns), return_counts=True)
    interval_ns = int(steps[np.argmax(counts)]) if steps.size else NS_PER_S
    following_ns = np.append(gps_ns[1:], gps_ns[-1] + interval_ns)
    is_next = 2 * (following_ns - gps_ns) <= 3 * interval_ns
    e_enu_m = np.array([report.e_enu_m for report in reports], dtype=np.float64)
    return Series(
        reports=tuple(reports),
        interval_ns=interval_ns,
        gps_ns=gps_ns,
        until_ns=np.where(is_next, following_ns, gps_ns + interval_ns),
        e_enu_m=e_enu_m,
        horizontal_m=np.hypot(e_enu_m[..., 0], e_enu_m[..., 1]),
    )


def by_key(keys: Iterable[Hashable]) -> dict[Hashable, list[int]]:
    """The places at which each key stands, in order of first appearance."""
    places: dict[Hashable, list[int]] = {}
    for i, key in enumerate(keys):
        places.setdefault(key, []).append(i)
    return places


class Line(NamedTuple):
    """Pieces of a line: each the pixels (n, 2) of one unbroken run."""

    pieces: list[Floats]
    thinned: bool


def thin(x_px: Floats, y_px: Floats, runs: Ints) -> Line:
    """A line of which every pixel column keeps its highest point, which is the largest value: no outlier is lost. NaN breaks it."""
    drawn = np.isfinite(y_px)
    run = np.cumsum(np.concatenate([[0], (np.diff(runs) != 0) | ~drawn[:-1]]))[drawn]
    x, y = x_px[drawn], y_px[drawn]
    if not x.size:
        return Line([], False)
    column = np.floor(x)
    order = np.lexsort((y, column))
    kept = np.sort(order[np.concatenate([[True], np.diff(column[order]) != 0])])
    points = np.stack([x[kept], y[kept]], axis=-1)
    pieces = np.split(points, np.flatnonzero(np.diff(run[kept])) + 1)
    return Line(pieces, kept.size < x.size)
