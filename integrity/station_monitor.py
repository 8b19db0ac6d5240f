"""The main path: events in, decisions out. Read this first.

`StationMonitor.feed(events)` takes what arrived, in order, and returns what was decided, in order. It reads no clock, no file, no
chance: live and replay call it with the same events and get the same decisions, however the stream is cut into calls.

The way of a block of epochs:
  0. `reception`      bytes become measurements, ephemerides, and what receivers say of themselves
  1. `assembler`      measurements become aligned epochs and interruptions
  2. `sight`          satellite states, residuals at the surveyed points, sigmas, screening
  3. `exclusion`      walk A, with memory: which satellites are used in each epoch
  4. `checks`         positions on those satellites, every statistic, every check
                      (2 to 4 of one block: `deciding`)
  5. `_epoch`         walk B, with memory: verdict and health, epoch by epoch, interruption by interruption
"""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from integrity import audit
from integrity.assembler import AlignedEpoch, Assembler, AssemblerState, Interruption
from integrity.audit import audited_checks
from integrity.config import SiteConfig
from integrity.deciding import Ahead, Decided, Last, Memory, ahead_of, decide, last_of, place_of
from integrity.events import Event
from integrity.evidence import evidence_of
from integrity.exclusion import Exclusion
from integrity.gnss.ephemeris.broadcast import Ephemeris
from integrity.gnss.ephemeris.store import EphemerisStore
from integrity.health import Health, after_epoch, after_silence
from integrity.hearsay import remarks, told_apart
from integrity.lateness import late
from integrity.monitor_memory import MonitorMemory
from integrity.monitors import clocks, signal
from integrity.naming import LastClean
from integrity.outputs import Alert, EpochReport, HealthReport, Output
from integrity.receiver_watch import ReceiverMemory
from integrity.reception import Reception, ReceptionMemory
from integrity.satellite_watch import SatelliteMemory
from integrity.self_test import is_due, silent_families
from integrity.states import Cause, State
from integrity.stream_memory import StreamMemory
from integrity.verdict import CLEAN, Verdict, full_verdict, triangle_verdict
from integrity.vouching import MonitoredSignal, vouched_for

MOST_EPOCHS_PER_BLOCK = 1024


@dataclass(frozen=True, eq=False)
class Snapshot:
    """Everything a monitor remembers. A new monitor that starts from it decides exactly as the old one would have."""

    streams: StreamMemory
    reception: tuple[ReceptionMemory, ...] = ()
    assembler: AssemblerState = field(default_factory=AssemblerState)
    ephemerides: tuple[Ephemeris, ...] = ()
    exclusions: tuple[Exclusion, ...] = ()
    last_clean: LastClean | None = None
    health: Health = field(default_factory=Health)
    sequence: int = 0
    monitors: MonitorMemory | None = None  # None: from before the first epoch
    silent: tuple[str, ...] = ()  # checks that missed the fault of the last self test


class _Due(NamedTuple):
    """A self test that is still to be made, on epoch e of a block."""

    decided: Decided
    e: int


class StationMonitor:
    """Decides for one site. `snapshot()` may be taken between any two calls of `feed`."""

    def __init__(self, site: SiteConfig, snapshot: Snapshot | None = None) -> None:
        start = snapshot or Snapshot(StreamMemory.empty(len(site.receivers)))
        self.site = site
        self.place = place_of(site)
        self.triangle, self.limits = self.place.triangle, self.place.limits
        self._store = EphemerisStore(start.ephemerides)
        self._reception = Reception(site.receiver_names, start.reception, site.protocols, self.limits["ephemeris"])
        disputes = self._reception.disputes
        self._assembler = Assembler(site.receiver_names, site.epoch_interval_ns, self.limits, start.assembler, self._store, disputes)
        self._last_clean = start.last_clean
        self._health = start.health
        self._sequence = start.sequence
        self._audited = audited_checks(site, self.limits)
        half_epochs = self.limits.carriers.motion.half_epochs
        monitors = start.monitors or MonitorMemory.empty(len(site.receivers), half_epochs)
        satellites = SatelliteMemory({of.satellite: of for of in monitors.navigation}, monitors.carriers)
        self._memory = Memory(
            start.streams,
            satellites.of_windows(half_epochs, len(site.receivers)),
            ReceiverMemory(monitors.clocks, monitors.slow, monitors.gains),
            {x.satellite: x for x in start.exclusions},
        )
        self._audit = monitors.audit
        self._silent = start.silent
        self._due: _Due | None = None
        self._last: Last | None = None
        self._ahead: Ahead | None = None

    def feed(self, events: Iterable[Event]) -> list[Output]:
        """Decide what the events complete."""
        return [output for _, outputs in self.blocks(events) for output in outputs]

    def blocks(self, events: Iterable[Event]) -> Iterator[tuple[Decided | None, list[Output]]]:
        """The same block by block, each with what it was decided on; interruptions have no block."""
        if self._assembler.last_epoch_ns is not None:
            self._store.forget_before(self._assembler.last_epoch_ns)
        run: list[AlignedEpoch] = []
        heard = (decoded for event in events for decoded in self._reception.take(event))
        for item in self._assembler.take(heard):
            if run and (isinstance(item, Interruption) or item.klobuchar != run[0].klobuchar or len(run) == MOST_EPOCHS_PER_BLOCK):
                yield self._block(run)
                run = []
            if isinstance(item, Interruption):
                yield None, self._interruption(item)
            else:
                run.append(item)
        if run:
            yield self._block(run)

    def look_ahead(self) -> None:
        """Compute what the next epoch is going to need, should it go on as the last one did, while there is time. It changes no decision,
        only how soon the next one is there."""
        last_ns, last = self._assembler.last_epoch_ns, self._last
        if last_ns is not None and last is not None:
            self._ahead = ahead_of(last, last_ns + self.site.epoch_interval_ns, self.place, self._store)

    @property
    def next_deadline_ns(self) -> int | None:
        """Monotonic time after which the shell should send a tick, so that a silent stream is noticed."""
        return self._assembler.deadline_ns

    @property
    def dropped(self) -> dict[str, int]:
        """Rows per receiver that were not aligned."""
        return {r: self._assembler.dropped[r] for r in self.site.receiver_names}

    def snapshot(self) -> Snapshot:
        """The whole state, as values."""
        self.test_itself()
        streams, satellites, receivers, exclusions = self._memory
        return Snapshot(
            streams=streams,
            reception=self._reception.memories(),
            assembler=self._assembler.state(),
            ephemerides=tuple(self._store.ephemerides),
            exclusions=tuple(exclusions.values()),
            last_clean=self._last_clean,
            health=self._health,
            sequence=self._sequence,
            monitors=MonitorMemory(tuple(satellites.navigation.values()), *receivers, self._audit, satellites.carriers),
            silent=self._silent,
        )

    def _block(self, epochs: Sequence[AlignedEpoch]) -> tuple[Decided, list[Output]]:
        decided = decide(epochs, self.place, self._store, self._memory, self._last, self._ahead)
        self._memory, self._last = decided.memory, last_of(decided)
        return decided, [output for e, epoch in enumerate(epochs) for output in self._epoch(decided, e, epoch)]

    def _epoch(self, decided: Decided, e: int, epoch: AlignedEpoch) -> list[Output]:
        exclusions = tuple(sorted(decided.walked.tables[e].values(), key=lambda x: x.satellite))
        alone = CLEAN if decided.clean_alone[e] else triangle_verdict(decided.alone.checks, e)
        self.test_itself()
        if decided.clean[e] and is_due(epoch.epoch_ns, self.site.epoch_interval_ns):
            self._due = _Due(decided, e)
        verdict = alone if self.site.integrity.rule == "triangle" else self._verdict(decided, e, exclusions)
        before, self._health = self._health, after_epoch(self._health, verdict, epoch.epoch_ns, self.limits)
        full = decided.full
        report = EpochReport(
            gps_time_ns=epoch.epoch_ns,
            mono_ns=epoch.mono_ns,
            state=self._health.state,
            cause=self._health.cause,
            subjects=self._health.subjects,
            verdict=verdict,
            triangle_alone=alone.state,
            exclusions=exclusions,
            channels=decided.walked.channels[e],
            receivers=self.site.receiver_names,
            e_enu_m=full.solution.e_enu_m[e],
            unsolved=full.solution.why[e],
            satellites_used=full.solution.n_used[e],
            check_names=full.checks.names,
            statistic=full.checks.statistic[e],
            threshold=full.checks.threshold,
            outcome=full.checks.outcome[e],
            signals=decided.sight.block.signals,
            used=full.used[e],
            residual_sigmas=full.satellites.residual_sigmas[e],
            b_m=full.satellites.b_m[e],
        )
        left_out = tuple(f"{c.satellite} left out: {c.receiver} differs, B {c.statistic:.3g} > {c.threshold:.3g}" for c in report.channels)
        lacking = decided.sight.lacking(e, self.limits.min_common_satellites)
        n_used = int(np.count_nonzero(full.used[e]))
        self._audit = audit.advance(self._audit, epoch.epoch_ns, report.statistic, bool(decided.clean[e]), n_used, self._audited)
        said = (*remarks(epoch.statuses, self.triangle), *told_apart(epoch.disputes, epoch.epoch_ns))
        reasons = (*verdict.reasons, *left_out, *lacking, *said, *late(epoch.mono_ns, epoch.measured_mono_ns), *self._remarks(decided, e))
        vouched = vouched_for(decided.sight, full, e, self.limits)
        not_monitored = (*report.not_monitored, *signal.silent_on(epoch.statuses, self.site.receiver_names))
        times = (epoch.epoch_ns, epoch.mono_ns, epoch.measured_mono_ns)
        health = self._health_report(*times, reasons, not_monitored, vouched, report.excluded)
        return [report, health, *self._alerts(before, epoch.epoch_ns, epoch.mono_ns, reasons)]

    def _remarks(self, decided: Decided, e: int) -> tuple[str, ...]:
        """What moves no position and stops nothing, in words: clocks, signals of single receivers, a promise that does not hold."""
        names, limits, receivers = self.site.receiver_names, self.limits, decided.full.receivers
        streams = decided.streams
        unusual = signal.Unusual(limits["cn0"], limits["loss"], limits.gain_drop)
        return (
            *clocks.remarks(receivers.clocks, e, names, limits.clock_sigmas),
            *signal.remarks(names, streams.cn0_drop_db[e], streams.lost_share[e], receivers.gain_drop[e], unusual),
            *audit.accusations(self._audit, self._audited),
        )

    def test_itself(self) -> None:
        """Once a minute, of a sound epoch: which checks miss a fault that they should see, in a copy of it. To be called where there is
        time after that epoch; it is made at the latest before the next one, whose verdict goes by it."""
        if self._due is not None:
            self._silent = silent_families(*self._due, self.place)
            self._due = None

    def _verdict(self, decided: Decided, e: int, exclusions: tuple[Exclusion, ...]) -> Verdict:
        last, gps_ns, policy = self._last_clean, int(decided.sight.block.epoch_ns[e]), self.site.integrity.on_satellite_fault
        if decided.clean[e]:
            self._last_clean = LastClean(gps_ns, decided.full.solution.e_enu_m[e])
            stops = policy == "stop" and any(x.is_acute(gps_ns, self.limits) for x in exclusions)
            if not stops and not self._silent:
                return CLEAN
        if self._silent:
            why = f"self test: {', '.join(self._silent)} missed a fault put into a copy of the epoch"
            return Verdict(State.NOT_CONFIRMABLE, Cause.SELF_TEST, reasons=(why,))
        evidence = evidence_of(decided, e, exclusions, last, self.place)
        return full_verdict(decided.full.checks, e, evidence, policy)

    def _interruption(self, interrupted: Interruption) -> list[Output]:
        reasons = (interrupted.why, *remarks(interrupted.statuses, self.triangle))
        verdict = Verdict(State.NOT_CONFIRMABLE, Cause.DATA, interrupted.receivers, reasons=reasons)
        before, self._health = self._health, after_silence(self._health, verdict)
        gps_ns, mono_ns = interrupted.last_epoch_ns, interrupted.mono_ns
        health = self._health_report(gps_ns, mono_ns, mono_ns, reasons, (), (), tuple(sorted(self._memory.exclusions)))
        return [health, *self._alerts(before, gps_ns, mono_ns, reasons)]

    def _health_report(
        self,
        gps_ns: int | None,
        mono_ns: int,
        issued_mono_ns: int,
        reasons: tuple[str, ...],
        not_monitored: tuple[str, ...],
        vouched: tuple[MonitoredSignal, ...],
        excluded: tuple[str, ...],
    ) -> HealthReport:
        self._sequence += 1
        now = self._health
        return HealthReport(
            sequence=self._sequence,
            gps_time_ns=gps_ns,
            mono_ns=mono_ns,
            issued_mono_ns=issued_mono_ns,
            valid_for_ms=self.site.valid_for_ms,
            state=now.state,
            cause=now.cause,
            subjects=now.subjects,
            reasons=reasons,
            not_monitored=not_monitored,
            vouched=vouched,
            excluded=excluded,
        )

    def _alerts(self, before: Health, gps_ns: int | None, mono_ns: int, reasons: tuple[str, ...]) -> list[Alert]:
        now = self._health
        if (before.state, before.cause, before.subjects) == (now.state, now.cause, now.subjects):
            return []
        return [Alert(gps_ns, mono_ns, before.state, now.state, now.cause, now.subjects, reasons)]
