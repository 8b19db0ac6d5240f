"""Navigation words: every message that sets are made of, as payloads of RXM-SFRBX, with parity and CRC redone over damaged contents."""

import struct
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import cache
from random import Random
from typing import NamedTuple

from integrity.gnss.atmosphere import Klobuchar
from integrity.gnss.ephemeris.broadcast import Ephemeris, KeplerEphemeris
from integrity.gnss.gps_time import NS_PER_S, WEEK_NS, WEEK_S
from integrity.gnss.navigation import beidou, fnav, glonass, inav, lnav
from integrity.gnss.navigation.bits import Layout
from integrity.gnss.navigation.collector import ARRIVES_WITHIN_NS, NavigationCollector, Page
from integrity.gnss.navigation.kinds import kind_kept, kind_of
from integrity.gnss.ubx.sfrbx import NavigationWords, decode_sfrbx
from recordings.simulate.constellation import IONOSPHERE
from recordings.simulate.navigation_words import inav_words, lnav_words, page_words, subframe_words
from tests.fuzz import bounds
from tests.fuzz.mutations import bits_flipped, damaged, random_message, with_extremes
from tests.fuzz.target import Piece, Target
from tests.sent_words import START_NS, beidou_words, examples, fnav_words, glonass_words, page_numbers, words_of

EVERY = ("LNAV", "INAV", "FNAV", "D1", "D2", "GLONASS")
GNSS_ID = {"G": 0, "S": 1, "E": 2, "C": 3, "J": 5, "R": 6}
SIGNAL_ID = {"G1C": 0, "J1C": 0, "S1C": 0, "E1B": 1, "E7I": 5, "E5I": 3, "C2I": 0, "C7I": 2, "C6I": 4, "R1C": 0, "R2C": 2}
ROUNDS = 4  # of all pages, in a batch
GLONASS_BITS = 77


class Writing(NamedTuple):
    """How a page of a message is written again: its fields by number, those that must stay for it to be a page, and its words."""

    fields: Mapping[int, Layout]
    kept: tuple[str, ...]
    words: Callable[[int, NavigationWords], tuple[int, ...]]


def _pages(numbers: Sequence[int], layout: Layout) -> dict[int, Layout]:
    """Of a set whose pages stand one behind the other, the fields of each that stand in one piece."""
    found = {}
    for k, number in enumerate(numbers):
        first = k * beidou.SUBFRAME_BITS
        here = {name: f for name, f in layout.fields.items() if all(first <= p.first < first + beidou.SUBFRAME_BITS for p in f.parts)}
        moved = {name: f._replace(parts=tuple(p._replace(first=p.first - first) for p in f.parts)) for name, f in here.items()}
        found[number] = Layout(beidou.SUBFRAME_BITS, {**beidou.HEAD.fields, **moved})
    return found


_BEIDOU = ("preamble", "subframe", "page")
WRITING = {
    "LNAV": Writing(
        {1: lnav.SUBFRAME_1, 2: lnav.SUBFRAME_2, 3: lnav.SUBFRAME_3, 4: lnav.IONOSPHERE},
        ("preamble", "subframe"),
        lambda page, _: subframe_words(page),
    ),
    "INAV": Writing(
        {0: inav.WORD_0, 1: inav.WORD_1, 2: inav.WORD_2, 3: inav.WORD_3, 4: inav.WORD_4, 5: inav.WORD_5, 6: inav.WORD_6},
        ("word_type",),
        lambda page, _: page_words(page),
    ),
    "FNAV": Writing(fnav.PAGES, ("page_type",), lambda page, _: fnav_words(page)),
    "D1": Writing(_pages(beidou.D1_SUBFRAMES, beidou.D1), _BEIDOU[:2], lambda page, _: beidou_words(page)),
    "D2": Writing(_pages(beidou.D2_PAGES, beidou.D2), _BEIDOU, lambda page, _: beidou_words(page)),
    "GLONASS": Writing(
        glonass.STRINGS,
        ("channel", "frame", "idle", "string"),
        lambda page, said: glonass_words(page & (1 << GLONASS_BITS) - 1, said.words[3]),
    ),
}
# Times that a field has room for and that are none: by page, field, and how many seconds its unit has.
TIMES_S = {
    "LNAV": {1: {"toc_16s": 16}, 2: {"toe_16s": 16}},
    "INAV": {1: {"toe_60s": 60}, 4: {"toc_60s": 60}, 5: {"tow_s": 1}},
    "FNAV": {1: {"toc_60s": 60, "tow_s": 1}, 3: {"toe_60s": 60}},
    "D1": {1: {"toc_8s": 8}},  # toe stands in two subframes
    "D2": {1: {"toc_8s": 8}, 7: {"toe_8s": 8}},
    "GLONASS": {},
}


def payload_of(words: NavigationWords) -> bytes:
    """RXM-SFRBX, version 2."""
    system, channel = words.satellite[0], 0 if words.channel is None else words.channel + 7
    head = (GNSS_ID[system], int(words.satellite[1:]) + (100 if system == "S" else 0), SIGNAL_ID[system + words.signal], channel)
    return bytes((*head, len(words.words), 0, 2, 0)) + struct.pack(f"<{len(words.words)}I", *words.words)


@cache
def sets() -> tuple[Ephemeris, ...]:
    """Of each message that of two satellites."""
    found: list[Ephemeris] = []
    for eph in examples().values():
        other = f"{eph.satellite[0]}{int(eph.satellite[1:]) % 30 + 1:02d}"
        found += [eph, replace(eph, satellite=other)]
    return tuple(found)


@cache
def pages_of(eph: Ephemeris) -> list[bytes]:
    return [payload_of(words_of(eph, number)) for number in page_numbers(eph)]


@cache
def payloads() -> list[bytes]:
    """Every page of every set, and pages that are of none."""
    found = [payload for eph in sets() for payload in pages_of(eph)]
    for eph in sets():
        if isinstance(eph, KeplerEphemeris) and eph.message == "LNAV" and eph.satellite[0] == "G":
            found += [payload_of(NavigationWords(eph.satellite, "1C", lnav_words(eph, IONOSPHERE, n, START_NS))) for n in (4, 5)]
        if isinstance(eph, KeplerEphemeris) and eph.message == "INAV":
            found += [payload_of(NavigationWords(eph.satellite, "1B", inav_words(eph, IONOSPHERE, n, START_NS))) for n in (0, 6)]
    return [*found, payload_of(NavigationWords("S29", "1C", tuple(range(8))))]


def sound(rng: Random) -> list[bytes]:
    """Pages in the order of their numbers, satellite by satellite or side by side."""
    pages = [page for _ in range(ROUNDS) for page in payloads()]
    if rng.random() < 0.5:
        rng.shuffle(pages)
    return pages


def touch(rng: Random, payload: bytes) -> bytes:
    """Damage that parity and CRC find, damage under a right CRC, or words under another name."""
    what = rng.randrange(8)
    if what == 0:
        return damaged(rng, payload)
    if what == 1:
        return payload[:8] + bits_flipped(rng, payload[8:])
    if what == 2:
        other = rng.choice(payloads())
        return other[:4] + payload[4:]
    said = decode_sfrbx(payload)
    return payload if said is None else payload_of(said._replace(words=rewritten(rng, said)))


def rewritten(rng: Random, said: NavigationWords) -> tuple[int, ...]:
    """The words of other contents with right parity."""
    kind = kind_of(said.satellite, said.signal)
    page = None if kind is None else kind.data_of(said)
    if kind is None or page is None:
        return said.words
    writing = WRITING[kind.name]
    fields = writing.fields.get(kind.number_of(page))
    if fields is None:
        return said.words
    if rng.random() < 0.2:
        return writing.words(random_message(rng, fields, writing.kept, page), said)
    return writing.words(with_extremes(rng, fields, page, () if rng.random() < 0.1 else writing.kept), said)


def examine(pieces: Sequence[Piece], rng: Random) -> Counter[str]:
    """One receiver hears them, a second or none apart, and its memory goes round by way of a snapshot; then every set comes whole again."""
    collector, again = NavigationCollector(messages=EVERY), NavigationCollector(messages=EVERY)
    now_ns, told = START_NS, Counter[str]()
    untimed = rng.random() < 0.3
    for payload, _ in pieces:
        words = decode_sfrbx(payload)
        if words is None:
            continue
        news = collector.take(words, None if untimed else now_ns)
        assert again.take(words, None if untimed else now_ns) == news
        if untimed and rng.random() < 0.02:
            completed = collector.complete(now_ns)
            assert again.complete(now_ns) == completed
            news += completed
            untimed = False
        _assert_in_range(news, collector, now_ns)
        told.update(x.message if isinstance(x, KeplerEphemeris) else type(x).__name__ for x in news)
        if rng.random() < 0.01:
            again = NavigationCollector(again.pages, again.told, EVERY)
        now_ns += rng.choice((0, 0, NS_PER_S, rng.randrange(30) * NS_PER_S))
        if now_ns - START_NS > 240 * NS_PER_S:
            now_ns = START_NS
    assert (collector.pages, collector.told) == (again.pages, again.told)
    _assert_whole_sets_are_told(collector)
    return told


def _assert_in_range(news: Sequence[Ephemeris | Klobuchar], collector: NavigationCollector, now_ns: int) -> None:
    for found in news:
        if isinstance(found, Klobuchar):
            bounds.assert_finite((*found.alpha, *found.beta))
            continue
        bounds.assert_sets_in_range((found,))
        assert abs(found.transmission_ns - now_ns) <= ARRIVES_WITHIN_NS, found
        assert abs(found.toe_ns - now_ns) <= WEEK_NS, found
        _assert_times_in_week(found, collector.pages)


def _assert_times_in_week(eph: Ephemeris, pages: Sequence[Page]) -> None:
    """That no reference time of a set is one that the week does not have."""
    name = eph.message if isinstance(eph, KeplerEphemeris) else "GLONASS"
    for page in pages:
        kind = kind_kept(page.satellite, page.number)
        if page.satellite != eph.satellite or kind is None or kind.name != name:
            continue
        number, data = page.number - kind.kept_as, int.from_bytes(page.data[: kind.data_bytes], "big")
        for field, unit_s in TIMES_S[name].get(number, {}).items():
            time_s = unit_s * WRITING[name].fields[number].integer(data, field)
            assert time_s < WEEK_S, f"{name} {field} = {time_s} s of {eph}"


def _assert_whole_sets_are_told(collector: NavigationCollector) -> None:
    """Whatever came before: untouched pages of a set, one after the other, make it what was told last."""
    for eph in sets():
        for payload in pages_of(eph):
            words = decode_sfrbx(payload)
            assert words is not None
            collector.take(words, eph.transmission_ns + 40 * NS_PER_S)
        message = eph.message if isinstance(eph, KeplerEphemeris) else None
        last = [x for x in collector.told if x.satellite == eph.satellite and (message is None or getattr(x, "message", None) == message)]
        sent_when_told = [replace(x, transmission_ns=eph.transmission_ns) for x in last]  # that alone is no news
        assert sent_when_told == [eph], f"{last} told where {eph} was sent"


def split(data: bytes) -> list[bytes]:
    """Any bytes as payloads, whose fifth byte tells their length."""
    found, at = [], 0
    while at < len(data):
        size = 8 + 4 * (data[at + 4] % 16) if at + 4 < len(data) else 8
        found.append(data[at : at + size])
        at += size
    return found


TARGET = Target(sound, touch, split, examine)
