"""What trials cannot reach, in four plots: smallest faults, the line of acceptance, wrong names, false alarms."""

from collections.abc import Mapping, Sequence
from typing import Any

from recordings.campaign.axes import (
    ALARM,
    ALL_MONITORS,
    ALONE,
    GAIN,
    Scale,
    bars,
    dots,
    frame,
    heading,
    line,
    sideward,
    upward,
)
from recordings.report.svg import GRID, INK, QUIET, WHITE, Box, Drawing

KIND_LOOKS = {"one": (ALL_MONITORS, "none"), "two alike": (ALARM, "6 3"), "two opposite": (ALONE, "2 3")}
DECADES = [(10.0**-k, "1" if k == 0 else f"1e-{k}") for k in range(0, 9, 2)]
NAMES_WRONG = 1e-3  # at most, that is asked for
ROW_PX = 22.0


def draw_theory(drawing: Drawing, boxes: Sequence[Box], top: float, left: float, found: Mapping[str, Any]) -> None:
    """All four, in boxes of one height; headings stand above each."""
    drawing.text(left, top, "What trials cannot reach: statistics of errors exactly as the site states them", 15, bold=True)
    _draw_smallest(drawing, boxes[0], found["smallest_faults"])
    _draw_line(drawing, boxes[1], found["line"])
    _draw_naming(drawing, boxes[2], found["naming"])
    _draw_alarms(drawing, boxes[3], found["false_alarms"])


def _draw_smallest(drawing: Drawing, box: Box, faults: Sequence[Mapping[str, Any]]) -> None:
    heading(drawing, box, "Smallest fault caught", "measured over stated; good: within 15 % of 1")
    inner = box._replace(left=box.left + 26)
    x = Scale(0.8, 1.2, inner.left, inner.right - 78)
    drawing.rect(Box(x.px(0.85), box.top, x.px(1.15), box.bottom), fill=GAIN)
    drawing.line(x.px(1.0), box.top, x.px(1.0), box.bottom, stroke=QUIET)
    for i, of in enumerate(faults):
        y = box.top + (i + 0.5) * (box.bottom - box.top) / len(faults)
        drawing.text(inner.left - 6, y + 3.5, of["check"], 10.5, anchor="end")
        line(drawing, [(x.px(of["low"] / of["theory"]), y), (x.px(of["high"] / of["theory"]), y)], ALL_MONITORS)
        colour = ALL_MONITORS if of["agrees"] else ALARM
        dots(drawing, [(x.px(of["ratio"]), y)], colour, colour)
        unit = "sigma" if of["fault"].startswith("sigma") else "m"
        drawing.text(box.right, y + 3.5, f"{of['measured']:g} {unit}", 10.5, anchor="end", fill=INK)
    plot = Box(inner.left, box.top, inner.right - 78, box.bottom)
    frame(drawing, plot)
    sideward(drawing, plot, x, [(0.85, "0.85"), (1.0, "1"), (1.15, "1.15")], "measured / stated")


def _draw_line(drawing: Drawing, box: Box, found: Mapping[str, Any]) -> None:
    verdict = "passes" if found["passes"] else f"fails; passes from {found['least_tolerance_m']:g} m on"
    heading(drawing, box, "Missed by the residual check", f"tolerance {found['tolerance_m']:g} m: {verdict}")
    points = found["points"]
    largest = points[-1]["size_m"]
    x, y = Scale(0.0, largest, box.left, box.right), Scale(1e-8, 1.0, box.bottom, box.top, True)
    upward(drawing, box, y, DECADES)
    line(drawing, [(x.px(p["size_m"]), y.px(p["allowed"])) for p in points], INK, "5 3")
    line(drawing, [(x.px(p["size_m"]), y.px(max(p["missed"], 1e-9))) for p in points if p["missed"] > 1e-9], ALL_MONITORS, width=2.0)
    frame(drawing, box)
    step = 2.0 if largest < 11 else 5.0
    sideward(drawing, box, x, [(k * step, f"{k * step:g}") for k in range(int(largest / step) + 1)], "range error of one satellite, m")
    drawing.text(box.left + 8, box.bottom - 24, "dashed: may be missed (a proposal)", 10.5, halo=True)
    drawing.text(box.left + 8, box.bottom - 10, "blue: is missed", 10.5, fill=ALL_MONITORS, halo=True)


def _draw_naming(drawing: Drawing, box: Box, found: Mapping[str, Any]) -> None:
    wrong = found["wrong"]
    words = f"{wrong['count']} of {wrong['of']}: at most {wrong['at_most']:.1e}; good: below {NAMES_WRONG:g}"
    heading(drawing, box, "A sound receiver named, by size", words)
    x, y = Scale(0.5, 50.0, box.left, box.right, True), Scale(1e-5, 1.0, box.bottom, box.top, True)
    upward(drawing, box, y, [(1.0, "1"), (1e-1, "0.1"), (1e-2, "0.01"), (1e-3, "1e-3"), (1e-4, "1e-4"), (1e-5, "1e-5")])
    drawing.line(box.left, y.px(NAMES_WRONG), box.right, y.px(NAMES_WRONG), stroke=INK, stroke_width=1.2)
    for i, (kind, (stroke, dash)) in enumerate(KIND_LOOKS.items()):
        of_kind = [of for of in found["sizes"] if of["kind"] == kind]
        line(drawing, [(x.px(of["size_m"]), y.px(of["wrong"]["at_most"])) for of in of_kind], stroke, dash)
        drawing.text(box.right, box.bottom - 36 + 13 * i, f"{kind} off, 95 % bound", 10.5, anchor="end", fill=stroke, halo=True)
    of_one = [(x.px(of["size_m"]), y.px(max(of["right"], 1e-5))) for of in found["sizes"] if of["kind"] == "one" and of["right"] > 0.0]
    line(drawing, of_one, "#009e73", width=1.4)
    drawing.text(box.right, box.bottom - 49, "the one that is off, named", 10.5, anchor="end", fill="#00795a", halo=True)
    frame(drawing, box)
    sideward(drawing, box, x, [(v, f"{v:g}") for v in (0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0)], "off by, m")


def _draw_alarms(drawing: Drawing, box: Box, promises: Sequence[Mapping[str, Any]]) -> None:
    days = sum(of["days"] for of in promises)
    heading(drawing, box, "False stops, promised and simulated", f"{days:g} days; good: the bar holds the line")
    y = Scale(0.1, 2e4, box.bottom, box.top, True)
    upward(drawing, box, y, [(0.1, "0.1"), (1.0, "1"), (10.0, "10"), (100.0, "100"), (1e3, "1000"), (1e4, "1e4")])
    step = (box.right - box.left) / len(promises)
    for i, of in enumerate(promises):
        middle = box.left + (i + 0.5) * step
        drawing.line(middle - 0.36 * step, y.px(of["promised"]), middle + 0.36 * step, y.px(of["promised"]), stroke=INK, stroke_width=1.4)
        bars(drawing, [(middle, y.px(max(of["stops_low"], 0.1)), y.px(of["stops_high"]))], ALL_MONITORS)
        colour = ALL_MONITORS if of["kept"] else ALARM
        dots(drawing, [(middle, y.px(max(of["stops"], 0.1)))], colour if of["stops"] else WHITE, colour)
        drawing.text(middle + 9, y.px(max(of["stops"], 0.14)) + 4, str(of["stops"]), 10.5, fill=colour, halo=True)
        drawing.text(middle, box.bottom + 14, f"{of['per_year']:g} a year", 10, anchor="middle", fill=QUIET)
        drawing.text(middle, box.bottom + 29, f"{of['days']:g} days", 10, anchor="middle", fill=QUIET)
    drawing.line(box.left, box.bottom, box.right, box.bottom, stroke=GRID)
    drawing.text(box.left + 6, box.top + 12, "line: promised; dot: came, exact 95 % bars", 10.5, halo=True)
    frame(drawing, box)
