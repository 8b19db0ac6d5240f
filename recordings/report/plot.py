"""`wayside replay --plot`: what was decided, why, and the evidence, in one picture.

From top to bottom: the verdict in one sentence; what was published over time and its causes; the errors and the statistics behind it.
At the left the triangle itself. A state is always a word, a shape and a colour; every time is UTC; every panel says what is good.
"""

from collections import Counter
from collections.abc import Sequence

from integrity.gnss.gps_time import format_utc
from integrity.limits import Limits
from integrity.outputs import EpochReport
from integrity.states import State
from integrity.triangle import ReferenceTriangle
from recordings.report.charts import draw_errors, draw_ratios
from recordings.report.marks import state_mark
from recordings.report.series import Series, Span, series
from recordings.report.svg import GRID, QUIET, Box, Drawing, fitted, text_width_px
from recordings.report.time_axis import LEGEND_PX, duration, time_axis
from recordings.report.triangle_panel import draw_triangle
from recordings.report.why_panel import cause_lanes, draw_why, exclusion_lanes, why_height

WIDTH_PX, HEIGHT_PX = 1200.0, 900.0  # higher only where the causes need the room
MARGIN_PX = 32.0
TOP_PX = 128.0  # of the panels
LEAST_CHARTS_PX = 420.0


def replay_svg(
    title: str, triangle: ReferenceTriangle, limits: Limits, reports: Sequence[EpochReport], silences: Sequence[Span] = ()
) -> str:
    """The picture of a replay as the text of an SVG file; ValueError without a single epoch.

    `reports` in order of time; `silences` are the times (GPS, nanoseconds, from and to) in which a stream was silent and the station
    said so. The same arguments give the same bytes.
    """
    data = series(reports)
    axis = time_axis(data, silences, 512.0, WIDTH_PX - MARGIN_PX - LEGEND_PX)
    causes, exclusions = cause_lanes(data, silences), exclusion_lanes(data)
    charts_top = TOP_PX + why_height(causes, exclusions)
    height = max(HEIGHT_PX, charts_top + LEAST_CHARTS_PX)
    charts_px = height - 54.0 - charts_top

    drawing = Drawing()
    verdict, span = _verdict(data, silences), _span(data)
    _draw_header(drawing, title, verdict, span, data)
    draw_triangle(drawing, Box(MARGIN_PX, TOP_PX, 452.0, height - MARGIN_PX), data, triangle, limits)
    draw_why(drawing, axis, TOP_PX, data, causes, exclusions, silences)
    errors = Box(axis.left, charts_top + 14, axis.right, charts_top + 0.46 * charts_px)
    draw_errors(drawing, axis, errors, data, limits)
    draw_ratios(drawing, axis, Box(axis.left, errors.bottom + 46, axis.right, height - 54.0), data)
    description = ". ".join([f"{span}: {verdict}", *(f"{lane.words}, {lane.more}" for lane in [*causes, *exclusions])]) + "."
    return drawing.document(WIDTH_PX, height, title, description)


def _verdict(data: Series, silences: Sequence[Span]) -> str:
    normal = sum(report.state is State.NORMAL for report in data.reports)
    silent = f", silent for {duration(sum(end - start for start, end in silences))}" if silences else ""
    return f"{State.NORMAL} {normal} of {len(data.reports)} epochs{silent}"


def _span(data: Series) -> str:
    """First and last epoch."""
    start, end = (format_utc(int(ns)).removesuffix("Z").replace("T", " ") for ns in data.gps_ns[[0, -1]])
    if end == start:
        return f"{start} UTC"
    return f"{start} to {end[11:] if end[:10] == start[:10] else end} UTC"


def _draw_header(drawing: Drawing, title: str, verdict: str, span: str, data: Series) -> None:
    """Title, and the legend of states with their counts; verdict and times below."""
    counts = Counter(report.state for report in data.reports)
    x = WIDTH_PX - MARGIN_PX
    for state in reversed(State):
        words = f"{state} {counts[state]}"
        x -= text_width_px(words, 12)
        drawing.text(x, 42, words, 12)
        state_mark(drawing, state, x - 14, 38, 7)
        x -= 44
    drawing.text(MARGIN_PX, 44, fitted(title, 21, x - MARGIN_PX, bold=True), 21, bold=True)
    drawing.text(MARGIN_PX, 70, verdict, 15, bold=True)
    drawing.text(MARGIN_PX + text_width_px(verdict, 15, bold=True) + 6, 70, span, 15, fill=QUIET)
    drawing.line(MARGIN_PX, 92, WIDTH_PX - MARGIN_PX, 92, stroke=GRID)
