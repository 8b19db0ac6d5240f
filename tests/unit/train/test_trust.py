"""Trust, row by row from every state, and to the nanosecond at both ends of validity. Times are of the train's clock."""

from dataclasses import FrozenInstanceError
from itertools import permutations, product
from typing import NamedTuple

import pytest

from integrity.messages.verification import NS_PER_MS, Received
from integrity.states import State
from train_client.trust import Trust, TrustLimits, TrustState, after_message, after_time, next_change_ns, together

CONFLICT = TrustState.CONFLICT
NORMAL, ANOMALY, NOT_CONFIRMABLE, STALE, NO_COMMS = STATES = [state for state in TrustState if state is not CONFLICT]
LIMITS = TrustLimits(recover_messages=3, no_comms_after_ns=2_000_000_000)
NOW = 7_000_000_000_000
VALID_NS, AGE_NS = 3_003 * NS_PER_MS, 1_001 * NS_PER_MS
LEFT_NS = 2_000 * NS_PER_MS  # 2,002 ms of age bound are 2,000 ms of a clock that is slow by 1e-3
SEQUENCE = 58

BEFORE = {  # one message has been counted, where a state allows that; the last one ends right now
    NORMAL: Trust(NORMAL, 5, NOW, 57),
    ANOMALY: Trust(ANOMALY, 1, NOW, 57),
    NOT_CONFIRMABLE: Trust(NOT_CONFIRMABLE, 1, NOW, 57),
    STALE: Trust(STALE, 0, NOW - 1, 57),
    NO_COMMS: Trust(NO_COMMS, 0, NOW - LIMITS.no_comms_after_ns - 1, 57),
}


def message(said: State = State.NORMAL, fresh: bool = True) -> Received:
    age_ns = AGE_NS if fresh else VALID_NS + 1
    return Received("", True, fresh, said=said, sequence=SEQUENCE, age_ns=age_ns, valid_ns=VALID_NS)


class Row(NamedTuple):
    """A message, and the trust that it leaves in each state before; None: the same object."""

    received: Received
    recover_messages: int
    after: dict[TrustState, Trust | None]


UNTOUCHED: dict[TrustState, Trust | None] = dict.fromkeys(STATES)
END_NS = NOW + LEFT_NS


def everywhere(trust: Trust) -> dict[TrustState, Trust | None]:
    return dict.fromkeys(STATES, trust)


ROWS = {
    "fresh anomaly": Row(message(State.SATELLITE_ANOMALY), 3, everywhere(Trust(ANOMALY, 0, END_NS, SEQUENCE))),
    "late anomaly": Row(message(State.SATELLITE_ANOMALY, fresh=False), 3, everywhere(Trust(ANOMALY, 0, NOW, SEQUENCE))),
    "fresh not confirmable": Row(message(State.NOT_CONFIRMABLE), 3, everywhere(Trust(NOT_CONFIRMABLE, 0, END_NS, SEQUENCE))),
    "late not confirmable": Row(message(State.NOT_CONFIRMABLE, fresh=False), 3, everywhere(Trust(NOT_CONFIRMABLE, 0, NOW, SEQUENCE))),
    "one more normal, not enough": Row(
        message(),
        3,
        {
            NORMAL: Trust(NORMAL, 6, END_NS, SEQUENCE),
            ANOMALY: Trust(ANOMALY, 2, END_NS, SEQUENCE),
            NOT_CONFIRMABLE: Trust(NOT_CONFIRMABLE, 2, END_NS, SEQUENCE),
            STALE: Trust(NOT_CONFIRMABLE, 1, END_NS, SEQUENCE),
            NO_COMMS: Trust(NOT_CONFIRMABLE, 1, END_NS, SEQUENCE),
        },
    ),
    "one more normal, enough for some": Row(
        message(),
        2,
        {
            NORMAL: Trust(NORMAL, 6, END_NS, SEQUENCE),
            ANOMALY: Trust(NORMAL, 2, END_NS, SEQUENCE),
            NOT_CONFIRMABLE: Trust(NORMAL, 2, END_NS, SEQUENCE),
            STALE: Trust(NOT_CONFIRMABLE, 1, END_NS, SEQUENCE),
            NO_COMMS: Trust(NOT_CONFIRMABLE, 1, END_NS, SEQUENCE),
        },
    ),
    "one normal is enough": Row(
        message(),
        1,
        {
            NORMAL: Trust(NORMAL, 6, END_NS, SEQUENCE),
            ANOMALY: Trust(NORMAL, 2, END_NS, SEQUENCE),
            NOT_CONFIRMABLE: Trust(NORMAL, 2, END_NS, SEQUENCE),
            STALE: Trust(NORMAL, 1, END_NS, SEQUENCE),
            NO_COMMS: Trust(NORMAL, 1, END_NS, SEQUENCE),
        },
    ),
    "late normal": Row(message(fresh=False), 1, UNTOUCHED),
    "normal of a boot not confirmed": Row(Received("", True, False, True, said=State.NORMAL, sequence=4), 1, UNTOUCHED),
    "anomaly of a boot not confirmed": Row(Received("", True, False, True, said=State.SATELLITE_ANOMALY, sequence=4), 1, UNTOUCHED),
    "refused": Row(Received("wrong signature"), 1, UNTOUCHED),
    "refused, whatever it says": Row(Received("", False, True, said=State.NORMAL, age_ns=0, valid_ns=VALID_NS), 1, UNTOUCHED),
    "refused, and it says stop": Row(Received("older", False, True, said=State.SATELLITE_ANOMALY, sequence=4), 1, UNTOUCHED),
}


@pytest.mark.parametrize("state", STATES)
@pytest.mark.parametrize("name", ROWS)
def test_a_message_in_every_state(name: str, state: TrustState) -> None:
    row, before = ROWS[name], BEFORE[state]
    after = after_message(before, row.received, NOW, LIMITS._replace(recover_messages=row.recover_messages))
    expected = row.after[state]
    assert after is before if expected is None else after == expected


END = 5_000_000_000
SILENT_NS = END + LIMITS.no_comms_after_ns
AFTER_TIME = {  # at the end of validity, 1 ns later, at the end of patience, 1 ns later
    NORMAL: (NORMAL, STALE, STALE, NO_COMMS),
    ANOMALY: (ANOMALY, STALE, STALE, NO_COMMS),
    NOT_CONFIRMABLE: (NOT_CONFIRMABLE, STALE, STALE, NO_COMMS),
    STALE: (STALE, STALE, STALE, NO_COMMS),
    NO_COMMS: (NO_COMMS, NO_COMMS, NO_COMMS, NO_COMMS),
}


@pytest.mark.parametrize("state", STATES)
@pytest.mark.parametrize("at, mono_ns", [(0, END), (1, END + 1), (2, SILENT_NS), (3, SILENT_NS + 1)])
def test_time_in_every_state(state: TrustState, at: int, mono_ns: int) -> None:
    before = Trust(state, 0 if state in (STALE, NO_COMMS) else 5, END, 57)
    expected = before if AFTER_TIME[state][at] is state else Trust(AFTER_TIME[state][at], 0, END, 57)
    assert after_time(before, mono_ns, LIMITS) == expected


@pytest.mark.parametrize("state", STATES)
def test_where_time_changes_nothing_nothing_is_made_anew(state: TrustState) -> None:
    before = Trust(state, 5, END, 57)
    assert after_time(before, END, LIMITS) is before


def test_the_same_in_one_step_and_in_steps() -> None:
    step_by_step = after_time(after_time(Trust(NORMAL, 5, END, 57), END + 1, LIMITS), SILENT_NS + 1, LIMITS)
    assert step_by_step == after_time(Trust(NORMAL, 5, END, 57), SILENT_NS + 1, LIMITS)


def test_without_patience_the_end_of_validity_is_no_comms() -> None:
    assert after_time(Trust(NORMAL, 5, END, 57), END + 1, LIMITS._replace(no_comms_after_ns=0)).state is NO_COMMS


@pytest.mark.parametrize(
    "state, patience_ns, expected",
    [
        (NORMAL, 2_000_000_000, END + 1),
        (ANOMALY, 2_000_000_000, END + 1),
        (NOT_CONFIRMABLE, 2_000_000_000, END + 1),
        (STALE, 2_000_000_000, SILENT_NS + 1),
        (NO_COMMS, 2_000_000_000, None),
        (NORMAL, 0, END + 1),
    ],
)
def test_when_something_will_change(state: TrustState, patience_ns: int, expected: int | None) -> None:
    assert next_change_ns(Trust(state, 5, END, 57), TrustLimits(3, patience_ns)) == expected


def test_before_the_first_message_nothing_will_change() -> None:
    assert next_change_ns(Trust(), LIMITS) is None


def test_trust_cannot_be_changed() -> None:
    with pytest.raises(FrozenInstanceError):
        Trust().state = NORMAL  # type: ignore[misc]


def test_it_begins_without_comms() -> None:
    assert Trust() == Trust(NO_COMMS, 0, None, None)


def fed(count: int, gaps_ns: dict[int, int] | None = None) -> Trust:
    """After `count` fresh NORMAL messages, one at each end of validity; before message i the clock goes on by `gaps_ns[i]` more."""
    trust, mono_ns = Trust(), NOW
    for i in range(count):
        mono_ns += LEFT_NS + (gaps_ns or {}).get(i, 0)
        trust = after_message(after_time(trust, mono_ns, LIMITS), message(), mono_ns, LIMITS)
    return trust


@pytest.mark.parametrize("count, state", [(1, NOT_CONFIRMABLE), (2, NOT_CONFIRMABLE), (3, NORMAL), (4, NORMAL)])
def test_normal_with_exactly_the_messages_asked_for(count: int, state: TrustState) -> None:
    assert fed(count).state is state


@pytest.mark.parametrize("gap_ns, normals", [(0, 4), (1, 2)])
def test_a_gap_of_one_nanosecond_starts_the_count_anew(gap_ns: int, normals: int) -> None:
    assert fed(4, {2: gap_ns}).normals == normals


@pytest.mark.parametrize("said", [State.SATELLITE_ANOMALY, State.NOT_CONFIRMABLE])
@pytest.mark.parametrize("fresh", [True, False])
def test_after_a_word_against_it_all_are_asked_for_again(said: State, fresh: bool) -> None:
    trust = after_message(fed(5), message(said, fresh), NOW, LIMITS)
    states = []
    for _ in range(3):
        trust = after_message(trust, message(), NOW, LIMITS)
        states.append(trust.state is NORMAL)
    assert states == [False, False, True]


def test_a_late_word_against_it_is_over_at_once() -> None:
    trust = after_message(fed(5), message(State.SATELLITE_ANOMALY, fresh=False), NOW, LIMITS)
    assert after_time(trust, NOW + 1, LIMITS).state is STALE


@pytest.mark.parametrize("normals, valid_until_ns", [(3, None), (0, NOW), (0, None)])
def test_normal_cannot_be_built_without_what_it_rests_on(normals: int, valid_until_ns: int | None) -> None:
    with pytest.raises(ValueError, match="NORMAL needs a message that is valid, and its end"):
        Trust(NORMAL, normals, valid_until_ns)


@pytest.mark.parametrize("left_ns", [0, 1])
def test_a_message_at_the_end_of_its_validity_ends_no_earlier_than_it_came(left_ns: int) -> None:
    received = Received("", True, True, said=State.NORMAL, sequence=1, age_ns=VALID_NS - left_ns, valid_ns=VALID_NS)
    until_ns = after_message(Trust(), received, NOW, LIMITS).valid_until_ns
    assert until_ns is not None and until_ns >= NOW


# While somebody else speaks in the station's name


@pytest.mark.parametrize("state", [state for state in STATES if state is not NORMAL])
@pytest.mark.parametrize("recover_messages", [1, 2, 3])
def test_held_trust_neither_rises_nor_counts_towards_it(state: TrustState, recover_messages: int) -> None:
    limits = LIMITS._replace(recover_messages=recover_messages)
    assert after_message(BEFORE[state], message(), NOW, limits, held=True) is BEFORE[state]


def test_held_trust_that_is_normal_stays_so() -> None:
    assert after_message(BEFORE[NORMAL], message(), NOW, LIMITS, held=True) == Trust(NORMAL, 6, END_NS, SEQUENCE)


@pytest.mark.parametrize("state", STATES)
@pytest.mark.parametrize("name", [name for name in ROWS if not name.startswith("one ")])
def test_held_or_not_everything_but_a_fresh_normal_means_the_same(name: str, state: TrustState) -> None:
    received = ROWS[name].received
    assert after_message(BEFORE[state], received, NOW, LIMITS, held=True) == after_message(BEFORE[state], received, NOW, LIMITS)


@pytest.mark.parametrize("state", [state for state in STATES if state is not NORMAL])
def test_released_from_the_hold_the_count_goes_on_where_it_was(state: TrustState) -> None:
    held = after_message(BEFORE[state], message(), NOW, LIMITS, held=True)
    assert after_message(held, message(), NOW, LIMITS) == after_message(BEFORE[state], message(), NOW, LIMITS)


# Several stations


@pytest.mark.parametrize("normals", [0, 1])
def test_one_station_does_not_contradict_itself(normals: int) -> None:
    with pytest.raises(ValueError, match=r"\Aone station does not contradict itself\Z"):
        Trust(CONFLICT, normals, NOW)


SAYING = {  # what each means beside others: a NORMAL that is not believed yet is a NORMAL, and silence nothing
    "normal": (Trust(NORMAL, 5, NOW), NORMAL),
    "one normal after an anomaly": (Trust(ANOMALY, 1, NOW), NORMAL),
    "one normal after silence": (Trust(NOT_CONFIRMABLE, 1, NOW), NORMAL),
    "anomaly": (Trust(ANOMALY, 0, NOW), ANOMALY),
    "not confirmable": (Trust(NOT_CONFIRMABLE, 0, NOW), NOT_CONFIRMABLE),
    "stale": (Trust(STALE, 0, NOW), None),
    "no comms": (Trust(NO_COMMS, 0, NOW), None),
    "never heard": (Trust(), None),
}
WORST = [ANOMALY, NOT_CONFIRMABLE, NO_COMMS, STALE, NORMAL]


@pytest.mark.parametrize("name", SAYING)
def test_what_a_station_has_said_last(name: str) -> None:
    trust, says = SAYING[name]
    assert trust.says is says


@pytest.mark.parametrize("name", SAYING)
def test_a_station_alone_is_trusted_as_it_is(name: str) -> None:
    trust, _ = SAYING[name]
    assert together([trust]) is trust.state


def test_where_nobody_vouches_there_is_nobody_to_hear() -> None:
    assert together([]) is NO_COMMS


@pytest.mark.parametrize(
    "names, state",
    [
        (("normal", "normal"), NORMAL),
        (("normal", "stale"), STALE),
        (("normal", "no comms"), NO_COMMS),
        (("normal", "never heard"), NO_COMMS),
        (("stale", "never heard"), NO_COMMS),
        (("normal", "anomaly"), CONFLICT),
        (("normal", "not confirmable"), CONFLICT),
        (("anomaly", "not confirmable"), CONFLICT),
        (("anomaly", "anomaly"), ANOMALY),
        (("not confirmable", "not confirmable"), NOT_CONFIRMABLE),
        (("anomaly", "never heard"), ANOMALY),
        (("not confirmable", "no comms"), NOT_CONFIRMABLE),
        (("normal", "one normal after an anomaly"), ANOMALY),  # both say NORMAL, one of them is not believed yet
        (("normal", "one normal after silence"), NOT_CONFIRMABLE),
        (("one normal after an anomaly", "anomaly"), CONFLICT),
        (("one normal after an anomaly", "one normal after silence"), ANOMALY),
        (("normal", "normal", "normal"), NORMAL),
        (("normal", "stale", "anomaly"), CONFLICT),
        (("stale", "anomaly", "never heard"), ANOMALY),
    ],
)
def test_several_stations_together(names: tuple[str, ...], state: TrustState) -> None:
    found = {together(SAYING[name][0] for name in order) for order in permutations(names)}
    assert found == {state}


@pytest.mark.parametrize("count", [2, 3])
def test_no_combination_is_better_than_any_of_its_stations(count: int) -> None:
    for several in product([trust for trust, _ in SAYING.values()], repeat=count):
        found = together(several)
        assert found is CONFLICT or WORST.index(found) == min(WORST.index(trust.state) for trust in several), several


@pytest.mark.parametrize("count", [1, 2, 3])
def test_normal_only_where_every_one_of_them_is(count: int) -> None:
    for several in product([trust for trust, _ in SAYING.values()], repeat=count):
        assert (together(several) is NORMAL) == all(trust.state is NORMAL for trust in several), several
