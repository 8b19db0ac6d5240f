"""Electron density of NeQuick-G: three layers below the F2 peak, one long tail above it.

Source: European GNSS (Galileo) Open Service, Ionospheric Correction Algorithm for Galileo Single Frequency Users, issue 1.2,
2.5.4 (Sun), 2.5.5 (layers) and 2.5.6 (density), whose symbols the formulas use. Heights in km, frequencies in MHz,
densities in 1e11 / m^3 inside this file.
"""

from typing import NamedTuple

import numpy as np

from integrity.gnss.angles import sine_cosine
from integrity.gnss.gps_time import DAY_S
from integrity.gnss.nequick.peaks import MapCoefficients, Site, f2_peak
from integrity.gnss.observations import Bools, Floats

DENSITY_OF_SQUARED_MHZ = 0.124  # 1e11 / m^3 per MHz^2
E_PEAK_KM = 120.0
E_BOTTOM_KM = 5.0
CHAPMAN_BELOW_KM = 100.0  # from there down the sum of layers gives way to a Chapman layer
DAY_NIGHT_ZENITH_DEG = 86.23292796211615
F1_PRESENT_MHZ = 0.5
AMPLITUDE_ROUNDS = 5
LARGEST_EXPONENT = 80.0


class Sun(NamedTuple):
    """Where the Sun stands: sine and cosine of its declination; those of 2 pi times the time of day; all of one shape."""

    sin_decl: Floats
    cos_decl: Floats
    sin_day: Floats
    cos_day: Floats


class Activity(NamedTuple):
    """What is one per receiver: effective ionisation level Az in solar flux units, effective sunspot number, coefficients of the maps."""

    az_sfu: Floats
    sunspots: Floats
    maps: MapCoefficients


class Profile(NamedTuple):
    """The layers above points of one shape: densities and amplitudes in 1e11 / m^3, heights and thicknesses in km."""

    Nm_F2: Floats
    hm_F2: Floats
    hm_F1: Floats
    B2_bot: Floats
    B1_top: Floats
    B1_bot: Floats
    BE_top: Floats
    H0: Floats
    A_F1: Floats
    A_E: Floats


def sun(month: int, ut_s: Floats) -> Sun:
    """The Sun in the middle of a month (1 to 12) at times of day."""
    t_days = 30.5 * month - 15.0 + (18.0 - ut_s / 3600.0) / 24.0
    a_m = np.radians(0.9856 * t_days - 3.289)
    a_l = a_m + np.radians(1.916 * sine_cosine(a_m)[0] + 0.020 * sine_cosine(2.0 * a_m)[0] + 282.634)
    sin_decl = 0.39782 * sine_cosine(a_l)[0]
    return Sun(sin_decl, np.sqrt(1.0 - sin_decl * sin_decl), *sine_cosine(2.0 * np.pi * ut_s / DAY_S))


def profile(month: int, of: Sun, at: Site, lat_deg: Floats, modip_deg: Floats, activity: Activity) -> Profile:
    """The layers over points; `of` and `activity` broadcast against them."""
    fo_e = _fo_e(month, of, at, lat_deg, activity.az_sfu)
    fo_f2, m3000 = f2_peak(at, modip_deg, activity.maps)
    fo_f1 = _fo_f1(fo_e, fo_f2)
    Nm_E, Nm_F1, Nm_F2 = (DENSITY_OF_SQUARED_MHZ * f * f for f in (fo_e, fo_f1, fo_f2))
    hm_F2 = _hm_f2(fo_e, fo_f2, m3000)
    hm_F1 = 0.5 * (hm_F2 + E_PEAK_KM)
    # 0.385 Nm over the gradient 0.01 exp(-3.467 + 0.857 ln fo^2 + 2.02 ln M), in one power: no division by zero where fo is 0
    squared = fo_f2 * fo_f2
    B2_bot = 38.5 * DENSITY_OF_SQUARED_MHZ * np.exp(3.467 + 0.143 * np.log(np.maximum(squared, 1e-12)) - 2.02 * np.log(m3000))
    B1_top, B1_bot = 0.3 * (hm_F2 - hm_F1), 0.5 * (hm_F1 - E_PEAK_KM)
    BE_top = np.maximum(B1_bot, 7.0)
    A_F1, A_E = _amplitudes(Nm_E, Nm_F1, Nm_F2, hm_F2, hm_F1, B2_bot, B1_bot, BE_top, fo_f1 >= F1_PRESENT_MHZ)
    H0 = _topside_thickness(month, activity.sunspots, Nm_F2, hm_F2, B2_bot)
    return Profile(Nm_F2, hm_F2, hm_F1, B2_bot, B1_top, B1_bot, BE_top, H0, A_F1, A_E)


def density(p: Profile, h_km: Floats) -> Floats:
    """Electrons, 1e11 / m^3, at heights of 60 km or more; shape of the profile."""
    above: Floats = np.where(h_km > p.hm_F2, _topside(p, h_km), _bottomside(p, h_km))
    return above


def _exp(x: Floats) -> Floats:
    value: Floats = np.exp(np.clip(x, -LARGEST_EXPONENT, LARGEST_EXPONENT))
    return value


def _join(f1: Floats | float, f2: Floats | float, alpha: float, x: Floats) -> Floats:
    """f1 where x is well above zero, f2 where it is well below, smooth between: f_join of the document."""
    e = _exp(alpha * x)
    value: Floats = (f1 * e + f2) / (e + 1.0)
    return value


def _epstein(a: Floats) -> Floats:
    """exp(a) / (1 + exp(a))^2, even in a."""
    e = np.exp(-np.abs(a))
    value: Floats = e / ((1.0 + e) * (1.0 + e))
    return value


def _fo_e(month: int, of: Sun, at: Site, lat_deg: Floats, az_sfu: Floats) -> Floats:
    cos_hour = of.sin_day * at.sin_lon - of.cos_day * at.cos_lon  # of the hour angle, pi (12 - LT) / 12
    cos_chi = np.clip(at.sin_lat * of.sin_decl + at.cos_lat * of.cos_decl * cos_hour, -1.0, 1.0)
    chi = np.degrees(np.arccos(cos_chi))
    chi_eff = _join(90.0 - 0.24 * _exp(20.0 - 0.2 * chi), chi, 12.0, chi - DAY_NIGHT_ZENITH_DEG)
    seas = -1.0 if month in (1, 2, 11, 12) else 1.0 if 5 <= month <= 8 else 0.0
    ee = _exp(0.3 * lat_deg)
    seasp = seas * (ee - 1.0) / (ee + 1.0)
    cos_eff = sine_cosine(np.radians(chi_eff))[1]
    squared = (1.112 - 0.019 * seasp) ** 2 * np.sqrt(az_sfu) * np.exp(0.6 * np.log(cos_eff)) + 0.49
    value: Floats = np.sqrt(squared)
    return value


def _fo_f1(fo_e: Floats, fo_f2: Floats) -> Floats:
    raw = _join(1.4 * fo_e, 0.0, 1000.0, fo_e - 2.0)
    raw = _join(0.0, raw, 1000.0, fo_e - raw)
    raw = _join(raw, 0.85 * raw, 60.0, 0.85 * fo_f2 - raw)
    value: Floats = np.where(raw < 1e-6, 0.0, raw)
    return value


def _hm_f2(fo_e: Floats, fo_f2: Floats, m3000: Floats) -> Floats:
    ratio = fo_f2 / fo_e
    rho = _join(ratio, 1.75, 20.0, ratio - 1.75)
    delta_m = 0.253 / (rho - 1.215) - 0.012
    m2 = m3000 * m3000
    factor = np.sqrt((0.0196 * m2 + 1.0) / (1.2967 * m2 - 1.0))
    height: Floats = 1490.0 * m3000 * factor / (m3000 + delta_m) - 176.0
    return height


def _amplitudes(
    Nm_E: Floats,
    Nm_F1: Floats,
    Nm_F2: Floats,
    hm_F2: Floats,
    hm_F1: Floats,
    B2_bot: Floats,
    B1_bot: Floats,
    BE_top: Floats,
    f1_present: Bools,
) -> tuple[Floats, Floats]:
    """A2 (F1) and A3 (E): what each peak's density leaves when the other two layers' share at its height is taken away."""
    A1 = 4.0 * Nm_F2
    E_less_F2 = 4.0 * (Nm_E - A1 * _epstein((E_PEAK_KM - hm_F2) / B2_bot))
    F1_less_F2 = 4.0 * (Nm_F1 - A1 * _epstein((hm_F1 - hm_F2) / B2_bot))
    E_at_F1 = 4.0 * _epstein((hm_F1 - E_PEAK_KM) / BE_top)
    F1_at_E = 4.0 * _epstein((E_PEAK_KM - hm_F1) / B1_bot)
    least = 0.8 * Nm_F1
    A3 = 4.0 * Nm_E
    A2 = np.zeros_like(A3)
    for _ in range(AMPLITUDE_ROUNDS):
        A2 = F1_less_F2 - A3 * E_at_F1
        A2 = _join(A2, least, 1.0, A2 - least)
        A3 = E_less_F2 - A2 * F1_at_E
    A2 = np.where(f1_present, A2, 0.0)
    A3 = np.where(f1_present, A3, E_less_F2)
    return A2, _join(A3, 0.05, 60.0, A3 - 0.005)


def _topside_thickness(month: int, sunspots: Floats, Nm_F2: Floats, hm_F2: Floats, B2_bot: Floats) -> Floats:
    summer = 4 <= month <= 9
    ka = 6.705 - 0.014 * sunspots - 0.008 * hm_F2 if summer else -7.77 + 0.097 * (hm_F2 / B2_bot) ** 2 + 0.153 * Nm_F2
    kb = _join(ka, 2.0, 1.0, ka - 2.0)
    k = _join(8.0, kb, 1.0, kb - 8.0)
    Ha = k * B2_bot
    x = (Ha - 150.0) / 100.0
    thickness: Floats = Ha / ((0.041163 * x - 0.183981) * x + 1.424472)
    return thickness


def _topside(p: Profile, h_km: Floats) -> Floats:
    """At the peak itself the layers below leave nothing but Nm_F2: their arguments are beyond 7e4 there (2.5.6)."""
    g, r = 0.125, 100.0
    dh = np.maximum(h_km - p.hm_F2, 0.0)
    z = dh / (p.H0 * (1.0 + r * g * dh / (r * p.H0 + g * dh)))
    value: Floats = 4.0 * p.Nm_F2 * _epstein(z)
    return value


def _bottomside(p: Profile, h_km: Floats) -> Floats:
    h = np.clip(h_km, CHAPMAN_BELOW_KM, p.hm_F2)
    below_peak = h - p.hm_F2
    fade = np.exp(10.0 / (1.0 - below_peak))  # lets F1 and E go on the way up to the F2 peak
    B1 = np.where(h_km > p.hm_F1, p.B1_top, p.B1_bot)
    BE = np.where(h_km > E_PEAK_KM, p.BE_top, E_BOTTOM_KM)
    layers = (
        (4.0 * p.Nm_F2, below_peak / p.B2_bot, p.B2_bot),
        (p.A_F1, (h - p.hm_F1) / B1 * fade, B1),
        (p.A_E, (h - E_PEAK_KM) / BE * fade, BE),
    )
    shares = [A * _epstein(a) for A, a, _ in layers]
    total = shares[0] + shares[1] + shares[2]
    if not np.any(h_km < CHAPMAN_BELOW_KM):
        return total
    # ds / s of each layer at 100 km is -tanh(a / 2) / B
    growth = sum(s * np.tanh(-0.5 * a) / B for s, (_, a, B) in zip(shares, layers, strict=True))
    z = (h_km - CHAPMAN_BELOW_KM) / 10.0
    chapman = total * _exp(1.0 - (1.0 - 10.0 * growth / total) * z - _exp(-z))
    value: Floats = np.where(h_km < CHAPMAN_BELOW_KM, chapman, total)
    return value
