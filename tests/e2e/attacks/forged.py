"""Forgeries, made of a genuine message: each says what would help the attacker most, NORMAL from now on, and none has the station's word.

Those that a key of the site has signed were signed for something else: for another site, or for another place.
"""

import random
import secrets
import time
from collections.abc import Callable

from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey

from integrity.messages import wayside_pb2 as pb
from integrity.messages.signatures import SigningKey, sign_challenge_reply, sign_health, signing_key
from tests.e2e.attacks.relay import CHALLENGE_KEY, HEALTH_KEY

Forge = Callable[[bytes], bytes]
STRANGER = signing_key(Ed25519PrivateKey.generate())
AHEAD = 1000  # of the sequence: a lower one would be refused for that
EPOCH_NS = 100_000_000


def by(key: SigningKey) -> Forge:
    return lambda genuine: sign_health(key, HEALTH_KEY, _wished(genuine)).SerializeToString()


by_a_stranger = by(STRANGER)


def under_a_trusted_name(genuine: bytes) -> bytes:
    signed = sign_health(STRANGER, HEALTH_KEY, _wished(genuine))
    signed.key_id = pb.SignedHealth.FromString(genuine).key_id
    return signed.SerializeToString()


def for_another_site(key: SigningKey) -> Forge:
    def forge(genuine: bytes) -> bytes:
        health = _wished(genuine)
        health.site = "elsewhere"
        return sign_health(key, HEALTH_KEY, health).SerializeToString()

    return forge


def for_another_place(key: SigningKey) -> Forge:
    return lambda genuine: sign_health(key, "wayside/v1/elsewhere/health", _wished(genuine)).SerializeToString()


def flipped(genuine: bytes) -> bytes:
    """One bit of the signed bytes is another."""
    signed = pb.SignedHealth.FromString(genuine)
    at = secrets.randbelow(len(signed.health))
    signed.health = signed.health[:at] + bytes([signed.health[at] ^ 1 << secrets.randbelow(8)]) + signed.health[at + 1 :]
    return signed.SerializeToString()


def with_another_tail(genuine: bytes, tail: bytes) -> bytes:
    """As Zenoh does after a stall: the last message of a dying link ends with the beginning of the next batch."""
    return genuine[: -len(tail)] + tail


def answer_by_a_stranger(nonce: bytes, genuine: bytes) -> bytes:
    """To a challenge, with the nonce that was asked, under the name of the station's key."""
    last = pb.Health.FromString(pb.SignedHealth.FromString(genuine).health)
    reply = pb.ChallengeReply(nonce=nonce, boot_id=last.boot_id, issued_mono_ns=time.monotonic_ns(), sequence=last.sequence)
    signed = sign_challenge_reply(STRANGER, CHALLENGE_KEY, reply)
    signed.key_id = pb.SignedHealth.FromString(genuine).key_id
    return signed.SerializeToString()


def garbage(count: int, genuine: bytes, seed: int = 1) -> list[bytes]:
    """Noise of any length, genuine messages cut short, and such as cost a whole verification: a trusted name, and a wrong signature."""
    rng = random.Random(seed)
    signed = pb.SignedHealth.FromString(genuine)
    kinds: tuple[Callable[[], bytes], ...] = (
        lambda: rng.randbytes(rng.randrange(1, 1000)),
        lambda: genuine[: rng.randrange(len(genuine))],
        lambda: pb.SignedHealth(health=signed.health, key_id=signed.key_id, signature=rng.randbytes(64)).SerializeToString(),
    )
    return [kinds[k % len(kinds)]() for k in range(count)]


def _wished(genuine: bytes) -> pb.Health:
    """The next message of this boot, issued now, of a later epoch."""
    health = pb.Health.FromString(pb.SignedHealth.FromString(genuine).health)
    health.sequence += AHEAD
    health.state, health.cause = pb.NORMAL, pb.CAUSE_UNSPECIFIED
    health.gps_time_ns += AHEAD * EPOCH_NS
    health.issued_mono_ns = time.monotonic_ns()
    return health
