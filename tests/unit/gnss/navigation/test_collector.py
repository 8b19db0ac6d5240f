"""What is told of each satellite, and when: pages in any order, lost, mixed, late, and from before a restart."""

from dataclasses import replace
from itertools import permutations

import pytest

from integrity.errors import DecodeError
from integrity.gnss.atmosphere import Klobuchar
from integrity.gnss.ephemeris.broadcast import Ephemeris
from integrity.gnss.gps_time import NS_PER_S, WEEK_NS, gps_from_week
from integrity.gnss.navigation.collector import PAGES_TOGETHER_NS, NavigationCollector, Page
from integrity.gnss.ubx.sfrbx import NavigationWords
from recordings.simulate.constellation import IONOSPHERE, constellation
from recordings.simulate.navigation_words import inav_words, lnav_words

Arrival = tuple[NavigationWords, int | None]
Told = list[Ephemeris | Klobuchar]

START_NS = gps_from_week(2408, 259_200.0)
HOUR_NS = 3600 * NS_PER_S
SETS = constellation(5, START_NS, START_NS)
GPS = replace(next(eph for eph in SETS if eph.satellite[0] == "G"), transmission_ns=START_NS)
GALILEO = replace(next(eph for eph in SETS if eph.satellite[0] == "E"), transmission_ns=START_NS)
NUMBERS = {"G": (1, 2, 3), "E": (1, 2, 3, 4, 5)}
BOTH = pytest.mark.parametrize("eph", [GPS, GALILEO], ids=["GPS", "Galileo"])


def page(eph: Ephemeris, number: int, at_ns: int = START_NS, near_ns: int | None = START_NS) -> Arrival:
    """A page sent at one time, arriving at another."""
    if eph.satellite[0] == "G":
        return NavigationWords(eph.satellite, "1C", lnav_words(eph, IONOSPHERE, number, at_ns)), near_ns
    return NavigationWords(eph.satellite, "1B", inav_words(eph, IONOSPHERE, number, at_ns)), near_ns


def pages(eph: Ephemeris, at_ns: int = START_NS) -> list[Arrival]:
    """All pages of a set, sent and arriving at one time."""
    return [page(eph, number, at_ns, at_ns) for number in NUMBERS[eph.satellite[0]]]


def told(collector: NavigationCollector, arrivals: list[Arrival]) -> Told:
    return [news for words, near_ns in arrivals for news in collector.take(words, near_ns)]


def next_issue(eph: Ephemeris) -> Ephemeris:
    return replace(eph, issue=(eph.issue + 1) % 240, m0=-eph.m0, crs=-eph.crs)


@BOTH
def test_a_set_is_told_with_its_last_page_whatever_the_order(eph: Ephemeris) -> None:
    for order in permutations(pages(eph)):
        collector = NavigationCollector()
        assert [collector.take(*arrival) for arrival in order] == [[]] * (len(order) - 1) + [[eph]]


@BOTH
def test_the_same_set_is_told_once(eph: Ephemeris) -> None:
    later = [arrival for k in range(1, 40) for arrival in pages(eph, START_NS + k * 30 * NS_PER_S)]
    assert told(NavigationCollector(), pages(eph) + later) == [eph]


def test_all_satellites_at_once_are_kept_apart() -> None:
    sent = [replace(eph, transmission_ns=START_NS) for eph in SETS]
    arrivals = [page(eph, n) for n in NUMBERS["E"] for eph in sent if n in NUMBERS[eph.satellite[0]]]
    news = told(NavigationCollector(), arrivals)
    assert sorted(news, key=str) == sorted(sent, key=str)


@BOTH
@pytest.mark.parametrize(
    ("change", "number"),
    [({"healthy": False}, {"G": 1, "E": 5}), ({"accuracy_m": None}, {"G": 1, "E": 3}), ({"group_delay_s": 0.0}, {"G": 1, "E": 5})],
    ids=["health", "accuracy", "group-delay"],
)
def test_a_change_without_a_new_issue_is_told_at_once(eph: Ephemeris, change: dict[str, bool], number: dict[str, int]) -> None:
    changed = replace(eph, **change)  # type: ignore[arg-type]
    collector = NavigationCollector()
    told(collector, pages(eph))
    assert collector.take(*page(changed, number[eph.satellite[0]])) == [changed]


@BOTH
def test_pages_of_two_issues_never_make_a_set(eph: Ephemeris) -> None:
    new, numbers = next_issue(eph), NUMBERS[eph.satellite[0]]
    for cut in (1, 2, 3)[: len(numbers) - 1]:  # Galileo's word 5 belongs to any issue
        mixed = [page(eph, n) for n in numbers[:cut]] + [page(new, n) for n in numbers[cut:]]
        assert told(NavigationCollector(), mixed) == []


@BOTH
def test_a_new_issue_is_told_when_all_of_it_has_come(eph: Ephemeris) -> None:
    new, collector = next_issue(eph), NavigationCollector()
    told(collector, pages(eph))
    assert [collector.take(*arrival) for arrival in pages(new)] == [[]] * (len(NUMBERS[eph.satellite[0]]) - 1) + [[new]]


def test_a_new_issue_waits_for_a_new_word_5() -> None:
    new, collector = next_issue(GALILEO), NavigationCollector()
    told(collector, pages(GALILEO))
    assert told(collector, [page(new, n) for n in (1, 2, 3, 4)]) == []


@BOTH
@pytest.mark.parametrize(("late_ns", "complete"), [(0, True), (1, False)], ids=["at-the-limit", "beyond"])
def test_pages_too_far_apart_make_no_set(eph: Ephemeris, late_ns: int, complete: bool) -> None:
    *early, last = NUMBERS[eph.satellite[0]]
    late = page(eph, last, START_NS + PAGES_TOGETHER_NS, START_NS + PAGES_TOGETHER_NS + late_ns)
    assert bool(told(NavigationCollector(), [*(page(eph, n) for n in early), late])) == complete


@BOTH
@pytest.mark.parametrize("knows_the_time", [True, False], ids=["time-known", "time-still-old"])
def test_what_was_kept_a_week_ago_makes_no_set_with_what_comes_now(eph: Ephemeris, knows_the_time: bool) -> None:
    numbers, timed = NUMBERS[eph.satellite[0]], {"G": 1, "E": 5}[eph.satellite[0]]
    collector = NavigationCollector()
    told(collector, [page(eph, n) for n in numbers if n != timed])
    restarted = NavigationCollector(collector.pages, collector.told)
    now_ns = START_NS + WEEK_NS
    assert restarted.take(*page(eph, timed, now_ns, now_ns if knows_the_time else START_NS)) == []


@BOTH
def test_sets_that_came_before_the_time_was_known_are_told_with_it(eph: Ephemeris) -> None:
    collector = NavigationCollector()
    told(collector, [(words, None) for words, _ in pages(eph)])
    assert [collector.complete(START_NS), collector.complete(START_NS)] == [[eph], []]


@BOTH
def test_nothing_is_told_before_the_time_is_known(eph: Ephemeris) -> None:
    assert told(NavigationCollector(), [(words, None) for words, _ in pages(eph)]) == []


def test_the_ionosphere_needs_no_time() -> None:
    assert NavigationCollector().take(*page(GPS, 4, near_ns=None)) == [IONOSPHERE]


@pytest.mark.parametrize(("eph", "signal"), [(GPS, "2L"), (GALILEO, "7I")], ids=["L2C", "E5b"])
def test_other_signals_are_passed_over(eph: Ephemeris, signal: str) -> None:
    assert told(NavigationCollector(), [(words._replace(signal=signal), near_ns) for words, near_ns in pages(eph)]) == []


@BOTH
def test_damaged_words_change_nothing(eph: Ephemeris) -> None:
    collector = NavigationCollector()
    told(collector, pages(eph))
    before = collector.pages, collector.told
    told(collector, [(words._replace(words=(words.words[0] ^ 1 << 9, *words.words[1:])), near) for words, near in pages(next_issue(eph))])
    assert (collector.pages, collector.told) == before


@BOTH
def test_an_orbit_that_cannot_be_is_not_told(eph: Ephemeris) -> None:
    assert told(NavigationCollector(), pages(replace(eph, e=0.2))) == []


def eventful() -> list[Arrival]:
    """Two satellites: time not known at first, an issue that changes in the middle, health that changes, a gap."""
    arrivals: list[Arrival] = [(words, None) for words, _ in pages(GPS)[:2] + pages(GALILEO)[:3]]
    for k, (gps, galileo) in enumerate(
        [(GPS, GALILEO), (next_issue(GPS), GALILEO), (next_issue(GPS), next_issue(replace(GALILEO, healthy=False)))]
    ):
        at_ns = START_NS + k * 30 * NS_PER_S
        arrivals += [pair for both in zip(pages(gps, at_ns), pages(galileo, at_ns), strict=False) for pair in both] + pages(galileo, at_ns)[
            3:
        ]
    return arrivals + pages(replace(GPS, healthy=False), START_NS + HOUR_NS)


def test_a_restart_anywhere_changes_nothing() -> None:
    arrivals, whole = eventful(), NavigationCollector()
    expected = told(whole, arrivals)
    for cut in range(len(arrivals)):
        first = NavigationCollector()
        before = told(first, arrivals[:cut])
        second = NavigationCollector(first.pages, first.told)
        assert before + told(second, arrivals[cut:]) == expected
        assert (second.pages, second.told) == (whole.pages, whole.told)


def test_the_eventful_stream_tells_each_change() -> None:
    news = [(eph.satellite[0], eph.issue, eph.healthy) for eph in told(NavigationCollector(), eventful()) if isinstance(eph, Ephemeris)]
    g, e, new_g, new_e = GPS.issue, GALILEO.issue, next_issue(GPS).issue, next_issue(GALILEO).issue
    assert news == [("G", g, True), ("E", e, True), ("G", new_g, True), ("E", new_e, False), ("G", g, False)]


@pytest.mark.parametrize(
    ("satellite", "number", "data"),
    [
        ("R05", 1, bytes(30)),
        ("", 1, bytes(30)),
        ("G05", 4, bytes(30)),
        ("G05", 1, bytes(30)),  # its bits say that it is no subframe 1
        ("G05", 1, bytes(31)),
        ("E05", 6, bytes([6 << 2]) + bytes(15)),
        ("E05", 1, bytes([2 << 2]) + bytes(15)),
    ],
)
def test_a_damaged_snapshot_is_refused(satellite: str, number: int, data: bytes) -> None:
    with pytest.raises(DecodeError, match="snapshot is damaged"):
        NavigationCollector([Page(satellite, number, data)])
