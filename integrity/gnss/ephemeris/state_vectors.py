"""Orbits of state vectors: GLONASS, whose equations of motion are integrated, and SBAS, which sends a parabola.

Sources: GLONASS ICD 5.1, appendix A.3.1.2; RTCA DO-229, A.4.4.11.
"""

from collections.abc import Sequence
from functools import lru_cache

import numpy as np

from integrity.gnss.constants import GLONASS_EARTH_RADIUS_M, GLONASS_EARTH_ROTATION_RADPS, GLONASS_J02, GLONASS_MU_M3PS2
from integrity.gnss.ephemeris.broadcast import GeoEphemeris, GlonassEphemeris
from integrity.gnss.gps_time import NS_PER_S
from integrity.gnss.observations import Floats, Ints

STEP_S = 60.0  # of fourth-order Runge-Kutta: errors of 0.1 mm over half an hour


def glonass_states(sets: Sequence[GlonassEphemeris], which: Ints, t_ns: Ints) -> Floats:
    """Position, velocity, acceleration, clock, its drift (11, n) of the sets `which` (n,) at GPS times (n,), within their fit interval.

    From the nearest of nodes a minute apart, which every set has, so that the result depends on the set and the time alone.
    """
    toe_ns = np.array([eph.toe_ns for eph in sets], dtype=np.int64)[which]
    t_s = (t_ns - toe_ns) / NS_PER_S
    reach = np.ceil(max((eph.fit_half_s for eph in sets), default=0.0) / STEP_S)
    node = np.clip(np.rint(t_s / STEP_S), -reach, reach).astype(np.int64)
    nodes = np.stack([_nodes(eph, int(reach)) for eph in sets])  # (sets, nodes, 6)
    force = np.array([(eph.ax_mps2, eph.ay_mps2, eph.az_mps2) for eph in sets])[which]
    state = _stepped(nodes[which, node + int(reach)], force, (t_s - node * STEP_S)[:, None])
    tau, gamma = (np.array([getattr(eph, name) for eph in sets])[which] for name in ("tau_n_s", "gamma_n"))
    motion = _motion(state, force)
    return np.concatenate((state.T, motion[:, 3:].T, [-tau + gamma * t_s, gamma]))


@lru_cache(maxsize=256)
def _nodes(eph: GlonassEphemeris, reach: int) -> Floats:
    """States (2 reach + 1, 6) at toe and every minute before and after it."""
    start = np.array([[eph.x_m, eph.y_m, eph.z_m, eph.vx_mps, eph.vy_mps, eph.vz_mps]])
    force = np.array([[eph.ax_mps2, eph.ay_mps2, eph.az_mps2]])
    before, after = [start], [start]
    for _ in range(reach):
        before.append(_stepped(before[-1], force, -STEP_S))
        after.append(_stepped(after[-1], force, STEP_S))
    nodes: Floats = np.concatenate(before[:0:-1] + after)
    nodes.setflags(write=False)
    return nodes


def _stepped(state: Floats, force: Floats, h_s: Floats | float) -> Floats:
    """States (n, 6) after one Runge-Kutta step of `h_s`."""
    k1 = _motion(state, force)
    k2 = _motion(state + 0.5 * h_s * k1, force)
    k3 = _motion(state + 0.5 * h_s * k2, force)
    k4 = _motion(state + h_s * k3, force)
    stepped: Floats = state + h_s / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
    return stepped


def _motion(state: Floats, force: Floats) -> Floats:
    """Derivative (n, 6) of states in the rotating frame, with luni-solar accelerations (n, 3) held: ICD 5.1, A.3.1.2."""
    x, y, z, vx, vy, vz = state.T
    omega = GLONASS_EARTH_ROTATION_RADPS
    r2 = x * x + y * y + z * z
    gravity = GLONASS_MU_M3PS2 / (r2 * np.sqrt(r2))
    flattening = 1.5 * GLONASS_J02 * GLONASS_MU_M3PS2 * GLONASS_EARTH_RADIUS_M**2 / (r2 * r2 * np.sqrt(r2))
    polar = 5.0 * z * z / r2
    level = -gravity - flattening * (1.0 - polar) + omega * omega
    ax = level * x + 2.0 * omega * vy + force[:, 0]
    ay = level * y - 2.0 * omega * vx + force[:, 1]
    az = (-gravity - flattening * (3.0 - polar)) * z + force[:, 2]
    return np.stack((vx, vy, vz, ax, ay, az), axis=-1)


def geo_states(sets: Sequence[GeoEphemeris], which: Ints, t_ns: Ints) -> Floats:
    """Position, velocity, acceleration, clock, its drift (11, n) of the sets `which` (n,) at GPS times (n,)."""
    names = ("x_m", "y_m", "z_m", "vx_mps", "vy_mps", "vz_mps", "ax_mps2", "ay_mps2", "az_mps2", "af0", "af1")
    value = np.array([[getattr(eph, name) for name in names] for eph in sets]).T[:, which]
    t_s = (t_ns - np.array([eph.toe_ns for eph in sets], dtype=np.int64)[which]) / NS_PER_S
    position, velocity, acceleration, (af0, af1) = value[0:3], value[3:6], value[6:9], value[9:11]
    moved = position + t_s * (velocity + 0.5 * t_s * acceleration)
    return np.concatenate((moved, velocity + t_s * acceleration, acceleration, [af0 + af1 * t_s, af1]))
