"""Every threshold of the train, with unit, reason and source; the only file of `train_client` in which one is set.

Sections are those of the project's digest of train positioning, [000] is the thesis behind it; "own choice" marks what no source
prescribes.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from integrity.gnss.gps_time import NS_PER_S
from integrity.gnss.observations import Floats, Ints, freeze
from integrity.probability import chi2_quantile, gauss_quantile

FALSE_ALARM = 1e-4  # per epoch and antenna, under the sigmas given; 1.8
WRONGLY_DISMISSED = 1e-9  # that noise alone dismisses the true place in a search: the order of a hazard rate [004 4.1]; own choice
MOST_DEGREES_OF_FREEDOM = 60  # in the table: two constellations never show an antenna more satellites


@dataclass(frozen=True, eq=False)
class TrainLimits:
    """All limits; each is met where statistic <= limit, so that NaN fails."""

    residuals: Floats
    """(61,) by degrees of freedom: weighted sum of squares that fits the track, chi-square, false alarm 1e-4; entry 0 is NaN; 1.8."""

    search_margin: float
    """By how much the squares of a place may exceed those of the best one, chi-square units, and still count as a place where the train
    may be. The truth, delta sigmas away from the best, is missed with Q((margin + delta^2) / (2 delta)) <= Q(sqrt(margin)); 1.4."""

    most_tpdop: float
    """Along-track dilution of precision; errors rise sharply above 3 [000 T2]."""

    min_redundancy: int
    """Degrees of freedom n - 1 - C: one, or nothing checks the solution; two satellites never start anything; 1.7, 1.8, 1.16."""

    elevation_mask_rad: float
    """Lower satellites are not used; the mask of the moving runs [000 3.7.4, T13]."""

    min_cn0_dbhz: float
    """Weaker signals are not used: code tracking of common receivers is unreliable there; own choice, as at the station."""

    most_hops: int
    """From segment to segment, of one solution; 1.5."""

    most_outside_m: float
    """Of a segment's end, at a corner where each of two segments refers to the other: there the projections on both differ by (angle
    between the chords) x (error across the track). 0.125 rad, a 20 m chord on 160 m radius, times 8 m; 1.5, own choice."""

    relinearise_beyond_m: float
    """From the point of linearisation: second order d^2 / (2 rho), rho >= 20,000 km, is 1 mm there; 1.5."""

    most_linearisations: int
    """Of one solution: hops reach no further than a few times the limit above; own choice."""

    alignment_tolerance_ns: int
    """Between the time tags of antennas in one epoch: receivers of one kind tag within a few ms of each other, and 10 ms are 0.5 m at
    180 km/h, of the order of the sigma of a distance between antennas; own choice."""

    distance_sigmas: float
    """Distance between two antennas along the line, less what the train prescribes; two-sided, false alarm 1e-4; 1.9."""

    most_train_length_m: float
    """How far along the map one antenna is searched from another; own choice, longer than any train with passengers."""

    def __post_init__(self) -> None:
        freeze(self)

    def residual_limit(self, dof: Ints) -> Floats:
        """Largest passing sum of squares, shape of `dof`; NaN, which nothing passes, without a degree of freedom.

        Beyond the table the limit of its end holds: too strict rather than too mild.
        """
        limit: Floats = self.residuals[np.minimum(np.maximum(dof, 0), len(self.residuals) - 1)]
        return limit


def derive() -> TrainLimits:
    """All limits of a train."""
    return TrainLimits(
        residuals=np.array([np.nan, *(chi2_quantile(FALSE_ALARM, dof) for dof in range(1, MOST_DEGREES_OF_FREEDOM + 1))]),
        search_margin=gauss_quantile(WRONGLY_DISMISSED) ** 2,
        most_tpdop=3.0,
        min_redundancy=1,
        elevation_mask_rad=float(np.deg2rad(10.0)),
        min_cn0_dbhz=25.0,
        most_hops=20,
        most_outside_m=1.0,
        relinearise_beyond_m=200.0,
        most_linearisations=4,
        alignment_tolerance_ns=10_000_000,
        distance_sigmas=gauss_quantile(FALSE_ALARM / 2.0),
        most_train_length_m=1_000.0,
    )


class Timing(NamedTuple):
    """How the rows of antennas are lined up: see `integrity.assembler`."""

    alignment_tolerance_ns: int
    same_time_ns: int
    silence_ns: int


def silence_ns(epoch_interval_ns: int) -> int:
    """A stream is silent after two intervals or 2 s, the longer: as at the station."""
    return max(2 * epoch_interval_ns, 2 * NS_PER_S)
