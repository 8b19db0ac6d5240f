"""Satellites that do not exist: GPS and Galileo as the ephemerides that every satellite would broadcast, made from a seed.

One reference set describes orbit and clock of a satellite for the whole run; every set transmitted is that one carried to its own
reference time. All of them therefore agree but for the resolution of the format: below 0.3 m of range, however far they are carried.
All values stand on the grid of the navigation messages, so that what is encoded and decoded again is the same to the bit.
Sources: IS-GPS-200, tables 20-I and 20-III; Galileo OS SIS ICD, 5.1.1, 5.1.3 and 5.1.5; orbits after the GPS SPS Performance Standard,
section 3.2, and Galileo's reference constellation (Walker 24/3/1).
"""

import math
from collections.abc import Iterator
from dataclasses import replace
from typing import NamedTuple

from integrity.gnss.atmosphere import Klobuchar
from integrity.gnss.constants import EARTH_ROTATION_RADPS, GALILEO_MU_M3PS2, GPS_MU_M3PS2
from integrity.gnss.ephemeris.broadcast import KeplerEphemeris
from integrity.gnss.gps_time import NS_PER_S, WEEK_NS
from recordings.simulate.errors import generator

# A quiet day: about 5 m in the zenith at noon in middle latitudes. Multiples of the scale factors of IS-GPS-200, table 20-X.
IONOSPHERE = Klobuchar(
    alpha=(12 * 2.0**-30, 1 * 2.0**-27, -1 * 2.0**-24, -1 * 2.0**-24),
    beta=(44 * 2.0**11, 2 * 2.0**14, -2 * 2.0**16, -3 * 2.0**16),
)

ORBIT_RESOLUTION = {  # of both systems
    **dict.fromkeys(("i0", "omega0", "omega", "m0"), math.pi * 2.0**-31),
    **dict.fromkeys(("delta_n", "i_dot", "omega_dot"), math.pi * 2.0**-43),
    **dict.fromkeys(("cuc", "cus", "cic", "cis"), 2.0**-29),
    **dict.fromkeys(("crc", "crs"), 2.0**-5),
    "sqrt_a": 2.0**-19,
    "e": 2.0**-33,
}
CLOCK_RESOLUTION = {
    "G": {"af0": 2.0**-31, "af1": 2.0**-43, "group_delay_s": 2.0**-31},
    "E": {"af0": 2.0**-34, "af1": 2.0**-46, "group_delay_s": 2.0**-32, "group_delay_2_s": 2.0**-32},
}


class System(NamedTuple):
    """What the satellites of a system share; each transmits a set per `period_ns`, from its reference time plus `after_toe_ns` on."""

    mu_m3ps2: float
    period_ns: int
    after_toe_ns: int
    issues: int  # numbers of issues before they begin again
    fit_half_s: float
    accuracy_m: float


SYSTEM = {
    # Issues from 240 on mark longer fit intervals: IS-GPS-200, table 20-XII.
    "G": System(GPS_MU_M3PS2, 7200 * NS_PER_S, -7200 * NS_PER_S, issues=240, fit_half_s=7200.0, accuracy_m=2.4),
    "E": System(GALILEO_MU_M3PS2, 1800 * NS_PER_S, 600 * NS_PER_S, issues=1024, fit_half_s=14_400.0, accuracy_m=3.12),
}

GPS_SATELLITES, GPS_NUMBERS, GPS_PLANES = 31, 32, 6
GPS_A_M, GPS_INCLINATION_RAD = 26_559_700.0, math.radians(55.0)
GALILEO_SATELLITES, GALILEO_PLANES, GALILEO_PHASING = 24, 3, 1
GALILEO_A_M, GALILEO_INCLINATION_RAD = 29_600_300.0, math.radians(56.0)


def constellation(seed: int, start_ns: int, end_ns: int) -> tuple[KeplerEphemeris, ...]:
    """The sets in force at the GPS time `start_ns` and those transmitted from then to `end_ns`, in the order of their transmission."""
    week_ns = start_ns // WEEK_NS * WEEK_NS
    sets = [
        carried(_on_grid(reference), toe_ns)
        for reference in (*_gps(seed, week_ns), *_galileo(seed, week_ns))
        for toe_ns in _reference_times(SYSTEM[reference.satellite[0]], start_ns, end_ns)
    ]
    return tuple(sorted(sets, key=lambda eph: (eph.transmission_ns, eph.satellite)))


def carried(reference: KeplerEphemeris, toe_ns: int) -> KeplerEphemeris:
    """The orbit and clock of a set described at another reference time, on the grid of the format.

    Mean anomaly, node, inclination and clock move; the argument of perigee and the harmonic terms have no rate in the broadcast model.
    """
    system = SYSTEM[reference.satellite[0]]
    dt_s = (toe_ns - reference.toe_ns) / NS_PER_S
    n = math.sqrt(system.mu_m3ps2 / reference.sqrt_a**6) + reference.delta_n
    # omega0 is the node's longitude at the beginning of the week of toe: in the ECEF of one time it moves by omega_dot alone.
    weeks_s = (toe_ns // WEEK_NS - reference.toe_ns // WEEK_NS) * (WEEK_NS // NS_PER_S)
    return _on_grid(
        replace(
            reference,
            issue=(toe_ns // system.period_ns + reference.issue) % system.issues,
            transmission_ns=toe_ns + system.after_toe_ns,
            toe_ns=toe_ns,
            toc_ns=toe_ns,
            m0=reference.m0 + n * dt_s,
            omega0=reference.omega0 + reference.omega_dot * dt_s - EARTH_ROTATION_RADPS * weeks_s,
            i0=reference.i0 + reference.i_dot * dt_s,
            af0=reference.af0 + reference.af1 * dt_s,
        )
    )


def _on_grid(eph: KeplerEphemeris) -> KeplerEphemeris:
    """Every value rounded to what its message can carry; angles that go round brought into half a turn of zero."""
    resolution = ORBIT_RESOLUTION | CLOCK_RESOLUTION[eph.satellite[0]]
    values = {name: getattr(eph, name) for name in resolution}
    values |= {name: math.remainder(values[name], math.tau) for name in ("m0", "omega0", "omega")}
    return replace(eph, **{name: round(value / resolution[name]) * resolution[name] for name, value in values.items()})


def _reference_times(system: System, start_ns: int, end_ns: int) -> Iterator[int]:
    """Reference times of the set in force at the start and of those transmitted later, up to the end."""
    first = (start_ns - system.after_toe_ns) // system.period_ns
    last = (end_ns - system.after_toe_ns) // system.period_ns
    return (k * system.period_ns for k in range(first, last + 1))


def _gps(seed: int, toe_ns: int) -> Iterator[KeplerEphemeris]:
    """Reference sets of 31 satellites in 6 planes, unevenly spread as the real ones are."""
    rng = generator(seed, "constellation/GPS")
    numbers = rng.permutation(GPS_NUMBERS)[:GPS_SATELLITES] + 1
    turn = rng.uniform(0.0, math.tau)
    for k, number in enumerate(numbers):
        plane, slot = k % GPS_PLANES, k // GPS_PLANES
        in_plane = len(range(plane, GPS_SATELLITES, GPS_PLANES))
        node = turn + math.tau * plane / GPS_PLANES + math.radians(rng.normal(0.0, 2.0))
        latitude_argument = math.tau * (slot / in_plane + plane / GPS_SATELLITES) + math.radians(rng.normal(0.0, 6.0))
        omega = rng.uniform(-math.pi, math.pi)
        yield KeplerEphemeris(
            satellite=f"G{number:02d}",
            message="LNAV",
            issue=int(rng.integers(240)),
            healthy=True,
            accuracy_m=SYSTEM["G"].accuracy_m,
            transmission_ns=toe_ns + SYSTEM["G"].after_toe_ns,
            toe_ns=toe_ns,
            toc_ns=toe_ns,
            fit_half_s=SYSTEM["G"].fit_half_s,
            sqrt_a=math.sqrt(GPS_A_M) + rng.normal(0.0, 0.1),
            e=rng.uniform(0.001, 0.015),
            i0=GPS_INCLINATION_RAD + math.radians(rng.normal(0.0, 0.5)),
            omega0=node,
            omega=omega,
            m0=latitude_argument - omega,
            delta_n=rng.normal(4.5e-9, 0.3e-9),
            i_dot=rng.normal(0.0, 2e-10),
            omega_dot=rng.normal(-8.0e-9, 0.2e-9),
            cuc=rng.normal(0.0, 3e-6),
            cus=rng.normal(6e-6, 3e-6),
            crc=rng.normal(250.0, 60.0),
            crs=rng.normal(0.0, 60.0),
            cic=rng.normal(0.0, 1e-7),
            cis=rng.normal(0.0, 1e-7),
            af0=rng.uniform(-4e-4, 4e-4),
            af1=rng.normal(0.0, 4e-12),
            af2=0.0,
            group_delay_s=rng.uniform(-13e-9, 5e-9),
        )


def _galileo(seed: int, toe_ns: int) -> Iterator[KeplerEphemeris]:
    """Reference sets of 24 satellites, Walker 24/3/1."""
    rng = generator(seed, "constellation/Galileo")
    turn, start = rng.uniform(0.0, math.tau, 2)
    per_plane = GALILEO_SATELLITES // GALILEO_PLANES
    for k in range(GALILEO_SATELLITES):
        plane, slot = divmod(k, per_plane)
        node = turn + math.tau * plane / GALILEO_PLANES
        latitude_argument = start + math.tau * (slot / per_plane + plane * GALILEO_PHASING / GALILEO_SATELLITES)
        omega = rng.uniform(-math.pi, math.pi)
        yield KeplerEphemeris(
            satellite=f"E{k + 1:02d}",
            message="INAV",
            issue=int(rng.integers(1024)),
            healthy=True,
            accuracy_m=SYSTEM["E"].accuracy_m,
            transmission_ns=toe_ns + SYSTEM["E"].after_toe_ns,
            toe_ns=toe_ns,
            toc_ns=toe_ns,
            fit_half_s=SYSTEM["E"].fit_half_s,
            sqrt_a=math.sqrt(GALILEO_A_M) + rng.normal(0.0, 0.02),
            e=rng.uniform(0.0001, 0.0005),
            i0=GALILEO_INCLINATION_RAD + math.radians(rng.normal(0.0, 0.3)),
            omega0=node,
            omega=omega,
            m0=latitude_argument - omega,
            delta_n=rng.normal(3.0e-9, 0.2e-9),
            i_dot=rng.normal(0.0, 2e-10),
            omega_dot=rng.normal(-5.6e-9, 0.1e-9),
            cuc=rng.normal(0.0, 3e-6),
            cus=rng.normal(8e-6, 2e-6),
            crc=rng.normal(160.0, 40.0),
            crs=rng.normal(0.0, 60.0),
            cic=rng.normal(0.0, 5e-8),
            cis=rng.normal(0.0, 5e-8),
            af0=rng.uniform(-8e-4, 8e-4),
            af1=rng.normal(0.0, 3e-12),
            af2=0.0,
            group_delay_s=(bgd_e5b_s := rng.uniform(-5e-9, 5e-9)),
            group_delay_2_s=0.9 * bgd_e5b_s,  # E5a and E5b leave by one amplifier
        )
