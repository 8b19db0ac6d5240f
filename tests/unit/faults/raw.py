"""A simulated stream as measurements and as bytes, with the same faults in both."""

from collections.abc import Sequence

from integrity.events import Event, RawBytes
from integrity.gnss.gps_time import NS_PER_S
from integrity.gnss.ubx.framing import Frame, Framer
from integrity.outputs import HealthReport
from recordings.faults import Fault, inject
from recordings.faults.kinds import Effect
from recordings.simulate.observations import antennas_of
from recordings.simulate.receiver import as_bytes
from tests.unit.streams import SITE, START_NS, new_monitor, stream

SECONDS = 120
MEASURED = stream(SECONDS)
BYTES = as_bytes(MEASURED, antennas_of(SITE))


def fault(effect: Effect, start_s: float = 40.0, end_s: float | None = 80.0) -> Fault:
    return Fault(START_NS + round(start_s * NS_PER_S), None if end_s is None else START_NS + round(end_s * NS_PER_S), effect)


def with_fault(events: Sequence[Event], effect: Effect, start_s: float = 40.0, end_s: float | None = 80.0) -> tuple[Event, ...]:
    return inject(events, [fault(effect, start_s, end_s)], SITE)


def decided(events: Sequence[Event]) -> list[tuple[object, ...]]:
    """State, cause and who, epoch by epoch and silence by silence."""
    found = [out for out in new_monitor().feed(events) if isinstance(out, HealthReport)]
    return [(out.mono_ns, out.gps_time_ns, out.state, out.cause, out.subjects, out.excluded) for out in found]


def stream_of(events: Sequence[Event], receiver: str) -> bytes:
    return b"".join(event.data for event in events if isinstance(event, RawBytes) and event.receiver == receiver)


def framed(events: Sequence[Event], receiver: str) -> tuple[list[Frame], int, int]:
    """The sound frames of a receiver, how many were not, and bytes outside of frames."""
    framer = Framer()
    return framer.feed(stream_of(events, receiver)), framer.bad_frames, framer.skipped_bytes


def recut(events: Sequence[Event], size: int) -> tuple[Event, ...]:
    """The bytes of each receiver in other pieces: each event keeps all but its last bytes, which come with the next one."""
    rest = dict.fromkeys(SITE.receiver_names, b"")
    last = {event.receiver: place for place, event in enumerate(events) if isinstance(event, RawBytes)}
    out: list[Event] = []
    for place, event in enumerate(events):
        if isinstance(event, RawBytes):
            data = rest[event.receiver] + event.data
            keep = len(data) if place == last[event.receiver] else max(0, len(data) - size)
            rest[event.receiver] = data[keep:]
            out.append(RawBytes(event.mono_ns, event.receiver, data[:keep]))
        else:
            out.append(event)
    return tuple(out)
