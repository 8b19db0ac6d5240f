"""Forged and replayed health, put by a third party at the station's own endpoint: what one client puts reaches the others through it."""

import time
from collections.abc import Sequence

from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey

from integrity.messages import wayside_pb2 as pb
from integrity.messages.key_expressions import HEALTH, site_key
from integrity.messages.signatures import SigningKey, sign_health, signing_key
from recordings.link import Link

ELSEWHERE = "elsewhere"


class Attacker:
    """Would stop the train if it were believed: every forged message says NOT_CONFIRMABLE, and so does the older one.

    `station_key` signs health for another site, as a stolen message of that site would come.
    """

    def __init__(self, link: Link, site: str, station_key: SigningKey) -> None:
        self._key_expr = site_key(site, HEALTH)
        self._put = link.urgent(self._key_expr, "wayside.v1.SignedHealth")
        self._stranger = signing_key(Ed25519PrivateKey.generate())
        self._station_key = station_key
        self._next = 0

    def strike(self, genuine: Sequence[bytes]) -> int:
        """One message, made of what the station has said so far, each kind in turn. How many more must be refused and counted: a mere copy
        of the last message may have come twice, and is not."""
        kinds = (self._by_stranger, self._under_trusted_name, _flipped, self._for_elsewhere, lambda _: genuine[0])
        kind, self._next = self._next, (self._next + 1) % (len(kinds) + 1)
        self._put(kinds[kind](genuine[-1]) if kind < len(kinds) else genuine[-1])
        return int(kind < len(kinds))

    def _by_stranger(self, last: bytes) -> bytes:
        return sign_health(self._stranger, self._key_expr, _stopping(last)).SerializeToString()

    def _under_trusted_name(self, last: bytes) -> bytes:
        signed = sign_health(self._stranger, self._key_expr, _stopping(last))
        signed.key_id = pb.SignedHealth.FromString(last).key_id
        return signed.SerializeToString()

    def _for_elsewhere(self, last: bytes) -> bytes:
        health = _stopping(last)
        health.site = ELSEWHERE
        return sign_health(self._station_key, self._key_expr, health).SerializeToString()


def _stopping(last: bytes) -> pb.Health:
    """What would stop a train: the next message of this boot, issued now."""
    health = pb.Health.FromString(pb.SignedHealth.FromString(last).health)
    health.sequence += 1000
    health.state, health.cause = pb.NOT_CONFIRMABLE, pb.RECEIVER
    health.issued_mono_ns = time.monotonic_ns()
    return health


def _flipped(last: bytes) -> bytes:
    """With one bit of the signed bytes flipped."""
    signed = pb.SignedHealth.FromString(last)
    middle = len(signed.health) // 2
    signed.health = signed.health[:middle] + bytes([signed.health[middle] ^ 1]) + signed.health[middle + 1 :]
    return signed.SerializeToString()
