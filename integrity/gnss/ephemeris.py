"""Broadcast orbits and clocks of GPS and Galileo: from ephemerides to satellite states, for a whole block at once.

`Ephemeris` is one broadcast set; `Ephemerides` are several side by side; `EphemerisStore` keeps those that have arrived and chooses;
`satellite_states` evaluates.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from math import cos, inf, isfinite, sin, sqrt
from typing import NamedTuple

import numpy as np

from integrity.gnss.angles import sine_cosine, turned
from integrity.gnss.constants import (
    EARTH_ROTATION_RADPS,
    GALILEO_MU_M3PS2,
    GALILEO_RELATIVITY_SPSQRTM,
    GPS_MU_M3PS2,
    GPS_RELATIVITY_SPSQRTM,
)
from integrity.gnss.gps_time import NS_PER_S, WEEK_NS
from integrity.gnss.observations import Bools, Floats, Ints, freeze, slices
from integrity.gnss.signals import SYSTEMS

KEPLER_ITERATIONS = 2  # Newton from E = M + e sin M: below 1e-14 rad for e < 0.1


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
        """Why this set cannot be an orbit and a clock of GPS or Galileo, or None; see `PLAUSIBLE`."""
        if self.satellite[:1] not in SYSTEMS or not self.satellite[1:].isdigit():
            return f"satellite {self.satellite!r}, expected a name like G05 or E11"
        if not all(isfinite(getattr(self, name)) for name in PLAUSIBLE) or not isfinite(self.accuracy_m or 0.0):
            return "a parameter is not a number"
        for name, (low, high) in PLAUSIBLE.items():
            if not low <= getattr(self, name) <= high:
                return f"{name} = {getattr(self, name):.6g}, expected {low:g} to {high:g}"
        if self.accuracy_m is not None and not 0.0 <= self.accuracy_m <= 6144.0:
            return f"accuracy_m = {self.accuracy_m:.6g}, expected 0 to 6144"
        if abs(self.toc_ns - self.toe_ns) > 86_400 * NS_PER_S:
            return "clock and orbit reference times are more than a day apart"
        return None


# What the words of IS-GPS-200 table 20-III and Galileo OS SIS ICD table 68 can hold (radians, with a margin), where no narrower range
# is sure: a semi-major axis between 25,000 and 31,360 km, an eccentricity that the solution of Kepler's equation is made for.
PLAUSIBLE: dict[str, tuple[float, float]] = {
    "sqrt_a": (5000.0, 5600.0),
    "e": (0.0, 0.1),
    "fit_half_s": (1.0, 86_400.0),
    **dict.fromkeys(("i0", "omega0", "omega", "m0"), (-6.3, 6.3)),
    "delta_n": (-1e-7, 1e-7),
    "i_dot": (-1e-8, 1e-8),
    "omega_dot": (-1e-6, 1e-6),
    **dict.fromkeys(("cuc", "cus", "cic", "cis"), (-1e-4, 1e-4)),
    **dict.fromkeys(("crc", "crs"), (-2100.0, 2100.0)),
    "af0": (-0.1, 0.1),
    "af1": (-1e-7, 1e-7),
    "af2": (-1e-12, 1e-12),
    "group_delay_s": (-1e-6, 1e-6),
}


class Parameters(NamedTuple):
    """Ephemerides side by side: what is broadcast, and what follows from it alone; each of shape (n,), or gathered to (E, S)."""

    e: Floats
    m0: Floats
    i_dot: Floats
    cuc: Floats
    cus: Floats
    crc: Floats
    crs: Floats
    cic: Floats
    cis: Floats
    af0: Floats  # group delay taken out
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
    mu: Floats
    F_e_sqrt_a: Floats
    toe_s: Floats  # from the common origin, as toc_s
    toc_s: Floats


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


class Ephemerides(tuple[Ephemeris, ...]):
    """Ephemerides with what follows from them, computed once. Arrays of n + 1: the last entry, index -1, is "none"."""

    @staticmethod
    def of(sets: Sequence[Ephemeris]) -> "Ephemerides":
        """The same sets; the same object where they are that already."""
        return sets if isinstance(sets, Ephemerides) else Ephemerides(sets)

    @cached_property
    def columns(self) -> Floats:
        """`Parameters` but for the times, (P - 2, n + 1)."""
        return np.array([*(_timeless(eph) for eph in self), (np.nan,) * (len(Parameters._fields) - 2)]).T

    @cached_property
    def reference_ns(self) -> Ints:
        """toe and toc, (2, n + 1)."""
        return np.array([*((eph.toe_ns, eph.toc_ns) for eph in self), (0, 0)], dtype=np.int64).T

    @cached_property
    def usable(self) -> Bools:
        """Which say healthy and promise an accuracy, (n + 1,)."""
        return np.array([*(eph.healthy and eph.accuracy_m is not None for eph in self), False])

    @cached_property
    def accuracy_m(self) -> Floats:
        """URA or SISA (n + 1,), m; NaN where nothing is promised."""
        return np.array([*(np.nan if eph.accuracy_m is None else eph.accuracy_m for eph in self), np.nan])

    @cached_property
    def best_last(self) -> Ints:
        """Indices by satellite, of each satellite the set that serves first last, (n,)."""
        return np.array(sorted(range(len(self)), key=lambda k: _precedence(self[k])), dtype=np.int64)

    @cached_property
    def serving_ns(self) -> Ints:
        """Reference time and half the fit interval in that order, (2, n)."""
        return np.array([(self[k].toe_ns, round(self[k].fit_half_s * NS_PER_S)) for k in self.best_last], dtype=np.int64).reshape(-1, 2).T

    @cached_property
    def first_of(self) -> dict[str, int]:
        """By satellite, where its sets begin in that order."""
        first: dict[str, int] = {}
        for place, k in enumerate(self.best_last):
            first.setdefault(self[k].satellite, place)
        return first

    def parameters(self, origin_ns: int) -> Parameters:
        """As columns, times in seconds from `origin_ns`."""
        return Parameters(*self.columns, *((self.reference_ns - origin_ns) / NS_PER_S))


def _timeless(eph: Ephemeris) -> tuple[float, ...]:
    """In the order of `Parameters`."""
    galileo = eph.satellite[0] == "E"
    mu, F = (GALILEO_MU_M3PS2, GALILEO_RELATIVITY_SPSQRTM) if galileo else (GPS_MU_M3PS2, GPS_RELATIVITY_SPSQRTM)
    A = eph.sqrt_a**2
    return (
        *(eph.e, eph.m0, eph.i_dot, eph.cuc, eph.cus, eph.crc, eph.crs, eph.cic, eph.cis),
        *(eph.af0 - eph.group_delay_s, eph.af1, eph.af2),
        *(A, sqrt(mu / A**3) + eph.delta_n, sqrt(1.0 - eph.e**2)),
        *(sin(eph.omega), cos(eph.omega), sin(eph.i0), cos(eph.i0)),
        *(eph.omega0 - EARTH_ROTATION_RADPS * (eph.toe_ns % WEEK_NS / NS_PER_S), eph.omega_dot - EARTH_ROTATION_RADPS),
        *(mu, F * eph.e * eph.sqrt_a),
    )


def satellite_states(ephemerides: Sequence[Ephemeris], index: Ints, t_ns: Ints) -> SatelliteStates:
    """States of satellites at GPS times `t_ns` (E,), `index` (E, S) into `ephemerides`, -1 for none.

    Accuracy: the broadcast model itself, evaluated to better than 1 mm and 1e-12 s; the acceleration is that of a point-mass Earth
    (good to 1e-4 m/s2: 0.01 mm over 0.5 s). Source: IS-GPS-200, table 20-IV and 20.3.3.3.3.1; Galileo OS SIS ICD, 5.1.1.
    """
    origin_ns = int(t_ns[0])
    t_s = ((t_ns - origin_ns) / NS_PER_S)[:, None]
    columns = np.array(Ephemerides.of(ephemerides).parameters(origin_ns))
    out = np.empty((11, *index.shape))
    for few in slices(*index.shape):
        out[:, few] = _evaluate(Parameters(*columns.take(index[few], axis=1, mode="wrap")), t_s[few])
    return SatelliteStates(t_ns, out[0:3], out[3:6], out[6:9], out[9], out[10])


def _evaluate(p: Parameters, t_s: Floats) -> tuple[Floats, ...]:
    """Position, velocity, acceleration (x, y, z each), clock and its drift; each (E, S), at times (E, 1) from the common origin."""
    t_k = t_s - p.toe_s
    M_k = p.m0 + p.n * t_k
    E_k = M_k + p.e * sine_cosine(M_k)[0]
    sin_E, cos_E = sine_cosine(E_k)
    for _ in range(KEPLER_ITERATIONS):
        step = (M_k - E_k + p.e * sin_E) / (1.0 - p.e * cos_E)
        E_k = E_k + step
        sin_E, cos_E = turned(sin_E, cos_E, step)
    q = 1.0 - p.e * cos_E
    E_dot = p.n / q

    # Argument of latitude Phi_k = nu_k + omega by its sine and cosine; nu_k from E_k without an arctangent.
    sin_nu, cos_nu = p.root * sin_E / q, (cos_E - p.e) / q
    sin_Phi, cos_Phi = sin_nu * p.cos_w + cos_nu * p.sin_w, cos_nu * p.cos_w - sin_nu * p.sin_w
    sin_2Phi, cos_2Phi = 2.0 * sin_Phi * cos_Phi, cos_Phi * cos_Phi - sin_Phi * sin_Phi
    Phi_dot = E_dot * p.root / q

    r_k = p.A * q + p.crs * sin_2Phi + p.crc * cos_2Phi
    sin_u, cos_u = turned(sin_Phi, cos_Phi, p.cus * sin_2Phi + p.cuc * cos_2Phi)
    sin_i, cos_i = turned(p.sin_i0, p.cos_i0, p.i_dot * t_k + p.cis * sin_2Phi + p.cic * cos_2Phi)
    u_dot = Phi_dot * (1.0 + 2.0 * (p.cus * cos_2Phi - p.cuc * sin_2Phi))
    r_dot = p.A * p.e * sin_E * E_dot + 2.0 * Phi_dot * (p.crs * cos_2Phi - p.crc * sin_2Phi)
    i_dot = p.i_dot + 2.0 * Phi_dot * (p.cis * cos_2Phi - p.cic * sin_2Phi)

    x_orb, y_orb = r_k * cos_u, r_k * sin_u
    x_orb_dot, y_orb_dot = r_dot * cos_u - y_orb * u_dot, r_dot * sin_u + x_orb * u_dot
    Omega_k = p.Omega_toe + p.Omega_dot * t_k
    sin_O, cos_O = sine_cosine(Omega_k)
    y_level, tilt = y_orb * cos_i, y_orb_dot * cos_i - y_orb * sin_i * i_dot
    x, y, z = x_orb * cos_O - y_level * sin_O, x_orb * sin_O + y_level * cos_O, y_orb * sin_i
    vx = x_orb_dot * cos_O - tilt * sin_O - y * p.Omega_dot
    vy = x_orb_dot * sin_O + tilt * cos_O + x * p.Omega_dot
    vz = y_orb_dot * sin_i + y_level * i_dot

    spin = EARTH_ROTATION_RADPS
    gravity = -p.mu / (r_k * r_k * r_k)
    ax = (gravity + spin * spin) * x + 2.0 * spin * vy
    ay = (gravity + spin * spin) * y - 2.0 * spin * vx
    az = gravity * z

    t_c = t_s - p.toc_s
    clock_s = p.af0 + t_c * (p.af1 + t_c * p.af2) + p.F_e_sqrt_a * sin_E
    clock_drift_sps = p.af1 + 2.0 * p.af2 * t_c + p.F_e_sqrt_a * cos_E * E_dot
    return x, y, z, vx, vy, vz, ax, ay, az, clock_s, clock_drift_sps


def _precedence(eph: Ephemeris) -> tuple[str, int, int, int, float, float]:
    """Sort key: by satellite, the set that serves first last; the last two settle what no satellite should send."""
    return eph.satellite, eph.transmission_ns, eph.toe_ns, eph.issue, eph.m0, eph.af0


def _end_ns(eph: Ephemeris) -> float:
    """GPS time up to which a set may be used."""
    return eph.toe_ns + eph.fit_half_s * NS_PER_S


class EphemerisStore:
    """The ephemerides that have arrived, in order of arrival, and which of them serves a satellite at an epoch.

    Of those of a satellite that had arrived and are within their fit interval, the one transmitted last serves (then the later
    reference time, then the higher issue): the order in which receivers deliver the same data makes no difference.
    """

    def __init__(self, arrived: Iterable[Ephemeris] = ()) -> None:
        self._arrived = dict.fromkeys(arrived)
        self._ephemerides: Ephemerides | None = None  # side by side, once they are needed
        self._first_end_ns = min((_end_ns(eph) for eph in self._arrived), default=inf)

    def __len__(self) -> int:
        return len(self._arrived)

    @property
    def ephemerides(self) -> Ephemerides:
        """In order of arrival; `len` of it is the count that a later `choose` takes as "arrived by then"."""
        if self._ephemerides is None:
            self._ephemerides = Ephemerides(self._arrived)
        return self._ephemerides

    def add(self, ephemeris: Ephemeris) -> None:
        """Keep an ephemeris; one that is already here changes nothing."""
        if ephemeris not in self._arrived:
            self._arrived[ephemeris] = None
            self._ephemerides = None
            self._first_end_ns = min(self._first_end_ns, _end_ns(ephemeris))

    def forget_before(self, gps_ns: int) -> None:
        """Drop what no epoch at or after `gps_ns` can use. Call between blocks only: earlier counts of arrivals lose their meaning."""
        if self._first_end_ns < gps_ns:
            self._arrived = {eph: None for eph in self._arrived if _end_ns(eph) >= gps_ns}
            self._ephemerides = None
            self._first_end_ns = min((_end_ns(eph) for eph in self._arrived), default=inf)

    def choose(self, satellites: Sequence[str], epoch_ns: Ints, arrived: Ints) -> Ints:
        """Index (E, S) into `ephemerides`, -1 for none; `arrived` (E,) is how many had arrived when each epoch was complete."""
        sets = self.ephemerides
        number = sets.best_last
        toe_ns, half_ns = sets.serving_ns
        serves = (np.abs(epoch_ns[:, None] - toe_ns) <= half_ns) & (arrived[:, None] > number)
        places = np.where(serves, np.arange(len(number)), -1)
        begins = list(sets.first_of.values())
        last = np.maximum.reduceat(places, begins, axis=1) if begins else places  # of each satellite, (E, satellites of the sets)
        chosen = np.append(np.where(last >= 0, number[last], -1) if begins else last, np.full((len(epoch_ns), 1), -1), axis=1)
        group_of = {satellite: group for group, satellite in enumerate(sets.first_of)}
        index: Ints = chosen[:, [group_of.get(s, -1) for s in satellites]]
        return index


def usable(ephemerides: Sequence[Ephemeris], index: Ints) -> Bools:
    """Where the chosen ephemeris (E, S) says healthy and promises an accuracy; False where there is none."""
    result: Bools = Ephemerides.of(ephemerides).usable[index]
    return result


def accuracy_m(ephemerides: Sequence[Ephemeris], index: Ints) -> Floats:
    """URA or SISA (E, S) in metres of the chosen ephemeris; NaN where there is none or it promises nothing."""
    result: Floats = Ephemerides.of(ephemerides).accuracy_m[index]
    return result
