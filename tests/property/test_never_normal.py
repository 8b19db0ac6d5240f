"""However a stream is corrupted, the core neither raises nor says NORMAL in an epoch whose positions it cannot stand for.

NORMAL promises that every receiver was found inside its circle. Corruption here is random in kind, place and size.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from integrity.events import EphemerisReceived, Event, ObservationsReceived
from integrity.gnss.ephemeris.broadcast import KeplerEphemeris
from integrity.gnss.gps_time import NS_PER_S
from integrity.gnss.observations import ROW_ARRAYS, ROW_FLOATS, ObservationRow
from integrity.outputs import EpochReport, HealthReport, Output
from integrity.states import Cause, Outcome, State
from tests.unit.streams import LIMITS, START_NS, epoch_of, moved, new_monitor, rows_changed, stream

STREAM = stream(12)
BOUND_M = LIMITS.radius_m  # horizontal; a vertex further from its point must never be NORMAL
REQUIRED = np.array([t.required for t in LIMITS.thresholds])

odd_numbers = st.one_of(
    st.sampled_from([float("nan"), float("inf"), float("-inf"), 0.0, -0.0, 1e-300, 1e300, -1e300, 1e7, 1e8, 2.2e7]),
    st.floats(allow_nan=True, allow_infinity=True),
    st.floats(1.5e7, 3e7),
)
small_faults = st.floats(-200.0, 200.0)
KINDS = ("set", "set", "add", "add", "repeat", "drop", "swap", "retime", "lose", "rename")


def with_array(row: ObservationRow, name: str, array: Any) -> ObservationRow:
    change: dict[str, Any] = {name: array}
    return replace(row, **change)


def without_some(row: ObservationRow, kept: Sequence[int]) -> ObservationRow:
    arrays: dict[str, Any] = {name: getattr(row, name)[list(kept)] for name in ROW_ARRAYS}
    return replace(row, signals=tuple(row.signals[i] for i in kept), **arrays)


def row_change(draw: st.DrawFn, kind: str) -> Callable[[ObservationRow], ObservationRow]:
    """What spoils a row in the way that `kind` says, the same for every row that it is applied to."""
    every = draw(st.integers(1, 5))
    name, value, fault_m = draw(st.sampled_from(ROW_FLOATS)), draw(odd_numbers), draw(small_faults)
    late_ns, receiver = draw(st.integers(-100, 100)) * NS_PER_S // 20, draw(st.sampled_from(["A", "B", "C", "X"]))

    def change(row: ObservationRow) -> ObservationRow:
        some = slice(None, None, every)
        if kind == "set":
            array = np.array(getattr(row, name))
            array[some] = value
            return with_array(row, name, array)
        if kind == "add":
            array = np.array(row.pseudorange_m)
            array[some] += fault_m
            return with_array(row, "pseudorange_m", array)
        if kind == "retime":
            return replace(row, receive_time_ns=row.receive_time_ns + late_ns)
        if kind == "lose":
            return without_some(row, range(len(row.signals))[some])
        return replace(row, receiver=receiver) if kind == "rename" else row

    return change


def changed_ephemeris(draw: st.DrawFn, ephemeris: KeplerEphemeris) -> KeplerEphemeris:
    name = draw(st.sampled_from(["sqrt_a", "e", "i0", "m0", "crs", "cuc", "af0", "group_delay_s", "accuracy_m", "omega_dot"]))
    factor = draw(st.sampled_from([1.0 + 1e-7, 1.0 + 1e-4, 2.0, -1.0, 0.0, float("nan"), float("inf")]))
    change: dict[str, Any] = {name: getattr(ephemeris, name) * factor}
    return replace(ephemeris, **change)


class Corrupted:
    """A spoiled stream, shown as what was done to it."""

    def __init__(self, events: Sequence[Event], done: Sequence[str]) -> None:
        self.events, self.done = tuple(events), tuple(done)

    def __repr__(self) -> str:
        return f"Corrupted({', '.join(self.done)})"


@st.composite
def corrupted(draw: st.DrawFn) -> Corrupted:
    """The stream with up to four places spoiled, each for one row or to the end, of one receiver or all."""
    events, done = list(STREAM), []
    for _ in range(draw(st.integers(1, 4))):
        kind, at, lasting = draw(st.sampled_from(KINDS)), draw(st.integers(0, len(events) - 1)), draw(st.booleans())
        event = events[at]
        done.append(f"{kind} {type(event).__name__} {at} {'and later' if lasting else 'alone'}")
        if kind == "repeat":
            to = draw(st.integers(0, len(events)))
            events[to:to] = events[at : at + draw(st.sampled_from([1, 4, 9]))]
        elif kind == "drop":
            del events[at]
        elif kind == "swap":
            other = draw(st.integers(0, len(events) - 1))
            events[at], events[other] = events[other], events[at]
        elif isinstance(event, EphemerisReceived) and isinstance(event.ephemeris, KeplerEphemeris):
            events[at] = replace(event, ephemeris=changed_ephemeris(draw, event.ephemeris))
        elif isinstance(event, ObservationsReceived):
            change, receivers = row_change(draw, kind), draw(st.sampled_from([event.row.receiver, "ABC"]))
            end = len(events) if lasting else at + 1
            events[at:end] = [_with_row(e, receivers, change) for e in events[at:end]]
    return Corrupted(events, done)


def _with_row(event: Event, receivers: str, change: Callable[[ObservationRow], ObservationRow]) -> Event:
    hit = isinstance(event, ObservationsReceived) and event.row.receiver in receivers
    return replace(event, row=change(event.row)) if hit and isinstance(event, ObservationsReceived) else event


def decided(events: Sequence[Event]) -> list[Output]:
    return new_monitor().feed(events)


def normal_reports(outputs: Sequence[Output]) -> list[EpochReport]:
    return [o for o in outputs if isinstance(o, EpochReport) and o.state is State.NORMAL]


@settings(max_examples=150, deadline=None)
@given(corrupted())
def test_never_normal_with_a_receiver_outside_its_circle(spoiled: Corrupted) -> None:
    horizontal_m = [np.hypot(r.e_enu_m[:, 0], r.e_enu_m[:, 1]) for r in normal_reports(decided(spoiled.events))]
    assert all((h <= BOUND_M).all() for h in horizontal_m)


@settings(max_examples=100, deadline=None)
@given(corrupted())
def test_never_normal_without_every_required_check_passing(spoiled: Corrupted) -> None:
    assert all((r.outcome[REQUIRED] == Outcome.PASS).all() for r in normal_reports(decided(spoiled.events)))


@settings(max_examples=100, deadline=None)
@given(corrupted())
def test_never_normal_for_an_epoch_that_is_not_later(spoiled: Corrupted) -> None:
    times = [o.gps_time_ns for o in decided(spoiled.events) if isinstance(o, HealthReport) and o.state is State.NORMAL]
    assert all(a is not None and b is not None and a < b for a, b in pairwise(times))


@settings(max_examples=50, deadline=None)
@given(corrupted())
def test_normal_has_no_cause_and_everything_else_has_one(spoiled: Corrupted) -> None:
    said = [(o.state, o.cause) for o in decided(spoiled.events) if isinstance(o, HealthReport)]
    assert all((state is State.NORMAL) == (cause is Cause.NONE) for state, cause in said)


far_m = st.floats(10.0 * BOUND_M, 1e6)


@settings(max_examples=60, deadline=None)
@given(st.sampled_from(["A", "B", "C", "AB", "AC", "BC", "ABC"]), far_m, st.floats(0.0, 2.0 * np.pi), st.integers(6, 10))
def test_never_normal_where_receivers_were_moved_beyond_the_bound(receivers: str, size_m: float, azimuth: float, from_s: int) -> None:
    def change(row: ObservationRow) -> ObservationRow:
        return moved(row, size_m, azimuth) if row.receiver in receivers and epoch_of(row) >= from_s else row

    reports = [o for o in decided(rows_changed(STREAM, change)) if isinstance(o, EpochReport)]
    assert State.NORMAL not in [r.state for r in reports if (r.gps_time_ns - START_NS) // NS_PER_S >= from_s]
