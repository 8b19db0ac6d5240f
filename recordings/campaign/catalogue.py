"""The threats: which fault in which sizes, and what a good answer to it is. Sizes after section 3 of the notes on ground integrity.

Satellite, receivers, direction and moment are drawn anew for every trial; all sizes are played equally often, those below what can be
detected included.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal, NamedTuple

from integrity.gnss.signals import SYSTEM_NAMES
from integrity.states import Cause
from recordings.faults.kinds import Effect
from recordings.faults.receiver_kinds import (
    AntennaMoved,
    Jamming,
    Meaconing,
    Multipath,
    ReceiverBias,
    ReceiverClockJump,
    ReceiverDrop,
    ReceiverFreeze,
    ReceiverNoise,
    ReceiverRamp,
    Spoofing,
    TwoReceivers,
)
from recordings.faults.satellite_kinds import (
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

MILLISECOND_M = 299_792.458
FRONT_SPEED_MPS, FRONT_WIDTH_KM = 100.0, 50.0


class Draw(NamedTuple):
    """What chance has chosen for a trial: a satellite in use and its system, the receivers in some order, a horizontal direction with its
    azimuth, a direction in ECEF, a sign."""

    satellite: str
    receivers: tuple[str, ...]
    east: float
    north: float
    azimuth_deg: float
    towards_ecef: tuple[float, float, float]
    sign: float

    @property
    def system(self) -> str:
        """Of the satellite."""
        return self.satellite[0]

    def offset_m(self, size_m: float) -> tuple[float, float, float]:
        """A horizontal offset of that size."""
        return size_m * self.east, size_m * self.north, 0.0

    def displaced_m(self, size_m: float) -> tuple[float, float, float]:
        """An offset of that size in ECEF."""
        x, y, z = self.towards_ecef
        return size_m * x, size_m * y, size_m * z


class Guilty(NamedTuple):
    """Who may be named: satellites, whole systems, receivers."""

    satellites: tuple[str, ...] = ()
    systems: tuple[str, ...] = ()
    receivers: tuple[str, ...] = ()

    def may_be(self, name: str) -> bool:
        """Whether naming this one is right."""
        if name in SYSTEM_NAMES.values():
            return any(SYSTEM_NAMES[system] == name for system in self.systems)
        return name in self.satellites or name in self.receivers or (name[0] in self.systems and name[1:].isdecimal())


@dataclass(frozen=True)
class Threat:
    """`effects` makes the faults of a size. `causes`: the first names it, the others are safe answers; no cause at all: it moves no
    position, and nothing may stop for it. `abrupt`: whole in its first epoch."""

    id: str
    title: str
    unit: str
    sizes: tuple[float, ...]
    effects: Callable[[float, Draw], tuple[Effect, ...]]
    guilty: Callable[[Draw], Guilty]
    causes: tuple[Cause, ...]
    duration_s: float = 60.0
    abrupt: bool = True


def _the_satellite(draw: Draw) -> Guilty:
    return Guilty(satellites=(draw.satellite,))


def _its_system(draw: Draw) -> Guilty:
    return Guilty(systems=(draw.system,))


def _one(draw: Draw) -> Guilty:
    return Guilty(receivers=draw.receivers[:1])


def _two(draw: Draw) -> Guilty:
    return Guilty(receivers=draw.receivers[:2])


def _all(draw: Draw) -> Guilty:
    return Guilty(receivers=draw.receivers)


def _nobody(draw: Draw) -> Guilty:
    return Guilty()


def _any_satellite(draw: Draw) -> Guilty:
    return Guilty(systems=("G", "E", "C", "J", "R"))


def _wrong_orbit(direction: Literal["along", "cross", "radial"]) -> Callable[[float, Draw], tuple[Effect, ...]]:
    return lambda size, d: (WrongEphemeris(satellite=d.satellite, offset_m=d.sign * size, direction=direction),)


DIRECTIONS: tuple[Literal["along", "cross", "radial"], ...] = ("along", "cross", "radial")
OF_SATELLITE = (Cause.SATELLITE,)
OF_SYSTEM = (Cause.CONSTELLATION, Cause.SATELLITE, Cause.SPOOFING, Cause.AMBIGUOUS)
OF_RECEIVER = (Cause.RECEIVER, Cause.AMBIGUOUS)
OF_TWO = (Cause.AMBIGUOUS, Cause.RECEIVER, Cause.SPOOFING)  # a receiver named has to be one of the two
OF_SPOOFING = (Cause.SPOOFING, Cause.AMBIGUOUS, Cause.DATA)
OF_JAMMING = (Cause.JAMMING, Cause.DATA, Cause.AMBIGUOUS)

METRES_OF_STEP = (0.5, 1.0, 2.0, 3.0, 5.0, 10.0, 30.0, 100.0)
METRES_OF_ORBIT = (100.0, 250.0, 700.0, 1000.0, 2500.0, 7000.0)

CATALOGUE: tuple[Threat, ...] = (
    Threat(
        "SV-STEP",
        "step of a satellite's range",
        "m",
        METRES_OF_STEP,
        lambda size, d: (SatelliteStep(satellite=d.satellite, size_m=d.sign * size),),
        _the_satellite,
        OF_SATELLITE,
    ),
    Threat(
        "SV-RAMP",
        "ramp of a satellite's clock",
        "m/s",
        (0.01, 0.05, 0.1, 0.5, 2.0),
        lambda size, d: (SatelliteRamp(satellite=d.satellite, rate_mps=d.sign * size),),
        _the_satellite,
        OF_SATELLITE,
        duration_s=600.0,
        abrupt=False,
    ),
    Threat(
        "SV-ACC",
        "acceleration of a satellite's clock",
        "m/s2",
        (0.001, 0.01, 0.04, 0.1, 0.5, 2.5),
        lambda size, d: (SatelliteAcceleration(satellite=d.satellite, rate_mps2=d.sign * size),),
        _the_satellite,
        OF_SATELLITE,
        duration_s=120.0,
        abrupt=False,
    ),
    Threat(
        "SV-CCD",
        "code drifts from carrier",
        "m/s",
        (0.005, 0.0125, 0.018, 0.05, 0.1),
        lambda size, d: (CodeCarrierDivergence(satellite=d.satellite, rate_mps=d.sign * size),),
        _the_satellite,
        OF_SATELLITE,
        duration_s=600.0,
        abrupt=False,
    ),
    Threat(
        "SV-LOW",
        "satellite sends weakly, ranges sound",
        "dB",
        (3.0, 6.0, 10.0),
        lambda size, d: (LowPower(satellite=d.satellite, drop_db=size),),
        _the_satellite,
        (),
    ),
    *(
        Threat(
            f"EPH-B-{direction.upper()}",
            f"broadcast orbit displaced, {direction}",
            "m",
            METRES_OF_ORBIT,
            _wrong_orbit(direction),
            _the_satellite,
            OF_SATELLITE,
        )
        for direction in DIRECTIONS
    ),
    Threat(
        "CONST-CLOCK",
        "a system's time steps",
        "m",
        (5.0, 20.0, 100.0),
        lambda size, d: (ConstellationClock(system=d.system, size_m=d.sign * size),),
        _its_system,
        (),
    ),
    Threat(
        "CONST-FRAME",
        "a system's orbits displaced together",
        "m",
        (5.0, 10.0, 20.0, 50.0, 100.0),
        lambda size, d: (ConstellationFrame(system=d.system, offset_ecef_m=d.displaced_m(size)),),
        _its_system,
        OF_SYSTEM,
    ),
    Threat(
        "ION-G",
        "ionospheric front, 50 km wide, 100 m/s",
        "mm/km",
        (30.0, 100.0, 200.0, 425.0, 600.0),
        lambda size, d: (IonoFront(slope_mm_per_km=size, width_km=FRONT_WIDTH_KM, speed_mps=FRONT_SPEED_MPS, azimuth_deg=d.azimuth_deg),),
        _any_satellite,
        (Cause.SATELLITE, Cause.AMBIGUOUS, Cause.SPOOFING, Cause.CONSTELLATION),
        duration_s=600.0,
        abrupt=False,
    ),
    Threat(
        "RX-BIAS",
        "one receiver's position off",
        "m",
        (0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0),
        lambda size, d: (ReceiverBias(receiver=d.receivers[0], offset_enu_m=d.offset_m(size)),),
        _one,
        OF_RECEIVER,
    ),
    Threat(
        "RX-RAMP",
        "one receiver's position drifts",
        "m/s",
        (0.01, 0.1, 0.5, 2.0),
        lambda size, d: (ReceiverRamp(receiver=d.receivers[0], rate_enu_mps=d.offset_m(size)),),
        _one,
        OF_RECEIVER,
        duration_s=600.0,
        abrupt=False,
    ),
    Threat(
        "RX-NOISE",
        "one receiver's noise grows",
        "times",
        (2.0, 5.0, 10.0),
        lambda size, d: (ReceiverNoise(receiver=d.receivers[0], factor=size),),
        _one,
        (Cause.AMBIGUOUS, Cause.RECEIVER),
        abrupt=False,
    ),
    Threat(
        "RX-FREEZE",
        "one receiver repeats itself",
        "",
        (1.0,),
        lambda size, d: (ReceiverFreeze(receiver=d.receivers[0]),),
        _one,
        (Cause.DATA,),
    ),
    Threat(
        "RX-DROP",
        "one receiver falls silent",
        "",
        (1.0,),
        lambda size, d: (ReceiverDrop(receiver=d.receivers[0]),),
        _one,
        (Cause.DATA,),
        abrupt=False,
    ),
    Threat(
        "RX-MOVE",
        "one antenna moved",
        "m",
        (0.2, 1.0, 5.0, 20.0),
        lambda size, d: (AntennaMoved(receiver=d.receivers[0], offset_enu_m=d.offset_m(size)),),
        _one,
        OF_RECEIVER,
        duration_s=600.0,
    ),
    Threat(
        "RX-CLOCK",
        "one receiver's clock jumps",
        "m",
        (30.0, MILLISECOND_M),
        lambda size, d: (ReceiverClockJump(receiver=d.receivers[0], size_m=d.sign * size),),
        _one,
        (),
    ),
    Threat(
        "RX2-SAME",
        "two receivers off alike",
        "m",
        (1.0, 2.0, 5.0, 10.0, 20.0),
        lambda size, d: (TwoReceivers(receivers=(d.receivers[0], d.receivers[1]), offset_enu_m=d.offset_m(size)),),
        _two,
        OF_TWO,
    ),
    Threat(
        "RX2-OPPOSITE",
        "two receivers off to opposite sides",
        "m",
        (1.0, 2.0, 5.0, 10.0, 20.0),
        lambda size, d: (
            ReceiverBias(receiver=d.receivers[0], offset_enu_m=d.offset_m(size)),
            ReceiverBias(receiver=d.receivers[1], offset_enu_m=d.offset_m(-size)),
        ),
        _two,
        OF_TWO,
    ),
    Threat(
        "MP",
        "multipath on one satellite at one receiver, 60 s",
        "m",
        (0.5, 2.0, 5.0),
        lambda size, d: (Multipath(receiver=d.receivers[0], satellites=(d.satellite,), amplitude_m=size, period_s=60.0),),
        _one,
        (Cause.AMBIGUOUS, Cause.RECEIVER),
        duration_s=120.0,
        abrupt=False,
    ),
    Threat(
        "JAM-ALL",
        "jamming of all receivers",
        "dB",
        (3.0, 6.0, 10.0, 20.0, 40.0),
        lambda size, d: (Jamming(receivers=d.receivers, drop_db=size),),
        _nobody,
        OF_JAMMING,
    ),
    Threat(
        "SPF-3",
        "all receivers hear one transmitter",
        "m/s of drift",
        (0.0, 0.05, 1.0, 9.7),
        lambda size, d: (Spoofing(receivers=d.receivers, drift_mps=size),),
        _all,
        OF_SPOOFING,
    ),
    Threat(
        "SPF-1",
        "one receiver hears a transmitter that plays another's place",
        "m/s of drift",
        (0.0, 1.0),
        lambda size, d: (Spoofing(receivers=(d.receivers[1], d.receivers[0]), drift_mps=size),),
        _two,
        (Cause.SPOOFING, Cause.RECEIVER, Cause.AMBIGUOUS, Cause.DATA),
    ),
    Threat(
        "MEAC",
        "two receivers hear what the third hears, later",
        "m of delay",
        (30.0, 300.0, 3000.0),
        lambda size, d: (Meaconing(from_receiver=d.receivers[0], to_receivers=d.receivers[1:], delay_m=size),),
        _all,
        OF_SPOOFING,
    ),
)
