"""A station, a train and a channel that is in the hands of an attacker, as values; and everything that may happen next.

True time exists only here: the clocks of both sides run off it, each by its own drift. The attacker hears whatever is sent, remembers the
last few messages and answers, and may hold, drop, repeat, reorder and change them, and make new ones; what it has not is a trusted key.
What the train believes is decided by the code that is checked; what it should is `Known`, from the history as it truly was.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

from integrity.messages import wayside_pb2 as pb
from integrity.messages.signatures import SigningKey, sign_challenge_reply, sign_health
from tests.model.code import Code

SITE = "here"
HEALTH_PLACE, CHALLENGE_PLACE = f"wayside/v1/{SITE}/health", f"wayside/v1/{SITE}/challenge"
MS = 1_000_000
VALID_MS = 1000
STEP_NS = 400 * MS  # two steps after it was issued a message is valid, three after it is not
LONG_NS = 86_400_000 * MS
NO_COMMS_AFTER_NS = 300 * MS
RECOVER_MESSAGES = 2
PPM = 1_000_000
DOWN = (pb.SATELLITE_ANOMALY, pb.NOT_CONFIRMABLE)


class Health(NamedTuple):
    """A message that the station really issued; times are true ones."""

    boot: int
    sequence: int
    epoch: int  # counts all messages of all boots: their GPS time
    state: int
    issued_ns: int
    data: bytes


class Answer(NamedTuple):
    """What the station of a boot really said to a nonce."""

    boot: int
    nonce: int
    sequence: int
    issued_ns: int
    data: bytes


class Known(NamedTuple):
    """What a train that is never deceived would hold: since it started, and of the boot in force."""

    newest: tuple[int, int] | None = None  # boot and sequence of the last message that counts
    in_a_row: int = 0  # NORMAL messages since the last one that said otherwise
    end_ns: int | None = None  # true end of validity of the NORMAL that is valid longest


class World(NamedTuple):
    now_ns: int
    boot: int
    sequence: int
    epoch: int
    heard: tuple[Health, ...]  # by the attacker, the newest first
    queries: tuple[int, ...]  # nonces asked that it holds back
    answers: tuple[Answer, ...]
    asked: dict[int, int]  # by the train: nonces, and the true time
    drawn: int  # the last nonce: in truth they are random
    verifier: Any  # VerifierMemory of the code
    trust: Any  # Trust of the code
    known: Known


class Drift(NamedTuple):
    """By how much each clock runs fast, in parts per million."""

    station_ppm: int
    train_ppm: int


WORST = Drift(500, -500)  # messages seem younger to the train than they are
DRIFTS = [Drift(s, t) for s in (-500, 0, 500) for t in (-500, 0, 500)]


class Event(NamedTuple):
    """What happened. `fits`: it was delivered as the station sent it, and nothing that counts came after it was sent."""

    after: World
    delivers: bool = False
    fits: bool = False
    state: int | None = None  # of the message delivered
    answer: Answer | None = None


Action = Callable[["Rules", World], Event | None]  # None: it cannot happen here


class Rules:
    """How the world goes on; `remembers`: messages, and answers, that the attacker keeps."""

    def __init__(self, code: Code, drift: Drift = WORST, remembers: int = 2) -> None:
        self.code = code
        self.drift = drift
        self.remembers = remembers
        self.key, self.stranger = code.key(1), code.key(2)
        self.limits = code.trust.TrustLimits(RECOVER_MESSAGES, NO_COMMS_AFTER_NS)
        self._keys = [self.key.public, code.key(3).public]

    def start(self) -> World:
        return World(0, 1, 0, 0, (), (), (), {}, 0, self.code.verification.VerifierMemory(), self.code.trust.Trust(), Known())

    def train_clock_ns(self, true_ns: int) -> int:
        return 5_000_000_000_000 + true_ns * (PPM + self.drift.train_ppm) // PPM

    def station_clock_ns(self, boot: int, true_ns: int) -> int:
        """Of each boot another: a machine that starts anew counts from zero."""
        return boot * 70_000_000_000_000 + true_ns * (PPM + self.drift.station_ppm) // PPM

    def issue(self, world: World, state: int) -> World:
        """The station decides, signs and sends; the attacker hears it."""
        sequence, epoch = world.sequence + 1, world.epoch + 1
        data = self.signed(self.key, HEALTH_PLACE, self.health(world, state)).SerializeToString()
        heard = Health(world.boot, sequence, epoch, state, world.now_ns, data)
        return world._replace(sequence=sequence, epoch=epoch, heard=(heard, *world.heard)[: self.remembers])

    def health(self, world: World, state: int, site: str = SITE) -> pb.Health:
        """The next message of the station."""
        return pb.Health(
            site=site,
            boot_id=bytes([world.boot]) * 16,
            sequence=world.sequence + 1,
            gps_time_ns=(world.epoch + 1) * 10**9,
            issued_mono_ns=self.station_clock_ns(world.boot, world.now_ns),
            valid_for_ms=VALID_MS,
            state=pb.State.Name(pb.State.ValueType(state)),
            cause=pb.CAUSE_UNSPECIFIED if state == pb.NORMAL else pb.SPOOFING,
        )

    def signed(self, key: SigningKey, place: str, health: pb.Health) -> pb.SignedHealth:
        return sign_health(key, place, health)

    def answer(self, world: World, nonce: int) -> World:
        """The station signs a nonce; the attacker hears it."""
        issued_ns = self.station_clock_ns(world.boot, world.now_ns)
        reply = pb.ChallengeReply(
            nonce=nonce_bytes(nonce), boot_id=bytes([world.boot]) * 16, issued_mono_ns=issued_ns, sequence=world.sequence
        )
        data = sign_challenge_reply(self.key, CHALLENGE_PLACE, reply).SerializeToString()
        answer = Answer(world.boot, nonce, world.sequence, world.now_ns, data)
        return world._replace(answers=(answer, *world.answers)[: self.remembers])

    def ask(self, world: World) -> tuple[World, int]:
        """The train draws a nonce."""
        nonce = world.drawn + 1
        asked = {n: at_ns for n, at_ns in world.asked.items() if world.now_ns - at_ns <= 2 * VALID_MS * MS}
        return world._replace(asked=asked | {nonce: world.now_ns}, drawn=nonce), nonce

    def deliver(self, world: World, data: bytes, place: str = HEALTH_PLACE, true: Health | None = None) -> Event:
        """Bytes reach the train; `true` is the message if they are one, unchanged, at its place."""
        now_ns = self.train_clock_ns(world.now_ns)
        verifier = self._verifier(world)
        received = verifier.health(place, data, now_ns)
        trust = self.code.trust.after_message(world.trust, received, now_ns, self.limits)
        known, fits = world.known, True
        last = world.verifier.last  # what was heard before the first challenge does not count when it comes again
        early = last is not None and true is not None and last.boot_id[0] == true.boot and last.sequence >= true.sequence
        if true is None or early or boot_in_force(world) != true.boot or (true.boot, true.sequence) <= (known.newest or (0, 0)):
            fits = False
        else:
            known = _known_after(known, true, world.now_ns)
        after = world._replace(verifier=verifier.memory(), trust=trust, known=known)
        return Event(after, True, fits, true.state if true else None)

    def deliver_answer(self, world: World, nonce: int, data: bytes, true: Answer | None = None) -> Event:
        """Bytes reach the train as the answer to a nonce that it has asked."""
        sent_ns, now_ns = world.asked[nonce], self.train_clock_ns(world.now_ns)
        verifier = self._verifier(world)
        verifier.challenge_answered(nonce_bytes(nonce), self.train_clock_ns(sent_ns), now_ns, data)
        after, known = world._replace(verifier=verifier.memory()), world.known
        fits = true is not None and true.nonce == nonce and world.now_ns - sent_ns <= VALID_MS * MS
        if fits and true is not None and boot_in_force(after) == true.boot:  # what it names may still come; what is older has had its time
            known = known._replace(newest=max(known.newest or (0, 0), (true.boot, true.sequence - 1)))
        return Event(after._replace(known=known), True, fits, answer=true)

    def pass_time(self, world: World, step_ns: int) -> World:
        now_ns = world.now_ns + step_ns
        return world._replace(now_ns=now_ns, trust=self.code.trust.after_time(world.trust, self.train_clock_ns(now_ns), self.limits))

    def _verifier(self, world: World) -> Any:
        return self.code.verification.HealthVerifier(SITE, self._keys, VALID_MS, world.verifier)


def nonce_bytes(nonce: int) -> bytes:
    return nonce.to_bytes(16, "big")


def boot_in_force(world: World) -> int | None:
    return world.verifier.tie.boot_id[0] if world.verifier.tie else None


def _known_after(known: Known, true: Health, now_ns: int) -> Known:
    newest, end_ns = (true.boot, true.sequence), true.issued_ns + VALID_MS * MS
    if true.state != pb.NORMAL:
        return known._replace(newest=newest, in_a_row=0)
    if now_ns > end_ns:
        return known._replace(newest=newest)
    in_a_row = 0 if known.end_ns is not None and now_ns > known.end_ns else known.in_a_row
    return Known(newest, in_a_row + 1, max(known.end_ns or end_ns, end_ns))
