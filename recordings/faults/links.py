"""Faults between a receiver and the station: bits that flip, pieces that come late, pieces that come twice.

A receiver's bytes belong to the measurements that they end with: those since its measurements before, up to these.
"""

from collections import deque
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace

import numpy as np

from integrity.config import SiteConfig
from integrity.events import Event, ObservationsReceived, RawBytes
from integrity.gnss.gps_time import NS_PER_S
from recordings.faults.kinds import CorruptBytes, Delay, ReceiverDuplicate
from recordings.faults.received import Measured
from recordings.faults.splicing import Edit, spliced


def corrupted(
    events: Sequence[Event], effect: CorruptBytes, hit: Sequence[Measured], site: SiteConfig, seed: tuple[int, int]
) -> list[Event]:
    """Bytes in which bits have flipped: at most one in a byte, with the probability `rate`.

    What flips depends on the seed, the receiver, the time and the number of bytes only, not on how they are cut.
    """
    stream = _bytes_of(events, effect.receiver)
    edits = []
    for found in hit:
        if found.burst is not None:
            old = np.frombuffer(stream[found.burst.since : found.burst.end], np.uint8)
            chance = np.random.Generator(
                np.random.PCG64([*seed, site.receiver_names.index(found.receiver), found.receive_time_ns, len(old)])
            )
            flips = np.where(chance.random(len(old)) < effect.rate, 1 << chance.integers(0, 8, len(old)), 0).astype(np.uint8)
            edits.append(Edit(found.receiver, found.burst.since, found.burst.end, (old ^ flips).tobytes()))
    return [event for event in spliced(events, edits) if event is not None]


def duplicated(events: Sequence[Event], effect: ReceiverDuplicate, hit: Sequence[Measured]) -> list[Event]:
    """Each row twice; bytes again as soon as those of an epoch are complete, so that no frame is broken by it."""
    stream = _bytes_of(events, effect.receiver)
    rows = {found.place for found in hit if found.burst is None}
    bursts = [found.burst for found in hit if found.burst is not None]
    edits = [Edit(effect.receiver, b.frames[-1].begin, b.end, stream[b.frames[-1].begin : b.end] + stream[b.since : b.end]) for b in bursts]
    out: list[Event] = []
    for place, event in enumerate(spliced(events, edits)):
        assert event is not None
        out += [event, event] if place in rows else [event]
    return out


def delayed(events: Sequence[Event], effect: Delay, hit: Sequence[Measured]) -> list[Event]:
    """What comes of a receiver comes later; what comes after that waits behind it: no link overtakes itself. All else stays."""
    delay_ns = round(effect.seconds * NS_PER_S)
    rows = {found.place for found in hit if found.burst is None}
    bursts = [found.burst for found in hit if found.burst is not None]
    begin, end = (bursts[0].since, bursts[-1].end) if bursts else (0, 0)
    kept: list[Event] = []
    late: list[RawBytes | ObservationsReceived] = []
    position = 0
    for place, event in enumerate(events):
        pieces: Iterable[tuple[RawBytes | ObservationsReceived, bool]] = ()
        if isinstance(event, RawBytes) and event.receiver == effect.receiver:
            pieces = _cut(event, begin - position, end - position)
            position += len(event.data)
        elif isinstance(event, ObservationsReceived) and event.row.receiver == effect.receiver:
            pieces = [(event, place in rows)]
        else:
            kept.append(event)
        for piece, held in pieces:
            behind_ns = late[-1].mono_ns if late else piece.mono_ns - 1
            if held or behind_ns >= piece.mono_ns:
                late.append(replace(piece, mono_ns=max(piece.mono_ns + held * delay_ns, behind_ns)))
            else:
                kept.append(piece)
    return list(_merged(kept, deque(late)))


def _bytes_of(events: Sequence[Event], receiver: str) -> bytes:
    return b"".join(event.data for event in events if isinstance(event, RawBytes) and event.receiver == receiver)


def _cut(event: RawBytes, begin: int, end: int) -> Iterator[tuple[RawBytes, bool]]:
    """The bytes before, within and after a stretch, as far as there are any; and whether they are within."""
    size = len(event.data)
    first, last = (min(max(0, at), size) for at in (begin, end))
    for low, high, within in ((0, first, False), (first, last, True), (last, size, False)):
        if low < high:
            yield replace(event, data=event.data[low:high]), within


def _merged(kept: Iterable[Event], late: deque[RawBytes | ObservationsReceived]) -> Iterator[Event]:
    """By time, what is late after everything of the same time."""
    for event in kept:
        while late and late[0].mono_ns < event.mono_ns:
            yield late.popleft()
        yield event
    yield from late
