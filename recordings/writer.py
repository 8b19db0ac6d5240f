"""Writes a recording: crash-safe, self-describing, the same bytes for the same input.

A chunk ends with each second of recorded time (and at 256 KiB), so that a file that is cut anywhere loses at most its last second;
the file is synced to the disk once a second of real time. It grows under the name `X.part` and gets its own when it is complete;
what an earlier writing left behind stays.
"""

import errno
import os
import time
from collections.abc import Iterable, Mapping
from contextlib import suppress
from itertools import count
from pathlib import Path
from types import MappingProxyType, TracebackType
from typing import Self

from google.protobuf.message import Message
from mcap.writer import CompressionType, IndexType, Writer

from integrity.config import Protocol
from integrity.errors import ConfigError
from integrity.events import Event, RawBytes
from integrity.gnss.gps_time import NS_PER_S, utc_from_gps
from integrity.messages.inputs import encode_event
from recordings.channels import (
    ENCODING,
    PROFILE,
    STATION_TOPICS,
    message_type,
    raw_topic,
    receiver_of,
    receiver_topics,
    schema_bytes,
    topic_of,
)

CHUNK_BYTES = 256 * 1024
SYNC_EVERY_S = 0.9  # less than a second, since seconds of recorded time do not come evenly


class RecordingWriter:
    """`log_time` is UTC at the first event plus elapsed monotonic time: it never steps back.

    The channels of `topics` and `receivers` stand at the head of the file; one that is not named there is added when first written to.
    `protocols` are of the receivers whose bytes are not UBX.
    """

    def __init__(
        self,
        path: Path,
        software: str,
        start_gps_ns: int,
        start_mono_ns: int,
        metadata: Mapping[str, Mapping[str, str]],
        receivers: Iterable[str] = (),
        topics: Iterable[str] = STATION_TOPICS,
        protocols: Mapping[str, Protocol] = MappingProxyType({}),
    ) -> None:
        self._path = path
        self._protocols = protocols
        self.part = next(p for i in count() if not (p := path.with_name(f"{path.name}{f'.{i}' if i else ''}.part")).exists())
        if not path.parent.is_dir():
            raise ConfigError(f"{path}: there is no folder {path.parent} to write to; make it, or write elsewhere")
        self._file = self.part.open("wb")
        self._writer = Writer(
            self._file,
            chunk_size=CHUNK_BYTES,
            compression=CompressionType.ZSTD,
            index_types=IndexType.ATTACHMENT | IndexType.CHUNK | IndexType.METADATA,
            use_statistics=True,
            enable_crcs=True,
            enable_data_crcs=True,
        )
        self._writer.start(profile=PROFILE, library=software)
        self._schema_of: dict[str, int] = {}
        self._channel_of: dict[str, int] = {}
        for topic in (*topics, *receiver_topics(receivers)):
            self._channel(topic)
        for name, values in metadata.items():
            self.add_metadata(name, values)
        self._offset_ns = utc_from_gps(start_gps_ns) - start_mono_ns
        self._log_ns = utc_from_gps(start_gps_ns)
        self._second = self._log_ns // NS_PER_S
        self._sequence = 0
        self._synced_s = time.monotonic()
        self.synced_bytes = 0
        self.unflushed = 0  # messages
        self.unflushed_since_s = 0.0  # monotonic time of the first of them

    def write_event(self, event: Event) -> None:
        """Record what is decided on, at the time of its arrival."""
        if isinstance(event, RawBytes):
            self.write_raw(event.receiver, event.data, event.mono_ns)
        else:
            self.write(encode_event(event), event.mono_ns)

    def write_raw(self, receiver: str, data: bytes, mono_ns: int) -> None:
        """Record bytes of a receiver. They carry no time but their log time: ValueError where that would not be of `mono_ns`."""
        if mono_ns + self._offset_ns < self._log_ns:
            late_ns = self._log_ns - self._offset_ns - mono_ns
            raise ValueError(f"{self._path}: bytes of receiver {receiver} are {late_ns} ns older than what was recorded before them")
        self.add(raw_topic(receiver), data, mono_ns)

    def write(self, message: Message, mono_ns: int) -> None:
        """Record a message at a monotonic time."""
        self.add(topic_of(message), message.SerializeToString(deterministic=True), mono_ns)

    def write_output(self, message: Message) -> None:
        """Record a message at the time of what was recorded before it: the event that completed it."""
        self.add(topic_of(message), message.SerializeToString(deterministic=True), self._log_ns - self._offset_ns)

    def add(self, topic: str, data: bytes, mono_ns: int) -> None:
        """Record what is in its bytes already."""
        self._log_ns = max(self._log_ns, mono_ns + self._offset_ns)
        self.unflushed += 1
        if self._log_ns // NS_PER_S != self._second:
            self._second = self._log_ns // NS_PER_S
            self._writer.flush()
            self.unflushed = 1
            if time.monotonic() - self._synced_s >= SYNC_EVERY_S:
                self._sync()
        if self.unflushed == 1:
            self.unflushed_since_s = time.monotonic()
        channel = self._channel(topic)
        self._writer.add_message(channel, log_time=self._log_ns, publish_time=self._log_ns, sequence=self._sequence, data=data)
        self._sequence += 1

    def _channel(self, topic: str) -> int:
        if topic not in self._channel_of:
            kind = message_type(topic)
            raw: Protocol = self._protocols.get(receiver_of(topic) or "", "ubx")
            encoding, schema = (raw, 0) if kind is None else (ENCODING, self._schema(kind))
            self._channel_of[topic] = self._writer.register_channel(topic, encoding, schema)
        return self._channel_of[topic]

    def _schema(self, kind: type[Message]) -> int:
        name = kind.DESCRIPTOR.full_name
        if name not in self._schema_of:
            self._schema_of[name] = self._writer.register_schema(name, ENCODING, schema_bytes(kind))
        return self._schema_of[name]

    def add_metadata(self, name: str, values: Mapping[str, str]) -> None:
        """Words that go along with the recording."""
        self._writer.add_metadata(name, dict(values))

    def flush(self) -> None:
        """Everything written so far is on the disk when this returns."""
        self._writer.flush()
        self.unflushed = 0
        self._sync()

    def _sync(self) -> None:
        self._file.flush()
        os.fsync(self._file.fileno())
        if os.fstat(self._file.fileno()).st_nlink == 0:
            raise FileNotFoundError(errno.ENOENT, "deleted while it was written", str(self.part))
        self._synced_s = time.monotonic()
        self.synced_bytes = self._file.tell()

    def close(self) -> None:
        """Finish, sync, and give the file its name."""
        self._writer.finish()
        self._sync()
        self._file.close()
        self.part.replace(self._path)

    def abandon(self) -> None:
        """Leave the file under its name `.part`, with what had been flushed; nothing where nothing had been."""
        with suppress(OSError):  # of a full disk: closing tries to write once more
            self._file.close()
        with suppress(OSError):  # of a directory that is gone
            if not self.part.stat().st_size:
                self.part.unlink()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        if kind is None:
            self.close()
        else:
            self.abandon()
