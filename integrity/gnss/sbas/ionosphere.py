"""Vertical delay of the ionosphere at pierce points: from the grid, and how uncertain a model is where there is none.

Source: RTCA DO-229D, A.4.4.10 (pierce point, grid points, interpolation), A.4.5.2 (degradation), J.2.3 (NPA without a grid).
"""

from enum import IntEnum
from typing import NamedTuple

import numpy as np

from integrity.gnss.angles import sine_cosine
from integrity.gnss.observations import Floats, Ints
from integrity.gnss.sbas.cells import TRIANGLE, Cells, Points, cells_of, weights
from integrity.gnss.sbas.grid import DO_NOT_USE, GOOD
from integrity.gnss.sbas.poles import high_cells, polar_cells

EARTH_RADIUS_M, SHELL_HEIGHT_M = 6_378_136.3, 350_000.0  # A.4.4.10.1


class NoDelay(IntEnum):
    """Why there is no delay from the grid."""

    FOUND = 0
    NOT_IN_MASK = 1
    NOT_MONITORED = 2
    DO_NOT_USE = 3


class Pierce(NamedTuple):
    """Where signals go through the shell: geodetic latitude and longitude, rad; obliquity factor F_pp."""

    lat_rad: Floats
    lon_rad: Floats
    obliquity: Floats


class Vertical(NamedTuple):
    """Vertical delay on L1, m, and its variance sigma^2_UIVE, m2; NaN where `why` (`NoDelay`) says so."""

    delay_m: Floats
    variance_m2: Floats
    why: Ints


def pierce_points(lat_rad: Floats, lon_rad: Floats, az_rad: Floats, el_rad: Floats) -> Pierce:
    """Of receivers, broadcast against the directions. A.4.4.10.1 and A.4.4.10.4."""
    ratio = EARTH_RADIUS_M / (EARTH_RADIUS_M + SHELL_HEIGHT_M) * sine_cosine(el_rad)[1]
    sin_psi, cos_psi = sine_cosine(0.5 * np.pi - el_rad - np.arcsin(ratio))
    sin_az, cos_az = sine_cosine(az_rad)
    sin_u, cos_u = np.sin(lat_rad), np.cos(lat_rad)
    phi = np.arcsin(np.clip(sin_u * cos_psi + cos_u * sin_psi * cos_az, -1.0, 1.0))
    # arctan2 is right beyond a pole as well, for which A.4.4.10.1 has a case of its own.
    lon = lon_rad + np.arctan2(sin_psi * sin_az, cos_psi * cos_u - sin_psi * sin_u * cos_az)
    return Pierce(phi, (lon + np.pi) % (2.0 * np.pi) - np.pi, 1.0 / np.sqrt(1.0 - ratio * ratio))


def vertical_delay(points: Points) -> Vertical:
    """At every point; see `Vertical`."""
    n = len(points.t_ns)
    result = Vertical(np.full(n, np.nan), np.full(n, np.nan), np.full(n, NoDelay.NOT_IN_MASK, dtype=np.int64))
    away = np.abs(points.lat_deg)
    for zone, cells in (
        (away <= 60.0, lambda some: cells_of(some, 5)),
        ((away > 60.0) & (away <= 75.0), lambda some: cells_of(some, 10)),
        ((away > 75.0) & (away <= 85.0), high_cells),
        (away > 85.0, polar_cells),
    ):
        which = np.nonzero(zone)[0]
        if len(which):
            found = _interpolated(cells(points.at(which)))
            for whole, part in zip(result, found, strict=True):
                whole[which] = part
    return result


def _interpolated(cells: Cells) -> Vertical:
    """A grid point that is not to be used rules out its cell; one that is not monitored leaves the triangle of the others. A.4.4.10.2."""
    weight, inside = weights(cells.x, cells.y, cells.chosen & (cells.corners.status == GOOD))
    why = np.where(inside, NoDelay.FOUND, NoDelay.NOT_MONITORED)
    why = np.where((cells.chosen & (cells.corners.status == DO_NOT_USE)).any(axis=1), NoDelay.DO_NOT_USE, why)
    why = np.where(cells.chosen.sum(axis=1) >= TRIANGLE, why, NoDelay.NOT_IN_MASK)
    found = why == NoDelay.FOUND
    delay = np.where(found, (weight * cells.corners.delay_m).sum(axis=1), np.nan)
    return Vertical(delay, np.where(found, (weight * cells.corners.variance_m2).sum(axis=1), np.nan), why)


def vertical_sigma_without_grid_m(magnetic_lat_rad: Floats) -> Floats:
    """tau_vert, m: by low, middle and high geomagnetic latitude of the pierce point. J.2.3."""
    away = np.abs(np.degrees(magnetic_lat_rad))
    return np.where(away <= 20.0, 9.0, np.where(away <= 55.0, 4.5, 6.0))


def magnetic_latitude_rad(pierce: Pierce) -> Floats:
    """Geomagnetic latitude of pierce points. IS-GPS-200, 20.3.3.5.2.5."""
    result: Floats = pierce.lat_rad + 0.064 * np.pi * sine_cosine(pierce.lon_rad - 1.617 * np.pi)[1]
    return result
