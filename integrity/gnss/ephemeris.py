"""Broadcast orbits and clocks of GPS and Galileo: from ephemerides to satellite states, for a whole block at once.

`Ephemeris` is one broadcast set; `EphemerisStore` keeps those that have arrived and chooses; `satellite_states` evaluates.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, fields
from typing import NamedTuple

import numpy as np

from integrity.gnss.constants import (
    EARTH_ROTATION_RADPS,
    GALILEO_MU_M3PS2,
    GALILEO_RELATIVITY_SPSQRTM,
    GPS_MU_M3PS2,
    GPS_RELATIVITY_SPSQRTM,
)
from integrity.gnss.gps_time import NS_PER_S, WEEK_S
from integrity.gnss.observations import Bools, Floats, Ints, freeze

KEPLER_ITERATIONS = 3  # Newton from E = M + e sin M: below 1e-14 rad for e < 0.1


@dataclass(frozen=True)
class Ephemeris:
    """One broadcast set, in the units of IS-GPS-200 table 20-III with angles in radians; times are GPS nanoseconds.

    `healthy` and `accuracy_m` (URA or SISA; None: no accuracy promised) are what the satellite says of itself.
    `group_delay_s` is what a single-frequency L1 user subtracts: TGD for GPS, BGD(E1,E5b) for Galileo I/NAV.
    """

    satellite: str
    issue: int  # IODE or IODnav
    healthy: bool
    accuracy_m: float | None
    transmission_ns: int
    toe_ns: int
    toc_ns: int
    fit_half_s: float  # usable for |t - toe| up to this
    sqrt_a: float
    e: float
    i0: float
    omega0: float
    omega: float
    m0: float
    delta_n: float
    i_dot: float
    omega_dot: float
    cuc: float
    cus: float
    crc: float
    crs: float
    cic: float
    cis: float
    af0: float
    af1: float
    af2: float
    group_delay_s: float

    def implausibility(self) -> str | None:
        """Why this set cannot be an orbit of GPS or Galileo, or None. Limits: the ranges of IS-GPS-200 table 20-III, narrowed."""
        numbers = [v for f in fields(self) if isinstance(v := getattr(self, f.name), float)]
        if not np.isfinite(numbers).all():
            return "a parameter is not a number"
        if not 5000.0 < self.sqrt_a < 5600.0:
            return f"sqrt(A) = {self.sqrt_a:.1f} sqrt(m), expected 5000 to 5600"
        if not 0.0 <= self.e < 0.1:
            return f"eccentricity {self.e:.4f}, expected 0 to 0.1"
        if abs(self.toc_ns - self.toe_ns) > 86_400 * NS_PER_S:
            return "clock and orbit reference times are more than a day apart"
        if abs(self.af0) > 0.1 or abs(self.group_delay_s) > 1e-6:
            return f"clock offset {self.af0:.3g} s or group delay {self.group_delay_s:.3g} s out of range"
        return None


class Parameters(NamedTuple):
    """The numbers of several ephemerides side by side, each of shape (n,), or gathered to (E, S)."""

    sqrt_a: Floats
    e: Floats
    i0: Floats
    omega0: Floats
    omega: Floats
    m0: Floats
    delta_n: Floats
    i_dot: Floats
    omega_dot: Floats
    cuc: Floats
    cus: Floats
    crc: Floats
    crs: Floats
    cic: Floats
    cis: Floats
    af0: Floats
    af1: Floats
    af2: Floats
    group_delay_s: Floats
    mu: Floats
    relativity: Floats
    toe_sow_s: Floats


@dataclass(frozen=True, eq=False)
class SatelliteStates:
    """Satellites of a block at the time `t_ns` (E,): position, velocity, acceleration (3, E, S) in ECEF of that time, m, m/s, m/s2.

    `clock_s`, `clock_drift_sps` (E, S): what the satellite's L1 clock is ahead of GPS time, relativity and group delay included.
    NaN where no ephemeris serves.
    """

    t_ns: Ints
    pos_ecef_m: Floats
    vel_ecef_mps: Floats
    acc_ecef_mps2: Floats
    clock_s: Floats
    clock_drift_sps: Floats

    def __post_init__(self) -> None:
        freeze(self)


def parameters_of(ephemerides: Sequence[Ephemeris]) -> Parameters:
    """Ephemerides as columns, a row of NaN appended: index -1 is "none"."""
    broadcast = Parameters._fields[:-3]
    table = np.full((len(Parameters._fields), len(ephemerides) + 1), np.nan)
    for i, eph in enumerate(ephemerides):
        galileo = eph.satellite[0] == "E"
        system = (GALILEO_MU_M3PS2, GALILEO_RELATIVITY_SPSQRTM) if galileo else (GPS_MU_M3PS2, GPS_RELATIVITY_SPSQRTM)
        table[:, i] = [*(getattr(eph, name) for name in broadcast), *system, eph.toe_ns // NS_PER_S % WEEK_S]
    return Parameters(*table)


def satellite_states(ephemerides: Sequence[Ephemeris], index: Ints, t_ns: Ints) -> SatelliteStates:
    """States of satellites at GPS times `t_ns` (E,), `index` (E, S) into `ephemerides`, -1 for none.

    Accuracy: the broadcast model itself, evaluated to better than 1 mm and 1e-12 s; the acceleration is that of a point-mass Earth
    (good to 1e-4 m/s2: 0.01 mm over 0.5 s). Source: IS-GPS-200, table 20-IV and 20.3.3.3.3.1; Galileo OS SIS ICD, 5.1.1.
    """
    toe_ns = np.array([eph.toe_ns for eph in ephemerides] + [0])
    toc_ns = np.array([eph.toc_ns for eph in ephemerides] + [0])
    p = Parameters(*(column[index] for column in parameters_of(ephemerides)))
    t_k = (t_ns[:, None] - toe_ns[index]) / NS_PER_S

    A = p.sqrt_a**2
    n = np.sqrt(p.mu) / (A * p.sqrt_a) + p.delta_n
    M_k = p.m0 + n * t_k
    E_k = M_k + p.e * np.sin(M_k)
    for _ in range(KEPLER_ITERATIONS - 1):
        E_k = E_k - (E_k - p.e * np.sin(E_k) - M_k) / (1.0 - p.e * np.cos(E_k))
    sin_E, cos_E = np.sin(E_k), np.cos(E_k)
    q = 1.0 - p.e * cos_E
    E_dot = n / q

    # Argument of latitude Phi_k = nu_k + omega by its sine and cosine; nu_k from E_k without an arctangent.
    root = np.sqrt(1.0 - p.e**2)
    sin_nu, cos_nu = root * sin_E / q, (cos_E - p.e) / q
    sin_w, cos_w = np.sin(p.omega), np.cos(p.omega)
    sin_Phi, cos_Phi = sin_nu * cos_w + cos_nu * sin_w, cos_nu * cos_w - sin_nu * sin_w
    sin_2Phi, cos_2Phi = 2.0 * sin_Phi * cos_Phi, cos_Phi**2 - sin_Phi**2
    Phi_dot = E_dot * root / q

    du = p.cus * sin_2Phi + p.cuc * cos_2Phi
    r_k = A * q + p.crs * sin_2Phi + p.crc * cos_2Phi
    i_k = p.i0 + p.i_dot * t_k + p.cis * sin_2Phi + p.cic * cos_2Phi
    sin_du, cos_du = du * (1.0 - du**2 / 6.0), 1.0 - du**2 / 2.0  # |du| < 1e-4: below 1e-16
    sin_u, cos_u = sin_Phi * cos_du + cos_Phi * sin_du, cos_Phi * cos_du - sin_Phi * sin_du
    u_dot = Phi_dot * (1.0 + 2.0 * (p.cus * cos_2Phi - p.cuc * sin_2Phi))
    r_dot = A * p.e * sin_E * E_dot + 2.0 * Phi_dot * (p.crs * cos_2Phi - p.crc * sin_2Phi)
    i_dot = p.i_dot + 2.0 * Phi_dot * (p.cis * cos_2Phi - p.cic * sin_2Phi)

    x_orb, y_orb = r_k * cos_u, r_k * sin_u
    x_orb_dot, y_orb_dot = r_dot * cos_u - y_orb * u_dot, r_dot * sin_u + x_orb * u_dot
    Omega_k = p.omega0 + (p.omega_dot - EARTH_ROTATION_RADPS) * t_k - EARTH_ROTATION_RADPS * p.toe_sow_s
    Omega_dot = p.omega_dot - EARTH_ROTATION_RADPS
    sin_O, cos_O, sin_i, cos_i = np.sin(Omega_k), np.cos(Omega_k), np.sin(i_k), np.cos(i_k)
    x, y, z = x_orb * cos_O - y_orb * cos_i * sin_O, x_orb * sin_O + y_orb * cos_i * cos_O, y_orb * sin_i
    tilt = y_orb_dot * cos_i - y_orb * sin_i * i_dot
    vx = x_orb_dot * cos_O - tilt * sin_O - y * Omega_dot
    vy = x_orb_dot * sin_O + tilt * cos_O + x * Omega_dot
    vz = y_orb_dot * sin_i + y_orb * cos_i * i_dot

    gravity = -p.mu / (r_k * r_k * r_k)
    spin = EARTH_ROTATION_RADPS
    ax = (gravity + spin**2) * x + 2.0 * spin * vy
    ay = (gravity + spin**2) * y - 2.0 * spin * vx

    t_c = (t_ns[:, None] - toc_ns[index]) / NS_PER_S
    clock_s = p.af0 + t_c * (p.af1 + t_c * p.af2) + p.relativity * p.e * p.sqrt_a * sin_E - p.group_delay_s
    clock_drift_sps = p.af1 + 2.0 * p.af2 * t_c + p.relativity * p.e * p.sqrt_a * cos_E * E_dot
    return SatelliteStates(
        t_ns=t_ns,
        pos_ecef_m=np.stack((x, y, z)),
        vel_ecef_mps=np.stack((vx, vy, vz)),
        acc_ecef_mps2=np.stack((ax, ay, gravity * z)),
        clock_s=clock_s,
        clock_drift_sps=clock_drift_sps,
    )


class EphemerisStore:
    """The ephemerides that have arrived, in order of arrival, and which of them serves a satellite at an epoch.

    Of those of a satellite that had arrived and are within their fit interval, the one transmitted last serves (then the later
    reference time, then the higher issue): the order in which receivers deliver the same data makes no difference.
    """

    def __init__(self, arrived: Iterable[Ephemeris] = ()) -> None:
        self._arrived = list(dict.fromkeys(arrived))
        self._known = set(self._arrived)

    @property
    def ephemerides(self) -> Sequence[Ephemeris]:
        """In order of arrival; `len` of it is the count that a later `choose` takes as "arrived by then"."""
        return self._arrived

    def add(self, ephemeris: Ephemeris) -> None:
        """Keep an ephemeris; one that is already here changes nothing."""
        if ephemeris not in self._known:
            self._known.add(ephemeris)
            self._arrived.append(ephemeris)

    def forget_before(self, gps_ns: int) -> None:
        """Drop what no epoch at or after `gps_ns` can use. Call between blocks only: earlier counts of arrivals lose their meaning."""
        self._arrived = [eph for eph in self._arrived if eph.toe_ns + eph.fit_half_s * NS_PER_S >= gps_ns]
        self._known = set(self._arrived)

    def choose(self, satellites: Sequence[str], epoch_ns: Ints, arrived: Ints) -> Ints:
        """Index (E, S) into `ephemerides`, -1 for none; `arrived` (E,) is how many had arrived when each epoch was complete."""
        index = np.full((len(epoch_ns), len(satellites)), -1, dtype=np.int64)
        of_satellite: dict[str, list[int]] = {}
        for k, eph in enumerate(self._arrived):
            of_satellite.setdefault(eph.satellite, []).append(k)
        for s, satellite in enumerate(satellites):
            worst_first = sorted(
                of_satellite.get(satellite, ()),
                key=lambda k: (self._arrived[k].transmission_ns, self._arrived[k].toe_ns, self._arrived[k].issue),
            )
            for k in worst_first:
                eph = self._arrived[k]
                serves = (arrived > k) & (np.abs(epoch_ns - eph.toe_ns) <= eph.fit_half_s * NS_PER_S)
                index[serves, s] = k
        return index


def usable(ephemerides: Sequence[Ephemeris], index: Ints) -> Bools:
    """Where the chosen ephemeris (E, S) says healthy and promises an accuracy; False where there is none."""
    good = np.array([eph.healthy and eph.accuracy_m is not None for eph in ephemerides] + [False])
    result: Bools = good[index]
    return result


def accuracy_m(ephemerides: Sequence[Ephemeris], index: Ints) -> Floats:
    """URA or SISA (E, S) in metres of the chosen ephemeris; NaN where there is none or it promises nothing."""
    values = np.array([np.nan if eph.accuracy_m is None else eph.accuracy_m for eph in ephemerides] + [np.nan])
    result: Floats = values[index]
    return result
