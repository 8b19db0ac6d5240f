"""Navigation messages against RTKLIB: what both make of the bytes of real receivers, and what RTKLIB makes of words that we encode.

Sets are compared by satellite and issue. RTKLIB writes powers of two and pi with 14 to 16 digits, so that its values are within 3e-15 of
ours; a field's last bit is more than 2e-10 of the largest value, so that a difference of one bit is far above the tolerance.
"""

import gzip
import math
from collections.abc import Iterator
from dataclasses import fields, replace
from pathlib import Path
from types import ModuleType
from typing import Any, NamedTuple

import pytest

from integrity.gnss.atmosphere import Klobuchar
from integrity.gnss.ephemeris.broadcast import KeplerEphemeris
from integrity.gnss.gps_time import GPS_EPOCH_UNIX_S, NS_PER_S, gps_from_week
from integrity.gnss.navigation.collector import NavigationCollector
from integrity.gnss.navigation.inav import SISA_M, WORD_5, word_of
from integrity.gnss.navigation.lnav import URA_UPPER_M
from integrity.gnss.ubx.framing import Framer, frame_bytes
from integrity.gnss.ubx.rawx import RXM_RAWX, decode_rawx
from integrity.gnss.ubx.sfrbx import RXM_SFRBX, decode_sfrbx
from recordings.simulate.constellation import IONOSPHERE, constellation
from recordings.simulate.navigation_words import inav_words, lnav_words, page_words

GALILEO_OFFSET = {"G": 0, "E": 59}  # of RTKLIB's satellite numbers, with 27 satellites of GLONASS between
NEWEST_EPHEMERIS = 2  # what RTKLIB returns when it has one
TOLERANCE = 1e-14  # relative
HANDOVER_NS = 6 * NS_PER_S  # RTKLIB takes the time in the GPS handover word, which is when the next subframe begins
# RTKLIB decodes with a subframe 3 only, and when Galileo's words 0 and 6 have come as well: the time may be that of a later repetition.
REPETITIONS_NS = tuple(k * 30 * NS_PER_S for k in range(3))

# Log, and the sets that RTKLIB does not have because word 0 or 6 did not come.
LOGS: dict[str, tuple[str, set[tuple[str, int]]]] = {
    "generation-10": ("ubx_security_2025/16dBatt_no_interference_coldstart.ubx.gz", set()),
    "generation-9": ("drive_imu/walk_gnss_1730.ubx.gz", {("E08", 45)}),
}
SIMULATED_NS = gps_from_week(2300, 259_200.0)  # past, as RTKLIB resolves the week by the computer's clock

Sets = dict[tuple[str, int], KeplerEphemeris]


def from_rtklib(data: bytes, rtklib: ModuleType) -> tuple[Sets, Klobuchar]:
    """Every GPS and Galileo I/NAV set that RTKLIB finds in a UBX stream, and its ionosphere, both as ours."""
    raw = rtklib.raw_t()
    assert rtklib.init_raw(raw, rtklib.STRFMT_UBX)
    sets: Sets = {}
    for byte in data:
        if rtklib.input_ubx(raw, byte) == NEWEST_EPHEMERIS and raw.ephset == 0:
            system = "G" if raw.ephsat <= 32 else "E"
            number = raw.ephsat - GALILEO_OFFSET[system]
            if 1 <= number <= 36:
                eph = as_ours(f"{system}{number:02d}", raw.nav.eph[raw.ephsat - 1])
                sets.setdefault((eph.satellite, eph.issue), eph)
    ion = [raw.nav.ion_gps[k] for k in range(8)]
    rtklib.free_raw(raw)
    return sets, Klobuchar((ion[0], ion[1], ion[2], ion[3]), (ion[4], ion[5], ion[6], ion[7]))


def as_ours(satellite: str, e: Any) -> KeplerEphemeris:
    """RTKLIB's record with the meaning that indices and flags have by IS-GPS-200 and the Galileo OS SIS ICD."""
    galileo = satellite[0] == "E"
    accuracies = SISA_M if galileo else URA_UPPER_M
    return KeplerEphemeris(
        satellite=satellite,
        message="INAV" if galileo else "LNAV",
        issue=e.iode,
        healthy=e.svh & 0b111 == 0 if galileo else e.svh == 0,
        accuracy_m=accuracies[e.sva] if e.sva < len(accuracies) else None,
        transmission_ns=gps_ns(e.ttr),
        toe_ns=gps_ns(e.toe),
        toc_ns=gps_ns(e.toc),
        fit_half_s=14_400.0 if galileo else e.fit * 1800.0,
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
        group_delay_s=e.tgd[1] if galileo else e.tgd[0],
        group_delay_2_s=e.tgd[0] if galileo else None,
    )


def gps_ns(t: Any) -> int:
    return int((t.time - GPS_EPOCH_UNIX_S) * NS_PER_S + round(t.sec * NS_PER_S))


def from_us(data: bytes) -> Sets:
    """Every set that we tell of a UBX stream, the first one of each issue."""
    collector = NavigationCollector()
    near_ns: int | None = None
    told: list[KeplerEphemeris | Klobuchar] = []
    for frame in Framer().feed(data):
        if frame[:2] == RXM_RAWX and (row := decode_rawx([frame.payload], "A")[0]):
            if near_ns is None:
                told += collector.complete(row.receive_time_ns)
            near_ns = row.receive_time_ns
        elif frame[:2] == RXM_SFRBX and (words := decode_sfrbx(frame.payload)):
            told += collector.take(words, near_ns)
    sets: Sets = {}
    for eph in told:
        if isinstance(eph, KeplerEphemeris):
            sets.setdefault((eph.satellite, eph.issue), eph)
    return sets


def differences(ours: KeplerEphemeris, theirs: KeplerEphemeris) -> list[str]:
    """Fields in which two sets differ by more than RTKLIB's constants do."""
    later_ns = theirs.transmission_ns - ours.transmission_ns - (HANDOVER_NS if ours.satellite[0] == "G" else 0)
    found = [] if later_ns in REPETITIONS_NS else [f"{ours.satellite} transmission_ns: theirs is {later_ns} later"]
    for name in (field.name for field in fields(KeplerEphemeris) if field.name != "transmission_ns"):
        a, b = getattr(ours, name), getattr(theirs, name)
        if a != b and not (isinstance(a, float) and isinstance(b, float) and abs(a - b) <= TOLERANCE * abs(b)):
            found.append(f"{ours.satellite} {name}: {a!r} instead of {b!r}")
    return found


class Logged(NamedTuple):
    """What both make of a log, and the sets that only we can have."""

    rtklib: Sets
    ours: Sets
    only_ours: set[tuple[str, int]]


@pytest.fixture(scope="module", params=LOGS.values(), ids=list(LOGS))
def logged(request: pytest.FixtureRequest, shared_data: Path, rtklib: ModuleType) -> Logged:
    path, only_ours = request.param
    data = gzip.decompress((shared_data / path).read_bytes())
    return Logged(from_rtklib(data, rtklib)[0], from_us(data), only_ours)


def test_both_find_the_same_satellites_and_issues(logged: Logged) -> None:
    plausible = {key for key, eph in logged.rtklib.items() if eph.implausibility() is None}  # not E14 and E18: far from circular
    assert logged.ours.keys() == plausible | logged.only_ours


def test_a_log_has_both_systems(logged: Logged) -> None:
    assert {satellite[0] for satellite, _ in logged.ours} == {"G", "E"}


def test_every_set_is_the_same_to_the_last_bit(logged: Logged) -> None:
    assert [d for key in logged.ours.keys() & logged.rtklib.keys() for d in differences(logged.ours[key], logged.rtklib[key])] == []


def simulated_bytes() -> tuple[Sets, bytes]:
    """One set of every satellite of a constellation, and the UBX stream that sends it."""
    sets = [varied(k, eph) for k, eph in enumerate(constellation(11, SIMULATED_NS, SIMULATED_NS))]
    return {(eph.satellite, eph.issue): eph for eph in sets}, b"".join(frame for eph in sets for frame in sent(eph))


def varied(k: int, eph: KeplerEphemeris) -> KeplerEphemeris:
    """With values that a simulated satellite has no use for, so that every field of the messages is seen to be in its place."""
    galileo = eph.satellite[0] == "E"
    return replace(
        eph,
        healthy=k % 3 > 0,
        accuracy_m=None if k % 5 == 0 else (SISA_M if galileo else URA_UPPER_M)[k % 15],
        fit_half_s=eph.fit_half_s if galileo or k % 2 else 10_800.0,
        toc_ns=eph.toc_ns + 3600 * NS_PER_S,
        af2=-3 * 2.0 ** (-59 if galileo else -55),
    )


def sent(eph: KeplerEphemeris) -> Iterator[bytes]:
    """What RTKLIB wants for a set: GPS subframes 1 to 5, Galileo words 0 to 6."""
    if eph.satellite[0] == "G":
        starts_ns = {number: eph.transmission_ns + 6 * NS_PER_S * k for k, number in enumerate((1, 2, 3, 4, 5))}
        yield from (sfrbx(eph, lnav_words(eph, IONOSPHERE, number, at_ns)) for number, at_ns in starts_ns.items())
    else:
        yield from (sfrbx(eph, inav_words(eph, IONOSPHERE, number, eph.transmission_ns)) for number in (2, 4, 6, 1, 3, 5, 0))


def sfrbx(eph: KeplerEphemeris, words: tuple[int, ...]) -> bytes:
    system, signal = (0, 0) if eph.satellite[0] == "G" else (2, 1)
    header = bytes((system, int(eph.satellite[1:]), signal, 0, len(words), 0, 2, 0))
    return frame_bytes(*RXM_SFRBX, header + b"".join(word.to_bytes(4, "little") for word in words))


def test_rtklib_hears_every_satellite_that_we_send(rtklib: ModuleType) -> None:
    sets, stream = simulated_bytes()
    assert from_rtklib(stream, rtklib)[0].keys() == sets.keys()


def test_rtklib_reads_what_we_send_to_the_last_bit(rtklib: ModuleType) -> None:
    sets, stream = simulated_bytes()
    read, _ = from_rtklib(stream, rtklib)
    assert [d for key in sets for d in differences(sets[key], read[key])] == []


@pytest.mark.parametrize(
    ("name", "value", "rtklib_health"),
    [("e1b_unsure", 1, 1), ("e1b_health", 2, 2 << 1), ("e5b_unsure", 1, 1 << 6), ("e5b_health", 2, 2 << 7)],
)
def test_health_of_each_signal_stands_where_rtklib_reads_it(rtklib: ModuleType, name: str, value: int, rtklib_health: int) -> None:
    eph = next(eph for eph in constellation(11, SIMULATED_NS, SIMULATED_NS) if eph.satellite[0] == "E")
    five = word_of(inav_words(eph, IONOSPHERE, 5, eph.transmission_ns))
    assert five is not None
    raw = rtklib.raw_t()
    assert rtklib.init_raw(raw, rtklib.STRFMT_UBX)
    *before, _, last = sent(eph)
    pages = [*before, sfrbx(eph, page_words(five | WORD_5.message({name: value}))), last]
    assert [rtklib.input_ubx(raw, byte) for byte in b"".join(pages)].count(NEWEST_EPHEMERIS) == 1
    health = raw.nav.eph[raw.ephsat - 1].svh
    rtklib.free_raw(raw)
    assert health == rtklib_health


def test_rtklib_reads_the_ionosphere_that_we_send(rtklib: ModuleType) -> None:
    ionosphere = from_rtklib(simulated_bytes()[1], rtklib)[1]
    assert ionosphere.alpha + ionosphere.beta == pytest.approx(IONOSPHERE.alpha + IONOSPHERE.beta, rel=TOLERANCE, abs=0.0)
