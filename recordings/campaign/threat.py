"""What a threat is: a fault in several sizes, what chance has to say about it, who may be named for it, and the causes that are right."""

from collections.abc import Callable
from dataclasses import dataclass
from math import sqrt
from typing import NamedTuple

from integrity.gnss.signals import SYSTEM_NAMES
from integrity.states import Cause
from recordings.faults.kinds import Effect

Point = tuple[float, float, float]


class Draw(NamedTuple):
    """What chance has chosen for a trial: a satellite in use and its system, the receivers in some order with their surveyed points (ECEF,
    m), a horizontal direction with its azimuth, a direction in ECEF, a sign."""

    satellite: str
    receivers: tuple[str, ...]
    points_ecef_m: tuple[Point, ...]
    east: float
    north: float
    azimuth_deg: float
    towards_ecef: Point
    sign: float

    @property
    def system(self) -> str:
        """Of the satellite."""
        return self.satellite[0]

    def offset_m(self, size_m: float) -> Point:
        """A horizontal offset of that size."""
        return size_m * self.east, size_m * self.north, 0.0

    def upward_m(self, size_m: float) -> Point:
        """A vertical one, up or down."""
        return 0.0, 0.0, self.sign * size_m

    def displaced_m(self, size_m: float) -> Point:
        """An offset of that size in ECEF."""
        x, y, z = self.towards_ecef
        return size_m * x, size_m * y, size_m * z

    def elsewhere_ecef_m(self, away_m: float) -> Point:
        """A point as far from the Earth's centre as the first receiver, so far from it along the ground."""
        r, d = self.points_ecef_m[0], self.towards_ecef
        radius_m = sqrt(sum(x * x for x in r))
        up = tuple(x / radius_m for x in r)
        upward = sum(u * x for u, x in zip(up, d, strict=True))
        level = [x - upward * u for x, u in zip(d, up, strict=True)]
        norm = sqrt(sum(x * x for x in level))
        x, y, z = (a + away_m * b / norm for a, b in zip(r, level, strict=True))
        back = radius_m / sqrt(x * x + y * y + z * z)
        return back * x, back * y, back * z


class Guilty(NamedTuple):
    """Who may be named: satellites, whole systems, receivers."""

    satellites: tuple[str, ...] = ()
    systems: tuple[str, ...] = ()
    receivers: tuple[str, ...] = ()

    def may_be(self, name: str) -> bool:
        """Whether naming this one is right."""
        if name in SYSTEM_NAMES.values():
            return any(SYSTEM_NAMES[system] == name for system in self.systems)
        return name in self.satellites or name in self.receivers or (name[0] in self.systems and name[1:].isdecimal())


@dataclass(frozen=True)
class Threat:
    """`effects` makes the faults of a size. `causes`: the first names it, the others are safe answers; no cause at all: it moves no
    position, and nothing may stop for it. `abrupt`: whole in its first epoch. What is not is
    played no further than it lasts: its end would be a step back. `apart_s`: each of its faults begins so much after the one
    before."""

    id: str
    title: str
    unit: str
    sizes: tuple[float, ...]
    effects: Callable[[float, Draw], tuple[Effect, ...]]
    guilty: Callable[[Draw], Guilty]
    causes: tuple[Cause, ...]
    duration_s: float = 60.0
    abrupt: bool = True
    apart_s: float = 0.0


def the_satellite(draw: Draw) -> Guilty:
    """The one that was drawn."""
    return Guilty(satellites=(draw.satellite,))


def its_system(draw: Draw) -> Guilty:
    """Of the satellite that was drawn, all of it."""
    return Guilty(systems=(draw.system,))


def any_satellite(draw: Draw) -> Guilty:
    """Of every system."""
    return Guilty(systems=tuple(SYSTEM_NAMES))


def first_receiver(draw: Draw) -> Guilty:
    """In the order that was drawn."""
    return Guilty(receivers=draw.receivers[:1])


def two_receivers(draw: Draw) -> Guilty:
    """The first two."""
    return Guilty(receivers=draw.receivers[:2])


def all_receivers(draw: Draw) -> Guilty:
    """Any of them."""
    return Guilty(receivers=draw.receivers)


def satellite_or_receiver(draw: Draw) -> Guilty:
    """The satellite, or the first receiver: both are off, or nobody can tell which."""
    return Guilty(satellites=(draw.satellite,), receivers=draw.receivers[:1])


def nobody(draw: Draw) -> Guilty:
    """All are sound."""
    return Guilty()
