"""SBAS messages from the words that u-blox receivers pass on (RXM-SFRBX, RXM-SFRB: `integrity.gnss.ubx`), which have no time of their own.

A frame comes after the measurements of the second in which its last bit came; so it was sent in the second before that of the last
measurements. Measured by the preamble, whose three parts keep step with GPS time (RTCA DO-229D, A.4.3.3), on every frame of a receiver of
2008 (482) and of one of generation 9 (307).
"""

import struct

from integrity.gnss.gps_time import NS_PER_S, WEEK_NS
from integrity.gnss.sbas.messages import FRAME_BITS, SbasMessage, message_of
from integrity.gnss.ubx.rawx import RXM_RAWX
from integrity.gnss.ubx.rxm_raw import RXM_RAW
from integrity.gnss.ubx.sfrbx import NavigationWords

WORD_BITS = 32
SBAS_LESS = 100  # S29 is PRN 129
FIRST_WEEK = 1024  # before August 1999: the receiver does not know the time
EARLY_NS = 10_000_000  # measurements of a second may be taken that much before it


def measured_ns(message_class: int, message_id: int, payload: bytes) -> int | None:
    """GPS time of the measurements in RXM-RAW or RXM-RAWX; None for other messages, and where the receiver does not know the time."""
    kind = message_class, message_id
    if kind == RXM_RAW and len(payload) >= 8:
        tow_ms, week = struct.unpack_from("<ih", payload)
        tow_s = tow_ms / 1000
    elif kind == RXM_RAWX and len(payload) >= 16:
        tow_s, week = struct.unpack_from("<dH", payload)
    else:
        return None
    within = week >= FIRST_WEEK and 0.0 <= tow_s < WEEK_NS / NS_PER_S
    return week * WEEK_NS + round(tow_s * NS_PER_S) if within else None


def message_of_words(words: NavigationWords, last_measured_ns: int) -> SbasMessage | str:
    """The message in the eight words of a frame, left-aligned, that came after measurements of that time; or what is wrong with it."""
    frame = 0
    for word in words.words:
        frame = frame << WORD_BITS | word
    bits = message_of(frame >> WORD_BITS * len(words.words) - FRAME_BITS)
    if isinstance(bits, str):
        return bits
    received_ns = (last_measured_ns + EARLY_NS) // NS_PER_S * NS_PER_S
    return SbasMessage(int(words.satellite[1:]) + SBAS_LESS, received_ns - NS_PER_S, bits)
