"""From bytes to measurements: what each receiver's stream holds, as the events that decisions are made of. Stateful, cheap, first."""

from collections.abc import Iterable, Mapping
from dataclasses import replace
from types import MappingProxyType

from integrity.config import Protocol
from integrity.events import EphemerisReceived, Event, Heard, RawBytes, Tick, ToldApart
from integrity.gnss.ephemeris.broadcast import Ephemeris, KeplerEphemeris
from integrity.gnss.gps_time import NS_PER_S
from integrity.monitors.told import Dispute
from integrity.reception.memory import ReceptionMemory
from integrity.reception.rtcm import RtcmStream
from integrity.reception.told import ToldSets
from integrity.reception.ubx import UbxStream

OLDER_SET_NS = 60 * NS_PER_S  # between reference times; after an upload GPS goes back by 16 s, sets of a day are 600 s apart or more

__all__ = ["Reception", "ReceptionMemory"]


class Reception:
    """The streams of all receivers, of UBX where `protocols` says nothing else; bytes of any other receiver are passed over.

    What receivers are told of one satellite is held against each other, beyond `most_change` sigmas (`monitors.told`), unless that is None.
    """

    def __init__(
        self,
        receivers: Iterable[str],
        memories: Iterable[ReceptionMemory] = (),
        protocols: Mapping[str, Protocol] = MappingProxyType({}),
        most_change: float | None = None,
    ) -> None:
        remembered = {memory.receiver: memory for memory in memories}
        self._streams: dict[str, UbxStream | RtcmStream] = {}
        told: list[tuple[str, Ephemeris]] = []
        for receiver in receivers:
            kind = RtcmStream if protocols.get(receiver) == "rtcm3" else UbxStream
            stream = self._streams[receiver] = kind(remembered.get(receiver, ReceptionMemory(receiver)))
            told += [(receiver, eph) for eph in stream.told]
        self._told = ToldSets(told, most_change)

    @property
    def disputes(self) -> tuple[Dispute, ...]:
        """What receivers were told that cannot all be true, now."""
        return self._told.disputes

    def take(self, event: Event) -> list[Heard]:
        """What an event says: bytes decoded, anything else as it is."""
        if isinstance(event, RawBytes):
            stream = self._streams.get(event.receiver)
            heard = [] if stream is None else stream.decoded(event)
            if any(isinstance(x, EphemerisReceived) for x in heard):
                return [y for x in heard for y in self._told_of(event.receiver, x)]
            return heard
        if isinstance(event, Tick):
            for stream in self._streams.values():
                stream.tick(event)
        return [event]

    def _told_of(self, receiver: str, heard: Heard) -> list[Heard]:
        """Of what a receiver was told, what may be used, and what is disputed if that has changed."""
        if not isinstance(heard, EphemerisReceived):
            return [heard]
        before = self._told.disputes
        usable = self._told.tell(receiver, heard.ephemeris)
        found: list[Heard] = [EphemerisReceived(heard.mono_ns, self._ranked(r, eph)) for r, eph in usable]
        now = self._told.disputes
        return found if now == before else [*found, ToldApart(heard.mono_ns, now)]

    def _ranked(self, receiver: str, eph: Ephemeris) -> Ephemeris:
        """RTCM does not say when a set was transmitted: one counts as of now. Casters are known to repeat old ones: where any receiver has
        told a later set of the satellite, an older one was transmitted before that, and must not serve in its place."""
        if not (isinstance(eph, KeplerEphemeris) and isinstance(self._streams[receiver], RtcmStream)):
            return eph
        if self._told.latest_toe_ns(eph) - eph.toe_ns <= OLDER_SET_NS:
            return eph
        return replace(eph, transmission_ns=eph.toe_ns - round(eph.fit_half_s * NS_PER_S))

    def memories(self) -> tuple[ReceptionMemory, ...]:
        """For a snapshot."""
        return tuple(stream.memory() for stream in self._streams.values())
