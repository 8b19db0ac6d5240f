"""Step, ramp and acceleration of satellites by their carrier: what is found, how often nothing is, what must not disturb it."""

from math import exp

import numpy as np
import pytest
from scipy.stats import poisson

from integrity.gnss.observations import Floats
from integrity.monitors.carrier_motion import MotionInputs, MotionMemory, MotionStatistics, advance
from integrity.monitors.carrier_residuals import without_clocks
from integrity.monitors.residuals import seen_by_all
from integrity.probability import chi2_quantile, gauss_quantile, tail_for_alarm_rate
from tests.unit.carriers import made, moving, since

H = 30
TRIALS = 3000
K_FA, P_MD = 6.5, 0.01  # of a satellite among sixty, one false alarm a year; so many misses can be counted
FAULTY = 4  # at 37 deg
STATISTICS = ("step", "ramp", "acceleration")


def moved(inputs: MotionInputs, half_epochs: int = H) -> MotionStatistics:
    return advance(MotionMemory.empty(inputs.residual_m.shape[1], half_epochs), inputs, moving(half_epochs))[1]


def with_fault(inputs: MotionInputs, fault_m: Floats, receivers: slice = slice(None)) -> MotionInputs:
    """The satellite `FAULTY` moves by fault_m (E,)."""
    residual_m = np.array(inputs.residual_m)
    residual_m[:, receivers, FAULTY] += fault_m[:, None]
    return inputs._replace(residual_m=residual_m)


@pytest.fixture(scope="module")
def trials() -> MotionInputs:
    """Each receiver a trial of its own."""
    return made(2 * H + 1, TRIALS, (8, 3))[0]


@pytest.fixture(scope="module")
def quiet(trials: MotionInputs) -> MotionStatistics:
    return moved(trials)


@pytest.mark.parametrize("name", STATISTICS)
@pytest.mark.parametrize(("members", "least", "most"), [(slice(0, 8), 0.83, 1.0), (slice(8, 11), 0.6, 0.85)], ids=["of eight", "of three"])
def test_noise_of_the_model_has_at_most_unit_variance(
    quiet: MotionStatistics, name: str, members: slice, least: float, most: float
) -> None:
    """Standard deviations, 3000 trials: 2.6 % two sigma. A median goes along with small changes, not with large ones: below one."""
    found = getattr(quiet, name)[-1, :, members].std(axis=0)
    assert least <= found.min() <= found.max() <= most


@pytest.mark.parametrize("name", STATISTICS)
def test_noise_of_the_model_has_at_most_unit_variance_where_phases_decide(trials: MotionInputs, name: str) -> None:
    """Half a window of 1 s: at 10 deg five sixths of the variance are noise of the phase."""
    found = getattr(moved(trials, 1), name)[-1, :, 0].std()
    assert 0.9 <= found <= 1.03


@pytest.mark.parametrize(
    ("name", "place", "shape"),
    [
        ("step", 0, np.arange(2 * H + 1) == 2 * H),
        ("ramp", 1, np.arange(2 * H + 1.0) / (2 * H)),
        ("acceleration", 2, 0.5 * (np.arange(2 * H + 1.0) / H) ** 2),
    ],
    ids=STATISTICS,
)
def test_smallest_fault_is_that_of_theory(trials: MotionInputs, name: str, place: int, shape: Floats) -> None:
    """Found with 1 - P_md: threshold and quantile of a normal times sigma; measured by the lower quantile of the statistic, within 15 %."""
    sigma = moved(trials).sigma[place, -1, 0, FAULTY]
    theory = (K_FA + gauss_quantile(P_MD)) * sigma
    statistic = getattr(moved(with_fault(trials, theory * shape)), name)[-1, :, FAULTY]
    lacking = K_FA - np.quantile(statistic, P_MD)
    assert 1.0 + lacking * sigma / theory == pytest.approx(1.0, abs=0.15)


@pytest.mark.parametrize(("name", "correlation_s"), [("step", 0.0), ("ramp", 30.0), ("acceleration", 15.0)])
def test_false_alarms_keep_their_promise(name: str, correlation_s: float) -> None:
    """Errors common to all receivers: 48 satellites for 10,000 s, 100 episodes promised. Fewer come: the model rounds up."""
    noise = made(10_000, 4, (12,), seed=3)[0]
    statistic = np.abs(getattr(moved(noise), name)).reshape(10_000, -1)
    looks = 10_000 * statistic.shape[1]
    correlation = exp(-1.0 / correlation_s) if correlation_s else 0.0
    threshold = chi2_quantile(tail_for_alarm_rate(100.0, looks, 1, correlation), 1) ** 0.5
    above = statistic > threshold
    episodes = int((above[1:] & ~above[:-1]).sum())
    assert 10 <= episodes <= poisson.ppf(0.975, 100.0)


AGREEING = {
    "all": ([1.0, 2.0, 3.0], [-1.0, 0.0, 1.0], [1.0, 1.0, 1.0]),
    "all but one": ([1.0, 2.0, 3.0, 100.0], [-1.0, 0.0, 1.0, 98.0], [1.0, 1.0, 1.0, 1.0 + 1.0 / 3.0]),
    "two of three": ([1.0, 2.0, 100.0], [-0.5, 0.5, 98.5], [1.0, 1.0, 1.5]),
    "two of four": ([1.0, 2.0, 100.0, 150.0], [np.nan] * 4, [1.0] * 4),
    "two alone": ([1.0, 2.0, np.nan], [np.nan] * 3, [1.0] * 3),
}


@pytest.mark.parametrize(("change_m", "left_m", "variance_m2"), AGREEING.values(), ids=AGREEING)
def test_the_clock_is_the_mean_of_the_majority_that_agrees(change_m: list[float], left_m: list[float], variance_m2: list[float]) -> None:
    by_signal = np.array(change_m)[None, :, None, None]
    known = np.isfinite(by_signal)
    left = without_clocks(np.nan_to_num(by_signal), known, np.ones((1, len(change_m), 1, 1)), np.zeros(len(change_m), dtype=np.int64))
    np.testing.assert_allclose(left.change_m[0, :, 0, 0], left_m, atol=1e-12)
    np.testing.assert_allclose(left.variance_m2[0, :, 0, 0], variance_m2, atol=1e-12)


def test_a_large_step_leaves_the_others_quiet() -> None:
    """A mean would move by an eighth of it."""
    inputs = made(10, 3, (8,))[0]
    faulty = moved(with_fault(inputs, 25.0 * since(10, 9)), 1)
    others = np.arange(8) != FAULTY
    assert seen_by_all(faulty.step)[-1, others].max() < 3.0


def test_of_two_satellites_nothing_is_said() -> None:
    assert np.isnan(moved(made(3, 3, (2, 5))[0], 1).step[..., :2]).all()


def test_a_fault_at_one_receiver_is_not_the_satellites() -> None:
    inputs = with_fault(made(10, 3, (8,))[0], 25.0 * since(10, 9), slice(0, 1))
    assert seen_by_all(moved(inputs, 1).step)[-1].max() < 3.0


def test_a_jump_of_a_receiver_clock_moves_nothing() -> None:
    inputs = made(70, 3, (8,))[0]
    jumped = np.array(inputs.residual_m)
    jumped[35:, 1] += 299_792.458
    before, after = moved(inputs), moved(inputs._replace(residual_m=jumped))
    for name in STATISTICS:
        np.testing.assert_allclose(getattr(after, name), getattr(before, name), atol=1e-6)


def test_a_jump_of_one_constellation_moves_nothing() -> None:
    inputs = made(70, 3, (8, 5))[0]
    jumped = np.array(inputs.residual_m)
    jumped[35:, :, 8:] += 20.0
    np.testing.assert_allclose(moved(inputs._replace(residual_m=jumped)).step, moved(inputs).step, atol=1e-6)


def test_another_ephemeris_moves_nothing() -> None:
    """2 m more range expected, 2 m less left."""
    inputs = made(70, 3, (8,))[0]
    jump_m = np.array(inputs.jump_m)
    jump_m[35, 2] = 2.0
    residual_m = np.array(inputs.residual_m)
    residual_m[35:, :, 2] -= 2.0
    before, after = moved(inputs), moved(inputs._replace(residual_m=residual_m, jump_m=jump_m))
    for name in STATISTICS:
        np.testing.assert_allclose(getattr(after, name), getattr(before, name), atol=1e-6)


@pytest.mark.parametrize("why", ["slip", "unknown ephemeris", "gap"])
def test_after_a_break_windows_fill_again(why: str) -> None:
    inputs = made(140, 3, (8,))[0]
    continues, jump_m, epoch_ns = np.array(inputs.continues), np.array(inputs.jump_m), np.array(inputs.epoch_ns)
    if why == "slip":
        continues[70, :, 2] = False
    elif why == "unknown ephemeris":
        jump_m[70, 2] = np.nan
    else:
        epoch_ns[70:] += 300 * 10**9
    found = moved(inputs._replace(continues=continues, jump_m=jump_m, epoch_ns=epoch_ns))
    silent = {name: np.flatnonzero(np.isnan(getattr(found, name)[61:, 0, 2])) + 61 for name in STATISTICS}
    assert [(int(s[0]), int(s[-1])) for s in silent.values()] == [(70, 70), (70, 129), (70, 129)]


def test_a_slip_that_nobody_marked_is_told_once() -> None:
    """1e7 m at one receiver: its ramp is not spoiled for a minute."""
    inputs = made(70, 3, (8,))[0]
    slipped = np.array(inputs.residual_m)
    slipped[35:, 1, 2] += 1e7
    found = moved(inputs._replace(residual_m=slipped), 5)
    told = (np.abs(found.step[:, 1, 2]) > 6.0), (np.abs(found.ramp[:, 1, 2]) > 6.0)
    assert [np.flatnonzero(t).tolist() for t in told] == [[35], []]


def test_at_30_s_a_step_below_a_metre_is_found_in_its_epoch() -> None:
    inputs = made(20, 3, (8,), interval_s=30.0)[0]
    found = moved(with_fault(inputs, 0.9 * since(20, 15)), 1)
    assert np.flatnonzero(seen_by_all(found.step)[1:, FAULTY] > K_FA).tolist() == [14]


def test_at_90_s_nothing_is_monitored() -> None:
    found = moved(made(20, 3, (8,), interval_s=90.0)[0], 1)
    assert all(np.isnan(getattr(found, name)).all() for name in STATISTICS)
