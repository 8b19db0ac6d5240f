"""The main path on board: events in, positions out. Read this first.

`TrainLocaliser.feed(events)` takes what arrived, in order, and returns what was decided, in order. It reads no clock, no file, no chance:
live and replay call it with the same events and get the same positions.

The way of an epoch, and of a message:
  1. `integrity.reception`      bytes of the antennas become measurements and navigation messages
  2. `positioning.navigation`   navigation messages count only where all antennas have heard the same
  3. `integrity.assembler`      rows of all antennas become aligned epochs; silence is noticed
  4. `fixes`                    one place along the track, or why there is none
  a. `integrity.messages.verification`   health is believed only if signed, for this site, next of the boot that answered a challenge
  b. `trust`                    may GNSS be used: one table
  c. `coverage`                 a fix stays provisional until a NORMAL message covers its epoch
"""

from collections.abc import Iterable, Mapping
from typing import NamedTuple

from integrity.assembler import AlignedEpoch, Assembler, Interruption
from integrity.events import EphemerisReceived, Heard, InputLost, RawBytes, Tick
from integrity.gnss.ephemeris.store import EphemerisStore
from integrity.messages import wayside_pb2 as pb
from integrity.messages.verification import HealthVerifier, Received
from integrity.reception import Reception
from integrity.states import State
from train_client.config import TrainConfig
from train_client.events import ChallengeAnswered, ChallengeSent, HealthReceived, TrainEvent
from train_client.limits import Timing, derive, silence_ns
from train_client.localisation.coverage import Coverage, Vouched, vouched_by
from train_client.localisation.fixes import FixMaker
from train_client.localisation.memory import LocaliserMemory
from train_client.localisation.progress import Progress
from train_client.outputs import Confirmed, Fix, MessageRefused, PositionReport, Status, TrainOutput, TrustChange
from train_client.positioning.navigation import NavigationAgreement
from train_client.track.track_map import TrackMap
from train_client.trust import Trust, TrustState, after_message, after_time, next_change_ns

CHALLENGE_EVERY_NS = 1_000_000_000
CHALLENGE_PAUSE_NS = 100_000_000  # at least this between two: replayed messages must not make us ask without end
MOST_NONCES = 16  # not answered yet
SHOWN_CHARACTERS = 200  # of words from the network that nobody has signed
DENIED = (TrustState.SATELLITE_ANOMALY, TrustState.NOT_CONFIRMABLE)


class _Waiting(NamedTuple):
    """An epoch whose fix is provisional, and the signals that were allowed for it; None: all."""

    epoch: AlignedEpoch
    signals: Mapping[str, int] | None
    fix: Fix


class TrainLocaliser:
    """Decides for one train. `keys` are the raw public keys trusted for its station."""

    def __init__(self, train: TrainConfig, track: TrackMap, keys: Iterable[bytes], memory: LocaliserMemory | None = None) -> None:
        start = memory or LocaliserMemory()
        self.train = train
        self.track = track
        self._keys = tuple(keys)
        limits = derive()
        timing = Timing(limits.alignment_tolerance_ns, limits.alignment_tolerance_ns, silence_ns(train.epoch_interval_ns))
        self._store = EphemerisStore(start.ephemerides)
        self._reception = Reception(train.antenna_ids, start.reception, train.protocols)
        self._agreement = NavigationAgreement(train.antenna_ids, start.told)
        self._assembler = Assembler(train.antenna_ids, train.epoch_interval_ns, timing, start.assembler, self._store)
        self._fixes = FixMaker(train, track, self._store, limits, start.fixes)
        self._progress = Progress(train, track, start.progress)
        self._verifier = HealthVerifier(train.station, self._keys, train.max_valid_ms, start.verifier)
        self._trust = start.trust
        self._coverage: Coverage[_Waiting] = Coverage(start.vouched)
        self._nonces = dict(start.nonces)  # to when they were sent
        self._challenge_at_ns = start.challenge_at_ns
        self._mono_ns = start.mono_ns
        self._sequence = start.sequence
        self._refused = start.refused
        self._confirmed = start.confirmed

    def snapshot(self) -> LocaliserMemory:
        """The whole memory, as values. Fixes that wait for their confirmation are let go: they stay provisional."""
        return LocaliserMemory(
            reception=self._reception.memories(),
            told=self._agreement.memory(),
            assembler=self._assembler.state(),
            ephemerides=tuple(self._store.ephemerides),
            fixes=self._fixes.memory(),
            progress=self._progress.memory(),
            vouched=self._coverage.vouched(),
            verifier=self._verifier.memory(),
            trust=self._trust,
            nonces=tuple(self._nonces.items()),
            challenge_at_ns=self._challenge_at_ns,
            mono_ns=self._mono_ns,
            sequence=self._sequence,
            refused=self._refused,
            confirmed=self._confirmed,
        )

    def feed(self, events: Iterable[TrainEvent]) -> list[TrainOutput]:
        """Decide what the events complete."""
        return [output for event in events for output in self._event(event)]

    def look_ahead(self) -> None:
        """Compute what the next epoch needs while there is time. It changes no decision, only how soon the next one is there."""
        if self._assembler.last_epoch_ns is not None:
            self._fixes.look_ahead(self._assembler.last_epoch_ns + self.train.epoch_interval_ns)

    @property
    def next_deadline_ns(self) -> int | None:
        """Monotonic time at which the shell should send a tick: trust runs out, or a stream falls silent."""
        silent_ns = self._assembler.deadline_ns
        times = [next_change_ns(self._trust, self.train.trust), None if silent_ns is None else silent_ns + 1]
        return min((t for t in times if t is not None), default=None)

    @property
    def challenge_due_ns(self) -> int:
        """Monotonic time at which the shell should challenge the station."""
        return self._challenge_at_ns or 0

    @property
    def trust(self) -> TrustState:
        """As of the last event."""
        return self._trust.state

    def _event(self, event: TrainEvent) -> list[TrainOutput]:
        outputs = self._time_passes(event.mono_ns)
        match event:
            case HealthReceived():
                outputs += self._health(event)
            case ChallengeSent():
                self._challenged(event)
            case ChallengeAnswered():
                outputs += self._answered(event)
            case RawBytes() | InputLost() | Tick():
                outputs += self._receivers(event)
        return outputs

    # ---- the ground

    def _time_passes(self, mono_ns: int) -> list[TrainOutput]:
        before_ns, self._mono_ns = self._mono_ns, mono_ns
        if before_ns is not None and mono_ns < before_ns:
            self._verifier = HealthVerifier(self.train.station, self._keys, self.train.max_valid_ms)
            self._nonces.clear()
            self._challenge_at_ns = mono_ns
            return self._changed(Trust(), mono_ns, (f"the train's clock stepped back by {(before_ns - mono_ns) / 1e9:.3f} s",))
        trust = after_time(self._trust, mono_ns, self.train.trust)
        why = "the last message is valid no longer" if trust.state is TrustState.STALE else "nothing that counts comes from the ground"
        return self._changed(trust, mono_ns, (why,))

    def _health(self, event: HealthReceived) -> list[TrainOutput]:
        received = self._verifier.health(event.key_expr, event.data, event.mono_ns)
        if received.unconfirmed:
            self._challenge_soon()
        if not received.verified:
            return self._refusal(event.mono_ns, received.refusal)
        trust = after_message(self._trust, received, event.mono_ns, self.train.trust)
        outputs = self._changed(trust, event.mono_ns, _reasons(received))
        health = received.health
        if health is None or trust.state is not TrustState.NORMAL or not received.fresh or received.said is not State.NORMAL:
            return outputs
        vouched = vouched_by(health)
        return outputs if vouched is None else [*outputs, *self._confirmations(vouched, event.mono_ns)]

    def _confirmations(self, vouched: Vouched, mono_ns: int) -> list[TrainOutput]:
        """What waited for this: solved again where other signals may be used than were."""
        waited = self._coverage.vouch(vouched)
        fixes = [w.fix if w.signals == vouched.signals else self._fix(w.epoch, vouched.signals) for w in waited]
        return [self._judged(fix, True, mono_ns) for fix in fixes]

    def _challenged(self, event: ChallengeSent) -> None:
        self._challenge_at_ns = event.mono_ns + CHALLENGE_EVERY_NS
        self._nonces[event.nonce] = event.mono_ns
        while len(self._nonces) > MOST_NONCES:
            del self._nonces[next(iter(self._nonces))]

    def _answered(self, event: ChallengeAnswered) -> list[TrainOutput]:
        sent_ns = self._nonces.get(event.nonce)
        if event.error or sent_ns is None:
            error = repr(event.error[:SHOWN_CHARACTERS]) if event.error else "an answer to a nonce that was not asked"
            return self._refusal(event.mono_ns, f"challenge: {error}")
        answer = self._verifier.challenge_answered(event.nonce, sent_ns, event.mono_ns, event.data)
        return self._refusal(event.mono_ns, f"challenge: {answer.refusal}") if answer.refusal else []

    def _refusal(self, mono_ns: int, refusal: str) -> list[TrainOutput]:
        self._refused += not refusal.startswith("repeated")  # a copy of the last message is no attack: it may have come twice
        return [MessageRefused(mono_ns, refusal)]

    def _challenge_soon(self) -> None:
        if self._challenge_at_ns is not None:
            last_ns = self._challenge_at_ns - CHALLENGE_EVERY_NS
            self._challenge_at_ns = min(self._challenge_at_ns, last_ns + CHALLENGE_PAUSE_NS)

    def _changed(self, trust: Trust, mono_ns: int, reasons: tuple[str, ...]) -> list[TrainOutput]:
        """Remember trust; where its state has changed, say so, and that there is no position until the next epoch."""
        before, self._trust = self._trust, trust
        if trust.state is not TrustState.NORMAL and trust != before:
            self._coverage.forget()
        if trust.state is before.state:
            return []
        change = TrustChange(mono_ns, before.state, trust.state, reasons)
        if before.state is not TrustState.NORMAL:
            return [change]
        return [change, self._report(mono_ns, Status.UNKNOWN, (f"trust is {trust.state.value}", *reasons), None)]

    # ---- the antennas

    def _receivers(self, event: RawBytes | InputLost | Tick) -> list[TrainOutput]:
        if self._assembler.last_epoch_ns is not None:
            self._store.forget_before(self._assembler.last_epoch_ns)
        outputs: list[TrainOutput] = []
        for item in self._assembler.take(self._agreed(event)):
            if isinstance(item, Interruption):
                self._fixes.lost()
                outputs.append(self._report(item.mono_ns, Status.UNKNOWN, (item.why,), None))
            else:
                outputs.append(self._position(item))
        return outputs

    def _agreed(self, event: RawBytes | InputLost | Tick) -> Iterable[Heard]:
        """What was heard, with those navigation messages that all antennas have heard alike."""
        for heard in self._reception.take(event):
            if not isinstance(heard, EphemerisReceived):
                yield heard
            elif isinstance(event, RawBytes):
                self._agreement.forget_before(self._assembler.last_epoch_ns or 0)
                for ephemeris in self._agreement.told(event.receiver, heard.ephemeris):
                    yield EphemerisReceived(heard.mono_ns, ephemeris)

    def _position(self, epoch: AlignedEpoch) -> PositionReport:
        """The place in an epoch: VALID if it is covered, PROVISIONAL as long as it may still be, UNKNOWN where there is none."""
        vouched = self._coverage.of(epoch.epoch_ns)
        likely = vouched or self._coverage.latest
        signals = None if likely is None else likely.signals
        fix = self._fix(epoch, signals)
        if vouched is None:
            self._coverage.wait(epoch.epoch_ns, _Waiting(epoch, signals, fix))
        return self._judged(fix, vouched is not None, epoch.mono_ns)

    def _fix(self, epoch: AlignedEpoch, signals: Mapping[str, int] | None) -> Fix:
        return self._fixes.fix(epoch, signals, self._agreement.mismatched)

    def _judged(self, fix: Fix, covered: bool, mono_ns: int) -> PositionReport:
        trust = self._trust.state
        if fix.front is None:
            return self._report(mono_ns, Status.UNKNOWN, fix.reasons, fix)
        if trust in DENIED:
            return self._report(mono_ns, Status.UNKNOWN, (f"trust is {trust.value}",), fix)
        if trust is not TrustState.NORMAL or not covered:
            return self._report(mono_ns, Status.PROVISIONAL, (f"no NORMAL message covers this epoch; trust is {trust.value}",), fix)
        objection = self._progress.objection(fix)
        if objection:
            return self._report(mono_ns, Status.UNKNOWN, (objection,), fix)
        self._progress.confirm(fix)
        self._confirmed = Confirmed(fix.front, fix.gps_time_ns)
        return self._report(mono_ns, Status.VALID, (), fix)

    def _report(self, mono_ns: int, status: Status, reasons: tuple[str, ...], fix: Fix | None) -> PositionReport:
        self._sequence += 1
        until_ns = self._trust.valid_until_ns
        left_ns = until_ns - mono_ns if until_ns is not None and self._trust.state is TrustState.NORMAL else None
        return PositionReport(
            self._sequence, mono_ns, status, reasons, fix, self._trust.state, self._trust.sequence, left_ns, self._confirmed, self._refused
        )


def _reasons(received: Received) -> tuple[str, ...]:
    """What the message says, for people."""
    health = received.health
    if health is None:
        return (received.refusal,)
    cause = pb.Cause.Name(health.cause).lower() if health.cause in pb.Cause.values() else f"cause {health.cause}"
    subjects = f" ({', '.join(health.subjects)})" if health.subjects else ""
    said = () if received.said is State.NORMAL else (f"the ground says {received.said.value}: {cause}{subjects}",)
    return (*said, *((received.caution,) if received.caution else ()), *health.reasons)
