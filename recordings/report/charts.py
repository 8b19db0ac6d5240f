"""The evidence over time: horizontal errors against the radius, and the main statistics over their thresholds."""

import math
from typing import NamedTuple

import numpy as np

from integrity.gnss.observations import Floats, Ints
from integrity.limits import Limits
from recordings.report.marks import ALARM, RECEIVER_LOOKS
from recordings.report.series import Line, Series, thin
from recordings.report.svg import GRID, INK, QUIET, Box, Drawing, fitted, metres, nice_step, path, rounded
from recordings.report.time_axis import TimeAxis, heading, time_grid, time_labels

MAIN_CHECKS = (
    ("shape", ("shape", "shape_3d")),
    ("common", ("common", "common_3d")),
    ("residual", ("residual",)),
    ("b_value", ("b_value",)),
    ("collapse", ("collapse",)),
)
DOT_PX = 3.2
LARGEST = "; the largest of each pixel"
LOWEST_RATIO, HIGHEST_RATIO = 0.03, 10.0


class ErrorScale(NamedTuple):
    """Metres upwards: linear to `bend_m`, above it logarithmic to `top_m`; where they are equal, linear alone."""

    bend_m: float
    top_m: float
    bottom: float
    bend: float
    top: float

    def y(self, metres: Floats) -> Floats:
        """Pixels."""
        linear = self.bottom - np.minimum(metres, self.bend_m) / self.bend_m * (self.bottom - self.bend)
        if self.top_m == self.bend_m:
            return linear
        decades = np.log10(np.clip(metres, self.bend_m, self.top_m) / self.bend_m) / math.log10(self.top_m / self.bend_m)
        result: Floats = linear - decades * (self.bend - self.top)
        return result

    def ticks(self) -> list[float]:
        """Round values, in metres."""
        step = nice_step(self.bend_m, 5)
        low = [k * step for k in range(round(self.bend_m / step) + 1)]
        decade = 10.0 ** math.ceil(math.log10(self.bend_m * 1.5))
        return low + [decade * 10.0**k for k in range(round(math.log10(self.top_m / decade)) + 1)] if self.top_m > self.bend_m else low


def error_scale(largest_m: float, radius_m: float, top: float, bottom: float) -> ErrorScale:
    """Linear while everything stays below twice the radius; else the lower part linear, so that the daily error keeps its detail."""
    fine_m = 2.0 * radius_m
    if not largest_m > fine_m:
        shown_m = max(1.25 * radius_m, 1.05 * largest_m if math.isfinite(largest_m) else 0.0)
        step = nice_step(shown_m, 5)
        limit_m = step * math.ceil(shown_m / step)
        return ErrorScale(limit_m, limit_m, bottom, top, top)
    step = nice_step(1.5 * radius_m, 4)
    bend_m = step * math.ceil(1.5 * radius_m / step)
    top_m = 10.0 ** math.ceil(math.log10(largest_m * 1.1))
    return ErrorScale(bend_m, max(top_m, 10.0 ** math.ceil(math.log10(bend_m * 1.5))), bottom, bottom - 0.58 * (bottom - top), top)


def draw_errors(drawing: Drawing, axis: TimeAxis, box: Box, data: Series, limits: Limits) -> None:
    """Horizontal error of each receiver, the radius, gaps where epochs are missing."""
    finite = data.horizontal_m[np.isfinite(data.horizontal_m)]
    scale = error_scale(float(finite.max(initial=0.0)), limits.radius_m, box.top, box.bottom)
    bent = scale.top_m > scale.bend_m
    x, runs = axis.xs(data), data.runs()
    lines = [thin(x, scale.y(data.horizontal_m[:, r]), runs) for r in range(len(RECEIVER_LOOKS))]
    how = f"; logarithmic above {metres(scale.bend_m)}" if bent else ""
    how += LARGEST * any(line.thinned for line in lines)
    heading(drawing, axis, box.top - 14, "Horizontal error", f"good: below the radius of {limits.radius_m:.2f} m{how}")
    for value in scale.ticks():
        y = float(scale.y(np.array(value)))
        drawing.line(box.left, y, box.right, y, stroke=GRID)
        drawing.text(box.left - 7, y + 4, metres(value), 11, anchor="end", fill=QUIET)
    if bent:
        drawing.line(box.left, scale.bend, box.right, scale.bend, stroke=QUIET, stroke_dasharray="2 3")
    time_grid(drawing, axis, box)
    for r, (line, look) in reversed(list(enumerate(zip(lines, RECEIVER_LOOKS, strict=True)))):
        _draw_line(drawing, line, f"error-{r}", look.stroke, 1.1 if line.thinned else 1.5, look.dash)
    radius_y = float(scale.y(np.array(limits.radius_m)))
    drawing.line(box.left, radius_y, box.right, radius_y, id="radius", stroke=INK, stroke_width=1.4)
    drawing.text(box.right - 6, radius_y - 5, f"radius {limits.radius_m:.2f} m", 11.5, anchor="end", bold=True, halo=True)
    for r, (name, look) in enumerate(zip(data.reports[0].receivers, RECEIVER_LOOKS, strict=True)):
        y = box.top + 14 + 19 * r
        drawing.line(box.right + 10, y, box.right + 38, y, stroke=look.stroke, stroke_dasharray=look.dash, stroke_width=2)
        drawing.text(box.right + 44, y + 4, fitted(name, 12, 40, bold=True), 12, bold=True)
    _frame(drawing, box)


def draw_ratios(drawing: Drawing, axis: TimeAxis, box: Box, data: Series) -> None:
    """A row per main check, all with the same logarithmic axis; what is above the limit is filled."""
    x, runs = axis.xs(data), data.runs()
    more_than_pixels = thin(x, np.zeros_like(x), runs).thinned
    good = f"below 1 is good; logarithmic, clipped to {LOWEST_RATIO:g} and {HIGHEST_RATIO:g}" + LARGEST * more_than_pixels
    heading(drawing, axis, box.top - 14, "Statistic / threshold", good)
    height = (box.bottom - box.top) / len(MAIN_CHECKS)
    time_grid(drawing, axis, box)
    for i, (name, checks) in enumerate(MAIN_CHECKS):
        row = Box(box.left, box.top + i * height, box.right, box.top + (i + 1) * height)
        _draw_ratio(drawing, row, x, runs, data.ratio(*checks), name)
    _frame(drawing, box)
    time_labels(drawing, axis, box.bottom)


def _draw_ratio(drawing: Drawing, row: Box, x: Floats, runs: Ints, ratio: Floats, name: str) -> None:
    def y_of(value: Floats) -> Floats:
        share = np.log10(np.clip(value, LOWEST_RATIO, HIGHEST_RATIO) / LOWEST_RATIO) / math.log10(HIGHEST_RATIO / LOWEST_RATIO)
        result: Floats = row.bottom - 3 - share * (row.bottom - row.top - 6)
        return result

    limit_y = float(y_of(np.array(1.0)))
    y = y_of(ratio)
    drawing.line(row.left, row.bottom, row.right, row.bottom, stroke=GRID)
    line = thin(x, y, runs)
    _draw_line(drawing, line, f"ratio-{name}", "#0072b2", 0.9 if line.thinned else 1.1)
    above = thin(x, np.where(ratio > 1.0, y, np.nan), runs)
    filled = "".join(path([(float(p[0, 0]), limit_y), *_pairs(p), (float(p[-1, 0]), limit_y)], closed=True) for p in above.pieces)
    if filled:
        drawing.add("path", d=filled, fill=ALARM, stroke=ALARM, stroke_width=1.6, stroke_linejoin="round")
    drawing.line(row.left, limit_y, row.right, limit_y, stroke=INK, stroke_width=0.9)
    drawing.text(row.left - 7, limit_y + 4, "limit 1", 11, anchor="end", fill=QUIET)
    worst = float(np.fmax.reduce(ratio))
    drawing.text(row.right + 10, limit_y - 3, name, 12, bold=True)
    drawing.text(row.right + 10, limit_y + 11, "no value" if math.isnan(worst) else f"max {rounded(worst)}", 11, fill=QUIET)


def _draw_line(drawing: Drawing, line: Line, id_: str, stroke: str, width: float, dash: str = "none") -> None:
    """The pieces of a line; a point without neighbours is a dot."""
    d = "".join(path(_pairs(piece)) for piece in line.pieces if len(piece) > 1)
    dots = "".join(path(_pairs(piece)) for piece in line.pieces if len(piece) == 1)
    if d:
        drawing.add("path", id=id_, d=d, fill="none", stroke=stroke, stroke_width=width, stroke_dasharray=dash, stroke_linejoin="round")
    if dots:
        drawing.add("path", id=f"{id_}-dots", d=dots, fill="none", stroke=stroke, stroke_width=DOT_PX, stroke_linecap="round")


def _pairs(piece: Floats) -> list[tuple[float, float]]:
    return [(float(x), float(y)) for x, y in piece]


def _frame(drawing: Drawing, box: Box) -> None:
    drawing.rect(box, fill="none", stroke=QUIET, stroke_width=0.8)
