"""Faults that make ranges longer or shorter: of satellites, of the ionosphere, or as if an antenna stood elsewhere; and clocks that jump.

Effects of several faults add up. A satellite without ephemeris has no known direction: faults of receivers, the ionosphere and spoofing
leave its measurements as they are.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from integrity.gnss.constants import SPEED_OF_LIGHT_MPS
from integrity.gnss.gps_time import NS_PER_S
from integrity.gnss.observations import Bools, Floats, ObservationRow
from integrity.gnss.positioning import Points, points_at
from recordings.faults.changes import Change, Rows, alike, moved
from recordings.faults.front import front_changes
from recordings.faults.kinds import (
    AntennaEffect,
    ConstellationFrame,
    IonoFront,
    RangeEffect,
    ReceiverClockJump,
    ReceiverRamp,
    SignalEffect,
    Spoofing,
)
from recordings.faults.scenario import Fault
from recordings.faults.signals import of_system, signal_change
from recordings.faults.truth import RangeChange, RecordedRow, Truth, range_changes, runs, surveyed

INCOHERENT_CLOCK_M = 300.0  # own choice: 1 us between the spoofer's time and GPS time
MS_M = SPEED_OF_LIGHT_MPS / 1000.0
NEARLY_WHOLE_MS = 1e-3 / MS_M  # a size within 1 mm of whole milliseconds is meant to be so


def with_ranges_changed(
    fault: Fault, effect: RangeEffect, truth: Truth, hit: Sequence[RecordedRow], rows: Rows
) -> Iterator[tuple[int, ObservationRow]]:
    """The rows that the fault changes, by place."""
    for seen, change in _changes(fault, effect, truth, hit):
        was = rows[seen.place]
        row = moved(was, seen.row.signals, change, truth.wavelengths_m(seen.row.signals))
        if row is not was:
            if isinstance(effect, Spoofing) and not effect.coherent:
                row = acquired_anew(row, change.code_m != 0.0, fault.elapsed_s(seen.epoch_ns), truth.site.epoch_interval_ns / NS_PER_S)
            yield seen.place, row


def _changes(fault: Fault, effect: RangeEffect, truth: Truth, hit: Sequence[RecordedRow]) -> Iterator[tuple[RecordedRow, Change]]:
    if isinstance(effect, SignalEffect):
        for seen in hit:
            yield seen, signal_change(effect, seen.row, fault.elapsed_s(seen.epoch_ns), truth.wavelengths_m(seen.row.signals))
    elif isinstance(effect, IonoFront):
        yield from front_changes(fault, effect, truth, hit)
    else:
        for run in runs(hit):
            there, velocity_ecef_mps, clock_m = _apparent_antenna(fault, effect, truth, run)
            for seen, change in zip(run, range_changes(truth, run, there, velocity_ecef_mps), strict=True):
                struck = of_system(seen.row, effect.system) if isinstance(effect, ConstellationFrame) else True
                yield seen, alike(RangeChange(*(np.where(struck, part, 0.0) for part in (change.delta_m + clock_m, change.rate_mps))))


def _apparent_antenna(fault: Fault, effect: AntennaEffect, truth: Truth, run: Sequence[RecordedRow]) -> tuple[Points, Floats, float]:
    """Where the antenna of a run of rows seems to be (E, 1), how it moves there in ECEF (E, 1, 3), and a step of all its ranges, m.

    Satellites that are displaced are at the range at which others are of an antenna displaced the other way: 0.5 mm per 100 m of it are
    what the Earth turns differently under the signal, and are left out.
    """
    here = surveyed(truth, run[0].row.receiver)
    elapsed_s = np.array([fault.elapsed_s(seen.epoch_ns) for seen in run])[:, None, None]
    still = np.zeros((len(run), 1, 3))
    match effect:
        case Spoofing():
            start = (
                surveyed(truth, effect.receivers[0]) if effect.position_ecef_m is None else points_at(np.array([effect.position_ecef_m]))
            )
            drift = np.broadcast_to(effect.drift_mps * start.enu[:, :, 0], (len(run), 1, 3))
            clock_m = 0.0 if effect.coherent else INCOHERENT_CLOCK_M
            return points_at(start.pos_ecef_m + elapsed_s * drift), drift, clock_m
        case ReceiverRamp():
            velocity = np.broadcast_to(np.array(effect.velocity_enu_mps) @ here.enu, (len(run), 1, 3))
            return _under_the_same_air(here, elapsed_s * velocity), velocity, 0.0
        case ConstellationFrame():
            return _under_the_same_air(here, still + np.array(effect.offset_ecef_m)), still, 0.0
        case _:
            return _under_the_same_air(here, still + np.array(effect.offset_enu_m) @ here.enu), still, 0.0


def _under_the_same_air(here: Points, offset_ecef_m: Floats) -> Points:
    """Points (E, 1) beside the surveyed one with its latitude, longitude and height: only the geometry differs."""
    same = (np.broadcast_to(part, (len(offset_ecef_m), *part.shape[1:])) for part in here[1:])
    return Points(here.pos_ecef_m + offset_ecef_m, *same)


def acquired_anew(row: ObservationRow, captured: Bools, elapsed_s: float, interval_s: float) -> ObservationRow:
    """The row of a receiver that lost the signals `captured` when the fault began, and tracks what it then heard."""
    return replace(
        row,
        slip=row.slip | (captured & (elapsed_s < interval_s)),
        lock_s=np.where(captured, np.minimum(row.lock_s, elapsed_s), row.lock_s),
    )


def clock_jumped(effect: ReceiverClockJump, truth: Truth, hit: Sequence[RecordedRow], rows: Rows) -> Iterator[tuple[int, ObservationRow]]:
    """The rows of a receiver whose clock is ahead, by place."""
    ms = round(effect.size_m / MS_M)
    tag_ns = ms * NS_PER_S // 1000 if ms and abs(effect.size_m / MS_M - ms) < NEARLY_WHOLE_MS else 0
    for run in runs(hit):
        here = surveyed(truth, effect.receiver)
        earlier = range_changes(truth, run, here, np.zeros((1, 1, 3)), effect.size_m)
        for seen, change in zip(run, earlier, strict=True):
            same_instant = np.full(len(seen.row.signals), effect.size_m)
            delta_m = same_instant if tag_ns else np.where(np.isfinite(change.delta_m), change.delta_m, same_instant)
            row = moved(
                rows[seen.place],
                seen.row.signals,
                alike(RangeChange(delta_m, np.zeros(len(delta_m)))),
                truth.wavelengths_m(seen.row.signals),
            )
            yield seen.place, replace(row, receive_time_ns=row.receive_time_ns + tag_ns)
