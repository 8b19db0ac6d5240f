"""Slips on made-up phases: each test of phase continuity has one that only it can see."""

from dataclasses import replace

import numpy as np
import pytest

from integrity.gnss.carrier.slips import Arcs, CarrierMemory, Slip, SlipLimits, find_slips
from integrity.gnss.gps_time import NS_PER_S
from integrity.gnss.observations import ObservationBlock
from tests.unit.gnss.carrier.phases import LIMITS, SATELLITES, edited, part, phases, slipped, wavelengths

EPOCHS, AT = 40, 20


def arcs_of(block: ObservationBlock, limits: SlipLimits = LIMITS) -> Arcs:
    return find_slips(block, wavelengths(block), CarrierMemory.empty(len(block.receivers)), limits)[0]


def test_phases_that_nothing_happens_to_continue() -> None:
    assert arcs_of(phases(400, receivers=2)).continues[1:].all()


def test_what_was_never_seen_starts() -> None:
    assert (arcs_of(phases(3)).slip[0] == Slip.START).all()


def test_a_slip_that_the_receiver_flags_is_one() -> None:
    block = edited(phases(EPOCHS), "slip", (AT, 0, 3), True)
    assert arcs_of(block).slip[AT, 0, 3] == Slip.FLAGGED


def test_a_flag_without_a_phase_counts_when_the_phase_is_back() -> None:
    block = edited(edited(phases(EPOCHS), "slip", (AT, 0, 3), True), "carrier_cycles", (AT, 0, 3), np.nan)
    assert arcs_of(block).slip[AT + 1, 0, 3] == Slip.FLAGGED


def test_a_flag_is_not_forgotten_while_the_phase_is_away() -> None:
    """Block after block of one epoch, four of them without a phase."""
    block = edited(edited(phases(EPOCHS), "slip", (AT, 0, 3), True), "carrier_cycles", (slice(AT, AT + 4), 0, 3), np.nan)
    memory = CarrierMemory.empty(1)
    for e in range(AT + 5):
        one = part(block, slice(e, e + 1), list(range(2 * len(SATELLITES))))
        arcs, memory = find_slips(one, wavelengths(one), memory, LIMITS)
    assert arcs.slip[0, 0, 3] == Slip.FLAGGED


def test_a_lock_time_that_goes_down_is_a_slip() -> None:
    block = phases(EPOCHS)
    block = edited(block, "lock_s", (slice(AT, None), 0, 3), np.arange(EPOCHS - AT) + 2.0)
    assert arcs_of(block).slip[AT, 0, 3] == Slip.LOCK


def test_a_lock_time_shorter_than_the_gap_is_a_slip() -> None:
    block = edited(phases(EPOCHS), "carrier_cycles", (slice(AT - 4, AT), 0, 3), np.nan)
    block = edited(block, "lock_s", (slice(0, AT - 4), 0, 3), 0.5)
    block = edited(block, "lock_s", (slice(AT, None), 0, 3), 4.9)  # five seconds have passed
    assert arcs_of(block).slip[AT, 0, 3] == Slip.LOCK


def test_a_lock_time_as_long_as_the_gap_is_none() -> None:
    block = edited(phases(EPOCHS), "carrier_cycles", (slice(AT - 4, AT), 0, 3), np.nan)
    block = edited(block, "lock_s", (slice(0, AT - 4), 0, 3), 0.5)
    block = edited(block, "lock_s", (slice(AT, None), 0, 3), 5.0)
    assert arcs_of(block).slip[AT, 0, 3] == Slip.NONE


@pytest.mark.parametrize("becomes", [True, False])
def test_a_half_cycle_that_changes_is_a_slip(becomes: bool) -> None:
    block = edited(phases(EPOCHS), "half_cycle", (slice(None, AT), 0, 3), not becomes)
    block = edited(block, "half_cycle", (slice(AT, None), 0, 3), becomes)
    assert arcs_of(block).slip[AT, 0, 3] == Slip.HALF_CYCLE


@pytest.mark.parametrize("cycles", [1.0, -1.0, 2.0, 5.0])
@pytest.mark.parametrize("signal", [2, 3])
def test_a_slip_of_one_frequency_shows_against_the_other(cycles: float, signal: int) -> None:
    slip = arcs_of(slipped(phases(EPOCHS), AT, signal, cycles)).slip[AT, 0]
    assert (slip[2:4] & Slip.GEOMETRY_FREE).all()


def test_a_slip_of_one_satellite_leaves_the_others_alone() -> None:
    arcs = arcs_of(slipped(phases(EPOCHS), AT, 2, 1.0))
    others = [k for k in range(2 * len(SATELLITES)) if k not in (2, 3)]
    assert arcs.continues[1:, 0, others].all()


def test_nine_cycles_of_l1_with_seven_of_l2_show_in_doppler_alone() -> None:
    block = slipped(slipped(phases(EPOCHS), AT, 2, 9.0), AT, 3, 7.0)
    assert (arcs_of(block).slip[AT, 0, 2:4] == Slip.DOPPLER).all()


@pytest.mark.parametrize("cycles", [2.0, -5.0])
def test_of_one_frequency_doppler_tells(cycles: float) -> None:
    block = part(slipped(phases(EPOCHS), AT, 4, cycles), slice(None), [0, 2, 4, 6, 8])
    np.testing.assert_array_equal(arcs_of(block).slip[AT, 0], [0, 0, Slip.DOPPLER, 0, 0])


def test_a_jump_of_the_receivers_clock_is_no_slip() -> None:
    block = phases(EPOCHS)
    shift = np.where(np.arange(EPOCHS) >= AT, 300.0, 0.0)[:, None, None] / wavelengths(block)[:, None]
    assert arcs_of(replace(block, carrier_cycles=block.carrier_cycles + shift)).continues[1:].all()


def test_too_few_signals_to_know_the_clock_by_are_not_compared_with_doppler() -> None:
    block = part(slipped(phases(EPOCHS), AT, 0, 5.0), slice(None), [0, 2, 4])
    assert arcs_of(block).continues[AT].all()


@pytest.mark.parametrize(("missing", "slip"), [(9, Slip.NONE), (10, Slip.START)])
def test_a_gap_longer_than_ten_seconds_starts_anew(missing: int, slip: Slip) -> None:
    block = edited(phases(EPOCHS), "carrier_cycles", (slice(AT, AT + missing), 0, 3), np.nan)
    assert arcs_of(block).slip[AT + missing, 0, 3] == slip


def test_a_slip_in_a_gap_is_found_at_its_end() -> None:
    block = slipped(phases(EPOCHS), AT, 3, 3.0)
    block = edited(block, "carrier_cycles", (slice(AT, AT + 3), 0, slice(2, 4)), np.nan)
    assert arcs_of(block).slip[AT + 3, 0, 3] & Slip.GEOMETRY_FREE


def test_time_that_stands_still_starts_anew() -> None:
    block = phases(EPOCHS)
    times = np.array(block.receive_time_ns)
    times[AT] = times[AT - 1]
    assert (arcs_of(replace(block, receive_time_ns=times)).slip[AT] == Slip.START).all()


def test_memory_keeps_no_signal_longer_than_it_can_serve() -> None:
    block = phases(EPOCHS)
    later = part(replace(block, receive_time_ns=block.receive_time_ns + 100 * NS_PER_S), slice(0, 5), [0, 1])
    _, memory = find_slips(block, wavelengths(block), CarrierMemory.empty(1), LIMITS)
    _, memory = find_slips(later, wavelengths(later), memory, LIMITS)
    assert memory.signals == ("G01.1C", "G01.2W")
