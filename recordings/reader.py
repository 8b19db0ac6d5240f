"""Reads a recording, checksums verified, in the order in which it was written; and salvages one that is cut or damaged."""

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import BinaryIO

from google.protobuf.message import Message
from mcap.exceptions import McapError
from mcap.records import Channel, Chunk, Footer, Header, Metadata, Schema, Statistics
from mcap.records import Message as McapMessage
from mcap.stream_reader import StreamReader, breakup_chunk
from zstandard import ZstdError

from integrity.config import Protocol
from integrity.errors import DecodeError, RecordingError
from integrity.messages.inputs import parsed
from recordings.channels import ENCODING, PROFILE, RAW_ENCODINGS, is_raw, message_type, receiver_of


@dataclass(frozen=True)
class Entry:
    """One recorded message, or bytes of a receiver as they came, and its log time (UTC, ns)."""

    topic: str
    log_ns: int
    message: Message | bytes

    @property
    def data(self) -> bytes:
        """As it stands in the file."""
        if isinstance(self.message, bytes):
            return self.message
        data: bytes = self.message.SerializeToString(deterministic=True)
        return data


@dataclass(frozen=True)
class Contents:
    """A recording in memory. `damage` says in words what was found wrong; empty for a whole file. `receivers` have channels in it,
    `protocols` are of those whose bytes are not UBX."""

    path: Path
    metadata: dict[str, dict[str, str]]
    receivers: tuple[str, ...]
    entries: tuple[Entry, ...]
    damage: str
    skipped_chunks: int
    protocols: dict[str, Protocol] = field(default_factory=dict)

    def counts(self) -> dict[str, int]:
        """Messages per topic."""
        return dict(Counter(entry.topic for entry in self.entries))


def read_recording(path: Path) -> Contents:
    """The whole recording; RecordingError where it is cut, damaged, or of an unknown schema."""
    contents = salvage(path)
    if contents.damage:
        raise RecordingError(f"{path}: {contents.damage}; `wayside recording recover {path} -o OUT.mcap` saves what is whole")
    return contents


def salvage(path: Path) -> Contents:
    """Everything that can be read: damaged chunks are skipped and counted. RecordingError where nothing is left, or it is not ours."""
    entries: list[Entry] = []
    metadata: dict[str, dict[str, str]] = {}
    damage: list[str] = []
    skipped = 0
    ended = False
    promised: int | None = None
    with path.open("rb") as file:
        records = _records(file, path, damage)
        topics = _Topics(path)
        for record in records:
            if isinstance(record, Chunk):
                try:
                    entries += topics.entries(record)
                except (McapError, DecodeError, KeyError, ValueError, EOFError, ZstdError) as error:
                    skipped += 1
                    damage.append(f"a chunk is damaged ({error})")
            elif isinstance(record, Metadata):
                metadata[record.name] = dict(record.metadata)
            elif isinstance(record, Statistics):
                promised = record.message_count
            ended = ended or isinstance(record, Footer)
    if not ended and not damage:
        damage.append("the file ends before its footer")
    if promised is not None and promised != len(entries) and not damage:
        damage.append(f"{promised} messages were written, {len(entries)} can be found")
    if not entries:
        raise RecordingError(f"{path}: {'; '.join(damage) or 'no message of Wayside in it'}; nothing to decide")
    return Contents(path, metadata, topics.receivers, tuple(entries), "; ".join(dict.fromkeys(damage)), skipped, topics.protocols)


def _records(file: BinaryIO, path: Path, damage: list[str]) -> Iterator[object]:
    """MCAP records up to the end or the first place at which the framing breaks; RecordingError for what is no recording of ours."""
    try:
        for record in StreamReader(file, emit_chunks=True, validate_crcs=True).records:
            if isinstance(record, Header) and record.profile != PROFILE:
                raise RecordingError(
                    f"{path}: profile {record.profile!r}, expected {PROFILE!r}: not written by a Wayside that this one knows"
                )
            yield record
    except RecordingError:
        raise
    except Exception as error:  # the MCAP library raises its own errors, struct.error, EOFError, codec errors: all mean the same here
        if file.tell() <= 64:
            raise RecordingError(
                f"{path}: not an MCAP recording ({error or type(error).__name__}); give a file that `wayside import`, `wayside simulate` "
                "or a station wrote"
            ) from None
        damage.append(f"cut or damaged at byte {file.tell()} ({type(error).__name__})")


class _Topics:
    """Schemas and channels met so far; turns a chunk into entries."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._schema_name: dict[int, str] = {}
        self._channel: dict[int, tuple[str, type[Message] | None]] = {}
        self.protocols: dict[str, Protocol] = {}  # of receivers whose bytes are not UBX

    def entries(self, chunk: Chunk) -> list[Entry]:
        """Messages of a chunk, its checksum verified."""
        found = []
        for record in breakup_chunk(chunk, validate_crc=True):
            if isinstance(record, Schema):
                self._schema_name[record.id] = record.name
            elif isinstance(record, Channel):
                self._check(record)
                self._channel[record.id] = (record.topic, message_type(record.topic))
            elif isinstance(record, McapMessage):
                topic, kind = self._channel[record.channel_id]
                found.append(Entry(topic, record.log_time, record.data if kind is None else parsed(kind, record.data)))
        return found

    @property
    def receivers(self) -> tuple[str, ...]:
        """Of the channels met so far."""
        return tuple(dict.fromkeys(receiver for topic, _ in self._channel.values() if (receiver := receiver_of(topic)) is not None))

    def _check(self, channel: Channel) -> None:
        kind = message_type(channel.topic)
        schema = self._schema_name.get(channel.schema_id)
        if is_raw(channel.topic):
            protocol = next((p for p in RAW_ENCODINGS if p == channel.message_encoding), None)
            known = protocol is not None and channel.schema_id == 0
            if protocol is not None and protocol != "ubx":
                self.protocols[receiver_of(channel.topic) or ""] = protocol
        else:
            known = kind is not None and channel.message_encoding == ENCODING and schema == kind.DESCRIPTOR.full_name
        if not known:
            holds = schema or "bytes"
            raise RecordingError(
                f"{self._path}: topic {channel.topic} holds {holds} ({channel.message_encoding}), which this version does not know; "
                "read it with the program that wrote it, a newer Wayside or another one"
            )
