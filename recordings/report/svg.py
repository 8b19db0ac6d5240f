"""A small SVG writer: elements, escaping, fixed decimals, the room that a text takes, and ticks of axes.

Coordinates are pixels, x to the right, y down. The same calls give the same bytes: nothing here depends on a locale, a clock or a hash.
"""

import math
import re
from collections.abc import Iterable, Sequence
from typing import Literal, NamedTuple

from integrity.gnss.gps_time import DAY_S, NS_PER_S, civil_from_days, gps_from_utc, utc_from_gps

FONT = "system-ui, -apple-system, 'Segoe UI', Roboto, 'Helvetica Neue', Arial, 'DejaVu Sans', sans-serif"
INK = "#1a1a1a"
QUIET = "#595959"  # 7:1 on white
GRID = "#dedede"
WHITE = "#ffffff"

Anchor = Literal["start", "middle", "end"]
Value = str | float

_NOT_IN_XML = re.compile("[^\t\n\r\u0020-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")
_ENTITIES = {"&": "&amp;", "<": "&lt;", ">": "&gt;", '"': "&quot;"}

_ASCENT_EM, _DESCENT_EM = 0.80, 0.22  # of letters and digits; accents may rise above
# Advance widths of DejaVu Sans for U+0020 to U+007E, in hundredths of an em, rounded up; read from the font's own `hmtx` table.
_WIDTHS = (
    *(32, 41, 46, 84, 64, 96, 78, 28, 40, 40, 50, 84, 32, 37, 32, 34, 64, 64, 64, 64, 64, 64, 64, 64, 64, 64, 34, 34, 84, 84, 84, 54),
    *(100, 69, 69, 70, 78, 64, 58, 78, 76, 30, 30, 66, 56, 87, 75, 79, 61, 79, 70, 64, 62, 74, 69, 99, 69, 62, 69, 40, 34, 40, 84, 50),
    *(50, 62, 64, 55, 64, 62, 36, 64, 64, 28, 28, 58, 28, 98, 64, 62, 64, 64, 42, 53, 40, 64, 60, 82, 60, 60, 53, 64, 34, 64, 84),
)
_MONTHS = ("Jan", "Feb", "Mar", "Apr", "May", "Jun", "Jul", "Aug", "Sep", "Oct", "Nov", "Dec")
_TIME_STEPS_S = (1, 2, 5, 10, 15, 30, 60, 120, 300, 600, 900, 1800, 3600, 7200, 10_800, 14_400, 21_600, 43_200)


class Box(NamedTuple):
    """A rectangle on the page."""

    left: float
    top: float
    right: float
    bottom: float

    def overlaps(self, other: "Box") -> bool:
        """Whether the two have an area in common; touching is not overlapping."""
        return self.left < other.right and other.left < self.right and self.top < other.bottom and other.top < self.bottom


class Drawing:
    """Elements in the order of drawing, and the boxes of all texts so far."""

    def __init__(self) -> None:
        self._lines: list[str] = []
        self.text_boxes: list[Box] = []

    def add(self, name: str, content: str | None = None, /, **attributes: Value) -> None:
        """One element; an underscore in an attribute's name is written as a hyphen, `content` is escaped."""
        written = "".join(f' {key.rstrip("_").replace("_", "-")}="{_value(value)}"' for key, value in attributes.items())
        self._lines.append(f"<{name}{written}/>" if content is None else f"<{name}{written}>{escape(content)}</{name}>")

    def text(
        self,
        x: float,
        y: float,
        content: str,
        size: float,
        *,
        anchor: Anchor = "start",
        fill: str = INK,
        bold: bool = False,
        halo: bool = False,
    ) -> None:
        """A line of text on the baseline y; `halo` keeps it readable on lines."""
        more: dict[str, Value] = {}
        if bold:
            more["font_weight"] = "bold"
        if halo:
            more |= {"stroke": WHITE, "stroke_width": 3, "stroke_linejoin": "round", "paint_order": "stroke"}
        self.text_boxes.append(text_box(x, y, content, size, anchor, bold))
        self.add("text", content, x=x, y=y, font_size=size, text_anchor=anchor, fill=fill, **more)

    def rect(self, box: Box, **attributes: Value) -> None:
        """A rectangle."""
        self.add("rect", x=box.left, y=box.top, width=box.right - box.left, height=box.bottom - box.top, **attributes)

    def line(self, x1: float, y1: float, x2: float, y2: float, **attributes: Value) -> None:
        """A straight line."""
        self.add("line", x1=x1, y1=y1, x2=x2, y2=y2, **attributes)

    def open(self, name: str, **attributes: Value) -> None:
        """Begin an element that holds others."""
        self.add(name, **attributes)
        self._lines[-1] = self._lines[-1][:-2] + ">"

    def close(self, name: str) -> None:
        """End it."""
        self._lines.append(f"</{name}>")

    def document(self, width: float, height: float, title: str, description: str) -> str:
        """The whole file, ending with a newline; `title` and `description` are what a screen reader says."""
        head = Drawing()
        head.open(
            "svg",
            xmlns="http://www.w3.org/2000/svg",
            viewBox=f"0 0 {number(width)} {number(height)}",
            width=width,
            height=height,
            role="img",
            aria_labelledby="title desc",
            font_family=FONT,
        )
        head.add("title", title, id="title")
        head.add("desc", description, id="desc")
        head.rect(Box(0, 0, width, height), fill=WHITE)
        return "\n".join([*head._lines, *self._lines, "</svg>"]) + "\n"


def number(value: float) -> str:
    """One decimal, none where it is zero: a tenth of a pixel is finer than any eye. ValueError for what is not a number."""
    if not math.isfinite(value):
        raise ValueError(f"a coordinate of {value} cannot be drawn")
    written = f"{value:.1f}".removesuffix(".0")
    return "0" if written == "-0" else written


def escape(text: str) -> str:
    """Text for an XML file; characters that XML forbids become U+FFFD."""
    return "".join(_ENTITIES.get(c, c) for c in _NOT_IN_XML.sub("\ufffd", text))


def _value(value: Value) -> str:
    return escape(value) if isinstance(value, str) else number(value)


def path(points: Iterable[tuple[float, float]], closed: bool = False) -> str:
    """`d` of a path through points. One point alone is drawn as a dot, if the line's caps are round."""
    steps = [f"{number(x)} {number(y)}" for x, y in points]
    return "M" + ("L".join(steps) if len(steps) > 1 else f"{steps[0]}h0") + ("Z" if closed else "")


def text_width_px(text: str, size: float, bold: bool = False) -> float:
    """Width of a text, from above: in DejaVu Sans, the widest of the fonts that may be taken; its bold is up to 15 % wider."""
    return size * sum(map(_glyph_em, text)) * (1.15 if bold else 1.0)


def _glyph_em(c: str) -> float:
    code = ord(c)
    if 0x20 <= code < 0x7F:
        return _WIDTHS[code - 0x20] / 100
    return 0.8 if code < 0x2000 else 1.02  # accented letters; dashes, and ideographs, which fill a square


def text_box(x: float, y: float, content: str, size: float, anchor: Anchor = "start", bold: bool = False) -> Box:
    """The room that a text takes, from above."""
    width = text_width_px(content, size, bold)
    left = x - {"start": 0.0, "middle": 0.5, "end": 1.0}[anchor] * width
    return Box(left, y - _ASCENT_EM * size, left + width, y + _DESCENT_EM * size)


def fitted(text: str, size: float, width: float, bold: bool = False) -> str:
    """The text, cut with an ellipsis where it is wider than there is room."""
    if text_width_px(text, size, bold) <= width:
        return text
    keep = len(text)
    while keep and text_width_px(text[:keep].rstrip() + "…", size, bold) > width:
        keep -= 1
    return text[:keep].rstrip() + "…"


def metres(value: float) -> str:
    """A length as people say it."""
    if value >= 1000.0:
        return f"{rounded(value / 1000.0)} km"
    return f"{rounded(value)} m"


def rounded(value: float) -> str:
    """A number to three figures."""
    if not math.isfinite(value):
        return "infinite"
    if value >= 1e5:
        return f"{value:.1e}".replace("e+0", "e").replace("e+", "e")
    return f"{value:.0f}" if value >= 99.5 else f"{value:.3g}"


def nice_step(span: float, most: int) -> float:
    """The smallest of 1, 2, 5 times a power of ten that cuts a span in at most so many steps."""
    decade = 10.0 ** math.floor(math.log10(span / most))
    return next(m * decade for m in (1.0, 2.0, 5.0, 10.0) if span <= m * decade * most * (1 + 1e-9))


def time_ticks(start_ns: int, end_ns: int, most: int) -> list[tuple[int, str]]:
    """Round UTC times between two GPS times, at most about so many: (GPS time, label). At midnight the label is the date."""
    seconds = (end_ns - start_ns) / NS_PER_S
    step_s = next((s for s in _TIME_STEPS_S if seconds <= s * most), DAY_S * max(1, math.ceil(seconds / DAY_S / most)))
    first = -(-utc_from_gps(start_ns) // (step_s * NS_PER_S))
    last = utc_from_gps(end_ns) // (step_s * NS_PER_S)
    times_s = [k * step_s for k in range(first, last + 1)]
    return [(gps_from_utc(t_s * NS_PER_S), _tick_label(t_s, step_s)) for t_s in times_s]


def _tick_label(utc_s: int, step_s: int) -> str:
    days, of_day = divmod(utc_s, DAY_S)
    if of_day == 0:
        _, month, day = civil_from_days(days)
        return f"{day} {_MONTHS[month - 1]}"
    clock = f"{of_day // 3600:02d}:{of_day // 60 % 60:02d}"
    return clock if step_s >= 60 else f"{clock}:{of_day % 60:02d}"


def first_free(candidates: Sequence[Box], taken: Sequence[Box]) -> int | None:
    """Which candidate overlaps nothing that is taken; None when every one does."""
    return next((i for i, box in enumerate(candidates) if not any(box.overlaps(other) for other in taken)), None)
