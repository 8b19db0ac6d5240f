"""Pairs of receivers: under the sky, or under one transmitter."""

from itertools import combinations

import numpy as np
import pytest

from integrity.gnss.observations import Bools, Floats
from integrity.monitors.single_differences import (
    PairStatistics,
    capture,
    captured,
    captured_receivers,
    pair_design,
    pair_statistics,
    phase_agreement,
)

K, LEAST, MISSED = 6.0, 10.3, 1e-5
PAIRS = list(combinations(range(3), 2))
SYSTEM_OF = np.array([0] * 10 + [1] * 8)
POINTS_M = np.array([[0.0, 0.0, 0.0], [120.0, 0.0, 2.0], [60.0, 103.9, -1.0]])
RNG = np.random.default_rng(6)
AZ_RAD, EL_RAD = RNG.uniform(0.0, 2.0 * np.pi, 18), RNG.uniform(0.15, 1.5, 18)
TOWARDS = np.stack((np.sin(AZ_RAD) * np.cos(EL_RAD), np.cos(AZ_RAD) * np.cos(EL_RAD), np.sin(EL_RAD)))
SATELLITES_M = 2.2e7 * TOWARDS
SIGMA_M = np.sqrt(0.25**2 + (0.2 / np.sin(EL_RAD)) ** 2)  # what one receiver measures differently
CLOCKS_M = np.array([[3e4, 3.1e4], [-2e5, -2e5], [0.0, 7.0]])
EPOCHS = 2000


def ranges(points_m: Floats = POINTS_M) -> Floats:
    """From points (R, 3) to all satellites, (R, S)."""
    distances: Floats = np.linalg.norm(SATELLITES_M.T[None] - points_m[:, None], axis=-1)
    return distances


RANGE_M = np.repeat(ranges()[None], EPOCHS, axis=0)
ALL = np.ones((EPOCHS, 18), dtype=np.bool_)


def prefits(stand_at_m: Floats = POINTS_M, captured_systems: Bools | None = None) -> Floats:
    """Residuals (E, R, S) of receivers whose ranges are as if they stood elsewhere, of all satellites or those of some systems."""
    moved = ranges(stand_at_m) - ranges()
    moved = np.where(captured_systems[SYSTEM_OF], moved, 0.0) if captured_systems is not None else moved
    noise = np.random.default_rng(1).normal(size=RANGE_M.shape) * SIGMA_M
    return CLOCKS_M[:, SYSTEM_OF] + moved + noise


def stands(**at: tuple[float, float, float]) -> Floats:
    """The surveyed points, but for receivers that seem to stand elsewhere."""
    points = np.array(POINTS_M)
    for name, point in at.items():
        points["ABC".index(name)] = point
    return points


def shown(prefit_m: Floats, used: Bools = ALL) -> PairStatistics:
    n = len(prefit_m)
    return pair_statistics(pair_design(RANGE_M[:n], np.broadcast_to(SIGMA_M, (n, 18)), used[:n], SYSTEM_OF, 5), prefit_m)


SKY = shown(prefits())
ON_B = tuple(POINTS_M[1].tolist())
ONE_TRANSMITTER = shown(prefits(stands(A=ON_B)))  # A and B hear the signals of B's point
ELSEWHERE = shown(prefits(stands(A=(900.0, -300.0, 20.0), B=(900.0, -300.0, 20.0))))  # or those of a third one


def test_separation_is_the_spread_of_the_baseline_along_the_lines_of_sight() -> None:
    along = -(POINTS_M[1] - POINTS_M[0]) @ TOWARDS
    w = 1.0 / (2.0 * SIGMA_M**2)
    expected = sum(
        (w[k] * (along[k] - (w[k] * along[k]).sum() / w[k].sum()) ** 2).sum() for k in (SYSTEM_OF == 0, SYSTEM_OF == 1)
    )  # section 2.6, a clock for each constellation
    assert SKY.separation[0, 0, -1] == pytest.approx(np.sqrt(expected), rel=1e-4)


def test_under_the_sky_it_is_standard_normal() -> None:
    moments = (SKY.collapse[:, 0, -1].mean(), SKY.collapse[:, 0, -1].std())
    assert moments == pytest.approx((0.0, 1.0), abs=3.0 / np.sqrt(EPOCHS))


@pytest.mark.parametrize("statistics", [ONE_TRANSMITTER, ELSEWHERE], ids=["at B's point", "elsewhere"])
def test_under_one_transmitter_it_is_the_separation(statistics: PairStatistics) -> None:
    excess = (statistics.collapse - statistics.separation)[:, 0, -1]
    assert (excess.mean(), excess.std()) == pytest.approx((0.0, 1.0), abs=0.1)


def test_one_transmitter_fits_as_a_chi_square() -> None:
    misfit = ONE_TRANSMITTER.misfit[:, 0, -1]
    assert (misfit.mean(), misfit.var()) == pytest.approx((16.0, 32.0), rel=0.1)  # 18 satellites, two clocks


def named(statistics: PairStatistics) -> set[str]:
    """What is said of the receivers, in any epoch."""
    receivers = captured_receivers(captured(statistics, K, LEAST, MISSED), 3)
    return {"".join(name for name, x in zip("ABC", row, strict=True) if x) for row in receivers.tolist()}


@pytest.mark.parametrize(
    ("stand_at_m", "receivers"),
    [
        (POINTS_M, ""),
        (stands(A=ON_B), "AB"),
        (stands(B=(0.0, 0.0, 0.0)), "AB"),
        (stands(A=(5e3, 0.0, 0.0), C=(5e3, 0.0, 0.0)), "AC"),
        (stands(A=ON_B, C=ON_B), "ABC"),
        (stands(A=(60.0, 0.0, 1.0)), ""),
        (stands(A=(0.0, 120.0, 0.0)), ""),
        (stands(A=(110.0, 10.0, 2.0)), ""),
        (stands(B=(125.0, 3.0, 2.0), C=(65.0, 106.9, -1.0)), ""),
    ],
    ids=["the sky", "A is at B", "B is at A", "A and C far away", "all", "A half way to B", "A aside", "A past B", "two moved alike"],
)
def test_who_hears_one_transmitter(stand_at_m: Floats, receivers: str) -> None:
    assert named(shown(prefits(stand_at_m)[:200])) == {receivers}


@pytest.mark.parametrize("pair", [0, 1, 2])
def test_the_check_fails_for_a_captured_pair(pair: int) -> None:
    a, b = PAIRS[pair]
    statistic = capture(shown(prefits(stands(**{"ABC"[a]: tuple(POINTS_M[b].tolist())}))), K, LEAST)
    assert (statistic[:, pair] > K).all()


def test_under_the_sky_nothing_comes_near() -> None:
    assert capture(SKY, K, LEAST).max() < 1.0


@pytest.mark.parametrize("repeated", [0, 1])
def test_a_transmitter_that_repeats_one_constellation(repeated: int) -> None:
    found = shown(prefits(stands(A=ON_B), np.arange(5) == repeated))
    assert (capture(found, K, LEAST)[:, 0] > K).all()


def test_the_receivers_of_one_repeated_constellation_are_named() -> None:
    assert named(shown(prefits(stands(A=ON_B), np.array([False, True, False, False, False]))[:200])) == {"AB"}


def statistics_of(collapse: float, separation: float, misfit: float = 5.0) -> PairStatistics:
    return PairStatistics(np.array([[[collapse]]]), np.array([[[misfit]]]), np.array([[[separation]]]), np.array([[[5]]]))


@pytest.mark.parametrize(("separation", "threshold"), [(11.0, 6.0), (12.0, 6.0), (100.0, 50.0)])
def test_threshold_is_k_or_the_middle(separation: float, threshold: float) -> None:
    at = [capture(statistics_of(x, separation), K, LEAST).item() <= K for x in (threshold, np.nextafter(threshold * (1 + 1e-15), np.inf))]
    assert at == [True, False]


def test_a_pair_too_close_to_tell_is_not_monitored() -> None:
    assert np.isnan(capture(statistics_of(9.0, np.nextafter(LEAST, 0.0)), K, LEAST)).all()


@pytest.mark.parametrize(("misfit", "fits"), [(30.85, True), (30.86, False)])
def test_a_bad_fit_names_nobody(misfit: float, fits: bool) -> None:
    # The 1 - 1e-5 quantile of chi-square with 5 degrees of freedom is 30.856.
    assert captured(statistics_of(90.0, 100.0, misfit), K, LEAST, MISSED).item() == fits


def test_a_good_fit_below_the_threshold_names_nobody() -> None:
    assert not captured(statistics_of(49.0, 100.0), K, LEAST, MISSED).item()


def test_a_satellite_alone_in_its_constellation_says_nothing() -> None:
    used = ALL & ((SYSTEM_OF == 0) | (np.arange(18) == 12))
    assert (shown(prefits()[:1], used).separation[0, 0, 1], shown(prefits()[:1], used).dof[0, 0].tolist()) == (0.0, [9, 0, 9])


def test_without_satellites_nothing_is_said() -> None:
    assert np.isnan(capture(shown(prefits()[:1], ~ALL), K, LEAST)).all()


def test_a_bias_common_to_a_receiver_is_its_clock() -> None:
    biased = prefits()[:50]
    biased[:, 1] += 5000.0
    assert np.abs(shown(biased).collapse - shown(prefits()[:50]).collapse).max() < 1e-6


def test_satellites_not_used_do_not_matter() -> None:
    used, without = ALL & (np.arange(18) != 3), prefits()[:5]
    without[..., 3] = np.nan
    assert np.isfinite(shown(without, used).collapse[..., -1]).all()


def test_a_block_decides_as_its_epochs_do() -> None:
    prefit_m = prefits(stands(A=ON_B))[:40]
    one_by_one = [shown(prefit_m[e : e + 1]) for e in range(40)]
    joined = [np.concatenate([getattr(x, name) for x in one_by_one]).tobytes() for name in ("collapse", "misfit", "separation")]
    whole = shown(prefit_m)
    assert joined == [getattr(whole, name).tobytes() for name in ("collapse", "misfit", "separation")]


L1_M = np.full(18, 0.1903)
DESIGN = pair_design(RANGE_M, np.broadcast_to(SIGMA_M, (EPOCHS, 18)), ALL, SYSTEM_OF, 5)


def carrier_ahead(prefit_m: Floats, stand_at_m: Floats = POINTS_M, sigma_m: float = 0.005) -> Floats:
    """Carrier less pseudorange (E, R, S) of receivers that hear what is heard elsewhere: true ranges, whole cycles, 5 mm."""
    rng = np.random.default_rng(3)
    cycles = rng.integers(-1000, 1000, size=prefit_m.shape[1:])
    path_m = CLOCKS_M[:, SYSTEM_OF] + 0.07 + ranges(stand_at_m) - ranges()
    ahead: Floats = path_m + L1_M * cycles + sigma_m * rng.normal(size=prefit_m.shape) - prefit_m
    return ahead


def phases(prefit_m: Floats, ahead_m: Floats, tail: float = 1e-3) -> Bools:
    """Whether they agree on one transmitter (E, P)."""
    statistic, threshold = phase_agreement(DESIGN, prefit_m, ahead_m, L1_M, tail)
    return statistic > threshold


def test_phases_over_one_path_agree() -> None:
    at = stands(A=ON_B)
    assert phases(prefits(at), carrier_ahead(prefits(at), at))[:, 0].all()


def test_phases_of_the_sky_do_not() -> None:
    assert not phases(prefits(), carrier_ahead(prefits())).any()


def test_phases_tell_a_biased_receiver_from_a_captured_one() -> None:
    # Its ranges are as if it stood at B's point, exactly; its phases are those of its own antenna.
    assert not phases(prefits(stands(A=ON_B)), carrier_ahead(prefits(stands(A=ON_B)))).any()


def mean_statistic(without: Bools) -> float:
    """Of phases over one path, some satellites without a phase."""
    at = stands(A=ON_B)
    ahead_m = np.where(without, np.nan, carrier_ahead(prefits(at), at))
    return float(phase_agreement(DESIGN, prefits(at), ahead_m, L1_M, 1e-3)[0][:, 0].mean())


def test_the_statistic_of_one_path() -> None:
    # E(n R^2) = 1 + (n - 1) exp(-(2 pi sigma)^2), sigma of two phases of 5 mm in cycles; ten and eight satellites.
    coherence = np.exp(-((2.0 * np.pi) ** 2) * 2.0 * (0.005 / 0.1903) ** 2)
    assert mean_statistic(np.zeros(18, dtype=np.bool_)) == pytest.approx(2.0 * (2.0 + 16.0 * coherence), abs=0.1)


def test_phases_agree_however_wrong_the_points_are() -> None:
    at, wrong_m = stands(A=ON_B), np.random.default_rng(4).uniform(-1.0, 1.0, (3, 18))
    design = pair_design(RANGE_M + wrong_m, np.broadcast_to(SIGMA_M, (EPOCHS, 18)), ALL, SYSTEM_OF, 5)
    prefit_m, ahead_m = prefits(at), carrier_ahead(prefits(at), at)
    found = [phase_agreement(d, x, ahead_m, L1_M, 1e-3)[0] for d, x in ((DESIGN, prefit_m), (design, prefit_m - wrong_m))]
    assert np.abs(found[0] - found[1]).max() < 1e-4


def test_phases_by_chance_are_chi_square_at_most() -> None:
    # Eight fractions align somewhat less often than many would, as chi-square has it.
    ahead_m = L1_M * np.random.default_rng(5).uniform(size=RANGE_M.shape)
    assert 0.02 < phases(prefits(), ahead_m, 0.05)[:, 0].mean() < 0.05


def test_satellites_without_phase_do_not_count() -> None:
    coherence = np.exp(-((2.0 * np.pi) ** 2) * 2.0 * (0.005 / 0.1903) ** 2)
    assert mean_statistic(np.arange(18) % 3 == 0) == pytest.approx(2.0 * (2.0 + 10.0 * coherence), abs=0.1)


def test_without_phases_nothing_is_said() -> None:
    assert np.isnan(phase_agreement(DESIGN, prefits(), np.full(RANGE_M.shape, np.nan), L1_M, 1e-3)[0]).all()


def test_one_phase_of_a_constellation_aligns_with_itself() -> None:
    # The 1 - 1e-3 quantile of chi-square with two degrees of freedom is 2 ln 1000.
    ahead_m = np.where(np.arange(18) > 10, np.nan, carrier_ahead(prefits()))
    assert phase_agreement(DESIGN, prefits(), ahead_m, L1_M, 1e-3)[1] == pytest.approx(2.0 * np.log(1000.0))
