"""Orbits of state vectors: GLONASS, whose equations of motion are integrated, and SBAS, which sends a parabola.

Sources: GLONASS ICD 5.1, appendix A.3.1.2; RTCA DO-229, A.4.4.11.
"""

from collections.abc import Callable, Sequence
from functools import lru_cache
from math import ceil, sqrt
from typing import TypeVar

import numpy as np

from integrity.gnss.constants import GLONASS_EARTH_RADIUS_M, GLONASS_EARTH_ROTATION_RADPS, GLONASS_J02, GLONASS_MU_M3PS2
from integrity.gnss.ephemeris.broadcast import GeoEphemeris, GlonassEphemeris
from integrity.gnss.gps_time import NS_PER_S
from integrity.gnss.observations import Floats, Ints

STEP_S = 60.0  # of fourth-order Runge-Kutta: errors of position below 1 mm over twenty minutes, jumps from node to node below 0.05 mm

Number = TypeVar("Number", float, Floats)
State = tuple[Number, Number, Number, Number, Number, Number]  # position and velocity
Force = tuple[Number, Number, Number]  # luni-solar acceleration, held


def glonass_states(sets: Sequence[GlonassEphemeris], which: Ints, t_ns: Ints) -> Floats:
    """Position, velocity, acceleration, clock, its drift (11, n) of the sets `which` (n,) at GPS times (n,), within their fit interval.

    From the nearest of nodes a minute apart, so that the result depends on the set and the time alone.
    """
    toe_ns = np.array([eph.toe_ns for eph in sets], dtype=np.int64)[which]
    t_s = (t_ns - toe_ns) / NS_PER_S
    reach = ceil(max((eph.fit_half_s for eph in sets), default=0.0) / STEP_S)
    node = np.clip(np.rint(t_s / STEP_S), -reach, reach).astype(np.int64)
    places, place = np.unique(which * (2 * reach + 1) + node + reach, return_inverse=True)
    nodes = np.array([_node(sets[p // (2 * reach + 1)], p % (2 * reach + 1) - reach) for p in places.tolist()]).reshape(-1, 6)
    force = np.array([_force(eph) for eph in sets])[which].T
    state = _stepped(tuple(nodes[place].T), tuple(force), t_s - node * STEP_S, np.sqrt)
    tau, gamma = (np.array([getattr(eph, name) for eph in sets])[which] for name in ("tau_n_s", "gamma_n"))
    return np.array([*state, *_motion(state, tuple(force), np.sqrt)[3:], -tau + gamma * t_s, gamma])


def _force(eph: GlonassEphemeris) -> Force[float]:
    return eph.ax_mps2, eph.ay_mps2, eph.az_mps2


@lru_cache(maxsize=4096)
def _node(eph: GlonassEphemeris, minutes: int) -> State[float]:
    """The state so many whole minutes after toe."""
    if minutes == 0:
        return eph.x_m, eph.y_m, eph.z_m, eph.vx_mps, eph.vy_mps, eph.vz_mps
    step = 1 if minutes > 0 else -1
    return _stepped(_node(eph, minutes - step), _force(eph), step * STEP_S, sqrt)


def _stepped(state: State[Number], force: Force[Number], h_s: Number, root: Callable[[Number], Number]) -> State[Number]:
    """The state after one Runge-Kutta step of `h_s`; `root` is the square root of such numbers."""
    half_s = 0.5 * h_s
    k1 = _motion(state, force, root)
    k2 = _motion(_moved(state, half_s, k1), force, root)
    k3 = _motion(_moved(state, half_s, k2), force, root)
    k4 = _motion(_moved(state, h_s, k3), force, root)
    a, b, c, d, e, f = (p + 2.0 * q + 2.0 * r + s for p, q, r, s in zip(k1, k2, k3, k4, strict=True))
    return _moved(state, h_s / 6.0, (a, b, c, d, e, f))


def _moved(state: State[Number], h_s: Number, rate: State[Number]) -> State[Number]:
    x, y, z, vx, vy, vz = state
    dx, dy, dz, dvx, dvy, dvz = rate
    return x + h_s * dx, y + h_s * dy, z + h_s * dz, vx + h_s * dvx, vy + h_s * dvy, vz + h_s * dvz


def _motion(state: State[Number], force: Force[Number], root: Callable[[Number], Number]) -> State[Number]:
    """Derivative of a state in the rotating frame: ICD 5.1, A.3.1.2."""
    x, y, z, vx, vy, vz = state
    omega = GLONASS_EARTH_ROTATION_RADPS
    r2 = x * x + y * y + z * z
    gravity = GLONASS_MU_M3PS2 / (r2 * root(r2))
    flattening = 1.5 * GLONASS_J02 * GLONASS_EARTH_RADIUS_M**2 * gravity / r2
    polar = 5.0 * z * z / r2
    level = omega * omega - gravity - flattening * (1.0 - polar)
    ax = level * x + 2.0 * omega * vy + force[0]
    ay = level * y - 2.0 * omega * vx + force[1]
    az = (-gravity - flattening * (3.0 - polar)) * z + force[2]
    return vx, vy, vz, ax, ay, az


def geo_states(sets: Sequence[GeoEphemeris], which: Ints, t_ns: Ints) -> Floats:
    """Position, velocity, acceleration, clock, its drift (11, n) of the sets `which` (n,) at GPS times (n,)."""
    names = ("x_m", "y_m", "z_m", "vx_mps", "vy_mps", "vz_mps", "ax_mps2", "ay_mps2", "az_mps2", "af0", "af1")
    value = np.array([[getattr(eph, name) for name in names] for eph in sets]).T[:, which]
    t_s = (t_ns - np.array([eph.toe_ns for eph in sets], dtype=np.int64)[which]) / NS_PER_S
    position, velocity, acceleration, (af0, af1) = value[0:3], value[3:6], value[6:9], value[9:11]
    moved = position + t_s * (velocity + 0.5 * t_s * acceleration)
    return np.concatenate((moved, velocity + t_s * acceleration, acceleration, [af0 + af1 * t_s, af1]))
