"""Writes a recording: crash-safe, self-describing, the same bytes for the same input.

A chunk ends with each second of recorded time (and at 256 KiB), so that a file that is cut anywhere loses at most its last second;
the file is synced to the disk once a second of real time. It grows under the name `X.part` and gets its own when it is complete;
what an earlier writing left behind stays.
"""

import os
import time
from collections.abc import Mapping
from itertools import count
from pathlib import Path
from types import TracebackType
from typing import Self

from google.protobuf.message import Message
from mcap.writer import CompressionType, IndexType, Writer

from integrity.errors import ConfigError
from integrity.gnss.gps_time import NS_PER_S, utc_from_gps
from recordings.channels import ENCODING, PROFILE, TOPICS, schema_bytes, topic_of

CHUNK_BYTES = 256 * 1024


class RecordingWriter:
    """`log_time` is UTC at the first event plus elapsed monotonic time: it never steps back."""

    def __init__(self, path: Path, software: str, start_gps_ns: int, start_mono_ns: int, metadata: Mapping[str, Mapping[str, str]]) -> None:
        self._path = path
        self._part = next(p for i in count() if not (p := path.with_name(f"{path.name}{f'.{i}' if i else ''}.part")).exists())
        if not path.parent.is_dir():
            raise ConfigError(f"{path}: there is no folder {path.parent} to write to; make it, or write elsewhere")
        self._file = self._part.open("wb")
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
        schema = schema_bytes()
        self._channel_of = {
            topic: self._writer.register_channel(
                topic, ENCODING, self._writer.register_schema(message_type.DESCRIPTOR.full_name, ENCODING, schema)
            )
            for topic, message_type in TOPICS.items()
        }
        for name, values in metadata.items():
            self._writer.add_metadata(name, dict(values))
        self._offset_ns = utc_from_gps(start_gps_ns) - start_mono_ns
        self._log_ns = utc_from_gps(start_gps_ns)
        self._second = self._log_ns // NS_PER_S
        self._sequence = 0
        self._synced = time.monotonic()

    def write(self, message: Message, mono_ns: int) -> None:
        """Record a message at a monotonic time."""
        self._log_ns = max(self._log_ns, mono_ns + self._offset_ns)
        if self._log_ns // NS_PER_S != self._second:
            self._second = self._log_ns // NS_PER_S
            self._writer.flush()
            self._sync()
        self._writer.add_message(
            self._channel_of[topic_of(message)],
            log_time=self._log_ns,
            publish_time=self._log_ns,
            sequence=self._sequence,
            data=message.SerializeToString(deterministic=True),
        )
        self._sequence += 1

    def _sync(self) -> None:
        if time.monotonic() - self._synced >= 1.0:
            self._file.flush()
            os.fsync(self._file.fileno())
            self._synced = time.monotonic()

    def close(self) -> None:
        """Finish, sync, and give the file its name."""
        self._writer.finish()
        self._file.flush()
        os.fsync(self._file.fileno())
        self._file.close()
        self._part.replace(self._path)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        if kind is None:
            self.close()
        else:
            self._file.close()
