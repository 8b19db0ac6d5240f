"""The code that is checked: the real source, with signatures that cost 2 us instead of 54. One place, one substitution.

`VerifyKey` is what `integrity.messages.verification` asks for a verdict. The stand-in is as exact about who signed what: its
signature is a hash over the secret and over the very bytes that are signed, so that another key, another place, another kind of message
or another byte is another signature. `test_model.py` shows that both judge alike.
"""

import hashlib
from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import Any, NamedTuple, cast

from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey
from nacl.exceptions import BadSignatureError

import train_client.trust
from integrity.messages import verification
from integrity.messages.signatures import PrivateKey, SigningKey, key_id, signing_key

Changes = dict[str, str]  # of source: what stands there, once, and what shall


class Code(NamedTuple):
    """What a train runs, and how keys are made for it from a number."""

    verification: ModuleType
    trust: ModuleType
    key: Callable[[int], SigningKey]


class StandInKey:
    """Both halves of a key: the model's attackers do not use what they do not know."""

    def __init__(self, secret: bytes) -> None:
        self._secret = secret

    def sign(self, data: bytes) -> bytes:
        return hashlib.blake2b(data, key=self._secret).digest()

    def verify(self, data: bytes, signature: bytes) -> None:
        if signature != self.sign(data):
            raise BadSignatureError


def real() -> Code:
    """As it runs, with Ed25519."""
    return Code(verification, train_client.trust, lambda n: signing_key(Ed25519PrivateKey.from_private_bytes(bytes([n]) * 32)))


def quick(in_verification: Changes | None = None, in_trust: Changes | None = None) -> Code:
    """The same source with the stand-in, and with a change to it, if one is given. Raises ValueError if the change finds no place."""
    checked = _copy(verification, in_verification or {})
    checked.__dict__["VerifyKey"] = StandInKey
    return Code(checked, _copy(train_client.trust, in_trust or {}), _stand_in_key)


def _stand_in_key(n: int) -> SigningKey:
    raw = bytes([n]) * 32
    return SigningKey(cast(PrivateKey, StandInKey(raw)), raw, key_id(raw))


def _copy(module: ModuleType, changes: Changes) -> ModuleType:
    path = Path(cast(str, module.__file__))
    source = path.read_text(encoding="utf-8")
    for old, new in changes.items():
        if source.count(old) != 1:
            raise ValueError(f"{path.name}: {old!r} stands there {source.count(old)} times, expected once")
        source = source.replace(old, new)
    copy = ModuleType(module.__name__)
    names: dict[str, Any] = copy.__dict__
    exec(compile(source, f"{path.name} (copy)", "exec"), names)
    return copy
