"""What a receiver of health may believe. Pure: bytes and the reader's monotonic clock come in, a judgement comes out; denies by default.

Theory of operation. A message is **verified** if a trusted key signed it for this site, and it is the next of the boot in force: later
than all before, and no copy. A boot comes into force only by a challenge: the station signs a nonce that the reader has just drawn, so
that nothing recorded can stand in for it. The same answer ties the clocks, and only then can a verified message be **fresh**:

    age = now - (issued_mono_ns, mapped by the round trip) + half the round trip + drift  <=  min(valid_for_ms, max_valid_ms)

The station answered between `sent` and `received` of the reader's clock. Half the round trip on top of its middle means that it
answered at once, at `sent`: the oldest that the message can be. GNSS time, UTC and the order of arrival never make a message fresh.
Both clocks must run on during a standstill of the machine that they are of (a reader that was suspended challenges first).

Refused is what cannot be believed to come from the station now. A verified message that says something unheard of is not refused but
read as NOT_CONFIRMABLE (`caution`): refused, it would leave the message before it in force.
"""

from collections.abc import Iterable
from typing import NamedTuple

from google.protobuf.message import DecodeError
from nacl.signing import VerifyKey

from integrity.messages import wayside_pb2 as pb
from integrity.messages.key_expressions import CHALLENGE, HEALTH, site_key
from integrity.messages.signatures import CHALLENGE_CONTEXT, HEALTH_CONTEXT, key_id, signature_is_right
from integrity.states import Cause, State

BOOT_ID_BYTES = 16
NONCE_BYTES = 16
KEY_ID_BYTES = 8
MOST_BYTES = 65_536  # of a message: twenty times what a station with a hundred signals says
NS_PER_MS = 1_000_000
DRIFT_DIVISOR = 1000  # clocks part by at most 1e-3: each may be slewed by 500 ppm (adjtimex, Linux), in opposite directions

TOO_LONG = f"too long: more than {MOST_BYTES} bytes"
SHOWN_CHARACTERS = 64  # of a name that is not the right one
STATES = {pb.NORMAL: State.NORMAL, pb.SATELLITE_ANOMALY: State.SATELLITE_ANOMALY, pb.NOT_CONFIRMABLE: State.NOT_CONFIRMABLE}
CAUSES = {pb.CAUSE_UNSPECIFIED: Cause.NONE} | {pb.Cause.Value(cause.name): cause for cause in Cause if cause is not Cause.NONE}


class Received(NamedTuple):
    """One message, judged at one time of the reader's clock. Only `state` may be acted on: NORMAL needs a fresh message that says so."""

    refusal: str  # why it is not believed; "" if verified
    verified: bool = False
    fresh: bool = False
    unconfirmed: bool = False  # its boot is not in force: challenge the station now, to know whether it should be
    staleness: str = ""  # why a verified message is not fresh
    caution: str = ""  # why `said` is NOT_CONFIRMABLE although the message does not say it in so many words
    said: State = State.NOT_CONFIRMABLE  # by the message, whatever its age
    sequence: int | None = None  # as signed, of a refused message too; None where the signature is not right
    missed: int = 0  # messages of its boot between the last verified one and it: the network tells nobody what it drops
    age_ns: int | None = None  # at most this old; None until a challenge has tied the clocks
    valid_ns: int = 0  # fresh up to this age
    health: pb.Health | None = None  # None unless verified

    @property
    def state(self) -> State:
        """What holds because of this message."""
        return self.said if self.fresh else State.NOT_CONFIRMABLE

    @property
    def age_ms(self) -> float | None:
        """Bound of the age in milliseconds."""
        return None if self.age_ns is None else self.age_ns / NS_PER_MS


def cut(data: bytes) -> bytes:
    """No more of it than is needed to see that it is too long: what strangers send is not to be kept in queues and recordings."""
    return data[: MOST_BYTES + 1]


class Answer(NamedTuple):
    """An answer to a challenge, judged. With a refusal nothing has changed; `boot_is_new` if it put another boot in force."""

    refusal: str
    boot_is_new: bool = False
    round_trip_ns: int | None = None


class Tie(NamedTuple):
    """The station's clock said `issued_mono_ns` between `sent` and `received` of the reader's clock."""

    boot_id: bytes
    sent_mono_ns: int
    received_mono_ns: int
    issued_mono_ns: int

    def age_bound_ns(self, issued_mono_ns: int, now_mono_ns: int) -> int:
        """The oldest that a message issued then can be now; below zero it cannot have been issued yet."""
        since_ns, before_ns = now_mono_ns - self.sent_mono_ns, self.issued_mono_ns - issued_mono_ns
        return since_ns + before_ns + -(-max(abs(since_ns), abs(before_ns)) // DRIFT_DIVISOR)


class LastHealth(NamedTuple):
    """The last verified message of a boot; `told` is the sequence that a challenge named."""

    boot_id: bytes
    sequence: int = 0
    data: bytes = b""
    gps_time_ns: int | None = None
    told: int = 0


class VerifierMemory(NamedTuple):
    """What a verifier remembers: another one that starts from it judges as this one would have."""

    tie: Tie | None = None
    last: LastHealth | None = None
    superseded: tuple[bytes, ...] = ()


class HealthVerifier:
    """Judges the health of one site. `keys` are raw public keys (32 bytes) that are trusted for it; none: everything is refused.

    Raises ValueError for a key that is not 32 bytes.
    """

    def __init__(self, site: str, keys: Iterable[bytes], max_valid_ms: int, memory: VerifierMemory | None = None) -> None:
        start = memory or VerifierMemory()
        self.site = site
        self.max_valid_ms = max_valid_ms
        self._keys = {key_id(raw): VerifyKey(raw) for raw in keys}
        self._tie = start.tie
        self._last = start.last
        self._superseded = set(start.superseded)

    def memory(self) -> VerifierMemory:
        """For a snapshot."""
        return VerifierMemory(self._tie, self._last, tuple(sorted(self._superseded)))

    @property
    def boot_id(self) -> bytes | None:
        """The boot in force; None before the first challenge is answered."""
        return self._tie.boot_id if self._tie else None

    def health(self, key_expr: str, data: bytes, mono_ns: int) -> Received:
        """Judge a SignedHealth that arrived at `key_expr` at `mono_ns` of the reader's clock. Raises nothing, whatever the bytes."""
        opened = self._open_health(key_expr, data)
        if isinstance(opened, str):
            return Received(opened)
        health, signed_data = opened
        refusal = self._identity_refusal(health) or self._superseded_refusal(health)
        if not refusal and self._tie and health.boot_id != self._tie.boot_id:
            refusal = f"boot not confirmed yet: challenge {health.boot_id.hex()} (in force is boot {self._tie.boot_id.hex()})"
            return Received(refusal, unconfirmed=True, sequence=health.sequence)
        refusal = refusal or self._sequence_refusal(health, signed_data)
        if refusal:
            return Received(refusal, sequence=health.sequence)
        before = self._last_of(health.boot_id)
        said, caution = _read_state(health, before.gps_time_ns)
        gps_time_ns = health.gps_time_ns if health.HasField("gps_time_ns") else before.gps_time_ns
        self._last = before._replace(sequence=health.sequence, data=signed_data, gps_time_ns=gps_time_ns)
        valid_ns = min(health.valid_for_ms, self.max_valid_ms) * NS_PER_MS
        missed = health.sequence - before.sequence - 1 if before.sequence else 0
        verified = Received("", True, caution=caution, said=said, sequence=health.sequence, missed=missed, valid_ns=valid_ns, health=health)
        return self.again(verified, mono_ns)

    def again(self, received: Received, mono_ns: int) -> Received:
        """The same message at a later time: between messages validity simply runs. A refused one stays refused."""
        if received.health is None or not received.verified:
            return received
        if self._tie is None:
            staleness = "age unknown: no challenge has been answered yet"
            return received._replace(fresh=False, unconfirmed=True, age_ns=None, staleness=staleness)
        boot_id = received.health.boot_id
        if boot_id != self._tie.boot_id:
            staleness = f"boot {boot_id.hex()} is not in force: the station answers as boot {self._tie.boot_id.hex()}"
            return received._replace(fresh=False, unconfirmed=True, age_ns=None, staleness=staleness)
        age_ns = self._tie.age_bound_ns(received.health.issued_mono_ns, mono_ns)
        fresh = 0 <= age_ns <= received.valid_ns
        staleness = "" if fresh else _staleness(age_ns, received.valid_ns)
        return received._replace(fresh=fresh, unconfirmed=False, age_ns=age_ns, staleness=staleness)

    def challenge_answered(self, nonce: bytes, sent_mono_ns: int, received_mono_ns: int, data: bytes) -> Answer:
        """Judge a SignedChallengeReply to a nonce of 16 bytes drawn for it at random; times are of the reader's clock.

        If it is right, its boot is in force from now on, and the clocks are tied by it.
        """
        if len(data) > MOST_BYTES:
            return Answer(TOO_LONG)
        try:
            signed = pb.SignedChallengeReply.FromString(data)
            key_expr = site_key(self.site, CHALLENGE)
            refusal = self._signature_refusal(signed.key_id, signed.signature, CHALLENGE_CONTEXT, key_expr, signed.reply)
            if refusal:
                return Answer(refusal)
            reply = pb.ChallengeReply.FromString(signed.reply)
        except DecodeError:
            return Answer(f"unreadable: {len(data)} bytes are no signed answer")
        tie = Tie(reply.boot_id, sent_mono_ns, received_mono_ns, reply.issued_mono_ns)
        refusal = self._answer_refusal(nonce, reply, tie)
        if refusal:
            return Answer(refusal)
        boot_is_new = self._tie is None or self._tie.boot_id != tie.boot_id
        if self._tie and boot_is_new:
            self._superseded.add(self._tie.boot_id)
        last = self._last_of(tie.boot_id)
        self._last = last._replace(told=max(last.told, reply.sequence))
        self._tie = tie
        return Answer("", boot_is_new, received_mono_ns - sent_mono_ns)

    def _open_health(self, key_expr: str, data: bytes) -> tuple[pb.Health, bytes] | str:
        """The message and the bytes that are signed, or why they are not believed. Nothing is parsed before its signature is right."""
        expected = site_key(self.site, HEALTH)
        if key_expr != expected:
            return f"wrong place: came at {key_expr}, expected at {expected}"
        if len(data) > MOST_BYTES:
            return TOO_LONG
        try:
            signed = pb.SignedHealth.FromString(data)
            refusal = self._signature_refusal(signed.key_id, signed.signature, HEALTH_CONTEXT, key_expr, signed.health)
            return refusal or (pb.Health.FromString(signed.health), signed.health)
        except DecodeError:
            return f"unreadable: {len(data)} bytes are no signed health"

    def _last_of(self, boot_id: bytes) -> LastHealth:
        return self._last if self._last and self._last.boot_id == boot_id else LastHealth(boot_id)

    def _signature_refusal(self, name: bytes, signature: bytes, context: bytes, key_expr: str, data: bytes) -> str:
        public = self._keys.get(name)
        if public is None:
            return f"unknown key: {_named(name, KEY_ID_BYTES) or 'none named'} is not trusted for site {self.site}"
        if not signature_is_right(public, signature, context, key_expr, data):
            return f"wrong signature: not made by key {name.hex()} over these bytes at {key_expr}"
        return ""

    def _identity_refusal(self, health: pb.Health) -> str:
        if health.site != self.site:
            return f"wrong site: signed for {health.site[:SHOWN_CHARACTERS]!r}, expected {self.site!r}"
        if len(health.boot_id) != BOOT_ID_BYTES:
            return f"no boot: boot_id has {len(health.boot_id)} bytes, expected {BOOT_ID_BYTES}"
        return "" if health.sequence >= 1 else "no sequence: it is 0, and a boot begins with 1"

    def _superseded_refusal(self, health: pb.Health) -> str:
        if health.boot_id not in self._superseded or self._tie is None:
            return ""
        boots = f"boot {health.boot_id.hex()}, which boot {self._tie.boot_id.hex()} has superseded"
        return f"older boot: sequence {health.sequence} of {boots}"

    def _sequence_refusal(self, health: pb.Health, data: bytes) -> str:
        last = self._last_of(health.boot_id)
        if health.sequence < last.sequence:
            return f"older: sequence {health.sequence} after {last.sequence}"
        if health.sequence > last.sequence:
            return (
                "" if health.sequence >= last.told else f"overtaken: sequence {health.sequence}, a challenge has named {last.told} already"
            )
        if data == last.data:
            return f"repeated: sequence {health.sequence} once more"
        return f"CONTRADICTION: sequence {health.sequence} signed twice with other bytes: two stations share a key, or it is stolen"

    def _answer_refusal(self, nonce: bytes, reply: pb.ChallengeReply, tie: Tie) -> str:
        if len(nonce) != NONCE_BYTES or reply.nonce != nonce:
            return f"wrong nonce: {_named(reply.nonce, NONCE_BYTES) or 'none'} answered, {nonce.hex()} asked"
        if len(tie.boot_id) != BOOT_ID_BYTES:
            return f"no boot: boot_id has {len(tie.boot_id)} bytes, expected {BOOT_ID_BYTES}"
        if self._tie and tie.sent_mono_ns < self._tie.sent_mono_ns:
            return "late answer: one to a later challenge has come already"
        if tie.boot_id in self._superseded:
            return f"older boot: boot {tie.boot_id.hex()} answers again after it was superseded: two stations share a key"
        if self._tie and tie.boot_id != self._tie.boot_id and tie.sent_mono_ns <= self._tie.received_mono_ns:
            return f"which boot is the later is not known: asked before boot {self._tie.boot_id.hex()} had answered: ask again"
        round_trip_ns = tie.received_mono_ns - tie.sent_mono_ns
        if not 0 <= round_trip_ns <= self.max_valid_ms * NS_PER_MS:
            return f"round trip of {round_trip_ns / NS_PER_MS:.1f} ms: expected 0 to {self.max_valid_ms} ms"
        return ""


def _named(name: bytes, right_bytes: int) -> str:
    """In hexadecimal; by its length where that is wrong."""
    return name.hex() if len(name) in (0, right_bytes) else f"one of {len(name)} bytes"


def _read_state(health: pb.Health, last_gps_time_ns: int | None) -> tuple[State, str]:
    """What the message says, and why it is read as NOT_CONFIRMABLE where it does not say so itself."""
    state = STATES.get(health.state)
    if state is None:
        return State.NOT_CONFIRMABLE, f"state {health.state} is unknown"
    if state is not State.NORMAL:
        return state, ""
    if health.cause != pb.CAUSE_UNSPECIFIED:
        return State.NOT_CONFIRMABLE, f"NORMAL with cause {health.cause}"
    if not health.HasField("gps_time_ns"):
        return State.NOT_CONFIRMABLE, "NORMAL without the epoch that it vouches for"
    if last_gps_time_ns is not None and health.gps_time_ns <= last_gps_time_ns:
        return State.NOT_CONFIRMABLE, f"NORMAL for epoch {health.gps_time_ns}, not later than {last_gps_time_ns} of the message before"
    return state, ""


def _staleness(age_ns: int, valid_ns: int) -> str:
    if age_ns < 0:
        return f"from the future: issued {-age_ns / NS_PER_MS:.1f} ms from now: a clock has jumped"
    return f"expired: age {age_ns / NS_PER_MS:.3f} ms, valid for {valid_ns / NS_PER_MS:.0f} ms"
