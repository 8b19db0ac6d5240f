"""What holds under every attack, judged by the train's own words and by what it wrote down of what came to it.

Genuine is what the station's key has signed for this site and place, found out here by cryptography and protobuf alone. The two rules:

    NEVER LATE    whenever the train trusts, a genuine NORMAL had come by then, and not more than its validity and 100 ms have passed since
                  the station issued it (one monotonic clock serves all processes of a machine); nor does it promise more
    NEVER RAISED  whenever it begins to trust, ten genuine NORMAL messages had come since it trusted last, each still valid and of a boot
                  that had answered a nonce of this train
"""

from collections import Counter
from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

from cryptography.exceptions import InvalidSignature
from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PublicKey
from google.protobuf.message import DecodeError

from integrity.messages import wayside_pb2 as pb
from recordings.reader import Entry
from tests.e2e.attacks.aboard import Said

ALLOWED_NS = 100_000_000
MAX_VALID_NS = 3_000_000_000  # of the train file
RECOVER_MESSAGES = 10
SILENT_NS = 1_500_000_000  # a train at 10 Hz that says nothing for longer gives no evidence


class Genuine(NamedTuple):
    """A message of the station that came to the train at `came_ns`; all times of the machine's clock."""

    came_ns: int
    boot_id: bytes
    sequence: int
    issued_ns: int
    ends_ns: int
    normal: bool


class Came(NamedTuple):
    """All that came to a train: genuine health, in order; when each boot answered first; how much came that was not genuine."""

    genuine: tuple[Genuine, ...]
    answered_ns: dict[bytes, int]
    not_genuine: int


def came(entries: Sequence[Entry], site: str, public: bytes) -> Came:
    """Of a train's recording."""
    key = Ed25519PublicKey.from_public_bytes(public)
    asked = {e.message.nonce for e in entries if isinstance(e.message, pb.ChallengeSent)}
    health = [_genuine(e.message, site, key) for e in entries if isinstance(e.message, pb.HealthReceived)]
    answers = [(e.message, _boot(e.message, site, key)) for e in entries if isinstance(e.message, pb.ChallengeAnswered)]
    answered_ns: dict[bytes, int] = {}
    for message, boot_id in answers:
        if boot_id is not None and message.nonce in asked:
            answered_ns.setdefault(boot_id, message.mono_ns)
    return Came(tuple(g for g in health if g), answered_ns, health.count(None) + sum(boot is None for _, boot in answers))


def broken_rules(said: Sequence[Said], came: Came) -> list[str]:
    """Each breach in words; none: both rules have held."""
    breaches = []
    latest, k, before, lost_ns = -1, 0, False, 0
    for position in said:
        while k < len(came.genuine) and came.genuine[k].came_ns <= position.mono_ns:
            latest = max(latest, came.genuine[k].ends_ns if came.genuine[k].normal else -1)
            k += 1
        if position.trusts and position.mono_ns > latest + ALLOWED_NS:
            breaches.append(f"NEVER LATE: trusts at {position.mono_ns}, the last genuine NORMAL ended at {latest}")
        if position.trusts and position.mono_ns + position.valid_for_ns > latest + ALLOWED_NS:
            breaches.append(f"NEVER LATE: promises until {position.mono_ns + position.valid_for_ns}, the message until {latest}")
        if position.trusts and not before:
            breaches += _raised_by_nothing(position.mono_ns, lost_ns, came)
        if before and not position.trusts:
            lost_ns = position.mono_ns
        before = position.trusts
    return breaches


def silence(said: Sequence[Said]) -> str:
    """Where the train said nothing for too long to be judged; "" if nowhere."""
    longest_ns = max((b.told_ns - a.told_ns for a, b in pairwise(said)), default=SILENT_NS + 1)
    return "" if longest_ns <= SILENT_NS else f"the train said nothing for {longest_ns / 1e9:.1f} s"


def ended_after_ms(said: Sequence[Said], came: Came) -> float | None:
    """From the issue of the last genuine NORMAL that had come to the first word that there is no trust; the longest of all ends."""
    ends = [b.mono_ns for a, b in pairwise(said) if a.trusts and not b.trusts]
    issued = [max((g.issued_ns for g in came.genuine if g.normal and g.came_ns < end), default=0) for end in ends]
    return max(((end - at) / 1e6 for end, at in zip(ends, issued, strict=True)), default=None)


def _raised_by_nothing(mono_ns: int, lost_ns: int, came: Came) -> list[str]:
    counted = {
        (g.boot_id, g.sequence)
        for g in came.genuine
        if g.normal and lost_ns <= g.came_ns <= min(mono_ns, g.ends_ns) and came.answered_ns.get(g.boot_id, g.came_ns + 1) <= g.came_ns
    }
    most = max(Counter(boot_id for boot_id, _ in counted).values(), default=0)
    return [] if most >= RECOVER_MESSAGES else [f"NEVER RAISED: trusts at {mono_ns} after {most} genuine fresh NORMAL messages"]


def _genuine(message: pb.HealthReceived, site: str, key: Ed25519PublicKey) -> Genuine | None:
    place = f"wayside/v1/{site}/health"
    try:
        signed = pb.SignedHealth.FromString(message.data)
        key.verify(signed.signature, f"wayside.v1.health\0{place}\0".encode() + signed.health)
        health = pb.Health.FromString(signed.health)
    except (DecodeError, InvalidSignature):
        return None
    if message.key_expr != place or health.site != site:
        return None
    ends_ns = health.issued_mono_ns + min(health.valid_for_ms * 1_000_000, MAX_VALID_NS)
    return Genuine(message.mono_ns, health.boot_id, health.sequence, health.issued_mono_ns, ends_ns, health.state == pb.NORMAL)


def _boot(message: pb.ChallengeAnswered, site: str, key: Ed25519PublicKey) -> bytes | None:
    """Of a genuine answer to this very nonce."""
    try:
        signed = pb.SignedChallengeReply.FromString(message.data)
        key.verify(signed.signature, f"wayside.v1.challenge\0wayside/v1/{site}/challenge\0".encode() + signed.reply)
        reply = pb.ChallengeReply.FromString(signed.reply)
    except (DecodeError, InvalidSignature):
        return None
    return bytes(reply.boot_id) if reply.nonce == message.nonce else None
