"""A recording in which every kind of message stands, and how it is written, compared and looked into."""

from collections.abc import Sequence
from pathlib import Path

from google.protobuf.message import Message

from integrity.events import RawBytes
from integrity.gnss.observations import ObservationRow
from integrity.messages import wayside_pb2 as pb
from integrity.messages.inputs import encode_event
from integrity.messages.outputs import encode_output
from integrity.messages.snapshots import encode_snapshot
from integrity.station_monitor import StationMonitor
from recordings.site_file import parse_site
from recordings.writer import RecordingWriter
from tests.unit.sites import SITE as SITE_TEXT
from tests.unit.streams import RECOVER_AFTER_S, SITE, START_NS, epoch_of, rows_changed, stream, with_more

SECONDS = 12
METADATA = {"truth": {"faults": "none\n"}, "import": {"dropped": "{}"}}
SITE_FILE = parse_site(SITE_TEXT.replace("recover_after_s = 30.0", f"recover_after_s = {RECOVER_AFTER_S}"), "site.toml")


def stepped(row: ObservationRow) -> ObservationRow:
    """From the eighth second on, a satellite 40 m off: excluded, alerted."""
    return with_more(row, "pseudorange_m", 40.0, [row.signals.index("G07.1C")]) if epoch_of(row) >= 8 else row


def messages() -> list[tuple[Message, int]]:
    """One or more of each topic, with the monotonic time at which it is written."""
    monitor = StationMonitor(SITE)
    events = rows_changed(stream(SECONDS), stepped)
    outputs = monitor.feed(events)
    listed: list[tuple[Message, int]] = [(pb.Started(site="test", software="wayside test", gps_time_ns=START_NS), START_NS)]
    listed.append((encode_snapshot(monitor.snapshot(), SITE.receiver_names, START_NS), START_NS))
    listed += [(encode_event(e), e.mono_ns) for e in events if not isinstance(e, RawBytes)]
    listed.append((pb.InputLost(mono_ns=events[-1].mono_ns, receiver="B", chunks=7), events[-1].mono_ns))
    listed += [(encode_output(o, SITE, "wayside test"), o.mono_ns) for o in outputs]
    return sorted(listed, key=lambda item: item[1])


def write(path: Path, listed: Sequence[tuple[Message, int]], metadata: dict[str, dict[str, str]] | None = None) -> None:
    with RecordingWriter(path, "wayside test", START_NS, START_NS, metadata or {}) as writer:
        for message, mono_ns in listed:
            writer.write(message, mono_ns)


def data(message: Message) -> bytes:
    """For comparison: NaN, "not measured", does not equal itself."""
    found: bytes = message.SerializeToString(deterministic=True)
    return found
