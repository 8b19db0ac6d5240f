"""BeiDou D1 (medium and inclined orbits) and D2 (geostationary): subframes from the words of a receiver, and what stands in them.

RXM-SFRBX has one 32-bit number per word, the word in its lower 30 bits. The two codes of a word, which the satellite sends bit by bit in
turn, stand there one after the other: 11 bits of data of each, then 4 of parity of each. So measured on a receiver of generation 9.
Source: BDS-SIS-ICD B1I 3.0, 5.1.3 (coding), 5.2.3 and 5.2.4 (D1), 5.3.2 and 5.3.3 (D2); B3I carries the same messages.
"""

from collections.abc import Sequence
from functools import lru_cache

from integrity.gnss.atmosphere import Klobuchar
from integrity.gnss.ephemeris.broadcast import KeplerEphemeris, KeplerMessage
from integrity.gnss.gps_time import BDT_BEHIND_GPS_NS, NS_PER_S, WEEK_NS, WEEK_S
from integrity.gnss.navigation.bits import HEARD_AT_ONCE, SEMICIRCLE_RAD, Field, Layout, Part, in_order, nearest_ns, plain, signed
from integrity.gnss.navigation.lnav import URA_NO_PROMISE, URA_UPPER_M

WORDS, SUBFRAME_BITS = 10, 224  # 26 bits of data in the first word, 22 in the others
PREAMBLE = 0x712  # 5.2.4.1
FIRST_WEEK = 1356  # GPS week in which BeiDou's weeks begin to count: 3.3
WEEKS_NS = 8192 * WEEK_NS  # the week has thirteen bits
FIT_HALF_S = 7200.0  # sets are renewed every hour: 5.2.4.2
D1_SUBFRAMES, D1_SUBFRAME_S = (1, 2, 3), 6
D2_PAGES, D2_PAGE_S = (1, 3, 4, 5, 6, 7, 8, 9, 10), 3  # of subframe 1; page 2 holds the ionosphere
CODE, CODE_BITS = 0b10011, 15  # BCH(15,11,1): x^4 + x + 1

_ANGLE, _ANGLE_RATE = SEMICIRCLE_RAD * 2.0**-31, SEMICIRCLE_RAD * 2.0**-43
# Units and signs, 5.2.4.9 to 5.2.4.12: the same in D1 and D2.
_QUANTITIES: dict[str, tuple[float, bool]] = {
    "group_delay_s": (1e-10, True),  # TGD1
    "group_delay_2_s": (1e-10, True),  # TGD2
    "af0": (2.0**-33, True),
    "af1": (2.0**-50, True),
    "af2": (2.0**-66, True),
    "sqrt_a": (2.0**-19, False),
    "e": (2.0**-33, False),
    "delta_n": (_ANGLE_RATE, True),
    "omega_dot": (_ANGLE_RATE, True),
    "i_dot": (_ANGLE_RATE, True),
    **dict.fromkeys(("m0", "i0", "omega0", "omega"), (_ANGLE, True)),
    **dict.fromkeys(("cuc", "cus", "cic", "cis"), (2.0**-31, True)),
    **dict.fromkeys(("crc", "crs"), (2.0**-6, True)),
}
HEAD = in_order(
    ("preamble", plain(11)),
    ("reserved", plain(4)),
    ("subframe", plain(3)),
    ("sow", plain(20)),  # when this subframe begins, seconds of the week
    ("page", plain(4)),  # of D2 only
    ("rest", plain(182)),
)


def _set_layout(numbers: Sequence[int], places: dict[str, tuple[tuple[int, int, int], ...]]) -> Layout:
    """Of subframes (D1) or pages (D2) one behind the other; places are their number, the first bit of data, and how many."""
    fields = {
        name: Field(tuple(Part(SUBFRAME_BITS * numbers.index(number) + first, bits) for number, first, bits in parts), *_of(name))
        for name, parts in places.items()
    }
    return Layout(SUBFRAME_BITS * len(numbers), fields)


def _of(name: str) -> tuple[float | None, bool]:
    return _QUANTITIES.get(name, (None, False))


D1 = _set_layout(
    D1_SUBFRAMES,
    {
        "sow": ((1, 18, 20),),
        "health": ((1, 38, 1),),  # SatH1
        "aodc": ((1, 39, 5),),
        "ura_index": ((1, 44, 4),),
        "week": ((1, 48, 13),),
        "toc_8s": ((1, 61, 17),),
        "group_delay_s": ((1, 78, 10),),
        "group_delay_2_s": ((1, 88, 10),),
        "af2": ((1, 162, 11),),
        "af0": ((1, 173, 24),),
        "af1": ((1, 197, 22),),
        "aode": ((1, 219, 5),),
        "delta_n": ((2, 38, 16),),
        "cuc": ((2, 54, 18),),
        "m0": ((2, 72, 32),),
        "e": ((2, 104, 32),),
        "cus": ((2, 136, 18),),
        "crc": ((2, 154, 18),),
        "crs": ((2, 172, 18),),
        "sqrt_a": ((2, 190, 32),),
        "toe_8s": ((2, 222, 2), (3, 38, 15)),
        "i0": ((3, 53, 32),),
        "cic": ((3, 85, 18),),
        "omega_dot": ((3, 103, 24),),
        "cis": ((3, 127, 18),),
        "i_dot": ((3, 145, 14),),
        "omega0": ((3, 159, 32),),
        "omega": ((3, 191, 32),),
    },
)
D2 = _set_layout(
    D2_PAGES,
    {
        "sow": ((1, 18, 20),),
        "health": ((1, 42, 1),),
        "aodc": ((1, 43, 5),),
        "ura_index": ((1, 48, 4),),
        "week": ((1, 52, 13),),
        "toc_8s": ((1, 65, 17),),
        "group_delay_s": ((1, 82, 10),),
        "group_delay_2_s": ((1, 92, 10),),
        "af0": ((3, 80, 24),),
        "af1": ((3, 104, 4), (4, 42, 18)),
        "af2": ((4, 60, 11),),
        "aode": ((4, 71, 5),),
        "delta_n": ((4, 76, 16),),
        "cuc": ((4, 92, 14), (5, 42, 4)),
        "m0": ((5, 46, 32),),
        "cus": ((5, 78, 18),),
        "e": ((5, 96, 10), (6, 42, 22)),
        "sqrt_a": ((6, 64, 32),),
        "cic": ((6, 96, 10), (7, 42, 8)),
        "cis": ((7, 50, 18),),
        "toe_8s": ((7, 68, 17),),
        "i0": ((7, 85, 21), (8, 42, 11)),
        "crc": ((8, 53, 18),),
        "crs": ((8, 71, 18),),
        "omega_dot": ((8, 89, 19), (9, 42, 5)),
        "omega0": ((9, 47, 32),),
        "omega": ((9, 79, 27), (10, 42, 5)),
        "i_dot": ((10, 47, 14),),
    },
)
LAYOUTS: dict[KeplerMessage, Layout] = {"D1": D1, "D2": D2}

# In subframe 1 of D1 from bit 98 on, in page 2 of D2 from bit 42 on.
IONOSPHERE = in_order(
    *((f"alpha{k}", signed(8, 2.0**exponent)) for k, exponent in enumerate((-30, -27, -24, -24))),
    *((f"beta{k}", signed(8, 2.0**exponent)) for k, exponent in enumerate((11, 14, 16, 16))),
)
D1_IONOSPHERE_AT, D2_IONOSPHERE_AT, D2_IONOSPHERE_PAGE = 98, 42, 2


def parity(data: int) -> int:
    """The four parity bits of 11 bits of data."""
    remainder = data << 4
    for bit in range(CODE_BITS - 1, 3, -1):
        if remainder >> bit & 1:
            remainder ^= CODE << bit - 4
    return remainder


_PARITY = tuple(parity(data) for data in range(1 << 11))


@lru_cache(maxsize=HEARD_AT_ONCE)
def subframe_of(words: tuple[int, ...]) -> int | None:
    """The 224 bits of data of a subframe from ten words of RXM-SFRBX; None where parity, preamble, number or time cannot be right.

    No error is corrected: with two wrong bits in one code that would make a third. The first 15 bits, preamble and reserve, have no parity.
    """
    if len(words) != WORDS:
        return None
    if _PARITY[words[0] >> 4 & 0x7FF] != words[0] & 0xF:
        return None
    message = words[0] >> 4 & 0x3FFFFFF
    for word in words[1:]:
        if _PARITY[word >> 19 & 0x7FF] != word >> 4 & 0xF or _PARITY[word >> 8 & 0x7FF] != word & 0xF:
            return None
        message = message << 22 | word >> 8 & 0x3FFFFF
    sound = (
        HEAD.integer(message, "preamble") == PREAMBLE
        and 1 <= HEAD.integer(message, "subframe") <= 5
        and HEAD.integer(message, "sow") < WEEK_S
    )
    return message if sound else None


def d2_page(subframe: int) -> int:
    """Number of the page where this is subframe 1 of D2, else 0."""
    return HEAD.integer(subframe, "page") if HEAD.integer(subframe, "subframe") == 1 else 0


def d1_frame(number: int, subframe: int) -> int:
    """When the frame of a subframe of D1 began, seconds of the week."""
    return HEAD.integer(subframe, "sow") - D1_SUBFRAME_S * (number - 1)


def d2_cycle(page: int, subframe: int) -> int:
    """When page 1 before a page of D2 began, seconds of the week."""
    return HEAD.integer(subframe, "sow") - D2_PAGE_S * (page - 1)


def d1_ephemeris_of(satellite: str, subframes: Sequence[int], near_ns: int) -> KeplerEphemeris | None:
    """The set that subframes 1 to 3 make up; None where they are not of one frame. See `_ephemeris_of`."""
    frames = {d1_frame(number, subframe) for number, subframe in zip(D1_SUBFRAMES, subframes, strict=True)}
    return _ephemeris_of(satellite, "D1", subframes, near_ns) if len(frames) == 1 else None


def d2_ephemeris_of(satellite: str, pages: Sequence[int], near_ns: int) -> KeplerEphemeris | None:
    """The set that pages 1 and 3 to 10 make up; None where they are not of one cycle. See `_ephemeris_of`."""
    cycles = {d2_cycle(number, page) for number, page in zip(D2_PAGES, pages, strict=True)}
    return _ephemeris_of(satellite, "D2", pages, near_ns) if len(cycles) == 1 else None


def _ephemeris_of(satellite: str, message: KeplerMessage, subframes: Sequence[int], near_ns: int) -> KeplerEphemeris | None:
    """Its transmission began with the first subframe; `near_ns` is a GPS time within 4,096 weeks. None where a reference time
    is beyond the week.

    No issue binds the pages of BeiDou, which is why they must be of one frame: sets change between frames only (5.2.4.2). `issue` is AODE,
    as in RINEX and RTCM 3; it says how old the data behind the orbit were, and is often the same in sets that follow each other.
    """
    layout = LAYOUTS[message]
    bits = 0
    for subframe in subframes:
        bits = bits << SUBFRAME_BITS | subframe
    toe_s, toc_s = 8 * layout.integer(bits, "toe_8s"), 8 * layout.integer(bits, "toc_8s")
    if max(toe_s, toc_s) >= WEEK_S:
        return None
    begun_ns = layout.integer(bits, "sow") * NS_PER_S + BDT_BEHIND_GPS_NS
    transmission_ns = nearest_ns((FIRST_WEEK + layout.integer(bits, "week")) * WEEK_NS + begun_ns, near_ns, WEEKS_NS)
    ura_index = layout.integer(bits, "ura_index")

    return KeplerEphemeris(
        satellite=satellite,
        message=message,
        issue=layout.integer(bits, "aode"),
        healthy=layout.integer(bits, "health") == 0,
        accuracy_m=None if ura_index == URA_NO_PROMISE else URA_UPPER_M[ura_index],
        transmission_ns=transmission_ns,
        toe_ns=nearest_ns(toe_s * NS_PER_S + BDT_BEHIND_GPS_NS, transmission_ns, WEEK_NS),
        toc_ns=nearest_ns(toc_s * NS_PER_S + BDT_BEHIND_GPS_NS, transmission_ns, WEEK_NS),
        fit_half_s=FIT_HALF_S,
        **layout.quantities(bits),
    )


def klobuchar_of(subframe: int, first: int) -> Klobuchar:
    """BeiDou's own ionosphere from `D1_IONOSPHERE_AT` of subframe 1 or `D2_IONOSPHERE_AT` of page 2.

    Nobody is told of it: its model (geographic latitude, 5.2.4.7) is not the one of GPS, whose coefficients are used for all systems.
    """
    c = IONOSPHERE.quantities(subframe >> SUBFRAME_BITS - first - IONOSPHERE.bits & (1 << IONOSPHERE.bits) - 1)
    return Klobuchar(
        alpha=(c["alpha0"], c["alpha1"], c["alpha2"], c["alpha3"]),
        beta=(c["beta0"], c["beta1"], c["beta2"], c["beta3"]),
    )
