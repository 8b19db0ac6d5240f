"""The train: bytes of its antennas and words from the ground in, positions out. The shell around `TrainLocaliser`: threads, clocks, links.

    listeners (a thread an antenna)  ->
    air (Zenoh's threads)            ->  inbox, bounded  ->  this thread: localiser  ->  air (TrainPosition), recorder, who watches

One thread decides. It challenges each station every second, and puts a tick between what comes where a second has passed or a deadline of
the localiser has: a station that is silent, frozen or dead is noticed by the train's own clock. SIGUSR1 releases a stop that is latched.
"""

import gc
import secrets
import signal
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from google.protobuf.message import Message

from integrity.events import InputLost
from integrity.gnss.gps_time import NS_PER_S, gps_from_utc
from integrity.messages import wayside_pb2 as pb
from integrity.messages.verification import NONCE_BYTES
from recordings.keys import KeyDates, keys_of, read_trusted
from recordings.recorder import Recorder, check_directory
from recordings.sources.host_clock import mono_now_ns, tick
from recordings.sources.inbox import Inbox
from recordings.sources.listener import listener_of
from recordings.tls_files import check_tls
from train_client.air import Air
from train_client.config import TrainConfig
from train_client.events import ChallengeSent, StopReleased, TrainEvent
from train_client.localisation.localiser import TrainLocaliser
from train_client.localisation.memory import LocaliserMemory
from train_client.map_file import read_map_text
from train_client.messages import encode_position
from train_client.outputs import MessageRefused, PositionReport, StopChange, TrainOutput, TrustChange
from train_client.recording import manner_of
from train_client.snapshots import encode_snapshot
from train_client.stop import StopState
from train_client.track.checks import load_map
from train_client.track.track_map import TrackMap
from train_client.track.vouching import stations_on
from train_client.train_file import TrainFile

TICK_NS = NS_PER_S
HOLD_NS = 10 * NS_PER_S  # so long the recording waits for the first epoch, to begin with GNSS time
SAY_AGAIN_NS = 10 * NS_PER_S
INTERRUPTED = 130
AIR = "the air"  # no antenna can be called so
MOST_OF_AIR = 256  # messages not decided yet: 30 ms of signatures, so much later what else is due is decided in a flood of them

Say = Callable[[str], None]
Watch = Callable[[pb.TrainPosition], None]


def run_train(train: TrainFile, map_file: Path, say: Say, watch: Watch) -> int:
    """Run until SIGTERM or SIGINT, or until every source has ended (files do); the exit code. `watch` gets every position.

    Raises ConfigError or LinkError where it cannot start.
    """
    config = train.config
    map_json = read_map_text(map_file)
    track = load_map(map_json, str(map_file))
    trusted = read_trusted(train.keys_path)
    keys = {site: keys_of(trusted, site, train.keys_path) for site in config.stations}
    dates = {site: KeyDates(trusted[site]) for site in config.stations}
    check_tls(train.tls)
    sources = {name: url for name, url in train.sources.items() if url is not None}
    check_directory(train.directory)
    inbox = Inbox[TrainEvent](shares={AIR: MOST_OF_AIR})
    recorder = Recorder(train.directory, manner_of(config, train.text, map_json, keys), say)
    airs = [
        Air(connect, train.tls, {site: dates[site] for site in sites}, config.train_id, lambda event: inbox.put_event(AIR, event), say)
        for connect, sites in train.connect.items()
    ]
    folder = Path(train.file).parent
    listeners = [listener_of(name, url, folder, inbox, config.epoch_interval_ns, say) for name, url in sources.items()]
    runner = TrainRunner(TrainLocaliser(config, track, keys), inbox, airs, recorder, say, watch)
    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, lambda received, _: runner.stop(received))
    signal.signal(signal.SIGUSR1, lambda *_: runner.release())
    try:
        for air in airs:
            air.start()
        for listener in listeners:
            listener.start()
        trusts = ", ".join(f"{len(of)} key{'s' * (len(of) != 1)} of {site}" for site, of in keys.items())
        say(f"train {config.train_id} on map {track.id}: trusts {trusts}")
        for warning in _warnings(config, track, dates):
            say(warning)
        runner.run(lambda: any(listener.is_alive() for listener in listeners))
    finally:
        inbox.close()
        for air in airs:
            air.stop()
        for listener in listeners:
            listener.stop()
        recorder.close()
    return INTERRUPTED if runner.stopped_by == signal.SIGINT else 0


def _warnings(train: TrainConfig, track: TrackMap, dates: Mapping[str, KeyDates]) -> Iterator[str]:
    """What may be as meant, and will stop the train some day."""
    for of in dates.values():
        yield from of.warnings()
    for site in stations_on(track):
        if site not in train.stations:
            yield f"warning: {site} vouches for stretches of map {track.id} and is not trusted: no position is VALID there"


class TrainRunner:
    """The thread that decides, and what it speaks to."""

    def __init__(
        self,
        localiser: TrainLocaliser,
        inbox: Inbox[TrainEvent],
        airs: Sequence[Air],
        recorder: Recorder[TrainEvent],
        say: Say,
        watch: Watch,
    ) -> None:
        self._localiser = localiser
        self._inbox = inbox
        self._airs = airs
        self._air_of = {site: air for air in airs for site in air.sites}
        self._shall_release = False
        self._recorder = recorder
        self._say = say
        self._watch = watch
        self.stopped_by = 0  # signal; 0: none
        self._now_ns = mono_now_ns()  # of the event decided last: never steps back
        self._began_ns = self._now_ns
        self._next_tick_ns = self._now_ns
        self._gps_ahead_ns: int | None = None  # GPS time minus the monotonic clock, by the last epoch
        self._held: list[TrainEvent | Message] | None = []  # events and what came of them, until the recording begins
        self._first = localiser.snapshot()  # until then
        self._refused: dict[str, tuple[int | None, int]] = {}  # by kind: when it was said last, and how many have come since

    def stop(self, signal_number: int) -> None:
        """End `run` soon; safe in a signal handler."""
        self.stopped_by = signal_number
        self._inbox.wake()

    def release(self) -> None:
        """Release the stop that is latched; safe in a signal handler."""
        self._shall_release = True
        self._inbox.wake()

    def run(self, sources_alive: Callable[[], bool]) -> None:
        """Decide until stopped, or until the sources have ended and everything that they brought is decided."""
        gc.collect()
        gc.freeze()
        try:
            while not self.stopped_by and self._once(sources_alive):
                pass
        finally:
            self._begin_recording()

    def _once(self, sources_alive: Callable[[], bool]) -> bool:
        """Whether to go on."""
        due_ns = self._due_ns()
        challenge_ns, site = self._localiser.challenge_due
        event = self._inbox.take(min(due_ns, challenge_ns))
        if self._shall_release:
            self._shall_release = False
            self._now_ns = max(self._now_ns, mono_now_ns())
            self._decide(StopReleased(self._now_ns))
        if mono_now_ns() >= challenge_ns:
            self._challenge(site)
        if event is None or event.mono_ns > due_ns:
            self._tick(max(due_ns, self._now_ns))
        if event is not None:
            self._decide(self._in_order(event))
        elif not sources_alive():
            self._say("every source has ended")
            return False
        return True

    def _due_ns(self) -> int:
        """When the next tick is due: each second, and as soon as the localiser would notice a silence or lose trust."""
        deadline_ns = self._localiser.next_deadline_ns
        return min(self._next_tick_ns, self._next_tick_ns if deadline_ns is None or deadline_ns < self._now_ns else deadline_ns)

    def _tick(self, mono_ns: int) -> None:
        if mono_now_ns() < mono_ns or self.stopped_by:
            return  # woken early
        self._now_ns = mono_ns
        if mono_ns >= self._next_tick_ns:
            self._next_tick_ns = mono_ns + TICK_NS
        for sender, lost in self._inbox.dropped().items():
            self._say(f"{sender}: overloaded, {lost} pieces were lost: is this machine too slow, or too busy?")
            if sender != AIR:
                self._decide(InputLost(mono_ns, sender, lost))
        self._decide(tick("none", mono_ns))

    def _challenge(self, site: str) -> None:
        nonce = secrets.token_bytes(NONCE_BYTES)
        self._now_ns = max(self._now_ns, mono_now_ns())
        self._decide(ChallengeSent(self._now_ns, site, nonce))
        self._air_of[site].challenge(site, nonce)

    def _in_order(self, event: TrainEvent) -> TrainEvent:
        """Stamped in several threads: the clock of what is decided never steps back. A later stamp makes a message older, not younger."""
        self._now_ns = max(self._now_ns, event.mono_ns)
        return event if event.mono_ns == self._now_ns else replace(event, mono_ns=self._now_ns)

    def _decide(self, event: TrainEvent) -> None:
        if self._held is None:
            if self._recorder.wants_file(event.mono_ns):
                self._begin_file(self._localiser.snapshot(), event.mono_ns)
            self._recorder.event(event)
        else:
            self._held.append(event)
        outputs = self._localiser.feed((event,))
        for output in outputs:
            self._output(output)
        if any(isinstance(output, PositionReport) for output in outputs):
            self._localiser.look_ahead()
        if self._held is not None and event.mono_ns - self._began_ns > HOLD_NS:
            self._begin_recording()

    def _output(self, output: TrainOutput) -> None:
        match output:
            case PositionReport():
                message = encode_position(output, self._localiser.train, self._localiser.track)
                for air in self._airs:
                    air.publish(message.SerializeToString())
                if self._held is None:
                    self._recorder.output(message)
                else:
                    self._held.append(message)
                if output.fix is not None:
                    self._gps_ahead_ns = output.fix.gps_time_ns - output.mono_ns
                    self._begin_recording()
                self._watch(message)
            case TrustChange():
                of = f" in {output.site}" if len(self._localiser.train.stations) > 1 else ""
                self._say(": ".join([f"trust {output.state.value}{of}", *(["; ".join(output.reasons)] if output.reasons else [])]))
            case StopChange():
                self._say(_stop_words(output))
            case MessageRefused():
                self._say_refused(output)

    def _say_refused(self, refused: MessageRefused) -> None:
        """The first of a kind at once; of more of them, how many, every ten seconds: nobody can fill a journal from afar."""
        alarm = f" SECURITY ALARM: somebody else speaks in the name of {refused.site}" if refused.alarm else ""
        kind = refused.refusal.partition(":")[0] + alarm
        said_ns, more = self._refused.get(kind, (None, 0))
        if said_ns is not None and refused.mono_ns - said_ns < SAY_AGAIN_NS:
            self._refused[kind] = (said_ns, more + 1)
            return
        self._refused[kind] = (refused.mono_ns, 0)
        self._say(f"not believed: {refused.refusal}{f' (and {more} like it before)' if more else ''}{alarm}")

    def _begin_recording(self) -> None:
        """With what was held; the clock of the file is GNSS time where it is known by now."""
        if self._held is None:
            return
        held, self._held = self._held, None
        for item in held:
            if isinstance(item, Message):
                self._recorder.output(item)
            else:
                if item is held[0]:
                    self._begin_file(self._first, item.mono_ns)
                self._recorder.event(item)

    def _begin_file(self, memory: LocaliserMemory, mono_ns: int) -> None:
        ahead_ns = self._gps_ahead_ns
        gps_ns = gps_from_utc(tick("none", mono_ns).utc_ns) if ahead_ns is None else mono_ns + ahead_ns
        self._recorder.begin(encode_snapshot(memory, self._localiser.train, self._localiser.track, mono_ns), mono_ns, gps_ns)


def _stop_words(change: StopChange) -> str:
    stop = change.stop
    if change.refusal:
        return f"not released: {change.refusal}"
    if stop.state is StopState.NONE:
        return "no stop is asked for any more"
    how = "latched until it is released (SIGUSR1)" if stop.state is StopState.LATCHED else "until a position is VALID"
    return f"STOP is asked for, {how}: {'; '.join(stop.reasons)}"
