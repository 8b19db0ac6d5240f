"""Satellites and signals by name.

A satellite is `G05` (system letter and number, as in RINEX 3). A signal is satellite and RINEX 3 observation code: `G05.1C`.
"""

from functools import lru_cache

SYSTEMS = ("G", "E")  # in the order of their clocks in every solution: GPS, Galileo
SYSTEM_NAMES = {"G": "GPS", "E": "Galileo"}

# Civil L1 codes. One signal per satellite is used; of several that all receivers track, the first in this order.
L1_CODES = {"G": ("1C",), "E": ("1C", "1X", "1B")}


def satellite_of(signal: str) -> str:
    """`G05` of `G05.1C`."""
    return signal.partition(".")[0]


def system_index(satellite: str) -> int:
    """Place of the satellite's system in `SYSTEMS`."""
    return SYSTEMS.index(satellite[0])


@lru_cache(maxsize=1024)
def preference(signal: str) -> tuple[str, int, str]:
    """Sort key: satellites by name, of each satellite the preferred signal first."""
    satellite, _, code = signal.partition(".")
    codes = L1_CODES.get(satellite[:1], ())
    return satellite, codes.index(code) if code in codes else len(codes), code
