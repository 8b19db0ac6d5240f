"""What a receiver says of itself in NAV-PVT, NAV-STATUS, MON-RF, MON-HW, SEC-SIG and MON-VER, parsed by pyubx2.

Only here does Wayside decide with pyubx2's help: these messages come once a second at most and only explain. pyubx2 reads missing
bytes as zeros and may raise anything on damaged ones; so lengths and versions are checked before, and whatever it raises ends here.
Sources: u-blox F9 HPG 1.51 interface description and u-blox 8 / M8 protocol specification, each under its message's name.
"""

import math
from collections.abc import Callable, Iterable
from enum import IntEnum
from typing import Any, TypeVar

from pyubx2 import GET, UBXMessage

from integrity.gnss.receiver_status import Antenna, Jamming, ReceiverStatus, Spoofing
from integrity.gnss.ubx.framing import Frame

NAV_STATUS, NAV_PVT = (0x01, 0x03), (0x01, 0x07)
MON_VER, MON_HW, MON_RF = (0x0A, 0x04), (0x0A, 0x09), (0x0A, 0x38)
SEC_SIG = (0x27, 0x09)

MOST_FIX_TYPE = 5  # none, dead reckoning, 2-D, 3-D, 3-D with dead reckoning, time only
FIX_TYPES_3D = (3, 4)
LEAST_HEIGHT_M, MOST_HEIGHT_M = -1000.0, 80_000.0  # u-blox receivers give no fix above 80 km
MOST_AGC_COUNT = 8191
L1_BLOCK_ID = 0  # the other blocks are of L2 and L5

# 0 is: not known, or detection switched off.
_JAMMING = {1: Jamming.NONE_SEEN, 2: Jamming.WARNING, 3: Jamming.CRITICAL}
_SPOOFING = {1: Spoofing.NONE_SEEN, 2: Spoofing.INDICATED, 3: Spoofing.INDICATED_AGAIN}
_ANTENNA = {2: Antenna.IN_ORDER, 3: Antenna.SHORT_CIRCUIT, 4: Antenna.OPEN}  # 0 and 1: starting, not known
_Word = TypeVar("_Word", bound=IntEnum)


def decode_status(frame: Frame) -> ReceiverStatus | None:
    """What this frame says; None where it is no message of `STATUS_MESSAGES`, damaged, of an unknown version, or says nothing."""
    decoder = _DECODERS.get((frame.message_class, frame.message_id))
    if decoder is None:
        return None
    fits, decode = decoder
    if not fits(frame.payload):
        return None
    try:
        message = UBXMessage(bytes([frame.message_class]), bytes([frame.message_id]), GET, payload=frame.payload)
        status = decode(message)
    except Exception:  # whatever pyubx2 raises: the receiver has not said
        return None
    return status if status != ReceiverStatus() else None


def _nav_pvt(message: Any) -> ReceiverStatus | None:
    if message.fixType > MOST_FIX_TYPE:
        return None
    fix_ok = bool(message.gnssFixOk) and message.fixType != 0
    lat_deg, lon_deg, height_m = message.lat, message.lon, message.height / 1e3
    in_range = abs(lat_deg) <= 90.0 and abs(lon_deg) <= 180.0 and LEAST_HEIGHT_M <= height_m <= MOST_HEIGHT_M
    if not (fix_ok and in_range and message.fixType in FIX_TYPES_3D and not message.invalidLlh):
        return ReceiverStatus(fix_ok=fix_ok)
    return ReceiverStatus(fix_ok=fix_ok, lat_rad=math.radians(lat_deg), lon_rad=math.radians(lon_deg), height_m=height_m)


def _nav_status(message: Any) -> ReceiverStatus | None:
    if message.gpsFix > MOST_FIX_TYPE:
        return None
    return ReceiverStatus(fix_ok=bool(message.gpsFixOk) and message.gpsFix != 0, spoofing=_SPOOFING.get(message.spoofDetState))


def _mon_rf(message: Any) -> ReceiverStatus:
    blocks = [f"_{i:02d}" for i in range(1, message.nBlocks + 1)]
    agc = [_agc(getattr(message, f"agcCnt{b}")) for b in blocks if getattr(message, f"blockId{b}") == L1_BLOCK_ID]
    return ReceiverStatus(
        jamming=_worst(_JAMMING.get(getattr(message, f"jammingState{b}")) for b in blocks),
        antenna=_worst(_ANTENNA.get(getattr(message, f"antStatus{b}")) for b in blocks),
        agc=agc[0] if agc else None,
    )


def _mon_hw(message: Any) -> ReceiverStatus:
    return ReceiverStatus(jamming=_JAMMING.get(message.jammingState), antenna=_ANTENNA.get(message.aStatus), agc=_agc(message.agcCnt))


def _sec_sig(message: Any) -> ReceiverStatus:
    return ReceiverStatus(
        jamming=_JAMMING.get(message.jammingState) if message.jamDetEnabled else None,
        spoofing=_SPOOFING.get(message.spoofingState) if message.spfDetEnabled else None,
    )


def _mon_ver(message: Any) -> ReceiverStatus:
    count = (len(message.payload) - 40) // 30
    lines = [getattr(message, f"extension_{i:02d}").split(b"\0")[0].decode("ascii") for i in range(1, count + 1)]
    said = dict(line.split("=", 1) for line in lines if line.isprintable() and "=" in line)
    return ReceiverStatus(model=" ".join(said[key].strip() for key in ("MOD", "FWVER") if key in said) or None)


def _agc(count: int) -> float | None:
    return count / MOST_AGC_COUNT if count <= MOST_AGC_COUNT else None


def _worst(words: Iterable[_Word | None]) -> _Word | None:
    return max((word for word in words if word is not None), default=None)


def _sec_sig_fits(payload: bytes) -> bool:
    """Version 1: 12 bytes. Version 2: 4 bytes and 4 for each frequency."""
    return (len(payload) == 12 and payload[0] == 1) or (len(payload) >= 4 and payload[0] == 2 and len(payload) == 4 + 4 * payload[3])


# Message: whether its length and version are as promised, and what it says.
_DECODERS: dict[tuple[int, int], tuple[Callable[[bytes], bool], Callable[[Any], ReceiverStatus | None]]] = {
    NAV_PVT: (lambda p: len(p) in (84, 92), _nav_pvt),
    NAV_STATUS: (lambda p: len(p) == 16, _nav_status),
    MON_RF: (lambda p: len(p) >= 4 and p[0] == 0 and len(p) == 4 + 24 * p[1], _mon_rf),
    MON_HW: (lambda p: len(p) == 60, _mon_hw),
    SEC_SIG: (_sec_sig_fits, _sec_sig),
    MON_VER: (lambda p: len(p) >= 40 and (len(p) - 40) % 30 == 0, _mon_ver),
}
STATUS_MESSAGES = frozenset(_DECODERS)
