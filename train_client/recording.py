"""What a train records, and how: a file begins with train file, map, trusted keys and all that is remembered, and decides alone."""

from collections.abc import Iterable, Mapping

from google.protobuf.message import Message

from recordings.channels import TRAIN_TOPICS
from recordings.recorder import Manner
from recordings.replay import redacted
from train_client.config import TrainConfig
from train_client.events import TrainEvent
from train_client.messages import encode_event, encode_started


def manner_of(train: TrainConfig, train_toml: str, map_json: str, keys: Mapping[str, tuple[bytes, ...]]) -> Manner[TrainEvent]:
    """For the recorder of a train."""

    def nothing_more(message: Message) -> Iterable[Message]:
        return ()

    return Manner(
        name=train.train_id,
        topics=TRAIN_TOPICS,
        receivers=train.antenna_ids,
        head=lambda gps_ns, mono_ns: encode_started(train, redacted(train_toml), map_json, keys, gps_ns, mono_ns),
        encode=encode_event,
        after=nothing_more,
        protocols=train.protocols,
    )
