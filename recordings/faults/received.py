"""What a station hears in a recording, and where the bytes stand that say it: so that a fault changes these bytes and no others."""

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

from integrity.config import Protocol, SiteConfig
from integrity.errors import ConfigError
from integrity.events import Event, Heard, ObservationsReceived, RawBytes
from integrity.gnss.rtcm import framing as rtcm
from integrity.gnss.rtcm.msm import MSM_NUMBERS, header_of
from integrity.gnss.rtcm.navigation_tables import EPHEMERIS_NUMBERS
from integrity.gnss.ubx import framing as ubx
from integrity.gnss.ubx.rawx import RXM_RAWX
from integrity.gnss.ubx.rxm_raw import RXM_RAW
from integrity.gnss.ubx.sfrbx import RXM_SFRBX
from integrity.reception import Reception, ReceptionMemory
from integrity.station_monitor import Snapshot


class FrameAt(NamedTuple):
    """A sound frame in the bytes of a receiver, counted from the first one in the events; below 0: it began before them.

    Complete with the event at `place`. `kind`: class and id of UBX, the number of an RTCM message (its payload here).
    """

    receiver: str
    place: int
    begin: int
    end: int
    protocol: Protocol
    kind: tuple[int, ...]
    payload: bytes

    def with_payload(self, payload: bytes) -> bytes:
        """The bytes of such a frame, checksum included. ValueError for a payload that no frame can hold."""
        return rtcm.frame_bytes(payload) if self.protocol == "rtcm3" else ubx.frame_bytes(self.kind[0], self.kind[1], payload)


class Burst(NamedTuple):
    """The frames of one row, the last of which completes it; `since` is where the bytes begin that came after those of the row before."""

    since: int
    frames: tuple[FrameAt, ...]

    @property
    def end(self) -> int:
        """Where the bytes end."""
        return self.frames[-1].end


class WordsAt(NamedTuple):
    """A frame of navigation words, or an RTCM ephemeris, and the GPS time at which it came; None before the first measurements."""

    frame: FrameAt
    near_ns: int | None


@dataclass(frozen=True, eq=False)
class Received:
    """The events of a recording with all bytes decoded, each with the place of the event that says it among those of the recording.

    `as_bytes`: whether each came so. `bursts`: of the measurements among these, by their place here; those of which a frame began before
    the events are left out: half of it is not there to be changed. `sizes`: how many bytes of each receiver there are.
    """

    events: tuple[Heard, ...]
    origins: tuple[int, ...]
    as_bytes: tuple[bool, ...]
    sizes: Mapping[str, int]
    bursts: Mapping[int, Burst]
    words: tuple[WordsAt, ...]


class Measured(NamedTuple):
    """Measurements of a receiver and their time by its clock, complete with the event at `place`; `burst` where they came as bytes."""

    receiver: str
    place: int
    receive_time_ns: int
    burst: Burst | None


def receive(events: Sequence[Event], site: SiteConfig, snapshot: Snapshot | None) -> Received:
    """Decode as a station does that begins with `snapshot`; what receivers say of themselves is left out.

    ConfigError for measurements in a message that cannot be written.
    """
    memories = {memory.receiver: memory for memory in (snapshot.reception if snapshot else ())}
    reception = Reception(site.receiver_names, (replace(memory, pending=b"") for memory in memories.values()), site.protocols)
    streams = {name: _Stream(memories.get(name, ReceptionMemory(name)), kind) for name, kind in site.protocols.items()}
    found: list[tuple[Heard, int]] = []
    bursts: dict[int, Burst] = {}
    words: list[WordsAt] = []
    for place, event in enumerate(events):
        if not isinstance(event, RawBytes):
            found += [(heard, place) for heard in reception.take(event)]
        elif event.receiver in streams:
            stream = streams[event.receiver]
            reception.take(replace(event, data=b""))  # a stream begins with its first bytes, a frame or not
            for frame in stream.frames(event.data, place):
                heard_now = _heard(reception, frame, event)
                if _tells_orbits(frame):
                    words.append(WordsAt(frame, None if stream.clock_ns is None else stream.clock_ns + event.mono_ns))
                rows = [heard.row for heard in heard_now if isinstance(heard, ObservationsReceived)]
                changeable = iter(stream.bursts(frame, len(rows), reception))
                for heard in heard_now:
                    if isinstance(heard, ObservationsReceived):
                        stream.clock_ns = heard.row.receive_time_ns - heard.mono_ns
                        burst = next(changeable)
                        if burst is None:
                            continue
                        bursts[len(found)] = burst
                    found.append((heard, place))
    origins = tuple(place for _, place in found)
    return Received(
        events=tuple(heard for heard, _ in found),
        origins=origins,
        as_bytes=tuple(isinstance(events[origin], RawBytes) for origin in origins),
        sizes=Counter({name: stream.size for name, stream in streams.items()}),
        bursts=bursts,
        words=tuple(words),
    )


def measured(events: Sequence[Event], site: SiteConfig, snapshot: Snapshot | None) -> Iterator[Measured]:
    """The measurements of the site's receivers in events, in order; without those of which a frame began before the events."""
    received = receive(events, site, snapshot)
    for place, event in enumerate(received.events):
        if isinstance(event, ObservationsReceived) and event.row.receiver in site.receiver_names:
            yield Measured(event.row.receiver, received.origins[place], event.row.receive_time_ns, received.bursts.get(place))


def _heard(reception: Reception, frame: FrameAt, event: RawBytes) -> list[Heard]:
    """What a frame says, if it is of measurements or orbits."""
    if frame.protocol == "ubx":
        if frame.kind == RXM_RAW:
            raise ConfigError(
                f"receiver {frame.receiver} sends RXM-RAW (u-blox before generation 8), which faults cannot be put into: "
                "convert its log to RINEX, and import that"
            )
        known = frame.kind in (RXM_RAWX, RXM_SFRBX)
    else:
        known = frame.kind[0] in MSM_NUMBERS | EPHEMERIS_NUMBERS
    return reception.take(replace(event, data=frame.with_payload(frame.payload))) if known else []


def _tells_orbits(frame: FrameAt) -> bool:
    return frame.kind == RXM_SFRBX if frame.protocol == "ubx" else frame.kind[0] in EPHEMERIS_NUMBERS


class _Stream:
    """One receiver's bytes. `clock_ns`: GPS time minus monotonic time, by its last measurements; `size`: how many bytes have come."""

    def __init__(self, memory: ReceptionMemory, protocol: Protocol) -> None:
        self._receiver, self._protocol = memory.receiver, protocol
        self._framer = rtcm.RtcmFramer(memory.pending) if protocol == "rtcm3" else ubx.Framer(memory.pending)
        self._open: list[FrameAt | None] = [None] * len(memory.rtcm.open_messages)  # of a row that waits for more; None: before the events
        self._since = 0
        self.clock_ns: int | None = None
        self.size = 0

    def frames(self, data: bytes, place: int) -> Iterator[FrameAt]:
        """The first bytes equal to a sound frame are this frame: the framer passes over no sound one."""
        pending = self._framer.pending
        buffer, first = pending + data, self.size - len(pending)
        self.size += len(data)
        at = 0
        for kind, payload in _framed(self._framer, data):
            frame = FrameAt(self._receiver, place, 0, 0, self._protocol, kind, payload)
            whole = frame.with_payload(payload)
            at = buffer.index(whole, at)
            yield frame._replace(begin=first + at, end=first + at + len(whole))
            at += len(whole)

    def bursts(self, frame: FrameAt, n_rows: int, reception: Reception) -> list[Burst | None]:
        """Of the rows that a frame completed; None for one that cannot be changed.

        A message of RTCM that says that no more follow completes its own row; any may show that the one before it is over.
        """
        if frame.protocol == "ubx":
            return [self._burst([frame]) for _ in range(n_rows)]
        header = header_of(frame.payload) if frame.kind[0] in MSM_NUMBERS else None
        if header is None:
            return []
        if n_rows == 0:
            if header.more and self._waiting(reception) > len(self._open):
                self._open.append(frame)
            return []
        over, self._open = self._open, [frame] if header.more else []
        if n_rows == 2:
            return [self._burst(over), self._burst([frame])]
        return [self._burst(over if header.more else [*over, frame])]

    def _waiting(self, reception: Reception) -> int:
        """How many messages of a row that is not complete the decoder has taken."""
        return next(len(memory.rtcm.open_messages) for memory in reception.memories() if memory.receiver == self._receiver)

    def _burst(self, frames: Sequence[FrameAt | None]) -> Burst | None:
        since, whole = self._since, tuple(frame for frame in frames if frame is not None)
        self._since = whole[-1].end if whole else since
        return Burst(since, whole) if len(whole) == len(frames) and whole[0].begin >= 0 else None


def _framed(framer: rtcm.RtcmFramer | ubx.Framer, data: bytes) -> Iterator[tuple[tuple[int, ...], bytes]]:
    """Kind and payload of each sound frame; RTCM messages too short to have a number are passed over."""
    if isinstance(framer, rtcm.RtcmFramer):
        for message in framer.feed(data):
            number = rtcm.message_number(message)
            if number is not None:
                yield (number,), message
    else:
        for message_class, message_id, payload in framer.feed(data):
            yield (message_class, message_id), payload
