"""The ionospheric grid points (IGPs), and what types 18 and 26 have told of them.

An IGP is a node (latitude, longitude) of a lattice of 5 degrees, whatever band names it: bands 0 to 8 stand upright, 9 and 10 lie around
the poles, and some places are in two of them. Source: RTCA DO-229D, A.4.4.9 and A.4.4.10, tables A-14 to A-17.
"""

from typing import NamedTuple

import numpy as np

from integrity.gnss.observations import Floats, Ints
from integrity.gnss.sbas.contents import IonoDelays, IonoMask
from integrity.gnss.sbas.messages import IGPS_OF_BLOCK

STEP_DEG, SOUTH_DEG, WEST_DEG = 5, -85, -180
NODES = (35, 72)  # latitudes from -85, longitudes from -180
NEVER = -(2**62)

# Variance of the vertical delay at an IGP, m2, by GIVEI 0 to 14; 15: not monitored. Table A-17.
GIVE_VARIANCE_M2 = (
    *(0.0084, 0.0333, 0.0749, 0.1331, 0.2079, 0.2994, 0.4075, 0.5322, 0.6735, 0.8315, 1.1974, 1.8709, 3.3260, 20.7870),
    187.0826,
)
NOT_MONITORED = 15
SILENT, GOOD, DO_NOT_USE = 0, 1, 2  # status of a node

_LOW = tuple(range(-55, 60, 5))  # of every column; each second one goes on in steps of 10
_HIGH = (-75, -65, *_LOW, 65, 75)
_WITH_NORTH, _WITH_SOUTH = (-180, -90, 0, 90), (-140, -50, 40, 130)  # columns that reach 85 degrees


def igps_of(band: int) -> tuple[tuple[int, int], ...]:
    """Latitude and longitude, degrees, of the IGPs of a band, in order. Table A-14."""
    if band <= 8:
        columns = range(WEST_DEG + 40 * band, WEST_DEG + 40 * band + 40, 5)
        return tuple((lat, lon) for lon in columns for lat in _latitudes(lon))
    side, first = (1, -180) if band == 9 else (-1, -170)
    rows = [(side * 60, range(-180, 180, 5))] + [(side * lat, range(-180, 180, 10)) for lat in (65, 70, 75)]
    return tuple((lat, lon) for lat, longitudes in [*rows, (side * 85, range(first, 180, 30))] for lon in longitudes)


def _latitudes(lon: int) -> tuple[int, ...]:
    if lon % 10:
        return _LOW
    return (*((-85,) if lon in _WITH_SOUTH else ()), *_HIGH, *((85,) if lon in _WITH_NORTH else ()))


def node_of(lat_deg: Ints, lon_deg: Ints) -> Ints:
    """Index of a node into a lattice that is laid out flat; -1 beyond 85 degrees."""
    row = (lat_deg - SOUTH_DEG) // STEP_DEG
    column = (lon_deg - WEST_DEG) // STEP_DEG % NODES[1]
    index: Ints = np.where((row >= 0) & (row < NODES[0]), row * NODES[1] + column, -1)
    return index


_NODES_OF = tuple(node_of(*np.array(igps_of(band), dtype=np.int64).T) for band in range(11))


class Grid(NamedTuple):
    """The lattice as flat arrays of NODES plus one: the last is a node that does not exist. None of them is changed any more.

    `mask_ns`: when the mask that has the node was received; `received_ns`, `sent_ns`: of its delay (NEVER: not yet).
    """

    mask_ns: Ints
    status: Ints
    delay_m: Floats
    variance_m2: Floats
    sent_ns: Ints
    received_ns: Ints


def empty() -> Grid:
    """Nothing has arrived."""
    n = NODES[0] * NODES[1] + 1
    never = np.full(n, NEVER, dtype=np.int64)
    return Grid(never, np.zeros(n, dtype=np.int64), np.zeros(n), np.zeros(n), never, never)


class _Mask(NamedTuple):
    """Nodes of a band under one IODI."""

    nodes: Ints
    bands: int
    received_ns: int


class GridStore:
    """What has arrived of the grid of one SBAS.

    A band is used with the mask of the IODI whose delays came last. So while a new IODI is being sent, bands whose delays still have the
    old one go on with it, and delays of an IODI whose mask is not here are passed over (A.4.4.9). Bands that a new, complete set of masks
    no longer has end with the first delays under it. Delays that come before the mask of their IODI wait for it.
    """

    def __init__(self) -> None:
        self.grid = empty()
        self._masks: dict[tuple[int, int], _Mask] = {}  # by IODI and band
        self._serving: dict[int, int] = {}  # IODI by band
        self._waiting: dict[tuple[int, int, int], tuple[IonoDelays, int, int]] = {}  # by IODI, band and block

    def add_mask(self, mask: IonoMask, received_ns: int) -> None:
        """Type 18."""
        iodi, band = mask.iodi, mask.band
        nodes = _NODES_OF[band][[igp - 1 for igp in mask.igps]]
        self._masks[iodi, band] = _Mask(nodes, mask.bands, received_ns)
        self._masks.pop(((iodi + 2) % 4, band), None)  # two issues are enough, and a number comes back one day
        served = self._serving.get(band)
        if served is None or (served, band) not in self._masks:
            self._serving[band] = iodi
        self._mark()
        for key in [key for key in self._waiting if key[:2] == (iodi, band)]:
            self.add_delays(*self._waiting.pop(key))

    def add_delays(self, delays: IonoDelays, sent_ns: int, received_ns: int) -> None:
        """Type 26."""
        mask = self._masks.get((delays.iodi, delays.band))
        if mask is None:
            self._waiting[delays.iodi, delays.band, delays.block] = (delays, sent_ns, received_ns)
            return
        if self._serving.get(delays.band) != delays.iodi:
            self._serving[delays.band] = delays.iodi
            self._end_bands_that_left(delays.iodi, mask.bands)
            self._mark()
        nodes = mask.nodes[IGPS_OF_BLOCK * delays.block : IGPS_OF_BLOCK * (delays.block + 1)]
        n = len(nodes)
        before = self.grid
        status, sent, received = before.status.copy(), before.sent_ns.copy(), before.received_ns.copy()
        delay_m, variance_m2 = before.delay_m.copy(), before.variance_m2.copy()
        status[nodes] = [_status(d, g) for d, g in zip(delays.delay_m[:n], delays.givei[:n], strict=True)]
        delay_m[nodes] = [0.0 if d is None else d for d in delays.delay_m[:n]]
        variance_m2[nodes] = [0.0 if g == NOT_MONITORED else GIVE_VARIANCE_M2[g] for g in delays.givei[:n]]
        sent[nodes], received[nodes] = sent_ns, received_ns
        self.grid = Grid(before.mask_ns, status, delay_m, variance_m2, sent, received)

    def _end_bands_that_left(self, iodi: int, bands: int) -> None:
        new = {band for i, band in self._masks if i == iodi}
        if len(new) >= bands:
            self._serving = {band: i for band, i in self._serving.items() if band in new}

    def _mark(self) -> None:
        """Write the masks that serve into a new grid."""
        mask_ns = np.full_like(self.grid.mask_ns, NEVER)
        for band, iodi in self._serving.items():
            nodes, _, received_ns = self._masks[iodi, band]
            mask_ns[nodes] = np.maximum(mask_ns[nodes], received_ns)
        self.grid = self.grid._replace(mask_ns=mask_ns)


def _status(delay_m: float | None, givei: int) -> int:
    if delay_m is None:
        return DO_NOT_USE
    return SILENT if givei == NOT_MONITORED else GOOD
