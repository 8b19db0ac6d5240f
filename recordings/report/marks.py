"""How a state and a receiver look: word, shape and colour together, so that neither a copier nor an eye loses one.

Colours are those of Okabe and Ito (2008), "Color universal design", chosen here so that the states also differ in lightness.
"""

import math
from collections.abc import Iterable
from typing import NamedTuple

from integrity.states import State
from recordings.report.svg import INK, WHITE, Drawing, path


class StateLook(NamedTuple):
    """`fill` of the shape, `block` of a stretch of time; words in `INK` keep a contrast of 4.5:1 and more on every block."""

    fill: str
    block: str


class LineLook(NamedTuple):
    """Colour and dash of a receiver's line."""

    stroke: str
    dash: str


STATE_LOOKS = {
    State.NORMAL: StateLook("#009e73", "#cfeae1"),
    State.SATELLITE_ANOMALY: StateLook("#e69f00", "#e69f00"),
    State.NOT_CONFIRMABLE: StateLook("#d55e00", "#d55e00"),
}
ALARM = "#d55e00"
RECEIVER_LOOKS = (LineLook("#0072b2", "none"), LineLook("#cc79a7", "7 3"), LineLook("#000000", "1.5 3"))


def state_mark(drawing: Drawing, state: State, x: float, y: float, r: float) -> None:
    """A circle with a tick, an octagon with an exclamation mark, a diamond with a question mark."""
    if state is State.NORMAL:
        drawing.add("circle", cx=x, cy=y, r=r, fill=STATE_LOOKS[state].fill)
    else:
        state_marks(drawing, state, [(x, y)], r)
    _sign(drawing, state, x, y, r)


def state_marks(drawing: Drawing, state: State, places: Iterable[tuple[float, float]], r: float) -> None:
    """Many small marks of a state that is not NORMAL: the shape alone, without a sign in it."""
    corners, turn, reach = (8, math.pi / 8, 1.05 * r) if state is State.SATELLITE_ANOMALY else (4, 0.0, 1.25 * r)
    around = [(reach * math.cos(a), reach * math.sin(a)) for a in (turn + 2 * math.pi * k / corners for k in range(corners))]
    d = "".join(path([(x + dx, y + dy) for dx, dy in around], closed=True) for x, y in places)
    if d:
        drawing.add("path", d=d, fill=STATE_LOOKS[state].fill, stroke=INK, stroke_width=0.12 * r + 0.2, stroke_linejoin="round")


def _sign(drawing: Drawing, state: State, x: float, y: float, r: float) -> None:
    if state is State.NORMAL:
        strokes = path([(x - 0.45 * r, y + 0.05 * r), (x - 0.1 * r, y + 0.4 * r), (x + 0.5 * r, y - 0.35 * r)])
        drawing.add("path", d=strokes, fill="none", stroke=WHITE, stroke_width=0.28 * r, stroke_linecap="round", stroke_linejoin="round")
        return
    dot = path([(x, y + 0.55 * r)])
    if state is State.SATELLITE_ANOMALY:
        strokes = path([(x, y - 0.55 * r), (x, y + 0.15 * r)]) + dot
    else:
        arc = [(x + 0.32 * r * math.cos(a), y - 0.3 * r + 0.32 * r * math.sin(a)) for a in (math.pi + 0.5 * k for k in range(9))]
        strokes = path([*arc, (x, y + 0.18 * r)]) + dot
    drawing.add("path", d=strokes, fill="none", stroke=INK, stroke_width=0.24 * r, stroke_linecap="round", stroke_linejoin="round")
