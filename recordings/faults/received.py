"""What a station hears in a recording, and where the bytes stand that say it: so that a fault changes these bytes and no others."""

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

from integrity.config import SiteConfig
from integrity.errors import ConfigError
from integrity.events import Event, Heard, ObservationsReceived, RawBytes
from integrity.gnss.ubx.framing import Framer, frame_bytes
from integrity.gnss.ubx.rawx import RXM_RAWX, decode_rawx
from integrity.gnss.ubx.rxm_raw import RXM_RAW
from integrity.gnss.ubx.sfrbx import RXM_SFRBX
from integrity.reception import Reception
from integrity.station_monitor import Snapshot


class FrameAt(NamedTuple):
    """A sound frame in the bytes of a receiver, counted from the first one in the events; below 0: it began before them.

    Complete with the event at `place`; `since` is where the bytes begin that came after the receiver's measurements before.
    """

    receiver: str
    place: int
    since: int
    begin: int
    end: int
    kind: tuple[int, int]
    payload: bytes


class WordsAt(NamedTuple):
    """A frame of navigation words, and the GPS time at which it came; None before the receiver's first measurements."""

    frame: FrameAt
    near_ns: int | None


@dataclass(frozen=True, eq=False)
class Received:
    """The events of a recording with all bytes decoded, each with the place of the event that says it among those of the recording.

    `as_bytes`: whether each came so. `frames`: of the measurements among these, by their place here; those whose frame began before the
    events are left out: half of it is not there to be changed. `sizes`: how many bytes of each receiver there are.
    """

    events: tuple[Heard, ...]
    origins: tuple[int, ...]
    as_bytes: tuple[bool, ...]
    sizes: Mapping[str, int]
    frames: Mapping[int, FrameAt]
    words: tuple[WordsAt, ...]


class Measured(NamedTuple):
    """Measurements of a receiver and their time by its clock, complete with the event at `place`; `frame` where they came as bytes."""

    receiver: str
    place: int
    receive_time_ns: int
    frame: FrameAt | None


def receive(events: Sequence[Event], site: SiteConfig, snapshot: Snapshot | None) -> Received:
    """Decode as a station does that begins with `snapshot`; what receivers say of themselves is left out.

    ConfigError for bytes of a receiver that does not send UBX, or measurements in a message that cannot be written.
    """
    reception = Reception(site.receiver_names, (replace(memory, pending=b"") for memory in (snapshot.reception if snapshot else ())))
    found: list[tuple[Heard, int]] = []
    frames: dict[int, FrameAt] = {}
    words: list[WordsAt] = []
    sizes: dict[str, int] = Counter()
    for event in events:
        if isinstance(event, RawBytes):
            sizes[event.receiver] += len(event.data)
    clocks: dict[str, int] = {}  # GPS time minus monotonic time
    for event, place, frame in _frames(events, site, snapshot):
        if frame is None:
            found.append((_decoded(event), place))
            continue
        if frame.kind == RXM_SFRBX:
            clock = clocks.get(frame.receiver)
            words.append(WordsAt(frame, None if clock is None else clock + event.mono_ns))
        elif frame.kind == RXM_RAW:
            raise ConfigError(
                f"receiver {frame.receiver} sends RXM-RAW (u-blox before generation 8), which faults cannot be put into: "
                "convert its log to RINEX, and import that"
            )
        elif frame.kind != RXM_RAWX:
            continue
        for heard in reception.take(RawBytes(event.mono_ns, frame.receiver, frame_bytes(*frame.kind, frame.payload))):
            if isinstance(heard, ObservationsReceived):
                clocks[frame.receiver] = heard.row.receive_time_ns - heard.mono_ns
                if frame.begin < 0:
                    continue
                frames[len(found)] = frame
            found.append((heard, place))
    origins = tuple(place for _, place in found)
    return Received(
        events=tuple(heard for heard, _ in found),
        origins=origins,
        as_bytes=tuple(isinstance(events[origin], RawBytes) for origin in origins),
        sizes=sizes,
        frames=frames,
        words=tuple(words),
    )


def measured(events: Sequence[Event], site: SiteConfig, snapshot: Snapshot | None) -> Iterator[Measured]:
    """The measurements of the site's receivers in events, in order; without those whose frame began before the events."""
    for event, place, frame in _frames(events, site, snapshot):
        if isinstance(event, ObservationsReceived) and event.row.receiver in site.receiver_names:
            yield Measured(event.row.receiver, place, event.row.receive_time_ns, None)
        elif frame is not None and frame.kind == RXM_RAWX and frame.begin >= 0:
            (row,) = decode_rawx([frame.payload], frame.receiver)
            if row is not None:
                yield Measured(row.receiver, place, row.receive_time_ns, frame)


def _decoded(event: Event) -> Heard:
    assert not isinstance(event, RawBytes)
    return event


def _frames(events: Sequence[Event], site: SiteConfig, snapshot: Snapshot | None) -> Iterator[tuple[Event, int, FrameAt | None]]:
    """Events with their places; bytes of the site's receivers once for each sound frame that they complete, others are passed over."""
    pending = {memory.receiver: memory.pending for memory in (snapshot.reception if snapshot else ())}
    streams = {receiver: _Stream(receiver, pending.get(receiver, b"")) for receiver in site.receiver_names}
    for place, event in enumerate(events):
        if not isinstance(event, RawBytes):
            yield event, place, None
        elif site.protocols.get(event.receiver) == "rtcm3":
            raise ConfigError(
                f"receiver {event.receiver} sends RTCM 3: faults can be put into UBX and into decoded measurements only, not into its bytes"
            )
        elif event.receiver in streams:
            for frame in streams[event.receiver].frames(event.data, place):
                yield event, place, frame


class _Stream:
    """One receiver's bytes."""

    def __init__(self, receiver: str, pending: bytes) -> None:
        self._receiver = receiver
        self._framer = Framer(pending)
        self._next = 0  # where the next event's bytes begin
        self._since = 0

    def frames(self, data: bytes, place: int) -> Iterator[FrameAt]:
        """The first bytes equal to a sound frame are this frame: the framer passes over no sound one."""
        pending = self._framer.pending
        buffer = pending + data
        first = self._next - len(pending)
        self._next += len(data)
        at = 0
        for message_class, message_id, payload in self._framer.feed(data):
            whole = frame_bytes(message_class, message_id, payload)
            at = buffer.index(whole, at)
            begin, end = first + at, first + at + len(whole)
            frame = FrameAt(self._receiver, place, self._since, begin, end, (message_class, message_id), payload)
            yield frame
            if frame.kind == RXM_RAWX:
                self._since = end
            at += len(whole)
