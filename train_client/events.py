"""What goes into a `TrainLocaliser`, besides `RawBytes`, `InputLost` and `Tick` of `integrity.events`. `mono_ns` is the train's clock."""

from dataclasses import dataclass

from integrity.events import InputLost, RawBytes, Tick


@dataclass(frozen=True)
class HealthReceived:
    """Bytes that came as health at a key expression, whoever sent them."""

    mono_ns: int
    key_expr: str
    data: bytes


@dataclass(frozen=True)
class ChallengeSent:
    """The station was asked to sign 16 bytes that were drawn for it at random."""

    mono_ns: int
    site: str
    nonce: bytes


@dataclass(frozen=True)
class ChallengeAnswered:
    """What came back for a nonce: `data`, or the words of an `error`."""

    mono_ns: int
    site: str
    nonce: bytes
    data: bytes
    error: str = ""


@dataclass(frozen=True)
class StopReleased:
    """Somebody who may do so releases a stop that is latched."""

    mono_ns: int


TrainEvent = RawBytes | InputLost | Tick | HealthReceived | ChallengeSent | ChallengeAnswered | StopReleased
