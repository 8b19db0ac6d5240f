"""The whole core on simulated streams: start-up, faults, silence, and that neither cuts nor names nor missing numbers matter."""

from collections.abc import Sequence
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from integrity.config import SiteConfig
from integrity.events import EphemerisReceived, Event, IonosphereReceived, ObservationsReceived, Tick
from integrity.gnss.atmosphere import Klobuchar
from integrity.gnss.gps_time import NS_PER_S
from integrity.gnss.observations import ROW_FLAGS, ROW_FLOATS, ObservationRow
from integrity.outputs import Output
from integrity.states import Cause, Outcome, State
from integrity.station_monitor import StationMonitor
from tests.unit.streams import (
    LIMITS,
    RECOVER_AFTER_S,
    SITE,
    START_NS,
    a_site,
    alerts,
    epoch_of,
    health,
    moved,
    new_monitor,
    reports,
    rows_changed,
    stream,
    ticks_only,
    with_more,
    with_signals,
    with_values,
)

SECONDS = 20
FAULT_S = 12  # well after start-up


def decided(events: Sequence[Event], site: SiteConfig = SITE) -> list[Output]:
    return new_monitor(site).feed(events)


def one_by_one(events: Sequence[Event], site: SiteConfig = SITE) -> list[Output]:
    monitor = new_monitor(site)
    return [output for event in events for output in monitor.feed([event])]


def published(outputs: Sequence[Output]) -> list[tuple[object, ...]]:
    """What decisions are compared by: everything published, and who is excluded; no floats."""
    return [(h.sequence, h.gps_time_ns, h.state, h.cause, h.subjects, h.monitored, h.excluded, h.not_monitored) for h in health(outputs)]


def states(outputs: Sequence[Output]) -> list[State]:
    return [h.state for h in health(outputs)]


def named(site: SiteConfig, **changes: object) -> SiteConfig:
    return replace(site, integrity=replace(site.integrity, **changes))  # type: ignore[arg-type]


def range_fault(events: Sequence[Event], receivers: str, size_m: float, satellite: str = "", from_s: int = FAULT_S) -> tuple[Event, ...]:
    """Ranges of some receivers longer from a time on: of one satellite, or of all with every other sign."""

    def change(row: ObservationRow) -> ObservationRow:
        if row.receiver not in receivers or epoch_of(row) < from_s:
            return row
        columns = [i for i, s in enumerate(row.signals) if s.startswith(satellite)]
        return with_more(row, "pseudorange_m", size_m, columns)

    return rows_changed(events, change)


SOUND = decided(stream(SECONDS))


# ---- start-up and sound streams


def test_start_up_is_not_ready_then_normal() -> None:
    said = [(h.state, h.cause) for h in health(SOUND)]
    waiting = round(RECOVER_AFTER_S)
    assert said == [(State.NOT_CONFIRMABLE, Cause.NOT_READY)] * waiting + [(State.NORMAL, Cause.NONE)] * (SECONDS - waiting)


def test_one_alert_at_the_end_of_start_up() -> None:
    assert [(a.before, a.state, a.cause) for a in alerts(SOUND)] == [(State.NOT_CONFIRMABLE, State.NORMAL, Cause.NONE)]


def test_every_epoch_has_a_report_and_health() -> None:
    assert (len(reports(SOUND)), len(health(SOUND))) == (SECONDS, SECONDS)


def test_health_is_numbered_without_gaps() -> None:
    assert [h.sequence for h in health(SOUND)] == list(range(1, SECONDS + 1))


def test_receivers_stand_within_2_m_of_their_points() -> None:
    # sigma_common 1.2 m is overbounded: the simulated errors are about half of it.
    assert max(float(np.abs(r.e_enu_m[:, :2]).max()) for r in reports(SOUND)) < 2.0


def test_before_anything_arrives_nothing_is_said() -> None:
    assert decided([]) == []


def test_without_ephemerides_nothing_is_confirmed() -> None:
    outputs = decided([e for e in stream(SECONDS) if not isinstance(e, EphemerisReceived)])
    assert {(h.state, h.cause) for h in health(outputs)} == {(State.NOT_CONFIRMABLE, Cause.DATA)}


def test_ephemerides_that_arrive_late_end_the_waiting() -> None:
    events = stream(SECONDS)
    late = [e for e in events if isinstance(e, EphemerisReceived)]
    others = [e for e in events if not isinstance(e, EphemerisReceived)]
    cut = next(i for i, e in enumerate(others) if isinstance(e, Tick) and e.mono_ns == START_NS + 5 * NS_PER_S)
    assert states(decided([*others[:cut], *late, *others[cut:]])).index(State.NORMAL) == 6 + round(RECOVER_AFTER_S)


def test_the_first_tick_of_all_leaves_not_ready() -> None:
    outputs = decided([Tick(START_NS - 1, 0, None), *stream(2)])
    assert {h.cause for h in health(outputs)} == {Cause.NOT_READY}


# ---- faults, in their first epoch


def first_fault(outputs: Sequence[Output]) -> tuple[int, State, Cause, tuple[str, ...]]:
    """Second, state, cause and subjects of the first alert after NORMAL."""
    alert = next(a for a in alerts(outputs) if a.before is State.NORMAL)
    assert alert.gps_time_ns is not None
    return (alert.gps_time_ns - START_NS) // NS_PER_S, alert.state, alert.cause, alert.subjects


def used_satellites() -> list[str]:
    last = reports(SOUND)[-1]
    return [s.partition(".")[0] for s, used in zip(last.signals, last.used, strict=True) if used]


@pytest.mark.parametrize("satellite", used_satellites()[::4])
def test_a_satellite_step_is_named_in_its_first_epoch(satellite: str) -> None:
    outputs = decided(range_fault(stream(SECONDS), "ABC", 60.0, satellite))
    assert first_fault(outputs) == (FAULT_S, State.SATELLITE_ANOMALY, Cause.SATELLITE, (satellite,))


def test_a_satellite_step_leaves_normal_where_the_site_excludes() -> None:
    site = named(SITE, on_satellite_fault="exclude")
    outputs = decided(range_fault(stream(SECONDS), "ABC", 60.0, used_satellites()[0]), site)
    assert (states(outputs)[-1], health(outputs)[-1].excluded) == (State.NORMAL, (used_satellites()[0],))


def test_an_excluded_satellite_is_not_monitored() -> None:
    site = named(SITE, on_satellite_fault="exclude")
    outputs = decided(range_fault(stream(SECONDS), "ABC", 60.0, used_satellites()[0]), site)
    assert not any(s.startswith(used_satellites()[0]) for s in health(outputs)[-1].monitored)


def half_the_sky(row: ObservationRow) -> list[int]:
    return list(range(0, len(row.signals), 2))


@pytest.mark.parametrize("receiver", "ABC")
def test_a_receiver_fault_is_seen_in_its_first_epoch(receiver: str) -> None:
    def change(row: ObservationRow) -> ObservationRow:
        faulty = row.receiver == receiver and epoch_of(row) >= FAULT_S
        return with_more(row, "pseudorange_m", 40.0, half_the_sky(row)) if faulty else row

    assert first_fault(decided(rows_changed(stream(SECONDS), change)))[:2] == (FAULT_S, State.NOT_CONFIRMABLE)


@pytest.mark.parametrize("azimuth", [0.0, 2.0, 4.0])
@pytest.mark.parametrize("receiver", "ABC")
def test_a_moved_antenna_is_named_in_its_first_epoch(receiver: str, azimuth: float) -> None:
    def change(row: ObservationRow) -> ObservationRow:
        return moved(row, 8.0, azimuth) if row.receiver == receiver and epoch_of(row) >= FAULT_S else row

    assert first_fault(decided(rows_changed(stream(SECONDS), change))) == (FAULT_S, State.NOT_CONFIRMABLE, Cause.RECEIVER, (receiver,))


def test_two_antennas_moved_alike_name_nobody() -> None:
    def change(row: ObservationRow) -> ObservationRow:
        return moved(row, 8.0, 1.0) if row.receiver in "AB" and epoch_of(row) >= FAULT_S else row

    assert first_fault(decided(rows_changed(stream(SECONDS), change)))[2:] == (Cause.AMBIGUOUS, ())


@pytest.mark.parametrize(
    ("name", "value", "used"),
    [("cn0_dbhz", 24.9, False), ("cn0_dbhz", 25.0, True), ("pseudorange_m", 9.9e6, False), ("pseudorange_m", 1.1e8, False)],
)
def test_a_weak_or_absurd_signal_at_one_receiver_is_not_used(name: str, value: float, used: bool) -> None:
    satellite = used_satellites()[0]

    def change(row: ObservationRow) -> ObservationRow:
        columns = [i for i, s in enumerate(row.signals) if s.startswith(satellite)]
        return with_values(row, name, value, columns) if row.receiver == "B" and epoch_of(row) == SECONDS - 1 else row

    monitored = health(decided(rows_changed(stream(SECONDS), change)))[-1].monitored
    assert any(s.startswith(satellite) for s in monitored) == used


def test_a_satellite_below_the_mask_is_not_used() -> None:
    outputs = decided(stream(SECONDS), named(SITE, elevation_mask_deg=30.0))
    assert set(health(outputs)[-1].monitored) < set(health(SOUND)[-1].monitored)


@pytest.mark.parametrize("receiver", "ABC")
def test_a_clock_jump_of_a_receiver_stops_nothing(receiver: str) -> None:
    outputs = decided(range_fault(stream(SECONDS), receiver, 30_000.0))
    assert states(outputs) == states(SOUND)


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


@pytest.mark.parametrize("receiver", "ABC")
def test_a_frozen_receiver_is_named_in_its_first_epoch(receiver: str) -> None:
    assert first_fault(decided(frozen(stream(SECONDS), receiver))) == (FAULT_S, State.NOT_CONFIRMABLE, Cause.DATA, (receiver,))


def test_one_transmitter_for_all_is_spoofing() -> None:
    # Everyone repeats what A measures, each with a clock of its own.
    of_a = {epoch_of(e.row): e.row for e in stream(SECONDS) if isinstance(e, ObservationsReceived) and e.row.receiver == "A"}

    def change(row: ObservationRow) -> ObservationRow:
        if epoch_of(row) < FAULT_S:
            return row
        heard = with_more(of_a[epoch_of(row)], "pseudorange_m", 100.0 * "ABC".index(row.receiver))
        return replace(heard, receiver=row.receiver)

    found = first_fault(decided(rows_changed(stream(SECONDS), change)))
    assert found == (FAULT_S, State.SATELLITE_ANOMALY, Cause.SPOOFING, ("A", "B", "C"))


@pytest.mark.parametrize("receivers", ["AB", "BC", "ABC"])
def test_a_drop_of_cn0_at_two_receivers_is_jamming(receivers: str) -> None:
    def change(row: ObservationRow) -> ObservationRow:
        return with_more(row, "cn0_dbhz", -9.0) if row.receiver in receivers and epoch_of(row) >= FAULT_S else row

    assert first_fault(decided(rows_changed(stream(SECONDS), change)))[:3] == (FAULT_S, State.SATELLITE_ANOMALY, Cause.JAMMING)


def test_a_drop_of_cn0_at_one_receiver_is_not() -> None:
    def change(row: ObservationRow) -> ObservationRow:
        return with_more(row, "cn0_dbhz", -9.0) if row.receiver == "A" and epoch_of(row) >= FAULT_S else row

    assert states(decided(rows_changed(stream(SECONDS), change))) == states(SOUND)


def test_without_cn0_the_check_is_named_as_not_monitored() -> None:
    outputs = decided(rows_changed(stream(SECONDS), lambda row: with_values(row, "cn0_dbhz", np.nan)))
    assert (states(outputs), health(outputs)[-1].not_monitored) == (states(SOUND), ("cn0",))


def test_too_few_common_satellites_are_no_data() -> None:
    kept = used_satellites()[:4]

    def change(row: ObservationRow) -> ObservationRow:
        return with_signals(row, lambda s: s.partition(".")[0] in kept) if epoch_of(row) >= FAULT_S else row

    assert first_fault(decided(rows_changed(stream(SECONDS), change)))[:3] == (FAULT_S, State.NOT_CONFIRMABLE, Cause.DATA)


def test_exchanged_antennas_are_hinted_at() -> None:
    other = {"A": "B", "B": "A", "C": "C"}
    outputs = decided(rows_changed(stream(SECONDS), lambda row: replace(row, receiver=other[row.receiver])))
    assert "receivers A and B stand at each other's points" in reports(outputs)[0].verdict.reasons[0]


def test_a_satellite_of_an_unknown_system_is_ignored() -> None:
    def change(row: ObservationRow) -> ObservationRow:
        return replace(row, signals=("R05.1C", *row.signals[1:]))

    assert states(decided(rows_changed(stream(SECONDS), change))) == states(SOUND)


# ---- silence


def test_silence_is_published_at_every_tick_past_the_deadline() -> None:
    events = stream(SECONDS)
    outputs = decided([*events, *ticks_only(events[-1], 5)])
    assert [(h.state, h.cause, h.subjects) for h in health(outputs)[SECONDS:]] == [(State.NOT_CONFIRMABLE, Cause.DATA, ("A", "B", "C"))] * 3


def test_a_heartbeat_vouches_for_no_signal() -> None:
    events = stream(SECONDS)
    assert health(decided([*events, *ticks_only(events[-1], 5)]))[-1].monitored == ()


@pytest.mark.parametrize("receiver", "ABC")
def test_silence_of_one_receiver_names_it(receiver: str) -> None:
    def change(row: ObservationRow) -> ObservationRow | None:
        return None if row.receiver == receiver and epoch_of(row) >= FAULT_S else row

    found = [h for h in health(decided(rows_changed(stream(SECONDS), change))) if h.cause is Cause.DATA]
    assert {h.subjects for h in found} == {(receiver,)}


def test_after_silence_the_station_recovers_like_at_start_up() -> None:
    def change(row: ObservationRow) -> ObservationRow | None:
        return None if 8 <= epoch_of(row) < 12 else row

    outputs = decided(rows_changed(stream(SECONDS), change))
    normal = [(h.gps_time_ns or 0) - START_NS for h in health(outputs) if h.state is State.NORMAL]
    assert [t // NS_PER_S for t in normal] == [5, 6, 7, 17, 18, 19]


def test_the_next_deadline_is_a_tick_away_from_silence() -> None:
    monitor = new_monitor()
    monitor.feed(stream(SECONDS))
    deadline_ns = monitor.next_deadline_ns
    assert deadline_ns is not None
    heard = [health(monitor.feed([Tick(deadline_ns + past_ns, 0, None)])) for past_ns in (0, 1)]
    assert [len(h) for h in heard] == [0, 1]


def test_time_far_ahead_on_all_receivers_is_never_normal_with_old_ephemerides() -> None:
    def change(row: ObservationRow) -> ObservationRow:
        return replace(row, receive_time_ns=row.receive_time_ns + 86_400 * NS_PER_S) if epoch_of(row) >= FAULT_S else row

    outputs = decided(rows_changed(stream(SECONDS), change))
    assert State.NORMAL not in states(outputs)[FAULT_S:]


def test_a_station_whose_time_was_pushed_ahead_never_vouches_for_an_earlier_epoch() -> None:
    # For two epochs all receivers say tomorrow, as under spoofing of the time; then they are back. No NORMAL without a later time.
    def change(row: ObservationRow) -> ObservationRow:
        return replace(row, receive_time_ns=row.receive_time_ns + 86_400 * NS_PER_S) if epoch_of(row) in (8, 9) else row

    assert State.NORMAL not in states(decided(rows_changed(stream(SECONDS), change)))[8:]


# ---- cuts, snapshots, names


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


# ---- numbers that are none


NO_NUMBERS = [np.nan, np.inf, -np.inf]


@pytest.mark.parametrize("value", NO_NUMBERS)
@pytest.mark.parametrize("name", ROW_FLOATS)
@pytest.mark.parametrize("receivers", ["A", "ABC"])
@pytest.mark.parametrize("columns", [[0], slice(None)], ids=["one signal", "all signals"])
def test_no_number_in_any_field_is_no_exception(name: str, value: float, receivers: str, columns: list[int] | slice) -> None:
    def change(row: ObservationRow) -> ObservationRow:
        return with_values(row, name, value, columns) if row.receiver in receivers and epoch_of(row) >= FAULT_S else row

    assert len(reports(decided(rows_changed(stream(SECONDS), change)))) == SECONDS


@pytest.mark.parametrize("value", NO_NUMBERS)
@pytest.mark.parametrize("receivers", ["A", "ABC"])
def test_no_number_in_all_ranges_is_never_normal(value: float, receivers: str) -> None:
    def change(row: ObservationRow) -> ObservationRow:
        return with_values(row, "pseudorange_m", value) if row.receiver in receivers and epoch_of(row) >= FAULT_S else row

    assert State.NORMAL not in states(decided(rows_changed(stream(SECONDS), change)))[FAULT_S:]


@pytest.mark.parametrize("name", [n for n in (*ROW_FLOATS, *ROW_FLAGS) if n not in ("pseudorange_m", "cn0_dbhz")])
def test_what_is_not_used_changes_nothing(name: str) -> None:
    outputs = decided(rows_changed(stream(SECONDS), lambda row: with_values(row, name, 1.0)))
    assert published(outputs) == published(SOUND)


@pytest.mark.parametrize("value", [np.inf, -np.inf])
def test_an_infinite_cn0_does_not_blind_the_monitor_for_good(value: float) -> None:
    def change(row: ObservationRow) -> ObservationRow:
        if epoch_of(row) == 0:
            return with_values(row, "cn0_dbhz", value)
        return with_more(row, "cn0_dbhz", -9.0) if epoch_of(row) >= FAULT_S else row

    assert first_fault(decided(rows_changed(stream(SECONDS), change)))[:3] == (FAULT_S, State.SATELLITE_ANOMALY, Cause.JAMMING)


@pytest.mark.parametrize("from_s", [0, FAULT_S])
@pytest.mark.parametrize("receivers", ["A", "ABC"])
def test_an_epoch_without_any_signal_is_no_data(receivers: str, from_s: int) -> None:
    def change(row: ObservationRow) -> ObservationRow:
        return with_signals(row, lambda signal: False) if row.receiver in receivers and epoch_of(row) >= from_s else row

    last = health(decided(rows_changed(stream(SECONDS), change)))[-1]
    assert (last.state, last.cause) == (State.NOT_CONFIRMABLE, Cause.DATA)


@pytest.mark.parametrize("value", [1e300, -1e300, 1e-300])
def test_an_ionosphere_beyond_measure_is_no_exception(value: float) -> None:
    broken = IonosphereReceived(START_NS, Klobuchar((value,) * 4, (value,) * 4))
    events = [broken if isinstance(e, IonosphereReceived) else e for e in stream(SECONDS)]
    assert len(reports(decided(events))) == SECONDS


def test_an_infinite_range_of_a_satellite_leaves_the_others() -> None:
    def change(row: ObservationRow) -> ObservationRow:
        return with_values(row, "pseudorange_m", np.inf, [0]) if row.receiver == "B" and epoch_of(row) >= FAULT_S else row

    assert states(decided(rows_changed(stream(SECONDS), change))) == states(SOUND)


# ---- the rule of the source


TRIANGLE_SITE = named(SITE, rule="triangle")


def test_under_the_rule_of_the_source_a_sound_stream_is_normal() -> None:
    assert states(decided(stream(SECONDS), TRIANGLE_SITE)) == states(SOUND)


def test_under_the_rule_of_the_source_a_moved_triangle_is_a_satellite_anomaly() -> None:
    # The same faults of half the sky for everyone move all three alike.
    def change(row: ObservationRow) -> ObservationRow:
        return with_more(row, "pseudorange_m", 60.0, half_the_sky(row)) if epoch_of(row) >= FAULT_S else row

    found = first_fault(decided(rows_changed(stream(SECONDS), change), TRIANGLE_SITE))
    assert found[:2] == (FAULT_S, State.SATELLITE_ANOMALY)


def test_under_the_rule_of_the_source_a_broken_triangle_is_not_confirmable() -> None:
    def change(row: ObservationRow) -> ObservationRow:
        faulty = row.receiver == "B" and epoch_of(row) >= FAULT_S
        return with_more(row, "pseudorange_m", 60.0, half_the_sky(row)) if faulty else row

    found = first_fault(decided(rows_changed(stream(SECONDS), change), TRIANGLE_SITE))
    assert found[:2] == (FAULT_S, State.NOT_CONFIRMABLE)


def test_under_the_rule_of_the_source_no_satellite_is_excluded() -> None:
    outputs = decided(range_fault(stream(SECONDS), "ABC", 60.0, used_satellites()[0]), TRIANGLE_SITE)
    assert {h.excluded for h in health(outputs)} == {()}


def test_what_the_triangle_alone_says_is_what_its_rule_decides() -> None:
    events = range_fault(stream(SECONDS), "ABC", 60.0, used_satellites()[0])
    alone = [r.triangle_alone for r in reports(decided(events))]
    assert alone == [r.verdict.state for r in reports(decided(events, TRIANGLE_SITE))]


@pytest.mark.parametrize("name", [n for n, t in LIMITS.by_name.items() if t.required])
def test_required_checks_run_in_every_epoch_of_a_sound_stream(name: str) -> None:
    column = reports(SOUND)[0].check_names.index(name)
    assert {int(r.outcome[column]) for r in reports(SOUND)} == {int(Outcome.PASS)}
