"""What a train believes: every refusal, by name. Clocks are numbers here."""

from collections.abc import Callable

import pytest

from integrity.messages import wayside_pb2 as pb
from integrity.messages.signatures import sign_challenge_reply, sign_health
from integrity.messages.verification import MOST_BYTES, Answer, HealthVerifier, LastHealth, Received, cut
from integrity.states import State
from tests.unit.verifying import (
    BOOT,
    CHALLENGE_PLACE,
    GPS_NS,
    KEY,
    LATER_BOOT,
    MS,
    NEXT_BOOT,
    NONCE,
    NOW,
    OLD_BOOT,
    PLACE,
    ROUND_TRIP_NS,
    SITE,
    STATION_T0,
    STRANGER,
    T0,
    answered,
    health,
    judged,
    signed,
    tied,
)


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
    "unconfirmed boot": (signed(health(boot_id=NEXT_BOOT)), f"boot not confirmed yet: challenge {NEXT_BOOT.hex()} (in force"),
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


def of_bytes(size: int) -> bytes:
    """A right message as long as that."""
    room = size - len(signed(health(57, reasons=[""]))) - 5  # so many more bytes the greater lengths need
    data = next(data for more in range(6) if len(data := signed(health(57, reasons=["r" * (room + more)]))) == size)
    return data


@pytest.mark.parametrize("size, refusal", [(MOST_BYTES, ""), (MOST_BYTES + 1, "too long: more than 65536 bytes")])
def test_how_long_a_message_may_be(size: int, refusal: str) -> None:
    assert tied().health(PLACE, of_bytes(size), NOW).refusal == refusal


@pytest.mark.parametrize("size, refusal", [(MOST_BYTES, "unreadable"), (MOST_BYTES + 1, "too long")])
def test_how_long_an_answer_may_be(size: int, refusal: str) -> None:
    assert tied().challenge_answered(NONCE, NOW, NOW, b"\xff" * size).refusal.startswith(refusal)


@pytest.mark.parametrize("size", [0, MOST_BYTES, MOST_BYTES + 1, 2 * MOST_BYTES])
def test_what_is_cut_is_refused_as_the_whole_is(size: int) -> None:
    data = b"\xff" * size
    assert tied().health(PLACE, cut(data), NOW).refusal == tied().health(PLACE, data, NOW).refusal


def test_no_more_is_kept_than_tells_that_it_is_too_long() -> None:
    assert len(cut(bytes(2 * MOST_BYTES))) == MOST_BYTES + 1


def test_a_name_of_another_length_is_told_by_its_length() -> None:
    data = pb.SignedHealth(key_id=bytes(1000)).SerializeToString()
    assert tied().health(PLACE, data, NOW).refusal.startswith("unknown key: one of 1000 bytes is not trusted")


def test_of_a_long_site_the_beginning_is_told() -> None:
    assert judged(tied(), health(site="s" * 1000)).refusal == f"wrong site: signed for {'s' * 64!r}, expected {SITE!r}"


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


@pytest.mark.parametrize("sequence, missed", [(58, 0), (59, 1), (1000, 942)])
def test_a_gap_in_the_sequence_is_told(sequence: int, missed: int) -> None:
    verifier = tied()
    judged(verifier, health(57))
    assert judged(verifier, health(sequence)).missed == missed


def test_before_the_first_message_of_a_boot_nothing_can_be_missed() -> None:
    verifier = HealthVerifier(SITE, [KEY.public], 3000)
    answered(verifier, sequence=57)
    assert judged(verifier, health(60)).missed == 0


def test_what_is_refused_misses_nothing() -> None:
    verifier = tied()
    judged(verifier, health(57))
    assert judged(verifier, health(70, site="elsewhere")).missed == 0


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
    assert judged(verifier, health(56)).refusal == "overtaken: sequence 56, a challenge has named 57 already"


def test_a_copy_of_the_last_message_is_one_also_where_a_challenge_has_named_a_later_one() -> None:
    verifier = tied()
    judged(verifier, health(41))
    answered(verifier, sent_ns=T0 + MS, sequence=57)
    assert judged(verifier, health(41)).refusal == "repeated: sequence 41 once more"


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
    assert judged(verifier, health(56)).refusal == "overtaken: sequence 56, a challenge has named 57 already"


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
    with pytest.raises(AttributeError):
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
