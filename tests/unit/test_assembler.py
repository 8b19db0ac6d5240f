"""Rows, ticks and ephemerides in; aligned epochs and interruptions out."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from integrity.assembler import MOST_PENDING_EPOCHS, AlignedEpoch, Assembler, AssemblerState, Interruption, nominal_epoch_ns
from integrity.events import EphemerisReceived, Heard, InputLost, IonosphereReceived, ObservationsReceived, StatusReceived, Tick
from integrity.gnss.ephemeris.store import EphemerisStore
from integrity.gnss.gps_time import NS_PER_S
from integrity.gnss.observations import ObservationRow
from integrity.gnss.receiver_status import Jamming, ReceiverStatus, Spoofing
from recordings.simulate.constellation import IONOSPHERE, constellation
from tests.unit.streams import LIMITS, START_NS

RECEIVERS = ("A", "B", "C")
EPHEMERIDES = constellation(1, START_NS, START_NS)
TOLERANCE_NS, SILENCE_NS = LIMITS.alignment_tolerance_ns, LIMITS.silence_ns
MONO_NS = 500 * NS_PER_S  # monotonic time of the first epoch
NOTHING = np.zeros(0)
NO_FLAGS = np.zeros(0, dtype=np.bool_)


def received(receiver: str, epoch_s: float, late_s: float = 0.0) -> ObservationsReceived:
    """A row tagged `epoch_s` after the beginning, heard at once or later."""
    tag_ns = START_NS + round(epoch_s * NS_PER_S)
    row = ObservationRow(receiver, tag_ns, (), NOTHING, NOTHING, NOTHING, NOTHING, NOTHING, NO_FLAGS, NO_FLAGS)
    return ObservationsReceived(MONO_NS + round((epoch_s + late_s) * NS_PER_S), row)


def everyone(*epochs_s: float) -> list[Heard]:
    return [received(r, t) for t in epochs_s for r in RECEIVERS]


def tick(s: float, ns: int = 0) -> Tick:
    return Tick(MONO_NS + round(s * NS_PER_S) + ns, 0, None)


def assembler(state: AssemblerState | None = None, store: EphemerisStore | None = None) -> Assembler:
    return Assembler(RECEIVERS, NS_PER_S, LIMITS, state or AssemblerState(), store or EphemerisStore())


def epochs(out: Sequence[AlignedEpoch | Interruption]) -> list[float]:
    """Seconds since the beginning of the aligned epochs."""
    return [(x.epoch_ns - START_NS) / NS_PER_S for x in out if isinstance(x, AlignedEpoch)]


def silences(out: Sequence[AlignedEpoch | Interruption]) -> list[tuple[str, ...]]:
    return [x.receivers for x in out if isinstance(x, Interruption)]


# ---- alignment


def test_an_epoch_is_complete_with_its_last_row() -> None:
    a = assembler()
    assert [epochs(a.take([received(r, 0)])) for r in RECEIVERS] == [[], [], [0]]


@pytest.mark.parametrize("order", ["ABC", "CBA", "BCA"])
def test_rows_stand_in_the_order_of_the_receivers(order: str) -> None:
    (epoch,) = assembler().take([received(r, 0) for r in order])
    assert isinstance(epoch, AlignedEpoch)
    assert [row.receiver for row in epoch.rows] == list(RECEIVERS)


def test_an_epoch_has_the_time_at_which_it_was_completed() -> None:
    (epoch,) = assembler().take([received("A", 0), received("B", 0, 0.2), received("C", 0, 0.7)])
    assert isinstance(epoch, AlignedEpoch)
    assert epoch.mono_ns == MONO_NS + 700_000_000


@pytest.mark.parametrize(
    ("off_ns", "aligned"), [(0, True), (TOLERANCE_NS, True), (-TOLERANCE_NS, True), (TOLERANCE_NS + 1, False), (-TOLERANCE_NS - 1, False)]
)
def test_a_time_tag_within_tolerance_belongs_to_its_epoch(off_ns: int, aligned: bool) -> None:
    assert epochs(assembler().take([received("A", 0), received("B", 0), received("C", off_ns / NS_PER_S)])) == ([0] if aligned else [])


def test_a_time_tag_beyond_tolerance_is_counted() -> None:
    a = assembler()
    a.take([received("C", 0.3)])
    assert a.dropped == {"C": 1}


@pytest.mark.parametrize(
    ("off_ns", "interval_ns", "expected_ns"),
    [
        (0, NS_PER_S, 0),
        (499_999_999, NS_PER_S, 0),
        (-499_999_999, NS_PER_S, 0),
        (999_000_000, NS_PER_S, NS_PER_S),
        (60_000_000, 100_000_000, 100_000_000),
        (-5_000_000_000, 30 * NS_PER_S, 0),
    ],
)
def test_nominal_epoch(off_ns: int, interval_ns: int, expected_ns: int) -> None:
    # START_NS is a multiple of 30 s: 03:00:00 UTC and 18 leap seconds are not.
    start_ns = START_NS // (30 * NS_PER_S) * 30 * NS_PER_S
    assert nominal_epoch_ns(start_ns + off_ns, interval_ns) == start_ns + expected_ns


def test_a_second_row_for_the_same_time_is_dropped() -> None:
    a = assembler()
    first, second = received("A", 0), received("A", 0.05)
    (epoch,) = a.take([first, second, received("B", 0), received("C", 0)])
    assert isinstance(epoch, AlignedEpoch)
    assert (epoch.rows[0], dict(a.dropped)) == (first.row, {"A": 1})


@pytest.mark.parametrize(
    ("apart_ns", "interrupted"), [(1, True), (LIMITS.same_time_ns, True), (LIMITS.same_time_ns + 1, False), (50_000_000, False)]
)
@pytest.mark.parametrize("complete", [False, True])
def test_two_rows_at_one_time_that_differ_are_two_receivers_on_one_link(apart_ns: int, interrupted: bool, complete: bool) -> None:
    a = assembler()
    a.take(everyone(0) if complete else [received("A", 0)])
    out = a.take([received("A", apart_ns / NS_PER_S)])
    assert silences(out) == ([("A",)] if interrupted else [])


@pytest.mark.parametrize("complete", [False, True])
def test_the_same_row_twice_is_no_interruption(complete: bool) -> None:
    a = assembler()
    a.take(everyone(0) if complete else [received("A", 0)])
    assert a.take([received("A", 0)]) == []


def test_two_receivers_on_one_link_are_known_after_a_snapshot() -> None:
    a = assembler()
    a.take(everyone(0))
    assert silences(assembler(a.state()).take([received("C", 0.001)])) == [("C",)]


def test_lost_input_interrupts() -> None:
    a = assembler()
    a.take(everyone(0))
    (lost,) = a.take([InputLost(MONO_NS + 1, "B", 3)])
    assert isinstance(lost, Interruption)
    assert (lost.receivers, lost.last_epoch_ns) == (("B",), START_NS)


def test_what_receivers_say_goes_along_with_the_epoch() -> None:
    a = assembler()
    said = [
        StatusReceived(MONO_NS, "B", ReceiverStatus(jamming=Jamming.WARNING)),
        StatusReceived(MONO_NS, "B", ReceiverStatus(spoofing=Spoofing.INDICATED)),
        StatusReceived(MONO_NS, "X", ReceiverStatus(spoofing=Spoofing.INDICATED)),
    ]
    (epoch,) = a.take([*said, *everyone(0)])
    assert epoch.statuses == (("B", ReceiverStatus(jamming=Jamming.WARNING, spoofing=Spoofing.INDICATED)),)


def test_an_epoch_repeated_by_everyone_is_decided_once() -> None:
    assert epochs(assembler().take(everyone(0, 1, 1, 0, 2))) == [0, 1, 2]


def test_a_row_whose_time_has_passed_is_dropped() -> None:
    a = assembler()
    a.take(everyone(5))
    a.take(everyone(4))
    assert a.dropped == {"A": 1, "B": 1, "C": 1}


def test_rows_without_partners_are_dropped_when_a_later_epoch_is_complete() -> None:
    a = assembler()
    a.take([received("A", 0), received("B", 0), *everyone(1)])
    assert a.dropped == {"A": 1, "B": 1}


def test_rows_of_a_later_epoch_wait_for_their_partners() -> None:
    order = [received("A", 0), received("A", 1), received("B", 0), received("B", 1), received("C", 0), received("C", 1)]
    assert epochs(assembler().take(order)) == [0, 1]


def test_a_time_that_jumps_back_is_not_decided_again() -> None:
    assert epochs(assembler().take([*everyone(10, 11), *everyone(3, 4), *everyone(12)])) == [10, 11, 12]


def test_one_receiver_whose_time_jumps_ahead_stops_the_epochs() -> None:
    a = assembler()
    jumped = [received(r, t + (3600 if r == "B" else 0)) for t in range(5) for r in RECEIVERS]
    assert epochs(a.take(jumped)) == []


def test_one_receiver_that_comes_back_from_ahead_is_aligned_again() -> None:
    jumped = [received(r, t + (3600 if r == "B" else 0)) for t in range(5) for r in RECEIVERS]
    assert epochs(assembler().take([*jumped, *everyone(5, 6)])) == [5, 6]


def test_a_receiver_of_another_site_is_dropped() -> None:
    a = assembler()
    assert (epochs(a.take([received("X", 0), *everyone(0)])), a.dropped["X"]) == ([0], 1)


def test_receivers_whose_times_never_meet_fill_a_bounded_store() -> None:
    a = assembler()
    a.take([received("A", t) for t in range(1000)])
    assert len(a.state().pending) == MOST_PENDING_EPOCHS


def test_what_the_bounded_store_gives_up_is_counted() -> None:
    a = assembler()
    a.take([received("A", t) for t in range(1000)])
    assert a.dropped["A"] == 1000 - MOST_PENDING_EPOCHS


def test_the_newest_rows_stay_in_the_bounded_store() -> None:
    a = assembler()
    a.take([received("A", t) for t in range(1000)])
    assert epochs(a.take([received("B", 999), received("C", 999)])) == [999]


@given(st.lists(st.tuples(st.sampled_from([*RECEIVERS, "X"]), st.integers(-3, 60)), max_size=150))
def test_epochs_only_advance(rows: list[tuple[str, int]]) -> None:
    found = epochs(assembler().take([received(r, t) for r, t in rows]))
    assert found == sorted(set(found))


@given(st.lists(st.tuples(st.sampled_from(RECEIVERS), st.integers(0, 30)), max_size=150))
def test_every_row_is_aligned_waiting_or_counted(rows: list[tuple[str, int]]) -> None:
    a = assembler()
    aligned = 3 * len(epochs(a.take([received(r, t) for r, t in rows])))
    assert aligned + sum(len(waiting) for _, waiting in a.state().pending) + a.dropped.total() == len(rows)


@given(st.lists(st.tuples(st.sampled_from(RECEIVERS), st.integers(0, 12)), max_size=60), st.data())
def test_a_new_assembler_goes_on_from_the_state_of_the_old_one(rows: list[tuple[str, int]], data: st.DataObject) -> None:
    events = [received(r, t) for r, t in rows]
    cut = data.draw(st.integers(0, len(events)))
    first = assembler()
    before = first.take(events[:cut])
    assert epochs(before + assembler(first.state()).take(events[cut:])) == epochs(assembler().take(events))


# ---- silence


def test_the_first_tick_of_all_is_not_yet_a_silence() -> None:
    # Nothing is silent before two seconds have passed: the station is not ready, which is another cause.
    assert silences(assembler().take([tick(0)])) == []


def test_a_tick_between_the_first_rows_is_not_yet_a_silence() -> None:
    assert silences(assembler().take([received("A", 0), tick(0.1), received("B", 0, 0.2), received("C", 0, 0.2)])) == []


@pytest.mark.parametrize(("past_ns", "expected"), [(0, []), (1, [RECEIVERS])])
def test_silence_begins_a_nanosecond_past_its_deadline(past_ns: int, expected: list[tuple[str, ...]]) -> None:
    assert silences(assembler().take([*everyone(0), Tick(MONO_NS + SILENCE_NS + past_ns, 0, None)])) == expected


@pytest.mark.parametrize(("past_ns", "expected"), [(0, []), (1, [("B",)])])
def test_silence_of_one_receiver(past_ns: int, expected: list[tuple[str, ...]]) -> None:
    rows = [*everyone(0), received("A", 1), received("C", 1)]
    assert silences(assembler().take([*rows, Tick(MONO_NS + SILENCE_NS + past_ns, 0, None)])) == expected


def test_the_deadline_is_the_last_tick_without_silence() -> None:
    a = assembler()
    a.take(everyone(0, 1))
    deadline_ns = a.deadline_ns
    assert deadline_ns is not None
    found = [silences(a.take([Tick(deadline_ns + past_ns, 0, None)])) for past_ns in (0, 1)]
    assert found == [[], [RECEIVERS]]


def test_before_the_first_event_there_is_no_deadline() -> None:
    assert assembler().deadline_ns is None


def test_a_receiver_that_was_never_heard_is_silent_in_time() -> None:
    rows = [received(r, t) for t in range(3) for r in "AB"]
    assert silences(assembler().take([*rows, tick(SILENCE_NS / NS_PER_S), tick(SILENCE_NS / NS_PER_S, 1)])) == [("C",)]


def test_receivers_that_send_but_share_no_epoch_are_silent_together() -> None:
    shifted = [received(r, t + 0.3 * (r == "C")) for t in range(5) for r in RECEIVERS]
    assert silences(assembler().take([*shifted, tick(4.5)])) == [()]


def test_every_tick_during_silence_counts() -> None:
    assert len(silences(assembler().take([*everyone(0), tick(3), tick(4), tick(5)]))) == 3


def test_rows_end_a_silence() -> None:
    assert silences(assembler().take([*everyone(0), tick(3), *everyone(4), tick(4.5)])) == [RECEIVERS]


def test_epochs_and_silences_stand_in_the_order_of_the_events() -> None:
    out = assembler().take([*everyone(0), tick(3), *everyone(4)])
    assert [type(x) for x in out] == [AlignedEpoch, Interruption, AlignedEpoch]


# ---- what was known


def test_an_epoch_knows_the_ephemerides_that_had_arrived() -> None:
    early, late = (EphemerisReceived(MONO_NS, eph) for eph in EPHEMERIDES[:2])
    out = assembler().take([early, *everyone(0), late, *everyone(1)])
    assert [x.arrived for x in out if isinstance(x, AlignedEpoch)] == [1, 2]


def test_an_implausible_ephemeris_is_refused() -> None:
    store = EphemerisStore()
    a = assembler(store=store)
    a.take([EphemerisReceived(MONO_NS, replace(EPHEMERIDES[0], e=0.9))])
    assert (len(store.ephemerides), a.state().refused_ephemerides) == (0, 1)


def test_an_epoch_knows_the_ionosphere_of_its_time() -> None:
    out = assembler().take([*everyone(0), IonosphereReceived(MONO_NS, IONOSPHERE), *everyone(1)])
    assert [x.klobuchar for x in out if isinstance(x, AlignedEpoch)] == [None, IONOSPHERE]


def test_a_gap_that_no_tick_noticed_is_a_silence_all_the_same() -> None:
    out = assembler().take(everyone(0, 1, 7))
    assert [type(x) for x in out] == [AlignedEpoch, AlignedEpoch, Interruption, AlignedEpoch]
