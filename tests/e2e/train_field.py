"""A train beside a station, on loopback: simulated receivers of both on TCP, the train client as a process of its own."""

import json
import os
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

from integrity.events import Event, RawBytes
from recordings.simulate.observations import antennas_of, observed
from recordings.simulate.receiver import as_bytes
from recordings.simulate.server import ReceiverServer
from tests.e2e.field import REPOSITORY, SITE_ID, START_NS, Field
from train_client.simulate.line import sample_line
from train_client.simulate.motion import antennas_on, sample_run
from train_client.simulate.story import TRAIN_ERRORS
from train_client.track.track_map import format_map, parse_map
from train_client.train_file import load_train

SAMPLES = REPOSITORY / "recordings" / "samples"
ANTENNAS = ("front", "rear")
RECOVER_MESSAGES = 10


def make_train(place: Field, sources: dict[str, str], interval_s: float = 0.1, more: str = "") -> Path:
    """A train file beside the station's: the sample train on the sample line, told to trust that station."""
    text = (SAMPLES / "train.toml").read_text()
    for name, url in (("20011", sources["front"]), ("20012", sources["rear"])):
        text = text.replace(f"tcp://127.0.0.1:{name}", url)
    text = text.replace("epoch_interval_s = 1.0", f"epoch_interval_s = {interval_s}").replace('"sample"', f'"{SITE_ID}"')
    text = text.replace("tcp/127.0.0.1:7447", place.endpoint)
    (place.folder / "line.json").write_text(line_of(SITE_ID))
    file = place.folder / "train.toml"
    file.write_text(text + more)
    load_train(file)
    return file


def line_of(*sites: str) -> str:
    """The sample line, all of which these vouch for."""
    track = parse_map((SAMPLES / "line.json").read_text(), "line.json")
    return format_map(replace(track, sections=tuple(replace(section, station=site) for site in sites for section in track.sections)))


@cache
def both_measured(site_file: Path, seconds: float, interval_s: float = 0.1, seed: int = 1, start_ns: int = START_NS) -> tuple[Event, ...]:
    """What the receivers of station and train send, in order of time."""
    from recordings.site_file import load_site

    site = load_site(site_file).config
    run = sample_run(sample_line(), start_ns)
    train = antennas_on(run, load_train(SAMPLES / "train.toml").config.antennas)
    ground = as_bytes(observed(antennas_of(site), start_ns, seconds, 1.0 / interval_s, seed), antennas_of(site))
    board = as_bytes(observed(train, start_ns, seconds, 1.0 / interval_s, seed, TRAIN_ERRORS), train)
    return tuple(sorted((e for e in (*ground, *board) if isinstance(e, RawBytes)), key=lambda e: e.mono_ns))


@dataclass
class RunningTrain:
    """The process, and the positions that it has told so far, each with when it came."""

    process: subprocess.Popen[str]
    positions: list[dict[str, Any]]

    def until(self, condition: Any, within_s: float) -> dict[str, Any]:
        """The first position from now on for which the condition holds; AssertionError if none comes in time."""
        k = len(self.positions)
        deadline_s = time.monotonic() + within_s
        while time.monotonic() < deadline_s:
            while k < len(self.positions):
                if condition(self.positions[k]):
                    return self.positions[k]
                k += 1
            time.sleep(0.01)
        raise AssertionError(f"nothing of the kind within {within_s} s; last: {self.positions[-1:]}")


@contextmanager
def running_train(train_file: Path) -> Iterator[RunningTrain]:
    """See `train_process`."""
    positions: list[dict[str, Any]] = []
    with train_process(train_file, positions.append) as process:
        yield RunningTrain(process, positions)


@contextmanager
def train_process(train_file: Path, take: Callable[[dict[str, Any]], None]) -> Iterator[subprocess.Popen[str]]:
    """`wayside train run --json`, whose positions are handed on as they come; its talk goes to `train.log` beside the file.

    Killed at the end if it still runs.
    """
    with (train_file.parent / "train.log").open("a") as log:
        process = subprocess.Popen(
            [sys.executable, "-m", "wayside", "train", "run", str(train_file), "--json"],
            stdout=subprocess.PIPE,
            stderr=log,
            cwd=REPOSITORY,
            env=os.environ | {"OPENBLAS_NUM_THREADS": "1"},
            text=True,
        )

        def read() -> None:
            assert process.stdout is not None
            with process.stdout as lines:
                for line in lines:
                    take(json.loads(line))

        reader = threading.Thread(target=read, daemon=True)
        reader.start()
        try:
            yield process
        finally:
            if process.poll() is None:
                process.kill()
            process.wait()
            reader.join(2.0)


def urls(server: ReceiverServer) -> dict[str, str]:
    """Where the receivers of a server are to be had."""
    return {name: f"tcp://{host}:{port}" for name, (host, port) in server.addresses.items()}
