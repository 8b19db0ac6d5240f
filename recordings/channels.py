"""Topics of a recording and their messages: protobuf, self-describing, opens in any MCAP viewer."""

from google.protobuf.descriptor_pb2 import FileDescriptorSet
from google.protobuf.message import Message

from integrity.messages import wayside_pb2 as pb

PROFILE = "wayside.v1"  # of the MCAP header; another one is refused
ENCODING = "protobuf"

TOPICS: dict[str, type[Message]] = {
    "/started": pb.Started,
    "/snapshot": pb.Snapshot,
    "/observations": pb.Observations,
    "/ephemeris": pb.Ephemeris,
    "/ionosphere": pb.Ionosphere,
    "/tick": pb.Tick,
    "/epoch": pb.EpochReport,
    "/health": pb.Health,
    "/alert": pb.Alert,
}
INPUTS = ("/observations", "/ephemeris", "/ionosphere", "/tick")
TOPIC_OF = {message_type.DESCRIPTOR.full_name: topic for topic, message_type in TOPICS.items()}


def topic_of(message: Message) -> str:
    """Where a message is recorded."""
    return TOPIC_OF[message.DESCRIPTOR.full_name]


def schema_bytes() -> bytes:
    """The descriptor set that makes a recording self-describing; the same for every message."""
    files = FileDescriptorSet()
    pb.DESCRIPTOR.CopyToProto(files.file.add())
    data: bytes = files.SerializeToString(deterministic=True)
    return data
