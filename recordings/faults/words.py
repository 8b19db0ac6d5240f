"""Navigation words of a satellite with a displaced orbit in them: subframes 1 to 3 of GPS LNAV, words 1 to 4 of Galileo I/NAV.

The orbit's parameters and the issue change, and parity or CRC with them; everything else in a message stays, its time above all.
Other messages that may carry the orbit (CNAV, F/NAV) stay as they are: no decision comes from them.
"""

import math
import struct
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import cache
from typing import NamedTuple

from integrity.errors import ConfigError
from integrity.gnss.ephemeris.broadcast import KeplerEphemeris
from integrity.gnss.gps_time import NS_PER_S, WEEK_NS
from integrity.gnss.navigation import inav, lnav
from integrity.gnss.navigation.bits import Layout, nearest_ns
from integrity.gnss.ubx.sfrbx import HEADER_BYTES, NavigationWords, decode_sfrbx
from recordings.faults.kinds import WrongEphemeris
from recordings.faults.orbits import ISSUES, wrong_orbit
from recordings.faults.received import FrameAt, WordsAt
from recordings.faults.scenario import Fault
from recordings.faults.truth import Truth
from recordings.simulate.navigation_words import subframe_words

PAGE_NS = 2 * NS_PER_S  # Galileo OS SIS ICD, 4.3.2: even and odd part
ORBIT = ("sqrt_a", "delta_n", "m0", "i0", "omega0", "omega")  # what `displaced` changes
TURNS = ("m0", "omega0", "omega")  # angles that are sent between -pi and pi
SUBFRAMES = {1: lnav.SUBFRAME_1, 2: lnav.SUBFRAME_2, 3: lnav.SUBFRAME_3}
WORDS = {1: inav.WORD_1, 2: inav.WORD_2, 3: inav.WORD_3, 4: inav.WORD_4}


class _Message(NamedTuple):
    """A page of a set: its bits, their layout, and the name of the issue in it."""

    bits: int
    layout: Layout
    issue_field: str

    @property
    def issue(self) -> int:
        return self.layout.integer(self.bits, self.issue_field)


def wrong_words(fault: Fault, effect: WrongEphemeris, truth: Truth, words: Sequence[WordsAt]) -> Iterator[tuple[FrameAt, bytes]]:
    """The frames whose words began while the fault lasts, with the payload that they have then.

    Words of a set that never becomes complete in the recording stay: nobody can say where its orbit would be. ConfigError where the
    displaced orbit is none, or a message has no room for it.
    """
    wrong_set_of = _wrong_sets(fault, effect, truth)
    for frame, near_ns in words:
        said = decode_sfrbx(frame.payload)
        if frame.begin < 0 or said is None or said.satellite != effect.satellite or near_ns is None:
            continue
        page = _page(said)
        if page is None or not fault.covers(_begun_ns(said, page, near_ns)):
            continue
        pair = wrong_set_of(page.issue % ISSUES[said.satellite[0]], near_ns)
        if pair is not None:
            yield frame, frame.payload[:HEADER_BYTES] + _wrong_page(fault, said, page, *pair)


def _wrong_sets(fault: Fault, effect: WrongEphemeris, truth: Truth) -> Callable[[int, int], tuple[KeplerEphemeris, KeplerEphemeris] | None]:
    """From an issue and a time to the set of that issue nearest to it, and the same displaced."""
    sets = [eph for eph in truth.store.ephemerides if isinstance(eph, KeplerEphemeris) and eph.satellite == effect.satellite]

    @cache
    def displaced_of(true: KeplerEphemeris) -> KeplerEphemeris:
        return wrong_orbit(fault, effect, true, max(fault.start_ns, true.transmission_ns))

    def pair(issue: int, near_ns: int) -> tuple[KeplerEphemeris, KeplerEphemeris] | None:
        same = [eph for eph in sets if eph.issue == issue]
        if not same:
            return None
        true = min(same, key=lambda eph: (abs(eph.transmission_ns - near_ns), eph.transmission_ns))
        return true, displaced_of(true)

    return pair


def _page(said: NavigationWords) -> _Message | None:
    """The page of a set that words hold; None for others and for damaged ones."""
    if said.signal == "1C":
        bits = lnav.subframe_of(said.words)
        number = 0 if bits is None else lnav.HEAD.integer(bits, "subframe")
        return None if bits is None or number not in SUBFRAMES else _Message(bits, SUBFRAMES[number], "iodc" if number == 1 else "iode")
    bits = inav.word_of(said.words)
    number = 0 if bits is None else inav.HEAD.integer(bits, "word_type")
    return None if bits is None or number not in WORDS else _Message(bits, WORDS[number], "issue")


def _begun_ns(said: NavigationWords, page: _Message, near_ns: int) -> int:
    """When the satellite began to send a page that came at `near_ns`; I/NAV words do not say it: the last whole page before."""
    if said.satellite[0] == "E":
        return near_ns // PAGE_NS * PAGE_NS - PAGE_NS
    count = (page.layout.integer(page.bits, "next_tow_count") - 1) % lnav.SUBFRAMES_A_WEEK
    return nearest_ns(count * lnav.SUBFRAME_S * NS_PER_S, near_ns, WEEK_NS)


def _wrong_page(fault: Fault, said: NavigationWords, page: _Message, true: KeplerEphemeris, wrong: KeplerEphemeris) -> bytes:
    """The words of a page of a true set as those of the wrong one, as they stand in RXM-SFRBX."""
    values: dict[str, float] = {page.issue_field: page.issue - page.issue % ISSUES[said.satellite[0]] + wrong.issue}
    for name in ORBIT:
        value = getattr(wrong, name)
        if name in page.layout.fields and value != getattr(true, name):
            values[name] = math.remainder(value, math.tau) if name in TURNS else value
    try:
        bits = _replaced(page.layout, page.bits, values)
    except ValueError as error:
        raise ConfigError(f"{fault}: {said.satellite} cannot send the orbit: {error}; make the offset smaller") from None
    words = subframe_words(bits) if said.satellite[0] == "G" else _page_words(said.words, bits)
    return struct.pack(f"<{len(words)}I", *words)


def _replaced(layout: Layout, message: int, values: Mapping[str, float]) -> int:
    """The message with some of its fields as given."""
    for name in values:
        for part in layout.fields[name].parts:
            message &= ~((1 << part.bits) - 1 << layout.bits - part.first - part.bits)
    return message | layout.message(values)


def _page_words(words: Sequence[int], bits: int) -> tuple[int, ...]:
    """The words of a page with another I/NAV word in it, and its CRC."""
    page = 0
    for word in words:
        page = page << 32 | word
    page = _replaced(inav.PAGE, page, {"data_1": bits >> 16, "data_2": bits & 0xFFFF})
    page = _replaced(inav.PAGE, page, {"crc": inav.page_crc(page)})
    return tuple(page >> shift & 0xFFFFFFFF for shift in range(224, -1, -32))
