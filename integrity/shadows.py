"""Faults for the self-test: who is at fault in which minute, and by how much.

Sizes. k sigmas are the threshold, k_md what noise hides with the accepted probability: a fault of 1.5 (k + k_md) sigmas stays below its
threshold only where noise takes off 1.5 k_md + 0.5 k of them, 9 sigmas and more. They come from the site's promises, not from the limits
that the checks use: a limit that has changed does not take its fault along. Where no promise gives a size it stands here (own choice).
Receivers and satellites take turns from minute to minute, each satellite with every receiver.
"""

from dataclasses import replace
from functools import lru_cache
from itertools import combinations
from math import ceil, copysign, degrees, inf, nan, sqrt
from typing import NamedTuple

import numpy as np

from integrity.carrier_thresholds import CARRIER_CHECKS
from integrity.checks import BlockChecks
from integrity.config import SiteConfig
from integrity.gnss.constants import EARTH_ROTATION_RADPS
from integrity.gnss.ephemeris.broadcast import Ephemeris, GeoEphemeris, GlonassEphemeris, KeplerEphemeris
from integrity.gnss.ephemeris.kepler import GEOSTATIONARY
from integrity.gnss.observations import Bools, Floats
from integrity.gnss.positioning import URA_NOMINAL_M
from integrity.limits import ALL_FAMILIES
from integrity.monitors import navigation, slow
from integrity.monitors.told import Dispute, dispute
from integrity.probability import detectable_noncentrality
from integrity.sight import Sight
from integrity.thresholds import Promises
from integrity.triangle import ReferenceTriangle

MARGIN = 1.5
LEAST_REDUNDANCY = 0.1  # of a range, so that its residual shows its error: other satellites take no turn
LAST_BIT_M = 0.03  # of an orbit: IS-GPS-200, table 20-III
OFF_ORBIT = 3.0  # tolerances of `navigation.FAMILIES`; true orbits are off by up to one
SLOW_STEP_NS = slow.BEGIN_ANEW_NS  # of the past that slow shifts are shown: the fewest epochs
COMPASS = ((1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0))


class Faults(NamedTuple):
    """Sizes: metres of a circle, sigmas of all others, by the epoch's own geometry; `slow_steps`: for how long a receiver has stood off;
    `interval_s`: between epochs."""

    circle_m: float
    common: float
    common_3d: float
    shape: float
    shape_3d: float
    collapse: float
    residual: float
    b_value: float
    constellation: float
    capture: float
    ephemeris: float
    slow: float
    step: float
    ramp: float
    acceleration: float
    innovation: float
    divergence: float
    slow_steps: int
    interval_s: float


@lru_cache(maxsize=16)
def faults_of(site: SiteConfig, triangle: ReferenceTriangle) -> Faults:
    """What the promises of a site say must be caught, and half as much again."""
    promises = Promises(site, triangle)
    of = {threshold.name: threshold for family in ALL_FAMILIES for threshold in family(promises)}

    def distance(name: str, dof: int) -> float:
        return MARGIN * sqrt(detectable_noncentrality(of[name].value, dof, site.integrity.missed_detection))

    def sigmas(name: str) -> float:
        return MARGIN * (of[name].value + promises.k_md)

    sigma_m = sqrt(site.integrity.sigma_common_m**2 + site.integrity.sigma_differential_m**2)
    radius = of[f"circle_{site.receiver_names[0]}"].value / sigma_m
    design = promises.slow
    g = slow.gain(SLOW_STEP_NS, design.correlation_s)
    found_m = of["slow"].smallest_fault or nan
    shift = MARGIN * found_m / (site.integrity.sigma_differential_m * sqrt(1.5))
    return Faults(
        circle_m=MARGIN * sigma_m * sqrt(detectable_noncentrality(radius**2, 2, site.integrity.missed_detection)),
        common=distance("common", 2),
        common_3d=distance("common_3d", 3),
        shape=distance("shape", 4),
        shape_3d=distance("shape_3d", 6),
        collapse=sigmas("collapse"),
        residual=sigmas("residual"),
        b_value=sigmas("b_value"),
        constellation=distance("constellation", 3),
        capture=sigmas("capture"),
        ephemeris=sigmas("ephemeris"),
        slow=shift,
        **{name: sigmas(name) for name in CARRIER_CHECKS},
        interval_s=promises.interval_s,
        slow_steps=ceil(slow.SATURATION * design.threshold / (min(shift * g, slow.MOST_SIGMAS) - design.allowance * g)),
    )


class Shadow(NamedTuple):
    """A copy of the epoch for one check: what is added to its residuals (R, S), the satellites used (S,), and what the statistic must reach
    beside failing."""

    check: str
    more_m: Floats
    used: Bools
    reaches: float = -inf


class Turn(NamedTuple):
    """Epoch e of a block, and whose turn it is to be at fault, by the number of its minute."""

    sight: Sight
    full: BlockChecks
    e: int
    minute: int
    faults: Faults
    triangle: ReferenceTriangle

    @property
    def receiver(self) -> int:
        """That is at fault where one is."""
        return self.minute % len(self.triangle.names)

    @property
    def others(self) -> tuple[int, ...]:
        """All others."""
        return tuple(r for r in range(len(self.triangle.names)) if r != self.receiver)

    def among(self, columns: list[int], more: int = 0) -> int:
        """One of several, each with every receiver in turn."""
        return columns[(self.minute // len(self.triangle.names) + more) % len(columns)]

    def moved_m(self, e_enu_m: Floats) -> Floats:
        """What displacements (R, 3) add to residuals, (R, S): a range shrinks when the receiver moves towards the satellite."""
        los = self.sight.at_points.los_enu[:, self.e]
        more_m: Floats = -(los[0] * e_enu_m[:, :1] + los[1] * e_enu_m[:, 1:2] + los[2] * e_enu_m[:, 2:])
        return more_m


def of_receivers(turn: Turn) -> list[Shadow]:
    """Receivers that stand elsewhere: one, or all. That of slow shifts comes first: its monitor's past ends before the first copy."""
    faults, var, r = turn.faults, turn.full.var, turn.receiver
    used, names = turn.full.used[turn.e], turn.triangle.names
    n = len(names)
    sigma_d, sigma_mean = np.sqrt(var.differential[turn.e]), np.sqrt(var.mean[turn.e])
    east, north = COMPASS[turn.minute // n % len(COMPASS)]
    level = np.array([east, north, 0.0])
    upwards = np.array([0.0, 0.0, 1.0])
    own = sqrt(n / (n - 1)) * sigma_d  # of one receiver against the others

    def one(displaced_m: Floats) -> Floats:
        return turn.moved_m(np.where(np.arange(n)[:, None] == r, displaced_m, 0.0))

    def everyone(displaced_m: Floats) -> Floats:
        return turn.moved_m(np.tile(displaced_m, (n, 1)))

    towards_one_point = -faults.collapse / var.separation[turn.e] * turn.triangle.baseline_enu_m
    return [
        Shadow("slow", one(slow_shift_m(turn)[1]), used),
        Shadow(f"circle_{names[r]}", one(faults.circle_m * level), used),
        Shadow("common", everyone(faults.common * sigma_mean * level), used),
        Shadow("common_3d", everyone(faults.common_3d * sigma_mean * upwards), used),
        Shadow("shape", one(faults.shape * own * level), used),
        Shadow("shape_3d", one(faults.shape_3d * own * upwards), used),
        Shadow("collapse", turn.moved_m(towards_one_point), used),
        *_captured(turn),
    ]


def _captured(turn: Turn) -> list[Shadow]:
    """A pair that hears one transmitter: the differences of its ranges are those of its points, and a bit more where that is little."""
    design = turn.full.pairs
    separation = design.separation[turn.e].max(axis=-1)
    p = turn.minute % len(separation)
    a, b = list(combinations(range(len(turn.triangle.names)), 2))[p]
    range_m = turn.sight.sky.expected.range_m[turn.e]
    more_m = np.zeros(range_m.shape)
    more_m[a] = max(1.0, turn.faults.capture / max(separation[p], 1.0)) * (range_m[b] - range_m[a])
    return [Shadow("capture", more_m, turn.full.used[turn.e])]


def of_ranges(turn: Turn) -> list[Shadow]:
    """A satellite, a satellite at one receiver, a constellation; none where no one's ranges would show it."""
    e, full, inputs = turn.e, turn.full, turn.sight.satellites
    used, sigma_m, sigma_d_m = full.used[e], inputs.sigma_m[e], inputs.sigma_differential_m[e]
    n = len(turn.triangle.names)
    redundancy = np.where(used, full.satellites.scale_m[e, 0] / sigma_m, nan) ** 2  # 1 - h of `residuals`
    columns = np.flatnonzero(redundancy >= LEAST_REDUNDANCY).tolist()
    shadows = []
    if columns:
        s = turn.among(columns)
        of_all, of_one = np.zeros((n, len(used))), np.zeros((n, len(used)))
        of_all[:, s] = turn.faults.residual * sigma_m[s] / sqrt(redundancy[s])
        size_m = turn.faults.b_value * sigma_d_m[s] * n / sqrt(n * (n - 1)) / redundancy[s]
        of_one[turn.receiver, s] = copysign(size_m, full.satellites.b_m[e, turn.receiver, s])
        # The others' B-values move half as far: more than that is the receiver's own.
        shadows += [Shadow("residual", of_all, used), Shadow("b_value", of_one, used, reaches=0.75 * turn.faults.b_value)]
    known = np.flatnonzero(np.isfinite(full.satellites.displacements[e])).tolist()
    if known:
        k = turn.among(known)
        unit_m = np.where(inputs.system_of == k, turn.moved_m(np.tile((1.0, 0.0, 0.0), (n, 1))), 0.0)
        of_one_metre = inputs.epoch(e)._replace(prefit_m=unit_m[None])
        squared = of_one_metre.displacements(of_one_metre.constellations(used[None]))[0, k]
        size_m = turn.faults.constellation / sqrt(squared) if squared > 0.0 else 0.0
        shadows.append(Shadow("constellation", size_m * unit_m, used))
    return shadows


def slow_shift_m(turn: Turn) -> tuple[Floats, Floats]:
    """A place to the east or west of the others, on the side where the receiver stands already, and how far it has to go there."""
    east_m = turn.full.solution.e_enu_m[turn.e, :, 0]
    n, r = len(east_m), turn.receiver
    now_m = (east_m[r] - east_m.sum() / n) * n / (n - 1)
    size_m = turn.faults.slow * sqrt(n / (n - 1) * turn.full.var.differential[turn.e, 0])
    place_m = size_m if now_m >= 0.0 else -size_m
    return np.array([place_m, 0.0, 0.0]), np.array([place_m - now_m, 0.0, 0.0])


def false_sets(turn: Turn, columns: list[int]) -> tuple[list[Ephemeris], list[Ephemeris]]:
    """The sets of three satellites, by their columns, and what follows them: one that puts its satellite elsewhere, one that differs in its
    last bit under the same issue, one on an orbit that its system does not fly."""
    before = [turn.sight.sky.ephemerides[int(turn.sight.sky.index[turn.e, s])] for s in columns]
    along_m = turn.faults.ephemeris * sqrt(2.0) * max(before[0].accuracy_m or 0.0, URA_NOMINAL_M)
    return before, [_ahead(before[0], along_m), _ahead(before[1], LAST_BIT_M), _off_orbit(before[2])]


def told_falsely(turn: Turn, most_change: float) -> list[Dispute]:
    """What is disputed where one receiver is told of two satellites that they are elsewhere."""
    names, r = turn.triangle.names, turn.receiver
    usable = np.flatnonzero(turn.full.used[turn.e]).tolist()
    found = []
    for more in range(2):
        true = turn.sight.sky.ephemerides[int(turn.sight.sky.index[turn.e, turn.among(usable, more)])]
        false = _ahead(true, turn.faults.ephemeris * sqrt(2.0) * max(true.accuracy_m or 0.0, URA_NOMINAL_M))
        of = dispute({name: false if name == names[r] else true for name in names}, most_change)
        found += [of] if of is not None else []
    return found


def _ahead(eph: Ephemeris, along_m: float) -> Ephemeris:
    """The set with its satellite further along its orbit."""
    if isinstance(eph, KeplerEphemeris):
        return replace(eph, m0=eph.m0 + along_m / eph.sqrt_a**2)
    vx, vy, vz = _inertial_mps(eph)
    ahead_s = along_m / sqrt(vx * vx + vy * vy + vz * vz)
    return replace(eph, x_m=eph.x_m + ahead_s * vx, y_m=eph.y_m + ahead_s * vy, z_m=eph.z_m + ahead_s * vz)


def _off_orbit(eph: Ephemeris) -> Ephemeris:
    """The set on an orbit that is off by `OFF_ORBIT` tolerances of the nearest that its system flies: in eccentricity, of state vectors in
    the semi-major axis, which grows twice as fast as the velocity does."""
    family = _family_of(eph)
    if isinstance(eph, KeplerEphemeris):
        centre, tolerance = family.e
        return replace(eph, e=centre + OFF_ORBIT * tolerance)
    a_km, tolerance_km = family.a_km
    vx, vy, vz = _inertial_mps(eph)
    more = OFF_ORBIT * tolerance_km / (2.0 * a_km)
    return replace(eph, vx_mps=eph.vx_mps + more * vx, vy_mps=eph.vy_mps + more * vy, vz_mps=eph.vz_mps + more * vz)


def _family_of(eph: Ephemeris) -> navigation.Family:
    """The orbit of its system that a set's is next to."""
    families = navigation.OF_BEIDOU_GEOSTATIONARY if eph.satellite in GEOSTATIONARY else navigation.FAMILIES[eph.satellite[0]]
    if not isinstance(eph, KeplerEphemeris):
        return families[0]  # systems that send state vectors fly one
    a_km, i_deg = eph.sqrt_a**2 / 1e3, degrees(abs(eph.i0))
    return min(families, key=lambda of: max(abs(a_km - of.a_km[0]) / of.a_km[1], abs(i_deg - of.i_deg[0]) / of.i_deg[1]))


def _inertial_mps(eph: GlonassEphemeris | GeoEphemeris) -> tuple[float, float, float]:
    """Velocity as seen by who does not turn with the Earth, along the axes of ECEF."""
    return eph.vx_mps - EARTH_ROTATION_RADPS * eph.y_m, eph.vy_mps + EARTH_ROTATION_RADPS * eph.x_m, eph.vz_mps
