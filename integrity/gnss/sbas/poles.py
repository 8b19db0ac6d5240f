"""Grid points around a pierce point beyond 75 degrees of latitude. Source: RTCA DO-229D, A.4.4.10.2 and A.4.4.10.3."""

from typing import Any

import numpy as np

from integrity.gnss.observations import Bools, Floats, Ints
from integrity.gnss.sbas.cells import Cells, Corners, Points, known_at
from integrity.gnss.sbas.grid import DO_NOT_USE, GOOD, SILENT, node_of

LOW_DEG, HIGH_DEG = 75, 85


def polar_cells(points: Points) -> Cells:
    """Beyond 85 degrees: the four grid points 90 degrees apart; x and y so that the pole is in their middle."""
    north = points.lat_deg > 0.0
    west = _column(points.lon_deg, np.where(north, -180.0, -140.0), 90.0)
    lon = west[:, None] + np.array([180.0, 270.0, 0.0, 90.0])
    nodes = node_of(np.where(north, HIGH_DEG, -HIGH_DEG)[:, None].repeat(4, axis=1), lon.astype(np.int64))
    y = (np.abs(points.lat_deg) - 85.0) / 10.0
    x = (points.lon_deg - west) / 90.0 * (1.0 - 2.0 * y) + y
    return Cells(known_at(points, nodes), points.in_mask(nodes).all(axis=1, keepdims=True).repeat(4, axis=1), x, y)


def high_cells(points: Points) -> Cells:
    """From 75 to 85 degrees: two grid points at 75, and above them two that are made of those at 85, 30 degrees apart or else 90."""
    north = points.lat_deg > 0.0
    west = np.floor(points.lon_deg / 10.0) * 10.0
    columns = np.stack((west + 10.0, west), axis=1)  # east, west
    low = node_of(np.where(north, LOW_DEG, -LOW_DEG)[:, None].repeat(2, axis=1), columns.astype(np.int64))
    high, left, apart = _neighbours(points, west, north)
    at_low, at_high = known_at(points, low), _between(known_at(points, high), (columns - left[:, None]) / apart[:, None])
    corners = Corners(*(_in_order(a, b, north) for a, b in zip(at_low, at_high, strict=True)))
    there = points.in_mask(low).all(axis=1, keepdims=True) & points.in_mask(high).all(axis=1, keepdims=True)
    y = np.where(north, points.lat_deg - LOW_DEG, points.lat_deg + HIGH_DEG) / 10.0
    return Cells(corners, there.repeat(4, axis=1), (points.lon_deg - west) / 10.0, y)


def _between(two: Corners, share: Floats) -> Corners:
    """Made of two grid points (n, 2), east and west: `share` (n, 2) of the eastern one. Both have to be monitored."""
    status = np.where((two.status == GOOD).all(axis=1), GOOD, np.where((two.status == DO_NOT_USE).any(axis=1), DO_NOT_USE, SILENT))
    delay = two.delay_m[:, :1] * share + two.delay_m[:, 1:] * (1.0 - share)
    variance = two.variance_m2[:, :1] * share + two.variance_m2[:, 1:] * (1.0 - share)
    return Corners(status[:, None].repeat(2, axis=1), delay, variance)


def _in_order(low: Any, high: Any, north: Bools) -> Any:
    """Corners (n, 4) from north-east on, of pairs (n, 2) that are east and west."""
    upper, lower = np.where(north[:, None], high, low), np.where(north[:, None], low, high)
    return np.concatenate((upper, lower[:, ::-1]), axis=1)


def _neighbours(points: Points, west: Floats, north: Bools) -> tuple[Ints, Floats, Floats]:
    """At 85 degrees: the grid points east and west of a column, the longitude of the western one, and how far apart they are."""
    row = np.where(north, HIGH_DEG, -HIGH_DEG)[:, None].repeat(2, axis=1)
    nodes, lefts = [], []
    for apart, south_first in ((30.0, -170.0), (90.0, -140.0)):
        left = _column(west, np.where(north, -180.0, south_first), apart)
        nodes.append(node_of(row, np.stack((left + apart, left), axis=1).astype(np.int64)))
        lefts.append(left)
    close = np.logical_and.reduce(points.in_mask(nodes[0]), axis=1)
    return np.where(close[:, None], *nodes), np.where(close, *lefts), np.where(close, 30.0, 90.0)


def _column(lon_deg: Floats, first_deg: Floats, apart_deg: float) -> Floats:
    """The column at or west of a longitude, of those `apart_deg` from each other."""
    result: Floats = first_deg + np.floor((lon_deg - first_deg) / apart_deg) * apart_deg
    return result
