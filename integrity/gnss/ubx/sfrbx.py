"""RXM-SFRBX: the words of a navigation message as a satellite sent them.

Header of 8 bytes: gnssId, svId, sigId, freqId, numWords, channel, version, reserved; then numWords words (u4, little endian).
Sources: u-blox F9 HPG 1.51 interface description, UBX-RXM-SFRBX and "Signal identifiers"; u-blox 8 / M8 protocol specification.

Generation 8 keeps the sigId reserved (0) in every version of the message and tracks L1 and E1 only. On generation 9 and later, Galileo
sigId 0 is E1-C, a pilot without a navigation message. So words of Galileo under sigId 0 can only be those of E1-B.
"""

import struct
from typing import NamedTuple

RXM_SFRBX = (0x02, 0x13)
HEADER_BYTES = 8
LAST_VERSION = 2
GPS, GALILEO = 0, 2

# gnssId, sigId: system, number of its satellites, RINEX code, words of one subframe (GPS) or page (Galileo I/NAV, even and odd part)
_SIGNALS = {
    (GPS, 0): ("G", 32, "1C", 10),
    (GALILEO, 0): ("E", 36, "1B", 8),
    (GALILEO, 1): ("E", 36, "1B", 8),
    (GALILEO, 5): ("E", 36, "7I", 8),
}


class NavigationWords(NamedTuple):
    """Words of one subframe or page: u32 as they stand in the message. Satellite such as `G05`; RINEX code `1C`, `1B` or `7I`."""

    satellite: str
    signal: str
    words: tuple[int, ...]


def decode_sfrbx(payload: bytes) -> NavigationWords | None:
    """The words of GPS L1 C/A, Galileo E1-B or E5b-I; None for every other signal and for what is not a sound message."""
    if len(payload) < HEADER_BYTES:
        return None
    gnss_id, sv_id, sig_id, _, n_words, _, version, _ = payload[:HEADER_BYTES]
    if version > LAST_VERSION or len(payload) != HEADER_BYTES + 4 * n_words:
        return None
    known = _SIGNALS.get((gnss_id, sig_id))
    if known is None:
        return None
    system, satellites, signal, expected_words = known
    if not 1 <= sv_id <= satellites or n_words != expected_words:
        return None
    return NavigationWords(f"{system}{sv_id:02d}", signal, struct.unpack_from(f"<{n_words}I", payload, HEADER_BYTES))
