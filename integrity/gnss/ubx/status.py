"""What a receiver says of itself in NAV-PVT, NAV-STATUS, MON-RF, MON-HW, SEC-SIG and MON-VER.

Hearsay: it only explains. Bits that are not named here are passed over.
Sources: u-blox F9 HPG 1.51 interface description and u-blox 8 / M8 protocol specification, each under its message's name.
"""

import math
import struct
from collections.abc import Callable, Iterable
from enum import IntEnum
from typing import TypeVar

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

# Where the fields stand that are read.
_PVT = struct.Struct("<20xBB2xiii42xH")  # fixType, flags, lon and lat in 1e-7 deg, height in mm, flags3
_STATUS = struct.Struct("<4xBBxB")  # gpsFix, flags, flags2
_RF_HEADER_BYTES = 4
_RF_BLOCK = struct.Struct("<3B11xH8x")  # blockId, flags, antStatus, agcCnt
_HW = struct.Struct("<18xHBxB")  # agcCnt, aStatus, flags
_VERSIONS_BYTES, _EXTENSION_BYTES = 40, 30  # software and hardware, then whatever there is to say
_DEG, _MM = 1e7, 1e3

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
    status = decode(frame.payload) if fits(frame.payload) else None
    return None if status == ReceiverStatus() else status


def _nav_pvt(payload: bytes) -> ReceiverStatus | None:
    fix_type, flags, lon, lat, height_mm, flags3 = _PVT.unpack_from(payload)
    if fix_type > MOST_FIX_TYPE:
        return None
    fix_ok = flags & 1 != 0 and fix_type != 0
    lat_deg, lon_deg, height_m = lat / _DEG, lon / _DEG, height_mm / _MM
    in_range = abs(lat_deg) <= 90.0 and abs(lon_deg) <= 180.0 and LEAST_HEIGHT_M <= height_m <= MOST_HEIGHT_M
    invalid_llh = flags3 & 1 != 0
    if not (fix_ok and in_range and fix_type in FIX_TYPES_3D and not invalid_llh):
        return ReceiverStatus(fix_ok=fix_ok)
    return ReceiverStatus(fix_ok=fix_ok, lat_rad=math.radians(lat_deg), lon_rad=math.radians(lon_deg), height_m=height_m)


def _nav_status(payload: bytes) -> ReceiverStatus | None:
    gps_fix, flags, flags2 = _STATUS.unpack_from(payload)
    if gps_fix > MOST_FIX_TYPE:
        return None
    return ReceiverStatus(fix_ok=flags & 1 != 0 and gps_fix != 0, spoofing=_SPOOFING.get(flags2 >> 3 & 3))


def _mon_rf(payload: bytes) -> ReceiverStatus:
    blocks = list(_RF_BLOCK.iter_unpack(payload[_RF_HEADER_BYTES:]))
    agc = [_agc(count) for block_id, _, _, count in blocks if block_id == L1_BLOCK_ID]
    return ReceiverStatus(
        jamming=_worst(_JAMMING.get(flags & 3) for _, flags, _, _ in blocks),
        antenna=_worst(_ANTENNA.get(antenna) for _, _, antenna, _ in blocks),
        agc=agc[0] if agc else None,
    )


def _mon_hw(payload: bytes) -> ReceiverStatus:
    count, antenna, flags = _HW.unpack_from(payload)
    return ReceiverStatus(jamming=_JAMMING.get(flags >> 2 & 3), antenna=_ANTENNA.get(antenna), agc=_agc(count))


def _sec_sig(payload: bytes) -> ReceiverStatus:
    """Of each kind of detection whether it is on, and then its state: in version 2 one after the other in a byte."""
    jamming, spoofing = (payload[4], payload[8]) if payload[0] == 1 else (payload[1], payload[1] >> 3)
    return ReceiverStatus(
        jamming=_JAMMING.get(jamming >> 1 & 3) if jamming & 1 else None,
        spoofing=_SPOOFING.get(spoofing >> 1 & 7) if spoofing & 1 else None,
    )


def _mon_ver(payload: bytes) -> ReceiverStatus | None:
    extensions = (payload[at : at + _EXTENSION_BYTES] for at in range(_VERSIONS_BYTES, len(payload), _EXTENSION_BYTES))
    lines = [extension.split(b"\0")[0] for extension in extensions]
    if not all(line.isascii() for line in lines):
        return None
    said = dict(line.split("=", 1) for line in map(bytes.decode, lines) if line.isprintable() and "=" in line)
    return ReceiverStatus(model=" ".join(said[key].strip() for key in ("MOD", "FWVER") if key in said) or None)


def _agc(count: int) -> float | None:
    return count / MOST_AGC_COUNT if count <= MOST_AGC_COUNT else None


def _worst(words: Iterable[_Word | None]) -> _Word | None:
    return max((word for word in words if word is not None), default=None)


def _sec_sig_fits(payload: bytes) -> bool:
    """Version 1: 12 bytes. Version 2: 4 bytes and 4 for each frequency."""
    return (len(payload) == 12 and payload[0] == 1) or (len(payload) >= 4 and payload[0] == 2 and len(payload) == 4 + 4 * payload[3])


# Message: whether its length and version are as promised, and what it says.
_DECODERS: dict[tuple[int, int], tuple[Callable[[bytes], bool], Callable[[bytes], ReceiverStatus | None]]] = {
    NAV_PVT: (lambda p: len(p) in (84, 92), _nav_pvt),
    NAV_STATUS: (lambda p: len(p) == 16, _nav_status),
    MON_RF: (lambda p: len(p) >= _RF_HEADER_BYTES and p[0] == 0 and len(p) == _RF_HEADER_BYTES + _RF_BLOCK.size * p[1], _mon_rf),
    MON_HW: (lambda p: len(p) == 60, _mon_hw),
    SEC_SIG: (_sec_sig_fits, _sec_sig),
    MON_VER: (lambda p: len(p) >= _VERSIONS_BYTES and (len(p) - _VERSIONS_BYTES) % _EXTENSION_BYTES == 0, _mon_ver),
}
STATUS_MESSAGES = frozenset(_DECODERS)
