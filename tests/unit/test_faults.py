"""Each kind of fault on a small made-up stream: 20 epochs of 30 s, three receivers (C 100 km away), 24 satellites in circles and G32,
which has no ephemeris."""

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from integrity.config import IntegrityConfig, ReceiverConfig, SiteConfig
from integrity.errors import ConfigError
from integrity.events import EphemerisReceived, Event, ObservationsReceived, Tick
from integrity.gnss.constants import EARTH_ROTATION_RADPS, L1_HZ, SPEED_OF_LIGHT_MPS
from integrity.gnss.ephemeris import Ephemeris, satellite_states
from integrity.gnss.frames import ecef_from_geodetic, enu_axes, geodetic_from_ecef
from integrity.gnss.gps_time import NS_PER_S, gps_from_calendar, utc_from_gps
from integrity.gnss.observations import Floats, ObservationRow, build_block
from integrity.gnss.positioning import points_at, prefit, solve, state_time_ns
from integrity.station_monitor import Snapshot
from integrity.stream_memory import StreamMemory
from recordings.faults import Fault, inject, parse_faults
from recordings.faults.kinds import (
    AntennaMoved,
    Effect,
    Jamming,
    ReceiverBias,
    ReceiverDrop,
    ReceiverFreeze,
    ReceiverRamp,
    SatelliteRamp,
    SatelliteStep,
    Spoofing,
    TwoReceivers,
    WrongEphemeris,
)
from recordings.toml_file import ConfigProblems

STEP_NS = 30 * NS_PER_S
FIRST_NS = gps_from_calendar(2010, 3, 18, 5, 0, 0)
EPOCHS = [FIRST_NS + k * STEP_NS for k in range(20)]
START_NS, END_NS = EPOCHS[5], EPOCHS[15]  # of every fault
CLOCK_M = 900.0  # of every receiver, 3 us
WAVELENGTH_M = SPEED_OF_LIGHT_MPS / L1_HZ


def point(lat_deg: float, lon_deg: float, height_m: float) -> tuple[float, float, float]:
    x, y, z = ecef_from_geodetic(np.deg2rad(lat_deg), np.deg2rad(lon_deg), height_m)
    return float(x), float(y), float(z)


POINTS = {"A": point(41.40, 2.10, 150.0), "B": point(41.401, 2.10, 152.0), "C": point(42.20, 2.60, 900.0)}
SITE = SiteConfig(
    "made-up", "none", None, STEP_NS, "none", tuple(ReceiverConfig(r, p) for r, p in POINTS.items()), IntegrityConfig(), 3000, ""
)


def ephemeris(number: int, transmission_ns: int = FIRST_NS - 600 * NS_PER_S, issue: int = 7) -> Ephemeris:
    plane, slot = divmod(number - 1, 4)
    zeros = dict.fromkeys(("delta_n", "i_dot", "cuc", "cus", "crc", "crs", "cic", "cis", "af1", "af2", "group_delay_s"), 0.0)
    return Ephemeris(
        satellite=f"G{number:02d}",
        issue=issue,
        healthy=True,
        accuracy_m=2.4,
        transmission_ns=transmission_ns,
        toe_ns=FIRST_NS + 3600 * NS_PER_S,
        toc_ns=FIRST_NS + 3600 * NS_PER_S,
        fit_half_s=7200.0,
        sqrt_a=5153.7,
        e=0.01,
        i0=0.96,
        omega0=plane * np.pi / 3.0,
        omega=0.4,
        m0=(slot + plane / 6.0) * np.pi / 2.0,
        omega_dot=-8e-9,
        af0=1e-5 * number,
        **zeros,
    )


EPHEMERIDES = [ephemeris(n) for n in range(1, 25)]


def measured(receiver: str, epoch_ns: int) -> ObservationRow:
    """Exact ranges by the broadcast model with a clock of 3 us; C/N0 is unknown to C; G32 stands still."""
    index = np.arange(24)[None]
    states = satellite_states(EPHEMERIDES, index, state_time_ns(np.array([epoch_ns])))
    signals = [f"G{n:02d}.1C" for n in range(1, 25)]
    rho = np.full(24, 2.3e7)
    here = points_at(np.array([POINTS[receiver]]))
    for _ in range(4):
        row = made_row(receiver, epoch_ns, tuple(signals), rho)
        at_point = prefit(build_block((receiver,), [epoch_ns], [[row]]), states, here, None)
        rho = rho - at_point.residual_m[0, 0] + CLOCK_M
    up = at_point.el_rad[0, 0] > np.deg2rad(5.0)
    kept = [s for s, keep in zip(signals, up, strict=True) if keep]
    return made_row(receiver, epoch_ns, (*kept, "G32.1C"), np.append(rho[up], 2.2e7))


def made_row(receiver: str, epoch_ns: int, signals: tuple[str, ...], rho: Floats) -> ObservationRow:
    n = len(signals)
    no = np.zeros(n, dtype=np.bool_)
    cn0 = np.full(n, np.nan if receiver == "C" else 44.0)
    return ObservationRow(receiver, epoch_ns, signals, rho, rho / WAVELENGTH_M, np.full(n, 1000.0), cn0, np.full(n, 500.0), no, no)


def made_stream() -> tuple[Event, ...]:
    events: list[Event] = [EphemerisReceived(FIRST_NS, eph) for eph in EPHEMERIDES]
    for epoch_ns in EPOCHS:
        events += [ObservationsReceived(epoch_ns, measured(r, epoch_ns)) for r in POINTS]
        events.append(Tick(epoch_ns, utc_from_gps(epoch_ns), None))
    return tuple(events)


STREAM = made_stream()


def with_fault(effect: Effect, end_ns: int | None = END_NS, seed: int = 0) -> tuple[Event, ...]:
    return inject(STREAM, [Fault(START_NS, end_ns, effect)], SITE, seed)


def rows_of(events: Sequence[Event], receiver: str) -> dict[int, ObservationRow]:
    return {e.row.receive_time_ns: e.row for e in events if isinstance(e, ObservationsReceived) and e.row.receiver == receiver}


Change = dict[str, float]
SEEN = sorted(set.intersection(*(set(rows_of(STREAM, r)[t].signals) for r in POINTS for t in EPOCHS)))[:-1]  # the last is G32


def changes(events: Sequence[Event], receiver: str, quantity: str = "pseudorange_m") -> dict[int, Change]:
    """What became of a quantity, by epoch and signal."""
    was, now = rows_of(STREAM, receiver), rows_of(events, receiver)
    return {
        t: dict(zip(row.signals, getattr(row, quantity) - getattr(was[t], quantity), strict=True))
        for t, row in now.items()
        if row.signals == was[t].signals
    }


def faulty(epoch_ns: int) -> bool:
    return START_NS <= epoch_ns < END_NS


def range_m(row: ObservationRow, signal: str, antenna_ecef_m: Floats) -> float:
    """Distance from the satellite at transmission, turned with the Earth while the signal travels, worked out from first principles."""
    eph = ephemeris(int(signal[1:3]))
    travel_s = (row.pseudorange_m[row.signals.index(signal)] - CLOCK_M) / SPEED_OF_LIGHT_MPS + eph.af0
    sent_ns = row.receive_time_ns - round((travel_s + CLOCK_M / SPEED_OF_LIGHT_MPS) * NS_PER_S)
    x, y, z = satellite_states([eph], np.array([[0]]), np.array([sent_ns])).pos_ecef_m[:, 0, 0]
    turn = EARTH_ROTATION_RADPS * travel_s
    turned = np.array([x * np.cos(turn) + y * np.sin(turn), y * np.cos(turn) - x * np.sin(turn), z])
    return float(np.linalg.norm(turned - antenna_ecef_m))


def moved_point(receiver: str, offset_enu_m: Sequence[float]) -> Floats:
    lat, lon, _ = geodetic_from_ecef(np.array(POINTS[receiver]))
    return np.array(POINTS[receiver]) + np.array(offset_enu_m) @ enu_axes(lat, lon)


def assert_antenna_elsewhere(events: Sequence[Event], receiver: str, offset_enu_m: Sequence[float], epochs: Sequence[int]) -> None:
    """Ranges and carriers of every satellite with an ephemeris changed by the geometry: to 0.1 mm, and 1 ppm for the air's new slant."""
    tolerance_m = 1e-4 + 1e-6 * float(np.linalg.norm(offset_enu_m))
    was, now = rows_of(STREAM, receiver), rows_of(events, receiver)
    code, carrier = changes(events, receiver), changes(events, receiver, "carrier_cycles")
    for t in epochs:
        for signal in SEEN:
            expected = range_m(now[t], signal, moved_point(receiver, offset_enu_m)) - range_m(was[t], signal, np.array(POINTS[receiver]))
            assert code[t][signal] == pytest.approx(expected, abs=tolerance_m)
            assert carrier[t][signal] * WAVELENGTH_M == pytest.approx(expected, abs=tolerance_m)


def assert_untouched(events: Sequence[Event], receiver: str, epochs: Sequence[int]) -> None:
    was, now = rows_of(STREAM, receiver), rows_of(events, receiver)
    assert all(now[t] is was[t] for t in epochs)


OUTSIDE = [t for t in EPOCHS if not faulty(t)]
INSIDE = [t for t in EPOCHS if faulty(t)]


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


# Ephemerides


def orbit_displacement_m(true: Ephemeris, wrong: Ephemeris, gps_ns: int) -> Floats:
    """Along, cross, radial."""
    (pos, vel), (other, _) = (
        (s.pos_ecef_m[:, 0, 0], s.vel_ecef_mps[:, 0, 0])
        for s in (satellite_states([e], np.array([[0]]), np.array([gps_ns])) for e in (true, wrong))
    )
    radial = pos / np.linalg.norm(pos)
    h = np.cross(pos, vel + np.cross([0.0, 0.0, EARTH_ROTATION_RADPS], pos))
    cross = h / np.linalg.norm(h)
    return np.array([np.cross(cross, radial), cross, radial]) @ (other - pos)


def altered(events: Sequence[Event], satellite: str) -> list[Ephemeris]:
    known = {e.ephemeris for e in STREAM if isinstance(e, EphemerisReceived)}
    found = [e.ephemeris for e in events if isinstance(e, EphemerisReceived) and e.ephemeris.satellite == satellite]
    return [e for e in found if e not in known]


@pytest.mark.parametrize("axis", ["along", "cross", "radial"])
@pytest.mark.parametrize("offset_m", [700.0, -2500.0])
@pytest.mark.parametrize("after_s", [0, 600])
@pytest.mark.parametrize("signal", SEEN)
def test_a_wrong_ephemeris_is_displaced_as_told(axis: str, offset_m: float, after_s: int, signal: str) -> None:
    satellite = signal[:3]
    wrong, _ = altered(
        with_fault(WrongEphemeris.model_validate({"satellite": satellite, "offset_m": offset_m, "direction": axis})), satellite
    )
    found = orbit_displacement_m(ephemeris(int(satellite[1:])), wrong, START_NS + after_s * NS_PER_S) / offset_m
    expected = np.array([axis == "along", axis == "cross", axis == "radial"], dtype=np.float64)
    assert np.abs(found - expected)[expected == 1.0].max() < 0.02
    assert np.abs(found - expected)[expected == 0.0].max() < 0.05


def test_a_wrong_ephemeris_enters_before_the_first_faulty_epoch_and_leaves_after_the_last() -> None:
    satellite = SEEN[0][:3]
    events = with_fault(WrongEphemeris(satellite=satellite, offset_m=700.0, direction="along"))
    places = [i for i, e in enumerate(events) if isinstance(e, EphemerisReceived) and e.mono_ns > FIRST_NS]
    following = [e.row.receive_time_ns for i in places if isinstance(e := events[i + 1], ObservationsReceived)]
    assert following == [START_NS, END_NS]


def test_the_true_ephemeris_enters_again_with_a_later_transmission() -> None:
    satellite = SEEN[0][:3]
    wrong, again = altered(with_fault(WrongEphemeris(satellite=satellite, offset_m=700.0, direction="along")), satellite)
    assert again == ephemeris(int(satellite[1:]), transmission_ns=END_NS)
    assert (wrong.issue, wrong.transmission_ns) == (8, START_NS)


def test_an_ephemeris_that_arrives_during_the_fault_is_wrong_likewise_and_true_afterwards() -> None:
    number = int(SEEN[0][1:3])
    arriving = ephemeris(number, transmission_ns=EPOCHS[9], issue=20)
    place = next(i for i, e in enumerate(STREAM) if e.mono_ns == EPOCHS[9])
    events = [*STREAM[:place], EphemerisReceived(EPOCHS[9], arriving), *STREAM[place:]]
    fault = Fault(START_NS, END_NS, WrongEphemeris(satellite=f"G{number:02d}", offset_m=700.0, direction="cross"))
    _, during, again = altered(inject(events, [fault], SITE), f"G{number:02d}")
    assert orbit_displacement_m(arriving, during, EPOCHS[9]) == pytest.approx([0.0, 700.0, 0.0], abs=14.0)
    assert again == replace(arriving, transmission_ns=END_NS)


def test_an_orbit_that_no_station_accepts_is_refused() -> None:
    low = [replace(e, ephemeris=replace(e.ephemeris, sqrt_a=5001.0)) if isinstance(e, EphemerisReceived) else e for e in STREAM]
    fault = Fault(START_NS, END_NS, WrongEphemeris(satellite=SEEN[0][:3], offset_m=-100_000.0, direction="radial"))
    with pytest.raises(ConfigError, match="no orbit that a station accepts"):
        inject(low, [fault], SITE)


# What an injection must not do


def test_input_events_are_not_changed() -> None:
    before = [rows_of(STREAM, "A")[t].pseudorange_m.copy() for t in EPOCHS]
    with_fault(ReceiverBias(receiver="A", offset_enu_m=(15.0, 0.0, 0.0)))
    assert all(np.array_equal(b, rows_of(STREAM, "A")[t].pseudorange_m) for b, t in zip(before, EPOCHS, strict=True))


def test_the_order_of_faults_does_not_matter() -> None:
    faults = [
        Fault(START_NS, END_NS, ReceiverFreeze(receiver="A")),
        Fault(EPOCHS[3], EPOCHS[8], SatelliteStep(satellite=SEEN[0][:3], size_m=10.0)),
        Fault(EPOCHS[2], EPOCHS[9], ReceiverBias(receiver="A", offset_enu_m=(5.0, 0.0, 0.0))),
    ]
    forward, backward = (changes(inject(STREAM, order, SITE), "A") for order in (faults, faults[::-1]))
    assert [list(f.values()) for f in forward.values()] == [pytest.approx(list(b.values()), abs=1e-6) for b in backward.values()]


NOTHING = {
    "before the recording": (
        Fault(1, 2, SatelliteStep(satellite="G01", size_m=1.0)),
        "covers no epoch: the recording spans 2010-03-18T04:59:45Z",
    ),
    "satellite unseen": (
        Fault(START_NS, END_NS, SatelliteStep(satellite="G31", size_m=1.0)),
        f"G31 is not seen then; seen are {SEEN[0][:3]}, ",
    ),
    "ephemeris unknown": (
        Fault(START_NS, END_NS, WrongEphemeris(satellite="G32", offset_m=100.0, direction="along")),
        "no ephemeris of G32",
    ),
    "nothing to repeat": (Fault(FIRST_NS, END_NS, ReceiverFreeze(receiver="A")), "no row of the receiver before it"),
    "spoofed to where it is": (Fault(START_NS, END_NS, Spoofing(receivers=("A",))), "the ranges are what they would be anyway"),
    "ramp not begun": (Fault(START_NS, EPOCHS[6], Jamming(receivers=("A",), drop_db=9.0, ramp_s=60.0)), "the ramp has not begun"),
}


@pytest.mark.parametrize("case", NOTHING)
def test_a_fault_that_does_nothing_is_refused(case: str) -> None:
    fault, message = NOTHING[case]
    with pytest.raises(ConfigError) as caught:
        inject(STREAM, [fault], SITE)
    assert message in str(caught.value)


# The tables


def fault_table(text: str) -> str:
    return f"[[fault]]\n{text}\n"


def parsed(text: str) -> tuple[Fault, ...]:
    return parse_faults(text, "faults.toml", FIRST_NS, SITE)


STEP = 'kind = "satellite_step"\nsatellite = "G05"\nsize_m = 10.0\n'


def test_start_is_utc() -> None:
    (fault,) = parsed(fault_table(STEP + 'start = "2010-03-18T05:20:00Z"\nduration_s = 120'))
    assert fault == Fault(
        FIRST_NS + 1215 * NS_PER_S, FIRST_NS + 1335 * NS_PER_S, SatelliteStep(satellite="G05", size_m=10.0)
    )  # 15 leap seconds in 2010


def test_start_s_counts_from_the_first_epoch() -> None:
    (fault,) = parsed(fault_table(STEP + "start_s = 90\nduration_s = 0.5"))
    assert (fault.start_ns, fault.end_ns) == (FIRST_NS + 90 * NS_PER_S, FIRST_NS + 90_500_000_000)


def test_a_moved_antenna_needs_no_duration() -> None:
    (fault,) = parsed(fault_table('kind = "antenna_moved"\nreceiver = "A"\noffset_enu_m = [1, 0, 0]\nstart_s = 0'))
    assert fault.end_ns is None


WHEN = "start_s = 0\nduration_s = 60\n"
BAD = {
    "unknown kind": (
        'kind = "satelite_step"\n' + WHEN,
        'faults.toml:2: fault.0.kind = "satelite_step": no such kind',
        'mean "satellite_step"?',
    ),
    "no kind": (WHEN, "faults.toml:1: fault.0.kind: missing", "receiver_freeze"),
    "no start": (STEP + "duration_s = 60", "faults.toml:1: fault.0.start: missing", "start_s"),
    "two starts": (STEP + WHEN + 'start = "2010-03-18T05:20:00Z"', "faults.toml:7: fault.0.start", "give one of start"),
    "not a time": (
        STEP + 'start = "noon"\nduration_s = 60',
        'faults.toml:5: fault.0.start = "noon": expected a UTC time',
        "2010-03-18T05:20:00Z",
    ),
    "no duration": (STEP + "start_s = 0", "faults.toml:1: fault.0.duration_s: missing", "seconds, above 0"),
    "duration of nothing": (STEP + "start_s = 0\nduration_s = 0", "faults.toml:6: fault.0.duration_s = 0: expected", "above 0"),
    "unknown satellite": (
        f'kind = "satellite_step"\nsatellite = "G5"\nsize_m = 1\n{WHEN}',
        'faults.toml:3: fault.0.satellite = "G5": expected a satellite',
        "G01",
    ),
    "unknown receiver": (
        f'kind = "receiver_drop"\nreceiver = "D"\n{WHEN}',
        'faults.toml:3: fault.0.receiver = "D": the site has no receiver "D"',
        "A or B or C",
    ),
    "receiver twice": (
        f'kind = "jamming"\nreceivers = ["A", "A"]\ndrop_db = 10\n{WHEN}',
        "faults.toml:3: fault.0.receivers",
        "a receiver stands twice",
    ),
    "one of two receivers": (
        f'kind = "two_receivers"\nreceivers = ["A"]\noffset_enu_m = [1, 0, 0]\n{WHEN}',
        "faults.toml:3: fault.0.receivers",
        "a list of two",
    ),
    "size missing": (f'kind = "satellite_step"\nsatellite = "G05"\n{WHEN}', "faults.toml:1: fault.0.size_m: missing", "metres"),
    "size of nothing": (STEP.replace("10.0", "0.0") + WHEN, "faults.toml:4: fault.0.size_m = 0.0: expected metres, not 0", ""),
    "another kind's key": (f"{STEP}rate_mps = 1.0\n{WHEN}", "faults.toml:5: fault.0.rate_mps = 1.0: no such key", "size_m"),
    "two rates": (
        f'kind = "receiver_ramp"\nreceiver = "A"\nrate_mps = 1\nrate_enu_mps = [1, 0, 0]\n{WHEN}',
        "faults.toml:1: fault.0: give either",
        "rate_enu_mps",
    ),
    "direction": (
        f'kind = "wrong_ephemeris"\nsatellite = "G05"\noffset_m = 100\ndirection = "up"\n{WHEN}',
        'faults.toml:5: fault.0.direction = "up"',
        '"radial"',
    ),
    "spoofer in space": (
        f'kind = "spoofing"\nreceivers = ["A"]\nposition_ecef_m = [1, 2, 3]\n{WHEN}',
        "faults.toml:4: fault.0.position_ecef_m",
        "on the Earth's surface",
    ),
}


@pytest.mark.parametrize("case", BAD)
def test_a_bad_table_says_where_and_what_would_be_right(case: str) -> None:
    text, beginning, contained = BAD[case]
    with pytest.raises(ConfigProblems) as caught:
        parsed(fault_table(text))
    (problem,) = caught.value.problems
    assert str(problem).startswith(beginning)
    assert contained in str(problem)


def test_all_problems_come_at_once() -> None:
    with pytest.raises(ConfigProblems) as caught:
        parsed("[site]\n" + fault_table('kind = "no"\nstart = "noon"') + fault_table(f'kind = "receiver_drop"\n{WHEN}'))
    assert [problem.line for problem in caught.value.problems] == [1, 3, 4, 5]


def test_a_file_without_faults_is_refused() -> None:
    with pytest.raises(ConfigProblems, match=r"faults\.toml: fault: missing"):
        parsed("")
