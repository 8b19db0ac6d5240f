"""RXM-RAWX of a whole log as blocks of arrays, without an object per epoch: what `rawx.decode_rawx` says of each, to the last bit.

Sources as there.
"""

from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from integrity.gnss.gps_time import NS_PER_S, WEEK_NS, WEEK_S
from integrity.gnss.observations import ROW_ARRAYS, ROW_FLAGS, Bools, Floats, Ints, ObservationBlock
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
ROOM_BYTES, ALIGNED_BYTES = 1 << 24, 64
HEADER_DTYPE = np.dtype(
    [("tow_s", "<f8"), ("week", "<u2"), ("leap_s", "i1"), ("n", "u1"), ("state", "u1"), ("version", "u1"), ("reserved", "V2")]
)
Numbers = NDArray[np.intp]
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
    """Measurements that are taken (N,), numbers of the signals that they are of, in order (S,), and the cell of each in a grid (E, S)."""

    measurements: Measurements
    numbers: Numbers
    cell: Ints


class _Arrays(NamedTuple):
    """The arrays of a block, (E, 1, S) each, in its order."""

    pseudorange_m: Floats
    carrier_cycles: Floats
    doppler_hz: Floats
    cn0_dbhz: Floats
    lock_s: Floats
    slip: Bools
    half_cycle: Bools


def rawx_blocks(log: Bytes, frames: Located, receiver: str, codes: Codes = EVERY_CODE) -> Iterator[ObservationBlock]:
    """The epochs of a log with the frames that `locate` found in it, in their order, at most `MOST_EPOCHS` a block; signals of `codes`.

    Nominal time is the receiver's own. An epoch for which `decode_rawx` has no row is left out; nothing is raised, whatever the bytes.
    """
    wanted = np.array([s.partition(".")[2] in codes.get(s[0], ()) for s in ALL_SIGNALS])
    room = _Room()
    for epochs, taken in _parts(log, frames):
        if len(epochs.frame):
            yield _block(epochs, _of_signals(wanted.take(taken.numbers), taken), receiver, room)


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
    n_epochs, n_signals = len(epochs.frame), len(taken.numbers)
    seen = np.zeros((n_epochs, n_signals), dtype=np.bool_)
    seen.reshape(-1)[taken.cell] = True
    if np.count_nonzero(seen) == len(taken.cell):
        return epochs, taken
    once = np.count_nonzero(seen, axis=1) == np.bincount(taken.cell // n_signals, minlength=n_epochs)
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
    present = np.zeros(NO_SIGNAL + 1, dtype=np.bool_)
    present[number] = True
    numbers = np.flatnonzero(present[:NO_SIGNAL])
    cell = np.repeat(len(numbers) * np.arange(len(epochs.frame)), epochs.measured) + (np.cumsum(present) - 1).take(number)
    taken = _Taken(measurements, numbers, cell)
    return _only(number < NO_SIGNAL, taken) if present[NO_SIGNAL] else taken


def _only(kept: Bools, taken: _Taken) -> _Taken:
    return _Taken(taken.measurements[kept], taken.numbers, taken.cell[kept])


def _of_signals(wanted: Bools, taken: _Taken) -> _Taken:
    """What is taken of signals that are wanted (S,)."""
    if wanted.all():
        return taken
    epoch, column = np.divmod(taken.cell, len(wanted))
    kept = wanted.take(column)
    cell = epoch[kept] * np.count_nonzero(wanted) + (np.cumsum(wanted) - 1).take(column[kept])
    return _Taken(taken.measurements[kept], taken.numbers[wanted], cell)


class _Room:
    """Memory for the arrays of blocks, several megabytes at a time: what systems hand out in small pieces they clear page by page, which
    takes half as long as the decoding. A block that is kept keeps what was handed out with it."""

    def __init__(self) -> None:
        self._free = np.empty(0, dtype=np.uint8)

    def arrays(self, n_epochs: int, n_signals: int) -> _Arrays:
        """Of one receiver's block; nothing is measured yet."""
        kinds = [np.dtype(np.bool_ if name in ROW_FLAGS else np.float64) for name in ROW_ARRAYS]
        ends = np.cumsum([n_epochs * n_signals * kind.itemsize for kind in kinds])  # floats first: all begin where they should
        if ends[-1] > len(self._free):
            self._free = np.empty(max(int(ends[-1]), ROOM_BYTES), dtype=np.uint8)
        parts = np.split(self._free[: ends[-1]], ends[:-1])
        self._free = self._free[-(-ends[-1] // ALIGNED_BYTES) * ALIGNED_BYTES :]
        arrays = _Arrays._make([part.view(kind).reshape(n_epochs, 1, n_signals) for part, kind in zip(parts, kinds, strict=True)])
        for array in arrays:
            array.fill(False if array.dtype == np.bool_ else np.nan)
        return arrays


def _block(epochs: Epochs, taken: _Taken, receiver: str, room: _Room) -> ObservationBlock:
    """The arrays of a block, NaN where nothing was measured; signals of which nothing was have no place in it."""
    pr_m, cp_cycles, kept = _range_and_carrier(taken.measurements.view(RAWX_DTYPE))
    if not kept.all():
        pr_m, cp_cycles, taken = pr_m[kept], cp_cycles[kept], _only(kept, taken)
        measured = np.zeros(len(taken.numbers), dtype=np.bool_)
        measured[taken.cell % len(measured)] = True
        taken = _of_signals(measured, taken)
    columns: tuple[NDArray[Any], ...] = (pr_m, cp_cycles, *_others(taken.measurements.view(RAWX_DTYPE)))
    arrays = room.arrays(len(epochs.frame), len(taken.numbers))
    for array, values in zip(arrays, columns, strict=True):
        array.reshape(-1)[taken.cell] = values
    signals = tuple(ALL_SIGNALS[i] for i in taken.numbers)
    satellites = tuple(satellite_of(s) for s in signals)
    return ObservationBlock((receiver,), signals, satellites, epochs.receive_time_ns, epochs.receive_time_ns[:, None], *arrays)


def _range_and_carrier(m: Measurements) -> tuple[Floats, Floats, Bools]:
    """NaN where the receiver does not vouch for them, or they are out of range; and which measurements have one of the two."""
    pr_m, cp_cycles, trk_stat = (m[field].copy() for field in ("pr_m", "cp_cycles", "trk_stat"))  # side by side
    pr_known = (pr_m >= LEAST_RANGE_M) & (pr_m <= MOST_RANGE_OF_GNSS_M.take(m["gnss_id"])) & (trk_stat & PR_VALID != 0)
    cp_known = (np.abs(cp_cycles) <= MOST_CARRIER_CYCLES) & (trk_stat & CP_VALID != 0)
    pr_m[~pr_known] = np.nan
    cp_cycles[~cp_known] = np.nan
    return pr_m, cp_cycles, pr_known | cp_known


def _others(m: Measurements) -> tuple[NDArray[np.float32], Floats, Floats, Bools, Bools]:
    """Doppler, C/N0, lock time, slip, half cycle."""
    do_hz = m["do_hz"].copy()
    do_hz[~(np.abs(do_hz) <= MOST_DOPPLER_HZ)] = np.nan  # before it is widened: to widen a signalling NaN warns
    lock_s = LOCK_S.take(m["locktime_ms"])
    half_cycle = m["trk_stat"] & (CP_VALID | HALF_CYCLE_RESOLVED) == CP_VALID
    return do_hz, CN0_DBHZ.take(m["cno_dbhz"]), lock_s, lock_s == 0.0, half_cycle
