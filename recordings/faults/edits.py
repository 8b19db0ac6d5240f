"""What faults have made of a recording so far, and what becomes of its bytes."""

from collections.abc import Iterator
from dataclasses import dataclass, field

from integrity.events import Event, ObservationsReceived
from integrity.gnss.observations import ObservationRow
from recordings.faults.measurements import rewritten
from recordings.faults.msm_measurements import rewritten_msm
from recordings.faults.received import FrameAt, Received
from recordings.faults.splicing import Edit
from recordings.faults.truth import Truth


@dataclass
class Changes:
    """Rows and events by their place among what was received, frames by where they are.

    `repeats`: the row that is sent in place of another.
    """

    rows: dict[int, ObservationRow]
    repeats: dict[int, int] = field(default_factory=dict)
    dropped: set[int] = field(default_factory=set)
    before: dict[int, list[Event]] = field(default_factory=dict)
    instead: dict[int, Event] = field(default_factory=dict)
    words: dict[FrameAt, bytes] = field(default_factory=dict)


def edits_of(received: Received, changes: Changes, truth: Truth) -> Iterator[Edit]:
    """What becomes of the bytes. Of a receiver that is silent, all that came since its measurements before is gone."""
    for frame, payload in changes.words.items():
        yield Edit(frame.receiver, frame.begin, frame.end, frame.with_payload(payload))
    last = {burst.frames[0].receiver: place for place, burst in received.bursts.items()}
    for place, burst in received.bursts.items():
        receiver = burst.frames[0].receiver
        if place in changes.dropped:
            yield Edit(receiver, burst.since, received.sizes[receiver] if place == last[receiver] else burst.end, b"")
        elif changes.rows[place] is not row_at(received, place):
            frames = _frames_now(received, place, changes, truth)
            if len(frames) != len(burst.frames):  # a row of more messages, or fewer, is repeated: they come with the last one
                frames = [b""] * (len(burst.frames) - 1) + [b"".join(frames)]
            for frame, now in zip(burst.frames, frames, strict=True):
                yield Edit(receiver, frame.begin, frame.end, now)


def row_at(received: Received, place: int) -> ObservationRow:
    """The row as it was recorded."""
    event = received.events[place]
    assert isinstance(event, ObservationsReceived)
    return event.row


def _frames_now(received: Received, place: int, changes: Changes, truth: Truth) -> list[bytes]:
    """The frames of a row, or of the one that is sent in its place."""
    source = changes.repeats.get(place, place)
    own, sent = received.bursts[place].frames, received.bursts[source].frames
    was, now = row_at(received, source), changes.rows[place]
    if own[0].protocol == "rtcm3":
        wavelengths_m = truth.wavelengths_m(was.signals)
        return [frame.with_payload(rewritten_msm(frame.payload, was, now, wavelengths_m)) for frame in sent]
    later_ns = now.receive_time_ns - row_at(received, place).receive_time_ns
    return [own[0].with_payload(rewritten(own[0].payload, sent[0].payload, was, now, later_ns))]
