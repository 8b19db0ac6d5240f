"""Faults that change ranges: of a satellite, of a receiver, spoofing."""

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from integrity.events import EphemerisReceived, Event, ObservationsReceived
from integrity.gnss.ephemeris.states import satellite_states
from integrity.gnss.least_squares import solve
from integrity.gnss.observations import build_block
from integrity.gnss.positioning import points_at, prefit, state_time_ns
from integrity.station_monitor import Snapshot
from integrity.stream_memory import StreamMemory
from recordings.faults import Fault, inject
from recordings.faults.kinds import (
    AntennaMoved,
    CodeBias,
    Effect,
    ReceiverBias,
    ReceiverRamp,
    SatelliteRamp,
    SatelliteStep,
    Spoofing,
    TwoReceivers,
)
from tests.unit.faults.made import (
    END_NS,
    EPHEMERIDES,
    EPOCHS,
    INSIDE,
    OUTSIDE,
    POINTS,
    SEEN,
    SITE,
    START_NS,
    STREAM,
    WAVELENGTH_M,
    assert_antenna_elsewhere,
    assert_untouched,
    changes,
    moved_point,
    point,
    rows_of,
    with_fault,
)

# Satellites


@pytest.mark.parametrize("receiver", POINTS)
def test_a_step_lengthens_one_satellites_code_and_carrier_for_every_receiver(receiver: str) -> None:
    events = with_fault(SatelliteStep(satellite=SEEN[0][:3], size_m=10.0))
    code, carrier = changes(events, receiver), changes(events, receiver, "carrier_cycles")
    for t in INSIDE:
        assert [s for s, change in code[t].items() if change] == [SEEN[0]]
        assert code[t][SEEN[0]] == pytest.approx(10.0, abs=1e-6)
        assert carrier[t][SEEN[0]] == pytest.approx(10.0 / WAVELENGTH_M, abs=1e-6)
    assert_untouched(events, receiver, OUTSIDE)


def test_a_ramp_grows_from_its_start_and_shows_in_doppler() -> None:
    events = with_fault(SatelliteRamp(satellite=SEEN[0][:3], rate_mps=-0.1))
    code, doppler = changes(events, "B"), changes(events, "B", "doppler_hz")
    assert [code[t][SEEN[0]] for t in INSIDE] == pytest.approx([-3.0 * k for k in range(10)], abs=1e-6)
    assert doppler[INSIDE[0]][SEEN[0]] == pytest.approx(0.1 / WAVELENGTH_M, abs=1e-9)  # shrinking: approaching, positive


def test_a_deformed_code_is_longer_where_it_is_heard_so() -> None:
    events = with_fault(CodeBias(satellite=SEEN[0][:3], size_m=4.0, receivers=("B",)))
    assert [changes(events, "B")[t][SEEN[0]] for t in INSIDE] == pytest.approx([4.0] * len(INSIDE), abs=1e-6)


def test_a_deformed_code_leaves_the_carrier() -> None:
    events = with_fault(CodeBias(satellite=SEEN[0][:3], size_m=4.0, receivers=("B",)))
    assert [changes(events, "B", "carrier_cycles")[t][SEEN[0]] for t in INSIDE] == [0.0] * len(INSIDE)


def test_a_deformed_code_leaves_receivers_that_are_not_named() -> None:
    assert_untouched(with_fault(CodeBias(satellite=SEEN[0][:3], size_m=4.0, receivers=("B",))), "A", EPOCHS)


@pytest.mark.parametrize("receiver", "ABC")
def test_a_deformed_code_is_longer_everywhere_where_no_receiver_is_named(receiver: str) -> None:
    events = with_fault(CodeBias(satellite=SEEN[0][:3], size_m=4.0))
    assert changes(events, receiver)[START_NS][SEEN[0]] == pytest.approx(4.0, abs=1e-6)


# Receivers


@pytest.mark.parametrize("offset", [(15.0, 0.0, 0.0), (0.0, 15.0, 0.0), (0.0, 0.0, 15.0), (300.0, -400.0, 20.0)])
def test_a_receiver_bias_is_the_geometry_of_another_place(offset: tuple[float, float, float]) -> None:
    events = with_fault(ReceiverBias(receiver="B", offset_enu_m=offset))
    assert_antenna_elsewhere(events, "B", offset, INSIDE)
    assert_untouched(events, "A", EPOCHS)
    assert_untouched(events, "B", OUTSIDE)


def test_a_satellite_without_ephemeris_stays_as_it_is() -> None:
    events = with_fault(ReceiverBias(receiver="A", offset_enu_m=(15.0, 0.0, 0.0)))
    assert [changes(events, "A")[t]["G32.1C"] for t in INSIDE] == [0.0] * len(INSIDE)


def test_ephemerides_of_the_recordings_snapshot_serve() -> None:
    snapshot = Snapshot(StreamMemory.empty(3), ephemerides=tuple(EPHEMERIDES))
    later = [e for e in STREAM if not isinstance(e, EphemerisReceived)]
    fault = Fault(START_NS, END_NS, ReceiverBias(receiver="B", offset_enu_m=(15.0, 0.0, 0.0)))
    assert_antenna_elsewhere(inject(later, [fault], SITE, snapshot=snapshot), "B", (15.0, 0.0, 0.0), INSIDE)


def test_a_carrier_without_code_moves_too() -> None:
    first = next(i for i, e in enumerate(STREAM) if isinstance(e, ObservationsReceived) and e.row.receive_time_ns == START_NS)
    event = STREAM[first]
    assert isinstance(event, ObservationsReceived)
    blind = replace(event.row, pseudorange_m=np.full(len(event.row.signals), np.nan))
    events = [*STREAM[:first], replace(event, row=blind), *STREAM[first + 1 :]]
    fault = Fault(START_NS, END_NS, ReceiverBias(receiver="A", offset_enu_m=(15.0, 0.0, 0.0)))
    carrier = changes(inject(events, [fault], SITE), "A", "carrier_cycles")
    with_code = changes(with_fault(fault.effect), "A", "carrier_cycles")
    assert list(carrier[START_NS].values()) == pytest.approx(list(with_code[START_NS].values()), abs=1e-3)


def test_a_receiver_ramp_grows_in_its_direction() -> None:
    events = with_fault(ReceiverRamp(receiver="C", rate_mps=0.1, direction_enu=(0.0, 2.0, 0.0)))
    assert_antenna_elsewhere(events, "C", (0.0, 0.1 * 270.0, 0.0), INSIDE[-1:])


def test_a_receiver_ramp_goes_east_unless_told() -> None:
    assert ReceiverRamp(receiver="C", rate_mps=0.2).velocity_enu_mps == pytest.approx((0.2, 0.0, 0.0))


@pytest.mark.parametrize(
    "effect",
    [
        ReceiverRamp(receiver="C", rate_enu_mps=(0.5, -0.3, 0.1)),
        ReceiverBias(receiver="C", offset_enu_m=(3000.0, 0.0, 0.0)),
        Spoofing(receivers=("C",), position_ecef_m=POINTS["A"]),
        Spoofing(receivers=("C",), drift_mps=5.0),
    ],
)
def test_doppler_is_the_rate_of_the_carrier(effect: Effect) -> None:
    """Middle of two epochs against the difference between them: the third derivative over 30 s is below 5 mm/s for 100 km."""
    events = with_fault(effect)
    carrier, doppler = changes(events, "C", "carrier_cycles"), changes(events, "C", "doppler_hz")
    for t, u in pairwise(INSIDE):
        for signal in SEEN:
            rate_hz = (carrier[u][signal] - carrier[t][signal]) / 30.0
            mean_doppler_hz = (doppler[u][signal] + doppler[t][signal]) / 2.0
            assert mean_doppler_hz == pytest.approx(-rate_hz, abs=0.005 / WAVELENGTH_M)


def test_a_moved_antenna_stays_where_it_is_put() -> None:
    events = with_fault(AntennaMoved(receiver="A", offset_enu_m=(0.0, 0.5, 0.0)), end_ns=None)
    assert_antenna_elsewhere(events, "A", (0.0, 0.5, 0.0), [t for t in EPOCHS if t >= START_NS])


def test_two_receivers_move_by_the_same_offset_and_the_third_does_not() -> None:
    events = with_fault(TwoReceivers(receivers=("A", "C"), offset_enu_m=(6.0, 0.0, 0.0)))
    assert_antenna_elsewhere(events, "A", (6.0, 0.0, 0.0), INSIDE)
    assert_antenna_elsewhere(events, "C", (6.0, 0.0, 0.0), INSIDE)
    assert_untouched(events, "B", EPOCHS)


# Spoofing


def solved_ecef_m(events: Sequence[Event], receiver: str, epoch_ns: int, near_ecef_m: Sequence[float]) -> list[float]:
    """The receiver's position, linearised near where it should be."""
    row = rows_of(events, receiver)[epoch_ns]
    near = points_at(np.array([near_ecef_m]))
    block = build_block((receiver,), [epoch_ns], [[row]])
    index = np.array([[-1 if s == "G32" else int(s[1:]) - 1 for s in block.satellites]])
    first = prefit(block, satellite_states(EPHEMERIDES, index, state_time_ns(np.array([epoch_ns]))), near, None)
    used = np.isfinite(first.residual_m)
    solution = solve(first.residual_m, first.los_enu, np.ones(used.shape), used, np.zeros(used.shape[-1], dtype=np.int64), 1)
    moved_m = np.abs(solution.e_enu_m[0, 0]) @ np.abs(near.enu[0, 0])
    assert moved_m.max() < 1000.0  # beyond it the linearisation does not hold
    return (near.pos_ecef_m[0, 0] + solution.e_enu_m[0, 0] @ near.enu[0, 0]).tolist()  # type: ignore[no-any-return]


def test_the_stream_itself_solves_to_the_surveyed_points() -> None:
    assert solved_ecef_m(STREAM, "C", START_NS, POINTS["C"]) == pytest.approx(POINTS["C"], abs=1e-3)


@pytest.mark.parametrize("receiver", POINTS)
def test_captured_receivers_collapse_to_the_point_of_the_first_named(receiver: str) -> None:
    events = with_fault(Spoofing(receivers=("B", "A", "C")))
    assert solved_ecef_m(events, receiver, INSIDE[3], POINTS["B"]) == pytest.approx(POINTS["B"], abs=1e-3)


def test_a_spoofer_elsewhere_puts_receivers_at_its_position() -> None:
    far = point(44.0, 5.0, 500.0)
    events = with_fault(Spoofing(receivers=("A", "C"), position_ecef_m=far))
    assert solved_ecef_m(events, "C", INSIDE[3], far) == pytest.approx(far, abs=1e-3)
    assert_untouched(events, "B", EPOCHS)


def test_a_drifting_spoofer_goes_east() -> None:
    events = with_fault(Spoofing(receivers=("A",), drift_mps=2.0))
    there = moved_point("A", (540.0, 0.0, 0.0)).tolist()
    assert solved_ecef_m(events, "A", INSIDE[9], there) == pytest.approx(there, abs=1e-3)


def test_coherent_spoofing_keeps_lock() -> None:
    row = rows_of(with_fault(Spoofing(receivers=("A", "C"))), "C")[START_NS]
    assert not row.slip.any()


def test_incoherent_spoofing_has_every_captured_signal_acquired_anew() -> None:
    row = rows_of(with_fault(Spoofing(receivers=("A", "C"), coherent=False)), "C")[START_NS]
    assert [s for s, slip in zip(row.signals, row.slip, strict=True) if not slip] == ["G32.1C"]


def test_incoherent_spoofing_starts_the_lock_again() -> None:
    row = rows_of(with_fault(Spoofing(receivers=("A", "C"), coherent=False)), "C")[INSIDE[2]]
    assert row.lock_s.tolist() == [60.0] * (len(row.signals) - 1) + [500.0]


def test_incoherent_spoofing_steps_the_clock_and_nothing_else() -> None:
    coherent = rows_of(with_fault(Spoofing(receivers=("A", "C"))), "C")[START_NS]
    row = rows_of(with_fault(Spoofing(receivers=("A", "C"), coherent=False)), "C")[START_NS]
    assert (row.pseudorange_m - coherent.pseudorange_m)[:-1] == pytest.approx(300.0, abs=1e-6)
