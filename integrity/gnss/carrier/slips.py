"""Where a carrier phase may have slipped: flags and lock time of the receiver, two frequencies against each other, Doppler against phase.

Each measurement is compared with the signal's last one, in the same block or remembered from before; only differences over time are
looked at, so that no ambiguity matters. A slip is suspected rather than missed: what two frequencies differ by does not say in which of
them it happened, and both are marked. Blind spots: slips of two frequencies whose lengths agree (9 cycles of L1, 7 of L2: 3 mm).
Sources: Blewitt 1990 (geometry-free combination); Teunissen, Montenbruck, Springer Handbook of GNSS, 2017, 20.4 and 22.4.
"""

from dataclasses import dataclass
from enum import IntFlag
from itertools import combinations
from typing import Any

import numpy as np

from integrity.gnss.constants import SPEED_OF_LIGHT_MPS
from integrity.gnss.gps_time import NS_PER_S
from integrity.gnss.observations import Bools, Floats, Ints, ObservationBlock, freeze
from integrity.gnss.signals import L1_HZ

L1_WAVELENGTH_M = SPEED_OF_LIGHT_MPS / L1_HZ
LEAST_FOR_MEDIAN = 4  # signals of which the receiver's clock is the median; with fewer it would be one of the suspects


class Slip(IntFlag):
    """Why a carrier phase does not continue the last one; several may hold."""

    NONE = 0
    START = 1  # never seen, or too long ago
    FLAGGED = 2  # by the receiver, at this measurement or one without a phase since the last
    LOCK = 4  # tracked for less than before, or than the time since
    HALF_CYCLE = 8  # a half cycle became known, or unknown
    GEOMETRY_FREE = 16  # two frequencies of the satellite changed differently
    DOPPLER = 32  # the phase changed differently from what Doppler says


@dataclass(frozen=True)
class SlipLimits:
    """`normal_quantile`: how many sigma a good difference may be off, two-sided; its tail is the false alarms of a pair and look.

    `lock_share`: the share of the true tracking time that a lock time says at least: 1 where it is exact, 0.5 for the indicators of MSM.
    """

    longest_gap_ns: int
    lock_share: float
    normal_quantile: float
    carrier_sigma_m: float
    ionosphere_mps: float  # how fast the delay of L1 may change; other frequencies in proportion
    doppler_sigma_mps: float
    jerk_mps3: float  # of the receiver, its clock taken out


@dataclass(frozen=True, eq=False)
class CarrierMemory:
    """The last measurement (R, N) of each of `signals`; `flagged`: a slip was marked since."""

    signals: tuple[str, ...]
    time_ns: Ints
    carrier_cycles: Floats
    doppler_hz: Floats
    lock_s: Floats
    half_cycle: Bools
    flagged: Bools

    def __post_init__(self) -> None:
        freeze(self)

    @staticmethod
    def empty(n_receivers: int) -> "CarrierMemory":
        """Nothing seen yet."""
        nothing = np.zeros((n_receivers, 0))
        no = nothing.astype(np.bool_)
        return CarrierMemory((), nothing.astype(np.int64), nothing, nothing, nothing, no, no)


@dataclass(frozen=True, eq=False)
class Arcs:
    """`slip` (E, R, S) holds `Slip` where `measured`, NONE elsewhere; the phase continues where it is NONE there."""

    measured: Bools
    slip: Ints

    def __post_init__(self) -> None:
        freeze(self)

    @property
    def continues(self) -> Bools:
        """Where the phase continues the signal's last one, (E, R, S)."""
        result: Bools = self.measured & (self.slip == Slip.NONE)
        return result


@dataclass(frozen=True, eq=False)
class _Steps:
    """From each measurement's predecessor to itself, (E, R, S): `dt_s`, phase in m, Doppler's, m; NaN without a predecessor near enough."""

    dt_ns: Ints
    dt_s: Floats
    phase_m: Floats
    doppler_m: Floats


def find_slips(block: ObservationBlock, wavelength_m: Floats, memory: CarrierMemory, limits: SlipLimits) -> tuple[Arcs, CarrierMemory]:
    """Slips of a block, and what to remember for the next one; however a stream is cut into blocks, the slips are the same.

    wavelength_m (E, S). Epochs of all receivers increase.
    """
    with_memory = _stacked(block, memory)
    measured = np.isfinite(with_memory["carrier_cycles"])
    order = np.arange(len(measured))[:, None, None]
    last = np.maximum.accumulate(np.where(measured, order, -1), axis=0)  # of each signal, up to and including this row
    before = np.maximum(last[:-1], 0)
    now = {name: array[1:] for name, array in with_memory.items()}
    then = {name: np.take_along_axis(array, before, axis=0) for name, array in with_memory.items()}
    here = measured[1:]
    dt_ns = now["time_ns"] - then["time_ns"]
    near = here & (last[:-1] >= 0) & (dt_ns > 0) & (dt_ns <= limits.longest_gap_ns)
    dt_s = np.where(near, dt_ns / NS_PER_S, np.nan)
    wavelength = wavelength_m[:, None]
    phase_m = wavelength * (now["carrier_cycles"] - then["carrier_cycles"])
    doppler_m = -wavelength * 0.5 * (now["doppler_hz"] + then["doppler_hz"]) * dt_s
    steps = _Steps(np.where(near, dt_ns, 0), dt_s, np.where(near, phase_m, np.nan), doppler_m)

    marks = np.cumsum(with_memory["flagged"], axis=0)
    flagged = (marks[1:] > np.take_along_axis(marks, before, axis=0)) | ((before == 0) & with_memory["flagged"][0])
    lock_s = now["lock_s"]
    slip = near * (
        Slip.FLAGGED * flagged
        + Slip.LOCK * ((lock_s < then["lock_s"]) | (lock_s < limits.lock_share * dt_s))
        + Slip.HALF_CYCLE * (now["half_cycle"] != then["half_cycle"])
        + Slip.GEOMETRY_FREE * _frequencies_differ(steps, block, wavelength, limits)
        + Slip.DOPPLER * _doppler_differs(steps, limits)
    )
    slip = np.where(here & ~near, int(Slip.START), slip)
    return Arcs(here, slip), _remembered(with_memory, last[-1], marks, block.signals, memory, limits)


def _frequencies_differ(steps: _Steps, block: ObservationBlock, wavelength: Floats, limits: SlipLimits) -> Bools:
    """Where the phases of a satellite's signals of different frequencies, over the same time, changed by more than they can."""
    differ = np.zeros(steps.phase_m.shape, dtype=np.bool_)
    noise_m = limits.normal_quantile * 2.0 * limits.carrier_sigma_m  # of two differences of two phases each
    of_satellite: dict[str, list[int]] = {}
    for s, satellite in enumerate(block.satellites):
        of_satellite.setdefault(satellite, []).append(s)
    for columns in of_satellite.values():
        for i, j in combinations(columns, 2):
            per_l1 = np.abs(wavelength[..., i] ** 2 - wavelength[..., j] ** 2) / L1_WAVELENGTH_M**2
            same_time = steps.dt_ns[..., i] == steps.dt_ns[..., j]
            change_m = np.abs(steps.phase_m[..., i] - steps.phase_m[..., j])
            allowed_m = noise_m + per_l1 * limits.ionosphere_mps * steps.dt_s[..., i]
            pair = (change_m > allowed_m) & same_time & (per_l1 > 0.0)
            differ[..., i] |= pair
            differ[..., j] |= pair
    return differ


def _doppler_differs(steps: _Steps, limits: SlipLimits) -> Bools:
    """Where a phase changed otherwise than Doppler says, by the trapezoidal rule; the median of a receiver's signals is its clock's."""
    beyond_m = steps.phase_m - steps.doppler_m
    rate_mps = np.sort(beyond_m / steps.dt_s, axis=-1)  # NaN last
    count = np.isfinite(rate_mps).sum(axis=-1, keepdims=True)
    middle = np.take_along_axis(rate_mps, np.maximum(count - 1, 0) // 2, axis=-1) if rate_mps.shape[-1] else rate_mps[..., :0]
    noise_m = limits.normal_quantile * (limits.doppler_sigma_mps * steps.dt_s / np.sqrt(2.0) + np.sqrt(2.0) * limits.carrier_sigma_m)
    allowed_m = noise_m + limits.jerk_mps3 * steps.dt_s**3 / 12.0
    result: Bools = (np.abs(beyond_m - middle * steps.dt_s) > allowed_m) & (count >= LEAST_FOR_MEDIAN)
    return result


def _stacked(block: ObservationBlock, memory: CarrierMemory) -> dict[str, Any]:
    """Of each quantity, what is remembered as row 0 and the block's rows after it, (E + 1, R, S)."""
    n_epochs, n_receivers, n_signals = block.carrier_cycles.shape
    place = {signal: k for k, signal in enumerate(memory.signals)}
    known = [s for s, signal in enumerate(block.signals) if signal in place]
    columns = [place[block.signals[s]] for s in known]
    stacked = {}
    for name in ("time_ns", "carrier_cycles", "doppler_hz", "lock_s", "half_cycle", "flagged"):
        remembered = getattr(memory, name)
        first = np.full((1, n_receivers, n_signals), np.nan if remembered.dtype == np.float64 else 0, dtype=remembered.dtype)
        first[0, :, known] = remembered[:, columns].T
        rows = {"time_ns": np.broadcast_to(block.receive_time_ns[..., None], (n_epochs, n_receivers, n_signals)), "flagged": block.slip}
        stacked[name] = np.concatenate((first, rows[name] if name in rows else getattr(block, name)))
    return stacked


def _remembered(
    stacked: dict[str, Any],
    last: Ints,
    marks: Ints,
    signals: tuple[str, ...],
    memory: CarrierMemory,
    limits: SlipLimits,
) -> CarrierMemory:
    """The last measurement of every signal that may still be continued."""
    row = np.maximum(last, 0)[None]
    values = {name: np.take_along_axis(array, row, axis=0)[0] for name, array in stacked.items()}
    values["flagged"] = marks[-1] > np.take_along_axis(marks, row, axis=0)[0]
    values["flagged"] |= (last == 0) & stacked["flagged"][0]
    values["carrier_cycles"] = np.where(last >= 0, values["carrier_cycles"], np.nan)
    older = [k for k, signal in enumerate(memory.signals) if signal not in signals]
    newest_ns = stacked["time_ns"].max(initial=0)
    everything = {name: np.concatenate((array, getattr(memory, name)[:, older]), axis=1) for name, array in values.items()}
    names = (*signals, *(memory.signals[k] for k in older))
    recent = (np.isfinite(everything["carrier_cycles"]) & (newest_ns - everything["time_ns"] <= 2 * limits.longest_gap_ns)).any(axis=0)
    kept = sorted(np.flatnonzero(recent).tolist(), key=lambda k: names[k])
    return CarrierMemory(tuple(names[k] for k in kept), **{name: array[:, kept].copy() for name, array in everything.items()})
