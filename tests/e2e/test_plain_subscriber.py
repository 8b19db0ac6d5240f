"""A subscriber that has nothing of ours but one generated file, as a process of its own against a real station and a forger."""

import ast
import os
import queue
import shutil
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
import zenoh
from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey

from integrity.messages import wayside_pb2 as pb
from integrity.messages.key_expressions import HEALTH, site_key
from integrity.messages.signatures import sign_health, signing_key
from recordings.keys import load_key
from tests.e2e.test_listen import Hub, hub
from tests.e2e.test_publisher import PATIENCE_S, SITE_ID, Station, key, station

__all__ = ["hub", "key"]  # fixtures
SUBSCRIBER = Path(__file__).with_name("plain_subscriber.py")
VALID_MS = 1000


class Plain:
    """The subscriber; what it prints is read as it comes."""

    def __init__(self, folder: Path, endpoint: str, public: bytes) -> None:
        shutil.copy(SUBSCRIBER, folder)
        shutil.copy(pb.__file__, folder)
        environment = {"ENDPOINT": endpoint, "SITE": SITE_ID, "KEY": public.hex()}
        self.process = subprocess.Popen(
            [sys.executable, SUBSCRIBER.name],
            cwd=folder,
            env={name: value for name, value in os.environ.items() if name != "PYTHONPATH"} | environment,
            stdout=subprocess.PIPE,
            text=True,
        )
        self._lines: queue.Queue[str] = queue.Queue()
        threading.Thread(target=self._read, daemon=True).start()

    def _read(self) -> None:
        assert self.process.stdout
        with self.process.stdout:
            for line in self.process.stdout:
                self._lines.put(line.rstrip("\n"))

    def line(self, *beginnings: str) -> str:
        """The next one that begins so."""
        while not (found := self._lines.get(timeout=PATIENCE_S)).startswith(beginnings):
            pass
        return found


@contextmanager
def scene(hub: Hub, key: Path, folder: Path) -> Iterator[tuple[Station, Plain]]:
    """A station that has said NORMAL to a subscriber whose challenge it had answered."""
    with station(key, [], [hub.endpoint]) as running:
        plain = Plain(folder, hub.endpoint, load_key(key).public)
        try:
            plain.line(f"boot {running.boot_id.hex()} answers")
            running.health(1, valid_for_ms=VALID_MS)
            assert plain.line("GNSS", "no GNSS", "refused").startswith("GNSS: state 1, sequence 1, age ")
            yield running, plain
        finally:
            plain.process.kill()
            plain.process.wait()


def test_forged_and_repeated_messages_are_refused(hub: Hub, key: Path, tmp_path: Path) -> None:
    with scene(hub, key, tmp_path) as (running, plain):
        genuine = hub.heard.get(timeout=PATIENCE_S)
        stranger = signing_key(Ed25519PrivateKey.generate())
        hub.put(
            sign_health(
                stranger, site_key(SITE_ID, HEALTH), pb.Health(site=SITE_ID, boot_id=running.boot_id, sequence=2)
            ).SerializeToString()
        )
        hub.put(genuine)
        hub.put(b"noise")
        refused = [plain.line("GNSS", "no GNSS", "refused").partition("(")[0] for _ in range(3)]
    assert refused == ["refused: InvalidSignature", "refused: ValueError", "refused: DecodeError"]


def test_an_anomaly_ends_trust_at_once(hub: Hub, key: Path, tmp_path: Path) -> None:
    with scene(hub, key, tmp_path) as (running, plain):
        running.health(2, state=pb.SATELLITE_ANOMALY, cause=pb.SATELLITE)
        told = plain.line("GNSS", "no GNSS", "refused")
    assert told.startswith("no GNSS: state 2, sequence 2")


def test_trust_ends_in_time_when_the_station_is_killed(hub: Hub, key: Path, tmp_path: Path) -> None:
    with scene(hub, key, tmp_path) as (running, plain):
        running.health(2, valid_for_ms=VALID_MS)
        plain.line("GNSS: state 1, sequence 2")
        issued_s = time.monotonic()
        running.process.kill()
        plain.line("no GNSS: nothing fresh")
        took_s = time.monotonic() - issued_s
    assert 0.5 <= took_s <= VALID_MS / 1000 + 0.1


def test_it_needs_nothing_of_ours_but_the_generated_file() -> None:
    tree = ast.parse(SUBSCRIBER.read_text("utf-8"))
    names = [a.name for node in ast.walk(tree) if isinstance(node, ast.Import) for a in node.names]
    names += [node.module or "" for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)]
    others = {name.partition(".")[0] for name in names} - set(sys.stdlib_module_names)
    assert others == {"cryptography", "wayside_pb2", "zenoh"}


def test_it_is_under_sixty_lines() -> None:
    assert len(SUBSCRIBER.read_text("utf-8").splitlines()) < 60


@pytest.mark.parametrize("what, schema", [("health", "SignedHealth"), ("epoch", "EpochReport"), ("alert", "Alert")])
def test_what_is_put_names_its_schema(hub: Hub, key: Path, what: str, schema: str) -> None:
    samples: queue.Queue[zenoh.Sample] = queue.Queue()
    hub.session.declare_subscriber(site_key(SITE_ID, what), samples.put)
    with station(key, [], [hub.endpoint]) as running:
        running.publish(what, **({"sequence": 1} if what == HEALTH else {}))
        sample = samples.get(timeout=PATIENCE_S)
    assert str(sample.encoding) == f"application/protobuf;wayside.v1.{schema}"


@pytest.mark.parametrize("what, schema", [("health", "SignedHealth"), ("challenge", "SignedChallengeReply"), ("info", "SiteInfo")])
def test_what_is_answered_names_its_schema(hub: Hub, key: Path, what: str, schema: str) -> None:
    with station(key, [], [hub.endpoint]) as running:
        running.health(1)
        hub.heard.get(timeout=PATIENCE_S)
        replies: list[Any] = list(hub.session.get(site_key(SITE_ID, what), payload=bytes(16), timeout=PATIENCE_S))
    assert [str(reply.ok.encoding) for reply in replies] == [f"application/protobuf;wayside.v1.{schema}"]
