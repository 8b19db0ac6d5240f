"""A stop: asked for at once or after a while, latched, and released only where it may be. Checked over all sequences too."""

from dataclasses import FrozenInstanceError, replace
from itertools import product
from typing import NamedTuple

import pytest

from train_client.stop import Stop, StopLimits, StopState, after_moment, after_valid, due_ns, released
from train_client.trust import TrustState

NONE, REQUESTED, LATCHED = StopState.NONE, StopState.REQUESTED, StopState.LATCHED
NORMAL, STALE, ANOMALY = TrustState.NORMAL, TrustState.STALE, TrustState.SATELLITE_ANOMALY
LIMITS = StopLimits(after_ns=3_000_000_000, latches=True)
FALLING = LIMITS._replace(latches=False)
NOW = 7_000_000_000_000
MOVING = Stop(NONE, (), valid_again=True)
STOPPED = Stop(LATCHED, ("a-1 says SATELLITE_ANOMALY",), NOW, NOW)
AWAY = "trust has been away for 3 s"


def test_a_train_begins_with_a_stop_that_is_asked_for_and_not_latched() -> None:
    assert Stop() == Stop(REQUESTED, ("no position has been VALID yet",), None, None, False)


def test_it_falls_with_the_first_valid_position() -> None:
    assert after_valid(Stop()) == MOVING


@pytest.mark.parametrize("denied", ["", "a-1 says SATELLITE_ANOMALY"])
@pytest.mark.parametrize("later_ns", [0, 10 * LIMITS.after_ns])
def test_it_is_not_latched_by_what_comes_before_that(denied: str, later_ns: int) -> None:
    stop = after_moment(Stop(), ANOMALY, denied, NOW, LIMITS)
    assert after_moment(stop, ANOMALY, denied, NOW + later_ns, LIMITS) == Stop(lost_ns=NOW)


def test_an_abnormal_word_stops_at_once() -> None:
    found = after_moment(MOVING, ANOMALY, "a-1 says SATELLITE_ANOMALY", NOW, LIMITS)
    assert found == Stop(LATCHED, ("a-1 says SATELLITE_ANOMALY",), NOW, NOW, valid_again=False)


@pytest.mark.parametrize(
    "since_ns, asked", [(0, False), (LIMITS.after_ns - 1, False), (LIMITS.after_ns, True), (LIMITS.after_ns + 1, True)]
)
def test_trust_that_is_away_stops_after_a_while_to_the_nanosecond(since_ns: int, asked: bool) -> None:
    lost = after_moment(MOVING, STALE, "", NOW, LIMITS)
    expected = Stop(LATCHED, (AWAY,), NOW + since_ns, NOW) if asked else Stop(NONE, (), lost_ns=NOW)
    assert after_moment(lost, STALE, "", NOW + since_ns, LIMITS) == expected


@pytest.mark.parametrize("after_ns, word", [(0, "0 s"), (500_000_000, "0.5 s")])
def test_a_stop_says_how_long_trust_was_away(after_ns: int, word: str) -> None:
    lost = after_moment(MOVING, STALE, "", NOW, StopLimits(after_ns, True))
    assert after_moment(lost, STALE, "", NOW + after_ns, StopLimits(after_ns, True)).reasons == (f"trust has been away for {word}",)


def test_trust_that_comes_back_in_time_stops_nothing_and_starts_the_while_anew() -> None:
    stop = after_moment(MOVING, STALE, "", NOW, LIMITS)
    stop = after_moment(stop, NORMAL, "", NOW + LIMITS.after_ns - 1, LIMITS)
    assert after_moment(stop, STALE, "", NOW + LIMITS.after_ns, LIMITS) == Stop(NONE, (), lost_ns=NOW + LIMITS.after_ns)


def test_where_the_clock_steps_back_the_while_begins_no_later() -> None:
    stop = after_moment(after_moment(MOVING, STALE, "", NOW, LIMITS), STALE, "", NOW - 60 * LIMITS.after_ns, LIMITS)
    assert due_ns(stop, LIMITS) == NOW - 59 * LIMITS.after_ns


def test_while_trust_is_normal_nothing_is_made_anew() -> None:
    assert after_moment(MOVING, NORMAL, "", NOW, LIMITS) is MOVING


def test_what_latched_first_stays_the_reason() -> None:
    found = after_moment(STOPPED, ANOMALY, "b-1 says NOT_CONFIRMABLE", NOW + 10 * LIMITS.after_ns, LIMITS)
    assert found == STOPPED


@pytest.mark.parametrize("state", [NONE, LATCHED])
def test_a_valid_position_is_remembered_and_releases_nothing(state: StopState) -> None:
    stop = Stop(state, ("why",), NOW)
    assert after_valid(stop) == replace(stop, valid_again=True)


@pytest.mark.parametrize("state", [NONE, LATCHED])
def test_where_a_valid_position_is_nothing_new_nothing_is_made_anew(state: StopState) -> None:
    stop = Stop(state, ("why",), NOW, valid_again=True)
    assert after_valid(stop) is stop


def test_where_stops_do_not_latch_the_next_valid_position_ends_them() -> None:
    asked = after_moment(MOVING, ANOMALY, "a-1 says SATELLITE_ANOMALY", NOW, FALLING)
    assert (asked.state, after_valid(asked).state) == (REQUESTED, NONE)


@pytest.mark.parametrize(
    "stop, expected",
    [
        (Stop(), "no stop is latched"),
        (MOVING, "no stop is latched"),
        (STOPPED, "the train has no VALID position yet"),
        (replace(STOPPED, valid_again=True), "the train has no VALID position yet"),  # trust is away once more
        (replace(STOPPED, lost_ns=None), "the train has no VALID position yet"),
        (replace(STOPPED, lost_ns=0, valid_again=True), "the train has no VALID position yet"),
        (replace(STOPPED, lost_ns=None, valid_again=True), MOVING),
    ],
)
def test_a_release_counts_only_where_trust_and_a_valid_position_are_back(stop: Stop, expected: Stop | str) -> None:
    assert released(stop) == expected


def test_after_a_release_a_stop_is_asked_for_again_as_before() -> None:
    again = released(replace(STOPPED, lost_ns=None, valid_again=True))
    assert isinstance(again, Stop)
    assert after_moment(again, ANOMALY, "a-1 says SATELLITE_ANOMALY", NOW, LIMITS) == STOPPED


@pytest.mark.parametrize(
    "stop, expected",
    [
        (MOVING, None),
        (replace(MOVING, lost_ns=0), LIMITS.after_ns),
        (replace(MOVING, lost_ns=NOW), NOW + LIMITS.after_ns),
        (replace(Stop(), lost_ns=NOW), None),
        (STOPPED, None),
    ],
)
def test_when_a_stop_will_be_asked_for(stop: Stop, expected: int | None) -> None:
    assert due_ns(stop, LIMITS) == expected


def test_a_stop_cannot_be_changed() -> None:
    with pytest.raises(FrozenInstanceError):
        Stop().state = NONE  # type: ignore[misc]


class Story(NamedTuple):
    """What has happened, by counting alone: whether a stop holds that must be released, and what a release needs."""

    stopped: bool = True
    latched: bool = False
    away: int = 0  # moments in a row without trust
    valid: bool = False  # since trust came back

    def then(self, what: str) -> "Story":
        match what:
            case "valid":
                return self._replace(stopped=self.latched, away=0, valid=True)
            case "release":
                free = self.latched and self.valid and not self.away
                return self._replace(stopped=self.stopped and not free, latched=self.latched and not free)
            case "trust":
                return self._replace(away=0)
        away = self.away + 1
        asks = not self.stopped and (what == "denied" or away > AWAY_MOMENTS)
        return Story(self.stopped or asks, self.latched or asks, away, False)


AWAY_MOMENTS = 2
WHATS = ("trust", "away", "denied", "valid", "release")


def decided(whats: tuple[str, ...]) -> list[tuple[bool, bool]]:
    """Whether a stop is asked for, and latched, after each."""
    stop, now_ns, found = Stop(), 0, []
    for what in whats:
        now_ns += what != "release"
        if what == "release":
            after = released(stop)
            stop = stop if isinstance(after, str) else after
        else:
            denied = "a-1 says SATELLITE_ANOMALY" if what == "denied" else ""
            trust = STALE if what == "away" else ANOMALY if what == "denied" else NORMAL
            stop = after_moment(stop, trust, denied, now_ns, StopLimits(AWAY_MOMENTS, True))
            stop = after_valid(stop) if what == "valid" else stop
        found.append((stop.state is not NONE, stop.state is LATCHED))
    return found


@pytest.mark.parametrize("first", WHATS)
def test_every_sequence_of_seven_moments_is_decided_as_counting_says(first: str) -> None:
    for rest in product(WHATS, repeat=6):
        story, expected = Story(), []
        for what in (first, *rest):
            story = story.then(what)
            expected.append((story.stopped, story.latched))
        assert decided((first, *rest)) == expected, (first, *rest)
