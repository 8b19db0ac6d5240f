"""Sigmas from recordings: bounds that cover known truths in the stated share, means that become no sigmas, refusals, the table."""

from dataclasses import replace
from functools import cache
from itertools import pairwise
from math import exp, sqrt

import numpy as np
import pytest
from scipy.special import chdtri

from integrity.config import ReceiverConfig, SiteConfig
from integrity.errors import ConfigError
from integrity.gnss.frames import enu_axes, geodetic_from_ecef
from integrity.gnss.observations import Floats
from recordings.calibrate import Calibration, calibrate
from recordings.calibrate_samples import Samples, samples
from recordings.calibrate_statistics import correlation, mean_bound, size, tail_scale
from recordings.calibrate_text import integrity_table, warnings
from recordings.simulate.errors import NOMINAL, gauss_markov
from recordings.simulate.observations import simulate
from recordings.site_file import parse_site
from tests.unit.sites import UBX_SITE
from tests.unit.streams import SITE, START_NS, a_site, stream

INTERVAL_S, TAU_S = 60.0, 3000.0
DAY_SITE = a_site(30.0)


def errors(seed: int, epochs: int, columns: int = 3, tau_s: float = TAU_S) -> Floats:
    """Gauss-Markov errors of unit size, their mean over the record taken out."""
    x = gauss_markov(np.random.default_rng(seed).standard_normal((epochs, columns)), INTERVAL_S / tau_s)
    varying: Floats = x - x.mean(axis=0)
    return varying


@cache
def bounds(hours: int, seeds: int) -> tuple[list[float], list[float], list[bool]]:
    """Of every axis of every seed with a result: upper bounds, estimates, and whether the interval of the mean holds it."""
    upper, estimates, holds = [], [], []
    for seed in range(seeds):
        x = gauss_markov(np.random.default_rng(seed).standard_normal((hours * 60, 3)), INTERVAL_S / TAU_S)
        varying = x - x.mean(axis=0)
        found = correlation(varying, INTERVAL_S, mean_removed=True)
        if found is None:
            continue
        sizes = [size(varying[:, i], INTERVAL_S, found) for i in range(3)]
        upper += [s.upper for s in sizes]
        estimates += [s.estimate for s in sizes]
        holds += [abs(float(m)) <= mean_bound(s, found) for m, s in zip(x.mean(axis=0), sizes, strict=True)]
    return upper, estimates, holds


@pytest.mark.parametrize("hours", [12, 48])
def test_upper_bounds_cover_the_truth_in_95_percent(hours: int) -> None:
    """Within three standard errors of 0.95, axes of one seed taken as one: 0.95 - 3 sqrt(0.95 0.05 / 120)."""
    assert np.mean(np.array(bounds(hours, 120)[0]) >= 1.0) >= 0.89


@pytest.mark.parametrize("hours", [12, 48])
def test_what_the_mean_takes_of_the_variance_is_given_back(hours: int) -> None:
    assert np.mean(np.square(bounds(hours, 120)[1])) == pytest.approx(1.0, abs=0.12)


@pytest.mark.parametrize("hours", [12, 48])
def test_a_mean_of_sound_errors_is_rarely_significant(hours: int) -> None:
    assert np.mean(bounds(hours, 120)[2]) >= 0.89


def test_twelve_hours_hold_about_fifteen_samples() -> None:
    effective = [
        size(errors(seed, 720)[:, 0], INTERVAL_S, found).effective
        for seed in range(20)
        if (found := correlation(errors(seed, 720), 60.0, True))
    ]
    assert 8.0 <= np.mean(effective) <= 16.0  # the correlation time enters near its upper bound


@pytest.mark.parametrize("tau_s", [30.0, 600.0, 3000.0])
def test_the_correlation_time_is_found(tau_s: float) -> None:
    x = errors(1, 20_000, 6, tau_s)
    found = correlation(x, INTERVAL_S, mean_removed=True)
    assert found is not None
    assert found.lower_s <= tau_s <= found.upper_s


def test_long_tails_are_covered_at_every_level_seen() -> None:
    x = np.random.default_rng(1).standard_t(3, 20_000)
    scale = tail_scale(x**2, 1, 0.0)
    level = np.array([0.1, 0.01, 0.001, 1e-4])
    share = (np.abs(x)[:, None] > scale * np.sqrt(chdtri(1, level))).mean(axis=0)
    assert (share <= level).all()


def test_normal_errors_are_hardly_stretched() -> None:
    assert tail_scale(np.random.default_rng(1).standard_normal(20_000) ** 2, 1, 0.0) == pytest.approx(1.0, abs=0.1)


@cache
def day(seed: int = 1) -> Samples:
    found = samples(DAY_SITE, simulate(DAY_SITE, START_NS, 86_400.0, 1.0 / 30.0, seed), None, None, None)
    assert found is not None
    return found


@cache
def measured(seed: int = 1) -> Calibration:
    return calibrate(day(seed), DAY_SITE)


@pytest.mark.parametrize("seed", [1, 2, 3])
@pytest.mark.parametrize("el_deg", [7.5, 15.0, 30.0, 60.0, 90.0])
def test_differential_ranges_are_promised_larger_than_simulated_and_not_by_much(seed: int, el_deg: float) -> None:
    """Noise and multipath of the simulation: sqrt(2) (0.12, 0.095)."""
    s2 = np.sin(np.deg2rad(el_deg)) ** 2
    truth = sqrt((NOMINAL.noise_m**2 + NOMINAL.multipath_m**2) + (NOMINAL.noise_low_m**2 + NOMINAL.multipath_low_m**2) / s2)
    values = measured(seed).values
    promised = sqrt(values["sigma_range_differential_m"] ** 2 + values["sigma_range_differential_low_m"] ** 2 / s2)
    assert truth <= promised <= 1.5 * truth


@pytest.mark.parametrize("key", ["sigma_common_m", "sigma_common_up_m", "sigma_differential_m", "sigma_differential_up_m"])
def test_position_sigmas_cover_other_days(key: str) -> None:
    """Promised from one day; the rms about zero of three other days, of the worst horizontal axis."""
    e = np.concatenate([day(seed).e_enu_m for seed in (2, 3, 4)])
    mean = np.nanmean(e, axis=1)
    spread = mean if "common" in key else ((e - mean[:, None]) * sqrt(1.5)).reshape(-1, 3)
    rms = np.sqrt(np.nanmean(spread**2, axis=0))
    assert measured().values[key] >= (rms[2] if "up" in key else rms[:2].max())


def moved(site: SiteConfig, name: str, offset_enu_m: tuple[float, float, float]) -> SiteConfig:
    """The site with one antenna surveyed wrong."""

    def point(receiver: ReceiverConfig) -> tuple[float, float, float]:
        ecef = np.array(receiver.position_ecef_m)
        lat, lon, _ = geodetic_from_ecef(ecef)
        x, y, z = ecef + np.array(offset_enu_m) @ enu_axes(lat, lon)
        return float(x), float(y), float(z)

    receivers = (replace(r, position_ecef_m=point(r)) if r.name == name else r for r in site.receivers)
    return replace(site, receivers=tuple(receivers))


@cache
def wrongly_surveyed() -> Calibration:
    site = moved(DAY_SITE, "B", (0.5, 0.0, 0.0))
    return calibrate(samples(site, simulate(DAY_SITE, START_NS, 86_400.0, 1.0 / 30.0, 1), None, None, None), site)


def test_a_survey_error_is_said_and_whose_it_is() -> None:
    (mean,) = [m for m in wrongly_surveyed().means if m.what.startswith("receiver B")]
    assert mean.mean_m[0] == pytest.approx(-0.5 * 2.0 / 3.0, abs=0.05)
    assert any("receiver B" in text and "Survey this antenna again" in text for text in warnings(wrongly_surveyed()))


def test_a_survey_error_makes_no_sigma_larger() -> None:
    right, wrong = measured().values["sigma_differential_m"], wrongly_surveyed().values["sigma_differential_m"]
    assert wrong == pytest.approx(right, abs=0.011)


def test_a_well_surveyed_site_is_warned_of_nothing() -> None:
    assert warnings(measured()) == []


def test_too_little_is_refused_with_what_would_do() -> None:
    with pytest.raises(ConfigError, match=r"0\.0083 h of sound epochs are too little .* What would do: about 4\.2 h"):
        calibrate(samples(SITE, stream(35.0), None, None, None), SITE)


def test_nothing_sound_is_refused() -> None:
    with pytest.raises(ConfigError, match="nothing to calibrate with"):
        calibrate(samples(SITE, stream(3.0), None, None, None), SITE)


def test_many_epochs_left_out_are_refused() -> None:
    with pytest.raises(ConfigError, match=r"400 of 3279 epochs after start-up are not sound \(400 x NOT_CONFIRMABLE, receiver\)"):
        calibrate(replace(day(), left_out={"starting up": 1, "NOT_CONFIRMABLE, receiver": 400}), DAY_SITE)


def test_few_epochs_left_out_are_warned_of() -> None:
    found = calibrate(replace(day(), left_out={"NOT_CONFIRMABLE, receiver": 100}), DAY_SITE)
    assert any("100 epochs were not sound" in text for text in warnings(found))


def test_the_table_is_read_as_it_was_measured() -> None:
    site = parse_site(UBX_SITE, "site.toml")
    before, _, rest = UBX_SITE.partition("[integrity]")
    after = rest[rest.index("[publish]") :]
    again = parse_site(before + integrity_table(measured(), site, "day.mcap") + after, "measured.toml")
    assert {key: getattr(again.config.integrity, key) for key in measured().values} == measured().values


def test_the_table_keeps_what_was_promised() -> None:
    site = parse_site(UBX_SITE, "site.toml")
    table = integrity_table(measured(), site, "day.mcap")
    assert "false_stops_per_year = 1.0\n" in table
    assert "tolerance_m = 20.0\n" in table


def test_every_value_says_what_it_rests_on() -> None:
    lines = integrity_table(measured(), parse_site(UBX_SITE, "site.toml"), "day.mcap").splitlines()
    noted = {line.partition(" =")[0] for before, line in pairwise(lines) if before.startswith("# ")}
    assert set(measured().values) - noted == {"sigma_range_low_m", "sigma_range_differential_low_m"}  # share the note of their pair


def test_correlation_times_are_lower_bounds() -> None:
    """Multipath of 20 to 60 s and white noise of the same size: from epoch to epoch below half of exp(-30 / 40)."""
    assert 10.0 <= measured().values["correlation_differential_s"] <= 30.0 / -np.log(0.5 * exp(-30.0 / 40.0))
