"""The main path: events in, decisions out. Read this first.

`StationMonitor.feed(events)` takes what arrived, in order, and returns what was decided, in order. It reads no clock, no file, no
chance: live and replay call it with the same events and get the same decisions, however the stream is cut into calls.

The way of a block of epochs:
  0. `reception`      bytes become measurements, ephemerides, and what receivers say of themselves
  1. `assembler`      measurements become aligned epochs and interruptions
  2. `sight`          satellite states, residuals at the surveyed points, sigmas, screening
  3. `exclusion`      walk A, with memory: which satellites are used in each epoch
  4. `checks`         positions on those satellites, every statistic, every check
  5. `_epoch`         walk B, with memory: verdict and health, epoch by epoch, interruption by interruption
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

from integrity import audit
from integrity.assembler import AlignedEpoch, Assembler, AssemblerState, Interruption
from integrity.audit import audited_checks
from integrity.checks import BlockChecks, Geometry, Surroundings, check, geometry_of
from integrity.config import SiteConfig
from integrity.events import Event
from integrity.exclusion import Exclusion, Table, Walk, walk, without_channels
from integrity.gnss.ephemeris.broadcast import Ephemeris
from integrity.gnss.ephemeris.store import EphemerisStore
from integrity.gnss.observations import Bools, Layout
from integrity.gnss.positioning import points_at
from integrity.health import Health, after_epoch, after_silence
from integrity.hearsay import remarks
from integrity.limits import derive
from integrity.monitor_memory import MonitorMemory
from integrity.monitors import clocks, signal
from integrity.monitors.single_differences import PairStatistics, captured, captured_receivers
from integrity.monitors.triangles import suspects, swapped_receivers
from integrity.naming import LastClean, named_receiver, stands_elsewhere
from integrity.outputs import Alert, EpochReport, HealthReport, Output
from integrity.receiver_watch import ReceiverMemory, heard_with
from integrity.reception import Reception, ReceptionMemory
from integrity.satellite_watch import SatelliteMemory, watch_satellites
from integrity.satellites import SatelliteStatistics
from integrity.self_test import is_due, silent_families
from integrity.sight import Sight, Sky, observe, sky_of
from integrity.states import Cause, State
from integrity.stream_memory import StreamMemory, StreamStatistics, advance
from integrity.triangle import reference_triangle
from integrity.verdict import CLEAN, Evidence, Verdict, clean_epochs, fails_only, full_verdict, triangle_verdict
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


@dataclass(frozen=True, eq=False)
class _Decided:
    """A block after step 4: with the satellites in use (`full`), and with all of them, which is what the triangle alone goes by.

    `clean`, `clean_alone` (E,): epochs without a failing check; `suspected` (E, R): whom rules (i) to (iii) of naming point at.
    """

    sight: Sight
    memory: StreamMemory
    satellites: SatelliteMemory
    around: Surroundings
    streams: StreamStatistics
    walked: Walk
    full: BlockChecks
    alone: BlockChecks
    clean: Bools
    clean_alone: Bools
    suspected: Bools


class _Last(NamedTuple):
    """What the next epoch probably shares with the last one: its signals, and satellites used (1, S), with and without exclusions."""

    layout: Layout
    sky: Sky
    used: tuple[Bools, ...]


class _Ahead(NamedTuple):
    """What was computed before an epoch was there."""

    sky: Sky
    geometries: tuple[Geometry, ...]


class StationMonitor:
    """Decides for one site. `snapshot()` may be taken between any two calls of `feed`."""

    def __init__(self, site: SiteConfig, snapshot: Snapshot | None = None) -> None:
        start = snapshot or Snapshot(StreamMemory.empty(len(site.receivers)))
        self.site = site
        self.triangle = reference_triangle(site)
        self.limits = derive(site, self.triangle)
        self._points = points_at(self.triangle.pos_ecef_m)
        self._middle_ecef_m = self.triangle.pos_ecef_m.mean(axis=0)
        self._store = EphemerisStore(start.ephemerides)
        self._reception = Reception(site.receiver_names, start.reception, site.protocols)
        self._assembler = Assembler(site.receiver_names, site.epoch_interval_ns, self.limits, start.assembler, self._store)
        self._exclusions: Table = {x.satellite: x for x in start.exclusions}
        self._last_clean = start.last_clean
        self._health = start.health
        self._sequence = start.sequence
        self._streams = start.streams
        self._audited = audited_checks(site, self.limits)
        monitors = start.monitors or MonitorMemory.empty(len(site.receivers))
        self._satellites = SatelliteMemory({of.satellite: of for of in monitors.navigation})
        self._receivers = ReceiverMemory(monitors.clocks, monitors.slow, monitors.gains)
        self._audit = monitors.audit
        self._silent = start.silent
        self._last: _Last | None = None
        self._ahead: _Ahead | None = None

    def feed(self, events: Iterable[Event]) -> list[Output]:
        """Decide what the events complete."""
        if self._assembler.last_epoch_ns is not None:
            self._store.forget_before(self._assembler.last_epoch_ns)
        outputs: list[Output] = []
        run: list[AlignedEpoch] = []
        heard = (decoded for event in events for decoded in self._reception.take(event))
        for item in self._assembler.take(heard):
            if run and (isinstance(item, Interruption) or item.klobuchar != run[0].klobuchar or len(run) == MOST_EPOCHS_PER_BLOCK):
                outputs += self._block(run)
                run = []
            if isinstance(item, Interruption):
                outputs += self._interruption(item)
            else:
                run.append(item)
        return outputs + self._block(run) if run else outputs

    def look_ahead(self) -> None:
        """Compute what the next epoch is going to need, should it go on as the last one did, while there is time. It changes no decision,
        only how soon the next one is there."""
        last_ns, last = self._assembler.last_epoch_ns, self._last
        if last_ns is not None and last is not None:
            next_ns, arrived = np.array([last_ns + self.site.epoch_interval_ns]), (len(self._store),)
            sky = sky_of(last.sky.signals, next_ns, arrived, last.sky.klobuchar, self._store, self._points, self.site, self.limits)
            self._ahead = _Ahead(sky, tuple(geometry_of(sky, used, self.site.integrity, self.triangle) for used in last.used))

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
        return Snapshot(
            streams=self._streams,
            reception=self._reception.memories(),
            assembler=self._assembler.state(),
            ephemerides=tuple(self._store.ephemerides),
            exclusions=tuple(self._exclusions.values()),
            last_clean=self._last_clean,
            health=self._health,
            sequence=self._sequence,
            monitors=MonitorMemory(tuple(self._satellites.navigation.values()), *self._receivers, self._audit),
            silent=self._silent,
        )

    def _block(self, epochs: Sequence[AlignedEpoch]) -> list[Output]:
        decided = self._decided(epochs)
        self._streams, self._exclusions, self._last = decided.memory, decided.walked.table, _last_of(decided)
        self._satellites, self._receivers = decided.satellites, decided.full.memory
        return [output for e, epoch in enumerate(epochs) for output in self._epoch(decided, e, epoch)]

    def _decided(self, epochs: Sequence[AlignedEpoch]) -> _Decided:
        """Steps 2 to 4; remembers nothing."""
        remembered = self._streams.signals_since(epochs[0].epoch_ns - self.limits.remember_satellite_ns)
        layout, sky = self._last and self._last.layout, self._ahead and self._ahead.sky
        sight = observe(epochs, self._store, self._points, self.site, self.limits, remembered, layout, sky)
        memory, streams = advance(self._streams, sight.heard, sight.heard_high, sight.bands, self.limits)
        satellites, watched = watch_satellites(self._satellites, sight, self._middle_ecef_m, self.limits)
        sight = replace(sight, satellites=sight.satellites._replace(watched=watched))
        heard = heard_with(epochs, sight.block.epoch_ns, self.site.receiver_names, self.site.host_clock)
        around = Surroundings(streams, heard, watched, self._receivers)
        screened = sight.satellites.screened
        of_screened = self._geometry(sight.sky, screened)
        on_screened = sight.satellites.statistics_by(of_screened.clocks, of_screened.of_each)
        walked = self._walk(sight, on_screened)

        def checked_by(geometry: Geometry, shown: SatelliteStatistics) -> BlockChecks:
            return check(sight, geometry, shown, around, self._points, self.triangle, self.site, self.limits)

        def checked(used: Bools) -> BlockChecks:
            geometry = self._geometry(sight.sky, used)
            return checked_by(geometry, sight.satellites.statistics_by(geometry.clocks, geometry.of_each))

        alone = checked_by(of_screened, on_screened)
        full = alone if np.array_equal(walked.used, screened) else checked(walked.used)
        if any(walked.channels):
            walked, full = _leave_out_channels(sight, walked, full, checked)
        clean, clean_alone = clean_epochs(full.checks, "full"), clean_epochs(alone.checks, "triangle")
        nobody = np.zeros(full.solution.why.shape, dtype=np.bool_)
        suspected = nobody if clean.all() else suspects(full.triangle.circle_m, full.naming, self.limits)
        return _Decided(sight, memory, satellites, around, streams, walked, full, alone, clean, clean_alone, suspected)

    def _geometry(self, sky: Sky, used: Bools) -> Geometry:
        """The one that was computed ahead, if it is of these satellites."""
        for geometry in self._ahead.geometries if self._ahead else ():
            if geometry.is_of(sky, used):
                return geometry
        return geometry_of(sky, used, self.site.integrity, self.triangle)

    def _walk(self, sight: Sight, on_screened: SatelliteStatistics) -> Walk:
        if self.site.integrity.rule == "triangle":
            n = len(sight.block.epoch_ns)
            return Walk(sight.satellites.screened, [{}] * n, [()] * n, {})
        block = sight.block
        return walk(self._exclusions, sight.satellites, on_screened, block.receivers, block.satellites, block.epoch_ns, self.limits)

    def _epoch(self, decided: _Decided, e: int, epoch: AlignedEpoch) -> list[Output]:
        exclusions = tuple(sorted(decided.walked.tables[e].values(), key=lambda x: x.satellite))
        alone = CLEAN if decided.clean_alone[e] else triangle_verdict(decided.alone.checks, e)
        self._test_itself(decided, e, epoch)
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
        reasons = (*verdict.reasons, *left_out, *lacking, *remarks(epoch.statuses, self.triangle), *self._remarks(decided, e))
        vouched = vouched_for(decided.sight, full, e, self.limits)
        not_monitored = (*report.not_monitored, *signal.silent_on(epoch.statuses, self.site.receiver_names))
        health = self._health_report(epoch.epoch_ns, epoch.mono_ns, reasons, not_monitored, vouched, report.excluded)
        return [report, health, *self._alerts(before, epoch.epoch_ns, epoch.mono_ns, reasons)]

    def _remarks(self, decided: _Decided, e: int) -> tuple[str, ...]:
        """What moves no position and stops nothing, in words: clocks, signals of single receivers, a promise that does not hold."""
        names, limits, receivers = self.site.receiver_names, self.limits, decided.full.receivers
        streams = decided.streams
        unusual = signal.Unusual(limits["cn0"], limits["loss"], limits.gain_drop)
        return (
            *clocks.remarks(receivers.clocks, e, names, limits.clock_sigmas),
            *signal.remarks(names, streams.cn0_drop_db[e], streams.lost_share[e], receivers.gain_drop[e], unusual),
            *audit.accusations(self._audit, self._audited),
        )

    def _test_itself(self, decided: _Decided, e: int, epoch: AlignedEpoch) -> None:
        """Once a minute, in a sound epoch: which checks miss a fault that they should see, in a copy of the epoch."""
        if decided.clean[e] and is_due(epoch.epoch_ns, self.site.epoch_interval_ns):
            site = (self._points, self.triangle, self.site, self.limits)
            self._silent = silent_families(decided.sight, decided.full, decided.around, epoch, e, *site)

    def _verdict(self, decided: _Decided, e: int, exclusions: tuple[Exclusion, ...]) -> Verdict:
        full, limits = decided.full, self.limits
        gps_ns, e_enu_m = int(decided.sight.block.epoch_ns[e]), full.solution.e_enu_m[e]
        last = self._last_clean
        if decided.clean[e]:
            self._last_clean = LastClean(gps_ns, e_enu_m)
            if not exclusions and not self._silent:
                return CLEAN
        if self._silent:
            why = f"self test: {', '.join(self._silent)} missed a fault put into a copy of the epoch"
            return Verdict(State.NOT_CONFIRMABLE, Cause.SELF_TEST, reasons=(why,))
        evidence = Evidence(
            receivers=self.site.receiver_names,
            repeating=decided.streams.repeating[e],
            named=self._named(decided, e, last),
            collapsed=bool(full.naming.collapse_fit[e] <= limits.collapse_fit),
            captured=self._captured(full, e),
            exclusions=exclusions,
            enough_without_exclusion=bool(decided.alone.solution.n_used[e].min() >= limits.min_common_satellites),
            swapped=swapped_receivers(e_enu_m, self.triangle, limits),
        )
        return full_verdict(full.checks, e, evidence, self.site.integrity.on_satellite_fault)

    def _named(self, decided: _Decided, e: int, last: LastClean | None) -> Bools:
        """The receiver (R,) that may be named, if any."""
        full, of, limits = decided.full, decided.sight.satellites.epoch(e), self.limits
        ratio, gps_ns = full.naming.log_likelihood_ratio[e], int(decided.sight.block.epoch_ns[e])
        variances = (full.var.common[e], full.var.differential[e])
        named = named_receiver(decided.suspected[e], ratio, full.solution.e_enu_m[e], *variances, last, gps_ns, self.site.integrity, limits)
        if not named.any():
            return named
        used = full.used[e : e + 1]
        return named & stands_elsewhere(of.los_enu, of.prefit_m, of.sigma_differential_m, used, of.system_of, of.n_systems, limits)

    def _captured(self, full: BlockChecks, e: int) -> Bools:
        """Receivers (R,) of the pairs that hear one transmitter: those of them that are off, since one at its own point may be what the
        other is drawn to; all where none is."""
        collapse, misfit, separation, dof = full.pairs
        one = slice(e, e + 1)
        of_epoch = PairStatistics(collapse[one], misfit[one], separation[one], dof[one])
        limits = self.limits
        pairs = captured(of_epoch, limits["capture"], limits.least_separation, limits.missed_detection)
        receivers: Bools = captured_receivers(pairs, len(self.site.receivers))[0]
        off = receivers & ~(full.triangle.circle_m[e] <= limits.radius_m)
        return off if off.any() else receivers

    def _interruption(self, interrupted: Interruption) -> list[Output]:
        reasons = (interrupted.why, *remarks(interrupted.statuses, self.triangle))
        verdict = Verdict(State.NOT_CONFIRMABLE, Cause.DATA, interrupted.receivers, reasons=reasons)
        before, self._health = self._health, after_silence(self._health, verdict)
        gps_ns, mono_ns = interrupted.last_epoch_ns, interrupted.mono_ns
        health = self._health_report(gps_ns, mono_ns, reasons, (), (), tuple(sorted(self._exclusions)))
        return [health, *self._alerts(before, gps_ns, mono_ns, reasons)]

    def _health_report(
        self,
        gps_ns: int | None,
        mono_ns: int,
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


def _last_of(decided: _Decided) -> _Last:
    alone, full = decided.alone.used[-1:], decided.full.used[-1:]
    return _Last(decided.sight.layout, decided.sight.sky, (full,) if np.array_equal(alone, full) else (full, alone))


def _leave_out_channels(sight: Sight, walked: Walk, full: BlockChecks, checked: Callable[[Bools], BlockChecks]) -> tuple[Walk, BlockChecks]:
    """Leave channels out where nothing but the B-value fails with them, and nothing fails without them; see `exclusion`."""
    could_help = fails_only(full.checks, "b_value") & np.array([bool(channels) for channels in walked.channels])
    satellites = sight.block.satellites
    if not could_help.any():
        return without_channels(walked, satellites, could_help), full
    without = checked(without_channels(walked, satellites, could_help).used)
    kept_out = without_channels(walked, satellites, could_help & clean_epochs(without.checks, "full"))
    return kept_out, checked(kept_out.used)
