"""RXM-RAWX of a whole log as blocks of arrays, without an object per epoch: what `rawx.decode_rawx` says of each, to the last bit.

Sources as there.
"""

from collections.abc import Iterator
from typing import NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from integrity.gnss.gps_time import NS_PER_S, WEEK_NS, WEEK_S
from integrity.gnss.observations import Bools, Floats, Ints, ObservationBlock
from integrity.gnss.signals import Codes, preference, satellite_of
from integrity.gnss.ubx.framing import FRAME_BYTES, HEADER_BYTES
from integrity.gnss.ubx.identifiers import EVERY_CODE, SIGNALS, signal_of
from integrity.gnss.ubx.located import Bytes, Located, kind_of
from integrity.gnss.ubx.plausible import LAST_WEEK, LEAST_RANGE_M, MOST_CARRIER_CYCLES, MOST_DOPPLER_HZ
from integrity.gnss.ubx.rawx import (
    CN0_DBHZ,
    CP_VALID,
    FIRST_WEEK,
    HALF_CYCLE_RESOLVED,
    LAST_VERSION,
    LOCK_S,
    MOST_RANGE_OF_GNSS_M,
    PR_VALID,
    RAWX_DTYPE,
    RAWX_HEADER,
    RXM_RAWX,
)

MOST_EPOCHS = 1024  # of a block
HEADER_DTYPE = np.dtype(
    [("tow_s", "<f8"), ("week", "<u2"), ("leap_s", "i1"), ("n", "u1"), ("state", "u1"), ("version", "u1"), ("reserved", "V2")]
)
Numbers = NDArray[np.intp]
_Kind = TypeVar("_Kind", bound=np.generic)
Measurements = NDArray[np.void]  # of as many bytes as RAWX_DTYPE, which is slow to copy

# gnssId takes the lowest 3 bits of a measurement's identity as read here, svId 8 and sigId 4; no signal has more.
GNSS_IDS, SV_IDS, SIG_IDS = 8, 256, 16


def _numbers() -> tuple[tuple[str, ...], Numbers]:
    """Every signal in the order of a block, and the number of the one that an identity names; the count of all where it names none."""
    named = {(gnss, sv, sig): signal_of(gnss, sv, sig) for (gnss, sig), s in SIGNALS.items() for sv in range(s.first, s.last + 1)}
    signals = tuple(sorted({signal for signal in named.values() if signal is not None}, key=preference))
    number_of = {signal: number for number, signal in enumerate(signals)}
    numbers = np.full((SIG_IDS, SV_IDS, GNSS_IDS), len(signals), dtype=np.intp)
    for (gnss, sv, sig), signal in named.items():
        if signal is not None:
            numbers[sig, sv, gnss] = number_of[signal]
    return signals, numbers.ravel()


ALL_SIGNALS, _NUMBER_OF_IDENTITY = _numbers()
NO_SIGNAL = len(ALL_SIGNALS)


class Epochs(NamedTuple):
    """Of each epoch the frame that it stands in, GPS time, place of its first measurement in the log, count of measurements; (E,) each."""

    frame: Ints
    receive_time_ns: Ints
    first: Ints
    measured: Ints


class _Taken(NamedTuple):
    """Measurements that are taken, with the epoch and the signal that each is of; (N,) each."""

    measurements: Measurements
    epoch: Ints
    signal: Numbers


def rawx_blocks(log: Bytes, frames: Located, receiver: str, codes: Codes = EVERY_CODE) -> Iterator[ObservationBlock]:
    """The epochs of a log with the frames that `locate` found in it, in their order, at most `MOST_EPOCHS` a block; signals of `codes`.

    Nominal time is the receiver's own. An epoch for which `decode_rawx` has no row is left out; nothing is raised, whatever the bytes.
    """
    wanted = np.array([*(s.partition(".")[2] in codes.get(s[0], ()) for s in ALL_SIGNALS), False])
    for epochs, taken in _parts(log, frames):
        if len(epochs.frame):
            yield _block(epochs, taken, receiver, wanted)


def rawx_epochs(log: Bytes, frames: Located) -> Epochs:
    """The epochs for which `decode_rawx` has a row, of a log with the frames that `locate` found in it, in their order."""
    parts = [epochs for epochs, _ in _parts(log, frames)]
    none = Epochs._make([np.empty(0, np.int64)] * len(Epochs._fields))
    return Epochs._make([np.concatenate(columns) for columns in zip(none, *parts, strict=True)])


def _parts(log: Bytes, frames: Located) -> Iterator[tuple[Epochs, _Taken]]:
    """At most `MOST_EPOCHS` at a time, with their measurements."""
    epochs = _epochs(log, frames)
    for at in range(0, len(epochs.frame), MOST_EPOCHS):
        yield _without_contradictions(log, Epochs._make([column[at : at + MOST_EPOCHS] for column in epochs]))


def _epochs(log: Bytes, frames: Located) -> Epochs:
    """The epochs whose version, week and time of week are right."""
    frame = np.flatnonzero((frames.kind == kind_of(RXM_RAWX)) & (frames.end - frames.begin > FRAME_BYTES))
    begin = frames.begin[frame] + HEADER_BYTES
    header = log[begin[:, None] + np.arange(RAWX_HEADER.size)].view(HEADER_DTYPE)[:, 0]
    tow_s, week = header["tow_s"], header["week"]
    sound = (header["version"] <= LAST_VERSION) & (tow_s >= 0.0) & (tow_s < WEEK_S) & (week >= FIRST_WEEK) & (week <= LAST_WEEK)
    header, begin, frame = header[sound], begin[sound], frame[sound]
    time_ns = header["week"] * np.int64(WEEK_NS) + np.rint(header["tow_s"] * NS_PER_S).astype(np.int64)
    return Epochs(frame, time_ns, begin + RAWX_HEADER.size, header["n"].astype(np.int64))


def _without_contradictions(log: Bytes, epochs: Epochs) -> tuple[Epochs, _Taken]:
    """The measurements of known signals, without the epochs in which a signal stands twice."""
    taken = _known_signals(log, epochs)
    seen = np.zeros((len(epochs.frame), NO_SIGNAL), dtype=np.bool_)
    seen.reshape(-1)[taken.epoch * NO_SIGNAL + taken.signal] = True
    if np.count_nonzero(seen) == len(taken.epoch):
        return epochs, taken
    once = np.count_nonzero(seen, axis=1) == np.bincount(taken.epoch, minlength=len(epochs.frame))
    epochs = Epochs._make([column[once] for column in epochs])
    return epochs, _known_signals(log, epochs)


def _known_signals(log: Bytes, epochs: Epochs) -> _Taken:
    size, end = RAWX_DTYPE.itemsize, np.cumsum(epochs.measured)
    place = np.repeat(epochs.first - size * (end - epochs.measured), epochs.measured) + size * np.arange(epochs.measured.sum())
    anywhere = np.ndarray((max(0, len(log) - size + 1),), f"V{size}", log.data, strides=(1,))  # a measurement from each byte on
    measurements = anywhere[place]
    identity = measurements.view("<u4").reshape(-1, size // 4)[:, 5]  # gnssId, svId, sigId, freqId
    number = _NUMBER_OF_IDENTITY.take(identity & 0x7 | identity >> 5 & 0x7FF8)
    number[identity & 0xF000F8 != 0] = NO_SIGNAL
    taken = _Taken(measurements, np.repeat(np.arange(len(epochs.frame)), epochs.measured), number)
    known = number < NO_SIGNAL
    return taken if known.all() else _only(known, taken)


def _only(kept: Bools, taken: _Taken) -> _Taken:
    return _Taken._make([column[kept] for column in taken])


def _block(epochs: Epochs, taken: _Taken, receiver: str, wanted: Bools) -> ObservationBlock:
    """The arrays of a block, NaN where nothing was measured."""
    pr_m, cp_cycles = _range_and_carrier(taken.measurements.view(RAWX_DTYPE))
    kept = (np.isfinite(pr_m) | np.isfinite(cp_cycles)) & wanted.take(taken.signal)
    if not kept.all():
        pr_m, cp_cycles, taken = pr_m[kept], cp_cycles[kept], _only(kept, taken)
    signals, column = _columns(taken.signal)
    shape = (len(epochs.frame), 1, len(signals))
    place = taken.epoch * len(signals) + column
    do_hz, cn0_dbhz, lock_s, half_cycle = _others(taken.measurements.view(RAWX_DTYPE))
    return ObservationBlock(
        (receiver,),
        signals,
        tuple(satellite_of(s) for s in signals),
        epochs.receive_time_ns,
        epochs.receive_time_ns[:, None],
        pseudorange_m=_spread(pr_m, place, np.full(shape, np.nan)),
        carrier_cycles=_spread(cp_cycles, place, np.full(shape, np.nan)),
        doppler_hz=_spread(do_hz, place, np.full(shape, np.nan)),
        cn0_dbhz=_spread(cn0_dbhz, place, np.full(shape, np.nan)),
        lock_s=_spread(lock_s, place, np.full(shape, np.nan)),
        slip=_spread(lock_s == 0.0, place, np.zeros(shape, dtype=np.bool_)),
        half_cycle=_spread(half_cycle, place, np.zeros(shape, dtype=np.bool_)),
    )


def _spread(values: NDArray[_Kind], place: Ints, array: NDArray[_Kind]) -> NDArray[_Kind]:
    """The array with these values at their places."""
    array.reshape(-1)[place] = values
    return array


def _columns(numbers: Numbers) -> tuple[tuple[str, ...], Ints]:
    """The signals among these, in order, and which of them each is."""
    present = np.zeros(NO_SIGNAL, dtype=np.bool_)
    present[numbers] = True
    return tuple(ALL_SIGNALS[i] for i in np.flatnonzero(present)), (np.cumsum(present) - 1).take(numbers)


def _range_and_carrier(m: Measurements) -> tuple[Floats, Floats]:
    """NaN where the receiver does not vouch for them, or they are out of range."""
    pr_m, cp_cycles, trk_stat = m["pr_m"], m["cp_cycles"], m["trk_stat"]
    pr_known = (pr_m >= LEAST_RANGE_M) & (pr_m <= MOST_RANGE_OF_GNSS_M.take(m["gnss_id"])) & (trk_stat & PR_VALID != 0)
    cp_known = (np.abs(cp_cycles) <= MOST_CARRIER_CYCLES) & (trk_stat & CP_VALID != 0)
    return np.where(pr_known, pr_m, np.nan), np.where(cp_known, cp_cycles, np.nan)


def _others(m: Measurements) -> tuple[Floats, Floats, Floats, Bools]:
    """Doppler, C/N0, lock time, half cycle."""
    do_hz = np.where(np.abs(m["do_hz"]) <= MOST_DOPPLER_HZ, m["do_hz"], np.float32(np.nan)).astype(np.float64)
    half_cycle = m["trk_stat"] & (CP_VALID | HALF_CYCLE_RESOLVED) == CP_VALID
    return do_hz, CN0_DBHZ.take(m["cno_dbhz"]), LOCK_S.take(m["locktime_ms"]), half_cycle
