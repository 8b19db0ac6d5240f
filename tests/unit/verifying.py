"""A station and a train whose clocks are numbers: messages, answers, a verifier that has been answered."""

from typing import Any

from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey

from integrity.messages import wayside_pb2 as pb
from integrity.messages.signatures import SigningKey, sign_challenge_reply, sign_health, signing_key
from integrity.messages.verification import Answer, HealthVerifier, Received

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
