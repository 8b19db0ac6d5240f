"""Clocks: receivers against their prediction, constellations against each other, GNSS time against the host's."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from integrity.config import HostClock
from integrity.events import Tick
from integrity.gnss.gps_time import NS_PER_S, gps_from_calendar, utc_from_gps
from integrity.gnss.observations import Floats
from integrity.gnss.signals import TIME_SCALES
from integrity.monitors.clocks import HALF_WIDTH_S, MILLISECOND_M, ClockMemory, ClockStatistics, advance, host_disagreement_s, remarks

NAN = float("nan")
RATES_MPS = np.array([-240.0, -425.0, 62.0])  # as three real receivers run
BIASES_M = np.array([0.0, 4.0, -3.0, 2.0, 8.0])
N_EPOCHS, AT = 12, 8
SIGMA_M = 0.4


def running(interval_s: float = 1.0) -> Floats:
    """Clocks (E, R, K) of three receivers that run evenly."""
    t_s = interval_s * np.arange(N_EPOCHS)
    clocks: Floats = t_s[:, None, None] * RATES_MPS[:, None] + BIASES_M
    return clocks


def shown(clock_m: Floats, interval_s: float = 1.0, late_s: float = 0.0) -> ClockStatistics:
    """What they show; from epoch `AT` on, time is `late_s` later."""
    epoch_ns = (1e9 * (interval_s * np.arange(N_EPOCHS) + late_s * (np.arange(N_EPOCHS) >= AT))).astype(np.int64)
    return advance(ClockMemory.empty(3), epoch_ns, clock_m, np.full((N_EPOCHS, len(TIME_SCALES)), SIGMA_M))[1]


def stepped(size_m: float, receivers: slice = slice(None), scales: slice = slice(None), interval_s: float = 1.0) -> ClockStatistics:
    clock_m = running(interval_s)
    clock_m[AT:, receivers, scales] += size_m
    return shown(clock_m, interval_s)


@pytest.mark.parametrize("interval_s", [0.1, 1.0, 30.0, 60.0])
def test_a_clock_that_runs_evenly_is_predicted(interval_s: float) -> None:
    assert np.abs(shown(running(interval_s), interval_s).innovation[2:]).max() < 1e-6


def test_two_epochs_make_a_prediction() -> None:
    assert np.isnan(shown(running()).innovation[:, 0]).tolist() == [True, True] + [False] * (N_EPOCHS - 2)


def test_beyond_a_minute_nothing_is_predicted() -> None:
    found = shown(running(), late_s=60.0)
    assert np.isnan(found.innovation[AT:, 0]).tolist() == [True, True, False, False]


def test_a_step_of_one_receiver_shows_there() -> None:
    assert stepped(50.0, receivers=slice(1, 2)).innovation_m[AT] == pytest.approx([0.0, 50.0, 0.0], abs=1e-6)


@pytest.mark.parametrize(
    ("interval_s", "sigma_m"), [(1.0, np.sqrt(6 * 0.4**2 + 2 * 0.2998**2)), (30.0, np.sqrt(6 * 0.4**2 + 2 * 8.994**2))]
)
def test_sigma_is_noise_and_the_flicker_of_a_crystal(interval_s: float, sigma_m: float) -> None:
    # Three clocks as 1, -2, 1: six times the variance. An Allan deviation of 1e-9 is 0.2998 m/s.
    assert stepped(50.0, interval_s=interval_s).innovation[AT, 0] == pytest.approx(50.0 / sigma_m, rel=1e-3)


@pytest.mark.parametrize("ms", [1.0, -1.0, 5.0])
def test_whole_milliseconds_are_counted(ms: float) -> None:
    assert stepped(ms * MILLISECOND_M, receivers=slice(0, 1)).jump_ms[AT].tolist() == [ms, 0.0, 0.0]


def test_whole_milliseconds_are_no_step() -> None:
    assert np.abs(stepped(5.0 * MILLISECOND_M).innovation[2:]).max() < 1e-5


def test_a_step_beside_whole_milliseconds_is_one() -> None:
    assert stepped(MILLISECOND_M + 50.0).innovation_m[AT] == pytest.approx([50.0] * 3, abs=1e-5)


def test_most_of_a_millisecond_is_a_step() -> None:
    assert stepped(0.6 * MILLISECOND_M).innovation_m[AT, 0] == pytest.approx(0.6 * MILLISECOND_M)


def test_a_clock_that_runs_on_over_a_gap_is_predicted() -> None:
    clock_m = running()
    clock_m[AT:] += 20.0 * RATES_MPS[:, None]
    assert np.abs(shown(clock_m, late_s=20.0).innovation[2:]).max() < 1e-6


@pytest.mark.parametrize(("receivers", "alike"), [(slice(0, 3), True), (slice(0, 2), False)])
def test_all_clocks_alike_are_gnss_time(receivers: slice, alike: bool) -> None:
    assert (stepped(50.0, receivers).all_alike[AT] > 6.0) == alike


def test_a_constellation_steps_against_the_others() -> None:
    found = stepped(12.0, scales=slice(1, 2))
    assert found.constellation_m[AT] == pytest.approx([NAN, 12.0, 0.0, 0.0, 0.0], abs=1e-6, nan_ok=True)


def test_sigma_of_a_constellation_is_of_four_clocks() -> None:
    assert stepped(12.0, scales=slice(1, 2)).constellation[AT, 1] == pytest.approx(12.0 / 0.8)


def test_a_constellation_that_steps_at_one_receiver_did_not() -> None:
    assert stepped(12.0, slice(0, 1), slice(1, 2)).constellation[AT, 1] == 0.0


def test_the_first_constellation_there_is_the_reference() -> None:
    clock_m = running()
    clock_m[..., 0] = NAN
    clock_m[AT:, :, 2] += 12.0
    assert shown(clock_m).constellation_m[AT] == pytest.approx([NAN, NAN, 12.0, 0.0, 0.0], abs=1e-6, nan_ok=True)


def test_without_gps_the_next_constellation_predicts() -> None:
    clock_m = running()
    clock_m[..., 0] = NAN
    assert np.abs(shown(clock_m).innovation[2:]).max() < 1e-6


def test_without_any_clock_nothing_is_predicted() -> None:
    assert np.isnan(shown(np.full((N_EPOCHS, 3, 5), NAN)).innovation).all()


@settings(max_examples=30, deadline=None)
@given(st.sets(st.integers(1, N_EPOCHS - 1)), st.sampled_from([-1.0, 12.0, MILLISECOND_M, NAN]))
def test_cutting_a_stream_changes_nothing(cuts: set[int], size_m: float) -> None:
    clock_m, sigma_m = running(), np.full((N_EPOCHS, 5), SIGMA_M)
    clock_m[AT:, 0, :2] += size_m
    epoch_ns, memory, parts = NS_PER_S * np.arange(1, N_EPOCHS + 1), ClockMemory.empty(3), []
    for begin, end in pairwise([0, *sorted(cuts), N_EPOCHS]):
        memory, part = advance(memory, epoch_ns[begin:end], clock_m[begin:end], sigma_m[begin:end])
        parts.append(part)
    whole = advance(ClockMemory.empty(3), epoch_ns, clock_m, sigma_m)[1]
    assert [np.concatenate(x).tobytes() for x in zip(*parts, strict=True)] == [x.tobytes() for x in whole]


def test_words_for_a_clock_that_was_set() -> None:
    assert remarks(stepped(-MILLISECOND_M, slice(1, 2)), AT, "ABC", 6.0) == ("B: its clock was set by -1 ms",)


def test_words_for_gnss_time_that_stepped() -> None:
    assert remarks(stepped(50.0), AT, "ABC", 6.0)[-1] == "the clocks of all receivers stepped alike, 46.8 sigma: GNSS time itself?"


def test_words_for_a_constellation() -> None:
    words = remarks(stepped(-12.0, scales=slice(1, 2)), AT, "ABC", 6.0)
    assert words == ("Galileo: its clock stepped by -12.0 m against the others, 15.0 sigma",)


def test_no_words_where_nothing_happened() -> None:
    assert remarks(shown(running()), AT, "ABC", 6.0) == ()


GPS_NS = gps_from_calendar(2026, 3, 2, 3, 0, 0)


def off_s(host_ahead_s: float, uncertainty_s: float | None = 0.01, late_s: tuple[float, ...] = (0.0, 0.0, 0.0), **more: int) -> float:
    """Disagreement of one epoch whose measurements have all come at a tick, but for those that are `late_s`."""
    utc_ns = utc_from_gps(more.get("gps_ns", GPS_NS)) + round(host_ahead_s * NS_PER_S)
    tick = Tick(5 * NS_PER_S, utc_ns, None if uncertainty_s is None else round(uncertainty_s * NS_PER_S))
    arrived_ns = np.array([[tick.mono_ns + more.get("after_ns", 0) + round(x * NS_PER_S) for x in late_s]])
    return float(host_disagreement_s(np.array([more.get("gps_ns", GPS_NS)]), arrived_ns, [tick], "ntp")[0])


@pytest.mark.parametrize(
    ("host_ahead_s", "sound"),
    [(0.05, True), (0.5, True), (2.9, True), (3.1, False), (-0.9, True), (-1.1, False), (900.0, False), (-180.0, False)],
    ids=["at once", "half a second", "as late as may be", "later", "a leap second", "from the future", "+15 min", "-3 min"],
)
def test_gnss_time_that_leaves_the_host(host_ahead_s: float, sound: bool) -> None:
    assert (off_s(host_ahead_s) <= HALF_WIDTH_S) == sound


def test_what_the_host_does_not_vouch_for_is_its_own() -> None:
    assert off_s(4.0, 1.5) == pytest.approx(3.0 - 1.5)


def test_the_host_clock_is_carried_to_the_arrival() -> None:
    assert off_s(0.0, after_ns=10 * NS_PER_S) == pytest.approx(10.0 - 1.0 - 0.01 - 10.0 * 5e-4)


def test_one_stream_that_is_late_is_not_time() -> None:
    assert off_s(0.1, late_s=(0.0, 0.0, 30.0)) <= HALF_WIDTH_S


def test_all_streams_that_are_late_may_be_time() -> None:
    assert off_s(0.1, late_s=(30.0, 30.0, 30.0)) > HALF_WIDTH_S


@pytest.mark.parametrize("second", [-1, 0, 1])
def test_a_leap_second_is_none(second: int) -> None:
    assert off_s(0.1, gps_ns=gps_from_calendar(2017, 1, 1, 0, 0, 17) + second * NS_PER_S) <= HALF_WIDTH_S


def test_nobody_vouches() -> None:
    assert np.isnan(off_s(0.1, None))


def test_a_tick_of_long_ago_says_nothing() -> None:
    assert np.isnan(off_s(0.1, after_ns=61 * NS_PER_S))


@pytest.mark.parametrize(("host_clock", "monitored"), [("none", False), ("gnss", False), ("ntp", True), ("ptp", True)])
def test_only_a_clock_of_its_own_judges(host_clock: HostClock, monitored: bool) -> None:
    tick = Tick(0, utc_from_gps(GPS_NS), 0)
    assert np.isfinite(host_disagreement_s(np.array([GPS_NS]), np.array([[0]]), [tick], host_clock)[0]) == monitored


def test_without_a_tick_nothing_is_said() -> None:
    assert np.isnan(host_disagreement_s(np.array([GPS_NS]), np.array([[0]]), [None], "ntp")[0])
