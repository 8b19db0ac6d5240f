"""However a stream is corrupted, the core neither raises nor says NORMAL in an epoch whose positions it cannot stand for.

NORMAL promises that every receiver was found inside its circle. Corruption here is random in kind, place and size.
"""

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from integrity.events import EphemerisReceived, Event, ObservationsReceived
from integrity.gnss.ephemeris import Ephemeris, EphemerisStore, satellite_states
from integrity.gnss.gps_time import NS_PER_S
from integrity.gnss.observations import ROW_ARRAYS, ROW_FLOATS, ObservationRow
from integrity.gnss.positioning import state_time_ns
from integrity.outputs import EpochReport, HealthReport, Output
from integrity.states import Cause, Outcome, State
from tests.unit.streams import LIMITS, TRIANGLE, new_monitor, stream

STREAM = stream(12)
BOUND_M = LIMITS.radius_m  # horizontal; a vertex further from its point must never be NORMAL
REQUIRED = np.array([t.required for t in LIMITS.thresholds])

odd_numbers = st.one_of(
    st.sampled_from([float("nan"), float("inf"), float("-inf"), 0.0, -0.0, 1e-300, 1e300, -1e300, 1e7, 1e8, 2.2e7]),
    st.floats(allow_nan=True, allow_infinity=True),
    st.floats(1.5e7, 3e7),
)
small_faults = st.floats(-200.0, 200.0)
KINDS = ("set", "add", "repeat", "drop", "swap", "retime", "lose", "rename", "ephemeris", "flag")


def with_array(row: ObservationRow, name: str, array: Any) -> ObservationRow:
    change: dict[str, Any] = {name: array}
    return replace(row, **change)


def without_some(row: ObservationRow, kept: Sequence[int]) -> ObservationRow:
    arrays: dict[str, Any] = {name: getattr(row, name)[list(kept)] for name in ROW_ARRAYS}
    return replace(row, signals=tuple(row.signals[i] for i in kept), **arrays)


def changed_row(draw: st.DrawFn, kind: str, row: ObservationRow) -> ObservationRow:
    """One row, spoiled in the way that `kind` says."""
    n = len(row.signals)
    columns = sorted(draw(st.sets(st.integers(0, n - 1), max_size=n))) if n else []
    if kind in ("set", "add"):
        name = draw(st.sampled_from(ROW_FLOATS)) if kind == "set" else "pseudorange_m"
        array = np.array(getattr(row, name))
        array[columns] = draw(odd_numbers) if kind == "set" else array[columns] + draw(small_faults)
        return with_array(row, name, array)
    if kind == "retime":
        return replace(row, receive_time_ns=row.receive_time_ns + draw(st.integers(-100, 100)) * NS_PER_S // 20)
    if kind == "lose":
        return without_some(row, columns)
    if kind == "rename":
        return replace(row, receiver=draw(st.sampled_from(["A", "B", "C", "X"])))
    return row


def changed_ephemeris(draw: st.DrawFn, ephemeris: Ephemeris) -> Ephemeris:
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
    """The stream with up to eight places spoiled, each for one row or for the rest of a receiver's rows."""
    events, done = list(STREAM), []
    for _ in range(draw(st.integers(1, 8))):
        kind, at, lasting = draw(st.sampled_from(KINDS)), draw(st.integers(0, len(events) - 1)), draw(st.booleans())
        event = events[at]
        done.append(f"{kind} {type(event).__name__} {at} {'and later' if lasting else 'alone'}")
        if kind == "repeat":
            events.insert(draw(st.integers(0, len(events))), event)
        elif kind == "drop":
            del events[at]
        elif kind == "swap":
            other = draw(st.integers(0, len(events) - 1))
            events[at], events[other] = events[other], events[at]
        elif isinstance(event, EphemerisReceived):
            events[at] = replace(event, ephemeris=changed_ephemeris(draw, event.ephemeris))
        elif isinstance(event, ObservationsReceived):
            places = [at, *(k for k in range(at + 1, len(events)) if lasting and _same_receiver(events[k], event))]
            spoiled = changed_row(draw, kind, event.row)
            events[at] = replace(event, row=spoiled)
            if kind == "add" and len(spoiled.signals) == len(event.row.signals):
                _go_on(events, places[1:], spoiled.pseudorange_m - event.row.pseudorange_m)
    return Corrupted(events, done)


def _same_receiver(event: Event, other: ObservationsReceived) -> bool:
    return isinstance(event, ObservationsReceived) and event.row.receiver == other.row.receiver


def _go_on(events: list[Event], places: Sequence[int], error_m: Any) -> None:
    """The same range errors in later rows with as many signals."""
    for k in places:
        event = events[k]
        if isinstance(event, ObservationsReceived) and len(event.row.signals) == len(error_m):
            events[k] = replace(event, row=with_array(event.row, "pseudorange_m", event.row.pseudorange_m + error_m))


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
    # Ranges as if the antennas stood elsewhere: size times the cosine towards a horizontal direction, from the first geometry on.
    towards = _cosines(azimuth)

    def change(event: Event) -> Event:
        if not isinstance(event, ObservationsReceived) or event.row.receiver not in receivers:
            return event
        late = (event.row.receive_time_ns - _first_time_ns()) // NS_PER_S >= from_s
        error_m = np.array([-size_m * towards.get(s, 0.0) for s in event.row.signals])
        return replace(event, row=with_array(event.row, "pseudorange_m", event.row.pseudorange_m + error_m)) if late else event

    reports = [o for o in decided(tuple(change(e) for e in STREAM)) if isinstance(o, EpochReport)]
    assert State.NORMAL not in [r.state for r in reports if (r.gps_time_ns - _first_time_ns()) // NS_PER_S >= from_s]


def _first_time_ns() -> int:
    return next(e.row.receive_time_ns for e in STREAM if isinstance(e, ObservationsReceived))


def _cosines(azimuth: float) -> dict[str, float]:
    """Cosine of the angle between a horizontal direction and each signal, at the first receiver in the first epoch."""
    sets = [e.ephemeris for e in STREAM if isinstance(e, EphemerisReceived)]
    satellites = sorted({eph.satellite for eph in sets})
    epoch_ns = np.array([_first_time_ns()])
    index = EphemerisStore(sets).choose(satellites, epoch_ns, np.array([len(sets)]))
    los = satellite_states(sets, index, state_time_ns(epoch_ns)).pos_ecef_m[:, 0] - TRIANGLE.pos_ecef_m[0][:, None]
    enu = TRIANGLE.enu[0] @ (los / np.linalg.norm(los, axis=0))
    return {f"{s}.1C": float(np.sin(azimuth) * enu[0, k] + np.cos(azimuth) * enu[1, k]) for k, s in enumerate(satellites)}
