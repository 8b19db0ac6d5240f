"""Satellite states of every kind of set: derivatives, ends of the fit interval, published examples.

Positions and clocks themselves are compared with RTKLIB in the crosschecks.
"""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from integrity.gnss.ephemeris.broadcast import Ephemeris, GlonassEphemeris, KeplerEphemeris
from integrity.gnss.ephemeris.states import accuracy_m, satellite_states, usable
from integrity.gnss.gps_time import NS_PER_S, parse_utc
from integrity.gnss.observations import Floats, Ints
from recordings.simulate.constellation import constellation
from tests.rinex_examples import EVERY_KIND, GPS_HEAD, kepler
from tests.rinex_examples import GPS as GPS_ROWS

TOE_NS = parse_utc("2026-03-02T04:00:00Z")


def at_toe(eph: Ephemeris) -> Ephemeris:
    """The same set with other reference times."""
    return replace(eph, toe_ns=TOE_NS, toc_ns=TOE_NS) if isinstance(eph, KeplerEphemeris) else replace(eph, toe_ns=TOE_NS)


HOUR_NS = 3600 * NS_PER_S
GPS = replace(kepler(GPS_HEAD, GPS_ROWS), toe_ns=TOE_NS, toc_ns=TOE_NS)
FIT_NS = round(GPS.fit_half_s * NS_PER_S)
SIMULATED = constellation(seed=1, start_ns=TOE_NS, end_ns=TOE_NS)
SETS = (*(at_toe(eph) for eph in EVERY_KIND.values()), *SIMULATED)
INDEX = np.arange(len(SETS))[None].repeat(3, axis=0)
SHARES = (-1.0, -0.37, 0.0, 0.61, 1.0)  # of half the fit interval


def around(offset_ns: int, step_ns: int) -> Ints:
    """A step before a time, at it, a step after."""
    return np.array([TOE_NS + offset_ns - step_ns, TOE_NS + offset_ns, TOE_NS + offset_ns + step_ns])


@pytest.mark.parametrize("share", SHARES)
def test_velocity_is_the_derivative_of_position(share: float) -> None:
    for k, eph in enumerate(SETS):
        states = satellite_states(SETS, INDEX[:, k : k + 1], around(round(share * eph.fit_half_s * NS_PER_S), NS_PER_S))
        difference_mps = (states.pos_ecef_m[:, 2] - states.pos_ecef_m[:, 0]) / 2.0
        # Third derivative over six: below 2e-5 m/s.
        assert states.vel_ecef_mps[:, 1] == pytest.approx(difference_mps, abs=1e-4), eph.satellite


@pytest.mark.parametrize("share", SHARES)
def test_acceleration_is_the_derivative_of_velocity(share: float) -> None:
    for k, eph in enumerate(SETS):
        states = satellite_states(SETS, INDEX[:, k : k + 1], around(round(share * eph.fit_half_s * NS_PER_S), NS_PER_S))
        difference_mps2 = (states.vel_ecef_mps[:, 2] - states.vel_ecef_mps[:, 0]) / 2.0
        # From arc to arc velocities jump by 1e-6 m/s.
        assert states.acc_ecef_mps2[:, 1] == pytest.approx(difference_mps2, abs=2e-6), eph.satellite


def test_clock_drift_is_the_derivative_of_the_clock() -> None:
    states = satellite_states(SETS, INDEX, around(300 * NS_PER_S, 100 * NS_PER_S))
    difference = (states.clock_s[2] - states.clock_s[0]) / 200.0
    # Relativity swings with the orbit: third derivative times 100^2 / 6 below 1e-15; of QZSS, whose orbit is flatter, below 4e-15.
    assert states.clock_drift_sps[1] == pytest.approx(difference, abs=4e-15)


def test_group_delay_is_taken_from_the_clock() -> None:
    sets = (GPS, replace(GPS, group_delay_s=GPS.group_delay_s + 1e-8))
    clock_s = satellite_states(sets, np.array([[0, 1]]), np.array([TOE_NS])).clock_s[0]
    assert clock_s[0] - clock_s[1] == pytest.approx(1e-8, abs=1e-15)


def test_state_vectors_stand_at_their_reference_time() -> None:
    for kind in ("GLONASS", "SBAS"):
        eph: Any = EVERY_KIND[kind]
        states = satellite_states((eph,), np.array([[0]]), np.array([eph.toe_ns]))
        assert states.pos_ecef_m[:, 0, 0].tolist() == [eph.x_m, eph.y_m, eph.z_m]


def test_sbas_moves_on_a_parabola() -> None:
    eph: Any = EVERY_KIND["SBAS"]
    states = satellite_states((eph,), np.array([[0]]), np.array([eph.toe_ns + 100 * NS_PER_S]))
    expected = (eph.x_m + 100.0 * eph.vx_mps + 5000.0 * eph.ax_mps2, eph.y_m + 100.0 * eph.vy_mps + 5000.0 * eph.ay_mps2)
    assert states.pos_ecef_m[:2, 0, 0] == pytest.approx(expected, abs=1e-8)
    assert states.clock_s[0, 0] == pytest.approx(eph.af0 + 100.0 * eph.af1, abs=1e-20)


def published(position_m: tuple[float, float, float], velocity_mps: tuple[float, float, float], after_s: int) -> Floats:
    """Position and velocity (6,) from those of a published example, which gives no luni-solar acceleration."""
    orbit = dict(zip(("x_m", "y_m", "z_m", "vx_mps", "vy_mps", "vz_mps"), (*position_m, *velocity_mps), strict=True))
    still = dict.fromkeys(("ax_mps2", "ay_mps2", "az_mps2"), 0.0)
    change: dict[str, Any] = orbit | still
    eph = replace(EVERY_KIND["GLONASS"], **change)
    states = satellite_states((eph,), np.array([[0]]), np.array([eph.toe_ns + after_s * NS_PER_S]))
    return np.concatenate((states.pos_ecef_m[:, 0, 0], states.vel_ecef_mps[:, 0, 0]))


def test_example_of_the_glonass_cdma_document() -> None:
    """GLONASS ICD, CDMA, general description 1.0, J.2.2: 600 s from t_b. Its velocities have steps of 0.1 mm/s: 30 mm after that time."""
    state = published((7_003_008.789, -12_206_626.953, 21_280_765.625), (783.5417, 2_804.2530, 1_352.5150), 600)
    assert state[:3] == pytest.approx((7_523_174.853, -10_506_962.176, 21_999_239.866), abs=0.03)
    assert state[3:] == pytest.approx((950.12609, 2_855.68710, 1_040.68137), abs=5e-5)


def test_example_of_the_glonass_interface_document() -> None:
    """GLONASS ICD 5.1, appendix 3.1: 900 s from t_b. It reckons with luni-solar accelerations that it does not print: they are below
    6.2e-6 m/s2 (table 4.5). Nor does its third velocity belong to its orbit: it is 137 m/s off, and left out here."""
    state = published((-14_081_752.701, 18_358_958.252, 10_861_302.124), (-1_025.76358, 1_086.72147, -3_157.32343), 900)
    assert state[:3] == pytest.approx((-14_836_563.872, 19_249_935.476, 7_924_017.196), abs=0.5 * 6.2e-6 * 900.0**2)
    assert state[3:5] == pytest.approx((-653.97782, 882.62958), abs=6.2e-6 * 900.0)


@pytest.mark.parametrize("minutes", [-19, -1, 0, 1, 19])
def test_glonass_does_not_jump_from_node_to_node(minutes: int) -> None:
    eph = EVERY_KIND["GLONASS"]
    between_ns = eph.toe_ns + (minutes * 60 + 30) * NS_PER_S
    states = satellite_states((eph,), np.array([[0], [0]]), np.array([between_ns - 1, between_ns + 1]))
    moved_m = states.vel_ecef_mps[:, 0, 0] * 2e-9
    assert states.pos_ecef_m[:, 1, 0] - states.pos_ecef_m[:, 0, 0] == pytest.approx(moved_m, abs=5e-5)


@pytest.mark.parametrize("others", [0, 3])
def test_glonass_is_the_same_in_any_company(others: int) -> None:
    eph = EVERY_KIND["GLONASS"]
    assert isinstance(eph, GlonassEphemeris)
    company = (*(replace(eph, satellite=f"R{k + 3:02d}", fit_half_s=3600.0, x_m=eph.x_m + k) for k in range(others)), eph)
    t_ns = np.array([eph.toe_ns + 777 * NS_PER_S])
    alone = satellite_states((eph,), np.array([[0]]), t_ns).pos_ecef_m[:, 0, 0]
    assert satellite_states(company, np.arange(others + 1)[None], t_ns).pos_ecef_m[:, 0, others].tolist() == alone.tolist()


def test_no_ephemeris_gives_no_position() -> None:
    states = satellite_states(SETS, np.full((1, 2), -1), np.array([TOE_NS]))
    assert np.isnan(states.pos_ecef_m).all()


def test_without_any_ephemeris_there_are_no_positions() -> None:
    states = satellite_states((), np.array([[-1, -1]]), np.array([TOE_NS]))
    assert np.isnan(states.pos_ecef_m).all()


@pytest.mark.parametrize("t_ns", [TOE_NS, TOE_NS + FIT_NS])
def test_a_block_gives_the_same_as_single_epochs(t_ns: int) -> None:
    times = np.array([TOE_NS - FIT_NS, t_ns, t_ns + 1])
    together = satellite_states(SETS, INDEX, times).pos_ecef_m[:, 1]
    alone = satellite_states(SETS, INDEX[:1], times[1:2]).pos_ecef_m[:, 0]
    assert together.tolist() == alone.tolist()


@pytest.mark.parametrize(
    ("change", "expected"),
    [({}, True), ({"healthy": False}, False), ({"accuracy_m": None}, False)],
    ids=["healthy", "unhealthy", "unpromised"],
)
@pytest.mark.parametrize("kind", EVERY_KIND)
def test_usable(kind: str, change: dict[str, Any], expected: bool) -> None:
    assert usable((replace(EVERY_KIND[kind], **change),), np.array([[0]])).tolist() == [[expected]]


def test_no_ephemeris_is_not_usable() -> None:
    assert usable((GPS,), np.array([[-1, 0]])).tolist() == [[False, True]]


def test_accuracy_is_absent_where_nothing_is_promised() -> None:
    sets = (GPS, replace(GPS, accuracy_m=None))
    assert accuracy_m(sets, np.array([[0, 1, -1]])) == pytest.approx(np.array([[GPS.accuracy_m, np.nan, np.nan]]), nan_ok=True)
