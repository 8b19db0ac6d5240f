"""Orbits of Kepler elements with harmonic corrections: GPS, QZSS, Galileo, BeiDou.

Sources: IS-GPS-200, table 20-IV and 20.3.3.3.3.1; Galileo OS SIS ICD, 5.1.1; BDS-SIS-ICD B1I 3.0, table 5-11 and 5.2.4.12.
"""

from math import cos, nan, sin, sqrt
from typing import NamedTuple

import numpy as np

from integrity.gnss.angles import sine_cosine, turned
from integrity.gnss.constants import (
    BEIDOU_EARTH_ROTATION_RADPS,
    BEIDOU_MU_M3PS2,
    EARTH_ROTATION_RADPS,
    GALILEO_MU_M3PS2,
    GALILEO_RELATIVITY_SPSQRTM,
    GPS_MU_M3PS2,
    GPS_RELATIVITY_SPSQRTM,
)
from integrity.gnss.ephemeris.broadcast import KeplerEphemeris
from integrity.gnss.gps_time import BDT_BEHIND_GPS_NS, NS_PER_S, WEEK_NS
from integrity.gnss.observations import Bools, Floats, Ints

GEO_TILT_RAD = float(np.deg2rad(-5.0))  # of the frame in which BeiDou gives the elements of its geostationary satellites
GEOSTATIONARY = frozenset(f"C{prn:02d}" for prn in (*range(1, 6), *range(59, 64)))  # BDS-SIS-ICD B1I 3.0, 4.3.2

_MU = {"E": GALILEO_MU_M3PS2, "C": BEIDOU_MU_M3PS2}
_RELATIVITY = {"E": GALILEO_RELATIVITY_SPSQRTM, "C": GALILEO_RELATIVITY_SPSQRTM}


class Parameters(NamedTuple):
    """Sets side by side: what is broadcast, and what follows from it alone; each of shape (n,)."""

    e: Floats
    m0: Floats
    i_dot: Floats
    cuc: Floats
    cus: Floats
    crc: Floats
    crs: Floats
    cic: Floats
    cis: Floats
    af0: Floats
    af1: Floats
    af2: Floats
    A: Floats
    n: Floats
    root: Floats  # sqrt(1 - e^2)
    sin_w: Floats
    cos_w: Floats
    sin_i0: Floats
    cos_i0: Floats
    Omega_toe: Floats  # of the node in ECEF at toe
    Omega_dot: Floats
    F_e_sqrt_a: Floats
    toe_s: Floats  # from an origin, as toc_s
    toc_s: Floats


TIMELESS = len(Parameters._fields) - 2


def timeless(eph: KeplerEphemeris) -> tuple[float, ...]:
    """In the order of `Parameters`, but for the two times."""
    system = eph.satellite[0]
    mu, F = _MU.get(system, GPS_MU_M3PS2), _RELATIVITY.get(system, GPS_RELATIVITY_SPSQRTM)
    A = eph.sqrt_a**2
    behind_ns, spin = (BDT_BEHIND_GPS_NS, BEIDOU_EARTH_ROTATION_RADPS) if system == "C" else (0, EARTH_ROTATION_RADPS)
    toe_s = (eph.toe_ns - behind_ns) % WEEK_NS / NS_PER_S
    return (
        *(eph.e, eph.m0, eph.i_dot, eph.cuc, eph.cus, eph.crc, eph.crs, eph.cic, eph.cis),
        *(eph.af0, eph.af1, eph.af2),
        *(A, sqrt(mu / A**3) + eph.delta_n, sqrt(1.0 - eph.e**2)),
        *(sin(eph.omega), cos(eph.omega), sin(eph.i0), cos(eph.i0)),
        *(eph.omega0 - spin * toe_s, eph.omega_dot - (0.0 if eph.satellite in GEOSTATIONARY else spin)),
        F * eph.e * eph.sqrt_a,
    )


NO_ORBIT = (nan,) * TIMELESS


class Elements(NamedTuple):
    """Sets side by side; the last of n + 1, index -1, is "none". `columns`: `Parameters` but for the times (P - 2, n + 1); `reference_ns`:
    toe and toc (2, n + 1); `tilted` (n + 1,): which are BeiDou's geostationary satellites."""

    columns: Floats
    reference_ns: Ints
    tilted: Bools

    def parameters(self, which: Ints, origin_ns: Ints) -> Parameters:
        """Of the sets `which` (n,), times in seconds from origins (n,)."""
        return Parameters(*self.columns.take(which, axis=1), *((self.reference_ns.take(which, axis=1) - origin_ns) / NS_PER_S))


def evaluate(p: Parameters, t_s: Floats, tilted: Bools) -> tuple[Floats, Floats, Floats, Floats]:
    """Position (x, y, z) and clock of n sets, each (m, n), at times (m, 1) from each set's origin; `tilted` (n,) as in `Elements`."""
    t_k = t_s - p.toe_s
    M_k = p.m0 + p.n * t_k
    sin_M, cos_M = sine_cosine(M_k)  # E_k by Newton's method from a series: to 4e-3 rad for e <= 0.2, then 2e-6, then 1e-12
    E_k = M_k + p.e * sin_M * (1.0 + p.e * cos_M)
    sin_E, cos_E = sine_cosine(E_k)
    step = (M_k - E_k + p.e * sin_E) / (1.0 - p.e * cos_E)
    sin_E, cos_E = turned(sin_E, cos_E, step)
    step = (M_k - E_k - step + p.e * sin_E) / (1.0 - p.e * cos_E)
    sin_E, cos_E = sin_E + cos_E * step, cos_E - sin_E * step
    q = 1.0 - p.e * cos_E

    # Argument of latitude Phi_k = nu_k + omega by its sine and cosine; nu_k from E_k without an arctangent.
    sin_nu, cos_nu = p.root * sin_E / q, (cos_E - p.e) / q
    sin_Phi, cos_Phi = sin_nu * p.cos_w + cos_nu * p.sin_w, cos_nu * p.cos_w - sin_nu * p.sin_w
    sin_2Phi, cos_2Phi = 2.0 * sin_Phi * cos_Phi, cos_Phi * cos_Phi - sin_Phi * sin_Phi

    r_k = p.A * q + p.crs * sin_2Phi + p.crc * cos_2Phi
    sin_u, cos_u = turned(sin_Phi, cos_Phi, p.cus * sin_2Phi + p.cuc * cos_2Phi)
    sin_i, cos_i = turned(p.sin_i0, p.cos_i0, p.i_dot * t_k + p.cis * sin_2Phi + p.cic * cos_2Phi)
    x_orb, y_orb = r_k * cos_u, r_k * sin_u
    sin_O, cos_O = sine_cosine(p.Omega_toe + p.Omega_dot * t_k)
    x, y, z = x_orb * cos_O - y_orb * cos_i * sin_O, x_orb * sin_O + y_orb * cos_i * cos_O, y_orb * sin_i
    if tilted.any():
        x, y, z = (np.where(tilted, a, b) for a, b in zip(_upright(x, y, z, t_k), (x, y, z), strict=True))

    t_c = t_s - p.toc_s
    clock_s = p.af0 + t_c * (p.af1 + t_c * p.af2) + p.F_e_sqrt_a * sin_E
    return x, y, z, clock_s


def _upright(x: Floats, y: Floats, z: Floats, t_k: Floats) -> tuple[Floats, Floats, Floats]:
    """From BeiDou's tilted frame, which stood as ECEF does at toe, to ECEF: R_Z(spin t_k) R_X(-5 deg), BDS-SIS-ICD B1I 3.0, table 5-11."""
    cos_x, sin_x = cos(GEO_TILT_RAD), sin(GEO_TILT_RAD)
    y, z = y * cos_x + z * sin_x, z * cos_x - y * sin_x
    sin_z, cos_z = sine_cosine(BEIDOU_EARTH_ROTATION_RADPS * t_k)
    return x * cos_z + y * sin_z, y * cos_z - x * sin_z, z
