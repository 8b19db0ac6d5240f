"""The stage: a folder with everything that a station and a train need, their two processes, and what the demo does to them.

For the station the demo plays the service manager that `sd_notify` speaks to: it reads the socket. To freeze the thread that decides, it
stops reading and fills the socket's queue from its own side; the next word of that thread, which it says each second, then waits for
room, while Zenoh's threads go on answering. To end that it reads again. Source: unix(7), sd_notify(3).
"""

import os
import random
import signal
import socket
import subprocess
import sys
import threading
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path
from typing import IO

from integrity.errors import WaysideError
from recordings.keys import new_key, trusted_table
from recordings.toml_file import format_toml

SITE, MAP, KEYS, TRAIN = "site.toml", "line.json", "keys/trusted.toml", "train.toml"
START = "import wayside; wayside.main()"  # from a checkout and installed alike
SETTINGS = ("site.epoch_interval_s=0.1", "integrity.recover_after_s=3.0", 'integrity.on_satellite_fault="exclude"')  # as in the story
PORTS = range(20_000, 32_000)  # below those from which the system takes ports for outgoing calls
STOP_WITHIN_S = 5.0
END_OF_LOG_LINES = 8
READ_FOR_S = 0.1


class DemoFailed(WaysideError):
    """The demo cannot go on; says why, with the end of the log of the process that ended."""


@dataclass(frozen=True)
class Folder:
    """Where everything lies: site, train, map, keys, logs and recordings."""

    path: Path
    site_id: str
    endpoint: str
    directories: tuple[str, str]  # recordings of the station, and of the train

    def at(self, name: str) -> Path:
        """A file in it."""
        return self.path / name

    def recordings(self, directory: str) -> list[Path]:
        """Whole ones and those that were cut, in the order of their beginning."""
        return sorted(path for path in self.at(directory).glob("*") if path.suffix in (".mcap", ".part"))


def make_folder(path: Path, settings: Sequence[str], addresses: Mapping[str, tuple[str, int]]) -> Folder:
    """Sample site and train with the receivers at `addresses`, and a key; `settings` (`section.key=VALUE`) are laid over the site."""
    samples = files("recordings") / "samples"
    site, train = (tomllib.loads((samples / name).read_text("utf-8")) for name in (SITE, TRAIN))
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    sources = {name: f"tcp://{host}:{port}" for name, (host, port) in addresses.items()}
    for section, values in tomllib.loads("\n".join(settings)).items():
        site[section] |= values
    for name, receiver in site["receivers"].items():
        receiver["source"] = sources[name]
    site["publish"]["listen"] = train["publish"]["connect"] = [endpoint]
    for antenna in train["antenna"]:
        antenna["source"] = sources[antenna["id"]]
    train["train"]["epoch_interval_s"] = site["site"]["epoch_interval_s"]

    site_id = site["site"]["id"]
    key = new_key(path / site["publish"]["key"])
    (path / KEYS).write_text(trusted_table(site_id, key.public))
    (path / SITE).write_text(format_toml(site))
    (path / TRAIN).write_text(format_toml(train))
    (path / MAP).write_text((samples / MAP).read_text("utf-8"))
    return Folder(path, site_id, endpoint, (site["record"]["directory"], train["record"]["directory"]))


def free_port() -> int:
    """A port of this machine that nobody listens at."""
    for port in random.sample(PORTS, 100):
        with suppress(OSError), socket.create_server(("127.0.0.1", port)):
            return port
    raise DemoFailed(f"no free port of 127.0.0.1 from {PORTS.start} to {PORTS.stop} in 100 tries")


class Stage:
    """The processes. `with` ends them, whatever happens."""

    def __init__(self, folder: Folder) -> None:
        self._folder = folder
        self._manager = _ServiceManager(folder.at("notify"))
        self._processes: list[subprocess.Popen[bytes]] = []
        try:
            with _held_back():  # between the birth of a process and our knowing it
                self.station = self._process("station", ["station", "run", SITE], {"NOTIFY_SOCKET": self._manager.address})
                self.train = self._process("train", ["train", "run", TRAIN, "--json"], {})
        except BaseException:
            self.close()
            raise

    def __enter__(self) -> "Stage":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    @property
    def station_ready(self) -> bool:
        """Whether the station has said so."""
        return self._manager.ready.is_set()

    @property
    def positions(self) -> IO[bytes]:
        """What the train client says, a JSON object a line."""
        assert self.train.stdout is not None
        return self.train.stdout

    def check(self) -> None:
        """DemoFailed where a process has ended that should run."""
        for name, process in (("station", self.station), ("train", self.train)):
            code = process.poll()
            if code is not None and not (name == "station" and code == -signal.SIGKILL):
                lines = self._folder.at(f"{name}.log").read_text(errors="replace").splitlines()[-END_OF_LOG_LINES:]
                raise DemoFailed(f"the {name}'s process has ended with {code}; its last words:\n  " + "\n  ".join(lines or ["none"]))

    def freeze_decisions(self) -> None:
        """From its next word on, at most a second from now, the station's deciding thread stands."""
        self._manager.stop_reading()

    def thaw_decisions(self) -> None:
        """It goes on."""
        self._manager.read()

    def kill_station(self) -> None:
        """SIGKILL: it cannot say a word."""
        self.station.kill()
        self.station.wait()

    def stop(self) -> None:
        """End both as a service manager would, and wait; killed where they do not end."""
        self.thaw_decisions()
        for process in self._processes:
            process.terminate()
        for process in self._processes:
            try:
                process.wait(STOP_WITHIN_S)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()

    def close(self) -> None:
        """The same, and nothing is left but the folder. Not to be interrupted once more."""
        with _held_back():
            self.stop()
            self._manager.close()

    def _process(self, name: str, arguments: list[str], more: Mapping[str, str]) -> subprocess.Popen[bytes]:
        root = str(Path(__file__).parents[2])
        environment = {k: v for k, v in os.environ.items() if k != "NOTIFY_SOCKET"}
        environment |= {"OPENBLAS_NUM_THREADS": "1", "PYTHONPATH": os.pathsep.join(filter(None, [root, os.environ.get("PYTHONPATH")]))}
        with self._folder.at(f"{name}.log").open("wb") as log:
            process = subprocess.Popen(
                [sys.executable, "-c", START, *arguments],
                stdin=subprocess.DEVNULL,
                stdout=subprocess.PIPE if name == "train" else log,
                stderr=log,
                cwd=self._folder.path,
                env=environment | dict(more),
                process_group=0,  # Ctrl-C is for the demo, which ends them in its own order
            )
        self._processes.append(process)
        return process


class _ServiceManager:
    """The socket that the station speaks to, and a thread that reads it except while it shall not."""

    def __init__(self, path: Path) -> None:
        self.ready = threading.Event()
        self.address = str(path)
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        self._socket.bind(self.address)
        self._socket.settimeout(READ_FOR_S)
        self._shall_read = threading.Event()
        self._shall_read.set()
        self._reading = threading.Lock()
        self._ended = False
        self._thread = threading.Thread(target=self._run, name="service manager", daemon=True)
        self._thread.start()

    def stop_reading(self) -> None:
        """No reading from now on, and no room for another word."""
        self._shall_read.clear()
        with self._reading:  # what was being read is
            while self._stuff():
                pass

    def read(self) -> None:
        """Read again, if it was stopped."""
        self._shall_read.set()

    def close(self) -> None:
        """Nobody is there any more."""
        self._ended = True
        self.read()
        self._thread.join()
        self._socket.close()

    def _stuff(self) -> bool:
        """Send until nothing more is taken; False where not even the first word was: then it is the reader's queue that is full."""
        taken = 0
        with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as sender:
            sender.setblocking(False)
            with suppress(BlockingIOError):
                while True:
                    sender.sendto(b"STATUS=", self.address)
                    taken += 1
        return taken > 0

    def _run(self) -> None:
        while not self._ended:
            self._shall_read.wait()
            with self._reading, suppress(TimeoutError):
                if self._shall_read.is_set() and b"READY=1" in self._socket.recv(4096).split(b"\n"):
                    self.ready.set()


@contextmanager
def _held_back() -> Iterator[None]:
    """SIGINT and SIGTERM wait until the block is over."""
    came: list[int] = []
    before = {number: signal.signal(number, lambda received, _: came.append(received)) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
    if came:
        signal.raise_signal(came[0])
