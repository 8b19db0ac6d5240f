"""Protection levels: how far off a position by least squares with SBAS corrections can be, but for a stated probability.

Horizontal: K_H times the larger axis of the error ellipse; vertical: K_V sigma_U; along a level track: K_H times sigma in that direction,
never more than the horizontal one. Source: RTCA DO-229D, J.1.
"""

from dataclasses import dataclass

import numpy as np

from integrity.gnss.observations import Bools, Floats, Ints, freeze
from integrity.gnss.sbas.corrections import Corrections

K_H = (6.0, 6.18)  # PA, NPA
K_V = 5.33
FEWEST = 4  # satellites of a position and a clock


@dataclass(frozen=True, eq=False)
class Protection:
    """Protection levels (E,), m, NaN where fewer than four satellites may be used or they do not determine a position; `n_used` (E,);
    `cov_enu_m2` (E, 6): xx, xy, xz, yy, yz, zz of east, north, up."""

    hpl_m: Floats
    vpl_m: Floats
    n_used: Ints
    cov_enu_m2: Floats

    def __post_init__(self) -> None:
        freeze(self)


def protection(c: Corrections, mode: int) -> Protection:
    """Of the satellites that may be used, each weighted by 1 / sigma^2; `mode` is PA or NPA."""
    cov = _covariance(c.u_enu, c.sigma_m, c.used)
    ee, en, _, nn, _, uu = cov.T
    half, d2 = (ee - nn) / 2.0, (ee + nn) / 2.0
    major = np.sqrt(d2 + np.sqrt(half * half + en * en))
    return Protection(K_H[mode] * major, K_V * np.sqrt(uu), c.used.sum(axis=1), cov)


def along_track_m(p: Protection, track_enu: Floats, mode: int) -> Floats:
    """Protection level (E,) along a unit vector, (3,) or (3, E), of the track."""
    x, y, z = track_enu
    ee, en, eu, nn, nu, uu = p.cov_enu_m2.T
    variance = ee * x * x + nn * y * y + uu * z * z + 2.0 * (en * x * y + eu * x * z + nu * y * z)
    result: Floats = K_H[mode] * np.sqrt(variance)
    return result


def _covariance(u_enu: Floats, sigma_m: Floats, used: Bools) -> Floats:
    """Of east, north, up (E, 6): inverse of G' W G without its clock, in closed form. NaN where it does not exist."""
    w = np.where(used, 1.0 / (sigma_m * sigma_m), 0.0)
    e, n, u = np.where(used, u_enu, 0.0)
    total = w.sum(axis=1)
    with np.errstate(invalid="ignore", divide="ignore"):
        e, n, u = (axis - ((w * axis).sum(axis=1) / total)[:, None] for axis in (e, n, u))
        a, b, c, d, f, g = ((w * product).sum(axis=1) for product in (e * e, e * n, e * u, n * n, n * u, u * u))
        cofactors = np.stack((d * g - f * f, c * f - b * g, b * f - c * d, a * g - c * c, b * c - a * f, a * d - b * b), axis=1)
        determinant = a * cofactors[:, 0] + b * cofactors[:, 1] + c * cofactors[:, 2]
        cov = cofactors / determinant[:, None]
    # Where satellites do not determine a position, rounding leaves about 1e-16 of what a good geometry has.
    sound = (used.sum(axis=1) >= FEWEST) & (determinant > 1e-12 * (a + d + g) ** 3)
    return np.where(sound[:, None], cov, np.nan)
