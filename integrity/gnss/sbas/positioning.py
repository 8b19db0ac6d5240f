"""Positions of a block corrected by SBAS, each with protection levels of exactly the satellites that it is made of.

`corrected` applies what SBAS says to what was measured: the fast correction is added to the pseudorange, the ionosphere's delay subtracted;
long-term corrections are added to the satellite's position and clock, by the ephemeris that they name. The troposphere is that of DO-229.
`positions` solves, each range weighted by 1 / sigma^2 of the sum that the levels are made of.
Source: RTCA DO-229D, A.4.2.4 (troposphere), A.4.4.3 (fast), A.4.4.7 (long-term), A.4.4.10 (ionosphere), J.1 (weights).
"""

from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from integrity.gnss.ephemeris.states import SatelliteStates, satellite_states
from integrity.gnss.ephemeris.store import EphemerisStore
from integrity.gnss.least_squares import Solution, solve
from integrity.gnss.observations import Bools, Floats, Ints, ObservationBlock
from integrity.gnss.positioning import Points, Prefit, compared, expected, state_time_ns
from integrity.gnss.sbas.corrections import Corrections, Reason
from integrity.gnss.sbas.protection import Protection, protection
from integrity.gnss.sbas.troposphere import zenith_delay_m
from integrity.gnss.signals import TIME_SCALES, time_scale_index

CORRECTED_CODE = "1C"  # L1 C/A: the clocks that SBAS corrects are those of the ephemeris with the group delay of this signal
# How far from its point a position may be and have levels: 100 m of height change the troposphere by 3 cm in the zenith, a quarter of its
# sigma, and the second order of the range is 0.3 mm.
NEAR_M = 100.0
NOWHERE = -1


class Corrected(NamedTuple):
    """A block after SBAS: `prefit` with corrected residuals, `sigma_m` (E, 1, S) of what is left in them, `used` (E, R, S): measured, and
    accepted by SBAS; `place` (S,) of each signal among the satellites of the corrections, -1 for signals that are not corrected."""

    prefit: Prefit
    sigma_m: Floats
    used: Bools
    place: Ints


class Positions(NamedTuple):
    """`solution` by the satellites `corrected.used`; `levels` of each receiver, over the epochs (`along_track_m` takes them)."""

    corrected: Corrected
    solution: Solution
    levels: tuple[Protection, ...]


def positions(block: ObservationBlock, ephemerides: EphemerisStore, points: Points, c: Corrections, mode: int) -> Positions:
    """Positions and levels of a block; arguments as for `corrected`, `mode` that of the corrections, PA or NPA.

    A level is NaN where there is no position, and where that is over 100 m from its point (in east, north or up): both, corrections and
    points, are then to be had where it is.
    """
    of = corrected(block, ephemerides, points, c)
    system_of = np.array([time_scale_index(s) for s in block.satellites], dtype=np.int64)
    found = solve(of.prefit.residual_m, of.prefit.los_enu, of.sigma_m, of.used, system_of, len(TIME_SCALES))
    near = np.all(np.abs(found.e_enu_m) <= NEAR_M, axis=-1)
    in_position = of.used & near[..., None]
    levels = tuple(protection(_only(c, in_position[:, r], of.place), mode) for r in range(len(block.receivers)))
    return Positions(of, found, levels)


def corrected(block: ObservationBlock, ephemerides: EphemerisStore, points: Points, c: Corrections) -> Corrected:
    """What receivers near the point of the corrections measured, less what is expected there with all that SBAS says.

    `ephemerides`: the store that the corrections were made with; their epochs are those of the block, else ValueError. Receivers may be
    some kilometres from that one point: a kilometre changes a range by 2 mm and a level by 0.02 %.
    """
    if not np.array_equal(c.t_ns, block.epoch_ns):
        raise ValueError(
            f"corrections at {len(c.t_ns)} epochs, a block of {len(block.epoch_ns)}: expected the same epochs; correct for those"
        )
    place_of = {f"{satellite}.{CORRECTED_CODE}": k for k, satellite in enumerate(c.satellites)}
    place = np.array([place_of.get(signal, NOWHERE) for signal in block.signals], dtype=np.int64)
    states = _states(block, ephemerides, place, c)
    seen = compared(block, expected(states, block.epoch_ns, _in_air(points, block.epoch_ns), None))
    residual_m = seen.residual_m + _placed(c.range_m - c.iono_m, place, np.nan)[:, None]
    used = _placed(c.used, place, False)[:, None] & np.isfinite(residual_m)
    return Corrected(replace(seen, residual_m=residual_m), _placed(c.sigma_m, place, np.nan)[:, None], used, place)


def _states(block: ObservationBlock, ephemerides: EphemerisStore, place: Ints, c: Corrections) -> SatelliteStates:
    """Corrected positions and clocks, at `state_time_ns`; their rates over the milliseconds from there to transmission are left out."""
    index = _placed(c.index, place, NOWHERE)
    states = satellite_states(ephemerides.ephemerides, index, state_time_ns(block.epoch_ns), block.signals)
    pos_ecef_m = states.pos_ecef_m + _placed(c.d_pos_ecef_m, place, np.nan)
    return replace(states, pos_ecef_m=pos_ecef_m, clock_s=states.clock_s + _placed(c.d_clock_s, place, np.nan))


def _in_air(points: Points, epoch_ns: Ints) -> Points:
    """The points of every epoch, under the troposphere of DO-229: its mapping is the one that `expected` uses."""
    of_epochs = Points(*(np.broadcast_to(array, (len(epoch_ns), *array.shape[1:])) for array in points))
    return of_epochs._replace(zenith_delay_m=zenith_delay_m(epoch_ns[:, None], of_epochs.lat_rad, of_epochs.height_m))


def _placed(values: NDArray[Any], place: Ints, otherwise: float) -> NDArray[Any]:
    """Of satellites (..., N) to signals (..., S)."""
    known = place >= 0
    out = np.full((*values.shape[:-1], len(place)), otherwise, dtype=values.dtype)
    out[..., known] = values[..., place[known]]
    return out


def _only(c: Corrections, used: Bools, place: Ints) -> Corrections:
    """The corrections with those satellites alone whose signals (E, S) are used; why not others is not said."""
    known = place >= 0
    of_satellites = np.zeros(c.why.shape, dtype=np.bool_)
    of_satellites[:, place[known]] = used[:, known]
    return replace(c, why=np.where(of_satellites, Reason.USED, Reason.NO_ORBIT))
