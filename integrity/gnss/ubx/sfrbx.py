"""RXM-SFRBX: the words of a navigation message as a satellite sent them.

Header of 8 bytes: gnssId, svId, sigId, freqId, numWords, channel, version, reserved; then numWords words (u4, little endian).
Sources: u-blox F9 HPG 1.51 interface description, UBX-RXM-SFRBX; u-blox F9 integration manual, "Broadcast navigation data"; u-blox 8 / M8
protocol specification.

Generation 8 keeps the sigId reserved (0) in every version of the message and tracks L1, E1, B1I and L1OF only. On generation 9 and later,
Galileo sigId 0 is E1-C, a pilot without a navigation message. So words of Galileo under sigId 0 can only be those of E1-B; and BeiDou's
under sigId 0 may be D1 or D2.
"""

import struct
from typing import NamedTuple

from integrity.gnss.ubx.identifiers import signal_of

RXM_SFRBX = (0x02, 0x13)
HEADER_BYTES = 8
LAST_VERSION = 2
GALILEO, GLONASS = 2, 6
E1_B = 1
FREQ_ID_LESS = 7  # freqId 0 to 13 is GLONASS channel -7 to 6

# Words of one subframe, page or string, by system and RINEX code: the signals with a message that we decode. Those with CNAV, such as L2C,
# L5, B1C and B2a, are not among them.
_WORDS = {
    **dict.fromkeys(("G1C", "J1C"), 10),  # LNAV
    **dict.fromkeys(("E1B", "E7I"), 8),  # I/NAV: even and odd part
    "E5I": 8,  # F/NAV
    **dict.fromkeys(("C2I", "C7I", "C6I"), 10),  # D1 or D2
    **dict.fromkeys(("R1C", "R2C"), 4),
    "S1C": 8,  # 250 bits, left-aligned
}


class NavigationWords(NamedTuple):
    """Words of one subframe, page or string: u32 as they stand in the message. Satellite such as `G05`; RINEX code such as `1C` or `7I`.

    `channel`: frequency number of GLONASS, -7 to 6; None for the others, and where it is out of range.
    """

    satellite: str
    signal: str
    words: tuple[int, ...]
    channel: int | None = None


def decode_sfrbx(payload: bytes) -> NavigationWords | None:
    """The words of a signal whose message we decode (or of SBAS); None for every other signal and for what is not a sound message."""
    if len(payload) < HEADER_BYTES:
        return None
    gnss_id, sv_id, sig_id, freq_id, n_words, _, version, _ = payload[:HEADER_BYTES]
    if version > LAST_VERSION or len(payload) != HEADER_BYTES + 4 * n_words:
        return None
    name = signal_of(gnss_id, sv_id, E1_B if gnss_id == GALILEO and sig_id == 0 else sig_id)
    if name is None:
        return None
    satellite, _, code = name.partition(".")
    if n_words != _WORDS.get(satellite[0] + code):
        return None
    channel = freq_id - FREQ_ID_LESS if gnss_id == GLONASS and freq_id <= 2 * FREQ_ID_LESS - 1 else None
    return NavigationWords(satellite, code, struct.unpack_from(f"<{n_words}I", payload, HEADER_BYTES), channel)
