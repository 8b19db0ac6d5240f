"""The numbers of sections 2.1, 2.2 and 2.5 of the notes on ground integrity, and Monte Carlo where no table says what is right."""

import numpy as np
import pytest
from scipy.stats import chi2, ncx2, norm

from integrity.gnss.observations import Floats
from integrity.probability import (
    chi2_quantile,
    detectable_noncentrality,
    episodes_per_look,
    exceeds_again,
    gauss_quantile,
    tail_for_alarm_rate,
    tail_for_episode_rate,
)

DAY_LOOKS, YEAR_LOOKS = 86_400, 31_557_600.0


# Section 2.1: radius in sigmas for a probability, and for a third of it (three circles); to the digits printed.
@pytest.mark.parametrize(
    ("tail", "k", "k_of_a_third"),
    [(1e-4, 4.29, 4.54), (1e-5, 4.80, 5.02), (1e-6, 5.26, 5.46), (1e-7, 5.68, 5.87), (1e-8, 6.07, 6.25), (1e-9, 6.44, 6.61)],
)
@pytest.mark.parametrize("circles", [1, 3])
def test_radius_of_a_circle(tail: float, k: float, k_of_a_third: float, circles: int) -> None:
    assert np.sqrt(chi2_quantile(tail / circles, 2)) == pytest.approx(k if circles == 1 else k_of_a_third, abs=0.006)


def test_protection_factor_of_do_229() -> None:
    # K_H,NPA = 6.18 of RTCA DO-229 belongs to 5e-9.
    assert np.sqrt(chi2_quantile(5.1e-9, 2)) == pytest.approx(6.18, abs=0.005)


# Section 2.2; printed to one decimal.
@pytest.mark.parametrize(
    ("dof", "thresholds"),
    [(2, (27.6, 32.2, 36.8, 41.4)), (3, (30.7, 35.4, 40.1, 44.8)), (4, (33.4, 38.2, 43.1, 47.9)), (6, (38.3, 43.3, 48.4, 53.3))],
)
def test_chi_square_thresholds(dof: int, thresholds: tuple[float, ...]) -> None:
    assert [chi2_quantile(p, dof) for p in (1e-6, 1e-7, 1e-8, 1e-9)] == pytest.approx(thresholds, abs=0.06)


# K_md and K_ffmd of GBAS with their tails (section 2.3).
@pytest.mark.parametrize(("tail", "k"), [(8.3e-9 / 2, 5.762), (5.0e-9 / 2, 5.847), (2.0e-3, 2.878), (1e-5, 4.265)])
def test_gauss_quantile(tail: float, k: float) -> None:
    assert gauss_quantile(tail) == pytest.approx(k, abs=0.003)


# Section 2.1: sqrt(lambda) for P_fa = 1e-6 and 2 dof.
@pytest.mark.parametrize(("missed", "root"), [(1e-3, 8.3), (1e-5, 9.5), (1e-9, 11.2)])
def test_smallest_detectable_bias(missed: float, root: float) -> None:
    assert np.sqrt(detectable_noncentrality(chi2_quantile(1e-6, 2), 2, missed)) == pytest.approx(root, abs=0.06)


@pytest.mark.parametrize("dof", [1, 2, 3, 4, 6])
@pytest.mark.parametrize("missed", [1e-3, 1e-5, 1e-9])
def test_a_detectable_bias_is_missed_as_often_as_asked(dof: int, missed: float) -> None:
    threshold = chi2_quantile(1e-7, dof)
    # Bisection to 1e-9 in the noncentrality, of which 1 % changes the probability by about 15 %.
    assert ncx2.cdf(threshold, dof, detectable_noncentrality(threshold, dof, missed)) == pytest.approx(missed, rel=1e-5)


# Section 2.5: independent looks a day at 5.87 sigma, 2 dof, 1 Hz.
@pytest.mark.parametrize(("tau_s", "looks"), [(30.0, 47.6e3), (60.0, 35.2e3), (120.0, 25.5e3)])
def test_looks_a_day(tau_s: float, looks: float) -> None:
    again = exceeds_again(5.87**2, 2, float(np.exp(-1.0 / tau_s)))
    assert DAY_LOOKS * (1.0 - again) == pytest.approx(looks, rel=0.005)


@pytest.mark.parametrize("tau_s", [30.0, 60.0, 120.0])
def test_looks_rise_with_the_threshold(tau_s: float) -> None:
    looks = [1.0 - exceeds_again(k**2, 2, float(np.exp(-1.0 / tau_s))) for k in (2.0, 3.5, 4.15, 4.8, 5.87, 7.0)]
    assert looks == sorted(looks)


def pairs(rng: np.random.Generator, n: int, dof: int, correlation: float) -> tuple[Floats, Floats]:
    """Statistics of two looks in a row at a stationary Gauss-Markov process of `dof` components."""
    first = rng.standard_normal((n, dof))
    second = correlation * first + np.sqrt(1.0 - correlation**2) * rng.standard_normal((n, dof))
    return (first**2).sum(axis=1), (second**2).sum(axis=1)


@pytest.mark.parametrize("dof", [1, 2, 3, 4, 6])
@pytest.mark.parametrize("correlation", [0.3, 0.9, float(np.exp(-1.0 / 30.0))])
def test_exceeding_again_against_monte_carlo(dof: int, correlation: float) -> None:
    threshold = chi2_quantile(0.01, dof)
    first, second = pairs(np.random.default_rng(dof), 400_000, dof, correlation)
    n = int((first > threshold).sum())
    share = float((second[first > threshold] > threshold).mean())
    # Four standard errors of a share of about 4,000: one false alarm of this test in 1,000 choices of the seeds.
    assert exceeds_again(threshold, dof, correlation) == pytest.approx(share, abs=4.0 * np.sqrt(share * (1.0 - share) / n))


@pytest.mark.parametrize("dof", [1, 2, 4])
def test_without_correlation_the_next_look_is_like_any(dof: int) -> None:
    assert exceeds_again(chi2_quantile(1e-3, dof), dof, 0.0) == pytest.approx(1e-3, rel=1e-9)


@pytest.mark.parametrize("dof", [1, 2, 3, 4, 6])
def test_exceeding_again_grows_with_correlation(dof: int) -> None:
    again = [exceeds_again(30.0, dof, a) for a in (0.1, 0.5, 0.9, 0.99, 0.999, 0.9999)]
    assert again == sorted(again)


def exact(threshold: float, dof: int, correlation: float) -> float:
    """By scipy's noncentral chi-square and plain sums over 2,000 slices of the tail."""
    a2 = correlation**2
    tail = chi2.sf(threshold, dof) * (np.arange(2_000) + 0.5) / 2_000
    q = chi2.isf(tail, dof)
    return float(ncx2.sf(threshold / (1.0 - a2), dof, a2 * q / (1.0 - a2)).mean())


# Noncentrality is about threshold * tau / (2 dt): 40 * 500 = 2e4 is reached at tau = 1000 s.
@pytest.mark.parametrize("dof", [1, 2, 4, 6])
@pytest.mark.parametrize("tau_s", [30.0, 300.0, 450.0, 500.0, 550.0, 700.0, 3000.0])
def test_the_normal_branch_continues_the_exact_one(tau_s: float, dof: int) -> None:
    correlation = float(np.exp(-1.0 / tau_s))
    # In what matters, the share of looks that begin an alarm: 1 %.
    assert 1.0 - exceeds_again(40.0, dof, correlation) == pytest.approx(1.0 - exact(40.0, dof, correlation), rel=0.01)


@pytest.mark.parametrize("dof", [1, 2, 4, 6])
def test_no_step_where_the_branches_meet(dof: int) -> None:
    taus = np.linspace(300.0, 700.0, 81)
    starts = np.array([1.0 - exceeds_again(40.0, dof, float(np.exp(-1.0 / tau))) for tau in taus]) * np.sqrt(taus)
    # Alarms begin as 1 / sqrt(tau): what is left changes by less than 0.3 % over a step of 5 s.
    assert np.abs(np.diff(starts) / starts[1:]).max() < 0.003


@pytest.mark.parametrize("dof", [1, 2, 3, 4, 6])
@pytest.mark.parametrize("tau_s", [30.0, 3000.0])
def test_the_alarms_of_a_tail_are_those_asked_for(dof: int, tau_s: float) -> None:
    correlation = float(np.exp(-1.0 / tau_s))
    tail = tail_for_alarm_rate(0.2, YEAR_LOOKS, dof, correlation)
    alarms = YEAR_LOOKS * tail * (1.0 - exceeds_again(chi2_quantile(tail, dof), dof, correlation))
    assert alarms == pytest.approx(0.2, rel=1e-6)


def test_alarms_of_a_simulated_process_are_those_asked_for() -> None:
    # 30 processes of 2 dof, 40,000 looks each, tau 30 looks; a promise of 6 alarms in 40,000 looks gives 180 in all.
    rng, correlation = np.random.default_rng(7), float(np.exp(-1.0 / 30.0))
    threshold = chi2_quantile(tail_for_alarm_rate(6.0, 40_000.0, 2, correlation), 2)
    x = rng.standard_normal((30, 2))
    before, alarms = np.zeros(30, dtype=np.bool_), 0
    for _ in range(40_000):
        x = correlation * x + np.sqrt(1.0 - correlation**2) * rng.standard_normal((30, 2))
        above = (x**2).sum(axis=1) > threshold
        alarms += int((above & ~before).sum())
        before = above
    # Alarms come in clusters (the process hovers about the threshold): about three times the variance of Poisson.
    assert alarms == pytest.approx(180, abs=4.0 * np.sqrt(3.0 * 180))


def test_quantiles_are_those_of_scipy() -> None:
    assert (gauss_quantile(1e-9), chi2_quantile(1e-9, 5)) == pytest.approx((norm.isf(1e-9), chi2.isf(1e-9, 5)), rel=1e-9)


@pytest.mark.parametrize("dof", [1, 2, 3, 6])
def test_with_one_clear_look_every_alarm_is_an_episode(dof: int) -> None:
    alarms = 1e-6 * (1.0 - exceeds_again(chi2_quantile(1e-6, dof), dof, 0.97))
    assert episodes_per_look(1e-6, dof, 0.97, 1) == pytest.approx(alarms, rel=1e-12)


@pytest.mark.parametrize("dof", [1, 2, 3, 6])
def test_episodes_far_apart_come_as_often_as_clumps(dof: int) -> None:
    # Poisson clumping heuristic (Aldous 1989): f(b) (b - (dof - 1) / b) / tau, f the density of the length; looks are close to each other.
    looks_of_tau, tail = 1e6, 1e-7
    b = chi2_quantile(tail, dof) ** 0.5
    density = 2.0 * b * chi2.pdf(b * b, dof)
    found = episodes_per_look(tail, dof, float(np.exp(-1.0 / looks_of_tau)), int(20 * looks_of_tau))
    assert found == pytest.approx(density * (b - (dof - 1) / b) / looks_of_tau, rel=0.02)


def test_looks_that_know_nothing_of_each_other_are_each_an_episode() -> None:
    assert episodes_per_look(1e-6, 1, 0.0, 31) == pytest.approx(1e-6, rel=1e-4)


@pytest.mark.parametrize("clear", [1, 31, 601])
@pytest.mark.parametrize("tau_s", [30.0, 3000.0])
def test_the_episodes_of_a_tail_are_those_asked_for(tau_s: float, clear: int) -> None:
    correlation = float(np.exp(-1.0 / tau_s))
    tail = tail_for_episode_rate(0.2, YEAR_LOOKS, 3, correlation, clear)
    assert YEAR_LOOKS * episodes_per_look(tail, 3, correlation, clear) == pytest.approx(0.2, rel=1e-6)


# Of 4,000 processes the looks at which they exceed after `clear` at which they did not.
@pytest.mark.parametrize(("dof", "tau_looks", "clear"), [(1, 10.0, 31), (2, 100.0, 31), (3, 30.0, 301), (4, 100.0, 101), (6, 0.3, 2)])
def test_episodes_of_a_simulated_process(dof: int, tau_looks: float, clear: int) -> None:
    rng, a, tail = np.random.default_rng(dof), float(np.exp(-1.0 / tau_looks)), 2e-4
    threshold = chi2_quantile(tail, dof)
    x = rng.standard_normal((dof, 4000))
    silent, episodes = np.full(4000, clear), 0
    for _ in range(1500):
        x = a * x + np.sqrt(1.0 - a * a) * rng.standard_normal(x.shape)
        exceeds = (x * x).sum(axis=0) > threshold
        episodes += int((exceeds & (silent >= clear)).sum())
        silent = np.where(exceeds, 0, silent + 1)
    expected = 4000 * 1500 * episodes_per_look(tail, dof, a, clear)
    assert episodes == pytest.approx(expected, abs=4.0 * np.sqrt(1.5 * expected) + 0.05 * expected)
