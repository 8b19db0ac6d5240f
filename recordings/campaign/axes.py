"""A small plot: a heading, a scale, ticks, a line with bars."""

import math
from collections.abc import Sequence
from typing import NamedTuple

from recordings.report.svg import GRID, INK, QUIET, Box, Drawing, fitted, path

ALL_MONITORS, ALONE, GAIN = "#0072b2", "#7f7f7f", "#dbe9f4"
ALARM = "#d55e00"
TICK_PX, NOTE_PX = 10.0, 10.5


class Scale(NamedTuple):
    """Values to pixels, linear or logarithmic; what lies outside is drawn at the edge."""

    low: float
    high: float
    from_px: float
    to_px: float
    logarithmic: bool = False

    def px(self, value: float) -> float:
        """Where a value stands."""
        clipped = min(max(value, self.low), self.high)
        if self.logarithmic:
            share = math.log(clipped / self.low) / math.log(self.high / self.low)
        else:
            share = (clipped - self.low) / (self.high - self.low)
        return self.from_px + share * (self.to_px - self.from_px)


Ticks = Sequence[tuple[float, str]]


def heading(drawing: Drawing, box: Box, title: str, words: str, aside: str = "") -> None:
    """Two lines above a plot, as wide as it and its labels; `aside` at the right end of the first."""
    left, room = box.left - 44, box.right - box.left + 44
    drawing.text(left, box.top - 25, fitted(title, 12.5, room, bold=True), 12.5, bold=True)
    drawing.text(box.right, box.top - 25, aside, NOTE_PX, anchor="end", fill=QUIET)
    drawing.text(left, box.top - 10, fitted(words, NOTE_PX + 0.5, room), NOTE_PX + 0.5, fill=QUIET)


def upward(drawing: Drawing, box: Box, scale: Scale, ticks: Ticks) -> None:
    """Lines across, with their values at the left."""
    for value, label in ticks:
        y = scale.px(value)
        drawing.line(box.left, y, box.right, y, stroke=GRID)
        drawing.text(box.left - 6, y + 3.5, label, TICK_PX, anchor="end", fill=QUIET)


def sideward(drawing: Drawing, box: Box, scale: Scale, ticks: Ticks, unit: str) -> None:
    """Values below a plot, and their unit under them."""
    for value, label in ticks:
        x = scale.px(value)
        drawing.line(x, box.bottom, x, box.bottom + 3, stroke=QUIET)
        drawing.text(x, box.bottom + 14, label, TICK_PX, anchor="middle", fill=QUIET)
    drawing.text((box.left + box.right) / 2, box.bottom + 29, unit, TICK_PX, anchor="middle", fill=QUIET)


def frame(drawing: Drawing, box: Box) -> None:
    """Left and bottom."""
    drawing.add("path", d=path([(box.left, box.top), (box.left, box.bottom), (box.right, box.bottom)]), fill="none", stroke=QUIET)


def bars(drawing: Drawing, at: Sequence[tuple[float, float, float]], stroke: str) -> None:
    """From the second to the third at the first."""
    d = "".join(path([(x, low), (x, high)]) for x, low, high in at)
    if d:
        drawing.add("path", d=d, fill="none", stroke=stroke, stroke_width=1.2)


def line(drawing: Drawing, points: Sequence[tuple[float, float]], stroke: str, dash: str = "none", width: float = 1.6) -> None:
    """Through points."""
    if points:
        drawing.add("path", d=path(points), fill="none", stroke=stroke, stroke_width=width, stroke_dasharray=dash, stroke_linejoin="round")


def dots(drawing: Drawing, points: Sequence[tuple[float, float]], fill: str, stroke: str, radius: float = 3.0) -> None:
    """At points."""
    for x, y in points:
        drawing.add("circle", cx=x, cy=y, r=radius, fill=fill, stroke=stroke, stroke_width=1.2)


def value_labels(drawing: Drawing, y: float, at: Sequence[tuple[float, str]], name: str, left: float, alarms: Sequence[bool] = ()) -> None:
    """A row of words below a plot; those that are alarms in their colour."""
    drawing.text(left - 6, y, name, 9.5, anchor="end", fill=QUIET)
    for i, (x, label) in enumerate(at):
        alarm = bool(alarms) and alarms[i]
        drawing.text(x, y, label, 9.5, anchor="middle", fill=ALARM if alarm else INK, bold=alarm)
