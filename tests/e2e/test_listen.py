"""`wayside listen` against a router that may be hostile: real processes, real Zenoh, and a third session that forges and replays."""

import json
import queue
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path
from typing import Any

import psutil
import pytest
import zenoh
from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey

from integrity.messages import wayside_pb2 as pb
from integrity.messages.signatures import sign_health, signing_key
from tests.e2e.test_publisher import PATIENCE_S, ROOT, SITE_ID, Station, environment, free_port, key, station

__all__ = ["key"]  # a fixture
PLACE = f"wayside/v1/{SITE_ID}/health"


class Hub:
    """A router in this process. It hears everything, and puts what it likes."""

    def __init__(self) -> None:
        self.endpoint = f"tcp/127.0.0.1:{free_port()}"
        config = zenoh.Config()
        config.insert_json5("mode", '"router"')
        config.insert_json5("listen/endpoints", json.dumps([self.endpoint]))
        config.insert_json5("scouting/multicast/enabled", "false")
        config.insert_json5("scouting/gossip/enabled", "false")
        self.session = zenoh.open(config)
        self.heard: queue.Queue[bytes] = queue.Queue()
        self._subscriber = self.session.declare_subscriber(PLACE, lambda sample: self.heard.put(bytes(sample.payload)))

    def put(self, data: bytes) -> None:
        self.session.put(PLACE, data)


@pytest.fixture
def hub() -> Iterator[Hub]:
    running = Hub()
    with running.session:
        yield running


class Listening:
    """A `wayside listen` process; what it says is read as it comes."""

    def __init__(self, *arguments: str) -> None:
        command = [sys.executable, "-m", "wayside", "listen", SITE_ID, *arguments]
        self.process = subprocess.Popen(
            command, env=environment(), cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, bufsize=1
        )
        self.out, self.err = (self._lines(pipe) for pipe in (self.process.stdout, self.process.stderr))

    @staticmethod
    def _lines(pipe: Any) -> "queue.Queue[str]":
        lines: queue.Queue[str] = queue.Queue()

        def read() -> None:
            with pipe:
                for line in pipe:
                    lines.put(line.rstrip("\n"))

        threading.Thread(target=read, daemon=True).start()
        return lines

    def message(self, wanted: Callable[[dict[str, Any]], bool] = lambda _: True) -> dict[str, Any]:
        """The next message that is wanted."""
        while True:
            found: dict[str, Any] = json.loads(self.out.get(timeout=PATIENCE_S))
            if wanted(found):
                return found

    def notice(self, part: str) -> str:
        while part not in (line := self.err.get(timeout=PATIENCE_S)):
            pass
        return line


@contextmanager
def started(*arguments: str) -> Iterator[Listening]:
    running = Listening(*arguments)
    try:
        yield running
    finally:
        running.process.kill()
        running.process.wait()


def listening(hub: Hub, key: Path, *arguments: str) -> AbstractContextManager[Listening]:
    return started("--keys", str(key.parent / "trusted.toml"), "--connect", hub.endpoint, *arguments)


@contextmanager
def scene(hub: Hub, key: Path) -> Iterator[tuple[Station, Listening]]:
    """A station whose first health is verified and fresh at a listener that came after it."""
    with station(key, [], [hub.endpoint]) as running:
        running.health(1)
        with listening(hub, key, "--json") as listener:
            first = listener.message()
            assert (first["sequence"], first["fresh"]) == (1, True)
            yield running, listener


def test_a_message_is_told_with_everything_that_a_machine_needs(hub: Hub, key: Path) -> None:
    with scene(hub, key) as (running, listener):
        running.health(
            2, state=pb.SATELLITE_ANOMALY, cause=pb.SATELLITE, subjects=["G07"], reasons=["residual"], excluded_satellites=["G07"]
        )
        told = listener.message()
    assert 0 < told.pop("age_ms") < 1000
    assert told == {
        "verified": True,
        "fresh": True,
        "refusal": "",
        "staleness": "",
        "caution": "",
        "sequence": 2,
        "missed": 0,
        "state": "SATELLITE_ANOMALY",
        "cause": "satellite",
        "subjects": ["G07"],
        "reasons": ["residual"],
        "gps_time_ns": 1_456_000_002_000_000_000,
        "utc": "2026-02-24T20:26:24Z",
        "excluded": ["G07"],
        "monitored": ["G05.1C"],
        "not_monitored": [],
        "valid_for_ms": 3000,
        "boot_id": running.boot_id.hex(),
        "config_sha256": "",
        "software": "",
    }


def test_forged_and_replayed_messages_are_told_as_refused_and_why(hub: Hub, key: Path) -> None:
    with scene(hub, key) as (running, listener):
        running.health(2)
        running.health(3)
        assert [listener.message()["sequence"] for _ in range(2)] == [2, 3]
        genuine = [hub.heard.get(timeout=PATIENCE_S) for _ in range(3)]
        stranger = signing_key(Ed25519PrivateKey.generate())
        trusted_name = pb.SignedHealth.FromString(genuine[2]).key_id
        forged = sign_health(stranger, PLACE, pb.Health(site=SITE_ID, boot_id=running.boot_id, sequence=4, state=pb.NORMAL))
        hub.put(forged.SerializeToString())
        hub.put(pb.SignedHealth(health=forged.health, key_id=trusted_name, signature=forged.signature).SerializeToString())
        hub.put(genuine[2][:-1] + bytes([genuine[2][-1] ^ 1]))
        hub.put(genuine[1])
        hub.put(genuine[2])
        hub.put(b"noise")
        told = [listener.message() for _ in range(6)]
        running.health(4)  # only now: two publishers have no order between them
        told.append(listener.message())
    assert [(t["verified"], t["state"], t["refusal"].split(":")[0]) for t in told] == [
        (False, None, "unknown key"),
        (False, None, "wrong signature"),
        (False, None, "wrong signature"),
        (False, None, "older"),
        (False, None, "repeated"),
        (False, None, "unreadable"),
        (True, "NORMAL", ""),
    ]


def test_after_a_restart_the_new_boot_counts_and_the_old_one_is_a_replay(hub: Hub, key: Path) -> None:
    with scene(hub, key) as (running, listener):
        old = hub.heard.get(timeout=PATIENCE_S)
        running.end()
        with station(key, [], [hub.endpoint]) as restarted:
            restarted.health(1)
            told = listener.message(lambda m: m["verified"])
            hub.put(old)
            replayed = listener.message(lambda m: not m["verified"])
    assert (told["sequence"], told["fresh"], told["boot_id"]) == (1, True, restarted.boot_id.hex())
    assert replayed["refusal"].startswith(f"older boot: sequence 1 of boot {running.boot_id.hex()}")


def test_what_was_held_back_on_the_way_is_verified_and_not_fresh(hub: Hub, key: Path) -> None:
    with scene(hub, key) as (running, listener):
        running.health(2, age_ns=3_000_000_000)
        told = listener.message()
    assert (told["verified"], told["fresh"], told["staleness"].split(":")[0]) == (True, False, "expired")


def test_a_station_that_is_killed_is_gone_at_once_and_then_there_are_no_comms_once(hub: Hub, key: Path) -> None:
    with scene(hub, key) as (running, listener):
        running.health(2, valid_for_ms=500)
        listener.message()
        killed = time.monotonic()
        running.process.kill()
        listener.notice(f"{SITE_ID} is gone")
        listener.notice("NO_COMMS")
        took_s = time.monotonic() - killed
        time.sleep(0.7)  # longer than the message was valid
        listener.process.terminate()
        listener.process.wait(PATIENCE_S)
        later = [listener.err.get() for _ in range(listener.err.qsize())]
    assert took_s <= 1.0
    assert [line for line in later if "NO_COMMS" in line] == []


def test_it_waits_for_a_station_that_is_not_there_yet(key: Path) -> None:
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    with started("--keys", str(key.parent / "trusted.toml"), "--connect", endpoint, "--json") as listener:
        listener.notice(f"NO_COMMS: nobody is at {endpoint}")
        with station(key, [endpoint], []) as running:
            listener.notice(f"{SITE_ID} answers as boot")
            running.health(1)
            told = listener.message()
    assert (told["sequence"], told["fresh"]) == (1, True)


@pytest.mark.parametrize("number, code", [(signal.SIGINT, 130), (signal.SIGTERM, 0)], ids=["interrupt", "terminate"])
def test_it_ends_when_told_to(hub: Hub, key: Path, number: signal.Signals, code: int) -> None:
    with listening(hub, key) as listener:
        listener.notice("listening for kokubunji-1")
        listener.process.send_signal(number)
        assert listener.process.wait(PATIENCE_S) == code


def test_it_ends_after_so_many_messages(hub: Hub, key: Path) -> None:
    with station(key, [], [hub.endpoint]) as running, listening(hub, key, "--count", "1") as listener:
        running.health(1)
        code = listener.process.wait(PATIENCE_S)
        lines = [listener.out.get(timeout=PATIENCE_S) for _ in range(3)]
    assert (code, f"{SITE_ID} is there" in lines[:2], lines[2][:56]) == (  # presence and the first answer have no order between them
        0,
        True,
        "2026-02-24T20:26:23Z  NORMAL             sequence 1  age",
    )


def test_it_can_be_reached_by_nobody(hub: Hub, key: Path) -> None:
    with listening(hub, key) as listener:
        listener.notice("listening for kokubunji-1")
        sockets = psutil.Process(listener.process.pid).net_connections()
    assert [s.laddr for s in sockets if s.status == psutil.CONN_LISTEN or (s.type.name == "SOCK_DGRAM" and s.laddr)] == []


@pytest.mark.parametrize(
    "arguments, code, why",
    [
        (["--keys", "no.toml"], 2, "no.toml: cannot be read"),
        (["--keys", "{other}"], 2, "no key is trusted for site kokubunji-1"),
        (["--keys", "{keys}", "--connect", "tcp/127.0.0.1"], 5, "expected PROTOCOL/HOST:PORT"),
    ],
    ids=["no keys", "other keys", "endpoint"],
)
def test_it_refuses_with_a_reason(key: Path, tmp_path: Path, arguments: list[str], code: int, why: str) -> None:
    other = tmp_path / "other.toml"
    other.write_text((key.parent / "trusted.toml").read_text().replace(SITE_ID, "elsewhere"))
    places = {"other": str(other), "keys": str(key.parent / "trusted.toml")}
    command = [sys.executable, "-m", "wayside", "listen", SITE_ID, *(argument.format(**places) for argument in arguments)]
    done = subprocess.run(command, env=environment(), cwd=ROOT, capture_output=True, text=True, timeout=60, check=False)
    assert (done.returncode, why in done.stderr, done.stdout) == (code, True, "")
