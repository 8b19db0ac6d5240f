"""Frames against published coordinates and the geometry of the axes."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from integrity.gnss.frames import ecef_from_geodetic, enu_axes, geodetic_from_ecef

# EPSG Guidance Note 7-2, geographic/geocentric conversions: WGS 84 53 48 33.820 N, 2 07 46.380 E, 73.0 m.
EPSG_LAT_RAD, EPSG_LON_RAD, EPSG_HEIGHT_M = np.deg2rad(53 + 48 / 60 + 33.820 / 3600), np.deg2rad(2 + 7 / 60 + 46.380 / 3600), 73.0
EPSG_ECEF_M = np.array([3771793.968, 140253.342, 5124304.349])

latitudes = st.floats(-np.pi / 2, np.pi / 2)
longitudes = st.floats(-np.pi, np.pi)


def test_published_point_to_ecef() -> None:
    # Seconds of arc are given to three decimals: 3 cm.
    assert ecef_from_geodetic(EPSG_LAT_RAD, EPSG_LON_RAD, EPSG_HEIGHT_M) == pytest.approx(EPSG_ECEF_M, abs=0.03)


def test_published_point_to_geodetic() -> None:
    lat_rad, lon_rad, height_m = geodetic_from_ecef(EPSG_ECEF_M)
    found_m = np.array([float(lat_rad - EPSG_LAT_RAD) * 6.4e6, float(lon_rad - EPSG_LON_RAD) * 6.4e6, float(height_m) - EPSG_HEIGHT_M])
    assert found_m == pytest.approx(np.zeros(3), abs=0.03)


# Semi-axes of WGS 84.
@pytest.mark.parametrize(
    ("ecef_m", "lat_deg", "height_m"),
    [((6378137.0, 0.0, 0.0), 0.0, 0.0), ((0.0, 0.0, 6356752.314245), 90.0, 0.0), ((0.0, 0.0, -6356852.314245), -90.0, 100.0)],
)
def test_equator_and_poles(ecef_m: tuple[float, float, float], lat_deg: float, height_m: float) -> None:
    lat_rad, _, height = geodetic_from_ecef(np.array(ecef_m))
    assert (float(np.rad2deg(lat_rad)), float(height)) == pytest.approx((lat_deg, height_m), abs=1e-6)


@given(latitudes, longitudes, st.floats(-500.0, 10_000.0))
def test_there_and_back_within_a_micrometre(lat_rad: float, lon_rad: float, height_m: float) -> None:
    point = ecef_from_geodetic(lat_rad, lon_rad, height_m)
    again = ecef_from_geodetic(*(float(v) for v in geodetic_from_ecef(point)))
    assert again == pytest.approx(point, abs=1e-6)


@pytest.mark.parametrize("shape", [(3,), (1, 3), (3, 3), (1, 1, 3), (5, 3, 3)])
def test_shape_is_kept(shape: tuple[int, ...]) -> None:
    points = np.broadcast_to(EPSG_ECEF_M, shape)
    assert {v.shape for v in geodetic_from_ecef(points)} == {shape[:-1]}


def test_axes_where_the_meridian_meets_the_equator() -> None:
    assert enu_axes(np.array(0.0), np.array(0.0)) == pytest.approx(np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]]))


@given(latitudes, longitudes)
def test_axes_are_a_rotation(lat_rad: float, lon_rad: float) -> None:
    axes = enu_axes(np.array(lat_rad), np.array(lon_rad))
    assert axes @ axes.T == pytest.approx(np.eye(3), abs=1e-14)


@given(latitudes, longitudes)
def test_axes_are_right_handed(lat_rad: float, lon_rad: float) -> None:
    east, north, up = enu_axes(np.array(lat_rad), np.array(lon_rad))
    assert np.cross(east, north) == pytest.approx(up, abs=1e-14)


@pytest.mark.parametrize(("axis", "geodetic_step"), [(0, (0.0, 1e-7, 0.0)), (1, (1e-7, 0.0, 0.0)), (2, (0.0, 0.0, 1.0))])
def test_axes_point_where_longitude_latitude_and_height_grow(axis: int, geodetic_step: tuple[float, float, float]) -> None:
    start = (EPSG_LAT_RAD, EPSG_LON_RAD, EPSG_HEIGHT_M)
    moved = ecef_from_geodetic(*(a + b for a, b in zip(start, geodetic_step, strict=True))) - ecef_from_geodetic(*start)
    direction = moved / np.linalg.norm(moved)
    # Steps of under a metre in coordinates known to a nanometre.
    assert enu_axes(np.array(EPSG_LAT_RAD), np.array(EPSG_LON_RAD))[axis] == pytest.approx(direction, abs=1e-7)
