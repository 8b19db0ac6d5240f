"""What satellites send of their orbits: each new set against the one before it, and against the orbits that its system flies.

Theory of operation. Per satellite one entry of a table: the set that serves, and the last one that was believed, the reference. When
another set begins to serve, both are evaluated over the next two hours; how far they are apart, in what the satellite promises of
their accuracy, is the satellite's statistic for as long as the new set serves. If it passes, the new set is the next reference;
otherwise the reference stays, and the satellite counts as false until a set serves that fits it, or until the reference is too old to
contradict. A satellite that says it is not healthy may be moving: it loses its reference. A set without a reference is believed if its
orbit is one of its system.

What this sees that ranges at surveyed points do not. An error e_m across the line of sight changes no range there; d_m away it changes the
range by e_m d_m / distance of the satellite: 1 km changes it by 0.04 m per km of distance (GPS, overhead 0.05). Along the line of sight
the residual sees more than this.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from math import atan2, degrees, hypot, inf, nan
from typing import NamedTuple

import numpy as np

from integrity.gnss.constants import EARTH_ROTATION_RADPS, GPS_MU_M3PS2, SPEED_OF_LIGHT_MPS
from integrity.gnss.ephemeris.broadcast import Ephemeris, KeplerEphemeris
from integrity.gnss.ephemeris.kepler import GEOSTATIONARY
from integrity.gnss.ephemeris.states import Ephemerides, satellite_states
from integrity.gnss.gps_time import NS_PER_S
from integrity.gnss.observations import Floats, Ints
from integrity.gnss.positioning import URA_NOMINAL_M

HOUR_NS = 3600 * NS_PER_S
# The change and the two hours that a new set serves; earlier it says nothing (Galileo's are wrong before their reference time, by metres in
# an hour), later true ones differ by more than the faults that matter.
MOMENTS_NS = np.arange(3) * HOUR_NS
NOW = 0
# How much faster than its fit interval allows a set grows wrong, one sigma. Real sets of GPS, Galileo, BeiDou and QZSS are at most 92 m
# off two hours beyond, 375 m four, 550 m six: 1.2 to 2.3 of these sigmas. Own choice.
BEYOND_FIT_MPH = 40.0
REFERENCE_NS = 6 * HOUR_NS  # beyond its fit interval a set is a reference for so long: own choice
SAME_WITHIN_M = 0.01  # the last bit of crs is 0.03 m, of m0 0.04 m: IS-GPS-200, table 20-III


class Family(NamedTuple):
    """An orbit that a system flies, each element with its tolerance: semi-major axis in km, eccentricity, inclination in degrees."""

    a_km: tuple[float, float]
    e: tuple[float, float]
    i_deg: tuple[float, float]


# Centres: GPS SPS Performance Standard, 3.2, and Galileo, BeiDou, QZSS, GLONASS interface documents. Tolerances: own choice, at least 1.4
# times what has been seen of healthy satellites (G11 flies at 50.9 deg, E14 and E18 on the orbit that their launch left them on, BeiDou's
# geostationary ones in a frame tilted by 5 deg). State vectors: osculating elements, which the flattening of the Earth moves by 20 km.
FAMILIES: Mapping[str, tuple[Family, ...]] = {
    "G": (Family((26_559.7, 50.0), (0.0, 0.035), (55.0, 6.0)),),
    "E": (Family((29_600.3, 10.0), (0.0, 0.005), (56.0, 3.0)), Family((27_977.6, 30.0), (0.16, 0.02), (50.0, 3.0))),
    "C": (Family((27_906.1, 10.0), (0.0, 0.01), (55.0, 4.0)), Family((42_164.0, 50.0), (0.0, 0.03), (55.0, 10.0))),
    "J": (Family((42_164.0, 50.0), (0.075, 0.03), (41.0, 7.0)), Family((42_164.0, 50.0), (0.0, 0.005), (0.0, 2.0))),
    "R": (Family((25_508.0, 60.0), (0.0, 0.015), (64.8, 3.0)),),
    "S": (Family((42_164.0, 100.0), (0.0, 0.01), (0.0, 15.0)),),
}
OF_BEIDOU_GEOSTATIONARY = (Family((42_164.0, 50.0), (0.0, 0.01), (5.0, 7.0)),)


@dataclass(frozen=True)
class Served:
    """A satellite's entry: the set that serves; the reference, None where there is none; and what came of their comparison when the set
    began to serve, NaN without a reference; see `NavigationStatistics`."""

    satellite: str
    serving: Ephemeris
    reference: Ephemeris | None
    change: float
    range_m: float
    apart_m: float
    reissued_m: float
    orbit: float


Table = Mapping[str, Served]


class NavigationStatistics(NamedTuple):
    """Each (E, S), NaN where no healthy set serves. `change`: new set against reference, in sigmas, NaN without a reference; of that, at
    the moment of the change: `range_m`, by which the expected range grew, and `apart_m`, between the satellite's places. `reissued_m`:
    how far it is from a reference of the same issue, 0 of another one. `orbit`: the set against its system's orbits, 1 at the edge of
    what they may be."""

    change: Floats
    range_m: Floats
    apart_m: Floats
    reissued_m: Floats
    orbit: Floats


class Comparison(NamedTuple):
    """Of n pairs of sets, each (n,): see `NavigationStatistics`."""

    change: Floats
    range_m: Floats
    apart_m: Floats
    reissued_m: Floats


def advance(
    table: Table,
    satellites: Sequence[str],
    ephemerides: Ephemerides,
    index: Ints,
    epoch_ns: Ints,
    site_ecef_m: Floats,
    most_change: float,
    most_orbit: float,
) -> tuple[Table, NavigationStatistics]:
    """The table after a block, and what it says of the satellite of each signal; `index` (E, S) as `EphemerisStore.choose` gives it.

    `site_ecef_m` (3,): from where ranges are seen. A set is believed where its change is at most `most_change` and it is no other content
    of its reference's issue, or, without a reference, where its orbit is at most `most_orbit`.
    """
    n_epochs, n_signals = index.shape
    out = np.full((5, n_epochs, n_signals), nan)
    turns = [0, *(np.flatnonzero((index[1:] != index[:-1]).any(axis=1)) + 1).tolist(), n_epochs]
    for e, until in pairwise(turns):
        serving = {s: ephemerides[k] for s, k in zip(satellites, index[e].tolist(), strict=True) if k >= 0}
        table = _after(table, serving, int(epoch_ns[e]), site_ecef_m, most_change, most_orbit)
        rows = [_row(table.get(s)) if s in serving else NOTHING for s in satellites]
        out[:, e:until] = np.array(rows).reshape(n_signals, 5).T[:, None]
    return table, NavigationStatistics(*out)


NOTHING = (nan, nan, nan, nan, nan)


def _row(entry: Served | None) -> tuple[float, float, float, float, float]:
    return NOTHING if entry is None else (entry.change, entry.range_m, entry.apart_m, entry.reissued_m, entry.orbit)


def _after(
    table: Table, serving: Mapping[str, Ephemeris], gps_ns: int, site_ecef_m: Floats, most_change: float, most_orbit: float
) -> Table:
    """The table after an epoch in which these sets serve; the same object where nothing changed."""
    changed = [s for s, eph in serving.items() if _is_other(table.get(s), eph)]
    if not changed:
        return table
    after = {s: entry for s, entry in table.items() if s in serving or _contradicts(entry.reference, gps_ns)}
    with_reference = []
    for satellite in changed:
        before, eph = after.pop(satellite, None), serving[satellite]
        if not is_usable(eph):
            continue
        if before is not None and before.reference is not None and _contradicts(before.reference, gps_ns):
            with_reference.append((before.reference, eph))
        else:
            orbit = off_nominal(eph)
            after[satellite] = Served(satellite, eph, eph if orbit <= most_orbit else None, nan, nan, nan, nan, orbit)
    if with_reference:
        found = compared([old for old, _ in with_reference], [new for _, new in with_reference], gps_ns, site_ecef_m)
        for (old, new), (change, range_m, apart_m, reissued_m) in zip(with_reference, np.array(found).T.tolist(), strict=True):
            orbit = off_nominal(new)
            believed = change <= most_change and reissued_m <= SAME_WITHIN_M
            after[new.satellite] = Served(new.satellite, new, new if believed else old, change, range_m, apart_m, reissued_m, orbit)
    return after


def _is_other(entry: Served | None, eph: Ephemeris) -> bool:
    """Whether a set is not the one that served; one that is not usable leaves no entry."""
    if entry is None:
        return is_usable(eph)
    return entry.serving is not eph and entry.serving != eph


def is_usable(eph: Ephemeris) -> bool:
    """Whether a satellite says that it is healthy, and how accurate."""
    return eph.healthy and eph.accuracy_m is not None


def _contradicts(reference: Ephemeris | None, gps_ns: int) -> bool:
    """Whether a reference is young enough to say anything; state vectors are not extrapolated."""
    if reference is None:
        return False
    longest_ns = reference.fit_half_s * NS_PER_S + (REFERENCE_NS if isinstance(reference, KeplerEphemeris) else 0)
    return abs(gps_ns - reference.toe_ns) <= longest_ns


def compared(old: Sequence[Ephemeris], new: Sequence[Ephemeris], gps_ns: int, site_ecef_m: Floats) -> Comparison:
    """Sets of the same satellites, pair by pair, when the new ones begin to serve.

    `change` is the largest, over `MOMENTS_NS`, of the distance between the two places, and of the change of the range from the site (the
    orbit along the line of sight and the clock together), over sigma: sigma^2 = URA_old^2 + URA_new^2, no URA less than 2.4 m, and for
    each set (`BEYOND_FIT_MPH` times the hours beyond its fit interval)^2. Group delays are left out: no issue covers those of Galileo.
    """
    n, t_ns = len(old), gps_ns + MOMENTS_NS
    sets = [replace(eph, group_delay_s=0.0) if isinstance(eph, KeplerEphemeris) else eph for eph in (*old, *new)]
    age_s = np.abs(t_ns[:, None] - np.array([eph.toe_ns for eph in sets])) / NS_PER_S  # (T, 2n)
    beyond_h = np.maximum(age_s - np.array([eph.fit_half_s for eph in sets]), 0.0) / 3600.0
    kepler = np.array([isinstance(eph, KeplerEphemeris) for eph in sets])
    states = satellite_states(sets, np.where(kepler | (beyond_h == 0.0), np.arange(2 * n), -1), t_ns)
    before, after = states.pos_ecef_m[..., :n], states.pos_ecef_m[..., n:]
    apart_m = np.sqrt(((after - before) ** 2).sum(axis=0))
    from_site = [np.sqrt(((place - site_ecef_m[:, None, None]) ** 2).sum(axis=0)) for place in (before, after)]
    range_m = from_site[1] - from_site[0] - SPEED_OF_LIGHT_MPS * (states.clock_s[:, n:] - states.clock_s[:, :n])
    promised_m = np.array([max(eph.accuracy_m or 0.0, URA_NOMINAL_M) for eph in sets])
    variance = promised_m**2 + (BEYOND_FIT_MPH * beyond_h) ** 2
    sigmas = np.maximum(apart_m, np.abs(range_m)) / np.sqrt(variance[:, :n] + variance[:, n:])
    change = np.where(np.isnan(sigmas), -1.0, sigmas).max(axis=0)
    same = np.array([_identity(a) == _identity(b) for a, b in zip(old, new, strict=True)], dtype=np.bool_)
    reissued_m = np.where(same, np.maximum(apart_m, np.abs(range_m))[NOW], 0.0)
    return Comparison(np.where(change < 0.0, nan, change), range_m[NOW], apart_m[NOW], reissued_m)


def _identity(eph: Ephemeris) -> tuple[str, int, int, int]:
    """What names a set: issues come round, and of BeiDou stay the same from hour to hour."""
    return message_of(eph), eph.issue, eph.toe_ns, eph.toc_ns if isinstance(eph, KeplerEphemeris) else eph.toe_ns


def off_nominal(eph: Ephemeris) -> float:
    """How far a set's orbit is from the nearest one of its system: the worst element in tolerances, at most 1 where it may be."""
    elements = _elements(eph)
    families = OF_BEIDOU_GEOSTATIONARY if eph.satellite in GEOSTATIONARY else FAMILIES[eph.satellite[0]]
    return min(max(abs(x - centre) / tolerance for x, (centre, tolerance) in zip(elements, family, strict=True)) for family in families)


def _elements(eph: Ephemeris) -> tuple[float, float, float]:
    """Semi-major axis in km, eccentricity, inclination in degrees; of a state vector the osculating ones of a point-mass Earth."""
    if isinstance(eph, KeplerEphemeris):
        return eph.sqrt_a**2 / 1e3, eph.e, degrees(abs(eph.i0))
    x, y, z = eph.x_m, eph.y_m, eph.z_m
    vx, vy, vz = eph.vx_mps - EARTH_ROTATION_RADPS * y, eph.vy_mps + EARTH_ROTATION_RADPS * x, eph.vz_mps
    hx, hy, hz = y * vz - z * vy, z * vx - x * vz, x * vy - y * vx
    r, h, mu = hypot(x, y, z), hypot(hx, hy, hz), GPS_MU_M3PS2
    inverse_a = 2.0 / r - (vx * vx + vy * vy + vz * vz) / mu
    e = hypot(h * h / (mu * r) - 1.0, (x * vx + y * vy + z * vz) / r * h / mu)
    return 1e-3 / inverse_a if inverse_a > 0.0 else inf, e, degrees(atan2(hypot(hx, hy), hz))


def message_of(eph: Ephemeris) -> str:
    """The name of the message that says a set: a satellite may send several."""
    return eph.message if isinstance(eph, KeplerEphemeris) else type(eph).__name__
