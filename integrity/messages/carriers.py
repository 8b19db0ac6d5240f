"""What is remembered of carriers, to a message and back, to the last bit: a part of a snapshot.

Decoding refuses what cannot have been remembered: arrays of other lengths, numbers beyond measure, times after the last epoch, sets that
are no orbit of their satellite. So what was decoded never breaks a monitor that goes on from it.
"""

from collections.abc import Sequence
from math import prod

import numpy as np

from integrity.carrier_watch import CarrierMemory
from integrity.errors import DecodeError
from integrity.gnss.ephemeris.broadcast import Ephemeris
from integrity.gnss.observations import BEYOND_MEASURE, Floats, Ints
from integrity.gnss.signals import satellite_of
from integrity.messages import wayside_pb2 as pb
from integrity.messages.ephemerides import decode_ephemeris, encode_ephemeris
from integrity.monitors.carrier_motion import MotionMemory
from integrity.monitors.carrier_residuals import TrackingMemory
from integrity.monitors.divergence import DivergenceMemory

LONGEST_TRACKING_EPOCHS = 2**40
NONE = -1
MOST = 1e3 * BEYOND_MEASURE  # differences and sums of what is measured, at most


def encode_carriers(memory: CarrierMemory) -> pb.CarrierMemory:
    """The memory of a station's carriers; that of the last epoch is the last of `motion.epoch_ns`."""
    serving = list(dict.fromkeys(eph for eph in memory.serving if eph is not None))
    place = {eph: k for k, eph in enumerate(serving)}
    tracking, motion, apart = memory.tracking, memory.motion, memory.divergence
    return pb.CarrierMemory(
        signal=memory.signals,
        serving=[encode_ephemeris(eph, 0) for eph in serving],
        served_by=[NONE if eph is None else place[eph] for eph in memory.serving],
        receive_time_ns=tracking.receive_time_ns.tolist(),
        lock_s=tracking.lock_s.ravel().tolist(),
        half_cycle=tracking.half_cycle.ravel().tolist(),
        epoch_ns=motion.epoch_ns.tolist(),
        residual_m=motion.residual_m.ravel().tolist(),
        half_m=motion.half_m.ravel().tolist(),
        motion_age=motion.age.ravel().tolist(),
        code_minus_carrier_m=apart.code_minus_carrier_m.ravel().tolist(),
        innovation_m=apart.innovation_m.ravel().tolist(),
        rate_mps=apart.rate_mps.ravel().tolist(),
        age=apart.age.ravel().tolist(),
        since_ns=apart.since_ns.ravel().tolist(),
    )


def decode_carriers(message: pb.CarrierMemory, n_receivers: int, half_epochs: int, last_epoch_ns: int | None) -> CarrierMemory:
    """The memory of carriers of so many receivers and windows of `2 half_epochs`, whose last epoch was at `last_epoch_ns` (None: there was
    none); DecodeError where a message is not of these, or could not have been remembered."""
    signals, last_ns = tuple(message.signal), last_epoch_ns or 0
    if len(set(signals)) != len(signals):
        raise DecodeError("snapshot: carriers of a signal stand twice")
    now = (n_receivers, len(signals))
    of_half = (half_epochs, *now)
    _expect("half cycles of carriers", len(message.half_cycle), prod(now))
    times_ns = _integers("epochs of carriers", message.epoch_ns, (2 * half_epochs,), last_ns)
    if (np.diff(times_ns) < 0).any():
        raise DecodeError(f"snapshot: epochs of carriers go back: {times_ns.tolist()} ns, expected GPS times in order")
    tracking = TrackingMemory(
        signals,
        _integers("times of reception", message.receive_time_ns, (n_receivers,), 2**62),
        _numbers("lock times", message.lock_s, now),
        np.array(message.half_cycle, dtype=np.bool_).reshape(now),
    )
    motion = MotionMemory(
        signals,
        times_ns,
        _numbers("residuals of carriers", message.residual_m, of_half),
        _numbers("changes of carriers", message.half_m, of_half),
        _integers("ages of carriers", message.motion_age, now, half_epochs),
    )
    apart = DivergenceMemory(
        signals,
        int(times_ns[-1]),
        _numbers("code minus carrier", message.code_minus_carrier_m, now),
        _known("innovations", _numbers("innovations", message.innovation_m, now)),
        _known("rates", _numbers("rates", message.rate_mps, now)),
        _integers("ages of filters", message.age, now, LONGEST_TRACKING_EPOCHS),
        _integers("beginnings of filters", message.since_ns, now, last_ns),
    )
    return CarrierMemory(signals, _serving(message, signals), tracking, motion, apart)


def _serving(message: pb.CarrierMemory, signals: tuple[str, ...]) -> tuple[Ephemeris | None, ...]:
    _expect("sets by signal", len(message.served_by), len(signals))
    sets = [decode_ephemeris(of) for of in message.serving]
    for eph in sets:
        if (why := eph.implausibility()) is not None:
            raise DecodeError(f"snapshot: a set that serves {eph.satellite!r}: {why}")
    serving: list[Ephemeris | None] = []
    for signal, place in zip(signals, message.served_by, strict=True):
        if not NONE <= place < len(sets) or (place != NONE and sets[place].satellite != satellite_of(signal)):
            raise DecodeError(f"snapshot: {signal!r} is served by set {place} of {len(sets)}, expected one of its satellite, or {NONE}")
        serving.append(None if place == NONE else sets[place])
    return tuple(serving)


def _expect(what: str, count: int, expected: int) -> None:
    if count != expected:
        raise DecodeError(f"snapshot: {count} {what}, expected {expected}")


def _integers(what: str, values: Sequence[int], shape: tuple[int, ...], most: int) -> Ints:
    """From 0 to `most`."""
    _expect(what, len(values), prod(shape))
    array = np.array(values, dtype=np.int64).reshape(shape)
    wrong = (array < 0) | (array > most)
    if wrong.any():
        raise DecodeError(f"snapshot: {what}: {array[wrong][0]}, expected 0 to {most}")
    return array


def _numbers(what: str, values: Sequence[float], shape: tuple[int, ...]) -> Floats:
    """At most `MOST`, or NaN."""
    _expect(what, len(values), prod(shape))
    array = np.array(values, dtype=np.float64).reshape(shape)
    wrong = np.abs(array) > MOST
    if wrong.any():
        raise DecodeError(f"snapshot: {what}: {array[wrong][0]:g}, expected at most {MOST:g}, or NaN")
    return array


def _known(what: str, array: Floats) -> Floats:
    if np.isnan(array).any():
        raise DecodeError(f"snapshot: {what}: not a number; expected one of every signal")
    return array
