"""Detection and exclusion: what holds for every sky."""

from dataclasses import fields
from random import Random

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from integrity.gnss.detection import Checked, Finding, criteria, detect_and_exclude, normalised_outside
from integrity.gnss.least_squares import solution
from integrity.gnss.leave_one_out import normalised, shares
from integrity.gnss.suspects import without_suspects
from tests.unit.gnss.skies import MadeSky, made_sky

LIMITS = criteria(false_alarm=1e-4, most_excluded=3, confusable=0.85, confusion=1e-3)


@st.composite
def skies(draw: st.DrawFn) -> MadeSky:
    """Skies of up to four constellations with up to three faults, some satellites not used."""
    satellites = tuple(draw(st.lists(st.integers(1, 8), min_size=1, max_size=4)))
    sky = made_sky(draw(st.integers(0, 2**32 - 1)), satellites, epochs=3)
    residual_m, used = sky.residual_m.copy(), sky.used.copy()
    n = len(sky.system_of)
    for _ in range(draw(st.integers(0, 3))):
        residual_m[draw(st.integers(0, 2)), :, draw(st.integers(0, n - 1))] += draw(st.sampled_from([-1e6, -50.0, 20.0, 1e4]))
    used[..., draw(st.lists(st.integers(0, n - 1), max_size=2))] = False
    return sky._replace(residual_m=residual_m, used=used)


def checked(sky: MadeSky) -> Checked:
    return detect_and_exclude(sky.design(), sky.los_enu, sky.residual_m, LIMITS)


@given(skies())
@settings(max_examples=200, deadline=None)
def test_what_remains_passes_both_tests_when_it_is_solved_again(sky: MadeSky) -> None:
    result = checked(sky)
    again = detect_and_exclude(sky.design(sky.used & ~result.excluded), sky.los_enu, sky.residual_m, LIMITS)
    accepted = (result.finding == Finding.PASSED) | (result.finding == Finding.EXCLUDED)
    assert (again.finding[accepted] == Finding.PASSED).all()


@given(skies())
@settings(max_examples=200, deadline=None)
def test_positions_are_those_of_solving_again_without_what_was_excluded(sky: MadeSky) -> None:
    result = checked(sky)
    again = solution(sky.design(sky.used & ~result.excluded), sky.residual_m)
    rounding_m = 1e-11 * np.abs(sky.residual_m).max()  # a PDOP of 100 and more makes 1e-16 that large
    np.testing.assert_allclose(result.found.e_enu_m, again.e_enu_m, rtol=0.0, atol=rounding_m)


@given(skies(), st.randoms(use_true_random=False))
@settings(max_examples=100, deadline=None)
def test_the_order_of_satellites_makes_no_difference(sky: MadeSky, random: Random) -> None:
    order = list(range(len(sky.system_of)))
    random.shuffle(order)
    turned = sky._replace(**{name: x[..., order] for name, x in sky._asdict().items()})
    np.testing.assert_array_equal(checked(turned).finding, checked(sky).finding)


@given(skies())
@settings(max_examples=100, deadline=None)
def test_epochs_are_decided_one_by_one(sky: MadeSky) -> None:
    """To the last bit: however a stream is cut into blocks."""
    whole = checked(sky)
    for e in range(3):
        one = slice(e, e + 1)
        part = checked(sky._replace(**{n: getattr(sky, n)[..., one, :, :] for n in ("los_enu", "sigma_m", "residual_m", "used")}))
        for name in (f.name for f in fields(Checked) if f.name != "found"):
            assert getattr(part, name).tobytes() == getattr(whole, name)[one].tobytes(), name


@given(skies(), st.floats(-1e5, 1e5))
@settings(max_examples=100, deadline=None)
def test_a_bias_common_to_a_receivers_ranges_excludes_nothing(sky: MadeSky, bias_m: float) -> None:
    np.testing.assert_array_equal(checked(sky._replace(residual_m=sky.residual_m + bias_m)).excluded, checked(sky).excluded)


@given(skies())
@settings(max_examples=200, deadline=None)
def test_without_all_suspects_what_remains_passes_when_it_is_solved_again(sky: MadeSky) -> None:
    of = sky.design()
    result = without_suspects(checked(sky), of, sky.los_enu, sky.residual_m, LIMITS)
    again = detect_and_exclude(sky.design(sky.used & ~result.excluded), sky.los_enu, sky.residual_m, LIMITS)
    assert (again.finding[result.finding == Finding.EXCLUDED] == Finding.PASSED).all()


@given(skies())
@settings(max_examples=100, deadline=None)
def test_the_only_range_left_out_is_as_unlikely_as_it_was_among_all(sky: MadeSky) -> None:
    """Its residual over the standard deviation of its prediction is its normalised residual before it went."""
    of, _, left_m = sky.solved()
    before = normalised(of, shares(of, sky.los_enu), left_m)
    for s in range(len(sky.system_of)):
        fewer, _, outside_m = sky.solved(sky.used & (np.arange(len(sky.system_of)) != s))
        after = normalised_outside(fewer, sky.los_enu, sky.sigma_m, outside_m)[..., s]
        both = np.isfinite(before[..., s]) & np.isfinite(after) & of.used[..., s]
        np.testing.assert_allclose(after[both], before[..., s][both], rtol=1e-5, atol=1e-6)
