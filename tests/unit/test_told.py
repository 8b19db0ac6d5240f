"""What receivers were told of one satellite, each against the others, and which sets may serve then."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from integrity.gnss.constants import SPEED_OF_LIGHT_MPS
from integrity.gnss.ephemeris.broadcast import Ephemeris, KeplerEphemeris
from integrity.gnss.ephemeris.store import EphemerisStore
from integrity.gnss.gps_time import NS_PER_S
from integrity.gnss.navigation.collector import ARRIVES_WITHIN_NS
from integrity.monitors.told import FOLLOW_NS, Quantity, dispute
from integrity.reception.told import ToldSets
from recordings.faults.orbits import displaced
from tests.rinex_examples import EVERY_KIND

MOST_CHANGE = 5.5
HOUR_NS = 3600 * NS_PER_S
TRUE = EVERY_KIND["GPS"]
assert isinstance(TRUE, KeplerEphemeris)
SENT_NS = TRUE.transmission_ns


def off(size_m: float, of: Ephemeris = TRUE, **changed: Any) -> Ephemeris:
    """A set with a displaced orbit, under the same issue unless that is changed."""
    return replace(displaced(of, size_m, "along", of.transmission_ns), **changed)


def later(eph: Ephemeris, by_ns: int = 30 * NS_PER_S) -> Ephemeris:
    return replace(eph, transmission_ns=eph.transmission_ns + by_ns)


NEXT = replace(TRUE, issue=TRUE.issue + 1, transmission_ns=SENT_NS + HOUR_NS)  # the same orbit under another issue
FALSE = off(300.0, NEXT)
AHEAD = replace(NEXT, toe_ns=TRUE.toe_ns + HOUR_NS)
END_NS = TRUE.toe_ns + round(TRUE.fit_half_s * NS_PER_S)  # TRUE is good for so long
PAST_NS = END_NS + ARRIVES_WITHIN_NS + 1
BEIDOU, GALILEO = EVERY_KIND["BeiDou MEO"], EVERY_KIND["Galileo I/NAV"]
assert isinstance(GALILEO, KeplerEphemeris)


@pytest.mark.parametrize(
    "told",
    [
        {},
        {"A": TRUE},
        {"A": TRUE, "B": TRUE, "C": TRUE},
        {"A": TRUE, "B": later(TRUE), "C": TRUE},
        {"A": TRUE, "B": NEXT, "C": TRUE},
        {"A": TRUE, "B": replace(TRUE, healthy=False), "C": TRUE},
        {"A": TRUE, "B": replace(FALSE, healthy=False), "C": TRUE},
        {"A": TRUE, "B": replace(TRUE, accuracy_m=4.85), "C": TRUE},
        {"A": TRUE, "B": off(300.0, toe_ns=TRUE.toe_ns - 10 * HOUR_NS, transmission_ns=SENT_NS - 10 * HOUR_NS), "C": TRUE},
        {"A": TRUE, "B": off(300.0, toe_ns=TRUE.toe_ns + 5 * HOUR_NS), "C": TRUE},
        {"A": BEIDOU, "B": replace(BEIDOU, toe_ns=BEIDOU.toe_ns + 24 * HOUR_NS, transmission_ns=BEIDOU.transmission_ns + 24 * HOUR_NS)},
        {"A": GALILEO, "B": replace(GALILEO, group_delay_s=GALILEO.group_delay_s + 5e-9), "C": GALILEO},
    ],
    ids=[
        "nobody told",
        "one told",
        "all alike",
        "one told later",
        "one told the next set sooner",
        "one told that it is unhealthy",
        "another one, unhealthy",
        "another accuracy",
        "one of long ago",
        "one for when the others are no more",
        "an issue that came round",
        "another group delay under one issue of Galileo",
    ],
)
def test_what_may_be_told_to_one_receiver_and_not_to_another(told: Mapping[str, Ephemeris]) -> None:
    assert dispute(told, MOST_CHANGE) is None


@pytest.mark.parametrize(
    ("told", "odd", "receivers"),
    [
        ({"A": TRUE, "B": FALSE, "C": TRUE}, "B", "ABC"),
        ({"A": FALSE, "B": NEXT, "C": TRUE}, "A", "ABC"),
        ({"A": TRUE, "B": FALSE}, None, "AB"),
        ({"B": TRUE, "C": FALSE}, None, "BC"),
        ({"A": TRUE, "B": FALSE, "C": off(-300.0, NEXT)}, None, "ABC"),
        ({"A": TRUE, "B": FALSE, "C": replace(TRUE, healthy=False)}, None, "AB"),
        ({"A": off(-15.0), "B": off(15.0, NEXT), "C": replace(NEXT, issue=NEXT.issue + 1)}, None, "AB"),
        ({"A": TRUE, "B": replace(FALSE, transmission_ns=END_NS + ARRIVES_WITHIN_NS), "C": TRUE}, "B", "ABC"),
        ({"A": TRUE, "B": replace(AHEAD, transmission_ns=PAST_NS), "C": off(300.0, AHEAD)}, None, "BC"),
    ],
    ids=[
        "one of three",
        "one of three, the others at different sets",
        "two",
        "two others",
        "three ways",
        "the third says nothing of it",
        "the third agrees with both",
        "one that is said to be sent when the others are no more",
        "the third was right once",
    ],
)
def test_two_that_agree_name_the_third_and_nobody_else_is_named(told: Mapping[str, Ephemeris], odd: str | None, receivers: str) -> None:
    found = dispute(told, MOST_CHANGE)
    assert found is not None and (found.odd, found.receivers) == (odd, tuple(receivers))


@pytest.mark.parametrize("kind", ["GPS", "Galileo I/NAV", "Galileo F/NAV", "BeiDou MEO", "BeiDou GEO", "QZSS", "GLONASS", "SBAS"])
def test_it_is_seen_in_every_system(kind: str) -> None:
    of = EVERY_KIND[kind]
    found = dispute({"A": of, "B": off(300.0, of), "C": later(of)}, MOST_CHANGE)
    assert found is not None and (found.odd, found.quantity) == ("B", "orbit") and found.size_m == pytest.approx(300.0, rel=0.02)


@pytest.mark.parametrize(
    ("changed", "quantity", "size_m"),
    [
        ({"af0": TRUE.af0 + 1e-7}, "clock", 1e-7 * SPEED_OF_LIGHT_MPS),
        ({"group_delay_s": TRUE.group_delay_s + 1e-7}, "group delay", 1e-7 * SPEED_OF_LIGHT_MPS * (77 / 60) ** 2),
        ({"af0": TRUE.af0 + 2.0**-31}, "clock", 2.0**-31 * SPEED_OF_LIGHT_MPS),
    ],
    ids=["clock", "group delay, of L2", "one bit under one issue"],
)
def test_what_differs_is_told(changed: Mapping[str, Any], quantity: Quantity, size_m: float) -> None:
    found = dispute({"A": TRUE, "B": replace(TRUE, **changed), "C": TRUE}, MOST_CHANGE)
    assert found is not None and found.quantity == quantity and found.size_m == pytest.approx(size_m, rel=1e-3)


def test_it_holds_once_the_others_had_the_time_to_be_told_the_same() -> None:
    found = dispute({"A": TRUE, "B": FALSE, "C": TRUE}, MOST_CHANGE)
    assert found is not None and found.from_ns == FALSE.transmission_ns + FOLLOW_NS


def test_it_holds_until_a_set_ends() -> None:
    found = dispute({"A": TRUE, "B": replace(FALSE, toe_ns=TRUE.toe_ns + HOUR_NS), "C": TRUE}, MOST_CHANGE)
    assert found is not None and found.until_ns == TRUE.toe_ns + round(TRUE.fit_half_s * NS_PER_S)


def test_a_set_for_later_is_held_against_those_that_will_serve_then() -> None:
    ahead = off(300.0, NEXT, toe_ns=TRUE.toe_ns + 3 * HOUR_NS)
    found = dispute({"A": TRUE, "B": ahead, "C": TRUE}, MOST_CHANGE)
    assert found is not None and found.odd == "B"


# ---- which sets may serve


def told_in_turn(turns: Sequence[tuple[str, Ephemeris]]) -> list[Ephemeris]:
    """All sets that the store gets when receivers are told these."""
    sets = ToldSets((), MOST_CHANGE)
    return [eph for receiver, told in turns for _, eph in sets.tell(receiver, told)]


def serving(turns: Sequence[tuple[str, Ephemeris]]) -> Ephemeris:
    """The set that serves shortly after the last one was told."""
    store = EphemerisStore(told_in_turn(turns))
    t_ns = max(eph.transmission_ns for _, eph in turns) + NS_PER_S
    return store.ephemerides[int(store.choose([TRUE.satellite], np.array([t_ns]), np.array([len(store)]))[0, 0])]


ALL_TOLD = [("A", TRUE), ("B", TRUE), ("C", TRUE)]


@pytest.mark.parametrize("receiver", ["A", "B", "C"])
def test_a_false_set_of_one_never_serves(receiver: str) -> None:
    assert FALSE not in told_in_turn([*ALL_TOLD, (receiver, FALSE)])


@pytest.mark.parametrize("receiver", ["A", "B", "C"])
def test_those_that_are_told_the_truth_go_on_beside_it(receiver: str) -> None:
    other = next(r for r in "CBA" if r != receiver)
    assert serving([*ALL_TOLD, (receiver, FALSE), (other, later(NEXT))]).issue == NEXT.issue


def test_what_the_first_was_told_serves_at_once() -> None:
    assert told_in_turn([("B", TRUE)]) == [TRUE]


def test_a_new_set_serves_at_once() -> None:
    assert serving([*ALL_TOLD, ("C", NEXT)]) == NEXT


def test_who_came_first_stays_while_two_differ() -> None:
    assert told_in_turn([("B", FALSE), ("A", TRUE)]) == [FALSE]


@pytest.mark.parametrize("first", ["A", "B", "C"])
def test_a_false_set_that_came_first_serves_no_longer_than_until_two_were_told_otherwise(first: str) -> None:
    others = [r for r in "ABC" if r != first]
    found = serving([(first, later(FALSE, 600 * NS_PER_S)), *((r, TRUE) for r in others)])
    assert found == replace(TRUE, transmission_ns=FALSE.transmission_ns + 600 * NS_PER_S + 1)


def test_a_satellite_that_sends_a_false_set_is_believed_of_two() -> None:
    assert serving([*ALL_TOLD, ("A", FALSE), ("B", FALSE)]) == FALSE


def test_a_satellite_that_is_not_healthy_is_out_whoever_was_told_so() -> None:
    assert not serving([*ALL_TOLD, ("B", replace(later(FALSE), healthy=False))]).healthy


def test_a_receiver_that_is_told_the_truth_again_is_named_no_more() -> None:
    sets = ToldSets((), MOST_CHANGE)
    for receiver, eph in [*ALL_TOLD, ("B", FALSE), ("B", later(TRUE, HOUR_NS))]:
        sets.tell(receiver, eph)
    assert sets.disputes == ()


def test_nothing_is_compared_without_a_limit() -> None:
    sets = ToldSets([("A", TRUE), ("C", TRUE)], None)
    assert (sets.tell("B", FALSE), sets.disputes) == ([("B", FALSE)], ())


def test_the_odd_ones_reference_time_is_not_the_latest() -> None:
    ahead = replace(FALSE, toe_ns=TRUE.toe_ns + HOUR_NS)
    assert ToldSets([*ALL_TOLD[:2], ("C", ahead)], MOST_CHANGE).latest_toe_ns(TRUE) == TRUE.toe_ns


def test_what_no_receiver_was_told_is_not_remembered() -> None:
    damage: dict[str, Any] = {"crs": float("nan")}
    damaged = replace(TRUE, **damage)
    assert ToldSets([("A", damaged), ("B", replace(damaged, issue=1)), ("C", TRUE)], MOST_CHANGE).disputes == ()
