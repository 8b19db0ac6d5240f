"""Tests, exclusion, velocities and residuals of a recording, with faults put into what the simulator has made."""

from dataclasses import replace

import numpy as np
import pytest

from integrity.gnss.detection import Finding, criteria
from integrity.gnss.ephemeris.states import satellite_states
from integrity.gnss.least_squares import Unsolved
from integrity.gnss.observations import Floats, ObservationBlock
from integrity.gnss.positioning import expected, points_at, state_time_ns
from integrity.gnss.velocity import wavelengths_m
from integrity.probability import chi2_quantile, gauss_quantile
from recordings.rinex.observation import read_blocks
from recordings.solve.results import Place, Ranges, Track, Why, joined, taken
from recordings.solve.sky import Sky, Weights
from recordings.solve.track import Wanted, solved
from tests.rinex_text import observation_text
from tests.unit.imported import EPHEMERIDES, KLOBUCHAR, ROWS
from tests.unit.streams import SITE

WEIGHTS = Weights(a_m=0.9, b_m=0.4, mask_rad=float(np.deg2rad(10.0)))
POSITION_ECEF_M = np.array(next(r.position_ecef_m for r in SITE.receivers if r.name == "A"))
TESTED = Wanted(criteria(false_alarm=1e-5, most_excluded=3, confusable=0.85, confusion=1e-3))
EVERYTHING = TESTED._replace(velocity=True, ranges=True)
FAULTY = 5  # the epoch


@pytest.fixture(scope="module")
def block(tmp_path_factory: pytest.TempPathFactory) -> ObservationBlock:
    path = tmp_path_factory.mktemp("details") / "A.rnx"
    path.write_text(observation_text(ROWS["A"]), "ascii")
    (found,) = read_blocks(path, "A").blocks
    return found


def track(
    of: ObservationBlock, wanted: Wanted = TESTED, start_ecef_m: Floats | None = POSITION_ECEF_M, mask_rad: float | None = None
) -> Track:
    weights = WEIGHTS if mask_rad is None else WEIGHTS._replace(mask_rad=mask_rad)
    (found,) = solved([of], Sky(EPHEMERIDES, KLOBUCHAR), weights, None if start_ecef_m is None else start_ecef_m.tolist(), wanted=wanted)
    return found


def ranges(of: Track) -> Ranges:
    assert of.ranges is not None
    return of.ranges


def highest(of: ObservationBlock) -> int:
    return int(ranges(track(of, EVERYTHING)).el_rad[FAULTY].argmax())


def with_fault(of: ObservationBlock, fault_m: float, column: int, epochs: int | slice = FAULTY) -> ObservationBlock:
    values = of.pseudorange_m.copy()
    values[epochs, 0, column] += fault_m
    return replace(of, pseudorange_m=values)


def without(of: ObservationBlock, column: int) -> ObservationBlock:
    return with_fault(of, np.nan, column, slice(None))


# Tests and exclusion


def test_without_a_fault_positions_are_the_same_to_the_bit(block: ObservationBlock) -> None:
    assert track(block).pos_ecef_m.tobytes() == track(block, Wanted()).pos_ecef_m.tobytes()


@pytest.mark.parametrize("fault_m", [30.0, -100.0, 5e3, 5e5, -1e7])
def test_the_faulty_satellite_is_named(block: ObservationBlock, fault_m: float) -> None:
    """Also where it moves the position by thousands of kilometres."""
    tested = track(with_fault(block, fault_m, highest(block))).tested
    assert tested is not None
    named = {e: name for e, name in enumerate(tested.excluded.tolist()) if name}
    assert named == {FAULTY: block.satellites[highest(block)]}


@pytest.mark.parametrize("fault_m", [30.0, 5e5, -1e7])
def test_the_position_is_that_without_the_faulty(block: ObservationBlock, fault_m: float) -> None:
    expected_m = track(without(block, highest(block)), Wanted()).pos_ecef_m[FAULTY]
    found = track(with_fault(block, fault_m, highest(block))).pos_ecef_m[FAULTY]
    np.testing.assert_allclose(found, expected_m, atol=1e-3)  # linear updates of residuals of up to 1e7 m


def test_a_start_is_not_found_by_a_faulty_epoch(block: ObservationBlock) -> None:
    """Of twenty equally full epochs the first is tried first."""
    found = track(with_fault(block, 5e5, highest(block), 0), start_ecef_m=None)
    assert np.linalg.norm(found.pos_ecef_m - POSITION_ECEF_M, axis=1).max() < 5.0


def test_far_from_the_start_the_faulty_satellite_is_named_too(block: ObservationBlock) -> None:
    tested = track(with_fault(block, 100.0, highest(block)), start_ecef_m=POSITION_ECEF_M + 20_000.0).tested
    assert tested is not None
    assert tested.excluded[FAULTY] == block.satellites[highest(block)]


def spoiled(block: ObservationBlock) -> Track:
    """Ranges of the faulty epoch wrong by hundreds of metres each."""
    wrong_m = np.random.default_rng(1).normal(0.0, 300.0, block.pseudorange_m.shape[2])
    values = block.pseudorange_m.copy()
    values[FAULTY, 0] += wrong_m
    return track(replace(block, pseudorange_m=values), EVERYTHING)


def test_an_epoch_that_does_not_fit_says_why(block: ObservationBlock) -> None:
    assert spoiled(block).why[FAULTY] in (Why.UNEXPLAINED, Why.AMBIGUOUS, Why.TOO_MANY, Why.UNVERIFIED)


def test_an_epoch_that_does_not_fit_has_no_position(block: ObservationBlock) -> None:
    assert np.isnan(spoiled(block).pos_ecef_m[FAULTY]).all()


def test_an_epoch_that_does_not_fit_has_no_velocity(block: ObservationBlock) -> None:
    motion = spoiled(block).motion
    assert motion is not None
    assert np.isnan(motion.v_enu_mps[FAULTY]).all()


def test_statistics_stand_beside_their_thresholds(block: ObservationBlock) -> None:
    """Both are those of half the false alarms: degrees of freedom: ranges less position and clocks; two-sided, each range."""
    found = track(block)
    assert found.tested is not None
    n, clocks = int(found.n_used[0]), len({satellite[0] for satellite in block.satellites})
    limits = (found.tested.chi2_limit[0], found.tested.largest_limit[0])
    assert limits == pytest.approx((chi2_quantile(0.5e-5, n - 3 - clocks), gauss_quantile(0.25e-5 / n)))


def test_as_many_unknowns_as_ranges_cannot_be_checked(block: ObservationBlock) -> None:
    gps = [s for s, satellite in enumerate(block.satellites) if satellite[0] == "G"]
    values = np.full(block.pseudorange_m.shape, np.nan)
    values[..., gps[:4]] = block.pseudorange_m[..., gps[:4]]
    found = track(replace(block, pseudorange_m=values), mask_rad=-2.0)
    assert found.tested is not None
    assert (set(found.tested.finding.tolist()), set(found.why.tolist())) == ({Finding.UNCHECKED}, {Unsolved.SOLVED})


# Velocity


def moving(block: ObservationBlock, v_enu_mps: Floats, drift_mps: float) -> ObservationBlock:
    """Doppler as of a receiver at the same places that moves, its clock gaining: less by what the range grows by."""
    index = Sky(EPHEMERIDES, KLOBUCHAR).choose(block.satellites, block.epoch_ns)
    states = satellite_states(EPHEMERIDES, index, state_time_ns(block.epoch_ns), block.signals)
    sight = expected(states, block.epoch_ns, points_at(POSITION_ECEF_M[None]), KLOBUCHAR)
    more_mps = drift_mps - np.einsum("i,iers->ers", v_enu_mps, sight.los_enu)
    return replace(block, doppler_hz=block.doppler_hz - more_mps / wavelengths_m(block.signals, np.zeros_like(index))[:, None])


def velocity(of: Track) -> tuple[Floats, Floats]:
    assert of.motion is not None
    return of.motion.v_enu_mps, of.motion.drift_mps


def test_a_receiver_at_rest_has_no_velocity(block: ObservationBlock) -> None:
    """The simulated range rates are wrong by 2 cm/s."""
    assert np.abs(velocity(track(block, EVERYTHING))[0]).max() < 0.1


def test_velocity_and_drift_are_those_of_the_receiver(block: ObservationBlock) -> None:
    v_mps = np.array([30.0, -20.0, 2.0])
    before, after = (velocity(track(of, EVERYTHING)) for of in (block, moving(block, v_mps, 100.0)))
    np.testing.assert_allclose(after[0] - before[0], np.broadcast_to(v_mps, before[0].shape), atol=1e-3)  # of u, which turns by 1 m
    np.testing.assert_allclose(after[1] - before[1], 100.0, atol=1e-3)


@pytest.mark.parametrize("away_m", [500.0, 20_000.0])
def test_where_it_is_looked_at_from_makes_no_difference(block: ObservationBlock, away_m: float) -> None:
    far = velocity(track(block, EVERYTHING, POSITION_ECEF_M + away_m))[0]
    np.testing.assert_allclose(far, velocity(track(block, EVERYTHING))[0], atol=2e-3)  # points within 10 m


def test_a_velocity_is_within_its_sigmas(block: ObservationBlock) -> None:
    motion = track(block, EVERYTHING).motion
    assert motion is not None
    assert (np.abs(motion.v_enu_mps) < 4.0 * motion.sigma_enu_mps).all()


def test_without_doppler_there_is_no_velocity(block: ObservationBlock) -> None:
    silent = replace(block, doppler_hz=np.full(block.doppler_hz.shape, np.nan))
    assert np.isnan(velocity(track(silent, EVERYTHING))[0]).all()


def test_a_doppler_that_does_not_fit_is_left_out(block: ObservationBlock) -> None:
    wrong = block.doppler_hz.copy()
    wrong[FAULTY, 0, highest(block)] += 100.0
    found = velocity(track(replace(block, doppler_hz=wrong), EVERYTHING))[0]
    assert np.abs(found[FAULTY]).max() < 0.1


# Every range


def test_a_displacement_is_that_of_solving_without_the_satellite(block: ObservationBlock) -> None:
    whole, column = track(block, EVERYTHING), highest(block)
    fewer = track(without(block, column), Wanted())
    moved_m = points_at(POSITION_ECEF_M[None]).enu[0, 0] @ (fewer.pos_ecef_m - whole.pos_ecef_m).T
    np.testing.assert_allclose(ranges(whole).moved_enu_m[:, :, column], moved_m, atol=1e-4)


def test_ranges_say_what_became_of_them(block: ObservationBlock) -> None:
    column = highest(block)
    places = ranges(track(with_fault(block, 100.0, column), EVERYTHING)).place[FAULTY]
    assert places[column] == Place.EXCLUDED
    assert {Place.USED, Place.BELOW_MASK} <= set(np.delete(places, column).tolist())


def test_an_excluded_range_shows_its_fault(block: ObservationBlock) -> None:
    column = highest(block)
    residual_m = ranges(track(with_fault(block, 100.0, column), EVERYTHING)).residual_m[FAULTY, column]
    assert residual_m == pytest.approx(100.0, abs=5.0)


# Joining


def test_epochs_out_of_order_keep_what_belongs_to_them(block: ObservationBlock) -> None:
    order = np.random.default_rng(1).permutation(len(block.epoch_ns))
    names = [name for name in block.__dataclass_fields__ if name not in ("receivers", "signals", "satellites")]
    faulty = with_fault(block, 100.0, highest(block))
    mixed = track(replace(faulty, **{name: getattr(faulty, name)[order] for name in names}), EVERYTHING).tested
    straight = track(faulty, EVERYTHING).tested
    assert mixed is not None and straight is not None
    np.testing.assert_array_equal(mixed.excluded, straight.excluded[order])


def test_tracks_one_after_the_other_are_those_of_all(block: ObservationBlock) -> None:
    whole = track(block, EVERYTHING)
    parts = [taken(whole, np.arange(0, 7)), taken(whole, np.arange(7, 20))]
    again = joined(parts)
    assert again.motion is not None and whole.motion is not None
    np.testing.assert_array_equal(again.motion.v_enu_mps, whole.motion.v_enu_mps)
