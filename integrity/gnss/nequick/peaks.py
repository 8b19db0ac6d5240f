"""Where and how dense the F2 layer's peak is: numerical maps over the Earth, ordered by the magnetic field.

Source: European GNSS (Galileo) Open Service, Ionospheric Correction Algorithm for Galileo Single Frequency Users, issue 1.2,
2.5.4.3 (modified dip latitude), 2.5.5.3 (maps), 2.5.7.1 (interpolation); the maps are those of ITU-R P.1239.
"""

from typing import NamedTuple

import numpy as np

from integrity.gnss.angles import sine_cosine
from integrity.gnss.gps_time import DAY_S
from integrity.gnss.nequick.maps import figures
from integrity.gnss.observations import Floats, Ints

FO_F2_DEGREES = (12, 12, 9, 5, 2, 1, 1, 1, 1)  # terms in powers of sin(modip), for each harmonic of the longitude
M3000_DEGREES = (7, 8, 6, 3, 2, 1, 1)
LOWEST_M3000 = 1.0  # below, the formula for the height of the peak has no value


class Site(NamedTuple):
    """Points on the sphere, any one shape: sines and cosines of geographic latitude and longitude."""

    sin_lat: Floats
    cos_lat: Floats
    sin_lon: Floats
    cos_lon: Floats


class MapCoefficients(NamedTuple):
    """The geographic coefficients of both maps for a month, a time of day and a solar activity: (76, ...) and (49, ...)."""

    fo_f2: Floats
    m3000: Floats


def modip_deg(lat_rad: Floats, lon_rad: Floats) -> Floats:
    """Modified dip latitude in degrees, of geographic latitude and longitude (in -pi to pi); third order in both; NaN of NaN."""
    row = (np.degrees(lat_rad) + 90.0) / 5.0
    column = (np.degrees(lon_rad) + 180.0) / 10.0
    grid = figures().modip_deg
    first_row = np.clip(np.floor(row), 0.0, grid.shape[0] - 4.0)
    first_column = np.clip(np.floor(column), 0.0, grid.shape[1] - 4.0)
    corner: Ints = np.nan_to_num(first_row * grid.shape[1] + first_column).astype(np.int64)  # NaN stays, in the weights
    across = _third_order(column - first_column)
    flat = grid.ravel()
    value: Floats = np.zeros(np.shape(corner))
    for i, along in enumerate(_third_order(row - first_row)):
        start = corner + i * grid.shape[1]
        value = value + along * sum(w * flat[start + j] for j, w in enumerate(across))
    return value


def _third_order(offset: Floats) -> tuple[Floats, Floats, Floats, Floats]:
    """Weights of four neighbours for a place between the second (offset 0) and the third (offset 1)."""
    d = 2.0 * offset - 1.0
    d2 = d * d
    even, odd = (d2 - 1.0) / 16.0, (d2 - 1.0) * d / 48.0
    inner_even, inner_odd = (9.0 - d2) / 16.0, (9.0 - d2) * d / 16.0
    return even - odd, inner_even - inner_odd, inner_even + inner_odd, even + odd


def map_coefficients(month: int, ut_s: Floats, sunspots: Floats) -> MapCoefficients:
    """The maps for a month (1 to 12) at times of day, for effective sunspot numbers: `ut_s` and `sunspots` broadcast to (...)."""
    longest = figures().fo_f2.shape[-1]
    angle = 2.0 * np.pi * ut_s / DAY_S - np.pi  # 15 UT - 180 deg
    waves = [np.ones_like(angle)]
    for n in range(1, longest // 2 + 1):
        waves += sine_cosine(n * angle)

    def at(maps: Floats) -> Floats:
        # term by term: the order in which einsum or sum adds depends on how many epochs there are
        low_high = np.zeros((*maps.shape[1:3], *angle.shape))
        for j, wave in enumerate(waves[: maps.shape[-1]]):
            low_high += maps[month - 1, :, :, j].reshape(*maps.shape[1:3], *(1,) * angle.ndim) * wave
        low, high = low_high
        mixed: Floats = low + (high - low) * (sunspots / 100.0)
        return mixed

    return MapCoefficients(at(figures().fo_f2), at(figures().m3000))


def f2_peak(at: Site, modip: Floats, coefficients: MapCoefficients) -> tuple[Floats, Floats]:
    """Critical frequency in MHz and M(3000)F2, at modified dip latitudes in degrees; coefficients broadcast against the points."""
    sin_modip = sine_cosine(np.radians(modip))[0]
    fo_f2 = _sum_of_map(coefficients.fo_f2, FO_F2_DEGREES, sin_modip, at)
    m3000 = _sum_of_map(coefficients.m3000, M3000_DEGREES, sin_modip, at)
    return fo_f2, np.maximum(m3000, LOWEST_M3000)


def _sum_of_map(c: Floats, degrees: tuple[int, ...], sin_modip: Floats, at: Site) -> Floats:
    """sum over harmonics n of cos^n(lat) (P_n(sin modip) cos(n lon) + Q_n(sin modip) sin(n lon)), by Horner's rule."""
    total = _polynomial(c[: degrees[0]], sin_modip)
    step_re, step_im = at.cos_lat * at.cos_lon, at.cos_lat * at.sin_lon
    re, im = step_re, step_im
    start = degrees[0]
    for n, degree in enumerate(degrees[1:], 1):
        stop = start + 2 * degree
        total = total + _polynomial(c[start:stop:2], sin_modip) * re + _polynomial(c[start + 1 : stop : 2], sin_modip) * im
        start = stop
        if n + 1 < len(degrees):
            re, im = re * step_re - im * step_im, re * step_im + im * step_re
    return total


def _polynomial(c: Floats, x: Floats) -> Floats:
    value: Floats = c[-1]
    for i in range(len(c) - 2, -1, -1):
        value = value * x + c[i]
    return value
