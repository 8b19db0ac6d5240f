"""A campaign in one picture: every threat in a small plot of its own, and below what trials cannot reach."""

from collections.abc import Mapping
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
    upward,
    value_labels,
)
from recordings.campaign.theory_panels import draw_theory
from recordings.report.svg import GRID, INK, QUIET, WHITE, Box, Drawing, fitted, path, rounded, text_width_px

WIDTH_PX, MARGIN_PX, LABELS_PX = 1280.0, 30.0, 46.0
COLUMNS, GAP_PX = 4, 20.0
TOP_PX, ROW_PX, PLOT_PX = 187.0, 209.0, 92.0
THEORY_PX = 330.0
PERCENT_TICKS = [(0.0, "0 %"), (0.5, "50 %"), (1.0, "100 %")]


def campaign_svg(found: Mapping[str, Any]) -> str:
    """The picture of `summary.as_json_object`, with `theory` if it is there, as the text of an SVG file."""
    threats = found["threats"]
    rows = -(-len(threats) // COLUMNS)
    below_px = TOP_PX + rows * ROW_PX
    height = below_px + (THEORY_PX if "theory" in found else 0.0) + 10.0
    drawing = Drawing()
    _header(drawing, found)
    for i, threat in enumerate(threats):
        _threat(drawing, plot_box(i % COLUMNS, TOP_PX + i // COLUMNS * ROW_PX, PLOT_PX), threat, found["radius_m"])
    if "theory" in found:
        drawing.line(MARGIN_PX, below_px - 14, WIDTH_PX - MARGIN_PX, below_px - 14, stroke=GRID)
        draw_theory(drawing, [plot_box(i, below_px + 62, 190.0) for i in range(COLUMNS)], below_px + 12, MARGIN_PX, found["theory"])
    words = "; ".join(f"{t['id']}: {_best(t)}" for t in threats)
    return drawing.document(WIDTH_PX, height, "Fault-injection campaign", f"Share of trials caught at the largest size. {words}.")


def plot_box(column: int, top: float, height: float) -> Box:
    """Where a plot stands; its labels are left of it."""
    width = (WIDTH_PX - 2 * MARGIN_PX - (COLUMNS - 1) * GAP_PX) / COLUMNS
    left = MARGIN_PX + column * (width + GAP_PX)
    return Box(left + LABELS_PX, top, left + width, top + height)


def _best(threat: Mapping[str, Any]) -> str:
    share = threat["sizes"][-1]["detected"]
    return f"{share['count']} of {share['of']}"


def _header(drawing: Drawing, found: Mapping[str, Any]) -> None:
    wrong, hazards = found["named_wrongly"], found["hazards"]
    drawing.text(MARGIN_PX, 42, "What is caught of each fault, how soon, and who is named", 21, bold=True)
    facts = (
        f"{found['trials']} trials on {len(found['stages'])} streams; someone else named in {wrong['count']} (at most "
        f"{100 * wrong['at_most']:.2g} %); NORMAL beyond {found['tolerance_m']:g} m in {hazards['count']} (at most "
        f"{100 * hazards['at_most']:.2g} %); 95 % confidence"
    )
    drawing.text(MARGIN_PX, 66, fitted(facts, 13, WIDTH_PX - 2 * MARGIN_PX), 13)
    about = f"{found['software']}, site {', '.join(found['sites'])}, seed {found['seed']}. Sizes are evenly spaced, not to scale."
    drawing.text(MARGIN_PX, 85, fitted(about, 11.5, WIDTH_PX - 2 * MARGIN_PX), 11.5, fill=QUIET)
    _legend(drawing, 108.0, found)
    drawing.line(MARGIN_PX, 139, WIDTH_PX - MARGIN_PX, 139, stroke=GRID)


def _legend(drawing: Drawing, y: float, found: Mapping[str, Any]) -> None:
    x = MARGIN_PX
    for words, stroke, fill, dash in (
        ("all monitors: share of trials caught, 95 % bars", ALL_MONITORS, ALL_MONITORS, "none"),
        ("the triangle alone: circles and shape", ALONE, WHITE, "4 3"),
    ):
        line(drawing, [(x, y - 4), (x + 30, y - 4)], stroke, dash)
        dots(drawing, [(x + 15, y - 4)], fill, stroke)
        drawing.text(x + 37, y, words, 11.5)
        x += 37 + text_width_px(words, 11.5) + 28
    drawing.rect(Box(x, y - 10, x + 22, y + 2), fill=GAIN)
    drawing.text(x + 29, y, "the gain", 11.5)
    x += 29 + text_width_px("the gain", 11.5) + 28
    drawing.text(x, y, "alert: time to it, 95 % of cases, s", 11.5)
    x += text_width_px("alert: time to it, 95 % of cases, s", 11.5) + 28
    drawing.text(x, y, "wrong: names", 11.5, fill=ALARM, bold=True)
    moved = (
        f"moved: how far the fault had moved a position by then, horizontally, in 95 % of cases, m; the radius is {found['radius_m']:g} m"
    )
    drawing.text(MARGIN_PX, y + 19, moved, 11.5)


def _threat(drawing: Drawing, box: Box, threat: Mapping[str, Any], radius_m: float) -> None:
    """Detection against size; below, sizes, time to alert, how far a position was moved by then, wrong names."""
    sizes = threat["sizes"]
    harmless = threat["kind"] == "harmless"
    good = "harmless, good is 0 %" if harmless else f"{threat['kind']}, for {rounded(threat['duration_s'])} s"
    heading(drawing, box, threat["id"], threat["title"] + f", {threat['unit']}" * bool(threat["unit"]), good)
    y = Scale(0.0, 1.0, box.bottom, box.top)
    step = (box.right - box.left) / len(sizes)
    x = [box.left + (i + 0.5) * step for i in range(len(sizes))]
    upward(drawing, box, y, PERCENT_TICKS)
    shares = [of["detected"] for of in sizes]
    alone = [(x_, y.px(_value(of["triangle_alone"]))) for x_, of in zip(x, sizes, strict=True)]
    caught = [(x_, y.px(_value(share))) for x_, share in zip(x, shares, strict=True)]
    if len(sizes) > 1:
        drawing.add("path", d=path([*caught, *reversed(alone)], closed=True), fill=GAIN)
    line(drawing, alone, ALONE, "4 3", 1.3)
    dots(drawing, alone, WHITE, ALONE, 2.6)
    bars(drawing, [(x_, y.px(s["low"]), y.px(s["high"])) for x_, s in zip(x, shares, strict=True) if s["of"]], ALL_MONITORS)
    line(drawing, caught, ALL_MONITORS)
    dots(drawing, caught, ALL_MONITORS, ALL_MONITORS, 2.8)
    frame(drawing, box)
    drawing.text(box.left - 6, box.bottom + 13, "size", 9.5, anchor="end", fill=QUIET)
    for x_, of in zip(x, sizes, strict=True):
        drawing.text(x_, box.bottom + 13, rounded_size(of["size"]), 9.5, anchor="middle", fill=INK)
    alerts = ["–" if of["time_to_alert_s"] is None else rounded(of["time_to_alert_s"]["p95"]) for of in sizes]
    value_labels(drawing, box.bottom + 27, list(zip(x, alerts, strict=True)), "alert s", box.left)
    moved_m = [0.0 if of["shift_m"] is None else of["shift_m"]["p95"] for of in sizes]
    too_far = [moved > radius_m for moved in moved_m]
    value_labels(drawing, box.bottom + 40, list(zip(x, [f"{m:.1f}" for m in moved_m], strict=True)), "moved m", box.left, too_far)
    wrong = [of["named_wrongly"] for of in sizes]
    value_labels(drawing, box.bottom + 53, list(zip(x, map(str, wrong), strict=True)), "wrong", box.left, [count > 0 for count in wrong])


def rounded_size(size: float) -> str:
    """As the catalogue has it: sizes are few and round."""
    return f"{size:g}" if size < 1e5 else rounded(size)


def _value(share: Mapping[str, Any]) -> float:
    return share["count"] / share["of"] if share["of"] else 0.0
