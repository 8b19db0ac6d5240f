"""A wrong orbit in the words of every message that a receiver passes on, and in every RTCM message that tells orbits."""

import struct
from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from typing import Literal

import numpy as np
import pytest

from integrity.errors import ConfigError
from integrity.events import EphemerisReceived, Event, ObservationsReceived, RawBytes
from integrity.gnss.constants import SPEED_OF_LIGHT_MPS
from integrity.gnss.ephemeris.broadcast import Ephemeris, GeoEphemeris, GlonassEphemeris, KeplerEphemeris
from integrity.gnss.gps_time import NS_PER_S
from integrity.gnss.navigation import fnav
from integrity.gnss.navigation.kinds import kind_of
from integrity.gnss.observations import ObservationRow
from integrity.gnss.rtcm.framing import RtcmFramer, message_number
from integrity.gnss.rtcm.framing import frame_bytes as rtcm_frame
from integrity.gnss.rtcm.navigation import encode_ephemeris
from integrity.gnss.rtcm.navigation_tables import EPHEMERIS_NUMBERS
from integrity.gnss.ubx.framing import frame_bytes
from integrity.gnss.ubx.sfrbx import RXM_SFRBX, decode_sfrbx
from integrity.reception import Reception
from recordings.faults import Fault, inject
from recordings.faults.kinds import WrongEphemeris
from tests.sent_words import START_NS, examples, page_numbers, words_of
from tests.unit.faults import everywhere
from tests.unit.faults.raw import framed, stream_of
from tests.unit.faults.test_ephemerides import orbit_displacement_m
from tests.unit.many_signals import as_rawx
from tests.unit.streams import a_site

Axis = Literal["along", "cross", "radial"]
AXES: tuple[Axis, ...] = ("along", "cross", "radial")
SITE = a_site(30.0)
CYCLES, BEGIN_S, END_S = 8, 80.0, 170.0  # cycles of 30 s; the words of three of them are faulty


def _soon(eph: Ephemeris) -> Ephemeris:
    """The set of an hour later: one of QZSS serves for an hour and a half before and after."""
    toe_ns = START_NS + 3600 * NS_PER_S
    return replace(eph, toe_ns=toe_ns, toc_ns=toe_ns) if isinstance(eph, KeplerEphemeris) else eph


SETS = {name: _soon(eph) if name == "QZSS" else eph for name, eph in examples().items()}
UBX_CODE = {"LNAV": (0, 0), "QZSS": (5, 0), "INAV": (2, 1), "FNAV": (2, 3), "D1": (3, 0), "D2": (3, 1), "GLONASS": (6, 0)}
PAGE_S = {"LNAV": 6, "QZSS": 6, "INAV": 2, "FNAV": 10, "D1": 6, "D2": 3, "GLONASS": 2}
SIGNALS = tuple(f"{eph.satellite}.{'2I' if eph.satellite[0] == 'C' else '1C'}" for name, eph in SETS.items() if name != "FNAV")


def sfrbx(name: str, eph: Ephemeris, number: int) -> bytes:
    said = words_of(eph, number)
    channel = eph.channel + 7 if isinstance(eph, GlonassEphemeris) else 0
    header = bytes((UBX_CODE[name][0], int(eph.satellite[1:]), UBX_CODE[name][1], channel, len(said.words), 0, 2, 0))
    return frame_bytes(*RXM_SFRBX, header + struct.pack(f"<{len(said.words)}I", *said.words))


@cache
def stream() -> tuple[Event, ...]:
    """Rows every half minute, and every page of every message when it ends, at each receiver."""
    n = len(SIGNALS)
    no, many = np.zeros(n, dtype=np.bool_), np.full(n, 4e7)
    events: list[Event] = []
    for cycle in range(CYCLES):
        t_ns = START_NS + 30 * cycle * NS_PER_S
        for receiver in SITE.receiver_names:
            row = ObservationRow(receiver, t_ns, SIGNALS, many, many * 5.0, many * 0.0, many * 1e-6, many * 1e-6, no, no)
            events += as_rawx([ObservationsReceived(t_ns, row)])
            for name, eph in SETS.items():
                sent = replace(eph, transmission_ns=eph.transmission_ns + 30 * cycle * NS_PER_S)
                for number in page_numbers(eph):
                    order = 1 + (page_numbers(eph).index(number) if name == "INAV" else number - 1)
                    ends_ns = sent.transmission_ns + PAGE_S[name] * order * NS_PER_S
                    events.append(RawBytes(ends_ns, receiver, sfrbx(name, sent, number)))
    return tuple(sorted(events, key=lambda event: event.mono_ns))


@cache
def with_fault(satellite: str, offset_m: float, direction: Axis | Literal["clock"]) -> tuple[Event, ...]:
    effect = WrongEphemeris(satellite=satellite, offset_m=offset_m, direction=direction)
    return inject(stream(), [Fault(START_NS + round(BEGIN_S * NS_PER_S), START_NS + round(END_S * NS_PER_S), effect)], SITE)


def told(events: Sequence[Event], satellite: str, protocol: Literal["ubx", "rtcm3"] = "ubx") -> list[Ephemeris]:
    """What receiver A says of a satellite, in order."""
    reception = Reception("A", protocols={"A": protocol})
    heard = [h for event in events if not isinstance(event, RawBytes) or event.receiver == "A" for h in reception.take(event)]
    return [h.ephemeris for h in heard if isinstance(h, EphemerisReceived) and h.ephemeris.satellite == satellite]


def assert_displaced(true: Ephemeris, wrong: Ephemeris, offset_m: float, direction: Axis, gps_ns: int) -> None:
    """Within 3 %, state vectors 5 % 20 minutes from their time, and what the direction of flight of QZSS is inclined; units of messages."""
    assert type(wrong) is type(true)
    found = orbit_displacement_m(true, wrong, gps_ns)  # type: ignore[arg-type]
    expected = offset_m * np.array([direction == axis for axis in AXES])
    share = {"J": 0.08, "R": 0.05}.get(true.satellite[0], 0.03)
    assert np.abs(found - expected).max() < share * abs(offset_m) + 1.0


of_words = pytest.mark.parametrize("name", [name for name in SETS if name != "FNAV"])
of_axes = pytest.mark.parametrize("direction", AXES)


@of_words
@of_axes
def test_a_receiver_hears_the_true_orbit_the_displaced_one_and_the_true_one_again(name: str, direction: Axis) -> None:
    true, wrong, again = told(with_fault(SETS[name].satellite, 800.0, direction), SETS[name].satellite)
    assert true == told(stream(), SETS[name].satellite)[0]
    assert replace(again, transmission_ns=true.transmission_ns) == true
    assert_displaced(true, wrong, 800.0, direction, START_NS + 90 * NS_PER_S)


@of_words
def test_the_wrong_set_differs_in_its_orbit_and_issue_alone(name: str) -> None:
    true, wrong, _ = told(with_fault(SETS[name].satellite, 800.0, "cross"), SETS[name].satellite)
    names = [field for field in vars(true) if getattr(true, field) != getattr(wrong, field)]
    allowed = {"transmission_ns", "issue", "i0", "omega0", "omega", "x_m", "y_m", "z_m", "vx_mps", "vy_mps", "vz_mps"}
    assert set(names) <= allowed
    assert ("issue" in names) == isinstance(true, KeplerEphemeris)


@of_words
def test_words_of_others_stay(name: str) -> None:
    satellite = SETS[name].satellite
    (was, *_), (now, *_) = framed(stream(), "B"), framed(with_fault(satellite, 800.0, "along"), "B")
    changed = [decode_sfrbx(f.payload) for f, g in zip(now, was, strict=True) if f != g]
    assert {words.satellite for words in changed if words is not None} == {satellite}
    assert len(changed) >= 3  # of three cycles


@pytest.mark.parametrize("name", ["D1", "D2", "GLONASS"])
def test_a_frame_without_issue_is_wrong_as_a_whole(name: str) -> None:
    """Of those sent while the fault lasts every page that holds the orbit changes, of the others none."""
    satellite = SETS[name].satellite
    (was, *_), (now, *_) = framed(stream(), "A"), framed(with_fault(satellite, 800.0, "cross"), "A")
    pages = [i for i, f in enumerate(was) if (said := decode_sfrbx(f.payload)) is not None and said.satellite == satellite]
    of_cycle = [pages[k : k + len(page_numbers(SETS[name]))] for k in range(0, len(pages), len(page_numbers(SETS[name])))]
    wrong = [any(was[i] != now[i] for i in cycle) for cycle in of_cycle]
    assert wrong == [k in (3, 4, 5) for k in range(CYCLES)]
    counts = {sum(was[i] != now[i] for i in cycle) for cycle, is_wrong in zip(of_cycle, wrong, strict=True) if is_wrong}
    assert len(counts) == 1


def test_a_frame_of_glonass_that_is_passed_on_late_is_wrong_as_a_whole() -> None:
    """All strings 20 s after their frame began: between this one and the next, by when they came."""
    satellite = SETS["GLONASS"].satellite

    def late(event: Event) -> Event:
        said = decode_sfrbx(framed([event], event.receiver)[0][0].payload) if isinstance(event, RawBytes) else None
        if said is None or said.satellite != satellite:
            return event
        begun_ns = SETS["GLONASS"].transmission_ns
        cycle = (event.mono_ns - begun_ns) // (30 * NS_PER_S)
        return replace(event, mono_ns=begun_ns + (30 * cycle + 20) * NS_PER_S)

    events = sorted((late(event) for event in stream()), key=lambda event: event.mono_ns)
    effect = WrongEphemeris(satellite=satellite, offset_m=800.0, direction="along")
    after = inject(events, [Fault(START_NS + round(BEGIN_S * NS_PER_S), START_NS + round(END_S * NS_PER_S), effect)], SITE)
    was, now = framed(events, "A")[0], framed(after, "A")[0]
    strings = [i for i, f in enumerate(was) if (said := decode_sfrbx(f.payload)) is not None and said.satellite == satellite]
    changed = [sum(was[i] != now[i] for i in strings[k : k + 4]) for k in range(0, len(strings), 4)]
    assert set(changed) == {0, 3}  # string 4 has the clock


def test_pages_of_fnav_say_the_orbit_of_the_words_of_inav() -> None:
    satellite = SETS["INAV"].satellite
    events = with_fault(satellite, 800.0, "cross")
    _, wrong, _ = told(events, satellite)
    assert isinstance(wrong, KeplerEphemeris)
    pages: dict[int, int] = {}
    for event in events:
        if isinstance(event, RawBytes) and event.receiver == "A" and 90 <= (event.mono_ns - START_NS) / NS_PER_S < 130:
            said = decode_sfrbx(framed([event], "A")[0][0].payload)
            kind = None if said is None or said.signal != "5I" else kind_of(said.satellite, said.signal)
            data = None if kind is None or said is None else kind.data_of(said)
            if data is not None:
                pages[fnav.page_type(data)] = data
    found = fnav.ephemeris_of(satellite, pages[1], pages[2], pages[3], pages[4], START_NS)
    assert found is not None
    assert all(getattr(found, field) == getattr(wrong, field) for field in ("issue", "i0", "omega0", "omega", "m0", "sqrt_a", "delta_n"))


# RTCM


BEHIND = b"\xa5"  # what a later version of the format may have behind a message


def with_orbits() -> tuple[Event, ...]:
    """Ephemerides of all satellites at each receiver, F/NAV too, sent again in epochs 7 and 16."""
    sets = [eph for eph in everywhere.SETS.values() if not isinstance(eph, GeoEphemeris)]
    galileo = [eph for eph in sets if isinstance(eph, KeplerEphemeris) and eph.satellite[0] == "E"]
    told_too = [replace(eph, message="FNAV", group_delay_2_s=None) for eph in galileo]
    messages = b"".join(rtcm_frame(encode_ephemeris(eph) + BEHIND) for eph in [*sets, *told_too])
    sent = (0, 7, 16)
    return tuple(
        replace(e, data=messages + e.data) if isinstance(e, RawBytes) and (e.mono_ns - everywhere.FIRST_NS) // NS_PER_S in sent else e
        for e in everywhere.MSM
    )


RTCM = with_orbits()
SEEN = sorted({signal[:3] for signal in everywhere.WAS["A", 0].signals})
ONE_OF_EACH = [next(satellite for satellite in SEEN if satellite[0] == system) for system in "GECJR"]


def rtcm_fault(satellite: str, offset_m: float, direction: Axis | Literal["clock"]) -> tuple[Event, ...]:
    return everywhere.with_fault(RTCM, WrongEphemeris(satellite=satellite, offset_m=offset_m, direction=direction), everywhere.RTCM_SITE)


def ahead_m(true: Ephemeris, wrong: Ephemeris) -> float:
    """By how much the clock of a satellite is said to be ahead; the GLONASS term is what is added to its time."""
    assert not isinstance(true, GeoEphemeris) and not isinstance(wrong, GeoEphemeris)
    if isinstance(true, GlonassEphemeris) and isinstance(wrong, GlonassEphemeris):
        return SPEED_OF_LIGHT_MPS * (true.tau_n_s - wrong.tau_n_s)
    assert isinstance(true, KeplerEphemeris) and isinstance(wrong, KeplerEphemeris)
    return SPEED_OF_LIGHT_MPS * (wrong.af0 - true.af0)


CLOCK_UNIT_M = 0.3  # of GLONASS, the coarsest: 2^-30 s


@of_words
def test_a_receiver_hears_the_true_clock_the_wrong_one_and_the_true_one_again(name: str) -> None:
    satellite = SETS[name].satellite
    true, wrong, again = told(with_fault(satellite, 800.0, "clock"), satellite)
    assert [ahead_m(true, wrong), ahead_m(true, again)] == pytest.approx([800.0, 0.0], abs=CLOCK_UNIT_M)


@of_words
def test_a_clock_that_is_off_leaves_the_orbit(name: str) -> None:
    satellite = SETS[name].satellite
    true, wrong, _ = told(with_fault(satellite, 800.0, "clock"), satellite)
    assert orbit_displacement_m(true, wrong, START_NS + 90 * NS_PER_S) == pytest.approx(0.0, abs=1e-6)  # type: ignore[arg-type]


@pytest.mark.parametrize("satellite", ONE_OF_EACH)
def test_rtcm_tells_the_wrong_clock_while_the_fault_lasts(satellite: str) -> None:
    sets = told(rtcm_fault(satellite, -500.0, "clock"), satellite, "rtcm3")
    n = len(sets) // 3
    assert [ahead_m(true, wrong) for true, wrong in zip(sets[:n], sets[n : 2 * n], strict=True)] == pytest.approx(
        [-500.0] * n, abs=CLOCK_UNIT_M
    )


@pytest.mark.parametrize("satellite", ONE_OF_EACH)
@of_axes
def test_rtcm_tells_the_displaced_orbit_while_the_fault_lasts(satellite: str, direction: Axis) -> None:
    """Galileo's twice: F/NAV as well."""
    sets = told(rtcm_fault(satellite, -500.0, direction), satellite, "rtcm3")
    n = 2 if satellite[0] == "E" else 1
    assert len(sets) == 3 * n
    for true, wrong, again in zip(sets[:n], sets[n : 2 * n], sets[2 * n :], strict=True):
        assert replace(again, transmission_ns=true.transmission_ns) == true
        assert_displaced(true, wrong, -500.0, direction, everywhere.EVENT_NS)


@pytest.mark.parametrize("satellite", ONE_OF_EACH)
def test_rtcm_messages_of_other_satellites_and_measurements_keep_their_bytes(satellite: str) -> None:
    """In receiver C's: one message, of Galileo two, in the one epoch of the fault in which orbits are sent."""
    was, now = (RtcmFramer().feed(stream_of(events, "C")) for events in (RTCM, rtcm_fault(satellite, 500.0, "along")))
    changed = [(a, b) for a, b in zip(was, now, strict=True) if a != b]
    assert len(changed) == (2 if satellite[0] == "E" else 1)
    for a, b in changed:
        assert message_number(a) == message_number(b)
        assert message_number(a) in EPHEMERIS_NUMBERS
        assert (len(b), b[-1:]) == (len(a), BEHIND)


def test_an_orbit_that_no_message_has_room_for_is_refused() -> None:
    with pytest.raises(ConfigError, match=r"C\d\d cannot send the orbit: delta_n = .*make the offset smaller"):
        rtcm_fault(ONE_OF_EACH[2], 5_000.0, "radial")
