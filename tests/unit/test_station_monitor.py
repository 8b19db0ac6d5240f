"""The whole core on simulated streams: start-up, sound streams and silence."""

from dataclasses import replace

import numpy as np
import pytest

from integrity.events import EphemerisReceived, Tick
from integrity.gnss.gps_time import NS_PER_S
from integrity.gnss.observations import ObservationRow
from integrity.states import Cause, Outcome, State
from tests.unit.monitored import FAULT_S, SECONDS, SOUND, decided, states
from tests.unit.streams import (
    LIMITS,
    RECOVER_AFTER_S,
    START_NS,
    alerts,
    epoch_of,
    health,
    new_monitor,
    reports,
    rows_changed,
    stream,
    ticks_only,
)

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


@pytest.mark.parametrize("name", [n for n, t in LIMITS.by_name.items() if t.required])
def test_required_checks_run_in_every_epoch_of_a_sound_stream(name: str) -> None:
    column = reports(SOUND)[0].check_names.index(name)
    assert {int(r.outcome[column]) for r in reports(SOUND)} == {int(Outcome.PASS)}


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
