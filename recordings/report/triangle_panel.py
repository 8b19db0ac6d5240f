"""The reference triangle to scale, and a magnifier for every vertex: a tolerance circle of metres on sides of kilometres."""

import math
from collections.abc import Sequence
from itertools import combinations, permutations
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from integrity.gnss.observations import Bools, Floats
from integrity.limits import Limits
from integrity.states import State
from integrity.triangle import ReferenceTriangle
from recordings.report.marks import STATE_LOOKS, state_marks
from recordings.report.series import Series
from recordings.report.svg import (
    GRID,
    INK,
    QUIET,
    WHITE,
    Anchor,
    Box,
    Drawing,
    first_free,
    fitted,
    metres,
    nice_step,
    path,
    text_box,
    text_width_px,
)

RIM_PX = 68.0
VIEW = 1.25  # radius of the view, in radii of the tolerance circle
RIM_ROOM_PX = 42.0  # for the distances at the arrows
WORDS_PX = 64.0  # name and numbers, and the distances again
ARROW_APART_RAD = math.radians(24.0)  # an arrow speaks for all points in about its direction
CLOUD_GRID_PX = 1.0  # of the light dots; marks of the other states have a coarser one
MARK_GRID_PX = 4.0

Point = tuple[float, float]


class Slot(NamedTuple):
    """A place for a magnifier: its middle, and whether its words stand above it."""

    x: float
    y: float
    words_above: bool


def draw_triangle(drawing: Drawing, box: Box, data: Series, triangle: ReferenceTriangle, limits: Limits) -> None:
    """The panel: a magnifier in each of three corners, the plan between them, directions and scale in the fourth."""
    drawing.text(box.left, box.top, "Triangle", 13, bold=True)
    drawing.text(box.left + 70, box.top, "good: every point inside its circle", 11.5, fill=QUIET)
    xs = (box.left + RIM_PX + RIM_ROOM_PX, box.right - RIM_PX - RIM_ROOM_PX)
    above, below = box.top + 34 + WORDS_PX + RIM_PX, box.bottom - WORDS_PX - RIM_PX
    slots = [Slot(x, y, up) for y, up in ((above, True), (below, False)) for x in xs]
    plan = Box(box.left + 52, above + RIM_PX + 44, box.right - 52, below - RIM_PX - 44)
    vertices, px_per_m = _plan(triangle, plan)
    chosen = min(permutations(slots, len(vertices)), key=lambda some: sum(math.dist(v, s[:2]) for v, s in zip(vertices, some, strict=True)))

    taken: list[Box] = [box for a, b in combinations(vertices, 2) for box in _along(a, b)]
    for vertex, slot in zip(vertices, chosen, strict=True):
        taken += _leader(drawing, vertex, slot)
    drawing.add("path", d=path(vertices, closed=True), fill="#f2f6f9", stroke=INK, stroke_width=1.4, stroke_linejoin="round")
    for x, y in vertices:
        drawing.add("circle", cx=x, cy=y, r=3.5, fill=WHITE, stroke=INK, stroke_width=1.4)
        taken.append(Box(x - 5, y - 5, x + 5, y + 5))
    _sides(drawing, triangle, vertices, taken)
    for r, slot in enumerate(chosen):
        _magnifier(drawing, slot, r, data, limits, taken)
    free = next(slot for slot in slots if slot not in chosen)
    _directions(drawing, free, px_per_m, limits)


def _plan(triangle: ReferenceTriangle, box: Box) -> tuple[list[Point], float]:
    """Vertices in pixels, north up, and pixels per metre: the triangle as large as the box lets it be."""
    east_m, north_m = triangle.baseline_enu_m[:, 0], triangle.baseline_enu_m[:, 1]
    width_m, height_m = float(np.ptp(east_m)), float(np.ptp(north_m))
    per_m = min((box.right - box.left) / max(width_m, 1e-3), (box.bottom - box.top) / max(height_m, 1e-3))
    x = (box.left + box.right) / 2 + (east_m - (east_m.max() + east_m.min()) / 2) * per_m
    y = (box.top + box.bottom) / 2 - (north_m - (north_m.max() + north_m.min()) / 2) * per_m
    return [(float(a), float(b)) for a, b in zip(x, y, strict=True)], per_m


def _leader(drawing: Drawing, vertex: Point, slot: Slot) -> list[Box]:
    """A thin line from a vertex to the rim of its magnifier; returns the room it takes."""
    length = math.dist(vertex, (slot.x, slot.y))
    share = max(0.0, 1.0 - RIM_PX / length)
    rim = (vertex[0] + (slot.x - vertex[0]) * share, vertex[1] + (slot.y - vertex[1]) * share)
    drawing.line(*vertex, *rim, stroke=QUIET, stroke_width=0.9, stroke_dasharray="4 3")
    return _along(vertex, rim)


def _along(a: Point, b: Point) -> list[Box]:
    """The room of a line, as small boxes that touch."""
    steps = max(1, int(math.dist(a, b) / 5))
    points = [(a[0] + (b[0] - a[0]) * k / steps, a[1] + (b[1] - a[1]) * k / steps) for k in range(steps + 1)]
    return [Box(x - 3, y - 3, x + 3, y + 3) for x, y in points]


def _sides(drawing: Drawing, triangle: ReferenceTriangle, vertices: Sequence[Point], taken: list[Box]) -> None:
    """The length of every side beside it, at the nearest place that is free."""
    place = dict(zip(triangle.names, vertices, strict=True))
    middle = (sum(x for x, _ in vertices) / len(vertices), sum(y for _, y in vertices) / len(vertices))
    for (a, b), side_m in triangle.sides_m.items():
        label = f"{a}–{b} {side_m:.1f} m"
        places = _beside(place[a], place[b], middle, text_width_px(label, 11.5))
        boxes = [text_box(x, y, label, 11.5, "middle") for x, y in places]
        i = first_free(boxes, taken) or 0  # where none is free, the best one all the same
        taken.append(boxes[i])
        drawing.text(*places[i], label, 11.5, anchor="middle", halo=True)


def _beside(a: Point, b: Point, inner: Point, width: float) -> list[Point]:
    """Places for words of a width beside the line from a to b, the best first: near it, at its middle, away from a point `inner`."""
    length = math.dist(a, b)
    normal = ((a[1] - b[1]) / length, (b[0] - a[0]) / length) if length > 1 else (0.0, 1.0)
    outwards = -1.0 if normal[0] * (inner[0] - a[0]) + normal[1] * (inner[1] - a[1]) > 0 else 1.0
    touching = abs(normal[0]) * width / 2 + abs(normal[1]) * 6 + 6
    return [
        (a[0] + (b[0] - a[0]) * t + normal[0] * side * away, a[1] + (b[1] - a[1]) * t + normal[1] * side * away + 4)
        for away in (touching + 10.0 * k for k in range(12))
        for t in (0.5, 0.42, 0.58, 0.34, 0.66, 0.25, 0.75)
        for side in (outwards, -outwards)
    ]


def _magnifier(drawing: Drawing, slot: Slot, r: int, data: Series, limits: Limits, taken: list[Box]) -> None:
    """Grid, cloud, circle, marks, arrows, words, the later above the earlier."""
    x, y = slot.x, slot.y
    px_per_m = RIM_PX / (VIEW * limits.radius_m)
    drawing.add("circle", cx=x, cy=y, r=RIM_PX, fill=WHITE, stroke=QUIET, stroke_width=1)
    drawing.line(x - RIM_PX, y, x + RIM_PX, y, stroke=GRID)
    drawing.line(x, y - RIM_PX, x, y + RIM_PX, stroke=GRID)
    points_m = data.e_enu_m[:, r, :2]
    solved = np.isfinite(data.horizontal_m[:, r])
    inside = solved & (data.horizontal_m[:, r] <= VIEW * limits.radius_m)
    states = np.array([report.state for report in data.reports], dtype=object)
    _cloud(drawing, slot, points_m[inside & (states == State.NORMAL)] * px_per_m)
    drawing.add("circle", cx=x, cy=y, r=limits.radius_m * px_per_m, fill="none", stroke=INK, stroke_width=1.5)
    for state in (State.NOT_CONFIRMABLE, State.SATELLITE_ANOMALY):
        offsets = points_m[inside & (states == state)] * px_per_m
        state_marks(drawing, state, _places(slot, offsets, MARK_GRID_PX), 2.8)
    northing = points_m[inside, 1] / limits.radius_m
    label_y = y + limits.radius_m * px_per_m - 7
    if (northing < -0.5).sum() > (northing > 0.5).sum():  # the emptier side has the label
        label_y = y - limits.radius_m * px_per_m + 15
    drawing.text(x, label_y, f"{limits.radius_m:.2f} m", 10.5, anchor="middle", halo=True)
    outside = solved & ~inside
    _arrows(drawing, slot, points_m[outside], states[outside], taken)
    _words(drawing, slot, r, data, solved)


def _cloud(drawing: Drawing, slot: Slot, offsets_px: Floats) -> None:
    """Light dots."""
    places = _places(slot, offsets_px, CLOUD_GRID_PX)
    d = "".join(path([place]) for place in places)
    if d:
        drawing.add("path", d=d, stroke="#7fcab4", stroke_width=1.8 if len(places) > 60 else 3.0, stroke_linecap="round", fill="none")


def _places(slot: Slot, offsets_px: Floats, grid_px: float) -> list[Point]:
    """Where points (n, 2), east and north of the middle, come to lie: one place for all that share a cell of the grid."""
    cells = np.unique(np.round(offsets_px / grid_px), axis=0) * grid_px
    return [(slot.x + float(east), slot.y - float(north)) for east, north in cells]


def _arrows(drawing: Drawing, slot: Slot, points_m: Floats, states: NDArray[np.object_], taken: list[Box]) -> None:
    """At the rim, where points lie outside the view: the farthest of each direction, with its distance where there is room."""
    distance_m = np.hypot(points_m[:, 0], points_m[:, 1])
    azimuth = np.arctan2(points_m[:, 0], points_m[:, 1])
    left = np.argsort(-distance_m, kind="stable")
    while left.size:
        i = int(left[0])
        left = left[np.cos(azimuth[left] - azimuth[i]) < math.cos(ARROW_APART_RAD)]
        along = (math.sin(azimuth[i]), -math.cos(azimuth[i]))
        across = (-along[1], along[0])
        tip, tail = RIM_PX + 7, RIM_PX - 9
        corners = [(tip, 0.0), (tail, 6.0), (tail, -6.0)]
        d = path([(slot.x + a * along[0] + c * across[0], slot.y + a * along[1] + c * across[1]) for a, c in corners], closed=True)
        drawing.add("path", d=d, fill=STATE_LOOKS[states[i]].fill, stroke=INK, stroke_width=0.8, stroke_linejoin="round")
        label = metres(float(distance_m[i]))
        anchor: Anchor = "middle" if abs(along[0]) < 0.35 else "start" if along[0] > 0 else "end"
        x, y = slot.x + (tip + 4) * along[0], slot.y + (tip + 10) * along[1] + 4
        places = [(x, y + dy) for dy in (0, -8, 8, -15, 15)]
        boxes = [text_box(*place, label, 10.5, anchor) for place in places]
        free = first_free(boxes, taken)
        if free is not None:
            drawing.text(*places[free], label, 10.5, anchor=anchor, halo=True)
            taken.append(boxes[free])


def _words(drawing: Drawing, slot: Slot, r: int, data: Series, solved: Bools) -> None:
    """Name, rms and largest error, and how many epochs have a solution where some have none."""
    name = fitted(f"receiver {data.reports[0].receivers[r]}", 13, 190, bold=True)
    horizontal_m = data.horizontal_m[solved, r]
    if horizontal_m.size:
        rms_m = math.sqrt(float((horizontal_m**2).mean()))
        numbers = f"h rms {_exact(rms_m)}, max {_exact(float(horizontal_m.max()))}"
    else:
        numbers = "no solution in any epoch"
    missing = f"solved {horizontal_m.size} of {len(solved)}" if 0 < horizontal_m.size < len(solved) else ""
    top = slot.y - RIM_PX - (57 if missing else 44) if slot.words_above else slot.y + RIM_PX + 38
    drawing.text(slot.x, top, name, 13, anchor="middle", bold=True)
    drawing.text(slot.x, top + 16, numbers, 11.5, anchor="middle")
    if missing:
        drawing.text(slot.x, top + 31, missing, 11.5, anchor="middle", fill=QUIET)


def _exact(distance_m: float) -> str:
    if distance_m < 100:
        return f"{distance_m:.2f} m"
    return f"{distance_m:.0f} m" if distance_m < 1000 else f"{distance_m / 1000:.3g} km"


def _directions(drawing: Drawing, slot: Slot, px_per_m: float, limits: Limits) -> None:
    """North arrow, scale bar, and what the magnifiers show."""
    x, y = slot.x, slot.y
    arrow = path([(x, y - 44), (x + 7, y - 18), (x, y - 23), (x - 7, y - 18)], closed=True)
    drawing.add("path", d=arrow, fill=INK)
    drawing.text(x, y - 50, "N", 12, anchor="middle", bold=True)
    length_m = nice_step(55.0 / px_per_m, 1)  # 55 to 138 pixels
    half = length_m * px_per_m / 2
    bar = path([(x - half, y), (x - half, y + 6), (x + half, y + 6), (x + half, y)])
    drawing.add("path", d=bar, fill="none", stroke=INK, stroke_width=1.4)
    drawing.text(x, y + 21, metres(length_m), 11.5, anchor="middle")
    lines = (f"Magnifiers: {metres(2 * VIEW * limits.radius_m)} across,", "solved minus surveyed,", "arrows: points farther out")
    for k, words in enumerate(lines):
        drawing.text(x, y + 44 + 15 * k, words, 11, anchor="middle", fill=QUIET)
