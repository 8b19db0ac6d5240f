"""The audit of the promise: fair odds under the promise, whatever came before; few false accusations; time until a broken one is known."""

from dataclasses import replace
from math import exp, log, sqrt

import numpy as np
import pytest
from scipy.special import chndtr

from integrity.audit import (
    FALSE_ACCUSATION,
    SPACING,
    Audited,
    AuditMemory,
    _chi_square_bets,
    _largest_bets,
    accusations,
    advance,
    audited_checks,
    broken,
)
from integrity.gnss.gps_time import NS_PER_S
from integrity.gnss.observations import Floats
from tests.unit.streams import LIMITS, SITE

AUDITED = audited_checks(SITE, LIMITS)
BY_NAME = {of.name: of for of in AUDITED}
SATELLITES = 10
START_NS = 1_000_000_000 * NS_PER_S


@pytest.mark.parametrize("dof", [2, 3, 4, 6])
@pytest.mark.parametrize(("a", "before"), [(0.0, 0.0), (0.02, 0.1), (0.02, 40.0), (0.5, 9.0)])
def test_chi_square_bets_are_fair_whatever_came_before(dof: int, a: float, before: float) -> None:
    """Mean factor by integration over the noncentral chi-square law that a Gauss-Markov process has: 1 within 1e-3."""
    s = 1.0 - a * a
    T = np.linspace(0.0, 400.0, 400_001)
    law = chndtr(T / s, float(dof), a * a * before / s)
    factors = np.exp(np.array([_chi_square_bets(float(t), before, dof, a) for t in T[::100]]))
    between = (factors[1:] + factors[:-1]) / 2.0
    assert (np.diff(law[::100])[:, None] * between).sum(axis=0) == pytest.approx(np.ones(3), abs=1e-2)


@pytest.mark.parametrize("a", [0.02, 0.2])
@pytest.mark.parametrize("before", [1.0, 3.0])
def test_bets_on_the_largest_never_favour_the_audit(a: float, before: float) -> None:
    """All values as large as the largest was: the worst past that there is. 200,000 draws: four standard errors above 1 at most."""
    rng = np.random.default_rng(1)
    largest = np.abs(a * before + sqrt(1.0 - a * a) * rng.standard_normal((200_000, 6))).max(axis=1)
    levels, counts = np.unique(np.floor(largest * 200.0), return_counts=True)
    factors = np.exp(np.array([_largest_bets((level + 0.5) / 200.0, before, 6, a) for level in levels]))
    mean = (factors * counts[:, None]).sum(axis=0) / counts.sum()
    spread = np.sqrt((factors**2 * counts[:, None]).sum(axis=0) / counts.sum() - mean**2) / sqrt(counts.sum())
    assert (mean <= 1.0 + 4.0 * spread + 0.01).all()  # 0.01: levels are in steps of 0.005


def statistics_of(of: Audited, x: Floats, scale: float) -> float:
    """The statistic that standard normal values (>= dof * satellites,) give where errors are `scale` times the promised ones."""
    if of.law == "largest":
        return float(scale * np.abs(x[: of.dof * SATELLITES]).max())
    squares = scale**2 * float((x[: of.dof] ** 2).sum())
    return of.scale * sqrt(squares) if of.square else squares


def audit(seed: int, looks: int, scale: float, names: tuple[str, ...] = tuple(BY_NAME), tau_factor: float = 1.0) -> tuple[int, AuditMemory]:
    """Looks until some promise is broken (0: never), with errors that forget as promised, or `tau_factor` times as slowly."""
    rng = np.random.default_rng(seed)
    audited = tuple(BY_NAME[name] for name in names)
    memory, columns = AuditMemory.empty(audited), len(LIMITS.names)
    kept = exp(-SPACING / tau_factor)
    x = rng.standard_normal((len(audited), 3 * SATELLITES))
    limit = log(len(AUDITED) / FALSE_ACCUSATION)
    for look in range(looks):
        row = np.zeros(columns)
        for of, values in zip(audited, x, strict=True):
            row[of.column] = statistics_of(of, values, scale)
        memory = advance(memory, START_NS + look * max(of.spacing_ns for of in audited), row, True, SATELLITES, audited)
        if max(ledger.most for ledger in memory.ledgers) >= limit:
            return look + 1, memory
        x = kept * x + sqrt(1.0 - kept**2) * rng.standard_normal(x.shape)
    return 0, memory


def test_right_sigmas_are_accused_in_less_than_one_run_in_a_thousand() -> None:
    """No accusation in 3000 runs: at most 1e-3 with 95 % (rule of three). All nine ledgers, 10 looks each; longer runs: the next test."""
    assert sum(audit(seed, 10, 1.0)[0] > 0 for seed in range(3000)) == 0


@pytest.mark.parametrize("tau_factor", [1.0, 2.0])
@pytest.mark.parametrize("name", ["shape", "b_value"])
def test_wealth_stays_below_twenty_in_19_runs_of_20(name: str, tau_factor: float) -> None:
    """Ville's inequality where it can be counted; also where errors forget half as fast as promised. 400 runs of 100 looks: 20 + 3 sd."""
    rich = sum(audit(10_000 + seed, 100, 1.0, (name,), tau_factor)[1].ledgers[0].most >= log(20.0) for seed in range(400))
    assert rich <= 33


@pytest.mark.parametrize(
    ("name", "most_looks"),
    [("circle_A", 100), ("common", 100), ("common_3d", 70), ("shape", 50), ("shape_3d", 35), ("residual", 60), ("b_value", 40)],
)
def test_sigmas_30_percent_too_small_are_known_in_time(name: str, most_looks: int) -> None:
    """Errors 1 / 0.7 times the promised ones: in 19 of 20 runs. A look every 2 min of differential errors, every 3.3 h of common ones."""
    assert sum(audit(seed, most_looks, 1.0 / 0.7, (name,))[0] > 0 for seed in range(20)) >= 19


def test_sigmas_that_become_too_small_after_long_good_times_are_known() -> None:
    memory = audit(1, 2000, 1.0, ("shape",))[1]
    of, rng = (BY_NAME["shape"],), np.random.default_rng(2)
    for look in range(80):
        row = np.zeros(len(LIMITS.names))
        row[of[0].column] = statistics_of(of[0], rng.standard_normal(4), 1.0 / 0.7)
        memory = advance(memory, START_NS + (2000 + look) * of[0].spacing_ns, row, True, SATELLITES, of)
    assert broken(memory) == (True,)


def test_what_it_says() -> None:
    of = (BY_NAME["shape"],)
    _, memory = audit(1, 200, 2.0, ("shape",))
    (sentence,) = accusations(memory, of)
    assert sentence.startswith("the promise of sigma_differential_m is broken: shape exceeded its 1 in 20 level ")
    assert sentence.endswith("measure the sigmas again: wayside replay REC.mcap --calibrate OUT.toml")


def test_a_kept_promise_says_nothing() -> None:
    assert accusations(audit(1, 25, 1.0)[1], AUDITED) == ()


def quiet(value: float = 1.0) -> Floats:
    return np.full(len(LIMITS.names), value)


def test_between_looks_nothing_is_remembered() -> None:
    memory = advance(AuditMemory.empty(AUDITED), START_NS, quiet(), True, SATELLITES, AUDITED)
    assert advance(memory, START_NS + NS_PER_S, quiet(1e6), True, SATELLITES, AUDITED) is memory


def test_after_an_epoch_that_is_not_clean_it_waits_anew() -> None:
    shape = (BY_NAME["shape"],)
    memory = advance(AuditMemory.empty(shape), START_NS, quiet(), True, SATELLITES, shape)
    memory = advance(memory, START_NS + 100 * NS_PER_S, quiet(1e6), False, SATELLITES, shape)
    assert memory.due_ns == START_NS + 100 * NS_PER_S + shape[0].spacing_ns


@pytest.mark.parametrize("value", [float("nan"), float("inf")])
def test_a_statistic_that_is_none_is_no_look(value: float) -> None:
    memory = advance(AuditMemory.empty(AUDITED), START_NS, quiet(value), True, SATELLITES, AUDITED)
    assert {ledger.looks for ledger in memory.ledgers} == {0}


def test_a_promise_once_broken_stays_broken() -> None:
    shape = (BY_NAME["shape"],)
    _, memory = audit(1, 200, 2.0, ("shape",))
    poor = replace(memory, ledgers=tuple(replace(x, log_wealth=(-1e9,) * 3) for x in memory.ledgers))
    assert accusations(poor, shape) == accusations(memory, shape) != ()
