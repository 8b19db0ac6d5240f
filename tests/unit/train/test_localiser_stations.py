"""Several stations: what all of them vouch for is VALID, and nothing else; from one stretch to the next, and where nobody vouches."""

from collections.abc import Callable, Sequence
from functools import cache

import pytest

from integrity.gnss.gps_time import NS_PER_S
from integrity.gnss.signals import satellite_of
from integrity.messages import wayside_pb2 as pb
from tests.unit.train.ride import MS, STEP_NS, Otherwise, Say, measured, nothing_special, positions, valid
from tests.unit.train.stations import (
    BEYOND,
    BORDER,
    BOTH,
    EPOCHS,
    GAP,
    HAND_OVER,
    IN_GAP,
    QUICK,
    A,
    B,
    at_ns,
    epochs,
    falls_silent,
    ground,
    localiser,
    mapped,
    once_in_five,
    says_anomaly,
    stream,
    two_station_train,
    where_says,
)
from train_client.outputs import MapPlace, PositionReport, Status, TrainOutput, TrustChange
from train_client.stop import StopLimits, StopState
from train_client.track.track_map import TrackMap
from train_client.trust import TrustState

From = Callable[[int], Say]
"""What a station says from an epoch on."""
ALL = set(range(2, EPOCHS))  # from the third NORMAL message on


@cache
def plain(track: TrackMap) -> list[TrainOutput]:
    return localiser(track).feed(stream())


def of_epoch(outputs: Sequence[TrainOutput], number: int) -> PositionReport:
    """The last word on an epoch."""
    return [report for report in positions(outputs) if report.fix and report.fix.gps_time_ns == at_ns(number)][-1]


def trusts(outputs: Sequence[TrainOutput], first: int) -> list[TrustState]:
    """At the epochs from one on, each once where it stays."""
    found = [report.trust for report in positions(outputs) if report.mono_ns >= at_ns(first)]
    return [state for k, state in enumerate(found) if k == 0 or found[k - 1] is not state]


# ---- one place, two stations


def test_where_both_are_normal_every_epoch_is_valid() -> None:
    assert epochs(valid(plain(BOTH))) == ALL


@pytest.mark.parametrize("first", [0, 20])
@pytest.mark.parametrize("who", [A, B])
def test_the_anomaly_that_one_of_them_sees_is_a_conflict_and_ends_positions(who: str, first: int) -> None:
    outputs = localiser().feed(where_says(who, says_anomaly(first)))
    assert epochs(valid(outputs)) == set(range(2, first))
    found = [(r.status, r.trust) for r in positions(outputs) if r.mono_ns > at_ns(max(first, 2))]
    assert set(found) == {(Status.UNKNOWN, TrustState.CONFLICT)}


def test_the_event_that_brings_the_anomaly_latches_the_stop_and_tells_it() -> None:
    train = localiser()
    for event in stream(b=says_anomaly(20)):
        outputs = train.feed([event])
        if any(isinstance(o, TrustChange) and o.state is TrustState.SATELLITE_ANOMALY for o in outputs):
            break
    [told] = positions(outputs)
    assert (told.stop.state, told.stop.reasons, told.stop.since_ns) == (StopState.LATCHED, ("b-1 says SATELLITE_ANOMALY",), at_ns(20))


def test_both_abnormal_is_what_they_say() -> None:
    outputs = localiser().feed(stream(says_anomaly(20), says_anomaly(20)))
    assert trusts(outputs, 21) == [TrustState.SATELLITE_ANOMALY]


@pytest.mark.parametrize("who", [A, B])
def test_silence_of_one_is_no_assent(who: str) -> None:
    outputs = localiser().feed(where_says(who, falls_silent(20)))
    assert epochs(valid(outputs)) == set(range(2, 20))
    assert trusts(outputs, 20) == [TrustState.NORMAL, TrustState.STALE, TrustState.NO_COMMS]


def test_a_station_that_has_never_been_heard_leaves_everything_provisional() -> None:
    outputs = localiser().feed(stream(b=falls_silent(0)))
    assert {(r.status, r.trust) for r in positions(outputs) if r.mono_ns > at_ns(2)} == {(Status.PROVISIONAL, TrustState.NO_COMMS)}


def test_a_position_tells_of_each_station_in_the_order_of_the_train_file() -> None:
    report = positions(localiser().feed(stream(b=falls_silent(20))))[-1]
    assert [(station.site, station.trust) for station in report.stations] == [(A, TrustState.NORMAL), (B, TrustState.NO_COMMS)]


def test_a_satellite_that_one_of_them_excludes_is_not_used() -> None:
    out = min(satellite_of(s) for r in valid(plain(BOTH)) if r.fix for s in r.fix.used)

    def say(number: int, plain: pb.Health) -> pb.Health:
        if number >= 10:
            plain.excluded_satellites.append(out)
        return plain

    late = [r.fix for r in valid(localiser().feed(stream(b=say))) if r.fix and r.fix.gps_time_ns >= at_ns(10)]
    assert len(late) == EPOCHS - 10
    assert not any(out == satellite_of(s) for fix in late for s in fix.used)


@pytest.mark.parametrize("who", [A, B])
def test_a_satellite_for_which_they_vouch_with_different_ephemerides_is_not_used(who: str) -> None:
    reports = valid(localiser().feed(stream(grounds={who: ground(who, Otherwise)})))
    assert epochs(reports) == ALL
    assert not any(signal.startswith("G07") for report in reports if report.fix for signal in report.fix.used)


def on_maps(*names: str) -> Say:
    def say(number: int, plain: pb.Health) -> pb.Health:
        plain.map_sha256.extend(names)
        return plain

    return say


def test_a_station_that_vouches_on_other_maps_confirms_nothing() -> None:
    report = positions(localiser().feed(stream(b=on_maps("0" * 64, "1" * 64))))[-1]
    assert [station.trust for station in report.stations] == [TrustState.NORMAL, TrustState.NOT_CONFIRMABLE]


def test_a_station_may_vouch_on_several_maps() -> None:
    assert epochs(valid(localiser().feed(stream(b=on_maps("0" * 64, BOTH.sha256))))) == ALL


@pytest.mark.parametrize("at", [0, 3])
def test_stations_that_are_both_slower_than_the_train_confirm_every_epoch(at: int) -> None:
    outputs = localiser().feed(stream(once_in_five(), once_in_five(at)))
    assert set(range(16, 31)) <= epochs(valid(outputs))


def test_a_station_that_is_slower_than_another_confirms_every_epoch_too() -> None:
    outputs = localiser().feed(stream(a=once_in_five()))
    assert set(range(16, 31)) <= epochs(valid(outputs))


# ---- from one stretch to the next


def test_from_one_stretch_over_both_to_the_next_every_epoch_is_valid() -> None:
    assert epochs(valid(plain(HAND_OVER))) == ALL


def test_whose_word_counts_is_told_with_each_position() -> None:
    """At first all that are listened to; and once more those of the place before."""
    found = {(r.fix.gps_time_ns - at_ns(0)) // STEP_NS: r.vouching for r in valid(plain(HAND_OVER)) if r.fix}
    expected = {2: (A, B)} | dict.fromkeys(range(3, BORDER), (A,)) | dict.fromkeys(range(BORDER, BEYOND), (A, B))
    assert found == expected | {BEYOND: (B, A)} | dict.fromkeys(range(BEYOND + 1, EPOCHS), (B,))


@pytest.mark.parametrize("say", [says_anomaly, falls_silent])
def test_the_station_behind_is_without_effect(say: From) -> None:
    outputs = localiser(HAND_OVER).feed(stream(a=say(BEYOND + 1)))
    assert epochs(valid(outputs)) == ALL
    assert positions(outputs)[-1].stop.state is StopState.NONE


def test_the_station_ahead_is_without_effect() -> None:
    outputs = localiser(HAND_OVER).feed(stream(b=says_anomaly(4, 6)))
    assert epochs(valid(outputs)) == ALL


@pytest.mark.parametrize("say", [says_anomaly, falls_silent])
@pytest.mark.parametrize("first", [BORDER - 6, BORDER])
def test_beyond_the_border_nothing_is_valid_without_the_station_there(say: From, first: int) -> None:
    outputs = localiser(HAND_OVER).feed(stream(b=say(first)))
    assert epochs(valid(outputs)) == set(range(2, BORDER))


def test_a_silent_station_ahead_asks_for_a_stop_where_its_word_begins_to_count() -> None:
    """It has been silent since the third epoch: that is not said before the train is there."""
    outputs = localiser(HAND_OVER).feed(stream(b=falls_silent(3)))
    stop = positions(outputs)[-1].stop
    assert (stop.state, stop.since_ns) == (StopState.LATCHED, at_ns(BORDER) + 3 * NS_PER_S)


@pytest.mark.parametrize("say", [says_anomaly, falls_silent])
def test_before_the_train_has_been_in_the_next_stretch_the_one_behind_still_counts(say: From) -> None:
    outputs = localiser(HAND_OVER).feed(stream(a=say(BEYOND)))
    assert epochs(valid(outputs)) == set(range(2, BEYOND))


APART = mapped(a=(0.0, 130.0), b=(200.0, 920.0))
LEAPS = 10


@cache
def after_a_leap(say: Say) -> list[TrainOutput]:
    """The antennas stand in A's stretch; from one epoch on what they receive is of B's stretch, 200 m further on."""
    sent = [e for e in measured(8.0, 60.0, 0.0) if e.mono_ns < at_ns(LEAPS)] + [
        e for e in measured(8.0, 260.0, 0.0) if e.mono_ns >= at_ns(LEAPS)
    ]
    return localiser(APART).feed(stream(a=say, sent=sent))


ANOMALY_HERE = says_anomaly(LEAPS)


def test_counterfeit_signals_do_not_lead_to_where_nobody_sees_them() -> None:
    assert epochs(valid(after_a_leap(ANOMALY_HERE))) == set(range(2, LEAPS))


def test_where_the_place_is_so_far_off_the_fix_itself_would_be_believed() -> None:
    """So that the test above can fail: what the leap takes at 100 m/s later."""
    found = valid(after_a_leap(nothing_special))
    assert max(epochs(found)) == EPOCHS - 1
    assert found[-1].fix is not None and found[-1].fix.front is not None and found[-1].fix.front.offset_m > 250.0


def test_slow_stations_confirm_every_epoch_at_the_border_too() -> None:
    outputs = localiser(HAND_OVER).feed(stream(once_in_five(), once_in_five()))
    assert set(range(16, 36)) <= epochs(valid(outputs))


OVER, BACK = 101.0, 95.0  # front end beyond the border, for one epoch, and before it


def test_a_fix_that_was_placed_before_another_stations_word_counted_too_is_not_confirmed_without_it() -> None:
    """Epoch 11 is in both stretches; B vouches for it, then A for it and all up to 15. Those after it were placed with A alone."""
    over = at_ns(11)
    sent = [e for e in measured(8.0, BACK, 0.0) if not over - MS < e.mono_ns < over + STEP_NS - MS]
    sent += [e for e in measured(8.0, OVER, 0.0) if over - MS < e.mono_ns < over + STEP_NS - MS]
    in_order = sorted(sent, key=lambda event: event.mono_ns)
    found = epochs(valid(localiser(HAND_OVER, QUICK).feed(stream(once_in_five(0), once_in_five(4), sent=in_order))))
    assert (11 in found, found & set(range(12, 16)), {10, 16, 20} <= found) == (True, set(), True)


def test_what_waited_when_a_station_spoke_against_it_is_never_confirmed() -> None:
    """Also if the station says afterwards that it had been all right."""

    def say(number: int, plain: pb.Health) -> pb.Health | None:
        return says_anomaly()(number, plain) if number == 12 else once_in_five()(number, plain)

    assert not {11, 12} & epochs(valid(localiser(train=QUICK).feed(stream(b=say))))


def test_but_for_that_word_it_is_confirmed() -> None:
    """So that the test above can fail."""
    assert {11, 12} <= epochs(valid(localiser(train=QUICK).feed(stream(b=once_in_five()))))


# ---- where nobody vouches


PATIENT = two_station_train(stop=StopLimits(60 * NS_PER_S, True))


@cache
def over_the_gap() -> list[TrainOutput]:
    return localiser(GAP, PATIENT).feed(stream())


def test_where_nobody_vouches_nothing_is_valid() -> None:
    assert epochs(valid(over_the_gap())) == ALL - set(IN_GAP)


def test_where_nobody_vouches_there_is_a_place_nobody_and_no_trust() -> None:
    found = {(r.status, r.trust, r.vouching) for r in (of_epoch(over_the_gap(), number) for number in IN_GAP)}
    assert found == {(Status.PROVISIONAL, TrustState.NO_COMMS, ())}


def test_a_position_says_for_which_place_nobody_vouches() -> None:
    assert of_epoch(over_the_gap(), 20).reasons == ("by the map no station vouches for main-1 140 m",)


def test_behind_the_gap_the_last_confirmed_place_is_still_that_before_it() -> None:
    report = of_epoch(over_the_gap(), IN_GAP[-1])
    assert report.last_confirmed is not None and report.last_confirmed.gps_time_ns == at_ns(IN_GAP[0] - 1)


@pytest.mark.parametrize("say", [says_anomaly, falls_silent])
def test_behind_the_gap_the_station_before_it_must_still_speak_for_it(say: From) -> None:
    outputs = localiser(GAP, PATIENT).feed(stream(a=say(IN_GAP[0] + 2)))
    assert epochs(valid(outputs)) == set(range(2, IN_GAP[0]))


def test_where_nobody_vouches_for_too_long_the_train_asks_for_a_stop() -> None:
    outputs = localiser(GAP, two_station_train(stop=StopLimits(NS_PER_S, True))).feed(stream())
    stop = positions(outputs)[-1].stop
    assert (stop.state, stop.since_ns) == (StopState.LATCHED, at_ns(IN_GAP[0]) + NS_PER_S)


def test_a_station_that_the_map_names_and_the_train_does_not_follow_is_never_heard() -> None:
    outputs = localiser(BOTH, two_station_train(stations=(A,))).feed(stream())
    report = positions(outputs)[-1]
    assert (report.status, report.trust, report.vouching) == (Status.PROVISIONAL, TrustState.NO_COMMS, (A, B))
    assert isinstance(report.fix and report.fix.front, MapPlace)
