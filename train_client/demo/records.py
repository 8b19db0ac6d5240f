"""What the demo saw while the story ran. Times are of this machine's monotonic clock, which all processes share."""

from collections.abc import Mapping
from dataclasses import dataclass

from integrity.gnss.gps_time import NS_PER_S
from integrity.states import Cause, State
from train_client.outputs import Status
from train_client.trust import TrustState


@dataclass(frozen=True)
class HealthSeen:
    """A verified message of the station, and when it came."""

    arrived_ns: int
    gps_time_ns: int | None
    sequence: int
    state: State
    cause: Cause
    subjects: tuple[str, ...] = ()
    excluded: tuple[str, ...] = ()


@dataclass(frozen=True)
class PositionSeen:
    """What the train client said, and when it came. `error_m`: front end against the truth along the line; None without a position."""

    arrived_ns: int
    gps_time_ns: int | None
    status: Status
    trust: TrustState
    error_m: float | None
    refused: int


@dataclass(frozen=True)
class ChallengeSeen:
    """The station was asked to sign a nonce. `sequence`: of the latest health, as answered in time; None without a right answer."""

    asked_ns: int
    sequence: int | None


@dataclass(frozen=True)
class Deeds:
    """When the demo did what it does to the station; None: not done. `attacks`: forged or replayed messages that the train must count."""

    attacks: int = 0
    attacked_ns: int | None = None
    frozen_ns: int | None = None
    thawed_ns: int | None = None
    killed_ns: int | None = None


@dataclass(frozen=True)
class Records:
    """All of it. `sent_ns`: when the last receiver's bytes of an epoch were on their way, by the epoch's GPS time."""

    began_ns: int
    start_gps_ns: int
    sent_ns: Mapping[int, int]
    health: tuple[HealthSeen, ...]
    positions: tuple[PositionSeen, ...]
    challenges: tuple[ChallengeSeen, ...]
    deeds: Deeds

    def gps_ns(self, story_s: float) -> int:
        """GPS time of a moment of the story."""
        return self.start_gps_ns + round(story_s * NS_PER_S)

    def mono_ns(self, story_s: float) -> int:
        """When the first epoch from a moment of the story on was sent; later than everything if none was."""
        from_ns = self.gps_ns(story_s)
        return min((mono for gps, mono in self.sent_ns.items() if gps >= from_ns), default=2**63 - 1)
