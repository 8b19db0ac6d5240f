"""Positions of all receivers and epochs of a block at once, linearised at known points.

The path: `expected` says what given points would see, `compared` what was measured beyond that (`prefit` does both);
`least_squares.solve` turns such residuals into displacements, in the local axes of each receiver, with a clock per constellation;
`positions` does all of it and linearises again where a receiver is far away.
"""

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from integrity.gnss.angles import sine_cosine
from integrity.gnss.atmosphere import (
    GalileoIonosphere,
    Ionosphere,
    Klobuchar,
    klobuchar_slope,
    klobuchar_towards_m,
    saastamoinen_zenith_m,
    troposphere_towards,
)
from integrity.gnss.constants import EARTH_ROTATION_RADPS, SPEED_OF_LIGHT_MPS
from integrity.gnss.ephemeris.states import SatelliteStates
from integrity.gnss.frames import enu_axes, geodetic_from_ecef
from integrity.gnss.gps_time import NS_PER_S, WEEK_NS
from integrity.gnss.least_squares import Design, Solution, Unsolved, design, solution, solve
from integrity.gnss.observations import Bools, Floats, Ints, ObservationBlock, freeze, slices

TRAVEL_TIME_NS = 77_500_000  # midway between zenith and horizon, GPS and Galileo: states are evaluated this long before the epoch
RELINEARISE_BEYOND_M = 1_000.0  # second order of the range: 2.5 cm at 1 km, 2.5 m at 10 km
RELINEARISATIONS = 6  # from anywhere on Earth to below 1 mm
LOWEST_MODELLED_RAD = float(np.deg2rad(3.0))  # below, neither atmosphere model holds; such satellites are screened out
LOWEST_MODELLED_SINE, LOWEST_MODELLED_COSINE = float(np.sin(LOWEST_MODELLED_RAD)), float(np.cos(LOWEST_MODELLED_RAD))
URA_NOMINAL_M = 2.4  # URA index 0: the accuracy for which the site's range sigmas hold


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
    unit vectors from receiver to satellite; `el_rad`, `az_rad` (E, R, S); `ionosphere_m`, broadcast to (E, R, S), the ionosphere's part of
    the range."""

    t_ns: Ints
    clock_s: Floats
    range_m: Floats
    rate_mps: Floats
    half_acc_mps2: Floats
    los_enu: Floats
    el_rad: Floats
    az_rad: Floats
    ionosphere_m: Floats


NO_IONOSPHERE = np.zeros((1, 1, 1))
NO_IONOSPHERE.setflags(write=False)


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


def points_at(pos_ecef_m: Floats) -> Points:
    """Points (..., R, 3) with their geodetic coordinates and axes; a single set (R, 3) serves all epochs."""
    pos = pos_ecef_m if pos_ecef_m.ndim == 3 else pos_ecef_m[None]
    lat, lon, height = geodetic_from_ecef(pos)
    return Points(pos, lat, lon, height, saastamoinen_zenith_m(lat, height), enu_axes(lat, lon))


def state_time_ns(epoch_ns: Ints) -> Ints:
    """The time at which to evaluate satellite states for epochs: near every transmission time, and the same for all receivers."""
    return epoch_ns - TRAVEL_TIME_NS


def prefit(block: ObservationBlock, states: SatelliteStates, points: Points, ionosphere: Ionosphere | None) -> Prefit:
    """Residuals of a block at the points; `states` at `state_time_ns` of the block's epochs."""
    return compared(block, expected(states, block.epoch_ns, points, ionosphere))


def compared(block: ObservationBlock, sight: Expected) -> Prefit:
    """What was measured, less what was expected at each receiver's own time of transmission."""
    t_rx_s = ((block.receive_time_ns - sight.t_ns[:, None]) / NS_PER_S)[:, :, None]
    rho = block.pseudorange_m
    with np.errstate(invalid="ignore"):  # a range that is infinite
        dt = t_rx_s - rho / SPEED_OF_LIGHT_MPS - sight.clock_s
        residual_m = rho - sight.range_m - dt * (sight.rate_mps + dt * sight.half_acc_mps2)
    return Prefit(residual_m, sight.los_enu, sight.el_rad, sight.az_rad)


def expected(states: SatelliteStates, epoch_ns: Ints, points: Points, ionosphere: Ionosphere | None) -> Expected:
    """Pseudoranges at the points but for the receivers' clocks, as they change around the time of the states (`state_time_ns`).

    To the second order in the time from there to transmission, 12 ms at most for a receiver whose time tag is the epoch's (60 ms of
    geosynchronous satellites): within 0.1 mm for one whose tag is up to 0.5 s off. Without its terms the ionosphere is left out.
    """
    tow_s = (epoch_ns % WEEK_NS / NS_PER_S)[:, None, None]
    alone = (states.clock_s, states.clock_drift_sps, states.ionosphere)
    satellites = np.concatenate((states.pos_ecef_m, states.vel_ecef_mps, states.acc_ecef_mps2, np.stack(alone)))[:, :, None, :]
    n_epochs, n_signals = states.clock_s.shape
    n_receivers = points.pos_ecef_m.shape[1]
    out = np.empty((8 if ionosphere is None else 9, n_epochs, n_receivers, n_signals))
    for few in slices(n_epochs, n_receivers * n_signals):
        there = points if len(points.pos_ecef_m) == 1 else Points(*(p[few] for p in points))
        out[:, few] = _geometry(states.t_ns[few], tow_s[few], satellites[:, few], there, ionosphere)
    return Expected(
        states.t_ns,
        states.clock_s[:, None, :],
        out[0],
        out[1],
        out[2],
        out[3:6],
        out[6],
        out[7],
        *(out[8:] if len(out) > 8 else NO_IONOSPHERE[None]),
    )


def _geometry(t_ns: Ints, tow_s: Floats, satellites: Floats, points: Points, ionosphere: Ionosphere | None) -> list[Floats]:
    """Range with its rate and half its acceleration, line of sight (east, north, up), elevation, azimuth, and with a model of it the
    ionosphere's part of the range; each (E, R, S)."""
    x, y, z, vx, vy, vz, ax, ay, az, clock_s, clock_drift_sps, dispersion = satellites
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
    level = np.sqrt(east * east + north * north)
    el_rad = np.arctan2(up, level)
    az_rad = np.arctan2(east, north)
    level_or_so = np.maximum(level, 1e-6)
    el_rate_radps = (up_mps - up * distance_mps) / (distance_m * level_or_so)

    low = up < LOWEST_MODELLED_SINE
    mapping, slope = troposphere_towards(np.where(low, LOWEST_MODELLED_SINE, up), np.where(low, LOWEST_MODELLED_COSINE, level))
    delay_m = points.zenith_delay_m[..., None] * mapping
    delay_mprad = delay_m * slope
    parts = []
    if ionosphere is not None:
        el_air = np.maximum(el_rad, LOWEST_MODELLED_RAD)
        if isinstance(ionosphere, Klobuchar):
            lat_rad, lon_rad = points.lat_rad[..., None], points.lon_rad[..., None]
            l1_m = klobuchar_towards_m(tow_s, lat_rad, lon_rad, east / level_or_so, north / level_or_so, el_air, ionosphere)
        else:
            l1_m = _nequick_m(t_ns, x, y, z, points, ionosphere)
        ionosphere_m = dispersion * l1_m
        parts = [ionosphere_m]
        delay_m = delay_m + ionosphere_m
        delay_mprad = delay_mprad + ionosphere_m * klobuchar_slope(el_air)
    range_m = distance_m + sagnac * (x * y_r - y * x_r) - SPEED_OF_LIGHT_MPS * clock_s + delay_m
    rate_mps = distance_mps + sagnac * (vx * y_r - vy * x_r) - SPEED_OF_LIGHT_MPS * clock_drift_sps + delay_mprad * el_rate_radps
    return [range_m, rate_mps, half_acc_mps2, east, north, up, el_rad, az_rad, *parts]


def _nequick_m(t_ns: Ints, x: Floats, y: Floats, z: Floats, points: Points, ionosphere: GalileoIonosphere) -> Floats:
    """Delay on L1 (E, R, S) by NeQuick-G, 40 us a ray; 0 below the horizon, which it does not model.

    Its figures are loaded when first used. Coordinates of satellites are off by 7e-5 deg at their height: nothing of the delay.
    """
    from integrity.gnss.nequick.integration import Geodetic
    from integrity.gnss.nequick.model import month_and_ut, nequick_delay_m

    month, ut_s = month_and_ut(t_ns[:, None, None])
    receiver = Geodetic(*(part[..., None] for part in (points.lat_rad, points.lon_rad, points.height_m)))
    satellite = Geodetic(*geodetic_from_ecef(np.stack((x, y, z), axis=-1)))
    delay_m = nequick_delay_m(month, ut_s, receiver, satellite, ionosphere)
    result: Floats = np.where(np.isfinite(delay_m), delay_m, 0.0)
    return result


def range_accuracy_m(states: SatelliteStates, accuracy_m: Floats) -> Floats:
    """The accuracy (E, S) that ranges of a block's signals are weighted by, m: URA or SISA, larger as the ionosphere delays the signal more
    than L1 (B3I 1.54 times): most of a range's error is what the model leaves of that delay."""
    accuracy: Floats = accuracy_m * np.maximum(states.ionosphere, 1.0)
    return accuracy


def range_sigma_m(el_rad: Floats, a_m: float, b_m: float, accuracy_m: Floats | float = URA_NOMINAL_M) -> Floats:
    """Standard deviation of a range, m: (URA / 2.4 m) sqrt(a^2 + (b / sin el)^2); shape of el_rad.

    Elevations below 3 deg count as 3 deg, an accuracy better than 2.4 m as 2.4 m: a satellite cannot make itself infinitely good.
    """
    sin_el, _ = sine_cosine(np.maximum(el_rad, LOWEST_MODELLED_RAD))
    scale = np.maximum(accuracy_m, URA_NOMINAL_M) / URA_NOMINAL_M
    sigma_m: Floats = scale * np.sqrt(a_m**2 + (b_m / sin_el) ** 2)
    return sigma_m


def positions(
    block: ObservationBlock,
    states: SatelliteStates,
    points: Points,
    ionosphere: Ionosphere | None,
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
    return relinearised(solution(of, first.residual_m), of, block, states, points, ionosphere)


def relinearised(
    found: Solution, of: Design, block: ObservationBlock, states: SatelliteStates, points: Points, ionosphere: Ionosphere | None
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
        again = prefit(block_far, states_far, there, ionosphere)
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
        states.ionosphere[epochs],
    )
