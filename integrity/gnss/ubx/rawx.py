"""RXM-RAWX, versions 0 and 1: the measurements of one epoch, as an `ObservationRow`.

All signals that `identifiers` knows are taken, carrier and Doppler in the cycles of each signal's own frequency. A quantity that the
receiver does not vouch for, or that lies outside of its range, is NaN; a measurement with neither range nor carrier is left out. What a
row has no place for: the receiver's own standard deviations, and the channel of GLONASS, which the ephemeris has too.
Sources: u-blox F9 HPG 1.51 interface description, UBX-RXM-RAWX; u-blox 8 / M8 protocol specification.
"""

import struct
from collections.abc import Sequence
from functools import lru_cache
from itertools import compress
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from integrity.gnss.gps_time import WEEK_S, gps_from_week
from integrity.gnss.observations import Bools, Floats, ObservationRow
from integrity.gnss.ubx.identifiers import SIGNALS, signal_of
from integrity.gnss.ubx.plausible import (
    LAST_WEEK,
    LEAST_RANGE_M,
    MOST_CARRIER_CYCLES,
    MOST_CN0_DBHZ,
    MOST_DOPPLER_HZ,
    MOST_LOCK_S,
    MOST_RANGE_M,
)

Indices = NDArray[np.intp]

RXM_RAWX = (0x02, 0x15)
RAWX_HEADER = struct.Struct("<dHbBBB2x")  # rcvTow s, week, leapS s, numMeas, recStat, version
_FIELDS = (
    ("pr_m", "<f8"),
    ("cp_cycles", "<f8"),
    ("do_hz", "<f4"),
    ("gnss_id", "u1"),
    ("sv_id", "u1"),
    ("sig_id", "u1"),
    ("freq_id", "u1"),
    ("locktime_ms", "<u2"),
    ("cno_dbhz", "u1"),
    ("pr_stdev", "u1"),
    ("cp_stdev", "u1"),
    ("do_stdev", "u1"),
    ("trk_stat", "u1"),
    ("reserved", "u1"),
)
RAWX_DTYPE = np.dtype(list(_FIELDS))
_SIZE = {name: np.dtype(kind).itemsize for name, kind in _FIELDS}
_OFFSET = {name: sum(_SIZE[before] for before, _ in _FIELDS[:i]) for i, (name, _) in enumerate(_FIELDS)}
LAST_VERSION = 1

PR_VALID, CP_VALID, HALF_CYCLE_RESOLVED = 1, 2, 4  # bits of trkStat

_IDENTITY = tuple(  # of all measurements of a payload: their gnssId, svId, sigId
    slice(RAWX_HEADER.size + _OFFSET[field], None, RAWX_DTYPE.itemsize) for field in ("gnss_id", "sv_id", "sig_id")
)

FIRST_WEEK = 1700  # August 2012, before RXM-RAWX existed. Week 0: the receiver does not know the time yet

# What a byte of cno, a count of locktime and a gnssId mean; and a byte of trkStat, of range, carrier, half cycle.
CN0_DBHZ = np.where(np.arange(256) <= MOST_CN0_DBHZ, np.arange(256.0), np.nan)
LOCK_S = np.where(np.arange(65536) / 1000.0 <= MOST_LOCK_S, np.arange(65536) / 1000.0, np.nan)
_BYTES = np.arange(256)
_TRACKED = np.stack((_BYTES & PR_VALID != 0, _BYTES & CP_VALID != 0, _BYTES & (CP_VALID | HALF_CYCLE_RESOLVED) == CP_VALID))
MOST_RANGE_OF_GNSS_M = np.full(256, np.nan)
for (_gnss, _), _known in SIGNALS.items():
    MOST_RANGE_OF_GNSS_M[_gnss] = MOST_RANGE_M[_known.system]
# A bound as an array: for a few measurements, numpy takes longer to look at a number of Python than to compare.
_LEAST_RANGE_M, _MOST_CARRIER_CYCLES, _NO_LOCK_S = np.array(LEAST_RANGE_M), np.array(MOST_CARRIER_CYCLES), np.array(0.0)
_MOST_DOPPLER_HZ = np.array(MOST_DOPPLER_HZ, dtype=np.float32)
_F8, _F4, _U2, _U1 = (np.dtype(kind) for kind in ("<f8", "<f4", "<u2", "u1"))


class _Places(NamedTuple):
    """Where the quantities of the measurements taken stand, each in units of its own size."""

    pr: Indices
    cp: Indices
    do: Indices
    locktime: Indices
    cno: Indices
    trk_stat: Indices


class _Layout(NamedTuple):
    """Which measurements of an epoch are taken, their names, where their quantities stand, and how long their ranges can be."""

    signals: tuple[str, ...]
    taken: Indices
    places: _Places
    most_range_m: Floats


class _Columns(NamedTuple):
    """The arrays of an `ObservationRow`, (n,) each, in its order."""

    pseudorange_m: Floats
    carrier_cycles: Floats
    doppler_hz: Floats
    cn0_dbhz: Floats
    lock_s: Floats
    slip: Bools
    half_cycle: Bools


def decode_rawx(payloads: Sequence[bytes], receiver: str) -> list[ObservationRow | None]:
    """One row for each payload of RXM-RAWX; None where length, version, time or names are wrong. Nothing is raised, whatever the bytes.

    A row may hold no signal: the receiver knows the time and tracks nothing that is taken.
    """
    rows: list[ObservationRow | None] = [None] * len(payloads)
    sound: list[tuple[int, int, _Layout]] = []
    for i, payload in enumerate(payloads):
        time_ns = _receive_time_ns(payload)
        layout = None if time_ns is None else _layout_of(*[payload[part] for part in _IDENTITY])
        if time_ns is not None and layout is not None:
            sound.append((i, time_ns, layout))
    if not sound:
        return rows
    columns, kept = _columns(*_joined([payloads[i] for i, _, _ in sound], [layout for _, _, layout in sound]))
    end = 0
    for i, time_ns, (signals, *_) in sound:
        begin, end = end, end + len(signals)
        mine = columns if len(sound) == 1 else _Columns._make([column[begin:end] for column in columns])
        if kept is not None:
            signals, mine = _only(kept[begin:end], signals, mine)
        rows[i] = ObservationRow(receiver, time_ns, signals, *mine)
    return rows


def _receive_time_ns(payload: bytes) -> int | None:
    """GPS time of an epoch; None where length, version, week or time of week are wrong."""
    if len(payload) < RAWX_HEADER.size:
        return None
    tow_s, week, _, n, _, version = RAWX_HEADER.unpack_from(payload)
    if len(payload) != RAWX_HEADER.size + n * RAWX_DTYPE.itemsize or version > LAST_VERSION:
        return None
    if not (0.0 <= tow_s < WEEK_S and FIRST_WEEK <= week <= LAST_WEEK):
        return None
    return gps_from_week(week, tow_s)


@lru_cache(maxsize=1024)
def _layout_of(gnss_ids: bytes, sv_ids: bytes, sig_ids: bytes) -> _Layout | None:
    """What is taken of an epoch with these identities; None where a signal stands twice."""
    taken: dict[str, int] = {}
    for i, (gnss_id, sv_id, sig_id) in enumerate(zip(gnss_ids, sv_ids, sig_ids, strict=True)):
        signal = signal_of(gnss_id, sv_id, sig_id)
        if signal in taken:
            return None
        if signal is not None:
            taken[signal] = i
    index = np.array(list(taken.values()), dtype=np.intp)
    return _Layout(tuple(taken), index, _places(index), MOST_RANGE_OF_GNSS_M[[gnss_ids[i] for i in index]])


def _places(taken: Indices) -> _Places:
    def place(field: str) -> Indices:
        return (taken * RAWX_DTYPE.itemsize + _OFFSET[field]) // _SIZE[field]

    fields = ("pr_m", "cp_cycles", "do_hz", "locktime_ms", "cno_dbhz", "trk_stat")
    return _Places._make([place(field) for field in fields])


def _joined(payloads: list[bytes], layouts: list[_Layout]) -> tuple[bytes, _Places, Floats]:
    """The measurements of the epochs one after the other, where what is taken of them stands, and how long its ranges can be."""
    measurements = [payload[RAWX_HEADER.size :] for payload in payloads]
    if len(payloads) == 1:
        return measurements[0], layouts[0].places, layouts[0].most_range_m
    first = np.cumsum([0] + [len(m) // RAWX_DTYPE.itemsize for m in measurements[:-1]])
    taken = np.concatenate([layout.taken for layout in layouts])
    places = _places(taken + np.repeat(first, [len(layout.taken) for layout in layouts]))
    return b"".join(measurements), places, np.concatenate([layout.most_range_m for layout in layouts])


def _columns(measurements: bytes, places: _Places, most_range_m: Floats) -> tuple[_Columns, Bools | None]:
    """The quantities, NaN where not vouched for or out of range; and which have a range or a carrier, None where all have."""
    as_f8, as_u1 = np.frombuffer(measurements, _F8), np.frombuffer(measurements, _U1)
    pr_valid, cp_valid, half_cycle = _TRACKED.take(as_u1[places.trk_stat], axis=1)
    pr_m = as_f8[places.pr]
    pr_known = (pr_m >= _LEAST_RANGE_M) & (pr_m <= most_range_m) & pr_valid
    cp_cycles = as_f8[places.cp]
    cp_known = (np.abs(cp_cycles) <= _MOST_CARRIER_CYCLES) & cp_valid
    do_hz = np.frombuffer(measurements, _F4)[places.do]
    do_known = np.abs(do_hz) <= _MOST_DOPPLER_HZ
    for values, known in ((pr_m, pr_known), (cp_cycles, cp_known), (do_hz, do_known)):
        if np.count_nonzero(known) != len(known):
            values[~known] = np.nan
    lock_s = LOCK_S.take(np.frombuffer(measurements, _U2)[places.locktime])
    kept = pr_known | cp_known
    columns = _Columns(
        pseudorange_m=pr_m,
        carrier_cycles=cp_cycles,
        doppler_hz=do_hz.astype(np.float64),  # after blanking: to widen a signalling NaN warns
        cn0_dbhz=CN0_DBHZ.take(as_u1[places.cno]),
        lock_s=lock_s,
        slip=lock_s == _NO_LOCK_S,
        half_cycle=half_cycle,
    )
    return columns, None if np.count_nonzero(kept) == len(kept) else kept


def _only(kept: Bools, signals: tuple[str, ...], columns: _Columns) -> tuple[tuple[str, ...], _Columns]:
    return tuple(compress(signals, kept)), _Columns._make([column[kept] for column in columns])
