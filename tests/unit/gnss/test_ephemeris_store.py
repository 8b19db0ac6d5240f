"""Which ephemeris serves. The same against a definition in plain words is in tests/property/test_ephemeris_choice.py."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from integrity.gnss.ephemeris.broadcast import Ephemeris, KeplerEphemeris
from integrity.gnss.ephemeris.content import content_crc32
from integrity.gnss.ephemeris.store import EphemerisStore
from integrity.gnss.gps_time import NS_PER_S, WEEK_NS, parse_utc
from tests.rinex_examples import EVERY_KIND, GPS_HEAD, kepler
from tests.rinex_examples import GPS as GPS_ROWS

TOE_NS = parse_utc("2026-03-02T04:00:00Z")
HOUR_NS = 3600 * NS_PER_S
GPS = replace(kepler(GPS_HEAD, GPS_ROWS), satellite="G05", toe_ns=TOE_NS, toc_ns=TOE_NS, transmission_ns=TOE_NS)
FIT_NS = round(GPS.fit_half_s * NS_PER_S)
OLD, NEW = replace(GPS, issue=1, transmission_ns=TOE_NS - HOUR_NS), replace(GPS, issue=2)


def serving(store: EphemerisStore, t_ns: int = TOE_NS, arrived: int | None = None, satellite: str = "G05") -> Ephemeris | None:
    """The ephemeris chosen at one time, when `arrived` (by default all) had arrived."""
    count = len(store.ephemerides) if arrived is None else arrived
    index = int(store.choose((satellite,), np.array([t_ns]), np.array([count]))[0, 0])
    return None if index < 0 else store.ephemerides[index]


def over(store: EphemerisStore, times_ns: list[int]) -> list[Ephemeris | None]:
    """What serves G05 over a block in which everything had arrived."""
    index = store.choose(("G05",), np.array(times_ns), np.full(len(times_ns), len(store.ephemerides)))
    return [None if k < 0 else store.ephemerides[k] for k in index[:, 0].tolist()]


def test_the_latest_transmitted_serves() -> None:
    assert serving(EphemerisStore((OLD, NEW))) == NEW


def test_the_latest_transmitted_serves_though_it_arrived_first() -> None:
    assert serving(EphemerisStore((NEW, OLD))) == NEW


def test_the_latest_transmitted_serves_whatever_its_issue_and_reference_time() -> None:
    # Issues begin again, and a satellite may go back to an earlier reference time after an upload.
    before = replace(OLD, issue=9, toe_ns=TOE_NS + HOUR_NS)
    assert serving(EphemerisStore((NEW, before))) == NEW


def test_what_has_not_arrived_does_not_serve() -> None:
    assert serving(EphemerisStore((OLD, NEW)), arrived=1) == OLD


def test_nothing_serves_before_anything_arrived() -> None:
    assert serving(EphemerisStore((OLD, NEW)), arrived=0) is None


def test_a_set_that_arrives_in_mid_block_serves_from_then_on() -> None:
    store = EphemerisStore((OLD, NEW))
    index = store.choose(("G05",), TOE_NS + np.arange(4) * NS_PER_S, np.array([0, 1, 1, 2]))
    assert index[:, 0].tolist() == [-1, 0, 0, 1]


def test_a_satellite_without_ephemeris_has_none() -> None:
    assert serving(EphemerisStore((OLD, NEW)), satellite="G06") is None


@pytest.mark.parametrize("sign", [-1, 1])
@pytest.mark.parametrize("kind", EVERY_KIND)
def test_at_the_end_of_the_fit_interval_it_serves(kind: str, sign: int) -> None:
    eph = EVERY_KIND[kind]
    assert serving(EphemerisStore((eph,)), eph.toe_ns + sign * round(eph.fit_half_s * NS_PER_S), satellite=eph.satellite) == eph


@pytest.mark.parametrize("sign", [-1, 1])
@pytest.mark.parametrize("kind", EVERY_KIND)
def test_a_nanosecond_beyond_the_fit_interval_it_does_not(kind: str, sign: int) -> None:
    eph = EVERY_KIND[kind]
    assert serving(EphemerisStore((eph,)), eph.toe_ns + sign * (round(eph.fit_half_s * NS_PER_S) + 1), satellite=eph.satellite) is None


def test_over_a_block_a_set_serves_in_its_fit_interval_alone() -> None:
    times_ns = [TOE_NS + k for k in (-FIT_NS - 1, -FIT_NS, 0, FIT_NS, FIT_NS + 1)]
    assert over(EphemerisStore((GPS,)), times_ns) == [None, GPS, GPS, GPS, None]


def test_beyond_the_fit_interval_of_the_latest_an_older_one_serves() -> None:
    ahead = replace(NEW, toe_ns=TOE_NS + 2 * HOUR_NS)
    assert over(EphemerisStore((OLD, ahead)), [TOE_NS - 1, TOE_NS, TOE_NS + FIT_NS + 1]) == [OLD, ahead, ahead]


def test_an_unhealthy_latest_is_not_replaced_by_an_older_healthy_one() -> None:
    unhealthy = replace(NEW, healthy=False)
    assert serving(EphemerisStore((OLD, unhealthy))) == unhealthy


def test_health_that_changes_without_a_new_issue() -> None:
    unhealthy = replace(NEW, healthy=False, transmission_ns=NEW.transmission_ns + 30 * NS_PER_S)
    again = replace(NEW, transmission_ns=NEW.transmission_ns + 60 * NS_PER_S)
    store = EphemerisStore((NEW, unhealthy, again))
    index = store.choose(("G05",), TOE_NS + np.arange(3) * 30 * NS_PER_S, np.array([1, 2, 3]))
    assert [store.ephemerides[k].healthy for k in index[:, 0].tolist()] == [True, False, True]


def test_of_two_transmitted_together_the_later_reference_time_serves() -> None:
    later = replace(GPS, toe_ns=TOE_NS + HOUR_NS, issue=0)
    assert serving(EphemerisStore((later, GPS))) == later


def test_of_two_with_the_same_times_the_higher_issue_serves() -> None:
    assert serving(EphemerisStore((replace(GPS, issue=8), replace(GPS, issue=7)))) == replace(GPS, issue=8)


def test_sets_on_both_sides_of_the_end_of_a_week() -> None:
    week_ns = (TOE_NS // WEEK_NS + 1) * WEEK_NS
    last, first = (replace(GPS, issue=k, toe_ns=t, transmission_ns=t - 2 * HOUR_NS) for k, t in ((8, week_ns), (9, week_ns + 2 * HOUR_NS)))
    assert over(EphemerisStore((last, first)), [week_ns - FIT_NS, week_ns - 1, week_ns]) == [last, last, first]


def test_by_its_issue_an_older_set_is_found() -> None:
    store = EphemerisStore((OLD, NEW))
    assert store.of_issue("G05", OLD.issue, TOE_NS) == 0


@pytest.mark.parametrize(("satellite", "issue", "t_ns"), [("G05", 3, TOE_NS), ("G06", 1, TOE_NS), ("G05", 1, TOE_NS + FIT_NS + 1)])
def test_no_set_of_an_issue(satellite: str, issue: int, t_ns: int) -> None:
    assert EphemerisStore((OLD, NEW)).of_issue(satellite, issue, t_ns) == -1


def test_of_two_sets_with_an_issue_the_one_transmitted_last_is_found() -> None:
    """Issues begin again."""
    later = replace(OLD, transmission_ns=NEW.transmission_ns + HOUR_NS)
    assert EphemerisStore((later, OLD, NEW)).of_issue("G05", OLD.issue, TOE_NS) == 0


def test_the_same_again_changes_nothing() -> None:
    store = EphemerisStore((OLD, NEW, OLD))
    store.add(NEW)
    assert tuple(store.ephemerides) == (OLD, NEW)


def test_what_is_added_after_a_choice_serves_at_the_next() -> None:
    store = EphemerisStore((OLD,))
    before = serving(store)
    store.add(NEW)
    assert (before, serving(store)) == (OLD, NEW)


@pytest.mark.parametrize(("after_fit_ns", "kept"), [(0, 1), (1, 0)])
def test_forgotten_is_only_what_no_later_epoch_can_use(after_fit_ns: int, kept: int) -> None:
    store = EphemerisStore((GPS,))
    store.forget_before(TOE_NS + FIT_NS + after_fit_ns)
    assert len(store.ephemerides) == kept


def test_what_was_forgotten_may_come_again() -> None:
    store = EphemerisStore((GPS,))
    store.forget_before(TOE_NS + FIT_NS + 1)
    store.add(GPS)
    assert tuple(store.ephemerides) == (GPS,)


@pytest.mark.parametrize("toe_ns", [-(2**63), 2**63 - 1])
def test_a_reference_time_at_the_end_of_all_numbers_never_serves(toe_ns: int) -> None:
    assert serving(EphemerisStore((replace(GPS, toe_ns=toe_ns, toc_ns=toe_ns),))) is None


def test_without_satellites_there_is_nothing_to_choose() -> None:
    assert EphemerisStore((GPS,)).choose((), np.array([TOE_NS]), np.array([1])).shape == (1, 0)


def test_types_of_sets_may_be_mixed() -> None:
    store = EphemerisStore(EVERY_KIND.values())
    assert len(store.ephemerides) == len(EVERY_KIND)
    assert isinstance(store.ephemerides[0], KeplerEphemeris)


@pytest.mark.parametrize("worse", [{"healthy": False}, {"accuracy_m": None}, {"accuracy_m": 48.0}])
def test_of_two_that_differ_in_what_they_promise_alone_the_worse_serves_in_any_order(worse: dict[str, Any]) -> None:
    """Files that leave times of transmission out have such pairs."""
    other = replace(GPS, **worse)
    assert [serving(EphemerisStore(order)) for order in ((GPS, other), (other, GPS))] == [other, other]


# ---- by content


def test_the_set_of_a_content_is_found_though_another_was_sent_later() -> None:
    assert EphemerisStore((OLD, NEW)).of_content("G05", content_crc32(OLD), TOE_NS, 2) == 0


def test_what_has_not_arrived_is_not_found_by_its_content() -> None:
    assert EphemerisStore((OLD, NEW)).of_content("G05", content_crc32(NEW), TOE_NS, 1) == -1


def test_what_has_ended_is_not_found_by_its_content() -> None:
    end_ns = OLD.toe_ns + round(OLD.fit_half_s * 1e9)
    assert [EphemerisStore((OLD,)).of_content("G05", content_crc32(OLD), t_ns, 1) for t_ns in (end_ns, end_ns + 1)] == [0, -1]


@pytest.mark.parametrize(("satellite", "crc32"), [("G05", 0), ("G06", content_crc32(OLD))])
def test_what_nobody_sent_is_not_found(satellite: str, crc32: int) -> None:
    assert EphemerisStore((OLD, NEW)).of_content(satellite, crc32, TOE_NS, 2) == -1
