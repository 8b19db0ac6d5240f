"""False stops and exclusions by sound receivers with correlated errors, against what the site promises: months and years, at the level of
statistics.

Common errors forget with the site's common time constant, each receiver's own with the differential one. Every check that has a share of
a promise is looked at in every epoch, through the station's own statistics: positions by `triangle_statistics`, satellites by
`seen_by_all` and `b_values_m`, as many at once as the budget counts, evenly spread over the sky; slow shifts by the sums of
`monitors.slow`. A stop is what a line sees: the first alarm of whatever stops the site after as many clean epochs as it takes to run again;
so is an exclusion, satellite by satellite. Common errors that are slow make both come in clusters, so that counts scatter more than
Poisson's; their mean does not suffer.
Satellites: receiver clocks are taken as known, and a satellite never sets. Constellations, pairs of receivers, and what carriers show are
processes of their own with the law that their thresholds assume (`carrier_thresholds.CORRELATION_S`); each new ephemeris is looked at once.
"""

from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from itertools import repeat
from math import sqrt
from typing import NamedTuple

import numpy as np
from scipy.special import chdtrc, chdtri

from integrity.carrier_thresholds import CARRIER_CHECKS, CORRELATION_S
from integrity.config import SiteConfig
from integrity.gnss.gps_time import DAY_S
from integrity.gnss.observations import Bools, Floats, Ints
from integrity.monitors import slow
from integrity.monitors.residuals import b_values_m, normalised_b_values, seen_by_all
from integrity.probability import exceeds_again
from integrity.thresholds import YEAR_S, Promises
from recordings.campaign.error_model import UNDER_TEST, ErrorModel, error_model
from recordings.campaign.gauss_markov import CANDIDATE, Grid, between, coarse, grid

CHUNK_S = 5.0 * DAY_S  # simulated at once; each begins anew, in the stationary state
STOPPING = ("circle_", "common", "common_3d", "shape", "shape_3d", "collapse", "capture", "slow")  # whatever the site's policy
LEFT_OUT = "b_value"  # a range of one receiver: never a stop


class Found(NamedTuple):
    """Alarms of each check, stops, and exclusions, of a time that was simulated."""

    seconds: float
    alarms: dict[str, int]
    stops: int
    exclusions: int


class Promise(NamedTuple):
    """What was promised of a simulated time, stops and exclusions alike, and what came: `expected` alarms by crossing theory, by check;
    `alarms` of these checks together, with the standard error by how chunks differ (alarms come in clusters), None of one chunk."""

    per_year: float
    found: Found
    expected: dict[str, float]
    alarms: int
    alarms_error: float | None

    @property
    def promised(self) -> float:
        """Stops in the simulated time; of exclusions as many."""
        return self.per_year * self.found.seconds / YEAR_S


class Crossings(NamedTuple):
    """Of a chunk: alarms of a check, and the epochs in which it exceeds, in order."""

    check: str
    alarms: int
    epochs: Ints


def poisson_bounds(count: int) -> tuple[float, float]:
    """Exact two-sided 95 % interval of the mean of a Poisson count; Garwood 1936."""
    low = 0.0 if count == 0 else float(chdtri(2 * count, 0.975)) / 2.0
    return low, float(chdtri(2 * (count + 1), 0.025)) / 2.0


def alarms_of(site: SiteConfig, per_year: float, seconds: float, seed: int, jobs: int = 1) -> Promise:
    """The site with another promise, all checks sharing it, over so much simulated time."""
    promised = with_promise(site, per_year)
    model = error_model(promised)
    chunks = max(1, round(seconds / CHUNK_S))
    seeds = [(seed, chunk) for chunk in range(chunks)]
    if jobs == 1:
        parts = [_chunk(promised, seconds / chunks, s) for s in seeds]
    else:
        with ProcessPoolExecutor(jobs) as pool:
            parts = list(pool.map(_chunk, repeat(promised), repeat(seconds / chunks), seeds))
    alarms = {check: sum(part.alarms[check] for part in parts) for check in parts[0].alarms}
    stops, exclusions = sum(part.stops for part in parts), sum(part.exclusions for part in parts)
    found = Found(sum(part.seconds for part in parts), alarms, stops, exclusions)
    expected = _expected(model, found.seconds)
    counts = [sum(part.alarms[check] for check in expected) for part in parts]
    error = float(np.std(counts, ddof=1)) * sqrt(chunks) if chunks > 1 else None
    return Promise(per_year, found, expected, sum(counts), error)


def with_promise(site: SiteConfig, per_year: float) -> SiteConfig:
    """The site as if it promised so many false stops, and as many false exclusions."""
    promises = replace(site.integrity, false_stops_per_year=per_year, false_exclusions_per_year=per_year, tolerance_m=None)
    return replace(site, integrity=promises)


def _chunk(site: SiteConfig, seconds: float, seed: tuple[int, int]) -> Found:
    model = error_model(site)
    promises = Promises(site, model.triangle)
    of = grid(promises.interval_s, min(site.integrity.correlation_common_s, site.integrity.correlation_differential_s))
    steps = max(1, round(seconds / of.interval_s / of.per_step))
    rng = np.random.default_rng(seed)
    crossings = [
        *_of_positions(model, of, steps, rng),
        *_of_satellites(model, of, steps, rng),
        *_of_others(model, promises, steps * of.per_step, rng),
        _of_slow_shifts(promises, steps * of.per_step, rng),
    ]
    alarms: dict[str, int] = {}
    for found in crossings:
        alarms[found.check] = alarms.get(found.check, 0) + found.alarms
    stopping = [x.epochs for x in crossings if _stops(x.check, promises)]
    excluding = [x.epochs for x in crossings if not _stops(x.check, promises)]
    stops = _begun(np.unique(np.concatenate(stopping)), promises.clear)
    return Found(steps * of.per_step * of.interval_s, alarms, stops, sum(_begun(epochs, promises.clear) for epochs in excluding))


def _stops(check: str, promises: Promises) -> bool:
    """Whether a false alarm of this check stops the line, rather than leave something out."""
    return check.startswith(STOPPING) or (promises.stops_for_satellite and check != LEFT_OUT)


def _begun(epochs: Ints, clear: int) -> int:
    """How many of the epochs, in order, have `clear` others or more between them and the one before."""
    return int((np.diff(epochs) > clear).sum()) + (len(epochs) > 0)


def _of_positions(model: ErrorModel, of: Grid, steps: int, rng: np.random.Generator) -> list[Crossings]:
    n, promises = model.receivers, model.site.integrity
    tau_common, tau_own = promises.correlation_common_s, promises.correlation_differential_s
    common, own = coarse(of, tau_common, (3, steps + 1), rng), coarse(of, tau_own, (n, 3, steps + 1), rng)
    limits = _limits(model)
    coarsely = _position_statistics(model, common, own, limits)
    near: Bools = np.logical_or.reduce(np.stack([s > _near(check) * t for check, s, t in coarsely]))
    at = np.flatnonzero(near[1:] | near[:-1])
    fine_common = between(of, tau_common, common[:, at], common[:, at + 1], rng)
    fine_own = between(of, tau_own, own[..., at], own[..., at + 1], rng)
    shape = (len(at), of.per_step + 1)
    statistics = _position_statistics(model, fine_common.reshape(3, -1), fine_own.reshape(n, 3, -1), limits)
    return [_crossings(check, (s > t).reshape(shape), at, of) for check, s, t in statistics]


def _position_statistics(model: ErrorModel, common: Floats, own: Floats, limits: dict[str, float]) -> Iterator[tuple[str, Floats, float]]:
    """Check, statistic (N,), threshold, of unit errors (3, N) and (R, 3, N)."""
    found = model.of_triangle(model.displacements_m(common.T, np.moveaxis(own, -1, 0)))
    for r, name in enumerate(model.site.receiver_names):
        yield f"circle_{name}", found.circle_m[:, r], limits[f"circle_{name}"]
    for check in ("common", "common_3d", "shape", "shape_3d", "collapse"):
        yield check, getattr(found, check), limits[check]


def _of_satellites(model: ErrorModel, of: Grid, steps: int, rng: np.random.Generator) -> list[Crossings]:
    """Satellite by satellite, as many as share the budget."""
    n, promises = model.receivers, model.site.integrity
    tau_common, tau_own = promises.correlation_common_s, promises.correlation_differential_s
    limits = _limits(model)
    found: list[Crossings] = []
    for satellite in range(Promises(model.site, model.triangle).satellites):
        s = satellite % UNDER_TEST
        common, own = coarse(of, tau_common, (steps + 1,), rng), coarse(of, tau_own, (n, steps + 1), rng)
        residual, b = _range_statistics(model, s, common, own)
        for check, largest in (("residual", residual), ("b_value", np.maximum.reduce(b))):
            near = largest > CANDIDATE * limits[check]
            at = np.flatnonzero(near[1:] | near[:-1])
            fine_common = between(of, tau_common, common[at], common[at + 1], rng)
            fine_own = between(of, tau_own, own[:, at], own[:, at + 1], rng)
            shape = (len(at), of.per_step + 1)
            fine_residual, fine_b = _range_statistics(model, s, fine_common.reshape(-1), fine_own.reshape(n, -1))
            members = [fine_residual] if check == "residual" else list(fine_b)
            found += [_crossings(check, (of_one > limits[check]).reshape(shape), at, of) for of_one in members]
    return found


def _range_statistics(model: ErrorModel, satellite: int, common: Floats, own: Floats) -> tuple[Floats, Floats]:
    """|Residual| that all receivers share (N,), and |B-values| (R, N), in sigmas, of a satellite; unit errors (N,) and (R, N)."""
    s = slice(satellite, satellite + 1)
    error_m = (model.range_common_m[s] * common[:, None] + model.range_own_m[s] * own.T)[..., None]  # (N, R, 1)
    residual = seen_by_all(error_m / model.range_sigma_m[s])[:, 0]
    b: Floats = np.abs(normalised_b_values(b_values_m(error_m), model.range_own_m[None, s]))[..., 0].T
    return residual, b


def _of_others(model: ErrorModel, promises: Promises, epochs: int, rng: np.random.Generator) -> list[Crossings]:
    """Each constellation alone, a chi-square with 3 degrees of freedom that forgets slowly; each pair, with each constellation and with
    all, a normal value that forgets fast; what carriers show of each satellite; ephemerides, one look each."""
    limits, by_name = _limits(model), model.limits.by_name
    own_s, scales = promises.integrity.correlation_differential_s, len(promises.scales)
    found: list[Crossings] = []
    for check, members, dof, tau_s, threshold in (
        ("constellation", scales * (scales > 1), 3, promises.integrity.correlation_common_s, sqrt(limits["constellation"])),
        ("capture", _pairs(promises), 1, own_s, limits["capture"]),
        *((check, promises.satellites, 1, CORRELATION_S[check], limits[check]) for check in CARRIER_CHECKS),
    ):
        if tau_s == 0.0:
            found.append(_alone(check, members * epochs * by_name[check].false_alarm_probability, epochs, rng))
            continue
        of = grid(promises.interval_s, tau_s)
        sides = (1.0,) if check == "capture" else (1.0, -1.0)[: 2 if dof == 1 else 1]
        for _ in range(members):
            x = coarse(of, tau_s, (dof, epochs // of.per_step + 1), rng)
            near = np.logical_or.reduce([_length(side * x) > CANDIDATE * threshold for side in sides])
            at = np.flatnonzero(near[1:] | near[:-1])
            path = between(of, tau_s, x[:, at], x[:, at + 1], rng)
            found.append(_crossings(check, np.logical_or.reduce([_length(side * path) > threshold for side in sides]), at, of))
    looks = promises.uploads_per_year * epochs * promises.interval_s / YEAR_S
    return [*found, _alone("ephemeris", looks * by_name["ephemeris"].false_alarm_probability, epochs, rng)]


def _alone(check: str, expected: float, epochs: int, rng: np.random.Generator) -> Crossings:
    """Looks that know nothing of each other: how many exceed is Poisson's, and when is anytime."""
    count = int(rng.poisson(expected))
    return Crossings(check, count, np.sort(rng.integers(0, epochs, count)))


def _of_slow_shifts(promises: Promises, epochs: int, rng: np.random.Generator) -> Crossings:
    """Slow shifts of receivers that stand where they should."""
    exceeding = slow_alarms(rng.standard_normal((promises.n, 3, epochs)), promises)
    return Crossings("slow", _begun(exceeding, 1), exceeding)


def slow_alarms(innovation: Floats, promises: Promises) -> Ints:
    """Epochs in which a sum of `monitors.slow` of one receiver exceeds, from what is new of each receiver's error in each epoch (R, 3, E),
    unit variance; the sums as if they never stopped growing.

    Every sum at once: max(0, C + y - k g) from epoch to epoch is how far a walk stands above its lowest point so far.
    """
    design = promises.slow
    reference = design.allowance * slow.gain(promises.site.epoch_interval_ns, design.correlation_s)
    exceeding: list[Ints] = []
    for row in slow.channels(promises.n)[: promises.n]:
        for axis in range(3):
            y = np.clip(np.einsum("r,re->e", row, innovation[:, axis]), -slow.MOST_SIGMAS, slow.MOST_SIGMAS)
            for side in (1.0, -1.0):
                walk = np.cumsum(side * y - reference)
                exceeding.append(np.flatnonzero(walk - np.minimum(np.minimum.accumulate(walk), 0.0) > design.threshold))
    return np.unique(np.concatenate(exceeding))


def _length(x: Floats) -> Floats:
    """Of vectors (dof, ...); a single component counts only upwards."""
    length: Floats = x[0] if len(x) == 1 else np.sqrt((x**2).sum(axis=0))
    return length


def _pairs(promises: Promises) -> int:
    """Pairs of receivers, each with every constellation and with all."""
    return promises.n * (promises.n - 1) // 2 * (len(promises.scales) + 1)


def _crossings(check: str, exceeds: Bools, at: Ints, of: Grid) -> Crossings:
    """Of windows (W, per_step + 1) that begin at grid points `at`; the first epoch of a window belongs to the one before."""
    window, epoch = np.nonzero(exceeds[:, 1:])
    return Crossings(check, int((exceeds[:, 1:] & ~exceeds[:, :-1]).sum()), at[window] * of.per_step + epoch + 1)


def _near(check: str) -> float:
    """`CANDIDATE` for a statistic as it is: a chi-square is a square of sigmas."""
    return CANDIDATE**2 if check.startswith(("common", "shape")) else CANDIDATE


def _limits(model: ErrorModel) -> dict[str, float]:
    return {t.name: t.value for t in model.limits.thresholds}


def _expected(model: ErrorModel, seconds: float) -> dict[str, float]:
    """Alarms by crossing theory (section 2.5), at each check's own threshold. None of the residual check: all receivers have to see it, for
    which there is no formula."""
    promises, limits = Promises(model.site, model.triangle), _limits(model)
    a_common, a_own = promises.a_common, promises.a_differential
    var_common, var_own = model.site.integrity.sigma_common_m**2, model.site.integrity.sigma_differential_m**2
    n, satellites, scales = model.receivers, promises.satellites, len(promises.scales)

    def mixed(own_share: float) -> float:
        return (1.0 - own_share) * a_common + own_share * a_own

    def rate(threshold: float, dof: int, correlation: float) -> float:
        return seconds / promises.interval_s * float(chdtrc(dof, threshold)) * (1.0 - exceeds_again(threshold, dof, correlation))

    circle = rate(
        limits["circle_" + model.site.receiver_names[0]] ** 2 / (var_common + var_own), 2, mixed(var_own / (var_common + var_own))
    )
    of_mean = mixed(var_own / n / (var_common + var_own / n))
    return {
        **{f"circle_{name}": circle for name in model.site.receiver_names},
        "common": rate(limits["common"], 2, of_mean),
        "common_3d": rate(limits["common_3d"], 3, of_mean),
        "shape": rate(limits["shape"], 4, a_own),
        "shape_3d": rate(limits["shape_3d"], 6, a_own),
        "collapse": 0.5 * rate(limits["collapse"] ** 2, 1, a_own),
        "b_value": satellites * n * rate(limits["b_value"] ** 2, 1, a_own),
        "constellation": scales * (scales > 1) * rate(limits["constellation"], 3, a_common),
        "capture": 0.5 * _pairs(promises) * rate(limits["capture"] ** 2, 1, a_own),
    }
