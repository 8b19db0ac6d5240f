"""Pages of navigation messages changed and put back into the words of a receiver, parity, CRC or check bits worked out anew.

One entry for each message of `integrity.gnss.navigation.kinds`: which pages hold the orbit, by which table they are changed, when what
they belong to began, and how their words are made. Where an issue binds the pages of a set, any page may be the first with the new
orbit, as the issue changes with it; where only their frame does (BeiDou, GLONASS), a frame is changed as a whole.
"""

from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

from integrity.gnss.crc import crc24q
from integrity.gnss.gps_time import BDT_BEHIND_GPS_NS, GLONASS_AHEAD_OF_UTC_NS, NS_PER_S, WEEK_NS, gps_from_utc, utc_from_gps
from integrity.gnss.navigation import beidou, fnav, glonass, inav, lnav
from integrity.gnss.navigation.bits import Layout, nearest_ns
from integrity.gnss.navigation.kinds import MessageKind
from recordings.simulate.navigation_words import subframe_words

INAV_PAGE_NS = 2 * NS_PER_S  # Galileo OS SIS ICD, 4.3.2: even and odd part
STRING_NS, FRAME_NS = 2 * NS_PER_S, 30 * NS_PER_S  # GLONASS ICD 5.1, 4.2
SUBFRAMES = {1: lnav.SUBFRAME_1, 2: lnav.SUBFRAME_2, 3: lnav.SUBFRAME_3}
WORDS = {1: inav.WORD_1, 2: inav.WORD_2, 3: inav.WORD_3, 4: inav.WORD_4}


class Page(NamedTuple):
    """A page with the orbit in it: its bits in the table by which it is read, and its issue, None where it has none.

    `behind`: bits of the table that belong to pages of the set after this one.
    """

    bits: int
    layout: Layout
    issue_field: str | None
    behind: int = 0

    @property
    def issue(self) -> int | None:
        """Of the set."""
        return None if self.issue_field is None else self.layout.integer(self.bits, self.issue_field)

    def data(self, bits: int, size: int) -> int:
        """The page alone, of so many bits."""
        return bits >> self.behind & (1 << size) - 1


def replaced(layout: Layout, message: int, values: Mapping[str, float]) -> int:
    """The message with some of its fields as given. ValueError for a value that does not fit."""
    return message & ~layout.mask(*values) | layout.message(values)


def page_of(kind: MessageKind, number: int, data: int) -> Page | None:
    """What a page with this number holds of a set's orbit or issue; None for one without."""
    match kind.name:
        case "LNAV" if number in SUBFRAMES:
            return Page(data, SUBFRAMES[number], "iodc" if number == 1 else "iode")
        case "INAV" if number in WORDS:
            return Page(data, WORDS[number], "issue")
        case "FNAV" if number in fnav.PAGES:
            return Page(data, fnav.PAGES[number], "issue")
        case "GLONASS" if number in glonass.STRINGS:
            return Page(data, glonass.STRINGS[number], None)
        case "D1" | "D2" if number in kind.pages:
            behind = beidou.SUBFRAME_BITS * (len(kind.pages) - 1 - kind.pages.index(number))
            return Page(data << behind, beidou.LAYOUTS["D1" if kind.name == "D1" else "D2"], None, behind)
    return None


def begun_ns(kind: MessageKind, number: int, page: Page, near_ns: int) -> int:
    """When the satellite began to send a page that came at `near_ns`, or the frame that it must be changed with."""
    match kind.name:
        case "LNAV":
            count = (page.layout.integer(page.bits, "next_tow_count") - 1) % lnav.SUBFRAMES_A_WEEK
            return nearest_ns(count * lnav.SUBFRAME_S * NS_PER_S, near_ns, WEEK_NS)
        case "INAV":  # most words do not say it: the last whole page before
            return near_ns // INAV_PAGE_NS * INAV_PAGE_NS - INAV_PAGE_NS
        case "FNAV":
            return nearest_ns(page.layout.integer(page.bits, "tow_s") * NS_PER_S, near_ns, WEEK_NS)
        case "GLONASS":
            moscow_ns = utc_from_gps(near_ns) + GLONASS_AHEAD_OF_UTC_NS - number * STRING_NS
            return gps_from_utc((moscow_ns + FRAME_NS // 2) // FRAME_NS * FRAME_NS - GLONASS_AHEAD_OF_UTC_NS)
    subframe = page.data(page.bits, beidou.SUBFRAME_BITS)
    began_s = (beidou.d1_frame if kind.name == "D1" else beidou.d2_cycle)(number, subframe)
    return nearest_ns(began_s * NS_PER_S + BDT_BEHIND_GPS_NS, near_ns, WEEK_NS)


def words_of(kind: MessageKind, page: Page, bits: int, words: Sequence[int]) -> tuple[int, ...]:
    """The words of a page that is `bits` now; what else stands in them stays."""
    return _WORDS[kind.name](page, bits, words)


def _lnav_words(_page: Page, bits: int, _words: Sequence[int]) -> tuple[int, ...]:
    return subframe_words(bits)


def _inav_words(_page: Page, bits: int, words: Sequence[int]) -> tuple[int, ...]:
    whole = replaced(inav.PAGE, _joined(words), {"data_1": bits >> 16, "data_2": bits & 0xFFFF})
    return _split(replaced(inav.PAGE, whole, {"crc": inav.page_crc(whole)}), len(words))


def _fnav_words(_page: Page, bits: int, words: Sequence[int]) -> tuple[int, ...]:
    return _split(replaced(fnav.PAGE, _joined(words), {"data": bits, "crc": crc24q(bits.to_bytes(27, "big"))}), len(words))


def _beidou_words(page: Page, bits: int, words: Sequence[int]) -> tuple[int, ...]:
    """26 bits of data in the first word, of which the last 11 are coded, 22 in the others; the two bits above each word stay."""
    data = page.data(bits, beidou.SUBFRAME_BITS)
    first = data >> beidou.SUBFRAME_BITS - 26
    made = [first << 4 | beidou.parity(first & 0x7FF)]
    for k in range(1, beidou.WORDS):
        two = data >> 22 * (beidou.WORDS - 1 - k) & 0x3FFFFF
        made.append(two << 8 | beidou.parity(two >> 11) << 4 | beidou.parity(two & 0x7FF))
    return tuple(word & 0xC0000000 | new for word, new in zip(words, made, strict=True))


def _glonass_words(_page: Page, bits: int, words: Sequence[int]) -> tuple[int, ...]:
    """The string in the first 85 of 96 bits, its check bits last; behind it and in the fourth word, what the receiver put there."""
    spare = 96 - glonass.STRING_BITS
    string = (bits & (1 << glonass.STRING_BITS - glonass.CHECK_BITS) - 1) << glonass.CHECK_BITS
    for bit, mask in enumerate(glonass.HAMMING_MASKS):  # the last is over all, the others among them
        string |= ((string & mask).bit_count() & 1) << bit
    return (*_split(string << spare | words[2] & (1 << spare) - 1, 3), words[3])


_WORDS: dict[str, Callable[[Page, int, Sequence[int]], tuple[int, ...]]] = {
    "LNAV": _lnav_words,
    "INAV": _inav_words,
    "FNAV": _fnav_words,
    "D1": _beidou_words,
    "D2": _beidou_words,
    "GLONASS": _glonass_words,
}


def _joined(words: Sequence[int]) -> int:
    whole = 0
    for word in words:
        whole = whole << 32 | word
    return whole


def _split(whole: int, n_words: int) -> tuple[int, ...]:
    return tuple(whole >> 32 * (n_words - 1 - k) & 0xFFFFFFFF for k in range(n_words))
