"""What satellites send of their orbits and clocks: Kepler elements (GPS, QZSS, Galileo, BeiDou), state vectors (GLONASS, SBAS).

All times are GPS time in nanoseconds: of BeiDou (BDT, 14 s behind) and GLONASS (UTC + 3 h) too. `healthy` and `accuracy_m` (URA, SISA, F_T;
None: no accuracy promised) are what the satellite says of itself. A set serves while |t - toe| <= `fit_half_s`.
"""

from dataclasses import dataclass
from math import isfinite
from typing import Literal

from integrity.gnss.gps_time import DAY_S, NS_PER_S
from integrity.gnss.signals import BAND_HZ, GLONASS_CHANNELS

KeplerMessage = Literal["LNAV", "INAV", "FNAV", "D1", "D2"]
MESSAGES: dict[str, tuple[KeplerMessage, ...]] = {"G": ("LNAV",), "J": ("LNAV",), "E": ("INAV", "FNAV"), "C": ("D1", "D2")}
MOST_ACCURACY_M = 6144.0
# Satellites that a system can have: PRN, slot (those beyond 24 are on test), PRN less 192 and less 100.
NUMBERS = {"G": range(1, 33), "E": range(1, 37), "C": range(1, 64), "R": range(1, 33), "J": range(1, 11), "S": range(20, 59)}


@dataclass(frozen=True)
class KeplerEphemeris:
    """One set of GPS, QZSS, Galileo or BeiDou, in the units of IS-GPS-200 table 20-III with angles in radians.

    `group_delay_s` is what a user of the first band alone subtracts from the clock: TGD, BGD(E1,E5b) of I/NAV, BGD(E1,E5a) of F/NAV,
    TGD1. `group_delay_2_s` is the other one that is sent, if any: BGD(E1,E5a) of I/NAV, TGD2.
    """

    satellite: str
    message: KeplerMessage
    issue: int  # IODE, IODnav, or of BeiDou AODE
    healthy: bool
    accuracy_m: float | None
    transmission_ns: int
    toe_ns: int
    toc_ns: int
    fit_half_s: float
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
    group_delay_2_s: float | None = None

    def implausibility(self) -> str | None:
        """Why this set cannot be an orbit and a clock of its system, or None; see `PLAUSIBLE`."""
        if self.message not in MESSAGES.get(self.satellite[:1], ()):
            return f"message {self.message} of satellite {self.satellite!r}, expected {MESSAGES}"
        if abs(self.toc_ns - self.toe_ns) > DAY_S * NS_PER_S:
            return "clock and orbit reference times are more than a day apart"
        return _implausibility(self, PLAUSIBLE if self.satellite[0] in "GE" else PLAUSIBLE | GEOSYNCHRONOUS)


@dataclass(frozen=True)
class GlonassEphemeris:
    """One set of GLONASS: position, velocity and luni-solar acceleration in PZ-90 (ECEF of that time) at toe (t_b), m, m/s, m/s2.

    `tau_n_s`, `gamma_n`: the satellite's clock is behind GLONASS time by tau_n - gamma_n (t - t_b); `delta_tau_n_s`: G2 leaves that much
    after G1 (None: not told). `issue` is t_b in quarters of an hour of the Moscow day, `channel` the frequency number H_n.
    Source: GLONASS ICD 5.1, 4.4.
    """

    satellite: str
    channel: int
    issue: int
    healthy: bool
    accuracy_m: float | None
    transmission_ns: int
    toe_ns: int
    fit_half_s: float
    x_m: float
    y_m: float
    z_m: float
    vx_mps: float
    vy_mps: float
    vz_mps: float
    ax_mps2: float
    ay_mps2: float
    az_mps2: float
    tau_n_s: float
    gamma_n: float
    delta_tau_n_s: float | None

    def implausibility(self) -> str | None:
        """Why this set cannot be one of GLONASS, or None; see `PLAUSIBLE_GLONASS`."""
        if self.channel not in GLONASS_CHANNELS:
            return f"channel {self.channel}, expected {GLONASS_CHANNELS.start} to {GLONASS_CHANNELS.stop - 1}"
        return _implausibility(self, PLAUSIBLE_GLONASS) or _off_orbit(self, 25.0e6, 26.0e6, MOST_GLONASS_CLIMB_MPS)


@dataclass(frozen=True)
class GeoEphemeris:
    """One set of an SBAS satellite (message type 9): position, velocity, acceleration in ECEF at toe (t_0), m, m/s, m/s2; `issue` is the
    IODN. Satellite PRN 129 is `S29`. Source: RTCA DO-229, A.4.4.11."""

    satellite: str
    issue: int
    healthy: bool
    accuracy_m: float | None
    transmission_ns: int
    toe_ns: int
    fit_half_s: float
    x_m: float
    y_m: float
    z_m: float
    vx_mps: float
    vy_mps: float
    vz_mps: float
    ax_mps2: float
    ay_mps2: float
    az_mps2: float
    af0: float
    af1: float

    def implausibility(self) -> str | None:
        """Why this set cannot be one of a geostationary satellite, or None; see `PLAUSIBLE_GEO`."""
        return _implausibility(self, PLAUSIBLE_GEO) or _off_orbit(self, 41.0e6, 43.5e6, MOST_GEO_CLIMB_MPS)


Ephemeris = KeplerEphemeris | GlonassEphemeris | GeoEphemeris

# What the words of IS-GPS-200 table 20-III, Galileo OS SIS ICD table 68 and BDS-SIS-ICD B1I table 5-9 can hold (radians, with a margin),
# where no narrower range is sure: a semi-major axis between 25,000 and 31,360 km, an eccentricity that the solution of Kepler's equation
# is made for (of QZSS 0.075, of two Galileo satellites 0.16).
PLAUSIBLE: dict[str, tuple[float, float]] = {
    "sqrt_a": (5000.0, 5600.0),
    "e": (0.0, 0.2),
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
    **dict.fromkeys(("group_delay_s", "group_delay_2_s"), (-1e-6, 1e-6)),
}
MOST_GLONASS_CLIMB_MPS = 100.0  # of healthy satellites up to 10 m/s
MOST_GEO_CLIMB_MPS = 100.0
GEOSYNCHRONOUS = {"sqrt_a": (5000.0, 6600.0)}  # of BeiDou and QZSS some are 42,164 km from the centre of the Earth
_VECTORS = {
    **dict.fromkeys(("x_m", "y_m", "z_m"), (-4.35e7, 4.35e7)),
    **dict.fromkeys(("vx_mps", "vy_mps", "vz_mps"), (-4.3e3, 4.3e3)),
}
PLAUSIBLE_GLONASS: dict[str, tuple[float, float]] = _VECTORS | {
    "fit_half_s": (1.0, 3_600.0),
    **dict.fromkeys(("ax_mps2", "ay_mps2", "az_mps2"), (-1.4e-5, 1.4e-5)),  # what the words hold; satellites send up to 6.6e-6
    "tau_n_s": (-2.0e-3, 2.0e-3),
    "gamma_n": (-1.9e-9, 1.9e-9),
    "delta_tau_n_s": (-1.4e-8, 1.4e-8),
}
PLAUSIBLE_GEO: dict[str, tuple[float, float]] = _VECTORS | {
    "fit_half_s": (1.0, 3_600.0),
    **dict.fromkeys(("ax_mps2", "ay_mps2", "az_mps2"), (-0.01, 0.01)),
    "af0": (-2e-6, 2e-6),
    "af1": (-2e-10, 2e-10),
}


def _implausibility(eph: Ephemeris, plausible: dict[str, tuple[float, float]]) -> str | None:
    system, number = eph.satellite[:1], eph.satellite[1:]
    if not (len(number) == 2 and number.isdecimal() and int(number) in NUMBERS.get(system, ())):
        return f"satellite {eph.satellite!r}, expected a name like G05 or E11"
    values = {name: value for name in plausible if (value := getattr(eph, name)) is not None}
    if not all(isfinite(value) for value in values.values()) or not isfinite(eph.accuracy_m or 0.0):
        return "a parameter is not a number"
    if eph.accuracy_m is not None and not 0.0 <= eph.accuracy_m <= MOST_ACCURACY_M:
        return f"accuracy_m = {eph.accuracy_m:.6g}, expected 0 to {MOST_ACCURACY_M:g}"
    for name, value in values.items():
        low, high = plausible[name]
        if not low <= value <= high:
            return f"{name} = {value:.6g}, expected {low:g} to {high:g}"
    return None


def _off_orbit(eph: GlonassEphemeris | GeoEphemeris, low_m: float, high_m: float, most_climb_mps: float) -> str | None:
    """What two frames mixed up give: a place or a velocity that is not of a nearly circular orbit."""
    radius_m = (eph.x_m**2 + eph.y_m**2 + eph.z_m**2) ** 0.5
    if not low_m <= radius_m <= high_m:
        return f"{radius_m:.6g} m from the centre of the Earth, expected {low_m:g} to {high_m:g}"
    climb_mps = (eph.x_m * eph.vx_mps + eph.y_m * eph.vy_mps + eph.z_m * eph.vz_mps) / radius_m
    if not abs(climb_mps) <= most_climb_mps:
        return f"{climb_mps:.6g} m/s away from the Earth, expected at most {most_climb_mps:g} up or down"
    return None


def group_delays_s(eph: Ephemeris) -> tuple[float | None, ...]:
    """By band in the order of `signals.DELAY_BANDS`, how much later than the broadcast clock says a signal leaves; None: not known.

    GPS, QZSS: the clock is that of L1 P and L2 P free of ionosphere (IS-GPS-200, 20.3.3.3.3.2); what C/A and L2C differ from these is not
    sent. Galileo: I/NAV's is that of E1 and E5b, F/NAV's of E1 and E5a (OS SIS ICD 2.1, 5.1.5). BeiDou: that of B3I (BDS-SIS-ICD B1I 3.0,
    5.2.4.10). GLONASS: that of G1.
    """
    if isinstance(eph, GeoEphemeris):
        return (0.0,)
    if isinstance(eph, GlonassEphemeris):
        return 0.0, eph.delta_tau_n_s
    first, second = eph.group_delay_s, eph.group_delay_2_s
    match eph.message:
        case "LNAV":
            return first, first * gamma("G", "1", "2")
        case "INAV":
            e5a = None if second is None else first - (1.0 - gamma("E", "1", "5")) * second
            return first, first * gamma("E", "1", "7"), e5a
        case "FNAV":
            return first, None, first * gamma("E", "1", "5")
        case "D1" | "D2":
            return first, second, 0.0


def gamma(system: str, band: str, other: str) -> float:
    """Squared ratio of two carrier frequencies: by it the ionosphere delays the other band more."""
    return (BAND_HZ[system + band] / BAND_HZ[system + other]) ** 2
