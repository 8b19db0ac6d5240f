"""Which satellite and signal the numbers in UBX messages mean, by RINEX 3 names.

Sources: u-blox F9 HPG 1.51 interface description, "GNSS identifiers", "Satellite numbering" and "Signal identifiers" (QZSS L1 C/B, sigId
12, is of later firmware); RINEX 3.05, tables 4 to 10, and for L1 C/B RINEX 4.01. NavIC (gnssId 7) is passed over.
"""

from functools import lru_cache
from typing import NamedTuple

from integrity.gnss.signals import Codes

SBAS_LESS, QZSS_LESS = 100, 192  # SBAS PRN 129 is `S29`, QZSS PRN 193 is `J01`


class SignalId(NamedTuple):
    """A signal of one system: satellites `first` to `last` as UBX numbers them, `less` more than RINEX does, and the RINEX code."""

    system: str
    first: int
    last: int
    less: int
    code: str


_SATELLITES = {  # by gnssId
    0: ("G", 1, 32, 0),
    1: ("S", 120, 158, SBAS_LESS),
    2: ("E", 1, 36, 0),
    3: ("C", 1, 63, 0),
    5: ("J", 1, 10, 0),
    6: ("R", 1, 32, 0),  # 255: heard, but not known which
}
_CODES = {  # by gnssId, then sigId
    0: {0: "1C", 3: "2L", 4: "2S", 6: "5I", 7: "5Q"},
    1: {0: "1C"},
    2: {0: "1C", 1: "1B", 3: "5I", 4: "5Q", 5: "7I", 6: "7Q", 8: "6B", 9: "6C", 10: "6A"},
    # D1 and D2, of which a satellite sends one, are messages on the same signal.
    3: {0: "2I", 1: "2I", 2: "7I", 3: "7I", 4: "6I", 10: "6I", 5: "1P", 6: "1D", 7: "5P", 8: "5D"},
    5: {0: "1C", 1: "1Z", 4: "2S", 5: "2L", 8: "5I", 9: "5Q", 12: "1E"},
    6: {0: "1C", 2: "2C"},
}
SIGNALS = {(gnss, sig): SignalId(*_SATELLITES[gnss], code) for gnss, codes in _CODES.items() for sig, code in codes.items()}
EVERY_CODE: Codes = {_SATELLITES[gnss][0]: tuple(dict.fromkeys(codes.values())) for gnss, codes in _CODES.items()}


@lru_cache(maxsize=4096)
def signal_of(gnss_id: int, sv_id: int, sig_id: int) -> str | None:
    """`G05.1C` of 0, 5, 0; None for what is no such satellite or signal."""
    known = SIGNALS.get((gnss_id, sig_id))
    if known is None or not known.first <= sv_id <= known.last:
        return None
    return f"{known.system}{sv_id - known.less:02d}.{known.code}"


def satellite_before_8(sv_id: int) -> str | None:
    """Satellite by the one number that generations before 8 use, of the systems that RXM-RAW and RXM-SFRB are of; None for others.

    Source: u-blox 6 protocol specification, "Satellite numbering".
    """
    if 1 <= sv_id <= 32:
        return f"G{sv_id:02d}"
    if 120 <= sv_id <= 158:
        return f"S{sv_id - SBAS_LESS:02d}"
    return f"J{sv_id - QZSS_LESS:02d}" if 193 <= sv_id <= 197 else None
