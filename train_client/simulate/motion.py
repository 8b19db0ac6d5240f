"""A train on a simulated line: where its front end is, and how its antennas move."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from integrity.gnss.gps_time import NS_PER_S
from integrity.gnss.observations import Floats, Ints, freeze
from recordings.simulate.observations import Antenna, Motion
from train_client.config import AntennaConfig
from train_client.simulate.line import Line
from train_client.track.locus import antenna_position

HALF_STEP_M = 0.05  # of the difference that gives the direction in which an antenna moves: below 1e-7 of it off in a curve of 100 m


class Leg(NamedTuple):
    """A stretch of time with a constant acceleration along the line."""

    duration_s: float
    acceleration_mps2: float


@dataclass(frozen=True, eq=False)
class Run:
    """A train that runs towards increasing running distance: legs from `start_ns` (GPS time) on, at rest before.

    `times_s`, `front_m`, `speed_mps`, `acceleration_mps2` (L + 1,): since the start, at the beginning of each leg, and at the end of the
    last one, after which the speed stays.
    """

    line: Line
    start_ns: int
    times_s: Floats
    front_m: Floats
    speed_mps: Floats
    acceleration_mps2: Floats

    def __post_init__(self) -> None:
        freeze(self)

    def front(self, gps_ns: Ints) -> tuple[Floats, Floats]:
        """Running distance of the front end, m, and its speed, m/s, at GPS times (E,)."""
        t_s = np.maximum((gps_ns - self.start_ns) / NS_PER_S, 0.0)
        leg = np.searchsorted(self.times_s, t_s, side="right") - 1
        since_s, acceleration = t_s - self.times_s[leg], self.acceleration_mps2[leg]
        speed_mps = self.speed_mps[leg] + acceleration * since_s
        return self.front_m[leg] + since_s * (self.speed_mps[leg] + 0.5 * acceleration * since_s), speed_mps


def run_of(line: Line, start_ns: int, front_m: float, legs: Sequence[Leg]) -> Run:
    """A run from rest with the front end at `front_m`. ValueError where the train would run backwards."""
    times_s, at_m, speed_mps = [0.0], [front_m], [0.0]
    for leg in legs:
        t, v, a = leg.duration_s, speed_mps[-1], leg.acceleration_mps2
        times_s.append(times_s[-1] + t)
        at_m.append(at_m[-1] + t * (v + 0.5 * a * t))
        speed_mps.append(v + a * t)
        if speed_mps[-1] < -1e-9:
            raise ValueError(f"the train would run backwards at {speed_mps[-1]:.3f} m/s after {times_s[-1]:g} s: brake shorter or less")
    acceleration_mps2 = np.array([*(leg.acceleration_mps2 for leg in legs), 0.0])
    return Run(line, start_ns, np.array(times_s), np.array(at_m), np.array(speed_mps), acceleration_mps2)


def motion_of(run: Run, antenna: AntennaConfig) -> Motion:
    """Position and velocity of an antenna, rigidly above the point of the track that is `x_m` ahead of the front end."""

    def motion(gps_ns: Ints) -> tuple[Floats, Floats]:
        front_m, speed_mps = run.front(gps_ns)
        s_m = front_m + antenna.x_m
        ahead = _above(run.line, s_m + HALF_STEP_M, antenna) - _above(run.line, s_m - HALF_STEP_M, antenna)
        return _above(run.line, s_m, antenna), ahead * (speed_mps / (2.0 * HALF_STEP_M))[:, None]

    return motion


def antennas_on(run: Run, antennas: Sequence[AntennaConfig]) -> tuple[Antenna, ...]:
    """The antennas of a train as the simulator takes them, each with a receiver of its name and a clock of its own."""
    return tuple(Antenna(antenna.id, motion_of(run, antenna)) for antenna in antennas)


def _above(line: Line, s_m: Floats, antenna: AntennaConfig) -> Floats:
    at = line.at(s_m)
    return antenna_position(at.pos_ecef_m, at.tangent, at.cant_rad, antenna.height_m, antenna.y_m)


SAMPLE_FRONT_M = 60.0
SAMPLE_LEGS = (  # 25 m/s on the straight, 20 in the curve of 400 m, 18 in that of 300 m; at rest for good after 175 s, 50 m before the end
    Leg(3.0, 0.0),
    Leg(25.0 / 0.7, 0.7),
    Leg(42.0 - 3.0 - 25.0 / 0.7, 0.0),
    Leg(10.0, -0.5),
    Leg(20.0, 0.0),
    Leg(4.0, -0.5),
    Leg(20.0, 0.0),
    Leg(14.0, 0.5),
    Leg(15.0, 0.0),
    Leg(50.0, -0.5),
)


def sample_run(line: Line, start_ns: int) -> Run:
    """The run of the demo's train on the sample line, from the GPS time of the first epoch on."""
    return run_of(line, start_ns, SAMPLE_FRONT_M, SAMPLE_LEGS)
