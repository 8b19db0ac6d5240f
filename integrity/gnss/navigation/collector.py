"""From words of navigation messages to whole ephemerides: what one receiver has of each satellite so far.

What makes up a set is in `kinds`. It is told when it is complete, plausible, and anything but the time of its transmission differs from
what was last told of that satellite and message: health may change without a new issue. A message that several signals carry (I/NAV on
E1-B and E5b-I, D1 on B1I and B3I) is one message, whichever of them a page came by.

Pages that do not belong together make no set. A page that shares another issue (BeiDou, GLONASS: another frame) than what is kept of the
satellite and message drops that, pages included that fit any issue (word 5 of I/NAV). As issues come round again and most pages do not
say of which week they are, all pages of a set must have arrived within `together_ns` of its kind, and the one that says when it was sent
must have arrived within `ARRIVES_WITHIN_NS` of that.
"""

from collections.abc import Collection, Iterable
from dataclasses import replace
from typing import NamedTuple

from integrity.errors import DecodeError
from integrity.gnss.atmosphere import Klobuchar
from integrity.gnss.ephemeris.broadcast import Ephemeris, KeplerEphemeris
from integrity.gnss.gps_time import NS_PER_S
from integrity.gnss.navigation import lnav
from integrity.gnss.navigation.kinds import LNAV, MessageKind, kind_kept, kind_of
from integrity.gnss.ubx.sfrbx import NavigationWords

# All but F/NAV, whose sets differ from those of I/NAV in the clock: a store that holds one set of a satellite at a time must not mix them.
ONE_OF_EACH = ("LNAV", "INAV", "D1", "D2", "GLONASS")

ARRIVES_WITHIN_NS = 600 * NS_PER_S
A_MOMENT_NS = 60 * NS_PER_S
TIME_BYTES = 8


class Page(NamedTuple):
    """A page kept: subframe, word, page or string `number` of a satellite; those of F/NAV count from 101.

    `data` is the message without parity, CRC and framing (as many bytes as its kind says), then the GPS time of its arrival in ns (8 bytes,
    signed, big endian), left out where that was not known.
    """

    satellite: str
    number: int
    data: bytes


class _Kept(NamedTuple):
    """A page's data, what it shares with the others of its set (None: it fits any), and when it arrived, in GPS time; None: before the
    time was known."""

    data: int
    common: int | None
    arrived_ns: int | None


_Source = tuple[str, str]  # satellite and name of the message


class NavigationCollector:
    """Collects the pages of every satellite of one receiver. Made again from its `pages` and `told`, it goes on as if never stopped.

    `messages` are the ones that sets are told of: names of `kinds`.
    """

    def __init__(self, pages: Iterable[Page] = (), told: Iterable[Ephemeris] = (), messages: Collection[str] = ONE_OF_EACH) -> None:
        self._messages = frozenset(messages)
        self._kept: dict[_Source, dict[int, _Kept]] = {}
        self._kinds: dict[_Source, MessageKind] = {}
        for page in pages:
            kind, number, kept = _unpacked(page)
            if kind.name in self._messages:
                self._pages_of(page.satellite, kind)[number] = kept
        self._told = {_source_of(eph): eph for eph in told}

    @property
    def pages(self) -> tuple[Page, ...]:
        """What is kept, by satellite and number."""
        packed = (
            _packed(source[0], self._kinds[source], number, kept) for source, pages in self._kept.items() for number, kept in pages.items()
        )
        return tuple(sorted(packed, key=lambda page: (page.satellite, page.number)))

    @property
    def told(self) -> tuple[Ephemeris, ...]:
        """The last set told of each satellite and message, by these."""
        return tuple(self._told[source] for source in sorted(self._told))

    def take(self, words: NavigationWords, near_ns: int | None) -> list[Ephemeris | Klobuchar]:
        """What these words newly tell: a set that they complete or change, or the ionosphere of GPS; mostly nothing.

        `near_ns` is the GPS time of arrival, good to a minute; None while it is not known: then pages are kept for `complete`.
        Words with wrong parity or CRC change nothing.
        """
        kind = kind_of(words.satellite, words.signal)
        if kind is None or kind.name not in self._messages:
            return []
        data = kind.data_of(words)
        if data is None:
            return []
        if kind is LNAV and words.satellite[0] == "G" and (klobuchar := lnav.klobuchar_of(data)):
            return [klobuchar]
        number = kind.number_of(data)
        if number not in kind.pages:
            return []
        pages, now = self._pages_of(words.satellite, kind), _Kept(data, kind.common_of(number, data), near_ns)
        before = pages.get(number)
        _keep(pages, number, now)
        if before is not None and _repeats(kind, number, before, now):
            return []
        ephemeris = self._news_of(words.satellite, kind)
        return [ephemeris] if ephemeris else []

    def complete(self, near_ns: int) -> list[Ephemeris]:
        """Sets not yet told, by satellite, now that the GPS time is known: pages kept without a time count as arrived at `near_ns`."""
        for pages in self._kept.values():
            for number, kept in pages.items():
                if kept.arrived_ns is None:
                    pages[number] = kept._replace(arrived_ns=near_ns)
        news = (self._news_of(source[0], self._kinds[source]) for source in sorted(self._kept))
        return [ephemeris for ephemeris in news if ephemeris]

    def _pages_of(self, satellite: str, kind: MessageKind) -> dict[int, _Kept]:
        source = satellite, kind.name
        self._kinds[source] = kind
        return self._kept.setdefault(source, {})

    def _news_of(self, satellite: str, kind: MessageKind) -> Ephemeris | None:
        """The set that the kept pages of a satellite make up, if they do and it says something new; it then counts as told."""
        source = satellite, kind.name
        ephemeris = _set_of(satellite, kind, self._kept[source])
        if ephemeris is None:
            return None
        last = self._told.get(source)
        if last is not None and replace(last, transmission_ns=ephemeris.transmission_ns) == ephemeris:
            return None
        self._told[source] = ephemeris
        return ephemeris


def _source_of(eph: Ephemeris) -> _Source:
    return eph.satellite, eph.message if isinstance(eph, KeplerEphemeris) else "GLONASS"


def _keep(pages: dict[int, _Kept], number: int, page: _Kept) -> None:
    if page.common is not None and any(kept.common not in (page.common, None) for kept in pages.values()):
        pages.clear()
    pages[number] = page


def _repeats(kind: MessageKind, number: int, before: _Kept, now: _Kept) -> bool:
    """Whether a page says what it said a moment ago, but for the time: then the set is as it was, and was told if there was one."""
    if before.arrived_ns is None or now.arrived_ns is None or not 0 <= now.arrived_ns - before.arrived_ns <= A_MOMENT_NS:
        return False
    return (before.data ^ now.data) & ~kind.time_bits.get(number, 0) == 0


def _set_of(satellite: str, kind: MessageKind, pages: dict[int, _Kept]) -> Ephemeris | None:
    """The set that the kept pages of a satellite make up; None where one is missing, or they do not belong together, or make no sense.

    A page that says it was sent at another time than it came is dropped where the right one would pass for a repetition of it.
    """
    arrived_ns = {number: kept.arrived_ns for number, kept in pages.items() if kept.arrived_ns is not None}
    if len(arrived_ns) < len(kind.pages) or max(arrived_ns.values()) - min(arrived_ns.values()) > kind.together_ns:
        return None
    timed_ns = arrived_ns[kind.timed]
    ephemeris = kind.ephemeris_of(satellite, [pages[number].data for number in kind.pages], timed_ns)
    if ephemeris is None or ephemeris.implausibility() is not None:
        return None
    if abs(timed_ns - ephemeris.transmission_ns) > ARRIVES_WITHIN_NS:
        if kind.timed in kind.time_bits:
            del pages[kind.timed]
        return None
    return ephemeris


def _packed(satellite: str, kind: MessageKind, number: int, kept: _Kept) -> Page:
    data = kept.data.to_bytes(kind.data_bytes, "big")
    if kept.arrived_ns is not None:
        data += kept.arrived_ns.to_bytes(TIME_BYTES, "big", signed=True)
    return Page(satellite, kind.kept_as + number, data)


def _unpacked(page: Page) -> tuple[MessageKind, int, _Kept]:
    """DecodeError where a page is none that `_packed` makes."""
    kind = kind_kept(page.satellite, page.number)
    if kind is not None and len(page.data) in (kind.data_bytes, kind.data_bytes + TIME_BYTES):
        number, time = page.number - kind.kept_as, page.data[kind.data_bytes :]
        data = int.from_bytes(page.data[: kind.data_bytes], "big")
        if number == kind.number_of(data):
            arrived_ns = int.from_bytes(time, "big", signed=True) if time else None
            return kind, number, _Kept(data, kind.common_of(number, data), arrived_ns)
    raise DecodeError(
        f"navigation page {page.number} of {page.satellite!r} in a snapshot: {page.data.hex()} is no such page; "
        "the snapshot is damaged: start without it"
    )
