"""Stops, alarms, jumps of the clock and snapshots, with two stations: what is latched, what is held, and that nothing is forgotten."""

from collections.abc import Sequence
from functools import cache
from typing import NamedTuple

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from integrity.events import Tick
from integrity.gnss.gps_time import NS_PER_S
from integrity.messages import wayside_pb2 as pb
from tests.unit.train.ride import measured, positions, valid
from tests.unit.train.stations import (
    BORDER,
    EPOCHS,
    HAND_OVER,
    QUICK,
    TRUSTED,
    A,
    B,
    Make,
    at_ns,
    epochs,
    falls_silent,
    forged,
    localiser,
    once_in_five,
    says_anomaly,
    stream,
    two_station_train,
)
from train_client.events import StopReleased, TrainEvent
from train_client.localisation.localiser import TrainLocaliser
from train_client.outputs import MessageRefused, StopChange, TrainOutput, TrustChange
from train_client.snapshots import decode_snapshot, encode_snapshot
from train_client.stop import StopLimits, StopState
from train_client.trust import TrustLimits, TrustState

NONE, REQUESTED, LATCHED = StopState.NONE, StopState.REQUESTED, StopState.LATCHED
ALL = set(range(2, EPOCHS))
NO_VALID = "the train has no VALID position yet"
ANOMALY = says_anomaly(10, 15)  # of B; trust is back with the third NORMAL after it, in epoch 17
BACK = 17


class Told(NamedTuple):
    """A change of the stop, or a release that does not count: in which epoch."""

    epoch: float
    state: StopState
    refusal: str = ""


def told(outputs: Sequence[TrainOutput]) -> list[Told]:
    step_ns = at_ns(1) - at_ns(0)
    return [Told((o.mono_ns - at_ns(0)) / step_ns, o.stop.state, o.refusal) for o in outputs if isinstance(o, StopChange)]


# ---- stops

FIRST, ASKED = Told(2, NONE), Told(10, LATCHED)


@pytest.mark.parametrize(
    "release, refused, ended",
    [
        ((), [], []),
        ((6,), [Told(6, NONE, "no stop is latched")], []),
        ((12,), [Told(12, LATCHED, NO_VALID)], []),  # it is as B says
        ((BACK - 1,), [Told(BACK - 1, LATCHED, NO_VALID)], []),  # B is NORMAL, not for long enough yet
        ((BACK,), [], [Told(BACK, NONE)]),
        ((20,), [], [Told(20, NONE)]),
        ((BACK - 1, 20), [Told(BACK - 1, LATCHED, NO_VALID)], [Told(20, NONE)]),
        ((20, 21), [], [Told(20, NONE), Told(21, NONE, "no stop is latched")]),
    ],
)
def test_a_stop_is_latched_until_it_is_released_and_not_before_trust_is_back(
    release: tuple[int, ...], refused: list[Told], ended: list[Told]
) -> None:
    outputs = localiser().feed(stream(b=ANOMALY, more={number: [StopReleased] for number in release}))
    assert told(outputs) == sorted([FIRST, ASKED, *refused, *ended])


def test_a_latched_stop_does_not_end_positions() -> None:
    outputs = localiser().feed(stream(b=ANOMALY))
    assert epochs(valid(outputs)) == ALL - set(range(10, BACK))
    assert positions(outputs)[-1].stop.state is LATCHED


def test_with_automatic_release_the_next_valid_position_ends_it() -> None:
    train = two_station_train(stop=StopLimits(3 * NS_PER_S, False))
    outputs = localiser(train=train).feed(stream(b=ANOMALY))
    assert told(outputs) == [FIRST, Told(10, REQUESTED), Told(BACK, NONE)]


@pytest.mark.parametrize("returns, more", [(34, []), (35, [Told(35, LATCHED)])])
def test_silence_asks_for_a_stop_only_after_a_while(returns: int, more: list[Told]) -> None:
    """The last message of B, of epoch 19, is valid for five epochs; the stop is due 10.25 epochs after them."""
    train = two_station_train(stop=StopLimits(2_050_000_000, True), trust=TrustLimits(1, 2 * NS_PER_S))
    assert told(localiser(train=train).feed(stream(b=falls_silent(20, returns)))) == [Told(0, NONE), *more]


def test_the_deadline_is_when_silence_asks_for_a_stop() -> None:
    """After those at which trust in B is STALE, then the antennas silent: nothing has changed a nanosecond before."""
    train = localiser(train=two_station_train(stop=StopLimits(NS_PER_S, True)))
    train.feed(e for e in stream(b=falls_silent(20)) if e.mono_ns <= at_ns(23))
    found: list[tuple[StopState, StopState]] = []
    for _ in range(6):
        due_ns = train.next_deadline_ns
        assert due_ns is not None
        train.feed([Tick(due_ns - 1, due_ns, None)])
        before = train.snapshot().stop
        train.feed([Tick(due_ns, due_ns, None)])
        stop = train.snapshot().stop
        found.append((before.state, stop.state))
        if stop.state is LATCHED:
            break
    assert found[-1] == (NONE, LATCHED)
    assert stop.lost_ns is not None and stop.since_ns == due_ns == stop.lost_ns + NS_PER_S


def test_what_is_asked_for_before_the_first_position_is_not_latched() -> None:
    assert told(localiser().feed(stream(b=says_anomaly(0, 15)))) == [Told(BACK, NONE)]


def test_a_change_of_the_stop_is_told_with_the_position_as_it_is_then() -> None:
    train, found = localiser(), []
    for event in stream(b=ANOMALY, more={20: [StopReleased]}):
        outputs = train.feed([event])
        found += [(o.stop, positions(outputs)[-1].stop) for o in outputs if isinstance(o, StopChange)]
    assert [change.state for change, _ in found] == [NONE, LATCHED, NONE]
    assert all(change == told_with_it for change, told_with_it in found)


SPAN = 12  # an epoch with a message for this one and four before it: two of them in A's stretch alone


def test_an_anomaly_stops_at_once_also_where_earlier_epochs_have_just_been_confirmed() -> None:
    outputs = localiser(HAND_OVER, QUICK).feed(stream(once_in_five(SPAN % 5), once_in_five(SPAN % 5, says_anomaly(SPAN))))
    assert told(outputs) == [FIRST, Told(SPAN, LATCHED)]


def test_a_release_does_not_count_while_a_station_of_the_place_is_abnormal() -> None:
    b = once_in_five(SPAN % 5, says_anomaly(SPAN - 5))
    outputs = localiser(HAND_OVER, QUICK).feed(stream(once_in_five(SPAN % 5), b, {SPAN: [StopReleased]}))
    assert told(outputs) == [FIRST, Told(BORDER, LATCHED), Told(SPAN, LATCHED, NO_VALID)]


def test_an_epoch_that_has_waited_needs_the_word_of_where_the_train_is_by_now_too() -> None:
    """A confirms two epochs of its own stretch when the train has reached B's, and B is abnormal."""
    b = once_in_five(SPAN % 5, says_anomaly(SPAN - 5))
    outputs = localiser(HAND_OVER, QUICK).feed(stream(once_in_five(SPAN % 5), b))
    assert {r.trust for r in valid(outputs)} == {TrustState.NORMAL}
    assert epochs(valid(outputs)) == set(range(8))


# ---- alarms


def attacked(site: str, number: int) -> dict[int, list[Make]]:
    """Three forged messages in an epoch."""
    return {number: [forged(site)] * 3}


@pytest.mark.parametrize("site", [A, B])
def test_an_alarm_does_not_end_what_is_normal(site: str) -> None:
    assert epochs(valid(localiser().feed(stream(more=attacked(site, 20))))) == ALL


def test_the_third_message_raises_it_and_positions_tell_whose_name_it_is() -> None:
    outputs = localiser().feed(stream(more=attacked(B, 20)))
    assert [(o.site, o.alarm) for o in outputs if isinstance(o, MessageRefused)] == [(B, False), (B, False), (B, True)]
    assert [(s.site, s.security_alarm, s.refused_messages) for s in positions(outputs)[-1].stations] == [(A, False, 0), (B, True, 3)]


def test_while_an_alarm_lasts_trust_does_not_come_back() -> None:
    outputs = localiser().feed(stream(b=ANOMALY, more=attacked(B, 14)))
    assert epochs(valid(outputs)) == set(range(2, 10))


def test_an_alarm_in_the_name_of_one_does_not_hold_the_other() -> None:
    outputs = localiser().feed(stream(b=ANOMALY, more=attacked(A, 14)))
    assert epochs(valid(outputs)) == ALL - set(range(10, BACK))


def test_two_forged_messages_are_no_alarm() -> None:
    outputs = localiser().feed(stream(b=ANOMALY, more={14: [forged(B)] * 2}))
    assert epochs(valid(outputs)) == ALL - set(range(10, BACK))


def test_ten_seconds_after_the_last_of_them_trust_rises_as_always() -> None:
    """The alarm is still there in epoch 50; then three messages are asked for."""
    outputs = localiser().feed(stream(more=attacked(B, 0), sent=measured(12.0)))
    assert epochs(valid(outputs)) == set(range(53, 60))


# ---- the train's clock


def test_where_the_clock_steps_back_trust_in_both_is_gone_and_earned_anew() -> None:
    def mono(gps_ns: int) -> int:
        return gps_ns - (5 * NS_PER_S if gps_ns >= at_ns(20) else 0)

    outputs = localiser().feed(stream(mono=mono))
    lost = [(o.site, o.reasons) for o in outputs if isinstance(o, TrustChange) and o.state is TrustState.NO_COMMS]
    assert lost == [(site, ("the train's clock stepped back by 4.800 s",)) for site in (A, B)]
    assert epochs(valid(outputs)) == ALL - {20, 21}


def test_where_the_clock_steps_back_a_latched_stop_stays() -> None:
    def mono(gps_ns: int) -> int:
        return gps_ns - (3600 * NS_PER_S if gps_ns >= at_ns(20) else 0)

    stop = positions(localiser().feed(stream(b=ANOMALY, mono=mono)))[-1].stop
    assert (stop.state, stop.since_ns) == (LATCHED, at_ns(10))


# ---- snapshots


@cache
def eventful() -> tuple[TrainEvent, ...]:
    """From A's stretch to B's; B is abnormal for a while, forged messages hold it, releases come too early and in time, A falls silent."""
    more: dict[int, list[Make]] = {4: [forged(A)] * 2, 18: [StopReleased], 21: [forged(B)], 26: [StopReleased], 30: [forged(B)] * 3}
    return tuple(stream(a=falls_silent(33), b=says_anomaly(12, 17), more=more))


def restored(train: TrainLocaliser) -> TrainLocaliser:
    """Another one that begins with its snapshot, through the message."""
    message = encode_snapshot(train.snapshot(), train.train, HAND_OVER, 0).SerializeToString()
    return TrainLocaliser(train.train, HAND_OVER, TRUSTED, decode_snapshot(pb.TrainSnapshot.FromString(message), HAND_OVER))


def run(cuts: Sequence[int], go_on: bool) -> list[TrainOutput]:
    """With a snapshot before these events; `go_on`: another localiser goes on from it."""
    train, outputs = localiser(HAND_OVER), []
    for before, after in zip([0, *cuts], [*cuts, len(eventful())], strict=True):
        outputs += train.feed(eventful()[before:after])
        train.snapshot()
        train = restored(train) if go_on else train
    return outputs


def test_the_story_has_in_it_what_a_snapshot_must_keep() -> None:
    outputs = run([], False)
    assert {t.refusal for t in told(outputs)} == {"", NO_VALID}
    assert {r.vouching for r in positions(outputs)} == {(A, B), (A,), (B, A), (B,)}
    assert epochs(valid(outputs)) >= {9, 25, 39}


@settings(max_examples=6, deadline=None)
@given(st.lists(st.integers(0, len(eventful())), max_size=12).map(sorted))
def test_cut_anywhere_and_restored_it_decides_the_same(cuts: list[int]) -> None:
    assert run(cuts, True) == run(cuts, False)


def test_restored_after_every_event_it_remembers_the_same() -> None:
    """Each time as the one that it was taken from, to the byte."""
    train = localiser(HAND_OVER)
    for event in eventful():
        train.feed([event])
        memory = encode_snapshot(train.snapshot(), train.train, HAND_OVER, 0)
        again = encode_snapshot(decode_snapshot(memory, HAND_OVER), train.train, HAND_OVER, 0)
        assert again.SerializeToString(deterministic=True) == memory.SerializeToString(deterministic=True)


def test_restored_at_the_first_moment_it_is_a_train_that_has_heard_nothing() -> None:
    assert epochs(valid(restored(localiser(HAND_OVER)).feed(stream()))) == ALL
