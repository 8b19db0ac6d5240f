"""Records a running program that decides: a thread of its own behind a bounded queue. Who decides never waits for the disk.

Theory of operation. The deciding thread hands over what it decides on (`event`) and what came out (`output`). The recording thread turns
it into files, which begin with what the `Manner` puts at their head and a snapshot of the whole memory, so that a file can be decided
alone. A snapshot can only be taken between two decisions; so the deciding thread asks `wants_file` before each (each
hour of UTC, and after trouble), and answers with `begin`: a new file, a new generation. Each variable is written by one of the two
threads only, so that none of them ever waits for a lock.

A file never hides a gap. Where something could not be taken (the queue is full) or not be written (the disk is full, the directory is
gone), its generation is over; whatever comes then is counted as lost, until the next `begin`.
"""

import errno
import os
import time
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from itertools import count
from pathlib import Path
from queue import Empty, SimpleQueue
from threading import Thread
from typing import Generic, NamedTuple, Protocol, TypeVar

from google.protobuf.message import Message

from integrity import SOFTWARE
from integrity.config import Protocol as StreamProtocol
from integrity.errors import ConfigError
from integrity.events import RawBytes
from integrity.gnss.gps_time import NS_PER_S, format_calendar, utc_from_gps
from recordings.writer import RecordingWriter

MOST_ENTRIES = 20_000  # waiting: some four minutes of three receivers at 10 Hz
MOST_BYTES = 64 * 1024 * 1024  # waiting
EVENT_BYTES = 200  # of an event without the bytes that it carries
FLUSH_AFTER_S = 1.2  # a chunk ends with each second of UTC; where nothing comes any more, this long after it began
RETRY_AFTER_S = 10.0
CLOSE_WITHIN_S = 10.0
HOUR_NS = 3600 * NS_PER_S
NO_ROOM = {errno.ENOSPC, errno.EDQUOT, errno.EFBIG}


class Timed(Protocol):
    """An event: it came at a time of the monotonic clock."""

    @property
    def mono_ns(self) -> int:
        """Of its arrival."""


T = TypeVar("T", bound=Timed)


@dataclass(frozen=True)
class Manner(Generic[T]):
    """How one program records: the name that its files begin with, their topics, the receivers that have topics of their own; the head
    of a file that begins at a GPS and a monotonic time; the message of an event that is no RawBytes; what is written after an output;
    the protocols of the receivers whose bytes are not UBX."""

    name: str
    topics: Iterable[str]
    receivers: Iterable[str]
    head: Callable[[int, int], Message]
    encode: Callable[[T], Message]
    after: Callable[[Message], Iterable[Message]]
    protocols: Mapping[str, StreamProtocol] = field(default_factory=dict)


class _Begin(NamedTuple):
    """A new file; `dropped` entries were not taken between the last one and this."""

    generation: int
    snapshot: Message
    mono_ns: int
    gps_ns: int
    dropped: int


class _Close(NamedTuple):
    dropped: int


def check_directory(directory: Path) -> None:
    """Make the directory where it is not there yet; ConfigError where a recording could not be written to it."""
    probe = directory / f".wayside-{os.getpid()}"
    try:
        directory.mkdir(parents=True, exist_ok=True)
        probe.write_bytes(bytes(4096))
        probe.unlink()
    except OSError as error:
        raise ConfigError(
            f"[record] directory {directory}: cannot be written to ({error.strerror}); give a directory that belongs to the user "
            "that this program runs as, on a disk with room"
        ) from None


class Recorder(Generic[T]):
    """All methods are for one thread, the one that decides. `say` is told, once each, that recording stops and that it goes on."""

    def __init__(self, directory: Path, manner: Manner[T], say: Callable[[str], None]) -> None:
        self._directory = directory
        self._say = say
        self._queue: SimpleQueue[tuple[int, T | Message | _Begin | _Close]] = SimpleQueue()
        self._files = _Files(directory, manner, say)
        self._generation = 0
        self._offset_ns = 0
        self._hour = 0
        self._overflowed = False
        self._dropped = 0
        self._dropped_before = 0  # the generation in hand
        self._put_bytes = 0
        self._taken_bytes = 0  # written by the recording thread
        self._thread = Thread(target=self._run, name="recorder", daemon=True)
        self._thread.start()

    def wants_file(self, mono_ns: int) -> bool:
        """Whether a new file should begin before an event of that monotonic time is handed over: with each hour, and after trouble."""
        if self._files.failed_generation == self._generation:
            return time.monotonic() >= self._files.retry_s
        if self._overflowed:
            return self._queue.qsize() <= MOST_ENTRIES // 2 and self._put_bytes - self._taken_bytes <= MOST_BYTES // 2
        return (mono_ns + self._offset_ns) // HOUR_NS > self._hour

    def begin(self, snapshot: Message, mono_ns: int, gps_ns: int) -> None:
        """A new file. `mono_ns` is of the next event, `gps_ns` the GPS time at that moment: log times are counted from there."""
        self._generation += 1
        utc_ns, by_last_file_ns = utc_from_gps(gps_ns), mono_ns + self._offset_ns
        self._offset_ns = utc_ns - mono_ns
        jitter = 0 < by_last_file_ns - utc_ns < NS_PER_S  # then the hour that has just begun would begin once more
        self._hour = (by_last_file_ns if jitter else utc_ns) // HOUR_NS
        self._overflowed = False
        dropped, self._dropped_before = self._dropped - self._dropped_before, self._dropped
        self._put(_Begin(self._generation, snapshot, mono_ns, gps_ns, dropped), snapshot.ByteSize())

    def event(self, event: T) -> None:
        """Record what is about to be decided on."""
        self._take(event, EVENT_BYTES + (len(event.data) if isinstance(event, RawBytes) else 0))

    def output(self, message: Message) -> None:
        """Record what came of the events handed over last. The message must not be changed any more."""
        self._take(message, message.ByteSize())

    def close(self) -> None:
        """Write what is waiting and finish the file; ten seconds at most, where a disk does not answer."""
        self._put(_Close(self._dropped - self._dropped_before), 0)
        self._thread.join(CLOSE_WITHIN_S)
        if self._thread.is_alive():
            self._say(f"{self._directory}: the disk does not answer; `wayside recording recover` saves what reached it")

    @property
    def lost(self) -> int:
        """Entries that are in no file."""
        return self._dropped + self._files.unwritten

    @property
    def bytes_written(self) -> int:
        """On the disk, in all files of this run."""
        return self._files.bytes_written

    @property
    def file(self) -> Path | None:
        """What the file that grows now will be called; None while nothing is recorded."""
        return self._files.path

    def _take(self, item: T | Message, size: int) -> None:
        if self._overflowed or self._files.failed_generation == self._generation:
            self._dropped += 1
        elif self._queue.qsize() >= MOST_ENTRIES or self._put_bytes - self._taken_bytes >= MOST_BYTES:
            self._overflowed = True
            self._dropped += 1
            self._say(
                f"{self._directory}: the disk is too slow, {self._queue.qsize()} entries are waiting for it; the recording has a gap here, "
                "decisions go on; use a faster disk, or one that nothing else writes to"
            )
        else:
            self._put(item, size)

    def _put(self, item: T | Message | _Begin | _Close, size: int) -> None:
        self._put_bytes += size
        self._queue.put((size, item))

    def _run(self) -> None:
        item: T | Message | _Begin | _Close | None = None
        while not isinstance(item, _Close):
            try:
                size, item = self._queue.get(timeout=self._files.seconds_to_flush())
            except Empty:
                size, item = 0, None
            self._files.take(item)
            self._taken_bytes += size


class _Files(Generic[T]):
    """One file after the other; for the recording thread alone, but for the attributes without underscore, which anyone may read."""

    def __init__(self, directory: Path, manner: Manner[T], say: Callable[[str], None]) -> None:
        self._directory = directory
        self._manner = manner
        self._say = say
        self._writer: RecordingWriter | None = None
        self._generation = 0
        self._failing = False
        self._missing = 0  # entries, not yet spoken of
        self._head_bytes = 0
        self._finished_bytes = 0
        self.failed_generation = 0  # before the first file, nothing can be recorded either
        self.retry_s = 0.0  # monotonic
        self.unwritten = 0
        self.bytes_written = 0
        self.path: Path | None = None

    def seconds_to_flush(self) -> float | None:
        """How long what was written may wait for more; None where nothing waits."""
        if self._writer is None or not self._writer.unflushed:
            return None
        return max(0.0, self._writer.unflushed_since_s + FLUSH_AFTER_S - time.monotonic())

    def take(self, item: T | Message | _Begin | _Close | None) -> None:
        """Write what came, if anything. Whatever goes wrong ends the file in hand, never the thread."""
        try:
            match item:
                case None:
                    pass
                case _Begin():
                    self._begin(item)
                case _Close():
                    self._finish(item.dropped)
                case _:
                    self._write(item)
            if self._writer is not None:
                self._to_disk(self._writer)
        except Exception as error:
            self._fail(error)
        self.bytes_written = self._finished_bytes + (self._writer.synced_bytes if self._writer else 0)

    def _to_disk(self, writer: RecordingWriter) -> None:
        if self.seconds_to_flush() == 0.0:
            writer.flush()
        if writer.synced_bytes > self._head_bytes:
            self._goes_on()

    def _write(self, item: T | Message) -> None:
        if self._writer is None:
            self._lose(1)
        elif isinstance(item, Message):
            self._writer.write_output(item)
            for message in self._manner.after(item):
                self._writer.write_output(message)
        elif isinstance(item, RawBytes):
            self._writer.write_raw(item.receiver, item.data, item.mono_ns)
        else:
            self._writer.write(self._manner.encode(item), item.mono_ns)

    def _begin(self, begin: _Begin) -> None:
        self._generation = begin.generation
        self._finish(begin.dropped)
        self._missing += begin.dropped
        self._directory.mkdir(parents=True, exist_ok=True)
        manner = self._manner
        path = _unused(self._directory, manner.name, utc_from_gps(begin.gps_ns))
        times = (begin.gps_ns, begin.mono_ns)
        self._writer = RecordingWriter(path, SOFTWARE, *times, {}, manner.receivers, manner.topics, manner.protocols)
        self._writer.write(manner.head(begin.gps_ns, begin.mono_ns), begin.mono_ns)
        self._writer.write(begin.snapshot, begin.mono_ns)
        self._writer.flush()
        self._head_bytes = self._writer.synced_bytes
        self.path = path

    def _finish(self, dropped: int) -> None:
        if self._writer is None:
            return
        if dropped:
            self._writer.add_metadata("recorder", {"dropped": str(dropped)})
        self._writer.close()
        self._finished_bytes += self._writer.synced_bytes
        self._goes_on()
        self._writer, self.path = None, None

    def _goes_on(self) -> None:
        """To be said when more than the head of a file is on the disk: on a disk that is nearly full, heads may fit again and again."""
        if self._failing or self._missing:
            self._say(f"{self.path}: recording again; {self._missing} entries are in no file")
        self._failing, self._missing = False, 0

    def _lose(self, entries: int) -> None:
        self.unwritten += entries
        self._missing += entries

    def _fail(self, error: Exception) -> None:
        if self._writer is not None:
            self._lose(self._writer.unflushed)
            self._finished_bytes += self._writer.synced_bytes
            self._writer.abandon()
        self._writer, self.path = None, None
        self.retry_s = time.monotonic() + RETRY_AFTER_S
        self.failed_generation = self._generation  # last: from here on the deciding thread looks at the others
        if not self._failing:
            self._failing = True
            self._say(
                f"{self._directory}: {_why(error)}; recording stops, decisions go on, a new file is tried every {RETRY_AFTER_S:.0f} s"
            )


def _unused(directory: Path, name: str, utc_ns: int) -> Path:
    """The name of a file that begins at a time of the Unix scale, with a number where there is one already, complete or not."""
    stamp = format_calendar(utc_ns - utc_ns % NS_PER_S).replace("-", "").replace(":", "")
    for n in count():
        path = directory / f"{name}-{stamp}Z{f'-{n}' if n else ''}.mcap"
        if not path.exists() and not path.with_name(f"{path.name}.part").exists():
            return path
    raise AssertionError("count() does not end")


def _why(error: Exception) -> str:
    if not isinstance(error, OSError):
        return f"{type(error).__name__}: {error}: a defect of Wayside, please report it"
    remedy = "make room on the disk" if error.errno in NO_ROOM else "see that the directory is there and that the station may write to it"
    return f"cannot be written to ({error.strerror}): {remedy}"
