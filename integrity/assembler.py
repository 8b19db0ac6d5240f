"""From measurements to aligned epochs: stateful and cheap. Keeps epochs and interruptions in the order in which they were completed.

An aligned epoch is one row of every receiver at one nominal time. A row too far from a nominal time, a second row for the same
time, and a row whose time has passed are dropped and counted; rows that never find their partners are dropped when a later epoch
is complete. Two rows of one receiver at one time that do not say the same are two receivers on one link: nothing is normal then.
"""

from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Protocol

from integrity.events import EphemerisReceived, Heard, InputLost, IonosphereReceived, ObservationsReceived, StatusReceived, Tick, ToldApart
from integrity.gnss.atmosphere import Klobuchar
from integrity.gnss.ephemeris.store import EphemerisStore
from integrity.gnss.observations import ObservationRow, same_measurements
from integrity.gnss.receiver_status import ReceiverStatus
from integrity.lateness import Fastest, after_epoch
from integrity.monitors.told import Dispute

MOST_PENDING_EPOCHS = 64  # of receivers whose times never meet

UNALIGNED = "no epoch common to all receivers"

Statuses = tuple[tuple[str, ReceiverStatus], ...]  # by receiver, those that have said something


class AlignmentLimits(Protocol):
    """How far a time tag may be from its epoch, how near two are that are the same, and how long a silence may be."""

    @property
    def alignment_tolerance_ns(self) -> int:
        """Of a time tag, from its epoch."""

    @property
    def same_time_ns(self) -> int:
        """Between two time tags of one receiver."""

    @property
    def silence_ns(self) -> int:
        """Of a stream."""


@dataclass(frozen=True)
class AlignedEpoch:
    """Rows in the order of the receivers, complete at `mono_ns`, measured at `measured_mono_ns` (`lateness`).

    `arrived` ephemerides, ionosphere, hearsay and disputes known by then, when each receiver was heard last (R,), and the last tick.
    """

    epoch_ns: int
    mono_ns: int
    measured_mono_ns: int
    rows: tuple[ObservationRow, ...]
    arrived: int
    klobuchar: Klobuchar | None
    statuses: Statuses
    heard_mono_ns: tuple[int, ...]
    tick: Tick | None
    disputes: tuple[Dispute, ...] = ()


@dataclass(frozen=True)
class Interruption:
    """At `mono_ns` receivers are silent, or their bytes cannot be relied on, and why; none named when all send but share no epoch."""

    mono_ns: int
    receivers: tuple[str, ...]
    last_epoch_ns: int | None
    why: str
    statuses: Statuses = ()


@dataclass(frozen=True)
class AssemblerState:
    """What the assembler remembers between calls; times are GPS (`last_epoch_ns`) and monotonic (`heard_ns`, `aligned_ns`)."""

    pending: tuple[tuple[int, tuple[ObservationRow, ...]], ...] = ()
    last_epoch_ns: int | None = None
    heard_ns: tuple[tuple[str, int], ...] = ()
    aligned_ns: int | None = None
    silence_told: bool = False  # since the last aligned epoch
    klobuchar: Klobuchar | None = None
    dropped: tuple[tuple[str, int], ...] = ()
    refused_ephemerides: int = 0
    last_rows: tuple[ObservationRow, ...] = ()
    statuses: Statuses = ()
    tick: Tick | None = None
    fastest: Fastest | None = None


class Assembler:
    """See the module. `store` is shared with the monitor, which chooses from it; `disputes` are those of the reception's memory."""

    def __init__(
        self,
        receivers: tuple[str, ...],
        interval_ns: int,
        limits: AlignmentLimits,
        state: AssemblerState,
        store: EphemerisStore,
        disputes: tuple[Dispute, ...] = (),
    ) -> None:
        self._receivers, self._interval_ns, self._limits, self._store = receivers, interval_ns, limits, store
        self._pending = {epoch: {row.receiver: row for row in rows} for epoch, rows in state.pending}
        self.last_epoch_ns = state.last_epoch_ns
        self._heard_ns = dict(state.heard_ns)
        self._aligned_ns = state.aligned_ns
        self._silence_told = state.silence_told
        self._klobuchar = state.klobuchar
        self.dropped = Counter(dict(state.dropped))
        self._refused_ephemerides = state.refused_ephemerides
        self._last_rows: Mapping[str, ObservationRow] = {row.receiver: row for row in state.last_rows}
        self._statuses = state.statuses
        self._last_tick = state.tick
        self._fastest = state.fastest
        self._disputes = disputes

    def state(self) -> AssemblerState:
        """For a snapshot."""
        return AssemblerState(
            pending=tuple((epoch, tuple(rows.values())) for epoch, rows in self._pending.items()),
            last_epoch_ns=self.last_epoch_ns,
            heard_ns=tuple(sorted(self._heard_ns.items())),
            aligned_ns=self._aligned_ns,
            silence_told=self._silence_told,
            klobuchar=self._klobuchar,
            dropped=tuple(sorted(self.dropped.items())),
            refused_ephemerides=self._refused_ephemerides,
            last_rows=tuple(self._last_rows.values()),
            statuses=self._statuses,
            tick=self._last_tick,
            fastest=self._fastest,
        )

    @property
    def deadline_ns(self) -> int | None:
        """Monotonic time after which a tick will find a silent stream; None before the first event."""
        heard = [self._heard_ns.get(r) for r in self._receivers] + [self._aligned_ns]
        known = [t for t in heard if t is not None]
        return min(known) + self._limits.silence_ns if known else None

    def take(self, events: Iterable[Heard]) -> list[AlignedEpoch | Interruption]:
        """Epochs and interruptions, in the order in which the events complete them."""
        out: list[AlignedEpoch | Interruption] = []
        for event in events:
            match event:
                case ObservationsReceived():
                    out += self._observations(event)
                case Tick():
                    out += self._tick(event)
                case EphemerisReceived():
                    if event.ephemeris.implausibility() is None:
                        self._store.add(event.ephemeris)
                    else:
                        self._refused_ephemerides += 1
                case IonosphereReceived():
                    if event.klobuchar.plausible():
                        self._klobuchar = event.klobuchar
                case StatusReceived():
                    self._hearsay(event)
                case ToldApart():
                    self._disputes = event.disputes
                case InputLost():
                    lost = f"overloaded: bytes of {event.receiver} were lost"
                    out.append(self._interruption(event.mono_ns, (event.receiver,), lost))
        return out

    def _observations(self, event: ObservationsReceived) -> list[AlignedEpoch | Interruption]:
        row = event.row
        if row.receiver not in self._receivers:
            self.dropped[row.receiver] += 1
            return []
        self._start_listening(event.mono_ns)
        self._heard_ns[row.receiver] = event.mono_ns
        epoch_ns = nominal_epoch_ns(row.receive_time_ns, self._interval_ns)
        off_grid = abs(row.receive_time_ns - epoch_ns) > self._limits.alignment_tolerance_ns
        past = self.last_epoch_ns is not None and epoch_ns <= self.last_epoch_ns
        rows = self._last_rows if epoch_ns == self.last_epoch_ns else self._pending.get(epoch_ns, {})
        if off_grid or past or row.receiver in rows:
            self.dropped[row.receiver] += 1
            if row.receiver in rows and self._contradict(rows[row.receiver], row):
                why = f"{row.receiver} measured twice at one time, differently: two receivers on one link?"
                return [self._interruption(event.mono_ns, (row.receiver,), why)]
            return []
        self._pending[epoch_ns] = {**rows, row.receiver: row}
        if len(rows) + 1 < len(self._receivers):
            if len(self._pending) > MOST_PENDING_EPOCHS:
                self._give_up(next(iter(self._pending)))
            return []
        return self._completed(epoch_ns, event.mono_ns)

    def _contradict(self, first: ObservationRow, second: ObservationRow) -> bool:
        """Whether two rows of one time differ; rows of a receiver that merely sends more often than it should are of other times."""
        apart_ns = abs(second.receive_time_ns - first.receive_time_ns)
        return apart_ns <= self._limits.same_time_ns and not same_measurements(first, second)

    def _completed(self, epoch_ns: int, mono_ns: int) -> list[AlignedEpoch | Interruption]:
        complete = self._pending.pop(epoch_ns)
        for earlier in [t for t in self._pending if t < epoch_ns]:
            self._give_up(earlier)
        gap: list[AlignedEpoch | Interruption] = []
        silent = self._aligned_ns is not None and mono_ns - self._aligned_ns > self._limits.silence_ns
        if silent and not self._silence_told:
            gap = [self._interruption(mono_ns, (), UNALIGNED)]  # no tick came to notice it
        self.last_epoch_ns, self._aligned_ns, self._silence_told, self._last_rows = epoch_ns, mono_ns, False, complete
        self._fastest = after_epoch(self._fastest, epoch_ns, mono_ns)
        measured_mono_ns = self._fastest.measured_mono_ns(epoch_ns)
        rows_in_order = tuple(complete[r] for r in self._receivers)
        heard_ns = tuple(self._heard_ns[r] for r in self._receivers)
        known = (len(self._store), self._klobuchar, self._statuses, heard_ns, self._last_tick, self._disputes)
        return [*gap, AlignedEpoch(epoch_ns, mono_ns, measured_mono_ns, rows_in_order, *known)]

    def _give_up(self, epoch_ns: int) -> None:
        self.dropped.update(self._pending.pop(epoch_ns).keys())

    def _hearsay(self, event: StatusReceived) -> None:
        if event.receiver in self._receivers:
            said = dict(self._statuses)
            before = said.get(event.receiver)
            after = event.status if before is None else before.updated(event.status)
            if after != before:
                said[event.receiver] = after
                self._statuses = tuple(sorted(said.items()))

    def _tick(self, tick: Tick) -> list[AlignedEpoch | Interruption]:
        self._start_listening(tick.mono_ns)
        self._last_tick = tick
        silent = tuple(r for r in self._receivers if tick.mono_ns - self._heard_ns[r] > self._limits.silence_ns)
        unaligned = self._aligned_ns is not None and tick.mono_ns - self._aligned_ns > self._limits.silence_ns
        if not (silent or unaligned):
            return []
        self._silence_told = True
        return [self._interruption(tick.mono_ns, silent, f"silent: {', '.join(silent)}" if silent else UNALIGNED)]

    def _interruption(self, mono_ns: int, receivers: tuple[str, ...], why: str) -> Interruption:
        return Interruption(mono_ns, receivers, self.last_epoch_ns, why, self._statuses)

    def _start_listening(self, mono_ns: int) -> None:
        """A receiver that was never heard is silent from the first event on, not from the beginning of time."""
        for receiver in self._receivers:
            self._heard_ns.setdefault(receiver, mono_ns)
        if self._aligned_ns is None:
            self._aligned_ns = mono_ns


def nominal_epoch_ns(receive_time_ns: int, interval_ns: int) -> int:
    """The multiple of the epoch interval, in GPS time, nearest to a receiver's time tag."""
    return (receive_time_ns + interval_ns // 2) // interval_ns * interval_ns
