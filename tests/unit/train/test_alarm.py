"""Somebody else in a station's name: three messages that cannot be its own within ten seconds, and no honest misfortune."""

import pytest

from integrity.gnss.gps_time import NS_PER_S
from integrity.messages.verification import Answer, Received
from train_client.alarm import Alarm, after_alarming, is_alarming, is_raised

NOW = 7_000 * NS_PER_S

ALARMING = [
    Received("wrong signature: not made by key"),
    Received("unknown key: none named"),
    Received("unreadable: 3 bytes"),
    Received("older: sequence 3 after 7", sequence=3),
    Received("older boot: sequence 3 of boot", sequence=3),
    Received("CONTRADICTION: sequence 3 signed twice", sequence=3),
    Answer("wrong nonce: none answered"),
    Answer("wrong signature: not made by key"),
    Answer("older boot: boot answers again"),
]
HARMLESS = [
    Received("", True, True),
    Received("repeated: sequence 3 once more", sequence=3),
    Received("overtaken: sequence 3, a challenge has named 7 already", sequence=3),
    Received("boot 00 not confirmed yet: challenge it", unconfirmed=True, sequence=3),
    Answer(""),
    Answer("late answer: one to a later challenge has come already"),
    Answer("which boot is the later is not known"),
    Answer("round trip of 4000.0 ms"),
]


@pytest.mark.parametrize("judged", ALARMING, ids=lambda judged: judged.refusal.partition(":")[0])
def test_what_the_station_cannot_have_said_alarms(judged: Received | Answer) -> None:
    assert is_alarming(judged) is True


@pytest.mark.parametrize("judged", HARMLESS, ids=lambda judged: judged.refusal.partition(":")[0] or type(judged).__name__)
def test_what_the_station_may_have_said_does_not(judged: Received | Answer) -> None:
    assert is_alarming(judged) is False


def test_at_first_there_is_none() -> None:
    assert not is_raised(Alarm(), 0)


@pytest.mark.parametrize(
    "came_s, raised",
    [
        ((), False),
        ((0,), False),
        ((0, 0), False),
        ((0, 0, 0), True),
        ((-9, -5, 0), True),
        ((-10, -5, 0), True),
        ((-11, -5, 0), False),
        ((-11, -5, -4, 0), True),  # the last three count
        ((-11, -11, -11, 0), False),
    ],
)
def test_three_within_ten_seconds_raise_it(came_s: tuple[int, ...], raised: bool) -> None:
    alarm = Alarm()
    for at_s in came_s:
        alarm = after_alarming(alarm, NOW + at_s * NS_PER_S)
    assert is_raised(alarm, NOW) is raised


@pytest.mark.parametrize("more_ns, raised", [(0, True), (1, False)])
def test_ten_seconds_from_the_first_to_the_last_to_the_nanosecond(more_ns: int, raised: bool) -> None:
    assert is_raised(Alarm((NOW - 10 * NS_PER_S - more_ns, NOW, NOW)), NOW) is raised


@pytest.mark.parametrize("since_ns, raised", [(0, True), (10 * NS_PER_S, True), (10 * NS_PER_S + 1, False)])
def test_it_lasts_ten_seconds_from_the_last_of_them(since_ns: int, raised: bool) -> None:
    assert is_raised(Alarm((NOW - 9 * NS_PER_S, NOW - 9 * NS_PER_S, NOW)), NOW + since_ns) is raised


def test_only_the_last_three_are_remembered_the_oldest_first() -> None:
    alarm = Alarm()
    for at_ns in range(10):
        alarm = after_alarming(alarm, at_ns)
    assert alarm == Alarm((7, 8, 9))
