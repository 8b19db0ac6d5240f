"""A receiver that freezes or falls silent, and jamming."""

import numpy as np
import pytest

from integrity.events import ObservationsReceived, Tick
from integrity.gnss.ephemeris.states import satellite_states
from integrity.gnss.gps_time import utc_from_gps
from integrity.gnss.positioning import state_time_ns
from recordings.faults import Fault, inject
from recordings.faults.kinds import (
    Jamming,
    ReceiverDrop,
    ReceiverFreeze,
)
from tests.unit.faults.made import (
    END_NS,
    EPOCHS,
    INSIDE,
    OUTSIDE,
    POINTS,
    SITE,
    START_NS,
    STEP_NS,
    STREAM,
    assert_untouched,
    changes,
    ephemeris,
    moved_point,
    rows_of,
    with_fault,
)


def test_a_frozen_receiver_repeats_its_last_row_with_advancing_time() -> None:
    events = with_fault(ReceiverFreeze(receiver="B"))
    rows, last = rows_of(events, "B"), rows_of(STREAM, "B")[EPOCHS[4]]
    assert list(rows) == EPOCHS
    assert all(np.array_equal(rows[t].pseudorange_m, last.pseudorange_m) and rows[t].signals == last.signals for t in INSIDE)
    assert_untouched(events, "B", OUTSIDE)


def test_a_receiver_that_drops_out_sends_no_rows() -> None:
    events = with_fault(ReceiverDrop(receiver="B"))
    assert list(rows_of(events, "B")) == OUTSIDE


def test_silence_gets_a_tick_when_its_deadline_passes() -> None:
    """Last heard at epoch 4, silent after two intervals: the shell's tick comes 1 ns later, 30 s before the tick of epoch 7."""
    ticks = [e.mono_ns for e in with_fault(ReceiverDrop(receiver="B")) if isinstance(e, Tick)]
    deadline_ns = EPOCHS[4] + 2 * STEP_NS + 1
    assert ticks == sorted([*EPOCHS, deadline_ns])


def test_the_tick_of_a_deadline_shows_the_utc_of_its_time() -> None:
    deadline_ns = EPOCHS[4] + 2 * STEP_NS + 1
    (tick,) = [e for e in with_fault(ReceiverDrop(receiver="B")) if isinstance(e, Tick) and e.mono_ns == deadline_ns]
    assert tick.utc_ns == utc_from_gps(deadline_ns)


def test_a_gap_shorter_than_the_silence_limit_gets_no_tick() -> None:
    events = inject(STREAM, [Fault(START_NS, EPOCHS[6], ReceiverDrop(receiver="B"))], SITE)
    assert sum(isinstance(e, Tick) for e in events) == len(EPOCHS)


# Jamming


def test_jamming_lowers_cn0_along_its_ramp() -> None:
    events = with_fault(Jamming(receivers=("A",), drop_db=12.0, ramp_s=120.0))
    drops = [44.0 - rows_of(events, "A")[t].cn0_dbhz[0] for t in INSIDE]
    assert drops == pytest.approx([0.0, 3.0, 6.0, 9.0, 12.0, 12.0, 12.0, 12.0, 12.0, 12.0])


def test_a_signal_below_28_dbhz_is_lost() -> None:
    """44 dB-Hz less 16 is kept, less 16.1 lost."""
    kept, lost = (rows_of(with_fault(Jamming(receivers=("A",), drop_db=d)), "A")[START_NS].signals for d in (16.0, 16.1))
    assert (len(kept), len(lost)) == (len(rows_of(STREAM, "A")[START_NS].signals), 0)


def test_a_receiver_that_does_not_say_its_cn0_loses_its_low_satellites() -> None:
    """Nominal 45 dB-Hz overhead, 10 dB less at the horizon: 12 dB down, what is below arcsin(0.5) = 30 deg is lost."""
    row, was = (rows_of(events, "C")[START_NS] for events in (with_fault(Jamming(receivers=("C",), drop_db=12.0)), STREAM))
    up = moved_point("C", (0.0, 0.0, 1.0)) - np.array(POINTS["C"])
    for signal in was.signals[:-1]:
        states = satellite_states([ephemeris(int(signal[1:3]))], np.array([[0]]), state_time_ns(np.array([START_NS])))
        to_satellite = states.pos_ecef_m[:, 0, 0] - np.array(POINTS["C"])
        sin_el = to_satellite @ up / np.linalg.norm(to_satellite)
        assert (signal in row.signals) == (sin_el >= 0.5)


def test_jamming_adds_the_noise_of_the_lower_cn0() -> None:
    """Before 0.3 m * 10^(1/20), after 0.3 m * 10^(16/20): 1.86 m are added; 110 draws know that to 20 % at 3 sigma."""
    events = with_fault(Jamming(receivers=("A",), drop_db=15.0))
    noise = [change for t in INSIDE for change in changes(events, "A")[t].values()]
    assert np.std(noise) == pytest.approx(np.sqrt((0.3 * 10**0.8) ** 2 - (0.3 * 10**0.05) ** 2), rel=0.2)


def test_jamming_is_the_same_for_the_same_seed() -> None:
    first, second = (changes(with_fault(Jamming(receivers=("A",), drop_db=15.0), seed=4), "A") for _ in range(2))
    assert first == second


def test_jamming_differs_for_another_seed() -> None:
    first, second = (changes(with_fault(Jamming(receivers=("A",), drop_db=15.0), seed=s), "A") for s in (4, 5))
    assert first[START_NS] != second[START_NS]


def test_jamming_does_not_depend_on_what_else_is_in_the_recording() -> None:
    fault = Fault(START_NS, END_NS, Jamming(receivers=("A",), drop_db=15.0))
    cut = [e for e in STREAM if not isinstance(e, ObservationsReceived) or e.row.receive_time_ns >= EPOCHS[8]]
    assert changes(inject(cut, [fault], SITE), "A")[EPOCHS[9]] == changes(inject(STREAM, [fault], SITE), "A")[EPOCHS[9]]
