"""What is remembered of receivers' bytes, and what they say of themselves, to messages and back."""

from typing import Any

from integrity.errors import DecodeError
from integrity.gnss.navigation.collector import Page
from integrity.gnss.receiver_status import Antenna, Jamming, ReceiverStatus, Spoofing
from integrity.messages import wayside_pb2 as pb
from integrity.messages.ephemerides import decode_ephemeris, encode_ephemeris
from integrity.reception import ReceptionMemory

_PLAIN = ("model", "fix_ok", "lat_rad", "lon_rad", "height_m", "agc")
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
    )


def encode_status(status: ReceiverStatus) -> pb.ReceiverStatus:
    """What a receiver has said; what it has not said is absent."""
    return pb.ReceiverStatus(**{name: getattr(status, name) for name in (*_PLAIN, *_WORDS)})


def decode_status(message: pb.ReceiverStatus) -> ReceiverStatus:
    """What a receiver has said; DecodeError for a word that nobody knows."""
    said: dict[str, Any] = {name: getattr(message, name) for name in (*_PLAIN, *_WORDS) if message.HasField(name)}
    try:
        return ReceiverStatus(**said | {name: word(said[name]) for name, word in _WORDS.items() if name in said})
    except ValueError as error:
        raise DecodeError(f"snapshot: status of a receiver: {error}") from None
