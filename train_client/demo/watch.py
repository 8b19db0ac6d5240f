"""Whoever watches: verifies what the station says over Zenoh, reads what the train says on its stdout, keeps both for the table."""

import secrets
import threading
import time
from collections.abc import Callable, Iterable
from typing import IO

from google.protobuf.json_format import Parse

from integrity.messages import wayside_pb2 as pb
from integrity.messages.key_expressions import CHALLENGE, EPOCH, HEALTH, site_key
from integrity.messages.verification import CAUSES, NONCE_BYTES, HealthVerifier
from recordings.link import Arrival, Link
from train_client.demo.records import ChallengeSeen, Deeds, HealthSeen, PositionSeen, Records
from train_client.outputs import Status
from train_client.trust import TrustState

MAX_VALID_MS = 3000
ANSWER_WITHIN_S = 1.0

ErrorOf = Callable[[str, float, int], float]
"""How far a place of the front end (edge, offset in m) is off the truth along the line at a GPS time, m."""


class Watch:
    """Filled by threads of the link, of the player and of its own; read by the demo's."""

    def __init__(self, site: str, keys: Iterable[bytes], error_of: ErrorOf, began_ns: int, start_gps_ns: int) -> None:
        self._site = site
        self._verifier = HealthVerifier(site, keys, MAX_VALID_MS)
        self._verifying = threading.Lock()
        self._error_of = error_of
        self._began_ns = began_ns
        self._start_gps_ns = start_gps_ns
        self._sent_ns: dict[int, int] = {}
        self._asked: list[tuple[int, bytes]] = []
        self._answered: dict[bytes, int] = {}
        self.health: list[HealthSeen] = []
        self.reports: dict[int, pb.EpochReport] = {}
        self.positions: list[PositionSeen] = []
        self.messages: list[pb.TrainPosition] = []  # of `positions`
        self.genuine: list[bytes] = []  # signed bytes as they came, of `health`
        self.first_sent_ns: int | None = None

    def listen(self, link: Link) -> None:
        """From now on."""
        link.subscribe(site_key(self._site, HEALTH), self._health)
        link.subscribe(site_key(self._site, EPOCH), self._report)

    def read_positions(self, lines: IO[bytes]) -> None:
        """In a thread of its own, until the train client ends."""

        def read() -> None:
            for line in lines:
                self._position(line, time.monotonic_ns())

        threading.Thread(target=read, name="positions", daemon=True).start()

    def sent(self, _receiver: str, gps_ns: int, mono_ns: int) -> None:
        """The player handed over an epoch's bytes."""
        if self.first_sent_ns is None:
            self.first_sent_ns = mono_ns
        self._sent_ns[gps_ns] = mono_ns

    def challenge(self, link: Link) -> None:
        """Ask the station to sign a nonce."""
        nonce, asked_ns = secrets.token_bytes(NONCE_BYTES), time.monotonic_ns()
        self._asked.append((asked_ns, nonce))
        link.ask(site_key(self._site, CHALLENGE), nonce, ANSWER_WITHIN_S, lambda arrival: self._answer(nonce, asked_ns, arrival))

    def records(self, deeds: Deeds) -> Records:
        """All that was seen until now."""
        challenges = tuple(ChallengeSeen(asked_ns, self._answered.get(nonce)) for asked_ns, nonce in self._asked)
        return Records(
            self._began_ns, self._start_gps_ns, dict(self._sent_ns), tuple(self.health), tuple(self.positions), challenges, deeds
        )

    def story_s(self, mono_ns: int) -> float:
        """Seconds since the first epoch was sent."""
        return 0.0 if self.first_sent_ns is None else (mono_ns - self.first_sent_ns) / 1e9

    def _health(self, arrival: Arrival) -> None:
        with self._verifying:
            received = self._verifier.health(arrival.key_expr, arrival.data, arrival.mono_ns)
        health = received.health
        if health is None:
            return
        gps_ns = health.gps_time_ns if health.HasField("gps_time_ns") else None
        self.genuine.append(arrival.data)
        self.health.append(
            HealthSeen(
                arrival.mono_ns,
                gps_ns,
                health.sequence,
                received.said,
                CAUSES[health.cause],
                tuple(health.subjects),
                tuple(health.excluded_satellites),
            )
        )

    def _report(self, arrival: Arrival) -> None:
        report = pb.EpochReport.FromString(arrival.data)
        self.reports[report.gps_time_ns] = report

    def _answer(self, nonce: bytes, asked_ns: int, arrival: Arrival) -> None:
        with self._verifying:
            answer = self._verifier.challenge_answered(nonce, asked_ns, arrival.mono_ns, arrival.data)
        if not answer.refusal and not arrival.error:
            self._answered[nonce] = pb.ChallengeReply.FromString(pb.SignedChallengeReply.FromString(arrival.data).reply).sequence

    def _position(self, line: bytes, arrived_ns: int) -> None:
        position = Parse(line, pb.TrainPosition())
        gps_ns = position.gps_time_ns if position.HasField("gps_time_ns") else None
        error_m = None
        if gps_ns is not None and position.HasField("front"):
            error_m = self._error_of(position.front.edge, position.front.offset_m, gps_ns)
        self.messages.append(position)
        self.positions.append(PositionSeen(arrived_ns, gps_ns, status_of(position), trust_of(position), error_m, position.refused_messages))


def trust_of(position: pb.TrainPosition) -> TrustState:
    """Of the message."""
    return TrustState(pb.TrustState.Name(position.trust).removeprefix("TRUST_"))


def status_of(position: pb.TrainPosition) -> Status:
    """Of the message."""
    return Status(pb.PositionStatus.Name(position.status).removeprefix("POSITION_"))
