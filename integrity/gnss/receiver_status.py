"""What a receiver says of itself, as far as it says it: hearsay, good for explaining, never for trusting."""

from dataclasses import dataclass, fields
from enum import IntEnum
from operator import attrgetter


class Jamming(IntEnum):
    """The receiver's own word on interference."""

    NONE_SEEN = 0
    WARNING = 1  # there is some, and the receiver still has a fix
    CRITICAL = 2  # there is some, and the receiver has no fix


class Spoofing(IntEnum):
    """The receiver's own word on false signals."""

    NONE_SEEN = 0
    INDICATED = 1
    INDICATED_AGAIN = 2  # by several of its detectors


class Antenna(IntEnum):
    """The receiver's own word on its antenna's supply."""

    IN_ORDER = 0
    SHORT_CIRCUIT = 1
    OPEN = 2


@dataclass(frozen=True)
class ReceiverStatus:
    """None: the receiver has not said. Position is that of its own fix: geodetic, radians, ellipsoidal height; `agc` from 0 to 1.

    `stated_ecef_m` is where whoever runs it has said that its antenna is; `virtual`: that there is no antenna there.
    """

    model: str | None = None
    fix_ok: bool | None = None
    lat_rad: float | None = None
    lon_rad: float | None = None
    height_m: float | None = None
    jamming: Jamming | None = None
    spoofing: Spoofing | None = None
    antenna: Antenna | None = None
    agc: float | None = None
    stated_ecef_m: tuple[float, float, float] | None = None
    virtual: bool | None = None

    def updated(self, later: "ReceiverStatus") -> "ReceiverStatus":
        """This status with everything that a later one says."""
        return ReceiverStatus(*[before if now is None else now for before, now in zip(_said(self), _said(later), strict=True)])


_said = attrgetter(*(f.name for f in fields(ReceiverStatus)))  # all of it, in order
