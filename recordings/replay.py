"""Decides a recording again: the same events, the same core; and records what was decided.

`decide` is the only way from events to decisions outside a running station: import, injection, simulation and replay all use it.
"""

import json
import tomllib
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise, zip_longest
from pathlib import Path

from integrity import SOFTWARE
from integrity.assembler import nominal_epoch_ns
from integrity.errors import ConfigError, DecodeError, RecordingError
from integrity.events import Event, ObservationsReceived, RawBytes, Tick
from integrity.gnss.gps_time import NS_PER_S, format_calendar, gps_from_utc, parse_utc
from integrity.health import Health
from integrity.messages import wayside_pb2 as pb
from integrity.messages.fixes import location_fixes
from integrity.messages.inputs import decode_event
from integrity.messages.outputs import encode_output
from integrity.messages.snapshots import decode_snapshot, encode_snapshot
from integrity.outputs import Output
from integrity.reception import Reception
from integrity.station_monitor import Snapshot, StationMonitor
from recordings.channels import STATION_TOPICS, TRAIN_TOPICS, is_input, receiver_of
from recordings.reader import Contents, Entry, salvage
from recordings.site_file import SiteFile, parse_site
from recordings.toml_file import format_toml
from recordings.writer import RecordingWriter

DEFAULT_BLOCK_EPOCHS = 1000
SNAPSHOT_EVERY_NS = 3600 * NS_PER_S


@dataclass(frozen=True)
class Boot:
    """The station that recorded: what it called itself when it started, and UTC minus its monotonic clock."""

    boot_id: bytes
    offset_ns: int


@dataclass(frozen=True)
class Replayable:
    """What a recording asks to be decided: its site, the memory it starts from, its events; and which station it was, if one ran."""

    site: SiteFile
    snapshot: Snapshot | None
    events: tuple[Event, ...]
    boot: Boot | None


def started(contents: Contents) -> pb.Started:
    """The first message of a recording."""
    first = contents.entries[0].message
    if not isinstance(first, pb.Started):
        raise RecordingError(f"{contents.path}: begins with {contents.entries[0].topic}, expected /started: its head is missing")
    return first


def beginning(contents: Contents) -> pb.Started | pb.TrainStarted:
    """The first message of a recording, of a station or of a train."""
    first = contents.entries[0].message
    return first if isinstance(first, pb.TrainStarted) else started(contents)


def recorded_site(contents: Contents) -> SiteFile:
    """The site file that the recording was decided with."""
    return parse_site(started(contents).site_toml, f"{contents.path}: recorded site")


def replayable(contents: Contents, site: SiteFile | None = None, start_ns: int | None = None, end_ns: int | None = None) -> Replayable:
    """Events from the last snapshot at or before `start_ns` (GPS; the head of the file by default) up to `end_ns`, not included.

    With another site file than the recorded one, what was received before (ephemerides, signals) is kept, and what was decided
    (health, exclusions) starts anew: those were other promises.
    """
    own = recorded_site(contents)
    chosen = site or own
    if chosen.config.receiver_names != own.config.receiver_names:
        raise ConfigError(
            f"the site file has receivers {', '.join(chosen.config.receiver_names)}, the recording {', '.join(own.config.receiver_names)}: "
            "name them as recorded"
        )
    for receiver, protocol in own.config.protocols.items():
        if chosen.config.protocols[receiver] != protocol:
            raise ConfigError(
                f"the site file has receiver {receiver} send {chosen.config.protocols[receiver]}, the recording holds {protocol}: "
                f'write protocol = "{protocol}" below [receivers.{receiver}]'
            )
    snapshots = [i for i, entry in enumerate(contents.entries) if isinstance(entry.message, pb.Snapshot)]
    before = [i for i in snapshots if start_ns is not None and gps_from_utc(contents.entries[i].log_ns) <= start_ns]
    first = (before[-1:] or snapshots[:1] or [0])[0]
    head = contents.entries[first].message
    try:
        snapshot = decode_snapshot(head) if isinstance(head, pb.Snapshot) else None
        events = _events(contents, first, end_ns)
    except DecodeError as error:
        raise RecordingError(f"{contents.path}: {error}; expected what a Wayside wrote: record or import it again") from None
    if snapshot is not None and chosen.config.config_sha256 != own.config.config_sha256:
        snapshot = replace(snapshot, exclusions=(), last_clean=None, health=Health(), monitors=None, silent=())
    boot_id = started(contents).boot_id
    return Replayable(chosen, snapshot, events, Boot(boot_id, _offset_ns(contents)) if boot_id else None)


def _offset_ns(contents: Contents) -> int:
    """Log time minus monotonic time, the same for the whole recording."""
    return contents.entries[0].log_ns - started(contents).mono_ns


def _events(contents: Contents, first: int, end_ns: int | None) -> tuple[Event, ...]:
    """Inputs from an entry on; bytes of receivers arrived at their log time."""
    offset_ns = _offset_ns(contents)

    def event(entry: Entry) -> Event:
        if isinstance(entry.message, bytes):
            return RawBytes(entry.log_ns - offset_ns, receiver_of(entry.topic) or "", entry.message)
        return decode_event(entry.message)

    inputs = (entry for entry in contents.entries[first:] if is_input(entry.topic))
    return tuple(event(entry) for entry in inputs if end_ns is None or gps_from_utc(entry.log_ns) < end_ns)


def recorded_drops(contents: Contents) -> dict[str, dict[str, int]]:
    """What the import of a recording dropped, by receiver and reason; nothing where it was not imported."""
    text = contents.metadata.get("import", {}).get("dropped", "{}")
    try:
        drops = {str(r): {str(reason): int(n) for reason, n in reasons.items()} for r, reasons in json.loads(text).items()}
    except (ValueError, TypeError, AttributeError):
        raise RecordingError(f"{contents.path}: metadata import/dropped is {text[:60]!r}, expected counts by receiver and reason") from None
    return {r: drops.get(r, {}) for r in recorded_site(contents).config.receiver_names}


def decide(
    site: SiteFile,
    events: Iterable[Event],
    snapshot: Snapshot | None = None,
    block_epochs: int = DEFAULT_BLOCK_EPOCHS,
    writer: RecordingWriter | None = None,
    boot_id: bytes = b"",
) -> tuple[list[Output], StationMonitor]:
    """Feed events to a new monitor, `block_epochs` epochs at a time; record them and what comes out where a writer is given.

    `boot_id` is of the station that decided first, and stands in the health recorded.
    """
    monitor = StationMonitor(site.config, snapshot)
    outputs: list[Output] = []
    next_snapshot_ns: int | None = None
    for batch in _batches(events, block_epochs * len(site.config.receivers)):
        mono_ns = batch[0].mono_ns
        if writer is not None and (next_snapshot_ns is None or mono_ns >= next_snapshot_ns):
            writer.write(encode_snapshot(monitor.snapshot(), site.config.receiver_names, mono_ns), mono_ns)
            next_snapshot_ns = mono_ns + SNAPSHOT_EVERY_NS
        decided = monitor.feed(batch)
        outputs += decided
        if writer is not None:
            _record(writer, site, monitor, batch, decided, boot_id)
    return outputs, monitor


def decide_and_record(
    path: Path,
    site: SiteFile,
    events: Sequence[Event],
    metadata: Mapping[str, Mapping[str, str]],
    snapshot: Snapshot | None = None,
    watch: Callable[[Sequence[Event]], Iterable[Event]] = iter,
    boot: Boot | None = None,
) -> tuple[list[Output], StationMonitor]:
    """A new recording of events and of what is decided on them; deterministic bytes. `watch` hands the events on and may say so.

    `boot` is the station that decided on them first, where one did: times are then recorded as it had them.
    """
    if not events:
        raise RecordingError(f"{path}: there is nothing to record")
    first = events[0]
    gps_ns = gps_from_utc(first.mono_ns + boot.offset_ns) if boot else _gps_of_first(events)
    boot_id = boot.boot_id if boot else b""
    names, protocols = site.config.receiver_names, site.config.protocols
    with RecordingWriter(path, SOFTWARE, gps_ns, first.mono_ns, metadata, names, protocols=protocols) as writer:
        writer.write(head(site, gps_ns, first.mono_ns, boot_id), first.mono_ns)
        return decide(site, watch(events), snapshot, block_epochs=60, writer=writer, boot_id=boot_id)


def _gps_of_first(events: Sequence[Event]) -> int:
    """GPS time of the first event by the first tick; without one, of an import, whose monotonic time is GPS time."""
    first = events[0]
    return next((gps_from_utc(e.utc_ns) - (e.mono_ns - first.mono_ns) for e in events if isinstance(e, Tick)), first.mono_ns)


def head(site: SiteFile, gps_ns: int, mono_ns: int, boot_id: bytes) -> pb.Started:
    """The first message of a recording."""
    return pb.Started(
        site=site.config.site_id,
        software=SOFTWARE,
        config_sha256=site.config.config_sha256,
        site_toml=redacted(site.text),
        gps_time_ns=gps_ns,
        mono_ns=mono_ns,
        boot_id=boot_id,
    )


def redacted(text: str) -> str:
    """A site or train file without the passwords in its sources: recordings are passed on. The same text where there are none."""
    document = tomllib.loads(text)
    tables = [*document.get("receivers", {}).values(), *document.get("antenna", [])]
    with_credentials = [
        table for table in tables if table.get("source", "").startswith(("ntrip://", "ntrips://")) and "@" in table["source"]
    ]
    for table in with_credentials:
        scheme, _, rest = table["source"].partition("://")
        credentials, _, address = rest.rpartition("@")
        user, colon, _password = credentials.partition(":")
        table["source"] = f"{scheme}://{user + colon if colon else ''}***@{address}"
    return format_toml(document) if with_credentials else text


def window(text_from: str | None, text_to: str | None) -> tuple[int | None, int | None]:
    """GPS times of `--from` and `--to`; ConfigError where they are not times."""
    try:
        start_ns = None if text_from is None else parse_utc(text_from)
        end_ns = None if text_to is None else parse_utc(text_to)
    except ValueError as error:
        raise ConfigError(str(error)) from None
    if start_ns is not None and end_ns is not None and end_ns <= start_ns:
        raise ConfigError(f"the time window ends ({text_to}) before it begins ({text_from})")
    return start_ns, end_ns


def span_utc(contents: Contents) -> tuple[str, str]:
    """First and last log time, UTC."""
    first, last = contents.entries[0], contents.entries[-1]
    return format_calendar(first.log_ns) + "Z", format_calendar(last.log_ns) + "Z"


def _batches(events: Iterable[Event], rows: int) -> Iterator[list[Event]]:
    """Cut after each `rows` rows of observations, or pieces of bytes, and the ticks that follow them."""
    batch: list[Event] = []
    count = 0
    for event in events:
        if count >= rows and not isinstance(event, Tick):
            yield batch
            batch, count = [], 0
        batch.append(event)
        count += isinstance(event, ObservationsReceived | RawBytes)
    if batch:
        yield batch


def _record(
    writer: RecordingWriter, site: SiteFile, monitor: StationMonitor, batch: Sequence[Event], decided: Sequence[Output], boot_id: bytes
) -> None:
    """Inputs in the order in which they were decided, each output after the input that completed it."""
    messages = [encode_output(output, site.config, SOFTWARE, boot_id) for output in decided]
    reports = [message for message in messages if isinstance(message, pb.EpochReport)]
    fixes = iter(location_fixes(reports, monitor.triangle, site.config.site_id))
    waiting = zip(decided, messages, strict=True)
    due = next(waiting, None)
    for event, following in zip_longest(batch, batch[1:]):
        writer.write_event(event)
        while due is not None and (following is None or due[0].mono_ns < following.mono_ns):
            message = due[1]
            writer.write(message, event.mono_ns)
            for fix in next(fixes) if isinstance(message, pb.EpochReport) else ():
                writer.write(fix, event.mono_ns)
            due = next(waiting, None)


def first_epoch_ns(todo: Replayable) -> int:
    """GPS time of the first row of observations."""
    site = todo.site.config
    reception = Reception(site.receiver_names, todo.snapshot.reception if todo.snapshot else (), site.protocols)
    for event in todo.events:
        for heard in reception.take(event):
            if isinstance(heard, ObservationsReceived):
                return nominal_epoch_ns(heard.row.receive_time_ns, todo.site.config.epoch_interval_ns)
    raise RecordingError("no observations in the recording: there is nothing to inject into")


def complaints(contents: Contents) -> list[str]:
    """What is not as it should be in a recording; empty for a whole one."""
    found = [contents.damage] if contents.damage else []
    topics = [entry.topic for entry in contents.entries[:2]]
    if topics not in (["/started", "/snapshot"], ["/train_started", "/train_snapshot"]):
        found.append(f"begins with {' and '.join(topics)}, expected /started and /snapshot")
    times = [entry.log_ns for entry in contents.entries]
    if any(b < a for a, b in pairwise(times)):
        found.append("log time steps back")
    return found


def recover(path: Path, output: Path) -> Contents:
    """Copy every message that can still be read to a new, whole recording; the same bytes as the original for a whole one."""
    contents = salvage(path)
    begun = beginning(contents)
    topics = TRAIN_TOPICS if isinstance(begun, pb.TrainStarted) else STATION_TOPICS
    first_ns = contents.entries[0].log_ns
    times, receivers = (gps_from_utc(first_ns), first_ns), contents.receivers
    with RecordingWriter(output, begun.software, *times, contents.metadata, receivers, topics, contents.protocols) as writer:
        for entry in contents.entries:
            writer.add(entry.topic, entry.data, entry.log_ns)
    return contents
