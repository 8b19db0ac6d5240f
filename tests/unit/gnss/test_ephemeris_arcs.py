"""Polynomials of orbits: how far they leave the orbit, from arc to arc too, and that a state depends on its set and its time alone."""

from dataclasses import replace

import numpy as np
import pytest

from integrity.gnss.constants import SPEED_OF_LIGHT_MPS
from integrity.gnss.ephemeris.arcs import HALF_NS, kepler_states
from integrity.gnss.ephemeris.broadcast import KeplerEphemeris
from integrity.gnss.ephemeris.kepler import GEOSTATIONARY, evaluate
from integrity.gnss.ephemeris.states import Ephemerides
from integrity.gnss.gps_time import NS_PER_S, parse_utc
from integrity.gnss.observations import Floats, Ints
from recordings.simulate.constellation import constellation
from tests.rinex_examples import EVERY_KIND

TOE_NS = parse_utc("2026-03-02T04:00:00Z")
ALL_ROUND = [m0 * np.pi / 6.0 for m0 in range(-6, 6)]  # perigee, where a satellite is fastest, among them
EXAMPLES = [replace(eph, toe_ns=TOE_NS, toc_ns=TOE_NS) for eph in EVERY_KIND.values() if isinstance(eph, KeplerEphemeris)]
SIMULATED = [eph for eph in constellation(seed=1, start_ns=TOE_NS, end_ns=TOE_NS) if isinstance(eph, KeplerEphemeris)]
SETS = Ephemerides([*EXAMPLES, *SIMULATED])
TIMES_NS = TOE_NS + np.arange(-1800, 1801, 37) * NS_PER_S + 922_500_000
INDEX = np.broadcast_to(np.arange(len(SETS)), (len(TIMES_NS), len(SETS)))


def eccentric(e: float) -> Ephemerides:
    """The fastest satellites there may be, of an eccentricity, all round their orbits."""
    return Ephemerides(replace(eph, sqrt_a=5000.0, e=e, m0=m0) for eph in EXAMPLES for m0 in ALL_ROUND)


def exactly(sets: Ephemerides, t_ns: Ints) -> Floats:
    """Position and clock (4, E, S) of every set, without polynomials."""
    of, every = sets.elements, np.arange(len(sets))
    return np.array(evaluate(of.parameters(every, np.full(len(sets), t_ns[0])), ((t_ns - t_ns[0]) / NS_PER_S)[:, None], of.tilted[every]))


def states(sets: Ephemerides, t_ns: Ints) -> Floats:
    return kepler_states(sets.elements, np.broadcast_to(np.arange(len(sets)), (len(t_ns), len(sets))), t_ns)


def length(vectors: Floats) -> float:
    return float(np.sqrt((vectors**2).sum(axis=0)).max())


def test_some_are_geostationary() -> None:
    assert GEOSTATIONARY & {eph.satellite for eph in SETS}


@pytest.mark.parametrize(("e", "limit_m"), [(0.0, 1e-5), (0.02, 1e-5), (0.08, 2e-5), (0.2, 2e-4)])
def test_it_leaves_the_orbit_by_no_more_than_it_says(e: float, limit_m: float) -> None:
    sets = eccentric(e)
    assert length(states(sets, TIMES_NS)[0:3] - exactly(sets, TIMES_NS)[0:3]) <= limit_m


def test_clocks_are_those_of_the_sets() -> None:
    sets = eccentric(0.2)
    difference_s = states(sets, TIMES_NS)[9] - exactly(sets, TIMES_NS)[3]
    assert np.abs(difference_s).max() * SPEED_OF_LIGHT_MPS <= 1e-7


def test_it_is_the_orbit_of_every_kind_of_set() -> None:
    assert length(states(SETS, TIMES_NS)[0:3] - exactly(SETS, TIMES_NS)[0:3]) <= 2e-5


def test_it_does_not_jump_from_arc_to_arc() -> None:
    border_ns = TOE_NS // (2 * HALF_NS) * 2 * HALF_NS
    before, after = np.moveaxis(states(SETS, border_ns + np.array([-1, 0])), 1, 0)
    assert length(after[0:3] - before[0:3] - 1e-9 * before[3:6]) <= 4e-5


@pytest.mark.parametrize("e", [0, 50, 97])
def test_an_epoch_is_the_same_in_any_block(e: int) -> None:
    together = kepler_states(SETS.elements, INDEX, TIMES_NS)[:, e]
    assert kepler_states(SETS.elements, INDEX[e : e + 1], TIMES_NS[e : e + 1])[:, 0].tolist() == together.tolist()


@pytest.mark.parametrize("s", [0, 7, len(SETS) - 1])
def test_a_satellite_is_the_same_in_any_company(s: int) -> None:
    together = kepler_states(SETS.elements, INDEX, TIMES_NS)[:, 50, s]
    assert kepler_states(SETS.elements, INDEX[50:51, s : s + 1], TIMES_NS[50:51])[:, 0, 0].tolist() == together.tolist()


def test_times_need_not_be_in_order() -> None:
    backwards = kepler_states(SETS.elements, INDEX, TIMES_NS[::-1])[:, ::-1]
    assert backwards.tolist() == kepler_states(SETS.elements, INDEX, TIMES_NS).tolist()


def test_no_set_is_nowhere_and_harms_no_other() -> None:
    index = np.array([[-1, 3], [3, -1]])
    found = kepler_states(SETS.elements, index, TIMES_NS[:2])
    assert np.isnan(found[0]).tolist() == (index < 0).tolist()


def test_nothing_is_asked_of_no_satellites() -> None:
    assert kepler_states(SETS.elements, np.empty((2, 0), dtype=np.int64), TIMES_NS[:2]).shape == (11, 2, 0)
