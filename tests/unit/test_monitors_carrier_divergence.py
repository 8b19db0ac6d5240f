"""Code against carrier: innovation and divergence; what is found of what size, how often nothing is, what must not disturb it."""

from math import exp

import numpy as np
import pytest
from scipy.signal import lfilter
from scipy.stats import poisson

from integrity.gnss.observations import Floats
from integrity.monitors.carrier_residuals import Nature
from integrity.monitors.divergence import DivergenceInputs, DivergenceMemory, DivergenceStatistics, advance
from integrity.monitors.residuals import seen_by_all
from integrity.probability import chi2_quantile, gauss_quantile, tail_for_alarm_rate
from tests.unit.carriers import CLOSE, made, since

EPOCHS, TRIALS = 700, 400
K_FA, P_MD = 6.5, 0.01
FAULTY, OTHER = 3, 1
TAU_S = CLOSE.window_s


def compared(inputs: DivergenceInputs) -> DivergenceStatistics:
    return advance(DivergenceMemory.empty(inputs.code_minus_carrier_m.shape[1]), inputs, CLOSE)[1]


def changed(inputs: DivergenceInputs, by_m: Floats, receivers: slice = slice(None)) -> DivergenceInputs:
    """The signal `FAULTY` with by_m (E,) more code than carrier."""
    c_m = np.array(inputs.code_minus_carrier_m)
    c_m[:, receivers, FAULTY] += by_m[:, None]
    return inputs._replace(code_minus_carrier_m=c_m)


def without_ionosphere(inputs: DivergenceInputs, c_m: Floats) -> DivergenceInputs:
    of = inputs.nature
    return inputs._replace(code_minus_carrier_m=c_m, nature=Nature(of.phase_m2, of.code_m2, 0.0 * of.ionosphere_m2ps2, of.atmosphere_m2ps2))


@pytest.fixture(scope="module")
def trials() -> DivergenceInputs:
    """Each receiver a trial of its own."""
    return made(EPOCHS, TRIALS, (12,))[1]


def alone(epochs: int) -> tuple[DivergenceInputs, Floats]:
    """Noise in one signal only, (E,): what is taken out as common of it and the others is the same."""
    inputs = made(epochs, 1, (5,))[1]
    c_m = np.where(np.arange(5) == FAULTY, inputs.code_minus_carrier_m, 0.0)
    return without_ionosphere(inputs, c_m), c_m[:, 0, FAULTY]


def test_the_stages_are_two_equal_filters_once_the_window_is_full() -> None:
    """Against scipy's filter of the rate of c, fed alike; what was before the window is full is forgotten after 1700 s."""
    inputs, c_m = alone(2000)
    b, a = [1.0 / TAU_S], [1.0, -(1.0 - 1.0 / TAU_S)]
    first_mps = lfilter(b, a, np.diff(c_m, prepend=c_m[0]))
    second_mps = lfilter(b, a, first_mps)
    found = compared(inputs)
    stages = (found.innovation * found.sigma[0])[:, 0] / TAU_S, (found.divergence * found.sigma[1])[:, 0]
    for got, want in zip((stage[:, FAULTY] - stage[:, OTHER] for stage in stages), (first_mps, second_mps), strict=True):
        np.testing.assert_allclose(got[1700:], want[1700:], rtol=1e-4, atol=1e-7)


def test_innovation_is_what_the_mean_so_far_did_not_expect() -> None:
    inputs, c_m = alone(90)
    found = compared(inputs)
    expected = [c_m[e] - c_m[:e].mean() for e in range(1, 90)]
    innovation_m = (found.innovation * found.sigma[0])[1:, 0]
    np.testing.assert_allclose(innovation_m[:, FAULTY] - innovation_m[:, OTHER], expected, atol=1e-12)


def test_multipath_and_ionosphere_of_the_model_have_at_most_unit_variance() -> None:
    """Among twelve signals, 200 trials: 10 % two sigma; medians go along with small changes, filters lag behind."""
    std = compared(made(EPOCHS, 200, (12,))[1]).divergence[-1].std(axis=0)
    assert 0.70 <= std.min() <= std.max() <= 1.05


def test_white_noise_of_the_model_has_at_most_unit_innovations() -> None:
    """Among twelve signals, 800 trials: 5 % two sigma."""
    trials = made(300, 800, (12,))[1]
    white = np.sqrt(trials.nature.code_m2) * np.random.default_rng(2).standard_normal(trials.code_minus_carrier_m.shape)
    std = compared(without_ionosphere(trials, white)).innovation[[1, 2, 20, 100, 299]].std(axis=1)
    assert 0.85 <= std.min() <= std.max() <= 1.03


def test_a_signal_that_rises_is_no_worse_than_the_others() -> None:
    """What was taken out as common before it rose must not be in the others as a random walk."""
    trials = made(300, 800, (12,))[1]
    white = np.sqrt(trials.nature.code_m2) * np.random.default_rng(2).standard_normal(trials.code_minus_carrier_m.shape)
    white[:250, :, 11] = np.nan
    assert compared(without_ionosphere(trials, white)).innovation[[255, 265, 299], :, 11].std(axis=1).max() <= 1.05


@pytest.mark.parametrize(
    ("name", "place", "shape"),
    [
        ("innovation", 0, 1.0 * (np.arange(EPOCHS) == EPOCHS - 1)),
        ("divergence", 1, np.arange(EPOCHS) - EPOCHS + 600.0),
    ],
    ids=["a jump of the code", "a drift for ten minutes"],
)
def test_smallest_fault_is_that_of_theory(trials: DivergenceInputs, name: str, place: int, shape: Floats) -> None:
    sigma = compared(trials).sigma[place, -1, 0, FAULTY]
    theory = (K_FA + gauss_quantile(P_MD)) * sigma
    statistic = getattr(compared(changed(trials, theory * np.maximum(shape, 0.0))), name)[-1, :, FAULTY]
    lacking = K_FA - np.quantile(statistic, P_MD)
    assert 1.0 + lacking * sigma / theory == pytest.approx(1.0, abs=0.15)


@pytest.mark.parametrize(("name", "correlation_s"), [("innovation", 30.0), ("divergence", 60.0)])
def test_false_alarms_keep_their_promise(name: str, correlation_s: float) -> None:
    """Multipath common to all receivers: 60 signals for 10,000 s, 100 episodes promised. Fewer come: filters and the model round up."""
    noise = made(10_000, 5, (12,), seed=3)[1]
    multipath_m = noise.code_minus_carrier_m - np.arange(10_000)[:, None, None] * (
        (noise.code_minus_carrier_m[-1] - noise.code_minus_carrier_m[0]) / 9_999.0
    )
    statistic = np.abs(getattr(compared(without_ionosphere(noise, multipath_m)), name)).reshape(10_000, -1)
    tail = tail_for_alarm_rate(100.0, 10_000 * statistic.shape[1], 1, exp(-1.0 / correlation_s))
    above = statistic > chi2_quantile(tail, 1) ** 0.5
    assert 5 <= int((above[1:] & ~above[:-1]).sum()) <= poisson.ppf(0.975, 100.0)


def test_a_jump_of_the_code_is_found_in_its_epoch() -> None:
    inputs = made(400, 3, (5,))[1]
    found = seen_by_all(compared(changed(inputs, 8.0 * since(400, 300))).innovation)[1:, FAULTY]
    assert np.flatnonzero(found > K_FA)[0] == 299


def test_a_fault_at_one_receiver_is_not_the_satellites() -> None:
    inputs = made(400, 3, (5,))[1]
    faulty = compared(changed(inputs, 8.0 * since(400, 300), slice(2, 3)))
    assert max(np.nanmax(seen_by_all(faulty.innovation)), np.nanmax(seen_by_all(faulty.divergence))) < 4.0


def test_a_clock_that_jumps_in_the_code_alone_goes_unnoticed() -> None:
    """By 1 ms at one receiver: of the median of five codes' noise remains."""
    inputs = made(400, 3, (5,))[1]
    c_m = np.array(inputs.code_minus_carrier_m)
    c_m[300:, 1] += 299_792.458
    jumped = compared(inputs._replace(code_minus_carrier_m=c_m))
    assert max(np.abs(jumped.innovation[300:, 1]).max(), np.abs(jumped.divergence[300:, 1]).max()) < 4.0


def test_a_receiver_that_lets_code_and_carrier_run_apart_goes_unnoticed() -> None:
    """By 1.3 m/s, a signal that rises meanwhile included."""
    inputs = made(900, 3, (5,))[1]
    c_m = np.array(inputs.code_minus_carrier_m)
    c_m += 1.3 * np.arange(900.0)[:, None, None]
    c_m[:450, :, 0] = np.nan
    found = compared(inputs._replace(code_minus_carrier_m=c_m))
    assert max(np.nanmax(np.abs(found.innovation)), np.nanmax(np.abs(found.divergence))) < 4.5


def test_a_drift_of_one_leaves_the_others_quiet() -> None:
    """1 m/s at all receivers: the mean goes along by a share of it."""
    inputs = changed(made(900, 3, (5,))[1], np.maximum(np.arange(900.0) - 450.0, 0.0))
    found = compared(inputs)
    others = np.arange(5) != FAULTY
    worst = [np.nanmax(seen_by_all(statistic)[:, others]) for statistic in (found.innovation, found.divergence)]
    assert max(worst) < 4.0


def test_a_slip_that_nobody_marked_is_told_once_and_breaks_no_other() -> None:
    inputs = made(400, 3, (5,))[1]
    found = compared(changed(inputs, 1e7 * since(400, 300), slice(1, 2)))
    assert np.flatnonzero(np.abs(found.innovation[1:, 1, FAULTY]) > K_FA).tolist() == [299]
    assert np.isfinite(found.divergence[300:, 1, :FAULTY]).all()


@pytest.mark.parametrize("why", ["slip", "gap", "not measured"])
def test_after_a_break_the_filter_warms_up_again(why: str) -> None:
    inputs = made(700, 3, (5,))[1]
    continues, c_m, epoch_ns = np.array(inputs.continues), np.array(inputs.code_minus_carrier_m), np.array(inputs.epoch_ns)
    if why == "slip":
        continues[300, 1, FAULTY] = False
    elif why == "gap":
        epoch_ns[300:] += 100 * 10**9
    else:
        c_m[299, 1, FAULTY] = np.nan
    found = compared(inputs._replace(continues=continues, code_minus_carrier_m=c_m, epoch_ns=epoch_ns))
    silent = np.flatnonzero(np.isnan(found.divergence[250:, 1, FAULTY])) + 250
    assert (silent[0], silent[-1]) == (299 if why == "not measured" else 300, 499)
