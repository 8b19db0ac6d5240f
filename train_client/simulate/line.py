"""A railway line from pieces: exact geometry of the railhead centreline, from which maps are sampled and antennas are moved.

Heading is measured against the north of the place where the line is, so that a straight piece is a geodesic; heights are above the
ellipsoid. Errors of the integration are below 0.01 mm over some kilometres.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from integrity.gnss.frames import ecef_from_geodetic, enu_axes, geodetic_from_ecef
from integrity.gnss.observations import Floats, freeze
from train_client.track.track_map import Edge, Node, Section, TrackMap, format_map, parse_map

RAIL_CENTRES_M = 1.13  # of 1067 mm gauge: train_positioning.md, 1.3
STEP_M = 0.5  # of the dense geometry
ITERATIONS = 3  # each shrinks what the line is off by its length over the Earth's radius: over 3 km 0.7 m, 0.1 mm, below 1 um


class Piece(NamedTuple):
    """A stretch along which curvature, cant and gradient change evenly, from those before it to these at its end.

    `radius_m` is positive to the right and infinite where the line is straight: a transition (clothoid) leads from one radius to
    another, a circular curve keeps it. `cant_m`: how much lower the right rail lies. `gradient`: rise over horizontal distance.
    """

    length_m: float
    radius_m: float = math.inf
    cant_m: float = 0.0
    gradient: float = 0.0


class Start(NamedTuple):
    """Where a line begins, straight, level and without cant; the azimuth is clockwise from north."""

    lat_rad: float
    lon_rad: float
    height_m: float
    azimuth_rad: float


class Places(NamedTuple):
    """Points of a line, N of them: railhead centre (N, 3) and unit tangent (N, 3) in ECEF, cant angle (N,), right rail low > 0."""

    pos_ecef_m: Floats
    tangent: Floats
    cant_rad: Floats


@dataclass(frozen=True, eq=False)
class Line:
    """The geometry of a line: `pos_ecef_m` and `tangent` (N, 3) every `step_m` of running distance.

    Cant and gradient are linear between the ends of pieces (P + 1,), the beginning of the line included.
    """

    step_m: float
    pos_ecef_m: Floats
    tangent: Floats
    ends_m: Floats
    cant_m: Floats
    gradient: Floats

    def __post_init__(self) -> None:
        freeze(self)

    @cached_property
    def length_m(self) -> float:
        """Running distance from beginning to end."""
        return float(self.ends_m[-1])

    def at(self, s_m: Floats) -> Places:
        """The line at running distances (N,): cubics through the dense points, below 1e-10 m off. ValueError beyond its ends."""
        if not ((s_m >= 0.0) & (s_m <= self.length_m)).all():
            raise ValueError(f"running distance {s_m.min():.3f} to {s_m.max():.3f} m: the line goes from 0 to {self.length_m:.3f} m")
        k = np.minimum((s_m / self.step_m).astype(np.int64), len(self.pos_ecef_m) - 2)
        x = (s_m / self.step_m - k)[:, None]
        left, slope_left, slope_right = self.pos_ecef_m[k], self.step_m * self.tangent[k], self.step_m * self.tangent[k + 1]
        rise = self.pos_ecef_m[k + 1] - left
        bend, twist = 3.0 * rise - 2.0 * slope_left - slope_right, slope_left + slope_right - 2.0 * rise
        along = slope_left + x * (2.0 * bend + x * 3.0 * twist)
        return Places(
            pos_ecef_m=left + x * (slope_left + x * (bend + x * twist)),
            tangent=along / np.linalg.norm(along, axis=1, keepdims=True),
            cant_rad=np.arcsin(np.interp(s_m, self.ends_m, self.cant_m) / RAIL_CENTRES_M),
        )


def build_line(start: Start, pieces: Sequence[Piece]) -> Line:
    """The line that begins at `start`; running distance counts along the railhead centreline, gradients included.

    Simpson's rule along the tangent, whose axes (north and up of the place) follow from the positions of the iteration before.
    """
    ends_m = np.cumsum([0.0, *(piece.length_m for piece in pieces)])
    cant_m = np.array([0.0, *(piece.cant_m for piece in pieces)])
    gradient = np.array([0.0, *(piece.gradient for piece in pieces)])
    cells = math.ceil(ends_m[-1] / STEP_M)
    s_m = np.linspace(0.0, ends_m[-1], 2 * cells + 1)  # middles included
    turn_rad = _turn_rad(s_m, ends_m, np.array([0.0, *(1.0 / piece.radius_m for piece in pieces)]))
    slope_rad = np.arctan(np.interp(s_m, ends_m, gradient))

    pos_ecef_m = np.tile(ecef_from_geodetic(start.lat_rad, start.lon_rad, start.height_m), (len(s_m), 1))
    tangent = np.zeros_like(pos_ecef_m)
    for _ in range(ITERATIONS):
        lat_rad, lon_rad, _ = geodetic_from_ecef(pos_ecef_m)
        convergence_rad = _running_sum(np.sin(0.5 * (lat_rad[1:] + lat_rad[:-1])) * np.diff(lon_rad))
        tangent = _tangent(start.azimuth_rad + turn_rad + convergence_rad, slope_rad, enu_axes(lat_rad, lon_rad))
        pos_ecef_m = pos_ecef_m[0] + _integrated(tangent, s_m)
    return Line(2.0 * s_m[1], pos_ecef_m[::2], tangent[::2], ends_m, cant_m, gradient)


def _turn_rad(s_m: Floats, ends_m: Floats, curvature_pm: Floats) -> Floats:
    """How far the line has turned to the right by each running distance: the integral of curvature that is linear between `ends_m`."""
    length_m = np.diff(ends_m)
    k = np.clip(np.searchsorted(ends_m, s_m, side="right") - 1, 0, len(length_m) - 1)
    before_rad = _running_sum(0.5 * (curvature_pm[1:] + curvature_pm[:-1]) * length_m)
    u_m = s_m - ends_m[k]
    change = (curvature_pm[k + 1] - curvature_pm[k]) / length_m[k]
    turn_rad: Floats = before_rad[k] + u_m * (curvature_pm[k] + 0.5 * u_m * change)
    return turn_rad


def _tangent(heading_rad: Floats, slope_rad: Floats, enu: Floats) -> Floats:
    """Unit vectors (N, 3) in ECEF of a heading and a slope in the local axes (N, 3, 3)."""
    level = np.cos(slope_rad)
    local = np.stack((level * np.sin(heading_rad), level * np.cos(heading_rad), np.sin(slope_rad)), axis=1)
    tangent: Floats = np.einsum("ni,nij->nj", local, enu)
    return tangent


def _integrated(tangent: Floats, s_m: Floats) -> Floats:
    """What tangents (2n + 1, 3) add up to from the first point on, by Simpson's rule over pairs of steps.

    At the middles, which only lend their axes, halfway between the ends: 0.1 mm aside in a curve of 300 m.
    """
    pair_m = 2.0 * s_m[1]
    at_ends = _running_sum(pair_m / 6.0 * (tangent[:-2:2] + 4.0 * tangent[1::2] + tangent[2::2]))
    out = np.empty_like(tangent)
    out[::2] = at_ends
    out[1::2] = 0.5 * (at_ends[1:] + at_ends[:-1])
    return out


def _running_sum(parts: Floats) -> Floats:
    """Sums along the first axis, beginning with 0."""
    return np.concatenate((np.zeros_like(parts[:1]), np.cumsum(parts, axis=0)))


MAP_STEP_M = 4.0  # chords of 5 m would lie 10.4 mm inside a curve of 300 m
DECIMALS_M, DECIMALS_RAD = 4, 7  # of a map: a tenth of a millimetre, of the antenna too

SAMPLE_START = Start(math.radians(35.6980), math.radians(139.4905), 99.0, math.radians(62.0))
SAMPLE_PIECES = (  # an S-curve beside the triangle of `recordings/samples/triangle.toml`
    Piece(740.0),
    Piece(60.0, gradient=0.010),
    Piece(100.0, 400.0, 0.090, 0.010),
    Piece(300.0, 400.0, 0.090, 0.010),
    Piece(100.0, gradient=0.010),
    Piece(100.0, -300.0, -0.105, 0.010),
    Piece(250.0, -300.0, -0.105, 0.010),
    Piece(100.0, gradient=0.010),
    Piece(150.0, gradient=-0.015),
    Piece(1100.0, gradient=-0.015),
)
SAMPLE_JOINT_M = 920.0
SAMPLE_STATION = "sample"


def sample_line() -> Line:
    """The line of the samples and the demo, 3 km from west to east."""
    return build_line(SAMPLE_START, SAMPLE_PIECES)


def sample_map() -> TrackMap:
    """Its map, `recordings/samples/line.json`: edge main-1 to a joint, and main-2 from there on."""
    line = sample_line()
    edges = (
        edge_of(line, "main-1", "west", "joint", 0.0, SAMPLE_JOINT_M),
        edge_of(line, "main-2", "joint", "east", SAMPLE_JOINT_M, line.length_m),
    )
    unhashed = TrackMap(
        id="sample-line",
        version=1,
        frame="ITRF2020",
        valid_from="2026-01-01T00:00:00Z",
        sha256="",
        nodes=(Node("west", "end"), Node("joint", "joint"), Node("east", "end")),
        edges=edges,
        sections=tuple(Section(edge.id, 0.0, float(edge.s_m[-1]), station=SAMPLE_STATION) for edge in edges),
    )
    return parse_map(format_map(unhashed), "sample map")


def edge_of(line: Line, name: str, from_node: str, to_node: str, from_m: float, to_m: float) -> Edge:
    """A part of a line as surveyed: points every `MAP_STEP_M`, to a tenth of a millimetre; offsets count from its beginning."""
    s_m = np.linspace(from_m, to_m, math.ceil((to_m - from_m) / MAP_STEP_M) + 1)
    places = line.at(s_m)
    gradient = np.interp(s_m, line.ends_m, line.gradient)
    return Edge(
        id=name,
        from_node=from_node,
        to_node=to_node,
        s_m=np.round(s_m - from_m, DECIMALS_M),
        pos_ecef_m=np.round(places.pos_ecef_m, DECIMALS_M),
        cant_rad=np.round(places.cant_rad, DECIMALS_RAD),
        gradient=np.round(gradient, DECIMALS_RAD),
    )


def sample_place(running_m: float) -> tuple[str, float]:
    """Edge and offset in the sample map of a running distance along the sample line."""
    return ("main-1", running_m) if running_m < SAMPLE_JOINT_M else ("main-2", running_m - SAMPLE_JOINT_M)
