"""Faults that make ranges longer or shorter, on code, carrier and Doppler together: of a satellite, or as if an antenna stood elsewhere.

Effects of several faults add up. A satellite without ephemeris has no known direction: faults of receivers and spoofing leave its
measurements as they are.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np

from integrity.gnss.gps_time import NS_PER_S
from integrity.gnss.observations import Bools, Floats, ObservationRow
from integrity.gnss.positioning import Points, points_at
from integrity.gnss.signals import satellite_of
from recordings.faults.kinds import RangeEffect, ReceiverRamp, SatelliteRamp, SatelliteStep, Spoofing
from recordings.faults.scenario import Fault
from recordings.faults.truth import RangeChange, RecordedRow, Truth, range_changes, runs, surveyed

INCOHERENT_CLOCK_M = 300.0  # own choice: 1 us between the spoofer's time and GPS time

Rows = Mapping[int, ObservationRow]  # by place in the events, with the faults so far


def with_ranges_changed(
    fault: Fault, effect: RangeEffect, truth: Truth, hit: Sequence[RecordedRow], rows: Rows
) -> Iterator[tuple[int, ObservationRow]]:
    """The rows that the fault changes, by place."""
    for seen, change in _changes(fault, effect, truth, hit):
        delta_m, rate_mps = (np.where(np.isfinite(part), part, 0.0) for part in change)
        if delta_m.any() or rate_mps.any():
            moved = RangeChange(delta_m, rate_mps)
            row = _moved(rows[seen.place], moved, truth.wavelengths_m(seen.row.signals))
            if isinstance(effect, Spoofing) and not effect.coherent:
                row = _acquired_anew(row, np.isfinite(change.delta_m), _elapsed_s(fault, seen), truth.site.epoch_interval_ns / NS_PER_S)
            yield seen.place, row


def _changes(fault: Fault, effect: RangeEffect, truth: Truth, hit: Sequence[RecordedRow]) -> Iterator[tuple[RecordedRow, RangeChange]]:
    match effect:
        case SatelliteStep(satellite=satellite, size_m=size_m):
            for seen in hit:
                yield seen, _of_satellite(seen.row, satellite, size_m, 0.0)
        case SatelliteRamp(satellite=satellite, rate_mps=rate_mps):
            for seen in hit:
                yield seen, _of_satellite(seen.row, satellite, rate_mps * _elapsed_s(fault, seen), rate_mps)
        case _:
            for run in runs(hit):
                there, velocity_ecef_mps, clock_m = _apparent_antenna(fault, effect, truth, run)
                for seen, change in zip(run, range_changes(truth, run, there, velocity_ecef_mps), strict=True):
                    yield seen, RangeChange(change.delta_m + clock_m, change.rate_mps)


def _of_satellite(row: ObservationRow, satellite: str, delta_m: float, rate_mps: float) -> RangeChange:
    struck = np.array([satellite_of(signal) == satellite for signal in row.signals], dtype=np.bool_)
    return RangeChange(np.where(struck, delta_m, 0.0), np.where(struck, rate_mps, 0.0))


def _apparent_antenna(fault: Fault, effect: RangeEffect, truth: Truth, run: Sequence[RecordedRow]) -> tuple[Points, Floats, float]:
    """Where the antenna of a run of rows seems to be (E, 1), how it moves there in ECEF (E, 1, 3), and a step of all its ranges, m."""
    here = surveyed(truth, run[0].row.receiver)
    elapsed_s = np.array([_elapsed_s(fault, seen) for seen in run])[:, None, None]
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
        case SatelliteStep() | SatelliteRamp():
            raise AssertionError(f"{effect.kind} moves no antenna")
        case _:
            offset = np.broadcast_to(np.array(effect.offset_enu_m) @ here.enu, (len(run), 1, 3))
            return _under_the_same_air(here, offset), np.zeros((len(run), 1, 3)), 0.0


def _under_the_same_air(here: Points, offset_ecef_m: Floats) -> Points:
    """Points (E, 1) beside the surveyed one with its latitude, longitude and height: only the geometry differs."""
    same = (np.broadcast_to(part, (len(offset_ecef_m), *part.shape[1:])) for part in here[1:])
    return Points(here.pos_ecef_m + offset_ecef_m, *same)


def _elapsed_s(fault: Fault, seen: RecordedRow) -> float:
    return (seen.epoch_ns - fault.start_ns) / NS_PER_S


def _moved(row: ObservationRow, change: RangeChange, wavelengths_m: Floats) -> ObservationRow:
    return replace(
        row,
        pseudorange_m=row.pseudorange_m + change.delta_m,
        carrier_cycles=row.carrier_cycles + change.delta_m / wavelengths_m,
        doppler_hz=row.doppler_hz - change.rate_mps / wavelengths_m,
    )


def _acquired_anew(row: ObservationRow, captured: Bools, elapsed_s: float, interval_s: float) -> ObservationRow:
    return replace(
        row,
        slip=row.slip | (captured & (elapsed_s < interval_s)),
        lock_s=np.where(captured, np.minimum(row.lock_s, elapsed_s), row.lock_s),
    )
