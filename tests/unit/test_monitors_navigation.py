"""Each set of a satellite against the one before it, and against its system's orbits."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, Literal

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from integrity.gnss.constants import SPEED_OF_LIGHT_MPS
from integrity.gnss.ephemeris.broadcast import GeoEphemeris, GlonassEphemeris, KeplerEphemeris
from integrity.gnss.ephemeris.states import Ephemerides, satellite_states
from integrity.gnss.gps_time import NS_PER_S
from integrity.monitors.navigation import NavigationStatistics, Table, advance, compared, off_nominal
from recordings.faults.orbits import displaced

Direction = Literal["along", "cross", "radial"]
HOUR_NS = 3600 * NS_PER_S
T_NS = 2400 * 7 * 24 * HOUR_NS + 50 * HOUR_NS
MOST_CHANGE, MOST_ORBIT = 5.5, 1.0
TRUE = KeplerEphemeris(
    satellite="G05",
    message="LNAV",
    issue=7,
    healthy=True,
    accuracy_m=2.4,
    transmission_ns=T_NS - HOUR_NS,
    toe_ns=T_NS,
    toc_ns=T_NS,
    fit_half_s=7200.0,
    sqrt_a=5153.7,
    e=0.01,
    i0=0.96,
    omega0=1.0,
    omega=0.4,
    m0=0.7,
    delta_n=4.5e-9,
    i_dot=0.0,
    omega_dot=-8e-9,
    cuc=0.0,
    cus=0.0,
    crc=200.0,
    crs=0.0,
    cic=0.0,
    cis=0.0,
    af0=1e-4,
    af1=0.0,
    af2=0.0,
    group_delay_s=0.0,
)
OVERHEAD = satellite_states([TRUE], np.array([[0]]), np.array([T_NS])).pos_ecef_m[:, 0, 0]
SITE = OVERHEAD / np.linalg.norm(OVERHEAD) * 6.37e6


def off(size_m: float, direction: Direction = "along", gps_ns: int = T_NS) -> KeplerEphemeris:
    """The true set, displaced at a time."""
    wrong = displaced(TRUE, size_m, direction, gps_ns)
    assert isinstance(wrong, KeplerEphemeris)
    return wrong


def after(eph: KeplerEphemeris, **changed: Any) -> KeplerEphemeris:
    """The set that replaces it, with another issue."""
    return replace(eph, **{"issue": eph.issue + 1, "transmission_ns": eph.transmission_ns + HOUR_NS} | changed)


def followed(sets: Sequence[KeplerEphemeris | None], table: Table | None = None, step_ns: int = NS_PER_S) -> NavigationStatistics:
    """G05 served by each of the sets in turn, one an epoch; None: by none. Every array is (E, 1)."""
    present = Ephemerides(dict.fromkeys(x for x in sets if x))
    index = np.array([[-1 if x is None else present.index(x)] for x in sets])
    return advance(table or {}, ["G05"], present, index, T_NS + step_ns * np.arange(len(sets)), SITE, MOST_CHANGE, MOST_ORBIT)[1]


def test_a_first_set_is_not_compared() -> None:
    assert np.isnan(followed([TRUE]).change).all()


def test_a_first_set_is_held_against_the_orbits_of_its_system() -> None:
    assert followed([TRUE]).orbit.item() == off_nominal(TRUE)


def test_a_set_that_is_only_sent_again_is_no_change() -> None:
    assert followed([TRUE, after(TRUE)]).change[:, 0] == pytest.approx([np.nan, 0.0], abs=1e-9, nan_ok=True)


@pytest.mark.parametrize("direction", ["along", "cross", "radial"])
@pytest.mark.parametrize("size_m", [100.0, -250.0, 700.0, 1000.0, 2500.0, 7000.0])
def test_a_wrong_orbit_shows_in_the_first_epoch_it_serves(size_m: float, direction: Direction) -> None:
    seen = followed([TRUE, after(off(size_m, direction, T_NS + NS_PER_S))])
    assert (seen.apart_m[1, 0] == pytest.approx(abs(size_m), rel=2e-3), seen.change[1, 0] > MOST_CHANGE) == (True, True)


def test_sigma_is_what_both_sets_promise() -> None:
    # At the change the same 100 m; two hours later the old set is two hours beyond what it is good for, where nothing is this far off.
    seen = followed([TRUE, after(off(100.0, gps_ns=T_NS + NS_PER_S), accuracy_m=4.8)])
    assert seen.change[1, 0] == pytest.approx(100.0 / np.hypot(2.4, 4.8), rel=0.05)


def test_a_clock_that_jumps_shows_in_the_range_alone() -> None:
    seen = followed([TRUE, after(TRUE, af0=TRUE.af0 + 30.0 / SPEED_OF_LIGHT_MPS)])
    assert (seen.range_m[1, 0], seen.apart_m[1, 0], seen.change[1, 0]) == pytest.approx((-30.0, 0.0, 30.0 / np.hypot(2.4, 2.4)), abs=1e-4)


def test_a_false_set_is_false_for_as_long_as_it_serves() -> None:
    wrong = after(off(100.0))
    assert (followed([TRUE, wrong, wrong, wrong]).change[1:, 0] > MOST_CHANGE).all()


def test_the_true_set_after_a_false_one_passes() -> None:
    assert followed([TRUE, after(off(100.0)), after(after(TRUE))]).change[2, 0] < 1e-6


def test_a_set_that_was_believed_is_the_next_reference() -> None:
    drifting = [TRUE, *(after(off(15.0 * k), issue=7 + k) for k in range(1, 6))]
    assert (followed(drifting).change[1:, 0] < MOST_CHANGE).all()


def test_a_reference_outlives_epochs_without_a_set() -> None:
    assert followed([TRUE, None, after(off(100.0))]).change[2, 0] > MOST_CHANGE


def test_a_reference_outlives_what_others_do_meanwhile() -> None:
    other = replace(TRUE, satellite="G06")
    sets = Ephemerides((TRUE, other, after(other), after(off(100.0))))
    index = np.array([[0, 1], [-1, 2], [3, 2]])
    seen = advance({}, ["G05", "G06"], sets, index, T_NS + NS_PER_S * np.arange(3), SITE, MOST_CHANGE, MOST_ORBIT)[1]
    assert seen.change[2, 0] > MOST_CHANGE


def test_an_equal_set_is_the_same_set() -> None:
    table, _ = advance({}, ["G05"], Ephemerides((TRUE,)), np.array([[0]]), np.array([T_NS]), SITE, MOST_CHANGE, MOST_ORBIT)
    again = advance(table, ["G05"], Ephemerides((replace(TRUE),)), np.array([[0]]), np.array([T_NS + 1]), SITE, MOST_CHANGE, MOST_ORBIT)
    assert again[0] is table


def test_a_reference_grows_uncertain_beyond_its_fit_interval() -> None:
    # Four hours beyond it: 160 m, beside the 2.4 m that both sets promise.
    new = after(TRUE, toe_ns=T_NS + 6 * HOUR_NS, m0=TRUE.m0 + 1.0)
    seen = followed([TRUE, new], step_ns=6 * HOUR_NS)
    assert seen.change[1, 0] == pytest.approx(seen.apart_m[1, 0] / np.sqrt(160.0**2 + 2 * 2.4**2), rel=1e-9)


def test_an_orbit_that_is_going_to_be_wrong() -> None:
    # 5e-9 rad/s for two hours are 950 m.
    seen = followed([TRUE, after(TRUE, delta_n=TRUE.delta_n + 5e-9)])
    assert (seen.apart_m[1, 0] < 1.0, seen.change[1, 0] > MOST_CHANGE) == (True, True)


def test_a_satellite_that_says_it_is_unhealthy_loses_its_reference() -> None:
    moved = after(off(7000.0))
    assert np.isnan(followed([TRUE, after(TRUE, healthy=False), moved]).change[2, 0])


@pytest.mark.parametrize(("beyond_ns", "compared_then"), [(0, True), (1, False)])
def test_a_reference_speaks_for_six_hours_beyond_its_fit_interval(beyond_ns: int, compared_then: bool) -> None:
    later_ns = 8 * HOUR_NS + beyond_ns
    seen = followed([TRUE, after(TRUE, toe_ns=T_NS + later_ns, toc_ns=T_NS + later_ns)], step_ns=later_ns)
    assert np.isfinite(seen.change[1, 0]) == compared_then


def test_other_contents_under_the_same_issue() -> None:
    one_bit = replace(TRUE, crs=TRUE.crs + 2.0**-5, transmission_ns=T_NS)
    assert 0.01 < followed([TRUE, one_bit]).reissued_m[1, 0] < 2.0**-5


def test_other_contents_under_the_same_issue_are_no_reference() -> None:
    one_bit = replace(TRUE, crs=TRUE.crs + 2.0**-5, transmission_ns=T_NS)
    assert followed([TRUE, one_bit, replace(one_bit, transmission_ns=T_NS + 1)]).reissued_m[2, 0] > 0.01


def test_an_issue_that_comes_round_is_another_one() -> None:
    assert followed([TRUE, replace(TRUE, toe_ns=T_NS + HOUR_NS)]).reissued_m[1, 0] == 0.0


def test_a_new_group_delay_is_no_other_content() -> None:
    assert followed([TRUE, replace(TRUE, group_delay_s=1e-9)]).reissued_m[1, 0] == 0.0


def test_a_first_set_off_every_orbit_is_no_reference() -> None:
    seen = followed([replace(TRUE, e=0.1), after(TRUE)])
    assert (seen.orbit[0, 0] > MOST_ORBIT, np.isnan(seen.change[1, 0])) == (True, True)


GLONASS = GlonassEphemeris(
    satellite="R01",
    channel=1,
    issue=1,
    healthy=True,
    accuracy_m=5.0,
    transmission_ns=T_NS,
    toe_ns=T_NS,
    fit_half_s=1200.0,
    x_m=7003008.7890625,
    y_m=-12206626.953125,
    z_m=21280765.625,
    vx_mps=783.542633,
    vy_mps=2804.2840957,
    vz_mps=1352.5150299,
    ax_mps2=0.0,
    ay_mps2=1.7e-6,
    az_mps2=-5.41e-6,
    tau_n_s=0.0,
    gamma_n=0.0,
    delta_tau_n_s=0.0,
)  # GLONASS ICD 5.1, example of appendix A.3.1.2 (km there)
SBAS = GeoEphemeris("S29", 0, True, 4.0, T_NS, T_NS, 360.0, 4.2164e7, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


@pytest.mark.parametrize(
    ("eph", "sound"),
    [
        (TRUE, True),
        (replace(TRUE, sqrt_a=np.sqrt(26_559.7e3 + 51e3)), False),
        (replace(TRUE, satellite="E11", message="INAV", sqrt_a=5440.6, e=1e-4, i0=0.98), True),
        (replace(TRUE, satellite="E11", message="INAV", sqrt_a=5441.6, e=1e-4, i0=0.98), False),
        (replace(TRUE, satellite="E18", message="INAV", sqrt_a=5289.4, e=0.16, i0=0.87), True),
        (replace(TRUE, satellite="C06", message="D1", sqrt_a=6493.4, e=0.005, i0=0.96), True),
        (replace(TRUE, satellite="C03", message="D2", sqrt_a=6493.4, e=0.0005, i0=0.1), True),
        (replace(TRUE, satellite="C21", message="D1", sqrt_a=5282.6, e=0.0005, i0=0.3), False),
        (replace(TRUE, satellite="J02", sqrt_a=6493.4, e=0.075, i0=0.72), True),
        (replace(TRUE, satellite="J07", sqrt_a=6493.4, e=0.0001, i0=0.001), True),
        (GLONASS, True),
        (replace(GLONASS, vz_mps=GLONASS.vz_mps + 100.0), False),
        (SBAS, True),
        (replace(SBAS, x_m=4.25e7), False),
    ],
)
def test_orbits_of_the_systems(eph: KeplerEphemeris, sound: bool) -> None:
    assert (off_nominal(eph) <= MOST_ORBIT) == sound


def test_a_fault_across_the_line_of_sight_is_a_quarter_of_a_metre_per_kilometre_at_five() -> None:
    # Section 2.3: 1 km of the satellite is 0.25 m per 5 km between station and train.
    wrong = replace(off(1000.0), issue=9)
    toward = satellite_states([TRUE, wrong], np.array([[0, 1]]), np.array([T_NS])).pos_ecef_m[:, 0]
    along = (toward[:, 1] - toward[:, 0]) / 1000.0
    here, there = (compared([TRUE], [wrong], T_NS, p).range_m[0] for p in (SITE, SITE + 5000.0 * along))
    assert abs(there - here) == pytest.approx(0.25, abs=0.01)


@settings(max_examples=50, deadline=None)
@given(st.lists(st.integers(-1, 5), min_size=2, max_size=30), st.integers(1, 29))
def test_cutting_a_stream_changes_nothing(served: list[int], cut: int) -> None:
    wrong = off(300.0, "cross")
    sets = Ephemerides((TRUE, after(TRUE), after(wrong), after(TRUE, healthy=False), replace(TRUE, crs=3.0), replace(TRUE, e=0.1)))
    index, epoch_ns = np.array(served)[:, None], T_NS + 1800 * NS_PER_S * np.arange(len(served))

    def run(table: Table, part: slice) -> tuple[Table, NavigationStatistics]:
        return advance(table, ["G05"], sets, index[part], epoch_ns[part], SITE, MOST_CHANGE, MOST_ORBIT)

    whole_table, whole = run({}, slice(None))
    between, first = run({}, slice(0, min(cut, len(served) - 1)))
    table, second = run(between, slice(min(cut, len(served) - 1), None))
    joined = [np.concatenate(parts).tobytes() for parts in zip(first, second, strict=True)]
    assert (repr(table), joined) == (repr(whole_table), [part.tobytes() for part in whole])
