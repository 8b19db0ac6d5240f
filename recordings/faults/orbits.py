"""A satellite that broadcasts a wrong orbit: the ephemeris displaced along, across or in height, and what a station would then receive."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from math import cos, sqrt
from typing import Literal

import numpy as np

from integrity.errors import ConfigError
from integrity.events import EphemerisReceived, Event
from integrity.gnss.constants import BEIDOU_MU_M3PS2, EARTH_ROTATION_RADPS, GALILEO_MU_M3PS2, GPS_MU_M3PS2, SPEED_OF_LIGHT_MPS
from integrity.gnss.ephemeris.broadcast import Ephemeris, GeoEphemeris, GlonassEphemeris, KeplerEphemeris
from integrity.gnss.ephemeris.kepler import GEOSTATIONARY
from integrity.gnss.ephemeris.states import satellite_states
from integrity.gnss.observations import Floats
from recordings.faults.kinds import WrongEphemeris
from recordings.faults.scenario import Fault
from recordings.faults.truth import RecordedRow, Truth

ISSUES = {"G": 256, "J": 256, "E": 1024, "C": 32}  # how many values IODE, IODnav and AODE have
_MU = {"E": GALILEO_MU_M3PS2, "C": BEIDOU_MU_M3PS2}
UPRIGHT_BEIDOU = "C11"  # a satellite whose elements are those of the equator

Axis = Literal["along", "cross", "radial"]


@dataclass(frozen=True)
class NavigationEdits:
    """Events to put before the one at a place, and events to put in the place of another."""

    before: dict[int, list[Event]] = field(default_factory=dict)
    instead: dict[int, Event] = field(default_factory=dict)


def displaced(true: Ephemeris, offset_m: float, direction: Axis | Literal["clock"], gps_ns: int) -> Ephemeris:
    """The ephemeris with its orbit displaced by `offset_m` at a GPS time (state vectors: at their reference time): in the direction of
    flight, along the orbit's normal, or up; or with its clock ahead by as much."""
    if direction == "clock":
        ahead_s = offset_m / SPEED_OF_LIGHT_MPS
        if isinstance(true, GlonassEphemeris):
            return replace(true, tau_n_s=true.tau_n_s - ahead_s)  # what is to be added to the satellite's time: GLONASS ICD 4.4
        return replace(true, af0=true.af0 + ahead_s)
    if isinstance(true, KeplerEphemeris):
        return displaced_elements(true, offset_m, direction, gps_ns)
    return displaced_vector(true, offset_m, direction)


def displaced_elements(true: KeplerEphemeris, offset_m: float, direction: Axis, gps_ns: int) -> KeplerEphemeris:
    """Along and up the displacement stays within 1 % for an hour at e < 0.02, across it turns with the satellite: cos(30 deg) of it is left
    after an hour. Parameters of IS-GPS-200, table 20-IV; the corrections for harmonics stay, their change is below 1e-4 of the offset.

    The elements of BeiDou's geostationary satellites are those of a tilted frame: across, they are displaced in it.
    """
    tilted = direction == "cross" and true.satellite in GEOSTATIONARY
    of_frame = replace(true, satellite=UPRIGHT_BEIDOU, message="D1") if tilted else true
    states = satellite_states([of_frame], np.array([[0]]), np.array([gps_ns]))
    pos, vel = states.pos_ecef_m[:, 0, 0], states.vel_ecef_mps[:, 0, 0]
    r = float(np.linalg.norm(pos))
    A = true.sqrt_a**2
    if direction == "along":
        # |v| = n A sqrt((1 + e cos E) / (1 - e cos E)), with 1 - e cos E = r / A
        return replace(true, m0=true.m0 + offset_m / A * sqrt((r / A) / (2.0 - r / A)))
    if direction == "radial":
        mu = _MU.get(true.satellite[0], GPS_MU_M3PS2)
        A_new = A + offset_m * A / r
        return replace(true, sqrt_a=sqrt(A_new), delta_n=true.delta_n + sqrt(mu / A**3) - sqrt(mu / A_new**3))
    # A rotation about the axis that lies in the orbit, 90 deg from the satellite: it lifts the satellite along the normal h.
    h = np.cross(pos, _inertial(pos, vel))
    node = np.cross([0.0, 0.0, 1.0], h)
    cos_u = float(pos @ node / (r * np.linalg.norm(node)))
    sin_u = float(np.cross(node, pos) @ h / (r * np.linalg.norm(node) * np.linalg.norm(h)))
    sin_i = float(np.linalg.norm(node) / np.linalg.norm(h))
    turned = -offset_m / r * cos_u / sin_i
    return replace(
        true, i0=true.i0 + offset_m / r * sin_u, omega0=true.omega0 + turned, omega=true.omega - turned * cos(true.i0)
    )  # the last takes the turn of the node out of the argument of latitude: nothing along the orbit


def displaced_vector(true: GlonassEphemeris | GeoEphemeris, offset_m: float, direction: Axis) -> GlonassEphemeris | GeoEphemeris:
    """Position and velocity of an orbit that goes beside the true one, within 3 % for 15 minutes: turned along itself by offset / r,
    lifted along its normal, or made larger at the same rate of turning (Clohessy and Wiltshire 1960: 1 + 1.5 (n t)^2)."""
    pos, vel = np.array([true.x_m, true.y_m, true.z_m]), np.array([true.vx_mps, true.vy_mps, true.vz_mps])
    flight = _inertial(pos, vel)
    r, h = float(np.linalg.norm(pos)), np.cross(pos, flight)
    normal = h / np.linalg.norm(h)
    if direction == "along":
        pos_new, flight_new = (v + offset_m / r * np.cross(normal, v) for v in (pos, flight))
    elif direction == "cross":
        pos_new, flight_new = pos + offset_m * normal, flight
    else:
        pos_new, flight_new = pos * (1.0 + offset_m / r), flight * (1.0 + offset_m / r)
    vel_new = flight_new - np.cross([0.0, 0.0, EARTH_ROTATION_RADPS], pos_new)
    (x, y, z), (vx, vy, vz) = pos_new.tolist(), vel_new.tolist()
    return replace(true, x_m=x, y_m=y, z_m=z, vx_mps=vx, vy_mps=vy, vz_mps=vz)


def _inertial(pos: Floats, vel: Floats) -> Floats:
    """Velocity in a frame that does not turn, in the axes of ECEF."""
    flight: Floats = vel + np.cross([0.0, 0.0, EARTH_ROTATION_RADPS], pos)
    return flight


def wrong_navigation(
    fault: Fault, effect: WrongEphemeris, truth: Truth, hit: Sequence[RecordedRow], told: Mapping[int, EphemerisReceived]
) -> NavigationEdits:
    """The displaced ephemeris enters before the first faulty epoch, transmitted when the fault starts; every one of the satellite that
    arrives during the fault is displaced likewise; the newest true one enters before the first epoch after it.

    `told` are the ephemerides that came as such, not as words, by place.
    """
    after = next((s for s in truth.rows if s.place > hit[-1].place and not fault.covers(s.epoch_ns)), None)
    edits = NavigationEdits()
    true = serving(fault, effect, truth, hit[0])
    sent_ns = max(fault.start_ns, true.transmission_ns + 1)
    entering = replace(wrong_orbit(fault, effect, true, sent_ns), transmission_ns=sent_ns)
    edits.before[hit[0].place] = [EphemerisReceived(hit[0].mono_ns, entering)]
    newest = true
    for place, event in told.items():
        during = hit[0].place <= place and (after is None or place < after.place)
        if during and event.ephemeris.satellite == effect.satellite:
            displaced_too = wrong_orbit(fault, effect, event.ephemeris, max(sent_ns, event.ephemeris.transmission_ns))
            edits.instead[place] = replace(event, ephemeris=displaced_too)
            newest = max(newest, event.ephemeris, key=lambda e: (e.transmission_ns, e.toe_ns, e.issue))
    if after is not None and fault.end_ns is not None:
        again = replace(newest, transmission_ns=max(fault.end_ns, sent_ns + 1))
        edits.before[after.place] = [EphemerisReceived(after.mono_ns, again)]
    return edits


def serving(fault: Fault, effect: WrongEphemeris, truth: Truth, first: RecordedRow) -> Ephemeris:
    """The ephemeris in use when the fault starts; ConfigError where there is none."""
    index = int(truth.store.choose([effect.satellite], np.array([first.epoch_ns]), np.array([first.arrived]))[0, 0])
    if index < 0:
        raise ConfigError(f"{fault}: no ephemeris of {effect.satellite} had arrived by then; choose a later start or another satellite")
    return truth.store.ephemerides[index]


def wrong_orbit(fault: Fault, effect: WrongEphemeris, true: Ephemeris, gps_ns: int) -> Ephemeris:
    """The ephemeris displaced as the fault says at a GPS time; ConfigError where that is no orbit.

    The issue of elements is half of all issues away from the true one, and so from those before and after it: no receiver joins pages of
    both. State vectors have none of their own: it is their reference time.
    """
    wrong = displaced(true, effect.offset_m, effect.direction, gps_ns)
    if isinstance(wrong, KeplerEphemeris):
        issues = ISSUES[wrong.satellite[0]]
        wrong = replace(wrong, issue=(wrong.issue + issues // 2) % issues)
    why = wrong.implausibility()
    if why is not None:
        raise ConfigError(f"{fault}: {effect.satellite} displaced by {effect.offset_m:g} m is no orbit that a station accepts: {why}")
    return wrong
