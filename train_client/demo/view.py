"""A small live view for terminals: every vertex of the triangle against its circle, and the train on its line."""

import math
from collections.abc import Sequence
from typing import NamedTuple

from rich.text import Text

from integrity.messages import wayside_pb2 as pb
from train_client.demo.records import HealthSeen
from train_client.demo.telling import place_words
from train_client.demo.truth import Truth
from train_client.demo.watch import trust_of
from train_client.trust import TrustState

ROWS, COLUMNS = 7, 15  # of a circle; a character is about twice as high as wide
WIDTH = 23  # of a circle with its label
VIEW = 1.25  # radius of what is shown, in radii of the circle
LINE_COLUMNS = 60


class VertexSeen(NamedTuple):
    """Of one receiver: solved minus surveyed, m; None where there is no position."""

    name: str
    east_m: float | None
    north_m: float | None


class Scene(NamedTuple):
    """What the view shows. Metres along the line: of the front end as the train says, and in truth."""

    station: str
    vertices: tuple[VertexSeen, ...]
    radius_m: float
    train: str
    train_uses_gnss: bool
    place_m: float | None
    truth_m: float
    line_m: float


def scene_of(
    health: HealthSeen, report: pb.EpochReport, position: pb.TrainPosition, error_m: float | None, truth: Truth, radius_m: float
) -> Scene:
    """Of the latest of everything."""
    trusted = trust_of(position) is TrustState.NORMAL and position.HasField("front")
    return Scene(
        station=str(health.state) + (f"  {health.cause}" if health.cause else "") + f" {' '.join((*health.subjects, *health.excluded))}",
        vertices=tuple(
            VertexSeen(v.receiver, v.east_m, v.north_m) if v.HasField("east_m") else VertexSeen(v.receiver, None, None)
            for v in report.triangle
        ),
        radius_m=radius_m,
        train=f"{trust_of(position).value}  {place_words(position, error_m) if trusted else 'GNSS not used'}",
        train_uses_gnss=trusted,
        place_m=truth.running_m(position.front.edge, position.front.offset_m) if trusted else None,
        truth_m=truth.front_m(position.gps_time_ns) if position.HasField("gps_time_ns") else 0.0,
        line_m=truth.line.length_m,
    )


def draw(scene: Scene) -> Text:
    """The whole view."""
    circles = [circle(vertex, scene.radius_m) for vertex in scene.vertices]
    lines = ["   ".join(parts) for parts in zip(*circles, strict=True)] if circles else []
    labels = "   ".join(label(vertex).ljust(WIDTH)[:WIDTH] for vertex in scene.vertices)
    text = Text(no_wrap=True, overflow="crop")
    text.append("\n".join([labels, *lines]) + "\n")
    text.append(f"station  {scene.station}\n", "bold green" if scene.station.startswith("NORMAL") else "bold red")
    text.append(f"train    {scene.train}\n", "bold green" if scene.train_uses_gnss else "bold red")
    text.append(track(scene.place_m, scene.truth_m, scene.line_m))
    return text


def label(vertex: VertexSeen) -> str:
    """Name and offset, as in `B  e +12.0  n -9.0 m`."""
    if vertex.east_m is None or vertex.north_m is None:
        return f"{vertex.name}  no position"
    return f"{vertex.name}  e {vertex.east_m:+.1f}  n {vertex.north_m:+.1f} m"


def circle(vertex: VertexSeen, radius_m: float) -> list[str]:
    """The circle, the surveyed point `+` and the solved one `o`; at the rim an arrowhead `*` where it is outside the view."""
    grid = [[" "] * WIDTH for _ in range(ROWS)]
    for k in range(72):
        _mark(grid, math.sin(k * math.tau / 72) / VIEW, math.cos(k * math.tau / 72) / VIEW, ".")
    _mark(grid, 0.0, 0.0, "+")
    if vertex.east_m is not None and vertex.north_m is not None:
        x, y = vertex.east_m / (radius_m * VIEW), vertex.north_m / (radius_m * VIEW)
        far = math.hypot(x, y)
        _mark(grid, x / max(far, 1.0), y / max(far, 1.0), "o" if far <= 1.0 else "*")
    return ["".join(row) for row in grid]


def track(place_m: float | None, truth_m: float, line_m: float) -> str:
    """The line from west to east with the train `>` as it says, or its true place `x` where it says nothing."""
    marks = ["-"] * LINE_COLUMNS
    at_m, mark = (truth_m, "x") if place_m is None else (place_m, ">")
    marks[min(max(int(at_m / line_m * LINE_COLUMNS), 0), LINE_COLUMNS - 1)] = mark
    return f"west |{''.join(marks)}| east"


def _mark(grid: Sequence[list[str]], x: float, y: float, mark: str) -> None:
    """At (x, y) of a view from -1 to 1 each way, north up."""
    column, row = round((x + 1.0) / 2.0 * (COLUMNS - 1)), round((1.0 - y) / 2.0 * (ROWS - 1))
    grid[row][column] = mark
