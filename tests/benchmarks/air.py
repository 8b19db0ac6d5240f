"""From decision to verified health: `python -m tests.benchmarks.air [--seconds 60] [--awake] [--json]`.

A station at 10 Hz in a process of its own, which decides on what three simulated receivers measure: when the decision is there the moment
is stamped, its health is encoded, signed and put. The subscriber, another process, is the one of `wayside listen`: it challenges and
verifies; then the moment is stamped again (one monotonic clock serves all processes of a machine), and trust follows. Once over TCP,
once over TLS with certificates and rights from peer to peer, once over TLS through the shipped router. Between two messages the same
bytes go the same way once more, unlooked at: from put to callback, which is Zenoh's share and the machine's. Then how many messages a
second one core verifies, trust included, beside the bare Ed25519 of the library.

Between two epochs the processors fall asleep, and each thread on the way wakes one: on a virtual machine a good part of the whole.
`--awake` keeps them from it, by the means Linux has for that (as `cyclictest` does when it measures); it needs root.
"""

import argparse
import gc
import json
import os
import struct
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterable, Iterator, Sequence
from contextlib import ExitStack, contextmanager, nullcontext
from pathlib import Path
from typing import Any

import numpy as np
from nacl.signing import VerifyKey

from integrity import SOFTWARE
from integrity.events import Event, Tick
from integrity.messages import wayside_pb2 as pb
from integrity.messages.key_expressions import CHALLENGE, HEALTH, site_key
from integrity.messages.outputs import encode_health
from integrity.messages.signatures import HEALTH_CONTEXT, SigningKey, sign_challenge_reply, sign_health, signature_is_right
from integrity.messages.verification import NONCE_BYTES, HealthVerifier, Received
from integrity.outputs import HealthReport
from integrity.station_monitor import StationMonitor
from recordings.certificates import Role, new_authority, new_certificate
from recordings.keys import KeyDates, TrustedKey, load_key, new_key
from recordings.link import Access, dial_link, open_link
from recordings.tls_files import files_beside
from station.publisher import Publisher
from station.runtime import CHORES_AFTER, LOOK_AHEAD_NS
from tests.e2e.field import REPOSITORY, free_port, make_field, measured
from tests.e2e.router import running_router
from train_client.listen import Listener
from train_client.trust import Trust, TrustLimits, TrustState, after_message, after_time

SITE_ID, READER = "kokubunji-1", "r291"
PERIOD_NS = 100_000_000
FIRST_NS = 1_456_000_000_000_000_000
VALID_MS = 3000
SATELLITES = [f"{system}{n:02d}.1C" for system in "GEC" for n in range(1, 12)]
LIMITS = TrustLimits(10, 2_000_000_000)
SETTLING = 50  # messages: the link, the challenge, the station's and the train's recovery
SOURCES = {"A": "tcp://127.0.0.1:2001", "B": "tcp://127.0.0.1:2002", "C": "tcp://127.0.0.1:2003"}  # nobody dials them
MISSED = 30  # epochs before the subscriber is there
LINGERS_S = 60
BARE = "bare"
TIME_BYTES = 8
ASKED_MS = {"tls": (1.0, 3.0), "tls router": (None, 8.0)}  # p50, p99
ASKED_PER_S = 6000
LATENCY_REQUEST = Path("/dev/cpu_dma_latency")  # Linux, "PM Quality of Service Interface": holds for as long as the file is open
MESSAGES = 20_000
ROUNDS = 5


def health(sequence: int, boot_id: bytes, issued_mono_ns: int) -> pb.Health:
    """What a station says in an epoch in which all is well."""
    gps_time_ns = FIRST_NS + sequence * PERIOD_NS
    message = pb.Health(site=SITE_ID, boot_id=boot_id, sequence=sequence, issued_mono_ns=issued_mono_ns, gps_time_ns=gps_time_ns)
    message.valid_for_ms, message.state, message.covers_from_gps_ns, message.covers_to_gps_ns = (
        VALID_MS,
        pb.NORMAL,
        gps_time_ns,
        gps_time_ns,
    )
    message.monitored.extend(SATELLITES)
    message.config_sha256, message.software = "0" * 64, "wayside benchmark"
    return message


def speak(endpoints: Sequence[str], connects: Sequence[str], folder: Path, secured: bool, epochs: int) -> None:
    """The station's process: decide and put each epoch, with its chores at the times of a station's; then wait to be killed."""
    tls = files_beside(folder / f"{SITE_ID}.pem") if secured else None
    boot_id = os.urandom(16)
    with tempfile.TemporaryDirectory() as name:
        site = make_field(Path(name), SOURCES, PERIOD_NS / 1e9, site_id=SITE_ID).site
    measurements = list(by_epoch(measured(site, epochs * PERIOD_NS / 1e9)))
    monitor = StationMonitor(site.config)
    with open_link(endpoints, connects, tls, Access(SITE_ID, (READER, "router")) if secured else None) as link:
        publisher = Publisher(link, site.config, load_key(folder / "signing.pem"), boot_id, SOFTWARE)
        put_bare = link.urgent(site_key(SITE_ID, BARE), "")
        gc.collect()
        gc.freeze()
        gc.disable()  # as the station does
        print("ready", flush=True)
        began_ns = time.monotonic_ns()
        for number, events in enumerate(measurements, 1):
            due_ns = began_ns + number * PERIOD_NS
            sleep_until(due_ns - LOOK_AHEAD_NS)
            monitor.look_ahead()
            sleep_until(due_ns)
            outputs = monitor.feed(events)
            decided_mono_ns = time.monotonic_ns()
            (report,) = (o for o in outputs if isinstance(o, HealthReport))
            message = encode_health(report, site.config, SOFTWARE, boot_id)
            message.issued_mono_ns = decided_mono_ns
            publisher.health(message)
            sleep_until(due_ns + round(CHORES_AFTER * PERIOD_NS))
            gc.collect()
            same = message.SerializeToString()[TIME_BYTES:]
            sleep_until(due_ns + PERIOD_NS // 2)
            put_bare(time.monotonic_ns().to_bytes(TIME_BYTES) + same)
        time.sleep(LINGERS_S)


def by_epoch(events: Iterable[Event]) -> Iterator[list[Event]]:
    """What comes up to each tick: an epoch of all receivers."""
    pending: list[Event] = []
    for event in events:
        pending.append(event)
        if isinstance(event, Tick):
            yield pending
            pending = []


def sleep_until(mono_ns: int) -> None:
    """At once, if that is over."""
    time.sleep(max(0, mono_ns - time.monotonic_ns()) / 1e9)


def hear(endpoint: str, folder: Path, secured: bool, messages: int) -> None:
    """The subscriber's process: latencies in nanoseconds, of each message that was verified and fresh, and of the bare bytes between."""
    trusted = load_key(folder / "signing.pem").public
    tls = files_beside(folder / f"{READER}.pem") if secured else None
    latencies_ns: list[int] = []
    bare_ns: list[int] = []
    trust = Trust()

    def take(received: Received) -> None:
        nonlocal trust
        now_ns = time.monotonic_ns()
        trust = after_message(after_time(trust, now_ns, LIMITS), received, now_ns, LIMITS)
        if received.fresh and received.health is not None:
            latencies_ns.append(now_ns - received.health.issued_mono_ns)

    with dial_link([endpoint], lambda: None, tls) as link:
        link.subscribe(site_key(SITE_ID, BARE), lambda came: bare_ns.append(came.mono_ns - int.from_bytes(came.data[:TIME_BYTES])))
        verifier = HealthVerifier(SITE_ID, [trusted], VALID_MS)
        Listener(link, verifier, KeyDates([TrustedKey(trusted)]), take, lambda _: None).run(messages)
    assert trust.state is TrustState.NORMAL, trust
    print(json.dumps([latencies_ns[SETTLING:], bare_ns[SETTLING:]]))


@contextmanager
def awake_processors() -> Iterator[None]:
    """None of this machine's falls asleep meanwhile."""
    try:
        request = LATENCY_REQUEST.open("wb", buffering=0)
    except OSError as error:
        raise SystemExit(f"{LATENCY_REQUEST}: {error.strerror}: run it as root, or without --awake") from error
    with request:
        request.write(struct.pack("i", 0))  # microseconds that waking may take
        yield


@contextmanager
def _process(*arguments: object) -> Iterator["subprocess.Popen[str]"]:
    command = [sys.executable, "-m", "tests.benchmarks.air", *map(str, arguments)]
    with subprocess.Popen(command, cwd=REPOSITORY, stdout=subprocess.PIPE, text=True) as process:
        try:
            yield process
        finally:
            process.kill()


def latencies_ms(setup: str, folder: Path, seconds: float) -> dict[str, float]:
    """Percentiles of one setup."""
    secured = setup.startswith("tls")
    with ExitStack() as stack:
        if setup == "tls router":
            endpoint = stack.enter_context(running_router(folder))
            listen, connect = "", endpoint
        else:
            endpoint = f"{setup}/127.0.0.1:{free_port()}"
            listen, connect = endpoint, ""
        messages = SETTLING + round(seconds * 1e9 / PERIOD_NS)
        speaker = stack.enter_context(_process("--speak", listen, connect, folder, secured, messages + MISSED))
        assert speaker.stdout
        assert speaker.stdout.readline() == "ready\n"
        listener = stack.enter_context(_process("--hear", endpoint, folder, secured, messages))
        out, _ = listener.communicate()
        assert listener.returncode == 0, f"the subscriber ended with {listener.returncode}"
    verified_ms, bare_ms = (np.array(found_ns) / 1e6 for found_ns in json.loads(out))
    named = {name: round(float(np.percentile(verified_ms, q)), 3) for name, q in (("p50", 50), ("p99", 99), ("max", 100))}
    bare = {f"bare_{name}": round(float(np.percentile(bare_ms, q)), 3) for name, q in (("p50", 50), ("p99", 99))}
    return {"messages": len(verified_ms)} | named | bare


def verifications_per_s(key: SigningKey) -> dict[str, float]:
    """Messages per second of processor time, the best of some rounds; `floor`: the signature alone."""
    boot_id, place = os.urandom(16), site_key(SITE_ID, HEALTH)
    signed = [sign_health(key, place, health(n, boot_id, n * PERIOD_NS)) for n in range(1, MESSAGES + 1)]
    sent = [message.SerializeToString() for message in signed]
    answers = {n * PERIOD_NS: _answer(key, boot_id, n * PERIOD_NS) for n in range(1, MESSAGES + 1, 10)}  # each second, as trains do
    public = VerifyKey(key.public)
    best = {"verified_with_trust": 0.0, "floor": 0.0}
    for _ in range(ROUNDS):
        verifier, trust = HealthVerifier(SITE_ID, [key.public], VALID_MS), Trust()
        began_s = time.process_time()
        for n, data in enumerate(sent, 1):
            asked_ns, now_ns = n * PERIOD_NS, n * PERIOD_NS + 1_000_000
            if asked_ns in answers:
                nonce, answer = answers[asked_ns]
                assert not verifier.challenge_answered(nonce, asked_ns, asked_ns, answer).refusal
            received = verifier.health(place, data, now_ns)
            trust = after_message(after_time(trust, now_ns, LIMITS), received, now_ns, LIMITS)
        best["verified_with_trust"] = max(best["verified_with_trust"], MESSAGES / (time.process_time() - began_s))
        assert (trust.state, trust.normals) == (TrustState.NORMAL, MESSAGES), "a message was not verified"
        began_s = time.process_time()
        for message in signed:
            assert signature_is_right(public, message.signature, HEALTH_CONTEXT, place, message.health)
        best["floor"] = max(best["floor"], MESSAGES / (time.process_time() - began_s))
    return {name: round(rate) for name, rate in best.items()}


def _answer(key: SigningKey, boot_id: bytes, mono_ns: int) -> tuple[bytes, bytes]:
    """A nonce, and what the station answers to it at that moment."""
    nonce = os.urandom(NONCE_BYTES)
    reply = pb.ChallengeReply(nonce=nonce, boot_id=boot_id, issued_mono_ns=mono_ns, sequence=0)
    return nonce, sign_challenge_reply(key, site_key(SITE_ID, CHALLENGE), reply).SerializeToString()


def measure(seconds: float) -> dict[str, Any]:
    """Everything once."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        key = new_key(folder / "signing.pem")
        new_authority(folder, 2)
        for certificate, role in ((SITE_ID, Role.SITE), ("router", Role.ROUTER), (READER, Role.TRAIN)):
            new_certificate(folder, certificate, role, [], 1)
        found = {setup: latencies_ms(setup, folder, seconds) for setup in ("tcp", "tls", "tls router")}
        return {"latency_ms": found, "per_s": verifications_per_s(key)}


def main() -> None:
    """Print what was measured, against what was asked."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=60.0, help="of each setup")
    parser.add_argument("--awake", action="store_true", help="keep the processors from falling asleep (Linux, root)")
    parser.add_argument("--json", action="store_true")
    parser.add_argument("--speak", nargs=5, help=argparse.SUPPRESS)
    parser.add_argument("--hear", nargs=4, help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.speak:
        listen, connect, folder, secured, epochs = arguments.speak
        speak([listen] if listen else [], [connect] if connect else [], Path(folder), secured == "True", int(epochs))
        return
    if arguments.hear:
        endpoint, folder, secured, messages = arguments.hear
        hear(endpoint, Path(folder), secured == "True", int(messages))
        return
    with awake_processors() if arguments.awake else nullcontext():
        found = measure(arguments.seconds)
    if arguments.json:
        print(json.dumps(found, indent=2))
        return
    for setup, ms in found["latency_ms"].items():
        asked = ", ".join(f"{name} {most:g}" for name, most in zip(("p50", "p99"), ASKED_MS.get(setup, ()), strict=False) if most)
        what = f"decision to verified health, {setup}"
        print(f"{what:<42} p50 {ms['p50']:.2f} ms, p99 {ms['p99']:.2f} ms, max {ms['max']:.2f} ms", end="")
        print(f" of {ms['messages']} (asked: {asked})" if asked else f" of {ms['messages']}", end="")
        print(f"; the bytes alone p50 {ms['bare_p50']:.2f} ms, p99 {ms['bare_p99']:.2f} ms")
    rates = found["per_s"]
    print(f"verified with trust on one core: {rates['verified_with_trust']} messages/s (asked {ASKED_PER_S}); ", end="")
    print(f"Ed25519 alone {rates['floor']}/s")


if __name__ == "__main__":
    main()
