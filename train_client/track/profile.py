"""Strips over distance: curvature, cant, gradient and height of every edge, one edge after another, and what holds on which stretch."""

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from integrity.gnss.observations import Floats, Ints
from recordings.report.svg import GRID, INK, QUIET, Box, Drawing, fitted, metres, nice_step, path, text_width_px
from train_client.track.geometry import shape_of
from train_client.track.track_map import Section, TrackMap

STRIP_PX, BETWEEN_PX, LANE_PX = 84.0, 16.0, 20.0
TOP_PX, BOTTOM_PX = 30.0, 52.0
TRACK, NO_GNSS, NO_RADIO, VOUCHED, OTHER, BAND = "#0072b2", "#e69f00", "#cc79a7", "#7fcab4", "#9e9e9e", "#f0e4c8"


class Strip(NamedTuple):
    """One quantity over distance; around zero, or from its least to its greatest value. `facts` are written beside it."""

    name: str
    meaning: str
    value: Floats
    around_zero: bool
    facts: tuple[str, ...]


def profile_height(track: TrackMap) -> float:
    """Pixels that the strips take."""
    return TOP_PX + 4 * (STRIP_PX + BETWEEN_PX) + len(_lanes(track)) * LANE_PX + BOTTOM_PX


def draw_profile(drawing: Drawing, track: TrackMap, box: Box) -> None:
    """All strips, edges from left to right in the order of the map."""
    lengths_m = [float(edge.s_m[-1] - edge.s_m[0]) for edge in track.edges]
    per_m = (box.right - box.left) / sum(lengths_m)
    starts = [box.left + per_m * sum(lengths_m[:index]) for index in range(len(lengths_m))]

    def x_of(index: int, s_m: float) -> float:
        return starts[index] + per_m * (s_m - float(track.edges[index].s_m[0]))

    x = np.concatenate([start + per_m * (edge.s_m - edge.s_m[0]) for start, edge in zip(starts, track.edges, strict=True)])
    runs = np.repeat(np.arange(len(lengths_m)), [len(edge.s_m) for edge in track.edges])
    ends = [*starts[1:], box.right]
    for edge, left, right in zip(track.edges, starts, ends, strict=True):
        words = fitted(edge.id, 12, right - left - 8, bold=True)
        if len(words) > 1 or words == edge.id:
            drawing.text((left + right) / 2, box.top + 12, words, 12, anchor="middle", fill=TRACK, bold=True)
    top = box.top + TOP_PX
    bottom = top
    for strip in _strips(track):
        area = Box(box.left, bottom, box.right, bottom + STRIP_PX)
        for section in track.sections:
            if not section.gnss:
                index = track.edge_index[section.edge]
                drawing.rect(Box(x_of(index, section.from_m), area.top, x_of(index, section.to_m), area.bottom), fill=BAND)
        _draw_strip(drawing, area, strip, x, runs)
        bottom = area.bottom + BETWEEN_PX
    for words, fill, sections in _lanes(track):
        spans = [(x_of(track.edge_index[s.edge], s.from_m), x_of(track.edge_index[s.edge], s.to_m)) for s in sections]
        _draw_lane(drawing, Box(box.left, bottom, box.right, bottom + LANE_PX), words, fill, spans)
        bottom += LANE_PX
    for left in starts[1:]:
        drawing.line(left, top, left, bottom, stroke=QUIET, stroke_dasharray="2 3")
    _draw_axis(drawing, track, starts, ends, per_m, bottom, x_of)


def _strips(track: TrackMap) -> list[Strip]:
    shapes = [shape_of(edge) for edge in track.edges]
    curvature = np.concatenate([shape.curvature_per_m for shape in shapes]) * 1000.0
    cant = np.concatenate([edge.cant_rad for edge in track.edges]) * 1000.0
    gradient = np.concatenate([np.append(shape.gradient, shape.gradient[-1]) for shape in shapes]) * 100.0
    height = np.concatenate([shape.height_m for shape in shapes])
    tightest = float(np.abs(curvature).max())
    least = f"least R {metres(1000.0 / tightest)}" if tightest > 1e-3 else "straight"
    return [
        Strip("Curvature", "1/km, right turns up", curvature, True, (least,)),
        Strip("Cant", "mrad, right rail low up", cant, True, (f"{cant.min():.0f} to {cant.max():.0f} mrad",)),
        Strip("Gradient", "%, climbing up", gradient, True, (f"{gradient.min():z.2f} to {gradient.max():z.2f} %",)),
        Strip("Height", "m above ellipsoid", height, False, (f"{height.min():.2f} to", f"{height.max():.2f} m")),
    ]


def _draw_strip(drawing: Drawing, area: Box, strip: Strip, x: Floats, runs: Ints) -> None:
    low, high, ticks = _scale(strip)
    y = area.bottom - (strip.value - low) / (high - low) * (area.bottom - area.top)
    for tick in ticks:
        at = area.bottom - (tick - low) / (high - low) * (area.bottom - area.top)
        drawing.line(area.left, at, area.right, at, stroke=QUIET if strip.around_zero and tick == 0 else GRID)
        drawing.text(area.left - 7, at + 4, f"{tick:g}", 10.5, anchor="end", fill=QUIET)
    for piece in _thinned(x, y, runs):
        drawing.add(
            "path", d=path([(float(a), float(b)) for a, b in piece]), fill="none", stroke=TRACK, stroke_width=1.6, stroke_linejoin="round"
        )
    drawing.text(area.right + 10, area.top + 14, strip.name, 12.5, bold=True)
    for k, words in enumerate((strip.meaning, *strip.facts)):
        drawing.text(area.right + 10, area.top + 31 + 15 * k, words, 10.5, fill=QUIET if k == 0 else INK)
    drawing.rect(area, fill="none", stroke=QUIET)


def _thinned(x_px: Floats, y_px: Floats, runs: Ints) -> list[Floats]:
    """A line (n, 2) a run, of which every pixel column keeps its highest and its lowest point: no outlier is lost."""
    column = np.floor(x_px)
    order = np.lexsort((y_px, column, runs))
    new = (np.diff(column[order]) != 0) | (np.diff(runs[order]) != 0)
    kept = np.unique(np.concatenate((order[np.concatenate(([True], new))], order[np.concatenate((new, [True]))])))
    points = np.stack((x_px[kept], y_px[kept]), axis=-1)
    return np.split(points, np.flatnonzero(np.diff(runs[kept])) + 1)


def _scale(strip: Strip) -> tuple[float, float, list[float]]:
    """Least and greatest value shown, and round ones between."""
    least, greatest = float(strip.value.min()), float(strip.value.max())
    if strip.around_zero:
        reach = max(abs(least), abs(greatest), 0.1) * 1.15
        low, high = -reach, reach
    else:
        room = max(0.12 * (greatest - least), 0.5)
        low, high = least - room, greatest + room
    step = nice_step(high - low, 4)
    return low, high, [k * step for k in range(math.ceil(low / step), math.floor(high / step) + 1)]


def _lanes(track: TrackMap) -> list[tuple[str, str, list[Section]]]:
    """A row for everything that sections say: who vouches where, and what is missing where."""
    stations = dict.fromkeys(section.station for section in track.sections if section.station)
    lanes = [(f"{station} vouches", VOUCHED, [s for s in track.sections if s.station == station]) for station in stations]
    classes = dict.fromkeys(section.multipath for section in track.sections if section.multipath)
    lanes += [(f"multipath {name}", OTHER, [s for s in track.sections if s.multipath == name]) for name in classes]
    lanes += [
        ("no GNSS", NO_GNSS, [s for s in track.sections if not s.gnss]),
        ("no radio", NO_RADIO, [s for s in track.sections if not s.radio]),
    ]
    return [(words, fill, sections) for words, fill, sections in lanes if sections]


def _draw_lane(drawing: Drawing, area: Box, words: str, fill: str, spans: list[tuple[float, float]]) -> None:
    middle = (area.top + area.bottom) / 2
    drawing.line(area.left, middle, area.right, middle, stroke=GRID)
    for left, right in spans:
        drawing.rect(Box(left, middle - 4, max(right, left + 1.5), middle + 4), fill=fill)
    drawing.text(area.right + 10, middle + 4, fitted(words, 11, 140), 11)


def _draw_axis(
    drawing: Drawing, track: TrackMap, starts: list[float], ends: list[float], per_m: float, y: float, x_of: Callable[[int, float], float]
) -> None:
    """Distances under each edge, from its own beginning."""
    step_m = nice_step(45.0 / per_m, 1)
    for index, edge in enumerate(track.edges):
        free = starts[index] - 30.0
        for k in range(math.ceil(float(edge.s_m[0]) / step_m - 1e-9), math.floor(float(edge.s_m[-1]) / step_m) + 1):
            at, words = x_of(index, k * step_m), f"{k * step_m:g}"
            half = text_width_px(words, 11) / 2
            drawing.line(at, y, at, y + 5, stroke=INK)
            if at - half > free and at + half < ends[index] + (30.0 if index == len(starts) - 1 else -4.0):
                drawing.text(at, y + 18, words, 11, anchor="middle")
                free = at + half + 6
    drawing.text((starts[0] + ends[-1]) / 2, y + 38, "s in metres, of each edge from its own beginning", 11, anchor="middle", fill=QUIET)
