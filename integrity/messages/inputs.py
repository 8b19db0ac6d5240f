"""Events to messages and back, but for raw bytes, which are recorded as they came.

Decoding checks what the types cannot: lengths, names, finiteness of what must be finite.
"""

import math
import re

import numpy as np
from google.protobuf.message import DecodeError as ProtobufError
from google.protobuf.message import Message

from integrity.errors import DecodeError
from integrity.events import EphemerisReceived, Event, InputLost, IonosphereReceived, ObservationsReceived, Tick
from integrity.gnss.atmosphere import Klobuchar
from integrity.gnss.observations import ObservationRow
from integrity.messages import wayside_pb2 as pb
from integrity.messages.ephemerides import decode_ephemeris, encode_ephemeris

SIGNAL = re.compile(r"[A-Z]\d\d\.\d[A-Z]")


Recorded = InputLost | ObservationsReceived | EphemerisReceived | IonosphereReceived | Tick


def encode_event(event: Recorded) -> Message:
    """The message that records an event."""
    match event:
        case InputLost():
            return pb.InputLost(mono_ns=event.mono_ns, receiver=event.receiver, chunks=event.chunks)
        case ObservationsReceived():
            return encode_row(event.row, event.mono_ns)
        case EphemerisReceived():
            return encode_ephemeris(event.ephemeris, event.mono_ns)
        case IonosphereReceived():
            return encode_ionosphere(event.klobuchar, event.mono_ns)
        case Tick():
            return pb.Tick(mono_ns=event.mono_ns, utc_ns=event.utc_ns, utc_uncertainty_ns=event.utc_uncertainty_ns)


def decode_event(message: Message) -> Event:
    """The event that a message records; DecodeError where the message cannot be one."""
    if isinstance(message, pb.Observations):
        return ObservationsReceived(message.mono_ns, decode_row(message))
    if isinstance(message, pb.Ephemeris):
        return EphemerisReceived(message.mono_ns, decode_ephemeris(message))
    if isinstance(message, pb.Ionosphere):
        return IonosphereReceived(message.mono_ns, decode_ionosphere(message))
    if isinstance(message, pb.InputLost):
        return InputLost(message.mono_ns, message.receiver, message.chunks)
    if isinstance(message, pb.Tick):
        return decode_tick(message)
    raise DecodeError(f"{message.DESCRIPTOR.full_name} is not an input")


def decode_tick(message: pb.Tick) -> Tick:
    """Time that passed."""
    uncertainty_ns = message.utc_uncertainty_ns if message.HasField("utc_uncertainty_ns") else None
    return Tick(message.mono_ns, message.utc_ns, uncertainty_ns)


def parsed(message_type: type[Message], data: bytes) -> Message:
    """A message from its bytes; DecodeError where they are not one."""
    message = message_type()
    try:
        message.ParseFromString(data)
    except ProtobufError as error:
        raise DecodeError(f"{len(data)} bytes are not a {message_type.DESCRIPTOR.full_name}: {error}") from None
    return message


def encode_row(row: ObservationRow, mono_ns: int) -> pb.Observations:
    """One receiver's row."""
    return pb.Observations(
        receiver=row.receiver,
        mono_ns=mono_ns,
        receive_time_ns=row.receive_time_ns,
        signal=row.signals,
        pseudorange_m=row.pseudorange_m.tolist(),
        carrier_cycles=row.carrier_cycles.tolist(),
        doppler_hz=row.doppler_hz.tolist(),
        cn0_dbhz=row.cn0_dbhz.tolist(),
        lock_s=row.lock_s.tolist(),
        slip=row.slip.tolist(),
        half_cycle=row.half_cycle.tolist(),
    )


def decode_row(message: pb.Observations) -> ObservationRow:
    """One receiver's row; DecodeError where arrays and signals do not fit each other, or a signal is no name of one."""
    for signal in message.signal:
        if not SIGNAL.fullmatch(signal):
            raise DecodeError(f"observations of receiver {message.receiver!r}: {signal!r} is no signal; expected a name like G05.1C")
    try:
        return ObservationRow(
            message.receiver,
            message.receive_time_ns,
            tuple(message.signal),
            pseudorange_m=np.array(message.pseudorange_m, dtype=np.float64),
            carrier_cycles=np.array(message.carrier_cycles, dtype=np.float64),
            doppler_hz=np.array(message.doppler_hz, dtype=np.float64),
            cn0_dbhz=np.array(message.cn0_dbhz, dtype=np.float64),
            lock_s=np.array(message.lock_s, dtype=np.float64),
            slip=np.array(message.slip, dtype=np.bool_),
            half_cycle=np.array(message.half_cycle, dtype=np.bool_),
        )
    except ValueError as error:
        raise DecodeError(f"observations of receiver {message.receiver!r}: {error}") from None


def encode_ionosphere(klobuchar: Klobuchar, mono_ns: int) -> pb.Ionosphere:
    """Klobuchar's coefficients."""
    return pb.Ionosphere(mono_ns=mono_ns, alpha=klobuchar.alpha, beta=klobuchar.beta)


def decode_ionosphere(message: pb.Ionosphere) -> Klobuchar:
    """Klobuchar's coefficients; DecodeError unless four and four finite numbers."""
    alpha, beta = tuple(message.alpha), tuple(message.beta)
    if len(alpha) != 4 or len(beta) != 4 or not all(math.isfinite(x) for x in alpha + beta):
        raise DecodeError(f"ionosphere: expected four and four finite coefficients, found {alpha} and {beta}")
    return Klobuchar((alpha[0], alpha[1], alpha[2], alpha[3]), (beta[0], beta[1], beta[2], beta[3]))
