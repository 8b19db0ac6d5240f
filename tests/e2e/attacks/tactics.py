"""What the man in the middle does with what he hears: with each health of the station, and with each challenge of the train."""

import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from itertools import cycle, islice

from recordings.keys import new_key
from tests.e2e.attacks import forged
from tests.e2e.attacks.relay import Question, Relay, Tactic, asked_on, passed_on
from tests.e2e.attacks.ride import Deed, Ride

HealthTactic = Callable[[Relay, bytes], None]
ChallengeTactic = Callable[[Relay, Question], None]


def withheld(relay: Relay, what: object) -> None:
    """Nothing."""


def tactic(health: HealthTactic = passed_on, challenge: ChallengeTactic = asked_on) -> Deed:
    @contextmanager
    def deed(ride: Ride) -> Iterator[None]:
        ride.relay.tactic = Tactic(health, challenge)
        yield
        ride.relay.tactic = Tactic()

    return deed


# ---- health: repeated, deleted, inserted, in another order, corrupted, delayed


def thrice(relay: Relay, health: bytes) -> None:
    for _ in range(3):
        relay.put(health)


def with_earlier_ones(relay: Relay, health: bytes) -> None:
    relay.put(health)
    for earlier in relay.heard[-10:-1]:
        relay.put(earlier)


def earlier_ones_instead(relay: Relay, health: bytes) -> None:
    """What was heard before the attack, over and over."""
    for earlier in relay.heard[:10]:
        relay.put(earlier)


def one_in_ten(relay: Relay, health: bytes) -> None:
    if len(relay.heard) % 10 == 0:
        relay.put(health)


def swapped(relay: Relay, health: bytes) -> None:
    """The second of two before the first."""
    if len(relay.heard) % 2 == 0:
        relay.put(health)
        relay.put(relay.heard[-2])


def every_second_flipped(relay: Relay, health: bytes) -> None:
    relay.put(forged.flipped(health) if len(relay.heard) % 2 else health)


def flipped(relay: Relay, health: bytes) -> None:
    relay.put(forged.flipped(health))


def with_another_tail(relay: Relay, health: bytes) -> None:
    """Every second one ends with the beginning of the one before."""
    relay.put(forged.with_another_tail(health, relay.heard[-2][:40]) if len(relay.heard) % 2 else health)


def later(delay_s: float) -> HealthTactic:
    return lambda relay, health: relay.later(delay_s, lambda: relay.put(health))


def ever_later(ride: Ride) -> AbstractContextManager[None]:
    """Each is held for as long as the attack has lasted; no answer says that there are later ones."""
    began_s = time.monotonic()
    return tactic(lambda relay, genuine: later(time.monotonic() - began_s)(relay, genuine), withheld)(ride)


def with_forgeries(ride: Ride) -> AbstractContextManager[None]:
    """Each genuine message is followed by forged ones."""
    key = ride.scene.key
    kinds = (forged.by_a_stranger, forged.under_a_trusted_name, forged.for_another_site(key), forged.for_another_place(key))

    def health(relay: Relay, genuine: bytes) -> None:
        relay.put(genuine)
        for forge in kinds:
            relay.put(forge(genuine))

    return tactic(health)(ride)


def of_another_site(ride: Ride) -> AbstractContextManager[None]:
    """Beside the station another one speaks at its key, whose own key the train trusts, for that other site."""
    forge = forged.by(new_key(ride.train.folder / "other.pem"))

    def health(relay: Relay, genuine: bytes) -> None:
        relay.put(genuine)
        relay.put(forge(genuine))

    return tactic(health)(ride)


def masquerade(relay: Relay, health: bytes) -> None:
    relay.put(forged.under_a_trusted_name(health))


def answered_by_a_stranger(relay: Relay, question: Question) -> None:
    question.answer(forged.answer_by_a_stranger(question.nonce, relay.heard[-1]))


MASQUERADE = tactic(masquerade, answered_by_a_stranger)


@contextmanager
def held_then_let_go(ride: Ride) -> Iterator[None]:
    """All at once and in order, when it ends."""
    held: list[bytes] = []

    def let_go() -> None:
        for health in held:
            ride.relay.put(health)
        ride.relay.tactic = Tactic()

    ride.relay.tactic = Tactic(lambda _, health: held.append(health))
    yield
    ride.relay.later(0.0, let_go)


# ---- challenges


def first_answer(relay: Relay, question: Question) -> None:
    if relay.answers:
        question.answer(relay.answers[0])


def answered_twice(relay: Relay, question: Question) -> None:
    """With one that was given before, then with the right one."""
    first_answer(relay, question)
    asked_on(relay, question)


def asked_late(delay_s: float) -> ChallengeTactic:
    return lambda relay, question: relay.later(delay_s, lambda: asked_on(relay, question))


def answered_late(delay_s: float) -> ChallengeTactic:
    """The station has answered at once; the answer is held back."""

    def hold(relay: Relay, question: Question) -> None:
        relay.ask(question.nonce, lambda answer: relay.later(delay_s, lambda: question.answer(answer)))

    return hold


# ---- earlier boots


def played_back(old: list[bytes]) -> HealthTactic:
    """In the place of each message ten of these, in their order."""
    ahead = cycle(old)

    def health(relay: Relay, genuine: bytes) -> None:
        for earlier in islice(ahead, 10):
            relay.put(earlier)

    return health
