"""A station under attack: simulated receivers, its process, which can be stopped, killed and begun anew, and one thread of it frozen.

To freeze the thread that decides, the scene plays the service manager whom that thread tells each second that it is alive, and reads
nothing any more: with the socket's queue full, the next word waits for room, while Zenoh's threads go on. Source: unix(7), sd_notify(3).
"""

import signal
import socket
import subprocess
import threading
from collections.abc import Callable, Iterator, Mapping
from contextlib import AbstractContextManager, ExitStack, contextmanager, suppress
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path

from integrity.gnss.gps_time import NS_PER_S, WEEK_NS, parse_utc
from integrity.messages.signatures import SigningKey
from recordings.keys import load_key
from recordings.simulate.server import ReceiverServer
from tests.e2e.field import SITE_ID, START_NS, Field, make_field, playing, running_station
from tests.e2e.train_field import ANTENNAS, both_measured, make_train, urls

INTERVAL_S = 0.1
RECOVER_AFTER_S = 2.0
PLAYED_S = 600.0  # longer than all attacks together
LEAP_NS = parse_utc("2017-01-01T00:00:00Z")  # the leap second has passed; a new hour, day and year as well
ROLLOVER_NS = 2048 * WEEK_NS  # the week of ten bits is 0 again; IS-GPS-200, 20.3.3.3.1.1
BEFORE_NS, AFTER_NS = 18 * NS_PER_S, 12 * NS_PER_S


class ServiceManager:
    """Reads what the station says, except while it shall not."""

    def __init__(self, address: Path) -> None:
        self.address = str(address)
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        self._socket.bind(self.address)
        self._socket.settimeout(0.1)
        self._reads, self._ended = threading.Event(), False
        self._reads.set()
        self._one_at_a_time = threading.Lock()
        self._thread = threading.Thread(target=self._read, daemon=True)
        self._thread.start()

    def stop_reading(self) -> None:
        """No reading from now on, and no room for another word."""
        self._reads.clear()
        with self._one_at_a_time, socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as sender, suppress(BlockingIOError):
            sender.setblocking(False)
            while True:
                sender.sendto(b"STATUS=", self.address)

    def read(self) -> None:
        """Again."""
        self._reads.set()

    def close(self) -> None:
        self._ended = True
        self.read()
        self._thread.join()
        self._socket.close()

    def _read(self) -> None:
        while not self._ended:
            self._reads.wait()
            with self._one_at_a_time, suppress(TimeoutError):
                if self._reads.is_set():
                    self._socket.recv(4096)


@dataclass
class Scene:
    """`place` is the station's folder; `heard`: health of a boot that has ended, if anybody has kept it."""

    place: Field
    sources: Mapping[str, str]
    manager: ServiceManager
    site_id: str = SITE_ID
    heard: list[bytes] = field(default_factory=list)
    _station: ExitStack = field(default_factory=ExitStack)
    _process: "subprocess.Popen[str] | None" = None

    @property
    def key(self) -> SigningKey:
        return load_key(self.place.folder / "keys" / f"{SITE_ID}.pem")

    def begin(self) -> None:
        """A station process, from the very beginning."""
        environment = {"NOTIFY_SOCKET": self.manager.address}
        self._process = self._station.enter_context(running_station(self.place, environment=environment))

    def send(self, number: signal.Signals) -> None:
        assert self._process is not None
        self._process.send_signal(number)

    def kill(self) -> None:
        """SIGKILL, and nothing is left of it."""
        self._station.close()

    def begin_anew(self) -> None:
        """Killed, and begun at once."""
        self.kill()
        self.begin()

    def train_file(self, name: str, endpoint: str, more: str = "") -> Path:
        """Of a train that dials there, in a folder of its own; `more` is TOML at its end."""
        folder = self.place.folder / name
        (folder / "keys").mkdir(parents=True)
        (folder / "keys" / "trusted.toml").write_text(self.place.trusted.read_text())
        return make_train(replace(self.place, folder=folder, endpoint=endpoint), dict(self.sources), INTERVAL_S, more)


def as_it_is(place: Field) -> Field:
    return place


@contextmanager
def scene(
    folder: Path, start_ns: int = START_NS, played_s: float = PLAYED_S, prepare: Callable[[Field], Field] = as_it_is
) -> Iterator[Scene]:
    """A station that runs, and receivers that play from the GPS time `start_ns` on; its files are ready when they have been prepared."""
    with ExitStack() as stack:
        server = stack.enter_context(ReceiverServer((*"ABC", *ANTENNAS), "127.0.0.1", 0))
        sources = urls(server)
        place = prepare(make_field(folder, {name: sources[name] for name in "ABC"}, INTERVAL_S, RECOVER_AFTER_S))
        manager = ServiceManager(folder / "notify")
        stack.callback(manager.close)
        events = both_measured(place.site_file, played_s, INTERVAL_S, start_ns=start_ns)
        here = Scene(place, sources, manager)
        stack.callback(here.kill)
        here.begin()
        stack.enter_context(playing(server, events))
        yield here


def scene_before(gps_ns: int) -> Callable[[Path], AbstractContextManager[Scene]]:
    """A short one, in which that moment comes when station and train have long found themselves."""
    return partial(scene, start_ns=gps_ns - BEFORE_NS, played_s=(BEFORE_NS + AFTER_NS) / NS_PER_S)
