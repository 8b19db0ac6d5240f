"""Which ephemerides the long-term corrections name, and where the corrected satellites stand.

Source: RTCA DO-229D, A.4.4.7 (long-term corrections), A.4.4.16 (covariance).
"""

from collections.abc import Sequence
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from integrity.gnss.constants import EARTH_ROTATION_RADPS, SPEED_OF_LIGHT_MPS
from integrity.gnss.ephemeris.states import satellite_states
from integrity.gnss.ephemeris.store import EphemerisStore
from integrity.gnss.gps_time import NS_PER_S
from integrity.gnss.observations import Bools, Floats, Ints
from integrity.gnss.sbas.degradation import older
from integrity.gnss.sbas.store import Rows

_FLIGHTS = 2  # iterations of the time of flight: 1 mm
_NOMINAL_FLIGHT_S = 0.075
_SHORTER_THAN_SETS_NS = 1800 * NS_PER_S  # every ephemeris serves for longer: between two times nothing begins and ends


class LongTerm(NamedTuple):
    """The corrections in use, (E, S) and (E, S, 3)."""

    sent_ns: Ints
    velocity_code: Ints
    t0_ns: Ints
    d_pos: Floats
    d_vel: Floats
    daf0: Floats
    daf1: Floats


class Orbits(NamedTuple):
    """`number` (E, S), index into the ephemerides, -1 for none: of the set that long-term corrections name where they are `corrected`, else
    of any that serves. `in_time`: there are long-term corrections in time, whether or not their ephemeris is here."""

    number: Ints
    in_time: Bools
    corrected: Bools
    long_term: LongTerm


class Sight(NamedTuple):
    """Direction to the satellite: azimuth and elevation, rad; unit vectors (3, E, S); corrections of position and clock."""

    az_rad: Floats
    el_rad: Floats
    u_enu: Floats
    u_ecef: Floats
    d_pos_ecef_m: Floats
    d_clock_s: Floats


def orbits_of(ephemerides: EphemerisStore, satellites: Sequence[str], rows: Rows, t: Ints, timeout_s: int) -> Orbits:
    """Of two corrections the newer counts, or else the older where only its ephemeris is here. t (E, 1)."""
    fresh = ~older(t[:, :, None], rows["lt_ns"], timeout_s)  # (E, S, 2)
    issue = np.where(fresh, rows["iod"], -1)
    index = np.full((*rows.shape, 2), -1, dtype=np.int64)
    for s, which in zip(*(place.tolist() for place in np.nonzero((issue >= 0).any(axis=0))), strict=True):
        index[:, s, which] = _of_issue(ephemerides, satellites[s], issue[:, s, which], t[:, 0])
    newer = index[:, :, 0] >= 0
    chosen = np.where(newer, index[:, :, 0], np.where(fresh[:, :, 0], index[:, :, 1], -1))
    corrected = chosen >= 0
    otherwise = ephemerides.choose(satellites, t[:, 0], np.full(len(t), len(ephemerides.ephemerides), dtype=np.int64))
    use = np.where(newer, 0, 1)[:, :, None]
    names = ("lt_ns", "velocity_code", "t0_ns", "d_pos", "d_vel", "daf0", "daf1")
    long_term = LongTerm(*(_taken(rows[name], use) for name in names))
    return Orbits(np.where(corrected, chosen, otherwise), fresh[:, :, 0], corrected, long_term)


def _taken(pairs: Rows, use: Ints) -> Any:
    """One of two, (E, S, 2, ...) to (E, S, ...)."""
    place = use if pairs.ndim == 3 else use[..., None]
    return np.take_along_axis(pairs, place, axis=2)[:, :, 0]


def _of_issue(ephemerides: EphemerisStore, satellite: str, issue: Ints, t_ns: Ints) -> Ints:
    """Index (E,) of the sets with these issues, -1 for none; asked once where a run begins and ends with the same answer."""
    index = np.full(len(issue), -1, dtype=np.int64)
    edges = [0, *(np.nonzero(issue[1:] != issue[:-1])[0] + 1).tolist(), len(issue)]
    for begin, end in pairwise(edges):
        wanted = int(issue[begin])
        if wanted >= 0:
            first = ephemerides.of_issue(satellite, wanted, int(t_ns[begin]))
            short = t_ns[end - 1] - t_ns[begin] <= _SHORTER_THAN_SETS_NS
            same = end - begin == 1 or (short and ephemerides.of_issue(satellite, wanted, int(t_ns[end - 1])) == first)
            index[begin:end] = first if same else [ephemerides.of_issue(satellite, wanted, time) for time in t_ns[begin:end].tolist()]
    return index


def sight(ephemerides: EphemerisStore, orbits: Orbits, rows: Rows, t: Ints, pos_ecef_m: Floats, axes: Floats) -> Sight:
    """From a point (3,) with local axes (3, 3), at reception times t (E, 1). Not corrected where there are no long-term corrections."""
    states = satellite_states(ephemerides.ephemerides, orbits.number, t[:, 0])
    pos, vel, acc = states.pos_ecef_m, states.vel_ecef_mps, states.acc_ecef_mps2
    flight_s = np.full(orbits.number.shape, _NOMINAL_FLIGHT_S)
    for _ in range(_FLIGHTS):
        sent = pos - vel * flight_s + 0.5 * acc * flight_s * flight_s
        angle = EARTH_ROTATION_RADPS * flight_s
        x, y = sent[0] + sent[1] * angle, sent[1] - sent[0] * angle  # small angle: 0.4 mm
        d = np.stack((x - pos_ecef_m[0], y - pos_ecef_m[1], sent[2] - pos_ecef_m[2]))
        flight_s = np.sqrt((d * d).sum(axis=0)) / SPEED_OF_LIGHT_MPS
    d_pos, d_clock_s = _long_term_at(orbits, t)
    d = d + d_pos
    u_ecef = d / np.sqrt((d * d).sum(axis=0))
    u_enu = np.einsum("ij,jes->ies", axes, u_ecef)
    return Sight(np.arctan2(u_enu[0], u_enu[1]), np.arcsin(np.clip(u_enu[2], -1.0, 1.0)), u_enu, u_ecef, d_pos, d_clock_s)


def _long_term_at(orbits: Orbits, t: Ints) -> tuple[Floats, Floats]:
    """Corrections of position (3, E, S), m, and clock (E, S), s, at transmission, by their rates where they have any."""
    ltc = orbits.long_term
    sent_s = (t - ltc.t0_ns) / NS_PER_S - _NOMINAL_FLIGHT_S  # of the signal; nominal: 1 mm
    since = np.where(orbits.corrected & (ltc.velocity_code == 1), sent_s, 0.0)
    d_pos = np.moveaxis(ltc.d_pos + ltc.d_vel * since[:, :, None], 2, 0)
    return np.where(orbits.corrected, d_pos, 0.0), np.where(orbits.corrected, ltc.daf0 + ltc.daf1 * since, 0.0)


def covariance_delta_udre(R: Floats, u_ecef: Floats) -> Floats:
    """sqrt(I' C I) with C = R' R (upper triangle row by row, (E, S, 10)) and I the direction to the satellite and 1. A.4.4.16."""
    x, y, z = u_ecef
    first = R[..., 0] * x + R[..., 1] * y + R[..., 2] * z + R[..., 3]
    second = R[..., 4] * y + R[..., 5] * z + R[..., 6]
    third = R[..., 7] * z + R[..., 8]
    result: Floats = np.sqrt(first * first + second * second + third * third + R[..., 9] ** 2)
    return result
