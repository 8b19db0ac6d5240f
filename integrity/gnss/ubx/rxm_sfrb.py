"""RXM-SFRB: the words of a navigation message from receivers of generations before 8, made into the words that RXM-SFRBX has.

Channel, satellite, then ten words (u4, little endian). Source: u-blox 6 protocol specification, RXM-SFRB.

GPS and QZSS: each word holds the 24 data bits, right as they stand, in its lower bits; above stands anything. The receiver has checked
the parity and left it out. It is computed again here, so that it guards nothing any more. (That words 2 and 10 end in two zeros, IS-GPS-200
20.3.3.2, is no check either: satellites without an upload are heard to break it.)

SBAS: the 250 bits of a message, 32 in each of seven words, the last 26 in the lower bits of the eighth; RXM-SFRBX has these in its
upper bits. The CRC is among them.
"""

import struct

from integrity.gnss.navigation.lnav import parity
from integrity.gnss.ubx.identifiers import satellite_before_8
from integrity.gnss.ubx.sfrbx import NavigationWords

RXM_SFRB = (0x02, 0x11)
PAYLOAD_BYTES = 42
SBAS_LAST_BITS = 26


def decode_sfrb(payload: bytes) -> NavigationWords | None:
    """The words of GPS, QZSS or SBAS L1 C/A; None for other satellites and for what is not a sound message. Nothing is raised."""
    if len(payload) != PAYLOAD_BYTES:
        return None
    satellite = satellite_before_8(payload[1])
    if satellite is None:
        return None
    words: tuple[int, ...] = struct.unpack_from("<10I", payload, 2)
    return NavigationWords(satellite, "1C", _sbas_words(words) if satellite[0] == "S" else _words_with_parity(words))


def _sbas_words(words: tuple[int, ...]) -> tuple[int, ...]:
    last = words[7] & (1 << SBAS_LAST_BITS) - 1
    return (*words[:7], last << 32 - SBAS_LAST_BITS)


def _words_with_parity(words: tuple[int, ...]) -> tuple[int, ...]:
    """D29* and D30* of the word before, 24 data bits, 6 bits of parity, all but the data inverted where D30* is one: `navigation.lnav`."""
    made = []
    d29 = d30 = 0  # a subframe ends in 00
    for word in words:
        data = word & 0xFFFFFF
        sent = parity(data, d29, d30)
        made.append((d29 ^ d30) << 31 | data << 6 | (sent ^ -d30) & 0x3F)
        d29, d30 = sent >> 1 & 1, sent & 1
    return tuple(made)
