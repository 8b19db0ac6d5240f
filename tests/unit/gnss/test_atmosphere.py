"""Delays at the points where the sources say what they are; the whole range is compared with RTKLIB in the crosschecks."""

import numpy as np
import pytest

from integrity.gnss.atmosphere import Klobuchar, klobuchar_delay_m, saastamoinen_delay_m, troposphere_mapping
from integrity.gnss.constants import SPEED_OF_LIGHT_MPS
from integrity.gnss.observations import Floats

ZENITH = np.array(np.pi / 2)
EQUATOR = np.array(0.0)
FLAT = Klobuchar(alpha=(20e-9, 0.0, 0.0, 0.0), beta=(100_000.0, 0.0, 0.0, 0.0))  # amplitude 20 ns, period 27.8 h everywhere
ELEVATIONS = np.deg2rad(np.linspace(5.0, 90.0, 500))


def klobuchar_at(local_time_h: float, el_rad: Floats = ZENITH, k: Klobuchar = FLAT) -> Floats:
    """At longitude and latitude zero, towards the north, where local time is GPS time."""
    return klobuchar_delay_m(np.array(local_time_h * 3600.0), EQUATOR, EQUATOR, EQUATOR, el_rad, k)


def test_at_night_the_zenith_delay_is_5_ns() -> None:
    # IS-GPS-200, 20.3.3.5.2.5: 5 ns outside the half wave; its slant factor is 1.0004 in the zenith.
    assert float(klobuchar_at(2.0)) == pytest.approx(5e-9 * SPEED_OF_LIGHT_MPS, rel=5e-4)


def test_at_14_hours_the_amplitude_comes_on_top() -> None:
    assert float(klobuchar_at(14.0)) == pytest.approx(25e-9 * SPEED_OF_LIGHT_MPS, rel=5e-4)


def test_14_hours_is_the_maximum_of_the_day() -> None:
    by_hour = [float(klobuchar_at(hour)) for hour in range(24)]
    assert int(np.argmax(by_hour)) == 14


def test_local_time_advances_with_longitude() -> None:
    east_90_deg = klobuchar_delay_m(np.array(8.0 * 3600.0), EQUATOR, np.array(np.pi / 2), EQUATOR, ZENITH, FLAT)
    assert float(east_90_deg) == pytest.approx(float(klobuchar_at(14.0)), rel=1e-9)


def test_negative_amplitude_counts_as_none() -> None:
    negative = Klobuchar(alpha=(-20e-9, 0.0, 0.0, 0.0), beta=FLAT.beta)
    assert float(klobuchar_at(14.0, k=negative)) == float(klobuchar_at(2.0))


def test_klobuchar_falls_with_elevation() -> None:
    assert (np.diff(klobuchar_at(2.0, ELEVATIONS)) < 0.0).all()


def test_klobuchar_at_5_deg_is_about_three_times_the_zenith() -> None:
    # F = 1 + 16 (0.53 - 5/180)^3 = 3.03.
    assert float(klobuchar_at(2.0, np.deg2rad(np.array(5.0))) / klobuchar_at(2.0)) == pytest.approx(3.03, abs=0.01)


def test_zenith_delay_at_sea_level() -> None:
    # Hydrostatic 2.307 m at 1013.25 hPa and 45 deg (Saastamoinen 1972; Davis 1985); 70 % humidity adds about 0.12 m.
    dry_m = saastamoinen_delay_m(np.array(np.pi / 4), np.array(0.0), ZENITH, relative_humidity=0.0)
    assert float(dry_m) == pytest.approx(2.307, abs=0.002)


def test_humidity_adds_a_decimetre() -> None:
    dry_m, humid_m = (saastamoinen_delay_m(np.array(np.pi / 4), np.array(0.0), ZENITH, h) for h in (0.0, 0.7))
    assert float(humid_m - dry_m) == pytest.approx(0.12, abs=0.03)


def test_delay_falls_with_height() -> None:
    by_height = saastamoinen_delay_m(np.array(np.pi / 4), np.linspace(0.0, 10_000.0, 200), ZENITH)
    assert (np.diff(by_height) < 0.0).all()


@pytest.mark.parametrize(("height_m", "as_at_m"), [(-400.0, 0.0), (1e6, 10_000.0)])
def test_heights_beyond_the_model_are_clipped(height_m: float, as_at_m: float) -> None:
    outside, at_limit = (saastamoinen_delay_m(np.array(0.6), np.array(h), ZENITH) for h in (height_m, as_at_m))
    assert float(outside) == float(at_limit)


def test_mapping_is_one_in_the_zenith() -> None:
    assert float(troposphere_mapping(ZENITH)) == pytest.approx(1.0, abs=1e-6)


def test_mapping_falls_with_elevation() -> None:
    assert (np.diff(troposphere_mapping(ELEVATIONS)) < 0.0).all()


# Niell's wet and hydrostatic mapping functions (1996, table 5) lie between 10.1 and 10.8 at 5 deg, within 0.2 % of 1.995 at 30 deg.
@pytest.mark.parametrize(("el_deg", "expected", "tolerance"), [(5.0, 10.2, 0.15), (10.0, 5.6, 0.06), (30.0, 1.995, 0.01)])
def test_mapping_near_niells(el_deg: float, expected: float, tolerance: float) -> None:
    assert float(troposphere_mapping(np.array(np.deg2rad(el_deg)))) == pytest.approx(expected, abs=tolerance)
