"""Sound streams on which faults are played: events, what is decided without a fault, and memories to start from in the middle."""

from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

from integrity.assembler import nominal_epoch_ns
from integrity.config import SiteConfig
from integrity.events import Event, ObservationsReceived, StatusReceived, ToldApart
from integrity.outputs import EpochReport, Output
from integrity.reception import Reception
from integrity.states import State
from integrity.station_monitor import Snapshot, StationMonitor
from recordings.reader import read_recording
from recordings.replay import replayable

EPOCHS_BETWEEN_MEMORIES = 15  # at most so many are decided again before a fault begins, but on a stage of hours,
MOST_MEMORIES = 500  # of which each is some 60 kB


@dataclass(frozen=True, eq=False)
class Memory:
    """What the monitor remembers after the events before `place`; the first of the others is of an epoch at or after `epoch_ns`."""

    place: int
    epoch_ns: int
    snapshot: Snapshot


@dataclass(frozen=True, eq=False)
class Stage:
    """A sound stream of a site. `reports` by epoch are what is decided when nothing is wrong."""

    name: str
    site: SiteConfig
    events: tuple[Event, ...]
    epoch_ns: tuple[int, ...]
    reports: dict[int, EpochReport]
    memories: tuple[Memory, ...]

    def memory_before(self, gps_ns: int) -> Memory:
        """The last memory of what came before an epoch."""
        return self.memories[max(0, bisect_right(self.memories, gps_ns, key=lambda memory: memory.epoch_ns) - 1)]

    def events_until(self, memory: Memory, gps_ns: int) -> tuple[Event, ...]:
        """Events after a memory, up to those of epochs at or after `gps_ns`."""
        return self.events[memory.place : place_of_epoch(self.events, self.site, gps_ns, memory.place)]

    def sound_for(self, lasts_ns: int) -> list[int]:
        """Epochs from which on the station is NORMAL without exclusions for so long: faults may begin there, and whatever is said is of
        them. What is said without a fault is counted as false alarms, elsewhere."""
        last_ns = self.epoch_ns[-1] - lasts_ns
        found: list[int] = []
        spoilt_ns = self.epoch_ns[-1] + 1  # the next epoch that is not so
        for t in reversed(self.epoch_ns):
            if t in self._unsound_ns:
                spoilt_ns = t
            elif t <= last_ns and t + lasts_ns < spoilt_ns:
                found.append(t)
        return found[::-1]

    @cached_property
    def _unsound_ns(self) -> frozenset[int]:
        return frozenset(t for t in self.epoch_ns if self.reports[t].state is not State.NORMAL or self.reports[t].exclusions)


def stage_of(name: str, site: SiteConfig, events: Sequence[Event], snapshot: Snapshot | None = None) -> Stage:
    """Decide a sound stream of measurements from a memory on, and keep memories on the way."""
    monitor = StationMonitor(site, snapshot)
    outputs: list[Output] = []
    memories = [Memory(0, 0, monitor.snapshot())]
    begin = 0
    for end, epoch_ns in _cuts(events, site):
        outputs += monitor.feed(events[begin:end])
        memories.append(Memory(end, epoch_ns, monitor.snapshot()))
        begin = end
    outputs += monitor.feed(events[begin:])
    reports = {output.gps_time_ns: output for output in outputs if isinstance(output, EpochReport)}
    return Stage(name, site, tuple(events), tuple(reports), reports, tuple(memories))


def recorded_stage(path: Path) -> Stage:
    """A stage of a recording in which nothing was wrong; bytes are decoded once, before any fault. RecordingError as reading it does."""
    recording = replayable(read_recording(path))
    site = recording.site.config
    reception = Reception(site.receiver_names, recording.snapshot.reception if recording.snapshot else (), site.protocols)
    heard = (decoded for event in recording.events for decoded in reception.take(event))
    events = [event for event in heard if not isinstance(event, StatusReceived | ToldApart)]
    return stage_of(path.name, site, events, recording.snapshot)


def place_of_epoch(events: Sequence[Event], site: SiteConfig, gps_ns: int, first: int = 0) -> int:
    """Where the measurements of epochs at or after a GPS time begin; the end of the events where there are none."""
    for place in range(first, len(events)):
        event = events[place]
        if isinstance(event, ObservationsReceived) and nominal_epoch_ns(event.row.receive_time_ns, site.epoch_interval_ns) >= gps_ns:
            return place
    return len(events)


def _cuts(events: Sequence[Event], site: SiteConfig) -> list[tuple[int, int]]:
    """Places between epochs, so many epochs apart, and the epoch that follows each."""
    begins: list[tuple[int, int]] = []
    last_ns = 0
    for place, event in enumerate(events):
        if isinstance(event, ObservationsReceived):
            epoch_ns = nominal_epoch_ns(event.row.receive_time_ns, site.epoch_interval_ns)
            if epoch_ns > last_ns:
                begins.append((place, epoch_ns))
                last_ns = epoch_ns
    apart = max(EPOCHS_BETWEEN_MEMORIES, len(begins) // MOST_MEMORIES)
    return begins[apart::apart]
