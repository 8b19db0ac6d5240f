"""From broadcast sets to satellite states, for a whole block at once."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any, NamedTuple

import numpy as np

from integrity.gnss.ephemeris.arcs import kepler_states
from integrity.gnss.ephemeris.broadcast import Ephemeris, GeoEphemeris, GlonassEphemeris, KeplerEphemeris, group_delays_s
from integrity.gnss.ephemeris.kepler import GEOSTATIONARY, NO_ORBIT, Elements, timeless
from integrity.gnss.ephemeris.state_vectors import geo_states, glonass_states
from integrity.gnss.observations import Bools, Floats, Ints, freeze
from integrity.gnss.signals import L1_HZ, UNKNOWN_BAND, bands_of, carrier_hz, delay_band, ionosphere_free_weights, is_beidou_2

_States = Callable[[list[Any], Ints, Ints], Floats]  # of sets of one kind
DELAYS = 3  # bands with a group delay, at most


@dataclass(frozen=True, eq=False)
class SatelliteStates:
    """Satellites of a block at the time `t_ns` (E,): position, velocity, acceleration (3, E, S) in ECEF of that time, m, m/s, m/s2.

    `clock_s`, `clock_drift_sps` (E, S): what the satellite's clock is ahead of its system's time, relativity and the group delay of the
    signal included. `ionosphere` (E, S): by how much more than L1 the ionosphere delays the signal. NaN where no ephemeris serves, or
    does not say that delay.
    """

    t_ns: Ints
    pos_ecef_m: Floats
    vel_ecef_mps: Floats
    acc_ecef_mps2: Floats
    clock_s: Floats
    clock_drift_sps: Floats
    ionosphere: Floats

    def __post_init__(self) -> None:
        freeze(self)


class Ephemerides(tuple[Ephemeris, ...]):
    """Ephemerides with what follows from them, computed once. Arrays of n + 1: the last entry, index -1, is "none"."""

    @staticmethod
    def of(sets: Sequence[Ephemeris]) -> "Ephemerides":
        """The same sets; the same object where they are that already."""
        return sets if isinstance(sets, Ephemerides) else Ephemerides(sets)

    @cached_property
    def elements(self) -> Elements:
        """What orbits are computed from, of the sets that are Kepler elements."""
        kepler = [eph if isinstance(eph, KeplerEphemeris) else None for eph in self]
        columns = [*(timeless(eph) if eph else NO_ORBIT for eph in kepler), NO_ORBIT]
        times = [*((eph.toe_ns, eph.toc_ns) if eph else (0, 0) for eph in kepler), (0, 0)]
        tilted = [*(eph is not None and eph.satellite in GEOSTATIONARY for eph in kepler), False]
        return Elements(np.array(columns).T, np.array(times, dtype=np.int64).T, np.array(tilted))

    @cached_property
    def delays_s(self) -> Floats:
        """Group delays by band in the order of `signals.DELAY_BANDS`, (DELAYS + 1, n + 1); the last row, of bands without, is NaN."""
        rows = [[np.nan if d is None else d for d in group_delays_s(eph)] for eph in self] + [[]]
        return np.array([row + [np.nan] * (DELAYS + 1 - len(row)) for row in rows]).T

    @cached_property
    def of_states(self) -> Bools:
        """Which are state vectors, (n + 1,)."""
        return np.array([*(not isinstance(eph, KeplerEphemeris) for eph in self), False])

    @cached_property
    def usable(self) -> Bools:
        """Which say healthy and promise an accuracy, (n + 1,)."""
        return np.array([*(eph.healthy and eph.accuracy_m is not None for eph in self), False])

    @cached_property
    def accuracy_m(self) -> Floats:
        """URA, SISA or F_T (n + 1,), m; NaN where nothing is promised.

        Of BeiDou's second generation twice what it says: its satellites delay the code by a metre and more between horizon and zenith
        (Wanninger and Beer, GPS Solutions 19, 2015), which no message tells.
        """
        return np.array(
            [*(np.nan if eph.accuracy_m is None else eph.accuracy_m * (1 + is_beidou_2(eph.satellite)) for eph in self), np.nan]
        )

    @cached_property
    def channel(self) -> Ints:
        """Frequency number of GLONASS (n + 1,), 0 for the others."""
        return np.array([*(eph.channel if isinstance(eph, GlonassEphemeris) else 0 for eph in self), 0], dtype=np.int64)


class _Delays(NamedTuple):
    """What a range of each signal (S,) says of delays in two bands: `weight` (2, S) of those in `band` (2, S), group delays in the order of
    an ephemeris; and how the ionosphere delays it: `free` not at all, else by its frequency, of GLONASS by its channel's."""

    band: Ints
    weight: Floats
    free: Bools
    carrier_hz: Floats
    channel_hz: Floats


def satellite_states(ephemerides: Sequence[Ephemeris], index: Ints, t_ns: Ints, signals: Sequence[str] = ()) -> SatelliteStates:
    """States of satellites at GPS times `t_ns` (E,), `index` (E, S) into `ephemerides`, -1 for none, for ranges of `signals` (S,).

    Without signals, clocks are those of every satellite's first band, and the ionosphere that of L1.

    Accuracy: the broadcast model itself, evaluated to better than 1 mm and 1e-12 s (GLONASS: 1 cm).
    """
    sets = Ephemerides.of(ephemerides)
    out = kepler_states(sets.elements, index, t_ns)
    if sets.of_states.any() and sets.of_states[index].any():
        _put(out, sets, index, t_ns, GlonassEphemeris, glonass_states)
        _put(out, sets, index, t_ns, GeoEphemeris, geo_states)
    of = _delays(tuple(signals))
    for band, weight in zip(of.band, of.weight, strict=True):
        if weight.any():
            out[9] -= weight * sets.delays_s[band, index]
    carriers_hz = of.carrier_hz + of.channel_hz * sets.channel[index] if of.channel_hz.any() else of.carrier_hz
    ionosphere = np.broadcast_to(np.where(of.free, 0.0, (L1_HZ / carriers_hz) ** 2), index.shape)
    return SatelliteStates(t_ns, out[0:3], out[3:6], out[6:9], out[9], out[10], ionosphere)


@lru_cache(maxsize=256)
def _delays(signals: tuple[str, ...]) -> _Delays:
    if not signals:
        return _Delays(np.zeros((2, 1), dtype=np.int64), np.array([[1.0], [0.0]]), np.array([False]), np.array([L1_HZ]), np.zeros(1))
    band = np.full((2, len(signals)), UNKNOWN_BAND, dtype=np.int64)
    weight = np.zeros((2, len(signals)))
    carrier_hz_ = np.full((2, len(signals)), np.nan)
    for s, signal in enumerate(signals):
        system, bands = signal[:1], bands_of(signal)
        band[:, s] = delay_band(system, bands[0]), delay_band(system, bands[-1])
        weights = (1.0, 0.0) if len(bands) == 1 else ionosphere_free_weights(system, *bands)
        weight[:, s] = (np.nan, np.nan) if weights is None else weights
        carrier_hz_[:, s] = carrier_hz(system, bands[0]) or np.nan
    return _Delays(band, weight, weight[1] != 0.0, carrier_hz_[0], carrier_hz_[1])


def _put(out: Floats, sets: Ephemerides, index: Ints, t_ns: Ints, kind: type[Ephemeris], states: _States) -> None:
    """Where sets of a kind serve, their states into `out` (11, E, S)."""
    of_kind = np.array([*(isinstance(eph, kind) for eph in sets), False])[index]
    if of_kind.any():
        epochs = np.nonzero(of_kind)[0]
        serving, which = np.unique(index[of_kind], return_inverse=True)
        out[:, of_kind] = states([sets[k] for k in serving], which, t_ns[epochs])


def usable(ephemerides: Sequence[Ephemeris], index: Ints) -> Bools:
    """Where the chosen ephemeris (E, S) says healthy and promises an accuracy; False where there is none."""
    result: Bools = Ephemerides.of(ephemerides).usable[index]
    return result


def accuracy_m(ephemerides: Sequence[Ephemeris], index: Ints) -> Floats:
    """URA, SISA or F_T (E, S) in metres of the chosen ephemeris; NaN where there is none or it promises nothing."""
    result: Floats = Ephemerides.of(ephemerides).accuracy_m[index]
    return result
