"""Faults between a receiver and the station: bits that flip, pieces that come late, pieces that come twice.

A receiver's bytes belong to the measurements that they end with: those since its measurements before, up to these.
"""

from collections import deque
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace

import numpy as np

from integrity.config import SiteConfig
from integrity.events import Event, ObservationsReceived, RawBytes
from integrity.gnss.gps_time import NS_PER_S
from recordings.faults.kinds import CorruptBytes, Delay
from recordings.faults.received import Measured
from recordings.faults.splicing import Edit, spliced


def bytes_of(events: Sequence[Event], receiver: str) -> bytes:
    """All bytes of a receiver, in order."""
    return b"".join(event.data for event in events if isinstance(event, RawBytes) and event.receiver == receiver)


def corrupted(events: Sequence[Event], effect: CorruptBytes, hit: Sequence[Measured], site: SiteConfig, seed: tuple[int, int]) -> list[Event]:
    """Bytes in which bits have flipped: at most one in a byte, with the probability `rate`.

    What flips depends on the seed, the receiver, the time and the number of bytes only, not on how they are cut.
    """
    stream = bytes_of(events, effect.receiver)
    edits = []
    for found in hit:
        if found.frame is not None:
            old = np.frombuffer(stream[found.frame.since : found.frame.end], np.uint8)
            chance = np.random.Generator(
                np.random.PCG64([*seed, site.receiver_names.index(found.receiver), found.receive_time_ns, len(old)])
            )
            flips = np.where(chance.random(len(old)) < effect.rate, 1 << chance.integers(0, 8, len(old)), 0).astype(np.uint8)
            edits.append(Edit(found.receiver, found.frame.since, found.frame.end, (old ^ flips).tobytes()))
    return [event for event in spliced(events, edits) if event is not None]


def duplicated(events: Sequence[Event], receiver: str, hit: Sequence[Measured]) -> list[Event]:
    """Each row twice; bytes again as soon as those of an epoch are complete, so that no frame is broken by it."""
    stream = bytes_of(events, receiver)
    twice = {found.place for found in hit if found.frame is None}
    edits = [
        Edit(receiver, found.frame.begin, found.frame.end, stream[found.frame.begin : found.frame.end] + stream[max(0, found.frame.since) : found.frame.end])
        for found in hit
        if found.frame is not None
    ]
    out: list[Event] = []
    for place, event in enumerate(spliced(events, edits)):
        assert event is not None
        out += [event, event] if place in twice else [event]
    return out


def delayed(events: Sequence[Event], effect: Delay, hit: Sequence[Measured]) -> list[Event]:
    """What comes of a receiver comes later; what comes after that waits behind it, since no link overtakes itself. All else stays."""
    delay_ns = round(effect.seconds * NS_PER_S)
    held = _held(hit)
    kept: list[Event] = []
    late: list[Event] = []
    position, last_ns = 0, events[0].mono_ns - 1
    for place, event in enumerate(events):
        match event:
            case RawBytes(receiver=receiver) if receiver == effect.receiver:
                pieces = list(_cut(event, position, held.bounds))
                position += len(event.data)
            case ObservationsReceived(row=row) if row.receiver == effect.receiver:
                pieces = [(event, held.is_row(place))]
            case _:
                kept.append(event)
                continue
        for piece, is_held in pieces:
            ...
    return _merged(kept, late)
