"""The published state: all states against all inputs, and the count of clean epochs."""

from dataclasses import FrozenInstanceError, replace
from itertools import product

import pytest
from hypothesis import given
from hypothesis import strategies as st

from integrity.gnss.gps_time import NS_PER_S
from integrity.health import TABLE, Health, Input, after_epoch, after_silence
from integrity.states import STATE_OF_CAUSE, Cause, State
from integrity.verdict import CLEAN, Verdict
from tests.unit.streams import LIMITS as SITE_LIMITS

LIMITS = replace(SITE_LIMITS, recover_after_ns=30 * NS_PER_S, recover_epochs=2)
NORMAL = Health(State.NORMAL, Cause.NONE)
BAD_CAUSES = [cause for cause in Cause if cause is not Cause.NONE]
BAD = [Verdict(STATE_OF_CAUSE[cause], cause, ("B",)) for cause in BAD_CAUSES]
SILENCE = Verdict(State.NOT_CONFIRMABLE, Cause.DATA, ("B",))
PUBLISHED = [NORMAL, *(Health(STATE_OF_CAUSE[cause], cause, ("A",)) for cause in BAD_CAUSES)]
COUNTING = [replace(h, clean_since_ns=0, clean_epochs=n) for h in PUBLISHED for n in (1, 7)]
EVERY_STATE = [*PUBLISHED, *COUNTING]


def states(healths: list[Health]) -> list[State]:
    return [h.state for h in healths]


def after(verdicts: list[Verdict], start: Health | None = None, interval_s: float = 1.0) -> list[Health]:
    """Memory after each of a row of epochs."""
    now, passed = start or Health(), []
    for k, verdict in enumerate(verdicts):
        now = after_epoch(now, verdict, round(k * interval_s * NS_PER_S), LIMITS)
        passed.append(now)
    return passed


@pytest.mark.parametrize(("state", "cause"), list(product(State, Cause)))
def test_only_the_state_of_a_cause_can_be_built(state: State, cause: Cause) -> None:
    legal = state is (State.NORMAL if cause is Cause.NONE else STATE_OF_CAUSE[cause])
    try:
        Health(state, cause)
    except ValueError:
        built = False
    else:
        built = True
    assert built == legal


@pytest.mark.parametrize(("state", "cause"), list(product(State, Cause)))
def test_only_the_state_of_a_cause_can_be_a_verdict(state: State, cause: Cause) -> None:
    legal = state is (State.NORMAL if cause is Cause.NONE else STATE_OF_CAUSE[cause])
    try:
        Verdict(state, cause)
    except ValueError:
        built = False
    else:
        built = True
    assert built == legal


def test_health_cannot_be_changed() -> None:
    with pytest.raises(FrozenInstanceError):
        NORMAL.state = State.NOT_CONFIRMABLE  # type: ignore[misc]


def test_before_the_first_epoch_nothing_is_confirmed() -> None:
    assert (Health().state, Health().cause) == (State.NOT_CONFIRMABLE, Cause.NOT_READY)


@pytest.mark.parametrize("verdict", BAD, ids=BAD_CAUSES)
@pytest.mark.parametrize("now", EVERY_STATE)
def test_a_failing_epoch_is_published_at_once(now: Health, verdict: Verdict) -> None:
    assert after_epoch(now, verdict, 10**12, LIMITS) == Health(verdict.state, verdict.cause, verdict.subjects)


@pytest.mark.parametrize("now", EVERY_STATE)
def test_silence_is_published_at_once(now: Health) -> None:
    assert after_silence(now, SILENCE) == Health(State.NOT_CONFIRMABLE, Cause.DATA, ("B",))


@pytest.mark.parametrize("now", PUBLISHED[1:])
def test_a_first_clean_epoch_keeps_what_is_published(now: Health) -> None:
    ran = replace(now, started=True)
    assert after_epoch(ran, CLEAN, 5, LIMITS) == replace(ran, clean_since_ns=5, clean_epochs=1)


def test_before_the_first_normal_waiting_for_data_leaves_not_ready() -> None:
    counting = after_epoch(after_silence(Health(), SILENCE), CLEAN, 5, LIMITS)
    assert counting == Health(State.NOT_CONFIRMABLE, Cause.NOT_READY, (), 5, 1)


@pytest.mark.parametrize("now", EVERY_STATE)
def test_having_been_normal_is_never_forgotten(now: Health) -> None:
    ran = replace(now, started=True)
    assert after_silence(ran, SILENCE).started and all(after_epoch(ran, v, 5, LIMITS).started for v in (CLEAN, *BAD))


@pytest.mark.parametrize("now", PUBLISHED[1:])
def test_enough_clean_epochs_lead_to_normal(now: Health) -> None:
    ready = replace(now, clean_since_ns=0, clean_epochs=1)
    assert after_epoch(ready, CLEAN, 30 * NS_PER_S, LIMITS) == Health(State.NORMAL, Cause.NONE, (), 0, 2, started=True)


def test_where_one_clean_epoch_is_enough_it_is_the_first_of_them() -> None:
    at_once = replace(LIMITS, recover_after_ns=0, recover_epochs=1)
    assert after_epoch(Health(), CLEAN, 5, at_once) == Health(State.NORMAL, Cause.NONE, (), 5, 1, started=True)


def test_who_is_normal_in_a_clean_epoch_has_been_normal() -> None:
    assert after_epoch(NORMAL, CLEAN, 5, LIMITS).started


def test_normal_stays_normal_in_a_clean_epoch() -> None:
    assert after_epoch(NORMAL, CLEAN, 5, LIMITS).state is State.NORMAL


@pytest.mark.parametrize("meaning", [m for m in Input if m is not Input.PROVEN])
@pytest.mark.parametrize("now", EVERY_STATE[1:])
def test_no_other_row_of_the_table_leads_to_normal(now: Health, meaning: Input) -> None:
    verdict = SILENCE if meaning in (Input.FAILS, Input.SILENT) else CLEAN
    assert TABLE[meaning](now, verdict, 10**12).state is not State.NORMAL or now.state is State.NORMAL


@pytest.mark.parametrize(("wait_ns", "state"), [(30 * NS_PER_S - 1, State.NOT_CONFIRMABLE), (30 * NS_PER_S, State.NORMAL)])
def test_recovery_at_its_time_to_the_nanosecond(wait_ns: int, state: State) -> None:
    now = after_epoch(Health(), CLEAN, 0, LIMITS)
    assert after_epoch(now, CLEAN, wait_ns, LIMITS).state is state


def test_start_up_at_1_hz_takes_30_s() -> None:
    assert states(after([CLEAN] * 32)).index(State.NORMAL) == 30


def test_one_clean_epoch_is_not_enough_however_long_after() -> None:
    # Two epochs, an hour apart: the second is the second.
    assert states(after([CLEAN] * 2, interval_s=3600.0)) == [State.NOT_CONFIRMABLE, State.NORMAL]


def test_a_first_clean_epoch_is_not_enough_where_no_time_is_asked_for() -> None:
    at_once = replace(LIMITS, recover_after_ns=0)
    first = after_epoch(Health(), CLEAN, 0, at_once)
    assert states([first, after_epoch(first, CLEAN, NS_PER_S, at_once)]) == [State.NOT_CONFIRMABLE, State.NORMAL]


def test_a_failure_starts_the_time_again() -> None:
    assert states(after([CLEAN] * 20 + BAD[:1] + [CLEAN] * 40)).index(State.NORMAL) == 21 + 30


def test_silence_starts_the_time_again() -> None:
    silent = after_silence(after([CLEAN] * 20)[-1], SILENCE)
    assert states(after([CLEAN] * 40, silent)).index(State.NORMAL) == 30


def test_the_published_cause_stays_while_clean_epochs_are_counted() -> None:
    passed = after([BAD[3], *[CLEAN] * 30], Health(started=True))
    assert {(h.state, h.cause, h.subjects) for h in passed} == {(BAD[3].state, BAD[3].cause, BAD[3].subjects)}


@given(st.lists(st.sampled_from([CLEAN, CLEAN, CLEAN, CLEAN, *BAD]), max_size=80))
def test_normal_only_after_30_s_without_a_failure(verdicts: list[Verdict]) -> None:
    for k, now in enumerate(after(verdicts)):
        if now.state is State.NORMAL:
            assert verdicts[max(k - 30, 0) : k + 1] == [CLEAN] * 31
