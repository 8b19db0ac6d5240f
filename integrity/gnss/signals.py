"""Satellites and signals by name.

A satellite is `G05` (system letter and number, as in RINEX 3). A signal is satellite and RINEX 3 observation code: `G05.1C`. The digit of
the code is the band: BeiDou's B1I is `2I`. A pair of signals of one satellite combined into one range is `G05.1C+2W`.
Sources: RINEX 3.05, tables 4 to 10; carrier frequencies as the interface documents of the systems have them.
"""

from collections.abc import Mapping
from functools import lru_cache

SYSTEM_NAMES = {"G": "GPS", "E": "Galileo", "C": "BeiDou", "R": "GLONASS", "J": "QZSS", "S": "SBAS"}
SYSTEMS = tuple(SYSTEM_NAMES)

# A solution has a clock for each of these, in this order. QZSS and SBAS keep GPS time, and receivers measure them like GPS. The second
# and the third generation of BeiDou keep one time, but receivers measure metres between them (4 m free of ionosphere in one make).
TIME_SCALES = ("GPS", "Galileo", "BeiDou-3", "BeiDou-2", "GLONASS")
_TIME_SCALE_OF = {"G": 0, "J": 0, "S": 0, "E": 1, "C": 2, "R": 4}
LAST_OF_BEIDOU_2 = 18  # BDS-SIS-ICD B1I 3.0, 4.3.2, and the constellation status of the China Satellite Navigation Office

Codes = Mapping[str, tuple[str, ...]]  # by system letter; of several that all receivers track, the first in this order

# Open signals that stand alone in a single-frequency solution: L1, E1, B1I (B3I of receivers that track B1C instead of it, whose group
# delay the older messages do not say), G1.
FIRST_CODES: Codes = {
    "G": ("1C",),
    "E": ("1C", "1X", "1B"),
    "C": ("2I", "6I"),
    "R": ("1C",),
    "J": ("1C",),
    "S": ("1C",),
}
# What decisions are made of unless a site says otherwise. GLONASS is not among them: receivers delay each of its channels differently, by
# metres that no message tells; nor are the ranges of SBAS satellites, which are worse than those of the others.
MONITORED_SYSTEMS = ("GPS", "Galileo", "BeiDou", "QZSS")
MONITORED_CODES: Codes = {system: FIRST_CODES[system] for system, name in SYSTEM_NAMES.items() if name in MONITORED_SYSTEMS}
# What they are combined with: L2 (open L2C before P(Y)), E5a or E5b, B3I or B2I, G2: signals whose group delay is broadcast.
SECOND_CODES: Codes = {
    "G": ("2L", "2X", "2S", "2W", "2C", "2P"),
    "E": ("5Q", "5X", "5I", "7Q", "7X", "7I"),
    "C": ("6I", "7I"),
    "R": ("2C", "2P"),
    "J": ("2L", "2X", "2S"),
}

L1_HZ = 1_575.42e6  # the frequency for which ionospheric models give their delay
BAND_HZ = {
    **dict.fromkeys(("G1", "E1", "J1", "S1", "C1"), L1_HZ),
    **dict.fromkeys(("G2", "J2"), 1_227.60e6),
    **dict.fromkeys(("G5", "E5", "J5", "S5", "C5"), 1_176.45e6),
    **dict.fromkeys(("E6", "J6"), 1_278.75e6),
    **dict.fromkeys(("E7", "C7"), 1_207.14e6),
    **dict.fromkeys(("E8", "C8"), 1_191.795e6),
    "C2": 1_561.098e6,
    "C6": 1_268.52e6,
    "R3": 1_202.025e6,
}
GLONASS_BAND_HZ = {"1": (1_602.0e6, 562.5e3), "2": (1_246.0e6, 437.5e3)}  # of channel 0, and between channels
GLONASS_CHANNELS = range(-7, 7)
BETWEEN_BANDS_HZ = 1.4e9  # satellite navigation has 1164 to 1300 MHz and 1559 to 1610 MHz: ITU Radio Regulations, article 5

# Bands in the order of the group delays of an ephemeris (`ephemeris.broadcast.group_delays_s`).
DELAY_BANDS = {"G": "12", "J": "12", "E": "175", "C": "276", "R": "12", "S": "1"}
UNKNOWN_BAND = -1


@lru_cache(maxsize=64)
def first_codes_of(systems: tuple[str, ...]) -> Codes:
    """`FIRST_CODES` of systems given by name."""
    return {system: FIRST_CODES[system] for system, name in SYSTEM_NAMES.items() if name in systems}


@lru_cache(maxsize=64)
def pair_codes_of(systems: tuple[str, ...]) -> Codes:
    """The codes that pairs are made of, `FIRST_CODES` and `SECOND_CODES`, of systems given by name that have both."""
    return {
        system: tuple(dict.fromkeys(FIRST_CODES[system] + SECOND_CODES[system]))
        for system, name in SYSTEM_NAMES.items()
        if name in systems and system in SECOND_CODES
    }


def satellite_of(signal: str) -> str:
    """`G05` of `G05.1C`."""
    return signal.partition(".")[0]


def time_scale_index(satellite: str) -> int:
    """Place of the satellite's clock in `TIME_SCALES`."""
    return _TIME_SCALE_OF[satellite[0]] + is_beidou_2(satellite)


def is_beidou_2(satellite: str) -> bool:
    """Whether it is one of BeiDou's second generation."""
    return satellite[0] == "C" and int(satellite[1:]) <= LAST_OF_BEIDOU_2


def bands_of(signal: str) -> tuple[str, ...]:
    """`("1",)` of `G05.1C`, `("1", "2")` of the pair `G05.1C+2W`."""
    return tuple(code[:1] for code in signal.partition(".")[2].split("+"))


def is_pair(signal: str) -> bool:
    """Whether it is two signals combined into one range."""
    return "+" in signal


def is_in_lower_band(signal: str) -> bool:
    """Whether a signal that stands alone is one of L2, L5, E5, E6, B2, B3, G2, G3: what disturbs them seldom disturbs those around L1."""
    carrier = carrier_hz(signal[:1], bands_of(signal)[0])
    return carrier is not None and carrier[0] < BETWEEN_BANDS_HZ


def delay_band(system: str, band: str) -> int:
    """Place of a band's group delay among those of an ephemeris of the system; UNKNOWN_BAND where its message has none."""
    return DELAY_BANDS.get(system, "").find(band)


def carrier_hz(system: str, band: str) -> tuple[float, float] | None:
    """Carrier frequency, of GLONASS that of channel 0, and how much higher each channel is (0 for all others); None for what is no band."""
    if system == "R" and band in GLONASS_BAND_HZ:
        return GLONASS_BAND_HZ[band]
    known_hz = BAND_HZ.get(system + band)
    return None if known_hz is None else (known_hz, 0.0)


def ionosphere_free_weights(system: str, first: str, second: str) -> tuple[float, float] | None:
    """By which the ranges of two bands add up to one free of ionosphere, to the first order; None where one is no band of the system.

    GLONASS: the channels' frequencies have one ratio, 9 to 7. Source: IS-GPS-200, 20.3.3.3.3.3.
    """
    carriers = carrier_hz(system, first), carrier_hz(system, second)
    if carriers[0] is None or carriers[1] is None or carriers[0] == carriers[1]:
        return None
    gamma = (carriers[0][0] / carriers[1][0]) ** 2
    return gamma / (gamma - 1.0), -1.0 / (gamma - 1.0)


@lru_cache(maxsize=4096)
def preference(signal: str) -> tuple[str, int, int, str]:
    """Sort key: satellites by name, of each satellite the signals of `FIRST_CODES` first, in that order; pairs by both their codes."""
    satellite, _, code = signal.partition(".")
    first, _, second = code.partition("+")
    return satellite, _place(first, FIRST_CODES.get(satellite[:1], ())), _place(second, SECOND_CODES.get(satellite[:1], ())), code


def _place(code: str, codes: tuple[str, ...]) -> int:
    return codes.index(code) if code in codes else len(codes)
