"""The kinds of faults that act on some of the receivers: their antennas, what they hear, themselves, their links.

One class each: its parameters as they stand in a `[[fault]]` table, and what it does. See `parameters` for what they may be.
"""

import math
from typing import Annotated, ClassVar

from pydantic import Field, model_validator

from recordings.faults.parameters import (
    EAST,
    Direction,
    DropDb,
    Ecef,
    Enu,
    RampS,
    RateEnu,
    Receiver,
    Receivers,
    Satellites,
    SizeM,
    Vector,
)
from recordings.site_schema import Section


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
    def velocity_enu_mps(self) -> Vector:
        """How the antenna seems to move."""
        if self.rate_enu_mps is not None:
            return self.rate_enu_mps
        east, north, up = EAST if self.direction_enu is None else self.direction_enu
        scale = (self.rate_mps or 0.0) / (math.hypot(east, north, up) or math.inf)
        return scale * east, scale * north, scale * up


class ReceiverNoise(Section):
    """The noise of a receiver's code, carrier and Doppler grows by `factor`; what it says of its signals stays."""

    kind: ClassVar = "receiver_noise"
    receiver: Receiver
    factor: Annotated[float, Field(gt=1, le=1000, description="a factor, above 1 and at most 1000")]


class ReceiverClockJump(Section):
    """A receiver's clock is ahead by `size_m` (of light) more than it was: all ranges and carriers are longer by it.

    Whole milliseconds (a multiple of 299,792.458 m) are what receivers correct their clocks by: their time tags jump along, and they
    measure when they did. By anything else the tags stay: with a clock that is ahead they measure that much earlier.
    """

    kind: ClassVar = "receiver_clock_jump"
    receiver: Receiver
    size_m: SizeM


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


class Multipath(Section):
    """The codes of some satellites swing by `amplitude_m` at one receiver, once in `period_s`, each as far from the next in its swing.

    The carriers swing a quarter of a period apart by what a reflection of half the strength does to them: a twelfth of a wavelength, 1.6 cm
    on L1. Source: Braasch in Parkinson and Spilker, Global Positioning System, 1996, volume I, chapter 14 (short delays, first order).
    """

    kind: ClassVar = "multipath"
    receiver: Receiver
    satellites: Satellites
    amplitude_m: Annotated[float, Field(gt=0, le=1000, description="metres, above 0 and at most 1000")]
    period_s: Annotated[float, Field(gt=0, le=1e6, description="seconds, above 0 and at most 1000000")]

    @model_validator(mode="after")
    def _each_once(self) -> "Multipath":
        if len(set(self.satellites)) < len(self.satellites):
            raise ValueError("a satellite stands twice: name each once")
        return self


class Jamming(Section):
    """C/N0 of receivers falls by `drop_db` in the course of `ramp_s` (at once without it): noise grows, weak signals are lost."""

    kind: ClassVar = "jamming"
    receivers: Receivers
    drop_db: DropDb
    ramp_s: RampS = 0.0


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


class Meaconing(Section):
    """Receivers hear what another one's antenna hears, repeated so much later that ranges are longer by `delay_m`.

    Ranges are those of `from_receiver`, the multipath at its antenna included, by the clock of the receiver that hears them; every signal
    is acquired anew, and those that `from_receiver` does not hear are gone.
    """

    kind: ClassVar = "meaconing"
    from_receiver: Receiver
    to_receivers: Receivers
    delay_m: Annotated[float, Field(ge=0, le=1e6, description="metres, from 0 to 1000000")]

    @model_validator(mode="after")
    def _others(self) -> "Meaconing":
        if self.from_receiver in self.to_receivers:
            raise ValueError(f"{self.from_receiver} hears itself: name only others in to_receivers")
        return self


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
