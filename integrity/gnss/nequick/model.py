"""Delay by the ionosphere after NeQuick-G: a climate of electron density, scaled by Galileo's broadcast level of ionisation.

Source: European GNSS (Galileo) Open Service, Ionospheric Correction Algorithm for Galileo Single Frequency Users, issue 1.2 (2016).
A climate cannot know the day's weather: its makers aimed at 70 % of the delay (rms), or 20 TECU where that is more.
"""

import numpy as np

from integrity.gnss.atmosphere import GalileoIonosphere
from integrity.gnss.gps_time import DAY_S, NS_PER_S, civil_from_days, utc_from_gps
from integrity.gnss.nequick.integration import POINTS, Geodetic, points, rays
from integrity.gnss.nequick.layers import Activity, Sun, density, profile, sun
from integrity.gnss.nequick.peaks import MapCoefficients, map_coefficients, modip_deg
from integrity.gnss.observations import Bools, Floats, Ints, slices
from integrity.gnss.signals import L1_HZ

DEFAULT_AZ_SFU = 63.7  # 3.1: where all coefficients are zero, that is, not to be used; sunspot number 0
LARGEST_AZ_SFU = 400.0  # 3.3
TECU = 1e16  # electrons per m^2
DELAY_M_PER_TECU = 40.3 * TECU / L1_HZ**2  # on L1, to the first order in 1 / f^2
LOWEST_RECEIVER_M = -1_000.0  # lower is inside the Earth


def month_and_ut(t_ns: Ints) -> tuple[Ints, Floats]:
    """Month (1 to 12) and time of day in seconds, both of UTC (the document's UT), of GPS times; shape of `t_ns`."""
    seconds = np.array([divmod(utc_from_gps(int(t)), DAY_S * NS_PER_S) for t in t_ns.ravel()], dtype=np.int64).reshape(-1, 2)
    months = np.array([civil_from_days(int(day))[1] for day in seconds[:, 0]], dtype=np.int64)
    return months.reshape(t_ns.shape), (seconds[:, 1] / NS_PER_S).reshape(t_ns.shape)


def nequick_delay_m(month: Ints | int, ut_s: Floats, receiver: Geodetic, satellite: Geodetic, ionosphere: GalileoIonosphere) -> Floats:
    """Ionospheric group delay on L1 in metres, positive, to be subtracted from a pseudorange; arguments and shape as of `stec_tecu`."""
    return DELAY_M_PER_TECU * stec_tecu(month, ut_s, receiver, satellite, ionosphere)


def stec_tecu(month: Ints | int, ut_s: Floats, receiver: Geodetic, satellite: Geodetic, ionosphere: GalileoIonosphere) -> Floats:
    """Electrons along the rays, in TECU (1e16 / m^2), of the shape that all arguments broadcast to, such as (E, R, S).

    Month 1 to 12 and time of day in seconds, of UTC. NaN where there is no ray through the air above a receiver: satellite not above
    the receiver or below its horizon (on the document's sphere, within 0.2 deg of the true one), receiver over 1 km below the
    ellipsoid, anything not finite. The model is the document's; for the error of the sum over a ray see `integration`. 40 us a ray.
    """
    given = [np.asarray(a, dtype=np.float64) for a in (ut_s, *receiver, *satellite)]
    shape = np.broadcast_shapes(np.shape(month), *(a.shape for a in given))
    rank = max(len(shape), 1)
    months = np.broadcast_to(np.asarray(month, dtype=np.int64), shape or (1,))
    assert np.all((months >= 1) & (months <= 12)), "months go from 1 to 12"
    finite = [np.where(np.isfinite(a), a, np.nan).reshape((1,) * (rank - a.ndim) + a.shape) for a in given]
    stec = np.full(shape or (1,), np.nan)
    for few in slices(len(stec), POINTS * int(np.prod(shape[1:]))):
        some = [a if len(a) == 1 else a[few] for a in finite]
        for one in np.unique(months[few]):  # two only where a block runs over the end of a month
            counted = _stec_of_month(int(one), some[0], Geodetic(*some[1:4]), Geodetic(*some[4:]), ionosphere)
            stec[few] = np.where(months[few] == one, counted, stec[few])
    return stec.reshape(shape)


def effective_ionisation_sfu(modip: Floats, ionosphere: GalileoIonosphere) -> Floats:
    """Az at modified dip latitudes in degrees; 63.7 where nothing is broadcast (all coefficients zero). Source: 3.1 and 3.3."""
    a0, a1, a2 = ionosphere.ai0, ionosphere.ai1, ionosphere.ai2
    if a0 == a1 == a2 == 0.0:
        return np.full(np.shape(modip), DEFAULT_AZ_SFU)
    az_sfu: Floats = np.clip(a0 + modip * (a1 + modip * a2), 0.0, LARGEST_AZ_SFU)
    return az_sfu


def _stec_of_month(month: int, ut_s: Floats, receiver: Geodetic, satellite: Geodetic, ionosphere: GalileoIonosphere) -> Floats:
    """As `stec_tecu`, for one month."""
    activity = _activity(month, ut_s, receiver, ionosphere)
    ray = rays(receiver, satellite)
    visible: Bools = (ray.sin_el >= 0.0) & (satellite.height_m > receiver.height_m) & (receiver.height_m >= LOWEST_RECEIVER_M)
    there = points(ray)
    of = Sun(*(a[..., None] for a in sun(month, ut_s)))
    modip = modip_deg(there.lat_rad, there.lon_rad)
    layers = profile(month, of, there.at, np.degrees(there.lat_rad), modip, activity)
    counted = np.sum(density(layers, there.height_km) * there.weight_km, axis=-1)
    stec: Floats = np.where(visible, counted * (1e11 * 1e3 / TECU), np.nan)  # 1e11 / m^3 times km
    return stec


def _activity(month: int, ut_s: Floats, receiver: Geodetic, ionosphere: GalileoIonosphere) -> Activity:
    """What the receivers' places set for the whole of their rays, with an axis for the points."""
    lon_rad = np.remainder(receiver.lon_rad + np.pi, 2.0 * np.pi) - np.pi
    az_sfu = effective_ionisation_sfu(modip_deg(receiver.lat_rad, lon_rad), ionosphere)
    sunspots = np.sqrt(167_273.0 + (az_sfu - 63.7) * 1_123.6) - 408.99  # ITU-R P.371-8
    maps = map_coefficients(month, ut_s, sunspots)
    return Activity(az_sfu[..., None], sunspots[..., None], MapCoefficients(*(c[..., None] for c in maps)))
