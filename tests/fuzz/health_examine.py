"""Everything that reads health, side by side: what it says must be what `health_oracle` says, and nothing may escape."""

import importlib
import json
import sys
from collections import Counter
from collections.abc import Iterable
from dataclasses import replace
from datetime import date
from functools import cache, lru_cache
from random import Random
from types import ModuleType
from typing import Any, NamedTuple

from cryptography.exceptions import InvalidSignature
from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PublicKey

from integrity.events import RawBytes, Tick
from integrity.gnss.gps_time import NS_PER_S
from integrity.messages import wayside_pb2 as pb
from integrity.messages.verification import HealthVerifier, Received
from integrity.states import State
from recordings.keys import KeyDates, TrustedKey
from tests.fuzz.health_oracle import REFUSED, Judged, Message, Train, says_normal
from tests.unit.train.ride import KEY, MAP, SITE, START_NS, a_train, measured
from train_client.events import ChallengeAnswered, ChallengeSent, HealthReceived, TrainEvent
from train_client.listen import as_json, as_line
from train_client.localisation.localiser import TrainLocaliser
from train_client.localisation.memory import LocaliserMemory
from train_client.messages import encode_position
from train_client.outputs import MessageRefused, PositionReport, Status, TrainOutput
from train_client.snapshots import decode_snapshot, encode_snapshot
from train_client.trust import TrustState

MS = 1_000_000
BEHIND_NS = 5_000 * NS_PER_S  # of a boot of the station, how far its clock is behind; a boot later twice as far
TRAIN = a_train()
HEALTH_AT, CHALLENGE_AT = f"wayside/v1/{SITE}/health", f"wayside/v1/{SITE}/challenge"
SIGNED = {b"h": f"wayside.v1.health\0{HEALTH_AT}\0".encode(), b"a": f"wayside.v1.challenge\0{CHALLENGE_AT}\0".encode()}
PUBLIC = Ed25519PublicKey.from_public_bytes(KEY.public)
MOST_BYTES = 65_536
OF_SIGNATURES = {"unreadable", "unknown key", "wrong signature"}
OF_HEALTH = {"wrong site", "no boot", "no sequence", "older boot", "older", "overtaken", "repeated", "CONTRADICTION", "boot not confirmed"}
OF_ANSWERS = {"wrong nonce", "no boot", "late answer", "older boot", "which boot is the later is not known", "round trip"}
MOST_NONCES = 16
SHARE_WITH_ANTENNAS, SHARE_READ_BY_ALL = 0.06, 0.1
DATES = KeyDates([TrustedKey(KEY.public, not_after=date(2020, 1, 1))])
SAID = {State.NORMAL: (True, False), State.SATELLITE_ANOMALY: (False, True), State.NOT_CONFIRMABLE: (False, False)}


class Arrived(NamedTuple):
    """Health (`h`), an answer (`a`) or an error (`e`). `inner`: what the station has signed, if it is known to have."""

    what: bytes
    number: int
    at_ns: int
    data: bytes
    inner: bytes | None
    untouched: bool


def new_localiser(memory: LocaliserMemory | None = None) -> TrainLocaliser:
    """A train that trusts the station's key."""
    return TrainLocaliser(TRAIN, MAP, {SITE: [KEY.public]}, memory)


def new_verifier() -> HealthVerifier:
    return HealthVerifier(SITE, [KEY.public], TRAIN.max_valid_ms)


@cache
def plain_subscriber() -> ModuleType:
    """The example of a reader that has nothing of ours, with the generated file under the name that it knows."""
    sys.modules["wayside_pb2"] = pb
    try:
        return importlib.import_module("tests.e2e.plain_subscriber")
    finally:
        del sys.modules["wayside_pb2"]


class Examiner:
    """One batch: a verifier, a train with one of its own, and the oracle, under one clock."""

    def __init__(self, rng: Random) -> None:
        self.told = Counter[str]()
        self._rng = rng
        self._now_ns = START_NS - NS_PER_S
        self._localiser, self._verifier, self._oracle = new_localiser(), new_verifier(), new_oracle()
        self._sent_ns: dict[bytes, int] = {}
        self._asked = set[int]()
        self._antennas: list[RawBytes | Tick] = []
        if rng.random() < SHARE_WITH_ANTENNAS:
            self._antennas = [event for event in measured() if isinstance(event, RawBytes | Tick)][::-1]
        self._calm = bool(self._antennas) or rng.random() < 0.7
        self._read_by_all = rng.random() < SHARE_READ_BY_ALL
        self._plain: Any = plain_subscriber().Station(SITE, KEY.public, TRAIN.max_valid_ms * MS)
        self._late_ns = 0

    def take(self, arrived: Arrived) -> None:
        """One arrival, at its time, or as soon after it as those before it allow."""
        if not self._calm and self._rng.random() < 0.01:
            self._jump()
        self._clock(max(self._now_ns + 1, arrived.at_ns + self._late_ns))
        if arrived.what == b"h":
            self._health(arrived)
        else:
            self._answer(arrived)

    def end(self) -> None:
        """Time runs out, and what the train remembers can be written down and read."""
        if self._read_by_all:
            message = encode_snapshot(self._localiser.snapshot(), TRAIN, MAP, self._now_ns)
            again = new_localiser(decode_snapshot(pb.TrainSnapshot.FromString(message.SerializeToString()), MAP))
            assert encode_snapshot(again.snapshot(), TRAIN, MAP, self._now_ns) == message
            self.told["snapshots"] += 1
        self._clock(self._now_ns + 2 * TRAIN.max_valid_ms * MS)
        self._feed(Tick(self._now_ns, 0, None))
        assert self._localiser.trust is not TrustState.NORMAL

    def _jump(self) -> None:
        """The train waits, or was asleep, or its clock steps back."""
        ns = self._rng.choice((NS_PER_S, 3 * NS_PER_S, 61 * NS_PER_S, -1, -NS_PER_S))
        self._late_ns += ns
        if ns < 0:
            self._now_ns += ns
            self._verifier, self._oracle = new_verifier(), new_oracle()
            self._sent_ns.clear()
            self._feed(Tick(self._now_ns, 0, None))
            self.told["clock stepped back"] += 1

    def _clock(self, now_ns: int) -> None:
        """It is as late as that; what the antennas have sent by then comes first."""
        while self._antennas and self._antennas[-1].mono_ns <= now_ns:
            event = self._antennas.pop()
            self._now_ns = max(self._now_ns, event.mono_ns)
            self._feed(replace(event, mono_ns=self._now_ns))
        self._now_ns = now_ns

    def _feed(self, event: TrainEvent) -> list[TrainOutput]:
        """Into the train, whose trust and positions are never more than is right; what it refused."""
        self._oracle.time_is(event.mono_ns)
        outputs = self._localiser.feed((event,))
        self._assert_no_more_than_right(outputs)
        return outputs

    def _assert_no_more_than_right(self, outputs: Iterable[TrainOutput]) -> None:
        normal = self._localiser.trust is TrustState.NORMAL
        assert not normal or self._oracle.may_use(), "trust is NORMAL"
        for report in (output for output in outputs if isinstance(output, PositionReport)):
            encode_position(report, TRAIN, MAP).SerializeToString()
            self.told[f"position {report.status.value}"] += 1
            if report.status is Status.VALID:
                assert report.fix is not None and normal
                assert self._oracle.vouches_for(report.fix.gps_time_ns, report.fix.used), "VALID, and nothing covers it"

    # ---- health

    def _health(self, arrived: Arrived) -> None:
        self._oracle.time_is(self._now_ns)
        received = self._verifier.health(HEALTH_AT, arrived.data, self._now_ns)
        kind = _kind(received.refusal)
        inner = self._inner(arrived, kind)
        judged = REFUSED if inner is None else self._oracle.health(self._now_ns, inner)
        assert (received.verified, received.fresh) == (judged.accepted, judged.fresh), f"{received}, expected {judged}"
        assert not received.verified or SAID[received.said] == (judged.normal, judged.anomaly), f"{received}, expected {judged}"
        assert (received.state is State.NORMAL) == (judged.normal and judged.fresh)
        assert kind in OF_SIGNATURES | OF_HEALTH | {"", "too long"}, received.refusal
        assert not received.unconfirmed or judged.may_be_next, "a boot that is over, or none, need not be challenged"
        event = HealthReceived(self._now_ns, HEALTH_AT, arrived.data)
        outputs = self._localiser.feed((event,))
        self._assert_no_more_than_right(outputs)
        self._assert_refused(outputs, received.refusal)
        self._tell(kind or ("fresh" if received.fresh else "not fresh"), received.said.name if received.verified else "")
        if self._read_by_all:
            self._read(received, arrived, judged)

    def _read(self, received: Received, arrived: Arrived, judged: Judged) -> None:
        """By the listener, the judge of dates and the plain subscriber."""
        assert as_line(received) and json.loads(as_json(received))["verified"] == judged.accepted
        assert DATES.of_health(arrived.data).partition(":")[0] in ("", "key no longer valid")
        try:
            said = self._plain.health(arrived.data, self._now_ns)
        except Exception:  # it refuses by whatever is raised
            return
        self.told[f"plain subscriber: {said.partition(':')[0]}"] += 1
        inner = _signed_inner(arrived.what, arrived.data)
        assert not said.startswith("GNSS") or says_normal(inner), said

    # ---- answers

    def _answer(self, arrived: Arrived) -> None:
        nonce = nonce_of(arrived.number)
        if arrived.number not in self._asked:
            self._ask(arrived.number)
            if self._rng.random() < 0.1 and arrived.number < 250:
                self._ask(arrived.number + 5)  # the next one, while this is not answered yet
            self._clock(self._now_ns + self._rng.choice((2 * MS, 4 * MS, 4 * MS, 50 * MS, 50 * MS if self._calm else 3001 * MS)))
        error = arrived.data.decode(errors="replace") if arrived.what == b"e" else ""
        event = ChallengeAnswered(self._now_ns, SITE, nonce, b"" if error else arrived.data, error)
        sent_ns = self._sent_ns.get(nonce)
        self._oracle.time_is(self._now_ns)
        if error or sent_ns is None:
            outputs = self._localiser.feed((event,))
            assert any(isinstance(output, MessageRefused) and len(output.refusal) < 2000 for output in outputs)
            self._tell("error instead of an answer" if error else "nobody asked", "")
        else:
            answer = self._verifier.challenge_answered(nonce, sent_ns, self._now_ns, event.data)
            kind = _kind(answer.refusal)
            inner = self._inner(arrived, kind)
            right = inner is not None and self._oracle.answer(nonce, sent_ns, self._now_ns, inner)
            assert right == (not answer.refusal), answer.refusal
            assert kind in OF_SIGNATURES | OF_ANSWERS | {"", "too long"}, answer.refusal
            outputs = self._localiser.feed((event,))
            self._assert_refused(outputs, answer.refusal and f"challenge: {answer.refusal}")
            self._tell(f"answer {kind or 'right'}", "")
        self._assert_no_more_than_right(outputs)
        if self._read_by_all:
            assert DATES.of_answer(arrived.data).partition(":")[0] in ("", "key no longer valid")
            try:
                self._plain.answer(arrived.data, self._now_ns)
            except Exception:  # as above
                self.told["plain subscriber refuses an answer"] += 1

    def _ask(self, number: int) -> None:
        nonce = nonce_of(number)
        self._asked.add(number)
        self._feed(ChallengeSent(self._now_ns, SITE, nonce))
        self._sent_ns[nonce] = self._now_ns
        self._plain.nonce, self._plain.asked = nonce, self._now_ns
        while len(self._sent_ns) > MOST_NONCES:
            del self._sent_ns[next(iter(self._sent_ns))]

    # ---- both

    def _inner(self, arrived: Arrived, kind: str) -> bytes | None:
        """What the station's key has signed, of a message that the code calls so: checked by another way than the code's."""
        assert (kind == "too long") == (len(arrived.data) > MOST_BYTES), f"{kind}: {len(arrived.data)} bytes"
        if kind == "too long":
            return None
        if kind in OF_SIGNATURES:
            assert not arrived.untouched, f"{kind}: nobody has touched it"
            assert arrived.inner is None or kind == "unreadable", f"{kind}: the station has signed it"
            return None
        assert Message(arrived.data).text(2) == KEY.key_id
        return _signed_inner(arrived.what, arrived.data) if arrived.inner is None else arrived.inner

    def _assert_refused(self, outputs: Iterable[TrainOutput], refusal: str) -> None:
        """The train refuses what the verifier beside it refuses, for the same reason."""
        found = [output.refusal for output in outputs if isinstance(output, MessageRefused)]
        assert len(found) == bool(refusal) and all(refusal in text for text in found), f"{found}, expected {refusal}"

    def _tell(self, *what: str) -> None:
        self.told.update(filter(None, what))
        self.told["trust NORMAL"] += self._localiser.trust is TrustState.NORMAL


def nonce_of(number: int) -> bytes:
    """What the train draws for a challenge."""
    return bytes((*range(15), number))


def new_oracle() -> Train:
    return Train(SITE, TRAIN.max_valid_ms, TRAIN.trust.recover_messages, MAP.sha256)


def _kind(refusal: str) -> str:
    """A refusal without the values in it."""
    kind = refusal.partition(":")[0]
    if kind.startswith("boot ") and kind.endswith(" not confirmed yet"):
        return "boot not confirmed"
    return "round trip" if kind.startswith("round trip of ") else kind


@lru_cache(maxsize=1024)  # of a story most come again and again
def _signed_inner(what: bytes, data: bytes) -> bytes:
    """What somebody believes that the station has signed: it must have. Checked by another way than the code's."""
    envelope = Message(data)
    try:
        PUBLIC.verify(envelope.text(3), SIGNED[what] + envelope.text(1))
    except InvalidSignature as error:
        raise AssertionError("believed, and the station has not signed it") from error
    return envelope.text(1)
