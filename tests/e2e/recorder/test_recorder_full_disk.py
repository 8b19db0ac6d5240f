"""A disk that is full is said, counted and survived, and who decides never waits.

The recorder runs in a process of its own, which may write a file of 100 kB and no larger.
"""

import subprocess
import sys
from pathlib import Path

import pytest

from recordings.reader import read_recording, salvage
from recordings.replay import complaints
from tests.e2e.recorder.recorded import numbers

FULL = """
import random, resource, signal, sys, time
from pathlib import Path
from integrity.events import RawBytes
from recordings import recorder as module
from station.recording import manner_of
from tests.e2e.recorder.recorded import BOOT_ID, GPS_NS, SITE, SNAPSHOT

module.RETRY_AFTER_S = 0.2
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
_, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
resource.setrlimit(resource.RLIMIT_FSIZE, (100_000, hard))
recorder = module.Recorder(Path(sys.argv[1]), manner_of(SITE, BOOT_ID), lambda line: print("said", line, flush=True))
chance, slowest, began = random.Random(3), 0.0, time.monotonic()
for number in range(400):
    if number == 240:
        resource.setrlimit(resource.RLIMIT_FSIZE, (hard, hard))
    now_ns = time.monotonic_ns()
    if recorder.wants_file(now_ns):
        recorder.begin(SNAPSHOT, now_ns, GPS_NS)
    event = RawBytes(now_ns, "A", number.to_bytes(8, "big") + chance.randbytes(3000))
    before = time.monotonic()
    recorder.event(event)
    slowest = max(slowest, time.monotonic() - before)
    time.sleep(0.01)
recorder.close()
print("lost", recorder.lost)
print("slowest", slowest)
"""


@pytest.fixture(scope="module")
def full(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, list[str]]:
    directory = tmp_path_factory.mktemp("full")
    done = subprocess.run([sys.executable, "-c", FULL, str(directory)], capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 0, done.stderr
    return directory, done.stdout.splitlines()


def test_a_full_disk_is_said_once_with_what_to_do_and_so_is_that_it_goes_on(full: tuple[Path, list[str]]) -> None:
    said = [line for line in full[1] if line.startswith("said")]
    assert len(said) == 2
    assert "File too large): make room on the disk; recording stops, decisions go on" in said[0]
    assert ".mcap: recording again; " in said[1]


def test_what_a_full_disk_cost_is_counted_and_the_rest_is_in_files(full: tuple[Path, list[str]]) -> None:
    directory, printed = full
    kept = [number for path in directory.iterdir() for number in numbers(salvage(path))]
    assert len(set(kept)) == len(kept)
    assert printed[-2] == f"lost {400 - len(kept)}"


def test_the_file_after_a_full_disk_is_whole_and_decidable_alone(full: tuple[Path, list[str]]) -> None:
    (whole,) = full[0].glob("*.mcap")
    contents = read_recording(whole)
    assert complaints(contents) == []
    assert numbers(contents) == list(range(numbers(contents)[0], 400))


def test_a_full_disk_keeps_nobody_waiting(full: tuple[Path, list[str]]) -> None:
    assert float(full[1][-1].removeprefix("slowest ")) < 0.1
