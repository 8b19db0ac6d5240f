"""Records of state vectors: GLONASS and SBAS.

Sources: RINEX 2.11, tables A11 and A16; RINEX 3.04, tables A10, A16 and 8.3.3 (health of SBAS); RINEX 3.05, table A10 (the fifth line of
GLONASS); GLONASS ICD 5.1, 4.4 (signs, F_T).
"""

import math
from collections.abc import Sequence

from integrity.gnss.ephemeris.broadcast import GeoEphemeris, GlonassEphemeris
from integrity.gnss.gps_time import DAY_S, GLONASS_AHEAD_OF_UTC_NS, GPS_EPOCH_UNIX_S, NS_PER_S, WEEK_S, gps_from_utc
from integrity.gnss.navigation import glonass
from integrity.gnss.navigation.bits import nearest_ns
from recordings.rinex.navigation_fields import USUAL_LEAD_NS, transmission_ns, ura_m

SBAS_FIT_HALF_S = 360.0  # time-out of message type 9 outside precision approach: RTCA DO-229, table A-25

# Bits of the health flags: l(3) of string 3, A_C (the almanac's health is reported), C (it is healthy). RINEX 3.05, table A10.
GLONASS_L3_UNHEALTHY, GLONASS_ALMANAC, GLONASS_ALMANAC_UNHEALTHY = 0b100, 0b011, 0b010
SBAS_UNHEALTHY = 0b10001  # ranging is off, or nobody said that it is on: RINEX 3.04, 8.3.3

# RINEX before 3.05 leaves F_T out; index 15, which no satellite sends, is how some files since then write "unknown". Then it is taken for
# the most that satellites in service usually send.
USUAL_F_T_M = 7.0
CHANNEL_BYTE = 256  # some receivers write channels -7 to -1 as 249 to 255
FRAME_WITHIN_NS = 3600 * NS_PER_S  # of its reference time a GLONASS set is sent
UNKNOWN = 0.99e9  # 0.9999E9, or 0.999999999999E9
KM = 1000.0


def glonass_of(satellite: str, epoch_ns: int, values: Sequence[float]) -> GlonassEphemeris | str:
    """The ephemeris in the 15 or (since RINEX 3.05) 19 numbers of a record, or why there is none. The epoch is UTC."""
    minus_tau_n_s, gamma_n, frame_s = values[:3]
    (x, vx, ax, health), (y, vy, ay, channel), (z, vz, az, _age) = values[3:7], values[7:11], values[11:15]
    status, delta_tau_n_s, f_t, flags = values[15:19] if len(values) > 15 else [math.nan] * 4
    if math.isnan(health) or math.isnan(channel):
        return "field missing"
    if not (0.0 <= health < 8.0 and -7.0 <= channel < CHANNEL_BYTE and channel.is_integer()):
        return "health or channel out of range"
    if not (_bits_or_unknown(status, 9) and _bits_or_unknown(f_t, 4) and _bits_or_unknown(flags, 3)):
        return "status, accuracy or health flags out of range"
    unix_ns = epoch_ns + GPS_EPOCH_UNIX_S * NS_PER_S
    toe_ns = gps_from_utc(unix_ns)
    return GlonassEphemeris(
        satellite=satellite,
        channel=int(channel) - (CHANNEL_BYTE if channel >= CHANNEL_BYTE // 2 else 0),
        issue=(unix_ns + GLONASS_AHEAD_OF_UTC_NS) // NS_PER_S % DAY_S // glonass.QUARTER_S,
        healthy=health == 0.0 and not _flagged(flags),
        accuracy_m=_f_t_m(f_t),
        transmission_ns=toe_ns - _sent_ahead_ns(frame_s, epoch_ns),
        toe_ns=toe_ns,
        fit_half_s=glonass.FIT_HALF_S,
        x_m=x * KM,
        y_m=y * KM,
        z_m=z * KM,
        vx_mps=vx * KM,
        vy_mps=vy * KM,
        vz_mps=vz * KM,
        ax_mps2=ax * KM,
        ay_mps2=ay * KM,
        az_mps2=az * KM,
        tau_n_s=-minus_tau_n_s,
        gamma_n=gamma_n,
        delta_tau_n_s=delta_tau_n_s if delta_tau_n_s < UNKNOWN else None,
    )


def _sent_ahead_ns(frame_s: float, epoch_ns: int) -> int:
    """How long before its epoch a GLONASS set was sent: the frame time counts, as the epoch in UTC, from the beginning of the day (RINEX 2)
    or of the week; as usual where it is unknown or cannot be."""
    if -WEEK_S <= frame_s <= 2 * WEEK_S:
        ahead_ns = epoch_ns - nearest_ns(round(frame_s * NS_PER_S), epoch_ns, DAY_S * NS_PER_S)
        if abs(ahead_ns) <= FRAME_WITHIN_NS:
            return ahead_ns
    return USUAL_LEAD_NS["R"]


def _bits_or_unknown(value: float, bits: int) -> bool:
    """Whether a field of RINEX 3.05 holds that many bits; it may be blank or 0.9999E9."""
    return math.isnan(value) or value >= UNKNOWN or (0.0 <= value < 1 << bits and value.is_integer())


def _flagged(flags: float) -> bool:
    """Whether the health flags of RINEX 3.05 speak against a satellite."""
    bits = int(flags) if flags < UNKNOWN else 0
    return bool(bits & GLONASS_L3_UNHEALTHY) or bits & GLONASS_ALMANAC == GLONASS_ALMANAC_UNHEALTHY


def _f_t_m(index: float) -> float:
    return glonass.ACCURACY_M[int(index)] if index < len(glonass.ACCURACY_M) else USUAL_F_T_M


def geo_of(satellite: str, epoch_ns: int, values: Sequence[float]) -> GeoEphemeris | str:
    """The ephemeris in the 15 numbers of a record, or why there is none."""
    af0, af1, transmission_s = values[:3]
    (x, vx, ax, health), (y, vy, ay, accuracy), (z, vz, az, issue) = values[3:7], values[7:11], values[11:15]
    if math.isnan(health) or math.isnan(issue):
        return "field missing"
    if not (0.0 <= health < 64.0 and health.is_integer() and 0.0 <= issue < 256.0 and issue.is_integer()):
        return "issue or health out of range"
    return GeoEphemeris(
        satellite=satellite,
        issue=int(issue),
        healthy=not int(health) & SBAS_UNHEALTHY,
        accuracy_m=ura_m(accuracy),
        transmission_ns=transmission_ns("S", transmission_s, epoch_ns),
        toe_ns=epoch_ns,
        fit_half_s=SBAS_FIT_HALF_S,
        x_m=x * KM,
        y_m=y * KM,
        z_m=z * KM,
        vx_mps=vx * KM,
        vy_mps=vy * KM,
        vz_mps=vz * KM,
        ax_mps2=ax * KM,
        ay_mps2=ay * KM,
        az_mps2=az * KM,
        af0=af0,
        af1=af1,
    )
