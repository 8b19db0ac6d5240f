"""What the parameters of faults may be: types with their bounds, and in words what each expects.

A value that would make the fault do nothing (a step of 0 m) is refused: an injection that does nothing proves nothing.
"""

import math
from typing import Annotated

from pydantic import AfterValidator, Field

from integrity.gnss.ephemeris.broadcast import NUMBERS
from integrity.gnss.signals import SYSTEM_NAMES
from recordings.site_checks import RADIUS_RANGE_M

Vector = tuple[float, float, float]  # east, north, up, or ECEF x, y, z
EAST: Vector = (1.0, 0.0, 0.0)
MOST_DISPLACEMENT_M = 1e5


def _something(value: float) -> float:
    if value == 0.0:
        raise ValueError("0 does nothing")
    return value


def _some_direction(vector: Vector) -> Vector:
    if not any(vector):
        raise ValueError("[0, 0, 0] does nothing")
    return vector


def _near_the_ground(point: Vector | None) -> Vector | None:
    if point is not None and not RADIUS_RANGE_M[0] <= math.hypot(*point) <= RADIUS_RANGE_M[1]:
        raise ValueError("off the Earth's surface")
    return point


def _not_far(vector: Vector) -> Vector:
    if math.hypot(*vector) > MOST_DISPLACEMENT_M:
        raise ValueError("too far")
    return vector


def _a_satellite(name: str) -> str:
    number = name[1:]
    if not (len(number) == 2 and number.isascii() and number.isdecimal() and int(number) in NUMBERS.get(name[:1], ())):
        raise ValueError("no such satellite")
    return name


def _a_system(name: str) -> str:
    """The letter of a system given by letter or name."""
    letter = next((letter for letter, full in SYSTEM_NAMES.items() if name in (letter, full)), None)
    if letter is None:
        raise ValueError("no such system")
    return letter


_LAST = " ".join(f"{system}{numbers[-1]:02d}" for system, numbers in NUMBERS.items())
Satellite = Annotated[
    str, AfterValidator(_a_satellite), Field(description=f'a satellite such as "G01"; the last of each system are {_LAST}')
]
Satellites = Annotated[
    tuple[Satellite, ...], Field(strict=False, min_length=1, description='a list of satellites, such as ["G05", "E11"], at least one')
]
System = Annotated[str, AfterValidator(_a_system), Field(description=f"one of {', '.join(SYSTEM_NAMES.values())}")]
Receiver = Annotated[str, Field(description='the name of one of the site\'s receivers, such as "A"')]
Receivers = Annotated[tuple[str, ...], Field(strict=False, min_length=1, description='a list of the site\'s receivers, such as ["A", "B"]')]
SizeM = Annotated[float, Field(ge=-1e6, le=1e6, description="metres, not 0, at most 1000000"), AfterValidator(_something)]
RateMps = Annotated[float, Field(ge=-1e4, le=1e4, description="metres per second, not 0, at most 10000"), AfterValidator(_something)]
RateMps2 = Annotated[float, Field(ge=-100, le=100, description="metres per second squared, not 0, at most 100"), AfterValidator(_something)]
DropDb = Annotated[float, Field(gt=0, le=100, description="decibels, above 0 and at most 100")]
RampS = Annotated[float, Field(ge=0, le=1e6, description="seconds, from 0 to 1000000")]
Enu = Annotated[
    Vector,
    Field(strict=False, description="[east, north, up] in metres at the receiver's surveyed point, not all 0"),
    AfterValidator(_some_direction),
]
RateEnu = Annotated[
    Vector | None, Field(strict=False, description="[east, north, up] in metres per second at the receiver's surveyed point, not all 0")
]
Direction = Annotated[Vector | None, Field(strict=False, description="[east, north, up], a direction of any length but 0")]
Displacement = Annotated[
    Vector,
    Field(strict=False, description="[x, y, z] in metres in ECEF, not all 0, together at most 100000 long"),
    AfterValidator(_some_direction),
    AfterValidator(_not_far),
]
Ecef = Annotated[
    Vector | None,
    Field(strict=False, description="a point on the Earth's surface, [x, y, z] in metres"),
    AfterValidator(_near_the_ground),
]
