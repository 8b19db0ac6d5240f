"""A station's voice over real Zenoh: a process that publishes, and this one that asks. Loopback, free ports, nothing found by itself."""

import json
import os
import queue
import secrets
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, TypeVar

import pytest

from integrity.messages import wayside_pb2 as pb
from integrity.messages.key_expressions import ALERT, ALIVE, CHALLENGE, EPOCH, HEALTH, INFO, site_key
from integrity.messages.verification import HealthVerifier
from integrity.states import State
from recordings.keys import load_key, new_key, trusted_table
from recordings.link import Arrival, Link, dial_link, open_link
from recordings.site_file import parse_site
from station.publisher import Publisher
from tests.unit.sites import SITE

ROOT = Path(__file__).parents[2]
SITE_ID = "kokubunji-1"
GPS_NS = 1_456_000_000_000_000_000
PATIENCE_S = 10.0
T = TypeVar("T")


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port: int = probe.getsockname()[1]
        return port


def environment() -> dict[str, str]:
    return {**os.environ, "PYTHONPATH": str(ROOT), "COLUMNS": "200"}


def until(what: str, look: Callable[[], T | None]) -> T:
    """What `look` finds, once it finds something."""
    deadline = time.monotonic() + PATIENCE_S
    while time.monotonic() < deadline:
        found = look()
        if found is not None:
            return found
        time.sleep(0.02)
    raise AssertionError(f"{what}: not within {PATIENCE_S} s")


def station_process(listen: list[str], connect: list[str], key: str, boot_id: str) -> None:
    """Runs in a process of its own: publishes what it is told on stdin, and says how long each put took, in nanoseconds."""
    with open_link(listen, connect) as link:
        boot = bytes.fromhex(boot_id)
        publisher = Publisher(link, parse_site(SITE, "site.toml").config, load_key(Path(key)), boot, "wayside test")
        print("ready", flush=True)
        for line in sys.stdin:
            kind, fields = json.loads(line)
            if kind == "health":
                fields = {"site": SITE_ID, "boot_id": boot, "issued_mono_ns": time.monotonic_ns() - fields.pop("age_ns", 0)} | fields
            if "pad" in fields:
                fields["reasons"] = ["x" * fields.pop("pad")]
            message = {"health": pb.Health, "epoch": pb.EpochReport, "alert": pb.Alert}[kind](**fields)
            put: Callable[[Any], None] = getattr(publisher, kind)
            began = time.perf_counter_ns()
            put(message)
            print(time.perf_counter_ns() - began, flush=True)


class Station:
    """A station process and what steers it."""

    def __init__(self, key: Path, listen: list[str], connect: list[str]) -> None:
        self.boot_id = secrets.token_bytes(16)
        call = f"from tests.e2e.test_publisher import *; station_process({listen!r}, {connect!r}, {str(key)!r}, {self.boot_id.hex()!r})"
        self.process = subprocess.Popen(
            [sys.executable, "-c", call], env=environment(), cwd=ROOT, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
        )
        assert self._said() == "ready"

    def _said(self) -> str:
        assert self.process.stdout
        return self.process.stdout.readline().strip()

    def publish(self, kind: str, **fields: Any) -> int:
        """How long the put took, in nanoseconds."""
        assert self.process.stdin
        self.process.stdin.write(json.dumps([kind, fields]) + "\n")
        self.process.stdin.flush()
        return int(self._said())

    def health(self, sequence: int, **changes: Any) -> int:
        fields = {"gps_time_ns": GPS_NS + sequence * 10**9, "valid_for_ms": 3000, "state": pb.NORMAL, "monitored": ["G05.1C"]}
        return self.publish("health", sequence=sequence, **(fields | changes))

    def end(self) -> None:
        assert self.process.stdin and self.process.stdout
        self.process.stdin.close()
        try:
            self.process.wait(PATIENCE_S)  # a session that is not closed would hang here
        finally:
            self.process.kill()
            self.process.wait()
            self.process.stdout.close()


@contextmanager
def station(key: Path, listen: list[str], connect: list[str]) -> Iterator[Station]:
    running = Station(key, listen, connect)
    try:
        yield running
    finally:
        running.end()


@pytest.fixture(scope="module")
def key(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A station's key; `trusted.toml` lies beside it."""
    path = tmp_path_factory.mktemp("keys") / f"{SITE_ID}.pem"
    (path.parent / "trusted.toml").write_text(trusted_table(SITE_ID, new_key(path).public))
    return path


@pytest.fixture
def on_air(key: Path) -> Iterator[tuple[Station, Link]]:
    """A station, and a link to it from here."""
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    with station(key, [endpoint], []) as running, dial_link([endpoint], lambda: None) as link:
        until("connection", lambda: link.connected or None)
        yield running, link


def ask(link: Link, what: str, payload: bytes = b"") -> Arrival:
    """The first answer; asked again while the station's queryable is not known here yet."""
    answers: queue.Queue[Arrival] = queue.Queue()

    def look() -> Arrival | None:
        link.ask(site_key(SITE_ID, what), payload, 1.0, answers.put)
        try:
            return answers.get(timeout=0.2)
        except queue.Empty:
            return None

    return until(f"answer about {what}", look)


def challenge(link: Link, verifier: HealthVerifier) -> str:
    nonce, sent_ns = secrets.token_bytes(16), time.monotonic_ns()
    arrival = ask(link, CHALLENGE, nonce)
    return arrival.error or verifier.challenge_answered(nonce, sent_ns, arrival.mono_ns, arrival.data).refusal


def verifier_of(key: Path) -> HealthVerifier:
    return HealthVerifier(SITE_ID, [load_key(key).public], 3000)


def test_who_comes_late_gets_the_latest_health_by_query_and_can_believe_it(on_air: tuple[Station, Link], key: Path) -> None:
    running, link = on_air
    running.health(1)
    running.health(2)
    verifier = verifier_of(key)
    challenge(link, verifier)
    arrival = ask(link, HEALTH)
    received = verifier.health(arrival.key_expr, arrival.data, arrival.mono_ns)
    assert (received.sequence, received.state, received.refusal) == (2, State.NORMAL, "")


def test_before_the_first_health_a_query_says_so(on_air: tuple[Station, Link]) -> None:
    assert ask(on_air[1], HEALTH).error.startswith("no health has been published")


def test_a_challenge_is_answered_with_the_boot_in_force(on_air: tuple[Station, Link], key: Path) -> None:
    running, link = on_air
    verifier = verifier_of(key)
    assert (challenge(link, verifier), verifier.boot_id) == ("", running.boot_id)


def test_a_nonce_of_another_length_is_refused_and_the_next_one_answered(on_air: tuple[Station, Link], key: Path) -> None:
    link = on_air[1]
    errors = [ask(link, CHALLENGE, bytes(length)).error for length in (0, 15, 17)]
    assert errors == [f"nonce of {n} bytes: expected 16 random ones" for n in (0, 15, 17)]
    assert challenge(link, verifier_of(key)) == ""


def test_info_tells_the_site(on_air: tuple[Station, Link], key: Path) -> None:
    running, link = on_air
    info = pb.SiteInfo.FromString(ask(link, INFO).data)
    told = (info.site, info.frame, len(info.triangle), info.radius_m > 0, info.key_id, info.boot_id)
    assert told == (SITE_ID, "JGD2011", 3, True, load_key(key).key_id, running.boot_id)


def test_health_and_reports_reach_a_subscriber(on_air: tuple[Station, Link]) -> None:
    running, link = on_air
    arrived: queue.Queue[Arrival] = queue.Queue()
    for what in (HEALTH, EPOCH):
        link.subscribe(site_key(SITE_ID, what), arrived.put)
    seen: set[str] = set()

    def both() -> bool | None:
        running.health(len(seen) + 1)
        running.publish("epoch", gps_time_ns=GPS_NS)
        while not arrived.empty():
            seen.add(arrived.get().key_expr.rsplit("/", 1)[1])
        return seen == {HEALTH, EPOCH} or None

    assert until("health and report", both)


def test_alerts_from_before_reach_who_comes_late(on_air: tuple[Station, Link]) -> None:
    running, link = on_air
    for n in range(5):
        running.publish("alert", mono_ns=n, state=pb.NORMAL)
    arrived: queue.Queue[Arrival] = queue.Queue()
    link.subscribe_remembered(site_key(SITE_ID, ALERT), 100, arrived.put)
    assert [pb.Alert.FromString(arrived.get(timeout=PATIENCE_S).data).mono_ns for _ in range(5)] == [0, 1, 2, 3, 4]


def test_who_is_killed_is_no_longer_alive(on_air: tuple[Station, Link]) -> None:
    running, link = on_air
    changes: queue.Queue[bool] = queue.Queue()
    link.watch(site_key(SITE_ID, ALIVE), changes.put)
    there = changes.get(timeout=PATIENCE_S)
    running.process.send_signal(signal.SIGKILL)
    assert (there, changes.get(timeout=PATIENCE_S)) == (True, False)


def waited_for_processor_ns() -> int:
    """Of this thread, since it began."""
    return int(Path("/proc/thread-self/schedstat").read_text().split()[1])


def test_a_reader_that_stands_still_does_not_hold_the_station(key: Path) -> None:
    """40 MB to a stopped process: more than the buffers between hold. With congestion control BLOCK a put takes seconds."""
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    reading = (
        "import time\nfrom recordings.link import dial_link\n"
        f"with dial_link([{endpoint!r}], print) as link:\n"
        f"    link.subscribe('wayside/v1/{SITE_ID}/health', lambda a: print(a.mono_ns, flush=True))\n    time.sleep(60)"
    )
    with (
        station(key, [endpoint], []) as running,
        subprocess.Popen([sys.executable, "-c", reading], env=environment(), stdout=subprocess.PIPE) as reader,
    ):
        assert reader.stdout
        out = reader.stdout
        os.set_blocking(out.fileno(), False)

        def heard() -> bytes | None:
            running.health(1)
            return out.read()

        def held_ns(n: int) -> int:
            """How long a put took, less what this thread waited for a processor meanwhile: others may keep the machine busy."""
            waited_ns = waited_for_processor_ns()
            took_ns = running.health(n, pad=200_000)
            return took_ns - (waited_for_processor_ns() - waited_ns)

        try:
            until("first health", heard)
            reader.send_signal(signal.SIGSTOP)
            slowest_ns = max(held_ns(n) for n in range(2, 202))
        finally:
            reader.kill()
    assert slowest_ns <= 100_000_000


def test_health_of_another_boot_is_a_bug(key: Path) -> None:
    with open_link([], []) as link, pytest.raises(AssertionError, match="another boot"):
        Publisher(link, parse_site(SITE, "s").config, load_key(key), bytes(16), "x").health(pb.Health(boot_id=b"x" * 16))
