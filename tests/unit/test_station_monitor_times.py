"""What happens to every station once a day, a week or a few years, in the middle of a block: nothing that anyone should notice."""

from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from typing import NamedTuple

import pytest

from integrity.events import EphemerisReceived, Event, Tick
from integrity.gnss.ephemeris.broadcast import KeplerEphemeris
from integrity.gnss.gps_time import DAY_S, NS_PER_S, WEEK_NS, parse_utc
from integrity.gnss.observations import ObservationRow
from integrity.outputs import HealthReport, Output
from integrity.states import State
from recordings.simulate.constellation import carried
from tests.unit.long_streams import (
    FORMS,
    NEW_SETS,
    START_UP,
    UNHEALTHY_FROM,
    Form,
    around,
    live,
    marked_unhealthy,
    new_sets,
    resumed,
    satellite_in_use,
    sent,
    sets_changed,
    site_of,
    without,
)
from tests.unit.monitored import decided, published
from tests.unit.streams import health, reports, rows_changed, ticks_only, with_signals

DAY_NS = DAY_S * NS_PER_S
WEEK = parse_utc("2026-03-08T00:00:00Z") // WEEK_NS * WEEK_NS
LEAP = parse_utc("2017-01-01T00:00:00Z")  # the second before is 23:59:60
RISING, SETTING = "G05.1C", "G19.1C"  # within the 5 minutes on either side of
HORIZON = parse_utc("2026-03-02T15:40:00Z") // NS_PER_S // 600 * 600 * NS_PER_S
TURNS = {
    "GPS week": WEEK,
    "GPS day, then UTC day": parse_utc("2026-03-03T00:00:00Z") // DAY_NS * DAY_NS,
    "GLONASS day": parse_utc("2026-03-02T21:00:00Z"),
    "leap second": LEAP,
}


class Story(NamedTuple):
    """A stream as rows, when something happens in it, and the interval of its epochs."""

    events: tuple[Event, ...]
    event_ns: int
    interval_s: float = 1.0


@cache
def story(name: str) -> Story:
    if name in TURNS:
        return Story(around(TURNS[name], after_s=20), TURNS[name])
    if name == "rising and setting":
        return Story(around(HORIZON, 300, 300, 20.0), HORIZON, 20.0)
    if name == "new sets":
        return Story(new_sets(), NEW_SETS)
    return Story(marked_unhealthy("E")[1], UNHEALTHY_FROM)


STORIES = (*TURNS, "rising and setting", "new sets", "unhealthy")
of_every_story = pytest.mark.parametrize("name", STORIES)
of_every_form = pytest.mark.parametrize("form", FORMS)


@cache
def whole(name: str, form: Form) -> list[Output]:
    """Decided in one block."""
    told = story(name)
    return decided(sent(told.events, form), site_of(form, told.interval_s))


# ---- every story, in every form


@of_every_form
@of_every_story
def test_it_is_normal_from_start_up_to_the_end(name: str, form: Form) -> None:
    waiting = max(1, round(START_UP / story(name).interval_s))
    said = [h.state for h in health(whole(name, form))]
    assert said == [State.NOT_CONFIRMABLE] * waiting + [State.NORMAL] * (len(said) - waiting)


@of_every_form
@of_every_story
def test_every_epoch_on_both_sides_is_decided_at_its_time(name: str, form: Form) -> None:
    told = story(name)
    ticks = [event.mono_ns for event in told.events if isinstance(event, Tick)]
    assert ticks[0] < told.event_ns < ticks[-1]
    assert [r.gps_time_ns for r in reports(whole(name, form))] == ticks


@of_every_form
@of_every_story
def test_a_live_station_decides_the_same(name: str, form: Form) -> None:
    told = story(name)
    assert published(live(sent(told.events, form), site_of(form, told.interval_s))) == published(whole(name, form))


@of_every_form
@of_every_story
def test_a_station_that_starts_from_a_snapshot_at_the_event_decides_the_same(name: str, form: Form) -> None:
    told = story(name)
    outputs = resumed(sent(told.events, form), site_of(form, told.interval_s), told.event_ns)
    assert published(outputs) == published(whole(name, form))


# ---- the leap second


def test_ticks_show_one_second_of_utc_twice() -> None:
    shown = [event.utc_ns for event in around(LEAP) if isinstance(event, Tick)]
    assert len(shown) - len(set(shown)) == 1


def silence_from(event_ns: int) -> list[tuple[object, ...]]:
    """What is said, and when, while all receivers are silent from two seconds before an event on."""
    heard = [event for event in around(event_ns) if event.mono_ns < event_ns - 2 * NS_PER_S]
    outputs = decided([*heard, *ticks_only(heard[-1], 10)])
    return [(h.mono_ns - event_ns, h.state, h.cause, h.subjects) for h in health(outputs)]


def test_silence_over_the_leap_second_is_told_at_the_time_it_always_is() -> None:
    assert silence_from(LEAP) == silence_from(WEEK)


@pytest.mark.parametrize("form", ["rows", "ubx"])
@pytest.mark.parametrize("wrong_s", [-1, 1, -7 * DAY_S])
def test_a_host_whose_utc_is_wrong_changes_nothing(form: Form, wrong_s: int) -> None:
    def wrong(event: Event) -> Event:
        return replace(event, utc_ns=event.utc_ns + wrong_s * NS_PER_S) if isinstance(event, Tick) else event

    assert published(decided([wrong(event) for event in sent(story("leap second").events, form)])) == published(whole("leap second", form))


def test_a_caster_is_dated_by_its_satellites_though_the_host_is_a_week_off() -> None:
    def wrong(event: Event) -> Event:
        return replace(event, utc_ns=event.utc_ns - 7 * DAY_NS) if isinstance(event, Tick) else event

    outputs = decided([wrong(event) for event in sent(story("GPS week").events, "rtcm3")], site_of("rtcm3"))
    assert published(outputs) == published(whole("GPS week", "rtcm3"))


# ---- satellites that rise and set


def monitored(outputs: Sequence[Output]) -> list[set[str]]:
    return [set(h.monitored) for h in health(outputs)]


@of_every_form
def test_satellites_that_rise_join_the_common_set(form: Form) -> None:
    said = monitored(whole("rising and setting", form))
    assert RISING not in said[0] and RISING in said[-1]


@of_every_form
def test_satellites_that_set_leave_the_common_set(form: Form) -> None:
    said = monitored(whole("rising and setting", form))
    assert SETTING in said[0] and SETTING not in said[-1]


@pytest.mark.parametrize("receiver", "ABC")
def test_a_receiver_with_a_worse_horizon_holds_back_what_rises_and_raises_no_alarm(receiver: str) -> None:
    seen_ns = min(r.gps_time_ns for r in reports(whole("rising and setting", "rows")) if RISING in r.signals)

    def change(row: ObservationRow) -> ObservationRow:
        late = row.receiver == receiver and row.receive_time_ns < seen_ns + 60 * NS_PER_S
        return with_signals(row, lambda s: s != RISING) if late else row

    told = story("rising and setting")
    outputs = decided(rows_changed(told.events, change), site_of("rows", told.interval_s))
    assert [h.state for h in health(outputs)][1:] == [State.NORMAL] * (len(health(outputs)) - 1)


@cache
def with_a_set_that_runs_out() -> tuple[str, list[HealthReport]]:
    """A satellite that has sent nothing new for two hours, so that its set of before serves up to `NEW_SETS`, and what is said."""
    out = satellite_in_use(new_sets(), "G")

    def change(event: EphemerisReceived) -> Sequence[EphemerisReceived]:
        eph = event.ephemeris
        if eph.satellite != out or not isinstance(eph, KeplerEphemeris):
            return [event]
        return [replace(event, ephemeris=carried(eph, eph.toe_ns - 7200 * NS_PER_S))] if event.mono_ns < NEW_SETS else []

    return out, health(decided(sets_changed(new_sets(), change)))


def test_a_satellite_whose_set_runs_out_leaves_the_common_set() -> None:
    satellite, said = with_a_set_that_runs_out()
    assert without(satellite, said, NEW_SETS) == list(range(1, 35))  # the set's last second is the one two hours after its toe


def test_a_satellite_whose_set_runs_out_raises_no_alarm() -> None:
    _, said = with_a_set_that_runs_out()
    assert {h.state for h in said[START_UP:]} == {State.NORMAL}
