"""`wayside map plot`: the map as a picture. Above the plan, north up; below it what a train feels and an antenna needs, over distance."""

import math
from typing import NamedTuple

import numpy as np

from integrity.gnss.frames import enu_axes, geodetic_from_ecef
from integrity.gnss.observations import Floats
from recordings.report.svg import (
    GRID,
    INK,
    QUIET,
    WHITE,
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
from train_client.track.checks import check_map
from train_client.track.profile import NO_GNSS, NO_RADIO, TRACK, draw_profile, profile_height
from train_client.track.track_map import Node, Section, TrackMap

WIDTH_PX, MARGIN_PX, TOP_PX = 1200.0, 32.0, 112.0
PLAN_PX = (240.0, 460.0)  # least and greatest height
KEEP_PX = 0.7  # points closer than this to the last one drawn are not seen

Point = tuple[float, float]


class Plan(NamedTuple):
    """Where ECEF comes to lie: `corner_enu_m` at the middle of the box, `per_m` pixels a metre, north up."""

    origin_ecef_m: Floats
    enu: Floats  # (2, 3): east, north
    middle_m: Floats  # (2,)
    per_m: float
    box: Box

    def px(self, pos_ecef_m: Floats) -> Floats:
        """Pixels (n, 2) of points (n, 3)."""
        offset = (np.einsum("ni,ji->nj", pos_ecef_m - self.origin_ecef_m, self.enu) - self.middle_m) * self.per_m
        x, y = (self.box.left + self.box.right) / 2.0, (self.box.top + self.box.bottom) / 2.0
        return np.column_stack((x + offset[:, 0], y - offset[:, 1]))


def map_svg(track: TrackMap) -> str:
    """The picture of a map as the text of an SVG file; the same map gives the same bytes. ValueError where points are not on the Earth."""
    check = check_map(track)
    if check.facts is None:
        raise ValueError("a map with points that are not on the Earth cannot be drawn: see `wayside map check`")
    facts = check.facts
    plan = _plan(track)
    profile_top = plan.box.bottom + 62.0
    height = profile_top + profile_height(track)
    drawing = Drawing()
    summary = f"{metres(facts.length_m)} of track, {facts.edges} edge{'s' * (facts.edges != 1)}, {facts.nodes} nodes, {facts.points} points"
    radius = "all straight" if math.isinf(facts.least_radius_m) else f"least radius {metres(facts.least_radius_m)}"
    extremes = f"{radius}, cant up to {facts.greatest_cant_rad * 1000:.0f} mrad, gradient up to {facts.greatest_gradient * 100:.1f} %"
    drawing.text(MARGIN_PX, 44, fitted(f"Track map {track.id}", 21, 700, bold=True), 21, bold=True)
    drawing.text(MARGIN_PX, 69, f"{summary}; {extremes}", 14)
    drawing.text(WIDTH_PX - MARGIN_PX, 44, fitted(f"{track.frame}, valid from {track.valid_from}", 12, 420), 12, anchor="end", fill=QUIET)
    drawing.text(WIDTH_PX - MARGIN_PX, 69, f"sha256 {track.sha256[:16]}…", 12, anchor="end", fill=QUIET)
    drawing.line(MARGIN_PX, 88, WIDTH_PX - MARGIN_PX, 88, stroke=GRID)
    _draw_plan(drawing, track, plan)
    draw_profile(drawing, track, Box(MARGIN_PX + 62, profile_top, WIDTH_PX - MARGIN_PX - 130, height))
    return drawing.document(WIDTH_PX, height, f"Track map {track.id}", f"{summary}. {extremes}.")


def _plan(track: TrackMap) -> Plan:
    """As large as the page lets it be."""
    points = np.concatenate([edge.pos_ecef_m for edge in track.edges])
    origin = (points.max(axis=0) + points.min(axis=0)) / 2.0
    lat_rad, lon_rad, _ = geodetic_from_ecef(origin)
    enu = enu_axes(lat_rad, lon_rad)[:2]
    flat = np.einsum("ni,ji->nj", points - origin, enu)
    low, high = flat.min(axis=0), flat.max(axis=0)
    width_m, height_m = (max(float(span), 1.0) for span in high - low)
    room_px = WIDTH_PX - 2 * MARGIN_PX - 120.0
    per_m = min(room_px / width_m, (PLAN_PX[1] - 90.0) / height_m)
    height_px = min(max(height_m * per_m + 90.0, PLAN_PX[0]), PLAN_PX[1])
    return Plan(origin, enu, (low + high) / 2.0, per_m, Box(MARGIN_PX, TOP_PX, WIDTH_PX - MARGIN_PX, TOP_PX + height_px))


def _draw_plan(drawing: Drawing, track: TrackMap, plan: Plan) -> None:
    lines = [_thinned(plan.px(edge.pos_ecef_m)) for edge in track.edges]
    for section in track.sections:
        _draw_section(drawing, track, plan, section)
    for line in lines:
        drawing.add("path", d=path(line), fill="none", stroke=TRACK, stroke_width=2.2, stroke_linejoin="round", stroke_linecap="round")
    taken = [Box(x - 4, y - 4, x + 4, y + 4) for line in lines for x, y in line[:: max(1, len(line) // 400)]]
    marks: list[tuple[Point, str, float, str]] = []
    marks += [mark for node in track.nodes if (mark := _draw_node(drawing, track, plan, node)) is not None]
    for boundary in track.boundaries:
        (x, y), (across_x, across_y) = _at(track, plan, boundary.edge, boundary.at_m)
        drawing.line(
            x - 9 * across_x, y - 9 * across_y, x + 9 * across_x, y + 9 * across_y, stroke=INK, stroke_width=2, stroke_dasharray="3 2"
        )
        marks.append(((x, y), boundary.id, 11.0, INK))
    marks += [(line[len(line) // 2], edge.id, 12.0, TRACK) for edge, line in zip(track.edges, lines, strict=True)]
    marks += _draw_distances(drawing, track, plan)
    for place, words, size, fill in marks:
        _label(drawing, place, words, size, fill, taken, plan.box)
    _directions(drawing, track, plan)


def _thinned(px: Floats) -> list[Point]:
    """A line without the points that nobody sees."""
    run_px = np.concatenate(([0.0], np.cumsum(np.hypot(*np.diff(px, axis=0).T))))
    keep = np.concatenate(([True], np.diff(np.floor(run_px / KEEP_PX)) > 0))
    keep[-1] = True
    return [(float(x), float(y)) for x, y in px[keep]]


def _draw_section(drawing: Drawing, track: TrackMap, plan: Plan, section: Section) -> None:
    """A broad band under the track where there is no GNSS, a dashed one where there is no radio."""
    edge = track.edges[track.edge_index[section.edge]]
    inside = edge.s_m[(edge.s_m > section.from_m) & (edge.s_m < section.to_m)]
    s_m = np.concatenate(([section.from_m], inside, [section.to_m]))
    d = path(_thinned(plan.px(np.column_stack([np.interp(s_m, edge.s_m, edge.pos_ecef_m[:, axis]) for axis in range(3)]))))
    if not section.gnss:
        drawing.add("path", d=d, fill="none", stroke=NO_GNSS, stroke_width=11, stroke_opacity=0.6, stroke_linejoin="round")
    if not section.radio:
        drawing.add("path", d=d, fill="none", stroke=NO_RADIO, stroke_width=6, stroke_dasharray="3 3")


def _draw_node(drawing: Drawing, track: TrackMap, plan: Plan, node: Node) -> tuple[Point, str, float, str] | None:
    """A circle, a diamond for a switch or a crossing; nothing for a node without an edge."""
    ends = track.ends_at[node.id]
    if not ends:
        return None
    x, y = (float(v) for v in plan.px(track.edges[ends[0].edge].pos_ecef_m[[-1 if ends[0].last else 0]])[0])
    if node.kind in ("switch", "crossing"):
        d = path([(x, y - 7), (x + 7, y), (x, y + 7), (x - 7, y)], closed=True)
        drawing.add("path", d=d, fill=INK, stroke=WHITE, stroke_width=1.2)
    else:
        drawing.add("circle", cx=x, cy=y, r=4.5, fill=WHITE, stroke=INK, stroke_width=1.6)
    return (x, y), node.id, 11.5, INK


def _draw_distances(drawing: Drawing, track: TrackMap, plan: Plan) -> list[tuple[Point, str, float, str]]:
    """Ticks at round s, 60 to 150 pixels apart."""
    longest_m = max(float(edge.s_m[-1] - edge.s_m[0]) for edge in track.edges)
    step_m = max(nice_step(60.0 / plan.per_m, 1), nice_step(longest_m, 100))  # s may be wrong, and far longer than the track
    marks = []
    for edge in track.edges:
        for k in range(math.ceil(float(edge.s_m[0]) / step_m + 0.2), math.floor(float(edge.s_m[-1]) / step_m - 0.2) + 1):
            (x, y), (across_x, across_y) = _at(track, plan, edge.id, k * step_m)
            drawing.line(x - 5 * across_x, y - 5 * across_y, x + 5 * across_x, y + 5 * across_y, stroke=INK, stroke_width=1.2)
            marks.append(((x, y), f"{k * step_m / 1000:g} km" if step_m >= 1000 else f"{k * step_m:g} m", 10.5, QUIET))
    return marks


def _at(track: TrackMap, plan: Plan, edge_id: str, s_m: float) -> tuple[Point, Point]:
    """Where a place of an edge is drawn, and the unit vector across the track there."""
    edge = track.edges[track.edge_index[edge_id]]
    i = min(max(int(np.searchsorted(edge.s_m, s_m)), 1), len(edge.s_m) - 1)
    (ax, ay), (bx, by) = (tuple(map(float, px)) for px in plan.px(edge.pos_ecef_m[i - 1 : i + 1]))
    share = (s_m - float(edge.s_m[i - 1])) / float(edge.s_m[i] - edge.s_m[i - 1])
    length = max(math.hypot(bx - ax, by - ay), 1e-9)
    return (ax + share * (bx - ax), ay + share * (by - ay)), ((ay - by) / length, (bx - ax) / length)


def _label(drawing: Drawing, place: Point, words: str, size: float, fill: str, taken: list[Box], room: Box) -> None:
    """Words near a place where nothing else is; without room, none."""
    half = text_width_px(words, size) / 2.0
    around = [(math.cos(a), math.sin(a)) for a in (-math.pi / 2 + k * math.pi / 4 * sign for k in range(5) for sign in (1, -1))]
    places = [(place[0] + dx * (half + away), place[1] + dy * (away + 5) + 4) for away in (12.0, 18.0, 26.0) for dx, dy in around]
    boxes = [text_box(x, y, words, size, "middle") for x, y in places]
    inside = [
        i for i, b in enumerate(boxes) if b.left >= room.left and b.right <= room.right and b.top >= room.top and b.bottom <= room.bottom
    ]
    free = first_free([boxes[i] for i in inside], taken)
    if free is not None:
        x, y = places[inside[free]]
        drawing.text(x, y, words, size, anchor="middle", fill=fill, halo=True)
        taken.append(boxes[inside[free]])


def _directions(drawing: Drawing, track: TrackMap, plan: Plan) -> None:
    """Under the plan: north, scale, and what the marks mean."""
    y = plan.box.bottom + 14
    x = plan.box.left + 10
    drawing.add("path", d=path([(x, y - 14), (x + 7, y + 8), (x, y + 3), (x - 7, y + 8)], closed=True), fill=INK)
    drawing.text(x + 12, y + 6, "N", 12, bold=True)
    length_m = nice_step(70.0 / plan.per_m, 1)
    bar_px = length_m * plan.per_m
    drawing.add(
        "path", d=path([(x + 44, y - 3), (x + 44, y + 4), (x + 44 + bar_px, y + 4), (x + 44 + bar_px, y - 3)]), fill="none", stroke=INK
    )
    drawing.text(x + 50 + bar_px, y + 6, metres(length_m), 11.5)
    right = plan.box.right
    if any(not section.radio for section in track.sections):
        right = _legend(drawing, right, y, "no radio", NO_RADIO, 6, "3 3", 1.0)
    if any(not section.gnss for section in track.sections):
        right = _legend(drawing, right, y, "no GNSS", NO_GNSS, 11, "none", 0.6)


def _legend(drawing: Drawing, right: float, y: float, words: str, stroke: str, width: float, dash: str, opacity: float) -> float:
    left = right - text_width_px(words, 11.5)
    drawing.text(left, y + 6, words, 11.5)
    drawing.add(
        "path",
        d=path([(left - 40, y + 2), (left - 6, y + 2)]),
        stroke=stroke,
        stroke_width=width,
        stroke_dasharray=dash,
        stroke_opacity=opacity,
    )
    return left - 60
