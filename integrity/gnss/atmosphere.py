"""Delays of the signal on its way down: ionosphere (Klobuchar; for NeQuick-G see `nequick`) and troposphere (Saastamoinen)."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from integrity.gnss.angles import sine_cosine
from integrity.gnss.constants import SPEED_OF_LIGHT_MPS
from integrity.gnss.gps_time import DAY_S
from integrity.gnss.observations import Floats


@dataclass(frozen=True)
class Klobuchar:
    """The eight broadcast coefficients: alpha in s, s/sc, s/sc^2, s/sc^3 and beta in s, s/sc, ... (sc: semicircle)."""

    alpha: tuple[float, float, float, float]
    beta: tuple[float, float, float, float]

    def plausible(self) -> bool:
        """Whether the words of IS-GPS-200 table 20-X can hold these numbers (with a margin)."""
        return all(abs(a) <= 1e-5 for a in self.alpha) and all(abs(b) <= 1e7 for b in self.beta)


class GalileoIonosphere(NamedTuple):
    """Effective ionisation level of NeQuick-G in solar flux units: ai0 + ai1 mu + ai2 mu^2, mu the modified dip latitude in degrees.

    `disturbed`: the storm flags of regions 1 to 5, region 1 the highest bit. Source: Galileo OS SIS ICD 2.1, 5.1.6 and 5.1.7.
    """

    ai0: float
    ai1: float
    ai2: float
    disturbed: int


Ionosphere = Klobuchar | GalileoIonosphere


def klobuchar_delay_m(tow_s: Floats, lat_rad: Floats, lon_rad: Floats, az_rad: Floats, el_rad: Floats, k: Klobuchar) -> Floats:
    """Ionospheric group delay on L1 in metres, positive, to be subtracted from a pseudorange; shape of el_rad.

    GPS time of week, geodetic latitude and longitude of the receiver; elevation in (0, pi/2]; arguments broadcast.
    Removes about half of the delay (rms). Source: IS-GPS-200, 20.3.3.5.2.5, angles in semicircles there.
    """
    return klobuchar_towards_m(tow_s, lat_rad, lon_rad, *sine_cosine(az_rad), el_rad, k)


def klobuchar_towards_m(
    tow_s: Floats, lat_rad: Floats, lon_rad: Floats, sin_az: Floats, cos_az: Floats, el_rad: Floats, k: Klobuchar
) -> Floats:
    """The same from sine and cosine of the azimuth."""
    E_sc = el_rad / np.pi
    psi_sc = 0.0137 / (E_sc + 0.11) - 0.022
    phi_i_sc = np.minimum(np.maximum(lat_rad / np.pi + psi_sc * cos_az, -0.416), 0.416)
    lambda_i_sc = lon_rad / np.pi + psi_sc * sin_az / _cosine(phi_i_sc * np.pi)
    phi_m_sc = phi_i_sc + 0.064 * _cosine((lambda_i_sc - 1.617) * np.pi)
    t_s = 43_200.0 * lambda_i_sc + tow_s
    t_s = t_s - DAY_S * np.floor(t_s / DAY_S)

    def cubic(c: tuple[float, float, float, float]) -> Floats:
        value: Floats = c[0] + phi_m_sc * (c[1] + phi_m_sc * (c[2] + phi_m_sc * c[3]))
        return value

    amplitude_s = np.maximum(cubic(k.alpha), 0.0)
    period_s = np.maximum(cubic(k.beta), 72_000.0)
    x = 2.0 * np.pi * (t_s - 50_400.0) / period_s
    x2 = x * x
    cosine = np.where(np.abs(x) < 1.57, 1.0 - x2 * (0.5 - x2 / 24.0), 0.0)
    low_sc = 0.53 - E_sc
    F = 1.0 + 16.0 * low_sc * low_sc * low_sc
    delay_m: Floats = SPEED_OF_LIGHT_MPS * F * (5e-9 + amplitude_s * cosine)
    return delay_m


def _cosine(angle_rad: Floats) -> Floats:
    """From the tangent of half the angle, as `sine_cosine`."""
    t = np.tan(0.5 * angle_rad)
    square = t * t
    cosine: Floats = (1.0 - square) / (1.0 + square)
    return cosine


def klobuchar_slope(el_rad: Floats) -> Floats:
    """Relative change of the delay with elevation, 1/rad, at one pierce point: that of the obliquity factor F."""
    low_sc = 0.53 - el_rad / np.pi
    slope: Floats = -48.0 / np.pi * low_sc * low_sc / (1.0 + 16.0 * low_sc * low_sc * low_sc)
    return slope


def saastamoinen_delay_m(lat_rad: Floats, height_m: Floats, el_rad: Floats, relative_humidity: float = 0.7) -> Floats:
    """Tropospheric delay in metres, positive, to be subtracted from a pseudorange; shape of el_rad."""
    delay_m: Floats = saastamoinen_zenith_m(lat_rad, height_m, relative_humidity) * troposphere_mapping(el_rad)
    return delay_m


def saastamoinen_zenith_m(lat_rad: Floats, height_m: Floats, relative_humidity: float = 0.7) -> Floats:
    """Tropospheric delay in the zenith, m; shape of lat_rad.

    Saastamoinen in a standard atmosphere (15 deg C and 1013.25 hPa at sea level, -6.5 K/km), good to 0.1 m; heights outside 0 to
    10,000 m are clipped. Sources: Saastamoinen 1972; standard atmosphere as in the RTKLIB 2.4.2 manual, E.5.1 to E.5.4.
    """
    h = np.clip(height_m, 0.0, 10_000.0)
    pressure_hpa = 1013.25 * (1.0 - 2.2557e-5 * h) ** 5.2568
    temperature_k = 15.0 - 6.5e-3 * h + 273.16
    vapour_hpa = 6.108 * relative_humidity * np.exp((17.15 * temperature_k - 4684.0) / (temperature_k - 38.45))
    hydrostatic_m = 0.0022768 * pressure_hpa / (1.0 - 0.00266 * np.cos(2.0 * lat_rad) - 0.00028 * h / 1e3)
    wet_m = 0.002277 * (1255.0 / temperature_k + 0.05) * vapour_hpa
    zenith_m: Floats = hydrostatic_m + wet_m
    return zenith_m


def troposphere_mapping(el_rad: Floats) -> Floats:
    """Slant over zenith delay, for elevations from 5 deg up; within 1.2 % of Niell's there, where 1 / sin el is 13 % too large.

    Source: Black and Eisner 1984, in the form of RTCA DO-229, A.4.2.4.
    """
    return troposphere_towards(*sine_cosine(el_rad))[0]


def troposphere_towards(sin_el: Floats, cos_el: Floats) -> tuple[Floats, Floats]:
    """The same mapping from sine and cosine of the elevation, and its relative change with elevation, 1/rad."""
    square = 0.002001 + sin_el * sin_el
    return 1.001 / np.sqrt(square), -sin_el * cos_el / square
