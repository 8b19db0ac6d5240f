"""A ride on the sample line with a station beside it, all in one process: real bytes of antennas, real signed health, one clock."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cache
from pathlib import Path

import numpy as np
from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey

from integrity.events import EphemerisReceived, Event, RawBytes, Tick
from integrity.gnss.ephemeris.content import content_crc32
from integrity.gnss.ephemeris.store import EphemerisStore
from integrity.gnss.gps_time import NS_PER_S, parse_utc
from integrity.gnss.signals import satellite_of
from integrity.messages import wayside_pb2 as pb
from integrity.messages.key_expressions import CHALLENGE, HEALTH, site_key
from integrity.messages.signatures import SigningKey, sign_challenge_reply, sign_health, signing_key
from integrity.reception import Reception
from recordings.simulate.observations import observed
from recordings.simulate.receiver import as_bytes
from train_client.config import TrainConfig
from train_client.events import ChallengeAnswered, ChallengeSent, HealthReceived, TrainEvent
from train_client.localisation.localiser import TrainLocaliser
from train_client.outputs import PositionReport, Status, TrainOutput
from train_client.simulate.line import sample_line, sample_map, sample_place
from train_client.simulate.motion import Leg, Run, antennas_on, run_of
from train_client.simulate.story import TRAIN_ERRORS
from train_client.track.track_map import TrackMap
from train_client.train_file import load_train
from train_client.trust import TrustLimits

SAMPLES = Path(__file__).parents[3] / "recordings" / "samples"
START_NS = parse_utc("2026-03-02T03:00:00Z")
SITE = "sample"
KEY = signing_key(Ed25519PrivateKey.from_private_bytes(bytes(range(32))))
BOOT = b"boot of the ride"
MS = 1_000_000
STEP_NS = NS_PER_S // 5
MAP = sample_map()
LINE = sample_line()

Say = Callable[[int, pb.Health], pb.Health | None]
"""What the ground says in an epoch (by number) instead of a plain NORMAL; None: nothing."""


def a_train(**changes: object) -> TrainConfig:
    """The sample train at 5 Hz, trusting again after three messages."""
    config = load_train(SAMPLES / "train.toml").config
    return replace(config, **{"epoch_interval_ns": STEP_NS, "trust": TrustLimits(3, 2 * NS_PER_S), **changes})  # type: ignore[arg-type]


def a_run(front_m: float = 60.0, speed_mps: float = 20.0) -> Run:
    """At once at speed: an acceleration that takes a microsecond."""
    return run_of(LINE, START_NS - NS_PER_S, front_m - speed_mps, [Leg(1e-6, speed_mps * 1e6)] if speed_mps else [])


@cache
def measured(seconds: float = 8.0, front_m: float = 60.0, speed_mps: float = 20.0) -> tuple[Event, ...]:
    """What the antennas send: a burst of each and a tick per epoch, five a second."""
    antennas = antennas_on(a_run(front_m, speed_mps), a_train().antennas)
    events = as_bytes(observed(antennas, START_NS, seconds, 5.0, 7, TRAIN_ERRORS), antennas)
    return tuple(event for event in events if isinstance(event, RawBytes | Tick))


@dataclass
class Ground:
    """The station: signs health of the epoch at hand, and answers challenges."""

    key: SigningKey = KEY
    site: str = SITE
    boot: bytes = BOOT
    answers: bool = True
    sequence: int = 0
    told: EphemerisStore = field(default_factory=EphemerisStore)  # what satellites say

    def hear(self, event: EphemerisReceived) -> None:
        """It hears the same satellites as the antennas do."""
        self.told.add(event.ephemeris)

    def known(self, gps_ns: int) -> int:
        """How many ephemerides it goes by in an epoch."""
        return len(self.told)

    def vouched(self, signal: str, gps_ns: int) -> list[pb.MonitoredSignal]:
        """The signal with the ephemeris that serves in an epoch, where there is one."""
        [[k]] = self.told.choose([satellite_of(signal)], np.array([gps_ns]), np.array([self.known(gps_ns)])).tolist()
        return [] if k < 0 else [pb.MonitoredSignal(signal=signal, ephemeris_crc32=content_crc32(self.told.ephemerides[k]))]

    def health(self, gps_ns: int, mono_ns: int, say: Say, number: int) -> Iterator[HealthReceived]:
        self.sequence += 1
        plain = pb.Health(
            site=self.site,
            boot_id=self.boot,
            sequence=self.sequence,
            gps_time_ns=gps_ns,
            issued_mono_ns=mono_ns,
            valid_for_ms=1000,
            covers_from_gps_ns=gps_ns - STEP_NS + 1,
            covers_to_gps_ns=gps_ns,
            state=pb.NORMAL,
            monitored=signals(),
        )
        message = say(number, plain)
        if message is not None:
            message.monitored_signals.extend(of for signal in message.monitored for of in self.vouched(signal, gps_ns))
            at = site_key(self.site, HEALTH)
            yield HealthReceived(mono_ns, at, sign_health(self.key, at, message).SerializeToString())

    def answer(self, sent: ChallengeSent) -> Iterator[ChallengeAnswered]:
        if self.answers:
            reply = pb.ChallengeReply(nonce=sent.nonce, boot_id=self.boot, issued_mono_ns=sent.mono_ns, sequence=self.sequence)
            data = sign_challenge_reply(self.key, site_key(self.site, CHALLENGE), reply).SerializeToString()
            yield ChallengeAnswered(sent.mono_ns, SITE, sent.nonce, data)


class Otherwise(Ground):
    """Vouches for another ephemeris of one satellite than all others hear."""

    def vouched(self, signal: str, gps_ns: int) -> list[pb.MonitoredSignal]:
        found = super().vouched(signal, gps_ns)
        for of in found:
            of.ephemeris_crc32 ^= signal.startswith("G07")
        return found


def signals() -> list[str]:
    """All that may be seen."""
    return [f"{system}{number:02d}.1C" for system in "GE" for number in range(1, 37)]


def nothing_special(number: int, plain: pb.Health) -> pb.Health:
    return plain


def events(
    sent: Sequence[Event], say: Say = nothing_special, ground: Ground | None = None, mono: Callable[[int], int] = lambda ns: ns
) -> list[TrainEvent]:
    """The bytes of the antennas, a challenge each second, and health after each epoch; `mono` makes the train's clock of GPS time."""
    station = ground or Ground()
    reception = Reception(sorted({event.receiver for event in sent if isinstance(event, RawBytes)}))
    found: list[TrainEvent] = []
    number = 0
    for event in sent:
        for heard in reception.take(event):
            if isinstance(heard, EphemerisReceived):
                station.hear(heard)
        at_ns = mono(event.mono_ns)
        assert isinstance(event, RawBytes | Tick)
        found.append(replace(event, mono_ns=at_ns))
        if isinstance(event, Tick):
            if number % 5 == 0:
                challenge = ChallengeSent(at_ns, SITE, number.to_bytes(16, "big"))
                found += [challenge, *station.answer(challenge)]
            found += station.health(event.mono_ns, at_ns, say, number)
            number += 1
    return found


def ride(of: Iterable[TrainEvent], train: TrainConfig | None = None, track: TrackMap = MAP) -> list[TrainOutput]:
    """Decide."""
    return TrainLocaliser(train or a_train(), track, {SITE: [KEY.public]}).feed(of)


def positions(outputs: Iterable[TrainOutput]) -> list[PositionReport]:
    return [output for output in outputs if isinstance(output, PositionReport)]


def valid(outputs: Iterable[TrainOutput]) -> list[PositionReport]:
    return [report for report in positions(outputs) if report.status is Status.VALID]


def errors_m(reports: Iterable[PositionReport], run: Run) -> list[float]:
    """Front end as reported less as it was; the edge must be right."""
    found = []
    for report in reports:
        assert report.fix is not None and report.fix.front is not None
        edge, s_m = sample_place(float(run.front(np.array([report.fix.gps_time_ns]))[0][0]))
        assert report.fix.front.edge == edge
        found.append(report.fix.front.offset_m - s_m)
    return found


def last_reasons(outputs: Iterable[TrainOutput]) -> str:
    return "; ".join(positions(outputs)[-1].reasons)
