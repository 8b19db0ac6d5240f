"""`frequencies` in a site file: what it decides by, and what is said of sigmas that do not go with it."""

import math

import pytest

from integrity.config import SIGMAS_OF_PAIRS_M, SIGMAS_OF_SIGNALS_M, IntegrityConfig
from integrity.gnss.signals import ionosphere_free_weights
from recordings.site_file import SiteFile, override_site, parse_site
from recordings.toml_file import ConfigProblems
from tests.unit.sites import SITE, edited

SIGMAS = [line for line in SITE.splitlines(keepends=True) if line.startswith("sigma_")]
WITHOUT_SIGMAS = "".join(line for line in SITE.splitlines(keepends=True) if line not in SIGMAS)


def with_frequencies(text: str, value: str) -> str:
    return text.replace('rule = "full"\n', f'rule = "full"\nfrequencies = {value}\n').replace("tolerance_m = 20.0\n", "")


def of_pairs(text: str = WITHOUT_SIGMAS) -> SiteFile:
    return parse_site(with_frequencies(text, "2"), "site.toml")


def warned(site: SiteFile) -> list[str]:
    return [warning.key for warning in site.warnings]


def test_a_site_decides_on_one_frequency_unless_it_says_otherwise() -> None:
    assert parse_site(SITE, "site.toml").config.integrity.frequencies == 1


def test_one_frequency_written_out_is_the_same_configuration() -> None:
    text = SITE.replace("tolerance_m = 20.0\n", "")
    assert parse_site(with_frequencies(SITE, "1"), "s").config == parse_site(text, "s").config


@pytest.mark.parametrize("value", ["0", "3", "2.0", '"2"', "true", "[1, 2]"])
def test_other_numbers_of_frequencies_are_refused(value: str) -> None:
    with pytest.raises(ConfigProblems) as refused:
        parse_site(with_frequencies(SITE, value), "site.toml")
    (problem,) = refused.value.problems
    assert str(problem).startswith(f"site.toml:{problem.line}: integrity.frequencies = ")
    assert problem.message == "expected 1 (of every satellite one signal) or 2 (pairs of signals that the ionosphere does not delay)"


def test_sigmas_left_out_are_those_of_one_signal() -> None:
    promises = parse_site(WITHOUT_SIGMAS.replace("tolerance_m = 20.0\n", ""), "s").config.integrity
    assert promises == IntegrityConfig()


@pytest.mark.parametrize("name", SIGMAS_OF_PAIRS_M)
def test_sigmas_left_out_are_those_of_pairs(name: str) -> None:
    assert getattr(of_pairs().config.integrity, name) == SIGMAS_OF_PAIRS_M[name]


@pytest.mark.parametrize(("name", "times"), [("sigma_common", 2.0), ("sigma_differential", 2.0)])
def test_vertical_sigmas_of_pairs_left_out_are_twice_the_horizontal(name: str, times: float) -> None:
    promises = of_pairs().config.integrity
    assert getattr(promises, f"{name}_up_m") == times * getattr(promises, f"{name}_m")


def test_a_sigma_that_is_stated_is_kept() -> None:
    text = WITHOUT_SIGMAS.replace("recover_after_s = 30.0", "recover_after_s = 30.0\nsigma_range_m = 1.4")
    assert of_pairs(text).config.integrity.sigma_range_m == 1.4


def test_what_receivers_do_not_share_grows_as_the_weights_of_gps_have_it() -> None:
    """By 2.98 for errors that are alike and independent; written as 3."""
    weights = ionosphere_free_weights("G", "1", "2")
    assert weights is not None
    grown = [
        SIGMAS_OF_PAIRS_M[name] / SIGMAS_OF_SIGNALS_M[name]
        for name in ("sigma_differential_m", "sigma_range_differential_m", "sigma_range_differential_low_m")
    ]
    assert grown == pytest.approx([math.hypot(*weights)] * 3, rel=0.01)


@pytest.mark.parametrize("part", ["", "low_"])
def test_a_range_has_three_times_its_noise_and_what_receivers_share_as_it_was(part: str) -> None:
    whole, own = f"sigma_range_{part}m", f"sigma_range_differential_{part}m"
    shared_m2 = SIGMAS_OF_SIGNALS_M[whole] ** 2 - SIGMAS_OF_SIGNALS_M[own] ** 2
    assert SIGMAS_OF_PAIRS_M[whole] == pytest.approx(math.sqrt(shared_m2 + SIGMAS_OF_PAIRS_M[own] ** 2), abs=0.01)


def test_sigmas_of_single_signals_stated_for_pairs_are_warned_of() -> None:
    """All that the sample states; what receivers share is the same for both."""
    stated = {f"integrity.{name}" for name in SIGMAS_OF_PAIRS_M if name != "sigma_common_m"}
    assert {key for key in warned(of_pairs(SITE)) if "sigma" in key} == stated


def test_the_same_sigmas_stated_for_one_frequency_are_not() -> None:
    assert not [key for key in warned(parse_site(SITE, "site.toml")) if "sigma" in key]


def test_sigmas_left_out_are_not_warned_of() -> None:
    assert not [key for key in warned(of_pairs()) if "sigma" in key]


def test_a_triangle_that_is_too_small_for_pairs_is_told_so() -> None:
    """15 m sides are enough for 0.5 m, not for 1.5 m."""
    text = WITHOUT_SIGMAS
    for old, new in (("[-3962186.571, 3381218.295, 3668678.638]", "b"), ("[-3962101.898, 3381224.913, 3668763.412]", "c")):
        point = {"b": "[-3962118.410, 3381298.164, 3668678.638]", "c": "[-3962107.826, 3381298.991, 3668689.235]"}[new]
        assert text.count(old) == 1
        text = text.replace(old, point)
    parse_site(text.replace("tolerance_m = 20.0\n", ""), "site.toml")
    with pytest.raises(ConfigProblems, match=r"now 1.5, that of pairs: frequencies = 2\)"):
        of_pairs(text)


def test_a_recording_can_be_decided_again_on_pairs() -> None:
    site = override_site(parse_site(edited(("tolerance_m = 20.0\n", "")), "site.toml"), ["frequencies=2"])
    assert site.config.integrity.frequencies == 2


def test_the_hash_changes_with_the_number_of_frequencies() -> None:
    one, two = (parse_site(with_frequencies(SITE, n), "s").config.config_sha256 for n in "12")
    assert one != two
