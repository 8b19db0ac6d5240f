"""Galileo I/NAV of E1-B and E5b-I: word pages from the words of a receiver, and what stands in them.

RXM-SFRBX has a page in eight 32-bit numbers: the even part in the first four, the odd part in the others, 120 bits each, left-aligned.
E5b-I sends the same words; where E1-B has OSNMA, search and rescue, and a spare, it has a reserve, which the CRC covers as well.
Source: Galileo OS SIS ICD 2.1, 4.3.2 (pages and CRC), 4.3.4 and 4.3.5 (words), 5.1 (parameters).
"""

from functools import lru_cache

from integrity.gnss.atmosphere import GalileoIonosphere
from integrity.gnss.crc import crc24q
from integrity.gnss.ephemeris.broadcast import KeplerEphemeris
from integrity.gnss.gps_time import NS_PER_S, WEEK_NS, WEEK_S
from integrity.gnss.navigation.bits import HEARD_AT_ONCE, SEMICIRCLE_RAD, Field, Layout, Part, in_order, nearest_ns, plain, signed

FIRST_WEEK = 1024  # GPS week in which Galileo's weeks begin to count: 5.1.2
WEEKS_NS = 4096 * WEEK_NS  # the week has twelve bits
FIT_HALF_S = 14_400.0  # 5.1.9.2: a set serves for up to 4 h
SISA_NO_PROMISE = 255

# Signal-in-space accuracy: first index of a range, accuracy there and step in cm; from index 126 on spare. 5.1.11, table of SISA(E1,E5b).
SISA_RANGES_CM = ((0, 0, 1), (50, 50, 2), (75, 100, 4), (100, 200, 16))
SISA_END = 126
SISA_M = tuple(
    (value_cm + (index - first) * step_cm) / 100.0
    for (first, value_cm, step_cm), end in zip(SISA_RANGES_CM, (50, 75, 100, SISA_END), strict=True)
    for index in range(first, end)
)

# A page as RXM-SFRBX has it, both parts filled up to 128 bits.
PAGE = in_order(
    ("even", plain(1)),  # 0
    ("even_alert", plain(1)),
    ("data_1", plain(112)),
    ("even_tail", plain(6)),
    ("even_fill", plain(8)),
    ("odd", plain(1)),  # 1
    ("odd_alert", plain(1)),
    ("data_2", plain(16)),
    ("osnma", plain(40)),
    ("sar", plain(22)),
    ("spare", plain(2)),
    ("crc", plain(24)),
    ("ssp", plain(8)),
    ("odd_tail", plain(6)),
    ("odd_fill", plain(8)),
)
EVEN_PROTECTED, ODD_PROTECTED = 114, 82  # bits from the beginning of each part that the CRC covers: 4.3.2.3

_ANGLE, _ANGLE_RATE = SEMICIRCLE_RAD * 2.0**-31, SEMICIRCLE_RAD * 2.0**-43
WORD_1 = in_order(
    ("word_type", plain(6)),
    ("issue", plain(10)),
    ("toe_60s", plain(14)),
    ("m0", signed(32, _ANGLE)),
    ("e", plain(32, 2.0**-33)),
    ("sqrt_a", plain(32, 2.0**-19)),
    ("spare", plain(2)),
)
WORD_2 = in_order(
    ("word_type", plain(6)),
    ("issue", plain(10)),
    ("omega0", signed(32, _ANGLE)),
    ("i0", signed(32, _ANGLE)),
    ("omega", signed(32, _ANGLE)),
    ("i_dot", signed(14, _ANGLE_RATE)),
    ("spare", plain(2)),
)
WORD_3 = in_order(
    ("word_type", plain(6)),
    ("issue", plain(10)),
    ("omega_dot", signed(24, _ANGLE_RATE)),
    ("delta_n", signed(16, _ANGLE_RATE)),
    ("cuc", signed(16, 2.0**-29)),
    ("cus", signed(16, 2.0**-29)),
    ("crc", signed(16, 2.0**-5)),
    ("crs", signed(16, 2.0**-5)),
    ("sisa_index", plain(8)),
)
WORD_4 = in_order(
    ("word_type", plain(6)),
    ("issue", plain(10)),
    ("satellite", plain(6)),
    ("cic", signed(16, 2.0**-29)),
    ("cis", signed(16, 2.0**-29)),
    ("toc_60s", plain(14)),
    ("af0", signed(31, 2.0**-34)),
    ("af1", signed(21, 2.0**-46)),
    ("af2", signed(6, 2.0**-59)),
    ("spare", plain(2)),
)
WORD_5 = in_order(
    ("word_type", plain(6)),
    ("ionosphere", plain(41)),  # `NEQUICK`
    ("group_delay_2_s", signed(10, 2.0**-32)),  # BGD(E1,E5a)
    ("group_delay_s", signed(10, 2.0**-32)),  # BGD(E1,E5b)
    ("e5b_health", plain(2)),
    ("e1b_health", plain(2)),
    ("e5b_unsure", plain(1)),  # data validity status
    ("e1b_unsure", plain(1)),
    ("week", plain(12)),
    ("tow_s", plain(20)),
    ("spare", plain(23)),
)
WORD_6 = in_order(  # GST to UTC: only written
    ("word_type", plain(6)),
    ("a0", signed(32, 2.0**-30)),
    ("a1", signed(24, 2.0**-50)),
    ("leap_s", plain(8)),
    ("reference_tow_3600s", plain(8)),
    ("reference_week", plain(8)),
    ("leap_week", plain(8)),
    ("leap_day", plain(3)),
    ("leap_then_s", plain(8)),
    ("tow_s", plain(20)),
    ("spare", plain(3)),
)
WORD_0 = in_order(("word_type", plain(6)), ("time", plain(2)), ("spare", plain(88)), ("week", plain(12)), ("tow_s", plain(20)))
NEQUICK = in_order(
    ("word_type", plain(6)),
    ("ai0", plain(11, 2.0**-2)),
    ("ai1", signed(11, 2.0**-8)),
    ("ai2", signed(14, 2.0**-15)),
    ("disturbed", plain(5)),
    ("rest", plain(81)),
)
HEAD = Layout(128, {"word_type": Field((Part(0, 6),)), "issue": Field((Part(6, 10),))})


def page_crc(page: int) -> int:
    """The CRC that the bits of a page (256) should have."""
    even, odd = page >> 256 - EVEN_PROTECTED, page >> 128 - ODD_PROTECTED & (1 << ODD_PROTECTED) - 1
    return crc24q((even << ODD_PROTECTED | odd).to_bytes(25, "big"))


@lru_cache(maxsize=HEARD_AT_ONCE)
def word_of(words: tuple[int, ...]) -> int | None:
    """The 128 bits of an I/NAV word from eight words of RXM-SFRBX; None for an alert page and where parts, CRC or time cannot be right.

    Tails are not looked at: they only end the convolutional code, and a receiver may deliver a sound page with a damaged one.
    """
    if len(words) != 8:
        return None
    page = 0
    for word in words:
        page = page << 32 | word
    sound = (
        (PAGE.integer(page, "even"), PAGE.integer(page, "odd")) == (0, 1)
        and not PAGE.integer(page, "even_alert")
        and not PAGE.integer(page, "odd_alert")
        and PAGE.integer(page, "crc") == page_crc(page)
    )
    word = PAGE.integer(page, "data_1") << 16 | PAGE.integer(page, "data_2")
    beyond_week = HEAD.integer(word, "word_type") == 5 and WORD_5.integer(word, "tow_s") >= WEEK_S
    return word if sound and not beyond_week else None


def ephemeris_of(satellite: str, one: int, two: int, three: int, four: int, five: int, near_ns: int) -> KeplerEphemeris | None:
    """The set that words 1 to 5 make up; None where issues differ, word 4 names another satellite, or a reference time is beyond the week.

    `near_ns` is a GPS time within 2,048 weeks. Its transmission began with the page of word 5, the only one of them that carries a time.
    """
    issue = HEAD.integer(one, "issue")
    if any(HEAD.integer(word, "issue") != issue for word in (two, three, four)):
        return None
    if WORD_4.integer(four, "satellite") != int(satellite[1:]):
        return None
    week, tow_s = FIRST_WEEK + WORD_5.integer(five, "week"), WORD_5.integer(five, "tow_s")
    toe_s, toc_s = 60 * WORD_1.integer(one, "toe_60s"), 60 * WORD_4.integer(four, "toc_60s")
    if max(toe_s, toc_s) >= WEEK_S:
        return None
    transmission_ns = nearest_ns(week * WEEK_NS + tow_s * NS_PER_S, near_ns, WEEKS_NS)
    sisa_index = WORD_3.integer(three, "sisa_index")
    return KeplerEphemeris(
        satellite=satellite,
        message="INAV",
        issue=issue,
        healthy=WORD_5.integer(five, "e1b_health") == 0 and WORD_5.integer(five, "e1b_unsure") == 0,
        accuracy_m=SISA_M[sisa_index] if sisa_index < SISA_END else None,
        transmission_ns=transmission_ns,
        toe_ns=nearest_ns(toe_s * NS_PER_S, transmission_ns, WEEK_NS),
        toc_ns=nearest_ns(toc_s * NS_PER_S, transmission_ns, WEEK_NS),
        fit_half_s=FIT_HALF_S,
        **WORD_1.quantities(one),
        **WORD_2.quantities(two),
        **WORD_3.quantities(three),
        **WORD_4.quantities(four),
        **WORD_5.quantities(five),
    )


def nequick_of(five: int) -> GalileoIonosphere:
    """The ionosphere in word 5."""
    c = NEQUICK.quantities(five)
    return GalileoIonosphere(c["ai0"], c["ai1"], c["ai2"], NEQUICK.integer(five, "disturbed"))
