"""Delays of the atmosphere against RTKLIB's `ionmodel` and `tropmodel`, over the whole Earth and day."""

from types import ModuleType

import numpy as np
import pytest

from integrity.gnss.atmosphere import Klobuchar, klobuchar_delay_m, saastamoinen_delay_m, troposphere_mapping
from integrity.gnss.gps_time import DAY_S
from integrity.gnss.observations import Floats

WEEK = 2149
EL_RAD = np.radians([5.0, 7.5, 10.0, 15.0, 30.0, 60.0, 89.0, 90.0])
RELATIVE_HUMIDITY = 0.7

# As broadcast by GPS on 19 March 2021: a quiet Sun.
QUIET = Klobuchar(alpha=(1.118e-8, 7.451e-9, -5.96e-8, -5.96e-8), beta=(9.011e4, 0.0, -1.966e5, -6.554e4))
# As broadcast on 1 January 2004 (RTKLIB's own default): here the limits of amplitude and period are reached.
ACTIVE = Klobuchar(alpha=(1.118e-8, -7.451e-9, -5.961e-8, 1.192e-7), beta=(1.167e5, -2.294e5, -1.311e5, 1.049e6))


def grid(*axes: Floats) -> list[Floats]:
    """Every combination of the axes' values: one flat array per axis."""
    return [values.ravel() for values in np.meshgrid(*axes, indexing="ij")]


@pytest.mark.parametrize("k", [QUIET, ACTIVE], ids=["quiet", "active"])
def test_klobuchar_agrees_within_1_mm(rtklib: ModuleType, k: Klobuchar) -> None:
    tow_s, lat_rad, lon_rad, az_rad, el_rad = grid(
        np.arange(0.0, 7 * DAY_S, 29_700.0),  # 21 times over the week, all at different hours
        np.radians([-89.0, -60.0, -35.0, -10.0, 0.0, 20.0, 48.0, 70.0, 89.0]),
        np.radians([-180.0, -120.0, -50.0, 0.0, 11.0, 90.0, 140.0, 180.0]),
        np.radians([0.0, 45.0, 100.0, 180.0, 250.0, 359.0]),
        EL_RAD,
    )
    ion, pos, azel = rtklib.Arr1Ddouble(8), rtklib.Arr1Ddouble(3), rtklib.Arr1Ddouble(2)
    for i, coefficient in enumerate(k.alpha + k.beta):
        ion[i] = coefficient
    time_of = {tow: rtklib.gpst2time(WEEK, float(tow)) for tow in np.unique(tow_s)}
    expected_m = np.empty_like(el_rad)
    for i, (tow, lat, lon, az, el) in enumerate(zip(tow_s, lat_rad, lon_rad, az_rad, el_rad, strict=True)):
        pos[0], pos[1], azel[0], azel[1] = lat, lon, az, el
        expected_m[i] = rtklib.ionmodel(time_of[tow], ion, pos, azel)
    assert np.max(np.abs(klobuchar_delay_m(tow_s, lat_rad, lon_rad, az_rad, el_rad, k) - expected_m)) <= 1e-3


def test_saastamoinen_at_zenith_agrees_within_1_mm(rtklib: ModuleType) -> None:
    lat_rad, height_m = grid(
        np.radians([-90.0, -45.0, -10.0, 0.0, 30.0, 48.0, 70.0, 90.0]),
        np.array([-99.9, -30.0, 0.0, 40.0, 250.0, 800.0, 2000.0, 4800.0, 9999.0]),
    )
    pos, azel, t = rtklib.Arr1Ddouble(3), rtklib.Arr1Ddouble(2), rtklib.gpst2time(WEEK, 0.0)
    azel[1] = np.pi / 2.0
    expected_m = np.empty_like(lat_rad)
    for i, (lat, height) in enumerate(zip(lat_rad, height_m, strict=True)):
        pos[0], pos[2] = lat, height
        expected_m[i] = rtklib.tropmodel(t, pos, azel, RELATIVE_HUMIDITY)
    zenith = np.full_like(lat_rad, np.pi / 2.0)
    assert np.max(np.abs(saastamoinen_delay_m(lat_rad, height_m, zenith, RELATIVE_HUMIDITY) - expected_m)) <= 1e-3


def test_mapping_is_within_12_permille_of_niells_hydrostatic_one(rtklib: ModuleType) -> None:
    lat_rad, el_rad = grid(np.radians([-60.0, -35.0, 0.0, 35.0, 48.0, 70.0]), np.radians([5.0, 7.5, 10.0, 15.0, 30.0, 60.0, 90.0]))
    pos, azel, t = rtklib.Arr1Ddouble(3), rtklib.Arr1Ddouble(2), rtklib.gpst2time(WEEK, 0.0)
    wet, niell = rtklib.Arr1Ddouble(1), np.empty_like(el_rad)
    for i, (lat, el) in enumerate(zip(lat_rad, el_rad, strict=True)):
        pos[0], pos[2], azel[1] = lat, 100.0, el
        niell[i] = rtklib.tropmapf(t, pos, azel, wet)
    assert np.max(np.abs(troposphere_mapping(el_rad) / niell - 1.0)) <= 0.012
