"""Epochs as a monitor decided them, block by block, to be tested on shadow faults: the monitor, and what it had in hand."""

from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from typing import NamedTuple

from integrity.assembler import AlignedEpoch
from integrity.checks import BlockChecks, Surroundings
from integrity.config import SiteConfig
from integrity.events import Event, Tick
from integrity.limits import Limits
from integrity.receiver_watch import ReceiverMemory, heard_with
from integrity.self_test import silent_families
from integrity.sight import Sight
from integrity.station_monitor import StationMonitor
from recordings.simulate.observations import simulate
from tests.unit.streams import SEED, START_NS, a_site

UNCERTAINTY_NS = 10_000_000


class DecidedBlock(NamedTuple):
    """A block after step 4; `clean` of each epoch."""

    monitor: StationMonitor
    sight: Sight
    full: BlockChecks
    around: Surroundings
    epochs: tuple[AlignedEpoch, ...]
    clean: tuple[bool, ...]

    def silent(self, e: int, limits: Limits | None = None) -> tuple[str, ...]:
        """What a self-test of epoch e finds."""
        monitor = self.monitor
        of = (monitor._points, monitor.triangle, monitor.site, limits or monitor.limits)
        return silent_families(self.sight, self.full, self.around, self.epochs[e], e, *of)


class _Recording(StationMonitor):
    """Keeps each block that it decides."""

    kept: list[DecidedBlock]

    def _decided(self, epochs: Sequence[AlignedEpoch]):  # type: ignore[no-untyped-def]
        decided = super()._decided(epochs)
        sight, site = decided.sight, self.site
        heard = heard_with(epochs, sight.block.epoch_ns, site.receiver_names, site.host_clock)
        nothing = ReceiverMemory.empty(len(site.receivers))
        around = Surroundings(decided.streams, heard, sight.satellites.watched, nothing)
        self.kept.append(DecidedBlock(self, sight, decided.full, around, tuple(epochs), tuple(decided.clean.tolist())))
        return decided


def blocks_of(site: SiteConfig, events: Sequence[Event], pieces: int = 1) -> list[DecidedBlock]:
    """The blocks that a monitor decides, fed in so many pieces."""
    monitor = _Recording(site)
    monitor.kept = []
    for k in range(pieces):
        monitor.feed(events[k * len(events) // pieces : (k + 1) * len(events) // pieces])
    return monitor.kept


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
