"""The kinds of faults by name, and what they have in common. Each is a class: of satellites and what is between, or of receivers."""

from recordings.faults.receiver_kinds import (
    AntennaMoved,
    CorruptBytes,
    Delay,
    Jamming,
    Meaconing,
    Multipath,
    ReceiverBias,
    ReceiverClockJump,
    ReceiverDrop,
    ReceiverDuplicate,
    ReceiverFreeze,
    ReceiverNoise,
    ReceiverRamp,
    Spoofing,
    TwoReceivers,
)
from recordings.faults.satellite_kinds import (
    CodeBias,
    CodeCarrierDivergence,
    ConstellationClock,
    ConstellationFrame,
    IonoFront,
    LowPower,
    SatelliteAcceleration,
    SatelliteRamp,
    SatelliteStep,
    WrongEphemeris,
)

__all__ = [
    "KINDS",
    "AntennaEffect",
    "AntennaMoved",
    "CodeBias",
    "CodeCarrierDivergence",
    "ConstellationClock",
    "ConstellationFrame",
    "CorruptBytes",
    "Delay",
    "Effect",
    "IonoFront",
    "Jamming",
    "LinkEffect",
    "LowPower",
    "Meaconing",
    "Multipath",
    "RangeEffect",
    "ReceiverBias",
    "ReceiverClockJump",
    "ReceiverDrop",
    "ReceiverDuplicate",
    "ReceiverFreeze",
    "ReceiverNoise",
    "ReceiverRamp",
    "SatelliteAcceleration",
    "SatelliteRamp",
    "SatelliteStep",
    "SignalEffect",
    "Spoofing",
    "TwoReceivers",
    "WrongEphemeris",
    "receivers_of",
    "satellites_of",
]

SignalEffect = SatelliteStep | SatelliteRamp | SatelliteAcceleration | CodeBias | CodeCarrierDivergence | ConstellationClock | Multipath
AntennaEffect = ReceiverBias | ReceiverRamp | AntennaMoved | TwoReceivers | Spoofing | ConstellationFrame
RangeEffect = SignalEffect | AntennaEffect | IonoFront
LinkEffect = CorruptBytes | ReceiverDuplicate | Delay
Effect = (
    RangeEffect
    | WrongEphemeris
    | Meaconing
    | LowPower
    | Jamming
    | ReceiverNoise
    | ReceiverClockJump
    | ReceiverFreeze
    | ReceiverDrop
    | LinkEffect
)

_ALL: tuple[type[Effect], ...] = (
    SatelliteStep,
    SatelliteRamp,
    SatelliteAcceleration,
    CodeCarrierDivergence,
    CodeBias,
    LowPower,
    WrongEphemeris,
    ConstellationClock,
    ConstellationFrame,
    IonoFront,
    ReceiverBias,
    ReceiverRamp,
    ReceiverNoise,
    ReceiverFreeze,
    ReceiverDrop,
    ReceiverClockJump,
    ReceiverDuplicate,
    AntennaMoved,
    Multipath,
    TwoReceivers,
    Jamming,
    Spoofing,
    Meaconing,
    CorruptBytes,
    Delay,
)
KINDS: dict[str, type[Effect]] = {effect.kind: effect for effect in _ALL}


def receivers_of(effect: Effect) -> tuple[str, ...]:
    """The receivers on which a fault acts; none for those that act on all."""
    match effect:
        case TwoReceivers() | Spoofing() | Jamming():
            return effect.receivers
        case CodeBias():
            return effect.receivers or ()
        case Meaconing():
            return effect.to_receivers
        case ConstellationClock() | ConstellationFrame() | IonoFront():
            return ()
        case SatelliteStep() | SatelliteRamp() | SatelliteAcceleration() | CodeCarrierDivergence() | LowPower() | WrongEphemeris():
            return ()
        case _:
            return (effect.receiver,)


def satellites_of(effect: Effect) -> tuple[str, ...]:
    """The satellites that a fault names."""
    match effect:
        case SatelliteStep() | SatelliteRamp() | SatelliteAcceleration() | CodeCarrierDivergence() | LowPower() | WrongEphemeris():
            return (effect.satellite,)
        case CodeBias():
            return (effect.satellite,)
        case Multipath():
            return effect.satellites
        case _:
            return ()
