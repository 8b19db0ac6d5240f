"""Which ephemeris serves, and that velocity, acceleration and clock drift belong to position and clock.

Positions themselves are compared with RTKLIB in the crosschecks.
"""

from dataclasses import fields, replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from integrity.gnss.ephemeris.broadcast import Ephemeris
from integrity.gnss.ephemeris.states import accuracy_m, satellite_states, usable
from integrity.gnss.ephemeris.store import EphemerisStore
from integrity.gnss.gps_time import NS_PER_S, parse_utc
from recordings.simulate.constellation import constellation

TOE_NS = parse_utc("2026-03-02T04:00:00Z")
EVERY = constellation(seed=1, start_ns=TOE_NS, end_ns=TOE_NS)
GPS = replace(next(eph for eph in EVERY if eph.satellite[0] == "G"), satellite="G05", toe_ns=TOE_NS, toc_ns=TOE_NS, transmission_ns=TOE_NS)
HOUR_NS = 3600 * NS_PER_S
FIT_NS = round(GPS.fit_half_s * NS_PER_S)
OLD, NEW = replace(GPS, issue=1, transmission_ns=TOE_NS - HOUR_NS), replace(GPS, issue=2)


def serving(store: EphemerisStore, t_ns: int = TOE_NS, arrived: int | None = None, satellite: str = "G05") -> Ephemeris | None:
    """The ephemeris chosen at one time, when `arrived` (by default all) had arrived."""
    count = len(store.ephemerides) if arrived is None else arrived
    index = int(store.choose((satellite,), np.array([t_ns]), np.array([count]))[0, 0])
    return None if index < 0 else store.ephemerides[index]


def test_the_latest_transmitted_serves() -> None:
    assert serving(EphemerisStore((OLD, NEW))) == NEW


def test_the_latest_transmitted_serves_though_it_arrived_first() -> None:
    assert serving(EphemerisStore((NEW, OLD))) == NEW


def test_the_latest_transmitted_serves_whatever_its_issue_and_reference_time() -> None:
    # Issues begin again, and a satellite may go back to an earlier reference time after an upload.
    before = replace(OLD, issue=9, toe_ns=TOE_NS + HOUR_NS)
    assert serving(EphemerisStore((NEW, before))) == NEW


def test_what_has_not_arrived_does_not_serve() -> None:
    assert serving(EphemerisStore((OLD, NEW)), arrived=1) == OLD


def test_nothing_serves_before_anything_arrived() -> None:
    assert serving(EphemerisStore((OLD, NEW)), arrived=0) is None


def test_a_satellite_without_ephemeris_has_none() -> None:
    assert serving(EphemerisStore((OLD, NEW)), satellite="G06") is None


@pytest.mark.parametrize("sign", [-1, 1])
def test_at_the_end_of_the_fit_interval_it_serves(sign: int) -> None:
    assert serving(EphemerisStore((GPS,)), TOE_NS + sign * FIT_NS) == GPS


@pytest.mark.parametrize("sign", [-1, 1])
def test_a_nanosecond_beyond_the_fit_interval_it_does_not(sign: int) -> None:
    assert serving(EphemerisStore((GPS,)), TOE_NS + sign * (FIT_NS + 1)) is None


def test_beyond_the_fit_interval_of_the_latest_an_older_one_serves() -> None:
    ahead = replace(NEW, toe_ns=TOE_NS + 2 * HOUR_NS)
    assert serving(EphemerisStore((OLD, ahead)), TOE_NS - 1) == OLD


def test_an_unhealthy_latest_is_not_replaced_by_an_older_healthy_one() -> None:
    unhealthy = replace(NEW, healthy=False)
    assert serving(EphemerisStore((OLD, unhealthy))) == unhealthy


def test_of_two_transmitted_together_the_later_reference_time_serves() -> None:
    later = replace(GPS, toe_ns=TOE_NS + HOUR_NS, issue=0)
    assert serving(EphemerisStore((later, GPS))) == later


def test_of_two_with_the_same_times_the_higher_issue_serves() -> None:
    assert serving(EphemerisStore((replace(GPS, issue=8), replace(GPS, issue=7)))) == replace(GPS, issue=8)


SETS = [
    replace(GPS, satellite=satellite, issue=issue, toe_ns=TOE_NS + toe_h * HOUR_NS, transmission_ns=TOE_NS + sent_h * HOUR_NS)
    for satellite in ("G05", "G06", "E05")
    for issue, (toe_h, sent_h) in enumerate([(0, -2), (2, 0), (2, 1), (4, 1)])
]


@given(st.permutations(SETS))
def test_order_of_arrival_changes_nothing(order: list[Ephemeris]) -> None:
    times = [TOE_NS + h * HOUR_NS for h in range(-3, 7)]
    chosen = [[serving(EphemerisStore(sets), t, satellite=s) for t in times for s in ("G05", "G06", "E05")] for sets in (SETS, order)]
    assert chosen[0] == chosen[1]


def test_the_same_again_changes_nothing() -> None:
    store = EphemerisStore((OLD, NEW, OLD))
    store.add(NEW)
    assert tuple(store.ephemerides) == (OLD, NEW)


@pytest.mark.parametrize(("after_fit_ns", "kept"), [(0, 1), (1, 0)])
def test_forgotten_is_only_what_no_later_epoch_can_use(after_fit_ns: int, kept: int) -> None:
    store = EphemerisStore((GPS,))
    store.forget_before(TOE_NS + FIT_NS + after_fit_ns)
    assert len(store.ephemerides) == kept


def test_what_was_forgotten_may_come_again() -> None:
    store = EphemerisStore((GPS,))
    store.forget_before(TOE_NS + FIT_NS + 1)
    store.add(GPS)
    assert tuple(store.ephemerides) == (GPS,)


NUMBERS = [f.name for f in fields(Ephemeris) if isinstance(getattr(GPS, f.name), float)]


@pytest.mark.parametrize("value", [float("nan"), float("inf"), float("-inf")])
@pytest.mark.parametrize("name", NUMBERS)
def test_what_is_not_a_number_is_implausible(name: str, value: float) -> None:
    change: dict[str, Any] = {name: value}
    assert replace(GPS, **change).implausibility() == "a parameter is not a number"


# sqrt(A) of GPS is 5154 sqrt(m), of Galileo 5441; low and geostationary orbits have 2600 and 6493.
@pytest.mark.parametrize(
    ("change", "why"),
    [
        ({"sqrt_a": 2600.0}, "sqrt_a = "),
        ({"sqrt_a": 6493.0}, "sqrt_a = "),
        ({"sqrt_a": 0.0}, "sqrt_a = "),
        ({"e": 0.5}, "e = "),
        ({"e": -0.01}, "e = "),
        ({"toc_ns": TOE_NS + 604_800 * NS_PER_S}, "more than a day"),
        ({"af0": 0.2}, "af0 = "),
        ({"group_delay_s": 2e-6}, "group_delay_s = "),
    ],
)
def test_implausible_sets_are_refused(change: dict[str, Any], why: str) -> None:
    assert why in (replace(GPS, **change).implausibility() or "")


@pytest.mark.parametrize(
    "name",
    ["crs", "crc", "cuc", "cus", "cic", "cis", "delta_n", "i_dot", "omega_dot", "af1", "af2", "accuracy_m"],
)
def test_a_parameter_beyond_its_field_is_implausible(name: str) -> None:
    change: dict[str, Any] = {name: 1e300}
    assert replace(GPS, **change).implausibility() is not None


@pytest.mark.parametrize("fit_half_s", [1e10, 1e300])
def test_a_fit_interval_of_years_is_implausible(fit_half_s: float) -> None:
    assert replace(GPS, fit_half_s=fit_half_s).implausibility() is not None


@pytest.mark.parametrize("toe_ns", [-(2**63), 2**63 - 1])
def test_a_reference_time_at_the_end_of_all_numbers_never_serves(toe_ns: int) -> None:
    assert serving(EphemerisStore((replace(GPS, toe_ns=toe_ns, toc_ns=toe_ns),))) is None


def test_every_simulated_set_is_plausible() -> None:
    assert [eph.implausibility() for eph in EVERY] == [None] * len(EVERY)


@pytest.mark.parametrize(
    ("change", "expected"),
    [({}, True), ({"healthy": False}, False), ({"accuracy_m": None}, False)],
    ids=["healthy", "unhealthy", "unpromised"],
)
def test_usable(change: dict[str, Any], expected: bool) -> None:
    assert usable((replace(GPS, **change),), np.array([[0]])).tolist() == [[expected]]


def test_no_ephemeris_is_not_usable() -> None:
    assert usable((GPS,), np.array([[-1, 0]])).tolist() == [[False, True]]


def test_accuracy_is_absent_where_nothing_is_promised() -> None:
    sets = (GPS, replace(GPS, accuracy_m=None))
    assert accuracy_m(sets, np.array([[0, 1, -1]])) == pytest.approx(np.array([[GPS.accuracy_m, np.nan, np.nan]]), nan_ok=True)


INDEX = np.arange(len(EVERY))[None].repeat(3, axis=0)


def around(step_ns: int) -> np.ndarray[tuple[int], np.dtype[np.int64]]:
    """An hour after the reference time: a step before, at it, a step after."""
    return np.array([TOE_NS + HOUR_NS - step_ns, TOE_NS + HOUR_NS, TOE_NS + HOUR_NS + step_ns])


def test_velocity_is_the_derivative_of_position() -> None:
    states = satellite_states(EVERY, INDEX, around(NS_PER_S))
    difference_mps = (states.pos_ecef_m[:, 2] - states.pos_ecef_m[:, 0]) / 2.0
    # Third derivative over six: below 2e-5 m/s.
    assert states.vel_ecef_mps[:, 1] == pytest.approx(difference_mps, abs=1e-4)


def test_acceleration_is_the_derivative_of_velocity() -> None:
    states = satellite_states(EVERY, INDEX, around(NS_PER_S))
    difference_mps2 = (states.vel_ecef_mps[:, 2] - states.vel_ecef_mps[:, 0]) / 2.0
    # Point mass: promised to 1e-4 m/s2.
    assert states.acc_ecef_mps2[:, 1] == pytest.approx(difference_mps2, abs=1e-4)


def test_clock_drift_is_the_derivative_of_the_clock() -> None:
    states = satellite_states(EVERY, INDEX, around(100 * NS_PER_S))
    difference = (states.clock_s[2] - states.clock_s[0]) / 200.0
    # Relativity swings with the orbit: third derivative times 100^2 / 6 below 1e-15.
    assert states.clock_drift_sps[1] == pytest.approx(difference, abs=2e-15)


def test_group_delay_is_taken_from_the_clock() -> None:
    sets = (GPS, replace(GPS, group_delay_s=GPS.group_delay_s + 1e-8))
    clock_s = satellite_states(sets, np.array([[0, 1]]), np.array([TOE_NS])).clock_s[0]
    assert clock_s[0] - clock_s[1] == pytest.approx(1e-8, abs=1e-15)


def test_no_ephemeris_gives_no_position() -> None:
    states = satellite_states((GPS,), np.array([[-1]]), np.array([TOE_NS]))
    assert np.isnan(states.pos_ecef_m).all()


def test_without_any_ephemeris_there_are_no_positions() -> None:
    states = satellite_states((), np.array([[-1, -1]]), np.array([TOE_NS]))
    assert np.isnan(states.pos_ecef_m).all()


@pytest.mark.parametrize("t_ns", [TOE_NS, TOE_NS + FIT_NS])
def test_a_block_gives_the_same_as_single_epochs(t_ns: int) -> None:
    times = np.array([TOE_NS - FIT_NS, t_ns, t_ns + 1])
    together = satellite_states(EVERY, INDEX, times).pos_ecef_m[:, 1]
    alone = satellite_states(EVERY, INDEX[:1], times[1:2]).pos_ecef_m[:, 0]
    # Seconds are counted from the block's first epoch: rounding of the time is below 1e-12 s.
    assert together == pytest.approx(alone, abs=1e-6)
