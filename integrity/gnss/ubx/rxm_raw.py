"""RXM-RAW: the measurements of one epoch from receivers of generations before 8, as an `ObservationRow`. L1 C/A only.

Header of 8 bytes: time of week in ms, full week number, count, reserved. Then 24 bytes for each satellite. How long the carrier has been
tracked is not said. A quantity that the receiver does not vouch for, or that lies outside of its range, is NaN; a measurement with
neither range nor carrier is left out.
Source: u-blox 6 protocol specification, RXM-RAW. The loss of lock indicator is that of RINEX: bit 0, a possible cycle slip; bit 1, a
possible half cycle (RINEX 3.05, 6.5). Seen on a u-blox 5: whole milliseconds one short of the second, a new carrier that is zero.
"""

import struct

import numpy as np

from integrity.gnss.gps_time import WEEK_NS, WEEK_S
from integrity.gnss.observations import ObservationRow
from integrity.gnss.ubx.identifiers import satellite_before_8
from integrity.gnss.ubx.plausible import (
    LAST_WEEK,
    LEAST_RANGE_M,
    MOST_CARRIER_CYCLES,
    MOST_CN0_DBHZ,
    MOST_DOPPLER_HZ,
    MOST_RANGE_M,
)

RXM_RAW = (0x02, 0x10)
RAW_HEADER = struct.Struct("<ihBx")  # iTOW ms, week, numSV
RAW_DTYPE = np.dtype(
    [
        ("cp_cycles", "<f8"),
        ("pr_m", "<f8"),
        ("do_hz", "<f4"),
        ("sv", "u1"),
        ("mes_qi", "i1"),
        ("cno_dbhz", "i1"),
        ("lli", "u1"),
    ]
)
FIRST_WEEK = 1200  # January 2003, before the first receiver with this message. Week 0: the receiver does not know the time yet
NS_PER_MS = 1_000_000
RANGE_KNOWN, CARRIER_KNOWN, CARRIER_KEPT = 4, 5, 6  # from these quality indicators on; the last: since the measurement before
LOST_LOCK, HALF_CYCLE = 1, 2  # bits of lli


def decode_raw(payload: bytes, receiver: str) -> ObservationRow | None:
    """The row of a payload of RXM-RAW; None where length, time or names are wrong. Nothing is raised, whatever the bytes."""
    time_ns = _receive_time_ns(payload)
    if time_ns is None:
        return None
    m = np.frombuffer(payload, RAW_DTYPE, offset=RAW_HEADER.size)
    names = [satellite_before_8(sv) for sv in m["sv"].tolist()]
    satellites = [name for name in names if name is not None]
    if len(set(satellites)) != len(satellites):
        return None
    m = m[[name is not None for name in names]]
    most_m = np.array([MOST_RANGE_M[satellite[0]] for satellite in satellites])
    pr_known = (m["pr_m"] >= LEAST_RANGE_M) & (m["pr_m"] <= most_m) & (m["mes_qi"] >= RANGE_KNOWN)
    cp_known = (np.abs(m["cp_cycles"]) <= MOST_CARRIER_CYCLES) & (m["cp_cycles"] != 0.0) & (m["mes_qi"] >= CARRIER_KNOWN)
    do_known = (np.abs(m["do_hz"]) <= MOST_DOPPLER_HZ) & (m["mes_qi"] >= RANGE_KNOWN)
    cn0_known = (m["cno_dbhz"] >= 0) & (m["cno_dbhz"] <= MOST_CN0_DBHZ)
    kept = pr_known | cp_known
    return ObservationRow(
        receiver,
        time_ns,
        tuple(f"{satellite}.1C" for satellite, keep in zip(satellites, kept.tolist(), strict=True) if keep),
        pseudorange_m=np.where(pr_known, m["pr_m"], np.nan)[kept],
        carrier_cycles=np.where(cp_known, m["cp_cycles"], np.nan)[kept],
        doppler_hz=np.where(do_known, m["do_hz"], np.float32(np.nan))[kept].astype(np.float64),  # to widen a signalling NaN warns
        cn0_dbhz=np.where(cn0_known, m["cno_dbhz"].astype(np.float64), np.nan)[kept],
        lock_s=np.full(np.count_nonzero(kept), np.nan),
        slip=((m["lli"] & LOST_LOCK != 0) | (m["mes_qi"] < CARRIER_KEPT))[kept],
        half_cycle=((m["lli"] & HALF_CYCLE != 0) & cp_known)[kept],
    )


def _receive_time_ns(payload: bytes) -> int | None:
    """GPS time of an epoch; None where length, week or time of week are wrong."""
    if len(payload) < RAW_HEADER.size:
        return None
    tow_ms, week, n = RAW_HEADER.unpack_from(payload)
    if len(payload) != RAW_HEADER.size + n * RAW_DTYPE.itemsize:
        return None
    if not (0 <= tow_ms < WEEK_S * 1000 and FIRST_WEEK <= week <= LAST_WEEK):
        return None
    return int(week * WEEK_NS + tow_ms * NS_PER_MS)
