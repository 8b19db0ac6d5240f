"""What comes through the air before anything is decided: cut, dated, and never said more often than a person can read."""

from datetime import date

from integrity.messages import wayside_pb2 as pb
from integrity.messages.verification import MOST_BYTES
from recordings.keys import KeyDates, TrustedKey
from recordings.link import Arrival
from tests.unit.verifying import KEY, PLACE, SITE, STRANGER
from train_client.air import SAY_AGAIN_NS, Air
from train_client.events import ChallengeAnswered, HealthReceived

OVER = KeyDates([TrustedKey(key.public, None, date(2020, 1, 1)) for key in (KEY, STRANGER)])


class Taken:
    """An air without a link, what it hands on and what it says."""

    def __init__(self, dates: KeyDates) -> None:
        self.events: list[HealthReceived | ChallengeAnswered] = []
        self.said: list[str] = []
        self.air = Air(["tcp/127.0.0.1:9"], None, {SITE: dates}, "t", self.events.append, self.said.append)
        self._dates = dates

    def health(self, data: bytes, mono_ns: int = 0) -> None:
        self.air._health(self._dates, Arrival(PLACE, data, mono_ns))


def named(number: int) -> bytes:
    return pb.SignedHealth(key_id=(KEY, STRANGER)[number % 2].key_id).SerializeToString()


def test_keys_that_have_ended_are_said_once_in_ten_seconds_whoever_names_them() -> None:
    taken = Taken(OVER)
    for n in range(1000):
        taken.health(named(n), 1 + n * SAY_AGAIN_NS // 500)
    assert (len(taken.said), taken.events) == (2, [])


def test_no_more_of_a_message_is_handed_on_than_tells_that_it_is_too_long() -> None:
    taken = Taken(KeyDates([TrustedKey(KEY.public)]))
    taken.health(bytes(2 * MOST_BYTES))
    taken.air._answer(SITE, b"n" * 16, Arrival(PLACE, bytes(2 * MOST_BYTES), 0))
    assert [len(event.data) for event in taken.events] == [MOST_BYTES + 1] * 2
