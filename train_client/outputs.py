"""What comes out of a `TrainLocaliser`: where the train is, and what may be believed of it."""

from dataclasses import dataclass
from enum import Enum

from train_client.stop import Stop
from train_client.trust import TrustState


class Status(Enum):
    """What a position may be used for."""

    UNKNOWN = "UNKNOWN"
    PROVISIONAL = "PROVISIONAL"  # solved, but no NORMAL covers its epoch: not for safety
    VALID = "VALID"  # solved on monitored satellites, and a fresh NORMAL covers its epoch


@dataclass(frozen=True)
class MapPlace:
    """A place on the map: metres along the centre line of an edge, from its first point."""

    edge: str
    offset_m: float


@dataclass(frozen=True)
class AntennaFix:
    """One antenna's own solution. `why` there is none; `residual` is the weighted sum of squares that the search and RAIM look at."""

    antenna: str
    place: MapPlace | None
    sigma_m: float | None
    tpdop: float | None
    satellites: int
    residual: float | None
    residual_threshold: float | None
    why: str


@dataclass(frozen=True)
class Fix:
    """What the antennas say of one epoch, whoever vouches for it. `front` is None where there is no position; `reasons` say why.

    `used` are the signals that some antenna was solved with, `unused` those that one measured and why they were left out.
    """

    gps_time_ns: int
    front: MapPlace | None
    rear: MapPlace | None
    sigma_m: float | None
    facing: int
    antennas: tuple[AntennaFix, ...]
    distance_m: float | None
    distance_expected_m: float | None
    used: tuple[str, ...]
    unused: tuple[tuple[str, str], ...]
    reasons: tuple[str, ...]


@dataclass(frozen=True)
class Confirmed:
    """The last place of the front end that was VALID, and its epoch."""

    place: MapPlace
    gps_time_ns: int


@dataclass(frozen=True)
class StationReport:
    """What a train makes of one station; `valid_for_ns` is None unless its trust is NORMAL."""

    site: str
    trust: TrustState
    health_sequence: int | None
    valid_for_ns: int | None
    refused_messages: int
    security_alarm: bool
    missed_messages: int = 0


@dataclass(frozen=True)
class PositionReport:
    """After each epoch, again when a provisional fix is confirmed, and when trust or stop change between epochs (`fix` is None).

    `trust` is that in all stations `vouching` here together; `stations` are all that the train listens to.
    """

    sequence: int
    mono_ns: int
    status: Status
    reasons: tuple[str, ...]
    fix: Fix | None
    trust: TrustState
    vouching: tuple[str, ...]
    stations: tuple[StationReport, ...]
    stop: Stop
    last_confirmed: Confirmed | None


@dataclass(frozen=True)
class TrustChange:
    """Trust in one station has changed, and why."""

    mono_ns: int
    site: str
    before: TrustState
    state: TrustState
    reasons: tuple[str, ...]


@dataclass(frozen=True)
class MessageRefused:
    """A message that came as health and was not believed (INVALID), or an answer to a challenge that was not. `alarm`: it raised one."""

    mono_ns: int
    refusal: str
    site: str = ""
    alarm: bool = False


@dataclass(frozen=True)
class StopChange:
    """A stop is asked for, or no longer; or, with `refusal`, a release came that does not count."""

    mono_ns: int
    stop: Stop
    refusal: str = ""


TrainOutput = PositionReport | TrustChange | MessageRefused | StopChange
