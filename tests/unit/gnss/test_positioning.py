"""Positions from ranges that this file makes: by inverting the model of `prefit` at a point that is not the point of linearisation.

That model itself is compared with RTKLIB in the crosschecks; here the solution is compared with where the receiver was put, and with
numpy's own least squares.
"""

from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from integrity.gnss.constants import SPEED_OF_LIGHT_MPS
from integrity.gnss.ephemeris.states import SatelliteStates, satellite_states
from integrity.gnss.ephemeris.store import EphemerisStore
from integrity.gnss.frames import ecef_from_geodetic
from integrity.gnss.gps_time import NS_PER_S, parse_utc
from integrity.gnss.least_squares import Solution, Unsolved, postfit_m, solve
from integrity.gnss.observations import Bools, Floats, Ints, ObservationBlock
from integrity.gnss.positioning import Points, Prefit, points_at, positions, prefit, range_sigma_m, state_time_ns
from integrity.gnss.signals import time_scale_index
from recordings.simulate.constellation import IONOSPHERE, constellation

EPOCH_NS = parse_utc("2026-03-02T03:00:00Z")
SETS = constellation(seed=1, start_ns=EPOCH_NS, end_ns=EPOCH_NS)
SURVEYED = np.array([ecef_from_geodetic(np.deg2rad(35.7), np.deg2rad(lon_deg), 100.0) for lon_deg in (139.0, 139.001, 139.002)])
MASK_RAD = np.deg2rad(10.0)


class Scene(NamedTuple):
    """A block of ranges (E, R, S) of the satellites above the mask, and what belongs to it."""

    block: ObservationBlock
    states: SatelliteStates
    points: Points
    system_of: Ints

    def prefit(self) -> Prefit:
        return prefit(self.block, self.states, self.points, IONOSPHERE)

    def solved(self, sigma_m: Floats | float = 1.0, used: Bools | bool = True) -> Solution:
        at_points = self.prefit()
        all_used = np.broadcast_to(np.asarray(used), at_points.residual_m.shape)
        sigma = np.broadcast_to(np.asarray(sigma_m, dtype=np.float64), at_points.residual_m.shape)
        return positions(self.block, self.states, self.points, IONOSPHERE, at_points, sigma, all_used, self.system_of, 2)


def scene(displacement_enu_m: Floats, clock_m: Floats | float = 0.0, tag_ns: int = 0, epochs: int = 1) -> Scene:
    """Ranges free of noise for receivers displaced (E, R, 3) or (3,) from `SURVEYED`, with clocks (E, R, S) or one for all."""
    points = points_at(SURVEYED)
    epoch_ns = EPOCH_NS + NS_PER_S * np.arange(epochs)
    satellites = tuple(sorted(eph.satellite for eph in SETS))
    store = EphemerisStore(SETS)
    index = store.choose(satellites, epoch_ns, np.full(epochs, len(SETS)))
    states = satellite_states(SETS, index, state_time_ns(epoch_ns))
    displaced = np.broadcast_to(displacement_enu_m, (epochs, len(SURVEYED), 3))
    truth = points_at(points.pos_ecef_m + (np.swapaxes(points.enu, -1, -2) @ displaced[..., None])[..., 0])
    shape = (epochs, len(SURVEYED), len(satellites))
    empty, no = np.full(shape, np.nan), np.zeros(shape, dtype=np.bool_)
    received = np.broadcast_to(epoch_ns[:, None] + tag_ns, shape[:2])
    codes = tuple(f"{s}.1C" for s in satellites)
    block = ObservationBlock(
        ("A", "B", "C"), codes, satellites, epoch_ns, received, np.full(shape, 2.2e7), empty, empty, empty, empty, no, no
    )
    # Reception by GPS time, seen by a clock that is ahead by the clock term: the tag runs with the range.
    for _ in range(4):
        residual_m = prefit(block, states, truth, IONOSPHERE).residual_m
        block = replace(block, pseudorange_m=block.pseudorange_m - residual_m + clock_m)
    el_rad = prefit(block, states, truth, IONOSPHERE).el_rad
    seen = (el_rad > MASK_RAD).all(axis=(0, 1))
    return visible(Scene(block, states, points, np.array([time_scale_index(s) for s in satellites])), np.flatnonzero(seen))


def visible(whole: Scene, columns: Ints) -> Scene:
    """The scene with these signals, in this order."""
    b, s = whole.block, whole.states
    arrays: dict[str, Any] = {
        n: getattr(b, n)[..., columns]
        for n in ("pseudorange_m", "carrier_cycles", "doppler_hz", "cn0_dbhz", "lock_s", "slip", "half_cycle")
    }
    names: dict[str, Any] = {n: tuple(getattr(b, n)[i] for i in columns) for n in ("signals", "satellites")}
    states = SatelliteStates(
        s.t_ns,
        *(getattr(s, n)[..., columns] for n in ("pos_ecef_m", "vel_ecef_mps", "acc_ecef_mps2", "clock_s", "clock_drift_sps", "ionosphere")),
    )
    return Scene(replace(b, **arrays, **names), states, whole.points, whole.system_of[columns])


def changed(whole: Scene, pseudorange_m: Floats) -> Scene:
    return whole._replace(block=replace(whole.block, pseudorange_m=pseudorange_m))


STILL = scene(np.zeros(3))
ENU = np.array([[[6.0, -8.0, 0.0], [-6.0, 0.5, 0.2], [0.0, 10.0, -0.2]]])  # up to 10 m, each receiver its own
NEAR = scene(ENU)
N_SIGNALS = len(STILL.block.signals)
SIGMAS = np.linspace(0.5, 3.0, N_SIGNALS)


def design(at_points: Prefit, system_of: Ints, r: int) -> Floats:
    """Geometry matrix (S, 5) of receiver r in the first epoch: minus the unit vectors, and a one for the constellation's clock."""
    return np.column_stack([-at_points.los_enu[:, 0, r].T, *(system_of == k for k in range(2))])


def test_the_scene_has_two_constellations_and_enough_satellites() -> None:
    assert np.bincount(STILL.system_of).min() >= 5


@pytest.mark.parametrize("k", range(3))
def test_a_displacement_of_10_m_is_found_to_a_millimetre(k: int) -> None:
    # Second order of the range: 10^2 / (2 * 2e7) = 2.5 micrometres.
    assert NEAR.solved().e_enu_m[0, k] == pytest.approx(ENU[0, k], abs=1e-3)


def test_a_height_of_10_m_is_found_to_2_cm() -> None:
    # The troposphere is that of the surveyed point: 0.3 mm per metre of height in the zenith, times the dilution.
    assert scene(np.array([0.0, 0.0, 10.0])).solved().e_enu_m[0] == pytest.approx(np.broadcast_to([0.0, 0.0, 10.0], (3, 3)), abs=0.02)


@pytest.mark.parametrize("far_enu_m", [(300e3, 0.0, 0.0), (-200e3, 200e3, -100e3), (0.0, 0.0, 300e3)])
def test_a_displacement_of_300_km_is_found_to_a_millimetre(far_enu_m: tuple[float, float, float]) -> None:
    far = scene(np.array(far_enu_m))
    assert far.solved().e_enu_m[0] == pytest.approx(np.broadcast_to(far_enu_m, (3, 3)), abs=1e-3)


def test_one_receiver_far_away_leaves_the_others_where_they_are() -> None:
    displaced = np.array([[[0.0, 50e3, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 2.0]]])
    assert scene(displaced).solved().e_enu_m[0, 1:] == pytest.approx(displaced[0, 1:], abs=1e-3)


def test_only_the_far_epoch_is_linearised_again() -> None:
    displaced = np.zeros((3, 3, 3))
    displaced[1, :, 0] = 50e3
    assert scene(displaced, epochs=3).solved().e_enu_m[::2] == pytest.approx(displaced[::2], abs=1e-6)


def test_just_under_a_kilometre_the_linear_solution_is_good_to_5_cm() -> None:
    # The bound at which it is linearised again: second order 2.5 cm in a range.
    assert scene(np.array([999.0, 0.0, 0.0])).solved().e_enu_m[0] == pytest.approx(np.broadcast_to([999.0, 0.0, 0.0], (3, 3)), abs=0.05)


def test_a_bias_common_to_all_ranges_does_not_move_the_position() -> None:
    biased = changed(NEAR, NEAR.block.pseudorange_m + 250.0)
    # The satellites move 0.6 mm/s * 250 m / c in the range meanwhile.
    assert biased.solved().e_enu_m == pytest.approx(NEAR.solved().e_enu_m, abs=1e-3)


def test_a_bias_common_to_all_ranges_moves_the_clocks() -> None:
    biased = changed(NEAR, NEAR.block.pseudorange_m + 250.0)
    assert biased.solved().clock_m - NEAR.solved().clock_m == pytest.approx(np.full((1, 3, 2), 250.0), abs=1e-3)


def test_a_bias_of_one_constellation_moves_only_its_clock() -> None:
    biased = changed(NEAR, NEAR.block.pseudorange_m + np.where(NEAR.system_of == 1, 40.0, 0.0))
    moved = biased.solved().clock_m - NEAR.solved().clock_m
    assert moved == pytest.approx(np.broadcast_to([0.0, 40.0], (1, 3, 2)), abs=1e-3)


def test_a_bias_of_one_receiver_moves_only_its_clock() -> None:
    biased = changed(NEAR, NEAR.block.pseudorange_m + np.array([0.0, 70.0, 0.0])[None, :, None])
    moved = biased.solved().clock_m - NEAR.solved().clock_m
    assert moved == pytest.approx(np.array([[[0.0, 0.0], [70.0, 70.0], [0.0, 0.0]]]), abs=1e-3)


@pytest.mark.parametrize("tag_s", [-0.4, 0.4])
def test_a_receiver_tagged_off_the_epoch_is_found_all_the_same(tag_s: float) -> None:
    off = scene(ENU, tag_ns=round(tag_s * NS_PER_S))
    assert off.solved().e_enu_m == pytest.approx(ENU, abs=1e-3)


def test_satellites_are_moved_to_the_time_of_the_tag_within_a_tenth_of_a_millimetre() -> None:
    off = scene(ENU, tag_ns=round(0.4 * NS_PER_S))
    epoch_ns = off.block.epoch_ns + round(0.4 * NS_PER_S)
    index = EphemerisStore(SETS).choose(off.block.satellites, epoch_ns, np.array([len(SETS)]))
    there = satellite_states(SETS, index, state_time_ns(epoch_ns))
    # The ionosphere runs with the epoch, not with the tag: 0.4 s of it are far below 0.01 mm.
    assert prefit(off.block, there, off.points, IONOSPHERE).residual_m == pytest.approx(off.prefit().residual_m, abs=1e-4)


def noisy(seed: int) -> Scene:
    return changed(NEAR, NEAR.block.pseudorange_m + np.random.default_rng(seed).normal(0.0, 3.0, NEAR.block.pseudorange_m.shape))


@pytest.mark.parametrize("sigma_m", [1.0, SIGMAS], ids=["equal weights", "weighted"])
@pytest.mark.parametrize("r", range(3))
def test_against_numpy_least_squares(r: int, sigma_m: Floats | float) -> None:
    at_points = noisy(1).prefit()
    H, y = design(at_points, NEAR.system_of, r), at_points.residual_m[0, r]
    w = np.broadcast_to(1.0 / np.asarray(sigma_m), y.shape)
    expected = np.linalg.lstsq(H * w[:, None], y * w, rcond=None)[0]
    found = noisy(1).solved(sigma_m)
    # The same numbers by another route: rounding.
    assert np.concatenate((found.e_enu_m[0, r], found.clock_m[0, r])) == pytest.approx(expected, abs=1e-6)


def test_covariance_against_the_normal_equations() -> None:
    H = design(NEAR.prefit(), NEAR.system_of, 0) / SIGMAS[:, None]
    assert NEAR.solved(SIGMAS).cov_enu_m2[0, 0] == pytest.approx(np.linalg.inv(H.T @ H)[:3, :3], rel=1e-9)


def test_a_satellite_of_little_weight_pulls_little() -> None:
    ranges = np.array(NEAR.block.pseudorange_m)
    ranges[..., 0] += 30.0
    sigma_m = np.where(np.arange(N_SIGNALS) == 0, 1e4, 1.0)
    assert changed(NEAR, ranges).solved(sigma_m).e_enu_m == pytest.approx(ENU, abs=1e-3)


def test_a_satellite_that_is_not_used_pulls_nothing() -> None:
    ranges = np.array(NEAR.block.pseudorange_m)
    ranges[..., 0] += 1e5
    assert changed(NEAR, ranges).solved(used=np.arange(N_SIGNALS) != 0).e_enu_m == pytest.approx(ENU, abs=1e-3)


def test_residuals_after_the_solution_against_numpy() -> None:
    whole = noisy(2)
    at_points = whole.prefit()
    H, y = design(at_points, NEAR.system_of, 0), at_points.residual_m[0, 0]
    expected = y - H @ np.linalg.lstsq(H, y, rcond=None)[0]
    found = postfit_m(at_points.residual_m, at_points.los_enu, whole.solved(), whole.system_of)
    assert found[0, 0] == pytest.approx(expected, abs=1e-6)


def test_a_satellite_that_is_not_used_has_a_residual_too() -> None:
    ranges = np.array(NEAR.block.pseudorange_m)
    ranges[..., 0] += 25.0
    whole = changed(NEAR, ranges)
    at_points, found = whole.prefit(), whole.solved(used=np.arange(N_SIGNALS) != 0)
    assert postfit_m(at_points.residual_m, at_points.los_enu, found, whole.system_of)[..., 0] == pytest.approx(
        np.full((1, 3), 25.0), abs=1e-3
    )


def only(*columns: int) -> Bools:
    return np.isin(np.arange(N_SIGNALS), columns)


GPS_COLUMNS = [int(i) for i in np.flatnonzero(STILL.system_of == 0)]
GALILEO_COLUMNS = [int(i) for i in np.flatnonzero(STILL.system_of == 1)]


@pytest.mark.parametrize(
    ("columns", "why"),
    [
        ([], Unsolved.TOO_FEW_SATELLITES),
        (GPS_COLUMNS[:3], Unsolved.TOO_FEW_SATELLITES),
        (GPS_COLUMNS[:4], Unsolved.SOLVED),
        (GPS_COLUMNS[:3] + GALILEO_COLUMNS[:1], Unsolved.TOO_FEW_SATELLITES),
        (GPS_COLUMNS[:2] + GALILEO_COLUMNS[:2], Unsolved.TOO_FEW_SATELLITES),
        (GPS_COLUMNS[:3] + GALILEO_COLUMNS[:2], Unsolved.SOLVED),
    ],
)
def test_satellites_needed(columns: list[int], why: Unsolved) -> None:
    assert (NEAR.solved(used=only(*columns)).why == why).all()


def test_a_satellite_alone_in_its_constellation_adds_nothing_to_the_position() -> None:
    without, with_one = (NEAR.solved(used=only(*GPS_COLUMNS, *extra)) for extra in ([], GALILEO_COLUMNS[:1]))
    assert with_one.e_enu_m == pytest.approx(without.e_enu_m, abs=1e-9)


def test_too_few_satellites_give_no_numbers() -> None:
    found = NEAR.solved(used=only(*GPS_COLUMNS[:3]))
    assert np.isnan([found.e_enu_m.sum(), found.cov_enu_m2.sum()]).all()


def solved_directly(los_enu: Floats) -> Solution:
    """From unit vectors (S, 3), one receiver, one epoch, all residuals zero."""
    zeros = np.zeros((1, 1, len(los_enu)))
    return solve(
        zeros,
        los_enu.T[:, None, None, :],
        np.ones_like(zeros),
        np.ones_like(zeros, dtype=np.bool_),
        np.zeros(len(los_enu), dtype=np.int64),
        1,
    )


def ring(el_deg: float, n: int) -> Floats:
    az, el = np.linspace(0.0, 2.0 * np.pi, n, endpoint=False), np.deg2rad(el_deg)
    return np.column_stack([np.sin(az) * np.cos(el), np.cos(az) * np.cos(el), np.full(n, np.sin(el))])


@pytest.mark.parametrize(
    "los_enu",
    [ring(40.0, 6), np.tile(ring(40.0, 1), (6, 1)), ring(0.0, 6), np.vstack([ring(5.0, 1)] * 3 + [ring(80.0, 1)] * 3)],
    ids=["one elevation", "one direction", "horizon", "two directions"],
)
def test_a_degenerate_geometry_is_refused(los_enu: Floats) -> None:
    assert solved_directly(los_enu).why.tolist() == [[Unsolved.POOR_GEOMETRY]]


def test_a_ring_and_the_zenith_can_be_solved() -> None:
    assert solved_directly(np.vstack([ring(10.0, 5), [[0.0, 0.0, 1.0]]])).solved.all()


# Two rings d apart in elevation: VDOP grows as 1 / d, and passes 100 between these.
@pytest.mark.parametrize(("apart_deg", "why"), [(2.0, Unsolved.SOLVED), (0.2, Unsolved.POOR_GEOMETRY)])
def test_geometry_is_refused_beyond_a_pdop_of_100(apart_deg: float, why: Unsolved) -> None:
    los_enu = np.vstack([ring(45.0, 4), ring(45.0 + apart_deg, 4)])
    H = np.column_stack([-los_enu, np.ones(8)])
    pdop = np.sqrt(np.trace(np.linalg.inv(H.T @ H)[:3, :3]))
    assert (solved_directly(los_enu).why.item(), pdop > 100.0) == (why, why is Unsolved.POOR_GEOMETRY)


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_a_range_that_is_no_number_is_not_used(value: float) -> None:
    ranges = np.array(NEAR.block.pseudorange_m)
    ranges[0, 1, 3] = value
    found = changed(NEAR, ranges).solved()
    assert found.n_used.tolist() == [[N_SIGNALS, N_SIGNALS - 1, N_SIGNALS]]
    assert found.e_enu_m == pytest.approx(ENU, abs=1e-3)


def test_a_satellite_without_ephemeris_is_not_used() -> None:
    positions_m = np.array(NEAR.states.pos_ecef_m)
    positions_m[..., 2] = np.nan
    found = NEAR._replace(states=replace(NEAR.states, pos_ecef_m=positions_m)).solved()
    assert (found.n_used == N_SIGNALS - 1).all()


@settings(max_examples=25)
@given(st.permutations(range(N_SIGNALS)))
def test_order_of_satellites_changes_nothing(order: list[int]) -> None:
    whole = noisy(3)
    # Sums in another order: rounding.
    assert visible(whole, np.array(order)).solved().e_enu_m == pytest.approx(whole.solved().e_enu_m, abs=1e-7)


@given(st.permutations(range(3)))
def test_order_of_receivers_changes_nothing_but_their_order(order: list[int]) -> None:
    whole = noisy(4)
    block = replace(
        whole.block,
        receivers=tuple(whole.block.receivers[i] for i in order),
        pseudorange_m=whole.block.pseudorange_m[:, order],
        receive_time_ns=whole.block.receive_time_ns[:, order],
    )
    permuted = whole._replace(block=block, points=points_at(SURVEYED[order]))
    assert permuted.solved().e_enu_m.tolist() == whole.solved().e_enu_m[:, order].tolist()


def test_a_block_gives_the_same_as_single_epochs() -> None:
    displaced = np.random.default_rng(5).normal(0.0, 5.0, (4, 3, 3))
    whole = scene(displaced, epochs=4)
    single = [scene(np.broadcast_to(displaced[:1], (1, 3, 3)))]
    assert whole.solved().e_enu_m[0] == pytest.approx(single[0].solved().e_enu_m[0], abs=1e-6)


def test_sigma_grows_towards_the_horizon() -> None:
    sigma = range_sigma_m(np.deg2rad(np.linspace(5.0, 90.0, 100)), 0.9, 0.4)
    assert (np.diff(sigma) < 0.0).all()


# sqrt(0.9^2 + (0.4 / sin 30 deg)^2) = 1.204, and twice that for twice the nominal URA of 2.4 m.
@pytest.mark.parametrize(("accuracy_m", "expected_m"), [(2.4, 1.2042), (4.8, 2.4083)])
def test_sigma_at_30_deg(accuracy_m: float, expected_m: float) -> None:
    assert float(range_sigma_m(np.array(np.pi / 6), 0.9, 0.4, accuracy_m)) == pytest.approx(expected_m, abs=1e-4)


@pytest.mark.parametrize("el_deg", [0.0, -30.0])
def test_sigma_below_the_horizon_is_that_of_3_deg(el_deg: float) -> None:
    below, at_3_deg = (float(range_sigma_m(np.array(np.deg2rad(d)), 0.9, 0.4)) for d in (el_deg, 3.0))
    assert below == at_3_deg


def test_a_clock_far_ahead_is_a_clock_and_nothing_else() -> None:
    # A millisecond: the receiver's tag is ahead by as much, so the satellites are where they were.
    ahead_m = 1e-3 * SPEED_OF_LIGHT_MPS
    whole = scene(ENU, clock_m=0.0)
    ahead = whole._replace(
        block=replace(
            whole.block, pseudorange_m=whole.block.pseudorange_m + ahead_m, receive_time_ns=whole.block.receive_time_ns + NS_PER_S // 1000
        )
    )
    assert ahead.solved().e_enu_m == pytest.approx(ENU, abs=1e-3)
