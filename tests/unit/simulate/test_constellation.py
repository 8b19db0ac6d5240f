import math
from collections import defaultdict
from itertools import pairwise

import numpy as np
import pytest

from integrity.gnss.constants import SPEED_OF_LIGHT_MPS
from integrity.gnss.ephemeris.broadcast import KeplerEphemeris
from integrity.gnss.ephemeris.states import satellite_states
from integrity.gnss.frames import ecef_from_geodetic, enu_axes
from integrity.gnss.gps_time import NS_PER_S, gps_from_week
from recordings.simulate.constellation import constellation

HOUR_NS = 3600 * NS_PER_S
MONDAY_NS = gps_from_week(2408, 86_400.0 + 3 * 3600.0 + 18.0)  # 2026-03-02T03:00:00Z
SATURDAY_NS = gps_from_week(2408, 604_800.0 - 4 * 3600.0)

# Bits of each field and 2's complement or not, with the scale as a power of two: IS-GPS-200, tables 20-I and 20-III; Galileo OS SIS
# ICD, 5.1.1, 5.1.3, 5.1.5. Angles are in semicircles there.
FIELDS = {
    "m0": (32, True, -31, True),
    "omega0": (32, True, -31, True),
    "omega": (32, True, -31, True),
    "i0": (32, True, -31, True),
    "delta_n": (16, True, -43, True),
    "omega_dot": (24, True, -43, True),
    "i_dot": (14, True, -43, True),
    "e": (32, False, -33, False),
    "sqrt_a": (32, False, -19, False),
    "cuc": (16, True, -29, False),
    "cus": (16, True, -29, False),
    "cic": (16, True, -29, False),
    "cis": (16, True, -29, False),
    "crc": (16, True, -5, False),
    "crs": (16, True, -5, False),
}
CLOCK_FIELDS = {
    "G": {"af0": (22, True, -31, False), "af1": (16, True, -43, False), "group_delay_s": (8, True, -31, False)},
    "E": {"af0": (31, True, -34, False), "af1": (21, True, -46, False), "group_delay_s": (10, True, -32, False)},
}


def by_satellite(sets: tuple[KeplerEphemeris, ...]) -> dict[str, list[KeplerEphemeris]]:
    groups = defaultdict(list)
    for eph in sets:
        groups[eph.satellite].append(eph)
    return groups


def test_a_seed_gives_the_same_satellites_again() -> None:
    assert constellation(7, MONDAY_NS, MONDAY_NS + HOUR_NS) == constellation(7, MONDAY_NS, MONDAY_NS + HOUR_NS)


def test_another_seed_gives_other_satellites() -> None:
    one, other = (constellation(seed, MONDAY_NS, MONDAY_NS) for seed in (7, 8))
    assert not {eph.m0 for eph in one} & {eph.m0 for eph in other}


def test_a_later_end_only_adds_sets() -> None:
    shorter, longer = (constellation(7, MONDAY_NS, MONDAY_NS + hours * HOUR_NS) for hours in (1, 5))
    assert longer[: len(shorter)] == shorter


@pytest.mark.parametrize("seed", range(5))
def test_every_set_is_plausible(seed: int) -> None:
    sets = constellation(seed, MONDAY_NS, MONDAY_NS + 4 * HOUR_NS)
    assert {eph.implausibility() for eph in sets} == {None}


@pytest.mark.parametrize("start_ns", [MONDAY_NS, SATURDAY_NS])
@pytest.mark.parametrize("seed", range(3))
def test_consecutive_sets_are_one_orbit_and_clock(seed: int, start_ns: int) -> None:
    """Over eight hours, one of them with the end of the week in it; limit: the resolution of the format, 0.3 m."""
    jumps_m = []
    for sets in by_satellite(constellation(seed, start_ns, start_ns + 8 * HOUR_NS)).values():
        for old, new in pairwise(sets):
            index = np.array([[0, 1]])
            states = satellite_states((old, new), index, np.array([new.transmission_ns]))
            moved_m = np.linalg.norm(np.diff(states.pos_ecef_m[:, 0], axis=-1))
            jumps_m.append(moved_m + SPEED_OF_LIGHT_MPS * abs(np.diff(states.clock_s[0])[0]))
    assert max(jumps_m) < 0.3


@pytest.mark.parametrize("after_s", [0, 581, 582, 3582, 7182, 40_000])
def test_every_satellite_has_one_set_in_force_at_any_time(after_s: int) -> None:
    """The last one transmitted; usable then, and the next one is on its way before it is not."""
    t_ns = MONDAY_NS + after_s * NS_PER_S
    for sets in by_satellite(constellation(3, MONDAY_NS, MONDAY_NS + 12 * HOUR_NS)).values():
        in_force = [eph for eph in sets if eph.transmission_ns <= t_ns][-1]
        assert abs(t_ns - in_force.toe_ns) <= in_force.fit_half_s * NS_PER_S


def test_at_the_start_no_set_is_out_of_date() -> None:
    sets = constellation(3, MONDAY_NS, MONDAY_NS)
    assert len({eph.satellite for eph in sets}) == len(sets) == 55


def test_gps_sets_serve_two_hours_each_up_to_an_even_hour() -> None:
    sets = by_satellite(constellation(3, MONDAY_NS, MONDAY_NS + 4 * HOUR_NS))
    hours = {tuple((eph.transmission_ns % (24 * HOUR_NS), eph.toe_ns % (24 * HOUR_NS)) for eph in sets[s]) for s in sets if s[0] == "G"}
    assert hours == {((2 * HOUR_NS, 4 * HOUR_NS), (4 * HOUR_NS, 6 * HOUR_NS), (6 * HOUR_NS, 8 * HOUR_NS))}


def test_galileo_sets_change_every_half_hour() -> None:
    for satellite, sets in by_satellite(constellation(3, MONDAY_NS, MONDAY_NS + 4 * HOUR_NS)).items():
        steps = {b.transmission_ns - a.transmission_ns for a, b in pairwise(sets)}
        assert satellite[0] == "G" or steps == {HOUR_NS // 2}


def test_the_issue_tells_the_sets_of_six_hours_apart() -> None:
    """IS-GPS-200, 20.3.4.4: an IODE does not come again within six hours."""
    for sets in by_satellite(constellation(3, MONDAY_NS, MONDAY_NS + 6 * HOUR_NS)).values():
        assert len({eph.issue for eph in sets}) == len(sets)


@pytest.mark.parametrize("seed", range(5))
def test_the_navigation_messages_can_carry_every_value_to_the_bit(seed: int) -> None:
    for eph in constellation(seed, SATURDAY_NS, SATURDAY_NS + 8 * HOUR_NS):
        for name, (bits, signed, power, angle) in (FIELDS | CLOCK_FIELDS[eph.satellite[0]]).items():
            value = getattr(eph, name)
            scale = 2.0**power * (math.pi if angle else 1.0)
            number = round(value / scale)
            low, high = (-(2 ** (bits - 1)), 2 ** (bits - 1)) if signed else (0, 2**bits)
            assert (low <= number < high, number * scale) == (True, value), f"{eph.satellite} {name}"


@pytest.mark.parametrize(("system", "planes", "step_deg"), [("G", 6, 60.0), ("E", 3, 120.0)])
def test_orbital_planes_are_evenly_turned(system: str, planes: int, step_deg: float) -> None:
    """Nodes scatter by 2 deg rms within a GPS plane."""
    nodes_deg = np.degrees([eph.omega0 for eph in constellation(4, MONDAY_NS, MONDAY_NS) if eph.satellite[0] == system])
    from_first_deg = (nodes_deg - nodes_deg[0] + 20.0) % 360.0 - 20.0
    plane = np.round(from_first_deg / step_deg)
    assert len(set(plane)) == planes
    assert np.abs(from_first_deg - step_deg * plane).max() < 15.0


@pytest.mark.parametrize(("system", "fewest"), [("G", 5), ("E", 4)])
@pytest.mark.parametrize("lat_deg", [0.0, 35.7, 60.0])
@pytest.mark.parametrize("seed", range(3))
def test_enough_satellites_are_up_all_day(seed: int, lat_deg: float, system: str, fewest: int) -> None:
    """Above 5 deg every quarter of an hour, as many as the real constellations always give."""
    t_ns = MONDAY_NS + np.arange(96) * (HOUR_NS // 4)
    point = ecef_from_geodetic(math.radians(lat_deg), 2.4, 0.0)
    up = enu_axes(np.array(math.radians(lat_deg)), np.array(2.4))[2]
    first = [eph for eph in constellation(seed, MONDAY_NS, MONDAY_NS) if eph.satellite[0] == system]
    los = satellite_states(first, np.tile(np.arange(len(first)), (96, 1)), t_ns).pos_ecef_m - point[:, None, None]
    sin_el = np.einsum("i,ies->es", up, los) / np.linalg.norm(los, axis=0)
    assert (sin_el > math.sin(math.radians(5.0))).sum(axis=1).min() >= fewest
