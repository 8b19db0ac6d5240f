"""Shadow faults on real data: no monitor is silent in any minute of any sound triple; false sets of real satellites are false enough."""

from pathlib import Path

import numpy as np
import pytest

from integrity.gnss.ephemeris.broadcast import Ephemeris
from integrity.monitors.navigation import compared, off_nominal
from integrity.shadows import LAST_BIT_M, _ahead, _off_orbit
from tests.realdata.catalonia import TRIPLES, imported, site
from tests.realdata.test_monitors_navigation import FILES, SITE_ECEF_M, replayed
from tests.unit.shadowed import blocks_of


@pytest.mark.parametrize("name", TRIPLES)
def test_nothing_is_silent_on_real_receivers(name: str, shared_data: Path) -> None:
    triple = TRIPLES[name]
    of_triple = site(shared_data, triple)
    blocks = blocks_of(of_triple.config, imported(shared_data, triple, of_triple).events)
    every_minute = 2  # epochs are 30 s apart
    minutes = [(block, e) for block in blocks for e in range(0, len(block.decided.epochs), every_minute) if block.decided.clean[e]]
    assert [(block.decided.epochs[e].epoch_ns, silent) for block, e in minutes if (silent := block.silent(e))] == []


def believed(data: Path, folder: str) -> list[Ephemeris]:
    """Sets that a station believes, one of each satellite and source."""
    sets = [eph for eph in replayed(data, folder).sets if eph.healthy and eph.accuracy_m is not None and off_nominal(eph) <= 1.0]
    return list({(eph.satellite, type(eph), getattr(eph, "message", "")): eph for eph in sets}.values())


@pytest.mark.parametrize("folder", FILES)
def test_an_orbit_that_nobody_flies_is_off_by_some_tolerances_and_no_more(folder: str, shared_data: Path) -> None:
    """Enough for the check, and little enough that a threshold ten times as large would be found out."""
    off = {eph.satellite: off_nominal(_off_orbit(eph)) for eph in believed(shared_data, folder)}
    assert {satellite: times for satellite, times in off.items() if not 1.5 <= times <= 5.0} == {}


@pytest.mark.parametrize("folder", FILES)
@pytest.mark.parametrize("along_m", [LAST_BIT_M, 60.0])
def test_a_satellite_that_is_put_elsewhere_is_as_far_away_as_it_should_be(along_m: float, folder: str, shared_data: Path) -> None:
    """Within 5 %: the eccentricity stretches and shrinks the way along an orbit (of two Galileo satellites by 16 %)."""
    sets = [eph for eph in believed(shared_data, folder) if getattr(eph, "e", 0.0) < 0.05]
    apart_m = [float(compared([eph], [_ahead(eph, along_m)], eph.toe_ns, SITE_ECEF_M).apart_m[0]) for eph in sets]
    assert apart_m == pytest.approx(np.full(len(sets), along_m), rel=0.05)
