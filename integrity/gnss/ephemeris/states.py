"""From broadcast sets to satellite states, for a whole block at once."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from integrity.gnss.ephemeris.broadcast import Ephemeris, GeoEphemeris, GlonassEphemeris, KeplerEphemeris, group_delays_s
from integrity.gnss.ephemeris.kepler import GEOSTATIONARY, NO_ORBIT, Parameters, evaluate, timeless
from integrity.gnss.ephemeris.state_vectors import geo_states, glonass_states
from integrity.gnss.gps_time import NS_PER_S
from integrity.gnss.observations import Bools, Floats, Ints, freeze, slices

_States = Callable[[list[Any], Ints, Ints], Floats]  # of sets of one kind
DELAYS = 3  # bands with a group delay, at most


@dataclass(frozen=True, eq=False)
class SatelliteStates:
    """Satellites of a block at the time `t_ns` (E,): position, velocity, acceleration (3, E, S) in ECEF of that time, m, m/s, m/s2.

    `clock_s`, `clock_drift_sps` (E, S): what the satellite's clock is ahead of its system's time, relativity and the group delay of the
    signal included. NaN where no ephemeris serves, or does not say that delay.
    """

    t_ns: Ints
    pos_ecef_m: Floats
    vel_ecef_mps: Floats
    acc_ecef_mps2: Floats
    clock_s: Floats
    clock_drift_sps: Floats

    def __post_init__(self) -> None:
        freeze(self)


class Ephemerides(tuple[Ephemeris, ...]):
    """Ephemerides with what follows from them, computed once. Arrays of n + 1: the last entry, index -1, is "none"."""

    @staticmethod
    def of(sets: Sequence[Ephemeris]) -> "Ephemerides":
        """The same sets; the same object where they are that already."""
        return sets if isinstance(sets, Ephemerides) else Ephemerides(sets)

    @cached_property
    def columns(self) -> Floats:
        """`Parameters` but for the times, (P - 2, n + 1)."""
        return np.array([*(timeless(eph) if isinstance(eph, KeplerEphemeris) else NO_ORBIT for eph in self), NO_ORBIT]).T

    @cached_property
    def reference_ns(self) -> Ints:
        """toe and toc, (2, n + 1)."""
        times = ((eph.toe_ns, eph.toc_ns if isinstance(eph, KeplerEphemeris) else eph.toe_ns) for eph in self)
        return np.array([*times, (0, 0)], dtype=np.int64).T

    @cached_property
    def delays_s(self) -> Floats:
        """Group delays by band as `signals.delay_band` counts, (DELAYS + 1, n + 1); the last row, of bands without, is NaN."""
        rows = [[np.nan if d is None else d for d in group_delays_s(eph)] for eph in self] + [[]]
        return np.array([row + [np.nan] * (DELAYS + 1 - len(row)) for row in rows]).T

    @cached_property
    def tilted(self) -> Bools:
        """Which are BeiDou's geostationary satellites, (n + 1,)."""
        return np.array([*(eph.satellite in GEOSTATIONARY for eph in self), False])

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
        """URA, SISA or F_T (n + 1,), m; NaN where nothing is promised."""
        return np.array([*(np.nan if eph.accuracy_m is None else eph.accuracy_m for eph in self), np.nan])

    @cached_property
    def channel(self) -> Ints:
        """Frequency number of GLONASS (n + 1,), 0 for the others."""
        return np.array([*(eph.channel if isinstance(eph, GlonassEphemeris) else 0 for eph in self), 0], dtype=np.int64)

    def parameters(self, origin_ns: int) -> Parameters:
        """As columns, times in seconds from `origin_ns`."""
        return Parameters(*self.columns, *((self.reference_ns - origin_ns) / NS_PER_S))


def satellite_states(ephemerides: Sequence[Ephemeris], index: Ints, t_ns: Ints, band: Ints | int = 0) -> SatelliteStates:
    """States of satellites at GPS times `t_ns` (E,), `index` (E, S) into `ephemerides`, -1 for none; `band` (S,) is that of the group
    delay (`signals.delay_band`), by default the first.

    Accuracy: the broadcast model itself, evaluated to better than 1 mm and 1e-12 s (GLONASS: 1 cm); the acceleration of Kepler orbits is
    that of a point-mass Earth (good to 1e-4 m/s2: 0.01 mm over 0.5 s).
    """
    sets = Ephemerides.of(ephemerides)
    origin_ns = int(t_ns[0])
    t_s = ((t_ns - origin_ns) / NS_PER_S)[:, None]
    columns = np.array(sets.parameters(origin_ns))
    tilted = sets.tilted[index] if sets.tilted.any() else None
    out = np.empty((11, *index.shape))
    for few in slices(*index.shape):
        out[:, few] = evaluate(
            Parameters(*columns.take(index[few], axis=1, mode="wrap")), t_s[few], None if tilted is None else tilted[few]
        )
    if sets.of_states.any():
        _put(out, sets, index, t_ns, GlonassEphemeris, glonass_states)
        _put(out, sets, index, t_ns, GeoEphemeris, geo_states)
    out[9] -= sets.delays_s[band, index]
    return SatelliteStates(t_ns, out[0:3], out[3:6], out[6:9], out[9], out[10])


def _put(
    out: Floats,
    sets: Ephemerides,
    index: Ints,
    t_ns: Ints,
    kind: type[Ephemeris],
    states: _States,
) -> None:
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
