"""Which satellites are out, and when they come back. No I/O, no clock.

Theory of operation. A satellite is IN (not in the table) or OUT (one `Exclusion`). Per epoch and satellite, one row of this table:

    IN,  residual passes, and all that is     stays IN
         watched of it
    IN,  something watched of it fails        goes OUT, if enough satellites remain and few go at once
    IN,  residual fails on all receivers,     goes OUT, if its B-values pass, enough satellites remain, and what remains passes, and if it
         the largest of all                   is not one of several that a displacement of their constellation explains; otherwise nothing
                                              is excluded in this epoch and the residual check fails
    OUT, not seen                             stays OUT, nothing is learnt
    OUT, residual or what is watched fails    stays OUT, the count of clean epochs starts again
    OUT, all pass                             stays OUT and is counted clean; comes back IN with the epoch that makes the count
                                              `recover_epochs` over at least `recover_after_ns`; or over an hour where its carrier moved
                                              and positions are hardly weaker without it
    IN,  its constellation alone puts the     the whole constellation goes OUT, if no other one fails, its B-values pass, enough satellites
         triangle elsewhere                   remain, and what remains passes. It counts as clean when the constellation passes, all its
                                              satellites together

What is watched (`satellites.Watched`) are monitors with memory of one satellite each: its ephemeris, its carrier.

A channel is one satellite at one receiver. One whose B-value fails while the satellite's residual passes is that receiver's own
trouble with that satellite (multipath, mostly). Nobody is blamed: the satellite is left out of the common set of this epoch, without
memory, where nothing but the B-value check fails with it and nothing fails without it. Otherwise it stays, and its B-value counts: a
fault of receivers must not hide behind a weaker sky. At most one channel per receiver (section 2.3, MRCC).
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from integrity.gnss.observations import Bools, Ints
from integrity.limits import Limits
from integrity.monitors.common_motion import displaced, may_be_named, standing
from integrity.monitors.constellations import misfits
from integrity.monitors.residuals import without_lone_satellites
from integrity.monitors.weakening import growth_without
from integrity.satellites import SatelliteInputs, SatelliteStatistics, Watched


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

    def is_acute(self, gps_ns: int, limits: Limits) -> bool:
        """Whether it has not been clean for as long as whatever fails must be. It may have to stay out longer."""
        if self.clean_since_ns is None or self.clean_epochs < limits.recover_epochs:
            return True
        return gps_ns - self.clean_since_ns < limits.recover_after_ns


Table = Mapping[str, Exclusion]
AT_A_TIME = 64  # epochs that are looked at together while a satellite is out


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
    """Screening with memory: for each epoch of the block, which satellites are used. Epochs without a suspect cost nothing, those in which
    nothing is wrong but what is out already, little.

    `on_screened` is what the satellites show when all that were screened are used.
    """
    quiet = _quiet(inputs, on_screened, inputs.screened, limits)
    used = np.array(inputs.screened)
    tables: list[Table] = []
    channels: list[tuple[Channel, ...]] = []
    rest: _Rest | None = None
    for e in range(len(epoch_ns)):
        left_out: tuple[Channel, ...] = ()
        if table:
            rest = rest if rest is not None and rest.is_of(table, e) else _without(inputs, table, satellites, e, limits)
        if table and rest is not None and rest.quiet[e - rest.first]:
            used[e], table = rest.used[e - rest.first], rest.seen_again(table, e, int(epoch_ns[e]), limits)
        elif table or not quiet[e]:
            used[e], table, left_out = _epoch(table, inputs.epoch(e), receivers, satellites, int(epoch_ns[e]), limits)
        tables.append(table)
        channels.append(left_out)
    return Walk(used, tables, channels, table)


def _quiet(inputs: SatelliteInputs, shown: SatelliteStatistics, among: Bools, limits: Limits) -> Bools:
    """Epochs (E,) in which nothing is wrong with the satellites `among` (E, S), which show `shown`."""
    quiet: Bools = (shown.worst_residual <= limits["residual"]) & (shown.worst_b <= limits["b_value"])
    for of in inputs.watched:
        quiet &= ~np.logical_or.reduce(of.exceeds & among, axis=-1)
    quiet &= ~np.logical_or.reduce(shown.displacements > limits["constellation"], axis=-1)
    return quiet


class _Rest(NamedTuple):
    """Some epochs, from the `first` on, without the satellites that are `out`: which remain, `used` (n, S); where nothing is wrong with
    them, `quiet` (n,); and of each that is out where it is `seen`, where it is `clean`, and where it is `spared` easily, (n,)."""

    first: int
    out: frozenset[str]
    used: Bools
    quiet: Bools
    seen: Mapping[str, Bools]
    clean: Mapping[str, Bools]
    spared: Mapping[str, Bools]

    def is_of(self, table: Table, e: int) -> bool:
        """Whether an epoch is one of these, without these satellites."""
        return e < self.first + len(self.quiet) and self.out == table.keys()

    def seen_again(self, table: Table, e: int, gps_ns: int, limits: Limits) -> Table:
        """The table after an epoch."""
        k = e - self.first
        after = {
            satellite: _seen_again(of, bool(self.clean[satellite][k]), bool(self.spared[satellite][k]), gps_ns, limits)
            if self.seen[satellite][k]
            else of
            for satellite, of in table.items()
        }
        return {satellite: of for satellite, of in after.items() if of is not None}


def _without(inputs: SatelliteInputs, table: Table, satellites: tuple[str, ...], first: int, limits: Limits) -> _Rest:
    """Of the next epochs, those of a constellation that is out left to `_epoch`: it keeps its own clock."""
    few = inputs.epochs(slice(first, first + AT_A_TIME))
    remaining = few.screened & ~np.isin(satellites, list(table))
    used = without_lone_satellites(remaining, few.system_of, few.n_systems)
    shown = few.statistics(used)
    quiet = _quiet(few, shown, remaining, limits)
    if any(of.check == "constellation" for of in table.values()):
        quiet[:] = False
    known = few.screened & np.isfinite(shown.residual_sigmas)
    fails = ~(shown.residual_sigmas <= limits["residual"])
    for of in few.watched:
        fails |= of.exceeds
    columns = {satellite: np.array([s == satellite for s in satellites]) for satellite in table}
    return _Rest(
        first,
        frozenset(table),
        used,
        quiet,
        {satellite: (known & own).any(axis=-1) for satellite, own in columns.items()},
        {satellite: (known & own & ~fails).any(axis=-1) for satellite, own in columns.items()},
        {satellite: _spared(few, used, known & own, table[satellite], limits) for satellite, own in columns.items()},
    )


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
    newly = _found_at_fault(inputs, used, satellites, gps_ns, limits)
    used = _less(inputs, used, newly, satellites)
    left_out = _failing_channels(inputs, used, receivers, satellites, limits)
    without_channels_left_out = used & ~np.isin(satellites, [c.satellite for c in left_out])
    by_range = _failing_satellites(inputs, without_channels_left_out, satellites, gps_ns, limits)
    newly |= {} if _rather_of_others(inputs, used, by_range, satellites, limits) else by_range
    used = _less(inputs, used, newly, satellites)
    displaced = _displaced_constellation(inputs, used, satellites, gps_ns, limits)
    newly |= displaced
    used = _less(inputs, used, displaced, satellites)
    whole = np.isin(satellites, [x.satellite for x in table.values() if x.check == "constellation"])
    probed = used | (inputs.screened & whole)  # a constellation that is out keeps its own clock
    statistic = inputs.statistics(probed).residual_sigmas
    fails = ~(statistic <= limits["residual"])
    for of in inputs.watched:
        fails |= of.exceeds
    after: dict[str, Exclusion] = {}
    for satellite, exclusion in table.items():
        columns = [i for i, s in enumerate(satellites) if s == satellite and inputs.screened[0, i] and np.isfinite(statistic[0, i])]
        clean = bool(columns) and not fails[0, columns[0]]
        if clean and exclusion.check == "constellation":
            clean = _constellation_passes(inputs, columns[0], limits)
        spared = _spared(inputs, used, np.isin(satellites, [satellite])[None] & inputs.screened, exclusion, limits)[0]
        kept = _seen_again(exclusion, clean, bool(spared), gps_ns, limits) if columns else exclusion
        if kept is not None:
            after[satellite] = kept
    after |= newly
    return used[0], after, left_out


def _less(inputs: SatelliteInputs, used: Bools, out: Table, satellites: tuple[str, ...]) -> Bools:
    """The satellites used without those that are out now, and without those that are alone then."""
    return without_lone_satellites(used & ~np.isin(satellites, list(out)), inputs.system_of, inputs.n_systems)


def _found_at_fault(inputs: SatelliteInputs, used: Bools, satellites: tuple[str, ...], gps_ns: int, limits: Limits) -> dict[str, Exclusion]:
    """Satellites of which something watched fails, each by the check that fails most; nothing where they are too many to be at fault. Not
    one that receivers measure differently: then it is not the satellite that fails."""
    worst: dict[str, tuple[float, Watched, int]] = {}
    failing = [of for of in inputs.watched if (of.names is None or of.names[0]) and (of.exceeds[0] & used[0]).any()]
    alike = (np.abs(inputs.statistics(used).b_sigmas[0]) <= limits["b_value"]).all(axis=0) if failing else used[0]
    for of in failing:
        for s in np.flatnonzero(of.exceeds[0] & used[0] & alike).tolist():
            times = float(of.statistic[0, s]) / of.threshold
            if satellites[s] not in worst or times > worst[satellites[s]][0]:
                worst[satellites[s]] = times, of, s
    if len(worst) > limits.max_exclusions_per_epoch or used.sum() - len(worst) < limits.min_common_satellites:
        return {}
    return {
        satellite: Exclusion(satellite, gps_ns, of.check, float(of.statistic[0, s]), of.threshold)
        for satellite, (_, of, s) in worst.items()
    }


def _rather_of_others(inputs: SatelliteInputs, used: Bools, failing: Table, satellites: tuple[str, ...], limits: Limits) -> bool:
    """Whether satellites fail by ranges that a displacement of everything explains as well, or several of one constellation by ranges that
    one displacement of all its orbits explains: naming them would be wrong then. Two faults of single satellites leave a misfit."""
    if failing and not may_be_named(inputs.measured(used), np.isin(satellites, list(failing)) & used, limits.log_likelihood_ratio)[0]:
        return True
    systems = [int(inputs.system_of[satellites.index(satellite)]) for satellite in failing]
    several = {system for system in systems if systems.count(system) > 1}
    if not several:
        return False
    misfit, dof = misfits(inputs.constellations(used), inputs.prefit_m)
    return any(misfit[0, k] <= limits.misfit(int(dof[0, k])) for k in several)


def _displaced_constellation(
    inputs: SatelliteInputs, used: Bools, satellites: tuple[str, ...], gps_ns: int, limits: Limits
) -> dict[str, Exclusion]:
    """All satellites of the one constellation that puts the triangle elsewhere; nothing unless it is alone in that, all receivers see it
    alike, and what remains passes."""
    where = inputs.displacements(inputs.constellations(used))[0]
    failing = np.flatnonzero(where > limits["constellation"])
    if len(failing) != 1:
        return {}
    mine = used & (inputs.system_of == failing[0])
    everything = inputs.measured(used)
    alone = misfits(inputs.constellations(used), inputs.prefit_m)[0][0, failing[0]] + standing(everything, mine)[0]
    if not 0.5 * (displaced(everything)[0][0] - alone) > limits.log_likelihood_ratio:
        return {}
    b = np.abs(inputs.statistics(used).b_sigmas[0][:, used[0] & (inputs.system_of == failing[0])])
    if not (b <= limits["b_value"]).all():
        return {}
    remaining = used & (inputs.system_of != failing[0])
    shown = inputs.statistics(remaining)
    passes = shown.worst_residual[0] <= limits["residual"] and shown.worst_b[0] <= limits["b_value"]
    if not passes or remaining.sum() < limits.min_common_satellites:
        return {}
    statistic = float(where[failing[0]])
    out = [satellites[s] for s in np.flatnonzero(mine[0]).tolist()]
    return {satellite: Exclusion(satellite, gps_ns, "constellation", statistic, limits["constellation"]) for satellite in out}


def _constellation_passes(inputs: SatelliteInputs, column: int, limits: Limits) -> bool:
    """Whether a satellite's constellation, all of it that was screened, puts the triangle where it stands."""
    where = inputs.displacements(inputs.constellations(inputs.screened))
    return bool(where[0, inputs.system_of[column]] <= limits["constellation"])


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


def _spared(inputs: SatelliteInputs, used: Bools, satellite: Bools, exclusion: Exclusion, limits: Limits) -> Bools:
    """Epochs (E,) in which positions are hardly weaker without a satellite (E, S); asked only of those that would stay out longer."""
    if exclusion.check not in limits.recover_after_of_ns:
        return np.zeros(len(used), dtype=np.bool_)
    spared: Bools = (
        growth_without(inputs.los_enu, inputs.sigma_m, used, satellite, inputs.system_of, inputs.n_systems) <= limits.most_growth
    )
    return spared


def _seen_again(exclusion: Exclusion, clean: bool, spared: bool, gps_ns: int, limits: Limits) -> Exclusion | None:
    """The entry of a satellite that is out, after it was seen once more; None when it comes back (from the next epoch on)."""
    if not clean:
        return replace(exclusion, clean_since_ns=None, clean_epochs=0)
    since_ns = gps_ns if exclusion.clean_since_ns is None else exclusion.clean_since_ns
    count = exclusion.clean_epochs + 1
    needed_ns = limits.recover_after_of_ns.get(exclusion.check, limits.recover_after_ns) if spared else limits.recover_after_ns
    if count >= limits.recover_epochs and gps_ns - since_ns >= needed_ns:
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
