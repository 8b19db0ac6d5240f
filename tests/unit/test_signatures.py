"""What is signed, byte by byte: the contract with any other language, and nothing that a flipped bit survives."""

from dataclasses import FrozenInstanceError

import pytest
from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey, Ed25519PublicKey
from nacl.signing import VerifyKey

from integrity.messages import wayside_pb2 as pb
from integrity.messages.signatures import (
    CHALLENGE_CONTEXT,
    HEALTH_CONTEXT,
    PUBLIC_KEY_BYTES,
    sign_challenge_reply,
    sign_health,
    signature_is_right,
    signed_bytes,
    signing_key,
)

# RFC 8032, 7.1, test 1: the secret and its public key. The two signatures were made over these bytes with a second implementation,
# written from RFC 8032, 5.1 with Python's integers, which gives the RFC's own signature of the empty message too.
SEED = bytes.fromhex("9d61b19deffd5a60ba844af492ec2cc44449c5697b326919703bac031cae7f60")
KEY = signing_key(Ed25519PrivateKey.from_private_bytes(SEED))
RFC_PUBLIC = "d75a980182b10ab7d54bfed3c964073a0ee172f3daa62325af021a68f707511a"
HEALTH_SIGNATURE = (
    "c20039307cfa953fa825b09332c328efce322343098d2fd37d71f1ed95bd6788699adbcbbe860ce570074fb4b9722d1c7cb218ffd9d0aac5ea8b29bb7b84710f"
)
REPLY_SIGNATURE = (
    "23cd019f6c4f4ab61b2d5c6df93fcc3dee0b75da2d067705a3ad222b96e7bb22b38771f906a7c6212f5db8b8a91ad80d4c8eff172a7648d91fb74326daec3c06"
)
PLACE = "wayside/v1/kokubunji-1/health"
PUBLIC = VerifyKey(KEY.public)


def test_a_key_is_named_by_the_first_eight_bytes_of_the_hash_of_its_public_half() -> None:
    assert (KEY.public.hex(), KEY.key_id.hex()) == (RFC_PUBLIC, "21fe31dfa154a261")  # sha256sum of the 32 bytes


def test_signed_health_is_these_bytes() -> None:
    signed = sign_health(KEY, PLACE, pb.Health(site="kokubunji-1"))
    health = "0a0b6b6f6b7562756e6a692d31"  # field 1, 11 characters
    assert signed.SerializeToString().hex() == f"0a0d{health}120821fe31dfa154a2611a40{HEALTH_SIGNATURE}"


def test_a_signed_answer_is_these_bytes() -> None:
    signed = sign_challenge_reply(KEY, "wayside/v1/kokubunji-1/challenge", pb.ChallengeReply(nonce=bytes(range(16))))
    reply = "0a10" + bytes(range(16)).hex()
    assert signed.SerializeToString().hex() == f"0a12{reply}120821fe31dfa154a2611a40{REPLY_SIGNATURE}"


def test_a_signature_counts_for_its_kind_of_message_its_place_and_its_bytes_only() -> None:
    signature = sign_health(KEY, PLACE, pb.Health(site="kokubunji-1")).signature
    data = pb.Health(site="kokubunji-1").SerializeToString()
    other = VerifyKey(signing_key(Ed25519PrivateKey.generate()).public)
    shortened = signature[:-1]
    cases = {
        "as signed": (PUBLIC, signature, HEALTH_CONTEXT, PLACE, data),
        "other kind": (PUBLIC, signature, CHALLENGE_CONTEXT, PLACE, data),
        "other place": (PUBLIC, signature, HEALTH_CONTEXT, PLACE + "x", data),
        "other bytes": (PUBLIC, signature, HEALTH_CONTEXT, PLACE, data + b"\0"),
        "other key": (other, signature, HEALTH_CONTEXT, PLACE, data),
        "shortened": (PUBLIC, shortened, HEALTH_CONTEXT, PLACE, data),
        "none": (PUBLIC, b"", HEALTH_CONTEXT, PLACE, data),
    }
    assert [name for name, case in cases.items() if signature_is_right(*case)] == ["as signed"]


def test_openssl_takes_what_is_signed() -> None:
    data = bytes(range(200))
    Ed25519PublicKey.from_public_bytes(KEY.public).verify(KEY.private.sign(data), data)  # raises where it does not


def test_a_key_does_not_show_its_private_half() -> None:
    shown = f"{KEY!r} {KEY.private!r}"
    assert SEED.hex() not in shown and repr(SEED)[2:-1] not in shown


def test_a_key_cannot_be_changed() -> None:
    with pytest.raises(FrozenInstanceError):
        KEY.public = bytes(PUBLIC_KEY_BYTES)  # type: ignore[misc]


def test_a_raw_public_key_is_as_long_as_it_is_said_to_be() -> None:
    assert len(KEY.public) == PUBLIC_KEY_BYTES


def test_bytes_cannot_move_between_place_and_message() -> None:
    assert signed_bytes(HEALTH_CONTEXT, "a/b", b"c") != signed_bytes(HEALTH_CONTEXT, "a", b"/bc")
