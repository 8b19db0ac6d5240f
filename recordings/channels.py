"""Topics of a recording: messages in protobuf, self-describing, for any MCAP viewer; and the bytes of receivers as they came."""

import re
from collections.abc import Iterable
from typing import get_args

from google.protobuf.descriptor_pb2 import FileDescriptorSet
from google.protobuf.message import Message

from integrity.config import Protocol
from integrity.messages import wayside_pb2 as pb
from integrity.messages.location_fix_pb2 import LocationFix

PROFILE = "wayside.v1"  # of the MCAP header; another one is refused
ENCODING = "protobuf"
RAW_ENCODINGS: tuple[Protocol, ...] = get_args(Protocol)  # of the bytes of receivers

STATION_TOPICS: dict[str, type[Message]] = {
    "/started": pb.Started,
    "/snapshot": pb.Snapshot,
    "/observations": pb.Observations,
    "/ephemeris": pb.Ephemeris,
    "/ionosphere": pb.Ionosphere,
    "/tick": pb.Tick,
    "/input_lost": pb.InputLost,
    "/epoch": pb.EpochReport,
    "/health": pb.Health,
    "/alert": pb.Alert,
}
TRAIN_TOPICS: dict[str, type[Message]] = {
    "/train_started": pb.TrainStarted,
    "/train_snapshot": pb.TrainSnapshot,
    "/tick": pb.Tick,
    "/input_lost": pb.InputLost,
    "/health_received": pb.HealthReceived,
    "/challenge_sent": pb.ChallengeSent,
    "/challenge_answered": pb.ChallengeAnswered,
    "/stop_released": pb.StopReleased,
    "/position": pb.TrainPosition,
}
TOPICS = STATION_TOPICS | TRAIN_TOPICS
INPUTS = (  # and the bytes of receivers
    *("/observations", "/ephemeris", "/ionosphere", "/tick", "/input_lost"),
    *("/health_received", "/challenge_sent", "/challenge_answered", "/stop_released"),
)
TOPIC_OF = {message_type.DESCRIPTOR.full_name: topic for topic, message_type in TOPICS.items()}
OF_RECEIVER = re.compile(r"/receiver/([^/]+)/(raw|fix)")


def raw_topic(receiver: str) -> str:
    """Where the bytes of a receiver are recorded."""
    return f"/receiver/{receiver}/raw"


def fix_topic(receiver: str) -> str:
    """Where the positions of a receiver are recorded."""
    return f"/receiver/{receiver}/fix"


def receiver_topics(receivers: Iterable[str]) -> list[str]:
    """The topics that each receiver has for itself."""
    return [topic for receiver in receivers for topic in (raw_topic(receiver), fix_topic(receiver))]


def receiver_of(topic: str) -> str | None:
    """Whose topic it is; None for a topic of the station."""
    found = OF_RECEIVER.fullmatch(topic)
    return found[1] if found else None


def is_raw(topic: str) -> bool:
    """Whether bytes of a receiver stand there, which are no messages of ours."""
    found = OF_RECEIVER.fullmatch(topic)
    return found is not None and found[2] == "raw"


def is_input(topic: str) -> bool:
    """Whether what stands there is decided on."""
    return topic in INPUTS or is_raw(topic)


def topic_of(message: Message) -> str:
    """Where a message is recorded."""
    if isinstance(message, LocationFix):
        return fix_topic(message.frame_id.rpartition("/")[2])
    return TOPIC_OF[message.DESCRIPTOR.full_name]


def message_type(topic: str) -> type[Message] | None:
    """What is recorded there; None for bytes of receivers and for topics that this version does not know."""
    return LocationFix if OF_RECEIVER.fullmatch(topic) and not is_raw(topic) else TOPICS.get(topic)


def schema_bytes(message_type: type[Message]) -> bytes:
    """The descriptor set that makes a recording self-describing: the file of a message and, before it, those that it builds on."""
    needed = [message_type.DESCRIPTOR.file]
    for file in needed:
        needed += file.dependencies
    files = FileDescriptorSet()
    for file in reversed(needed):
        file.CopyToProto(files.file.add())
    data: bytes = files.SerializeToString(deterministic=True)
    return data
