"""One fault on one stage: what the monitor said, when, of whom, and what it let through."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import islice
from typing import NamedTuple

import numpy as np

from integrity.events import Event
from integrity.gnss.gps_time import NS_PER_S
from integrity.outputs import EpochReport, HealthReport, Output
from integrity.states import Cause, State
from integrity.station_monitor import StationMonitor
from recordings.campaign.stage import Stage
from recordings.faults import Fault, inject

EPOCHS_AFTER = 5  # what is said so late after the end of a fault is still of the fault
EVENTS_AT_ONCE = 200  # of three receivers some 50 epochs: blocks are cheaper than epochs, and what is decided is the same


class Said(NamedTuple):
    """What was published at a GPS time; `report` is of the epoch, None while a stream is silent."""

    gps_ns: int
    state: State
    cause: Cause
    names: frozenset[str]  # subjects, and satellites excluded
    report: EpochReport | None

    @property
    def alerts(self) -> bool:
        """Whether it is anything else than NORMAL without exclusions."""
        return self.state is not State.NORMAL or bool(self.names)


@dataclass(frozen=True)
class Trial:
    """Times count from the fault's first epoch, None: never. `cause` is that of the first epoch that is not NORMAL or excludes something,
    `causes` and `named` what and who was named in any. `shift_m`: the farthest that the fault moved a receiver, horizontally, before
    anything was said, and `shift_at_alert_m` until it was, that epoch included; `hazard`: NORMAL while a receiver was solved beyond the
    tolerance."""

    detected_s: float | None
    triangle_detected_s: float | None
    cause: Cause
    causes: frozenset[Cause]
    named: frozenset[str]
    shift_m: float
    shift_at_alert_m: float
    hazard: bool


def play(
    stage: Stage,
    faults: Sequence[Fault],
    tolerance_m: float,
    seed: int = 0,
    watched_s: float | None = None,
    epochs_after: int = EPOCHS_AFTER,
) -> Trial:
    """Faults on a stage, until so many epochs after they end, or until so long after the first of them is caught; ConfigError where they
    would change nothing."""
    first_ns = min(fault.start_ns for fault in faults)
    last_ns = max(fault.end_ns or stage.epoch_ns[-1] for fault in faults)
    memory = stage.memory_before(first_ns)
    events = stage.events_until(memory, last_ns + epochs_after * stage.site.epoch_interval_ns)
    outputs = _fed(StationMonitor(stage.site, memory.snapshot), inject(events, faults, stage.site, seed, memory.snapshot))
    watched_ns = None if watched_s is None else round(watched_s * NS_PER_S)
    return trial_of(list(watched(published(outputs), first_ns, watched_ns)), stage, first_ns, tolerance_m)


def _fed(monitor: StationMonitor, events: Iterable[Event]) -> Iterator[Output]:
    """What a monitor decides, no further than it is asked for."""
    rest = iter(events)
    while some := list(islice(rest, EVENTS_AT_ONCE)):
        yield from monitor.feed(some)


def watched(said: Iterable[Said], first_ns: int, watched_ns: int | None) -> Iterator[Said]:
    """What is said from the first faulty epoch on, until so long after the first alert."""
    until_ns: int | None = None
    for one in said:
        if until_ns is not None and one.gps_ns > until_ns:
            return
        if one.gps_ns >= first_ns:
            if until_ns is None and watched_ns is not None and one.alerts:
                until_ns = one.gps_ns + watched_ns
            yield one


def published(outputs: Iterable[Output]) -> Iterator[Said]:
    """Health after each epoch, and while a stream is silent by the time that passes (the monotonic clock of a stage is GPS time)."""
    report: EpochReport | None = None
    for output in outputs:
        if isinstance(output, EpochReport):
            report = output
        elif isinstance(output, HealthReport):
            of_epoch = report is not None and report.gps_time_ns == output.gps_time_ns
            gps_ns = output.gps_time_ns if of_epoch and output.gps_time_ns is not None else output.mono_ns
            yield Said(gps_ns, output.state, output.cause, frozenset((*output.subjects, *output.excluded)), report if of_epoch else None)
            report = None


def trial_of(published_since: Sequence[Said], stage: Stage, first_ns: int, tolerance_m: float) -> Trial:
    """What was published from the first faulty epoch on amounts to."""
    told = [said for said in published_since if said.alerts]
    alone = [said for said in published_since if said.report is None or said.report.triangle_alone is not State.NORMAL]
    before = [_shift_m(said, stage) for said in published_since if not told or said.gps_ns < told[0].gps_ns]
    at_alert = [_shift_m(said, stage) for said in told[:1]]
    return Trial(
        detected_s=_elapsed_s(told, first_ns),
        triangle_detected_s=_elapsed_s(alone, first_ns),
        cause=_cause(told[0]) if told else Cause.NONE,
        causes=frozenset(map(_cause, told)),
        named=frozenset(name for said in told for name in said.names),
        shift_m=max(before, default=0.0),
        shift_at_alert_m=max(before + at_alert, default=0.0),
        hazard=any(said.state is State.NORMAL and _farthest_m(said) > tolerance_m for said in published_since),
    )


def _elapsed_s(said: Sequence[Said], first_ns: int) -> float | None:
    return (said[0].gps_ns - first_ns) / NS_PER_S if said else None


def _cause(said: Said) -> Cause:
    """NORMAL with exclusions has named satellites, or a constellation, too."""
    if said.cause is not Cause.NONE:
        return said.cause
    by_constellation = said.report is not None and any(x.check == "constellation" for x in said.report.exclusions)
    return Cause.CONSTELLATION if by_constellation else Cause.SATELLITE


def _shift_m(said: Said, stage: Stage) -> float:
    """How far the fault has moved any receiver, against the same epoch without it."""
    if said.report is None or said.gps_ns not in stage.reports:
        return 0.0
    moved = (said.report.e_enu_m - stage.reports[said.gps_ns].e_enu_m)[:, :2]
    return float(np.hypot(moved[:, 0], moved[:, 1]).max())


def _farthest_m(said: Said) -> float:
    if said.report is None:
        return 0.0
    return float(np.hypot(said.report.e_enu_m[:, 0], said.report.e_enu_m[:, 1]).max())
