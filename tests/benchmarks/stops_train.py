"""A train client as a process of its own, whose every word is stamped when it is read; and what it had to wait for to say it."""

import json
import os
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, NamedTuple

from tests.e2e.field import REPOSITORY

TRUSTED = "TRUST_NORMAL"
CLOCK = "import sys, time\nfor line in sys.stdin: print(time.monotonic_ns(), line, end='', flush=True)"


class Told(NamedTuple):
    """A position, and when it was read."""

    mono_ns: int
    position: dict[str, Any]


class Waits(NamedTuple):
    """How long some had been ready without a processor by `mono_ns`, ns; None where the system does not tell.

    `threads_ns`: the thread of the train that decides, all others of it together, and who reads what the train tells.
    """

    mono_ns: int
    threads_ns: tuple[int, int, int] | None


class TellingTrain:
    """`wayside train run --json`, and a process that reads and stamps it. `told` grows with each line."""

    def __init__(self, train: subprocess.Popen[bytes], reader: subprocess.Popen[bytes]) -> None:
        self.told: list[Told] = []
        self._train = train
        self._reader = reader
        self._collector = threading.Thread(target=self._collect, daemon=True)
        self._collector.start()

    def waits(self) -> Waits:
        """As of now. Second number of `schedstat`: Linux, Documentation/scheduler/sched-stats."""
        now_ns = time.monotonic_ns()
        try:
            decides_ns, reader_ns = _waited_ns(self._train.pid), _waited_ns(self._reader.pid)
            all_ns = sum(_waited_ns(int(task.name)) for task in Path(f"/proc/{self._train.pid}/task").iterdir())
        except OSError:  # no such system; or a thread of the train has just ended
            return Waits(now_ns, None)
        return Waits(now_ns, (decides_ns, all_ns - decides_ns, reader_ns))

    def end(self) -> None:
        """Both are gone, and all that was told has been read."""
        self._train.kill()
        self._train.wait()
        self._reader.wait()
        self._collector.join()

    def _collect(self) -> None:
        assert self._reader.stdout is not None
        for line in self._reader.stdout:
            mono_ns, _, position = line.partition(b" ")
            self.told.append(Told(int(mono_ns), json.loads(position)))


@contextmanager
def telling_train(train_file: Path, nice: int) -> Iterator[TellingTrain]:
    """As a service of its own, so niced; its talk goes to `train.log` beside the file. Killed at the end. Below 0 needs the right to it."""
    as_service = ["nice", "-n", str(nice), sys.executable]
    environment = os.environ | {"OPENBLAS_NUM_THREADS": "1"}
    with (
        (train_file.parent / "train.log").open("a") as log,
        subprocess.Popen(
            [*as_service, "-m", "wayside", "train", "run", str(train_file), "--json"],
            stdout=subprocess.PIPE,
            stderr=log,
            cwd=REPOSITORY,
            env=environment,
            start_new_session=True,
        ) as train,
        subprocess.Popen([*as_service, "-S", "-c", CLOCK], stdin=train.stdout, stdout=subprocess.PIPE, start_new_session=True) as reader,
    ):
        for process in (train, reader) if nice else ():
            with suppress(OSError):  # Linux may weigh sessions first (sched_autogroup_enabled), and only in them processes
                Path(f"/proc/{process.pid}/autogroup").write_text(str(nice))
        telling = TellingTrain(train, reader)
        try:
            yield telling
        finally:
            telling.end()


def is_trusted(told: Told) -> bool:
    """Whether GNSS may be used, by the train's word."""
    return bool(told.position.get("trust") == TRUSTED)


def _waited_ns(thread: int) -> int:
    return int(Path(f"/proc/{thread}/schedstat").read_text().split()[1])
