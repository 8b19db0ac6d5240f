"""Threats that receivers meet each for itself: antennas, hardware, streams, surroundings; jamming; spoofing of some or all."""

from integrity.states import Cause
from recordings.campaign.threat import (
    Draw,
    Threat,
    all_receivers,
    first_receiver,
    nobody,
    satellite_or_receiver,
    two_receivers,
)
from recordings.faults.kinds import Effect
from recordings.faults.receiver_kinds import (
    AntennaMoved,
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
from recordings.faults.satellite_kinds import CodeBias, SatelliteStep

MILLISECOND_M = 299_792.458
DEEPEST_DB = 40.0  # to which jamming grows: below it no signal is left

OF_RECEIVER = (Cause.RECEIVER, Cause.AMBIGUOUS)
OF_TWO = (Cause.AMBIGUOUS, Cause.RECEIVER, Cause.SPOOFING)  # a receiver named has to be one of the two
OF_SPOOFING = (Cause.SPOOFING, Cause.AMBIGUOUS, Cause.DATA)
OF_CAPTURE = (Cause.SPOOFING, Cause.RECEIVER, Cause.AMBIGUOUS, Cause.DATA)
OF_WHOLE = (Cause.SPOOFING, Cause.AMBIGUOUS, Cause.RECEIVER)  # the triangle moves as one
OF_JAMMING = (Cause.JAMMING, Cause.DATA, Cause.AMBIGUOUS)
OF_JAMMED = (Cause.RECEIVER, Cause.AMBIGUOUS, Cause.DATA, Cause.JAMMING)


def _all_off(size_m: float, draw: Draw) -> tuple[Effect, ...]:
    return tuple(ReceiverBias(receiver=name, offset_enu_m=draw.offset_m(size_m)) for name in draw.receivers)


def _all_pulled(rate_mps: float, draw: Draw) -> tuple[Effect, ...]:
    return tuple(ReceiverRamp(receiver=name, rate_enu_mps=draw.offset_m(rate_mps)) for name in draw.receivers)


def _swapped(_: float, draw: Draw) -> tuple[Effect, ...]:
    """Each of two receivers measures at the other's point."""
    (one, other), (here, there) = draw.receivers[:2], draw.points_ecef_m[:2]
    return Spoofing(receivers=(one,), position_ecef_m=there), Spoofing(receivers=(other,), position_ecef_m=here)


def _one_after_another(away_m: float, draw: Draw) -> tuple[Effect, ...]:
    point = draw.elsewhere_ecef_m(away_m)
    return tuple(Spoofing(receivers=(name,), position_ecef_m=point) for name in draw.receivers)


RECEIVER_THREATS: tuple[Threat, ...] = (
    Threat(
        "RX-BIAS",
        "one receiver's position off",
        "m",
        (0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0),
        lambda size, d: (ReceiverBias(receiver=d.receivers[0], offset_enu_m=d.offset_m(size)),),
        first_receiver,
        OF_RECEIVER,
    ),
    Threat(
        "RX-UP",
        "one receiver's height off",
        "m",
        (0.5, 2.0, 5.0, 10.0, 20.0),
        lambda size, d: (ReceiverBias(receiver=d.receivers[0], offset_enu_m=d.upward_m(size)),),
        first_receiver,
        OF_RECEIVER,
    ),
    Threat(
        "RX-RAMP",
        "one receiver's position drifts",
        "m/s",
        (0.01, 0.1, 0.5, 2.0),
        lambda size, d: (ReceiverRamp(receiver=d.receivers[0], rate_enu_mps=d.offset_m(size)),),
        first_receiver,
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
        first_receiver,
        (Cause.AMBIGUOUS, Cause.RECEIVER),
        abrupt=False,
    ),
    Threat(
        "RX-FREEZE",
        "one receiver repeats itself",
        "",
        (1.0,),
        lambda size, d: (ReceiverFreeze(receiver=d.receivers[0]),),
        first_receiver,
        (Cause.DATA,),
    ),
    Threat(
        "RX-DROP",
        "one receiver falls silent",
        "",
        (1.0,),
        lambda size, d: (ReceiverDrop(receiver=d.receivers[0]),),
        first_receiver,
        (Cause.DATA,),
        abrupt=False,
    ),
    Threat(
        "RX-DOUBLE",
        "one receiver sends everything twice",
        "",
        (1.0,),
        lambda size, d: (ReceiverDuplicate(receiver=d.receivers[0]),),
        first_receiver,
        (),
    ),
    Threat(
        "RX-STALL",
        "one receiver's stream comes late",
        "s",
        (3.0, 10.0, 30.0),
        lambda size, d: (Delay(receiver=d.receivers[0], seconds=size),),
        first_receiver,
        (Cause.DATA,),
        abrupt=False,
    ),
    Threat(
        "RX-MOVE",
        "one antenna moved",
        "m",
        (0.02, 0.05, 0.2, 1.0, 5.0, 20.0),
        lambda size, d: (AntennaMoved(receiver=d.receivers[0], offset_enu_m=d.offset_m(size)),),
        first_receiver,
        OF_RECEIVER,
        duration_s=600.0,
    ),
    Threat(
        "RX-CLOCK",
        "one receiver's clock jumps",
        "m",
        (30.0, MILLISECOND_M),
        lambda size, d: (ReceiverClockJump(receiver=d.receivers[0], size_m=d.sign * size),),
        first_receiver,
        (),
    ),
    Threat(
        "RX2-SAME",
        "two receivers off alike",
        "m",
        (1.0, 2.0, 5.0, 10.0, 20.0),
        lambda size, d: (TwoReceivers(receivers=(d.receivers[0], d.receivers[1]), offset_enu_m=d.offset_m(size)),),
        two_receivers,
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
        two_receivers,
        OF_TWO,
    ),
    Threat(
        "CFG-SWAP",
        "two antennas in each other's place",
        "",
        (1.0,),
        _swapped,
        two_receivers,
        (Cause.AMBIGUOUS, Cause.RECEIVER, Cause.SPOOFING),
    ),
    Threat(
        "MP",
        "multipath at one receiver, 60 s, one satellite",
        "m",
        (0.5, 2.0, 5.0),
        lambda size, d: (Multipath(receiver=d.receivers[0], satellites=(d.satellite,), amplitude_m=size, period_s=60.0),),
        satellite_or_receiver,
        (Cause.AMBIGUOUS, Cause.RECEIVER),
        duration_s=120.0,
        abrupt=False,
    ),
    Threat(
        "MP-SLOW",
        "the same, 600 s",
        "m",
        (0.5, 2.0, 5.0),
        lambda size, d: (Multipath(receiver=d.receivers[0], satellites=(d.satellite,), amplitude_m=size, period_s=600.0),),
        satellite_or_receiver,
        (Cause.AMBIGUOUS, Cause.RECEIVER),
        duration_s=600.0,
        abrupt=False,
    ),
    Threat(
        "MP-NLOS",
        "one receiver's code of one satellite off",
        "m",
        (0.5, 2.0, 5.0, 10.0, 30.0),
        lambda size, d: (CodeBias(satellite=d.satellite, receivers=d.receivers[:1], size_m=size),),
        satellite_or_receiver,
        (Cause.AMBIGUOUS, Cause.RECEIVER, Cause.SATELLITE),
    ),
    Threat(
        "MIX-SV-RX",
        "a satellite steps while a receiver is off",
        "m each",
        (2.0, 5.0, 10.0, 30.0),
        lambda size, d: (
            SatelliteStep(satellite=d.satellite, size_m=d.sign * size),
            ReceiverBias(receiver=d.receivers[0], offset_enu_m=d.offset_m(size)),
        ),
        satellite_or_receiver,
        (Cause.AMBIGUOUS, Cause.RECEIVER, Cause.SATELLITE),
    ),
    Threat(
        "JAM-ALL",
        "jamming of all receivers",
        "dB",
        (3.0, 6.0, 10.0, 20.0, 40.0),
        lambda size, d: (Jamming(receivers=d.receivers, drop_db=size),),
        nobody,
        OF_JAMMING,
    ),
    Threat(
        "JAM-P",
        "jamming that grows to loss",
        "dB/s",
        (0.2, 1.0, 5.0),
        lambda size, d: (Jamming(receivers=d.receivers, drop_db=DEEPEST_DB, ramp_s=DEEPEST_DB / size),),
        nobody,
        OF_JAMMING,
        duration_s=240.0,
        abrupt=False,
    ),
    Threat(
        "JAM-1",
        "jamming of one receiver",
        "dB",
        (3.0, 6.0, 10.0, 20.0, 40.0),
        lambda size, d: (Jamming(receivers=d.receivers[:1], drop_db=size),),
        first_receiver,
        OF_JAMMED,
    ),
    Threat(
        "SPF-3",
        "all receivers hear one transmitter",
        "m/s of drift",
        (0.0, 0.05, 1.0, 9.7),
        lambda size, d: (Spoofing(receivers=d.receivers, drift_mps=size),),
        all_receivers,
        OF_SPOOFING,
    ),
    Threat(
        "SPF-INC",
        "the same, of a place far away, not aligned",
        "m away",
        (100.0, 1e4, 1e6),
        lambda size, d: (Spoofing(receivers=d.receivers, position_ecef_m=d.elsewhere_ecef_m(size), coherent=False),),
        all_receivers,
        OF_SPOOFING,
    ),
    Threat(
        "SPF-ALL",
        "a transmitter for each antenna, all off alike",
        "m",
        (0.5, 2.0, 5.0, 10.0, 20.0),
        _all_off,
        all_receivers,
        OF_WHOLE,
    ),
    Threat(
        "SPF-PULL",
        "the same, pulled away slowly",
        "m/s",
        (0.05, 0.2, 1.0, 9.7),
        _all_pulled,
        all_receivers,
        OF_WHOLE,
        duration_s=600.0,
        abrupt=False,
    ),
    Threat(
        "SPF-1",
        "one receiver drawn to another's place",
        "m/s of drift",
        (0.0, 1.0),
        lambda size, d: (Spoofing(receivers=(d.receivers[1], d.receivers[0]), drift_mps=size),),
        two_receivers,
        OF_CAPTURE,
    ),
    Threat(
        "SPF-NEXT",
        "captured one after another, 10 s apart",
        "m away",
        (10.0, 50.0, 1000.0),
        _one_after_another,
        all_receivers,
        OF_CAPTURE,
        apart_s=10.0,
    ),
    Threat(
        "SPF-TIME",
        "all clocks pushed together",
        "m",
        (30.0, 300.0, MILLISECOND_M),
        lambda size, d: tuple(ReceiverClockJump(receiver=name, size_m=d.sign * size) for name in d.receivers),
        all_receivers,
        (),
    ),
    Threat(
        "MEAC",
        "two hear what the third hears, later",
        "m of delay",
        (30.0, 300.0, 3000.0),
        lambda size, d: (Meaconing(from_receiver=d.receivers[0], to_receivers=d.receivers[1:], delay_m=size),),
        all_receivers,
        OF_SPOOFING,
    ),
)
