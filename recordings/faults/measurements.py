"""Changed measurements written back into the RXM-RAWX that they came from.

What decisions use (civil L1 codes of GPS and Galileo) takes the values of the row. Other signals of the same satellites (L2, L5, E5, E6)
are shifted alike: their code by the same metres, carrier and Doppler by these over their own wavelength, and their lock is lost together
with that on L1. That the ionosphere differs with frequency is left out: its change between two antennas is centimetres. Jamming
acts on what decisions use alone, and satellites of other systems stay as they are: without ephemeris they have no known direction.
Source of the layout: u-blox F9 HPG 1.51 interface description, UBX-RXM-RAWX and "Signal identifiers".
"""

from collections.abc import Mapping, Sequence
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from integrity.gnss.constants import SPEED_OF_LIGHT_MPS
from integrity.gnss.observations import Bools, Floats, Ints, ObservationRow
from integrity.gnss.signals import satellite_of
from integrity.gnss.ubx.rawx import CP_VALID, L1_SIGNALS, PR_VALID, RAWX_DTYPE, RAWX_HEADER
from recordings.faults.truth import RangeChange

SYSTEM_OF = {0: "G", 2: "E"}  # by gnssId
OTHER_SIGNALS_HZ = {  # by gnssId and sigId; IS-GPS-200 and IS-GPS-705, Galileo OS SIS ICD, table 2
    **{(0, sig_id): 1_227.60e6 for sig_id in (3, 4)},  # L2 CL, CM
    **{(0, sig_id): 1_176.45e6 for sig_id in (6, 7)},  # L5 I, Q
    **{(2, sig_id): 1_176.45e6 for sig_id in (3, 4)},  # E5a I, Q
    **{(2, sig_id): 1_207.14e6 for sig_id in (5, 6)},  # E5b I, Q
    **{(2, sig_id): 1_278.75e6 for sig_id in (8, 9, 10)},  # E6 B, C, A
}
MOST_CN0_DBHZ = 63.0  # six bits in the receiver

Measurements = NDArray[np.void]  # of RAWX_DTYPE


def rewritten(own: bytes, source: bytes, was: ObservationRow, now: ObservationRow, change: RangeChange | None) -> bytes:
    """The payload with the measurements of `source` as they are `now`, where they decode to `was`, under the time of `own`.

    `change` is by how much ranges of `was` were moved by all faults together. What is the same in `was` and `now` keeps its bytes.
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
    if change is not None:
        _move_others(m, was.signals, change)
        _unlock_others(m, now.signals, was.lock_s[columns], m["locktime_ms"][places])
    kept = np.ones(len(m), dtype=np.bool_)
    kept[[place_of[signal] for signal in column_of.keys() - set(now.signals)]] = False
    tow_s, week, leap_s, _, state, version = RAWX_HEADER.unpack_from(own)
    header = bytearray(own[: RAWX_HEADER.size])
    RAWX_HEADER.pack_into(header, 0, tow_s, week, leap_s, int(kept.sum()), state, version)
    header[-2:] = own[RAWX_HEADER.size - 2 : RAWX_HEADER.size]  # reserved
    return bytes(header) + m[kept].tobytes()


@lru_cache(maxsize=1024)
def _places(gnss_ids: bytes, sv_ids: bytes, sig_ids: bytes) -> Mapping[str, int]:
    """Where the signals that decisions use stand among the measurements of an epoch."""
    found: dict[str, int] = {}
    for place, (gnss_id, sv_id, sig_id) in enumerate(zip(gnss_ids, sv_ids, sig_ids, strict=True)):
        known = L1_SIGNALS.get((gnss_id, sig_id))
        if known is not None:
            found[f"{known[0]}{sv_id:02d}.{known[2]}"] = place
    return found


def _write(m: Measurements, field: str, places: Ints, was: Floats, now: Floats) -> None:
    differs: Bools = (was != now) & np.isfinite(now)
    m[field][places[differs]] = now[differs]


def _others(m: Measurements) -> list[tuple[int, str, float]]:
    """Place, satellite and carrier frequency of measurements that decisions do not use."""
    identities = zip(m["gnss_id"].tolist(), m["sv_id"].tolist(), m["sig_id"].tolist(), strict=True)
    return [
        (place, f"{SYSTEM_OF[gnss_id]}{sv_id:02d}", OTHER_SIGNALS_HZ[gnss_id, sig_id])
        for place, (gnss_id, sv_id, sig_id) in enumerate(identities)
        if (gnss_id, sig_id) in OTHER_SIGNALS_HZ
    ]


def _move_others(m: Measurements, signals: Sequence[str], change: RangeChange) -> None:
    moved = {
        satellite_of(signal): (delta_m, rate_mps)
        for signal, delta_m, rate_mps in zip(signals, change.delta_m.tolist(), change.rate_mps.tolist(), strict=True)
        if delta_m or rate_mps
    }
    for place, satellite, frequency_hz in _others(m):
        if satellite in moved:
            delta_m, rate_mps = moved[satellite]
            valid, wavelength_m = int(m["trk_stat"][place]), SPEED_OF_LIGHT_MPS / frequency_hz
            if valid & PR_VALID:
                m["pr_m"][place] += delta_m
            if valid & CP_VALID:
                m["cp_cycles"][place] += delta_m / wavelength_m
            if valid & (PR_VALID | CP_VALID):
                m["do_hz"][place] -= rate_mps / wavelength_m


def _unlock_others(m: Measurements, signals: Sequence[str], was_lock_s: Floats, now_lock_ms: Ints) -> None:
    lost = {satellite_of(s): int(ms) for s, was_s, ms in zip(signals, was_lock_s, now_lock_ms, strict=True) if ms < round(1e3 * was_s)}
    for place, satellite, _ in _others(m):
        if satellite in lost:
            m["locktime_ms"][place] = min(int(m["locktime_ms"][place]), lost[satellite])
