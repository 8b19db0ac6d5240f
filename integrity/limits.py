"""Every limit of a site, derived from what it promises: the thresholds of all checks (`thresholds`), and those of screening, naming, time.

Nothing else in the project sets a threshold. Section numbers are those of the notes on ground integrity.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from math import log

import numpy as np

from integrity.carrier_thresholds import MOTION_CHECKS, CarrierDesign, carrier_design, carrier_thresholds, clean_for_s
from integrity.config import SiteConfig
from integrity.gnss.gps_time import NS_PER_S
from integrity.gnss.observations import Bools, Floats, Ints
from integrity.monitors.common_motion import MISFIT
from integrity.monitors.slow import SlowDesign
from integrity.probability import chi2_quantile, gauss_quantile
from integrity.states import Outcome
from integrity.thresholds import FAMILIES, Promises, Threshold
from integrity.triangle import ReferenceTriangle

NAMED_RATHER = log(1000.0)  # than anything else, for whoever is named: section 2.2, (iv)
ALL_FAMILIES = (*FAMILIES, carrier_thresholds)


@dataclass(frozen=True)
class Limits:
    """What `derive` makes of a site. Besides the checks: limits of screening, naming, and time."""

    thresholds: tuple[Threshold, ...]
    radius_m: float
    isolation: float  # naming (i), on t_j, chi-square with 3 degrees of freedom
    pair: float  # naming (ii), on T_pair
    log_likelihood_ratio: float  # naming (iv), and satellites rather than a common motion
    jump_log_likelihood_ratio: float  # the same for what moved: stricter, since it comes on top of (iv)
    collapse_fit: float  # the solved points are one point: chi-square with 6 degrees of freedom
    undetected_sigmas: float  # of a satellite's range: what residuals miss with the accepted probability; section 2.3, E_i
    least_separation: float  # of a pair of receivers, in sigmas: below, one transmitter cannot be told from two
    missed_detection: float
    slow: SlowDesign
    carriers: CarrierDesign
    clock_sigmas: float  # beyond which a clock's step is told; own choice
    gain_drop: float  # of its range, beyond which a receiver's gain is told; own choice
    min_common_satellites: int
    max_exclusions_per_epoch: int
    elevation_mask_rad: float
    min_cn0_dbhz: float
    pseudorange_range_m: tuple[float, float]
    remember_satellite_ns: int
    loss_elevation_rad: float
    alignment_tolerance_ns: int
    same_time_ns: int  # receivers of one kind tag an epoch within a few ms of each other; own choice
    silence_ns: int
    recover_after_ns: int
    recover_after_of_ns: Mapping[str, int]  # of a satellite that one of these checks excluded, and the sky can do without
    most_growth: float  # of horizontal sigmas without a satellite: beyond, the sky cannot do without it; own choice
    recover_epochs: int
    by_name: Mapping[str, Threshold] = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "by_name", {t.name: t for t in self.thresholds})
        for array in (self.values, self.required, self.without_result):
            array.setflags(write=False)

    def misfit(self, dof: int) -> float:
        """What a chi-square statistic of so many degrees of freedom exceeds in one case of a thousand."""
        return chi2_quantile(MISFIT, dof) if dof else 0.0

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Of all checks, (C,)."""
        return tuple(t.name for t in self.thresholds)

    @cached_property
    def values(self) -> Floats:
        """Thresholds of all checks, (C,)."""
        return np.array([t.value for t in self.thresholds])

    @cached_property
    def required(self) -> Bools:
        """Which checks must have a result, (C,)."""
        return np.array([t.required for t in self.thresholds])

    @cached_property
    def without_result(self) -> Ints:
        """The `Outcome` of each check that has no result, (C,)."""
        return np.where(self.required, int(Outcome.UNKNOWN), int(Outcome.NOT_MONITORED))

    def __getitem__(self, name: str) -> float:
        """The threshold of a check."""
        return self.by_name[name].value


@lru_cache(maxsize=16)
def derive(site: SiteConfig, triangle: ReferenceTriangle) -> Limits:
    """All limits of a site; ConfigError where its promises contradict each other or its triangle."""
    promises = Promises(site, triangle)
    thresholds = tuple(threshold for family in ALL_FAMILIES for threshold in family(promises))
    value = {threshold.name: threshold.value for threshold in thresholds}
    p_md = site.integrity.missed_detection
    return Limits(
        thresholds=thresholds,
        radius_m=value[f"circle_{site.receiver_names[0]}"],
        isolation=chi2_quantile(promises.share / promises.looks_per_year, 3),
        pair=chi2_quantile(1e-3, 3),
        log_likelihood_ratio=NAMED_RATHER,
        jump_log_likelihood_ratio=log(10_000.0),
        collapse_fit=chi2_quantile(min(p_md, 1e-5), 6),
        undetected_sigmas=value["residual"] + gauss_quantile(p_md / promises.n),  # any one of the receivers may be the one that misses it
        least_separation=value["capture"] + promises.k_md,
        missed_detection=p_md,
        slow=promises.slow,
        carriers=carrier_design(promises.interval_s, value, NAMED_RATHER),
        clock_sigmas=6.0,
        gain_drop=0.15,
        min_common_satellites=5,
        max_exclusions_per_epoch=3,
        elevation_mask_rad=float(np.deg2rad(site.integrity.elevation_mask_deg)),
        min_cn0_dbhz=25.0,
        pseudorange_range_m=(1.0e7, 1.0e8),
        remember_satellite_ns=600 * NS_PER_S,
        loss_elevation_rad=float(np.deg2rad(15.0)),
        same_time_ns=NS_PER_S // 100,
        alignment_tolerance_ns=alignment_tolerance_ns(site.epoch_interval_ns),
        silence_ns=max(2 * site.epoch_interval_ns, 2 * NS_PER_S),
        recover_after_ns=round(site.integrity.recover_after_s * NS_PER_S),
        recover_after_of_ns={name: round(clean_for_s(name, site.integrity.recover_after_s) * NS_PER_S) for name in MOTION_CHECKS},
        most_growth=1.2,
        recover_epochs=2,
    )


def alignment_tolerance_ns(epoch_interval_ns: int) -> int:
    """How far from a nominal epoch a receiver's time tag may lie: 0.1 s, at high rates a fifth of the interval. Own choice."""
    return min(NS_PER_S // 10, epoch_interval_ns // 5)
