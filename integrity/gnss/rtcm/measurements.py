"""The measurements of one epoch from all its MSM messages.

The bits of all cells are fetched in one go. Where they stand and what they mean follows from the masks, which seldom change: it is
remembered. Sources as of `msm`.
"""

from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from integrity.gnss.constants import SPEED_OF_LIGHT_MPS
from integrity.gnss.observations import Bools, Floats, Ints
from integrity.gnss.rtcm.msm import (
    CELL_FIELDS,
    CHANNELS_SENT,
    FINE_RATE,
    FIRST_CHANNEL,
    NO_CHANNEL,
    NO_CN0,
    NO_WHOLE_MS,
    RATE,
    SATELLITE_FIELDS,
    Masks,
    contents_of,
    none_of,
)
from integrity.gnss.signals import bands_of, carrier_hz

# Fetched of each cell, in this order; the first four from its satellite.
_FETCHED = ("whole_ms", "channel", "part_ms", "rate_mps", "range_ms", "phase_ms", "lock", "half_cycle", "cn0_dbhz", "fine_rate_mps")
_PART_MS = 2.0**-10
_FINE_RATES = 10_000  # in 1 m/s

LEAST_WHOLE_MS = 33  # nearer than 10,000 km there is no satellite; some senders write zeros where they have no range
LOCK_INDICATORS = 705  # of DF407; the rest is reserved


def _least_lock_s() -> list[float]:
    """Least time of lock by indicator, of DF407 (RTCM 10403.3, table 3.5-75), where the step doubles every 32."""
    doubled = [(i, max(0, i // 32 - 1)) for i in range(LOCK_INDICATORS)]
    return [((i - 32 * k) << k) / 1000.0 for i, k in doubled]


LEAST_LOCK_S = {
    **dict.fromkeys((4, 5), np.array([0.0] + [2.0 ** (i + 4) / 1000.0 for i in range(1, 16)])),  # DF402, table 3.5-74
    **dict.fromkeys((6, 7), np.array(_least_lock_s())),
}
_LOCK_S = np.concatenate([LEAST_LOCK_S[7], np.full(1024 - LOCK_INDICATORS, np.nan), LEAST_LOCK_S[4]])
_SHORT_LOCK_FROM = 1024


class _Places(NamedTuple):
    """Where the fields of the known cells of one message stand, (10, n), no bits where there is no such field; and `_meaning`, (9, n)."""

    first: Ints
    width: Ints
    sign: Ints
    meaning: Floats


@lru_cache(maxsize=512)
def _places_of(masks: Masks) -> _Places:
    contents = contents_of(masks)
    named = dict(SATELLITE_FIELDS[masks.kind] + CELL_FIELDS[masks.kind])
    n = len(contents.signals)
    of_satellite, of_cell = np.array(contents.places, dtype=np.int64).reshape(n, 2).T
    first = np.zeros((len(_FETCHED), n), dtype=np.int64)
    width, sign = np.zeros_like(first), np.zeros_like(first)
    in_satellite = dict(SATELLITE_FIELDS[masks.kind])
    for row, name in enumerate(_FETCHED):
        if name in named:
            bits = named[name].bits
            first[row] = contents.begins.first[name] + bits * (of_satellite if name in in_satellite else of_cell)
            width[row] = bits
            sign[row] = 1 << bits - 1 if named[name].signed else 0
    meaning = [_meaning(signal, masks.kind) for signal in contents.signals]
    return _Places(first, width, sign, np.array(meaning, dtype=np.float64).reshape(n, 9).T)


@lru_cache(maxsize=4096)
def _meaning(signal: str, kind: int) -> tuple[float, ...]:
    """What the numbers of a cell mean, in the order of `_Layout` from `range_unit_ms` on."""
    named = dict(CELL_FIELDS[kind])
    range_ms, phase_ms = named["range_ms"], named["phase_ms"]
    first_hz, step_hz = carrier_hz(signal[0], bands_of(signal)[0]) or (np.nan, np.nan)
    return (
        range_ms.unit or np.nan,
        none_of(range_ms),
        phase_ms.unit or np.nan,
        none_of(phase_ms),
        _SHORT_LOCK_FROM if kind < 6 else 0,
        named["cn0_dbhz"].unit or np.nan,
        -1000.0 / (_FINE_RATES * SPEED_OF_LIGHT_MPS) if FINE_RATE[0] in named else np.nan,
        first_hz / 1000.0,
        step_hz / 1000.0,
    )


class _Layout(NamedTuple):
    """All known cells of an epoch: names, where their fields stand in its messages joined (10, n), what their numbers mean (n,)."""

    signals: tuple[str, ...]
    byte: NDArray[np.intp]
    shift: Ints
    ones: Ints
    sign: Ints
    range_unit_ms: Floats
    range_none: Floats
    phase_unit_ms: Floats
    phase_none: Floats
    lock_from: NDArray[np.intp]
    cn0_unit_dbhz: Floats
    doppler_unit: Floats  # hertz for 0.1 mm/s and 1 kHz of carrier; NaN where no rate is sent
    khz: Floats  # the carrier; of GLONASS that of channel 0
    khz_per_channel: Floats
    slot: NDArray[np.intp]  # of a GLONASS satellite, elsewhere 0
    no_channel: Ints  # NO_CHANNEL where the message has no such field, elsewhere 0


@lru_cache(maxsize=128)
def _layout_of(epoch: tuple[Masks, ...]) -> _Layout:
    places = [_places_of(masks) for masks in epoch]
    begins = np.cumsum([0] + [8 * masks.size for masks in epoch[:-1]])
    first = np.concatenate([p.first + begin for p, begin in zip(places, begins, strict=True)], axis=1)
    width = np.concatenate([p.width for p in places], axis=1)
    meaning = np.concatenate([p.meaning for p in places], axis=1)
    range_unit_ms, range_none, phase_unit_ms, phase_none, lock_from, cn0_unit_dbhz, doppler_unit, khz, khz_per_channel = meaning
    signals = tuple(signal for masks in epoch for signal in contents_of(masks).signals)
    return _Layout(
        signals,
        byte=(first // 8).astype(np.intp),
        shift=32 - first % 8 - width,
        ones=(1 << width) - 1,
        sign=np.concatenate([p.sign for p in places], axis=1),
        range_unit_ms=range_unit_ms,
        range_none=range_none,
        phase_unit_ms=phase_unit_ms,
        phase_none=phase_none,
        lock_from=lock_from.astype(np.intp),
        cn0_unit_dbhz=cn0_unit_dbhz,
        doppler_unit=doppler_unit,
        khz=khz,
        khz_per_channel=khz_per_channel,
        slot=np.array([int(s[1:3]) if s[0] == "R" else 0 for s in signals], dtype=np.intp),
        no_channel=np.where(width[_FETCHED.index("channel")] == 0, NO_CHANNEL, 0),
    )


class Measured(NamedTuple):
    """The cells of an epoch: arrays (n,), NaN where a quantity was not told.

    `slot` and `channel` are those of GLONASS satellites, the channel NaN where it is not known; elsewhere 0 and without meaning.
    """

    signals: tuple[str, ...]
    pseudorange_m: Floats
    carrier_cycles: Floats
    doppler_hz: Floats
    cn0_dbhz: Floats
    lock_s: Floats
    half_cycle: Bools
    slot: NDArray[np.intp]
    channel: Floats


def measured(messages: list[bytes], epoch: tuple[Masks, ...], channels: Floats) -> Measured:
    """The measurements of messages whose headers were right and which have no signal in common.

    `channels` (25,) by GLONASS slot, NaN where not known, serve where a message does not tell them: without, there is no carrier.
    """
    layout = _layout_of(epoch)
    whole_ms, sent, part, rate, fine_range, fine_phase, lock, half, cn0, fine_rate = _fetched(b"".join(messages), layout)
    sent = sent + layout.no_channel
    channel = np.where(sent < CHANNELS_SENT, sent + FIRST_CHANNEL, channels[layout.slot])
    khz = layout.khz + np.where(layout.slot > 0, channel * layout.khz_per_channel, 0.0)
    no_range = (whole_ms == NO_WHOLE_MS) | (whole_ms < LEAST_WHOLE_MS)
    rough_ms = whole_ms + part * _PART_MS
    pseudorange_m = (rough_ms + fine_range * layout.range_unit_ms) * (SPEED_OF_LIGHT_MPS / 1000.0)
    pseudorange_m[no_range | (fine_range == layout.range_none)] = np.nan
    carrier_cycles = (rough_ms + fine_phase * layout.phase_unit_ms) * khz
    carrier_cycles[no_range | (fine_phase == layout.phase_none)] = np.nan
    doppler_hz = (rate * _FINE_RATES + fine_rate) * layout.doppler_unit * khz
    doppler_hz[(rate == none_of(RATE[1])) | (fine_rate == none_of(FINE_RATE[1]))] = np.nan
    cn0_dbhz = cn0 * layout.cn0_unit_dbhz
    cn0_dbhz[cn0 == NO_CN0] = np.nan
    lock_s = _LOCK_S[lock + layout.lock_from]
    return Measured(layout.signals, pseudorange_m, carrier_cycles, doppler_hz, cn0_dbhz, lock_s, half == 1, layout.slot, channel)


def _fetched(data: bytes, layout: _Layout) -> Ints:
    """The numbers of all fields, (10, n): none is wider than 25 bits, so that each stands in the 32 bits from its first byte on."""
    words = np.ndarray((len(data) + 1,), dtype=">u4", buffer=data + bytes(4), strides=(1,))
    values = words[layout.byte].astype(np.int64) >> layout.shift & layout.ones
    return (values ^ layout.sign) - layout.sign
