"""One fault on one stage: what the monitor said, when, of whom, and what it let through."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from integrity.gnss.gps_time import NS_PER_S
from integrity.outputs import EpochReport, HealthReport, Output
from integrity.states import Cause, State
from integrity.station_monitor import StationMonitor
from recordings.campaign.stage import Stage
from recordings.faults import Fault, inject

EPOCHS_AFTER = 5  # what is said so late after the end of a fault is still of the fault


class Said(NamedTuple):
    """What was published at a GPS time; `report` is of the epoch, None while a stream is silent."""

    gps_ns: int
    state: State
    cause: Cause
    names: frozenset[str]  # subjects, and satellites excluded
    report: EpochReport | None


@dataclass(frozen=True)
class Trial:
    """Times count from the fault's first epoch, None: never. `cause` is that of the first epoch that is not NORMAL or excludes something,
    `causes` and `named` what and who was named in any. `shift_m`: the farthest that the fault moved a receiver, horizontally, before
    anything was said; `hazard`: NORMAL while a receiver was solved beyond the tolerance."""

    detected_s: float | None
    triangle_detected_s: float | None
    cause: Cause
    causes: frozenset[Cause]
    named: frozenset[str]
    shift_m: float
    hazard: bool


def play(stage: Stage, faults: Sequence[Fault], tolerance_m: float, seed: int = 0) -> Trial:
    """Faults on a stage, until a little after they end; ConfigError where they would change nothing."""
    first_ns = min(fault.start_ns for fault in faults)
    last_ns = max(fault.end_ns or stage.epoch_ns[-1] for fault in faults)
    memory = stage.memory_before(first_ns)
    events = stage.events_until(memory, last_ns + EPOCHS_AFTER * stage.site.epoch_interval_ns)
    outputs = StationMonitor(stage.site, memory.snapshot).feed(inject(events, faults, stage.site, seed, memory.snapshot))
    return trial_of([said for said in published(outputs) if said.gps_ns >= first_ns], stage, first_ns, tolerance_m)


def published(outputs: Sequence[Output]) -> Iterator[Said]:
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
    told = [said for said in published_since if said.state is not State.NORMAL or said.names]
    alone = [said for said in published_since if said.report is None or said.report.triangle_alone is not State.NORMAL]
    before = [said for said in published_since if not told or said.gps_ns < told[0].gps_ns]
    return Trial(
        detected_s=_elapsed_s(told, first_ns),
        triangle_detected_s=_elapsed_s(alone, first_ns),
        cause=_cause(told[0]) if told else Cause.NONE,
        causes=frozenset(map(_cause, told)),
        named=frozenset(name for said in told for name in said.names),
        shift_m=max((_shift_m(said, stage) for said in before), default=0.0),
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
