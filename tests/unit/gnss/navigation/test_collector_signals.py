"""Which signals tell what: several that carry one message, and those that are passed over."""

from dataclasses import replace

import pytest

from integrity.gnss.ephemeris.broadcast import Ephemeris
from integrity.gnss.gps_time import NS_PER_S
from integrity.gnss.navigation import inav, lnav
from integrity.gnss.navigation.collector import NavigationCollector, Page
from integrity.gnss.ubx.sfrbx import NavigationWords
from recordings.simulate.constellation import IONOSPHERE
from recordings.simulate.navigation_words import lnav_words
from tests.sent_words import D2_ON_THE_AIR, D2_ON_THE_AIR_NS, START_NS, d2_on_the_air, examples, glonass_frame, page_numbers, words_of

SETS = examples()
SAME_MESSAGE = {"INAV": "7I", "D1": "6I", "D2": "7I", "GLONASS": "2C"}  # another signal that carries it


def told(collector: NavigationCollector, words: list[NavigationWords]) -> list[object]:
    return [news for said in words for news in collector.take(said, START_NS)]


def sent(eph: Ephemeris, signal: str | None = None) -> list[NavigationWords]:
    words = [words_of(eph, number) for number in page_numbers(eph)]
    return [said._replace(signal=signal or said.signal) for said in words]


@pytest.mark.parametrize(("name", "signal"), SAME_MESSAGE.items())
def test_another_signal_tells_the_same(name: str, signal: str) -> None:
    assert told(NavigationCollector(), sent(SETS[name], signal)) == [SETS[name]]


@pytest.mark.parametrize(("name", "signal"), SAME_MESSAGE.items())
def test_pages_may_come_by_either_signal(name: str, signal: str) -> None:
    pairs = zip(sent(SETS[name]), sent(SETS[name], signal), strict=True)
    assert told(NavigationCollector(), [pair[k % 2] for k, pair in enumerate(pairs)]) == [SETS[name]]


@pytest.mark.parametrize(
    ("name", "signal"), [("LNAV", "2L"), ("LNAV", "5I"), ("QZSS", "1Z"), ("INAV", "6B"), ("D1", "1D"), ("D2", "5D"), ("GLONASS", "3I")]
)
def test_other_signals_are_passed_over(name: str, signal: str) -> None:
    assert told(NavigationCollector(), sent(SETS[name], signal)) == []


def test_sbas_is_not_collected_here() -> None:
    collector = NavigationCollector()
    assert (collector.take(NavigationWords("S29", "1C", (0x53000000,) * 8), START_NS), collector.pages) == ([], ())


def test_f_nav_is_told_only_where_it_is_wanted() -> None:
    assert told(NavigationCollector(), sent(SETS["FNAV"])) == []


def test_f_nav_is_told_beside_i_nav() -> None:
    both = sent(SETS["INAV"]) + sent(SETS["FNAV"])
    assert told(NavigationCollector(messages=("INAV", "FNAV")), both) == [SETS["INAV"], SETS["FNAV"]]


def test_both_are_kept_beside_each_other() -> None:
    collector = NavigationCollector(messages=("INAV", "FNAV"))
    told(collector, sent(SETS["INAV"]) + sent(SETS["FNAV"]))
    assert [page.number for page in collector.pages] == [1, 2, 3, 4, 5, 101, 102, 103, 104]


def test_pages_of_what_is_not_wanted_any_more_are_dropped() -> None:
    collector = NavigationCollector(messages=("FNAV",))
    told(collector, sent(SETS["FNAV"])[:-1])
    assert NavigationCollector(collector.pages).pages == ()


def test_the_ionosphere_of_gps_needs_no_time() -> None:
    words = lnav_words(SETS["LNAV"], IONOSPHERE, 4, START_NS)  # type: ignore[arg-type]
    assert NavigationCollector().take(NavigationWords("G05", "1C", words), None) == [IONOSPHERE]


def test_that_of_qzss_is_not_told() -> None:
    words = lnav_words(SETS["LNAV"], IONOSPHERE, 4, START_NS)  # type: ignore[arg-type]
    assert NavigationCollector().take(NavigationWords("J02", "1C", words), START_NS) == []


def test_geostationary_satellites_send_d2_and_no_others_do() -> None:
    words = [d2_on_the_air(page)._replace(satellite="C06") for page in D2_ON_THE_AIR]
    collector = NavigationCollector()
    assert [news for said in words for news in collector.take(said, D2_ON_THE_AIR_NS)] == []


def test_strings_whose_frame_the_receiver_does_not_know_are_not_used() -> None:
    superframe = glonass_frame(SETS["GLONASS"].transmission_ns) & 0xFFFF_0000
    for frame in (0, superframe):
        words = [said._replace(words=(*said.words[:3], frame)) for said in sent(SETS["GLONASS"])]
        assert told(NavigationCollector(), words) == []


def test_frames_of_two_superframes_that_the_receiver_does_not_know_are_kept_apart() -> None:
    first, *others = (said._replace(words=(*said.words[:3], 2)) for said in sent(SETS["GLONASS"]))
    collector, next_superframe_ns = NavigationCollector(), START_NS + 150 * NS_PER_S
    assert collector.take(first, START_NS) + [news for said in others for news in collector.take(said, next_superframe_ns)] == []


def test_strings_on_two_channels_make_no_set() -> None:
    words = sent(SETS["GLONASS"])
    assert told(NavigationCollector(), [words[0]._replace(channel=2), *words[1:]]) == []


def test_receivers_that_hear_the_same_tell_the_same() -> None:
    streams = [sent(eph) for eph in SETS.values()]
    one, other = NavigationCollector(), NavigationCollector()
    heard = [(one.take(said, START_NS), other.take(said, START_NS)) for stream in streams for said in stream]
    assert [a for a, _ in heard] == [b for _, b in heard]


def test_health_of_e5b_is_not_that_of_e1b() -> None:
    unwell = replace(SETS["INAV"], healthy=False)
    assert told(NavigationCollector(), sent(unwell, "7I")) == [unwell]


def test_pages_of_gps_and_galileo_stand_in_a_snapshot_as_they_always_did() -> None:
    collector, arrived = NavigationCollector(), START_NS.to_bytes(8, "big")
    gps, galileo = sent(SETS["LNAV"])[1], sent(SETS["INAV"])[3]
    told(collector, [gps, galileo])
    subframe, word = lnav.subframe_of(gps.words), inav.word_of(galileo.words)
    assert subframe is not None and word is not None
    assert sorted(collector.pages, reverse=True) == [
        Page(gps.satellite, 2, subframe.to_bytes(30, "big") + arrived),
        Page(galileo.satellite, 4, word.to_bytes(16, "big") + arrived),
    ]
