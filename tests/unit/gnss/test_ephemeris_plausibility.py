"""What cannot be an orbit and a clock is refused, whatever message it came from."""

from dataclasses import fields, replace
from typing import Any

import pytest

from integrity.gnss.gps_time import NS_PER_S, parse_utc
from recordings.simulate.constellation import constellation
from tests.rinex_examples import EVERY_KIND

TOE_NS = parse_utc("2026-03-02T04:00:00Z")
NUMBERS = [(kind, f.name) for kind, eph in EVERY_KIND.items() for f in fields(eph) if isinstance(getattr(eph, f.name), float)]


@pytest.mark.parametrize("kind", EVERY_KIND)
def test_every_example_is_plausible(kind: str) -> None:
    assert EVERY_KIND[kind].implausibility() is None


def test_every_simulated_set_is_plausible() -> None:
    sets = constellation(seed=1, start_ns=TOE_NS, end_ns=TOE_NS)
    assert [eph.implausibility() for eph in sets] == [None] * len(sets)


@pytest.mark.parametrize("value", [float("nan"), float("inf"), float("-inf")])
@pytest.mark.parametrize(("kind", "name"), NUMBERS)
def test_what_is_not_a_number_is_implausible(kind: str, name: str, value: float) -> None:
    change: dict[str, Any] = {name: value}
    assert replace(EVERY_KIND[kind], **change).implausibility() == "a parameter is not a number"


@pytest.mark.parametrize("value", [1e300, -1e300])
@pytest.mark.parametrize(("kind", "name"), NUMBERS)
def test_a_parameter_beyond_all_measure_is_implausible(kind: str, name: str, value: float) -> None:
    change: dict[str, Any] = {name: value}
    assert replace(EVERY_KIND[kind], **change).implausibility() is not None


# sqrt(A) of GPS is 5154 sqrt(m), of Galileo 5441, of geosynchronous orbits 6493; low ones have 2600.
@pytest.mark.parametrize(
    ("kind", "change", "why"),
    [
        ("GPS", {"sqrt_a": 2600.0}, "sqrt_a = "),
        ("GPS", {"sqrt_a": 6493.0}, "sqrt_a = "),
        ("GPS", {"sqrt_a": 0.0}, "sqrt_a = "),
        ("Galileo I/NAV", {"sqrt_a": 6493.0}, "sqrt_a = "),
        ("BeiDou GEO", {"sqrt_a": 2600.0}, "sqrt_a = "),
        ("GPS", {"e": 0.5}, "e = "),
        ("GPS", {"e": -0.01}, "e = "),
        ("GPS", {"af0": 0.2}, "af0 = "),
        ("GPS", {"group_delay_s": 2e-6}, "group_delay_s = "),
        ("BeiDou GEO", {"group_delay_2_s": 2e-6}, "group_delay_2_s = "),
        ("GPS", {"message": "INAV"}, "message INAV"),
        ("Galileo I/NAV", {"message": "D1"}, "message D1"),
        ("GPS", {"satellite": "G5"}, "satellite 'G5'"),
        ("GPS", {"satellite": "G33"}, "satellite 'G33'"),
        ("SBAS", {"satellite": "S05"}, "satellite 'S05'"),
        ("GLONASS", {"channel": 7}, "channel 7"),
        ("GLONASS", {"channel": -8}, "channel -8"),
        ("GLONASS", {"ax_mps2": 1.5e-5}, "ax_mps2 = "),
        ("GLONASS", {"x_m": 0.0}, "from the centre of the Earth"),
        ("SBAS", {"x_m": 0.0}, "from the centre of the Earth"),
        ("SBAS", {"af0": 3e-6}, "af0 = "),
    ],
)
def test_implausible_sets_are_refused(kind: str, change: dict[str, Any], why: str) -> None:
    assert why in (replace(EVERY_KIND[kind], **change).implausibility() or "")


def test_clock_and_orbit_of_different_weeks_are_implausible() -> None:
    gps: Any = EVERY_KIND["GPS"]
    assert "more than a day" in (replace(gps, toc_ns=gps.toe_ns + 604_800 * NS_PER_S).implausibility() or "")


@pytest.mark.parametrize("kind", EVERY_KIND)
def test_a_fit_interval_of_years_is_implausible(kind: str) -> None:
    assert replace(EVERY_KIND[kind], fit_half_s=1e10).implausibility() is not None
