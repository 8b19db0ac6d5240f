"""What comes late is not young."""

from collections.abc import Sequence
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from integrity.assembler import AlignedEpoch, Assembler, AssemblerState
from integrity.events import Event
from integrity.gnss.ephemeris.store import EphemerisStore
from integrity.gnss.gps_time import NS_PER_S
from integrity.lateness import WINDOW_NS, Fastest, after_epoch, late
from integrity.messages.outputs import encode_health
from integrity.outputs import HealthReport
from integrity.states import State
from tests.unit.monitored import decided
from tests.unit.streams import LIMITS, RECOVER_AFTER_S, SITE, START_NS, health, stream
from tests.unit.test_assembler import MONO_NS, RECEIVERS, everyone, received, tick

AHEAD_NS = MONO_NS - START_NS  # monotonic minus GPS time


def measured_s(epochs: Sequence[tuple[float, float]]) -> list[float]:
    """When epochs were measured, by (their time, how late they came), in seconds since the first."""
    fastest, found = None, []
    for epoch_s, late_s in epochs:
        epoch_ns = START_NS + round(epoch_s * NS_PER_S)
        fastest = after_epoch(fastest, epoch_ns, epoch_ns + AHEAD_NS + round(late_s * NS_PER_S))
        found.append((fastest.measured_mono_ns(epoch_ns) - MONO_NS) / NS_PER_S)
    return found


def test_the_first_epoch_was_measured_when_it_came() -> None:
    assert measured_s([(0, 0.2)]) == [0.2]


def test_an_epoch_that_comes_later_than_the_fastest_is_older() -> None:
    assert measured_s([(0, 0.2), (1, 0.2), (2, 1.9), (3, 0.9), (4, 0.2)]) == pytest.approx([0.2, 1.2, 2.2, 3.2, 4.2])


def test_a_faster_one_makes_all_that_follow_older() -> None:
    assert measured_s([(0, 0.2), (1, 0.05), (2, 0.2)]) == pytest.approx([0.2, 1.05, 2.05])


def test_the_fastest_is_remembered_for_one_window_at_least_and_two_at_most() -> None:
    window_s = 600
    slower = [(float(t), 1.0) for t in range(1, 2 * window_s + 2)]
    found = measured_s([(0, 0.0), *slower])
    as_the_first = [m == t for m, (t, _) in zip(found[1:], slower, strict=True)]
    assert as_the_first == [True] * (2 * window_s - 1) + [False] * 2


def test_a_standstill_of_hours_does_not_make_forget_the_fastest() -> None:
    # bytes of before the standstill come after it, and then what has been measured since
    hours_s = 3 * 3600.0
    assert measured_s([(0, 0.1), (1, 0.1), (2, hours_s), (hours_s + 2, 0.1)]) == pytest.approx([0.1, 1.1, 2.1, hours_s + 2.1])


@given(st.lists(st.tuples(st.integers(1, 2 * WINDOW_NS), st.integers(0, 5 * NS_PER_S)), min_size=1, max_size=30))
def test_nothing_is_younger_than_it_came_nor_older_than_the_fastest(steps: list[tuple[int, int]]) -> None:
    fastest, epoch_ns, least_ns = None, START_NS, 10 * NS_PER_S
    for step_ns, late_ns in steps:
        epoch_ns += step_ns
        mono_ns = epoch_ns + AHEAD_NS + late_ns
        least_ns = min(least_ns, late_ns)
        fastest = after_epoch(fastest, epoch_ns, mono_ns)
        assert epoch_ns + AHEAD_NS + least_ns <= fastest.measured_mono_ns(epoch_ns) <= mono_ns


def test_only_what_is_late_by_half_a_second_is_worth_a_word() -> None:
    assert (late(499_999_999, 0), len(late(500_000_000, 0))) == ((), 1)
    assert late(19 * NS_PER_S // 10, 0) == ("the epoch came 1.9 s later than others: valid from when it was measured",)


# ---- in the assembler


def assembled(late_s: Sequence[float], state: AssemblerState | None = None, first: int = 0) -> tuple[Assembler, list[AlignedEpoch]]:
    a = Assembler(RECEIVERS, NS_PER_S, LIMITS, state or AssemblerState(), EphemerisStore())
    rows = [received(r, t, s) for t, s in enumerate(late_s, first) for r in RECEIVERS]
    return a, [x for x in a.take(rows) if isinstance(x, AlignedEpoch)]


def test_an_epoch_is_measured_with_its_receivers_and_complete_with_the_last_of_them() -> None:
    a = Assembler(RECEIVERS, NS_PER_S, LIMITS, AssemblerState(), EphemerisStore())
    first, second = (x for x in a.take([*everyone(0), received("A", 1), received("B", 1), received("C", 1, 0.7)]))
    assert isinstance(first, AlignedEpoch)
    assert isinstance(second, AlignedEpoch)
    assert (first.measured_mono_ns - MONO_NS, second.measured_mono_ns - MONO_NS) == (0, NS_PER_S)
    assert second.mono_ns - second.measured_mono_ns == 700_000_000


def test_the_fastest_is_part_of_the_memory() -> None:
    a, _ = assembled([0.0, 0.3])
    assert a.state().fastest == Fastest(START_NS, AHEAD_NS, AHEAD_NS)
    _, (again,) = assembled([0.4], a.state(), first=2)
    assert again.mono_ns - again.measured_mono_ns == 400_000_000


def test_silence_does_not_make_forget_it() -> None:
    a, _ = assembled([0.0])
    a.take([tick(20)])
    _, (late_one,) = assembled([15.0], a.state(), first=6)
    assert late_one.mono_ns - late_one.measured_mono_ns == 15 * NS_PER_S


# ---- in what is published


def held_back(events: Sequence[Event], from_s: float, to_s: float) -> list[Event]:
    """Everything that came within that time comes at its end, as from a station that stood still."""
    from_ns, to_ns = (START_NS_MONO + round(s * NS_PER_S) for s in (from_s, to_s))
    return [replace(e, mono_ns=to_ns) if from_ns <= e.mono_ns < to_ns else e for e in events]


SECONDS = 15
EVENTS = stream(float(SECONDS))
START_NS_MONO = next(h.mono_ns for h in health(decided(EVENTS)))


def test_health_of_a_stream_without_delay_is_issued_when_it_is_complete() -> None:
    assert [h.issued_mono_ns for h in health(decided(EVENTS))] == [h.mono_ns for h in health(decided(EVENTS))]


def test_after_a_standstill_health_is_as_old_as_its_epochs() -> None:
    said = health(decided(held_back(EVENTS, 8.5, 9.9)))
    late_s = [round((h.mono_ns - h.issued_mono_ns) / NS_PER_S, 1) for h in said]
    assert late_s == [0.0] * 9 + [0.9] + [0.0] * (SECONDS - 10)
    assert {h.state for h in said[round(RECOVER_AFTER_S) :]} == {State.NORMAL}
    assert any("the epoch came 0.9 s later than others" in reason for reason in said[9].reasons)
    assert not any("later than others" in reason for h in (said[8], said[10]) for reason in h.reasons)


def test_it_goes_on_the_air_like_that() -> None:
    said = health(decided(held_back(EVENTS, 8.5, 9.9)))[9]
    assert encode_health(said, SITE, "test").issued_mono_ns == said.mono_ns - 900_000_000


def test_a_heartbeat_in_silence_is_issued_when_silence_is_seen() -> None:
    a_tick = next(e for e in EVENTS if type(e).__name__ == "Tick")
    silent = [*EVENTS, replace(a_tick, mono_ns=START_NS_MONO + 30 * NS_PER_S)]
    last = decided(silent)[-2]
    assert isinstance(last, HealthReport)
    assert (last.state, last.issued_mono_ns) == (State.NOT_CONFIRMABLE, START_NS_MONO + 30 * NS_PER_S)
