"""Processes measured over ensembles. Bounds are five standard errors of the estimate, so that a right process fails once in a million."""

import math
from dataclasses import replace

import numpy as np
import pytest

from integrity.config import IntegrityConfig
from integrity.gnss.observations import Floats
from integrity.gnss.positioning import range_sigma_m
from recordings.simulate.errors import (
    NOMINAL,
    ErrorModel,
    SignalErrors,
    gauss_markov,
    generator,
    receiver_clocks,
    signal_errors,
    slow,
)

QUIET = replace(
    NOMINAL,
    satellite_m=0.0,
    ionosphere=0.0,
    noise_m=0.0,
    noise_low_m=0.0,
    multipath_m=0.0,
    multipath_low_m=0.0,
    carrier_m=0.0,
    range_rate_mps=0.0,
    cn0_db=0.0,
)
MANY = 2000
SLACK = 5.0 / math.sqrt(2.0 * MANY)  # relative, of a standard deviation from MANY independent samples


def names(n: int) -> list[str]:
    return [f"G{k}" for k in range(n)]


def sky(
    model: ErrorModel, seed: int, receivers: list[str], satellites: list[str], epochs: int, step_s: float = 1.0, el_deg: float = 90.0
) -> SignalErrors:
    """All satellites at one place in the sky, in the east, behind 5 m of ionosphere."""
    shape = (epochs, len(receivers), len(satellites))
    el_rad = np.full(shape, math.radians(el_deg))
    return signal_errors(model, seed, receivers, satellites, step_s, np.full(shape, math.pi / 2), el_rad, np.full(shape, 5.0))


def correlation(a: Floats, b: Floats) -> float:
    return float((a * b).mean() / np.sqrt((a * a).mean() * (b * b).mean()))


@pytest.mark.parametrize("epoch", [0, 1, 37])
def test_gauss_markov_has_unit_variance_from_the_first_epoch(epoch: int) -> None:
    process = gauss_markov(generator(1, "x").standard_normal((38, MANY)), 1.0 / 30.0)
    assert process[epoch].std() == pytest.approx(1.0, rel=SLACK)


@pytest.mark.parametrize("lag", [1, 15, 30, 60])
def test_gauss_markov_forgets_with_its_time_constant(lag: int) -> None:
    process = gauss_markov(generator(1, "x").standard_normal((100, MANY)), 1.0 / 30.0)
    assert correlation(process[20], process[20 + lag]) == pytest.approx(math.exp(-lag / 30.0), abs=5.0 / math.sqrt(MANY))


@pytest.mark.parametrize("epoch", [0, 50, 75, 100])
def test_slow_process_has_unit_variance_at_and_between_knots(epoch: int) -> None:
    """Knots are 100 s apart; half way the variance is 2.3 % lower, so the deviation 1.2 %."""
    values = np.array([slow(generator(seed, "x"), 1000.0, 1.0, 101)[epoch] for seed in range(MANY)])
    assert values.std() == pytest.approx(1.0, rel=SLACK + 0.012)


@pytest.mark.parametrize("lag_s", [200, 1000, 2000])
def test_slow_process_forgets_with_its_time_constant(lag_s: int) -> None:
    """Cubic between knots: the correlation differs from the exponential by less than 0.02 beyond two knots."""
    values = np.array([slow(generator(seed, "x"), 1000.0, 10.0, 220)[[0, lag_s // 10]] for seed in range(MANY)])
    assert correlation(*values.T) == pytest.approx(math.exp(-lag_s / 1000.0), abs=5.0 / math.sqrt(MANY) + 0.02)


def test_slow_process_can_be_followed_by_a_carrier() -> None:
    """A first-order process of 1800 s would move by 3 % of its sigma from second to second, every second in a new direction."""
    second_difference = np.diff(slow(generator(1, "x"), 1800.0, 1.0, 20_000), 2)
    assert np.abs(second_difference).max() < 5e-4


def test_satellite_error_has_its_sigma() -> None:
    errors = sky(replace(QUIET, satellite_m=0.55), 1, ["A"], names(MANY), 1)
    assert errors.code_m.std() == pytest.approx(0.55, rel=SLACK)


def test_satellite_error_is_the_same_in_every_receiver_code_and_carrier() -> None:
    errors = sky(replace(QUIET, satellite_m=0.55), 1, ["A", "B"], names(9), 20)
    assert np.ptp([errors.code_m[:, 0], errors.code_m[:, 1], errors.carrier_m[:, 0], errors.carrier_m[:, 1]], axis=0).max() == 0.0


@pytest.mark.parametrize(("el_deg", "factor"), [(90.0, 1.0), (10.0, math.hypot(1.0, math.cos(math.radians(10.0))))])
def test_ionosphere_error_is_its_share_of_the_delay(el_deg: float, factor: float) -> None:
    """In the zenith the mean alone; low in the east, the east slope with it."""
    model = replace(QUIET, ionosphere=0.06)
    error_m = np.array([sky(model, seed, ["A"], ["G01"], 1, el_deg=el_deg).code_m[0, 0, 0] for seed in range(MANY)])
    assert error_m.std() == pytest.approx(0.06 * 5.0 * factor, rel=SLACK)


def test_ionosphere_error_delays_the_code_and_advances_the_carrier() -> None:
    errors = sky(replace(QUIET, ionosphere=0.06), 1, ["A", "B"], names(5), 30, el_deg=40.0)
    assert np.abs(errors.code_m).min() > 0.0
    assert np.array_equal(errors.code_m, -errors.carrier_m)


@pytest.mark.parametrize("el_deg", [90.0, 10.0])
def test_noise_is_white_with_its_sigma(el_deg: float) -> None:
    code_m = sky(replace(QUIET, noise_m=0.12, noise_low_m=0.095), 1, ["A"], names(100), MANY, el_deg=el_deg).code_m[:, 0]
    sigma_m = math.hypot(0.12, 0.095 / math.sin(math.radians(el_deg)))
    assert code_m.std() == pytest.approx(sigma_m, rel=SLACK / 10.0)
    assert correlation(code_m[1:], code_m[:-1]) == pytest.approx(0.0, abs=5.0 / math.sqrt(100 * MANY))


def test_multipath_has_its_sigma() -> None:
    code_m = sky(replace(QUIET, multipath_m=0.12, multipath_low_m=0.095), 1, ["A"], names(MANY), 3, el_deg=30.0).code_m
    assert code_m[2].std() == pytest.approx(math.hypot(0.12, 0.19), rel=SLACK)


def test_multipath_forgets_with_its_time_constant() -> None:
    model = replace(QUIET, multipath_m=0.12, multipath_low_m=0.095, multipath_tau_s=(40.0, 40.0))
    code_m = sky(model, 1, ["A"], names(MANY), 41).code_m[:, 0]
    assert correlation(code_m[0], code_m[40]) == pytest.approx(math.exp(-1.0), abs=5.0 / math.sqrt(MANY))


def test_multipath_spoils_the_code_alone() -> None:
    errors = sky(replace(QUIET, multipath_m=0.12), 1, ["A"], names(5), 5)
    assert not errors.carrier_m.any()


def test_receivers_have_their_own_noise_and_multipath() -> None:
    model = replace(QUIET, noise_m=0.12, multipath_m=0.12)
    code_m = sky(model, 1, ["A", "B"], names(MANY), 1).code_m
    assert correlation(code_m[:, 0], code_m[:, 1]) == pytest.approx(0.0, abs=5.0 / math.sqrt(MANY))


def test_a_seed_gives_the_same_errors_again() -> None:
    assert np.array_equal(sky(NOMINAL, 5, ["A"], names(3), 10).code_m, sky(NOMINAL, 5, ["A"], names(3), 10).code_m)


@pytest.mark.parametrize("kind", ["code_m", "carrier_m", "range_rate_mps", "cn0_dbhz"])
def test_another_seed_gives_other_errors(kind: str) -> None:
    one, other = (getattr(sky(NOMINAL, seed, ["A"], names(3), 10), kind) for seed in (5, 6))
    assert not (one == other).any()


def test_errors_of_a_receiver_do_not_depend_on_who_else_is_asked_for() -> None:
    alone = sky(NOMINAL, 5, ["B"], ["G2"], 10)
    among = sky(NOMINAL, 5, ["A", "B", "C"], names(4), 10)
    assert np.array_equal(alone.code_m[:, 0, 0], among.code_m[:, 1, 2])


def test_errors_begin_alike_however_long_they_last() -> None:
    short, long = (sky(NOMINAL, 5, ["A"], names(3), n).code_m for n in (10, 1000))
    assert np.array_equal(short, long[:10])


def test_clocks_of_a_receiver_do_not_depend_on_who_else_is_asked_for() -> None:
    alone, among = receiver_clocks(NOMINAL, 5, ["C"], 1.0, 10), receiver_clocks(NOMINAL, 5, ["A", "B", "C"], 1.0, 10)
    assert np.array_equal(alone.bias_s[:, 0], among.bias_s[:, 2])


def test_clocks_start_and_drift_within_their_bounds() -> None:
    """From edge to edge: of 400 even draws the outermost lie within 3 % of the bounds, or the seed is one in 10^5."""
    clocks = receiver_clocks(replace(NOMINAL, clock_noise_m=0.0), 1, names(400), 1.0, 2)
    for values, bound in ((clocks.bias_s[0], 3e-4), (clocks.drift_sps[0], 3e-8)):
        assert 0.97 * bound < np.abs(values).max() <= bound


def test_clocks_walk_with_their_frequency_noise() -> None:
    """0.03 m over one second: 0.03 sqrt(4) m over a step of four."""
    steady, noisy = (receiver_clocks(replace(NOMINAL, clock_noise_m=m), 1, ["A"], 4.0, MANY + 1).bias_s for m in (0.0, 0.03))
    assert 299_792_458.0 * np.diff(noisy - steady, axis=0).std() == pytest.approx(0.06, rel=SLACK)


def test_clock_drift_is_the_rate_of_its_bias() -> None:
    clocks = receiver_clocks(NOMINAL, 1, ["A", "B"], 0.5, 50)
    assert np.diff(clocks.bias_s, axis=0) / 0.5 == pytest.approx(clocks.drift_sps[1:], rel=1e-6)


@pytest.mark.parametrize("el_deg", [10.0, 20.0, 30.0, 45.0, 60.0, 85.0])
def test_default_range_sigmas_of_a_site_overbound_what_receivers_have_in_common(el_deg: float) -> None:
    """By 1.3 to 2.2; the zenith delay is 5 m."""
    obliquity = 1.0 + 16.0 * (0.53 - el_deg / 180.0) ** 3  # IS-GPS-200, 20.3.3.5.2.5
    model = replace(QUIET, satellite_m=NOMINAL.satellite_m, ionosphere=NOMINAL.ionosphere)
    sigma_m = range_sigma_m(np.array(math.radians(el_deg)), IntegrityConfig.sigma_range_m, IntegrityConfig.sigma_range_low_m)
    assert 1.3 < sigma_m / deviation_over_the_sky_m(model, el_deg, 5.0 * obliquity) < 2.2


@pytest.mark.parametrize("el_deg", [10.0, 20.0, 30.0, 45.0, 60.0, 85.0])
def test_default_range_sigmas_of_a_site_overbound_what_each_receiver_has_alone(el_deg: float) -> None:
    """By 1.3 to 1.7."""
    model = replace(NOMINAL, satellite_m=0.0, ionosphere=0.0)
    a_m, b_m = IntegrityConfig.sigma_range_differential_m, IntegrityConfig.sigma_range_differential_low_m
    sigma_m = range_sigma_m(np.array(math.radians(el_deg)), a_m, b_m)
    assert 1.3 < sigma_m / deviation_over_the_sky_m(model, el_deg, 5.0) < 1.7


def deviation_over_the_sky_m(model: ErrorModel, el_deg: float, ionosphere_m: float) -> float:
    """Of the code of ten satellites all around, in 200 runs."""
    shape = (1, 1, 10)
    az_rad = np.linspace(0.0, 2.0 * math.pi, 10, endpoint=False).reshape(shape)
    el_rad, delay_m = np.full(shape, math.radians(el_deg)), np.full(shape, ionosphere_m)
    return float(np.std([signal_errors(model, seed, ["A"], names(10), 1.0, az_rad, el_rad, delay_m).code_m for seed in range(200)]))
