"""Simulated streams through the whole core, spoiled or not, and what is read off the decisions."""

from collections.abc import Sequence
from dataclasses import replace

from integrity.config import SiteConfig
from integrity.events import Event
from integrity.gnss.gps_time import NS_PER_S
from integrity.gnss.observations import ObservationRow
from integrity.outputs import Output
from integrity.states import Cause, State
from tests.unit.streams import SITE, START_NS, alerts, epoch_of, health, new_monitor, reports, rows_changed, stream, with_more

SECONDS = 20
FAULT_S = 12  # well after start-up


def decided(events: Sequence[Event], site: SiteConfig = SITE) -> list[Output]:
    return new_monitor(site).feed(events)


def published(outputs: Sequence[Output]) -> list[tuple[object, ...]]:
    """What decisions are compared by: everything published, and who is excluded; no floats."""
    return [(h.sequence, h.gps_time_ns, h.state, h.cause, h.subjects, h.monitored, h.excluded, h.not_monitored) for h in health(outputs)]


def states(outputs: Sequence[Output]) -> list[State]:
    return [h.state for h in health(outputs)]


def range_fault(events: Sequence[Event], receivers: str, size_m: float, satellite: str = "", from_s: int = FAULT_S) -> tuple[Event, ...]:
    """Ranges of some receivers longer from a time on: of one satellite, or of all with every other sign."""

    def change(row: ObservationRow) -> ObservationRow:
        if row.receiver not in receivers or epoch_of(row) < from_s:
            return row
        columns = [i for i, s in enumerate(row.signals) if s.startswith(satellite)]
        return with_more(row, "pseudorange_m", size_m, columns)

    return rows_changed(events, change)


SOUND = decided(stream(SECONDS))


def first_fault(outputs: Sequence[Output]) -> tuple[int, State, Cause, tuple[str, ...]]:
    """Second, state, cause and subjects of the first alert after NORMAL."""
    alert = next(a for a in alerts(outputs) if a.before is State.NORMAL)
    assert alert.gps_time_ns is not None
    return (alert.gps_time_ns - START_NS) // NS_PER_S, alert.state, alert.cause, alert.subjects


def used_satellites() -> list[str]:
    last = reports(SOUND)[-1]
    return [s.partition(".")[0] for s, used in zip(last.signals, last.used, strict=True) if used]


def frozen(events: Sequence[Event], receiver: str) -> tuple[Event, ...]:
    """A receiver that repeats its ranges with advancing time."""
    last: list[ObservationRow] = []

    def change(row: ObservationRow) -> ObservationRow:
        if row.receiver != receiver:
            return row
        if epoch_of(row) < FAULT_S:
            last[:] = [row]
            return row
        return replace(last[0], receive_time_ns=row.receive_time_ns)

    return rows_changed(events, change)
