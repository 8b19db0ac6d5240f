"""Navigation messages against RTKLIB: what both make of the bytes of real receivers and of real satellites, and what RTKLIB makes of words
that we write. See `rtklib_sets` for how sets are compared."""

import gzip
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from types import ModuleType
from typing import Any, NamedTuple

import pytest

from integrity.gnss.ephemeris.broadcast import Ephemeris, GlonassEphemeris, KeplerEphemeris
from integrity.gnss.gps_time import NS_PER_S, gps_from_week
from integrity.gnss.navigation import beidou, fnav
from integrity.gnss.navigation.collector import NavigationCollector
from integrity.gnss.navigation.inav import SISA_M, WORD_5, word_of
from integrity.gnss.navigation.lnav import URA_UPPER_M
from integrity.gnss.ubx.framing import Framer
from integrity.gnss.ubx.sfrbx import RXM_SFRBX, NavigationWords, decode_sfrbx
from recordings.simulate.constellation import IONOSPHERE, constellation
from recordings.simulate.navigation_words import inav_words, lnav_words, page_words
from tests.crosscheck.rtklib_sets import NEWEST_EPHEMERIS, TOLERANCE, Decoded, Sets, differences, from_rtklib, from_us, kepler, keyed, sfrbx
from tests.sent_words import (
    D2_ON_THE_AIR,
    D2_ON_THE_AIR_NS,
    GLONASS_ON_THE_AIR,
    GLONASS_ON_THE_AIR_NS,
    d2_on_the_air,
    examples,
    glonass_on_the_air,
    page_numbers,
    words_of,
)


class Log(NamedTuple):
    """A recording, what it holds, and satellites that only we have: word 0 or 6 did not come, or RTKLIB has no such number."""

    path: str
    systems: set[str]
    only_ours: set[str]


LOGS = {
    "generation-10": Log("ubx_security_2025/16dBatt_no_interference_coldstart.ubx.gz", {"G", "E"}, set()),
    "generation-9": Log("drive_imu/walk_gnss_1730.ubx.gz", {"G", "E", "C"}, {"E08", "E14", "C50"}),
}
F_NAV_LOG = LOGS["generation-9"].path
SIMULATED_NS = gps_from_week(2300, 259_200.0)  # past, as RTKLIB resolves the week by the computer's clock


class Logged(NamedTuple):
    """What both make of a log."""

    log: Log
    rtklib: Decoded
    ours: Sets


@pytest.fixture(scope="module", params=LOGS.values(), ids=list(LOGS))
def logged(request: pytest.FixtureRequest, shared_data: Path, rtklib: ModuleType) -> Logged:
    log: Log = request.param
    data = gzip.decompress((shared_data / log.path).read_bytes())
    return Logged(log, from_rtklib(data, rtklib), from_us(data))


def test_both_find_the_same_satellites_and_reference_times(logged: Logged) -> None:
    plausible = {key for key, eph in logged.rtklib.sets.items() if eph.implausibility() is None}
    assert {key for key in logged.ours if key[0] not in logged.log.only_ours} == plausible


def test_a_log_has_its_systems(logged: Logged) -> None:
    assert {satellite[0] for satellite, _ in logged.ours} == logged.log.systems


def test_every_set_is_the_same_to_the_last_bit(logged: Logged) -> None:
    """But for the time of transmission of a satellite that sends word 5 up to three times in half a minute: any of them may count."""
    both = {key: (logged.ours[key], logged.rtklib.sets[key]) for key in logged.ours.keys() & logged.rtklib.sets.keys()}
    same_time = ((replace(a, transmission_ns=b.transmission_ns) if key[0] == "E18" else a, b) for key, (a, b) in both.items())
    assert [d for a, b in same_time for d in differences(a, b)] == []


def words_in(path: Path, satellites: str, signal: str) -> Iterator[NavigationWords]:
    for frame in Framer().feed(gzip.decompress(path.read_bytes())):
        said = decode_sfrbx(frame.payload) if frame[:2] == RXM_SFRBX else None
        if said is not None and said.satellite[0] == satellites and said.signal == signal:
            yield said


def fnav_pages(path: Path) -> dict[str, dict[int, int]]:
    """Pages 1 to 4 of the first issue of which a log has all, by satellite."""
    of_issue: dict[tuple[str, int], dict[int, int]] = {}
    for said in words_in(path, "E", "5I"):
        page = fnav.page_of(said.words)
        assert page is not None
        if (number := fnav.page_type(page)) in fnav.PAGES:
            of_issue.setdefault((said.satellite, fnav.issue_of(number, page)), {})[number] = page
    found: dict[str, dict[int, int]] = {}
    for (satellite, _), pages in of_issue.items():
        if len(pages) == len(fnav.PAGES):
            found.setdefault(satellite, pages)
    return found


def unsigned_chars(rtklib: ModuleType, data: bytes) -> Any:
    buffer = getattr(rtklib, "Arr1Dunsigned char")(len(data))
    for k, byte in enumerate(data):
        buffer[k] = byte
    return buffer


def fnav_by_rtklib(pages: dict[int, int], rtklib: ModuleType, satellite: str) -> KeplerEphemeris:
    data = b"".join((pages[number] << 34).to_bytes(31, "big") for number in (1, 2, 3, 4))
    eph = rtklib.eph_t()
    assert rtklib.decode_gal_fnav(unsigned_chars(rtklib, data + bytes(62)), eph, rtklib.Arr1Ddouble(4), rtklib.Arr1Ddouble(8))
    return kepler(satellite, eph, "FNAV")


def test_f_nav_of_a_log_is_the_same_to_the_last_bit(shared_data: Path, rtklib: ModuleType) -> None:
    ours = from_us(gzip.decompress((shared_data / F_NAV_LOG).read_bytes()), ("FNAV",))
    read = (fnav_by_rtklib(pages, rtklib, satellite) for satellite, pages in fnav_pages(shared_data / F_NAV_LOG).items())
    theirs = keyed(eph for eph in read if eph.implausibility() is None)
    assert {satellite for satellite, _ in theirs} == {satellite for satellite, _ in ours}
    assert [d for key in theirs for d in differences(replace(ours[key], transmission_ns=theirs[key].transmission_ns), theirs[key])] == []


def test_the_ionosphere_of_beidou_in_a_log(shared_data: Path, rtklib: ModuleType) -> None:
    words = {said.words for said in words_in(shared_data / LOGS["generation-9"].path, "C", "6I")}
    ones = [(w, s) for w in words if (s := beidou.subframe_of(w)) is not None and beidou.HEAD.integer(s, "subframe") == 1]
    for sent_words, subframe in ones:
        with_parity = sum(word << 30 * (9 - k) for k, word in enumerate(sent_words)) << 4
        ion = rtklib.Arr1Ddouble(8)
        data = unsigned_chars(rtklib, with_parity.to_bytes(38, "big") + bytes(152))
        rtklib.decode_bds_d1(data, None, ion, rtklib.Arr1Ddouble(8))  # without subframe 5 it finds no UTC, and says so
        ours = beidou.klobuchar_of(subframe, beidou.D1_IONOSPHERE_AT)
        assert ours.alpha + ours.beta == pytest.approx([ion[k] for k in range(8)], rel=TOLERANCE, abs=0.0)
    assert ones


def test_d2_from_the_air(rtklib: ModuleType) -> None:
    collector = NavigationCollector()
    ours = keyed(eph for page in D2_ON_THE_AIR for eph in collector.take(d2_on_the_air(page), D2_ON_THE_AIR_NS))
    theirs = from_rtklib(b"".join(sfrbx(d2_on_the_air(page)) for page in D2_ON_THE_AIR), rtklib).sets
    assert ours.keys() == theirs.keys() == {("C01", D2_ON_THE_AIR_NS)}
    assert [d for key in ours for d in differences(ours[key], theirs[key])] == []


def test_glonass_from_the_air(rtklib: ModuleType) -> None:
    collector = NavigationCollector()
    ours = keyed(eph for n in GLONASS_ON_THE_AIR for eph in collector.take(glonass_on_the_air(n), GLONASS_ON_THE_AIR_NS))
    theirs = from_rtklib(b"".join(sfrbx(glonass_on_the_air(n)) for n in GLONASS_ON_THE_AIR), rtklib, GLONASS_ON_THE_AIR_NS).sets
    assert ours.keys() == theirs.keys() == {("R01", GLONASS_ON_THE_AIR_NS + 300 * NS_PER_S)}
    assert [d for key in ours for d in differences(ours[key], theirs[key])] == []


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
        for number, at_ns in starts_ns.items():
            yield sfrbx(NavigationWords(eph.satellite, "1C", lnav_words(eph, IONOSPHERE, number, at_ns)))
    else:
        for number in (2, 4, 6, 1, 3, 5, 0):
            yield sfrbx(NavigationWords(eph.satellite, "1B", inav_words(eph, IONOSPHERE, number, eph.transmission_ns)))


@pytest.fixture(scope="module")
def simulated(rtklib: ModuleType) -> tuple[Sets, Decoded]:
    """One set of every satellite of a constellation, and what RTKLIB reads of it."""
    sets = [varied(k, eph) for k, eph in enumerate(constellation(11, SIMULATED_NS, SIMULATED_NS))]
    return keyed(sets), from_rtklib(b"".join(frame for eph in sets for frame in sent(eph)), rtklib)


def test_rtklib_hears_every_satellite_that_we_send(simulated: tuple[Sets, Decoded]) -> None:
    assert simulated[1].sets.keys() == simulated[0].keys()


def test_rtklib_reads_what_we_send_to_the_last_bit(simulated: tuple[Sets, Decoded]) -> None:
    assert [d for key, eph in simulated[0].items() for d in differences(eph, simulated[1].sets[key])] == []


def test_rtklib_reads_the_ionosphere_that_we_send(simulated: tuple[Sets, Decoded]) -> None:
    ionosphere = simulated[1].gps
    assert ionosphere.alpha + ionosphere.beta == pytest.approx(IONOSPHERE.alpha + IONOSPHERE.beta, rel=TOLERANCE, abs=0.0)


def other_sets() -> list[Ephemeris]:
    """Of QZSS, BeiDou and GLONASS: a sound one, and another that is not."""
    of = examples()
    sound = [of[name] for name in ("QZSS", "D1", "D2", "GLONASS")]
    others = [
        replace(eph, satellite=f"{eph.satellite[0]}{int(eph.satellite[1:]) + 2:02d}", healthy=False, accuracy_m=None) for eph in sound
    ]
    return sound + [
        replace(eph, channel=-7, tau_n_s=-eph.tau_n_s, x_m=-eph.x_m) if isinstance(eph, GlonassEphemeris) else eph for eph in others
    ]


@pytest.mark.parametrize("eph", other_sets(), ids=str)
def test_rtklib_reads_the_other_messages_that_we_write(rtklib: ModuleType, eph: Ephemeris) -> None:
    stream = b"".join(sfrbx(words_of(eph, number)) for number in page_numbers(eph))
    theirs = from_rtklib(stream, rtklib, eph.transmission_ns).sets
    assert [differences(eph, read) for read in theirs.values()] == [[]]


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
    pages = [*before, sfrbx(NavigationWords(eph.satellite, "1B", page_words(five | WORD_5.message({name: value})))), last]
    assert [rtklib.input_ubx(raw, byte) for byte in b"".join(pages)].count(NEWEST_EPHEMERIS) == 1
    health = raw.nav.eph[raw.ephsat - 1].svh
    rtklib.free_raw(raw)
    assert health == rtklib_health
