"""The ionospheric grid: where its points are, which of them are chosen, and what is made of them.

A delay that is a plane in latitude and longitude comes back from squares and triangles of any size as it is."""

import numpy as np
import pytest

from integrity.gnss.sbas.cells import Points
from integrity.gnss.sbas.contents import Degradation, IonoDelays, IonoMask
from integrity.gnss.sbas.grid import GridStore, igps_of, node_of
from integrity.gnss.sbas.ionosphere import NoDelay, Pierce, Vertical, magnetic_latitude_rad, pierce_points, vertical_delay
from integrity.gnss.sbas.ionosphere import vertical_sigma_without_grid_m as sigma_without_grid_m
from tests.unit.gnss.sbas.sent import DEGRADATION, T0_NS

S = 1_000_000_000
NORTH_BANDS, SOUTH_BANDS = (*range(9), 9), (*range(9), 10)


def plane(lat: float, lon: float) -> float:
    """In eighths of a metre."""
    return 40.0 + lat / 5.0 * 2.0 + lon / 5.0


def filled(
    bands: tuple[int, ...], left_out: frozenset[tuple[int, int]] = frozenset(), givei: dict[tuple[int, int], int] | None = None
) -> GridStore:
    """A grid with the plane at every point of some bands but for those left out of the mask; GIVEI 0, or another at some points."""
    store = GridStore()
    for band in bands:
        igps = [n for n, place in enumerate(igps_of(band), 1) if place not in left_out]
        store.add_mask(IonoMask(1, len(bands), band, tuple(igps)), T0_NS)
        places = [igps_of(band)[n - 1] for n in igps]
        for block in range(-(-len(places) // 15)):
            some = places[15 * block : 15 * block + 15]
            delays = tuple(None if (givei or {}).get(p) == 16 else 0.125 * plane(*p) for p in some)
            indicators = tuple(min((givei or {}).get(p, 0), 15) for p in some)
            empty = (0.0,) * (15 - len(some))
            store.add_delays(IonoDelays(1, band, block, delays + empty, indicators + (15,) * len(empty)), T0_NS, T0_NS)
    return store


def found_at(store: GridStore, lat: float, lon: float, t_s: float = 0.0, d: Degradation | None = None) -> Vertical:
    return vertical_delay(Points(np.array([lat]), np.array([lon]), np.array([T0_NS + round(t_s * S)]), store.grid, d))


def test_bands_have_as_many_points_as_the_table_says() -> None:
    assert [len(igps_of(band)) for band in range(11)] == [201] * 8 + [200, 192, 192]


@pytest.mark.parametrize(
    ("band", "igp", "place"),
    [
        (0, 1, (-75, -180)),
        (0, 28, (85, -180)),
        (0, 201, (55, -145)),
        (1, 1, (-85, -140)),
        (3, 51, (-85, -50)),
        (4, 128, (85, 0)),
        (5, 101, (-85, 40)),
        (6, 178, (85, 90)),
        (7, 151, (-85, 130)),
        (8, 200, (55, 175)),
        (9, 1, (60, -180)),
        (9, 73, (65, -180)),
        (9, 192, (85, 150)),
        (10, 181, (-85, -170)),
    ],
)
def test_points_stand_where_table_a_14_has_them(band: int, igp: int, place: tuple[int, int]) -> None:
    assert igps_of(band)[igp - 1] == place


def test_every_point_is_a_node() -> None:
    assert all(node_of(np.array(lat), np.array(lon)) >= 0 for band in range(11) for lat, lon in igps_of(band))


@pytest.mark.parametrize(
    ("lat", "lon"),
    [(36.2, 138.9), (-12.0, 3.3), (59.9, 40.1), (62.5, -33.3), (71.0, 5.0), (-64.9, 101.0), (-72.5, 17.0), (0.0, 0.0), (55.0, 10.0)],
)
def test_a_plane_comes_back_up_to_75_degrees(lat: float, lon: float) -> None:
    found = found_at(filled(NORTH_BANDS if lat > 0 else SOUTH_BANDS), lat, lon)
    assert found.delay_m[0] == pytest.approx(0.125 * plane(lat, lon), abs=1e-9)


def test_cells_reach_over_the_date_line() -> None:
    """East of 175 degrees the neighbours are those of 180 west: between 75.2 / 8 m at 176 and what the plane has at -180."""
    west, east = 0.125 * plane(35.0, 175.0), 0.125 * plane(35.0, -180.0)
    assert found_at(filled((0, 8)), 35.0, 176.0).delay_m[0] == pytest.approx(0.8 * west + 0.2 * east)


@pytest.mark.parametrize(
    ("left_out", "lat", "lon"),
    [
        ({(40, 140)}, 36.0, 138.0),  # without the north-east corner: its triangle has the point
        ({(40, 140)}, 39.0, 139.0),  # a square of 10 degrees
        ({(40, 140), (35, 135)}, 36.0, 137.0),
        ({(60, 40), (60, 50)}, 61.0, 44.0),
        ({(70, 40)}, 71.0, 41.0),
    ],
)
def test_without_a_point_in_the_mask_another_cell_serves(left_out: set[tuple[int, int]], lat: float, lon: float) -> None:
    found = found_at(filled(NORTH_BANDS, frozenset(left_out)), lat, lon)
    assert found.delay_m[0] == pytest.approx(0.125 * plane(lat, lon), abs=1e-9)


@pytest.mark.parametrize(
    ("missing", "lat", "lon"), [((40, 140), 36.0, 137.5), ((40, 135), 36.0, 138.0), ((35, 135), 39.0, 139.0), ((35, 140), 39.0, 136.5)]
)
def test_three_points_make_a_plane(missing: tuple[int, int], lat: float, lon: float) -> None:
    """Whichever corner is not monitored: the square would use it, so the triangle of the others has to serve."""
    found = found_at(filled((7, 8), givei={missing: 15}), lat, lon)
    assert found.delay_m[0] == pytest.approx(0.125 * plane(lat, lon), abs=1e-9)


def test_without_any_cell_there_is_no_delay() -> None:
    assert found_at(filled((5,)), 36.0, 138.0).why[0] == NoDelay.NOT_IN_MASK


@pytest.mark.parametrize(("lat", "lon", "why"), [(36.0, 138.0, NoDelay.FOUND), (39.0, 139.0, NoDelay.NOT_MONITORED)])
def test_a_point_that_is_not_monitored_leaves_a_triangle(lat: float, lon: float, why: NoDelay) -> None:
    assert found_at(filled((7, 8), givei={(40, 140): 15}), lat, lon).why[0] == why


def test_a_point_not_to_be_used_rules_out_its_cell() -> None:
    assert found_at(filled((7, 8), givei={(40, 140): 16}), 35.5, 135.5).why[0] == NoDelay.DO_NOT_USE


@pytest.mark.parametrize(("lat", "lon"), [(80.0, 47.0), (76.0, -179.0), (-79.0, 12.5), (85.0, 0.0)])
@pytest.mark.parametrize("spacing", [30, 90])
def test_between_75_and_85_degrees_points_at_85_are_interpolated(lat: float, lon: float, spacing: int) -> None:
    """Points 30 degrees apart of bands 9 and 10, or 90 of the others. Columns are not a plane across the date line: none of these is."""
    side = range(9) if spacing == 90 else NORTH_BANDS if lat > 0 else SOUTH_BANDS
    found = found_at(filled(tuple(side)), lat, lon)
    assert found.delay_m[0] == pytest.approx(0.125 * plane(lat, lon), abs=1e-9)


@pytest.mark.parametrize("sign", [1, -1])
def test_at_a_pole_four_points_weigh_the_same(sign: int) -> None:
    bands, columns = (NORTH_BANDS, (-180, -90, 0, 90)) if sign > 0 else (SOUTH_BANDS, (-140, -50, 40, 130))
    expected = np.mean([0.125 * plane(85.0 * sign, lon) for lon in columns])
    assert found_at(filled(bands), 90.0 * sign, 12.0).delay_m[0] == pytest.approx(expected)


def test_near_a_point_at_85_degrees_its_delay_is_the_delay() -> None:
    assert found_at(filled(NORTH_BANDS), 85.0001, -90.0001 + 1e-3).delay_m[0] == pytest.approx(0.125 * plane(85.0, -90.0), abs=1e-2)


@pytest.mark.parametrize(("age_s", "why"), [(600.0, NoDelay.FOUND), (600.1, NoDelay.NOT_MONITORED), (1200.1, NoDelay.NOT_IN_MASK)])
def test_delays_and_masks_time_out(age_s: float, why: NoDelay) -> None:
    assert found_at(filled((7, 8)), 36.0, 138.0, age_s).why[0] == why


@pytest.mark.parametrize(("rss", "expected"), [(True, 0.0084 + 0.45**2), (False, (0.0084**0.5 + 0.45) ** 2)])
def test_variances_grow_with_age(rss: bool, expected: float) -> None:
    """After 300 s: one step of 0.3 m and 300 s at 0.5 mm/s. A.4.5.2."""
    d = Degradation(**DEGRADATION | {"RSS_iono": rss})  # type: ignore[arg-type]
    assert found_at(filled((7, 8)), 36.0, 138.0, 300.0, d).variance_m2[0] == pytest.approx(expected)


def test_delays_of_another_issue_wait_for_their_mask() -> None:
    store = filled((7, 8))
    store.add_delays(IonoDelays(2, 7, 0, (9.0,) * 15, (0,) * 15), T0_NS, T0_NS)
    node = int(node_of(np.array(-75), np.array(100)))
    before = store.grid.delay_m[node]
    store.add_mask(IonoMask(2, 2, 7, tuple(range(1, 16))), T0_NS)
    assert (before, store.grid.delay_m[node]) == (0.125 * plane(-75, 100), 9.0)


def test_a_band_that_a_complete_new_issue_leaves_out_ends() -> None:
    store = filled((7, 8))
    store.add_mask(IonoMask(2, 1, 7, tuple(range(1, 202))), T0_NS)
    still = found_at(store, 36.0, 141.0).why[0]
    store.add_delays(IonoDelays(2, 7, 0, (9.0,) * 15, (0,) * 15), T0_NS, T0_NS)
    assert (still, found_at(store, 36.0, 141.0).why[0]) == (NoDelay.FOUND, NoDelay.NOT_IN_MASK)


def test_a_pierce_point_in_the_zenith_is_overhead() -> None:
    pierce = pierce_points(np.array(0.6), np.array(2.4), np.array([1.0]), np.array([np.pi / 2]))
    assert [pierce.lat_rad[0], pierce.lon_rad[0], pierce.obliquity[0]] == pytest.approx([0.6, 2.4, 1.0])


def test_a_pierce_point_beyond_the_pole_is_on_the_other_side() -> None:
    pierce = pierce_points(np.array(np.deg2rad(89.0)), np.array(0.5), np.array([0.0]), np.array([np.deg2rad(20.0)]))
    assert np.rad2deg(pierce.lon_rad[0] - 0.5) % 360.0 == pytest.approx(180.0)


@pytest.mark.parametrize(("magnetic_deg", "sigma_m"), [(-20.0, 9.0), (20.1, 4.5), (-55.0, 4.5), (55.1, 6.0)])
def test_without_a_grid_sigma_is_that_of_the_climate(magnetic_deg: float, sigma_m: float) -> None:
    assert sigma_without_grid_m(np.deg2rad([magnetic_deg]))[0] == sigma_m


def test_the_magnetic_pole_lies_towards_america() -> None:
    """IS-GPS-200: where the longitude is 1.617 semicircles east, geomagnetic latitude is 0.064 semicircles above the geographic one."""
    there = Pierce(np.array([0.5]), np.array([1.617 * np.pi]), np.array([1.0]))
    assert magnetic_latitude_rad(there)[0] == pytest.approx(0.5 + 0.064 * np.pi)
