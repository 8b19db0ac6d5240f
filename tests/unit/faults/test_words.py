"""A wrong orbit in the words of a satellite: what a receiver would have heard."""

from dataclasses import replace
from typing import Literal

import pytest

from integrity.errors import ConfigError
from integrity.events import EphemerisReceived, Event, IonosphereReceived, RawBytes
from integrity.gnss.ephemeris.broadcast import KeplerEphemeris
from integrity.gnss.gps_time import NS_PER_S
from integrity.gnss.navigation import inav, lnav
from integrity.gnss.ubx.framing import Framer, frame_bytes
from integrity.gnss.ubx.rawx import RXM_RAWX
from integrity.gnss.ubx.sfrbx import RXM_SFRBX, NavigationWords, decode_sfrbx
from integrity.reception import Reception
from recordings.faults import inject
from recordings.faults.kinds import ReceiverDrop, WrongEphemeris
from recordings.simulate.observations import antennas_of
from recordings.simulate.receiver import as_bytes
from tests.unit.faults.raw import BYTES, MEASURED, decided, fault, framed, recut, with_fault
from tests.unit.faults.test_ephemerides import orbit_displacement_m
from tests.unit.streams import SITE, START_NS

GPS, GALILEO = "G07", "E11"
ALONG = WrongEphemeris(satellite=GPS, offset_m=300.0, direction="along")


def wrong(satellite: str, offset_m: float = 300.0, direction: Literal["along", "cross", "radial"] = "along") -> WrongEphemeris:
    return WrongEphemeris(satellite=satellite, offset_m=offset_m, direction=direction)


def sets_of(events: tuple[Event, ...], satellite: str) -> list[tuple[float, KeplerEphemeris]]:
    """Sets of a satellite that a station is told, and when, in seconds of the stream; each once."""
    reception = Reception(SITE.receiver_names)
    heard = [
        h for event in events for h in reception.take(event) if isinstance(h, EphemerisReceived) and h.ephemeris.satellite == satellite
    ]
    first: dict[KeplerEphemeris, float] = {}
    for event in heard:
        assert isinstance(event.ephemeris, KeplerEphemeris)
        first.setdefault(event.ephemeris, (event.mono_ns - START_NS) / NS_PER_S)
    return [(at, eph) for eph, at in first.items()]


@pytest.mark.parametrize("satellite", [GPS, GALILEO])
@pytest.mark.parametrize("direction", ["along", "cross", "radial"])
def test_words_are_those_that_a_simulated_satellite_with_this_orbit_sends(
    satellite: str, direction: Literal["along", "cross", "radial"]
) -> None:
    """To the last bit: the encoder writes whole sets, the fault changes a few of their fields."""
    effect = wrong(satellite, 300.0, direction)
    assert with_fault(BYTES, effect) == as_bytes(with_fault(MEASURED, effect), antennas_of(SITE))


@pytest.mark.parametrize("satellite", [GPS, GALILEO])
def test_the_wrong_set_comes_with_the_words_of_the_fault_and_the_true_one_with_those_after_it(satellite: str) -> None:
    (_, true), (begins_s, false), (ends_s, again) = sets_of(with_fault(BYTES, wrong(satellite)), satellite)
    assert 40.0 < begins_s <= 75.0
    assert 80.0 < ends_s <= 115.0
    assert false.issue == (true.issue + (128 if satellite == GPS else 512)) % (256 if satellite == GPS else 1024)
    assert replace(again, transmission_ns=true.transmission_ns) == true


@pytest.mark.parametrize("satellite", [GPS, GALILEO])
def test_the_orbit_that_is_heard_is_displaced_as_told(satellite: str) -> None:
    """Units of the messages: 4 cm in m0, 4 cm after an hour in delta_n."""
    (_, true), (_, false), _ = sets_of(with_fault(BYTES, wrong(satellite, -250.0, "cross")), satellite)
    assert orbit_displacement_m(true, false, START_NS + 40 * NS_PER_S) == pytest.approx([0.0, -250.0, 0.0], abs=0.2)


def test_decisions_are_those_on_the_words_of_such_a_satellite() -> None:
    states = decided(with_fault(BYTES, ALONG))
    assert states == decided(as_bytes(with_fault(MEASURED, ALONG), antennas_of(SITE)))
    assert states != decided(BYTES)


def test_words_of_other_satellites_and_all_measurements_stay() -> None:
    for receiver in SITE.receiver_names:
        (was, *_), (now, *_) = framed(BYTES, receiver), framed(with_fault(BYTES, ALONG), receiver)
        changed = [decode_sfrbx(f.payload) for f, g in zip(now, was, strict=True) if f != g and f[:2] == RXM_SFRBX]
        assert [f for f in now if f[:2] == RXM_RAWX] == [f for f in was if f[:2] == RXM_RAWX]
        assert {words.satellite for words in changed if words} == {GPS}


def words_changed(by: int, words: NavigationWords, place: int) -> bytes:
    """The payload of RXM-SFRBX with bits of one word flipped."""
    header = bytes(
        (0 if words.satellite[0] == "G" else 2, int(words.satellite[1:]), 0 if words.signal == "1C" else 1, 0, len(words.words), 0, 2, 0)
    )
    return header + b"".join((w ^ (by if k == place else 0)).to_bytes(4, "little") for k, w in enumerate(words.words))


def test_damaged_words_stay_as_they_are() -> None:
    """With wrong parity a message says nothing, and nothing can be changed in it."""

    def damaged(event: Event) -> Event:
        if not isinstance(event, RawBytes):
            return event
        frames = []
        for frame in Framer().feed(event.data):
            words = decode_sfrbx(frame.payload) if frame[:2] == RXM_SFRBX else None
            hit = words is not None and words.satellite == GPS
            frames.append(frame_bytes(*frame[:2], words_changed(1 << 20, words, 3) if words is not None and hit else frame.payload))
        return replace(event, data=b"".join(frames))

    events = tuple(damaged(event) for event in BYTES)
    with_sets = (*(e for e in MEASURED if isinstance(e, EphemerisReceived | IonosphereReceived)), *events)
    after = inject(with_sets, [fault(ALONG)], SITE)
    assert [e for e in after if isinstance(e, RawBytes)] == [e for e in events if isinstance(e, RawBytes)]


@pytest.mark.parametrize("receiver", SITE.receiver_names)
def test_every_receiver_hears_it(receiver: str) -> None:
    alone = tuple(e for e in with_fault(BYTES, ALONG) if not isinstance(e, RawBytes) or e.receiver == receiver)
    assert [eph.issue for _, eph in sets_of(alone, GPS)] == [eph.issue for _, eph in sets_of(with_fault(BYTES, ALONG), GPS)]


def test_what_else_stands_in_a_page_stays() -> None:
    """OSNMA, search and rescue, reserved bits and tails of a real page are not zeros; so here."""
    other = {"osnma": 0xA5A5A5A5A5, "spare": 3, "ssp": 0x5A, "odd_tail": 21, "even_tail": 42}

    def filled(event: Event) -> Event:
        if not isinstance(event, RawBytes):
            return event
        frames = []
        for frame in Framer().feed(event.data):
            said = decode_sfrbx(frame.payload) if frame[:2] == RXM_SFRBX else None
            if said is None or said.satellite != GALILEO:
                frames.append(frame_bytes(*frame))
                continue
            page = sum(word << 32 * (7 - k) for k, word in enumerate(said.words)) | inav.PAGE.message(other)
            page = page & ~inav.PAGE.message({"crc": 0xFFFFFF}) | inav.PAGE.message({"crc": 0})
            page |= inav.PAGE.message({"crc": inav.page_crc(page)})
            words = NavigationWords(said.satellite, said.signal, tuple(page >> s & 0xFFFFFFFF for s in range(224, -1, -32)))
            frames.append(frame_bytes(*RXM_SFRBX, words_changed(0, words, 0)))
        return replace(event, data=b"".join(frames))

    events = tuple(filled(event) for event in BYTES)
    (was, *_), (now, *_) = framed(events, "A"), framed(with_fault(events, wrong(GALILEO)), "A")
    pairs = [(decode_sfrbx(f.payload), decode_sfrbx(g.payload)) for f, g in zip(was, now, strict=True) if f != g]
    assert len(pairs) >= 12
    for before, after in pairs:
        assert before is not None and after is not None and inav.word_of(after.words) is not None
        pages = [sum(word << 32 * (7 - k) for k, word in enumerate(said.words)) for said in (before, after)]
        assert [{name: inav.PAGE.integer(page, name) for name in other} for page in pages] == [other, other]


def test_subframes_keep_their_time_and_week() -> None:
    for f, g in zip(framed(BYTES, "A")[0], framed(with_fault(BYTES, ALONG), "A")[0], strict=True):
        if f != g:
            before, after = (decode_sfrbx(frame.payload) for frame in (f, g))
            assert before is not None and after is not None
            was, now = lnav.subframe_of(before.words), lnav.subframe_of(after.words)
            assert was is not None and now is not None
            assert [lnav.HEAD.integer(m, "next_tow_count") for m in (was, now)] == [lnav.HEAD.integer(was, "next_tow_count")] * 2


def test_how_bytes_are_cut_changes_nothing() -> None:
    assert decided(inject(recut(BYTES, 333), [fault(ALONG)], SITE)) == decided(recut(with_fault(BYTES, ALONG), 333))


def test_a_silent_receiver_sends_no_wrong_words_either() -> None:
    drop = fault(ReceiverDrop(receiver="B"))
    both = inject(BYTES, [fault(ALONG), drop], SITE)
    assert framed(both, "B") == framed(inject(with_fault(BYTES, ALONG), [drop], SITE), "B")


def test_where_ephemerides_come_as_such_the_wrong_one_does_too() -> None:
    """Bytes of B, measurements of A and C: the displaced ephemeris enters before the first faulty epoch, as without any bytes."""
    as_such = [e for e in MEASURED if isinstance(e, EphemerisReceived | IonosphereReceived)]
    rest = [e for e in MEASURED if not isinstance(e, EphemerisReceived | IonosphereReceived)]
    events = (*as_such, *(raw if isinstance(raw, RawBytes) and raw.receiver == "B" else e for e, raw in zip(rest, BYTES, strict=True)))
    begun = [e.mono_ns for e in with_fault(events, ALONG) if isinstance(e, EphemerisReceived) and e.mono_ns > START_NS]
    assert begun == [START_NS + 40 * NS_PER_S, START_NS + 80 * NS_PER_S]


def test_an_orbit_that_does_not_fit_the_message_is_refused() -> None:
    """delta_n has 16 bits, 1.2e-8 rad/s: enough for half a kilometre up, not for ten."""
    with pytest.raises(ConfigError, match=r"G07 cannot send the orbit: delta_n = .*make the offset smaller"):
        with_fault(BYTES, wrong(GPS, 10_000.0, "radial"))


def test_a_fault_between_two_pages_is_refused() -> None:
    with pytest.raises(ConfigError, match="changes nothing: no words with the orbit"):
        with_fault(BYTES, ALONG, 50.0, 52.0)
