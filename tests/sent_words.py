"""Navigation words of messages that the simulator does not send, written by the tables that read them, and sets that have been on the air.

Parity, CRC and check bits are made here by the definition, not by the code under test: polynomial division and the sums of the ICD.
"""

import math
from dataclasses import replace
from typing import Any

from integrity.gnss.crc import crc24q
from integrity.gnss.ephemeris.broadcast import Ephemeris, GlonassEphemeris, KeplerEphemeris
from integrity.gnss.gps_time import (
    BDT_BEHIND_GPS_NS,
    DAY_S,
    GLONASS_AHEAD_OF_UTC_NS,
    NS_PER_S,
    WEEK_NS,
    WEEK_S,
    gps_from_calendar,
    gps_from_week,
    utc_from_gps,
)
from integrity.gnss.navigation import beidou, fnav, glonass
from integrity.gnss.navigation.bits import Layout
from integrity.gnss.navigation.inav import FIRST_WEEK, SISA_M, SISA_NO_PROMISE
from integrity.gnss.navigation.lnav import URA_NO_PROMISE, URA_UPPER_M
from integrity.gnss.ubx.sfrbx import NavigationWords
from recordings.simulate.constellation import IONOSPHERE, constellation
from recordings.simulate.navigation_words import inav_words, lnav_words

START_NS = gps_from_week(2408, 259_200.0)  # a Wednesday, 0:00 GPS time
FRAME_NS = 30 * NS_PER_S

# BeiDou C01, subframe 1 of D2, pages 1 to 10 (the rest of a page is reserved), begun in second 345,600 of BDT week 810, in July 2021.
# Source: test data of GNSSTk (SGL-UT/gnsstk, core/tests/NewNav/D2NavTestDataDef.hpp).
D2_FILLING = (0x1555554B, 0x2AAAAAB4)
D2_ON_THE_AIR = {
    1: (0x38901541, 0x18004027, 0x00654A7C, 0x2303C840, 0x39B015EA),
    2: (0x38901541, 0x180C8114, 0x304FB0CA, 0x1CDC2F71, 0x380755B6),
    3: (0x38901541, 0x1818C079, 0x00000000, 0x000DC13C, 0x3C88153A),
    4: (0x38901541, 0x18250AEB, 0x0E4C00E9, 0x01F8D7D5, 0x373C55E4),
    5: (0x38901541, 0x18317E86, 0x31E9F0F9, 0x047BD7C7, 0x3C015552),
    6: (0x38901541, 0x183D90BD, 0x35CA72D3, 0x2EB5040A, 0x3FFE55F9),
    7: (0x38901541, 0x1849CEA7, 0x3002B543, 0x14600143, 0x304F55C6),
    8: (0x38901541, 0x185621FD, 0x301EAF12, 0x3C0CB863, 0x002515CC),
    9: (0x38901541, 0x18626153, 0x005173D2, 0x0146E114, 0x238B552F),
    10: (0x38901541, 0x186E8E6B, 0x08A8AA59, 0x2AAAAAB4, 0x2AAAAAB4),
}
D2_ON_THE_AIR_NS = gps_from_week(1356 + 810, 345_600.0) + BDT_BEHIND_GPS_NS
# GLONASS R01, strings 1 to 4 with check bits: frame of 2015-06-27, 3:40 Moscow time. Source: as above, GLOFNavTestDataDef.hpp.
GLONASS_ON_THE_AIR_NS = gps_from_calendar(2015, 6, 27, 0, 40, 16)
GLONASS_ON_THE_AIR = {
    1: (0x080E8452, 0x5A9449E9, 0x1B364800),
    2: (0x108F0186, 0xB0304527, 0xCD987800),
    3: (0x1C003435, 0xA6949646, 0x1DCBC800),
    4: (0x20500C09, 0x00000113, 0xE82AE800),
}


def d2_on_the_air(page: int) -> NavigationWords:
    words = D2_ON_THE_AIR[page]
    return NavigationWords("C01", "2I", words + (D2_FILLING[page == 10],) * 5)


def glonass_on_the_air(number: int) -> NavigationWords:
    return NavigationWords("R01", "1C", (*GLONASS_ON_THE_AIR[number], glonass_frame(GLONASS_ON_THE_AIR_NS)), 1)


def remainder(bits: int, length: int, polynomial: int) -> int:
    """Of bits as a polynomial over GF(2), first bit the highest power."""
    degree = polynomial.bit_length() - 1
    for bit in range(length - 1, degree - 1, -1):
        if bits >> bit & 1:
            bits ^= polynomial << bit - degree
    return bits


def bch(data: int) -> int:
    """Parity of 11 bits: BDS-SIS-ICD B1I 3.0, 5.1.3."""
    return remainder(data << 4, 15, 0b10011)


def beidou_words(subframe: int) -> tuple[int, ...]:
    """Ten words of the 224 bits of a subframe."""
    first = subframe >> 198
    words = [first << 4 | bch(first & 0x7FF)]
    for k in range(9):
        data = subframe >> 22 * (8 - k) & 0x3FFFFF
        words.append(data << 8 | bch(data >> 11) << 4 | bch(data & 0x7FF))
    return tuple(words)


def fnav_words(data: int) -> tuple[int, ...]:
    """Eight words of the 214 bits of a page."""
    page = (data << 24 | crc24q(data.to_bytes(27, "big"))) << 18
    return tuple(page >> shift & 0xFFFFFFFF for shift in range(224, -1, -32))


def _runs(length: int, *firsts: int) -> tuple[int, ...]:
    return tuple(bit for first in firsts for bit in range(first, first + length))


# Data bits that each check bit sums: GLONASS ICD 5.1, table 4.13.
_SUMS = (
    (9, 10, 12, 13, 15, 17, 19, 20, 22, 24, 26, 28, 30, 32, 34, *range(35, 66, 2), *range(66, 85, 2)),
    (9, *_runs(2, 11, 14, 18, 21, 25, 29, 33, 36, 40, 44, 48, 52, 56, 60, 64, 67, 71, 75, 79, 83)),
    (*_runs(3, 10), *_runs(4, 16, 23, 31, 38, 46, 54, 62, 69, 77), 85),
    (*_runs(7, 13), *_runs(8, 27, 42, 58, 73)),
    (*_runs(15, 20), *_runs(16, 50), *_runs(5, 81)),
    _runs(31, 35),
    _runs(20, 66),
)


def check_bits(string: int) -> int:
    """Bits 8 to 1 of a string, of its bits 85 to 9."""
    betas = [sum(string >> bit - 9 & 1 for bit in bits) & 1 for bits in _SUMS]
    total = (string.bit_count() + sum(betas)) & 1
    return total << 7 | sum(beta << i for i, beta in enumerate(betas))


def glonass_words(string: int, frame: int) -> tuple[int, ...]:
    """Four words of bits 85 to 9 of a string, and the frame as a receiver numbers it."""
    bits = (string << 8 | check_bits(string)) << 11
    return bits >> 64, bits >> 32 & 0xFFFFFFFF, bits & 0xFFFFFFFF, frame


def quantities(layout: Layout, eph: Ephemeris) -> dict[str, float]:
    return {name: getattr(eph, name) for name, field in layout.fields.items() if field.unit is not None}


def beidou_set(eph: KeplerEphemeris, **own: int) -> int:
    """All subframes or pages of a set one behind the other, as `beidou.D1` and `beidou.D2` have them, heads left out; `own` fields."""
    layout = beidou.LAYOUTS[eph.message]
    bdt_ns = eph.transmission_ns - BDT_BEHIND_GPS_NS
    values: dict[str, float] = {
        "sow": bdt_ns % WEEK_NS // NS_PER_S,
        "week": (bdt_ns // WEEK_NS - beidou.FIRST_WEEK) % 8192,
        "aode": eph.issue,
        "health": 0 if eph.healthy else 1,
        "ura_index": URA_NO_PROMISE if eph.accuracy_m is None else URA_UPPER_M.index(eph.accuracy_m),
        "toe_8s": (eph.toe_ns - BDT_BEHIND_GPS_NS) % WEEK_NS / (8 * NS_PER_S),
        "toc_8s": (eph.toc_ns - BDT_BEHIND_GPS_NS) % WEEK_NS / (8 * NS_PER_S),
    }
    return layout.message(quantities(layout, eph) | values | own)


def beidou_subframes(eph: KeplerEphemeris, bits: int) -> dict[int, int]:
    """The 224 bits of each subframe (D1) or page (D2) of a set, by number."""
    numbers = beidou.D1_SUBFRAMES if eph.message == "D1" else beidou.D2_PAGES
    step_s = beidou.D1_SUBFRAME_S if eph.message == "D1" else beidou.D2_PAGE_S
    begun_s = (eph.transmission_ns - BDT_BEHIND_GPS_NS) % WEEK_NS // NS_PER_S
    found = {}
    for k, number in enumerate(numbers):
        head: dict[str, float] = {"preamble": beidou.PREAMBLE, "sow": begun_s + step_s * (number - 1)}
        head |= {"subframe": number} if eph.message == "D1" else {"subframe": 1, "page": number}
        contents = bits >> 224 * (len(numbers) - 1 - k) & (1 << 224) - 1
        contents &= ~beidou.HEAD.mask("sow")
        found[number] = contents | beidou.HEAD.message(head)
    return found


def fnav_pages(eph: KeplerEphemeris) -> dict[int, int]:
    """The 214 bits of pages 1 to 4, 10 s each."""
    own: dict[int, dict[str, float]] = {
        1: {
            "satellite": int(eph.satellite[1:]),
            "toc_60s": eph.toc_ns % WEEK_NS / (60 * NS_PER_S),
            "sisa_index": SISA_NO_PROMISE if eph.accuracy_m is None else SISA_M.index(eph.accuracy_m),
            "e5a_health": 0 if eph.healthy else 1,
        },
        2: {},
        3: {"toe_60s": eph.toe_ns % WEEK_NS / (60 * NS_PER_S)},
        4: {},
    }
    found = {}
    for number, layout in fnav.PAGES.items():
        at_ns = eph.transmission_ns + 10 * NS_PER_S * (number - 1)
        head = {"page_type": number, "issue": eph.issue, "tow_s": at_ns // NS_PER_S % WEEK_S}
        if number != 4:
            head["week"] = at_ns // WEEK_NS - FIRST_WEEK
        found[number] = layout.message(quantities(layout, eph) | own[number] | head)
    return found


def glonass_frame(begun_ns: int) -> int:
    """Superframe and frame of the Moscow day, both from 1, as a receiver writes them."""
    frame = (utc_from_gps(begun_ns) + GLONASS_AHEAD_OF_UTC_NS) // NS_PER_S % DAY_S // 30
    return (frame // 5 + 1) << 16 | frame % 5 + 1


def glonass_strings(eph: GlonassEphemeris, **own: int) -> dict[int, int]:
    """Bits 85 to 9 of strings 1 to 4; `own` fields of string 4."""
    moscow_s = (utc_from_gps(eph.transmission_ns) + GLONASS_AHEAD_OF_UTC_NS) // NS_PER_S
    days, second = divmod(moscow_s, DAY_S)
    values: dict[int, dict[str, float]] = {
        1: {"t_k_h": second // 3600, "t_k_min": second // 60 % 60, "t_k_30s": second // 30 % 2},
        2: {"t_b_15min": eph.issue, "unhealthy": 0 if eph.healthy else 1},
        3: {},
        4: {
            "f_t_index": 15 if eph.accuracy_m is None else glonass.ACCURACY_M.index(eph.accuracy_m),
            "n_t_days": (days - glonass.FIRST_DAY) % 1461 + 1,
            "slot": int(eph.satellite[1:]),
            "m": 1,
        },
    }
    values[4] |= own
    return {
        number: layout.message({"string": number} | values[number] | quantities(layout, eph)) & (1 << 77) - 1
        for number, layout in glonass.STRINGS.items()
    }


def words_of(eph: Ephemeris, number: int, **own: int) -> NavigationWords:
    """A page of a set, as it was at the time of its transmission."""
    if isinstance(eph, GlonassEphemeris):
        frame = glonass_frame(eph.transmission_ns)
        return NavigationWords(eph.satellite, "1C", glonass_words(glonass_strings(eph, **own)[number], frame), eph.channel)
    assert isinstance(eph, KeplerEphemeris)
    if eph.message == "LNAV":
        sent = replace(eph, fit_half_s={5400.0: 7200.0, 7200.0: 10_800.0}[eph.fit_half_s]) if eph.satellite[0] == "J" else eph
        return NavigationWords(eph.satellite, "1C", lnav_words(sent, IONOSPHERE, number, eph.transmission_ns + 6 * NS_PER_S * (number - 1)))
    if eph.message == "INAV":
        return NavigationWords(eph.satellite, "1B", inav_words(eph, IONOSPHERE, number, eph.transmission_ns))
    if eph.message == "FNAV":
        return NavigationWords(eph.satellite, "5I", fnav_words(fnav_pages(eph)[number]))
    return NavigationWords(eph.satellite, "2I", beidou_words(beidou_subframes(eph, beidou_set(eph, **own))[number]))


PAGES = {"LNAV": (1, 2, 3), "INAV": (1, 2, 3, 4, 5), "FNAV": (1, 2, 3, 4), "D1": (1, 2, 3), "D2": (1, 3, 4, 5, 6, 7, 8, 9, 10)}


def page_numbers(eph: Ephemeris) -> tuple[int, ...]:
    """Of the pages that make up a set."""
    return PAGES[eph.message] if isinstance(eph, KeplerEphemeris) else (1, 2, 3, 4)


def examples() -> dict[str, Ephemeris]:
    """A set of each message, as its words have it: names as in `kinds`, and QZSS."""
    of = {eph.satellite[0]: replace(eph, transmission_ns=START_NS) for eph in constellation(5, START_NS, START_NS)}
    gps, galileo = of["G"], of["E"]
    assert isinstance(gps, KeplerEphemeris)
    on_bdt: dict[str, Any] = {
        "transmission_ns": START_NS + BDT_BEHIND_GPS_NS,
        "toe_ns": START_NS + 1800 * NS_PER_S + BDT_BEHIND_GPS_NS,
        "toc_ns": START_NS + 1800 * NS_PER_S + BDT_BEHIND_GPS_NS,
        "issue": 1,
        "fit_half_s": 7200.0,
        "group_delay_s": 38 * 1e-10,
        "group_delay_2_s": -14 * 1e-10,
        "af0": -1_537_805 * 2.0**-33,
        "af1": -13_003 * 2.0**-50,
        "af2": 3 * 2.0**-66,
    }
    one, two, three, four = (_string(number) for number in (1, 2, 3, 4))
    glo = glonass.ephemeris_of("R01", one, two, three, four, near_ns=GLONASS_ON_THE_AIR_NS)
    assert glo is not None
    toe_ns = START_NS + 900 * NS_PER_S + 18 * NS_PER_S  # 3:15 Moscow time
    return {
        "LNAV": gps,
        "QZSS": replace(gps, satellite="J02", sqrt_a=3_404_445_900 * 2.0**-19, e=640_810_000 * 2.0**-33, fit_half_s=5400.0),
        "INAV": galileo,
        "FNAV": replace(galileo, message="FNAV", group_delay_s=-7 * 2.0**-32, group_delay_2_s=None, accuracy_m=3.12),
        "D1": replace(gps, satellite="C21", message="D1", sqrt_a=2_769_608_000 * 2.0**-19, **on_bdt),
        "D2": replace(gps, satellite="C03", message="D2", sqrt_a=3_404_300_000 * 2.0**-19, i0=50_000_000 * math.pi * 2.0**-31, **on_bdt),
        "GLONASS": replace(glo, transmission_ns=START_NS + 18 * NS_PER_S, toe_ns=toe_ns, issue=13),
    }


def _string(number: int) -> int:
    said = glonass_on_the_air(number)
    string = glonass.string_of(said.words, said.channel)
    assert string is not None
    return string
