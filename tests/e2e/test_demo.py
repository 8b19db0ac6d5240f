"""`wayside demo` from beginning to end: real processes, real Zenoh, real time. The whole story is `python -m tests.benchmarks.demo`."""

import contextlib
import fcntl
import json
import os
import signal
import struct
import subprocess
import sys
import termios
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import psutil
import pytest

from tests.e2e.commands import ROOT, environment
from tests.e2e.field import until

PATIENCE_S = 90.0


@contextmanager
def demo(folder: Path, *arguments: str) -> Iterator[subprocess.Popen[str]]:
    """The command; everything it makes lies in `folder`. What is left of it is killed at the end."""
    with (folder / "out").open("w") as out, (folder / "err").open("w") as err:
        process = subprocess.Popen(
            [sys.executable, "-m", "wayside", "demo", *arguments],
            stdout=out,
            stderr=err,
            cwd=ROOT,
            env=environment(TMPDIR=str(folder)),
            text=True,
        )
        try:
            yield process
        finally:
            process.kill()
            process.wait()
            for left in processes(folder):
                left.kill()


def processes(folder: Path) -> list[psutil.Process]:
    """Station and train of a demo: they run in its folder."""
    found = []
    for process in psutil.process_iter():
        try:
            if folder in Path(process.cwd()).parents:
                found.append(process)
        except psutil.Error:
            continue
    return found


def said(folder: Path, words: str) -> bool:
    return words in (folder / "out").read_text() + (folder / "err").read_text()


def rows(folder: Path) -> dict[str, dict[str, Any]]:
    told = json.loads((folder / "out").read_text())
    return {row["name"]: row for row in told["rows"]}


def test_twenty_seconds_of_it_are_as_expected(tmp_path: Path) -> None:
    with demo(tmp_path, "--seconds", "20", "--no-page") as process:
        code = process.wait(PATIENCE_S)
        left = processes(tmp_path)
    out = (tmp_path / "out").read_text()
    assert (code, (tmp_path / "err").read_text(), left) == (0, "", []), out
    first, second = out.splitlines()[:2]
    assert Path(first.split()[-1], "site.toml").is_file()
    assert "Zenoh listens at tcp/127.0.0.1:" in second
    assert "a receiver is faulty (B); B is 15." in out
    assert "All 5 rows as expected." in out


def test_one_kind_alone_as_one_json_object(tmp_path: Path) -> None:
    """The kind that needs most of the machine around it: the thread that decides stands, and the rest of the station answers."""
    with demo(tmp_path, "--fault", "frozen_decisions", "--json") as process:
        assert process.wait(PATIENCE_S) == 0, (tmp_path / "out").read_text()
    told = json.loads((tmp_path / "out").read_text())
    assert [row["name"] for row in told["rows"]] == [
        "start-up",
        "decisions frozen",
        "positions",
        "station's recording",
        "train's recording",
    ]
    assert all(Path(path).is_file() for paths in told["recordings"].values() for path in paths)


def test_what_is_not_as_expected_is_named_and_fails(tmp_path: Path) -> None:
    """A station that is stopped in a fault says nothing of it: the train goes on until the last message has run out."""
    with demo(tmp_path, "--fault", "jamming", "--json") as process:
        assert until(lambda: said(tmp_path, "train    NORMAL"), PATIENCE_S)
        (station,) = [p for p in processes(tmp_path) if "station" in p.cmdline()]
        time.sleep(7.5)  # until shortly before the fault, 12 s after the first epoch
        station.suspend()
        assert until(lambda: said(tmp_path, "train    STALE"), PATIENCE_S)
        station.resume()
        code = process.wait(PATIENCE_S)
    assert code == 1
    assert [name for name, row in rows(tmp_path).items() if not row["as_expected"]] == ["jamming"]


def test_a_process_that_dies_is_told_with_its_last_words(tmp_path: Path) -> None:
    with demo(tmp_path, "--seconds", "20") as process:
        assert until(lambda: said(tmp_path, "station  NORMAL"), PATIENCE_S)
        (train,) = [p for p in processes(tmp_path) if "train" in p.cmdline()]
        train.kill()
        code = process.wait(PATIENCE_S)
        left = processes(tmp_path)
    err = (tmp_path / "err").read_text()
    assert (code, left) == (1, [])
    assert "the train's process has ended with -9; its last words:\n" in err
    assert "connected to tcp/127.0.0.1:" in err


@pytest.mark.parametrize("moment", ["Zenoh listens", "train    NORMAL", "the thread that decides stands", "decided again"])
def test_an_interrupt_ends_everything_calmly(tmp_path: Path, moment: str) -> None:
    with demo(tmp_path, "--fault", "frozen_decisions", "--seconds", "15") as process:
        assert until(lambda: said(tmp_path, moment), PATIENCE_S)
        process.send_signal(signal.SIGINT)
        code = process.wait(PATIENCE_S)
        left = processes(tmp_path)
    assert (code, left) == (130, [])
    assert not said(tmp_path, "Traceback")


@pytest.mark.parametrize("no_color", ["", "1"])
def test_on_a_terminal_the_triangle_and_the_train_are_seen_live(tmp_path: Path, no_color: str) -> None:
    shown = b""
    try:
        ours, theirs = os.openpty()
    except OSError as error:
        pytest.skip(f"no pseudo-terminals on this machine: {error}")
    fcntl.ioctl(theirs, termios.TIOCSWINSZ, struct.pack("HHHH", 40, 120, 0, 0))
    command = [sys.executable, "-m", "wayside", "demo", "--seconds", "5"]
    more = {"TMPDIR": str(tmp_path)} | ({"NO_COLOR": no_color} if no_color else {})
    with subprocess.Popen(command, stdin=theirs, stdout=theirs, stderr=theirs, cwd=ROOT, env=environment(**more)) as process:
        os.close(theirs)
        with contextlib.suppress(OSError):  # EIO: nobody has the other end any more
            while data := os.read(ours, 1 << 16):
                shown += data
    os.close(ours)
    assert (process.returncode, processes(tmp_path)) == (0, [])
    assert b"west |" in shown
    assert shown.rfind(b"\x1b[?25h") > shown.rfind(b"\x1b[?25l") > -1, "the cursor is not shown again"
    assert (b"\x1b[1;32m" in shown) is not bool(no_color)


def test_an_unknown_kind_is_a_mistake_in_usage(tmp_path: Path) -> None:
    with demo(tmp_path, "--fault", "earthquake") as process:
        assert process.wait(PATIENCE_S) == 2
    assert said(tmp_path, "--fault earthquake: expected one of receiver_bias, satellite_step, spoofing")
