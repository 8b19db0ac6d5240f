"""DO-229's troposphere: numbers worked out by hand from its table, and how it behaves between and beyond the table's latitudes."""

from datetime import UTC, datetime, timedelta

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from integrity.gnss.gps_time import gps_from_calendar
from integrity.gnss.sbas.troposphere import day_of_year, weather, zenith_delay_m

COLDEST_NORTH, COLDEST_SOUTH = (2025, 1, 28), (2025, 7, 30)  # days 28 and 211


def ns(date: tuple[int, int, int]) -> "np.typing.NDArray[np.int64]":
    return np.array(gps_from_calendar(*date, 0, 0, 0))


def zenith(date: tuple[int, int, int], lat_deg: float, height_m: float = 0.0) -> float:
    return float(zenith_delay_m(ns(date), np.radians(lat_deg), np.array(height_m)))


def test_at_the_equator_it_is_the_sum_worked_out_by_hand() -> None:
    """1e-6 * 77.604 * 287.054 * 1013.25 / 9.784 = 2.30701 m of dry air; of vapour 1e-6 * 382000 * 287.054 / (9.784 * 3.77 - 0.0063 *
    287.054) * 26.31 / 299.65 = 0.27448 m."""
    assert zenith(COLDEST_NORTH, 0.0) == pytest.approx(2.30701 + 0.27448, abs=2e-5)


def test_a_kilometre_up_dry_air_and_vapour_are_less_by_powers_of_their_own() -> None:
    """1 - 6.3 / 299.65 = 0.978976; to the power of 9.80665 / (287.054 * 0.0063) = 5.42267, and of 3.77 * 5.42267 - 1 = 19.44347."""
    assert zenith(COLDEST_NORTH, 0.0, 1000.0) == pytest.approx(2.30701 * 0.891167 + 0.27448 * 0.661566, abs=5e-5)


@pytest.mark.parametrize(
    ("lat_deg", "pressure_mbar", "temperature_k"),
    [(45.0, 1018.00, 272.15), (37.5, 1019.50, 279.65), (75.0, 1013.50, 249.15), (89.0, 1013.50, 249.15), (10.0, 1013.25, 299.65)],
)
def test_on_the_coldest_day_the_whole_season_is_subtracted(lat_deg: float, pressure_mbar: float, temperature_k: float) -> None:
    found = weather(np.array(28.0), np.radians(lat_deg))
    assert (float(found.P), float(found.T)) == pytest.approx((pressure_mbar, temperature_k), abs=1e-9)


@pytest.mark.parametrize("lat_deg", [20.0, 52.0, 80.0])
def test_the_south_is_the_north_half_a_year_later(lat_deg: float) -> None:
    assert zenith(COLDEST_SOUTH, -lat_deg) == pytest.approx(zenith(COLDEST_NORTH, lat_deg), abs=1e-12)


def test_by_day_it_changes_at_midnight_by_no_step() -> None:
    noon, before, after = (day_of_year(np.array(gps_from_calendar(2024, 3, *at))) for at in ((1, 12, 0, 0), (1, 23, 59, 59), (2, 0, 0, 0)))
    assert [float(noon), float(after - before)] == pytest.approx([61.5, 1.0 / 86_400.0], abs=1e-9)


@given(st.datetimes(datetime(1980, 1, 6), datetime(2099, 12, 31)))
def test_days_are_those_of_the_calendar(at: datetime) -> None:
    at = at.replace(microsecond=0, tzinfo=UTC)
    t_ns = gps_from_calendar(at.year, at.month, at.day, at.hour, at.minute, at.second)
    expected = (at - datetime(at.year, 1, 1, tzinfo=UTC)) / timedelta(days=1) + 1.0
    assert float(day_of_year(np.array(t_ns))) == pytest.approx(expected, abs=1e-9)


@given(st.floats(-np.pi / 2, np.pi / 2), st.floats(-1e8, 1e8), st.integers(0, 4_000_000_000_000_000_000))
def test_it_is_never_out_of_reason_wherever_a_point_is(lat_rad: float, height_m: float, t_ns: int) -> None:
    assert 0.5 <= float(zenith_delay_m(np.array(t_ns), np.array(lat_rad), np.array(height_m))) <= 2.9


@given(st.floats(-np.pi / 2, np.pi / 2), st.floats(-400.0, 9_000.0), st.floats(1.0, 110.0))
def test_a_height_above_the_ellipsoid_costs_as_much_as_said(lat_rad: float, height_m: float, geoid_m: float) -> None:
    low, high = (float(zenith_delay_m(ns(COLDEST_SOUTH), np.array(lat_rad), np.array(h))) for h in (height_m, height_m + geoid_m))
    assert 0.0 < low - high <= 0.0005 * geoid_m
