"""Records of Kepler elements: GPS, QZSS, Galileo, BeiDou.

Sources: RINEX 3.04, tables A6 (GPS), A8 (Galileo), A12 (QZSS), A14 (BeiDou); Galileo OS SIS ICD, 5.1; IS-QZSS-PNT, 4.1.2.
"""

import math
from collections.abc import Sequence

from integrity.gnss.ephemeris.broadcast import MESSAGES, KeplerEphemeris, KeplerMessage
from integrity.gnss.ephemeris.kepler import GEOSTATIONARY
from integrity.gnss.gps_time import BDT_BEHIND_GPS_NS, NS_PER_S, WEEK_NS, WEEK_S
from integrity.gnss.navigation import beidou, inav, lnav
from integrity.gnss.navigation.bits import nearest_ns
from recordings.rinex.navigation_fields import transmission_ns, ura_m

GPS_LONGEST_FIT_H = 146.0  # IS-GPS-200, table 20-XII

GALILEO_INAV, GALILEO_FNAV = 0b101, 0b010  # data sources: I/NAV E1-B or E5b-I, F/NAV E5a-I. Table A8
GALILEO_E1_UNHEALTHY, GALILEO_E5A_UNHEALTHY = 0b111, 0b111_000  # data validity and signal health. Table A8
ANY_BIT = -1


def kepler_of(satellite: str, message: str | None, epoch_ns: int, values: Sequence[float]) -> KeplerEphemeris | str:
    """The ephemeris in the 31 numbers of a record, or why there is none; `message` is None where the file does not name it."""
    # In the order of the file: clock, then broadcast orbits 1 to 7.
    af0, af1, af2 = values[:3]
    issue, crs, delta_n, m0 = values[3:7]
    cuc, e, cus, sqrt_a = values[7:11]
    toe_s, cic, omega0, cis = values[11:15]
    i0, crc, omega, omega_dot = values[15:19]
    i_dot, sources, _week, _ = values[19:23]
    accuracy, health, delay_1_s, delay_2_s = values[23:27]  # TGD, IODC; BGD(E1,E5a), BGD(E1,E5b); TGD1, TGD2
    transmission_s, fit = values[27:29]

    system = satellite[0]
    if any(math.isnan(v) for v in (issue, toe_s, health, *([sources] if system == "E" and message is None else []))):
        return "field missing"
    if not (0.0 <= toe_s <= WEEK_S and 0.0 <= issue < 1024.0 and issue.is_integer() and 0.0 <= health < 512.0 and health.is_integer()):
        return "reference time, issue or health out of range"
    kind = _message(satellite, message, sources)
    if kind is None:
        return "kind of navigation message not clear"
    behind_ns = BDT_BEHIND_GPS_NS if system == "C" else 0
    toc_ns = epoch_ns + behind_ns
    # The week next to the epoch, which the week field repeats: some files have it modulo 1024, or that of the transmission.
    toe_ns = nearest_ns(round(toe_s * NS_PER_S) + behind_ns, toc_ns, WEEK_NS)
    if kind == "INAV":
        delay_1_s, delay_2_s = delay_2_s, delay_1_s
    return KeplerEphemeris(
        satellite=satellite,
        message=kind,
        issue=int(issue),
        healthy=not int(health) & _unhealthy(system, kind),
        accuracy_m=_sisa_m(accuracy) if system == "E" else ura_m(accuracy),
        transmission_ns=transmission_ns(system, transmission_s, toe_ns, behind_ns),
        toe_ns=toe_ns,
        toc_ns=toc_ns,
        fit_half_s=_fit_half_s(system, fit),
        sqrt_a=sqrt_a,
        e=e,
        i0=i0,
        omega0=omega0,
        omega=omega,
        m0=m0,
        delta_n=delta_n,
        i_dot=i_dot,
        omega_dot=omega_dot,
        cuc=cuc,
        cus=cus,
        crc=crc,
        crs=crs,
        cic=cic,
        cis=cis,
        af0=af0,
        af1=af1,
        af2=af2,
        group_delay_s=delay_1_s,
        group_delay_2_s=None if kind in ("LNAV", "FNAV") or math.isnan(delay_2_s) else delay_2_s,
    )


def _message(satellite: str, message: str | None, sources: float) -> KeplerMessage | None:
    """The kind of a set: as RINEX 4 names it, else of Galileo by the data sources; None where these say nothing or contradict."""
    system = satellite[0]
    if message is not None:
        return next((kind for kind in MESSAGES[system] if kind == message), None)
    if system == "C":
        return "D2" if satellite in GEOSTATIONARY else "D1"
    if system != "E":
        return "LNAV"
    bits = int(sources) if 0.0 <= sources < 1024.0 else 0
    if bool(bits & GALILEO_INAV) == bool(bits & GALILEO_FNAV):
        return None
    return "INAV" if bits & GALILEO_INAV else "FNAV"


def _unhealthy(system: str, message: KeplerMessage) -> int:
    """The bits of the health field that speak against a set."""
    if system == "E":
        return GALILEO_E1_UNHEALTHY if message == "INAV" else GALILEO_E5A_UNHEALTHY
    return ~lnav.QZSS_OTHER_SIGNAL if system == "J" else ANY_BIT


def _sisa_m(value_m: float) -> float | None:
    """SISA as it stands; None for "no accuracy prediction available" (negative) and for blank."""
    return value_m if value_m >= 0.0 else None


def _fit_half_s(system: str, fit: float) -> float:
    """Half of the fit interval. Of GPS the file has hours, or in old ones the flag (RINEX 3.05, 6.11), of QZSS the flag; or nothing."""
    match system:
        case "G" if fit == 1.0:
            return lnav.FIT_HALF_S[1]
        case "G":
            return fit * 1800.0 if 4.0 < fit <= GPS_LONGEST_FIT_H else lnav.FIT_HALF_S[0]
        case "J":
            return lnav.QZSS_FIT_HALF_S[fit == 1.0]
        case "E":
            return inav.FIT_HALF_S
        case _:
            return beidou.FIT_HALF_S
