"""How often stops begin: alarms of checks that see the same correlated errors, taken together.

Theory of operation. A stop begins with a look at which some check fails after `clear` looks at which none did. In a stationary process that
looks the same backwards that is as often as a look at which some check fails is followed by `clear` looks at which none does:

    stops per look = sum over checks i of P_i E[ 1 / M, if nothing fails at the next `clear` looks | i fails now ],

P_i the tail of check i, M how many checks fail now: what several of them see counts once. The expectation is a mean over paths. Each begins
with one check beyond its threshold, drawn exactly; then every component of the errors forgets with its own time constant (first-order
Gauss-Markov). Nothing is left to chance: the numbers in place of it come from an integer hash, the same in every run and on every machine.

Of more than `STEPS` looks those further after the alarm are taken ever more rarely, and with a threshold that is lower by what a path has
exceeded in between without showing it: 0.5826 standard deviations of its way (Siegmund 1985, chapter X; Broadie, Glasserman, Kou 1997,
Mathematical Finance 7).
"""

from collections.abc import Callable, Mapping, Sequence
from functools import lru_cache
from math import exp, log, pi, sqrt
from typing import NamedTuple

import numpy as np
from scipy.special import chdtri, ndtr, ndtri

from integrity.gnss.observations import Bools, Floats, Ints
from integrity.probability import gauss_quantile, tail_for_episode_rate

STEPS = 48
OVERSHOOT = 0.5826
LEAST_RESIDUAL = 1.0  # sigmas; where more stops are promised than can be told apart
PATHS = 1024  # of `episodes`: good for 2 %
USUAL_FACTOR, STOPS_PER_TAIL = 1.5, 0.93  # measured: 1.3 to 2.1 over promises, rates and sigmas; power by which stops grow with tails
FAMILIES = 4  # that share the errors of positions: circles, common, shape, collapse
GOLDEN = 0.6180339887498949  # its multiples fill an interval evenly
GRID = np.linspace(-4.0, 10.0, 561)  # of what receivers share, sigmas
GRID.setflags(write=False)


class Errors(NamedTuple):
    """Components (D,) of unit variance: how long each remembers; looks `interval_s` apart, and how many without a failure end a stop."""

    seconds: tuple[float, ...]
    interval_s: float
    clear: int

    def way(self, looks: int) -> Floats:
        """Variance (D,) of what each component moves in so many looks."""
        way: Floats = -2.0 * np.expm1(-looks * self.interval_s / np.array(self.seconds))
        return way


class Region(NamedTuple):
    """A check that fails where the length of rows x exceeds the quantile of `tail`; `rows` (m, D) orthonormal. Of one row: where the row
    itself does. `counts` for so many regions that differ in names only, 0 where another one counts for it."""

    rows: Floats
    tail: float
    counts: int = 1

    @property
    def threshold(self) -> float:
        """Of the length, sigmas."""
        return float(-ndtri(self.tail)) if len(self.rows) == 1 else sqrt(float(chdtri(len(self.rows), self.tail)))

    def fails(self, x: Floats, lowered: float = 0.0) -> Bools:
        """Of errors (D, N): (N,)."""
        along = _along(self.rows, x)
        length = along[0] if len(along) == 1 else np.sqrt(np.add.reduce(along * along, axis=0))
        result: Bools = length > self.threshold - lowered
        return result

    def beyond(self, normal: Floats, tail: Floats) -> Floats:
        """Errors (D, N) that fail: `normal` ones, moved along the rows until `tail` (N,) of the failing ones lie beyond."""
        along = _along(self.rows, normal)
        m = len(along)
        if m == 1:
            wanted = -ndtri(tail * self.tail)[None]
        else:
            wanted = along * np.sqrt(chdtri(m, tail * self.tail) / np.add.reduce(along * along, axis=0))
        return normal + _along(self.rows.T, wanted - along)

    def ended(self, x: Floats, way: Floats, normal: Floats, quantile: Floats) -> tuple[Floats, Floats]:
        """Errors (D, N) a look after x, when the length is below the threshold again, and the probability of that (N,).

        `normal` (D, N) moves them as it comes but for one direction w: straight down, where t, normal too, is drawn from what leads below,
        by its `quantile` (N,): |m + h t|^2 <= T^2 between the roots of a quadratic equation.
        """
        a = (1.0 - 0.5 * way)[:, None]
        step = np.sqrt(1.0 - a * a)
        now = _along(self.rows, a * x)
        w = step * _along(self.rows.T, now)
        w /= np.sqrt(np.add.reduce(w * w, axis=0))
        aside = a * x + step * (normal - w * np.add.reduce(w * normal, axis=0))
        m, h = _along(self.rows, aside), _along(self.rows, step * w)
        hh, mh = np.add.reduce(h * h, axis=0), np.add.reduce(m * h, axis=0)
        if len(self.rows) == 1:
            low, high = np.zeros(len(quantile)), ndtr((self.threshold - m[0]) / h[0])
        else:
            root = np.sqrt(np.maximum(mh * mh - hh * (np.add.reduce(m * m, axis=0) - self.threshold**2), 0.0))
            low, high = ndtr((-mh - root) / hh), ndtr((-mh + root) / hh)
        t = ndtri(np.maximum(low + (high - low) * quantile, 1e-300))
        return aside + step * w * t, high - low

    def way(self, way: Floats) -> float:
        """Standard deviation of what its length moves, of the components' variances (D,)."""
        return sqrt(float((self.rows**2 * way).sum()) / len(self.rows))


def position_regions(
    common_m: Sequence[float], differential_m: Sequence[float], baseline_enu_m: Sequence[Sequence[float]], tails: Mapping[str, float]
) -> list[Region]:
    """The checks of `monitors.triangles` with these tails, of errors c (3,), then d_j (3,) of each receiver, of unit variance: e_j is
    sigma_c c + sigma_d d_j, axis by axis (section 2.2)."""
    n, sigma_c, sigma_d = len(baseline_enu_m), np.array(common_m), np.array(differential_m)
    axes = np.eye(3)
    positions = np.stack([np.concatenate([axes * sigma_c] + [axes * sigma_d * (k == j) for k in range(n)], axis=1) for j in range(n)])
    horizontal = [_unit(e_j[:2]) for e_j in positions]
    mean = _unit(np.add.reduce(positions) / n)
    helmert = [_unit((np.add.reduce(positions[:j]) / j - positions[j]) * ([0.0] * 3 + [1.0] * 3 * n)) for j in range(1, n)]
    shape = np.concatenate([of[:2] for of in helmert] + [of[2:] for of in helmert])
    towards_one_point = np.concatenate([np.zeros(3), *(-np.array(r_m) / sigma_d for r_m in baseline_enu_m)])[None]
    return [
        *(Region(rows, tails["circle"], n if j == 0 else 0) for j, rows in enumerate(horizontal)),
        Region(mean[:2], tails["common"]),
        Region(mean, tails["common_3d"]),
        Region(shape[: 2 * (n - 1)], tails["shape"]),
        Region(shape, tails["shape_3d"]),
        Region(_unit(towards_one_point), tails["collapse"]),
    ]


def _unit(rows: Floats) -> Floats:
    unit: Floats = rows / np.sqrt(np.add.reduce(rows * rows, axis=1))[:, None]
    return unit


def stops_per_look(regions: Sequence[Region], errors: Errors, paths: int) -> float:
    """Of all regions together; `paths` from each that counts: 1,000 are good for 2 %. More of them begin near the threshold, from where a
    path ends an alarm."""
    v: Floats = (np.arange(paths) + 0.5) / paths
    quantile: Floats = np.mod((np.arange(paths) + 0.5) * GOLDEN, 1.0)
    way = errors.way(1)
    starts, weights = [], []
    for i, region in enumerate(regions):
        if region.counts:
            normal = _normal(i - len(regions), np.arange(2 * paths), len(errors.seconds))
            x = region.beyond(normal[:, :paths], 1.0 - v**3)
            several = np.maximum(np.add.reduce([of.fails(x) for of in regions]), 1)  # itself, but for rounding
            x, share = region.ended(x, way, normal[:, paths:], quantile)
            none = np.logical_and.reduce([np.full(paths, True), *(~of.fails(x) for j, of in enumerate(regions) if j != i)])
            starts.append(x[:, none])
            weights.append((region.counts * region.tail * share * 3.0 * v * v / paths / several)[none])

    def fails(x: Floats, kept: Ints, way: Floats, first: Floats) -> Bools:
        result: Bools = np.logical_or.reduce([of.fails(x, OVERSHOOT * (of.way(way) - of.way(first))) for of in regions])
        return result

    ended = _silent_after(np.concatenate(starts, axis=1), 1, errors, fails)
    least = max(region.tail for region in regions) / (1000.0 * paths)  # where no path is left: by far less than one stands for
    return max(float(np.concatenate(weights)[ended].sum()), least)


def tail_seen_by_all(k: float, common: float, receivers: int) -> float:
    """P(C + D_j > k for all j), C and D_j normal, variances `common` and 1 - common: what the smallest of the receivers' values exceeds."""
    return float(_seen_by_all(k, common, receivers).sum() * (GRID[1] - GRID[0]) / sqrt(2.0 * pi))


def tail_missed_by_one(k: float, common: float, receivers: int) -> float:
    """P(C + D_j > k for some j): what the largest of the receivers' values exceeds."""
    at_one = ndtr((sqrt(common) * GRID - k) / sqrt(1.0 - common))
    density = np.exp(-0.5 * GRID**2) * -np.expm1(receivers * np.log1p(-np.minimum(at_one, 1.0 - 1e-16)))
    return float(density.sum() * (GRID[1] - GRID[0]) / sqrt(2.0 * pi))


def _seen_by_all(k: float, common: float, receivers: int) -> Floats:
    """exp(-c^2 / 2) P(all D_j beyond k - C | C = c) on the grid."""
    density: Floats = np.exp(-0.5 * GRID**2) * ndtr((sqrt(common) * GRID - k) / sqrt(1.0 - common)) ** receivers
    return density


def stops_seen_by_all_per_look(k: float, commons: Sequence[float], receivers: int, errors: Errors, paths: int) -> float:
    """Of a value that all receivers see (`monitors.residuals.seen_by_all`) beyond k to either side; the mean over several shares `commons`
    of the variance that receivers have in common, `paths` for each. Components of `errors`: C, then each D_j."""
    common = np.repeat(commons, paths)
    of_c, of_d = np.sqrt(common), np.sqrt(1.0 - common)
    u = ndtr(_normal(-1, np.arange(len(common)), receivers))
    c = np.concatenate([_beyond_k(k, of, receivers, paths) for of in commons])
    d = -ndtri(u * ndtr((of_c * c - k) / of_d))

    def fails(x: Floats, kept: Ints, way: Floats, first: Floats) -> Bools:
        share = common[kept]
        far, near = (np.sqrt(share * of[0] + (1.0 - share) * of[1]) for of in (way, first))
        result: Bools = of_c[kept] * x[0] + of_d[kept] * np.minimum.reduce(x[1:], axis=0) > k - OVERSHOOT * (far - near)
        return result

    ended = _silent_after(np.concatenate((c[None], d)), 0, errors, fails)
    tails = np.repeat([tail_seen_by_all(k, of, receivers) for of in commons], paths)
    return 2.0 * max(float(tails[ended].sum()), float(tails.max()) / 1000.0) / len(common)


def _beyond_k(k: float, common: float, receivers: int, paths: int) -> Floats:
    """C where all receivers are beyond k, (paths,), from its smallest to its largest."""
    below = np.add.accumulate(_seen_by_all(k, common, receivers))
    c: Floats = np.interp((np.arange(paths) + 0.5) / paths * below[-1], below, GRID)
    return c


def _silent_after(x: Floats, seen: int, errors: Errors, fails: Callable[[Floats, Ints, Floats, Floats], Bools]) -> Ints:
    """Which of the paths from x (D, N), `seen` looks after an alarm, fail at none of the looks left; `fails` of errors, of which paths, and
    of the ways since the look before and between two neighbours."""
    dimension, paths = x.shape
    kept, before = np.arange(paths), seen
    for look in looks(errors.clear)[seen:]:
        way = errors.way(look - before)
        a = (1.0 - 0.5 * way)[:, None]
        x = a * x + np.sqrt(1.0 - a * a) * _normal(look, kept, dimension)
        passes = ~fails(x, kept, way, errors.way(1))
        x, kept, before = x[:, passes], kept[passes], look
    return kept


@lru_cache(maxsize=64)
def looks(clear: int) -> tuple[int, ...]:
    """Up to `STEPS` of the looks 1 to `clear`: the first ones, then ever fewer, the last."""
    for first in range(min(clear, STEPS), 0, -1):
        taken: list[int] = []
        look = 0
        while look < clear and len(taken) <= STEPS:
            look = min(clear, look + max(1, look // first))
            taken.append(look)
        if len(taken) <= STEPS:
            return tuple(taken)
    raise AssertionError(f"no {STEPS} looks reach {clear}")


def _normal(look: int, paths: Ints, dimension: int) -> Floats:
    """Normal numbers (D, N) in place of chance, of a look and of paths (N,): four of an integer of splitmix64 (Steele, Lea, Flood 2014)."""
    fours = np.arange((dimension + 3) // 4, dtype=np.uint64)[:, None]
    z = (paths.astype(np.uint64) + (fours << np.uint64(24)) + np.uint64((look + 64) << 32)) * np.uint64(0x9E3779B97F4A7C15)
    z = (z ^ (z >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    z = (z ^ (z >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    z ^= z >> np.uint64(31)
    quarters = np.concatenate([(z >> np.uint64(shift)) & np.uint64(0xFFFF) for shift in (0, 16, 32, 48)])
    return _quantiles()[quarters[:dimension].astype(np.int64)]


@lru_cache(maxsize=1)
def _quantiles() -> Floats:
    quantiles: Floats = ndtri((np.arange(65536) + 0.5) / 65536)
    return quantiles


def _along(rows: Floats, x: Floats) -> Floats:
    """rows x, (m, N), one component after the other."""
    result: Floats = np.einsum("md,dn->mn", rows, x)
    return result


@lru_cache(maxsize=16)
def position_tails(
    common_m: tuple[float, ...],
    differential_m: tuple[float, ...],
    baseline_enu_m: tuple[tuple[float, ...], ...],
    share: float,
    errors: Errors,
) -> Mapping[str, float]:
    """Tails per look by which each of the families (circles, common, shape, collapse) alone would begin stops at the rate `share` per look,
    times the one factor by which all together begin them at the sum of their shares; sigmas of east, north, up.

    Stops grow a little slower than tails, since alarms that are more frequent come in larger clusters: from a usual factor one step does.
    """
    n = len(baseline_enu_m)
    a_common, a_own = (exp(-errors.interval_s / seconds) for seconds in (errors.seconds[0], errors.seconds[-1]))

    def tail(members: float, dof: int, receivers: int) -> float:
        var_common, var_own = common_m[0] ** 2, differential_m[0] ** 2 / max(receivers, 1)
        a = (var_common * a_common + var_own * a_own) / (var_common + var_own) if receivers else a_own
        return tail_for_episode_rate(share / members, 1.0, dof, a, errors.clear)

    tails = {
        "circle": tail(n, 2, 1),
        "common": tail(2, 2, n),
        "common_3d": tail(2, 3, n),
        "shape": tail(2, 4, 0),
        "shape_3d": tail(2, 6, 0),
        "collapse": tail(0.5, 1, 0) / 2.0,
    }
    tails = {name: p * USUAL_FACTOR for name, p in tails.items()}
    together = stops_per_look(position_regions(common_m, differential_m, baseline_enu_m, tails), errors, PATHS)
    more = (FAMILIES * share / together) ** (1.0 / STOPS_PER_TAIL)
    return {name: min(p * more, 0.1) for name, p in tails.items()}


@lru_cache(maxsize=16)
def residual_threshold(stops: float, commons: tuple[float, ...], receivers: int, errors: Errors) -> float:
    """Sigmas beyond which all receivers see a satellite so often per look, the mean over satellites with these shares of common errors; by
    Newton's method on logarithms, first for tails, then for stops."""
    k = gauss_quantile(stops)
    slope = sum(of + (1.0 - of) / receivers for of in commons) / len(commons)  # variance of what all receivers see alike
    for _ in range(3):
        p = 2.0 * sum(tail_seen_by_all(k, of, receivers) for of in commons) / len(commons)
        k += log(p / (3.0 * stops)) * slope / k
        k = max(k, LEAST_RESIDUAL)
    for _ in range(2):
        k += log(stops_seen_by_all_per_look(k, commons, receivers, errors, PATHS // 2) / stops) * slope / k
        k = max(k, LEAST_RESIDUAL)
    return k


def missed_by_one(probability: float, common: float, receivers: int) -> float:
    """Sigmas that noise takes off the value of one receiver at least with a probability; by bisection."""
    low, high = 0.0, 10.0
    for _ in range(50):
        middle = (low + high) / 2.0
        low, high = (middle, high) if tail_missed_by_one(middle, common, receivers) > probability else (low, middle)
    return high
