"""Satellites that do not exist: GPS and Galileo constellations as the broadcast ephemerides of every satellite, made from a seed.

One reference set per satellite describes its orbit and clock for the whole run; every set transmitted is that one carried to its own
reference time, so that consecutive sets agree but for the resolution of the format (below 0.3 m of range where they change). All values
stand on the grid of the navigation messages: what is encoded and decoded again is the same to the bit.
Sources: IS-GPS-200, tables 20-I, 20-III and 20.3.4.5; Galileo OS SIS ICD, tables 61 to 67; GPS Standard Positioning Service Performance
Standard, section 3.2 (orbits); Galileo reference constellation: Walker 24/3/1.
"""

import math
from collections.abc import Iterator
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from integrity.gnss.atmosphere import Klobuchar
from integrity.gnss.constants import EARTH_ROTATION_RADPS
from integrity.gnss.ephemeris import Ephemeris
from integrity.gnss.gps_time import NS_PER_S, WEEK_NS
from recordings.simulate.errors import generator

# A moderate day: 5 m in the zenith at noon in middle latitudes. Multiples of the scale factors of IS-GPS-200, table 20-X.
IONOSPHERE = Klobuchar(
    alpha=(12 * 2**-30, 1 * 2**-27, -1 * 2**-24, -1 * 2**-24),
    beta=(44 * 2.0**11, 2 * 2.0**14, -2 * 2.0**16, -3 * 2.0**16),
)

ORBIT_RESOLUTION = {  # the same in both systems
    **dict.fromkeys(("i0", "omega0", "omega", "m0"), math.pi * 2**-31),
    **dict.fromkeys(("delta_n", "i_dot", "omega_dot"), math.pi * 2**-43),
    **dict.fromkeys(("cuc", "cus", "cic", "cis"), 2**-29),
    **dict.fromkeys(("crc", "crs"), 2**-5),
    "sqrt_a": 2**-19,
    "e": 2**-33,
}
CLOCK_RESOLUTION = {
    "G": {"af0": 2**-31, "af1": 2**-43, "group_delay_s": 2**-31},
    "E": {"af0": 2**-34, "af1": 2**-46, "group_delay_s": 2**-32},
}


class Schedule(NamedTuple):
    """When a system changes its sets: one every `period_ns`, transmitted from its reference time plus `after_toe_ns` on."""

    period_ns: int
    after_toe_ns: int
    issues: int  # numbers of issues before they begin again


SCHEDULES = {
    "G": Schedule(7200 * NS_PER_S, -7200 * NS_PER_S, 240),  # higher IODEs mark long fit intervals: IS-GPS-200, 20.3.4.4
    "E": Schedule(1800 * NS_PER_S, 600 * NS_PER_S, 1024),
}


def constellation(seed: int, start_ns: int, end_ns: int) -> tuple[Ephemeris, ...]:
    """The sets in force at a GPS time and those transmitted from then to another, in the order of their transmission."""
    week_ns = start_ns // WEEK_NS * WEEK_NS
    sets = [
        carried(reference, toe_ns)
        for reference in (*_gps(seed, week_ns), *_galileo(seed, week_ns))
        for toe_ns in _reference_times(SCHEDULES[reference.satellite[0]], start_ns, end_ns)
    ]
    return tuple(sorted(sets, key=lambda eph: (eph.transmission_ns, eph.satellite)))


def carried(reference: Ephemeris, toe_ns: int) -> Ephemeris:
    """The same orbit and clock, described at another reference time. Harmonic terms and the argument of perigee have no rate to follow."""
    dt_s = (toe_ns - reference.toe_ns) / NS_PER_S
    mu = GALILEO_MU_M3PS2 if reference.satellite[0] == "E" else GPS_MU_M3PS2
    n = math.sqrt(mu / reference.sqrt_a**6) + reference.delta_n
    # The node is broadcast as its longitude at the beginning of the week of toe.
    node_at_toe = _node_at_toe(reference) + (reference.omega_dot - EARTH_ROTATION_RADPS) * dt_s
    schedule = SCHEDULES[reference.satellite[0]]
    return _on_grid(
        replace(
            reference,
            issue=(toe_ns // schedule.period_ns + reference.issue) % schedule.issues,
            transmission_ns=toe_ns + schedule.after_toe_ns,
            toe_ns=toe_ns,
            toc_ns=toe_ns,
            m0=_turn(reference.m0 + n * dt_s),
            omega0=_turn(node_at_toe + EARTH_ROTATION_RADPS * (toe_ns % WEEK_NS / NS_PER_S)),
            i0=reference.i0 + reference.i_dot * dt_s,
            af0=reference.af0 + reference.af1 * dt_s,
        )
    )
