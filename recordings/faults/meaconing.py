"""Receivers that hear, repeated and delayed, what the antenna of another one hears."""

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from integrity.gnss.gps_time import NS_PER_S
from integrity.gnss.observations import Bools, Floats, ObservationRow
from integrity.gnss.signals import satellite_of
from recordings.faults.changes import Change, Rows, alike, moved, only
from recordings.faults.kinds import Meaconing
from recordings.faults.ranges import acquired_anew
from recordings.faults.scenario import Fault
from recordings.faults.truth import RecordedRow, Truth, range_changes, residuals, runs, surveyed


def meaconed(fault: Fault, effect: Meaconing, truth: Truth, hit: Sequence[RecordedRow], rows: Rows) -> Iterator[tuple[int, ObservationRow]]:
    """The rows of the receivers that hear the repeater, by place; those of epochs that `from_receiver` did not measure stay.

    The geometry is that at its surveyed point, delayed; codes take over what its codes differ by from the model, multipath above all. What
    they have in common by signal (the receivers' clocks and their delays of each signal) stays that of the receiver that hears: so its
    clock goes on as it was, but for the delay. Carriers keep their own ambiguities and noise.
    """
    interval_s = truth.site.epoch_interval_ns / NS_PER_S
    sources = {seen.epoch_ns: seen for seen in truth.rows if seen.row.receiver == effect.from_receiver}
    there = surveyed(truth, effect.from_receiver)
    for run in runs([seen for seen in hit if seen.epoch_ns in sources]):
        at_source = [sources[seen.epoch_ns] for seen in run]
        geometry = range_changes(truth, run, there, np.zeros((1, 1, 3)), effect.delay_m)
        own, others = residuals(truth, run), _residuals_of(truth, at_source)
        for seen, source, change, own_m, other_m in zip(run, at_source, geometry, own, others, strict=True):
            known = np.isfinite(change.delta_m)
            both = alike(change)
            code_m = both.code_m + np.where(known, _deviation_m(seen.row, own_m, source.row, other_m), 0.0)
            row = moved(
                rows[seen.place], seen.row.signals, Change(code_m, both.carrier_m, both.rate_mps), truth.wavelengths_m(seen.row.signals)
            )
            heard = {satellite_of(signal) for signal in source.row.signals}
            row = only(row, np.array([satellite_of(signal) in heard for signal in row.signals], dtype=np.bool_))
            captured = np.array([signal in _names(seen.row, known) for signal in row.signals], dtype=np.bool_)
            yield seen.place, acquired_anew(row, captured, fault.elapsed_s(seen.epoch_ns), interval_s)


def _residuals_of(truth: Truth, at_source: Sequence[RecordedRow]) -> list[Floats]:
    """In the order given, which need not be the one of `runs`."""
    found: dict[int, Floats] = {}
    for run in runs({seen.place: seen for seen in at_source}.values()):
        found |= {seen.place: residual_m for seen, residual_m in zip(run, residuals(truth, run), strict=True)}
    return [found[seen.place] for seen in at_source]


def _deviation_m(row: ObservationRow, own_m: Floats, source: ObservationRow, other_m: Floats) -> Floats:
    """How much more the source's codes differ from the model than a row's own, but for what all of one code have in common; (n,), 0 where
    one of them is not known."""
    at_source: Mapping[str, float] = dict(zip(source.signals, other_m.tolist(), strict=True))
    more_m = np.array([at_source.get(signal, np.nan) for signal in row.signals], dtype=np.float64) - own_m
    codes = np.array([signal[0] + signal.partition(".")[2] for signal in row.signals])
    for code in np.unique(codes[np.isfinite(more_m)]):
        of_code = (codes == code) & np.isfinite(more_m)
        more_m[of_code] -= np.median(more_m[of_code])
    return np.where(np.isfinite(more_m), more_m, 0.0)


def _names(row: ObservationRow, which: Bools) -> set[str]:
    return {signal for signal, mine in zip(row.signals, which, strict=True) if mine}
