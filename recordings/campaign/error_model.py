"""Errors exactly as the site file states them: what the thresholds are derived from, and what no recording can be trusted to have.

e_j = c + d_j (section 2.2), and of each satellite a range error that all receivers share and one of each receiver's own. All normal, with
the site's overbounded sigmas, and the site's time constants where time matters.
"""

from dataclasses import dataclass, replace

import numpy as np

from integrity.config import SiteConfig
from integrity.gnss.observations import Bools, Floats, freeze
from integrity.gnss.positioning import range_sigma_m
from integrity.limits import Limits, derive
from integrity.monitors.residuals import KnownPointResiduals, b_values_m, known_point_residuals, normalised_b_values, seen_by_all, worst
from integrity.monitors.triangles import TriangleStatistics, Variances, promised_m2, triangle_statistics, variances_of
from integrity.thresholds import REFERENCE_SKY_RAD
from integrity.triangle import ReferenceTriangle, reference_triangle

UNDER_TEST = len(REFERENCE_SKY_RAD) - 1


@dataclass(frozen=True, eq=False)
class ErrorModel:
    """A site with its limits, its triangle, and its errors: variances for the real statistics, sigmas (3,) of east, north, up, m, and of
    the ranges of the sky (S,): what receivers share, and what they do not."""

    site: SiteConfig
    triangle: ReferenceTriangle
    limits: Limits
    var: Variances
    sigma_common_m: Floats
    sigma_own_m: Floats
    range_sigma_m: Floats  # of both together
    range_own_m: Floats

    def __post_init__(self) -> None:
        freeze(self)

    @property
    def receivers(self) -> int:
        """How many."""
        return len(self.site.receivers)

    @property
    def range_common_m(self) -> Floats:
        """What receivers share of a range's error, (S,)."""
        common: Floats = np.sqrt(self.range_sigma_m**2 - self.range_own_m**2)
        return common

    def displacements_m(self, common: Floats, own: Floats) -> Floats:
        """e (N, R, 3) of unit errors (N, 3) and (N, R, 3)."""
        e: Floats = (common * self.sigma_common_m)[:, None, :] + own * self.sigma_own_m
        return e

    def ranges_m(self, common: Floats, own: Floats) -> Floats:
        """Range errors (N, R, S) of unit errors (N, S) and (N, R, S)."""
        error_m: Floats = (common * self.range_common_m)[:, None, :] + own * self.range_own_m
        return error_m

    def of_triangle(self, e_enu_m: Floats) -> TriangleStatistics:
        """The statistics of displacements (N, R, 3)."""
        return triangle_statistics(e_enu_m, self.var, self.triangle)

    def worst_residual(self, prefit_m: Floats) -> Floats:
        """What the residual check looks at (N,), of ranges (N, R, S) of which all are used."""
        return worst(seen_by_all(self._known(prefit_m).normalised), self._sees)

    def worst_b(self, prefit_m: Floats) -> Floats:
        """The same of the B-values."""
        b_sigmas = normalised_b_values(b_values_m(self._known(prefit_m).residual_m), self.range_own_m[None])
        return worst(np.maximum.reduce(np.abs(b_sigmas), axis=1), self._sees)

    def _known(self, prefit_m: Floats) -> KnownPointResiduals:
        return known_point_residuals(prefit_m, self.range_sigma_m[None], self._sees, np.zeros(len(self.range_sigma_m), dtype=np.int64), 1)

    @property
    def _sees(self) -> Bools:
        return np.ones((1, len(self.range_sigma_m)), dtype=np.bool_)

    def with_separation(self, sigmas: float) -> "ErrorModel":
        """The same site with its triangle scaled so that S has that many sigmas between it and a point."""
        scale = sigmas / float(self.var.separation[0])
        triangle = replace(self.triangle, baseline_enu_m=self.triangle.baseline_enu_m * scale)
        return replace(self, triangle=triangle, var=variances_of(self.var.common, self.var.differential, triangle))


def error_model(site: SiteConfig) -> ErrorModel:
    """The errors of a site. ConfigError where its promises contradict each other (`limits.derive`)."""
    promises, triangle = site.integrity, reference_triangle(site)
    common_m2, own_m2 = promised_m2(promises)
    return ErrorModel(
        site=site,
        triangle=triangle,
        limits=derive(site, triangle),
        var=variances_of(common_m2[None], own_m2[None], triangle),
        sigma_common_m=np.sqrt(common_m2),
        sigma_own_m=np.sqrt(own_m2),
        range_sigma_m=range_sigma_m(REFERENCE_SKY_RAD, promises.sigma_range_m, promises.sigma_range_low_m),
        range_own_m=range_sigma_m(REFERENCE_SKY_RAD, promises.sigma_range_differential_m, promises.sigma_range_differential_low_m),
    )
