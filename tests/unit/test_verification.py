"""What a train believes: every refusal, by name, and freshness to the nanosecond. Clocks are numbers here."""

from collections.abc import Callable
from dataclasses import FrozenInstanceError
from typing import Any

import pytest
from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey

from integrity.messages import wayside_pb2 as pb
from integrity.messages.signatures import SigningKey, sign_challenge_reply, sign_health, signing_key
from integrity.messages.verification import Answer, HealthVerifier, LastHealth, Received
from integrity.states import State

SITE = "kokubunji-1"
PLACE = f"wayside/v1/{SITE}/health"
CHALLENGE_PLACE = f"wayside/v1/{SITE}/challenge"
KEY, STRANGER = (signing_key(Ed25519PrivateKey.from_private_bytes(bytes([n]) * 32)) for n in (1, 2))
BOOT, NEXT_BOOT, LATER_BOOT, OLD_BOOT = (bytes([n]) * 16 for n in (0xB0, 0xB1, 0xB2, 0xAF))
NONCE = bytes(range(16))
MS = 1_000_000
T0 = 7_000_000_000_000  # the train's clock at the challenge; the station's is 5,000 s behind
STATION_T0 = T0 - 5_000_000_000_000
ROUND_TRIP_NS = 4 * MS
NOW = T0 + ROUND_TRIP_NS + MS
GPS_NS = 1_456_000_000_000_000_000


def health(sequence: int = 57, **changes: Any) -> pb.Health:
    """NORMAL, issued when the challenge was answered."""
    fields: dict[str, Any] = {
        "site": SITE,
        "boot_id": BOOT,
        "sequence": sequence,
        "gps_time_ns": GPS_NS + sequence * 1_000_000_000,
        "issued_mono_ns": STATION_T0,
        "valid_for_ms": 3000,
        "state": pb.NORMAL,
        "monitored": ["G05.1C", "E11.1C"],
        "config_sha256": "c0ffee",
    }
    return pb.Health(**(fields | changes))


def signed(message: pb.Health, key: SigningKey = KEY, place: str = PLACE) -> bytes:
    return sign_health(key, place, message).SerializeToString()


def answered(verifier: HealthVerifier, key: SigningKey = KEY, sent_ns: int = T0, trip_ns: int = ROUND_TRIP_NS, **changes: Any) -> Answer:
    fields: dict[str, Any] = {"nonce": NONCE, "boot_id": BOOT, "issued_mono_ns": STATION_T0}
    reply = pb.ChallengeReply(**(fields | changes))
    data = sign_challenge_reply(key, CHALLENGE_PLACE, reply).SerializeToString()
    return verifier.challenge_answered(NONCE, sent_ns, sent_ns + trip_ns, data)


def tied(max_valid_ms: int = 3000) -> HealthVerifier:
    verifier = HealthVerifier(SITE, [KEY.public], max_valid_ms)
    assert answered(verifier).refusal == ""
    return verifier


def judged(verifier: HealthVerifier, message: pb.Health, now_ns: int = NOW) -> Received:
    return verifier.health(PLACE, signed(message), now_ns)


def test_a_message_that_is_right_in_everything_counts() -> None:
    received = judged(tied(), health())
    assert (received.verified, received.fresh, received.state, received.refusal) == (True, True, State.NORMAL, "")


def test_no_single_bit_of_a_message_can_be_flipped() -> None:
    verifier, data = tied(), signed(health())
    flipped = (data[: bit // 8] + bytes([data[bit // 8] ^ 1 << bit % 8]) + data[bit // 8 + 1 :] for bit in range(8 * len(data)))
    assert [bit for bit, message in enumerate(flipped) if verifier.health(PLACE, message, NOW).refusal == ""] == []


def test_no_single_bit_of_an_answer_can_be_flipped() -> None:
    verifier = HealthVerifier(SITE, [KEY.public], 3000)
    reply = pb.ChallengeReply(nonce=NONCE, boot_id=BOOT, issued_mono_ns=STATION_T0)
    data = sign_challenge_reply(KEY, CHALLENGE_PLACE, reply).SerializeToString()
    flipped = (data[: bit // 8] + bytes([data[bit // 8] ^ 1 << bit % 8]) + data[bit // 8 + 1 :] for bit in range(8 * len(data)))
    assert [b for b, d in enumerate(flipped) if not verifier.challenge_answered(NONCE, T0, T0 + MS, d).refusal] == []


def _raw(health_bytes: bytes) -> bytes:
    """Rightly signed bytes that need not be a Health."""
    private = KEY.private.sign(b"wayside.v1.health\0" + PLACE.encode() + b"\0" + health_bytes)
    return pb.SignedHealth(health=health_bytes, key_id=KEY.key_id, signature=private).SerializeToString()


REFUSED: dict[str, tuple[bytes, str]] = {
    "nothing": (b"", "unknown key: none named is not trusted for site kokubunji-1"),
    "garbage": (b"\xff" * 40, "unreadable: 40 bytes are no signed health"),
    "cut": (signed(health())[:-1], f"unreadable: {len(signed(health())) - 1} bytes are no signed health"),
    "a stranger's": (signed(health(), STRANGER), f"unknown key: {STRANGER.key_id.hex()} is not trusted"),
    "a stranger's under a trusted name": (
        pb.SignedHealth(
            health=health().SerializeToString(), key_id=KEY.key_id, signature=sign_health(STRANGER, PLACE, health()).signature
        ).SerializeToString(),
        f"wrong signature: not made by key {KEY.key_id.hex()}",
    ),
    "signed for another place": (signed(health(), place="wayside/v1/elsewhere/health"), "wrong signature"),
    "signed garbage": (_raw(b"\xff" * 9), "unreadable"),
    "signed text that is no text": (_raw(b"\x0a\x02\xff\xfe"), "unreadable"),
    "another site": (signed(health(site="elsewhere")), "wrong site: signed for 'elsewhere', expected 'kokubunji-1'"),
    "no boot": (signed(health(boot_id=b"")), "no boot: boot_id has 0 bytes, expected 16"),
    "short boot": (signed(health(boot_id=bytes(15))), "no boot: boot_id has 15 bytes, expected 16"),
    "no sequence": (signed(health(0)), "no sequence: it is 0"),
    "unconfirmed boot": (signed(health(boot_id=NEXT_BOOT)), f"boot {NEXT_BOOT.hex()} not confirmed yet: challenge it"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_refused_with_its_reason(name: str) -> None:
    data, refusal = REFUSED[name]
    received = tied().health(PLACE, data, NOW)
    assert refusal in received.refusal


@pytest.mark.parametrize("name", REFUSED)
def test_what_is_refused_says_nothing(name: str) -> None:
    received = tied().health(PLACE, REFUSED[name][0], NOW)
    assert (received.verified, received.fresh, received.health, received.state) == (False, False, None, State.NOT_CONFIRMABLE)


def test_without_keys_everything_is_refused() -> None:
    assert "unknown key" in HealthVerifier(SITE, [], 3000).health(PLACE, signed(health()), NOW).refusal


def test_a_right_message_at_another_key_expression_is_refused() -> None:
    received = tied().health("wayside/v1/elsewhere/health", signed(health()), NOW)
    assert received.refusal == "wrong place: came at wayside/v1/elsewhere/health, expected at wayside/v1/kokubunji-1/health"


SECOND: dict[str, tuple[pb.Health, str]] = {  # after sequence 57
    "repeated": (health(57), "repeated: sequence 57 once more"),
    "older": (health(41), "older: sequence 41 after 57"),
    "contradiction": (health(57, state=pb.NOT_CONFIRMABLE), "CONTRADICTION: sequence 57 signed twice with other bytes"),
    "next": (health(58), ""),
    "after a gap": (health(1000), ""),
}


@pytest.mark.parametrize("name", SECOND)
def test_the_second_message(name: str) -> None:
    verifier, (message, refusal) = tied(), SECOND[name]
    judged(verifier, health(57))
    received = judged(verifier, message)
    assert received.refusal.startswith(refusal) if refusal else received.verified


def test_a_refused_message_leaves_the_order_as_it_was() -> None:
    verifier = tied()
    judged(verifier, health(57))
    for data, _ in REFUSED.values():
        verifier.health(PLACE, data, NOW)
    verifier.health(PLACE, signed(health(10**6), STRANGER), NOW)
    assert judged(verifier, health(58)).fresh


def test_a_challenge_tells_what_is_older_to_a_train_that_has_heard_nothing() -> None:
    verifier = HealthVerifier(SITE, [KEY.public], 3000)
    answered(verifier, sequence=57)
    assert judged(verifier, health(56)).refusal == "older: sequence 56 after 57"


def test_the_message_that_a_challenge_names_counts() -> None:
    verifier = HealthVerifier(SITE, [KEY.public], 3000)
    answered(verifier, sequence=57)
    assert judged(verifier, health(57)).fresh


def test_before_the_first_challenge_a_message_is_verified_and_not_fresh() -> None:
    received = judged(HealthVerifier(SITE, [KEY.public], 3000), health())
    assert (received.verified, received.fresh, received.age_ns, received.state) == (True, False, None, State.NOT_CONFIRMABLE)


def test_the_first_challenge_makes_the_message_before_it_fresh() -> None:
    verifier = HealthVerifier(SITE, [KEY.public], 3000)
    received = judged(verifier, health())
    answered(verifier)
    assert verifier.again(received, NOW).fresh


def test_replays_of_several_boots_before_the_first_challenge_do_not_hide_the_true_one() -> None:
    verifier = HealthVerifier(SITE, [KEY.public], 3000)
    judged(verifier, health(10**9, boot_id=OLD_BOOT))
    answered(verifier)
    assert judged(verifier, health(1)).fresh


def restarted() -> HealthVerifier:
    verifier = tied()
    judged(verifier, health(57))
    assert answered(verifier, sent_ns=NOW, boot_id=NEXT_BOOT).boot_is_new
    return verifier


def test_a_new_boot_begins_again_with_one() -> None:
    assert judged(restarted(), health(1, boot_id=NEXT_BOOT, gps_time_ns=GPS_NS), NOW + 5 * MS).fresh


def test_a_superseded_boot_is_a_replay() -> None:
    assert judged(restarted(), health(58)).refusal.startswith(f"older boot: sequence 58 of boot {BOOT.hex()}")


def test_what_a_superseded_boot_said_holds_no_longer() -> None:
    verifier = tied()
    received = judged(verifier, health(57))
    answered(verifier, sent_ns=NOW, boot_id=NEXT_BOOT)
    assert not verifier.again(received, NOW + 5 * MS).fresh


ANSWERS: dict[str, tuple[Callable[[HealthVerifier], Answer], str]] = {
    "another nonce": (lambda v: answered(v, nonce=bytes(16)), f"wrong nonce: {'00' * 16} answered, {NONCE.hex()} asked"),
    "a stranger's": (lambda v: answered(v, STRANGER), "unknown key"),
    "no boot": (lambda v: answered(v, boot_id=b"x"), "no boot: boot_id has 1 bytes, expected 16"),
    "another boot, asked before the last had answered": (
        lambda v: answered(v, sent_ns=NOW + ROUND_TRIP_NS, boot_id=LATER_BOOT),
        f"which boot is the later is not known: asked before boot {NEXT_BOOT.hex()} had answered: ask again",
    ),
    "a superseded boot": (lambda v: answered(v, sent_ns=NOW + MS), f"older boot: boot {BOOT.hex()} answers again"),
    "before the last": (lambda v: answered(v, sent_ns=T0 - 1, boot_id=NEXT_BOOT), "late answer"),
    "too slow": (lambda v: answered(v, sent_ns=NOW, boot_id=NEXT_BOOT, trip_ns=3000 * MS + 1), "round trip of 3000.0 ms: expected 0 to"),
    "backwards": (lambda v: answered(v, sent_ns=NOW, boot_id=NEXT_BOOT, trip_ns=-1), "round trip of -0.0 ms"),
    "garbage": (lambda v: v.challenge_answered(NONCE, NOW, NOW, b"\xff" * 9), "unreadable: 9 bytes are no signed answer"),
    "nothing": (lambda v: v.challenge_answered(NONCE, NOW, NOW, b""), "unknown key: none named"),
    "a health's signature": (lambda v: v.challenge_answered(NONCE, NOW, NOW, signed(health())), "wrong signature"),
}


@pytest.mark.parametrize("name", ANSWERS)
def test_an_answer_is_refused_with_its_reason(name: str) -> None:
    attempt, refusal = ANSWERS[name]
    assert attempt(restarted()).refusal.startswith(refusal)


@pytest.mark.parametrize("name", ANSWERS)
def test_a_refused_answer_changes_nothing(name: str) -> None:
    verifier = restarted()
    ANSWERS[name][0](verifier)
    assert (verifier.boot_id, judged(verifier, health(1, boot_id=NEXT_BOOT), NOW + 5 * MS).age_ns) == (NEXT_BOOT, 5 * MS + 5000)


def test_another_boot_that_was_asked_after_the_last_had_answered_is_in_force() -> None:
    assert answered(restarted(), sent_ns=NOW + ROUND_TRIP_NS + 1, boot_id=LATER_BOOT) == Answer("", True, ROUND_TRIP_NS)


@pytest.mark.parametrize("trip_ns, refusal", [(0, ""), (3000 * MS, ""), (3000 * MS + 1, "round trip of 3000.0 ms: expected 0 to 3000 ms")])
def test_the_round_trip_to_the_nanosecond(trip_ns: int, refusal: str) -> None:
    assert answered(HealthVerifier(SITE, [KEY.public], 3000), trip_ns=trip_ns).refusal == refusal


def test_the_same_boot_may_answer_twice_to_one_challenge() -> None:
    assert answered(tied(), issued_mono_ns=STATION_T0 + MS) == Answer("", False, ROUND_TRIP_NS)


def test_a_nonce_that_was_cut_is_refused_even_if_it_is_answered_as_asked() -> None:
    reply = pb.ChallengeReply(nonce=NONCE[:15], boot_id=BOOT, issued_mono_ns=STATION_T0)
    data = sign_challenge_reply(KEY, CHALLENGE_PLACE, reply).SerializeToString()
    refusal = HealthVerifier(SITE, [KEY.public], 3000).challenge_answered(NONCE[:15], T0, T0, data).refusal
    assert refusal.startswith("wrong nonce")


def test_a_memory_judges_on_as_the_verifier_would_have() -> None:
    on = HealthVerifier(SITE, [KEY.public], 3000, restarted().memory())
    assert judged(on, health(58)).refusal.startswith(f"older boot: sequence 58 of boot {BOOT.hex()}")


def test_what_is_told_stays_told_when_a_later_answer_tells_less() -> None:
    verifier = tied()
    answered(verifier, sent_ns=T0 + MS, sequence=57)
    answered(verifier, sent_ns=T0 + 2 * MS, sequence=3)
    assert judged(verifier, health(56)).refusal == "older: sequence 56 after 57"


def test_of_the_last_sequence_and_the_one_told_the_later_counts() -> None:
    verifier = tied()
    judged(verifier, health(57))
    answered(verifier, sent_ns=T0 + MS, sequence=3)
    assert judged(verifier, health(56)).refusal == "older: sequence 56 after 57"


def test_before_the_first_challenge_it_is_worth_one() -> None:
    assert judged(HealthVerifier(SITE, [KEY.public], 3000), health()).unconfirmed


@pytest.mark.parametrize("boot_id, unconfirmed", [(BOOT, False), (NEXT_BOOT, True)])
def test_a_boot_that_is_not_in_force_is_worth_a_challenge(boot_id: bytes, unconfirmed: bool) -> None:
    assert judged(tied(), health(boot_id=boot_id)).unconfirmed is unconfirmed


def test_what_was_refused_stays_refused() -> None:
    verifier = tied()
    received = verifier.health(PLACE, b"", NOW)
    assert verifier.again(received, NOW + MS) is received


def test_what_a_superseded_boot_said_has_no_age_and_is_worth_a_challenge() -> None:
    verifier = tied()
    received = judged(verifier, health(57))
    answered(verifier, sent_ns=NOW, boot_id=NEXT_BOOT)
    later = verifier.again(received, NOW + 5 * MS)
    assert (later.unconfirmed, later.age_ns, later.age_ms) == (True, None, None)
    assert later.staleness == f"boot {BOOT.hex()} is not in force: the station answers as boot {NEXT_BOOT.hex()}"


def test_what_is_refused_is_worth_no_challenge_and_has_no_validity() -> None:
    received = tied().health(PLACE, b"", NOW)
    assert (received.unconfirmed, received.sequence, received.age_ns, received.valid_ns) == (False, None, None, 0)


@pytest.mark.parametrize("name", ANSWERS)
def test_a_refused_answer_brings_no_boot(name: str) -> None:
    assert not ANSWERS[name][0](restarted()).boot_is_new


def test_a_judgement_cannot_be_changed() -> None:
    with pytest.raises(FrozenInstanceError):
        judged(tied(), health()).fresh = True  # type: ignore[misc]


def test_before_the_first_challenge_no_boot_is_in_force() -> None:
    assert HealthVerifier(SITE, [KEY.public], 3000).boot_id is None


def test_before_the_first_answer_nothing_is_told() -> None:
    verifier = HealthVerifier(SITE, [KEY.public], 3000)
    judged(verifier, health())
    assert verifier.memory().last == LastHealth(BOOT, 57, health().SerializeToString(), health().gps_time_ns, 0)


@pytest.mark.parametrize("odd", [Received("", True), Received("refused", False, health=health())])
def test_half_a_judgement_is_not_judged_again(odd: Received) -> None:
    assert tied().again(odd, NOW) is odd


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
