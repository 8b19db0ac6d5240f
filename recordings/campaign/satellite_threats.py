"""Threats that all receivers meet alike: satellites, what they broadcast, whole systems, the ionosphere."""

from collections.abc import Callable
from typing import Literal

from integrity.states import Cause
from recordings.campaign.threat import Draw, Threat, any_satellite, its_system, the_satellite
from recordings.faults.kinds import Effect
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

FRONT_SPEED_MPS, FRONT_WIDTH_KM = 100.0, 50.0
NOMINAL_WIDTH_KM = 200.0
WEAKER_DB_A_S = 0.5

OF_SATELLITE = (Cause.SATELLITE,)
OF_SYSTEM = (Cause.CONSTELLATION, Cause.SATELLITE, Cause.SPOOFING, Cause.AMBIGUOUS)
OF_FRONT = (Cause.SATELLITE, Cause.AMBIGUOUS, Cause.SPOOFING, Cause.CONSTELLATION)

METRES_OF_STEP = (0.5, 1.0, 2.0, 3.0, 5.0, 10.0, 30.0, 100.0)
METRES_OF_ORBIT = (100.0, 250.0, 700.0, 1000.0, 2500.0, 7000.0)

Broadcast = Literal["along", "cross", "radial", "clock"]
DIRECTIONS: tuple[Broadcast, ...] = ("along", "cross", "radial")


def _broadcast_off(direction: Broadcast) -> Callable[[float, Draw], tuple[Effect, ...]]:
    return lambda size, d: (WrongEphemeris(satellite=d.satellite, offset_m=d.sign * size, direction=direction),)


def _front(width_km: float) -> Callable[[float, Draw], tuple[Effect, ...]]:
    return lambda size, d: (IonoFront(slope_mm_per_km=size, width_km=width_km, speed_mps=FRONT_SPEED_MPS, azimuth_deg=d.azimuth_deg),)


SATELLITE_THREATS: tuple[Threat, ...] = (
    Threat(
        "SV-STEP",
        "step of a satellite's range",
        "m",
        METRES_OF_STEP,
        lambda size, d: (SatelliteStep(satellite=d.satellite, size_m=d.sign * size),),
        the_satellite,
        OF_SATELLITE,
    ),
    Threat(
        "SV-RAMP",
        "ramp of a satellite's clock, or of a manoeuvre",
        "m/s",
        (0.01, 0.05, 0.1, 0.5, 2.0),
        lambda size, d: (SatelliteRamp(satellite=d.satellite, rate_mps=d.sign * size),),
        the_satellite,
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
        the_satellite,
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
        the_satellite,
        OF_SATELLITE,
        duration_s=600.0,
        abrupt=False,
    ),
    Threat(
        "SV-DEF",
        "code deformed, receivers of one kind",
        "m",
        (1.0, 2.0, 5.0, 10.0, 30.0),
        lambda size, d: (CodeBias(satellite=d.satellite, size_m=d.sign * size),),
        the_satellite,
        OF_SATELLITE,
    ),
    Threat(
        "SV-LOW",
        "satellite sends weakly, ranges sound",
        "dB",
        (3.0, 6.0, 10.0),
        lambda size, d: (LowPower(satellite=d.satellite, drop_db=size),),
        the_satellite,
        (),
    ),
    Threat(
        "SV-FADE",
        "satellite fades by 0.5 dB/s, to loss",
        "dB",
        (5.0, 10.0, 20.0),
        lambda size, d: (LowPower(satellite=d.satellite, drop_db=size, ramp_s=size / WEAKER_DB_A_S),),
        the_satellite,
        (),
        abrupt=False,
    ),
    *(
        Threat(
            f"EPH-B-{direction.upper()}",
            f"broadcast orbit displaced, {direction}",
            "m",
            METRES_OF_ORBIT,
            _broadcast_off(direction),
            the_satellite,
            OF_SATELLITE,
        )
        for direction in DIRECTIONS
    ),
    Threat(
        "NAV-CLOCK",
        "broadcast clock of a satellite off",
        "m",
        (5.0, 10.0, 30.0, 100.0, 1000.0),
        _broadcast_off("clock"),
        the_satellite,
        OF_SATELLITE,
    ),
    Threat(
        "CONST-CLOCK",
        "a system's time steps",
        "m",
        (5.0, 20.0, 100.0),
        lambda size, d: (ConstellationClock(system=d.system, size_m=d.sign * size),),
        its_system,
        (),
    ),
    Threat(
        "CONST-FRAME",
        "a system's orbits displaced together",
        "m",
        (5.0, 10.0, 20.0, 50.0, 100.0),
        lambda size, d: (ConstellationFrame(system=d.system, offset_ecef_m=d.displaced_m(size)),),
        its_system,
        OF_SYSTEM,
    ),
    Threat(
        "ION-G",
        "ionospheric front, 50 km wide, 100 m/s",
        "mm/km",
        (30.0, 100.0, 200.0, 425.0, 600.0),
        _front(FRONT_WIDTH_KM),
        any_satellite,
        OF_FRONT,
        duration_s=600.0,
        abrupt=False,
    ),
    Threat(
        "ION-N",
        "gradient of quiet days, 200 km wide",
        "mm/km",
        (1.0, 4.0, 6.4),
        _front(NOMINAL_WIDTH_KM),
        any_satellite,
        (),
        duration_s=600.0,
        abrupt=False,
    ),
)
