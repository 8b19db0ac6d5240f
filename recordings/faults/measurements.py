"""Changed measurements written back into the RXM-RAWX that they came from.

Every signal of a known satellite takes the values of its row; what no row has (systems and signals that are passed over) stays.
Source of the layout: u-blox F9 HPG 1.51 interface description, UBX-RXM-RAWX and "Signal identifiers".
"""

from collections.abc import Mapping
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from integrity.gnss.gps_time import NS_PER_S, WEEK_S
from integrity.gnss.observations import Bools, Floats, Ints, ObservationRow
from integrity.gnss.ubx.identifiers import signal_of
from integrity.gnss.ubx.rawx import RAWX_DTYPE, RAWX_HEADER

MOST_CN0_DBHZ = 63.0  # six bits in the receiver

Measurements = NDArray[np.void]  # of RAWX_DTYPE


def rewritten(own: bytes, source: bytes, was: ObservationRow, now: ObservationRow, later_ns: int) -> bytes:
    """The payload with the measurements of `source` as they are `now`, where they decode to `was`, under the time of `own`, so much later.

    What is the same in `was` and `now` keeps its bytes.
    """
    m = np.frombuffer(source, RAWX_DTYPE, offset=RAWX_HEADER.size).copy()
    place_of = _places(m["gnss_id"].tobytes(), m["sv_id"].tobytes(), m["sig_id"].tobytes())
    column_of = {signal: column for column, signal in enumerate(was.signals)}
    columns = np.array([column_of[signal] for signal in now.signals], dtype=np.int64)
    places = np.array([place_of[signal] for signal in now.signals], dtype=np.int64)
    _write(m, "pr_m", places, was.pseudorange_m[columns], now.pseudorange_m)
    _write(m, "cp_cycles", places, was.carrier_cycles[columns], now.carrier_cycles)
    _write(m, "do_hz", places, was.doppler_hz[columns], now.doppler_hz)
    _write(m, "cno_dbhz", places, was.cn0_dbhz[columns], np.clip(np.round(now.cn0_dbhz), 0.0, MOST_CN0_DBHZ))
    slipped = now.slip & ~was.slip[columns]
    _write(m, "locktime_ms", places, 1e3 * was.lock_s[columns], np.where(slipped, 0.0, np.round(1e3 * now.lock_s)))
    kept = np.ones(len(m), dtype=np.bool_)
    kept[[place_of[signal] for signal in column_of.keys() - set(now.signals)]] = False
    tow_s, week, leap_s, _, state, version = RAWX_HEADER.unpack_from(own)
    weeks, tow_s = divmod(tow_s + later_ns / NS_PER_S, WEEK_S) if later_ns else (0, tow_s)
    header = bytearray(own[: RAWX_HEADER.size])
    RAWX_HEADER.pack_into(header, 0, tow_s, week + int(weeks), leap_s, int(kept.sum()), state, version)
    header[-2:] = own[RAWX_HEADER.size - 2 : RAWX_HEADER.size]  # reserved
    return bytes(header) + m[kept].tobytes()


@lru_cache(maxsize=1024)
def _places(gnss_ids: bytes, sv_ids: bytes, sig_ids: bytes) -> Mapping[str, int]:
    """Where signals stand among the measurements of an epoch."""
    named = (signal_of(*identity) for identity in zip(gnss_ids, sv_ids, sig_ids, strict=True))
    return {signal: place for place, signal in enumerate(named) if signal is not None}


def _write(m: Measurements, field: str, places: Ints, was: Floats, now: Floats) -> None:
    differs: Bools = (was != now) & np.isfinite(now)
    m[field][places[differs]] = now[differs]
