"""Ed25519 over a context string, the key expression and the bytes: a signature counts for one kind of message, at one place.

Source: RFC 8032; the order of what is signed is the contract of `wayside.proto`, at SignedHealth. No I/O: keys come in as values.
Signed and verified with libsodium: a signature in two thirds of OpenSSL's time, a verdict in half of it. Tests let OpenSSL check both.
"""

import hashlib
from dataclasses import dataclass

from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey
from nacl.bindings import crypto_sign
from nacl.exceptions import BadSignatureError
from nacl.signing import VerifyKey

from integrity.messages import wayside_pb2 as pb

HEALTH_CONTEXT = b"wayside.v1.health"
CHALLENGE_CONTEXT = b"wayside.v1.challenge"
PUBLIC_KEY_BYTES = 32
KEY_ID_BYTES = 8
SIGNATURE_BYTES = 64


class PrivateKey:
    """The half that signs: never shown, never sent."""

    def __init__(self, seed: bytes, public: bytes) -> None:
        self._secret = seed + public  # as libsodium takes it

    def sign(self, data: bytes) -> bytes:
        """The signature (64 bytes)."""
        return crypto_sign(data, self._secret)[:SIGNATURE_BYTES]


@dataclass(frozen=True)
class SigningKey:
    """A station's key: `public` is the raw public half (32 bytes), `key_id` names it in messages (8 bytes)."""

    private: PrivateKey
    public: bytes
    key_id: bytes


def signing_key(private: Ed25519PrivateKey) -> SigningKey:
    """The key with its public half and its name."""
    public = private.public_key().public_bytes_raw()
    return SigningKey(PrivateKey(private.private_bytes_raw(), public), public, key_id(public))


def key_id(public: bytes) -> bytes:
    """First 8 bytes of the SHA-256 of a raw public key. A name, not a proof: two keys may be made to share it."""
    return hashlib.sha256(public).digest()[:KEY_ID_BYTES]


def signed_bytes(context: bytes, key_expr: str, data: bytes) -> bytes:
    """What a signature is over. Neither the context nor a key expression holds a zero byte, so that no two triples read the same."""
    return context + b"\0" + key_expr.encode() + b"\0" + data


def signature_is_right(public: VerifyKey, signature: bytes, context: bytes, key_expr: str, data: bytes) -> bool:
    """Whether the holder of the key signed these bytes for this place; False for a signature of any other length as well."""
    if len(signature) != SIGNATURE_BYTES:
        return False
    try:
        public.verify(signed_bytes(context, key_expr, data), signature)
    except BadSignatureError:
        return False
    return True


def sign_health(key: SigningKey, key_expr: str, health: pb.Health) -> pb.SignedHealth:
    """A message ready to be put at `key_expr`."""
    data = health.SerializeToString()
    return pb.SignedHealth(health=data, key_id=key.key_id, signature=_sign(key, HEALTH_CONTEXT, key_expr, data))


def sign_challenge_reply(key: SigningKey, key_expr: str, reply: pb.ChallengeReply) -> pb.SignedChallengeReply:
    """An answer to a query at `key_expr`."""
    data = reply.SerializeToString()
    return pb.SignedChallengeReply(reply=data, key_id=key.key_id, signature=_sign(key, CHALLENGE_CONTEXT, key_expr, data))


def _sign(key: SigningKey, context: bytes, key_expr: str, data: bytes) -> bytes:
    return key.private.sign(signed_bytes(context, key_expr, data))
