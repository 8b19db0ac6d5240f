"""One station as a train sees it: what of its words is believed, and what follows from that. Steps a and b of the main path on board."""

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import NamedTuple

from integrity.messages import wayside_pb2 as pb
from integrity.messages.verification import Answer, HealthVerifier, Received, VerifierMemory
from integrity.states import State
from train_client.alarm import Alarm, after_alarming, is_alarming, is_raised
from train_client.config import TrainConfig
from train_client.events import ChallengeAnswered, ChallengeSent, HealthReceived
from train_client.localisation.coverage import Vouched, vouched_by
from train_client.trust import Trust, TrustState, after_message, after_time, next_change_ns

CHALLENGE_EVERY_NS = 1_000_000_000
CHALLENGE_PAUSE_NS = 100_000_000  # at least this between two: replayed messages must not make us ask without end
MOST_NONCES = 16  # not answered yet
SHOWN_CHARACTERS = 200  # of words from the network that nobody has signed
MOST_COUNTED = 2**64 - 1  # the largest number that a message holds: a sequence may leap as far, and more than once


@dataclass(frozen=True)
class GroundMemory:
    """See the parts; `nonces` that were sent and when; messages `refused`, and those that never came."""

    verifier: VerifierMemory = field(default_factory=VerifierMemory)
    trust: Trust = field(default_factory=Trust)
    alarm: Alarm = field(default_factory=Alarm)
    nonces: tuple[tuple[bytes, int], ...] = ()
    challenge_at_ns: int | None = None
    refused: int = 0
    missed: int = 0


class Said(NamedTuple):
    """What came of a message: trust after it and why, what it vouches for, or why it was refused."""

    trust: Trust
    reasons: tuple[str, ...] = ()
    vouched: Vouched | None = None
    refusal: str = ""


class Ground:
    """Judges the words of one site for one train. `keys` are the raw public keys trusted for it, `map_sha256` names the train's map."""

    def __init__(self, site: str, keys: Iterable[bytes], train: TrainConfig, map_sha256: str, memory: GroundMemory | None = None) -> None:
        start = memory or GroundMemory()
        self.site = site
        self.trust = start.trust
        self.refused = start.refused
        self.missed = start.missed
        self._train = train
        self._map_sha256 = map_sha256
        self._keys = tuple(keys)
        self._verifier = HealthVerifier(site, self._keys, train.max_valid_ms, start.verifier)
        self._alarm = start.alarm
        self._nonces = dict(start.nonces)  # to when they were sent
        self._challenge_at_ns = start.challenge_at_ns

    def memory(self) -> GroundMemory:
        """For a snapshot."""
        return GroundMemory(
            self._verifier.memory(),
            self.trust,
            self._alarm,
            tuple(self._nonces.items()),
            self._challenge_at_ns,
            self.refused,
            self.missed,
        )

    @property
    def challenge_due_ns(self) -> int:
        """When the station should be challenged next, of the train's clock."""
        return self._challenge_at_ns or 0

    @property
    def next_change_ns(self) -> int | None:
        """When trust runs out if nothing comes; None: never."""
        return next_change_ns(self.trust, self._train.trust)

    def is_alarmed(self, mono_ns: int) -> bool:
        """Whether somebody else speaks in its name."""
        return is_raised(self._alarm, mono_ns)

    def time_passes(self, mono_ns: int) -> Said:
        """Trust now, where nothing has come since."""
        self.trust = after_time(self.trust, mono_ns, self._train.trust)
        why = "the last message is valid no longer" if self.trust.state is TrustState.STALE else "nothing that counts comes from the ground"
        return Said(self.trust, (why,))

    def forget(self, mono_ns: int, why: str) -> Said:
        """The train's clock has jumped: nothing that was tied to it holds any more."""
        self._verifier = HealthVerifier(self.site, self._keys, self._train.max_valid_ms)
        self._nonces.clear()
        self._alarm = Alarm()
        self._challenge_at_ns = mono_ns
        self.trust = Trust()
        return Said(self.trust, (why,))

    def health(self, event: HealthReceived) -> Said:
        """Judge a message that came at this site's key."""
        received = self._of_our_map(self._verifier.health(event.key_expr, event.data, event.mono_ns))
        if received.unconfirmed:
            self._challenge_soon()
        if not received.verified:
            return self._refusal(received, event.mono_ns, received.refusal)
        self.missed = min(self.missed + received.missed, MOST_COUNTED)
        self.trust = after_message(self.trust, received, event.mono_ns, self._train.trust, self.is_alarmed(event.mono_ns))
        counts = self.trust.state is TrustState.NORMAL and received.fresh and received.said is State.NORMAL
        vouched = vouched_by(received.health) if counts and received.health is not None else None
        return Said(self.trust, _reasons(received), vouched)

    def challenged(self, event: ChallengeSent) -> None:
        """It was asked to sign this nonce."""
        self._challenge_at_ns = event.mono_ns + CHALLENGE_EVERY_NS
        self._nonces[event.nonce] = event.mono_ns
        while len(self._nonces) > MOST_NONCES:
            del self._nonces[next(iter(self._nonces))]

    def answered(self, event: ChallengeAnswered) -> Said:
        """Judge what came back."""
        sent_ns = self._nonces.get(event.nonce)
        if event.error or sent_ns is None:
            error = repr(event.error[:SHOWN_CHARACTERS]) if event.error else "an answer to a nonce that was not asked"
            return self._refusal(None, event.mono_ns, f"challenge: {error}")
        answer = self._verifier.challenge_answered(event.nonce, sent_ns, event.mono_ns, event.data)
        return self._refusal(answer, event.mono_ns, f"challenge: {answer.refusal}") if answer.refusal else Said(self.trust)

    def _refusal(self, judged: Received | Answer | None, mono_ns: int, refusal: str) -> Said:
        self.refused += not refusal.startswith("repeated")  # a copy of the last message is no attack: it may have come twice
        if judged is not None and is_alarming(judged):
            self._alarm = after_alarming(self._alarm, mono_ns)
        return Said(self.trust, refusal=refusal)

    def _challenge_soon(self) -> None:
        if self._challenge_at_ns is not None:
            last_ns = self._challenge_at_ns - CHALLENGE_EVERY_NS
            self._challenge_at_ns = min(self._challenge_at_ns, last_ns + CHALLENGE_PAUSE_NS)

    def _of_our_map(self, received: Received) -> Received:
        """Which station vouches for which edge stands in the map: what is said on another edition of it confirms nothing here."""
        if received.health is None or not received.health.map_sha256 or self._map_sha256 in received.health.map_sha256:
            return received
        if received.said is not State.NORMAL:
            return received
        caution = f"it vouches on other maps than this train's {self._map_sha256[:12]}"
        return received._replace(said=State.NOT_CONFIRMABLE, caution=caution)


def _reasons(received: Received) -> tuple[str, ...]:
    """What the message says, for people."""
    health = received.health
    if health is None:
        return (received.refusal,)
    cause = pb.Cause.Name(health.cause).lower() if health.cause in pb.Cause.values() else f"cause {health.cause}"
    subjects = f" ({', '.join(health.subjects)})" if health.subjects else ""
    said = () if received.said is State.NORMAL else (f"the ground says {received.said.value}: {cause}{subjects}",)
    return (*said, *((received.caution,) if received.caution else ()), *health.reasons)
