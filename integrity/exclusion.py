"""Which satellites are out, and when they come back. No I/O, no clock.

Theory of operation. A satellite is IN (not in the table) or OUT (one `Exclusion`). Per epoch and satellite, one row of this table:

    IN,  residual passes                      stays IN
    IN,  residual fails on all receivers,     goes OUT, if its B-values pass, enough satellites remain, and what remains passes;
         the largest of all                   otherwise nothing is excluded in this epoch and the residual check fails
    OUT, not seen                             stays OUT, nothing is learnt
    OUT, residual fails                       stays OUT, the count of clean epochs starts again
    OUT, residual passes                      stays OUT and is counted clean; comes back IN with the epoch that makes the count
                                              `recover_epochs` over at least `recover_after_ns`

A channel is one satellite at one receiver. One whose B-value fails while the satellite's residual passes is that receiver's own
trouble with that satellite (multipath, mostly). Nobody is blamed: the satellite is left out of the common set of this epoch, without
memory, where nothing but the B-value check fails with it and nothing fails without it. Otherwise it stays, and its B-value counts: a
fault of receivers must not hide behind a weaker sky. At most one channel per receiver (section 2.3, MRCC).
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from integrity.gnss.observations import Bools, Floats, Ints
from integrity.limits import Limits
from integrity.monitors.residuals import (
    ClockDesign,
    b_values_m,
    clock_design,
    normalised_b_values,
    seen_by_all,
    without_clocks,
    without_lone_satellites,
    worst,
)


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

    def statistics(self, used: Bools) -> "SatelliteStatistics":
        """What the satellites show, with clocks from those `used` (E, S)."""
        return self.statistics_by(clock_design(self.sigma_m, used, self.system_of, self.n_systems))

    def statistics_by(self, clocks: ClockDesign) -> "SatelliteStatistics":
        """The same by a design that is there already."""
        known = without_clocks(clocks, self.prefit_m)
        residual_sigmas = seen_by_all(known.normalised)
        b_m = b_values_m(known.residual_m)
        b_sigmas = normalised_b_values(b_m, self.sigma_differential_m)
        worst_residual, worst_b = worst(residual_sigmas, clocks.used), worst(np.maximum.reduce(np.abs(b_sigmas), axis=1), clocks.used)
        return SatelliteStatistics(known.residual_m, clocks.scale_m, residual_sigmas, b_m, b_sigmas, worst_residual, worst_b)


class SatelliteStatistics(NamedTuple):
    """`residual_m` (E, R, S) and their standard deviation `scale_m` (E, 1, S); `residual_sigmas` (E, S), the normalised residual that all
    receivers share; B-values `b_m` and, in sigmas, `b_sigmas` (E, R, S); of each the worst among the satellites used, `worst_residual` and
    `worst_b` (E,)."""

    residual_m: Floats
    scale_m: Floats
    residual_sigmas: Floats
    b_m: Floats
    b_sigmas: Floats
    worst_residual: Floats
    worst_b: Floats


@dataclass(frozen=True)
class Channel:
    """A satellite left out of one epoch because one receiver measures it differently: the B-value in sigmas, and its threshold."""

    receiver: str
    satellite: str
    statistic: float
    threshold: float


class Walk(NamedTuple):
    """What the walk through a block decided: satellites `used` (E, S); per epoch the table after it, and the channels that could be
    left out (still used: see `without_channels`)."""

    used: Bools
    tables: list[Table]
    channels: list[tuple[Channel, ...]]
    table: Table


def walk(
    table: Table,
    inputs: SatelliteInputs,
    on_screened: SatelliteStatistics,
    receivers: tuple[str, ...],
    satellites: tuple[str, ...],
    epoch_ns: Ints,
    limits: Limits,
) -> Walk:
    """Screening with memory: for each epoch of the block, which satellites are used. Epochs without a suspect cost nothing.

    `on_screened` is what the satellites show when all that were screened are used.
    """
    quiet = (on_screened.worst_residual <= limits["residual"]) & (on_screened.worst_b <= limits["b_value"])
    used = np.array(inputs.screened)
    tables: list[Table] = []
    channels: list[tuple[Channel, ...]] = []
    for e in range(len(epoch_ns)):
        left_out: tuple[Channel, ...] = ()
        if table or not quiet[e]:
            used[e], table, left_out = _epoch(table, inputs.epoch(e), receivers, satellites, int(epoch_ns[e]), limits)
        tables.append(table)
        channels.append(left_out)
    return Walk(used, tables, channels, table)


def without_channels(walked: Walk, satellites: tuple[str, ...], epochs: Bools) -> Walk:
    """The same walk with its channels left out in some `epochs` (E,), and back in use, as if nothing were, in the others."""
    used = np.array(walked.used)
    channels = list(walked.channels)
    for e, left_out in enumerate(channels):
        if epochs[e]:
            used[e] &= ~np.isin(satellites, [c.satellite for c in left_out])
        else:
            channels[e] = ()
    return walked._replace(used=used, channels=channels)


def _epoch(
    table: Table, inputs: SatelliteInputs, receivers: tuple[str, ...], satellites: tuple[str, ...], gps_ns: int, limits: Limits
) -> tuple[Bools, Table, tuple[Channel, ...]]:
    out = np.array([s in table for s in satellites], dtype=np.bool_)
    used = inputs.screened & ~out
    left_out = _failing_channels(inputs, used, receivers, satellites, limits)
    newly = _failing_satellites(inputs, used & ~np.isin(satellites, [c.satellite for c in left_out]), satellites, gps_ns, limits)
    used = without_lone_satellites(used & ~np.isin(satellites, list(newly)), inputs.system_of, inputs.n_systems)
    statistic = inputs.statistics(used).residual_sigmas
    after: dict[str, Exclusion] = {}
    for satellite, exclusion in table.items():
        columns = [i for i, s in enumerate(satellites) if s == satellite and inputs.screened[0, i] and np.isfinite(statistic[0, i])]
        kept = _watched(exclusion, statistic[0, columns[0]] <= limits["residual"], gps_ns, limits) if columns else exclusion
        if kept is not None:
            after[satellite] = kept
    after |= newly
    return used[0], after, left_out


def _failing_channels(
    inputs: SatelliteInputs, used: Bools, receivers: tuple[str, ...], satellites: tuple[str, ...], limits: Limits
) -> tuple[Channel, ...]:
    """The worst B-value first, clocks estimated again after each; nothing unless one channel per receiver explains all."""
    channels: list[Channel] = []
    for _ in range(len(receivers)):
        shown = inputs.statistics(used)
        b = shown.b_sigmas
        sizes = np.where(used[0] & np.isfinite(b[0]), np.abs(b[0]), -np.inf)
        if sizes.max(initial=-np.inf) <= limits["b_value"]:
            return tuple(channels)
        r, s = divmod(int(np.argmax(sizes)), len(satellites))
        own_trouble = shown.residual_sigmas[0, s] <= limits["residual"] and receivers[r] not in {c.receiver for c in channels}
        if not own_trouble or used.sum() <= limits.min_common_satellites:
            return ()
        channels.append(Channel(receivers[r], satellites[s], float(sizes[r, s]), limits["b_value"]))
        used = without_lone_satellites(used & ~np.isin(satellites, [satellites[s]]), inputs.system_of, inputs.n_systems)
    return tuple(channels) if inputs.statistics(used).worst_b[0] <= limits["b_value"] else ()


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
        shown = inputs.statistics(used)
        statistic, b = shown.residual_sigmas, shown.b_sigmas
        if not used.any() or shown.worst_residual[0] <= limits["residual"]:
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
        used = without_lone_satellites(used & ~np.isin(satellites, [satellite]), inputs.system_of, inputs.n_systems)
    return failing if inputs.statistics(used).worst_residual[0] <= limits["residual"] else {}
