"""Health and answers to challenges, as bytes, into the verifier, a train and whatever else reads them: trust is never more than is right.

A piece is one arrival: a head (what it is, which challenge it answers, when it comes) and a body. Bodies of `H` and `A` are what goes over
the air; those of `h` and `a` were changed *before* the station signs them, so that they verify and must be read by the rules. `E` is an
error in words instead of an answer. What may be believed is computed once more, by `health_oracle`.
"""

import struct
from collections import Counter
from collections.abc import Callable, Sequence
from functools import cache
from random import Random

from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey
from google.protobuf.message import DecodeError, Message

from integrity.gnss.gps_time import NS_PER_S
from integrity.messages import wayside_pb2 as pb
from integrity.messages.key_expressions import CHALLENGE, HEALTH, site_key
from integrity.messages.signatures import CHALLENGE_CONTEXT, HEALTH_CONTEXT, SigningKey, signed_bytes, signing_key
from tests.fuzz.health_examine import BEHIND_NS, Arrived, Examiner
from tests.fuzz.health_wire import LENGTH, Unreadable, fields_of, unknown, with_limits, written
from tests.fuzz.mutations import damaged
from tests.fuzz.target import Piece, Target
from tests.unit.train.ride import BOOT, KEY, MAP, SITE, START_NS, STEP_NS, events, measured
from train_client.events import HealthReceived

HEAD = struct.Struct(">cBII")  # what, number of the challenge, ms since the start, bytes of the body
MS = 1_000_000
HEALTH_AT, CHALLENGE_AT = site_key(SITE, HEALTH), site_key(SITE, CHALLENGE)
PLACES = {b"h": (HEALTH_CONTEXT, HEALTH_AT), b"a": (CHALLENGE_CONTEXT, CHALLENGE_AT)}
KINDS: dict[bytes, type[Message]] = {b"h": pb.Health, b"a": pb.ChallengeReply}
STORIES, EPOCHS, CHALLENGE_EVERY = 8, 120, 5
STRANGER = signing_key(Ed25519PrivateKey.from_private_bytes(bytes(range(100, 132))))
KEPT = frozenset({"sequence", "gps_time_ns", "boot_id", "nonce"})  # most often: after one far ahead nothing would count
LARGE_BYTES = 1 << 20


def piece(what: bytes, number: int, at_ms: int, body: bytes) -> bytes:
    return HEAD.pack(what, number & 0xFF, max(0, at_ms) & 0xFFFFFFFF, len(body)) + body


@cache
def vouching() -> tuple[pb.Health, ...]:
    """What the ground says along the ride, with the ephemerides that the antennas hear."""
    said = (event for event in events(measured()) if isinstance(event, HealthReceived))
    return tuple(pb.Health.FromString(pb.SignedHealth.FromString(event.data).health) for event in said)


@cache
def story(number: int) -> tuple[bytes, ...]:
    """24 seconds of a station: NORMAL, with anomalies and silence, with one reboot or two, with both."""
    rng, boots, sequence, found = Random(f"story {number}"), 0, 0, list[bytes]()
    reboots = rng.sample(range(8, EPOCHS), number % 3)
    for epoch in range(EPOCHS):
        at_ms = epoch * STEP_NS // MS
        if epoch in reboots:
            boots, sequence = boots + 1, 0
        boot, issued_ns = BOOT[:-1] + bytes((boots,)), START_NS + at_ms * MS - BEHIND_NS * (1 + boots)
        if epoch % CHALLENGE_EVERY == 0:
            answer = pb.ChallengeReply(nonce=bytes((*range(15), epoch)), boot_id=boot, issued_mono_ns=issued_ns + 2 * MS, sequence=sequence)
            found.append(piece(b"A", epoch, at_ms, in_envelope(b"a", answer.SerializeToString())))
        sequence += 1
        of = vouching()[min(epoch, len(vouching()) - 1)]
        gps_ns = START_NS + epoch * STEP_NS
        said = pb.Health(
            boot_id=boot, sequence=sequence, issued_mono_ns=issued_ns + 5 * MS, gps_time_ns=gps_ns, config_sha256="c0ffee" * 10
        )
        said.MergeFrom(pb.Health(covers_from_gps_ns=gps_ns - STEP_NS + 1, covers_to_gps_ns=gps_ns, excluded_satellites=["G31"]))
        said = merged(of, said)
        said.map_sha256.extend(["0" * 64, MAP.sha256] * (number % 2))
        vouched = [of.signal for of in said.monitored_signals]
        said.monitored[:] = ["C05.2I", *(signal for signal in vouched if signal != vouched[number])]
        said.excluded_satellites.append(vouched[-1 - number % 4].partition(".")[0])
        if number >= STORIES // 2 and rng.random() < 0.1:
            said.state, said.cause, said.reasons[:] = rng.choice((pb.NOT_CONFIRMABLE, pb.SATELLITE_ANOMALY)), pb.DATA, ["silent: A"]
        found.append(piece(b"H", 0, at_ms + 6, in_envelope(b"h", said.SerializeToString())))
    return tuple(found)


def merged(of: pb.Health, changes: pb.Health) -> pb.Health:
    found = pb.Health()
    found.CopyFrom(of)
    found.MergeFrom(changes)
    return found


def in_envelope(what: bytes, inner: bytes, key: SigningKey = KEY, named: SigningKey = KEY) -> bytes:
    """Signed by a key, under the name of one: SignedHealth (`h`) or SignedChallengeReply (`a`), which have the same fields."""
    return b"".join(
        written(n, LENGTH, b) for n, b in ((1, inner), (2, named.key_id), (3, key.private.sign(signed_bytes(*PLACES[what], inner))))
    )


def sound(rng: Random) -> list[bytes]:
    return list(story(rng.randrange(STORIES)))


def touch(rng: Random, frame: bytes) -> bytes:
    """Late or early; damaged on the way; another's; or changed before it was signed."""
    if len(frame) < HEAD.size:
        return damaged(rng, frame)
    what, number, at_ms, _ = HEAD.unpack_from(frame)
    body, way = frame[HEAD.size :], rng.random()
    if way < 0.06:
        return piece(what, number, at_ms + rng.choice((-4000, -1000, 300, 994, 1000, 3000, 10_000)), body)
    if way < 0.08:
        return piece(rng.choice((b"H", b"A", b"E")), number, at_ms, body)
    if what not in (b"H", b"A") or way < 0.4:
        return piece(what, number, at_ms, on_the_way(rng, body))
    kind = what.lower()
    try:
        inner = pb.SignedHealth.FromString(body).health
        return piece(kind, number, at_ms, changed(rng, kind, inner))
    except (DecodeError, Unreadable):  # guided by coverage, anything may be touched
        return piece(kind, number, at_ms, damaged(rng, body))


def on_the_way(rng: Random, body: bytes) -> bytes:
    """What a stranger can do."""
    what = rng.randrange(10)
    if what < 4:
        return damaged(rng, body)
    if what == 4:
        return rng.randbytes(rng.choice((0, 1, 8, 64, 300))) if rng.random() < 0.99 else rng.randbytes(1) * LARGE_BYTES
    if what == 5:
        return body + unknown(rng)
    try:
        signed = pb.SignedHealth.FromString(body)
    except DecodeError:
        return damaged(rng, body)
    if what == 6:
        signed.health = damaged(rng, signed.health)
    elif what == 7:
        signed.signature = damaged(rng, signed.signature)
    elif what == 8:
        signed.key_id = rng.choice((STRANGER.key_id, b"", damaged(rng, signed.key_id), rng.randbytes(8)))
    else:
        return in_envelope(rng.choice((b"h", b"a")), signed.health, rng.choice((KEY, STRANGER)), rng.choice((KEY, STRANGER)))
    return signed.SerializeToString()


def changed(rng: Random, kind: bytes, inner: bytes) -> bytes:
    """What the station itself might sign, if it were broken, or of another version."""
    what = rng.randrange(8)
    if what == 0:
        return damaged(rng, inner, 1)
    if what == 1:
        return unknown(rng) + inner + unknown(rng)
    if what == 2:
        fields = [field.whole for field in fields_of(inner)]
        return b"".join(rng.sample([*fields, *rng.choices(fields, k=rng.randint(0, 3))], k=len(fields)))
    if what < 5 or kind == b"a":
        return with_limits(rng, KINDS[kind], inner, KEPT if rng.random() < 0.95 else frozenset())
    health = pb.Health.FromString(inner)
    for change in rng.sample(CHANGES, rng.choice((1, 1, 2))):
        change(health, rng)
    return health.SerializeToString()


def _sequence(health: pb.Health, rng: Random) -> None:
    health.sequence = max(0, health.sequence + rng.choice((-100, -2, -1, 1, 2, 7)))


def _epoch(health: pb.Health, rng: Random) -> None:
    health.gps_time_ns += rng.choice((-1, 1, -STEP_NS, STEP_NS, -NS_PER_S))
    if rng.random() < 0.3:
        health.ClearField("gps_time_ns")


def _covers(health: pb.Health, rng: Random) -> None:
    health.covers_from_gps_ns = rng.choice(
        (0, -(1 << 63), health.covers_to_gps_ns, health.covers_to_gps_ns + 1, health.gps_time_ns - NS_PER_S)
    )
    health.covers_to_gps_ns = rng.choice((health.gps_time_ns, health.gps_time_ns + 1, health.gps_time_ns - 1, (1 << 63) - 1))


def _issued(health: pb.Health, rng: Random) -> None:
    health.issued_mono_ns += rng.choice((-1, 1, 4 * MS, 20 * MS, 10 * NS_PER_S, -900 * MS, -1100 * MS, -4 * NS_PER_S))
    health.valid_for_ms = rng.choice((0, 1, 100, 1000, 3000, 3001, 60_000, (1 << 32) - 1))


def _state(health: pb.Health, rng: Random) -> None:
    health.state, health.cause = rng.choice((0, 1, 1, 2, 3, 4, 2**31 - 1, -1)), rng.choice((0, 0, 1, 4, 11, 12, -1))  # type: ignore[assignment]


def _identity(health: pb.Health, rng: Random) -> None:
    health.site = rng.choice((SITE, SITE, "", "sample ", "elsewhere", "駅"))
    health.boot_id = rng.choice((health.boot_id, BOOT, bytes(16), b"", health.boot_id[1:], health.boot_id + b"\0"))


def _signals(health: pb.Health, rng: Random) -> None:
    health.excluded_satellites.extend(of.signal[:3] for of in health.monitored_signals if rng.random() < 0.3)
    for of in health.monitored_signals:
        if rng.random() < 0.2:
            of.ephemeris_crc32 ^= rng.getrandbits(32)
            of.signal = rng.choice((of.signal, "", "G", ".", "G05.1C" * 1000))
    if rng.random() < 0.2:
        health.ClearField("monitored")


def _maps(health: pb.Health, rng: Random) -> None:
    health.map_sha256[:] = rng.sample(["", "0" * 64, MAP.sha256, MAP.sha256[1:]], rng.randrange(3))


CHANGES: tuple[Callable[[pb.Health, Random], None], ...] = (_sequence, _epoch, _covers, _issued, _state, _identity, _signals, _maps)


def arrived(of: Piece) -> Arrived | None:
    """What is handed to the readers; None for bytes that are no piece."""
    if len(of.data) < HEAD.size:
        return None
    what, number, at_ms, _ = HEAD.unpack_from(of.data)
    body, at_ns = of.data[HEAD.size :], START_NS + at_ms * MS
    if what in PLACES:
        return Arrived(what, number, at_ns, in_envelope(what, body), body, of.untouched)
    return Arrived(what.lower(), number, at_ns, body, None, of.untouched) if what in (b"H", b"A", b"E") else None


def examine(pieces: Sequence[Piece], rng: Random) -> Counter[str]:
    """Everything that reads them, one after the other."""
    examiner = Examiner(rng)
    for of in pieces:
        found = arrived(of)
        if found is not None:
            examiner.take(found)
    examiner.end()
    return examiner.told


def split(data: bytes) -> list[bytes]:
    """Any bytes as pieces, by the sizes that stand in their heads."""
    found = []
    while data:
        size = HEAD.size + (HEAD.unpack_from(data)[3] if len(data) >= HEAD.size else 0)
        found.append(data[:size])
        data = data[size:]
    return found


TARGET = Target(sound, touch, split, examine)
