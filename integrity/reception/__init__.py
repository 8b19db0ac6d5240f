"""From bytes to measurements: what each receiver's stream holds, as the events that decisions are made of. Stateful, cheap, first."""

from collections.abc import Iterable, Mapping
from types import MappingProxyType

from integrity.config import Protocol
from integrity.events import Event, Heard, RawBytes, Tick
from integrity.reception.memory import ReceptionMemory
from integrity.reception.rtcm import RtcmStream
from integrity.reception.ubx import UbxStream

__all__ = ["Reception", "ReceptionMemory"]


class Reception:
    """The streams of all receivers, of UBX where `protocols` says nothing else; bytes of any other receiver are passed over."""

    def __init__(
        self,
        receivers: Iterable[str],
        memories: Iterable[ReceptionMemory] = (),
        protocols: Mapping[str, Protocol] = MappingProxyType({}),
    ) -> None:
        remembered = {memory.receiver: memory for memory in memories}
        self._streams: dict[str, UbxStream | RtcmStream] = {}
        for receiver in receivers:
            kind = RtcmStream if protocols.get(receiver) == "rtcm3" else UbxStream
            self._streams[receiver] = kind(remembered.get(receiver, ReceptionMemory(receiver)))

    def take(self, event: Event) -> list[Heard]:
        """What an event says: bytes decoded, anything else as it is."""
        if isinstance(event, RawBytes):
            stream = self._streams.get(event.receiver)
            return [] if stream is None else stream.decoded(event)
        if isinstance(event, Tick):
            for stream in self._streams.values():
                stream.tick(event)
        return [event]

    def memories(self) -> tuple[ReceptionMemory, ...]:
        """For a snapshot."""
        return tuple(stream.memory() for stream in self._streams.values())
