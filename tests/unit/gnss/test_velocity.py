"""Velocities from Doppler that this file makes, by differences of pseudoranges of a moving receiver with a bad clock.

The pseudoranges come from their definition: the light-time equation solved in an inertial frame, two clocks read. Nothing of the model
under test is in them.
"""

from typing import NamedTuple

import numpy as np
import pytest

from integrity.gnss.constants import EARTH_ROTATION_RADPS, SPEED_OF_LIGHT_MPS
from integrity.gnss.ephemeris.states import SatelliteStates, satellite_states
from integrity.gnss.ephemeris.store import EphemerisStore
from integrity.gnss.frames import ecef_from_geodetic
from integrity.gnss.gps_time import NS_PER_S, parse_utc
from integrity.gnss.least_squares import Unsolved
from integrity.gnss.observations import Floats, ObservationBlock
from integrity.gnss.positioning import Expected, expected, points_at, state_time_ns
from integrity.gnss.velocity import Velocities, rates_mps, velocities, wavelengths_m
from recordings.simulate.constellation import constellation

EPOCH_NS = parse_utc("2026-03-02T03:00:00Z")
SETS = constellation(seed=1, start_ns=EPOCH_NS, end_ns=EPOCH_NS)
SATELLITES = tuple(sorted(eph.satellite for eph in SETS))
SIGNALS = tuple(f"{s}.1C" for s in SATELLITES)
START_ECEF_M = ecef_from_geodetic(np.deg2rad(35.7), np.deg2rad(139.0), 100.0)
HALF_STEP_S = 0.1  # the range's third derivative, 1e-4 m/s3, makes 2e-7 m/s of it
CLOCK_M = 3e4  # 0.1 ms
L1_M = SPEED_OF_LIGHT_MPS / 1_575.42e6


class Drive(NamedTuple):
    block: ObservationBlock
    sight: Expected


def satellites() -> SatelliteStates:
    epoch_ns = np.array([EPOCH_NS])
    index = EphemerisStore(SETS).choose(SATELLITES, epoch_ns, np.array([len(SETS)]))
    return satellite_states(SETS, index, state_time_ns(epoch_ns), SIGNALS)


def reading(states: SatelliteStates, t_s: float, v_ecef_mps: Floats, drift: float) -> tuple[Floats, float]:
    """Pseudoranges (S,) of a receiver at a true time, seconds after the epoch, and its clock's reading."""
    clock_s = t_s + CLOCK_M / SPEED_OF_LIGHT_MPS + drift * t_s
    receiver = START_ECEF_M + v_ecef_mps * t_s
    flight_s = np.full(len(SATELLITES), 0.0775)
    for _ in range(6):
        dt = t_s - flight_s + 0.0775  # from the time of the states
        x, y, z = (states.pos_ecef_m + dt * (states.vel_ecef_mps + 0.5 * dt * states.acc_ecef_mps2))[:, 0]
        turn = EARTH_ROTATION_RADPS * flight_s
        there = np.array((x * np.cos(turn) + y * np.sin(turn), y * np.cos(turn) - x * np.sin(turn), z))
        flight_s = np.linalg.norm(there - receiver[:, None], axis=0) / SPEED_OF_LIGHT_MPS
    sent_s = t_s - flight_s
    satellite_clock_s = sent_s + states.clock_s[0] + states.clock_drift_sps[0] * (sent_s + 0.0775)
    return SPEED_OF_LIGHT_MPS * (clock_s - satellite_clock_s), clock_s


def drive(v_enu_mps: Floats, drift: float) -> Drive:
    """One epoch of a receiver without atmosphere that moves and whose clock gains `drift` seconds a second."""
    states, points = satellites(), points_at(START_ECEF_M[None])
    points = points._replace(zenith_delay_m=np.zeros_like(points.zenith_delay_m))
    v_ecef_mps = v_enu_mps @ points.enu[0, 0]
    (before_m, before_s), (now_m, now_s), (after_m, after_s) = (
        reading(states, t_s, v_ecef_mps, drift) for t_s in (-HALF_STEP_S, 0.0, HALF_STEP_S)
    )
    doppler_hz = -(after_m - before_m) / (after_s - before_s) / L1_M
    shape = (1, 1, len(SATELLITES))
    empty, no = np.full(shape, np.nan), np.zeros(shape, dtype=np.bool_)
    epoch_ns = np.array([EPOCH_NS])
    block = ObservationBlock(
        ("A",), SIGNALS, SATELLITES, epoch_ns, epoch_ns[:, None] + round(now_s * NS_PER_S), now_m.reshape(shape), empty,
        doppler_hz.reshape(shape), empty, empty, no, no,
    )  # fmt: skip
    return Drive(block, expected(states, epoch_ns, points, None))


def solved(made: Drive, visible: slice = slice(None)) -> Velocities:
    rate_mps = rates_mps(made.block, made.sight, np.full((1, len(SIGNALS)), L1_M))
    used = made.sight.el_rad > np.deg2rad(10.0)
    keep = np.flatnonzero(used[0, 0])[visible]
    return velocities(rate_mps, made.sight.los_enu, np.full(rate_mps.shape, 0.05), used & np.isin(np.arange(len(SIGNALS)), keep))


@pytest.mark.parametrize("v_enu_mps", [(0.0, 0.0, 0.0), (30.0, -20.0, 1.0), (-80.0, 10.0, -3.0)])
@pytest.mark.parametrize("drift", [0.0, 1e-6, -5e-6])
def test_a_velocity_is_found_to_a_millimetre_a_second(v_enu_mps: tuple[float, ...], drift: float) -> None:
    """What is left out is the turn of the Earth while the receiver moves: 6e-6 of the speed."""
    found = solved(drive(np.array(v_enu_mps), drift))
    np.testing.assert_allclose(found.v_enu_mps[0, 0], v_enu_mps, atol=1e-3)


def test_at_rest_it_is_found_to_a_tenth_of_a_millimetre_a_second() -> None:
    np.testing.assert_allclose(solved(drive(np.zeros(3), 1e-6)).v_enu_mps[0, 0], 0.0, atol=1e-4)


@pytest.mark.parametrize("drift", [0.0, 1e-6, -5e-6])
def test_the_clocks_drift_is_found_to_a_millimetre_a_second(drift: float) -> None:
    found = solved(drive(np.array([30.0, -20.0, 1.0]), drift))
    assert found.drift_mps.item() == pytest.approx(drift * SPEED_OF_LIGHT_MPS, abs=1e-3)


def test_residuals_of_true_rates_are_below_a_millimetre_a_second() -> None:
    made = drive(np.array([30.0, -20.0, 1.0]), 1e-6)
    seen = made.sight.el_rad > np.deg2rad(10.0)
    assert np.abs(solved(made).residual_mps[seen]).max() < 1e-3


def test_four_satellites_do() -> None:
    assert solved(drive(np.array([30.0, -20.0, 1.0]), 0.0), slice(4)).why.item() == Unsolved.SOLVED


def test_three_satellites_are_too_few() -> None:
    assert solved(drive(np.array([30.0, -20.0, 1.0]), 0.0), slice(3)).why.item() == Unsolved.TOO_FEW_SATELLITES


def test_the_covariance_is_that_of_the_sigmas() -> None:
    made = drive(np.zeros(3), 0.0)
    seen = made.sight.el_rad[0, 0] > np.deg2rad(10.0)
    A = np.column_stack((-made.sight.los_enu[:, 0, 0, seen].T, np.ones(seen.sum())))
    np.testing.assert_allclose(solved(made).cov_enu_m2ps2[0, 0], 0.05**2 * np.linalg.inv(A.T @ A)[:3, :3], rtol=1e-9)


def test_a_wavelength_of_glonass_is_that_of_its_channel() -> None:
    """1602 MHz + k 562.5 kHz. GLONASS ICD 5.1, table 3.1."""
    channel = np.array([[0, -7], [0, 6]])
    expected_m = SPEED_OF_LIGHT_MPS / (1_602.0e6 + channel[:, 1] * 562.5e3)
    np.testing.assert_allclose(wavelengths_m(("G05.1C", "R10.1C"), channel)[:, 1], expected_m, rtol=1e-12)
