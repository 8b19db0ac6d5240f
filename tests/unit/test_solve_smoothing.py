"""Smoothing of a recording on made-up phases: what it gains, when it begins anew, and what it says of what is left."""

from dataclasses import replace

import numpy as np
import pytest

from integrity.gnss.observations import Floats, ObservationBlock
from integrity.gnss.range_errors import Quality
from recordings.solve.smoothing import Smoother
from tests.unit.gnss.carrier.phases import CODE_SIGMA_M, SIGNALS, edited, phases, slipped

WINDOW_S = 100.0
EPOCHS = 300
CLOCK_JUMP_M = 299_792.458  # a millisecond


def smoothed(block: ObservationBlock, pairs: bool = False) -> tuple[ObservationBlock, Quality]:
    return Smoother(WINDOW_S, pairs, ()).smoothed(block)


def truth_m(pairs: bool = False, ionosphere_mps: float = 0.0) -> Floats:
    """The ranges of `phases` without noise, of the signals that come out."""
    block = phases(EPOCHS, ionosphere_mps=ionosphere_mps, noise=0.0)
    return smoothed(edited(block, "carrier_cycles", ..., np.nan), pairs)[0].pseudorange_m


@pytest.mark.parametrize(("pairs", "names"), [(False, ("G01.1C", "G02.1C")), (True, ("G01.1C+2W", "G02.1C+2W"))])
def test_first_signals_or_pairs_come_out(pairs: bool, names: tuple[str, str]) -> None:
    assert smoothed(phases(2), pairs)[0].signals[:2] == names


@pytest.mark.parametrize("pairs", [False, True])
def test_noise_falls(pairs: bool) -> None:
    """To sqrt(1 / 199) of it with a full window of white noise; of five satellites, as good as one: a quarter."""
    raw = CODE_SIGMA_M * (2.98 if pairs else 1.0)
    assert np.abs(smoothed(phases(EPOCHS), pairs)[0].pseudorange_m - truth_m(pairs))[-50:].max() < 0.25 * raw


def test_a_pair_does_not_drift_with_the_ionosphere() -> None:
    found = smoothed(phases(EPOCHS, ionosphere_mps=0.02, noise=0.0), pairs=True)[0]
    np.testing.assert_allclose(found.pseudorange_m, truth_m(True, 0.02), atol=1e-6)


def test_one_frequency_does_and_says_by_how_much() -> None:
    """Twice 1 mm/s over the mean age of the ranges in it, a hundred seconds in the end."""
    block, quality = smoothed(phases(EPOCHS, ionosphere_mps=0.001, noise=0.0))
    off_m = np.abs(block.pseudorange_m - truth_m(False, 0.001))
    np.testing.assert_allclose(quality.drift_m, off_m, atol=1e-6)


@pytest.mark.parametrize("pairs", [False, True])
def test_a_clock_that_jumps_in_the_code_alone_begins_anew(pairs: bool) -> None:
    before = phases(EPOCHS, noise=0.0)
    jump_m = np.where(np.arange(EPOCHS) >= 200, CLOCK_JUMP_M, 0.0)[:, None, None]
    after = smoothed(replace(before, pseudorange_m=before.pseudorange_m + jump_m), pairs)[0]
    np.testing.assert_allclose(after.pseudorange_m, truth_m(pairs) + jump_m, atol=1e-6)


@pytest.mark.parametrize("column", [0, 1])
def test_a_slip_of_either_frequency_begins_a_pair_anew(column: int) -> None:
    quality = smoothed(slipped(phases(EPOCHS), 200, column, 1.0), pairs=True)[1]
    assert quality.noise_share[200, 0, 0] == 1.0


def test_a_slip_of_the_second_frequency_is_none_of_the_first_but_cannot_be_told_from_it() -> None:
    quality = smoothed(slipped(phases(EPOCHS), 200, 1, 1.0))[1]
    assert quality.noise_share[200, 0, 0] == 1.0
    assert quality.noise_share[200, 0, 1] < 1.0


def test_a_range_without_a_phase_is_as_it_was_measured() -> None:
    block = edited(phases(EPOCHS), "carrier_cycles", (150, 0, 0), np.nan)
    after, quality = smoothed(block)
    assert (after.pseudorange_m[150, 0, 0], quality.noise_share[150, 0, 0]) == (block.pseudorange_m[150, 0, 0], 1.0)


def test_time_that_goes_back_begins_anew() -> None:
    smoother = Smoother(WINDOW_S, False, ())
    block = phases(20)
    smoother.smoothed(block)
    assert (smoother.smoothed(block)[1].noise_share[0] == 1.0).all()


@pytest.mark.parametrize(("gone", "share"), [((), 1.0), (("doppler_hz", "lock_s"), 1.0), (("doppler_hz", "lock_s", "second"), 0.0)])
def test_carriers_are_counted_that_something_checks(gone: tuple[str, ...], share: float) -> None:
    block = phases(20)
    for name in gone:
        second = (..., [k for k, signal in enumerate(SIGNALS) if signal.endswith("2W")])
        block = edited(block, "carrier_cycles", second, np.nan) if name == "second" else edited(block, name, ..., np.nan)
    smoother = Smoother(WINDOW_S, False, ())
    smoother.smoothed(block)
    assert smoother.watched.checkable == share * smoother.watched.phases
