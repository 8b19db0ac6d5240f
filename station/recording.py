"""What a station records, and how: the head of its files, its events, and with each epoch report the solved positions for maps."""

from collections.abc import Iterable

from google.protobuf.message import Message

from integrity.events import Event, RawBytes
from integrity.messages import wayside_pb2 as pb
from integrity.messages.fixes import location_fixes
from integrity.messages.inputs import encode_event
from integrity.triangle import reference_triangle
from recordings.channels import STATION_TOPICS
from recordings.recorder import Manner
from recordings.replay import head
from recordings.site_file import SiteFile


def manner_of(site: SiteFile, boot_id: bytes) -> Manner[Event]:
    """For the recorder of a station that was started as `boot_id`."""
    triangle = reference_triangle(site.config)

    def after(message: Message) -> Iterable[Message]:
        return location_fixes([message], triangle, site.config.site_id)[0] if isinstance(message, pb.EpochReport) else ()

    return Manner(
        name=site.config.site_id,
        topics=STATION_TOPICS,
        receivers=site.config.receiver_names,
        head=lambda gps_ns, mono_ns: head(site, gps_ns, mono_ns, boot_id),
        encode=_encoded,
        after=after,
        protocols=site.config.protocols,
    )


def _encoded(event: Event) -> Message:
    assert not isinstance(event, RawBytes), "bytes of receivers are recorded as they came"
    return encode_event(event)
