"""A receiver that sends UBX. Its week comes with its measurements; navigation words that arrive before the first of them wait for it."""

from collections.abc import Iterable

from integrity.events import Decoded, EphemerisReceived, Heard, IonosphereReceived, ObservationsReceived, RawBytes, StatusReceived, Tick
from integrity.gnss.atmosphere import Klobuchar
from integrity.gnss.ephemeris.broadcast import Ephemeris
from integrity.gnss.gps_time import NS_PER_S
from integrity.gnss.navigation.collector import NavigationCollector
from integrity.gnss.ubx.framing import Frame, Framer
from integrity.gnss.ubx.rawx import RXM_RAWX, decode_rawx
from integrity.gnss.ubx.rxm_raw import RXM_RAW, decode_raw
from integrity.gnss.ubx.rxm_sfrb import RXM_SFRB, decode_sfrb
from integrity.gnss.ubx.sfrbx import RXM_SFRBX, decode_sfrbx
from integrity.gnss.ubx.status import STATUS_MESSAGES, decode_status
from integrity.reception.memory import ReceptionMemory

NAV_PVT = (0x01, 0x07)
STATUS_EVERY_NS = NS_PER_S  # hearsay is read once a second, however often it is sent;
POSITION_EVERY_NS = 10 * NS_PER_S  # positions, which come every epoch and say little, every ten


class UbxStream:
    """One receiver's bytes."""

    def __init__(self, memory: ReceptionMemory) -> None:
        self._receiver = memory.receiver
        self._framer = Framer(memory.pending)
        self._framer.bad_frames, self._framer.skipped_bytes = memory.bad_frames, memory.skipped_bytes
        self._navigation = NavigationCollector(memory.pages, memory.told)
        self._last_row_ns = memory.last_row_ns
        self._status_mono_ns = dict(memory.status_mono_ns)

    def memory(self) -> ReceptionMemory:
        """For a snapshot."""
        return ReceptionMemory(
            self._receiver,
            pending=self._framer.pending,
            pages=tuple(self._navigation.pages),
            told=tuple(self._navigation.told),
            last_row_ns=self._last_row_ns,
            status_mono_ns=tuple(sorted(self._status_mono_ns.items())),
            bad_frames=self._framer.bad_frames,
            skipped_bytes=self._framer.skipped_bytes,
        )

    def tick(self, tick: Tick) -> None:
        """Time passes: the receiver knows it better."""

    @property
    def told(self) -> tuple[Ephemeris, ...]:
        """The last set told of each satellite and message."""
        return self._navigation.told

    def decoded(self, event: RawBytes) -> list[Heard]:
        """Frames in the order in which they end."""
        found: list[Heard] = []
        for frame in self._framer.feed(event.data):
            kind = (frame.message_class, frame.message_id)
            if kind in (RXM_RAWX, RXM_RAW):
                found += self._row(frame, event.mono_ns)
            elif kind in (RXM_SFRBX, RXM_SFRB):
                found += self._words(frame, event.mono_ns)
            elif kind in STATUS_MESSAGES and self._due(kind, event.mono_ns):
                status = decode_status(frame)
                found += [] if status is None else [StatusReceived(event.mono_ns, self._receiver, status)]
        return found

    def _row(self, frame: Frame, mono_ns: int) -> list[Decoded]:
        before_8 = (frame.message_class, frame.message_id) == RXM_RAW
        row = decode_raw(frame.payload, self._receiver) if before_8 else decode_rawx([frame.payload], self._receiver)[0]
        if row is None:
            return []
        waiting = self._navigation.complete(row.receive_time_ns) if self._last_row_ns is None else []
        self._last_row_ns = row.receive_time_ns
        return [*_navigation(waiting, mono_ns), ObservationsReceived(mono_ns, row)]

    def _words(self, frame: Frame, mono_ns: int) -> list[Decoded]:
        before_8 = (frame.message_class, frame.message_id) == RXM_SFRB
        words = decode_sfrb(frame.payload) if before_8 else decode_sfrbx(frame.payload)
        return [] if words is None else _navigation(self._navigation.take(words, self._last_row_ns), mono_ns)

    def _due(self, kind: tuple[int, int], mono_ns: int) -> bool:
        last_ns = self._status_mono_ns.get(kind)
        every_ns = POSITION_EVERY_NS if kind == NAV_PVT else STATUS_EVERY_NS
        if last_ns is not None and mono_ns - last_ns < every_ns:
            return False
        self._status_mono_ns[kind] = mono_ns
        return True


def _navigation(told: Iterable[Ephemeris | Klobuchar], mono_ns: int) -> list[Decoded]:
    return [IonosphereReceived(mono_ns, x) if isinstance(x, Klobuchar) else EphemerisReceived(mono_ns, x) for x in told]
