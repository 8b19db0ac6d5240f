"""The navigation messages that sets are made of, side by side: how each is read, and which of its pages belong together.

A page is a subframe (LNAV, D1), a page (F/NAV, D2), a word (I/NAV) or a string (GLONASS). QZSS sends LNAV as GPS does. BeiDou's
geostationary satellites send D2, the others D1.
"""

from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

from integrity.gnss.ephemeris.broadcast import Ephemeris
from integrity.gnss.ephemeris.kepler import GEOSTATIONARY
from integrity.gnss.gps_time import NS_PER_S
from integrity.gnss.navigation import beidou, fnav, glonass, inav, lnav
from integrity.gnss.ubx.sfrbx import NavigationWords

_EphemerisOf = Callable[[str, Sequence[int], int], Ephemeris | None]


class MessageKind(NamedTuple):
    """One navigation message.

    `together_ns`: the pages of a set have arrived within that time; less than it takes what they have in common to come round again.
    """

    name: str
    pages: tuple[int, ...]  # numbers of those that make up a set
    timed: int  # the one whose beginning is the time of transmission
    data_bytes: int  # of a page, parity and framing taken out
    kept_as: int  # added to the number of a page in a snapshot
    together_ns: int
    data_of: Callable[[NavigationWords], int | None]  # None where parity, CRC or framing is not right
    number_of: Callable[[int], int]
    common_of: Callable[[int, int], int | None]  # number and data: what all pages of a set share; None for one that fits any
    time_bits: Mapping[int, int]  # by number, the bits that tell the time
    ephemeris_of: _EphemerisOf  # satellite, data of `pages` in that order, a GPS time near to them


def _lnav_common(number: int, data: int) -> int:
    if number == 1:
        return lnav.SUBFRAME_1.integer(data, "iodc") & 0xFF
    return (lnav.SUBFRAME_2 if number == 2 else lnav.SUBFRAME_3).integer(data, "iode")


def _inav_common(number: int, data: int) -> int | None:
    return inav.HEAD.integer(data, "issue") if number != 5 else None


LNAV = MessageKind(
    name="LNAV",
    pages=(1, 2, 3),
    timed=1,
    data_bytes=30,
    kept_as=0,
    together_ns=600 * NS_PER_S,  # each page comes every 30 s; issues repeat after 6 h at the earliest: IS-GPS-200, 20.3.4.4
    data_of=lambda words: lnav.subframe_of(words.words),
    number_of=lambda data: lnav.HEAD.integer(data, "subframe"),
    common_of=_lnav_common,
    time_bits=dict.fromkeys((1, 2, 3), lnav.HEAD.mask("next_tow_count")),
    ephemeris_of=lambda satellite, data, near_ns: lnav.ephemeris_of(satellite, data[0], data[1], data[2], near_ns),
)
INAV = MessageKind(
    name="INAV",
    pages=(1, 2, 3, 4, 5),
    timed=5,
    data_bytes=16,
    kept_as=0,
    together_ns=600 * NS_PER_S,
    data_of=lambda words: inav.word_of(words.words),
    number_of=lambda data: inav.HEAD.integer(data, "word_type"),
    common_of=_inav_common,
    time_bits={5: inav.WORD_5.mask("week", "tow_s")},
    ephemeris_of=lambda satellite, data, near_ns: inav.ephemeris_of(satellite, data[0], data[1], data[2], data[3], data[4], near_ns),
)
FNAV = MessageKind(
    name="FNAV",
    pages=(1, 2, 3, 4),
    timed=1,
    data_bytes=27,
    kept_as=100,  # beside the words of I/NAV of the same satellite
    together_ns=600 * NS_PER_S,
    data_of=lambda words: fnav.page_of(words.words),
    number_of=fnav.page_type,
    common_of=fnav.issue_of,
    time_bits={number: fnav.PAGES[number].mask(*(("tow_s",) if number == 4 else ("week", "tow_s"))) for number in (1, 2, 3, 4)},
    ephemeris_of=lambda satellite, data, near_ns: fnav.ephemeris_of(satellite, data[0], data[1], data[2], data[3], near_ns),
)
D1 = MessageKind(
    name="D1",
    pages=beidou.D1_SUBFRAMES,
    timed=1,
    data_bytes=28,
    kept_as=0,
    together_ns=600 * NS_PER_S,  # what they share is the second of the week
    data_of=lambda words: beidou.subframe_of(words.words),
    number_of=lambda data: beidou.HEAD.integer(data, "subframe"),
    common_of=beidou.d1_frame,
    time_bits={},
    ephemeris_of=beidou.d1_ephemeris_of,
)
D2 = D1._replace(
    name="D2",
    pages=beidou.D2_PAGES,
    number_of=beidou.d2_page,
    common_of=beidou.d2_cycle,
    ephemeris_of=beidou.d2_ephemeris_of,
)
GLONASS = MessageKind(
    name="GLONASS",
    pages=(1, 2, 3, 4),
    timed=1,
    data_bytes=15,
    kept_as=0,
    together_ns=60 * NS_PER_S,  # what they share is the frame; its number may come without that of the superframe, of 150 s
    data_of=lambda words: glonass.string_of(words.words, words.channel),
    number_of=glonass.string_number,
    common_of=glonass.frame_of,
    time_bits={},
    ephemeris_of=lambda satellite, data, near_ns: glonass.ephemeris_of(satellite, data[0], data[1], data[2], data[3], near_ns),
)

_BY_SIGNAL = {
    **dict.fromkeys(("G1C", "J1C"), LNAV),
    **dict.fromkeys(("E1B", "E7I"), INAV),
    "E5I": FNAV,
    **dict.fromkeys(("C2I", "C7I", "C6I"), D1),
    **dict.fromkeys(("R1C", "R2C"), GLONASS),
}
_BY_SYSTEM = {"G": LNAV, "J": LNAV, "E": INAV, "C": D1, "R": GLONASS}


def kind_of(satellite: str, signal: str) -> MessageKind | None:
    """The message on a signal; None for those without one of these."""
    kind = _BY_SIGNAL.get(satellite[0] + signal)
    return D2 if kind is D1 and satellite in GEOSTATIONARY else kind


def kind_kept(satellite: str, number: int) -> MessageKind | None:
    """The message that a page of a snapshot is of, by the number that it has there; None where there is no such page."""
    kind = _BY_SYSTEM.get(satellite[:1])
    if kind is D1 and satellite in GEOSTATIONARY:
        kind = D2
    if kind is INAV and number > FNAV.kept_as:
        kind = FNAV
    return kind if kind is not None and number - kind.kept_as in kind.pages else None
