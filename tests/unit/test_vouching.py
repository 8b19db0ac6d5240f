"""What trains are told of each satellite: the error that the ground lets through against Monte Carlo, corrections against formulas."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from integrity.gnss.ephemeris.content import content_crc32
from integrity.gnss.observations import Floats
from integrity.monitors.residuals import b_values_m, clock_design, seen_by_all, without_clocks
from integrity.probability import gauss_quantile
from integrity.vouching import MonitoredSignal, monitored_signals, undetected_range_m
from tests.rinex_examples import GPS as GPS_ROWS
from tests.rinex_examples import GPS_HEAD, kepler

GPS = kepler(GPS_HEAD, GPS_ROWS)
SYSTEM_OF = np.array([0, 0, 0, 0, 1, 1, 1])
SIGMA_M = np.array([1.0, 1.4, 0.9, 2.0, 1.0, 1.1, 3.0])
RECEIVERS = 3
THRESHOLD, MISSED = 5.0, 0.01
UNDETECTED_SIGMAS = THRESHOLD + gauss_quantile(MISSED / RECEIVERS)


def missed_share(satellite: int, bias_m: float, own_share: float) -> float:
    """How often an error of one satellite's range passes the check; `own_share` of the variance is each receiver's own."""
    rng = np.random.default_rng(satellite)
    n = 40_000
    common, own = rng.standard_normal((n, 1, 7)), rng.standard_normal((n, RECEIVERS, 7))
    ranges_m = SIGMA_M * (np.sqrt(1.0 - own_share) * common + np.sqrt(own_share) * own)
    ranges_m[..., satellite] += bias_m
    used = np.ones((n, 7), dtype=np.bool_)
    of = clock_design(np.tile(SIGMA_M, (n, 1)), used, SYSTEM_OF, 2)
    return float(np.mean(seen_by_all(without_clocks(of, ranges_m).normalised)[:, satellite] <= THRESHOLD))


def undetected_m() -> Floats:
    of = clock_design(SIGMA_M[None], np.ones((1, 7), dtype=np.bool_), SYSTEM_OF, 2)
    return undetected_range_m(SIGMA_M, of.scale_m[0, 0], UNDETECTED_SIGMAS)


@pytest.mark.parametrize("own_share", [0.1, 1.0])
@pytest.mark.parametrize("satellite", range(7))
def test_an_error_as_large_as_stated_is_missed_no_more_often_than_promised(satellite: int, own_share: float) -> None:
    missed = missed_share(satellite, float(undetected_m()[satellite]), own_share)
    assert missed <= MISSED + 4.0 * np.sqrt(MISSED / 40_000)


@pytest.mark.parametrize("satellite", range(7))
def test_what_is_stated_is_not_larger_than_needed(satellite: int) -> None:
    assert missed_share(satellite, 0.85 * float(undetected_m()[satellite]), 0.1) > MISSED


def test_a_satellite_that_is_half_of_its_clock_lets_more_through() -> None:
    alone_with_another = undetected_range_m(np.array([1.0]), np.array([np.sqrt(0.5)]), 10.0)
    assert alone_with_another == pytest.approx([10.0 * np.sqrt(2.0)])


def offered() -> tuple[MonitoredSignal, ...]:
    residual_m = np.array([[1.0, 4.0], [2.0, 4.0], [6.0, 4.0]])
    sets = (replace(GPS, satellite="G01"), replace(GPS, satellite="G07"))
    return monitored_signals(
        ("G01.1C", "G07.1C"),
        np.array([True, False]),
        sets,
        np.array([0, 1]),
        np.array([9.0, 8.0]),
        residual_m,
        b_values_m(residual_m[None])[0],
        np.array([0.3, 0.4]),
    )


def test_only_signals_in_use_are_offered() -> None:
    assert [of.signal for of in offered()] == ["G01.1C"]


def test_a_correction_takes_the_receivers_mean_away() -> None:
    assert offered()[0].correction_m == pytest.approx(-3.0)


def test_a_corrections_sigma_is_that_of_the_mean_of_three() -> None:
    assert offered()[0].correction_sigma_m == pytest.approx(0.3 / np.sqrt(3.0))


def test_b_values_stand_in_the_order_of_receivers() -> None:
    assert offered()[0].b_m == pytest.approx((-1.0, -0.5, 1.5))


def test_the_ephemeris_is_that_of_the_satellite() -> None:
    assert offered()[0].ephemeris_crc32 == content_crc32(replace(GPS, satellite="G01"))


def test_a_set_sent_again_has_the_same_content() -> None:
    assert content_crc32(replace(GPS, transmission_ns=GPS.transmission_ns + 30_000_000_000)) == content_crc32(GPS)


@pytest.mark.parametrize("name", ["sqrt_a", "e", "m0", "cis", "af0", "group_delay_s"])
def test_any_other_number_is_another_content(name: str) -> None:
    by_a_bit: Any = {name: float(np.nextafter(getattr(GPS, name), 1e9))}
    changed = replace(GPS, **by_a_bit)
    assert content_crc32(changed) != content_crc32(GPS)
