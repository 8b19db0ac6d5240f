"""What a block says of each satellite: its residuals and B-values, and what monitors with memory watch of it."""

from typing import NamedTuple

import numpy as np

from integrity.gnss.observations import Bools, Floats, Ints
from integrity.monitors.common_motion import Measured
from integrity.monitors.constellations import ConstellationDesign, constellation_design, displacements
from integrity.monitors.residuals import (
    ClockDesign,
    KnownPointResiduals,
    b_values_m,
    clock_design,
    normalised_b_values,
    seen_by_all,
    without_clocks,
    worst,
)


class Watched(NamedTuple):
    """What one monitor with memory says of the satellites of a block, (E, S), whichever of them are used; NaN where it says nothing.

    `names` (E,): where no motion of everything explains as well what exceeds the threshold, so that satellites may be named; `everything`
    (E,): where nothing else does (`monitors.common_motion`). None of monitors that no motion can deceive.
    """

    check: str
    statistic: Floats
    threshold: float
    names: Bools | None = None
    everything: Bools | None = None

    @property
    def exceeds(self) -> Bools:
        """Where the satellite is found at fault, (E, S)."""
        result: Bools = self.statistic > self.threshold
        return result

    def epochs(self, s: slice) -> "Watched":
        """The same for some epochs."""
        names, everything = (None if of is None else of[s] for of in (self.names, self.everything))
        return self._replace(statistic=self.statistic[s], names=names, everything=everything)


class SatelliteInputs(NamedTuple):
    """Of a block: `prefit_m` (E, R, S) and `los_enu` (3, E, R, S), `sigma_m` and `sigma_differential_m` (E, S), `screened` (E, S),
    constellations of the signals; `common_m2` and `mean_m2` (3,), east, north, up: promised variances of the error that receivers share,
    and of their mean; and what is `watched` of the satellites."""

    prefit_m: Floats
    los_enu: Floats
    sigma_m: Floats
    sigma_differential_m: Floats
    screened: Bools
    system_of: Ints
    n_systems: int
    common_m2: Floats
    mean_m2: Floats
    watched: tuple[Watched, ...] = ()

    def epoch(self, e: int) -> "SatelliteInputs":
        """The same for one epoch, as a block of one."""
        return self.epochs(slice(e, e + 1))

    def measured(self, among: Bools) -> Measured:
        """Ranges of satellites (E, S), all receivers together."""
        n = self.prefit_m.shape[1]
        moved_m, towards = np.add.reduce(self.prefit_m, axis=1) / n, np.add.reduce(self.los_enu, axis=2) / n
        return Measured(moved_m, towards, self.sigma_m, among, self.system_of, self.n_systems)

    def epochs(self, s: slice) -> "SatelliteInputs":
        """The same for some epochs."""
        return self._replace(
            prefit_m=self.prefit_m[s],
            los_enu=self.los_enu[:, s],
            sigma_m=self.sigma_m[s],
            sigma_differential_m=self.sigma_differential_m[s],
            screened=self.screened[s],
            watched=tuple(of.epochs(s) for of in self.watched),
        )

    def statistics(self, used: Bools) -> "SatelliteStatistics":
        """What the satellites show, with clocks from those `used` (E, S)."""
        return self.statistics_by(clock_design(self.sigma_m, used, self.system_of, self.n_systems), self.constellations(used))

    def constellations(self, used: Bools) -> ConstellationDesign:
        """Each constellation's satellites among those `used` (E, S), by themselves."""
        return constellation_design(self.los_enu, self.sigma_m, used, self.system_of, self.n_systems)

    def displacements(self, of: ConstellationDesign) -> Floats:
        """Where constellations put the triangle, in sigmas squared, (E, K)."""
        return displacements(of, self.prefit_m, self.common_m2, self.mean_m2)

    def statistics_by(self, clocks: ClockDesign, of_each: ConstellationDesign) -> "SatelliteStatistics":
        """The same by designs that are there already."""
        known = without_clocks(clocks, self.prefit_m)
        residual_sigmas = seen_by_all(known.normalised)
        b_m = b_values_m(known.residual_m)
        b_sigmas = normalised_b_values(b_m, self.sigma_differential_m)
        worst_residual, worst_b = worst(residual_sigmas, clocks.used), worst(np.maximum.reduce(np.abs(b_sigmas), axis=1), clocks.used)
        where = self.displacements(of_each)
        return SatelliteStatistics(known, clocks.scale_m, residual_sigmas, b_m, b_sigmas, worst_residual, worst_b, where)


class SatelliteStatistics(NamedTuple):
    """Residuals and clocks at the `known` points, and the standard deviation `scale_m` (E, 1, S) of residuals; `residual_sigmas` (E, S),
    the normalised residual that all receivers share; B-values `b_m` and, in sigmas, `b_sigmas` (E, R, S); of each the worst among the
    satellites used, `worst_residual` and `worst_b` (E,); `displacements` (E, K) of constellations."""

    known: KnownPointResiduals
    scale_m: Floats
    residual_sigmas: Floats
    b_m: Floats
    b_sigmas: Floats
    worst_residual: Floats
    worst_b: Floats
    displacements: Floats
