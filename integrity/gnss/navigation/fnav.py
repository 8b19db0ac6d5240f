"""Galileo F/NAV of E5a-I: pages from the words of a receiver, and what stands in them.

RXM-SFRBX has a page in eight 32-bit numbers: 214 bits of data, the CRC, six bits of tail, the rest filled up. So measured on a receiver
of generation 9. Source: Galileo OS SIS ICD 2.1, 4.2 (pages and CRC: 4.2.2; contents: 4.2.3 and 4.2.4), 5.1 (parameters).
"""

from functools import lru_cache

from integrity.gnss.crc import crc24q
from integrity.gnss.ephemeris.broadcast import KeplerEphemeris
from integrity.gnss.gps_time import NS_PER_S, WEEK_NS, WEEK_S
from integrity.gnss.navigation.bits import HEARD_AT_ONCE, SEMICIRCLE_RAD, in_order, nearest_ns, plain, signed
from integrity.gnss.navigation.inav import FIRST_WEEK, FIT_HALF_S, SISA_END, SISA_M, WEEKS_NS

WORDS, DATA_BITS = 8, 214
PAGE = in_order(("data", plain(DATA_BITS)), ("crc", plain(24)), ("tail", plain(6)), ("fill", plain(12)))

_ANGLE, _ANGLE_RATE = SEMICIRCLE_RAD * 2.0**-31, SEMICIRCLE_RAD * 2.0**-43
PAGE_1 = in_order(
    ("page_type", plain(6)),
    ("satellite", plain(6)),
    ("issue", plain(10)),
    ("toc_60s", plain(14)),
    ("af0", signed(31, 2.0**-34)),
    ("af1", signed(21, 2.0**-46)),
    ("af2", signed(6, 2.0**-59)),
    ("sisa_index", plain(8)),
    ("ionosphere", plain(41)),  # as in word 5 of I/NAV
    ("group_delay_s", signed(10, 2.0**-32)),  # BGD(E1,E5a)
    ("e5a_health", plain(2)),
    ("week", plain(12)),
    ("tow_s", plain(20)),
    ("e5a_unsure", plain(1)),  # data validity status
    ("spare", plain(26)),
)
PAGE_2 = in_order(
    ("page_type", plain(6)),
    ("issue", plain(10)),
    ("m0", signed(32, _ANGLE)),
    ("omega_dot", signed(24, _ANGLE_RATE)),
    ("e", plain(32, 2.0**-33)),
    ("sqrt_a", plain(32, 2.0**-19)),
    ("omega0", signed(32, _ANGLE)),
    ("i_dot", signed(14, _ANGLE_RATE)),
    ("week", plain(12)),
    ("tow_s", plain(20)),
)
PAGE_3 = in_order(
    ("page_type", plain(6)),
    ("issue", plain(10)),
    ("i0", signed(32, _ANGLE)),
    ("omega", signed(32, _ANGLE)),
    ("delta_n", signed(16, _ANGLE_RATE)),
    ("cuc", signed(16, 2.0**-29)),
    ("cus", signed(16, 2.0**-29)),
    ("crc", signed(16, 2.0**-5)),
    ("crs", signed(16, 2.0**-5)),
    ("toe_60s", plain(14)),
    ("week", plain(12)),
    ("tow_s", plain(20)),
    ("spare", plain(8)),
)
PAGE_4 = in_order(
    ("page_type", plain(6)),
    ("issue", plain(10)),
    ("cic", signed(16, 2.0**-29)),
    ("cis", signed(16, 2.0**-29)),
    ("utc", plain(99)),
    ("gps_offset", plain(42)),
    ("tow_s", plain(20)),
    ("spare", plain(5)),
)
PAGES = {1: PAGE_1, 2: PAGE_2, 3: PAGE_3, 4: PAGE_4}


@lru_cache(maxsize=HEARD_AT_ONCE)
def page_of(words: tuple[int, ...]) -> int | None:
    """The 214 bits of data of a page from eight words of RXM-SFRBX; None where CRC or time cannot be right. Tail and filling are not
    looked at."""
    if len(words) != WORDS:
        return None
    page = 0
    for word in words:
        page = page << 32 | word
    data = PAGE.integer(page, "data")
    beyond_week = page_type(data) == 1 and PAGE_1.integer(data, "tow_s") >= WEEK_S
    return data if PAGE.integer(page, "crc") == crc24q(data.to_bytes(27, "big")) and not beyond_week else None


def page_type(page: int) -> int:
    """1 to 4 are a set, 5 and 6 the almanac."""
    return PAGE_1.integer(page, "page_type")


def issue_of(page_type: int, page: int) -> int:
    """IODnav of a page of a set."""
    return PAGES[page_type].integer(page, "issue")


def ephemeris_of(satellite: str, one: int, two: int, three: int, four: int, near_ns: int) -> KeplerEphemeris | None:
    """The set that pages 1 to 4 make up; None where issues differ, page 1 names another satellite, or a reference time is beyond the week.

    `near_ns` is a GPS time within 2,048 weeks. Its transmission began with page 1.
    """
    issue = PAGE_1.integer(one, "issue")
    if any(PAGES[number].integer(page, "issue") != issue for number, page in ((2, two), (3, three), (4, four))):
        return None
    if PAGE_1.integer(one, "satellite") != int(satellite[1:]):
        return None
    week, tow_s = FIRST_WEEK + PAGE_1.integer(one, "week"), PAGE_1.integer(one, "tow_s")
    toe_s, toc_s = 60 * PAGE_3.integer(three, "toe_60s"), 60 * PAGE_1.integer(one, "toc_60s")
    if max(toe_s, toc_s) >= WEEK_S:
        return None
    transmission_ns = nearest_ns(week * WEEK_NS + tow_s * NS_PER_S, near_ns, WEEKS_NS)
    sisa_index = PAGE_1.integer(one, "sisa_index")
    return KeplerEphemeris(
        satellite=satellite,
        message="FNAV",
        issue=issue,
        healthy=PAGE_1.integer(one, "e5a_health") == 0 and PAGE_1.integer(one, "e5a_unsure") == 0,
        accuracy_m=SISA_M[sisa_index] if sisa_index < SISA_END else None,
        transmission_ns=transmission_ns,
        toe_ns=nearest_ns(toe_s * NS_PER_S, transmission_ns, WEEK_NS),
        toc_ns=nearest_ns(toc_s * NS_PER_S, transmission_ns, WEEK_NS),
        fit_half_s=FIT_HALF_S,
        **PAGE_1.quantities(one),
        **PAGE_2.quantities(two),
        **PAGE_3.quantities(three),
        **PAGE_4.quantities(four),
    )
