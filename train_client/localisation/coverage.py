"""Confirm, then use: which epochs the ground has vouched for, with which signals, and which fixes still wait for that. A memory, no clock.

A NORMAL message covers epochs from `covers_from_gps_ns` to `covers_to_gps_ns`, both included, and the signals that it lists as monitored,
less those of excluded satellites; each with the ephemeris that is vouched for, and no other one. What an epoch was not covered by in time
is never confirmed.
"""

from collections import deque
from collections.abc import Iterable, Mapping
from typing import Generic, NamedTuple, TypeVar

from integrity.gnss.signals import satellite_of
from integrity.messages import wayside_pb2 as pb

MOST_WAITING = 64  # epochs, 6 s at 10 Hz: longer than any message is valid
MOST_REMEMBERED = 64  # messages

W = TypeVar("W")


class Vouched(NamedTuple):
    """Epochs (GPS times, both included) and the signals that a train may use in them, each with the CRC-32 of the content of its
    ephemeris."""

    from_ns: int
    to_ns: int
    signals: Mapping[str, int]

    def covers(self, gps_ns: int) -> bool:
        """Whether an epoch is one of these."""
        return self.from_ns <= gps_ns <= self.to_ns


def vouched_by(health: pb.Health) -> Vouched | None:
    """What a message that says NORMAL covers; None where it does not say, or would cover what comes after its own epoch."""
    if not (health.HasField("covers_from_gps_ns") and health.HasField("covers_to_gps_ns")):
        return None
    if not health.covers_to_gps_ns <= health.gps_time_ns:
        return None
    excluded, monitored = set(health.excluded_satellites), set(health.monitored)
    signals = {
        of.signal: of.ephemeris_crc32
        for of in health.monitored_signals
        if of.signal in monitored and satellite_of(of.signal) not in excluded
    }
    return Vouched(health.covers_from_gps_ns, health.covers_to_gps_ns, signals)


class Coverage(Generic[W]):
    """What was vouched for of late, and what waits for it: W by its epoch."""

    def __init__(self, vouched: Iterable[Vouched] = ()) -> None:
        self._vouched: deque[Vouched] = deque(vouched, maxlen=MOST_REMEMBERED)
        self._waiting: deque[tuple[int, W]] = deque(maxlen=MOST_WAITING)

    @property
    def latest(self) -> Vouched | None:
        """What was vouched for last."""
        return self._vouched[-1] if self._vouched else None

    def of(self, gps_ns: int) -> Vouched | None:
        """What covers an epoch; of several the latest."""
        return next((v for v in reversed(self._vouched) if v.covers(gps_ns)), None)

    def wait(self, gps_ns: int, what: W) -> None:
        """Keep it until its epoch is covered; the oldest goes where too many wait."""
        self._waiting.append((gps_ns, what))

    def vouch(self, vouched: Vouched) -> list[W]:
        """Remember it; what waited for it, in order. What is older than it waits no longer: no later message covers that."""
        self._vouched.append(vouched)
        waiting, self._waiting = self._waiting, deque(maxlen=MOST_WAITING)
        self._waiting.extend((t, what) for t, what in waiting if t > vouched.to_ns)
        return [what for t, what in waiting if vouched.covers(t)]

    def vouched(self) -> tuple[Vouched, ...]:
        """Everything remembered but what waits, which is let go: a memory that goes on elsewhere would not have it."""
        self._waiting.clear()
        return tuple(self._vouched)

    def forget(self) -> None:
        """The ground vouches for nothing any more: neither for what was nor for what waits."""
        self._vouched.clear()
        self._waiting.clear()
