"""Lines of known geometry for tests of the track, laid out in the plane that touches the ellipsoid at one point."""

import numpy as np
from numpy.typing import NDArray

from integrity.gnss.frames import ecef_from_geodetic, enu_axes
from train_client.track.track_map import Edge, Node, TrackMap

Floats = NDArray[np.float64]

LAT_RAD, LON_RAD = np.deg2rad(35.7), np.deg2rad(139.46)
ORIGIN_ECEF_M = ecef_from_geodetic(LAT_RAD, LON_RAD, 60.0)
ENU = enu_axes(np.array(LAT_RAD), np.array(LON_RAD))  # rows east, north, up


def from_enu(enu_m: Floats) -> Floats:
    """ECEF (N, 3) of points east, north, up of the origin."""
    pos_ecef_m: Floats = ORIGIN_ECEF_M + np.einsum("ni,ij->nj", enu_m, ENU)
    return pos_ecef_m


def to_enu(pos_ecef_m: Floats) -> Floats:
    enu_m: Floats = np.einsum("nj,ij->ni", pos_ecef_m - ORIGIN_ECEF_M, ENU)
    return enu_m


def turning(s_m: Floats, curvature: Floats, rise: float = 0.0) -> Floats:
    """Points east, north, up (N, 3) of a line that starts northwards: `curvature` (N - 1,) of each step in 1/m, positive to the right."""
    step_m = np.diff(s_m)
    turn = step_m * curvature
    heading = np.concatenate(([0.0], np.cumsum(turn)))
    with np.errstate(invalid="ignore"):
        half = turn / 2.0
        chord_m = step_m * np.where(half == 0.0, 1.0, np.sin(half) / half)
    middle = heading[:-1] + half
    east, north = np.cumsum(chord_m * np.sin(middle)), np.cumsum(chord_m * np.cos(middle))
    run = np.column_stack((np.concatenate(([0.0], east)), np.concatenate(([0.0], north))))
    return np.column_stack((run, rise * (s_m - s_m[0])))


def edge(name: str, from_node: str, to_node: str, enu_m: Floats, s_m: Floats, cant_rad: Floats | float = 0.0) -> Edge:
    return Edge(name, from_node, to_node, s_m, from_enu(enu_m), np.broadcast_to(np.asarray(cant_rad, dtype=np.float64), s_m.shape).copy())


def line(*edges: Edge, **more: object) -> TrackMap:
    """A map of edges; its nodes are what they end at, of the kind that suits."""
    ends = [node for e in edges for node in (e.from_node, e.to_node)]
    kinds = {1: "end", 2: "joint"}
    nodes = tuple(Node(name, kinds.get(ends.count(name), "switch")) for name in dict.fromkeys(ends))
    return TrackMap("test", 1, "JGD2011", "2026-03-01T00:00:00Z", "", nodes, edges, **more)  # type: ignore[arg-type]


def straight(name: str, from_node: str, to_node: str, from_m: float, to_m: float, step_m: float = 10.0) -> Edge:
    """Northwards from one distance to another, or southwards where the second is smaller; s counts from zero."""
    north_m = np.linspace(from_m, to_m, round(abs(to_m - from_m) / step_m) + 1)
    enu_m = np.column_stack((np.zeros_like(north_m), north_m, np.zeros_like(north_m)))
    return edge(name, from_node, to_node, enu_m, np.abs(north_m - from_m))
