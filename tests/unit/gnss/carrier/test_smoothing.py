"""Smoothing on made-up ranges and phases: its noise, its lag, and when it begins anew."""

from dataclasses import replace

import numpy as np
import pytest

from integrity.gnss.carrier.slips import CarrierMemory, find_slips
from integrity.gnss.carrier.smoothing import Smoothed, SmoothingMemory, divergence_free_m, smooth
from integrity.gnss.observations import Floats, ObservationBlock
from tests.unit.gnss.carrier.phases import CODE_SIGMA_M, LIMITS, WAVELENGTH_M, edited, phases, slipped, wavelengths

WINDOW_S = 100.0
PARTNER = np.arange(len(WAVELENGTH_M)) ^ 1
EPOCHS = 400


def smoothed(block: ObservationBlock, carrier_m: Floats | None = None) -> Smoothed:
    n = len(block.receivers)
    arcs, _ = find_slips(block, wavelengths(block), CarrierMemory.empty(n), LIMITS)
    phase_m = wavelengths(block)[:, None] * block.carrier_cycles if carrier_m is None else carrier_m
    sigma_m = np.array([[[CODE_SIGMA_M]]])
    return smooth(block, phase_m, arcs, sigma_m, 0.003, WINDOW_S, SmoothingMemory.empty(n))[0]


def truth_m(ionosphere_mps: float = 0.0) -> Floats:
    """The ranges of `phases` without noise."""
    return phases(EPOCHS, ionosphere_mps=ionosphere_mps, noise=0.0).pseudorange_m


def test_the_first_range_of_an_arc_is_the_measured_one() -> None:
    block = phases(EPOCHS)
    np.testing.assert_array_equal(smoothed(block).range_m[0], block.pseudorange_m[0])


def test_until_the_window_is_full_a_range_is_the_mean_of_all() -> None:
    """Of ranges carried to the last epoch by the phase."""
    block = phases(50)
    phase_m = wavelengths(block)[:, None] * block.carrier_cycles
    carried_m = (block.pseudorange_m - phase_m).mean(axis=0) + phase_m[-1]
    np.testing.assert_allclose(smoothed(block).range_m[-1], carried_m, atol=1e-6)


def test_noise_falls_as_the_variance_says() -> None:
    """Of 2,000 arcs of 50 ranges: the error's spread at the end is that of a mean of 50, 0.07 m, to 5 %."""
    errors = [(smoothed(phases(50, seed=s)).range_m - phases(50, seed=s, noise=0.0).pseudorange_m)[-1] for s in range(200)]
    block = phases(50)
    assert np.std(errors) == pytest.approx(float(smoothed(block).sigma_m[-1, 0, 0]), rel=0.05)


def test_with_a_full_window_the_variance_is_that_of_a_steady_filter() -> None:
    """a / (2 - a) of the range's, a = 1 / 100; the phase's two thousandths come on top."""
    steady_m = np.sqrt(CODE_SIGMA_M**2 * 0.01 / 1.99 + 2.0 * 0.003**2)
    assert smoothed(phases(1500)).sigma_m[-1, 0, 0] == pytest.approx(steady_m, rel=1e-4)


def test_a_changing_ionosphere_makes_single_frequency_ranges_lag_by_its_bound() -> None:
    """2 mm/s for 400 s: twice the change in the mean age of 98 s, 0.39 m, on L1."""
    block = phases(EPOCHS, ionosphere_mps=0.002, noise=0.0)
    found = smoothed(block)
    lag_m = (found.range_m - truth_m(0.002))[-1, 0, 0::2]
    np.testing.assert_allclose(-lag_m, found.drift_bound_m(0.002)[-1, 0, 0::2], rtol=1e-6)


def test_the_mean_age_with_a_full_window_is_the_window_less_a_step() -> None:
    assert smoothed(phases(1500)).age_s[-1, 0, 0] == pytest.approx(WINDOW_S - 1.0, abs=1e-3)


def test_with_two_frequencies_nothing_lags() -> None:
    block = phases(EPOCHS, ionosphere_mps=0.002, noise=0.0)
    found = smoothed(block, divergence_free_m(block, wavelengths(block), PARTNER))
    np.testing.assert_allclose(found.range_m, truth_m(0.002), atol=1e-6)


def test_a_slip_begins_anew() -> None:
    block = slipped(phases(EPOCHS), 200, 2, 5.0)
    assert smoothed(block).range_m[200, 0, 2] == block.pseudorange_m[200, 0, 2]


def test_without_begin_anew_the_slip_would_stay_in_the_range() -> None:
    """What the last test is worth: a slip of 100 cycles that is said to be none moves the range by 19 m."""
    block = slipped(phases(EPOCHS), 200, 2, 100.0)
    arcs, _ = find_slips(block, wavelengths(block), CarrierMemory.empty(1), LIMITS)
    blind = replace(arcs, slip=np.where(np.arange(EPOCHS)[:, None, None] > 0, 0, arcs.slip))
    phase_m = wavelengths(block)[:, None] * block.carrier_cycles
    found, _ = smooth(block, phase_m, blind, np.array([[[0.5]]]), 0.003, WINDOW_S, SmoothingMemory.empty(1))
    assert (found.range_m - truth_m())[200, 0, 2] > 18.0


def test_a_slip_while_no_range_is_measured_is_remembered() -> None:
    block = edited(slipped(phases(EPOCHS), 200, 2, 5.0), "pseudorange_m", (slice(198, 203), 0, 2), np.nan)
    assert smoothed(block).range_m[203, 0, 2] == block.pseudorange_m[203, 0, 2]


def test_a_phase_without_range_carries_the_filter_on() -> None:
    """Two ranges missing in a full window move the next result by less than their share."""
    whole, holed = phases(EPOCHS), edited(phases(EPOCHS), "pseudorange_m", (slice(300, 302), 0, 2), np.nan)
    assert abs(smoothed(whole).range_m[302, 0, 2] - smoothed(holed).range_m[302, 0, 2]) < 4.0 * 2.0 * 0.01 * CODE_SIGMA_M


@pytest.mark.parametrize("name", ["pseudorange_m", "carrier_cycles"])
def test_without_range_or_phase_there_is_no_smoothed_range(name: str) -> None:
    block = edited(phases(EPOCHS), name, (300, 0, 2), np.nan)
    assert np.isnan(smoothed(block).range_m[300, 0, 2])
