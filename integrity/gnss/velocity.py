"""Velocity and clock drift from Doppler, for all receivers and epochs of a block at once.

A receiver counts the beat of the carrier that arrives against its own oscillator: the Doppler is (X - 1) times the carrier frequency, X
the rate of the satellite's clock against the receiver's, as it is received,

    X = (1 + drift of the satellite's clock) (1 - (r' - u v) / (c + r')) / (1 + drift of the receiver's clock),

with r' the rate of the range for a receiver at rest, by the time of transmission, u the unit vector towards the satellite, v the
receiver's velocity. Solved for what is unknown of the receiver that is linear, y = drift - u v, the form that ranges have, and the same
least squares serve. Source: follows from the definition of the pseudorange. The usual form (Misra, Enge, Global Positioning System, 2nd
edition, 6.2.1) has no 1 / (1 + r' / c), which makes r'^2 / c: up to 2 mm/s.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from integrity.gnss.constants import SPEED_OF_LIGHT_MPS
from integrity.gnss.gps_time import NS_PER_S
from integrity.gnss.least_squares import Design, design, postfit_m, solution
from integrity.gnss.observations import Bools, Floats, Ints, ObservationBlock, freeze
from integrity.gnss.positioning import Expected
from integrity.gnss.signals import bands_of, carrier_hz


@dataclass(frozen=True, eq=False)
class Velocities:
    """`v_enu_mps` (E, R, 3) in the axes of the points, `drift_mps` (E, R): how fast the receiver's clock gains; NaN where unsolved.

    `cov_enu_m2ps2` (E, R, 3, 3) is the covariance of the velocity when the sigmas are right; `residual_mps` (E, R, S) what is left of the
    rates, also of satellites not used; `why` (E, R) holds `Unsolved`.
    """

    v_enu_mps: Floats
    drift_mps: Floats
    cov_enu_m2ps2: Floats
    residual_mps: Floats
    n_used: Ints
    why: Ints

    def __post_init__(self) -> None:
        freeze(self)


def wavelengths_m(signals: Sequence[str], channel: Ints) -> Floats:
    """Carrier wavelengths (E, S), m; `channel` (E, S): GLONASS frequency numbers (`Ephemerides.channel`); NaN where none is known."""
    carriers = np.array([carrier_hz(signal[:1], bands_of(signal)[0]) or (np.nan, np.nan) for signal in signals]).reshape(-1, 2)
    result: Floats = SPEED_OF_LIGHT_MPS / (carriers[:, 0] + carriers[:, 1] * channel)
    return result


def rates_mps(block: ObservationBlock, sight: Expected, wavelength_m: Floats) -> Floats:
    """What Doppler says beyond the expected rate, (E, R, S), m/s: the drift of the receiver's clock less its speed towards the satellite.

    wavelength_m (E, S). NaN where Doppler or range was not measured. The points must be within 5 m of the receivers for 1 mm/s (the
    satellite moves 4 km/s across a line of sight that turns by 50 nrad per metre). The change of the ionosphere's delay, below 1 mm/s, is
    taken as that of the code; that of the carrier has the other sign.
    """
    t_rx_s = ((block.receive_time_ns - sight.t_ns[:, None]) / NS_PER_S)[:, :, None]
    with np.errstate(invalid="ignore"):  # a range that is infinite
        dt = t_rx_s - block.pseudorange_m / SPEED_OF_LIGHT_MPS - sight.clock_s
        at_rest_mps = sight.rate_mps + 2.0 * dt * sight.half_acc_mps2
        measured_mps = -block.doppler_hz * wavelength_m[:, None]
        beyond_mps = measured_mps - at_rest_mps / (1.0 + at_rest_mps / SPEED_OF_LIGHT_MPS)
        result: Floats = beyond_mps / (1.0 - measured_mps / SPEED_OF_LIGHT_MPS)
    return result


def velocity_design(los_enu: Floats, sigma_mps: Floats, used: Bools) -> Design:
    """The design of a velocity: like that of a position, with one clock for all constellations, whose own clocks drift alike to 1e-13.

    los_enu (3, E, R, S); sigma_mps, used broadcast to (E, R, S). Four satellites do.
    """
    return design(los_enu, sigma_mps, used, np.zeros(los_enu.shape[-1], dtype=np.int64), 1)


def velocities(rate_mps: Floats, los_enu: Floats, sigma_mps: Floats, used: Bools) -> Velocities:
    """Velocities from `rates_mps` (E, R, S), weighted by `sigma_mps`; `los_enu` (3, E, R, S), the rest broadcast to (E, R, S)."""
    of = velocity_design(los_enu, sigma_mps, used & np.isfinite(rate_mps))
    found = solution(of, rate_mps)
    residual_mps = postfit_m(rate_mps, los_enu, found, of.system_of)
    return Velocities(found.e_enu_m, found.clock_m[..., 0], found.cov_enu_m2, residual_mps, found.n_used, found.why)
