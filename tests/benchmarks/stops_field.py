"""A station and a train that lose each other, again and again: one field on loopback, and what is measured of a moment.

Station and train are processes of their own at 10 Hz, with simulated receivers of their own; the train reaches the station through a
`Path`. An observer listens to the station directly, so that what the station said is known whatever became of it on the way.

What holds trust up for longest decides how strict this is. After a kill the next station is started at once, but the path refuses
connections until trust has ended: a train that heard the new boot would stop for its first word, long before the end of validity.
"""

import random
import signal
import socket
import time
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from enum import Enum
from pathlib import Path as FilePath
from typing import NamedTuple, TypedDict

from integrity.events import Event
from integrity.messages import wayside_pb2 as pb
from integrity.messages.key_expressions import HEALTH, site_key
from recordings.link import Arrival, dial_link
from recordings.simulate.server import ReceiverServer
from tests.benchmarks.stops_path import Passage, Path
from tests.benchmarks.stops_train import TellingTrain, Told, Waits, is_trusted, telling_train
from tests.e2e.field import SITE_ID, Field, make_field, playing, running_station, until
from tests.e2e.train_field import ANTENNAS, make_train, urls

INTERVAL_S = 0.1
VALID_FOR_MS = 3000
WAIT_S = VALID_FOR_MS / 1e3 + INTERVAL_S  # the moment is uniform over one validity and one epoch
RECOVER_AFTER_S = 1.0  # of the station, after a start or a silence: the shorter, the more moments an hour
TRUSTS_WITHIN_S = 45.0  # after a start or a loss; more is an error
ENDS_WITHIN_S = 10.0
OBSERVED_WITHIN_NS = 1_000_000_000
KEPT = 200  # NORMAL messages: 20 s


class Way(Enum):
    """How a train loses its station."""

    KILL = "killed"
    STOP = "stopped"
    CUT_STANDING = "cut (bytes stand)"
    CUT_LOSING = "cut (bytes lost)"


class Moment(TypedDict):
    """One loss, ms. `heard_ms`, which is judged: from the issue of the last NORMAL until somebody who reads what the train tells knows.

    `own_ms`: until the train's own stamp of that word. `epoch_ms`: as `heard_ms`, from when the receivers sent the epoch covered; None if
    that is not known. `since_issue_ms`: at the moment of the loss. `taken`: the observer has heard the message that the train held last.
    `waited_ms`: for a processor, of the train's thread that decides, of all its others together, and of the reader, from the end of
    validity until it was read, to the next 20 ms; None where the system does not tell. `trusted_ms`: from the end of trust before, or from
    the start of the field, until there was trust again.
    """

    way: str
    since_issue_ms: float
    heard_ms: float
    own_ms: float
    epoch_ms: float | None
    taken: bool
    ended_as: str
    waited_ms: tuple[float, float, float] | None
    trusted_ms: float


class Normal(NamedTuple):
    """What matters of a NORMAL message."""

    boot_id: bytes
    sequence: int
    issued_mono_ns: int
    gps_time_ns: int


class FieldFailed(Exception):
    """A moment could not be measured: what was missing, and the last words of both processes."""


class LosingField:
    """Made by `losing_field`; `lose` once per moment."""

    def __init__(self, place: Field, path: Path, train: TellingTrain, stack: ExitStack) -> None:
        self._place = place
        self._path = path
        self._train = train
        self._stack = stack
        self.normals: deque[Normal] = deque(maxlen=KEPT)
        self.sent_mono_ns: dict[int, int] = {}  # of an epoch, by its GPS time: when the first receiver sent it
        self.postponed = 0  # moments at which there was no trust to be lost
        self._since_ns = time.monotonic_ns()  # the start, or when trust ended
        self._station = stack.enter_context(running_station(place))

    def started(self) -> None:
        """Return when the station listens; FieldFailed where it does not."""
        log = self._place.folder / "station.log"
        self._await(lambda: "listening at" in log.read_text(), TRUSTS_WITHIN_S, "the station does not listen")

    def sent(self, _: str, epoch_ns: int, mono_ns: int) -> None:
        """A receiver has sent that epoch."""
        self.sent_mono_ns.setdefault(epoch_ns, mono_ns)

    def trusts(self) -> None:
        """Return when there is trust; FieldFailed where it does not come."""
        self._await(lambda: self._trusted() and self._observed(), TRUSTS_WITHIN_S, "no trust")

    def lose(self, way: Way, rng: random.Random) -> Moment:
        """Wait until there is trust at a random moment; then until it has ended, and give the station back. FieldFailed."""
        self.trusts()
        trusted_ms = _ms(time.monotonic_ns() - self._since_ns)
        time.sleep(rng.uniform(0.0, WAIT_S))
        while not (self._trusted() and self._observed()):
            self.postponed += 1
            self.trusts()
            time.sleep(rng.uniform(0.0, WAIT_S))
        before = len(self._train.told)
        lost_ns = self._lose(way)
        waits = [self._train.waits()]

        def ended() -> bool:
            over = not all(map(is_trusted, self._train.told[before:]))
            waits.append(self._train.waits())
            return over

        self._await(ended, ENDS_WITHIN_S, "trust does not end")
        end = next(told for told in self._train.told[before:] if not is_trusted(told))
        self._since_ns = end.mono_ns
        self._give_back(way)
        return self._measured(way, lost_ns, end, trusted_ms, waits)

    def _lose(self, way: Way) -> int:
        """The moment, ns: until then the station may have spoken, and after it no word of it came through."""
        match way:
            case Way.CUT_STANDING:
                return self._path.become(Passage.STANDING)
            case Way.CUT_LOSING:
                return self._path.become(Passage.LOSING)
            case Way.STOP:
                self._station.send_signal(signal.SIGSTOP)
                return time.monotonic_ns()
            case Way.KILL:
                self._path.become(Passage.REFUSING)
                self._station.kill()
                self._station.wait()
                lost_ns = time.monotonic_ns()
                self._station = self._stack.enter_context(running_station(self._place))
                return lost_ns

    def _give_back(self, way: Way) -> None:
        if way is Way.STOP:
            self._station.send_signal(signal.SIGCONT)
        else:
            self._path.become(Passage.OPEN)

    def _measured(self, way: Way, lost_ns: int, end: Told, trusted_ms: float, waits: Sequence[Waits]) -> Moment:
        """Counted from the last NORMAL that was issued before the loss, or from the one that the train held, if that is an earlier one."""
        newest_first = tuple(self.normals)[::-1]
        published = next(n for n in newest_first if n.issued_mono_ns <= lost_ns)
        held = int(end.position.get("health_sequence", 0))
        taken = next((n for n in newest_first if (n.boot_id, n.sequence) == (published.boot_id, held)), None)
        last = published if taken is None else min(published, taken, key=lambda n: n.issued_mono_ns)
        sent_ns = self.sent_mono_ns.get(last.gps_time_ns)
        return {
            "way": way.value,
            "since_issue_ms": _ms(lost_ns - last.issued_mono_ns),
            "heard_ms": _ms(end.mono_ns - last.issued_mono_ns),
            "own_ms": _ms(int(end.position["mono_ns"]) - last.issued_mono_ns),
            "epoch_ms": None if sent_ns is None else _ms(end.mono_ns - sent_ns),
            "taken": taken is not None,
            "ended_as": end.position["trust"],
            "waited_ms": _waited_ms(waits, last.issued_mono_ns + VALID_FOR_MS * 1_000_000),
            "trusted_ms": trusted_ms,
        }

    def _trusted(self) -> bool:
        return bool(self._train.told) and is_trusted(self._train.told[-1])

    def _observed(self) -> bool:
        """The observer has heard a NORMAL just now."""
        return bool(self.normals) and time.monotonic_ns() - self.normals[-1].issued_mono_ns < OBSERVED_WITHIN_NS

    def _await(self, condition: Callable[[], bool], within_s: float, otherwise: str) -> None:
        if not until(condition, within_s):
            raise self._failed(f"{otherwise} within {within_s:.0f} s")

    def _failed(self, what: str) -> FieldFailed:
        logs = [(self._place.folder / name).read_text().splitlines()[-4:] for name in ("station.log", "train.log")]
        last = self._train.told[-1].position if self._train.told else {}
        told = {name: last.get(name) for name in ("mono_ns", "trust", "valid_for_ms")}
        return FieldFailed(f"{what}; station: {logs[0]}; train: {logs[1]}; it told last: {told}")


def _ms(ns: int) -> float:
    return round(ns / 1e6, 2)


def _waited_ms(waits: Sequence[Waits], since_ns: int) -> tuple[float, float, float] | None:
    """From a moment to the end, each of the three."""
    known = [(w.mono_ns, w.threads_ns) for w in waits if w.threads_ns is not None]
    if not known:
        return None
    first = next((threads_ns for mono_ns, threads_ns in reversed(known) if mono_ns <= since_ns), known[0][1])
    decides_ns, others_ns, reader_ns = (last - before for last, before in zip(known[-1][1], first, strict=True))
    return _ms(decides_ns), _ms(others_ns), _ms(reader_ns)


@contextmanager
def losing_field(folder: FilePath, events: Iterable[Event], train_nice: int) -> Iterator[LosingField]:
    """All processes and threads of a field, until the block ends."""
    with ExitStack() as stack:
        server = stack.enter_context(ReceiverServer((*"ABC", *ANTENNAS), "127.0.0.1", 0))
        sources = urls(server)
        place = make_field(folder, {name: sources[name] for name in "ABC"}, INTERVAL_S, RECOVER_AFTER_S)
        host, _, port = place.endpoint.removeprefix("tcp/").rpartition(":")
        stack.enter_context(_held(host, int(port)))
        path = stack.enter_context(Path((host, int(port))))
        train_file = make_train(replace(place, endpoint=f"tcp/{path.address[0]}:{path.address[1]}"), sources)
        field = LosingField(place, path, stack.enter_context(telling_train(train_file, train_nice)), stack)
        stack.enter_context(playing(server, events, field.sent))
        field.started()
        link = stack.enter_context(dial_link([place.endpoint], lambda: None))
        link.subscribe(site_key(SITE_ID, HEALTH), lambda arrival: _observe(arrival, field.normals))
        yield field


@contextmanager
def _held(host: str, port: int) -> Iterator[None]:
    """While a station is dead nobody else gets its port: it is bound, and nobody listens."""
    with socket.socket() as holder:
        holder.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        holder.bind((host, port))
        yield


def _observe(arrival: Arrival, normals: deque[Normal]) -> None:
    health = pb.Health.FromString(pb.SignedHealth.FromString(arrival.data).health)
    if health.state == pb.NORMAL:
        normals.append(Normal(health.boot_id, health.sequence, health.issued_mono_ns, health.gps_time_ns))
