"""Epochs as a monitor decided them, block by block, to be tested on shadow faults: the monitor, and what it had in hand."""

from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from itertools import pairwise
from typing import NamedTuple

from integrity.config import SiteConfig
from integrity.deciding import Decided
from integrity.events import Event, Tick
from integrity.limits import Limits
from integrity.self_test import silent_families
from integrity.station_monitor import StationMonitor
from recordings.simulate.observations import simulate
from tests.unit.streams import SEED, START_NS, a_site

UNCERTAINTY_NS = 10_000_000


class DecidedBlock(NamedTuple):
    """A block after step 4, and the monitor that decided it."""

    monitor: StationMonitor
    decided: Decided

    def silent(self, e: int, limits: Limits | None = None) -> tuple[str, ...]:
        """What a self-test of epoch e finds."""
        place = self.monitor.place
        return silent_families(self.decided, e, place if limits is None else place._replace(limits=limits))


def blocks_of(site: SiteConfig, events: Sequence[Event], pieces: int = 1) -> list[DecidedBlock]:
    """The blocks that a monitor decides, fed in so many pieces."""
    monitor = StationMonitor(site)
    cuts = [k * len(events) // pieces for k in range(pieces + 1)]
    return [
        DecidedBlock(monitor, decided)
        for first, end in pairwise(cuts)
        for decided, _ in monitor.blocks(events[first:end])
        if decided is not None
    ]


def a_site_with_host_time(interval_s: float = 30.0) -> SiteConfig:
    return replace(a_site(interval_s), host_clock="ntp")


@cache
def an_hour() -> tuple[Event, ...]:
    """Sound, an epoch every 30 s, on a host that knows the time."""
    events = simulate(a_site(30.0), START_NS, 3600, 1.0 / 30.0, SEED)
    return tuple(replace(event, utc_uncertainty_ns=UNCERTAINTY_NS) if isinstance(event, Tick) else event for event in events)


@cache
def sound_hour() -> DecidedBlock:
    """The same as one block."""
    [block] = blocks_of(a_site_with_host_time(), an_hour())
    return block


@cache
def sound_minutes() -> DecidedBlock:
    """Ten sound minutes, an epoch a second, as one block."""
    [block] = blocks_of(a_site(1.0), simulate(a_site(1.0), START_NS, 590.0, 1.0, SEED))
    return block
