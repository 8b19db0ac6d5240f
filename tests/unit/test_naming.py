"""Who may be named by what moved since the last clean epoch: the cases of `integrity.naming`'s theory of operation."""

import numpy as np
import pytest

from integrity.config import IntegrityConfig
from integrity.gnss.gps_time import NS_PER_S
from integrity.gnss.observations import Bools, Floats
from integrity.naming import LastClean, jump_ratio, named_receiver, stands_elsewhere
from tests.unit.gnss.skies import made_sky
from tests.unit.streams import LIMITS

PROMISES = IntegrityConfig()
VAR_COMMON = np.array([1.2, 1.2, 2.4]) ** 2
VAR_D = np.array([0.5, 0.5, 1.0]) ** 2
UNSURE = np.zeros(3)  # rule (iv) without memory says nothing
SUSPECT_C = np.array([False, False, True])
CASES = 20_000


def ratios(e_enu_m: Floats, before_m: Floats, seconds: int = 30) -> Floats:
    return jump_ratio(e_enu_m, VAR_COMMON, VAR_D, LastClean(0, before_m), seconds * NS_PER_S, PROMISES)


def named(e_enu_m: Floats, last: LastClean | None) -> list[bool]:
    found = named_receiver(SUSPECT_C, UNSURE, e_enu_m, VAR_COMMON, VAR_D, last, 30 * NS_PER_S, PROMISES, LIMITS)
    return [bool(f) for f in found]


def test_the_receiver_that_jumped_up_is_named_under_a_large_common_height_error() -> None:
    before = np.array([[0.0, 0.0, -5.0]] * 3)
    assert named(before + np.array([[0, 0, 0], [0, 0, 0], [0, 0, 15.0]]), LastClean(0, before)) == [False, False, True]


def test_without_a_clean_epoch_before_nothing_jumped() -> None:
    assert named(np.array([[0.0, 0.0, -5.0], [0.0, 0.0, -5.0], [0.0, 0.0, 10.0]]), None) == [False, False, False]


def test_only_a_suspect_is_named() -> None:
    before = np.zeros((3, 3))
    assert named(np.array([[15.0, 0.0, 0.0], [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]]), LastClean(0, before)) == [False, False, False]


@pytest.mark.parametrize("size_m", [4.0, 6.0, 10.0, 20.0])
def test_two_that_jump_alike_never_make_the_third_look_as_if_it_had(size_m: float) -> None:
    jump = np.array([[size_m, 0.0, 0.0], [size_m, 0.0, 0.0], [0.0, 0.0, 0.0]])
    assert ratios(jump, np.zeros((3, 3)))[2] < 0.0


@pytest.mark.parametrize("rate_m", [0.01, 0.1, 0.5])
def test_two_that_drift_alike_never_make_the_third_look_as_if_it_had_jumped(rate_m: float) -> None:
    """However far the two had drifted in the last clean epoch: what counts is where each was then."""
    for drifted_m in (0.0, 2.0, 4.0, 8.0):
        before = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 0.0], [-drifted_m, 0.0, 0.0]])  # the drift hides a common error of its size
        for epochs in range(1, 21):
            now = before + np.array([[rate_m * epochs, 0.0, 0.0], [rate_m * epochs, 0.0, 0.0], [0.0, 0.0, 0.0]])
            assert ratios(now, before, 30 * epochs)[2] <= 0.0


@pytest.mark.parametrize("seconds", [30, 300, 1200])
def test_the_healthy_third_is_not_named_under_noise(seconds: int) -> None:
    """Two jump by 6 m alike; at most 2 of 20,000 draws of the error model: fewer than 3.2e-4 of them with 95 % confidence, before rules
    (i) to (iii) take their share."""
    rng = np.random.default_rng(1)
    keeps = np.exp(-seconds / PROMISES.correlation_common_s)
    common = rng.normal(0.0, np.sqrt(VAR_COMMON), (CASES, 1, 3))
    later = keeps * common + rng.normal(0.0, np.sqrt(VAR_COMMON * (1.0 - keeps**2)), (CASES, 1, 3))
    before, now = (c + rng.normal(0.0, np.sqrt(VAR_D), (CASES, 3, 3)) for c in (common, later))
    now[:, :2, 0] += 6.0
    wrong = sum(ratios(n, b, seconds)[2] > LIMITS.jump_log_likelihood_ratio for n, b in zip(now, before, strict=True))
    assert wrong <= 2


SKY = made_sky(11, (6, 5), epochs=1, receivers=1)
SIGMA_RANGE_M = 0.3


def ranges_of(receiver: int, extra_m: Floats) -> Floats:
    """Prefit residuals (1, 3, S) of three receivers with clocks of their own, small noise, and more at one."""
    n = len(SKY.system_of)
    clocks_m = np.array([100.0, -30.0, 7e4])[:, None] + np.array([0.0, 12.0])[SKY.system_of]
    noise_m = np.random.default_rng(4).normal(0.0, 0.7 * SIGMA_RANGE_M, (3, n))
    prefit_m = clocks_m + noise_m
    prefit_m[receiver] += extra_m
    result: Floats = prefit_m[None]
    return result


def elsewhere(prefit_m: Floats, used: Bools | None = None) -> list[bool]:
    los_enu = np.ascontiguousarray(np.broadcast_to(SKY.los_enu, (3, *prefit_m.shape)))
    sigma_m = np.full(prefit_m.shape[::2], SIGMA_RANGE_M)
    chosen = np.ones(sigma_m.shape, dtype=np.bool_) if used is None else used
    return [bool(found) for found in stands_elsewhere(los_enu, prefit_m, sigma_m, chosen, SKY.system_of, 2, LIMITS)]


def along(offset_enu_m: tuple[float, float, float]) -> Floats:
    ranges_m: Floats = -np.einsum("is,i->s", SKY.los_enu[:, 0, 0], np.array(offset_enu_m))
    return ranges_m


@pytest.mark.parametrize("receiver", range(3))
def test_ranges_of_an_antenna_that_stands_elsewhere_are_explained_by_that(receiver: int) -> None:
    assert elsewhere(ranges_of(receiver, along((15.0, -4.0, 9.0))))[receiver]


@pytest.mark.parametrize("receiver", range(3))
def test_delays_of_some_satellites_at_one_receiver_are_not(receiver: int) -> None:
    delayed = np.where(np.arange(len(SKY.system_of)) % 3 == 0, 8.0, 0.0)
    assert not elsewhere(ranges_of(receiver, delayed))[receiver]


def test_five_satellites_of_two_constellations_contradict_nothing() -> None:
    used = np.isin(np.arange(len(SKY.system_of)), [0, 1, 2, 6, 7])[None]
    assert not any(elsewhere(ranges_of(0, along((15.0, 0.0, 0.0))), used))
