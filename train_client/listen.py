"""A subscriber that believes nothing it has not verified: the example for onboard teams.

One thread decides: it takes what the link's threads have stamped from a bounded queue. It challenges the station every second, and at
once when a boot speaks that is not confirmed; asks for the latest health when a boot has come into force; and says each message with
what may be believed of it. Where it stays silent for as long as the last message was valid, it says NO_COMMS, once.
"""

import json
import queue
import secrets
import time
from collections.abc import Callable
from typing import Any, NamedTuple

from integrity.gnss.gps_time import format_utc
from integrity.messages import wayside_pb2 as pb
from integrity.messages.key_expressions import ALIVE, CHALLENGE, HEALTH, site_key
from integrity.messages.verification import CAUSES, NONCE_BYTES, NS_PER_MS, Answer, HealthVerifier, Received, cut
from recordings.keys import KeyDates
from recordings.link import Arrival, Link

CHALLENGE_EVERY_NS = 1_000_000_000
CHALLENGE_PAUSE_NS = 100_000_000  # at least this between two: replayed messages must not make us ask without end
ANSWER_WITHIN_S = 1.0
SHOWN_CHARACTERS = 200  # of words from the network that nobody has signed
MOST_WAITING = 1000  # arrivals not looked at yet: a minute of a station at 10 Hz


class _Health(NamedTuple):
    arrival: Arrival
    live: bool  # put by the station just now, not the answer to a query


class _Answer(NamedTuple):
    arrival: Arrival
    nonce: bytes
    sent_mono_ns: int


class _Alive(NamedTuple):
    alive: bool


class Listener:
    """Follows one site over a link. `on_message` gets every message of it, believed or not; `on_notice` what else happens, in words."""

    def __init__(
        self,
        link: Link,
        verifier: HealthVerifier,
        dates: KeyDates,
        on_message: Callable[[Received], None],
        on_notice: Callable[[str], None],
    ) -> None:
        self._link = link
        self._dates = dates
        self._verifier = verifier
        self._on_message = on_message
        self._on_notice = on_notice
        self._waiting: queue.SimpleQueue[_Health | _Answer | _Alive] = queue.SimpleQueue()
        self._lost = 0
        self._challenged_mono_ns = time.monotonic_ns() - CHALLENGE_EVERY_NS
        self._challenge_at_mono_ns = self._challenged_mono_ns
        self._silent_at_mono_ns: int | None = time.monotonic_ns() + verifier.max_valid_ms * NS_PER_MS
        self._refused_answer = ""
        link.subscribe(site_key(verifier.site, HEALTH), lambda arrival: self._enqueue(_Health(_cut(arrival), True)))
        link.watch(site_key(verifier.site, ALIVE), lambda alive: self._enqueue(_Alive(alive)))

    def run(self, most_messages: int | None) -> None:
        """Until so many messages have been handed on; None: for ever."""
        handed_on = 0
        while most_messages is None or handed_on < most_messages:
            now_ns = time.monotonic_ns()
            if now_ns >= self._challenge_at_mono_ns:
                self._challenge(now_ns)
            if self._silent_at_mono_ns is not None and now_ns >= self._silent_at_mono_ns and self._waiting.empty():
                self._silent_at_mono_ns = None
                self._no_comms()
            due_ns = min(self._challenge_at_mono_ns, self._silent_at_mono_ns or self._challenge_at_mono_ns)
            try:
                item = self._waiting.get(timeout=max(0, due_ns - time.monotonic_ns()) / 1e9)
            except queue.Empty:
                continue
            handed_on += self._take(item)

    def _no_comms(self) -> None:
        why = "nothing more that can be verified" if self._link.connected else "there is no connection"
        self._on_notice(f"NO_COMMS: {why}: whatever {self._verifier.site} said before is valid no longer")

    def _take(self, item: _Health | _Answer | _Alive) -> int:
        """Messages handed on because of it."""
        if self._lost:
            self._on_notice(f"{self._lost} messages came faster than they could be looked at, and were lost")
            self._lost = 0
        match item:
            case _Health():
                return self._health(item)
            case _Answer():
                self._answer(item)
            case _Alive(alive):
                self._on_notice(f"{self._verifier.site} is {'there' if alive else 'gone'}")
                self._challenge_soon()
        return 0

    def _health(self, item: _Health) -> int:
        arrival = item.arrival
        if arrival.error:
            self._on_notice(f"{self._verifier.site} has no health to tell: {arrival.error[:SHOWN_CHARACTERS]!r}")
            return 0
        refusal = self._dates.of_health(arrival.data)
        received = Received(refusal) if refusal else self._verifier.health(arrival.key_expr, arrival.data, arrival.mono_ns)
        if not item.live and received.refusal.startswith(("repeated", "older", "overtaken")):
            return 0  # the live one was faster
        if received.verified:
            self._silent_at_mono_ns = arrival.mono_ns + received.valid_ns - (received.age_ns or 0) * received.fresh
        if received.unconfirmed:
            self._challenge_soon()
        self._on_message(received)
        return 1

    def _answer(self, item: _Answer) -> None:
        arrival = item.arrival
        if arrival.error:
            answer = Answer(f"an error instead of it: {arrival.error[:SHOWN_CHARACTERS]!r}")
        elif refusal := self._dates.of_answer(arrival.data):
            answer = Answer(refusal)
        else:
            answer = self._verifier.challenge_answered(item.nonce, item.sent_mono_ns, arrival.mono_ns, arrival.data)
        if answer.refusal and answer.refusal != self._refused_answer:
            self._on_notice(f"answer to a challenge not believed: {answer.refusal}")
        self._refused_answer = answer.refusal
        if answer.boot_is_new and self._verifier.boot_id is not None:
            self._on_notice(f"{self._verifier.site} answers as boot {self._verifier.boot_id.hex()}")
            self._link.ask(
                site_key(self._verifier.site, HEALTH), b"", ANSWER_WITHIN_S, lambda arrival: self._enqueue(_Health(_cut(arrival), False))
            )

    def _challenge_soon(self) -> None:
        self._challenge_at_mono_ns = min(self._challenge_at_mono_ns, self._challenged_mono_ns + CHALLENGE_PAUSE_NS)

    def _challenge(self, now_ns: int) -> None:
        nonce = secrets.token_bytes(NONCE_BYTES)
        self._challenged_mono_ns, self._challenge_at_mono_ns = now_ns, now_ns + CHALLENGE_EVERY_NS
        key_expr = site_key(self._verifier.site, CHALLENGE)
        sent_mono_ns = time.monotonic_ns()
        self._link.ask(key_expr, nonce, ANSWER_WITHIN_S, lambda arrival: self._enqueue(_Answer(_cut(arrival), nonce, sent_mono_ns)))

    def _enqueue(self, item: _Health | _Answer | _Alive) -> None:
        """In a thread of the link: never waits."""
        if self._waiting.qsize() < MOST_WAITING:
            self._waiting.put(item)
        else:
            self._lost += 1


def _cut(arrival: Arrival) -> Arrival:
    return arrival._replace(data=cut(arrival.data))


def as_line(received: Received) -> str:
    """A message for a person, on one line."""
    health = received.health
    if health is None:
        return f"{'refused':<20}  {received.refusal}"
    utc = format_utc(health.gps_time_ns) if health.HasField("gps_time_ns") else "no epoch yet"
    why = " ".join([_cause(health), *([f"({', '.join(health.subjects)})"] if health.subjects else [])])
    parts = [f"{utc:<20}", f"{received.said:<17}", *([why] if why else []), f"sequence {health.sequence}"]
    parts += [f"after {received.missed} that never came"] if received.missed else []
    parts += [f"age {received.age_ms:.1f} ms"] if received.age_ms is not None else []
    parts += [f"without {', '.join(health.excluded_satellites)}"] if health.excluded_satellites else []
    parts += [f"NOT FRESH: {received.staleness}"] if not received.fresh else []
    return "  ".join(parts + ([f"CAUTION: {received.caution}"] if received.caution else []))


def as_json(received: Received) -> str:
    """A message for a machine: one JSON object on one line. What is not known, or not to be believed, is null.

    `state` is what the message says; it may be acted on only where `fresh` is true.
    """
    health = received.health or pb.Health()
    told: dict[str, Any] = {
        "state": received.said,
        "cause": _cause(health),
        "subjects": list(health.subjects),
        "reasons": list(health.reasons),
        "gps_time_ns": health.gps_time_ns if health.HasField("gps_time_ns") else None,
        "utc": format_utc(health.gps_time_ns) if health.HasField("gps_time_ns") else None,
        "excluded": list(health.excluded_satellites),
        "monitored": list(health.monitored),
        "not_monitored": list(health.not_monitored),
        "valid_for_ms": health.valid_for_ms,
        "boot_id": health.boot_id.hex(),
        "config_sha256": health.config_sha256,
        "software": health.software,
    }
    judged = {
        "verified": received.verified,
        "fresh": received.fresh,
        "refusal": received.refusal,
        "staleness": received.staleness,
        "caution": received.caution,
        "sequence": received.sequence,
        "missed": received.missed,
        "age_ms": received.age_ms,
    }
    return json.dumps(judged | (told if received.verified else dict.fromkeys(told)))


def _cause(health: pb.Health) -> str:
    cause = CAUSES.get(health.cause)
    return f"cause {health.cause}" if cause is None else cause
