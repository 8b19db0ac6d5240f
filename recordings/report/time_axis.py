"""Time from left to right: the axis that all panels share, and how long things took, in words."""

from collections.abc import Sequence
from typing import NamedTuple

from integrity.gnss.gps_time import DAY_S, NS_PER_S
from integrity.gnss.observations import Floats
from recordings.report.series import Series, Span
from recordings.report.svg import GRID, INK, QUIET, Box, Drawing, fitted, text_width_px, time_ticks

MOST_TICKS = 8
LEGEND_PX = 84.0  # beside the panels


class TimeAxis(NamedTuple):
    """GPS time from left to right."""

    start_ns: int
    end_ns: int
    left: float
    right: float

    def x(self, gps_ns: int) -> float:
        """Pixel of a time."""
        return self.left + (gps_ns - self.start_ns) / (self.end_ns - self.start_ns) * (self.right - self.left)

    def xs(self, data: Series) -> Floats:
        """Pixels of all epochs (E,)."""
        share = (data.gps_ns - self.start_ns) / (self.end_ns - self.start_ns)
        result: Floats = self.left + share * (self.right - self.left)
        return result


def time_axis(data: Series, silences: Sequence[Span], left: float, right: float) -> TimeAxis:
    """From the first epoch or silence to the last."""
    start_ns = min([int(data.gps_ns[0]), *(start for start, _ in silences)])
    end_ns = max([int(data.until_ns[-1]), *(end for _, end in silences)])
    return TimeAxis(start_ns, end_ns, left, right)


def heading(drawing: Drawing, axis: TimeAxis, y: float, what: str, good: str) -> None:
    """Name of a panel, and in the same line what is good."""
    drawing.text(axis.left, y, what, 13, bold=True)
    used = text_width_px(what, 13, bold=True) + 10
    drawing.text(axis.left + used, y, fitted(good, 11.5, axis.right + LEGEND_PX - axis.left - used), 11.5, fill=QUIET)


def time_grid(drawing: Drawing, axis: TimeAxis, box: Box) -> None:
    """Vertical lines at round times."""
    for gps_ns, _ in time_ticks(axis.start_ns, axis.end_ns, MOST_TICKS):
        x = axis.x(gps_ns)
        drawing.line(x, box.top, x, box.bottom, stroke=GRID)


def time_labels(drawing: Drawing, axis: TimeAxis, y: float) -> None:
    """Ticks and their times under the lowest panel."""
    for gps_ns, label in time_ticks(axis.start_ns, axis.end_ns, MOST_TICKS):
        x = axis.x(gps_ns)
        drawing.line(x, y, x, y + 5, stroke=INK)
        drawing.text(x, y + 18, label, 11.5, anchor="middle")
    drawing.text(axis.right + LEGEND_PX, y + 18, "UTC", 11.5, anchor="end", fill=QUIET)


def duration(ns: int) -> str:
    """A length of time in its two largest units."""
    seconds = ns / NS_PER_S
    if seconds < 60:
        return f"{seconds:.3g} s"
    whole = round(seconds)
    for unit_s, unit, part_s, part in ((DAY_S, "d", 3600, "h"), (3600, "h", 60, "min"), (60, "min", 1, "s")):
        if whole >= unit_s:
            rest = whole % unit_s // part_s
            return f"{whole // unit_s} {unit}" + (f" {rest} {part}" if rest else "")
    raise AssertionError("a minute or more has a unit")
