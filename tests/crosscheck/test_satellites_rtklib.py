"""Satellite states against RTKLIB, both of its builds: every set of every constellation in navigation files of all kinds, over its fit
interval. Each side reads the file itself, so that this is about parsing too.

RTKLIB gives the clock with relativity and without group delay, so the group delay is zero here.
"""

import gzip
import json
import subprocess
import sys
from collections import defaultdict
from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest

from integrity.gnss.constants import SPEED_OF_LIGHT_MPS
from integrity.gnss.ephemeris.broadcast import Ephemeris, KeplerEphemeris
from integrity.gnss.ephemeris.states import SatelliteStates, satellite_states
from integrity.gnss.gps_time import NS_PER_S
from integrity.gnss.observations import Floats
from recordings.rinex.navigation import read_navigation
from tests import rinex_examples as example
from tests.rinex_text import navigation_text
from tests.unit.rinex.navigation_files import HEADER_2_GEO, HEADER_2_GLONASS, record_2

PROGRAM = Path(__file__).with_name("rtklib_orbits.py")
SHARES = (-1.0, -0.77, -0.431, -0.1, -0.0123, 0.0, 0.0517, 0.3, 0.633, 0.9, 1.0)  # of half the fit interval
FIT_HALF_S = {"G": 7200.0, "J": 5400.0, "E": 14_400.0, "C": 7200.0, "R": 1200.0, "S": 360.0}
RECORDED = (
    "catalonia_2010/brdc0770.10n.gz",  # RINEX 2
    "gsi_2005/07590920.05n.gz",
    "nagoya_static/base.nav.gz",
    "rosalia_2025/rref001g00.25p.gz",
    "rosalia_2025/rref001h30.25p.gz",
    "sbas_2025/046r_rnx.nav.gz",  # RINEX 4
    "spp_truth/ESBC00DNK_2020177_nav.rnx.gz",
    "spp_truth/SEPT078M.21P.gz",
    "tokyo_sbas_2008/merged_20080526.nav.gz",
    "tokyo_sbas_2008/oemv_200911218.nav.gz",
)
WRITTEN = {
    "examples of the format": navigation_text(example.EVERY_KIND.values()),
    "GLONASS in RINEX 2": HEADER_2_GLONASS + record_2(" 2", example.GLONASS_HEAD, example.GLONASS),
    "SBAS in RINEX 2": HEADER_2_GEO + record_2("22", "S22 2003 10 18 00 01 04", example.SBAS),
}
ECCENTRIC = {"E14", "E18"}  # the two that were left in wrong orbits, e = 0.16: not plausible here
STEP_NS = NS_PER_S  # of the central differences; their truncation is below 2e-5 m/s and 1e-8 m/s2

Key = tuple[str, int, str]  # satellite, reference time, of Galileo the message


class Case(NamedTuple):
    """Our sets of a file, those that the other program reads, by key, and what it makes of each: (shares, 4), ECEF in m and clock in s."""

    version: float
    ours: list[Ephemeris]
    theirs: dict[Key, list[Floats]]

    def pairs(self) -> list[tuple[Ephemeris, list[Floats]]]:
        """Our sets of the satellites that the other program knows, each with what that has under its key."""
        known = {satellite for satellite, _, _ in self.theirs}
        return [(eph, self.theirs.get(key_of(eph), [])) for eph in self.ours if eph.satellite in known]


def key_of(eph: Ephemeris) -> Key:
    return eph.satellite, eph.toe_ns, eph.message if isinstance(eph, KeplerEphemeris) and eph.satellite[0] == "E" else ""


def without_group_delay(eph: Ephemeris) -> Ephemeris:
    return replace(eph, group_delay_s=0.0) if isinstance(eph, KeplerEphemeris) else eph


def read_by_rtklib(module: str, file: Path, directory: Path) -> dict[Key, list[Floats]]:
    result = directory / "result.npz"
    command = [sys.executable, str(PROGRAM), module, str(file), str(result), json.dumps(SHARES), json.dumps(FIT_HALF_S)]
    subprocess.run(command, check=True, timeout=120)
    found: dict[Key, list[Floats]] = defaultdict(list)
    with np.load(result) as data:
        for name, toe_ns, kind, states in zip(data["name"], data["toe_ns"], data["kind"], data["states"], strict=True):
            found[str(name), int(toe_ns), str(kind)].append(states)
    return found


@pytest.fixture(scope="module", params=["pyrtklib5", "pyrtklib"])
def module(request: pytest.FixtureRequest) -> str:
    name: str = request.param
    if find_spec(name) is None:
        pytest.skip(f"{name} is not installed")
    return name


@pytest.fixture(scope="module", params=[*WRITTEN, *RECORDED])
def case(request: pytest.FixtureRequest, module: str, tmp_path_factory: pytest.TempPathFactory) -> Case:
    directory, name = tmp_path_factory.mktemp("nav"), request.param
    plain = directory / "site.nav"
    if name in WRITTEN:
        plain.write_text(WRITTEN[name], "ascii")
    else:
        plain.write_bytes(gzip.decompress((request.getfixturevalue("shared_data") / name).read_bytes()))
    file = read_navigation(plain)
    ours = [without_group_delay(eph) for eph in (*file.ephemerides, *file.fnav_ephemerides)]
    assert ours
    return Case(file.version, ours, read_by_rtklib(module, plain, directory))


def states_of(sets: list[Ephemeris], shift_ns: int = 0) -> SatelliteStates:
    """Of each set at all shares of its fit interval, one after the other: (E, 1) with E = sets times shares."""
    times_ns = [eph.toe_ns + round(share * FIT_HALF_S[eph.satellite[0]] * NS_PER_S) + shift_ns for eph in sets for share in SHARES]
    return satellite_states(sets, np.repeat(np.arange(len(sets)), len(SHARES))[:, None], np.array(times_ns))


def differences(case: Case) -> tuple[Floats, Floats]:
    """Of every set, the largest distance of the positions and the largest difference of the clocks, in metres, to that one of the sets
    under its key which is nearest."""
    pairs = [(eph, theirs) for eph, theirs in case.pairs() if theirs]
    ours = states_of([eph for eph, _ in pairs])
    position_m, clock_s = ours.pos_ecef_m[:, :, 0].T.reshape(len(pairs), len(SHARES), 3), ours.clock_s.reshape(len(pairs), len(SHARES))
    found = []
    for (_, theirs), mine_m, mine_s in zip(pairs, position_m, clock_s, strict=True):
        position = [float(np.max(np.linalg.norm(states[:, :3] - mine_m, axis=1))) for states in theirs]
        clock = [float(np.max(np.abs(states[:, 3] - mine_s))) * SPEED_OF_LIGHT_MPS for states in theirs]
        found.append(min(zip(position, clock, strict=True)))
    table = np.array(found).reshape(-1, 2)
    return table[:, 0], table[:, 1]


def test_each_of_our_sets_is_one_of_theirs(case: Case) -> None:
    assert [key_of(eph) for eph, theirs in case.pairs() if not theirs] == []


def test_each_of_their_sets_is_one_of_ours(case: Case) -> None:
    if case.version >= 4:
        pytest.skip("RTKLIB takes other messages of RINEX 4 for those of RINEX 3")
    assert {satellite for satellite, _, _ in case.theirs.keys() - {key_of(eph) for eph in case.ours}} <= ECCENTRIC


def test_positions_agree_within_1_mm(case: Case) -> None:
    """GLONASS too, though for it a centimetre would do: both integrate in steps of a minute."""
    assert np.max(differences(case)[0]) <= 1e-3


def test_clocks_agree_within_1_mm(case: Case) -> None:
    assert np.max(differences(case)[1]) <= 1e-3


@pytest.fixture(scope="module", params=[*WRITTEN, *RECORDED])
def every_set(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> list[Ephemeris]:
    path = tmp_path_factory.mktemp("nav") / "site.nav"
    if request.param in WRITTEN:
        path.write_text(WRITTEN[request.param], "ascii")
    else:
        path = request.getfixturevalue("shared_data") / request.param
    file = read_navigation(path)
    return [*file.ephemerides, *file.fnav_ephemerides]


def worst(difference: Floats) -> float:
    """The largest length over (3, E, 1); NaN if any is."""
    return float(np.max(np.linalg.norm(difference, axis=0)))


def test_velocity_is_the_derivative_of_position_within_1_mmps(every_set: list[Ephemeris]) -> None:
    before, now, after = (states_of(every_set, shift_ns) for shift_ns in (-STEP_NS, 0, STEP_NS))
    difference = (after.pos_ecef_m - before.pos_ecef_m) / (2 * STEP_NS / NS_PER_S)
    assert worst(now.vel_ecef_mps - difference) <= 1e-3


def test_acceleration_is_the_derivative_of_velocity_within_0_01_mmps2(every_set: list[Ephemeris]) -> None:
    before, now, after = (states_of(every_set, shift_ns) for shift_ns in (-STEP_NS, 0, STEP_NS))
    difference = (after.vel_ecef_mps - before.vel_ecef_mps) / (2 * STEP_NS / NS_PER_S)
    assert worst(now.acc_ecef_mps2 - difference) <= 1e-5


def test_clock_drift_is_the_derivative_of_the_clock_within_1_umps(every_set: list[Ephemeris]) -> None:
    """Relativity moves a clock by up to 2 mm/s at e = 0.02: the bound would show a wrong drift of it."""
    before, now, after = (states_of(every_set, shift_ns) for shift_ns in (-STEP_NS, 0, STEP_NS))
    difference = (after.clock_s - before.clock_s) / (2 * STEP_NS / NS_PER_S)
    assert float(np.max(np.abs(now.clock_drift_sps - difference))) * SPEED_OF_LIGHT_MPS <= 1e-6
