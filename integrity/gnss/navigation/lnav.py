"""LNAV of GPS and QZSS: subframes from the words of a receiver, and what stands in them.

RXM-SFRBX has one 32-bit number per word: D29* and D30* (the last bits of the word before), then the word's 30 bits, all of them inverted
where D30* is one, so that the data bits are right as they stand. Measured on receivers of generations 9 and 10: so in every word.
Source: IS-GPS-200, 20.3.3 (layout: figure 20-1; scales: tables 20-I, 20-III and 20-X) and 20.3.5.2 (parity). QZSS: IS-QZSS-PNT, 4.1, by
which subframes 1 to 3 differ in what the fit interval, the health and one value of the group delay mean.
"""

from functools import lru_cache

from integrity.gnss.atmosphere import Klobuchar
from integrity.gnss.ephemeris.broadcast import KeplerEphemeris
from integrity.gnss.gps_time import NS_PER_S, WEEK_NS, WEEK_S
from integrity.gnss.navigation.bits import HEARD_AT_ONCE, SEMICIRCLE_RAD, Field, Layout, Part, nearest_ns

SUBFRAME_S = 6
SUBFRAMES_A_WEEK = 100_800
PREAMBLE = 0x8B  # 20.3.3.1
WORDS, WORD_BITS, DATA_BITS, PARITY_BITS = 10, 30, 24, 6
WEEKS_NS = 1024 * WEEK_NS  # the week has ten bits
IONOSPHERE_PAGE = 56  # identity of page 18 of subframe 4: table 20-V
FIT_HALF_S = (7200.0, 10_800.0)  # by the fit interval flag, which says no more than 4 h or 6 h and above: 20.3.3.4.3.1
QZSS_FIT_HALF_S = (5400.0, 7200.0)  # 2 h, with half an hour for a new set to come, or more than 2 h
QZSS_OTHER_SIGNAL = 1  # bit of the health that is of L6 or L1 C/B only; set on sound satellites
QZSS_NO_GROUP_DELAY_S = -128 * 2.0**-31

# Upper bounds of the User Range Accuracy, index 0 to 14; index 15 promises nothing. 20.3.3.3.1.3.
URA_UPPER_M = (2.4, 3.4, 4.85, 6.85, 9.65, 13.65, 24.0, 48.0, 96.0, 192.0, 384.0, 768.0, 1536.0, 3072.0, 6144.0)
URA_NO_PROMISE = 15

# Data bits that each parity bit D25 to D30 sums, with the star bit of the word before (29 or 30). Table 20-XIV.
PARITY_EQUATIONS = (
    (29, (1, 2, 3, 5, 6, 10, 11, 12, 13, 14, 17, 18, 20, 23)),
    (30, (2, 3, 4, 6, 7, 11, 12, 13, 14, 15, 18, 19, 21, 24)),
    (29, (1, 3, 4, 5, 7, 8, 12, 13, 14, 15, 16, 19, 20, 22)),
    (30, (2, 4, 5, 6, 8, 9, 13, 14, 15, 16, 17, 20, 21, 23)),
    (30, (1, 3, 5, 6, 7, 9, 10, 14, 15, 16, 17, 18, 21, 22, 24)),
    (29, (3, 5, 6, 8, 9, 10, 11, 13, 15, 19, 22, 23, 24)),
)
# The same as masks over 26 bits: D29*, D30*, d1 to d24.
_PARITY_MASKS = tuple(sum((1 << 24 - bit for bit in data), 1 << 54 - star) for star, data in PARITY_EQUATIONS)


def _at(*places: tuple[int, int, int], unit: float | None = None, signed: bool = False) -> Field:
    """A field given as in the tables of IS-GPS-200: word from 1, bit in the word from 1, bits."""
    return Field(tuple(Part(DATA_BITS * (word - 1) + bit - 1, bits) for word, bit, bits in places), unit, signed)


def _angle(*places: tuple[int, int, int], exponent: int) -> Field:
    return _at(*places, unit=SEMICIRCLE_RAD * 2.0**exponent, signed=True)


# Of the 240 data bits, parity taken out. Names of quantities are those of `Ephemeris`; 24-bit pairs of words hold 32-bit values.
_HEAD = {
    "preamble": _at((1, 1, 8)),
    "next_tow_count": _at((2, 1, 17)),  # of the subframe that follows, in units of 6 s
    "alert": _at((2, 18, 1)),
    "subframe": _at((2, 20, 3)),
}
HEAD = Layout(240, _HEAD)
SUBFRAME_1 = Layout(
    240,
    _HEAD
    | {
        "week": _at((3, 1, 10)),
        "ura_index": _at((3, 13, 4)),
        "health": _at((3, 17, 6)),
        "iodc": _at((3, 23, 2), (8, 1, 8)),
        "group_delay_s": _at((7, 17, 8), unit=2.0**-31, signed=True),
        "toc_16s": _at((8, 9, 16)),
        "af2": _at((9, 1, 8), unit=2.0**-55, signed=True),
        "af1": _at((9, 9, 16), unit=2.0**-43, signed=True),
        "af0": _at((10, 1, 22), unit=2.0**-31, signed=True),
    },
)
SUBFRAME_2 = Layout(
    240,
    _HEAD
    | {
        "iode": _at((3, 1, 8)),
        "crs": _at((3, 9, 16), unit=2.0**-5, signed=True),
        "delta_n": _angle((4, 1, 16), exponent=-43),
        "m0": _angle((4, 17, 8), (5, 1, 24), exponent=-31),
        "cuc": _at((6, 1, 16), unit=2.0**-29, signed=True),
        "e": _at((6, 17, 8), (7, 1, 24), unit=2.0**-33),
        "cus": _at((8, 1, 16), unit=2.0**-29, signed=True),
        "sqrt_a": _at((8, 17, 8), (9, 1, 24), unit=2.0**-19),
        "toe_16s": _at((10, 1, 16)),
        "fit_flag": _at((10, 17, 1)),
    },
)
SUBFRAME_3 = Layout(
    240,
    _HEAD
    | {
        "cic": _at((3, 1, 16), unit=2.0**-29, signed=True),
        "omega0": _angle((3, 17, 8), (4, 1, 24), exponent=-31),
        "cis": _at((5, 1, 16), unit=2.0**-29, signed=True),
        "i0": _angle((5, 17, 8), (6, 1, 24), exponent=-31),
        "crc": _at((7, 1, 16), unit=2.0**-5, signed=True),
        "omega": _angle((7, 17, 8), (8, 1, 24), exponent=-31),
        "omega_dot": _angle((9, 1, 24), exponent=-43),
        "iode": _at((10, 1, 8)),
        "i_dot": _angle((10, 9, 14), exponent=-43),
    },
)
ALMANAC = Layout(240, _HEAD | {"data_id": _at((3, 1, 2)), "page_id": _at((3, 3, 6))})  # what the pages of subframes 4 and 5 share
IONOSPHERE = Layout(
    240,
    dict(ALMANAC.fields)
    | {
        "alpha0": _at((3, 9, 8), unit=2.0**-30, signed=True),
        "alpha1": _at((3, 17, 8), unit=2.0**-27, signed=True),
        "alpha2": _at((4, 1, 8), unit=2.0**-24, signed=True),
        "alpha3": _at((4, 9, 8), unit=2.0**-24, signed=True),
        "beta0": _at((4, 17, 8), unit=2.0**11, signed=True),
        "beta1": _at((5, 1, 8), unit=2.0**14, signed=True),
        "beta2": _at((5, 9, 8), unit=2.0**16, signed=True),
        "beta3": _at((5, 17, 8), unit=2.0**16, signed=True),
    },
)


def parity(data: int, d29: int, d30: int) -> int:
    """Parity bits D25 to D30 of 24 data bits after a word that ended in `d29`, `d30`. Source: IS-GPS-200, table 20-XIV."""
    bits = d29 << 25 | d30 << 24 | data
    sums = 0
    for mask in _PARITY_MASKS:
        sums = sums << 1 | (bits & mask).bit_count() & 1
    return sums


@lru_cache(maxsize=HEARD_AT_ONCE)
def subframe_of(words: tuple[int, ...]) -> int | None:
    """The 240 data bits of a subframe from ten words of RXM-SFRBX; None where parity, preamble, identity or time cannot be right."""
    if len(words) != WORDS:
        return None
    message = d29 = d30 = 0  # a subframe ends in 00: 20.3.5.2
    for word in words:
        data = word >> PARITY_BITS & 0xFFFFFF
        sent = (word ^ -d30) & 0x3F  # as on the air: inverted like the data
        if parity(data, d29, d30) != sent:
            return None
        d29, d30 = sent >> 1 & 1, sent & 1
        message = message << DATA_BITS | data
    sound = (
        HEAD.integer(message, "preamble") == PREAMBLE
        and 1 <= HEAD.integer(message, "subframe") <= 5
        and HEAD.integer(message, "next_tow_count") < SUBFRAMES_A_WEEK
    )
    return message if sound else None


def ephemeris_of(satellite: str, one: int, two: int, three: int, near_ns: int) -> KeplerEphemeris | None:
    """The set that subframes 1, 2 and 3 make up; None where their issues differ or a reference time is beyond the week.

    Its transmission began with subframe 1. `near_ns` is a GPS time within 512 weeks. Where a subframe raises the alert flag, no accuracy is
    promised (20.3.3.2). A set of QZSS that says no group delay is none: its clock serves no signal alone.
    """
    iodc, iode = SUBFRAME_1.integer(one, "iodc"), SUBFRAME_2.integer(two, "iode")
    if not iodc & 0xFF == iode == SUBFRAME_3.integer(three, "iode"):
        return None
    qzss, health = satellite[0] == "J", SUBFRAME_1.integer(one, "health")
    of_clock = SUBFRAME_1.quantities(one)
    if qzss and of_clock["group_delay_s"] == QZSS_NO_GROUP_DELAY_S:
        return None
    toe_s, toc_s = 16 * SUBFRAME_2.integer(two, "toe_16s"), 16 * SUBFRAME_1.integer(one, "toc_16s")
    if max(toe_s, toc_s) >= WEEK_S:
        return None
    tow_s = (HEAD.integer(one, "next_tow_count") - 1) % SUBFRAMES_A_WEEK * SUBFRAME_S
    transmission_ns = nearest_ns(SUBFRAME_1.integer(one, "week") * WEEK_NS + tow_s * NS_PER_S, near_ns, WEEKS_NS)
    ura_index = SUBFRAME_1.integer(one, "ura_index")
    promised = ura_index != URA_NO_PROMISE and not any(HEAD.integer(message, "alert") for message in (one, two, three))
    return KeplerEphemeris(
        satellite=satellite,
        message="LNAV",
        issue=iode,
        healthy=(health & ~QZSS_OTHER_SIGNAL if qzss else health) == 0,
        accuracy_m=URA_UPPER_M[ura_index] if promised else None,
        transmission_ns=transmission_ns,
        toe_ns=nearest_ns(toe_s * NS_PER_S, transmission_ns, WEEK_NS),
        toc_ns=nearest_ns(toc_s * NS_PER_S, transmission_ns, WEEK_NS),
        fit_half_s=(QZSS_FIT_HALF_S if qzss else FIT_HALF_S)[SUBFRAME_2.integer(two, "fit_flag")],
        **of_clock,
        **SUBFRAME_2.quantities(two),
        **SUBFRAME_3.quantities(three),
    )


def klobuchar_of(message: int) -> Klobuchar | None:
    """The ionosphere where a message is page 18 of subframe 4, else None. That of QZSS, made for Japan, stands there too."""
    if HEAD.integer(message, "subframe") != 4 or IONOSPHERE.integer(message, "page_id") != IONOSPHERE_PAGE:
        return None
    c = IONOSPHERE.quantities(message)
    return Klobuchar(
        alpha=(c["alpha0"], c["alpha1"], c["alpha2"], c["alpha3"]),
        beta=(c["beta0"], c["beta1"], c["beta2"], c["beta3"]),
    )
