"""Satellite states against RTKLIB's `eph2pos`, over every ephemeris of two real navigation files, up to two hours from each.

Our ephemerides are built from RTKLIB's own records: this is about evaluation, not about parsing. `eph2pos` gives the clock with
relativity and without group delay, so the group delay is zero here.
"""

import gzip
import math
from pathlib import Path
from types import ModuleType
from typing import Any, NamedTuple

import numpy as np
import pytest

from integrity.gnss.constants import SPEED_OF_LIGHT_MPS
from integrity.gnss.ephemeris.broadcast import Ephemeris, KeplerEphemeris
from integrity.gnss.ephemeris.states import SatelliteStates, satellite_states
from integrity.gnss.gps_time import GPS_EPOCH_UNIX_S, NS_PER_S
from integrity.gnss.observations import Floats, Ints

OFFSETS_NS = np.arange(-16, 17) * 449_900_000_000  # 7198.4 s to either side of toe, most of them not at a whole second
STEP_NS = NS_PER_S  # of the central differences; their truncation is below 2e-5 m/s and 1e-8 m/s2


class Case(NamedTuple):
    """Ephemerides of one system and file, each at all offsets; RTKLIB's position (3, N) and clock (N,)."""

    ephemerides: list[Ephemeris]
    eph_index: Ints
    t_ns: Ints
    rtklib_pos_ecef_m: Floats
    rtklib_clock_s: Floats


def gps_ns_of(t: Any) -> int:
    return int((t.time - GPS_EPOCH_UNIX_S) * NS_PER_S + round(t.sec * NS_PER_S))


def ephemeris_from_rtklib(satellite: str, eph: Any) -> Ephemeris:
    return KeplerEphemeris(
        satellite=satellite,
        message="INAV" if satellite[0] == "E" else "LNAV",
        issue=eph.iode,
        healthy=eph.svh == 0,
        accuracy_m=None,
        transmission_ns=gps_ns_of(eph.ttr),
        toe_ns=gps_ns_of(eph.toe),
        toc_ns=gps_ns_of(eph.toc),
        fit_half_s=7200.0,
        sqrt_a=math.sqrt(eph.A),
        e=eph.e,
        i0=eph.i0,
        omega0=eph.OMG0,
        omega=eph.omg,
        m0=eph.M0,
        delta_n=eph.deln,
        i_dot=eph.idot,
        omega_dot=eph.OMGd,
        cuc=eph.cuc,
        cus=eph.cus,
        crc=eph.crc,
        crs=eph.crs,
        cic=eph.cic,
        cis=eph.cis,
        af0=eph.f0,
        af1=eph.f1,
        af2=eph.f2,
        group_delay_s=0.0,
    )


def evaluate_rtklib(rtklib: ModuleType, eph: Any) -> tuple[Floats, Floats]:
    """Positions (3, offsets) and clocks (offsets,)."""
    position, clock, variance = rtklib.Arr1Ddouble(3), rtklib.Arr1Ddouble(1), rtklib.Arr1Ddouble(1)
    values = []
    for offset_ns in OFFSETS_NS:
        rtklib.eph2pos(rtklib.timeadd(eph.toe, offset_ns / NS_PER_S), eph, position, clock, variance)
        values.append((position[0], position[1], position[2], clock[0]))
    table = np.array(values).T
    return table[:3], table[3]


@pytest.fixture(
    scope="module",
    params=[
        ("G", "catalonia_2010/brdc0770.10n.gz"),
        ("G", "spp_truth/SEPT078M.21P.gz"),
        ("E", "spp_truth/SEPT078M.21P.gz"),
    ],
    ids=["gps-2010", "gps-2021", "galileo-2021"],
)
def case(request: pytest.FixtureRequest, shared_data: Path, rtklib: ModuleType, tmp_path_factory: pytest.TempPathFactory) -> Case:
    letter, name = request.param
    system = {"G": rtklib.SYS_GPS, "E": rtklib.SYS_GAL}[letter]
    unzipped = tmp_path_factory.mktemp("nav") / Path(name).stem
    unzipped.write_bytes(gzip.decompress((shared_data / name).read_bytes()))
    obs, nav, station, prn = rtklib.obs_t(), rtklib.nav_t(), rtklib.sta_t(), rtklib.Arr1Dint(1)
    assert rtklib.readrnx(str(unzipped), 1, f"-SYS={letter}", obs, nav, station) == 1

    records = [eph for eph in (nav.eph[i] for i in range(nav.n)) if rtklib.satsys(eph.sat, prn) == system]
    assert records, f"RTKLIB finds no ephemeris of system {letter} in {name}"
    ephemerides = []
    for eph in records:
        rtklib.satsys(eph.sat, prn)
        ephemerides.append(ephemeris_from_rtklib(f"{letter}{prn[0]:02d}", eph))
    positions, clocks = zip(*(evaluate_rtklib(rtklib, eph) for eph in records), strict=True)
    toe_ns = np.array([eph.toe_ns for eph in ephemerides])
    return Case(
        ephemerides=ephemerides,
        eph_index=np.repeat(np.arange(len(records)), len(OFFSETS_NS))[:, None],
        t_ns=(toe_ns[:, None] + OFFSETS_NS).ravel(),
        rtklib_pos_ecef_m=np.concatenate(positions, axis=1),
        rtklib_clock_s=np.concatenate(clocks),
    )


def states_at(case: Case, shift_ns: int) -> SatelliteStates:
    return satellite_states(case.ephemerides, case.eph_index, case.t_ns + shift_ns)


def worst(difference: Floats) -> float:
    """The largest length over (3, E, S); NaN if any is."""
    return float(np.max(np.linalg.norm(difference, axis=0)))


def test_position_agrees_within_1_mm(case: Case) -> None:
    ours = states_at(case, 0).pos_ecef_m
    assert worst(ours - case.rtklib_pos_ecef_m[:, :, None]) <= 1e-3


def test_clock_agrees_within_1_mm(case: Case) -> None:
    ours = states_at(case, 0).clock_s[:, 0]
    assert float(np.max(np.abs(ours - case.rtklib_clock_s))) * SPEED_OF_LIGHT_MPS <= 1e-3


def test_velocity_is_the_derivative_of_position_within_1_mmps(case: Case) -> None:
    before, now, after = (states_at(case, shift_ns) for shift_ns in (-STEP_NS, 0, STEP_NS))
    difference = (after.pos_ecef_m - before.pos_ecef_m) / (2 * STEP_NS / NS_PER_S)
    assert worst(now.vel_ecef_mps - difference) <= 1e-3


def test_acceleration_is_the_second_derivative_within_0_2_mmps2(case: Case) -> None:
    """Ours is that of a point-mass Earth; the broadcast orbit also feels the Earth's flattening, up to 8e-5 m/s2."""
    before, now, after = (states_at(case, shift_ns) for shift_ns in (-STEP_NS, 0, STEP_NS))
    difference = (after.pos_ecef_m - 2.0 * now.pos_ecef_m + before.pos_ecef_m) / (STEP_NS / NS_PER_S) ** 2
    assert worst(now.acc_ecef_mps2 - difference) <= 2e-4


def test_clock_drift_is_the_derivative_of_the_clock_within_1_umps(case: Case) -> None:
    """Relativity moves a clock by up to 2 mm/s at e = 0.02: the bound would show a wrong drift of it."""
    before, now, after = (states_at(case, shift_ns) for shift_ns in (-STEP_NS, 0, STEP_NS))
    difference = (after.clock_s - before.clock_s) / (2 * STEP_NS / NS_PER_S)
    assert float(np.max(np.abs(now.clock_drift_sps - difference))) * SPEED_OF_LIGHT_MPS <= 1e-6
