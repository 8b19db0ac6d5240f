"""Broadcast sets that RTKLIB decodes from UBX bytes, as ours, and where two sets differ.

RTKLIB writes powers of two and pi with 14 to 16 digits, so that its values are within 3e-15 of ours; a field's last bit is more than 2e-10
of the largest value, so that a difference of one bit is far above the tolerance.
"""

import math
from collections.abc import Iterable
from dataclasses import fields
from types import ModuleType
from typing import Any, NamedTuple

from integrity.gnss.atmosphere import Klobuchar
from integrity.gnss.ephemeris.broadcast import Ephemeris, GlonassEphemeris, KeplerEphemeris
from integrity.gnss.ephemeris.kepler import GEOSTATIONARY
from integrity.gnss.gps_time import GPS_EPOCH_UNIX_S, NS_PER_S
from integrity.gnss.navigation.collector import ONE_OF_EACH, NavigationCollector
from integrity.gnss.navigation.glonass import ACCURACY_M
from integrity.gnss.navigation.inav import SISA_M
from integrity.gnss.navigation.lnav import URA_UPPER_M
from integrity.gnss.ubx.framing import Framer, frame_bytes
from integrity.gnss.ubx.rawx import RXM_RAWX, decode_rawx
from integrity.gnss.ubx.sfrbx import RXM_SFRBX, NavigationWords, decode_sfrbx

NEWEST_EPHEMERIS = 2  # what RTKLIB returns when it has one
TOLERANCE = 1e-14  # relative
HANDOVER_NS = 6 * NS_PER_S  # RTKLIB takes the time in the handover word of LNAV, which is when the next subframe begins
# RTKLIB decodes with a subframe 3 only, and when Galileo's words 0 and 6 have come as well: the time may be that of a later repetition.
REPETITIONS_NS = tuple(k * 30 * NS_PER_S for k in range(6))
FIRST_NUMBERS = {"G": 1, "R": 33, "E": 60, "J": 96, "C": 106}  # of RTKLIB's satellites, with how many there are of each
SATELLITES = {"G": 32, "R": 27, "E": 36, "J": 10, "C": 46}
UBX_SYSTEMS = {"G": 0, "E": 2, "C": 3, "J": 5, "R": 6}
UBX_SIGNALS = {"E1B": 1, "E7I": 5, "E5I": 3}  # the others are sent under 0

Key = tuple[str, int]  # satellite and toe: RTKLIB does not keep BeiDou's AODE
Sets = dict[Key, Ephemeris]


class Decoded(NamedTuple):
    """Every set, the first one of each reference time, and the ionosphere of GPS."""

    sets: Sets
    gps: Klobuchar


def keyed(told: Iterable[object]) -> Sets:
    sets: Sets = {}
    for eph in told:
        if isinstance(eph, KeplerEphemeris | GlonassEphemeris):
            sets.setdefault((eph.satellite, eph.toe_ns), eph)
    return sets


def from_rtklib(data: bytes, rtklib: ModuleType, near_ns: int | None = None) -> Decoded:
    """What RTKLIB finds in a UBX stream; `near_ns` where that has no measurements to tell it the time.

    Words that we pass over are left out: it takes BeiDou's CNAV for D1.
    """
    raw = rtklib.raw_t()
    assert rtklib.init_raw(raw, rtklib.STRFMT_UBX)
    if near_ns is not None:
        raw.time = rtklib.gtime_t()
        raw.time.time = near_ns // NS_PER_S + GPS_EPOCH_UNIX_S
    told: list[Ephemeris] = []
    for frame in Framer().feed(data):
        if frame[:2] == RXM_SFRBX and decode_sfrbx(frame.payload) is None:
            continue
        for byte in frame_bytes(*frame):
            if rtklib.input_ubx(raw, byte) == NEWEST_EPHEMERIS and raw.ephset == 0:
                told += newest(raw)
    ion = [raw.nav.ion_gps[k] for k in range(8)]
    rtklib.free_raw(raw)
    return Decoded(keyed(told), Klobuchar((ion[0], ion[1], ion[2], ion[3]), (ion[4], ion[5], ion[6], ion[7])))


def newest(raw: Any) -> list[Ephemeris]:
    """The set that has just come, if it is of one of our systems."""
    for system, first in FIRST_NUMBERS.items():
        number = raw.ephsat - first + 1
        if 1 <= number <= SATELLITES[system]:
            satellite = f"{system}{number:02d}"
            return [glonass(satellite, raw.nav.geph[number - 1]) if system == "R" else kepler(satellite, raw.nav.eph[raw.ephsat - 1])]
    return []


def kepler(satellite: str, e: Any, message: Any = None) -> KeplerEphemeris:
    """RTKLIB's record with the meaning that indices and flags have by the interface documents."""
    system = satellite[0]
    beidou = "D2" if satellite in GEOSTATIONARY else "D1"
    message = message or {"G": "LNAV", "J": "LNAV", "E": "INAV", "C": beidou}[system]
    accuracies = SISA_M if system == "E" else URA_UPPER_M
    first, second = {"INAV": (1, 0), "D1": (0, 1), "D2": (0, 1)}.get(message, (0, None))
    healthy = {"INAV": 0b111, "FNAV": 0b111_000}.get(message, 0b111_110 if system == "J" else 0b111_111)
    return KeplerEphemeris(
        satellite=satellite,
        message=message,
        issue=e.iode,
        healthy=e.svh & healthy == 0,
        accuracy_m=accuracies[e.sva] if e.sva < len(accuracies) else None,
        transmission_ns=gps_ns(e.ttr),
        toe_ns=gps_ns(e.toe),
        toc_ns=gps_ns(e.toc),
        fit_half_s={"E": 14_400.0, "C": 7200.0, "J": {2.0: 5400.0, 4.0: 7200.0}.get(e.fit, 0.0)}.get(system, e.fit * 1800.0),
        sqrt_a=math.sqrt(e.A),
        e=e.e,
        i0=e.i0,
        omega0=e.OMG0,
        omega=e.omg,
        m0=e.M0,
        delta_n=e.deln,
        i_dot=e.idot,
        omega_dot=e.OMGd,
        cuc=e.cuc,
        cus=e.cus,
        crc=e.crc,
        crs=e.crs,
        cic=e.cic,
        cis=e.cis,
        af0=e.f0,
        af1=e.f1,
        af2=e.f2,
        group_delay_s=e.tgd[first],
        group_delay_2_s=None if second is None else e.tgd[second],
    )


def glonass(satellite: str, g: Any) -> GlonassEphemeris:
    """The same of GLONASS."""
    x, v, a = ([three[k] for k in range(3)] for three in (g.pos, g.vel, g.acc))
    return GlonassEphemeris(
        satellite=satellite,
        channel=g.frq,
        issue=g.iode,
        healthy=g.svh & 0b1001 == 0,  # l_n and the highest bit of B_n
        accuracy_m=ACCURACY_M[g.sva] if g.sva < len(ACCURACY_M) else None,
        transmission_ns=gps_ns(g.tof),
        toe_ns=gps_ns(g.toe),
        fit_half_s=1200.0,
        x_m=x[0],
        y_m=x[1],
        z_m=x[2],
        vx_mps=v[0],
        vy_mps=v[1],
        vz_mps=v[2],
        ax_mps2=a[0],
        ay_mps2=a[1],
        az_mps2=a[2],
        tau_n_s=g.taun,
        gamma_n=g.gamn,
        delta_tau_n_s=g.dtaun,
    )


def gps_ns(t: Any) -> int:
    return int((t.time - GPS_EPOCH_UNIX_S) * NS_PER_S + round(t.sec * NS_PER_S))


def from_us(data: bytes, messages: Iterable[str] = ONE_OF_EACH) -> Sets:
    """Every set that we tell of a UBX stream, the first one of each reference time."""
    collector = NavigationCollector(messages=tuple(messages))
    near_ns: int | None = None
    told: list[object] = []
    for frame in Framer().feed(data):
        if frame[:2] == RXM_RAWX and (row := decode_rawx([frame.payload], "A")[0]):
            if near_ns is None:
                told += collector.complete(row.receive_time_ns)
            near_ns = row.receive_time_ns
        elif frame[:2] == RXM_SFRBX and (words := decode_sfrbx(frame.payload)):
            told += collector.take(words, near_ns)
    return keyed(told)


def differences(ours: Ephemeris, theirs: Ephemeris) -> list[str]:
    """Fields in which two sets differ by more than RTKLIB's constants do."""
    later_ns = theirs.transmission_ns - ours.transmission_ns - (HANDOVER_NS if ours.satellite[0] in "GJ" else 0)
    found = [] if later_ns in REPETITIONS_NS else [f"{ours.satellite} transmission_ns: theirs is {later_ns} later"]
    for name in (field.name for field in fields(ours) if field.name != "transmission_ns"):
        a, b = getattr(ours, name), getattr(theirs, name)
        near = isinstance(a, float) and isinstance(b, float) and abs(a - b) <= TOLERANCE * abs(b)
        if a != b and not near and not (name == "issue" and ours.satellite[0] == "C"):
            found.append(f"{ours.satellite} {name}: {a!r} instead of {b!r}")
    return found


def sfrbx(said: NavigationWords) -> bytes:
    """The frame that says these words."""
    system = said.satellite[0]
    freq_id = 0 if said.channel is None else said.channel + 7
    header = bytes(
        (UBX_SYSTEMS[system], int(said.satellite[1:]), UBX_SIGNALS.get(system + said.signal, 0), freq_id, len(said.words), 0, 2, 0)
    )
    return frame_bytes(*RXM_SFRBX, header + b"".join(word.to_bytes(4, "little") for word in said.words))
