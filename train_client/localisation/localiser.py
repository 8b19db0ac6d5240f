"""The main path on board: events in, positions out. Read this first.

`TrainLocaliser.feed(events)` takes what arrived, in order, and returns what was decided, in order. It reads no clock, no file, no chance:
live and replay call it with the same events and get the same positions.

The way of an epoch, and of a message:
  1. `integrity.reception`      bytes of the antennas become measurements and navigation messages
  2. `positioning.navigation`   navigation messages count only where all antennas have heard the same
  3. `integrity.assembler`      rows of all antennas become aligned epochs; silence is noticed
  4. `fixes`                    one place along the track, or why there is none
  a. `grounds`                  of each station: its health counts only if signed, for this site, next of the boot that answered a challenge
  b. `trust`                    may GNSS be used: one table; of several stations the worst, and which they are the map says for each place
  c. `coverage`                 a fix stays provisional until NORMAL messages of all of them cover its epoch
  d. `stop`                     trust that is lost asks for a stop, until somebody releases it
"""

from collections.abc import Iterable, Mapping
from typing import NamedTuple

from integrity.assembler import AlignedEpoch, Assembler, Interruption
from integrity.errors import ConfigError
from integrity.events import EphemerisReceived, Heard, InputLost, RawBytes, Tick
from integrity.gnss.ephemeris.store import EphemerisStore
from integrity.reception import Reception
from train_client.config import TrainConfig
from train_client.events import ChallengeAnswered, ChallengeSent, HealthReceived, StopReleased, TrainEvent
from train_client.limits import Timing, derive, silence_ns
from train_client.localisation.coverage import Coverage, Signals
from train_client.localisation.fixes import FixMaker
from train_client.localisation.grounds import Grounds, Spoken
from train_client.localisation.memory import LocaliserMemory
from train_client.localisation.progress import Progress
from train_client.outputs import (
    Confirmed,
    Fix,
    MessageRefused,
    PositionReport,
    Status,
    StopChange,
    TrainOutput,
    TrustChange,
)
from train_client.positioning.navigation import NavigationAgreement
from train_client.stop import after_moment, after_valid, due_ns, released
from train_client.track.track_map import TrackMap
from train_client.track.vouching import stations_at, stations_on
from train_client.trust import DENIED, TrustState

MOST_SOLUTIONS = 3  # of an epoch: the place names the stations, they name the signals, and these the place


class _Placed(NamedTuple):
    """A fix, the signals that were allowed for it (None: all), and the stations whose word counts there, or why nobody's does."""

    epoch: AlignedEpoch
    fix: Fix
    signals: Signals | None
    sites: tuple[str, ...]
    why_none: str


class TrainLocaliser:
    """Decides for one train. `keys` are the raw public keys trusted for each of its stations, by site.

    Raises ConfigError where a station of the train vouches for nothing on the map.
    """

    def __init__(
        self, train: TrainConfig, track: TrackMap, keys: Mapping[str, Iterable[bytes]], memory: LocaliserMemory | None = None
    ) -> None:
        start = memory or LocaliserMemory()
        self.train = train
        self.track = track
        _refuse_unmapped(train, track)
        limits = derive()
        timing = Timing(limits.alignment_tolerance_ns, limits.alignment_tolerance_ns, silence_ns(train.epoch_interval_ns))
        self._store = EphemerisStore(start.ephemerides)
        self._reception = Reception(train.antenna_ids, start.reception, train.protocols)
        self._agreement = NavigationAgreement(train.antenna_ids, start.told)
        self._assembler = Assembler(train.antenna_ids, train.epoch_interval_ns, timing, start.assembler, self._store)
        self._fixes = FixMaker(train, track, self._store, limits, start.fixes)
        self._progress = Progress(train, track, start.progress)
        self._grounds = Grounds(train, track.sha256, keys, start.grounds)
        self._coverage: Coverage[_Placed] = Coverage({site: start.vouched.get(site, ()) for site in train.stations})
        self._here = train.stations if start.here is None else start.here
        self._confirmed_by = start.confirmed_by
        self._stop = start.stop
        self._mono_ns = start.mono_ns
        self._sequence = start.sequence
        self._confirmed = start.confirmed

    def snapshot(self) -> LocaliserMemory:
        """The whole memory, as values. Fixes that wait for their confirmation are let go: they stay provisional."""
        self._coverage.let_go()
        return LocaliserMemory(
            reception=self._reception.memories(),
            told=self._agreement.memory(),
            assembler=self._assembler.state(),
            ephemerides=tuple(self._store.ephemerides),
            fixes=self._fixes.memory(),
            progress=self._progress.memory(),
            grounds=self._grounds.memories(),
            vouched={site: self._coverage.vouched(site) for site in self.train.stations},
            here=self._here,
            confirmed_by=self._confirmed_by,
            stop=self._stop,
            mono_ns=self._mono_ns,
            sequence=self._sequence,
            confirmed=self._confirmed,
        )

    def feed(self, events: Iterable[TrainEvent]) -> list[TrainOutput]:
        """Decide what the events complete."""
        return [output for event in events for output in self._event(event)]

    def look_ahead(self) -> None:
        """Compute what the next epoch needs while there is time. It changes no decision, only how soon the next one is there."""
        if self._assembler.last_epoch_ns is not None:
            self._fixes.look_ahead(self._assembler.last_epoch_ns + self.train.epoch_interval_ns)

    @property
    def next_deadline_ns(self) -> int | None:
        """Monotonic time at which the shell should send a tick: trust runs out, a stop is due, or a stream falls silent."""
        silent_ns = self._assembler.deadline_ns
        times = [self._grounds.next_change_ns, due_ns(self._stop, self.train.stop), None if silent_ns is None else silent_ns + 1]
        return min((t for t in times if t is not None), default=None)

    @property
    def challenge_due(self) -> tuple[int, str]:
        """Monotonic time at which the shell should challenge a station next, and which."""
        return self._grounds.challenge_due

    @property
    def trust(self) -> TrustState:
        """As of the last event, where the train is."""
        return self._grounds.trust(self._here)

    def _event(self, event: TrainEvent) -> list[TrainOutput]:
        stop_before = self._stop.state
        outputs = self._time_passes(event.mono_ns)
        match event:
            case HealthReceived():
                outputs += self._health(event)
            case ChallengeSent():
                self._grounds.challenged(event)
            case ChallengeAnswered():
                outputs += self._answered(event)
            case StopReleased():
                outputs += self._released(event)
            case RawBytes() | InputLost() | Tick():
                outputs += self._receivers(event)
        self._stop_moves(event.mono_ns)
        return outputs if self._stop.state is stop_before else outputs + self._stop_told(outputs, event.mono_ns)

    # ---- the ground

    def _time_passes(self, mono_ns: int) -> list[TrainOutput]:
        trust_before = self.trust
        before_ns, self._mono_ns = self._mono_ns, mono_ns
        outputs = [output for spoken in self._grounds.time_passes(mono_ns, before_ns) for output in self._said(spoken, mono_ns)]
        return outputs + self._if_lost(trust_before, outputs, mono_ns)

    def _health(self, event: HealthReceived) -> list[TrainOutput]:
        trust_before = self.trust
        spoken = self._grounds.health(event)
        if isinstance(spoken, str):
            return [MessageRefused(event.mono_ns, spoken)]
        outputs = self._said(spoken, event.mono_ns)
        return outputs + self._if_lost(trust_before, outputs, event.mono_ns)

    def _answered(self, event: ChallengeAnswered) -> list[TrainOutput]:
        spoken = self._grounds.answered(event)
        return [] if spoken is None else self._said(spoken, event.mono_ns)

    def _said(self, spoken: Spoken, mono_ns: int) -> list[TrainOutput]:
        """What a station said, or its silence, changes."""
        site, before, said = spoken
        if said.refusal:
            return [MessageRefused(mono_ns, said.refusal, site, self._grounds.is_alarmed(site, mono_ns))]
        if said.trust.state is not TrustState.NORMAL and said.trust != before:
            self._coverage.forget(site)
        outputs: list[TrainOutput] = []
        if said.trust.state is not before.state:
            outputs.append(TrustChange(mono_ns, site, before.state, said.trust.state, said.reasons))
        if said.vouched is not None:
            outputs += [self._confirmed_or_not(waited, mono_ns) for waited in self._coverage.vouch(site, said.vouched)]
        return outputs

    def _confirmed_or_not(self, waited: _Placed, mono_ns: int) -> PositionReport:
        """What waited for the last of its stations: solved again where other signals may be used than were."""
        same = waited.signals == self._coverage.of(waited.epoch.epoch_ns, waited.sites)
        return self._judged(waited if same else self._place(waited.epoch, waited.sites), mono_ns)

    def _released(self, event: StopReleased) -> list[TrainOutput]:
        after = released(self._stop)
        if isinstance(after, str):
            return [StopChange(event.mono_ns, self._stop, after)]
        self._stop = after
        return []

    def _if_lost(self, trust_before: TrustState, outputs: list[TrainOutput], mono_ns: int) -> list[TrainOutput]:
        """Trust that is lost is told at once, and that there is no position until the next epoch."""
        trust = self.trust
        if trust_before is not TrustState.NORMAL or trust is TrustState.NORMAL:
            return []
        why = next((output.reasons for output in outputs if isinstance(output, TrustChange)), ())
        return [self._report(mono_ns, Status.UNKNOWN, (f"trust is {trust.value}", *why), None)]

    def _stop_told(self, outputs: list[TrainOutput], mono_ns: int) -> list[TrainOutput]:
        """A stop that is asked for, or no longer, is told at once too."""
        change = StopChange(mono_ns, self._stop)
        told = any(isinstance(output, PositionReport) and output.stop == self._stop for output in outputs)
        return [change] if told else [change, self._report(mono_ns, Status.UNKNOWN, ("no epoch yet since the stop has changed",), None)]

    def _stop_moves(self, mono_ns: int) -> None:
        self._stop = after_moment(self._stop, self.trust, self._grounds.against(self._here), mono_ns, self.train.stop)

    # ---- the antennas

    def _receivers(self, event: RawBytes | InputLost | Tick) -> list[TrainOutput]:
        if self._assembler.last_epoch_ns is not None:
            self._store.forget_before(self._assembler.last_epoch_ns)
        outputs: list[TrainOutput] = []
        for item in self._assembler.take(self._agreed(event)):
            if isinstance(item, Interruption):
                self._fixes.lost()
                outputs.append(self._report(item.mono_ns, Status.UNKNOWN, (item.why,), None))
            else:
                outputs.append(self._position(item))
        return outputs

    def _agreed(self, event: RawBytes | InputLost | Tick) -> Iterable[Heard]:
        """What was heard, with those navigation messages that all antennas have heard alike."""
        for heard in self._reception.take(event):
            if not isinstance(heard, EphemerisReceived):
                yield heard
            elif isinstance(event, RawBytes):
                self._agreement.forget_before(self._assembler.last_epoch_ns or 0)
                for ephemeris in self._agreement.told(event.receiver, heard.ephemeris):
                    yield EphemerisReceived(heard.mono_ns, ephemeris)

    def _position(self, epoch: AlignedEpoch) -> PositionReport:
        """The place in an epoch: VALID if it is covered, PROVISIONAL as long as it may still be, UNKNOWN where there is none."""
        placed = self._place(epoch, self._here)
        self._here = placed.sites
        if not placed.why_none and self._coverage.of(epoch.epoch_ns, placed.sites) is None:
            self._coverage.wait(epoch.epoch_ns, placed.sites, placed)
        return self._judged(placed, epoch.mono_ns)

    def _place(self, epoch: AlignedEpoch, sites: tuple[str, ...]) -> _Placed:
        """Solved with what the stations of the place itself vouch for."""
        signals = self._coverage.likely(epoch.epoch_ns, sites)
        fix, why_none = self._fixes.fix(epoch, signals, self._agreement.mismatched), ""
        for _ in range(MOST_SOLUTIONS - 1):
            there = self._whose_word_counts(fix, sites)
            if isinstance(there, str):
                sites, why_none = (), there
                break
            before, signals, sites = signals, self._coverage.likely(epoch.epoch_ns, there), there
            if signals == before:
                break
            fix = self._fixes.fix(epoch, signals, self._agreement.mismatched)
        return _Placed(epoch, fix, signals, sites, why_none)

    def _whose_word_counts(self, fix: Fix, sites: tuple[str, ...]) -> tuple[str, ...] | str:
        """Stations of the place, and of the one that was confirmed last: counterfeit signals must not lead to where nobody sees them.

        Before there is one, all that the train listens to; where there is no place, as before. In words where the map names nobody.
        """
        if fix.front is None:
            return sites
        there = self._stations_at(fix)
        if isinstance(there, str):
            return there
        more = self.train.stations if self._confirmed_by is None else self._confirmed_by
        return tuple(dict.fromkeys((*there, *more)))

    def _stations_at(self, fix: Fix) -> tuple[str, ...] | str:
        """That vouch for where its antennas and its ends are; in words for which of them nobody does."""
        places = [fix.front, fix.rear, *(antenna.place for antenna in fix.antennas)]
        return stations_at(self.track, [(place.edge, place.offset_m) for place in places if place is not None])

    def _judged(self, placed: _Placed, mono_ns: int) -> PositionReport:
        """An epoch that has waited for its confirmation needs that of where the train is by now too."""
        fix, trust = placed.fix, self._grounds.trust({*placed.sites, *self._here})
        if fix.front is None:
            return self._report(mono_ns, Status.UNKNOWN, fix.reasons, fix)
        if trust in DENIED:
            return self._report(mono_ns, Status.UNKNOWN, (f"trust is {trust.value}",), fix)
        if placed.why_none:
            return self._report(mono_ns, Status.PROVISIONAL, (placed.why_none,), fix)
        if trust is not TrustState.NORMAL or not self._is_covered(placed):
            return self._report(mono_ns, Status.PROVISIONAL, (f"no NORMAL message covers this epoch; trust is {trust.value}",), fix)
        objection = self._progress.objection(fix)
        if objection:
            return self._report(mono_ns, Status.UNKNOWN, (objection,), fix)
        self._confirm(fix)
        return self._report(mono_ns, Status.VALID, (), fix)

    def _is_covered(self, placed: _Placed) -> bool:
        """Whether all whose word counts there vouch for it as it was solved."""
        there = self._whose_word_counts(placed.fix, placed.sites)
        signals = self._coverage.of(placed.fix.gps_time_ns, placed.sites)
        return not isinstance(there, str) and set(there) <= set(placed.sites) and signals is not None and placed.signals == signals

    def _confirm(self, fix: Fix) -> None:
        there = self._stations_at(fix)
        assert fix.front is not None and not isinstance(there, str)
        self._progress.confirm(fix)
        self._confirmed, self._confirmed_by = Confirmed(fix.front, fix.gps_time_ns), there

    def _report(self, mono_ns: int, status: Status, reasons: tuple[str, ...], fix: Fix | None) -> PositionReport:
        self._sequence += 1
        if status is Status.VALID:
            self._stop = after_valid(self._stop)
        self._stop_moves(mono_ns)
        stations = self._grounds.reports(mono_ns)
        return PositionReport(self._sequence, mono_ns, status, reasons, fix, self.trust, self._here, stations, self._stop, self._confirmed)


def _refuse_unmapped(train: TrainConfig, track: TrackMap) -> None:
    known = stations_on(track)
    for site in train.stations:
        if site not in known:
            named = f"only {', '.join(known)}" if known else "no station at all"
            raise ConfigError(
                f"station {site} vouches for no stretch of map {track.id}, which names {named}: "
                f'add sections with "station": "{site}" to it, or take the station out of the train file'
            )
