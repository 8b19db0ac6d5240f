"""A train on the sample line: kinematics in closed form, and antennas against the line and the map."""

from functools import cache
from pathlib import Path

import numpy as np
import pytest

from integrity.gnss.gps_time import NS_PER_S
from integrity.gnss.observations import Floats, Ints
from train_client.config import AntennaConfig
from train_client.simulate.line import Line, sample_line, sample_map
from train_client.simulate.motion import Leg, Run, antennas_on, motion_of, run_of, sample_run
from train_client.track.locus import locus_of
from train_client.train_file import load_train

START_NS = 1_456_455_618 * NS_PER_S
TRAIN = load_train(Path(__file__).parents[3] / "recordings" / "samples" / "train.toml").config
FRONT, REAR = TRAIN.antennas


@cache
def line() -> Line:
    return sample_line()


@cache
def run() -> Run:
    return sample_run(line(), START_NS)


def at(*seconds: float) -> Ints:
    return START_NS + np.array([round(s * NS_PER_S) for s in seconds])


def positions(antenna: AntennaConfig, gps_ns: Ints) -> Floats:
    return motion_of(run(), antenna)(gps_ns)[0]


@pytest.mark.parametrize(
    ("second", "front_m", "speed_mps"),
    [
        (-5.0, 60.0, 0.0),
        (3.0, 60.0, 0.0),
        (13.0, 60.0 + 0.5 * 0.7 * 10.0**2, 7.0),
        (40.0, 60.0 + 25.0**2 / 1.4 + 25.0 * (37.0 - 25.0 / 0.7), 25.0),
        (52.0, 60.0 + 25.0**2 / 1.4 + 25.0 * (39.0 - 25.0 / 0.7) + 225.0, 20.0),
    ],
)
def test_the_front_end_moves_as_its_legs_say(second: float, front_m: float, speed_mps: float) -> None:
    found_m, found_mps = run().front(at(second))
    np.testing.assert_allclose(found_m, front_m, atol=1e-9)
    np.testing.assert_allclose(found_mps, speed_mps, atol=1e-9)


def test_the_train_comes_to_rest_before_the_end_of_the_line() -> None:
    front_m, _ = run().front(at(175.0, 600.0))
    assert front_m[0] == pytest.approx(front_m[1], abs=1e-6)
    assert front_m[1] < line().length_m


def test_after_its_last_leg_a_train_keeps_its_speed() -> None:
    front_m, _ = run_of(line(), START_NS, 100.0, (Leg(10.0, 1.0),)).front(at(10.0, 13.0))
    np.testing.assert_allclose(front_m, (150.0, 180.0))


def test_a_train_does_not_brake_into_running_backwards() -> None:
    with pytest.raises(ValueError, match="backwards"):
        run_of(line(), START_NS, 100.0, (Leg(10.0, 1.0), Leg(11.0, -1.0)))


@pytest.mark.parametrize("antenna", [FRONT, REAR, AntennaConfig("side", -3.0, 1.2, 3.9)])
def test_velocity_is_the_derivative_of_position(antenna: AntennaConfig) -> None:
    """Differences over 2 ms: rounding of positions of 6000 km in it is 1e-6 m/s, the acceleration changes by less."""
    seconds = np.arange(1.0, 180.0, 0.7)
    velocity = motion_of(run(), antenna)(at(*seconds))[1]
    moved = positions(antenna, at(*(seconds + 1e-3))) - positions(antenna, at(*(seconds - 1e-3)))
    np.testing.assert_allclose(velocity, moved / 2e-3, atol=1e-5)


def test_antennas_are_18_15_m_apart_along_the_line() -> None:
    """Where the rear antenna is, the front one was when the train's front end was 18.15 m further back."""
    front_m, _ = run().front(at(20.0, 60.0, 90.0))
    further_back = [run_of(line(), START_NS, m - 18.15, ()) for m in front_m.tolist()]
    was = np.concatenate([motion_of(r, FRONT)(at(0.0))[0] for r in further_back])
    np.testing.assert_allclose(positions(REAR, at(20.0, 60.0, 90.0)), was, atol=1e-6)


def test_on_the_straight_antennas_are_18_15_m_apart() -> None:
    apart_m = np.linalg.norm(positions(FRONT, at(30.0)) - positions(REAR, at(30.0)), axis=1)
    np.testing.assert_allclose(apart_m, 18.15, atol=1e-3)


def test_in_a_canted_curve_an_antenna_leans_inwards() -> None:
    """At 3.9 m over 90 mm of cant, 3.9 * 0.090 / 1.13 m to the right of the track, in the curve to the right."""
    gps_ns = at(62.0)
    track = line().at(run().front(gps_ns)[0] + FRONT.x_m)
    up = track.pos_ecef_m[0] / np.linalg.norm(track.pos_ecef_m[0])
    right = np.cross(track.tangent[0], up)
    leaning_m = float((positions(FRONT, gps_ns) - track.pos_ecef_m)[0] @ right / np.linalg.norm(right))
    assert leaning_m == pytest.approx(3.9 * 0.090 / 1.13, abs=0.02)  # the geocentric vertical is up to 3 mrad off


def test_antennas_run_within_10_mm_of_the_locus_that_the_map_gives() -> None:
    locus = locus_of(sample_map(), FRONT.height_m, FRONT.y_m)
    antenna = positions(FRONT, at(*np.arange(0.0, 175.0, 0.3)))
    from_begin = antenna[:, None, :] - locus.pos_ecef_m
    along_m = np.clip(np.einsum("egi,gi->eg", from_begin, locus.along_ecef), 0.0, locus.length_m)
    off_m = np.linalg.norm(from_begin - along_m[:, :, None] * locus.along_ecef, axis=2).min(axis=1)
    assert off_m.max() < 0.010


def test_each_antenna_of_the_train_is_a_receiver_of_its_name() -> None:
    assert [antenna.receiver for antenna in antennas_on(run(), TRAIN.antennas)] == ["front", "rear"]
