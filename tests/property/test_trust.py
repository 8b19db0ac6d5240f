"""NORMAL means: enough fresh NORMAL messages in a row, the last of them still valid. Checked over all sequences, not over samples.

What is expected is computed from the history alone, by `Story`, which shares no code with `train_client.trust`.
"""

from collections.abc import Callable
from itertools import product
from typing import NamedTuple

import pytest
from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey
from hypothesis import given, settings
from hypothesis import strategies as st

from integrity.messages import wayside_pb2 as pb
from integrity.messages.signatures import sign_challenge_reply, sign_health, signing_key
from integrity.messages.verification import NS_PER_MS, HealthVerifier, Received
from integrity.states import State
from train_client.trust import Trust, TrustLimits, TrustState, after_message, after_time, next_change_ns

NOW = 1_000_000
LEFT_NS = 20  # of a fresh message, on the train's clock
PATIENCE_NS = 7
DEPTH = 10


class Story(NamedTuple):
    """What has happened: fresh NORMAL messages in a row, and the end of the last message that was verified and not in vain."""

    in_a_row: int = 0
    end_ns: int | None = None

    def normal(self, now_ns: int, recover_messages: int) -> bool:
        return self.end_ns is not None and self.in_a_row >= recover_messages and now_ns <= self.end_ns

    def told(self, received: Received, now_ns: int) -> "Story":
        row = self.in_a_row if self.end_ns is not None and now_ns <= self.end_ns else 0
        if not received.verified or (received.said is State.NORMAL and not received.fresh):
            return self._replace(in_a_row=row)
        return Story(row + 1 if received.said is State.NORMAL else 0, now_ns + LEFT_NS if received.fresh else now_ns)


def told(said: State, fresh: bool) -> Received:
    """A message of 23 ns validity, 1 ns old: 22 ns of age bound are 21 ns of the clock, and one is rounded away."""
    return Received("", True, fresh, said=said, sequence=1, age_ns=1 if fresh else 99, valid_ns=LEFT_NS + 2)


MESSAGES = {
    "fresh NORMAL": told(State.NORMAL, True),
    "stale NORMAL": told(State.NORMAL, False),
    "fresh ANOMALY": told(State.SATELLITE_ANOMALY, True),
    "unfresh NOT_CONFIRMABLE": told(State.NOT_CONFIRMABLE, False),
    "refused": Received("wrong signature", False, True, said=State.NORMAL, sequence=1, age_ns=1, valid_ns=LEFT_NS + 2),
}
STEPS_NS = {"to the end": LEFT_NS, "on": 1, "half": LEFT_NS // 2, "to the end of patience": LEFT_NS + PATIENCE_NS}


class Point(NamedTuple):
    now_ns: int
    trust: Trust
    story: Story


def violations(limits: TrustLimits, depth: int, holds: Callable[[Point, str, Point], bool]) -> list[tuple[Point, str, Point]]:
    """Steps for which `holds` does not, in every sequence of messages and steps of time up to a length.

    Equal points that were reached in several ways are followed once: 200,000 steps stand for the 9^10 sequences of ten.
    """
    front, broken = {Point(NOW, Trust(), Story())}, []
    seen = set(front)
    for _ in range(depth):
        beyond = set()
        for before in front:
            for name in (*MESSAGES, *STEPS_NS):
                after = next_point(before, name, limits)
                if not holds(before, name, after):
                    broken.append((before, name, after))
                beyond.add(after)
        front = beyond - seen
        seen |= front
    return broken


def next_point(before: Point, name: str, limits: TrustLimits) -> Point:
    if name in STEPS_NS:
        now_ns = before.now_ns + STEPS_NS[name]
        return Point(now_ns, after_time(before.trust, now_ns, limits), before.story)
    received = MESSAGES[name]
    return Point(before.now_ns, after_message(before.trust, received, before.now_ns, limits), before.story.told(received, before.now_ns))


@pytest.mark.parametrize("recover_messages, patience_ns", [(1, PATIENCE_NS), (2, 0), (3, PATIENCE_NS)])
def test_normal_exactly_where_enough_fresh_ones_came_in_a_row_and_the_last_is_valid(recover_messages: int, patience_ns: int) -> None:
    def holds(before: Point, name: str, after: Point) -> bool:
        return (after.trust.state is TrustState.NORMAL) == after.story.normal(after.now_ns, recover_messages)

    assert violations(TrustLimits(recover_messages, patience_ns), DEPTH, holds)[:1] == []


@pytest.mark.parametrize("recover_messages", [1, 3])
def test_nothing_refused_or_unfresh_ever_raises_trust(recover_messages: int) -> None:
    def holds(before: Point, name: str, after: Point) -> bool:
        if name in ("refused", "stale NORMAL"):
            return after.trust is before.trust
        if name == "unfresh NOT_CONFIRMABLE":
            return after.trust.state is TrustState.NOT_CONFIRMABLE and after.trust.normals == 0
        return True

    assert violations(TrustLimits(recover_messages, PATIENCE_NS), DEPTH, holds)[:1] == []


def test_time_alone_never_raises_trust() -> None:
    """Neither to NORMAL, nor by a count, nor by a later end."""

    def holds(before: Point, name: str, after: Point) -> bool:
        fallen = after.trust.state in (before.trust.state, TrustState.STALE, TrustState.NO_COMMS)
        same = after.trust.normals <= before.trust.normals and after.trust.valid_until_ns == before.trust.valid_until_ns
        return name not in STEPS_NS or (fallen and same)

    assert violations(TrustLimits(2, PATIENCE_NS), DEPTH, holds)[:1] == []


@pytest.mark.parametrize("patience_ns", [0, 1, PATIENCE_NS])
def test_the_next_change_is_the_first(patience_ns: int) -> None:
    """Nothing changes a nanosecond before, something does then; where none is announced, nothing changes ever."""
    limits = TrustLimits(2, patience_ns)

    def holds(before: Point, name: str, after: Point) -> bool:
        change_ns = next_change_ns(after.trust, limits)
        if change_ns is None:
            return after_time(after.trust, 2**62, limits) is after.trust
        kept = after_time(after.trust, change_ns - 1, limits) is after.trust
        return kept and after_time(after.trust, change_ns, limits).state is not after.trust.state

    assert violations(limits, 6, holds)[:1] == []


# With real messages, and the real judge of them

SITE = "k-1"
PLACE, CHALLENGE_PLACE = f"wayside/v1/{SITE}/health", f"wayside/v1/{SITE}/challenge"
KEY, STRANGER = (signing_key(Ed25519PrivateKey.from_private_bytes(bytes([n]) * 32)) for n in (1, 2))
BOOT, NONCE = bytes([0xB0]) * 16, bytes(16)
VALID_MS = 1000
AHEAD_NS = 5_000_000_000  # of the station's clock
REAL = ("normal", "delayed normal", "anomaly", "delayed not confirmable", "a stranger's", "the last once more", "silence")
COUNTING = {"normal": State.NORMAL, "anomaly": State.SATELLITE_ANOMALY, "delayed not confirmable": State.NOT_CONFIRMABLE}


def tied(max_valid_ms: int = VALID_MS, trip_ns: int = 0) -> HealthVerifier:
    """A verifier that has challenged the station, `trip_ns` ago."""
    verifier = HealthVerifier(SITE, [KEY.public], max_valid_ms)
    reply = pb.ChallengeReply(nonce=NONCE, boot_id=BOOT, issued_mono_ns=NOW + AHEAD_NS)
    data = sign_challenge_reply(KEY, CHALLENGE_PLACE, reply).SerializeToString()
    assert verifier.challenge_answered(NONCE, NOW, NOW + trip_ns, data).refusal == ""
    return verifier


def signed(sequence: int, issued_ns: int, name: str = "normal", valid_for_ms: int = VALID_MS) -> bytes:
    state = pb.SATELLITE_ANOMALY if name == "anomaly" else pb.NOT_CONFIRMABLE if name.endswith("confirmable") else pb.NORMAL
    message = pb.Health(
        site=SITE,
        boot_id=BOOT,
        sequence=sequence,
        gps_time_ns=sequence,
        issued_mono_ns=issued_ns + AHEAD_NS,
        valid_for_ms=valid_for_ms,
        state=state,
        cause=pb.CAUSE_UNSPECIFIED if state == pb.NORMAL else pb.SPOOFING,
    )
    return sign_health(STRANGER if name == "a stranger's" else KEY, PLACE, message).SerializeToString()


DATA = {
    (name, i): signed(i + 1, NOW + (i - 2 * VALID_MS if name.startswith("delayed") else i) * NS_PER_MS, name)
    for name in REAL
    for i in range(5)
}


def lived(names: tuple[str, ...], limits: TrustLimits) -> tuple[list[bool], list[bool]]:
    """One message a millisecond: where trust was NORMAL, and where it should have been."""
    verifier, trust, in_a_row, last, now_ns = tied(), Trust(), 0, b"", NOW
    was, should = [], []
    for i, name in enumerate(names):
        now_ns += (2 * VALID_MS if name == "silence" else 1) * NS_PER_MS
        trust = after_time(trust, now_ns, limits)
        if name == "silence":
            in_a_row = 0
        else:
            data = last if name == "the last once more" else DATA[name, i]
            last = data if name != "a stranger's" else last
            trust = after_message(trust, verifier.health(PLACE, data, now_ns), now_ns, limits)
            late = "silence" in names[:i]  # whatever was signed for this place of the sequence was signed before the silence
            if name in COUNTING:
                in_a_row = in_a_row + (not late) if name == "normal" else 0
        was.append(trust.state is TrustState.NORMAL)
        should.append(in_a_row >= limits.recover_messages)
    return was, should


def test_the_same_with_signed_messages() -> None:
    """2,401 sequences of four."""
    limits = TrustLimits(2, PATIENCE_NS)
    wrong = [names for names in product(REAL, repeat=4) if (found := lived(names, limits))[0] != found[1]]
    assert wrong == []


@pytest.mark.parametrize("name", ["normal", "anomaly", "delayed not confirmable"])
def test_without_a_challenge_nothing_that_is_signed_changes_trust(name: str) -> None:
    before = Trust(TrustState.NORMAL, 3, NOW + 10 * NS_PER_MS)
    received = HealthVerifier(SITE, [KEY.public], VALID_MS).health(PLACE, DATA[name, 0], NOW)
    assert after_message(before, received, NOW, TrustLimits(1, 0)) is before


ages_ms = st.integers(0, 3000)


@settings(max_examples=200, deadline=None)
@given(ages_ms, ages_ms, st.integers(100, 3000), st.integers(100, 3000), st.integers(0, 100), st.integers(0, 10**6))
def test_trust_ends_with_the_freshness_of_the_message_and_not_much_before(
    since_ms: int, ago_ms: int, valid_for_ms: int, max_valid_ms: int, trip_ms: int, odd_ns: int
) -> None:
    """`since_ms` after the challenge, a message comes that was issued `ago_ms` before; what is lost is drift, 1e-3, and rounding."""
    verifier = tied(max_valid_ms, trip_ms * NS_PER_MS)
    now_ns = NOW + since_ms * NS_PER_MS + odd_ns
    received = verifier.health(PLACE, signed(1, now_ns - ago_ms * NS_PER_MS, valid_for_ms=valid_for_ms), now_ns)
    until_ns = after_message(Trust(), received, now_ns, TrustLimits(1, 0)).valid_until_ns
    if not received.fresh:
        assert until_ns is None
        return
    assert until_ns is not None
    lost_ns = 3 + (until_ns - now_ns) // 1000 + (received.valid_ns - (received.age_ns or 0)) // 1000
    assert [verifier.again(received, t).fresh for t in (until_ns, until_ns + lost_ns)] == [True, False]
