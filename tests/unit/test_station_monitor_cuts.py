"""Neither cuts of the stream, nor a new start from a snapshot, nor the names of receivers change a decision."""

from collections.abc import Sequence
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from integrity.config import SiteConfig
from integrity.events import EphemerisReceived, Event, ObservationsReceived
from integrity.gnss.observations import ObservationRow
from integrity.outputs import Output
from integrity.states import Cause, State
from integrity.station_monitor import StationMonitor
from tests.unit.monitored import FAULT_S, SECONDS, decided, frozen, published, range_fault, states, used_satellites
from tests.unit.streams import SITE, a_site, epoch_of, health, moved, new_monitor, reports, rows_changed, stream, with_more, with_signals


def one_by_one(events: Sequence[Event], site: SiteConfig = SITE) -> list[Output]:
    monitor = new_monitor(site)
    return [output for event in events for output in monitor.feed([event])]


@cache
def eventful() -> tuple[Event, ...]:
    """A fault of a satellite, a silence, a channel, a duplicate and a late ephemeris in 30 s."""
    events = range_fault(stream(30), "ABC", 60.0, used_satellites()[0], from_s=8)
    events = range_fault(events, "B", 12.0, used_satellites()[3], from_s=22)

    def change(row: ObservationRow) -> ObservationRow | None:
        if row.receiver == "C" and 14 <= epoch_of(row) < 18:
            return None
        return (
            with_more(row, "pseudorange_m", -60.0, [i for i, s in enumerate(row.signals) if s.startswith(used_satellites()[0])])
            if epoch_of(row) >= 10
            else row
        )

    changed = list(rows_changed(events, change))
    ephemerides = [e for e in changed if isinstance(e, EphemerisReceived)]
    changed.remove(ephemerides[3])
    return (*changed[:200], ephemerides[3], *changed[190:])


def test_the_eventful_stream_visits_every_state() -> None:
    assert set(states(decided(eventful()))) == set(State)


def test_one_event_at_a_time_decides_the_same() -> None:
    assert published(one_by_one(eventful())) == published(decided(eventful()))


def test_one_event_at_a_time_computes_the_same_numbers() -> None:
    apart, together = (np.stack([r.statistic for r in reports(outputs)]) for outputs in (one_by_one(eventful()), decided(eventful())))
    # Times are counted from the first epoch of a block: rounding.
    assert apart == pytest.approx(together, abs=1e-4, nan_ok=True)


cuts = st.lists(st.integers(0, len(eventful())), max_size=6).map(sorted)


@settings(max_examples=40, deadline=None)
@given(cuts)
def test_cutting_the_stream_anywhere_decides_the_same(at: list[int]) -> None:
    monitor, outputs = new_monitor(), []
    for start, end in zip([0, *at], [*at, len(eventful())], strict=True):
        outputs += monitor.feed(eventful()[start:end])
    assert published(outputs) == published(decided(eventful()))


@settings(max_examples=12, deadline=None)
@given(cuts)
def test_a_new_monitor_goes_on_from_the_snapshot_of_the_old_one(at: list[int]) -> None:
    monitor, outputs = new_monitor(), []
    for start, end in zip([0, *at], [*at, len(eventful())], strict=True):
        outputs += monitor.feed(eventful()[start:end])
        monitor = StationMonitor(SITE, monitor.snapshot())
    assert published(outputs) == published(decided(eventful()))


def test_a_new_monitor_knows_what_was_measured_before() -> None:
    # B freezes right after the snapshot: its first repeated ranges show against the memory only.
    events = frozen(stream(SECONDS), "B")
    cut = 1 + max(i for i, e in enumerate(events) if isinstance(e, ObservationsReceived) and epoch_of(e.row) < FAULT_S)
    monitor = new_monitor()
    monitor.feed(events[:cut])
    again = reports(StationMonitor(SITE, monitor.snapshot()).feed(events[cut:]))
    assert (again[0].verdict.check, again[0].verdict.subjects) == ("repeat", ("B",))


def test_a_new_monitor_knows_where_the_receivers_were_before() -> None:
    # A jump of 4.6 m: enough to suspect B (t_j 56 against 41), not enough to name it without what was before (ln 1000 at 4.8 m).
    def change(row: ObservationRow) -> ObservationRow:
        return moved(row, 4.6, 1.0) if row.receiver == "B" and epoch_of(row) >= FAULT_S else row

    events = rows_changed(stream(SECONDS), change)
    cut = 1 + max(i for i, e in enumerate(events) if isinstance(e, ObservationsReceived) and epoch_of(e.row) < FAULT_S)
    monitor = new_monitor()
    monitor.feed(events[:cut])
    again = reports(StationMonitor(SITE, monitor.snapshot()).feed(events[cut:]))
    assert (again[0].verdict.cause, again[0].verdict.subjects) == (Cause.RECEIVER, ("B",))


def test_a_satellite_long_out_of_view_is_forgotten_however_the_stream_is_cut() -> None:
    # One epoch a minute; of most satellites nothing is heard for 15 minutes, then they come back 14 dB weaker.
    site, events = a_site(60.0), stream(2400.0, 60.0)
    kept = used_satellites()[:6]

    def change(row: ObservationRow) -> ObservationRow:
        minute = epoch_of(row) // 60
        if 10 <= minute < 25:
            return with_signals(row, lambda s: s.partition(".")[0] in kept)
        return (
            with_more(row, "cn0_dbhz", -14.0, [i for i, s in enumerate(row.signals) if s.partition(".")[0] not in kept])
            if minute >= 25
            else row
        )

    spoiled = rows_changed(events, change)
    assert published(one_by_one(spoiled, site)) == published(decided(spoiled, site))


@pytest.mark.parametrize("names", [("C", "B", "A"), ("B", "C", "A"), ("north", "east", "mast")])
def test_names_of_receivers_only_rename(names: tuple[str, str, str]) -> None:
    new = dict(zip("ABC", names, strict=True))
    renamed = rows_changed(eventful(), lambda row: replace(row, receiver=new[row.receiver]))
    outputs, as_named = decided(eventful()), decided(renamed, a_site(names=names))
    expected = [(h.gps_time_ns, h.state, h.cause, tuple(sorted(new.get(s, s) for s in h.subjects)), h.excluded) for h in health(outputs)]
    assert [(h.gps_time_ns, h.state, h.cause, tuple(sorted(h.subjects)), h.excluded) for h in health(as_named)] == expected
