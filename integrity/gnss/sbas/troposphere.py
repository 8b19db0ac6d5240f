"""Delay of the troposphere in the zenith, by latitude, day of the year and height; its slant is `atmosphere.troposphere_mapping`.

Source: RTCA DO-229D, A.4.2.4, with its table of meteorological parameters.
"""

from typing import NamedTuple

import numpy as np

from integrity.gnss.gps_time import DAY_S, NS_PER_S
from integrity.gnss.observations import Floats, Ints

K1_KPMBAR, K2_K2PMBAR = 77.604, 382_000.0  # refractivity of dry air and of vapour
R_D_JPKGK, G_M_MPS2, G_MPS2 = 287.054, 9.784, 9.80665  # gas constant of dry air; gravity at the air's centre of mass, and at the ground
YEAR_D = 365.25
COLDEST_DAY_NORTH, COLDEST_DAY_SOUTH = 28.0, 211.0  # D_min
LOWEST_M, HIGHEST_M = -500.0, 10_000.0  # of the ground, and of what flies by this model

_LATITUDES_DEG = np.array([15.0, 30.0, 45.0, 60.0, 75.0])
# Pressure P, mbar; temperature T, K; vapour pressure e, mbar; temperature lapse rate beta, K/m; vapour lapse rate lambda.
_AVERAGE = np.array(
    [
        [1013.25, 299.65, 26.31, 6.30e-3, 2.77],
        [1017.25, 294.15, 21.79, 6.05e-3, 3.15],
        [1015.75, 283.15, 11.66, 5.58e-3, 2.57],
        [1011.75, 272.15, 6.78, 5.39e-3, 1.81],
        [1013.00, 263.65, 4.11, 4.53e-3, 1.55],
    ]
).T
_SEASONAL = np.array(
    [
        [0.00, 0.00, 0.00, 0.00e-3, 0.00],
        [-3.75, 7.00, 8.85, 0.25e-3, 0.33],
        [-2.25, 11.00, 7.24, 0.32e-3, 0.46],
        [-1.75, 15.00, 5.36, 0.81e-3, 0.74],
        [-0.50, 14.50, 3.39, 0.62e-3, 0.30],
    ]
).T
_CALENDAR_BEGINS = np.datetime64("1980-01-06", "D")


class Weather(NamedTuple):
    """At sea level, by place and season; units as in the tables."""

    P: Floats
    T: Floats
    e: Floats
    beta: Floats
    lambda_: Floats


def zenith_delay_m(t_ns: Ints, lat_rad: Floats, height_m: Floats) -> Floats:
    """Hydrostatic and wet delay, m, at GPS times and places; shapes broadcast.

    The model wants heights above sea level. Those above the ellipsoid, up to 110 m off, change it by 3 cm at most, a quarter of the sigma
    of 0.12 m that goes with it (A.4.2.5). Heights outside -500 to 10,000 m are clipped.
    """
    P, T, e, beta, lambda_ = weather(day_of_year(t_ns), lat_rad)
    dry_m = 1e-6 * K1_KPMBAR * R_D_JPKGK * P / G_M_MPS2
    wet_m = 1e-6 * K2_K2PMBAR * R_D_JPKGK / (G_M_MPS2 * (lambda_ + 1.0) - beta * R_D_JPKGK) * e / T
    cooler = 1.0 - beta * np.clip(height_m, LOWEST_M, HIGHEST_M) / T
    power = G_MPS2 / (R_D_JPKGK * beta)
    delay_m: Floats = dry_m * cooler**power + wet_m * cooler ** ((lambda_ + 1.0) * power - 1.0)
    return delay_m


def weather(day: Floats, lat_rad: Floats) -> Weather:
    """Averages less a yearly cosine, both linear in latitude between 15 and 75 degrees and constant beyond."""
    lat_deg = np.degrees(lat_rad)
    coldest = np.where(lat_deg >= 0.0, COLDEST_DAY_NORTH, COLDEST_DAY_SOUTH)
    season = np.cos(2.0 * np.pi * (day - coldest) / YEAR_D)
    away = np.abs(lat_deg)
    values = (
        np.interp(away, _LATITUDES_DEG, average) - np.interp(away, _LATITUDES_DEG, seasonal) * season
        for average, seasonal in zip(_AVERAGE, _SEASONAL, strict=True)
    )
    return Weather(*values)


def day_of_year(t_ns: Ints) -> Floats:
    """From 1 at the beginning of 1 January, with its fraction: the delay then has no steps. On the calendar of GPS time."""
    days, ns = np.divmod(t_ns, DAY_S * NS_PER_S)
    date = _CALENDAR_BEGINS + days.astype("timedelta64[D]")
    since = (date - date.astype("datetime64[Y]")).astype(np.int64)
    day: Floats = 1.0 + since + ns / (DAY_S * NS_PER_S)
    return day
