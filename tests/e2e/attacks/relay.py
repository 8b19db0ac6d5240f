"""A man in the middle who speaks Zenoh, as anybody can where there is no TLS: the train dials him, he dials the station.

To the train he is the station: he puts health at its key, and answers its challenges. To the station he is a reader who asks. What he does
with what he hears is a `Tactic`, by default he passes everything on. One thread does all of it, in the order of time, so that a tactic
may remember things. He has no key: what he cannot take from the station he must forge.
"""

import heapq
import json
import threading
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, suppress
from itertools import count
from typing import Any, NamedTuple

import zenoh

from integrity.messages.key_expressions import CHALLENGE, HEALTH, site_key
from recordings.tls_files import TlsFiles
from tests.e2e.field import SITE_ID, free_port

HEALTH_KEY, CHALLENGE_KEY = site_key(SITE_ID, HEALTH), site_key(SITE_ID, CHALLENGE)
ANSWER_WITHIN_S = 1.0
MANNER: dict[str, Any] = {"priority": zenoh.Priority.REAL_TIME, "express": True}


class Question:
    """A challenge of the train, which may be answered several times, or never."""

    def __init__(self, query: zenoh.Query, nonce: bytes) -> None:
        self._query = query
        self.nonce = nonce

    def answer(self, data: bytes) -> None:
        """Too late, and nobody takes it."""
        with suppress(zenoh.ZError):
            self._query.reply(CHALLENGE_KEY, data, express=True)


def passed_on(relay: "Relay", health: bytes) -> None:
    relay.put(health)


def asked_on(relay: "Relay", question: Question) -> None:
    relay.ask(question.nonce, question.answer)


class Tactic(NamedTuple):
    """What is done with each health of the station, and with each challenge of the train."""

    health: Callable[["Relay", bytes], None] = passed_on
    challenge: Callable[["Relay", Question], None] = asked_on


class Relay:
    """`endpoint` is where a train dials. `heard`: all health of the station so far; `answers`: what it answered to challenges."""

    def __init__(self, endpoint: str, to_train: zenoh.Session, to_station: zenoh.Session) -> None:
        self.endpoint = endpoint
        self.tactic = Tactic()
        self.heard: list[bytes] = []
        self.answers: list[bytes] = []
        self._train, self._station = to_train, to_station
        self._due: list[tuple[float, int, Callable[[], None]]] = []
        self._number = count()
        self._changed = threading.Condition()
        self._ended = False
        self._kept = [
            to_station.declare_subscriber(HEALTH_KEY, lambda sample: self._health(bytes(sample.payload))),
            to_train.declare_queryable(HEALTH_KEY, lambda query: self.heard and query.reply(HEALTH_KEY, self.heard[-1])),
            to_train.declare_queryable(CHALLENGE_KEY, self._question),
        ]
        self._thread = threading.Thread(target=self._run, name="man in the middle", daemon=True)
        self._thread.start()

    def put(self, data: bytes, key: str = HEALTH_KEY, wait: bool = False) -> None:
        """To the train. With `wait` nothing is dropped on the way out: the caller waits for room."""
        drop = zenoh.CongestionControl.BLOCK if wait else zenoh.CongestionControl.DROP
        self._train.put(key, data, congestion_control=drop, **MANNER)

    def ask(self, nonce: bytes, take: Callable[[bytes], None]) -> None:
        """Challenge the station; what it answers is remembered and handed on."""

        def hand_on(reply: zenoh.Reply) -> None:
            if reply.ok is not None:
                data = bytes(reply.ok.payload)
                self.answers.append(data)
                self.later(0.0, lambda: take(data))

        self._station.get(CHALLENGE_KEY, hand_on, payload=nonce, timeout=ANSWER_WITHIN_S, **MANNER)

    def later(self, delay_s: float, do: Callable[[], None]) -> None:
        """Do it then, in the one thread; what is due at the same moment, in the order in which it was asked for."""
        with self._changed:
            heapq.heappush(self._due, (time.monotonic() + delay_s, next(self._number), do))
            self._changed.notify()

    def end(self) -> None:
        with self._changed:
            self._ended = True
            self._changed.notify()
        self._thread.join()

    def _health(self, data: bytes) -> None:
        self.heard.append(data)
        self.later(0.0, lambda: self.tactic.health(self, data))

    def _question(self, query: zenoh.Query) -> None:
        question = Question(query, bytes(query.payload or b""))
        self.later(0.0, lambda: self.tactic.challenge(self, question))

    def _run(self) -> None:
        while not self._ended:
            with self._changed:
                wait_s = self._due[0][0] - time.monotonic() if self._due else None
                if wait_s is None or wait_s > 0:
                    self._changed.wait(wait_s)
                    continue
                _, _, do = heapq.heappop(self._due)
            do()


@contextmanager
def relaying(station: str | None, tls: TlsFiles | None = None, lease_ms: int = 1000) -> Iterator[Relay]:
    """Between trains that dial the relay's endpoint and a station that listens at `station` (None: nowhere).

    `tls`: what he shows to trains; `lease_ms`: how long a train shall wait for a word of him.
    """
    endpoint = f"{'tls' if tls else 'tcp'}/127.0.0.1:{free_port()}"
    shown: Mapping[str, object] = {}
    if tls:
        shown = {
            "root_ca_certificate": str(tls.root_ca),
            "listen_certificate": str(tls.certificate),
            "listen_private_key": str(tls.private_key),
            "enable_mtls": False,  # he takes anybody
        }
    with ExitStack() as stack:
        to_train = stack.enter_context(zenoh.open(_config([endpoint], [], lease_ms, shown)))
        to_station = stack.enter_context(zenoh.open(_config([], [station] if station else [], lease_ms, {})))
        relay = Relay(endpoint, to_train, to_station)
        stack.callback(relay.end)
        yield relay


def _config(listen: Sequence[str], connect: Sequence[str], lease_ms: int, tls: Mapping[str, object]) -> zenoh.Config:
    config = zenoh.Config()
    settings: dict[str, object] = {
        "mode": "peer",
        "listen/endpoints": list(listen),
        "connect/endpoints": list(connect),
        "connect/exit_on_failure": False,
        "connect/retry": {"period_init_ms": 100, "period_max_ms": 200, "period_increase_factor": 1},
        "scouting/multicast/enabled": False,
        "scouting/gossip/enabled": False,
        "transport/link/tx/lease": lease_ms,
        **({"transport/link/tls": dict(tls)} if tls else {}),
    }
    for key, value in settings.items():
        config.insert_json5(key, json.dumps(value))
    return config
