"""Which satellites are out, and when they come back. No I/O, no clock.

Theory of operation. A satellite is IN (not in the table) or OUT (one `Exclusion`). Per epoch and satellite, one row of this table:

    IN,  residual passes                      stays IN
    IN,  residual fails on all receivers,     goes OUT, if its B-values pass, enough satellites remain, and what remains passes;
         the largest of all                   otherwise nothing is excluded in this epoch and the residual check fails
    OUT, not seen                             stays OUT, nothing is learnt
    OUT, residual fails                       stays OUT, the count of clean epochs starts again
    OUT, residual passes                      stays OUT and is counted clean; comes back IN with the epoch that makes the count
                                              `recover_epochs` over at least `recover_after_ns`
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from integrity.gnss.observations import Bools, Floats, Ints
from integrity.limits import Limits
from integrity.monitors.residuals import known_point_residuals, normalised_b_values, seen_by_all, worst


@dataclass(frozen=True)
class Exclusion:
    """A satellite that is out: since when (GPS time), by which check and numbers, and its clean epochs since it failed last."""

    satellite: str
    since_ns: int
    check: str
    statistic: float
    threshold: float
    clean_since_ns: int | None = None
    clean_epochs: int = 0


Table = Mapping[str, Exclusion]


class SatelliteInputs(NamedTuple):
    """Of a block: `prefit_m` (E, R, S), `sigma_m` and `sigma_differential_m` (E, S), `screened` (E, S), constellations of the signals."""

    prefit_m: Floats
    sigma_m: Floats
    sigma_differential_m: Floats
    screened: Bools
    system_of: Ints
    n_systems: int

    def epoch(self, e: int) -> "SatelliteInputs":
        """The same for one epoch, as a block of one."""
        s = slice(e, e + 1)
        return self._replace(
            prefit_m=self.prefit_m[s],
            sigma_m=self.sigma_m[s],
            sigma_differential_m=self.sigma_differential_m[s],
            screened=self.screened[s],
        )

    def statistics(self, used: Bools) -> tuple[Floats, Floats]:
        """Residual statistic (E, S) and normalised B-values (E, R, S) with clocks from the satellites `used`."""
        known = known_point_residuals(self.prefit_m, self.sigma_m, used, self.system_of, self.n_systems)
        return seen_by_all(known.normalised), normalised_b_values(known.residual_m, self.sigma_differential_m)


class Walk(NamedTuple):
    """What the walk through a block decided: satellites `used` (E, S), the table after each epoch, and after the last."""

    used: Bools
    tables: list[Table]
    table: Table


def walk(table: Table, inputs: SatelliteInputs, satellites: tuple[str, ...], epoch_ns: Ints, limits: Limits) -> Walk:
    """Screening with memory: for each epoch of the block, which satellites are used. Epochs without a suspect cost nothing."""
    statistic, _ = inputs.statistics(inputs.screened)
    quiet = worst(statistic, inputs.screened) <= limits["residual"]
    used = np.array(inputs.screened)
    tables: list[Table] = []
    for e in range(len(epoch_ns)):
        if table or not quiet[e]:
            used[e], table = _epoch(table, inputs.epoch(e), satellites, int(epoch_ns[e]), limits)
        tables.append(table)
    return Walk(used, tables, table)


def _epoch(table: Table, inputs: SatelliteInputs, satellites: tuple[str, ...], gps_ns: int, limits: Limits) -> tuple[Bools, Table]:
    out = np.array([s in table for s in satellites])
    used = inputs.screened & ~out
    newly = _failing_satellites(inputs, used, satellites, gps_ns, limits)
    used = used & ~np.array([s in newly for s in satellites])
    statistic, _ = inputs.statistics(used)
    after: dict[str, Exclusion] = {}
    for satellite, exclusion in table.items():
        columns = [i for i, s in enumerate(satellites) if s == satellite and inputs.screened[0, i] and np.isfinite(statistic[0, i])]
        kept = _watched(exclusion, statistic[0, columns[0]] <= limits["residual"], gps_ns, limits) if columns else exclusion
        if kept is not None:
            after[satellite] = kept
    after |= newly
    return used[0], after


def _watched(exclusion: Exclusion, clean: bool, gps_ns: int, limits: Limits) -> Exclusion | None:
    """The entry of a satellite that is out, after it was seen once more; None when it comes back (from the next epoch on)."""
    if not clean:
        return replace(exclusion, clean_since_ns=None, clean_epochs=0)
    since_ns = gps_ns if exclusion.clean_since_ns is None else exclusion.clean_since_ns
    count = exclusion.clean_epochs + 1
    if count >= limits.recover_epochs and gps_ns - since_ns >= limits.recover_after_ns:
        return None
    return replace(exclusion, clean_since_ns=since_ns, clean_epochs=count)


def _failing_satellites(
    inputs: SatelliteInputs, used: Bools, satellites: tuple[str, ...], gps_ns: int, limits: Limits
) -> dict[str, Exclusion]:
    """Take out the largest residual, estimate the clocks again, repeat; nothing unless all that remain pass.

    The largest only: with the clock a weighted mean, a large step lifts innocent satellites over their threshold too, but the
    faulty one is always the largest (section 4).
    """
    failing: dict[str, Exclusion] = {}
    for _ in range(limits.max_exclusions_per_epoch):
        statistic, b = inputs.statistics(used)
        if worst(statistic, used)[0] <= limits["residual"]:
            return failing
        suspect = int(np.argmax(np.where(used[0] & np.isfinite(statistic[0]), statistic[0], -np.inf)))
        blamable = (
            used[0, suspect]
            and statistic[0, suspect] > limits["residual"]
            and (np.abs(b[0, :, suspect]) <= limits["b_value"]).all()
            and used.sum() > limits.min_common_satellites
        )
        if not blamable:
            return {}
        satellite = satellites[suspect]
        failing[satellite] = Exclusion(satellite, gps_ns, "residual", float(statistic[0, suspect]), limits["residual"])
        used = used & ~np.array([s == satellite for s in satellites])
    statistic, _ = inputs.statistics(used)
    return failing if worst(statistic, used)[0] <= limits["residual"] else {}
