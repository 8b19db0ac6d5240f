"""From bytes to measurements: what each receiver's stream holds, as the events that decisions are made of. Stateful, cheap, first."""

from collections.abc import Iterable, Mapping
from dataclasses import replace
from types import MappingProxyType

from integrity.config import Protocol
from integrity.events import EphemerisReceived, Event, Heard, RawBytes, Tick
from integrity.gnss.ephemeris.broadcast import KeplerEphemeris
from integrity.gnss.gps_time import NS_PER_S
from integrity.reception.memory import ReceptionMemory
from integrity.reception.rtcm import RtcmStream
from integrity.reception.ubx import UbxStream

OLDER_SET_NS = 60 * NS_PER_S  # between reference times; after an upload GPS goes back by 16 s, sets of a day are 600 s apart or more

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
            heard = [] if stream is None else stream.decoded(event)
            return [self._ranked(x) for x in heard] if isinstance(stream, RtcmStream) else heard
        if isinstance(event, Tick):
            for stream in self._streams.values():
                stream.tick(event)
        return [event]

    def _ranked(self, heard: Heard) -> Heard:
        """RTCM does not say when a set was transmitted: one counts as of now. Casters are known to repeat old ones: where any receiver has
        told a later set of the satellite, an older one was transmitted before that, and must not serve in its place."""
        if not (isinstance(heard, EphemerisReceived) and isinstance(heard.ephemeris, KeplerEphemeris)):
            return heard
        eph = heard.ephemeris
        latest_ns = max(stream.toe_ns(eph.satellite, eph.message) or eph.toe_ns for stream in self._streams.values())
        if latest_ns - eph.toe_ns <= OLDER_SET_NS:
            return heard
        return replace(heard, ephemeris=replace(eph, transmission_ns=eph.toe_ns - round(eph.fit_half_s * NS_PER_S)))

    def memories(self) -> tuple[ReceptionMemory, ...]:
        """For a snapshot."""
        return tuple(stream.memory() for stream in self._streams.values())
