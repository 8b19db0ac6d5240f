"""The navigation messages that a simulated satellite sends, as the words that RXM-SFRBX of a receiver has: the inverse of the decoders.

Sources: IS-GPS-200, 20.3.3 and 20.3.5.2; Galileo OS SIS ICD 2.1, 4.3.2 to 4.3.5. The bit tables are those of `integrity.gnss.navigation`.
"""

from collections.abc import Mapping

from integrity.gnss.atmosphere import Klobuchar
from integrity.gnss.ephemeris.broadcast import KeplerEphemeris
from integrity.gnss.gps_time import NS_PER_S, WEEK_NS, WEEK_S, leap_seconds_at_gps
from integrity.gnss.navigation import inav, lnav
from integrity.gnss.navigation.bits import Layout

GPS_UNHEALTHY = 0b111111  # data bad, more than one anomaly: IS-GPS-200, 20.3.3.3.1.4 and table 20-VIII
GALILEO_UNHEALTHY = 1  # out of service: Galileo OS SIS ICD, 5.1.9.3
DATA_ID = 0b01  # IS-GPS-200, 20.3.3.5.1.1
EMPTY_PAGE = int("10" * 91, 2) << 2  # alternating ones and zeros from bit 9 of word 3 to bit 22 of word 10: IS-GPS-200, 20.3.3.5.1.1
NO_SAR = 0x2AAAAA  # alternating as well, as seen on the air


def lnav_words(eph: KeplerEphemeris, klobuchar: Klobuchar, subframe: int, start_ns: int) -> tuple[int, ...]:
    """Ten words of a GPS subframe (1 to 5) that begins at the GPS time `start_ns`, a multiple of 6 s.

    Subframe 4 is always page 18 (the ionosphere), subframe 5 the page of a satellite that does not exist: no almanac is sent.
    ValueError for other subframes and times, and for a value that the message has no room for.
    """
    if subframe not in range(1, 6) or start_ns % (lnav.SUBFRAME_S * NS_PER_S):
        raise ValueError(f"subframe {subframe} at {start_ns} ns: expected subframe 1 to 5 at a multiple of {lnav.SUBFRAME_S} s")
    layout, values = _lnav_content(eph, klobuchar, subframe, start_ns)
    head = {
        "preamble": lnav.PREAMBLE,
        "next_tow_count": (start_ns // NS_PER_S // lnav.SUBFRAME_S + 1) % lnav.SUBFRAMES_A_WEEK,
        "subframe": subframe,
    }
    message = layout.message(head | dict(values))
    return subframe_words(message | EMPTY_PAGE if subframe == 5 else message)


def _lnav_content(eph: KeplerEphemeris, klobuchar: Klobuchar, subframe: int, start_ns: int) -> tuple[Layout, Mapping[str, float]]:
    """What follows the head of a subframe, and where."""
    if subframe == 1:
        own = {
            "week": start_ns // WEEK_NS % 1024,
            "ura_index": lnav.URA_NO_PROMISE if eph.accuracy_m is None else _index(lnav.URA_UPPER_M, "accuracy_m", eph.accuracy_m),
            "health": 0 if eph.healthy else GPS_UNHEALTHY,
            "iodc": eph.issue,
            "toc_16s": eph.toc_ns % WEEK_NS / (16 * NS_PER_S),
        }
        return lnav.SUBFRAME_1, own | _quantities(lnav.SUBFRAME_1, eph)
    if subframe == 2:
        own = {
            "iode": eph.issue,
            "toe_16s": eph.toe_ns % WEEK_NS / (16 * NS_PER_S),
            "fit_flag": _index(lnav.FIT_HALF_S, "fit_half_s", eph.fit_half_s),
        }
        return lnav.SUBFRAME_2, own | _quantities(lnav.SUBFRAME_2, eph)
    if subframe == 3:
        return lnav.SUBFRAME_3, {"iode": eph.issue} | _quantities(lnav.SUBFRAME_3, eph)
    if subframe == 5:
        return lnav.ALMANAC, {"data_id": DATA_ID, "page_id": 0}
    coefficients = {
        f"{letter}{k}": c for letter, four in (("alpha", klobuchar.alpha), ("beta", klobuchar.beta)) for k, c in enumerate(four)
    }
    return lnav.IONOSPHERE, {"data_id": DATA_ID, "page_id": lnav.IONOSPHERE_PAGE} | coefficients


def _quantities(layout: Layout, eph: KeplerEphemeris) -> dict[str, float]:
    """The fields of a message that `KeplerEphemeris` has under the same name and in the same unit."""
    return {name: getattr(eph, name) for name, field in layout.fields.items() if field.unit is not None}


def _index(table: tuple[float, ...], name: str, value: float) -> int:
    """Place of a value in a table of those that can be sent."""
    if value not in table:
        raise ValueError(f"{name} = {value!r} cannot be sent, expected one of the {len(table)} values from {table[0]} to {table[-1]}")
    return table.index(value)


def subframe_words(message: int) -> tuple[int, ...]:
    """Ten words of a subframe from its 240 data bits: the last two of words 2 and 10 solved, parity added, inverted where D30* is one.

    Source: IS-GPS-200, 20.3.5.2 and figure 20-5; the form of the words as in `integrity.gnss.navigation.lnav`.
    """
    words = []
    d29 = d30 = 0
    for k in range(lnav.WORDS):
        data = message >> lnav.DATA_BITS * (lnav.WORDS - 1 - k) & 0xFFFFFF
        if k in (1, 9):
            data = next(d for d in (data & ~0b11 | solved for solved in range(4)) if not lnav.parity(d, d29, d30) & 0b11)
        parity = lnav.parity(data, d29, d30)
        words.append((d29 ^ d30) << 31 | data << lnav.PARITY_BITS | parity ^ (0x3F if d30 else 0))
        d29, d30 = parity >> 1 & 1, parity & 1
    return tuple(words)


def inav_words(eph: KeplerEphemeris, klobuchar: Klobuchar, word_type: int, start_ns: int) -> tuple[int, ...]:
    """Eight words of a Galileo I/NAV page of E1-B that begins at the GPS time `start_ns`, a whole second.

    Word types 1 to 5 are the set; some programs, RTKLIB among them, wait for 0 (spare, with the time) and 6 (leap seconds) as well.
    Galileo sends parameters of another model of the ionosphere: they are zero here, and `klobuchar` is not used.
    ValueError for other word types and times, and for a value that the message has no room for.
    """
    if word_type not in range(7) or start_ns % NS_PER_S:
        raise ValueError(f"word type {word_type} at {start_ns} ns: expected type 0 to 6 at a whole second")
    layout, values = _inav_content(eph, word_type, start_ns)
    return page_words(layout.message({"word_type": word_type} | dict(values)))


def page_words(word: int) -> tuple[int, ...]:
    """Eight words of a page from the 128 bits of an I/NAV word: both parts, CRC added."""
    page = inav.PAGE.message({"data_1": word >> 16, "data_2": word & 0xFFFF, "odd": 1, "sar": NO_SAR})
    page |= inav.PAGE.message({"crc": inav.page_crc(page)})
    return tuple(page >> shift & 0xFFFFFFFF for shift in range(224, -1, -32))


def _inav_content(eph: KeplerEphemeris, word_type: int, start_ns: int) -> tuple[Layout, Mapping[str, float]]:
    """What follows the type of a word, and where."""
    time = {"week": (start_ns // WEEK_NS - inav.FIRST_WEEK) % 4096, "tow_s": start_ns // NS_PER_S % WEEK_S}
    if word_type == 0:
        return inav.WORD_0, {"time": 0b10} | time
    if word_type == 5:
        health = 0 if eph.healthy else GALILEO_UNHEALTHY
        return inav.WORD_5, {"e1b_health": health, "e5b_health": health} | time | _quantities(inav.WORD_5, eph)
    if word_type == 6:
        return inav.WORD_6, _leap_seconds(start_ns) | {"tow_s": time["tow_s"]}
    if word_type == 1:
        own: dict[str, float] = {"toe_60s": eph.toe_ns % WEEK_NS / (60 * NS_PER_S)}
    elif word_type == 2:
        own = {}
    elif word_type == 3:
        own = {"sisa_index": inav.SISA_NO_PROMISE if eph.accuracy_m is None else _index(inav.SISA_M, "accuracy_m", eph.accuracy_m)}
    else:
        own = {"satellite": int(eph.satellite[1:]), "toc_60s": eph.toc_ns % WEEK_NS / (60 * NS_PER_S)}
    layout = (inav.WORD_1, inav.WORD_2, inav.WORD_3, inav.WORD_4)[word_type - 1]
    return layout, {"issue": eph.issue} | own | _quantities(layout, eph)


def _leap_seconds(start_ns: int) -> dict[str, float]:
    """GST is GPS time here, and no leap second is announced: the next one "was" on the first day of this week, and changed nothing."""
    leap_s, week = leap_seconds_at_gps(start_ns), (start_ns // WEEK_NS - inav.FIRST_WEEK) % 256
    return {"leap_s": leap_s, "leap_then_s": leap_s, "reference_week": week, "leap_week": week, "leap_day": 1}
