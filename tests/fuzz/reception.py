"""Whole byte streams of three receivers, UBX and RTCM, into the monitor: never NORMAL while the bytes of one are garbage.

A piece is a burst, all frames that a receiver sends with an epoch; the first says which of the protocols the receivers have.
"""

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from random import Random
from typing import NamedTuple

import numpy as np

from integrity.config import SiteConfig
from integrity.events import Event, RawBytes, Tick
from integrity.gnss.gps_time import NS_PER_S
from integrity.messages import wayside_pb2 as pb
from integrity.messages.snapshots import decode_snapshot, encode_snapshot
from integrity.outputs import EpochReport, HealthReport, Output
from integrity.states import Outcome, State
from integrity.station_monitor import StationMonitor
from recordings.simulate.observations import antennas_of
from recordings.simulate.receiver import as_bytes
from recordings.simulate.rtcm import as_rtcm
from tests.fuzz import rtcm, ubx
from tests.fuzz.mutations import cuts, damaged
from tests.fuzz.target import Piece, Target
from tests.unit.streams import LIMITS, SITE, START_NS, new_monitor, stream

SECONDS = 30
READY_S, NOTICED_S = 8, 2.5  # start-up is over; a receiver that is silent has been noticed
MOST_PENDING_BYTES = 8200
REQUIRED = np.array([threshold.required for threshold in LIMITS.thresholds])
PROTOCOLS = {b"ubx": "", b"rtcm": "ABC", b"mixed": "B"}  # receivers that send RTCM


class Window(NamedTuple):
    """Seconds in which a receiver sends noise."""

    receiver: str
    first_s: int
    end_s: int


@cache
def site(protocols: bytes) -> SiteConfig:
    of_rtcm = PROTOCOLS[protocols]
    return replace(SITE, receivers=tuple(replace(r, protocol="rtcm3") if r.name in of_rtcm else r for r in SITE.receivers))


@cache
def events(protocols: bytes) -> tuple[Event, ...]:
    """Bytes and ticks; what simulated satellites say stands in the bytes alone."""
    decoded = stream(float(SECONDS))
    antennas = antennas_of(SITE)
    sent = as_bytes(as_rtcm(decoded, [a for a in antennas if a.receiver in PROTOCOLS[protocols]]), antennas)
    return tuple(event for event in sent if isinstance(event, RawBytes | Tick))


def sound(rng: Random) -> list[bytes]:
    protocols = rng.choice(list(PROTOCOLS))
    return [protocols, *(event.data for event in events(protocols) if isinstance(event, RawBytes))]


def touch(rng: Random, burst: bytes) -> bytes:
    """Noise, nothing, damage anywhere, or damage to one frame with its checksum redone."""
    if burst in PROTOCOLS or rng.random() < 0.5:  # else a receiver is hardly ever whole
        return burst
    match rng.randrange(6):
        case 0:
            return rng.randbytes(len(burst))
        case 1:
            return b""
        case 2 | 3:
            return damaged(rng, burst)
    kind = ubx if burst.startswith(b"\xb5\x62") else rtcm
    frames = [frame for frame in kind.split(burst) if frame]
    k = rng.randrange(len(frames))
    return b"".join((*frames[:k], kind.touch(rng, frames[k]), *frames[k + 1 :]))


def examine(pieces: Sequence[Piece], rng: Random) -> Counter[str]:
    """Decisions, which are the same for other cuts and across a snapshot; what must not be said."""
    if not pieces or pieces[0].data not in PROTOCOLS:
        return Counter()
    protocols = pieces[0].data
    first_s = rng.randrange(READY_S, SECONDS - 8)
    window = Window(rng.choice("ABC"), first_s, first_s + rng.randrange(3, 8)) if rng.random() < 0.7 else None
    arrived = arrivals(protocols, [piece.data for piece in pieces[1:]], window, rng)
    monitor = new_monitor(site(protocols))
    outputs = [output for event in arrived for output in monitor.feed((event,))]
    snapshot = monitor.snapshot()
    for memory in snapshot.reception:
        assert len(memory.pending) <= MOST_PENDING_BYTES
    if rng.random() < 0.2:
        assert decisions(interrupted(protocols, arrived, rng)) == decisions(outputs)
    assert_never_wrong(outputs, window)
    if window is None and all(piece.untouched for piece in pieces):
        assert health(outputs)[-1].state is State.NORMAL
    return Counter(h.state.name for h in health(outputs)) + Counter(bad_frames=sum(m.bad_frames for m in snapshot.reception))


def arrivals(protocols: bytes, bursts: Sequence[bytes], window: Window | None, rng: Random) -> list[Event]:
    """The events with these bursts for theirs, the last ones without where there are fewer."""
    waiting, found = iter(bursts), list[Event]()
    for event in events(protocols):
        if isinstance(event, RawBytes):
            data = next(waiting, b"")
            second = (event.mono_ns - START_NS) // NS_PER_S
            if window is not None and event.receiver == window.receiver and window.first_s <= second < window.end_s:
                data = rng.randbytes(len(event.data))
            found += [replace(event, data=data)] if data else []
        else:
            found.append(event)
    return found


def interrupted(protocols: bytes, arrived: Sequence[Event], rng: Random) -> list[Output]:
    """The outputs of the same bytes cut elsewhere, with a new monitor that goes on from what the old one had written down."""
    pieces: list[Event] = []
    for event in arrived:
        pieces += [replace(event, data=data) for data in cuts(rng, event.data, 4000)] if isinstance(event, RawBytes) else [event]
    place = rng.randint(0, len(pieces))
    first = new_monitor(site(protocols))
    before = first.feed(pieces[:place])
    written = encode_snapshot(first.snapshot(), SITE.receiver_names, 0).SerializeToString(deterministic=True)
    second = StationMonitor(site(protocols), decode_snapshot(pb.Snapshot.FromString(written)))
    assert encode_snapshot(second.snapshot(), SITE.receiver_names, 0).SerializeToString(deterministic=True) == written
    return before + second.feed(pieces[place:])


def health(outputs: Sequence[Output]) -> list[HealthReport]:
    return [output for output in outputs if isinstance(output, HealthReport)]


def decisions(outputs: Sequence[Output]) -> list[tuple[object, ...]]:
    """What was decided, with every number."""
    reports = [o for o in outputs if isinstance(o, EpochReport)]
    said: list[tuple[object, ...]] = [(h.sequence, h.gps_time_ns, h.state, h.cause, h.subjects, h.excluded) for h in health(outputs)]
    return said + [(r.gps_time_ns, r.state, r.excluded, r.statistic.tobytes(), r.e_enu_m.tobytes()) for r in reports]


def assert_never_wrong(outputs: Sequence[Output], window: Window | None) -> None:
    """NORMAL only with every required check passed and every receiver in its circle, and never while one sends noise."""
    for report in (o for o in outputs if isinstance(o, EpochReport) and o.state is State.NORMAL):
        assert (report.outcome[REQUIRED] == Outcome.PASS).all()
        assert (np.hypot(report.e_enu_m[:, 0], report.e_enu_m[:, 1]) <= LIMITS.radius_m).all()
        second = (report.gps_time_ns - START_NS) // NS_PER_S
        assert window is None or not window.first_s <= second < window.end_s, f"NORMAL in second {second} of {window}"
    for said in health(outputs):
        mono_s = (said.mono_ns - START_NS) / NS_PER_S
        noise = window is not None and window.first_s + NOTICED_S <= mono_s < window.end_s
        assert not (noise and said.state is State.NORMAL), f"NORMAL at {mono_s} s of {window}"


def split(data: bytes) -> list[bytes]:
    """Any bytes as bursts of receivers with both protocols."""
    size = 1 + len(data) // (3 * SECONDS)
    return [b"mixed", *(data[k : k + size] for k in range(0, len(data), size))]


TARGET = Target(sound, touch, split, examine, any_order=False)
