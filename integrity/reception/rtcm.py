"""A receiver, or a caster, that sends RTCM 3. Its messages count time within a week or a day: which one it is, others must tell.

The satellites do, by the reference times of their ephemerides: the middle one of all, since casters are known to send sets of satellites
that are gone. Where no set comes for a while, the host's clock does. That one need not be right by more than half a week; ephemerides are
waited for, since time that once was ahead cannot go back: epochs of the past are not decided.
"""

from collections.abc import Mapping

from integrity.events import EphemerisReceived, Heard, ObservationsReceived, RawBytes, StatusReceived, Tick
from integrity.gnss.ephemeris.broadcast import Ephemeris, KeplerEphemeris
from integrity.gnss.gps_time import NS_PER_S, gps_from_utc
from integrity.gnss.observations import ObservationRow
from integrity.gnss.receiver_status import ReceiverStatus
from integrity.gnss.rtcm.decoder import RtcmDecoder
from integrity.gnss.rtcm.framing import RtcmFramer, message_number
from integrity.gnss.rtcm.msm import MSM_NUMBERS
from integrity.gnss.rtcm.station import AntennaPosition
from integrity.reception.memory import ReceptionMemory

CLOCK_AFTER_NS = 15 * NS_PER_S  # from the first bytes on; casters that send ephemerides send one of some satellite every few seconds


class RtcmStream:
    """One receiver's bytes."""

    def __init__(self, memory: ReceptionMemory) -> None:
        self._receiver = memory.receiver
        self._framer = RtcmFramer(memory.pending)
        self._framer.bad_frames, self._framer.skipped_bytes = memory.bad_frames, memory.skipped_bytes
        self._decoder = RtcmDecoder(memory.receiver, memory.rtcm)
        self._since_mono_ns = memory.since_mono_ns
        self._gps_ahead_ns = memory.gps_ahead_ns
        self._toe_ns: dict[tuple[str, str], int] = {
            (eph.satellite, eph.message): eph.toe_ns for eph in memory.rtcm.told if isinstance(eph, KeplerEphemeris)
        }
        self._sky_ns = _middle(self._toe_ns)

    def memory(self) -> ReceptionMemory:
        """For a snapshot."""
        return ReceptionMemory(
            self._receiver,
            pending=self._framer.pending,
            bad_frames=self._framer.bad_frames,
            skipped_bytes=self._framer.skipped_bytes,
            rtcm=self._decoder.memory(),
            since_mono_ns=self._since_mono_ns,
            gps_ahead_ns=self._gps_ahead_ns,
        )

    def tick(self, tick: Tick) -> None:
        """Time passes."""
        self._gps_ahead_ns = gps_from_utc(tick.utc_ns) - tick.mono_ns

    @property
    def told(self) -> tuple[Ephemeris, ...]:
        """The last set told of each satellite and message."""
        return self._decoder.memory().told

    def decoded(self, event: RawBytes) -> list[Heard]:
        """What the messages say, in the order in which they end."""
        if self._since_mono_ns is None:
            self._since_mono_ns = event.mono_ns
        heard_for_ns = event.mono_ns - self._since_mono_ns
        heard: list[Heard] = []
        for message in self._framer.feed(event.data):
            may_wait = message_number(message) in MSM_NUMBERS and heard_for_ns < CLOCK_AFTER_NS
            near_ns = self._near_ns(event.mono_ns, may_wait)
            heard += [self._heard(found, event.mono_ns) for found in self._decoder.take(message, near_ns)]
        return heard

    def _near_ns(self, mono_ns: int, may_wait: bool) -> int | None:
        """GPS time to within half a week; None where nobody has told yet whom to believe."""
        if self._sky_ns is not None or self._gps_ahead_ns is None or may_wait:
            return self._sky_ns
        return mono_ns + self._gps_ahead_ns

    def _heard(self, found: ObservationRow | Ephemeris | AntennaPosition, mono_ns: int) -> Heard:
        match found:
            case ObservationRow():
                return ObservationsReceived(mono_ns, found)
            case AntennaPosition():
                stated_ecef_m = (found.x_m, found.y_m, found.z_m)
                return StatusReceived(mono_ns, self._receiver, ReceiverStatus(stated_ecef_m=stated_ecef_m, virtual=not found.real))
            case KeplerEphemeris():
                self._toe_ns[found.satellite, found.message] = found.toe_ns
                self._sky_ns = _middle(self._toe_ns)
        return EphemerisReceived(mono_ns, found)


def _middle(toe_ns: Mapping[tuple[str, str], int]) -> int | None:
    in_order = sorted(toe_ns.values())
    return in_order[len(in_order) // 2] if in_order else None
