"""Health at its limits: every field, every size, versions that are not known; and what strangers can make a train remember: nothing."""

import gc
import os
import time
from collections.abc import Callable, Iterator

import psutil
import pytest
from google.protobuf.descriptor import FieldDescriptor
from google.protobuf.message import DecodeError

from integrity.messages import wayside_pb2 as pb
from integrity.messages.key_expressions import HEALTH, site_key
from integrity.messages.signatures import sign_challenge_reply
from integrity.messages.verification import Answer, HealthVerifier, Received
from integrity.states import State
from tests.fuzz.health_examine import MOST_NONCES, TRAIN, new_localiser
from tests.fuzz.health_oracle import Train
from tests.fuzz.health_wire import LENGTH, UNKNOWN_NUMBERS, VARINT, field_of, large_of, limits_of, without, written
from tests.unit.train import ride
from tests.unit.verifying import (
    BOOT,
    CHALLENGE_PLACE,
    KEY,
    MS,
    NEXT_BOOT,
    NONCE,
    NOW,
    PLACE,
    ROUND_TRIP_NS,
    SITE,
    STATION_T0,
    T0,
    health,
    signed,
    tied,
)
from train_client.events import ChallengeAnswered, ChallengeSent, HealthReceived
from train_client.localisation.localiser import TrainLocaliser
from train_client.snapshots import encode_snapshot

LARGEST_BYTES = 16 << 20
SIZES = [1, 10, 100, 1000, 10_000, 60_000, 65_536, 100_000, 1_000_000, LARGEST_BYTES]
MOST_BYTES = 65_536  # of a message; a longer one is refused unread
MOST_SECONDS = {"a stranger's": 1.0, "the station's own": 3.0}  # of 16 MB; measured: 0.12 and 0.53
MOST_KEPT_MB = 64  # two messages of 16 MB, the last and the one at hand, and what the allocator holds back
MOST_REFUSAL_CHARACTERS = 400
REPLY = pb.ChallengeReply(nonce=NONCE, boot_id=BOOT, issued_mono_ns=STATION_T0, sequence=5)


def envelope(context: bytes, place: str, inner: bytes) -> bytes:
    """Rightly signed bytes, whatever they are."""
    signature = KEY.private.sign(context + b"\0" + place.encode() + b"\0" + inner)
    return pb.SignedHealth(health=inner, key_id=KEY.key_id, signature=signature).SerializeToString()


def judged(inner: bytes, verifier: HealthVerifier | None = None) -> Received:
    return (verifier or tied()).health(PLACE, envelope(b"wayside.v1.health", PLACE, inner), NOW)


def answered(inner: bytes) -> Answer:
    verifier = HealthVerifier(SITE, [KEY.public], 3000)
    return verifier.challenge_answered(NONCE, T0, T0 + ROUND_TRIP_NS, envelope(b"wayside.v1.challenge", CHALLENGE_PLACE, inner))


def oracle() -> Train:
    train = Train(SITE, 3000, 1)
    assert train.answer(NONCE, T0, T0 + ROUND_TRIP_NS, without(REPLY.SerializeToString(), 4))
    return train


def is_readable(kind: type[pb.Health] | type[pb.ChallengeReply], inner: bytes) -> bool:
    if len(envelope(b"", "", inner)) > MOST_BYTES:
        return False
    try:
        kind.FromString(inner)
    except DecodeError:
        return False
    return True


def at_limits(field: FieldDescriptor, inner: bytes) -> Iterator[bytes]:
    """The message with the field at its limits: before it, after it, instead of it; and without it."""
    stripped = without(inner, field.number)
    yield stripped
    for limit in (*limits_of(field), *large_of(field)):
        yield from (stripped + limit, inner + limit, limit + inner)


@pytest.mark.parametrize("name", list(pb.Health.DESCRIPTOR.fields_by_name))
def test_a_field_of_health_at_its_limits_reads_by_the_rules(name: str) -> None:
    for inner in at_limits(field_of(pb.Health, name), health().SerializeToString()):
        received = judged(inner)
        assert received.refusal.startswith(("unreadable", "too long")) != is_readable(pb.Health, inner), inner[-60:].hex()
        if is_readable(pb.Health, inner):
            right = oracle().health(NOW, inner)
            found = received.verified, received.said is State.NORMAL, received.said is State.SATELLITE_ANOMALY, received.fresh
            assert found == right[:4], inner[-60:].hex()
            unheard = judged(inner, HealthVerifier(SITE, [KEY.public], 3000))
            assert (unheard.verified, unheard.fresh) == Train(SITE, 3000, 1).health(NOW, inner)[::3][:2], inner[-60:].hex()


@pytest.mark.parametrize("name", list(pb.ChallengeReply.DESCRIPTOR.fields_by_name))
def test_a_field_of_an_answer_at_its_limits_reads_by_the_rules(name: str) -> None:
    for inner in at_limits(field_of(pb.ChallengeReply, name), REPLY.SerializeToString()):
        right = is_readable(pb.ChallengeReply, inner) and Train(SITE, 3000, 1).answer(NONCE, T0, T0 + ROUND_TRIP_NS, inner)
        assert (not answered(inner).refusal) == right, inner[-60:].hex()


@pytest.mark.parametrize("number", UNKNOWN_NUMBERS)
def test_a_field_of_a_later_version_is_passed_over(number: int) -> None:
    received = judged(health().SerializeToString() + written(number, LENGTH, b"new") + written(number, VARINT, 7))
    assert received.fresh and received.said is State.NORMAL


@pytest.mark.parametrize("state", [0, 4, 5, 127, 2**31 - 1, -1, -(2**31)])
def test_a_state_of_a_later_version_is_not_confirmable_and_in_force(state: int) -> None:
    verifier = tied()
    assert verifier.health(PLACE, signed(health(57)), NOW).state is State.NORMAL
    received = verifier.health(PLACE, signed(health(58, state=state)), NOW)
    assert (received.verified, received.said, received.caution) == (True, State.NOT_CONFIRMABLE, f"state {state} is unknown")


# ---- sizes

STRANGERS: dict[str, Callable[[int], bytes]] = {
    "zeros": bytes,
    "noise": os.urandom,
    "fields that are not known": lambda size: written(60, VARINT, 1) * (size // 3),
    "a long name of a key": lambda size: written(2, LENGTH, bytes(size)),
    "long bytes under a trusted name": lambda size: (
        written(1, LENGTH, bytes(size)) + written(2, LENGTH, KEY.key_id) + written(3, LENGTH, bytes(64))
    ),
    "a long signature": lambda size: written(1, LENGTH, b"x") + written(2, LENGTH, KEY.key_id) + written(3, LENGTH, bytes(size)),
}
OWN: dict[str, Callable[[int], bytes]] = {
    "zeros": bytes,
    "a long reason": lambda size: written(13, LENGTH, b"r" * size),
    "a long site": lambda size: written(1, LENGTH, b"s" * size),
    "signals": lambda size: written(15, LENGTH, b"G05.1C") * (size // 8),
    "empty signals": lambda size: written(21, LENGTH, b"") * (size // 3),
    "B-values": lambda size: written(21, LENGTH, written(7, LENGTH, bytes(size // 4 * 4))),
    "fields that are not known": lambda size: written(60, VARINT, 1) * (size // 3),
}


def own(name: str, size: int) -> bytes:
    inner = health(57 + SIZES.index(size)).SerializeToString()
    return envelope(b"wayside.v1.health", PLACE, inner + OWN[name](size))


def seconds_of(verifier: HealthVerifier, data: bytes) -> float:
    begun = time.process_time()
    verifier.health(PLACE, data, NOW)
    return time.process_time() - begun


@pytest.mark.parametrize("name", STRANGERS)
def test_a_stranger_takes_little_time_at_any_size(name: str) -> None:
    verifier = tied()
    assert max(seconds_of(verifier, STRANGERS[name](size)) for size in SIZES) <= MOST_SECONDS["a stranger's"]


@pytest.mark.parametrize("name", STRANGERS)
def test_a_stranger_is_refused_at_any_size(name: str) -> None:
    verifier = tied()
    refusals = {verifier.health(PLACE, STRANGERS[name](size), NOW).refusal.partition(":")[0] for size in SIZES}
    assert refusals - {"unreadable", "unknown key", "wrong signature"} == {"too long"}


@pytest.mark.parametrize("name", OWN)
def test_the_station_itself_takes_a_bounded_time_at_any_size(name: str) -> None:
    verifier = tied()
    assert max(seconds_of(verifier, own(name, size)) for size in SIZES) <= MOST_SECONDS["the station's own"]


@pytest.mark.parametrize("name", ["a long reason", "signals", "empty signals", "B-values", "fields that are not known"])
def test_a_long_message_of_the_station_counts_as_a_short_one_does_until_it_is_too_long(name: str) -> None:
    verifier = tied()
    counts = [verifier.health(PLACE, own(name, size), NOW).state is State.NORMAL for size in SIZES]
    assert counts == [len(own(name, size)) <= MOST_BYTES for size in SIZES] and True in counts and False in counts


def test_memory_is_given_back() -> None:
    verifier, process = tied(), psutil.Process()

    def sweep() -> float:
        for name in STRANGERS:
            verifier.health(PLACE, STRANGERS[name](LARGEST_BYTES), NOW)
        for name in OWN:
            verifier.health(PLACE, own(name, LARGEST_BYTES), NOW)
        gc.collect()
        return float(process.memory_info().rss) / 1e6

    before_mb = process.memory_info().rss / 1e6
    assert max(sweep(), sweep()) - before_mb <= MOST_KEPT_MB


@pytest.mark.parametrize("data", [STRANGERS["a long name of a key"](1000), signed(health(site="s" * 1000))], ids=["key", "site"])
def test_a_refusal_is_a_line_for_a_person(data: bytes) -> None:
    assert len(tied().health(PLACE, data, NOW).refusal) <= MOST_REFUSAL_CHARACTERS


# ---- what a train remembers

JUNK: tuple[Callable[[int], bytes], ...] = (
    lambda n: os.urandom(200),
    lambda n: pb.SignedHealth(health=os.urandom(50), key_id=n.to_bytes(8, "big"), signature=bytes(64)).SerializeToString(),
    lambda n: pb.SignedHealth(health=signed_by_nobody(n), key_id=ride.KEY.key_id, signature=os.urandom(64)).SerializeToString(),
)


def signed_by_nobody(n: int) -> bytes:
    return pb.Health(site=ride.SITE, boot_id=n.to_bytes(16, "big"), sequence=n + 1, state=pb.NORMAL).SerializeToString()


def snapshot_bytes(train: TrainLocaliser, mono_ns: int) -> int:
    return encode_snapshot(train.snapshot(), TRAIN, ride.MAP, mono_ns).ByteSize()


def test_nothing_that_strangers_say_is_remembered() -> None:
    train, at = new_localiser(), site_key(ride.SITE, HEALTH)

    def flood(first: int, n: int) -> int:
        for k in range(first, first + n):
            for junk in JUNK:
                train.feed(
                    (HealthReceived(ride.START_NS + k, at, junk(k)), ChallengeAnswered(ride.START_NS + k, ride.SITE, bytes(16), junk(k)))
                )
        return snapshot_bytes(train, ride.START_NS + first + n)

    assert flood(10_000, 1000) <= flood(0, 10) + 8  # the count of what was refused needs more bytes


def test_questions_that_nobody_answers_are_forgotten() -> None:
    train = new_localiser()
    train.feed(ChallengeSent(ride.START_NS + k, ride.SITE, k.to_bytes(16, "big")) for k in range(1000))
    written_down = encode_snapshot(train.snapshot(), TRAIN, ride.MAP, 0).SerializeToString()
    assert sum(k.to_bytes(16, "big") in written_down for k in range(1000)) == MOST_NONCES


def test_a_boot_of_the_station_that_is_over_is_remembered_by_its_name_alone() -> None:
    verifier = tied()
    boots = [NEXT_BOOT[:14] + n.to_bytes(2, "big") for n in range(1000)]
    for k, boot in enumerate(boots):
        sent_ns = NOW + k * 10 * MS
        reply = pb.ChallengeReply(nonce=NONCE, boot_id=boot, issued_mono_ns=STATION_T0)
        data = sign_challenge_reply(KEY, CHALLENGE_PLACE, reply).SerializeToString()
        assert not verifier.challenge_answered(NONCE, sent_ns, sent_ns + ROUND_TRIP_NS, data).refusal
    assert verifier.memory().superseded == tuple(sorted((BOOT, *boots[:-1])))
