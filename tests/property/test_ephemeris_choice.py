"""The store of ephemerides chooses what its definition in plain words says, whatever the sets, the order they came in and the block.

Of the sets of a satellite that had arrived and whose fit interval holds the epoch, the one with the highest precedence serves: transmitted
last; then of the later reference time; then of the higher issue; then the one that promises less, at last for a shorter time.
"""

from dataclasses import replace

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from integrity.gnss.ephemeris.broadcast import Ephemeris
from integrity.gnss.ephemeris.store import EphemerisStore
from integrity.gnss.gps_time import NS_PER_S, WEEK_NS
from tests.rinex_examples import EVERY_KIND

START_NS = 2360 * WEEK_NS - 7200 * NS_PER_S  # the week ends among the epochs
SATELLITES = ("G05", "E12", "R02")
BASE = {"G": EVERY_KIND["GPS"], "E": EVERY_KIND["Galileo I/NAV"], "R": EVERY_KIND["GLONASS"]}
times_ns = st.integers(0, 4).map(lambda hours: START_NS + hours * 3600 * NS_PER_S)  # few, so that they coincide


@st.composite
def sets(draw: st.DrawFn) -> Ephemeris:
    satellite = draw(st.sampled_from(SATELLITES))
    return replace(
        BASE[satellite[0]],
        satellite=satellite,
        toe_ns=draw(times_ns),
        transmission_ns=draw(times_ns),
        issue=draw(st.integers(1, 3)),
        healthy=draw(st.booleans()),
        accuracy_m=draw(st.sampled_from([None, 2.4, 4.85])),
        fit_half_s=draw(st.sampled_from([360.0, 1200.0, 7200.0])),
    )


several = st.lists(sets(), max_size=12, unique=True)
ends_ns = st.sampled_from([-1, 0, 1])  # a nanosecond beside the ends of fit intervals


@st.composite
def epochs(draw: st.DrawFn) -> list[int]:
    """Times that do not decrease, some of them next to where a fit interval may end."""
    found = draw(st.lists(st.tuples(times_ns, st.sampled_from([0, -360, 360, 1200, -7200, 7200]), ends_ns), min_size=1, max_size=12))
    times = draw(st.sampled_from([1, 40])) * found  # few and many go different ways
    return sorted(t + offset_s * NS_PER_S + ns for t, offset_s, ns in times)


def precedence(eph: Ephemeris) -> tuple[int, int, int, bool, float, float]:
    worst_m = float("inf") if eph.accuracy_m is None else eph.accuracy_m
    return eph.transmission_ns, eph.toe_ns, eph.issue, not eph.healthy, worst_m, -eph.fit_half_s


def by_definition(known: list[Ephemeris], satellite: str, t_ns: int) -> Ephemeris | None:
    able = [eph for eph in known if eph.satellite == satellite and abs(t_ns - eph.toe_ns) <= round(eph.fit_half_s * NS_PER_S)]
    return max(able, key=precedence, default=None)


def chosen(store: EphemerisStore, at_ns: list[int], arrived: list[int]) -> list[list[Ephemeris | None]]:
    index = store.choose(SATELLITES, np.array(at_ns), np.array(arrived))
    return [[None if k < 0 else store.ephemerides[k] for k in row] for row in index.tolist()]


@settings(deadline=None)
@given(several, epochs(), st.data())
def test_it_chooses_by_its_definition_among_what_had_arrived(arriving: list[Ephemeris], at_ns: list[int], data: st.DataObject) -> None:
    arrived = sorted(data.draw(st.lists(st.integers(0, len(arriving)), min_size=len(at_ns), max_size=len(at_ns))))
    expected = [[by_definition(arriving[:n], s, t) for s in SATELLITES] for t, n in zip(at_ns, arrived, strict=True)]
    assert chosen(EphemerisStore(arriving), at_ns, arrived) == expected


@settings(deadline=None)
@given(several, epochs(), st.data())
def test_order_of_arrival_changes_nothing(arriving: list[Ephemeris], at_ns: list[int], data: st.DataObject) -> None:
    other = data.draw(st.permutations(arriving))
    everything = [len(arriving)] * len(at_ns)
    assert chosen(EphemerisStore(other), at_ns, everything) == chosen(EphemerisStore(arriving), at_ns, everything)


@settings(deadline=None)
@given(several, epochs(), st.data())
def test_what_arrives_later_changes_no_earlier_epoch(arriving: list[Ephemeris], at_ns: list[int], data: st.DataObject) -> None:
    n = data.draw(st.integers(0, len(arriving)))
    arrived = [n] * len(at_ns)
    assert chosen(EphemerisStore(arriving), at_ns, arrived) == chosen(EphemerisStore(arriving[:n]), at_ns, arrived)


@settings(deadline=None)
@given(several, epochs(), st.data())
def test_blocks_choose_as_single_epochs_do(arriving: list[Ephemeris], at_ns: list[int], data: st.DataObject) -> None:
    arrived = sorted(data.draw(st.lists(st.integers(0, len(arriving)), min_size=len(at_ns), max_size=len(at_ns))))
    store = EphemerisStore(arriving)
    alone = [chosen(store, [t], [n])[0] for t, n in zip(at_ns, arrived, strict=True)]
    assert chosen(store, at_ns, arrived) == alone


@settings(deadline=None)
@given(several, times_ns, st.sampled_from(SATELLITES), st.integers(1, 3))
def test_by_issue_it_finds_what_would_serve_if_there_were_no_other_issue(
    arriving: list[Ephemeris], t_ns: int, satellite: str, issue: int
) -> None:
    store = EphemerisStore(arriving)
    found = store.of_issue(satellite, issue, t_ns)
    expected = by_definition([eph for eph in arriving if eph.issue == issue], satellite, t_ns)
    assert (None if found < 0 else store.ephemerides[found]) == expected
