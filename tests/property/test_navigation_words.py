"""Navigation words as they never should be, and in any order.

Whatever the words, nothing is raised and what is told is plausible; one or two wrong bits make a page worthless; order, repetition and
other receivers change nothing; what the tables write they read.
"""

from collections.abc import Callable
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from integrity.gnss.ephemeris.broadcast import Ephemeris
from integrity.gnss.navigation import beidou, fnav, glonass, inav, lnav
from integrity.gnss.navigation.bits import Layout
from integrity.gnss.navigation.collector import NavigationCollector
from integrity.gnss.navigation.kinds import kind_of
from integrity.gnss.ubx.sfrbx import NavigationWords
from recordings.simulate.navigation_words import page_words, subframe_words
from tests.sent_words import START_NS, beidou_words, examples, fnav_words, glonass_words, page_numbers, words_of

EVERY = ("LNAV", "INAV", "FNAV", "D1", "D2", "GLONASS")
SETS = examples()
EACH = pytest.mark.parametrize("name", list(SETS))
SENT = {name: [words_of(eph, number) for number in page_numbers(eph)] for name, eph in SETS.items()}
SIGNALS = [
    ("G05", "1C"),
    ("J02", "1C"),
    ("E11", "1B"),
    ("E11", "7I"),
    ("E11", "5I"),
    ("C06", "6I"),
    ("C01", "2I"),
    ("R07", "2C"),
    ("S29", "1C"),
]

# Bits of each word that parity, CRC or a fixed value protects; others fill up, are reserved, or end the convolutional code.
_30 = 0x3FFFFFFF
PROTECTED = {
    "LNAV": (_30,) * 10,
    "QZSS": (_30,) * 10,
    "INAV": (0xFFFFFFFF,) * 3 + (0xFFFFC000,) + (0xFFFFFFFF,) * 3 + (0xFFC00000,),
    "FNAV": (0xFFFFFFFF,) * 7 + (0xFFFC0000,),
    "D1": (0x3FF87FFF,) + (_30,) * 9,
    "D2": (0x3FF87FFF,) + (_30,) * 9,
    "GLONASS": (0xFFFFFFFF, 0xFFFFFFFF, 0xFFFFF800, 0),
}
LAYOUTS: dict[str, Layout] = {
    "LNAV 1": lnav.SUBFRAME_1,
    "LNAV 2": lnav.SUBFRAME_2,
    "LNAV 3": lnav.SUBFRAME_3,
    "word 4": inav.WORD_4,
    "word 5": inav.WORD_5,
    "NeQuick": inav.NEQUICK,
    **{f"F/NAV {number}": layout for number, layout in fnav.PAGES.items()},
    "D1": beidou.D1,
    "D2": beidou.D2,
    **{f"string {number}": layout for number, layout in glonass.STRINGS.items()},
}


def told(collector: NavigationCollector, words: list[NavigationWords]) -> list[Any]:
    return [news for said in words for news in collector.take(said, START_NS)]


def implausible(news: list[Any]) -> list[str]:
    return [why for eph in news if (why := eph.implausibility()) is not None]


def read(said: NavigationWords) -> int | None:
    kind = kind_of(said.satellite, said.signal)
    assert kind is not None
    return kind.data_of(said)


@settings(deadline=None)
@given(st.sampled_from(SIGNALS), st.lists(st.integers(0, 0xFFFFFFFF), max_size=12), st.integers(-7, 6) | st.none())
def test_words_of_chance_tell_nothing(signal: tuple[str, str], words: list[int], channel: int | None) -> None:
    assert NavigationCollector(messages=EVERY).take(NavigationWords(*signal, tuple(words), channel), START_NS) == []


@EACH
@settings(deadline=None)
@given(data=st.data())
def test_one_or_two_wrong_bits_make_a_page_worthless(name: str, data: st.DataObject) -> None:
    said = data.draw(st.sampled_from(SENT[name]))
    places = [(k, bit) for k, mask in enumerate(PROTECTED[name]) for bit in range(32) if mask >> bit & 1]
    words = list(said.words)
    for k, bit in data.draw(st.lists(st.sampled_from(places), min_size=1, max_size=2, unique=True)):
        words[k] ^= 1 << bit
    assert read(said._replace(words=tuple(words))) is None


@EACH
@settings(deadline=None)
@given(data=st.data())
def test_pages_with_many_wrong_bits_tell_nothing_implausible(name: str, data: st.DataObject) -> None:
    wrong = data.draw(st.lists(st.tuples(st.integers(0, 2), st.integers(0, 3), st.integers(0, 31)), max_size=40))
    words = [list(said.words) for said in SENT[name]]
    for page, k, bit in wrong:
        words[page][k] ^= 1 << bit
    pages = [said._replace(words=tuple(w)) for said, w in zip(SENT[name], words, strict=True)]
    assert implausible(told(NavigationCollector(messages=EVERY), pages)) == []


def other_contents(said: NavigationWords, name: str, bits: int) -> NavigationWords:
    """A page with right parity whose contents are other bits; kind, number, time and frame stay."""
    page = read(said)
    assert page is not None
    layout, kept, write = CONTENTS[name]
    keep, every_bit = layout.mask(*kept), (1 << layout.bits) - 1
    return said._replace(words=write(page & keep | bits & every_bit & ~keep, said))


def _glonass(page: int, said: NavigationWords) -> tuple[int, ...]:
    return glonass_words(page & (1 << 77) - 1, said.words[3])


# By message, what stays of a page, and how its words are written again.
CONTENTS: dict[str, tuple[Layout, tuple[str, ...], Callable[[int, NavigationWords], tuple[int, ...]]]] = {
    **dict.fromkeys(("LNAV", "QZSS"), (lnav.HEAD, ("preamble", "next_tow_count", "subframe"), lambda page, _: subframe_words(page))),
    "INAV": (inav.HEAD, ("word_type", "issue"), lambda page, _: page_words(page)),
    "FNAV": (fnav.PAGE_2, ("page_type", "issue"), lambda page, _: fnav_words(page)),
    "D1": (beidou.HEAD, ("preamble", "subframe", "sow"), lambda page, _: beidou_words(page)),
    "D2": (beidou.HEAD, ("preamble", "subframe", "sow", "page"), lambda page, _: beidou_words(page)),
    "GLONASS": (glonass.HEAD, ("channel", "frame", "idle", "string"), _glonass),
}


@EACH
@settings(deadline=None)
@given(data=st.data())
def test_contents_of_chance_with_right_parity_tell_nothing_implausible(name: str, data: st.DataObject) -> None:
    changed = data.draw(st.sets(st.sampled_from(range(len(SENT[name]))), min_size=1))
    pages = [
        other_contents(said, name, data.draw(st.integers(0, (1 << 240) - 1))) if k in changed else said for k, said in enumerate(SENT[name])
    ]
    assert implausible(told(NavigationCollector(messages=EVERY), pages)) == []


@settings(deadline=None)
@given(data=st.data())
def test_order_and_repetition_change_nothing(data: st.DataObject) -> None:
    once = [said for words in SENT.values() for said in words]
    again = data.draw(st.lists(st.sampled_from(once), max_size=20))
    arrivals = data.draw(st.permutations(once + again))
    assert sorted(told(NavigationCollector(messages=EVERY), arrivals), key=str) == sorted(SETS.values(), key=str)


@settings(deadline=None)
@given(st.lists(st.integers(0, 2), min_size=100, max_size=100))
def test_other_receivers_change_nothing(turns: list[int]) -> None:
    once = [said for words in SENT.values() for said in words]
    waiting = [iter(once) for _ in range(3)]
    collectors = [NavigationCollector(messages=EVERY) for _ in range(3)]
    news: list[list[Ephemeris]] = [[], [], []]
    for receiver in [*turns, *([0] * len(once)), *([1] * len(once)), *([2] * len(once))]:
        news[receiver] += told(collectors[receiver], [said for said in [next(waiting[receiver], None)] if said is not None])
    assert news == [list(SETS.values())] * 3


@pytest.mark.parametrize("layout", LAYOUTS.values(), ids=list(LAYOUTS))
@settings(deadline=None)
@given(data=st.data())
def test_what_a_table_writes_it_reads(layout: Layout, data: st.DataObject) -> None:
    numbers = {name: data.draw(st.integers(*field.range()), label=name) for name, field in layout.fields.items()}
    values = {name: number * (layout.fields[name].unit or 1) for name, number in numbers.items()}
    message = layout.message(values)
    assert {name: layout.integer(message, name) for name in numbers} == numbers
