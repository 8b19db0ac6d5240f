"""Every decision is made twice, and looking ahead changes none."""

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from integrity.events import EphemerisReceived, Event, Tick
from integrity.gnss.ephemeris.broadcast import KeplerEphemeris
from integrity.gnss.observations import ObservationRow
from integrity.outputs import HealthReport, Output
from integrity.station_monitor import StationMonitor
from station.second_look import MOST_NOTED, SecondLook
from tests.unit.streams import (
    SITE,
    epoch_of,
    health,
    moved,
    new_monitor,
    reports,
    rows_changed,
    stream,
    with_more,
    with_signals,
    with_values,
)


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
    flipped = [replace(o, vouched=o.vouched[1:]) if isinstance(o, HealthReport) else o for o in outputs]
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


CHANGING_FROM_S = 8  # by then it is NORMAL


def changing(row: ObservationRow) -> ObservationRow:
    """Three seconds each: a satellite disappears, and is there again; one is 40 m off and goes out; one range is missing at one receiver;
    one receiver has trouble with one satellite; one constellation is gone; an antenna stands 5 km away."""
    match (epoch_of(row) - CHANGING_FROM_S) // 3:
        case 0:
            return with_signals(row, lambda s: s != row.signals[0])
        case 2:
            return with_more(row, "pseudorange_m", 40.0, [3])
        case 4 if row.receiver == "B":
            return with_values(row, "pseudorange_m", np.nan, [5])
        case 5 if row.receiver == "C":
            return with_more(row, "pseudorange_m", 8.0, [6])
        case 6:
            return with_signals(row, lambda s: s.startswith("G"))
        case 7 if row.receiver == "A":
            return moved(row, 5000.0, 1.5)
    return row


def numbers(outputs: Sequence[Output]) -> list[tuple[bytes, ...]]:
    return [tuple(x.tobytes() for x in (r.statistic, r.e_enu_m, r.used, r.residual_sigmas, r.b_m)) for r in reports(outputs)]


def told(monitor: StationMonitor, events: Sequence[Event], ahead: bool) -> list[Output]:
    outputs: list[Output] = []
    for event in events:
        outputs += monitor.feed((event,))
        if ahead:
            monitor.look_ahead()
    return outputs


CHANGING = rows_changed(stream(40.0), changing)
PLAIN = told(new_monitor(), CHANGING, ahead=False)


def test_looking_ahead_changes_no_bit_while_the_satellites_used_change() -> None:
    assert numbers(told(new_monitor(), CHANGING, ahead=True)) == numbers(PLAIN)


def test_the_satellites_used_do_change() -> None:
    used = [r.used.tobytes() for r in reports(PLAIN)]
    assert sum(a != b for a, b in pairwise(used)) >= 7  # there and back, mostly


def test_a_satellite_does_go_out() -> None:
    assert any(r.exclusions for r in reports(PLAIN))


def test_a_channel_is_left_out() -> None:
    assert any(r.channels for r in reports(PLAIN))


def test_a_quiet_epoch_finds_its_geometry_made(monkeypatch: pytest.MonkeyPatch) -> None:
    monitor, events = new_monitor(), stream(12.0)
    made: list[int] = []
    place = 1 + max(i for i, e in enumerate(events[:-8]) if isinstance(e, Tick))
    told(monitor, events[:place], ahead=True)
    monkeypatch.setattr("integrity.deciding.geometry_of", lambda *_: made.append(1))
    assert (len(reports(monitor.feed(events[place : place + 3]))), made) == (1, [])


def test_a_sky_computed_ahead_is_not_used_with_another_ephemeris() -> None:
    plain, ahead = new_monitor(), new_monitor()
    events = list(stream(12.0))
    old = next(e for e in events if isinstance(e, EphemerisReceived))
    assert isinstance(old.ephemeris, KeplerEphemeris)
    worse = replace(old, ephemeris=replace(old.ephemeris, af0=old.ephemeris.af0 + 1e-7, transmission_ns=old.ephemeris.transmission_ns + 1))
    place = len(events) - 8
    before = plain.feed([*events[:place], worse, *events[place:]])
    after = ahead.feed(events[:place])
    ahead.look_ahead()
    after += ahead.feed([worse, *events[place:]])
    assert health(after) == health(before)
