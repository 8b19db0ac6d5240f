"""What is told of each satellite, and when, of every message: pages in any order, lost, mixed, late, and from before a restart."""

from collections.abc import Iterable
from dataclasses import replace
from itertools import permutations

import pytest

from integrity.errors import DecodeError
from integrity.gnss.atmosphere import Klobuchar
from integrity.gnss.ephemeris.broadcast import Ephemeris, GlonassEphemeris, KeplerEphemeris
from integrity.gnss.gps_time import NS_PER_S, WEEK_NS
from integrity.gnss.navigation.collector import NavigationCollector, Page
from integrity.gnss.navigation.kinds import kind_of
from integrity.gnss.ubx.sfrbx import NavigationWords
from recordings.simulate.constellation import constellation
from tests.sent_words import FRAME_NS, START_NS, examples, page_numbers, words_of

Arrival = tuple[NavigationWords, int | None]

HOUR_NS = 3600 * NS_PER_S
SETS = examples()
EVERY = ("LNAV", "INAV", "FNAV", "D1", "D2", "GLONASS")
OF_FRAMES = ("D1", "D2", "GLONASS")  # whose pages have no issue: those of a frame make a set
ALL = pytest.mark.parametrize("eph", SETS.values(), ids=list(SETS))


def collecting(pages: Iterable[Page] = (), told: Iterable[Ephemeris] = ()) -> NavigationCollector:
    return NavigationCollector(pages, told, EVERY)


def later(eph: Ephemeris, by_ns: int) -> Ephemeris:
    return replace(eph, transmission_ns=eph.transmission_ns + by_ns)


def page(eph: Ephemeris, number: int, near_ns: int | None = START_NS) -> Arrival:
    return words_of(eph, number), near_ns


def pages(eph: Ephemeris) -> list[Arrival]:
    """All pages of a set, arriving when its transmission begins."""
    return [page(eph, number, eph.transmission_ns) for number in page_numbers(eph)]


def told(collector: NavigationCollector, arrivals: Iterable[Arrival]) -> list[Ephemeris]:
    news = (said for words, near_ns in arrivals for said in collector.take(words, near_ns))
    return [said for said in news if not isinstance(said, Klobuchar)]


def next_issue(eph: Ephemeris) -> Ephemeris:
    """Sent from the next frame on."""
    transmission_ns = eph.transmission_ns + FRAME_NS
    if isinstance(eph, GlonassEphemeris):
        toe_ns = eph.toe_ns + 1800 * NS_PER_S
        return replace(
            eph, transmission_ns=transmission_ns, issue=eph.issue + 2, toe_ns=toe_ns, x_m=-eph.x_m, vx_mps=-eph.vx_mps, tau_n_s=-eph.tau_n_s
        )
    assert isinstance(eph, KeplerEphemeris)
    issue = eph.issue if eph.message in OF_FRAMES else (eph.issue + 1) % 240
    return replace(eph, transmission_ns=transmission_ns, issue=issue, m0=-eph.m0, crs=-eph.crs)


def timed_page(eph: Ephemeris) -> int:
    kind = kind_of(*page(eph, 1)[0][:2])
    assert kind is not None
    return kind.timed


def some_orders(arrivals: list[Arrival]) -> Iterable[tuple[Arrival, ...]]:
    """All, or of many pages those that begin anywhere, forwards and backwards."""
    if len(arrivals) <= 5:
        return permutations(arrivals)
    turned = [(*arrivals[k:], *arrivals[:k]) for k in range(len(arrivals))]
    return turned + [order[::-1] for order in turned]


@ALL
def test_a_set_is_told_with_its_last_page_whatever_the_order(eph: Ephemeris) -> None:
    for order in some_orders(pages(eph)):
        collector = collecting()
        assert [collector.take(*arrival) for arrival in order] == [[]] * (len(order) - 1) + [[eph]]


@ALL
def test_the_same_set_is_told_once(eph: Ephemeris) -> None:
    repeated = [arrival for k in range(1, 40) for arrival in pages(later(eph, k * FRAME_NS))]
    assert told(collecting(), pages(eph) + repeated) == [eph]


def test_all_satellites_at_once_are_kept_apart() -> None:
    simulated = [replace(eph, transmission_ns=START_NS) for eph in constellation(5, START_NS, START_NS)]
    sent: list[Ephemeris] = [*simulated, *(eph for name, eph in SETS.items() if name not in ("LNAV", "INAV"))]
    arrivals = [page(eph, n) for n in range(1, 11) for eph in sent if n in page_numbers(eph)]
    assert sorted(told(collecting(), arrivals), key=str) == sorted(sent, key=str)


@ALL
@pytest.mark.parametrize("change", [{"healthy": False}, {"accuracy_m": None}], ids=["health", "accuracy"])
def test_a_change_without_a_new_issue_is_told(eph: Ephemeris, change: dict[str, bool]) -> None:
    changed = replace(eph, **change)  # type: ignore[arg-type]
    news = told(collecting(), pages(eph) + pages(later(changed, FRAME_NS)))
    assert [replace(said, transmission_ns=eph.transmission_ns) for said in news] == [eph, changed]


@pytest.mark.parametrize(
    ("change", "number"),
    [
        ({"healthy": False}, {"LNAV": 1, "QZSS": 1, "INAV": 5, "FNAV": 1}),
        ({"accuracy_m": None}, {"LNAV": 1, "QZSS": 1, "INAV": 3, "FNAV": 1}),
        ({"group_delay_s": 0.0}, {"LNAV": 1, "QZSS": 1, "INAV": 5, "FNAV": 1}),
    ],
    ids=["health", "accuracy", "group-delay"],
)
@pytest.mark.parametrize("name", ["LNAV", "QZSS", "INAV", "FNAV"])
def test_it_is_told_with_the_page_that_says_it(name: str, change: dict[str, bool], number: dict[str, int]) -> None:
    changed = replace(SETS[name], **change)  # type: ignore[arg-type]
    collector = collecting()
    told(collector, pages(SETS[name]))
    assert collector.take(*page(changed, number[name])) == [changed]


@ALL
def test_pages_of_two_issues_or_frames_never_make_a_set(eph: Ephemeris) -> None:
    new, numbers = next_issue(eph), page_numbers(eph)
    fits_any = 5 if timed_page(eph) == 5 else 0  # word 5 of I/NAV
    for cut in range(1, len([n for n in numbers if n != fits_any])):
        mixed = [page(eph, n) for n in numbers[:cut]] + [page(new, n) for n in numbers[cut:]]
        assert told(collecting(), mixed) == []


@ALL
def test_a_page_of_another_issue_or_frame_drops_what_was_kept(eph: Ephemeris) -> None:
    collector, first = collecting(), page_numbers(eph)[0]
    told(collector, [*pages(eph), page(next_issue(eph), first)])
    assert [kept.number % 100 for kept in collector.pages] == [first]


@pytest.mark.parametrize("name", OF_FRAMES)
def test_nor_do_those_of_two_frames_that_say_the_same(name: str) -> None:
    eph, again = SETS[name], later(SETS[name], FRAME_NS)
    *but_one, last = page_numbers(eph)
    arrivals = [page(eph, n) for n in but_one] + [page(again, last)]
    assert told(collecting(), arrivals) == []


@ALL
def test_a_new_issue_is_told_when_all_of_it_has_come(eph: Ephemeris) -> None:
    new, collector = next_issue(eph), collecting()
    told(collector, pages(eph))
    assert [collector.take(*arrival) for arrival in pages(new)] == [[]] * (len(page_numbers(eph)) - 1) + [[new]]


def test_a_new_issue_waits_for_a_new_word_5() -> None:
    new, collector = next_issue(SETS["INAV"]), collecting()
    told(collector, pages(SETS["INAV"]))
    assert told(collector, [page(new, n) for n in (1, 2, 3, 4)]) == []


@ALL
@pytest.mark.parametrize(("late_ns", "complete"), [(0, True), (1, False)], ids=["at-the-limit", "beyond"])
def test_pages_too_far_apart_make_no_set(eph: Ephemeris, late_ns: int, complete: bool) -> None:
    kind = kind_of(*words_of(eph, 1)[:2])
    assert kind is not None
    *early, last = page_numbers(eph)
    sent = later(eph, kind.together_ns) if last == kind.timed else eph
    late = page(sent, last, START_NS + kind.together_ns + late_ns)
    assert bool(told(collecting(), [*(page(eph, n) for n in early), late])) == complete


def from_a_week_ago(eph: Ephemeris) -> tuple[NavigationCollector, Ephemeris]:
    """A collector restarted with all pages but the one with the time, and what is sent now."""
    collector = collecting()
    told(collector, [page(eph, n) for n in page_numbers(eph) if n != timed_page(eph)])
    return collecting(collector.pages, collector.told), later(eph, WEEK_NS)


@ALL
def test_what_was_kept_a_week_ago_makes_no_set_with_what_comes_now(eph: Ephemeris) -> None:
    restarted, now = from_a_week_ago(eph)
    assert restarted.take(*page(now, timed_page(eph), now.transmission_ns)) == []


# Not GLONASS: no string says the week, and the one that says the day is not the one that says the time.
@pytest.mark.parametrize("name", [name for name in SETS if name != "GLONASS"])
def test_nor_while_the_time_is_still_the_old_one(name: str) -> None:
    restarted, now = from_a_week_ago(SETS[name])
    assert restarted.take(*page(now, timed_page(now), START_NS)) == []


@ALL
def test_sets_that_came_before_the_time_was_known_are_told_with_it(eph: Ephemeris) -> None:
    collector = collecting()
    told(collector, [(words, None) for words, _ in pages(eph)])
    assert [collector.complete(START_NS), collector.complete(START_NS)] == [[eph], []]


@ALL
def test_nothing_is_told_before_the_time_is_known(eph: Ephemeris) -> None:
    assert told(collecting(), [(words, None) for words, _ in pages(eph)]) == []


@ALL
def test_damaged_words_change_nothing(eph: Ephemeris) -> None:
    collector = collecting()
    told(collector, pages(eph))
    before = collector.pages, collector.told
    told(collector, [(words._replace(words=(words.words[0] ^ 1 << 9, *words.words[1:])), near) for words, near in pages(next_issue(eph))])
    assert (collector.pages, collector.told) == before


@ALL
def test_an_orbit_that_cannot_be_is_not_told(eph: Ephemeris) -> None:
    impossible = {"x_m": 0.0} if isinstance(eph, GlonassEphemeris) else {"sqrt_a": 4000.0}
    assert told(collecting(), pages(replace(eph, **impossible))) == []  # type: ignore[arg-type]


def eventful(eph: Ephemeris) -> list[Arrival]:
    """Time not known at first, an issue that changes in the middle of a frame, health that changes, a gap."""
    new = next_issue(eph)
    arrivals: list[Arrival] = [(words, None) for words, _ in pages(eph)[:2]]
    arrivals += pages(eph) + pages(eph)[:1] + pages(new) + pages(replace(later(new, FRAME_NS), healthy=False))
    return arrivals + pages(replace(later(eph, HOUR_NS), healthy=False))


@ALL
def test_a_restart_anywhere_changes_nothing(eph: Ephemeris) -> None:
    arrivals, whole = eventful(eph) + eventful(SETS["LNAV"]), collecting()
    expected = told(whole, arrivals)
    for cut in range(len(arrivals)):
        first = collecting()
        before = told(first, arrivals[:cut])
        second = collecting(first.pages, first.told)
        assert before + told(second, arrivals[cut:]) == expected
        assert (second.pages, second.told) == (whole.pages, whole.told)


@ALL
def test_the_eventful_stream_tells_each_change(eph: Ephemeris) -> None:
    new = next_issue(eph)
    assert told(collecting(), eventful(eph)) == [
        eph,
        new,
        replace(later(new, FRAME_NS), healthy=False),
        replace(later(eph, HOUR_NS), healthy=False),
    ]


@pytest.mark.parametrize(
    ("satellite", "number", "data"),
    [
        ("R05", 1, bytes(15)),
        ("R05", 5, bytes(15)),
        ("R05", 1, bytes(30)),
        ("S29", 1, bytes(30)),
        ("C05", 2, bytes(28)),  # D2 has no page 2 that is kept
        ("C06", 4, bytes(28)),
        ("C06", 1, bytes(28)),
        ("E05", 101, bytes(27)),
        ("E05", 105, bytes(27)),
        ("G05", 101, bytes(30)),
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


@pytest.mark.parametrize("name", ["LNAV", "QZSS", "INAV", "FNAV"])
def test_a_page_with_a_wrong_time_does_not_hide_the_right_one(name: str) -> None:
    eph = SETS[name]
    wrong = page(later(eph, HOUR_NS), timed_page(eph), eph.transmission_ns)
    assert told(collecting(), [wrong, *[p for p in pages(eph) if p[0] != page(eph, timed_page(eph))[0]]]) == []
    arrivals = [wrong, *[page(eph, n, eph.transmission_ns) for n in page_numbers(eph) if n != timed_page(eph)], *pages(eph)]
    assert told(collecting(), arrivals) == [eph]
