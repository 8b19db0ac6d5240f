"""The station: bytes in, decisions out, on the air and on record. The shell around `StationMonitor`: threads, clocks, links.

    listeners (a thread a receiver)  ->  inbox, bounded  ->  this thread: monitor  ->  publisher (Zenoh)
                                                                                   ->  recorder (a thread, behind a queue)

One thread decides. It takes pieces in the order of arrival, puts a tick between them where a second has passed or a deadline of the
monitor has, and publishes health before it does anything else. Chores come when there is time; shortly before an epoch is due it lets the
monitor look ahead. A bug ends the station: what is published then runs out by itself.
"""

import gc
import os
import signal
import sys
from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

from google.protobuf.message import Message

from integrity import SOFTWARE
from integrity.events import Event, InputLost, RawBytes
from integrity.gnss.gps_time import NS_PER_S, format_utc, gps_from_utc
from integrity.messages.outputs import encode_alert, encode_health, encode_report
from integrity.messages.snapshots import encode_snapshot
from integrity.outputs import Alert, EpochReport, HealthReport
from integrity.station_monitor import Snapshot, StationMonitor
from recordings.explain import changed
from recordings.keys import load_key
from recordings.link import Access, open_link
from recordings.recorder import Recorder, check_directory
from recordings.site_file import SiteFile
from recordings.sources.host_clock import mono_now_ns, tick
from recordings.sources.inbox import Inbox
from recordings.sources.listener import listener_of
from recordings.tls_files import check_tls, files_of
from station.notify import notify
from station.publisher import Publisher
from station.recording import manner_of
from station.second_look import SecondLook

TICK_NS = NS_PER_S
LOOK_AHEAD_NS = NS_PER_S // 50  # before an epoch is due
CHORES_AFTER = 0.3  # of an interval: what has time is done well before the next epoch
NEVER_NS = 2**63 - 1
INTERRUPTED = 130
SWITCH_INTERVAL_S = 0.005  # the longest that another thread keeps the deciding one from the interpreter

Say = Callable[[str], None]
M = TypeVar("M", bound=Message)


def run_station(site: SiteFile, say: Say) -> int:
    """Run until SIGTERM or SIGINT, or until every source has ended (files do); the exit code.

    Raises ConfigError or LinkError where it cannot start.
    """
    folder = Path(site.file).parent  # relative paths of a site file count from where it lies
    sources = {name: url for name, url in site.sources.items() if url is not None}
    key = load_key(folder / site.publish.key)
    tls = files_of(site.tls, folder)
    check_tls(tls)
    access = Access(site.config.site_id, site.publish.readers) if tls else None  # without certificates nobody can be told from another
    directory = folder / site.record.directory
    check_directory(directory)
    boot_id = os.urandom(16)
    monitor = StationMonitor(site.config)
    inbox = Inbox[RawBytes]()
    with open_link(site.publish.listen, site.publish.connect, tls, access) as link:
        publisher = Publisher(link, site.config, key, boot_id, SOFTWARE)
        recorder = Recorder(directory, manner_of(site, boot_id), say)
        listeners = [listener_of(name, url, folder, inbox, site.config.epoch_interval_ns, say) for name, url in sources.items()]
        station = Station(site, monitor, inbox, publisher, recorder, boot_id, say)
        for number in (signal.SIGTERM, signal.SIGINT):
            signal.signal(number, lambda received, _: station.stop(received))
        try:
            for listener in listeners:
                listener.start()
            say(f"site {site.config.site_id}: key {key.key_id.hex()}, listening at {', '.join(site.publish.listen) or 'no endpoint'}")
            notify("READY=1")
            station.run(lambda: any(listener.is_alive() for listener in listeners))
        finally:
            notify("STOPPING=1")
            inbox.close()
            for listener in listeners:
                listener.stop()
            recorder.close()
        for name, dropped in monitor.dropped.items():
            if dropped:
                say(f"{name}: {dropped} rows had no partner in the other receivers")
    return INTERRUPTED if station.stopped_by == signal.SIGINT else 0


class Station:
    """The thread that decides, and what it speaks to."""

    def __init__(
        self,
        site: SiteFile,
        monitor: StationMonitor,
        inbox: Inbox[RawBytes],
        publisher: Publisher,
        recorder: Recorder[Event],
        boot_id: bytes,
        say: Say,
    ) -> None:
        self._site = site.config
        self._monitor = monitor
        self._second_look = SecondLook(site.config, say)
        self._inbox = inbox
        self._publisher = publisher
        self._recorder = recorder
        self._boot_id = boot_id
        self._say = say
        self.stopped_by = 0  # signal; 0: none
        self._now_ns = mono_now_ns()  # of the event decided last: never steps back
        self._next_tick_ns = self._now_ns
        self._chores_ns = NEVER_NS
        self._look_ahead_ns = NEVER_NS
        self._gps_ahead_ns: int | None = None  # GPS time minus the monotonic clock, by the last aligned epoch
        self._first: Snapshot | None = monitor.snapshot()  # until the recording begins: with the first decision, when the time is known
        self._held: list[Event] = []  # decided on, and not yet handed to the recorder

    def stop(self, signal_number: int) -> None:
        """End `run` soon; safe in a signal handler."""
        self.stopped_by = signal_number
        self._inbox.wake()

    def run(self, sources_alive: Callable[[], bool]) -> None:
        """Decide until stopped, or until the sources have ended and everything that they brought is decided."""
        sys.setswitchinterval(SWITCH_INTERVAL_S)
        gc.collect()
        gc.freeze()  # what stays for good is not searched again and again
        gc.disable()  # garbage is collected when nothing is due
        try:
            self._run(sources_alive)
        finally:
            self._hand_over()

    def _run(self, sources_alive: Callable[[], bool]) -> None:
        while not self.stopped_by:
            due_ns = self._due_ns()
            piece = self._inbox.take(min(due_ns, self._chores_ns, self._look_ahead_ns))
            now_ns = mono_now_ns()
            if piece is None and self._chores_ns <= now_ns < due_ns:
                self._do_chores()
            elif piece is None and self._look_ahead_ns <= now_ns < due_ns:
                self._look_ahead_ns = NEVER_NS
                self._monitor.look_ahead()
            elif piece is None or piece.mono_ns > due_ns:
                self._tick(max(due_ns, self._now_ns))
            if piece is not None:
                self._now_ns = max(self._now_ns, piece.mono_ns)
                self._decide(RawBytes(self._now_ns, piece.receiver, piece.data))
            elif not sources_alive():
                self._say("every source has ended")
                return

    def _do_chores(self) -> None:
        """While there is time: the monitor tests itself, a second look at what was decided, and garbage."""
        self._chores_ns = NEVER_NS
        self._monitor.test_itself()
        self._second_look.take()
        gc.collect()

    def _due_ns(self) -> int:
        """When the next tick is due: each second, and as soon as the monitor would notice a silence."""
        deadline_ns = self._monitor.next_deadline_ns
        noticed_ns = self._next_tick_ns if deadline_ns is None or deadline_ns < self._now_ns else deadline_ns + 1
        return min(self._next_tick_ns, noticed_ns)

    def _tick(self, mono_ns: int) -> None:
        if mono_now_ns() < mono_ns or self.stopped_by:
            return  # woken early
        self._now_ns = mono_ns
        if mono_ns >= self._next_tick_ns:
            self._next_tick_ns = mono_ns + TICK_NS
        notify("WATCHDOG=1")
        for receiver, chunks in self._inbox.dropped().items():
            self._say(f"{receiver}: overloaded, {chunks} pieces of its bytes were lost: is this machine too slow, or too busy?")
            self._decide(InputLost(mono_ns, receiver, chunks))
        self._decide(tick(self._site.host_clock, mono_ns))
        self._hand_over()
        if self._chores_ns <= mono_ns - TICK_NS:  # there has been no time for a second
            self._do_chores()

    def _decide(self, event: Event) -> None:
        """Decide, publish, record; the recorder is not woken before health is on the air."""
        if self._first is None and self._recorder.wants_file(event.mono_ns):
            self._hand_over()
            self._begin(self._monitor.snapshot(), event.mono_ns)
        self._held.append(event)
        outputs = self._monitor.feed((event,))
        self._second_look.note(event, outputs)
        if not outputs:
            return
        health = {o.sequence: encode_health(o, self._site, SOFTWARE, self._boot_id) for o in outputs if isinstance(o, HealthReport)}
        for message in health.values():
            self._publisher.health(message)
        self._gps_ahead_ns = next((o.gps_time_ns - o.mono_ns for o in outputs if isinstance(o, EpochReport)), self._gps_ahead_ns)
        self._chores_ns = event.mono_ns + round(CHORES_AFTER * self._site.epoch_interval_ns)
        self._look_ahead_ns = event.mono_ns + self._site.epoch_interval_ns - LOOK_AHEAD_NS
        if self._first is not None:
            self._begin(self._first, self._held[0].mono_ns)
            self._first = None
        self._hand_over()
        for output in outputs:
            match output:
                case HealthReport():
                    self._recorder.output(health[output.sequence])
                case EpochReport():
                    self._publish(encode_report(output), self._publisher.epoch)
                case Alert():
                    self._publish(encode_alert(output), self._publisher.alert)
                    self._say_change(output)

    def _publish(self, message: M, put: Callable[[M], None]) -> None:
        put(message)
        self._recorder.output(message)

    def _hand_over(self) -> None:
        """Events to the recorder; before the first decision they are held, at most until the first silence is noticed."""
        if self._first is None:
            for event in self._held:
                self._recorder.event(event)
            self._held.clear()

    def _begin(self, snapshot: Snapshot, mono_ns: int) -> None:
        """A new file, by GNSS time if there is any."""
        ahead_ns = self._gps_ahead_ns
        gps_ns = gps_from_utc(tick(self._site.host_clock, mono_ns).utc_ns) if ahead_ns is None else mono_ns + ahead_ns
        self._recorder.begin(encode_snapshot(snapshot, self._site.receiver_names, mono_ns), mono_ns, gps_ns)

    def _say_change(self, alert: Alert) -> None:
        line = changed(alert.state, alert.cause, alert.subjects, alert.reasons)
        when = "" if alert.gps_time_ns is None else f"{format_utc(alert.gps_time_ns)}  "
        self._say(f"{when}{line}")
        notify(f"STATUS={line}")
