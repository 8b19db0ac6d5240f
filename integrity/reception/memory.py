"""What is remembered of one receiver's bytes."""

from dataclasses import dataclass, field

from integrity.gnss.ephemeris.broadcast import Ephemeris
from integrity.gnss.navigation.collector import Page
from integrity.gnss.rtcm.decoder import RtcmMemory


@dataclass(frozen=True)
class ReceptionMemory:
    """The beginning of a frame, counters, and what only one of the protocols needs.

    UBX: pages and ephemerides that were told of, the receive time of the last row, `status_mono_ns`: when each kind of status message was
    last read. RTCM: what its decoder remembers, when its first bytes came, and GPS time minus the monotonic clock by the last tick.
    """

    receiver: str
    pending: bytes = b""
    pages: tuple[Page, ...] = ()
    told: tuple[Ephemeris, ...] = ()
    last_row_ns: int | None = None
    status_mono_ns: tuple[tuple[tuple[int, int], int], ...] = ()
    bad_frames: int = 0
    skipped_bytes: int = 0
    rtcm: RtcmMemory = field(default_factory=RtcmMemory)
    since_mono_ns: int | None = None
    gps_ahead_ns: int | None = None
