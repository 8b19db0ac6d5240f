"""From words of navigation messages to whole ephemerides: what one receiver has of each satellite so far.

A set is GPS subframes 1 to 3 or Galileo I/NAV words 1 to 5 of E1-B. It is told when it is complete, plausible, and anything but the time
of its transmission differs from what was last told of that satellite: health may change without a new issue. Other signals carry the same
sets (E5b-I) or are not used; their words are passed over.

Pages that do not belong together make no set. A page of another issue drops what is kept of the satellite, word 5 included, which has no
issue. As issues come round again and most pages do not say of which week they are, all pages of a set must have arrived within
`PAGES_TOGETHER_NS`, and the one that says when it was sent must have arrived as close to that.
"""

from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import NamedTuple

from integrity.errors import DecodeError
from integrity.gnss.atmosphere import Klobuchar
from integrity.gnss.ephemeris.broadcast import Ephemeris
from integrity.gnss.gps_time import NS_PER_S
from integrity.gnss.navigation import inav, lnav
from integrity.gnss.ubx.sfrbx import NavigationWords

PAGES_TOGETHER_NS = 600 * NS_PER_S  # each page comes every 30 s; issues repeat after 6 h at the earliest: IS-GPS-200, 20.3.4.4

A_MOMENT_NS = 60 * NS_PER_S
GPS_TIME_BITS, GALILEO_TIME_BITS = lnav.HEAD.mask("next_tow_count"), inav.WORD_5.mask("week", "tow_s")

PAGES_OF_SET = {"G": (1, 2, 3), "E": (1, 2, 3, 4, 5)}
PAGE_WITH_TIME = {"G": 1, "E": 5}  # the one whose beginning is the time of transmission
MESSAGE_BYTES = {"G": 30, "E": 16}
TIME_BYTES = 8


class Page(NamedTuple):
    """A page kept: subframe or word type `number` of a satellite.

    `data` is the message without parity, CRC and framing (30 bytes of a subframe, 16 of a word), then the GPS time of its arrival in ns
    (8 bytes, signed, big endian), left out where that was not known.
    """

    satellite: str
    number: int
    data: bytes


class _Kept(NamedTuple):
    """A page's message, its issue (None: it has none), and when it arrived, in GPS time; None: before the time was known."""

    message: int
    issue: int | None
    arrived_ns: int | None


class NavigationCollector:
    """Collects the pages of every satellite of one receiver. Made again from its `pages` and `told`, it goes on as if never stopped."""

    def __init__(self, pages: Iterable[Page] = (), told: Iterable[Ephemeris] = ()) -> None:
        self._kept: dict[str, dict[int, _Kept]] = {}
        for page in pages:
            self._kept.setdefault(page.satellite, {})[page.number] = _unpacked(page)
        self._told = {eph.satellite: eph for eph in told}

    @property
    def pages(self) -> tuple[Page, ...]:
        """What is kept, by satellite and number."""
        return tuple(
            _packed(satellite, number, kept) for satellite, pages in sorted(self._kept.items()) for number, kept in sorted(pages.items())
        )

    @property
    def told(self) -> tuple[Ephemeris, ...]:
        """The last set told of each satellite, by satellite."""
        return tuple(self._told[satellite] for satellite in sorted(self._told))

    def take(self, words: NavigationWords, near_ns: int | None) -> list[Ephemeris | Klobuchar]:
        """What these words newly tell: a set that they complete or change, or the ionosphere; mostly nothing.

        `near_ns` is the GPS time of arrival, good to a minute; None while it is not known: then pages are kept for `complete`.
        Words with wrong parity or CRC change nothing.
        """
        if words.signal == "1C":
            message = lnav.subframe_of(words.words)
        elif words.signal == "1B":
            message = inav.word_of(words.words)
        else:
            return []
        if message is None:
            return []
        system = words.satellite[0]
        if system == "G" and (klobuchar := lnav.klobuchar_of(message)):
            return [klobuchar]
        number = _number(system, message)
        if number not in PAGES_OF_SET[system]:
            return []
        before, now = self._kept.get(words.satellite, {}).get(number), _Kept(message, _issue(system, number, message), near_ns)
        self._keep(words.satellite, number, now)
        if before is not None and _repeats(system, number, before, now):
            return []
        ephemeris = self._news_of(words.satellite)
        return [ephemeris] if ephemeris else []

    def complete(self, near_ns: int) -> list[Ephemeris]:
        """Sets not yet told, by satellite, now that the GPS time is known: pages kept without a time count as arrived at `near_ns`."""
        for pages in self._kept.values():
            for number, kept in pages.items():
                if kept.arrived_ns is None:
                    pages[number] = kept._replace(arrived_ns=near_ns)
        news = (self._news_of(satellite) for satellite in sorted(self._kept))
        return [ephemeris for ephemeris in news if ephemeris]

    def _keep(self, satellite: str, number: int, page: _Kept) -> None:
        pages = self._kept.setdefault(satellite, {})
        if page.issue is not None and any(kept.issue not in (page.issue, None) for kept in pages.values()):
            pages.clear()
        pages[number] = page

    def _news_of(self, satellite: str) -> Ephemeris | None:
        """The set that the kept pages of a satellite make up, if they do and it says something new; it then counts as told."""
        ephemeris = _set_of(satellite, self._kept[satellite])
        if ephemeris is None:
            return None
        last = self._told.get(satellite)
        if last is not None and replace(last, transmission_ns=ephemeris.transmission_ns) == ephemeris:
            return None
        self._told[satellite] = ephemeris
        return ephemeris


def _repeats(system: str, number: int, before: _Kept, now: _Kept) -> bool:
    """Whether a page says what it said a moment ago, but for the time: then the set is as it was, and was told if there was one."""
    if before.arrived_ns is None or now.arrived_ns is None or not 0 <= now.arrived_ns - before.arrived_ns <= A_MOMENT_NS:
        return False
    time = GPS_TIME_BITS if system == "G" else GALILEO_TIME_BITS if number == 5 else 0
    return (before.message ^ now.message) & ~time == 0


def _number(system: str, message: int) -> int:
    return lnav.HEAD.integer(message, "subframe") if system == "G" else inav.HEAD.integer(message, "word_type")


def _issue(system: str, number: int, message: int) -> int | None:
    """What all pages of a set have in common; None for Galileo's word 5, which has none."""
    if system == "E":
        return inav.HEAD.integer(message, "issue") if number != 5 else None
    if number == 1:
        return lnav.SUBFRAME_1.integer(message, "iodc") & 0xFF
    return (lnav.SUBFRAME_2 if number == 2 else lnav.SUBFRAME_3).integer(message, "iode")


def _set_of(satellite: str, pages: Mapping[int, _Kept]) -> Ephemeris | None:
    """The set that the kept pages of a satellite make up; None where one is missing, or they do not belong together, or make no sense."""
    arrived_ns = {number: kept.arrived_ns for number, kept in pages.items() if kept.arrived_ns is not None}
    if len(arrived_ns) < len(PAGES_OF_SET[satellite[0]]) or max(arrived_ns.values()) - min(arrived_ns.values()) > PAGES_TOGETHER_NS:
        return None
    timed_ns = arrived_ns[PAGE_WITH_TIME[satellite[0]]]
    messages = [pages[number].message for number in sorted(pages)]
    if satellite[0] == "G":
        ephemeris = lnav.ephemeris_of(satellite, messages[0], messages[1], messages[2], timed_ns)
    else:
        ephemeris = inav.ephemeris_of(satellite, messages[0], messages[1], messages[2], messages[3], messages[4], timed_ns)
    if ephemeris is None or ephemeris.implausibility() is not None or abs(timed_ns - ephemeris.transmission_ns) > PAGES_TOGETHER_NS:
        return None
    return ephemeris


def _packed(satellite: str, number: int, kept: _Kept) -> Page:
    data = kept.message.to_bytes(MESSAGE_BYTES[satellite[0]], "big")
    if kept.arrived_ns is not None:
        data += kept.arrived_ns.to_bytes(TIME_BYTES, "big", signed=True)
    return Page(satellite, number, data)


def _unpacked(page: Page) -> _Kept:
    """DecodeError where a page is none that `_packed` makes."""
    system = page.satellite[:1]
    size = MESSAGE_BYTES.get(system, 0)
    if size and len(page.data) in (size, size + TIME_BYTES):
        message, time = int.from_bytes(page.data[:size], "big"), page.data[size:]
        if page.number in PAGES_OF_SET[system] and page.number == _number(system, message):
            return _Kept(message, _issue(system, page.number, message), int.from_bytes(time, "big", signed=True) if time else None)
    raise DecodeError(
        f"navigation page {page.number} of {page.satellite!r} in a snapshot: {page.data.hex()} is no such page; "
        "the snapshot is damaged: start without it"
    )
