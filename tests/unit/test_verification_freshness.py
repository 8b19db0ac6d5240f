"""Freshness to the nanosecond, and what a train reads in a message that is believed. Clocks are numbers here."""

from typing import Any

import pytest

from integrity.messages import wayside_pb2 as pb
from integrity.states import State
from tests.unit.verifying import GPS_NS, MS, STATION_T0, T0, health, judged, tied


def test_a_message_of_this_very_nanosecond_is_fresh() -> None:
    received = judged(tied(), health(), T0)
    assert (received.fresh, received.age_ns, received.staleness) == (True, 0, "")


def test_age_in_milliseconds_is_the_bound() -> None:
    assert judged(tied(), health()).age_ms == pytest.approx(5.005, abs=1e-9)


def test_what_is_not_fresh_is_not_confirmable_whatever_it_says() -> None:
    received = judged(tied(), health(), T0 + 4000 * MS)
    assert (received.said, received.state) == (State.NORMAL, State.NOT_CONFIRMABLE)


@pytest.mark.parametrize("said, read", [(pb.SATELLITE_ANOMALY, State.SATELLITE_ANOMALY), (pb.NOT_CONFIRMABLE, State.NOT_CONFIRMABLE)])
def test_a_word_against_it_is_read_as_it_stands(said: pb.State, read: State) -> None:
    received = judged(tied(), health(state=said, cause=pb.SPOOFING))
    assert (received.said, received.caution) == (read, "")


def test_it_is_from_the_future_by_so_much() -> None:
    received = judged(tied(), health(issued_mono_ns=STATION_T0 + 1005 * MS), T0)
    assert received.staleness == "from the future: issued 1004.0 ms from now: a clock has jumped"


# The station answered at T0 at the earliest: after 10 ms of the train's clock, a message issued with the answer is at most
# 10 ms + 1e-3 * 10 ms old, that is middle of the round trip + half of it + drift.
@pytest.mark.parametrize(
    "issued_after_ns, elapsed_ns, age_ns", [(0, 10 * MS, 10_010_000), (4 * MS, 10 * MS, 6_010_000), (-2000 * MS, MS, 2_003_000_000)]
)
def test_age_is_bounded_from_above(issued_after_ns: int, elapsed_ns: int, age_ns: int) -> None:
    assert judged(tied(), health(issued_mono_ns=STATION_T0 + issued_after_ns), T0 + elapsed_ns).age_ns == age_ns


@pytest.mark.parametrize(
    "valid_for_ms, max_valid_ms, past_ns, fresh",
    [(1001, 9000, 0, True), (1001, 9000, 1, False), (9000, 1001, 0, True), (9000, 1001, 1, False), (0, 9000, -999 * MS, False)],
)
def test_fresh_up_to_the_shorter_validity_and_not_a_nanosecond_longer(
    valid_for_ms: int, max_valid_ms: int, past_ns: int, fresh: bool
) -> None:
    """1000 ms of the clock and 1 ms of drift are exactly 1001 ms."""
    assert judged(tied(max_valid_ms), health(valid_for_ms=valid_for_ms), T0 + 1000 * MS + past_ns).fresh is fresh


def test_validity_runs_out_between_messages() -> None:
    verifier = tied()
    received = verifier.again(judged(verifier, health()), T0 + 3000 * MS)
    assert (received.fresh, received.staleness) == (False, "expired: age 3003.000 ms, valid for 3000 ms")


def test_a_message_from_the_future_is_not_fresh() -> None:
    received = judged(tied(), health(issued_mono_ns=STATION_T0 + 60_000 * MS))
    assert (received.fresh, received.staleness[:16]) == (False, "from the future:")


@pytest.mark.parametrize(
    "changes, caution",
    [
        ({"state": pb.STATE_UNSPECIFIED}, "state 0 is unknown"),
        ({"state": 4}, "state 4 is unknown"),
        ({"cause": pb.RECEIVER}, "NORMAL with cause 9"),
        ({"gps_time_ns": None}, "NORMAL without the epoch"),
        ({"gps_time_ns": GPS_NS + 57_000_000_000}, "NORMAL for epoch 1456000057000000000, not later than 1456000057000000000"),
    ],
)
def test_what_is_unheard_of_stops_a_train_at_once(changes: dict[str, Any], caution: str) -> None:
    verifier = tied()
    judged(verifier, health(57))
    received = judged(verifier, health(58, **changes))
    assert (received.verified, received.state, received.caution[: len(caution)]) == (True, State.NOT_CONFIRMABLE, caution)


def test_a_heartbeat_in_between_does_not_let_an_epoch_count_twice() -> None:
    verifier = tied()
    judged(verifier, health(57))
    judged(verifier, health(58, state=pb.NOT_CONFIRMABLE, cause=pb.DATA, gps_time_ns=None))
    assert judged(verifier, health(59, gps_time_ns=GPS_NS + 57_000_000_000)).state is State.NOT_CONFIRMABLE
