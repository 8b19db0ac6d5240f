"""Positions of all receivers and epochs of a block at once, linearised at known points.

The path: `expected` says what given points would see, `compared` what was measured beyond that (`prefit` does both); `solve` turns such
residuals into displacements, in the local axes of each receiver, with a clock per constellation; `positions` does all of it and
linearises again where a receiver is far away.

Each clock is eliminated by subtracting its constellation's weighted mean, which leaves 3 x 3 normal equations that are inverted
in closed form: no linear-algebra library, so that every machine computes the same.
"""

from dataclasses import dataclass, replace
from enum import IntEnum
from typing import NamedTuple

import numpy as np

from integrity.gnss.angles import sine_cosine
from integrity.gnss.atmosphere import (
    Klobuchar,
    klobuchar_delay_m,
    klobuchar_slope,
    saastamoinen_zenith_m,
    troposphere_mapping,
    troposphere_slope,
)
from integrity.gnss.constants import EARTH_ROTATION_RADPS, SPEED_OF_LIGHT_MPS
from integrity.gnss.ephemeris import SatelliteStates
from integrity.gnss.frames import enu_axes, geodetic_from_ecef
from integrity.gnss.gps_time import NS_PER_S, WEEK_NS
from integrity.gnss.observations import Bools, Floats, Ints, ObservationBlock, freeze, slices

TRAVEL_TIME_NS = 77_500_000  # midway between zenith and horizon, GPS and Galileo: states are evaluated this long before the epoch
RELINEARISE_BEYOND_M = 1_000.0  # second order of the range: 2.5 cm at 1 km, 2.5 m at 10 km
RELINEARISATIONS = 6  # from anywhere on Earth to below 1 mm
LOWEST_MODELLED_RAD = float(np.deg2rad(3.0))  # below, neither atmosphere model holds; such satellites are screened out
MOST_PDOP = 100.0
URA_NOMINAL_M = 2.4  # URA index 0: the accuracy for which the site's range sigmas hold


# The six cofactors of a symmetric 3 x 3 matrix, xx, xy, xz, yy, yz, zz, are a b - c d: which of its nine entries; and how they fill it.
COFACTOR_A, COFACTOR_B = [4, 2, 1, 0, 1, 0], [8, 5, 5, 8, 2, 4]
COFACTOR_C, COFACTOR_D = [5, 1, 2, 2, 0, 1], [5, 8, 4, 2, 5, 1]
SQUARE = [[0, 1, 2], [1, 3, 4], [2, 4, 5]]


class Unsolved(IntEnum):
    """Why there is no position, or SOLVED."""

    SOLVED = 0
    TOO_FEW_SATELLITES = 1
    POOR_GEOMETRY = 2
    DIVERGED = 3


class Points(NamedTuple):
    """Points of linearisation: `pos_ecef_m` (E or 1, R, 3), geodetic coordinates and tropospheric zenith delay
    (E or 1, R), local axes `enu` (E or 1, R, 3, 3)."""

    pos_ecef_m: Floats
    lat_rad: Floats
    lon_rad: Floats
    height_m: Floats
    zenith_delay_m: Floats
    enu: Floats


class Expected(NamedTuple):
    """What points would see at the times `t_ns` (E,), before anything is measured: pseudorange but for the receiver's clock, with the
    delays of the atmosphere, its rate and half its acceleration, (E, R, S); satellite clocks `clock_s` (E, 1, S); `los_enu` (3, E, R, S):
    unit vectors from receiver to satellite; `el_rad`, `az_rad` (E, R, S)."""

    t_ns: Ints
    clock_s: Floats
    range_m: Floats
    rate_mps: Floats
    half_acc_mps2: Floats
    los_enu: Floats
    el_rad: Floats
    az_rad: Floats


@dataclass(frozen=True, eq=False)
class Prefit:
    """Residuals (E, R, S) at the points, m: measured minus modelled pseudorange, receiver clock left in; NaN where unseen.

    `los_enu` (3, E, R, S): unit vectors from receiver to satellite; `el_rad`, `az_rad` (E, R, S) also where nothing was measured.
    """

    residual_m: Floats
    los_enu: Floats
    el_rad: Floats
    az_rad: Floats

    def __post_init__(self) -> None:
        freeze(self)


class Design(NamedTuple):
    """A solution before anything is measured: all of it that follows from where the satellites `used` are. Symbols as in `design`."""

    used: Bools  # (E, R, S)
    sigma_m: Floats  # as given
    system_of: Ints  # (S,)
    member: Floats  # (S, K): one where the satellite is of the constellation
    w: Floats  # (E, R, S)
    wu: Floats  # (3, E, R, S)
    safe: Floats  # (E, R, K): weight of the constellation, one where it has none
    u_mean: Floats  # (3, E, R, K), NaN where it has none
    C: Floats  # (3, 3, E, R), NaN where unsolved
    cov_enu_m2: Floats  # this and the rest go into the `Solution` as they are
    n_used: Ints
    why: Ints


@dataclass(frozen=True, eq=False)
class Solution:
    """Displacements from the points: `e_enu_m` and, in order of `SYSTEMS`, `clock_m`; (E, R, 3) and (E, R, K); NaN where unsolved.

    `cov_enu_m2` (E, R, 3, 3) is the covariance of the position when the sigmas are right, m2; `why` (E, R) holds `Unsolved`.
    """

    e_enu_m: Floats
    clock_m: Floats
    cov_enu_m2: Floats
    n_used: Ints
    why: Ints

    def __post_init__(self) -> None:
        freeze(self)

    @property
    def solved(self) -> Bools:
        """Where there is a position, (E, R)."""
        result: Bools = self.why == Unsolved.SOLVED
        return result


def points_at(pos_ecef_m: Floats) -> Points:
    """Points (..., R, 3) with their geodetic coordinates and axes; a single set (R, 3) serves all epochs."""
    pos = pos_ecef_m if pos_ecef_m.ndim == 3 else pos_ecef_m[None]
    lat, lon, height = geodetic_from_ecef(pos)
    return Points(pos, lat, lon, height, saastamoinen_zenith_m(lat, height), enu_axes(lat, lon))


def state_time_ns(epoch_ns: Ints) -> Ints:
    """The time at which to evaluate satellite states for epochs: near every transmission time, and the same for all receivers."""
    return epoch_ns - TRAVEL_TIME_NS


def prefit(block: ObservationBlock, states: SatelliteStates, points: Points, klobuchar: Klobuchar | None) -> Prefit:
    """Residuals of a block at the points; `states` at `state_time_ns` of the block's epochs."""
    return compared(block, expected(states, block.epoch_ns, points, klobuchar))


def compared(block: ObservationBlock, sight: Expected) -> Prefit:
    """What was measured, less what was expected at each receiver's own time of transmission."""
    t_rx_s = ((block.receive_time_ns - sight.t_ns[:, None]) / NS_PER_S)[:, :, None]
    rho = block.pseudorange_m
    with np.errstate(invalid="ignore"):  # a range that is infinite
        dt = t_rx_s - rho / SPEED_OF_LIGHT_MPS - sight.clock_s
        residual_m = rho - sight.range_m - dt * (sight.rate_mps + dt * sight.half_acc_mps2)
    return Prefit(residual_m, sight.los_enu, sight.el_rad, sight.az_rad)


def expected(states: SatelliteStates, epoch_ns: Ints, points: Points, klobuchar: Klobuchar | None) -> Expected:
    """Pseudoranges at the points but for the receivers' clocks, as they change around the time of the states (`state_time_ns`).

    To the second order in the time from there to transmission, 12 ms at most for a receiver whose time tag is the epoch's: within
    0.1 mm for one whose tag is up to 0.5 s off. Without Klobuchar terms the ionosphere is left out.
    """
    tow_s = (epoch_ns % WEEK_NS / NS_PER_S)[:, None, None]
    satellites = np.concatenate(
        (states.pos_ecef_m, states.vel_ecef_mps, states.acc_ecef_mps2, states.clock_s[None], states.clock_drift_sps[None])
    )[:, :, None, :]
    n_epochs, n_signals = states.clock_s.shape
    n_receivers = points.pos_ecef_m.shape[1]
    out = np.empty((8, n_epochs, n_receivers, n_signals))
    for few in slices(n_epochs, n_receivers * n_signals):
        there = points if len(points.pos_ecef_m) == 1 else Points(*(p[few] for p in points))
        out[:, few] = _geometry(tow_s[few], satellites[:, few], there, klobuchar)
    return Expected(states.t_ns, states.clock_s[:, None, :], out[0], out[1], out[2], out[3:6], out[6], out[7])


def _geometry(tow_s: Floats, satellites: Floats, points: Points, klobuchar: Klobuchar | None) -> list[Floats]:
    """Range with its rate and half its acceleration, line of sight (east, north, up), elevation, azimuth; each (E, R, S)."""
    x, y, z, vx, vy, vz, ax, ay, az, clock_s, clock_drift_sps = satellites
    x_r, y_r, z_r = (points.pos_ecef_m[..., i, None] for i in range(3))
    dx, dy, dz = x - x_r, y - y_r, z - z_r
    distance_m = np.sqrt(dx * dx + dy * dy + dz * dz)
    distance_mps = (dx * vx + dy * vy + dz * vz) / distance_m
    across2 = vx * vx + vy * vy + vz * vz + dx * ax + dy * ay + dz * az  # v^2 + d a
    half_acc_mps2 = 0.5 * (across2 - distance_mps * distance_mps) / distance_m
    sagnac = EARTH_ROTATION_RADPS / SPEED_OF_LIGHT_MPS

    axes = points.enu[..., None]
    east, north, up = ((axes[:, :, i, 0] * dx + axes[:, :, i, 1] * dy + axes[:, :, i, 2] * dz) / distance_m for i in range(3))
    up_mps = axes[:, :, 2, 0] * vx + axes[:, :, 2, 1] * vy + axes[:, :, 2, 2] * vz
    level = np.hypot(east, north)
    el_rad = np.arctan2(up, level)
    az_rad = np.arctan2(east, north)
    el_rate_radps = (up_mps - up * distance_mps) / (distance_m * np.maximum(level, 1e-6))

    el_air = np.maximum(el_rad, LOWEST_MODELLED_RAD)
    delay_m = points.zenith_delay_m[..., None] * troposphere_mapping(el_air)
    delay_mprad = delay_m * troposphere_slope(el_air)
    if klobuchar is not None:
        ionosphere_m = klobuchar_delay_m(tow_s, points.lat_rad[..., None], points.lon_rad[..., None], az_rad, el_air, klobuchar)
        delay_m = delay_m + ionosphere_m
        delay_mprad = delay_mprad + ionosphere_m * klobuchar_slope(el_air)
    range_m = distance_m + sagnac * (x * y_r - y * x_r) - SPEED_OF_LIGHT_MPS * clock_s + delay_m
    rate_mps = distance_mps + sagnac * (vx * y_r - vy * x_r) - SPEED_OF_LIGHT_MPS * clock_drift_sps + delay_mprad * el_rate_radps
    return [range_m, rate_mps, half_acc_mps2, east, north, up, el_rad, az_rad]


def range_sigma_m(el_rad: Floats, a_m: float, b_m: float, accuracy_m: Floats | float = URA_NOMINAL_M) -> Floats:
    """Standard deviation of a range, m: (URA / 2.4 m) sqrt(a^2 + (b / sin el)^2); shape of el_rad.

    Elevations below 3 deg count as 3 deg, an accuracy better than 2.4 m as 2.4 m: a satellite cannot make itself infinitely good.
    """
    sin_el, _ = sine_cosine(np.maximum(el_rad, LOWEST_MODELLED_RAD))
    scale = np.maximum(accuracy_m, URA_NOMINAL_M) / URA_NOMINAL_M
    sigma_m: Floats = scale * np.sqrt(a_m**2 + (b_m / sin_el) ** 2)
    return sigma_m


def solve(residual_m: Floats, los_enu: Floats, sigma_m: Floats, used: Bools, system_of: Ints, n_systems: int) -> Solution:
    """Weighted least squares of displacement and a clock per constellation, for every epoch and receiver.

    residual_m (E, R, S); los_enu (3, E, R, S); sigma_m, used broadcast to (E, R, S); system_of (S,) numbers the constellation.
    A satellite alone in its constellation determines only a clock. Geometry is refused where its weighted PDOP, sqrt(tr(C) mean(w)),
    exceeds 100.
    """
    return solution(design(los_enu, sigma_m, used & np.isfinite(residual_m), system_of, n_systems), residual_m)


def design(los_enu: Floats, sigma_m: Floats, used: Bools, system_of: Ints, n_systems: int) -> Design:
    """The part of `solve` that needs no measurement, for satellites `used` all of which will have been measured."""
    used = np.broadcast_to(used, los_enu.shape[1:])
    w = np.where(used, 1.0 / sigma_m**2, 0.0)
    u = np.where(used, los_enu, 0.0)

    member = (system_of[:, None] == np.arange(n_systems)).astype(np.float64)  # (S, K)
    weight = _per_system(w, member)  # (E, R, K)
    count = _per_system(used.astype(np.float64), member)
    safe = np.where(weight > 0.0, weight, 1.0)
    wu = w * u
    u_mean = _per_system(wu, member) / safe  # (3, E, R, K)

    N = _products(wu, u) - _products(weight * u_mean, u_mean)
    C, determinant = _inverse(N)

    n_used = used.sum(axis=-1)
    n_clocks = (count > 0).sum(axis=-1)
    with np.errstate(invalid="ignore"):
        pdop2 = (C[0, 0] + C[1, 1] + C[2, 2]) * weight.sum(axis=-1) / np.maximum(n_used, 1)
        poor = ~((determinant > 0.0) & (pdop2 <= MOST_PDOP**2))
    why = np.where(n_used < 3 + n_clocks, Unsolved.TOO_FEW_SATELLITES, np.where(poor, Unsolved.POOR_GEOMETRY, Unsolved.SOLVED))
    C[:, :, why != Unsolved.SOLVED] = np.nan
    return Design(
        used=used,
        sigma_m=sigma_m,
        system_of=system_of,
        member=member,
        w=w,
        wu=wu,
        safe=safe,
        u_mean=np.where(count > 0, u_mean, np.nan),
        C=C,
        cov_enu_m2=C.transpose(2, 3, 0, 1),
        n_used=n_used,
        why=why,
    )


def solution(of: Design, residual_m: Floats) -> Solution:
    """What the residuals (E, R, S) make of a design."""
    y = np.where(of.used, residual_m, 0.0)
    y_mean = _per_system(of.w * y, of.member) / of.safe
    dy = y - y_mean[..., of.system_of]
    b = -(of.wu * dy).sum(axis=-1)  # a range shrinks when the receiver moves towards the satellite
    e = (of.C * b).sum(axis=1)
    clock = y_mean + (of.u_mean * e[..., None]).sum(axis=0)
    found = Solution(e.transpose(1, 2, 0), clock, of.cov_enu_m2, of.n_used, of.why)
    return found if np.isfinite(e).all() else _without_infinite(found)


def _without_infinite(found: Solution) -> Solution:
    """A displacement beyond all numbers is none: its geometry was poorer than its PDOP said."""
    broken: Bools = ~np.all(np.isfinite(found.e_enu_m), axis=-1)
    if not (broken & found.solved).any():
        return found
    return Solution(
        e_enu_m=np.where(broken[..., None], np.nan, found.e_enu_m),
        clock_m=np.where(broken[..., None], np.nan, found.clock_m),
        cov_enu_m2=np.where(broken[..., None, None], np.nan, found.cov_enu_m2),
        n_used=found.n_used,
        why=np.where(broken & found.solved, Unsolved.POOR_GEOMETRY, found.why),
    )


def postfit_m(residual_m: Floats, los_enu: Floats, solution: Solution, system_of: Ints) -> Floats:
    """Residuals (E, R, S) after the solution, m, of every satellite seen whose constellation has a clock, used or not."""
    moved_m = (los_enu * np.moveaxis(solution.e_enu_m, -1, 0)[..., None]).sum(axis=0)
    result: Floats = residual_m + moved_m - solution.clock_m[..., system_of]
    return result


def positions(
    block: ObservationBlock,
    states: SatelliteStates,
    points: Points,
    klobuchar: Klobuchar | None,
    first: Prefit,
    sigma_m: Floats,
    used: Bools,
    system_of: Ints,
    n_systems: int,
) -> Solution:
    """The solution on the given prefit; epochs in which a receiver is over 1 km away are linearised again where it is.

    Displacements and covariances stay in the axes of `points`; residuals of such epochs are not those of `first`.
    """
    of = design(first.los_enu, sigma_m, used & np.isfinite(first.residual_m), system_of, n_systems)
    return relinearised(solution(of, first.residual_m), of, block, states, points, klobuchar)


def relinearised(
    found: Solution, of: Design, block: ObservationBlock, states: SatelliteStates, points: Points, klobuchar: Klobuchar | None
) -> Solution:
    """The solution `found` by a design; epochs in which a receiver is over 1 km away are linearised again where it is. See `positions`."""
    is_far: Bools = np.any(np.abs(found.e_enu_m) > RELINEARISE_BEYOND_M, axis=(1, 2))
    if not is_far.any():
        return found
    far = np.flatnonzero(is_far)
    block_far, states_far = _epochs_of_block(block, far), _epochs_of_states(states, far)
    sigma_far, used_far = np.broadcast_to(of.sigma_m, of.used.shape)[far], of.used[far]
    refined, e = found, np.array(found.e_enu_m[far])
    pos = points.pos_ecef_m + _turn(np.swapaxes(points.enu, -1, -2), np.where(np.isfinite(e), e, 0.0))
    for _ in range(RELINEARISATIONS):
        there = points_at(pos)
        again = prefit(block_far, states_far, there, klobuchar)
        refined = solve(again.residual_m, again.los_enu, sigma_far, used_far, of.system_of, of.member.shape[1])
        step = refined.e_enu_m
        pos = pos + _turn(np.swapaxes(there.enu, -1, -2), np.where(np.isfinite(step), step, 0.0))
    converged: Bools = np.all(np.abs(refined.e_enu_m) < 0.01, axis=-1)
    e = _turn(points.enu, pos - points.pos_ecef_m)
    turn = np.einsum("...ij,...kj->...ik", points.enu, there.enu)
    cov = np.einsum("...ij,...jk,...lk->...il", turn, refined.cov_enu_m2, turn)
    return _replaced(found, far, replace(refined, e_enu_m=e, cov_enu_m2=cov), converged)


def _turn(axes: Floats, vectors: Floats) -> Floats:
    """Vectors (..., 3) in other axes (..., 3, 3)."""
    turned: Floats = np.einsum("...ij,...j->...i", axes, vectors)
    return turned


def _replaced(solution: Solution, far: Ints, refined: Solution, converged: Bools) -> Solution:
    """`solution` with the epochs `far` taken from `refined`; NaN and DIVERGED where it did not converge."""
    values = {name: np.array(getattr(solution, name)) for name in Solution.__dataclass_fields__}
    for name, array in values.items():
        array[far] = getattr(refined, name)
    values["e_enu_m"][far] = np.where(converged[..., None], refined.e_enu_m, np.nan)
    values["why"][far] = np.where(refined.solved & ~converged, Unsolved.DIVERGED, refined.why)
    return Solution(**values)


def _epochs_of_block(block: ObservationBlock, epochs: Ints) -> ObservationBlock:
    per_epoch = {n: getattr(block, n)[epochs] for n in block.__dataclass_fields__ if n not in ("receivers", "signals", "satellites")}
    return ObservationBlock(block.receivers, block.signals, block.satellites, **per_epoch)


def _epochs_of_states(states: SatelliteStates, epochs: Ints) -> SatelliteStates:
    return SatelliteStates(
        states.t_ns[epochs],
        states.pos_ecef_m[:, epochs],
        states.vel_ecef_mps[:, epochs],
        states.acc_ecef_mps2[:, epochs],
        states.clock_s[epochs],
        states.clock_drift_sps[epochs],
    )


def _per_system(v: Floats, member: Floats) -> Floats:
    """Sums of (..., S) over the satellites of each constellation, (..., K)."""
    sums: Floats = np.einsum("...s,sk->...k", v, member)
    return sums


def _products(a: Floats, b: Floats) -> Floats:
    """Sums over the last axis of a_i b_j, (3, 3, E, R), for a, b (3, E, R, n)."""
    sums: Floats = np.einsum("iern,jern->ijer", a, b)
    return sums


def _inverse(N: Floats) -> tuple[Floats, Floats]:
    """Inverse (3, 3, ...) and determinant (...) of symmetric matrices by cofactors; NaN where the determinant is not positive."""
    N = N.reshape(9, *N.shape[2:])
    C = N[COFACTOR_A] * N[COFACTOR_B] - N[COFACTOR_C] * N[COFACTOR_D]
    determinant = (N[:3] * C[:3]).sum(axis=0)
    positive = determinant > 0.0
    return (C / np.where(positive, determinant, np.nan))[SQUARE], determinant
