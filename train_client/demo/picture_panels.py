"""The two panels of the demo's picture, at one moment: the triangle as it is solved, and the train on its line. Both to scale, north up."""

import math
from typing import NamedTuple

import numpy as np

from integrity.gnss.observations import Floats
from integrity.messages import wayside_pb2 as pb
from integrity.states import State
from recordings.report.marks import ALARM, state_mark
from recordings.report.svg import GRID, INK, QUIET, WHITE, Box, Drawing, fitted, metres, nice_step, path, text_width_px
from train_client.demo.picture_told import DEAD, SILENT, Told, confirmed_now, latest, off_m
from train_client.track.plot import Plan

SOLVED = "#0072b2"
MUTE, GONE = "#bdbdbd", "#8f8f8f"  # of words that nobody vouches for; ink on them has a contrast of 5:1 and more
TRACK = "#595959"
TRAIN_PX = 6.5
LEGEND_PX = 70.0
EDGE_PX = 18.0  # for labels below
MIDDLE_EM = 0.36  # from the baseline of a text to its middle

Point = tuple[float, float]


class Words(NamedTuple):
    """The state of something as words."""

    word: str
    lines: tuple[str, ...]


class Solved(NamedTuple):
    """The solved triangle on the page: `inside` and `out` are vertices in their circles and out of them, each with its label."""

    corners: tuple[Point, ...]
    inside: tuple[Point, ...]
    out: tuple[tuple[Point, str], ...]
    heard: bool


class Seen(NamedTuple):
    """The train on the page: confirmed, or solved but provisional, or neither; and where it was confirmed last if that is elsewhere."""

    confirmed: Point | None
    provisional: Point | None
    last: Point | None


def draw_words(drawing: Drawing, box: Box, words: Words) -> None:
    """A mark, a word and lines under it."""
    mark(drawing, words.word, box.left + 11, box.top + 12, 8.0)
    drawing.text(box.left + 28, box.top + 18, words.word, 17, bold=True)
    for k, line in enumerate(words.lines):
        size = 13.0 if k == 0 else 12.0
        drawing.text(box.left, box.top + 38 + 17 * k, fitted(line, size, box.right - box.left), size, fill=INK if k == 0 else QUIET)


def mark(drawing: Drawing, word: str, x: float, y: float, r: float) -> None:
    """Of a state; of silence a grey circle with a bar, of what is gone with a cross."""
    if word in set(State):
        state_mark(drawing, State(word), x, y, r)
        return
    reach = 0.45 * r
    bar = path([(x - reach, y), (x + reach, y)])
    cross = path([(x - reach, y - reach), (x + reach, y + reach)]) + path([(x - reach, y + reach), (x + reach, y - reach)])
    drawing.add("circle", cx=x, cy=y, r=r, fill=block(word), stroke=INK, stroke_width=1)
    drawing.add("path", d=cross if is_gone(word) else bar, stroke=INK, stroke_width=max(1.2, 0.24 * r), stroke_linecap="round")


def is_gone(word: str) -> bool:
    """Silent for long."""
    return word in (DEAD, pb.TrustState.Name(pb.TRUST_NO_COMMS).removeprefix("TRUST_"))


def block(word: str) -> str:
    """Colour of a stretch of time without a message."""
    return GONE if is_gone(word) else MUTE


class TrianglePanel:
    """The reference triangle with its circles, which do not move, and what is solved."""

    def __init__(self, told: Told, box: Box) -> None:
        self._told = told
        self._box = box
        east_m, north_m = told.triangle.baseline_enu_m[:, 0], told.triangle.baseline_enu_m[:, 1]
        room_m, room_px = 2.0 * told.radius_m, (box.right - box.left - 2 * LEGEND_PX, box.bottom - box.top - 2 * EDGE_PX)
        self._per_m = float(min(room_px[0] / (np.ptp(east_m) + room_m), room_px[1] / (np.ptp(north_m) + room_m)))
        self._middle_m = (float(east_m.max() + east_m.min()) / 2.0, float(north_m.max() + north_m.min()) / 2.0)
        self._points_m = list(zip(east_m.tolist(), north_m.tolist(), strict=True))

    def still(self, drawing: Drawing) -> None:
        """Triangle, circles, names inside, where few vertices go, scale."""
        told, points = self._told, [self._px(*point) for point in self._points_m]
        drawing.add("path", d=path(points, closed=True), fill="#f2f6f9", stroke=INK, stroke_width=1.2, stroke_linejoin="round")
        r = told.radius_m * self._per_m
        centre = np.mean(points, axis=0)
        for name, (x, y) in zip(told.triangle.names, points, strict=True):
            drawing.add("circle", cx=x, cy=y, r=r, fill=WHITE, stroke=INK, stroke_width=1.2)
            away = np.array([x, y]) - centre
            dx, dy = -away / max(float(np.hypot(*away)), 1.0) * (r + 13)
            drawing.text(x + float(dx), y + float(dy) + 13 * MIDDLE_EM, name, 13, anchor="middle", bold=True)
        sides = [f"{a}–{b} {metres(side_m)}" for (a, b), side_m in told.triangle.sides_m.items()]
        lines = ("To scale", *sides, f"circles: {told.radius_m:.2f} m")
        for k, words in enumerate(lines):
            drawing.text(self._box.left, self._box.bottom - 4 - 14 * (len(lines) - 1 - k), words, 10.5, fill=QUIET)

    def view(self, story_s: float) -> Solved:
        """What was heard last."""
        report = latest(self._told.heard, story_s).report
        solved = {vertex.receiver: vertex for vertex in report.triangle if vertex.HasField("east_m")}
        inside: list[Point] = []
        out: dict[Point, list[str]] = {}
        corners = []
        for name, (east_m, north_m) in zip(self._told.triangle.names, self._points_m, strict=True):
            if name not in solved:
                continue
            vertex = solved[name]
            place = self._px(east_m + vertex.east_m, north_m + vertex.north_m)
            corners.append(place)
            if off_m(vertex) <= self._told.radius_m and name not in report.verdict_subjects:
                inside.append(place)
            else:
                near = next((other for other in out if max(abs(other[0] - place[0]), abs(other[1] - place[1])) < 8), place)
                out.setdefault(near, []).append(name)
        words = {place: self._label(names, solved) for place, names in out.items()}
        heard = latest(self._told.station, story_s).word not in (SILENT, DEAD)
        return Solved(tuple(corners), tuple(inside), tuple(words.items()), heard)

    def draw(self, drawing: Drawing, view: Solved) -> None:
        """Solved triangle, dots inside, diamonds with a label outside; all grey when nothing is heard."""
        colour = (ALARM if view.out else SOLVED) if view.heard else GONE
        if len(view.corners) > 1:
            drawing.add("path", d=path(view.corners, closed=True), fill="none", stroke=colour, stroke_width=2, stroke_linejoin="round")
        dots = "".join(path([place]) for place in view.inside)
        if dots:
            drawing.add("path", d=dots, stroke=SOLVED if view.heard else GONE, stroke_width=7, stroke_linecap="round")
        for (x, y), label in view.out:
            corners = [(x, y - 7), (x + 7, y), (x, y + 7), (x - 7, y)]
            drawing.add("path", d=path(corners, closed=True), fill=ALARM if view.heard else GONE, stroke=INK)
            right = x < (self._box.left + self._box.right) / 2.0 + LEGEND_PX
            below = y + 24 < self._box.bottom
            place = (x + (10 if right else -10), y + (19 if below else -12))
            drawing.text(*place, label, 12, anchor="start" if right else "end", bold=True, halo=True)
        if not view.heard:
            x, y = self._px(*self._middle_m)
            drawing.text(x, y + 4, "last heard", 12, anchor="middle", fill=QUIET, halo=True)

    def _px(self, east_m: float, north_m: float) -> Point:
        x = (self._box.left + self._box.right) / 2.0 + 24 + (east_m - self._middle_m[0]) * self._per_m
        y = (self._box.top + self._box.bottom) / 2.0 - (north_m - self._middle_m[1]) * self._per_m
        return round(x, 1), round(y, 1)

    def _label(self, names: list[str], solved: dict[str, pb.Vertex]) -> str:
        if len(names) == 1:
            return f"{names[0]} {off_m(solved[names[0]]):.0f} m off"
        return f"{', '.join(names)} at one point"


class LinePanel:
    """The line in plan, and the train on it."""

    def __init__(self, told: Told, box: Box) -> None:
        self._told = told
        points = np.concatenate([edge.pos_ecef_m for edge in told.track.edges])
        origin = (points.max(axis=0) + points.min(axis=0)) / 2.0
        flat = np.einsum("ni,ji->nj", points - origin, told.triangle.enu[0, :2])
        low, high = flat.min(axis=0), flat.max(axis=0)
        span = np.maximum(high - low, 1.0)
        room = np.array([box.right - box.left - 24, box.bottom - box.top - 40])
        self._plan = Plan(origin, told.triangle.enu[0, :2], (low + high) / 2.0, float((room / span).min()), box)

    def still(self, drawing: Drawing) -> None:
        """Track, its nodes, the station's triangle, scale and marks."""
        told, plan = self._told, self._plan
        station = _pairs(plan.px(told.triangle.pos_ecef_m))
        for edge in told.track.edges:
            drawing.add(
                "path", d=path(_pairs(plan.px(edge.pos_ecef_m))[::4]), fill="none", stroke=GRID, stroke_width=7, stroke_linecap="round"
            )
        for edge in told.track.edges:
            line = _pairs(plan.px(edge.pos_ecef_m))
            drawing.add("path", d=path([*line[::4], line[-1]]), fill="none", stroke=TRACK, stroke_width=1.8, stroke_linejoin="round")
            for x, y in (line[0], line[-1]):
                drawing.add("circle", cx=x, cy=y, r=2.5, fill=WHITE, stroke=TRACK, stroke_width=1.4)
            x, y = max((line[len(line) // 4], line[3 * len(line) // 4]), key=lambda place: math.dist(place, station[0]))
            drawing.text(x + 10, y + 18, edge.id, 10.5, fill=QUIET)
        drawing.add("path", d=path(station, closed=True), fill=SOLVED, stroke=SOLVED, stroke_width=2, stroke_linejoin="round")
        drawing.text(station[0][0] + 12, station[0][1] + 15, "station", 10.5, fill=QUIET)
        self._scale(drawing)

    def view(self, story_s: float) -> Seen:
        """What the train said last."""
        ridden = self._told.ridden
        position = latest(ridden, story_s).position
        last = self._px(position.last_confirmed) if position.HasField("last_confirmed") else None
        if confirmed_now(position):
            return Seen(last, None, None)
        return Seen(None, self._px(position.front) if position.HasField("front") else None, last)

    def draw(self, drawing: Drawing, view: Seen) -> None:
        """A full disc, a hollow one, a faint one, each with its words."""
        if view.last is not None:
            self._disc(drawing, view.last, "last confirmed", fill=SOLVED, fill_opacity="0.3", stroke="none")
        if view.provisional is not None:
            x, y = view.provisional
            drawing.add("circle", cx=x, cy=y, r=TRAIN_PX, fill=WHITE, stroke=INK, stroke_width=1.6, stroke_dasharray="3 2")
            drawing.text(x + 4, y + 22, "not confirmed", 11, fill=QUIET)
        if view.confirmed is not None:
            self._disc(drawing, view.confirmed, "confirmed", fill=SOLVED, stroke=INK)

    def _disc(self, drawing: Drawing, place: Point, words: str, **look: str) -> None:
        x, y = place
        drawing.add("circle", cx=x, cy=y, r=TRAIN_PX, stroke_width=1.6, **look)
        right = max(x + 4, self._plan.box.left + text_width_px(words, 11))
        drawing.text(right, y - 19, words, 11, anchor="end", fill=QUIET)

    def _px(self, place: pb.TrackPlace) -> Point:
        edge = self._told.track.edges[self._told.track.edge_index[place.edge]]
        at = np.array([[np.interp(place.offset_m, edge.s_m, axis) for axis in edge.pos_ecef_m.T]])
        x, y = self._plan.px(at)[0]
        return round(float(x), 1), round(float(y), 1)

    def _scale(self, drawing: Drawing) -> None:
        box, per_m = self._plan.box, self._plan.per_m
        length_m = nice_step(50.0 / per_m, 1)
        right, y = box.right - 8, box.bottom - 10
        left = right - length_m * per_m
        drawing.add("path", d=path([(left, y - 5), (left, y), (right, y), (right, y - 5)]), fill="none", stroke=INK, stroke_width=1.4)
        drawing.text((left + right) / 2, y - 9, metres(length_m), 10.5, anchor="middle", fill=QUIET)


def _pairs(px: Floats) -> list[Point]:
    return [(float(x), float(y)) for x, y in px]
