"""A station as in the field, on loopback: a folder with site file and keys, simulated receivers on TCP, the station as a process."""

import contextlib
import os
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import takewhile
from pathlib import Path

from integrity.events import Event
from integrity.gnss.gps_time import parse_utc
from recordings.keys import new_key, trusted_table
from recordings.simulate.observations import antennas_of, simulate
from recordings.simulate.rtcm import as_sent
from recordings.simulate.server import ReceiverServer, Sent
from recordings.site_file import SiteFile, load_site
from tests.unit.sites import A_ECEF_M, B_ECEF_M, C_ECEF_M

REPOSITORY = Path(__file__).resolve().parents[2]
START_NS = parse_utc("2026-03-02T03:10:00Z")
SITE_ID = "field"


def free_ports(count: int) -> list[int]:
    """Different ones: each is held until all are found."""
    with contextlib.ExitStack() as held:
        return [held.enter_context(socket.create_server(("127.0.0.1", 0))).getsockname()[1] for _ in range(count)]


def free_port() -> int:
    return free_ports(1)[0]


@dataclass(frozen=True)
class Field:
    """The folder of a station; `endpoint` is where it publishes."""

    folder: Path
    endpoint: str
    site: SiteFile

    @property
    def site_file(self) -> Path:
        return self.folder / "site.toml"

    @property
    def trusted(self) -> Path:
        return self.folder / "keys" / "trusted.toml"

    @property
    def records(self) -> Path:
        return self.folder / "recordings"

    def recordings(self) -> list[Path]:
        """Complete recordings and those that were cut, in the order of their beginning."""
        return sorted(path for path in self.records.iterdir() if path.suffix in (".mcap", ".part"))


def make_field(
    folder: Path,
    sources: Mapping[str, str],
    interval_s: float = 1.0,
    recover_after_s: float = 3.0,
    more: str = "",
    of_receivers: str = "",
    site_id: str = SITE_ID,
) -> Field:
    """A site of three antennas 120 m apart; `more` is TOML at the end of `[integrity]`, and after it, `of_receivers` of each receiver."""
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    key = folder / "keys" / f"{site_id}.pem"
    public = new_key(key).public
    (folder / "keys" / "trusted.toml").write_text(trusted_table(site_id, public))
    receivers = "\n".join(
        f'[receivers.{name}]\nsource = "{sources[name]}"\nposition_ecef_m = {list(point)}\n{of_receivers}'
        for name, point in zip("ABC", (A_ECEF_M, B_ECEF_M, C_ECEF_M), strict=True)
    )
    (folder / "site.toml").write_text(
        f'[site]\nid = "{site_id}"\nframe = "ITRF2020"\nepoch_interval_s = {interval_s}\n{receivers}\n'
        f'[publish]\nlisten = ["{endpoint}"]\nkey = "{key}"\n[record]\ndirectory = "{folder / "recordings"}"\n'
        f"[integrity]\nrecover_after_s = {recover_after_s}\n{more}\n"
    )
    return Field(folder, endpoint, load_site(folder / "site.toml"))


def measured(site: SiteFile, seconds: float, seed: int = 1) -> tuple[Event, ...]:
    """What the receivers of the site send, as bytes, each by its protocol, and ticks."""
    interval_s = site.config.epoch_interval_ns / 1e9
    return as_sent(simulate(site.config, START_NS, seconds, 1.0 / interval_s, seed), antennas_of(site.config), site.config.protocols)


@contextmanager
def running_station(field: Field, *, environment: Mapping[str, str] | None = None) -> Iterator[subprocess.Popen[str]]:
    """The station as a process of its own; its talk goes to `station.log` in the folder. Killed at the end if it still runs."""
    with (field.folder / "station.log").open("a") as log:
        process = subprocess.Popen(
            [sys.executable, "-m", "wayside", "station", "run", str(field.site_file)],
            stdout=log,
            stderr=log,
            cwd=REPOSITORY,
            env=os.environ | {"OPENBLAS_NUM_THREADS": "1"} | dict(environment or {}),
            text=True,
        )
        try:
            yield process
        finally:
            if process.poll() is None:
                process.kill()
            process.wait()


def until(condition: object, within_s: float) -> bool:
    """Whether a condition (a callable) becomes true in time."""
    assert callable(condition)
    deadline_s = time.monotonic() + within_s
    while time.monotonic() < deadline_s:
        if condition():
            return True
        time.sleep(0.02)
    return bool(condition())


@contextmanager
def playing(server: ReceiverServer, events: Iterable[Event], sent: Sent | None = None) -> Iterator[None]:
    """The server plays in the background, until the events or this block end; `sent` is told of every burst."""
    ended = threading.Event()
    player = threading.Thread(target=server.play, args=(takewhile(lambda _: not ended.is_set(), events), 1.0, sent))
    player.start()
    try:
        yield
    finally:
        ended.set()
        player.join()


class Plug:
    """A cable between a station and a simulated receiver, which can be pulled and pushed in again."""

    def __init__(self, upstream: tuple[str, int]) -> None:
        self._upstream = upstream
        self._server = socket.create_server(("127.0.0.1", 0))
        self.address: tuple[str, int] = self._server.getsockname()
        self._pulled = False
        self._ends: list[socket.socket] = []

    def __enter__(self) -> "Plug":
        threading.Thread(target=self._serve, daemon=True).start()
        return self

    def __exit__(self, *_: object) -> None:
        self.pull()
        self._server.close()

    def pull(self) -> None:
        self._pulled = True
        for end in self._ends:
            with contextlib.suppress(OSError):
                end.shutdown(socket.SHUT_RDWR)

    def push(self) -> None:
        self._pulled = False

    def _serve(self) -> None:
        with contextlib.suppress(OSError):
            while True:
                client, _ = self._server.accept()
                if self._pulled:
                    client.close()
                    continue
                receiver = socket.create_connection(self._upstream)
                self._ends = [client, receiver]
                threading.Thread(target=self._forward, args=(receiver, client), daemon=True).start()

    def _forward(self, receiver: socket.socket, client: socket.socket) -> None:
        with receiver, client, contextlib.suppress(OSError):
            while data := receiver.recv(1 << 16):
                client.sendall(data)
