"""NeQuick-G where its document and its reference program say what it gives, and at the edges of what it is made for.

The whole range of places, hours and months is compared with the reference program in the crosschecks.
"""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from integrity.gnss.atmosphere import GalileoIonosphere
from integrity.gnss.gps_time import parse_utc
from integrity.gnss.nequick.integration import Geodetic, points, rays
from integrity.gnss.nequick.maps import figures
from integrity.gnss.nequick.model import effective_ionisation_sfu, month_and_ut, nequick_delay_m, stec_tecu
from integrity.gnss.nequick.peaks import Site, f2_peak, map_coefficients, modip_deg
from integrity.gnss.observations import Floats
from tests.unit.gnss.nequick_rays import INTEGRATED, LEVELS, PUBLISHED

MEDIUM = LEVELS["medium"]
VIENNA = (48.2, 16.4, 200.0)  # latitude, longitude, height
NOON_S = np.array(43_200.0)


def place(lat_deg: Floats | float, lon_deg: Floats | float, height_m: Floats | float) -> Geodetic:
    return Geodetic(np.radians(lat_deg), np.radians(lon_deg), np.asarray(height_m, dtype=np.float64))


def published(level: str) -> tuple[Floats, Geodetic, Geodetic, Floats]:
    """The annex's rays of a level: UT in s, receivers, satellites, electron contents."""
    rows: list[list[float]] = []
    receiver: list[float] = []
    here = False
    for line in PUBLISHED.strip().splitlines():
        if not line.startswith(" "):
            name, *words = line.split()
            here, receiver = name == level, [float(w) for w in words]
        elif here:
            rows.append([*receiver, *map(float, line.split())])
    lon, lat, height, ut_h, lon_s, lat_s, height_s, stec = np.array(rows).T
    return ut_h * 3600.0, place(lat, lon, height), place(lat_s, lon_s, height_s), stec


def satellites_seen(lat_deg: Floats, lon_deg: Floats, el_rad: Floats, az_rad: Floats) -> Geodetic:
    """Satellites 23,200 km high where receivers at sea level see them, on the document's sphere."""
    earth_m, orbit_m = 6_371_200.0, 29_571_200.0
    away = np.pi / 2 - el_rad - np.arcsin(earth_m / orbit_m * np.cos(el_rad))
    lat = np.radians(lat_deg)
    sin_lat = np.sin(lat) * np.cos(away) + np.cos(lat) * np.sin(away) * np.cos(az_rad)
    east = np.arctan2(np.sin(away) * np.sin(az_rad) * np.cos(lat), np.cos(away) - np.sin(lat) * sin_lat)
    return Geodetic(np.arcsin(sin_lat), np.radians(lon_deg) + east, np.full(np.shape(away), orbit_m - earth_m))


@pytest.mark.parametrize("level", LEVELS)
def test_the_rays_of_the_documents_annex(level: str) -> None:
    """0.1 TECU or 0.2 %: the published contents are integrated to 0.1 % below 1,000 km, to 1 % above."""
    ut_s, receiver, satellite, expected = published(level)
    error = np.abs(stec_tecu(4, ut_s, receiver, satellite, LEVELS[level]) - expected)
    assert error.size == 36 and np.all(error <= np.maximum(0.1, 0.002 * expected))


@pytest.mark.parametrize("line", INTEGRATED.strip().splitlines())
def test_rays_of_every_month_against_the_reference_program_integrated_finely(line: str) -> None:
    level, *words = line.split()
    month, ut_h, lon, lat, height, lon_s, lat_s, height_s, expected = map(float, words)
    found = stec_tecu(int(month), np.array(ut_h * 3600.0), place(lat, lon, height), place(lat_s, lon_s, height_s), LEVELS[level])
    assert float(found) == pytest.approx(expected, abs=0.02)


@pytest.mark.parametrize(
    ("lon_deg", "lat_deg", "expected"),
    [
        (-62.34046, 82.49429, 76.28407),
        (-52.80596, 5.25218, 19.52877),
        (40.19439, -2.99591, -23.31631),
        (166.66933, -77.83835, -71.81130),
        (115.88525, -31.80197, -51.37982),
        (0.0, 90.0, 90.0),
    ],
)
def test_modified_dip_latitude(lon_deg: float, lat_deg: float, expected: float) -> None:
    """Values of the reference program's own tests; at the pole the document's rule."""
    assert float(modip_deg(np.radians(lat_deg), np.radians(lon_deg))) == pytest.approx(expected, abs=1e-5)


@pytest.mark.parametrize(
    ("ut_h", "sunspots", "lon_deg", "lat_deg", "expected"),
    [
        (0.0, 186.328060298, 297.438314733, 82.481346266, (6.575612801, 2.366982653)),
        (2.666667, 186.328060298, 18.105699987, 74.653105616, (6.289174069, 2.375445167)),
        (10.5, 203.036737976, 31.022679098, -8.649092730, (16.638422783, 2.244593590)),
    ],
)
def test_the_f2_peak(ut_h: float, sunspots: float, lon_deg: float, lat_deg: float, expected: tuple[float, float]) -> None:
    """Values of the reference program's own tests, of April; to its 1e-5 (critical frequency in MHz, M(3000)F2)."""
    lat, lon = np.radians(lat_deg), np.radians(lon_deg if lon_deg < 180.0 else lon_deg - 360.0)
    at = Site(np.sin(lat), np.cos(lat), np.sin(lon), np.cos(lon))
    maps = map_coefficients(4, np.array(ut_h * 3600.0), np.array(sunspots))
    assert f2_peak(at, modip_deg(lat, lon), maps) == pytest.approx(expected, abs=1e-5)


@pytest.mark.parametrize(("level", "expected"), [("high", 267.690378), ("medium", 138.624713), ("low", 62.745440)])
def test_the_effective_ionisation_level(level: str, expected: float) -> None:
    assert float(effective_ionisation_sfu(np.array(-51.379818), LEVELS[level])) == pytest.approx(expected, abs=1e-6)


@pytest.mark.parametrize(("ai0", "expected"), [(-3.0, 0.0), (401.0, 400.0), (0.0, 63.7)])
def test_its_limits_and_what_stands_for_coefficients_not_broadcast(ai0: float, expected: float) -> None:
    assert float(effective_ionisation_sfu(np.array(10.0), GalileoIonosphere(ai0, 0.0, 0.0, 0))) == expected


def test_the_figures_cannot_be_changed() -> None:
    with pytest.raises(ValueError, match="read-only"):
        figures().fo_f2[0, 0, 0, 0] = 0.0


def sky(n_epochs: int) -> tuple[Floats, Geodetic, Geodetic]:
    """Times (E, 1, 1), receivers (1, 3, 1), satellites (E, 1, 7)."""
    random = np.random.default_rng(7)
    ut_s = np.linspace(20_000.0, 80_000.0, n_epochs)[:, None, None]
    receivers = place(*(np.array([v, v + 0.01, v + 0.02])[None, :, None] for v in VIENNA))
    shape = (n_epochs, 1, 7)
    return ut_s, receivers, place(random.uniform(20.0, 70.0, shape), random.uniform(-20.0, 50.0, shape), random.uniform(19e6, 24e6, shape))


def test_a_ray_is_counted_alike_alone_and_among_many() -> None:
    """To the last bit: what is decided does not depend on how a stream was cut; 50 epochs take several slices."""
    ut_s, receivers, satellites = sky(50)
    together = stec_tecu(4, ut_s, receivers, satellites, MEDIUM)
    alone = np.empty_like(together)
    for e, r, s in np.ndindex(together.shape):
        receiver, satellite = (Geodetic(*(a[i] for a in of)) for of, i in ((receivers, (0, r, 0)), (satellites, (e, 0, s))))
        alone[e, r, s] = stec_tecu(4, ut_s[e, 0, 0], receiver, satellite, MEDIUM)
    assert np.array_equal(together, alone)


def test_a_block_over_the_end_of_a_month_takes_each_epoch_by_its_own() -> None:
    ut_s, receivers, satellites = sky(4)
    months = np.array([4, 4, 5, 5])[:, None, None]
    april, may = (stec_tecu(m, ut_s, receivers, satellites, MEDIUM) for m in (4, 5))
    assert np.array_equal(stec_tecu(months, ut_s, receivers, satellites, MEDIUM), np.where(months == 4, april, may))


def test_month_and_time_of_day_are_those_of_utc() -> None:
    t_ns = np.array([parse_utc("2016-12-31T23:59:59.5Z"), parse_utc("2017-01-01T00:00:00Z"), parse_utc("2024-02-29T06:00:01Z")])
    months, ut_s = month_and_ut(t_ns)
    assert (months.tolist(), ut_s.tolist()) == ([12, 1, 2], [86_399.5, 0.0, 21_601.0])


UP = (*VIENNA[:2], 2.0e7)
NOWHERE = {
    "the satellite is below the horizon": (VIENNA, (-20.0, -120.0, 2.0e7)),
    "the satellite is not above the receiver": (VIENNA, (*VIENNA[:2], 200.0)),
    "the receiver is inside the Earth": ((*VIENNA[:2], -1_001.0), UP),
    "the receiver's place is not known": ((np.nan, *VIENNA[1:]), UP),
    "the satellite is at infinity": (VIENNA, (*VIENNA[:2], np.inf)),
}


@pytest.mark.parametrize("case", NOWHERE)
def test_no_ray_no_number(case: str) -> None:
    """And no harm to the ray beside it."""
    receiver, satellite = NOWHERE[case]
    pair = (place(*np.array([VIENNA, receiver]).T), place(*np.array([UP, satellite]).T))
    found = stec_tecu(4, NOON_S, *pair, MEDIUM)
    assert np.isfinite(found).tolist() == [True, False]


@pytest.mark.parametrize("lat_deg", [90.0, -90.0])
def test_at_a_pole_every_longitude_is_the_same_place(lat_deg: float) -> None:
    lon_deg = np.linspace(-180.0, 180.0, 9)
    found = stec_tecu(4, NOON_S, place(np.full(9, lat_deg), lon_deg, np.zeros(9)), place(lat_deg * 0.6, 30.0, 2e7), MEDIUM)
    assert np.ptp(found) < 1e-9


def test_the_weights_add_up_to_the_way_above_60_km() -> None:
    counted = points(rays(place(*VIENNA), place(*UP)))
    assert float(counted.weight_km.sum()) == pytest.approx(2.0e7 / 1e3 - 60.0, abs=1e-6)


def test_a_tecu_is_16_cm_on_l1() -> None:
    """40.3 1e16 / (1575.42 MHz)^2."""
    arguments = (4, NOON_S, place(*VIENNA), place(*UP), MEDIUM)
    assert float(nequick_delay_m(*arguments) / stec_tecu(*arguments)) == pytest.approx(0.162372, abs=1e-6)


@given(
    lat_deg=st.floats(-90.0, 90.0),
    lon_deg=st.floats(-180.0, 180.0),
    height_m=st.floats(-1e3, 9e3),
    el_deg=st.floats(5.0, 90.0),
    az_deg=st.floats(0.0, 360.0),
    ut_s=st.floats(0.0, 86_400.0),
    month=st.integers(1, 12),
    ionosphere=st.builds(GalileoIonosphere, st.floats(0.0, 511.75), st.floats(-4.0, 4.0), st.floats(-0.25, 0.25), st.just(0)),
)
def test_whatever_is_broadcast_gives_a_content_that_is_possible(
    lat_deg: float, lon_deg: float, height_m: float, el_deg: float, az_deg: float, ut_s: float, month: int, ionosphere: GalileoIonosphere
) -> None:
    """Over every place, direction and set of coefficients that the message can hold (a warning is an error here)."""
    lat, lon = np.array([lat_deg]), np.array([lon_deg])
    satellite = satellites_seen(lat, lon, np.radians([el_deg]), np.radians([az_deg]))
    (found,) = stec_tecu(month, np.array([ut_s]), place(lat, lon, np.array([height_m])), satellite, ionosphere)
    assert 0.0 < found < 3_000.0
