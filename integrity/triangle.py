"""The reference triangle, the tolerance circles, and the solved triangle of one epoch."""

from dataclasses import dataclass
from functools import lru_cache
from itertools import combinations

import numpy as np

from integrity.config import SiteConfig
from integrity.gnss.frames import enu_axes, geodetic_from_ecef
from integrity.gnss.observations import Floats, freeze


@dataclass(frozen=True, eq=False)
class ReferenceTriangle:
    """Surveyed points of the receivers: `pos_ecef_m` (R, 3), geodetic coordinates (R,), local axes `enu` (R, 3, 3).

    `baseline_enu_m` (R, 3): each point minus the centroid, in the axes of the first point.
    """

    names: tuple[str, ...]
    pos_ecef_m: Floats
    lat_rad: Floats
    lon_rad: Floats
    height_m: Floats
    enu: Floats
    baseline_enu_m: Floats

    def __post_init__(self) -> None:
        freeze(self)

    @property
    def sides_m(self) -> dict[tuple[str, str], float]:
        """Length of every side, by the names of its ends."""
        pairs = combinations(range(len(self.names)), 2)
        return {(self.names[a], self.names[b]): float(np.linalg.norm(self.pos_ecef_m[a] - self.pos_ecef_m[b])) for a, b in pairs}


@lru_cache(maxsize=16)
def reference_triangle(site: SiteConfig) -> ReferenceTriangle:
    """The triangle of a site file. The points are taken as they are: plausibility is checked where the file is read."""
    points = np.array([r.position_ecef_m for r in site.receivers], dtype=np.float64)
    lat_rad, lon_rad, height_m = geodetic_from_ecef(points)
    enu = enu_axes(lat_rad, lon_rad)
    return ReferenceTriangle(
        names=site.receiver_names,
        pos_ecef_m=points,
        lat_rad=lat_rad,
        lon_rad=lon_rad,
        height_m=height_m,
        enu=enu,
        baseline_enu_m=np.einsum("ij,rj->ri", enu[0], points - points.mean(axis=0)),
    )
