"""The clocks of this machine."""

import time

import pytest

from integrity.config import HostClock
from recordings.sources.host_clock import mono_now_ns, tick


def test_a_tick_has_the_time_of_its_moment() -> None:
    now_ns = mono_now_ns() - 500_000_000
    assert tick("none", now_ns).utc_ns == pytest.approx(time.time_ns() - 500_000_000, abs=50_000_000)


def test_nobody_vouches_for_an_undisciplined_clock() -> None:
    assert tick("none", mono_now_ns()).utc_uncertainty_ns is None


@pytest.mark.parametrize("host_clock", ["ntp", "ptp", "gnss"])
def test_the_kernel_vouches_for_a_disciplined_one_or_says_that_it_is_none(host_clock: HostClock) -> None:
    uncertainty_ns = tick(host_clock, mono_now_ns()).utc_uncertainty_ns
    assert uncertainty_ns is None or 0 <= uncertainty_ns < 20_000_000_000
