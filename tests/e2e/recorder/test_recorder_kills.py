"""A recorder that is killed costs the last second and a half at most, and leaves no hole."""

import random
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from recordings.reader import read_recording, salvage
from recordings.replay import complaints, recover
from tests.e2e.recorder.recorded import MOST_LOST_S, numbers

KILLS = 10
CHILD = """
import sys, time
from pathlib import Path
from integrity.events import RawBytes
from integrity.messages.wayside_pb2 import Snapshot
from recordings.site_file import parse_site
from recordings.recorder import Recorder
from station.recording import manner_of
from tests.unit.sites import SITE

recorder = Recorder(Path(sys.argv[1]), manner_of(parse_site(SITE, "site.toml"), bytes(16)), print)
recorder.begin(Snapshot(), time.monotonic_ns(), 1_456_459_190_000_000_000)
number = 0
while True:
    for _ in range(3):
        recorder.event(RawBytes(time.monotonic_ns(), "A", number.to_bytes(8, "big") + bytes(1000)))
        print(number, time.monotonic(), flush=True)
        number += 1
    time.sleep(0.1)
"""


def killed(directory: Path, after_s: float) -> list[tuple[int, float]]:
    """Numbers that a recording process had handed over when it was killed, and when; read until nothing comes any more."""
    with subprocess.Popen([sys.executable, "-c", CHILD, str(directory)], stdout=subprocess.PIPE, text=True) as child:
        assert child.stdout is not None
        first = child.stdout.readline()
        time.sleep(after_s)
        child.kill()
        lines = [first, *child.stdout.readlines()]
    return [(int(number), float(when)) for number, when in (line.split() for line in lines if line.endswith("\n"))]


@pytest.fixture(scope="module")
def kills(tmp_path_factory: pytest.TempPathFactory) -> list[tuple[Path, list[tuple[int, float]]]]:
    """At random moments, several processes at a time."""
    rng = random.Random(9)
    work = [(tmp_path_factory.mktemp("killed"), rng.uniform(1.5, 3.5)) for _ in range(KILLS)]
    with ThreadPoolExecutor(KILLS) as pool:
        handed_over = list(pool.map(lambda item: killed(*item), work))
    return [(next(directory.iterdir()), what) for (directory, _), what in zip(work, handed_over, strict=True)]


def test_after_a_kill_the_file_is_recovered_to_a_whole_one(kills: list[tuple[Path, list[tuple[int, float]]]], tmp_path: Path) -> None:
    for k, (part, _) in enumerate(kills):
        recover(part, tmp_path / f"{k}.mcap")
        assert complaints(read_recording(tmp_path / f"{k}.mcap")) == []


def test_a_kill_costs_the_last_second_and_a_half_at_most(kills: list[tuple[Path, list[tuple[int, float]]]]) -> None:
    for part, handed_over in kills:
        kept = set(numbers(salvage(part)))
        lost = [when for number, when in handed_over if number not in kept]
        assert not lost or handed_over[-1][1] - lost[0] <= MOST_LOST_S


def test_a_kill_leaves_no_hole(kills: list[tuple[Path, list[tuple[int, float]]]]) -> None:
    for part, _ in kills:
        kept = numbers(salvage(part))
        assert kept == list(range(len(kept)))
