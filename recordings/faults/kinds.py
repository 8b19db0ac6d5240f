"""The kinds of faults, one class each: its parameters as they stand in a `[[fault]]` table, and what each of them expects.

A parameter that would make the fault do nothing (a step of 0 m) is refused: an injection that does nothing proves nothing.
"""

import math
from typing import Annotated, ClassVar, Literal

from pydantic import AfterValidator, Field, model_validator

from recordings.site_checks import RADIUS_RANGE_M
from recordings.site_schema import Section

EnuM = tuple[float, float, float]
EAST: EnuM = (1.0, 0.0, 0.0)


def _something(value: float) -> float:
    if value == 0.0:
        raise ValueError("0 does nothing")
    return value


def _some_direction(vector: EnuM) -> EnuM:
    if not any(vector):
        raise ValueError("[0, 0, 0] does nothing")
    return vector


def _near_the_ground(point: EnuM | None) -> EnuM | None:
    if point is not None and not RADIUS_RANGE_M[0] <= math.hypot(*point) <= RADIUS_RANGE_M[1]:
        raise ValueError("off the Earth's surface")
    return point


Satellite = Annotated[
    str,
    Field(pattern="^(G(0[1-9]|[12][0-9]|3[0-2])|E(0[1-9]|[12][0-9]|3[0-6]))$", description='a satellite, "G01" to "G32" or "E01" to "E36"'),
]
Receiver = Annotated[str, Field(description='the name of one of the site\'s receivers, such as "A"')]
Receivers = Annotated[tuple[str, ...], Field(strict=False, min_length=1, description='a list of the site\'s receivers, such as ["A", "B"]')]
SizeM = Annotated[float, Field(ge=-1e6, le=1e6, description="metres, not 0, at most 1000000"), AfterValidator(_something)]
RateMps = Annotated[float, Field(ge=-1e4, le=1e4, description="metres per second, not 0, at most 10000"), AfterValidator(_something)]
Enu = Annotated[
    EnuM,
    Field(strict=False, description="[east, north, up] in metres at the receiver's surveyed point, not all 0"),
    AfterValidator(_some_direction),
]
RateEnu = Annotated[
    EnuM | None, Field(strict=False, description="[east, north, up] in metres per second at the receiver's surveyed point, not all 0")
]
Direction = Annotated[EnuM | None, Field(strict=False, description="[east, north, up], a direction of any length but 0")]
Ecef = Annotated[
    EnuM | None,
    Field(strict=False, description="a point on the Earth's surface, [x, y, z] in metres"),
    AfterValidator(_near_the_ground),
]


class SatelliteStep(Section):
    """The range to a satellite is longer by `size_m`, for all receivers alike, on code and carrier."""

    kind: ClassVar = "satellite_step"
    satellite: Satellite
    size_m: SizeM


class SatelliteRamp(Section):
    """The range to a satellite grows by `rate_mps` more than it should, for all receivers alike, on code, carrier and Doppler."""

    kind: ClassVar = "satellite_ramp"
    satellite: Satellite
    rate_mps: RateMps


class WrongEphemeris(Section):
    """A satellite broadcasts an orbit that is displaced by `offset_m`; its ranges are as they were."""

    kind: ClassVar = "wrong_ephemeris"
    satellite: Satellite
    offset_m: SizeM
    direction: Annotated[Literal["along", "cross", "radial"], Field(description='"along", "cross" or "radial"')]


class ReceiverBias(Section):
    """All ranges of a receiver are as if its antenna stood elsewhere."""

    kind: ClassVar = "receiver_bias"
    receiver: Receiver
    offset_enu_m: Enu


class ReceiverRamp(Section):
    """All ranges of a receiver are as if its antenna moved away from its point, at `rate_enu_mps`, or `rate_mps` in a direction."""

    kind: ClassVar = "receiver_ramp"
    receiver: Receiver
    rate_enu_mps: RateEnu = None
    rate_mps: Annotated[float | None, Field(ge=-1e4, le=1e4, description="metres per second, not 0, at most 10000")] = None
    direction_enu: Direction = None

    @model_validator(mode="after")
    def _one_rate(self) -> "ReceiverRamp":
        if (self.rate_enu_mps is None) == (self.rate_mps is None):
            raise ValueError("give either rate_enu_mps = [east, north, up] or rate_mps (east, or along direction_enu)")
        if self.rate_enu_mps is not None and self.direction_enu is not None:
            raise ValueError("direction_enu goes with rate_mps; rate_enu_mps has its direction in it")
        if not any(self.velocity_enu_mps):
            raise ValueError("a rate or a direction of 0 does nothing")
        return self

    @property
    def velocity_enu_mps(self) -> EnuM:
        """How the antenna seems to move."""
        if self.rate_enu_mps is not None:
            return self.rate_enu_mps
        east, north, up = EAST if self.direction_enu is None else self.direction_enu
        scale = (self.rate_mps or 0.0) / (math.hypot(east, north, up) or math.inf)
        return scale * east, scale * north, scale * up


class ReceiverFreeze(Section):
    """A receiver repeats its last measurements, with times that go on."""

    kind: ClassVar = "receiver_freeze"
    receiver: Receiver


class ReceiverDrop(Section):
    """A receiver sends nothing."""

    kind: ClassVar = "receiver_drop"
    receiver: Receiver


class AntennaMoved(Section):
    """An antenna stands elsewhere, to the end of the recording where no `duration_s` is given."""

    kind: ClassVar = "antenna_moved"
    receiver: Receiver
    offset_enu_m: Enu


class TwoReceivers(Section):
    """All ranges of two receivers are as if their antennas stood elsewhere, by the same offset."""

    kind: ClassVar = "two_receivers"
    receivers: Annotated[tuple[str, str], Field(strict=False, description='a list of two of the site\'s receivers, such as ["A", "B"]')]
    offset_enu_m: Enu


class Spoofing(Section):
    """Receivers hear one transmitter: their ranges are those of one point, which drifts east.

    Without `position_ecef_m` the point is the surveyed point of the first receiver named. Coherent: aligned with the true signals, so that
    nothing else changes. Not coherent: every captured signal is acquired anew (slip, lock from the beginning), and the clocks step.
    """

    kind: ClassVar = "spoofing"
    receivers: Receivers
    position_ecef_m: Ecef = None
    drift_mps: Annotated[float, Field(ge=-1e4, le=1e4, description="metres per second to the east, at most 10000")] = 0.0
    coherent: Annotated[bool, Field(description="true or false")] = True


class Jamming(Section):
    """C/N0 of receivers falls by `drop_db` in the course of `ramp_s` (at once without it): noise grows, weak signals are lost."""

    kind: ClassVar = "jamming"
    receivers: Receivers
    drop_db: Annotated[float, Field(gt=0, le=100, description="decibels, above 0 and at most 100")]
    ramp_s: Annotated[float, Field(ge=0, le=1e6, description="seconds, from 0 to 1000000")] = 0.0


class CorruptBytes(Section):
    """Bits of a receiver's bytes flip on the way, in a byte with the probability `rate`; only where its bytes were recorded."""

    kind: ClassVar = "corrupt_bytes"
    receiver: Receiver
    rate: Annotated[float, Field(gt=0, le=1, description="damaged bytes per byte, above 0 and at most 1")]


class ReceiverDuplicate(Section):
    """What a receiver sends comes twice."""

    kind: ClassVar = "receiver_duplicate"
    receiver: Receiver


class Delay(Section):
    """What a receiver sends comes later by `seconds`; what it sends afterwards waits behind it."""

    kind: ClassVar = "delay"
    receiver: Receiver
    seconds: Annotated[float, Field(ge=0.001, le=86_400, description="seconds, from 0.001 to 86400")]


RangeEffect = SatelliteStep | SatelliteRamp | ReceiverBias | ReceiverRamp | AntennaMoved | TwoReceivers | Spoofing
LinkEffect = CorruptBytes | ReceiverDuplicate | Delay
Effect = RangeEffect | WrongEphemeris | ReceiverFreeze | ReceiverDrop | Jamming | LinkEffect

_ALL: tuple[type[Effect], ...] = (
    SatelliteStep,
    SatelliteRamp,
    WrongEphemeris,
    ReceiverBias,
    ReceiverRamp,
    ReceiverFreeze,
    ReceiverDrop,
    AntennaMoved,
    TwoReceivers,
    Jamming,
    Spoofing,
    CorruptBytes,
    ReceiverDuplicate,
    Delay,
)
KINDS: dict[str, type[Effect]] = {effect.kind: effect for effect in _ALL}


def receivers_of(effect: Effect) -> tuple[str, ...]:
    """The receivers that a fault names; none for a fault of a satellite, which acts on all."""
    match effect:
        case TwoReceivers() | Spoofing() | Jamming():
            return effect.receivers
        case SatelliteStep() | SatelliteRamp() | WrongEphemeris():
            return ()
        case _:
            return (effect.receiver,)
