"""Navigation messages of two antennas: taken alike or not at all."""

from dataclasses import replace

import pytest

from integrity.gnss.ephemeris.broadcast import KeplerEphemeris
from recordings.simulate.constellation import constellation
from tests.unit.positioning.field import START_NS
from train_client.positioning.navigation import NavigationAgreement

FIRST, SECOND = (eph for eph in constellation(5, START_NS, START_NS + 7200 * 10**9) if eph.satellite == "G02")
LATER = replace(FIRST, transmission_ns=FIRST.transmission_ns + 30 * 10**9)
FALSE = replace(FIRST, m0=FIRST.m0 + 1e-6)


def two() -> NavigationAgreement:
    return NavigationAgreement(("front", "rear"))


def after(*told: tuple[str, KeplerEphemeris]) -> NavigationAgreement:
    agreement = two()
    for antenna, ephemeris in told:
        agreement.told(antenna, ephemeris)
    return agreement


def test_known_to_one_only_is_not_taken() -> None:
    assert two().told("front", FIRST) == []


def test_told_alike_it_is_taken_once_as_transmitted_last() -> None:
    agreement = after(("front", LATER))
    assert [agreement.told("rear", FIRST), agreement.told("rear", LATER), agreement.told("front", FIRST)] == [[LATER], [], []]


def test_one_antenna_is_believed_at_once() -> None:
    assert NavigationAgreement(("only",)).told("only", FIRST) == [FIRST]


@pytest.mark.parametrize("order", [("front", "rear"), ("rear", "front")])
def test_a_contradiction_is_not_taken_and_named(order: tuple[str, str]) -> None:
    agreement = after((order[0], FIRST))
    assert (agreement.told(order[1], FALSE), agreement.mismatched) == ([], ("G02",))


def test_a_contradiction_after_agreement_is_named() -> None:
    assert after(("front", FIRST), ("rear", FIRST), ("rear", FALSE)).mismatched == ("G02",)


def test_it_ends_when_the_same_set_is_told_alike_again() -> None:
    agreement = after(("front", FIRST), ("rear", FALSE))
    assert (agreement.told("rear", LATER), agreement.mismatched) == ([LATER], ())


def test_it_ends_with_a_later_set_told_alike() -> None:
    agreement = after(("front", FIRST), ("rear", FALSE), ("front", SECOND), ("rear", SECOND))
    assert agreement.mismatched == ()


def test_it_does_not_end_with_an_earlier_set_told_alike() -> None:
    wrong = replace(SECOND, af0=SECOND.af0 + 1e-6)
    assert after(("front", SECOND), ("rear", wrong), ("front", FIRST), ("rear", FIRST)).mismatched == ("G02",)


def test_a_later_set_told_by_one_only_is_no_contradiction() -> None:
    assert after(("front", FIRST), ("rear", FIRST), ("rear", SECOND)).mismatched == ()


def test_another_starts_where_this_one_stands() -> None:
    memory = after(("front", FIRST), ("front", SECOND), ("rear", FALSE)).memory()
    copy = NavigationAgreement(("front", "rear"), memory)
    assert (copy.mismatched, copy.told("rear", SECOND), copy.mismatched) == (("G02",), [SECOND], ())


def test_what_no_epoch_can_use_is_forgotten() -> None:
    agreement = after(("front", FIRST), ("rear", FALSE), ("front", SECOND))
    agreement.forget_before(FIRST.toe_ns + round(FIRST.fit_half_s * 1e9) + 1)
    assert (agreement.mismatched, agreement.memory()) == ((), (("front", SECOND),))


def test_a_stranger_is_refused() -> None:
    with pytest.raises(ValueError, match="middle"):
        two().told("middle", FIRST)
