"""What SBAS messages say, by type, as values. `reading` makes them.

Satellites of corrections are places 1 to 51 in the PRN mask of the same IODP, which `store` knows. Source: RTCA DO-229D, A.4.4.
"""

from typing import NamedTuple

from integrity.gnss.ephemeris.broadcast import GeoEphemeris


class PrnMask(NamedTuple):
    """Type 1: PRN mask numbers (1 to 210) of the satellites, in order."""

    iodp: int
    numbers: tuple[int, ...]


class Fast(NamedTuple):
    """Types 2 to 5 and 24: corrections of the places from `first` on, to be added to pseudoranges, m, and UDRE indicators."""

    iodp: int
    iodf: int
    first: int
    prc_m: tuple[float, ...]
    udrei: tuple[int, ...]


class Integrity(NamedTuple):
    """Type 6: UDRE indicators of places 1 to 51, valid with the fast corrections whose IODF is that of their block of 13."""

    iodf: tuple[int, ...]
    udrei: tuple[int, ...]


class FastDegradation(NamedTuple):
    """Type 7: system latency, s, and degradation factor indicators of places 1 to 51."""

    iodp: int
    t_lat_s: float
    indicator: tuple[int, ...]


class Degradation(NamedTuple):
    """Type 10, in m, m/s and s, with the names of table A-9; RSS: the terms of a sigma are added as squares."""

    B_rrc: float
    C_ltc_lsb: float
    C_ltc_v1: float
    I_ltc_v1: float
    C_ltc_v0: float
    I_ltc_v0: float
    C_geo_lsb: float
    C_geo_v: float
    I_geo: float
    C_er: float
    C_iono_step: float
    I_iono: float
    C_iono_ramp: float
    C_covariance: float
    RSS_UDRE: bool
    RSS_iono: bool


class NetworkTime(NamedTuple):
    """Type 12: SBAS network time minus UTC, a polynomial about the time `t0t_s` of the week `week_8bit`; leap seconds; GPS week, time."""

    a0_s: float
    a1_sps: float
    t0t_s: float
    week_8bit: int
    leap_s: float
    leap_week: int
    day: int
    future_leap_s: float
    utc_standard: int
    week: int
    tow_s: int
    glonass: bool


class GeoAlmanac(NamedTuple):
    """One satellite of type 17: position and velocity in ECEF at t0; health bits: 1 ranging, 2 precise and 4 basic corrections are off."""

    prn: int
    health: int
    t0_ns: int
    pos_ecef_m: tuple[float, float, float]
    vel_ecef_mps: tuple[float, float, float]


class Almanac(NamedTuple):
    """Type 17."""

    satellites: tuple[GeoAlmanac, ...]


class LongTerm(NamedTuple):
    """One satellite of types 24 and 25: corrections to be added to position and clock of the ephemeris with that issue.

    With velocity code 1 they move from `t0_ns` on; with 0 there are no rates, and `t0_ns` is when the message was sent.
    """

    iodp: int
    place: int
    iod: int
    velocity_code: int
    d_pos_ecef_m: tuple[float, float, float]
    d_vel_ecef_mps: tuple[float, float, float]
    daf0_s: float
    daf1: float
    t0_ns: int


class Mixed(NamedTuple):
    """Types 24 and 25: fast corrections, if any, and long-term ones."""

    fast: Fast | None
    long_term: tuple[LongTerm, ...]


class IonoMask(NamedTuple):
    """Type 18: numbers (from 1) of the grid points of a band that have delays; `bands` are broadcast with this IODI."""

    iodi: int
    bands: int
    band: int
    igps: tuple[int, ...]


class IonoDelays(NamedTuple):
    """Type 26: vertical delays on L1, m, None: do not use; of the grid points 15 block + 1, ... of the mask of the band."""

    iodi: int
    band: int
    block: int
    delay_m: tuple[float | None, ...]
    givei: tuple[int, ...]


class Area(NamedTuple):
    """A service region: triangle or rectangle of degrees."""

    lat1_deg: float
    lon1_deg: float
    lat2_deg: float
    lon2_deg: float
    square: bool


class Service(NamedTuple):
    """Type 27: delta UDRE indicators inside and outside of areas; `number` of `messages` with this IODS."""

    iods: int
    messages: int
    number: int
    priority: int
    inside: int
    outside: int
    areas: tuple[Area, ...]


class Covariance(NamedTuple):
    """One satellite of type 28: the upper triangle R, row by row (11, 12, 13, 14, 22, ...), scaled by `scale`; C = R' R."""

    iodp: int
    place: int
    scale: float
    R: tuple[float, ...]


class Covariances(NamedTuple):
    """Type 28."""

    satellites: tuple[Covariance, ...]


class DoNotUse(NamedTuple):
    """Type 0: not for safety applications; `empty` without data of type 2 in it."""

    empty: bool


Content = (
    PrnMask | Fast | Integrity | FastDegradation | Degradation | GeoEphemeris | NetworkTime | Almanac | IonoMask | IonoDelays
    | Mixed | Service | Covariances | DoNotUse | None
)  # fmt: skip
