"""GLONASS L1OF and L2OF: strings from the words of a receiver, and what stands in strings 1 to 4, which are a set.

RXM-SFRBX has a string in three 32-bit numbers, bit 85 first, the rest filled up, then one with the numbers of superframe and frame, which
the receiver has worked out; zero where it could not. The frequency channel stands in the header.
Source: GLONASS ICD 5.1, 4.3 to 4.5 (strings: table 4.3; words: tables 4.5 and 4.6) and 4.7 (coding); u-blox F9 integration manual.
"""

from functools import lru_cache

from integrity.gnss.ephemeris.broadcast import GlonassEphemeris
from integrity.gnss.gps_time import DAY_S, GLONASS_AHEAD_OF_UTC_NS, NS_PER_S, days_from_civil, gps_from_utc, utc_from_gps
from integrity.gnss.navigation.bits import HEARD_AT_ONCE, Layout, in_order, nearest_ns, plain, sign_and_magnitude
from integrity.gnss.signals import GLONASS_CHANNELS

WORDS, STRING_BITS, CHECK_BITS, LAST_STRING = 4, 85, 8, 15
CHANNEL_LESS = 7  # channels are sent as 0 to 13
FIT_HALF_S = 1200.0  # t_b is the middle of half an hour as a rule, and some minutes go by until a new set has come: table 4.5, P1
QUARTER_S, QUARTERS_A_DAY = 900, 96
DAY_NS = DAY_S * NS_PER_S
DAYS_OF_4_YEARS = 1461
FIRST_DAY = days_from_civil(1996, 1, 1)  # N_T counts from the first day of a leap year

# F_T: accuracy of a range, m; 15 is not used. Table 4.4.
ACCURACY_M = (1.0, 2.0, 2.5, 4.0, 5.0, 7.0, 10.0, 12.0, 14.0, 16.0, 32.0, 64.0, 128.0, 256.0, 512.0)

_KM = 1000.0
_HEAD = (
    ("channel", plain(4)),
    ("frame", plain(32)),  # superframe and frame as the receiver numbers them
    ("idle", plain(1)),
    ("string", plain(4)),
)
HEAD = in_order(*_HEAD, ("rest", plain(72)))
STRING_1 = in_order(
    *_HEAD,
    ("reserved", plain(2)),
    ("p1", plain(2)),
    ("t_k_h", plain(5)),
    ("t_k_min", plain(6)),
    ("t_k_30s", plain(1)),
    ("vx_mps", sign_and_magnitude(24, _KM * 2.0**-20)),
    ("ax_mps2", sign_and_magnitude(5, _KM * 2.0**-30)),
    ("x_m", sign_and_magnitude(27, _KM * 2.0**-11)),
)
STRING_2 = in_order(
    *_HEAD,
    ("unhealthy", plain(1)),  # highest bit of B_n, the only one that users look at: 4.4
    ("b_n", plain(2)),
    ("p2", plain(1)),
    ("t_b_15min", plain(7)),
    ("reserved", plain(5)),
    ("vy_mps", sign_and_magnitude(24, _KM * 2.0**-20)),
    ("ay_mps2", sign_and_magnitude(5, _KM * 2.0**-30)),
    ("y_m", sign_and_magnitude(27, _KM * 2.0**-11)),
)
STRING_3 = in_order(
    *_HEAD,
    ("p3", plain(1)),
    ("gamma_n", sign_and_magnitude(11, 2.0**-40)),
    ("reserved", plain(1)),
    ("p", plain(2)),
    ("unhealthy", plain(1)),  # l_n
    ("vz_mps", sign_and_magnitude(24, _KM * 2.0**-20)),
    ("az_mps2", sign_and_magnitude(5, _KM * 2.0**-30)),
    ("z_m", sign_and_magnitude(27, _KM * 2.0**-11)),
)
STRING_4 = in_order(
    *_HEAD,
    ("tau_n_s", sign_and_magnitude(22, 2.0**-30)),
    ("delta_tau_n_s", sign_and_magnitude(5, 2.0**-30)),
    ("e_n_days", plain(5)),
    ("reserved", plain(14)),
    ("p4", plain(1)),
    ("f_t_index", plain(4)),
    ("reserved_2", plain(3)),
    ("n_t_days", plain(11)),
    ("slot", plain(5)),
    ("m", plain(2)),
)
STRINGS: dict[int, Layout] = {1: STRING_1, 2: STRING_2, 3: STRING_3, 4: STRING_4}

# The sums that must be even: bits 9 to 85 stand for the numbers from 3 to 84 that are no powers of two, bit i (1 to 7) for 2^(i - 1); sum i
# is of all whose number has that power in it. The eighth is of all bits. 4.7, tables 4.13 and 4.14.
_NUMBERS = {i + 1: 1 << i for i in range(CHECK_BITS - 1)} | dict(
    zip(range(9, STRING_BITS + 1), (n for n in range(3, 128) if n & n - 1), strict=False)
)
HAMMING_MASKS = (
    *(sum(1 << bit - 1 for bit, number in _NUMBERS.items() if number >> i & 1) for i in range(CHECK_BITS - 1)),
    (1 << STRING_BITS) - 1,
)


@lru_cache(maxsize=HEARD_AT_ONCE)
def string_of(words: tuple[int, ...], channel: int | None) -> int | None:
    """A string with its frame and channel in front (`HEAD`), its check bits taken out, from four words of RXM-SFRBX.

    None where the code, the idle bit or the number of the string is not right, and where frame or channel is not known. No error is
    corrected: with three wrong bits that would make a fourth.
    """
    if len(words) != WORDS or channel is None or channel not in GLONASS_CHANNELS:
        return None
    string = (words[0] << 64 | words[1] << 32 | words[2]) >> 96 - STRING_BITS
    if any((string & mask).bit_count() & 1 for mask in HAMMING_MASKS):
        return None
    frame_known = words[3] & 0xFF != 0  # its upper half, the superframe, may well be the first
    message = ((channel + CHANNEL_LESS) << 32 | words[3]) << STRING_BITS - CHECK_BITS | string >> CHECK_BITS
    sound = frame_known and not HEAD.integer(message, "idle") and 1 <= HEAD.integer(message, "string") <= LAST_STRING
    return message if sound else None


def string_number(message: int) -> int:
    """1 to 15."""
    return HEAD.integer(message, "string")


def frame_of(_number: int, message: int) -> int:
    """The frame that a string is of, and its channel: what the strings of a set have in common."""
    return message >> STRING_BITS - CHECK_BITS


def ephemeris_of(satellite: str, one: int, two: int, three: int, four: int, near_ns: int) -> GlonassEphemeris | None:
    """The set that strings 1 to 4 of one frame make up, transmitted when that began; `near_ns` is a GPS time within two years.

    None where frames differ, string 4 names another satellite (those before GLONASS-M named none), or a time cannot be. `issue` is t_b.
    """
    t_b, n_t_days = STRING_2.integer(two, "t_b_15min"), STRING_4.integer(four, "n_t_days")
    h, minutes = STRING_1.integer(one, "t_k_h"), STRING_1.integer(one, "t_k_min")
    of_one_frame = len({frame_of(number, string) for number, string in enumerate((one, two, three, four), 1)}) == 1
    if not of_one_frame or STRING_4.integer(four, "slot") != int(satellite[1:]):
        return None
    if h >= 24 or minutes >= 60 or t_b >= QUARTERS_A_DAY or not 1 <= n_t_days <= DAYS_OF_4_YEARS:
        return None
    # Moscow time on the Unix scale. A leap second is one of GLONASS time too: days are counted on that scale, then carried over to GPS's.
    near_moscow_ns = utc_from_gps(near_ns) + GLONASS_AHEAD_OF_UTC_NS
    t_k_ns = (FIRST_DAY + n_t_days - 1) * DAY_NS + (h * 3600 + minutes * 60 + STRING_1.integer(one, "t_k_30s") * 30) * NS_PER_S
    t_k_ns = nearest_ns(t_k_ns, near_moscow_ns, DAYS_OF_4_YEARS * DAY_NS)
    t_b_ns = nearest_ns(t_b * QUARTER_S * NS_PER_S, t_k_ns, DAY_NS)
    f_t_index = STRING_4.integer(four, "f_t_index")
    return GlonassEphemeris(
        satellite=satellite,
        channel=HEAD.integer(one, "channel") - CHANNEL_LESS,
        issue=t_b,
        healthy=not STRING_2.integer(two, "unhealthy") and not STRING_3.integer(three, "unhealthy"),
        accuracy_m=ACCURACY_M[f_t_index] if f_t_index < len(ACCURACY_M) else None,
        transmission_ns=gps_from_utc(t_k_ns - GLONASS_AHEAD_OF_UTC_NS),
        toe_ns=gps_from_utc(t_b_ns - GLONASS_AHEAD_OF_UTC_NS),
        fit_half_s=FIT_HALF_S,
        **STRING_1.quantities(one),
        **STRING_2.quantities(two),
        **STRING_3.quantities(three),
        **STRING_4.quantities(four),
    )
