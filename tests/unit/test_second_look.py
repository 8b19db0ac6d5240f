"""Every decision is made twice, and looking ahead changes none."""

from dataclasses import replace

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from integrity.events import EphemerisReceived, Event
from integrity.outputs import HealthReport, Output
from station.second_look import MOST_NOTED, SecondLook
from tests.unit.streams import SITE, health, new_monitor, reports, stream


def said() -> tuple[list[str], SecondLook]:
    lines: list[str] = []
    return lines, SecondLook(SITE, lines.append)


def decided() -> list[tuple[Event, list[Output]]]:
    monitor = new_monitor()
    return [(event, monitor.feed((event,))) for event in stream(8.0)]


def test_the_same_events_are_decided_alike() -> None:
    lines, look = said()
    for event, outputs in decided():
        look.note(event, outputs)
        look.take()
    assert lines == []


def test_a_decision_that_comes_out_differently_ends_it() -> None:
    _, look = said()
    events = decided()
    place = next(k for k, (_, outputs) in enumerate(events) if any(isinstance(o, HealthReport) for o in outputs))
    event, outputs = events[place]
    flipped = [replace(o, monitored=o.monitored[1:]) if isinstance(o, HealthReport) else o for o in outputs]
    for before, its_outputs in events[:place]:
        look.note(before, its_outputs)
    look.note(event, flipped)
    with pytest.raises(RuntimeError, match="decided twice, differently"):
        look.take()


def test_without_time_it_gives_up_and_says_so_once() -> None:
    lines, look = said()
    event, outputs = decided()[-1]
    for _ in range(2 * MOST_NOTED + 2):
        look.note(event, outputs)
    look.take()
    assert len(lines) == 1


@settings(deadline=None)
@given(st.sets(st.integers(0, 60)))
def test_looking_ahead_changes_no_decision(places: set[int]) -> None:
    plain, ahead = new_monitor(), new_monitor()
    events = stream(12.0)
    before = [o for event in events for o in plain.feed((event,))]
    after: list[Output] = []
    for k, event in enumerate(events):
        if k in places or k % 7 == 0:
            ahead.look_ahead()
        after += ahead.feed((event,))
    assert [r.statistic.tobytes() for r in reports(after)] == [r.statistic.tobytes() for r in reports(before)]


def test_a_sky_computed_ahead_is_not_used_with_another_ephemeris() -> None:
    plain, ahead = new_monitor(), new_monitor()
    events = list(stream(12.0))
    old = next(e for e in events if isinstance(e, EphemerisReceived))
    worse = replace(old, ephemeris=replace(old.ephemeris, af0=old.ephemeris.af0 + 1e-7, transmission_ns=old.ephemeris.transmission_ns + 1))
    place = len(events) - 8
    before = plain.feed([*events[:place], worse, *events[place:]])
    after = ahead.feed(events[:place])
    ahead.look_ahead()
    after += ahead.feed([worse, *events[place:]])
    assert health(after) == health(before)
