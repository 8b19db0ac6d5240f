"""Confirm, then use: which epochs each station has vouched for, with which signals, and which fixes still wait. A memory, no clock.

A NORMAL message covers epochs from `covers_from_gps_ns` to `covers_to_gps_ns`, both included, and the signals that it lists as monitored,
less those of excluded satellites; each with the ephemeris that is vouched for, and no other one. Where several stations vouch for a
place all of them must cover the epoch, and a signal counts that all of them monitor, with one and the same ephemeris, and none excludes.
What an epoch was not covered by in time is never confirmed.
"""

from collections import deque
from collections.abc import Collection, Iterable, Mapping
from typing import Generic, NamedTuple, TypeVar

from integrity.gnss.signals import satellite_of
from integrity.messages import wayside_pb2 as pb

MOST_WAITING = 64  # epochs, 6 s at 10 Hz: longer than any message is valid
MOST_REMEMBERED = 64  # messages of each station

W = TypeVar("W")
Signals = Mapping[str, int]
"""Signals that a train may use, each with the CRC-32 of the content of its ephemeris."""


class Vouched(NamedTuple):
    """Epochs (GPS times, both included) and the signals that a train may use in them."""

    from_ns: int
    to_ns: int
    signals: Signals

    def covers(self, gps_ns: int) -> bool:
        """Whether an epoch is one of these."""
        return self.from_ns <= gps_ns <= self.to_ns


class _Waits(NamedTuple, Generic[W]):
    gps_ns: int
    sites: Collection[str]
    what: W


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
    """What each of some sites has vouched for of late, and what waits for them: W by its epoch."""

    def __init__(self, vouched: Mapping[str, Iterable[Vouched]]) -> None:
        self._vouched: dict[str, deque[Vouched]] = {site: deque(of, maxlen=MOST_REMEMBERED) for site, of in vouched.items()}
        self._waiting: deque[_Waits[W]] = deque(maxlen=MOST_WAITING)

    def of(self, gps_ns: int, sites: Collection[str]) -> Signals | None:
        """What all of these sites, one or more, vouch for in an epoch; None where one of them does not cover it."""
        return _common([self._of(gps_ns, site) for site in sites])

    def likely(self, gps_ns: int, sites: Collection[str]) -> Signals | None:
        """The same, or what they will vouch for if that is what they did last; None where one of them never did."""
        return _common([self._of(gps_ns, site) or self._latest(site) for site in sites])

    def wait(self, gps_ns: int, sites: Collection[str], what: W) -> None:
        """Keep it until these sites cover its epoch; the oldest goes where too many wait."""
        self._waiting.append(_Waits(gps_ns, sites, what))

    def vouch(self, site: str, vouched: Vouched) -> list[W]:
        """Remember it; what waited for it and for nobody else, in order. What is older than it waits for the site no longer: no later
        message covers that."""
        self._vouched[site].append(vouched)
        waiting, self._waiting = self._waiting, deque(maxlen=MOST_WAITING)
        found = []
        for waits in waiting:
            if site not in waits.sites or waits.gps_ns > vouched.to_ns:
                self._waiting.append(waits)
            elif self.of(waits.gps_ns, waits.sites) is not None:
                found.append(waits.what)
            elif self._of(waits.gps_ns, site) is not None:
                self._waiting.append(waits)  # for the others
        return found

    def vouched(self, site: str) -> tuple[Vouched, ...]:
        """All that is remembered of a site."""
        return tuple(self._vouched[site])

    def let_go(self) -> None:
        """Nothing waits any more: a memory that goes on elsewhere would not have it."""
        self._waiting.clear()

    def forget(self, site: str) -> None:
        """It vouches for nothing any more: neither for what was nor for what waits for it."""
        self._vouched[site].clear()
        self._waiting = deque((waits for waits in self._waiting if site not in waits.sites), maxlen=MOST_WAITING)

    def _of(self, gps_ns: int, site: str) -> Vouched | None:
        """What covers an epoch; of several the latest."""
        return next((v for v in reversed(self._vouched.get(site, ())) if v.covers(gps_ns)), None)

    def _latest(self, site: str) -> Vouched | None:
        of = self._vouched.get(site)
        return of[-1] if of else None


def _common(of_sites: Collection[Vouched | None]) -> Signals | None:
    """Monitored by all with one ephemeris, excluded by none; None where one of them says nothing, or there is none."""
    vouched = [of for of in of_sites if of is not None]
    if not vouched or len(vouched) < len(of_sites):
        return None
    first, *others = vouched
    return {s: crc32 for s, crc32 in first.signals.items() if all(of.signals.get(s) == crc32 for of in others)} if others else first.signals
