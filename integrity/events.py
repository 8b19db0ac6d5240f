"""What goes into a `StationMonitor`. Every event carries `mono_ns`, the host's monotonic clock when it arrived."""

from dataclasses import dataclass

from integrity.gnss.atmosphere import Klobuchar
from integrity.gnss.ephemeris.broadcast import Ephemeris
from integrity.gnss.observations import ObservationRow
from integrity.gnss.receiver_status import ReceiverStatus
from integrity.monitors.told import Dispute


@dataclass(frozen=True)
class RawBytes:
    """Bytes of one receiver as they came from its link, cut anywhere."""

    mono_ns: int
    receiver: str
    data: bytes


@dataclass(frozen=True)
class InputLost:
    """Pieces of a receiver's bytes that had arrived and were lost before they could be decided on."""

    mono_ns: int
    receiver: str
    chunks: int


@dataclass(frozen=True)
class ObservationsReceived:
    """One receiver's measurements at one time."""

    mono_ns: int
    row: ObservationRow


@dataclass(frozen=True)
class EphemerisReceived:
    """A broadcast ephemeris, usable from here on."""

    mono_ns: int
    ephemeris: Ephemeris


@dataclass(frozen=True)
class IonosphereReceived:
    """Broadcast ionospheric coefficients, used from the next epoch on."""

    mono_ns: int
    klobuchar: Klobuchar


@dataclass(frozen=True)
class StatusReceived:
    """What a receiver says of itself."""

    mono_ns: int
    receiver: str
    status: ReceiverStatus


@dataclass(frozen=True)
class ToldApart:
    """What receivers were told of satellites that cannot all be true, from here on; none: they agree again."""

    mono_ns: int
    disputes: tuple[Dispute, ...]


@dataclass(frozen=True)
class Tick:
    """Time passes: the only clock that the monitor has. `utc_uncertainty_ns` is None where nobody vouches for `utc_ns`."""

    mono_ns: int
    utc_ns: int
    utc_uncertainty_ns: int | None


Decoded = ObservationsReceived | EphemerisReceived | IonosphereReceived | StatusReceived
Event = RawBytes | InputLost | ObservationsReceived | EphemerisReceived | IonosphereReceived | Tick
Heard = Decoded | ToldApart | InputLost | Tick  # an event after its bytes were decoded
