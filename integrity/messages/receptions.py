"""What is remembered of receivers' bytes, and what they say of themselves, to messages and back."""

import math
from collections.abc import Sequence
from typing import Any

from integrity.errors import DecodeError
from integrity.gnss.navigation.collector import Page
from integrity.gnss.receiver_status import Antenna, Jamming, ReceiverStatus, Spoofing
from integrity.gnss.rtcm.decoder import RtcmDecoder, RtcmMemory
from integrity.gnss.rtcm.locks import SignalLock
from integrity.messages import wayside_pb2 as pb
from integrity.messages.ephemerides import decode_ephemeris, encode_ephemeris
from integrity.reception import ReceptionMemory

_PLAIN = ("model", "fix_ok", "lat_rad", "lon_rad", "height_m", "agc", "virtual")
_WORDS = {"jamming": Jamming, "spoofing": Spoofing, "antenna": Antenna}


def encode_reception(memory: ReceptionMemory) -> pb.ReceptionMemory:
    """One receiver's memory."""
    return pb.ReceptionMemory(
        receiver=memory.receiver,
        pending=memory.pending,
        pages=[pb.NavigationPage(satellite=p.satellite, number=p.number, data=p.data) for p in memory.pages],
        told=[encode_ephemeris(eph, 0) for eph in memory.told],
        last_row_ns=memory.last_row_ns,
        status_mono_ns={kind[0] << 8 | kind[1]: mono_ns for kind, mono_ns in memory.status_mono_ns},
        bad_frames=memory.bad_frames,
        skipped_bytes=memory.skipped_bytes,
        rtcm=None if memory.rtcm == RtcmMemory() else _encode_rtcm(memory.rtcm),
        since_mono_ns=memory.since_mono_ns,
        gps_ahead_ns=memory.gps_ahead_ns,
    )


def decode_reception(message: pb.ReceptionMemory) -> ReceptionMemory:
    """One receiver's memory."""
    return ReceptionMemory(
        message.receiver,
        pending=message.pending,
        pages=tuple(Page(p.satellite, p.number, p.data) for p in message.pages),
        told=tuple(decode_ephemeris(eph) for eph in message.told),
        last_row_ns=message.last_row_ns if message.HasField("last_row_ns") else None,
        status_mono_ns=tuple(sorted(((kind >> 8, kind & 255), mono_ns) for kind, mono_ns in message.status_mono_ns.items())),
        bad_frames=message.bad_frames,
        skipped_bytes=message.skipped_bytes,
        rtcm=_decode_rtcm(message.rtcm) if message.HasField("rtcm") else RtcmMemory(),
        since_mono_ns=message.since_mono_ns if message.HasField("since_mono_ns") else None,
        gps_ahead_ns=message.gps_ahead_ns if message.HasField("gps_ahead_ns") else None,
    )


def _encode_rtcm(memory: RtcmMemory) -> pb.RtcmMemory:
    signals, times_ns, locks_s = zip(*memory.locks, strict=True) if memory.locks else ((), (), ())
    return pb.RtcmMemory(
        near_ns=memory.near_ns,
        epoch_ns=memory.epoch_ns,
        open_messages=memory.open_messages,
        channels=dict(memory.channels),
        lock_signal=signals,
        lock_time_ns=times_ns,
        lock_s=locks_s,
        told=[encode_ephemeris(eph, 0) for eph in memory.told],
        refused=memory.refused,
        undated=memory.undated,
    )


def _decode_rtcm(message: pb.RtcmMemory) -> RtcmMemory:
    """DecodeError for what a decoder cannot have remembered."""
    lengths = (len(message.lock_signal), len(message.lock_time_ns), len(message.lock_s))
    if len(set(lengths)) > 1:
        raise DecodeError(f"snapshot: {lengths[0]} signals with {lengths[1]} times and {lengths[2]} locks: expected one each")
    memory = RtcmMemory(
        near_ns=message.near_ns if message.HasField("near_ns") else None,
        epoch_ns=message.epoch_ns if message.HasField("epoch_ns") else None,
        open_messages=tuple(message.open_messages),
        channels=tuple(sorted(message.channels.items())),
        locks=tuple(map(SignalLock, message.lock_signal, message.lock_time_ns, message.lock_s)),
        told=tuple(decode_ephemeris(eph) for eph in message.told),
        refused=message.refused,
        undated=message.undated,
    )
    RtcmDecoder("", memory)  # knows what it cannot have remembered
    return memory


def encode_status(status: ReceiverStatus) -> pb.ReceiverStatus:
    """What a receiver has said; what it has not said is absent."""
    said = {name: getattr(status, name) for name in (*_PLAIN, *_WORDS)}
    return pb.ReceiverStatus(**said, stated_ecef_m=status.stated_ecef_m or ())


def decode_status(message: pb.ReceiverStatus) -> ReceiverStatus:
    """What a receiver has said; DecodeError for a word that nobody knows."""
    said: dict[str, Any] = {name: getattr(message, name) for name in (*_PLAIN, *_WORDS) if message.HasField(name)}
    if message.stated_ecef_m:
        said["stated_ecef_m"] = _point(message.stated_ecef_m)
    try:
        return ReceiverStatus(**said | {name: word(said[name]) for name, word in _WORDS.items() if name in said})
    except ValueError as error:
        raise DecodeError(f"snapshot: status of a receiver: {error}") from None


def _point(coordinates: Sequence[float]) -> tuple[float, float, float]:
    if len(coordinates) != 3 or not all(math.isfinite(x) for x in coordinates):
        raise DecodeError(f"snapshot: a stated position is {list(coordinates)}: expected three finite numbers, ECEF metres")
    x_m, y_m, z_m = coordinates
    return x_m, y_m, z_m
