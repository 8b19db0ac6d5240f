"""Frames: ECEF and geodetic coordinates, and the local east-north-up axes of a point. The only file that imports pymap3d.

pymap3d is imported when first used: it brings date parsers along, a quarter of the time that the solver takes to import.
"""

import numpy as np

from integrity.gnss.observations import Floats


def geodetic_from_ecef(pos_ecef_m: Floats) -> tuple[Floats, Floats, Floats]:
    """Geodetic latitude and longitude (rad) and ellipsoidal height (m, WGS 84) of points (..., 3) near the ground; each of shape (...).

    For points up to some hundred kilometres of height (pymap3d loses accuracy higher up): receivers, never satellites.
    """
    import pymap3d

    x, y, z = np.moveaxis(np.array(pos_ecef_m, dtype=np.float64), -1, 0)
    lat, lon, height = pymap3d.ecef2geodetic(x, y, z, deg=False)
    return np.reshape(lat, x.shape), np.reshape(lon, x.shape), np.reshape(height, x.shape)  # pymap3d squeezes single epochs


def ecef_from_geodetic(lat_rad: float, lon_rad: float, height_m: float) -> Floats:
    """ECEF position (3,) in metres of a geodetic position on WGS 84."""
    import pymap3d

    return np.array(pymap3d.geodetic2ecef(lat_rad, lon_rad, height_m, deg=False), dtype=np.float64)


def enu_axes(lat_rad: Floats, lon_rad: Floats) -> Floats:
    """Rotation from ECEF to local axes, shape (..., 3, 3): rows are the unit vectors east, north, up."""
    sin_lat, cos_lat, sin_lon, cos_lon = np.sin(lat_rad), np.cos(lat_rad), np.sin(lon_rad), np.cos(lon_rad)
    east = np.stack((-sin_lon, cos_lon, np.zeros_like(sin_lon)), axis=-1)
    north = np.stack((-sin_lat * cos_lon, -sin_lat * sin_lon, cos_lat), axis=-1)
    up = np.stack((cos_lat * cos_lon, cos_lat * sin_lon, sin_lat), axis=-1)
    return np.stack((east, north, up), axis=-2)
