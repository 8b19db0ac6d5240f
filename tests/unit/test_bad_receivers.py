"""Receivers that misbehave, as bytes: whatever they do, nothing is normal by accident, and what is right comes back."""

from collections.abc import Sequence
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from integrity.config import SiteConfig
from integrity.events import Event, InputLost, ObservationsReceived, RawBytes, Tick
from integrity.gnss.gps_time import NS_PER_S, WEEK_NS
from integrity.gnss.observations import ObservationRow
from integrity.outputs import HealthReport, Output
from integrity.states import Cause, State
from recordings.simulate.observations import antennas_of, simulate
from recordings.simulate.receiver import as_bytes
from tests.unit.streams import (
    SEED,
    SITE,
    START_NS,
    a_site,
    epoch_of,
    health,
    new_monitor,
    reports,
    rows_changed,
    stream,
    with_more,
    with_values,
)

SECONDS = 40.0
CLOCK_JUMP_M = 299_792.458  # a millisecond
OSAKA_ECEF_M = (-3753212.0, 3521834.0, 3756421.0)


def sent(events: Sequence[Event], site: SiteConfig = SITE) -> tuple[Event, ...]:
    return as_bytes(events, antennas_of(site))


def decided(events: Sequence[Event]) -> list[Output]:
    return new_monitor().feed(events)


def states_from(outputs: Sequence[Output], first_s: float, end_s: float) -> set[State]:
    """States published from one moment to another; `mono_ns` of these streams is GPS time."""
    return {h.state for h in health(outputs) if START_NS + first_s * NS_PER_S <= h.mono_ns < START_NS + end_s * NS_PER_S}


def last(outputs: Sequence[Output]) -> HealthReport:
    return health(outputs)[-1]


@cache
def another_site() -> tuple[Event, ...]:
    """The same sky over a site whose receiver A stands in another city."""
    a, b, c = SITE.receivers
    elsewhere = replace(SITE, receivers=(replace(a, position_ecef_m=OSAKA_ECEF_M), b, c))
    return sent(simulate(elsewhere, START_NS, SECONDS, 1.0, SEED), elsewhere)


def of(events: Sequence[Event], receiver: str) -> list[RawBytes]:
    return [e for e in events if isinstance(e, RawBytes) and e.receiver == receiver]


# ---- unplugged


@pytest.mark.parametrize("gap_s", [1, 10, 100])
def test_a_receiver_unplugged_stops_trust_and_comes_back(gap_s: int) -> None:
    events = sent(stream(30.0 + gap_s))
    plugged = [
        e for e in events if not (isinstance(e, RawBytes) and e.receiver == "B" and 15 <= (e.mono_ns - START_NS) / NS_PER_S < 15 + gap_s)
    ]
    outputs = decided(plugged)
    noticed_s = 15 + 2  # silence: two intervals or 2 s
    if gap_s > 2:
        assert states_from(outputs, noticed_s + 0.5, 15 + gap_s) == {State.NOT_CONFIRMABLE}
    assert last(outputs).state is State.NORMAL


def test_a_silent_receiver_is_named() -> None:
    events = [e for e in sent(stream(20.0)) if not (isinstance(e, RawBytes) and e.receiver == "B" and e.mono_ns > START_NS + 10 * NS_PER_S)]
    assert (last(decided(events)).cause, last(decided(events)).subjects) == (Cause.DATA, ("B",))


# ---- two receivers on one link


@pytest.mark.parametrize("stranger_first", [False, True])
def test_two_receivers_on_one_link_are_never_normal(stranger_first: bool) -> None:
    events, strangers = sent(stream(SECONDS)), {e.mono_ns: e.data for e in of(another_site(), "A")}
    mixed: list[Event] = []
    for e in events:
        if isinstance(e, RawBytes) and e.receiver == "A":
            pair = [e, RawBytes(e.mono_ns, "A", strangers[e.mono_ns])]
            mixed += reversed(pair) if stranger_first else pair
        else:
            mixed.append(e)
    outputs = decided(mixed)
    assert {h.state for h in health(outputs)} == {State.NOT_CONFIRMABLE}


def test_two_receivers_on_one_link_are_said_to_be() -> None:
    events, others = sent(stream(10.0)), sent(rows_changed(stream(10.0), lambda row: with_more(row, "pseudorange_m", 5.0)))
    both = [x for e, f in zip(events, others, strict=True) for x in ((e, f) if isinstance(e, RawBytes) and e.receiver == "A" else (e,))]
    assert any("two receivers on one link" in reason for h in health(decided(both)) for reason in h.reasons)


# ---- a receiver that restarts


def restarted(row: ObservationRow) -> ObservationRow | None:
    """B is away for four seconds; then its clock is a millisecond off and its carriers are new."""
    t = epoch_of(row)
    if row.receiver != "B" or t < 12:
        return row
    if t < 16:
        return None
    anew = with_values(row, "lock_s", float(t - 16))
    return with_more(with_more(anew, "pseudorange_m", CLOCK_JUMP_M), "carrier_cycles", 1e5)


def test_a_receiver_that_restarts_is_blamed_for_nothing() -> None:
    outputs = decided(sent(rows_changed(stream(SECONDS), restarted)))
    assert {h.cause for h in health(outputs)} <= {Cause.NONE, Cause.NOT_READY, Cause.DATA}


def test_a_receiver_that_restarts_is_trusted_again() -> None:
    assert last(decided(sent(rows_changed(stream(SECONDS), restarted)))).state is State.NORMAL


# ---- another rate


def test_a_faster_receiver_is_used_at_the_rate_of_the_site() -> None:
    site = a_site()
    fast = simulate(a_site(0.2), START_NS, 20.0, 5.0, SEED)
    kept = [e for e in fast if not (isinstance(e, ObservationsReceived) and e.row.receiver != "B" and e.row.receive_time_ns % NS_PER_S)]
    outputs = decided(sent(kept, site))
    assert len(reports(outputs)) == 20
    assert last(outputs).state is State.NORMAL


def test_a_slower_receiver_is_silent_between() -> None:
    slow = rows_changed(stream(30.0), lambda row: None if row.receiver == "B" and epoch_of(row) % 5 else row)
    assert State.NORMAL not in {h.state for h in health(decided(sent(slow)))}


# ---- another week, another city


@pytest.mark.parametrize("weeks", [-1, 1, 1024])
def test_a_receiver_in_another_week_is_never_normal(weeks: int) -> None:
    events = list(stream(20.0))
    shifted = [
        replace(e, row=replace(e.row, receive_time_ns=e.row.receive_time_ns + weeks * WEEK_NS))
        if isinstance(e, ObservationsReceived) and e.row.receiver == "C"
        else e
        for e in events
    ]
    monitor = new_monitor()
    outputs = monitor.feed(shifted)
    assert State.NORMAL not in {h.state for h in health(outputs)}


def test_a_receiver_from_another_city_is_never_normal() -> None:
    assert {h.state for h in health(decided(another_site()))} == {State.NOT_CONFIRMABLE}


def test_a_receiver_from_another_city_says_where_it_is() -> None:
    said = [reason for h in health(decided(another_site())) for reason in h.reasons]
    assert any(r.startswith("A reports a fix of its own") for r in said)


# ---- lost input


def test_lost_input_lowers_health_and_it_recovers() -> None:
    events = list(sent(stream(30.0)))
    place = next(i for i, e in enumerate(events) if isinstance(e, Tick) and e.mono_ns >= START_NS + 15 * NS_PER_S)
    outputs = decided([*events[:place], InputLost(events[place].mono_ns, "A", 7), *events[place:]])
    lost = next(h for h in health(outputs) if any("bytes of A were lost" in r for r in h.reasons))
    assert (lost.state, lost.cause, last(outputs).state) == (State.NOT_CONFIRMABLE, Cause.DATA, State.NORMAL)


def test_rows_of_nan_are_never_normal() -> None:
    spoiled = rows_changed(stream(20.0), lambda row: with_values(row, "pseudorange_m", np.nan) if row.receiver == "C" else row)
    assert State.NORMAL not in {h.state for h in health(decided(sent(spoiled)))}
