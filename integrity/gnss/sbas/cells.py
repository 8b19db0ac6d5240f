"""Which grid points surround a pierce point, and their weights: up to 75 degrees of latitude here, beyond in `poles`.

Corners of a cell are counted as in DO-229D figure A-19: north-east, north-west, south-west, south-east.
Source: RTCA DO-229D, A.4.4.10.2 and A.4.4.10.3.
"""

from typing import NamedTuple

import numpy as np

from integrity.gnss.gps_time import NS_PER_S
from integrity.gnss.observations import Bools, Floats, Ints
from integrity.gnss.sbas.contents import Degradation
from integrity.gnss.sbas.grid import NEVER, SILENT, Grid, node_of

MASK_TIMEOUT_S, DELAY_TIMEOUT_S = 1200, 600  # table A-25, for PA and NPA
SQUARE, TRIANGLE = 4, 3  # corners


class Points(NamedTuple):
    """Pierce points (n,) in degrees at GPS times, with what has arrived of the grid; variances grow with age by `degradation`."""

    lat_deg: Floats
    lon_deg: Floats
    t_ns: Ints
    grid: Grid
    degradation: Degradation | None

    def at(self, which: Ints) -> "Points":
        """Some of them."""
        return Points(self.lat_deg[which], self.lon_deg[which], self.t_ns[which], self.grid, self.degradation)

    def in_mask(self, nodes: Ints) -> Bools:
        """Whether the mask has these nodes (n, k), and a delay has ever come for them.

        DO-229D speaks of the mask alone. While a receiver starts, gLAB too passes over grid points that have not been sent yet, so that
        a cell of 10 x 10 degrees may serve some minutes earlier than the one of 5 x 5 that the mask has; to wait for that one, leave out
        the second condition.
        """
        masked: Bools = self.t_ns[:, None] - self.grid.mask_ns[nodes] <= MASK_TIMEOUT_S * NS_PER_S
        come: Bools = self.grid.received_ns[nodes] != NEVER
        return masked & come


class Corners(NamedTuple):
    """Status, delay and sigma^2_ionogrid of grid points, (n, k)."""

    status: Ints
    delay_m: Floats
    variance_m2: Floats


class Cells(NamedTuple):
    """Four corners (n, 4) of each point, those `chosen` of them by the mask, and where the point is: x eastwards, y northwards, 0 to 1."""

    corners: Corners
    chosen: Bools
    x: Floats
    y: Floats


def known_at(points: Points, nodes: Ints) -> Corners:
    """What is known at nodes (n, k), time-out and degradation applied. A.4.5.2."""
    grid, d, t = points.grid, points.degradation, points.t_ns[:, None]
    fresh = t - grid.received_ns[nodes] <= DELAY_TIMEOUT_S * NS_PER_S
    variance = grid.variance_m2[nodes]
    if d is not None:
        age = np.where(fresh, (t - grid.sent_ns[nodes]) / NS_PER_S, 0.0)
        steps = np.floor(age / d.I_iono) if d.I_iono > 0.0 else 0.0
        epsilon = d.C_iono_step * steps + d.C_iono_ramp * age
        variance = variance + epsilon * epsilon if d.RSS_iono else (np.sqrt(variance) + epsilon) ** 2
    return Corners(np.where(fresh, grid.status[nodes], SILENT), grid.delay_m[nodes], variance)


def cells_of(points: Points, width_deg: int) -> Cells:
    """A cell of 5 x `width_deg` degrees, else one of 10 x 10; a square before a triangle around the point."""
    n = len(points.t_ns)
    nodes, chosen, x, y = np.full((n, 4), -1, dtype=np.int64), np.zeros((n, 4), dtype=np.bool_), np.zeros(n), np.zeros(n)
    south, west = np.floor(points.lat_deg / 5.0) * 5.0, np.floor(points.lon_deg / width_deg) * width_deg
    shifts = ((0, 0), (0, -5), (-5, -5), (-5, 0)) if width_deg == 5 else ((0, 0), (-5, 0))
    left = np.arange(n)
    for height, width, places in ((5, width_deg, ((0, 0),)), (10, 10, shifts)):
        for needed in (SQUARE, TRIANGLE):
            for north_by, east_by in places:
                if not len(left):
                    break
                some = points.at(left)
                s, w = south[left] + north_by, west[left] + east_by
                there = corner_nodes(s, w, height, width)
                in_mask = some.in_mask(there)
                x_, y_ = (some.lon_deg - w) / width, (some.lat_deg - s) / height
                fits = in_mask.all(axis=1) if needed == SQUARE else weights(x_, y_, in_mask)[1]
                taken = left[fits]
                nodes[taken], chosen[taken], x[taken], y[taken] = there[fits], in_mask[fits], x_[fits], y_[fits]
                left = left[~fits]
    return Cells(known_at(points, nodes), chosen, x, y)


def corner_nodes(south_deg: Floats, west_deg: Floats, height_deg: int, width_deg: int) -> Ints:
    """The four corners (n, 4) of cells."""
    south, west = south_deg.astype(np.int64), west_deg.astype(np.int64)
    north, east = south + height_deg, west + width_deg
    return node_of(np.stack((north, north, south, south), axis=1), np.stack((east, west, west, east), axis=1))


def weights(x: Floats, y: Floats, there: Bools) -> tuple[Floats, Bools]:
    """Weights (n, 4) of the corners, and where these surround the point: all four, or three and the point in their triangle."""
    four = np.stack((x * y, (1.0 - x) * y, (1.0 - x) * (1.0 - y), x * (1.0 - y)), axis=1)
    nothing = np.zeros_like(x)
    without = (
        (nothing, y, 1.0 - x - y, x),
        (y, nothing, 1.0 - x, x - y),
        (x + y - 1.0, 1.0 - x, nothing, 1.0 - y),
        (x, y - x, 1.0 - y, nothing),
    )
    count = there.sum(axis=1)
    if (count == SQUARE).all():
        return four, count == SQUARE
    result = four
    for corner, three in enumerate(without):
        result = np.where(there[:, corner, None], result, np.stack(three, axis=1))
    return result, (count == SQUARE) | (count == TRIANGLE) & (result >= 0.0).all(axis=1)
