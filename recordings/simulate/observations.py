"""What receivers would have measured under a simulated constellation, as the events that whoever listens to them would have met.

Any number of antennas, fixed or moving. Satellites fly for the whole run by the ephemerides that are in force when it begins, so that the
broadcast models find the antennas but for the errors of `ErrorModel`; sets that follow say the same but for their resolution. Light time
is iterated and the frame turned under the signal (no linearised Sagnac term): right to 0.1 mm, then rounded to 1/1024 m (a binary fraction
compresses well). Every value is one that a u-blox receiver can say: `receiver`.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from integrity.config import SiteConfig
from integrity.events import EphemerisReceived, Event, IonosphereReceived, ObservationsReceived, Tick
from integrity.gnss.atmosphere import klobuchar_delay_m, saastamoinen_delay_m
from integrity.gnss.constants import EARTH_ROTATION_RADPS, SPEED_OF_LIGHT_MPS
from integrity.gnss.ephemeris.broadcast import KeplerEphemeris
from integrity.gnss.ephemeris.states import SatelliteStates, satellite_states
from integrity.gnss.ephemeris.store import EphemerisStore
from integrity.gnss.frames import enu_axes, geodetic_from_ecef
from integrity.gnss.gps_time import NS_PER_S, WEEK_NS, utc_from_gps
from integrity.gnss.observations import ROW_ARRAYS, Bools, Floats, Ints, ObservationRow
from integrity.gnss.positioning import state_time_ns
from integrity.gnss.signals import L1_HZ, bands_of, carrier_hz
from recordings.simulate.constellation import IONOSPHERE, constellation
from recordings.simulate.errors import NOMINAL, ErrorModel, ReceiverClocks, generator, receiver_clocks, signal_errors

CUT_OFF_RAD = math.radians(5.0)
LIGHT_TIME_ITERATIONS = 3  # each shrinks the error by v / c: from 20 ms to below 1e-15 s
CODE_OF_SYSTEM = {"G": "1C", "E": "1C"}
SECOND_CODE_OF_SYSTEM = {"G": "2L", "E": "7Q"}  # as receivers of u-blox generation 9 have them
MOST_AMBIGUITY_CYCLES = 4000  # MSM tells carriers that are less than 1,171 m from their range: RTCM 10403.3, DF401, DF406
LONGEST_LOCK_MS = 64_500.0  # a u-blox receiver counts no further (interface description of HPG 1.51, UBX-RXM-RAWX)

Motion = Callable[[Ints], tuple[Floats, Floats]]
"""Position and velocity (E, 3) in ECEF, m and m/s, at GPS times (E,)."""


@dataclass(frozen=True)
class Antenna:
    """An antenna, the receiver behind it by name, and how it moves. Antennas with the same `clock` share one; by default none does."""

    receiver: str
    motion: Motion
    clock: str | None = None


def fixed(pos_ecef_m: Sequence[float]) -> Motion:
    """The motion of what stands still."""
    point = np.array(pos_ecef_m, dtype=np.float64)
    return lambda gps_ns: (np.tile(point, (len(gps_ns), 1)), np.zeros((len(gps_ns), 3)))


def antennas_of(site: SiteConfig) -> tuple[Antenna, ...]:
    """The receivers of a site, each at its surveyed point with a clock of its own."""
    return tuple(Antenna(r.name, fixed(r.position_ecef_m)) for r in site.receivers)


def simulate(
    site: SiteConfig, start_ns: int, duration_s: float, rate_hz: float, seed: int, errors: ErrorModel = NOMINAL, frequencies: int = 1
) -> tuple[Event, ...]:
    """`observed` by the antennas of a site."""
    return observed(antennas_of(site), start_ns, duration_s, rate_hz, seed, errors, frequencies)


def observed(
    antennas: Sequence[Antenna],
    start_ns: int,
    duration_s: float,
    rate_hz: float,
    seed: int,
    errors: ErrorModel = NOMINAL,
    frequencies: int = 1,
) -> tuple[Event, ...]:
    """Events of the epochs in [start, start + duration) that are multiples of 1 / rate_hz in GPS time; `start_ns` is GPS time.

    First the ionosphere and the ephemerides in force, later ones when they are transmitted; a Tick after each epoch. `mono_ns` is GPS
    time. An ephemeris enters if its satellite is seen in the run at all. What an antenna measures does not depend on the others, and what
    it measures on the first of two `frequencies` is what it measures on one.
    """
    interval_ns = round(NS_PER_S / rate_hz)
    first, end = -(-start_ns // interval_ns), -(-(start_ns + round(duration_s * NS_PER_S)) // interval_ns)
    epoch_ns = interval_ns * np.arange(first, end)
    if not len(epoch_ns):
        return ()
    sets = constellation(seed, int(epoch_ns[0]), int(epoch_ns[-1]))
    receivers = tuple(antenna.receiver for antenna in antennas)
    path = _path(antennas, epoch_ns)
    satellites, index = _in_sight(sets, epoch_ns, path)
    states = satellite_states(sets, index, state_time_ns(epoch_ns))
    step_s = interval_ns / NS_PER_S
    clocks = receiver_clocks(errors, seed, [antenna.clock or antenna.receiver for antenna in antennas], step_s, len(epoch_ns))
    sky = _sky(states, epoch_ns, clocks, path)
    signals = tuple(f"{s}.{CODE_OF_SYSTEM[s[0]]}" for s in satellites)
    seen = sky.el_rad >= CUT_OFF_RAD
    measured = _measured(errors, seed, receivers, satellites, signals, satellites, step_s, clocks, sky)
    if frequencies == 2:
        second = tuple(f"{s}.{SECOND_CODE_OF_SYSTEM[s[0]]}" for s in satellites)
        later_s = states.clock_s - satellite_states(sets, index, states.t_ns, second).clock_s
        sky_of_second = _on_another_band(sky, second, later_s)
        on_second = _measured(errors, seed, receivers, satellites, second, second, step_s, clocks, sky_of_second)
        signals, seen, measured = _side_by_side(signals, second, seen, measured, on_second)
    ephemerides = [eph for eph in sets if eph.satellite in satellites]
    return tuple(_events(epoch_ns, receivers, signals, seen, measured, ephemerides))


class Path(NamedTuple):
    """Antennas at the epochs: position and velocity (E, R, 3) in ECEF, latitude, longitude, height (E, R), and local axes (E, R, 3, 3)."""

    pos_ecef_m: Floats
    vel_ecef_mps: Floats
    lat_rad: Floats
    lon_rad: Floats
    height_m: Floats
    enu: Floats


def _path(antennas: Sequence[Antenna], epoch_ns: Ints) -> Path:
    moved = [antenna.motion(epoch_ns) for antenna in antennas]
    pos, vel = (np.stack(parts, axis=1) for parts in zip(*moved, strict=True))
    lat_rad, lon_rad, height_m = geodetic_from_ecef(pos)
    return Path(pos, vel, lat_rad, lon_rad, height_m, enu_axes(lat_rad, lon_rad))


def _in_sight(sets: tuple[KeplerEphemeris, ...], epoch_ns: Ints, path: Path) -> tuple[tuple[str, ...], Ints]:
    """Satellites above the cut-off at some epoch, by name, and the sets that they fly by, the same at all epochs (E, S), as places among
    `sets`: those in force at first."""
    store = EphemerisStore(sets)
    arrived = np.searchsorted([eph.transmission_ns for eph in sets], epoch_ns[:1], side="right")
    everything = sorted({eph.satellite for eph in sets})
    index = np.repeat(store.choose(everything, epoch_ns[:1], arrived), len(epoch_ns), axis=0)
    states = satellite_states(sets, index, state_time_ns(epoch_ns))
    seen = np.zeros(len(everything), dtype=np.bool_)
    for r in range(path.pos_ecef_m.shape[1]):
        los = states.pos_ecef_m - path.pos_ecef_m[:, r].T[:, :, None]
        sin_el = np.einsum("ei,ies->es", path.enu[:, r, 2], los) / np.linalg.norm(los, axis=0)
        seen |= (sin_el >= math.sin(CUT_OFF_RAD)).any(axis=0)
    satellites = tuple(s for s, above in zip(everything, seen, strict=True) if above)
    return satellites, index[:, seen]


class Sky(NamedTuple):
    """The signals as they arrive without errors, (E, R, S): light time as a distance and its rate, satellite clock, direction, delays."""

    range_m: Floats
    range_rate_mps: Floats
    satellite_clock_m: Floats
    satellite_clock_mps: Floats
    az_rad: Floats
    el_rad: Floats
    ionosphere_m: Floats
    troposphere_m: Floats


def _sky(states: SatelliteStates, epoch_ns: Ints, clocks: ReceiverClocks, path: Path) -> Sky:
    """Light time from satellites (S) to antennas (R) for reception when the receivers' clocks show `epoch_ns`.

    In the ECEF of reception, where the satellite stands turned back by the Earth's rotation during the light time. The rate follows from
    |R(w tau) s(t - tau) - r(t)| = c tau by differentiation. Antennas move on in a straight line for what their clock is off.
    """
    received_s = (epoch_ns - states.t_ns)[:, None, None] / NS_PER_S - clocks.bias_s[:, :, None]
    pos, vel, acc = (v[:, :, None, :] for v in (states.pos_ecef_m, states.vel_ecef_mps, states.acc_ecef_mps2))
    antenna_mps = np.moveaxis(path.vel_ecef_mps, -1, 0)[..., None]
    antenna_m = np.moveaxis(path.pos_ecef_m, -1, 0)[..., None] - antenna_mps * clocks.bias_s[:, :, None]
    tau_s = np.full((*clocks.bias_s.shape, pos.shape[-1]), 0.0775)
    for _ in range(LIGHT_TIME_ITERATIONS):
        dt = received_s - tau_s
        there_m = _turned_back(pos + dt * (vel + 0.5 * dt * acc), tau_s)
        los = there_m - antenna_m
        distance_m = np.sqrt((los * los).sum(axis=0))
        tau_s = distance_m / SPEED_OF_LIGHT_MPS

    u = los / distance_m
    moving_mps = (u * _turned_back(vel + dt * acc, tau_s)).sum(axis=0)
    turning_mps = EARTH_ROTATION_RADPS * (u[0] * there_m[1] - u[1] * there_m[0])
    opening_mps = moving_mps - (u * antenna_mps).sum(axis=0)
    range_rate_mps = SPEED_OF_LIGHT_MPS * opening_mps / (SPEED_OF_LIGHT_MPS + moving_mps - turning_mps)

    los_enu = np.einsum("erij,jers->iers", path.enu, u)
    el_rad, az_rad = np.arcsin(np.clip(los_enu[2], -1.0, 1.0)), np.arctan2(los_enu[0], los_enu[1])
    el_air = np.maximum(el_rad, 0.5 * CUT_OFF_RAD)  # what is lower is not observed
    lat, lon, height = (part[:, :, None] for part in (path.lat_rad, path.lon_rad, path.height_m))
    tow_s = (epoch_ns % WEEK_NS / NS_PER_S)[:, None, None]
    return Sky(
        range_m=distance_m,
        range_rate_mps=range_rate_mps,
        satellite_clock_m=SPEED_OF_LIGHT_MPS * (states.clock_s[:, None, :] + states.clock_drift_sps[:, None, :] * dt),
        satellite_clock_mps=SPEED_OF_LIGHT_MPS * np.broadcast_to(states.clock_drift_sps[:, None, :], tau_s.shape),
        az_rad=az_rad,
        el_rad=el_rad,
        ionosphere_m=klobuchar_delay_m(tow_s, lat, lon, az_rad, el_air, IONOSPHERE),
        troposphere_m=saastamoinen_delay_m(lat, height, el_air),
    )


def _turned_back(vector: Floats, tau_s: Floats) -> Floats:
    """Vectors (3, ...) of the ECEF of transmission in the ECEF of reception, `tau_s` later."""
    angle = EARTH_ROTATION_RADPS * tau_s
    cosine, sine = np.cos(angle), np.sin(angle)
    return np.stack((cosine * vector[0] + sine * vector[1], cosine * vector[1] - sine * vector[0], np.broadcast_to(vector[2], angle.shape)))


def _on_another_band(sky: Sky, signals: Sequence[str], later_s: Floats) -> Sky:
    """The sky as other signals (S,) of the same satellites have it, which leave `later_s` (E, S) later: 0.1 mm of range and less."""
    times = np.array([(L1_HZ / _carrier_hz(signal)) ** 2 for signal in signals])
    return sky._replace(
        satellite_clock_m=sky.satellite_clock_m - SPEED_OF_LIGHT_MPS * later_s[:, None, :], ionosphere_m=times * sky.ionosphere_m
    )


def _carrier_hz(signal: str) -> float:
    found = carrier_hz(signal[0], bands_of(signal)[0])
    assert found is not None
    return found[0]


def _side_by_side(
    signals: Sequence[str], second: Sequence[str], seen: Bools, measured: dict[str, Floats], on_second: dict[str, Floats]
) -> tuple[tuple[str, ...], Bools, dict[str, Floats]]:
    """Both signals of each satellite beside each other; both are seen or none."""
    order = np.arange(2 * len(signals)).reshape(2, -1).T.ravel()
    together = {name: np.concatenate((values, on_second[name]), axis=-1)[..., order] for name, values in measured.items()}
    names = (*signals, *second)
    return tuple(names[i] for i in order.tolist()), np.repeat(seen, 2, axis=-1), together


def _measured(
    errors: ErrorModel,
    seed: int,
    receivers: tuple[str, ...],
    satellites: tuple[str, ...],
    signals: tuple[str, ...],
    processes: tuple[str, ...],
    step_s: float,
    clocks: ReceiverClocks,
    sky: Sky,
) -> dict[str, Floats]:
    """The arrays of `ObservationRow`, (E, R, S), rounded as receivers give them, but for flags and lock time; one signal a satellite,
    whose errors are told apart by the names of `processes`.

    The Doppler, in steps of 1/1024 Hz, fits a 32-bit float to 16 kHz. It leaves out the rates of delays and slow errors: below
    0.03 m/s at 5 deg of elevation.
    """
    spoiled = signal_errors(errors, seed, receivers, satellites, step_s, sky.az_rad, sky.el_rad, sky.ionosphere_m, processes)
    wavelength_m = np.array([SPEED_OF_LIGHT_MPS / _carrier_hz(signal) for signal in signals])
    clock_m = SPEED_OF_LIGHT_MPS * clocks.bias_s[:, :, None] - sky.satellite_clock_m
    clock_mps = SPEED_OF_LIGHT_MPS * clocks.drift_sps[:, :, None] - sky.satellite_clock_mps
    neutral_m = sky.range_m + clock_m + sky.troposphere_m
    ambiguity = [
        [generator(seed, f"ambiguity/{r}/{s}").integers(-MOST_AMBIGUITY_CYCLES, MOST_AMBIGUITY_CYCLES) for s in processes]
        for r in receivers
    ]
    return {
        "pseudorange_m": _rounded(neutral_m + sky.ionosphere_m + spoiled.code_m, 1024),
        "carrier_cycles": _rounded((neutral_m - sky.ionosphere_m + spoiled.carrier_m) / wavelength_m + np.array(ambiguity), 1024),
        "doppler_hz": _rounded(-(sky.range_rate_mps + clock_mps + spoiled.range_rate_mps) / wavelength_m, 1024),
        "cn0_dbhz": _rounded(spoiled.cn0_dbhz, 1),
    }


def _rounded(values: Floats, steps_per_unit: int) -> Floats:
    result: Floats = np.round(values * steps_per_unit) / steps_per_unit
    return result


def _lock_s(seen: Bools, step_s: float) -> Floats:
    """How long each signal (E, R, S) has been tracked without a break, in whole ms; receivers are switched on at the first epoch."""
    k = np.arange(len(seen))[:, None, None]
    last_unseen = np.maximum.accumulate(np.where(seen, -1, k), axis=0)
    lock_ms = np.round(1e3 * step_s * np.maximum(k - last_unseen - 1, 0))
    lock_s: Floats = np.minimum(lock_ms, LONGEST_LOCK_MS) / 1e3
    return lock_s


def _events(
    epoch_ns: Ints,
    receivers: tuple[str, ...],
    signals: tuple[str, ...],
    seen: Bools,
    measured: dict[str, Floats],
    ephemerides: list[KeplerEphemeris],
) -> list[Event]:
    """In the order in which a station meets them; `ephemerides` in the order of transmission."""
    step_s = float(epoch_ns[1] - epoch_ns[0]) / NS_PER_S if len(epoch_ns) > 1 else 0.0
    lock_s = _lock_s(seen, step_s)
    arrays = measured | {"lock_s": lock_s, "slip": lock_s == 0.0, "half_cycle": np.zeros(seen.shape, dtype=np.bool_)}
    names = np.array(signals)
    start_ns = int(epoch_ns[0])
    events: list[Event] = [IonosphereReceived(start_ns, IONOSPHERE)]
    sent = 0
    for e, t_ns in enumerate(epoch_ns.tolist()):
        while sent < len(ephemerides) and ephemerides[sent].transmission_ns <= t_ns:
            events.append(EphemerisReceived(max(ephemerides[sent].transmission_ns, start_ns), ephemerides[sent]))
            sent += 1
        for r, receiver in enumerate(receivers):
            in_view = seen[e, r]
            values = {name: arrays[name][e, r][in_view] for name in ROW_ARRAYS}
            events.append(ObservationsReceived(t_ns, ObservationRow(receiver, t_ns, tuple(names[in_view].tolist()), **values)))
        events.append(Tick(t_ns, utc_from_gps(t_ns), None))
    return events
