"""Made-up phases of two frequencies for tests of carrier work: satellites that come and go, a receiver clock that drifts, an ionosphere."""

from dataclasses import replace
from typing import Any

import numpy as np

from integrity.gnss.carrier.slips import SlipLimits
from integrity.gnss.gps_time import NS_PER_S
from integrity.gnss.observations import Floats, ObservationBlock

L1_M, L2_M = 299_792_458.0 / 1_575.42e6, 299_792_458.0 / 1_227.60e6
SATELLITES = ("G01", "G02", "G03", "G04", "G05")
SIGNALS = tuple(f"{satellite}.{code}" for satellite in SATELLITES for code in ("1C", "2W"))
WAVELENGTH_M = np.array([L1_M, L2_M] * len(SATELLITES))
START_NS = 1_400_000_000 * NS_PER_S
LIMITS = SlipLimits(
    longest_gap_ns=10 * NS_PER_S,
    lock_share=1.0,
    normal_quantile=5.0,
    carrier_sigma_m=0.003,
    ionosphere_mps=0.004,
    doppler_sigma_mps=0.03,
    jerk_mps3=0.1,
)
CODE_SIGMA_M = 0.5


def phases(epochs: int, receivers: int = 1, seed: int = 1, ionosphere_mps: float = 0.0, noise: float = 1.0) -> ObservationBlock:
    """A block at 1 Hz in which nothing slips: ranges that fall and rise, a clock that gains 30 m/s, all phases tracked from the start."""
    rng = np.random.default_rng(seed)
    t_s = np.arange(epochs, dtype=np.float64)[:, None, None]
    n = len(SATELLITES)
    rate_mps, acc_mps2 = rng.uniform(-600.0, 600.0, (1, 1, n)), rng.uniform(-0.1, 0.1, (1, 1, n))
    geometry_m = 2.2e7 + (rate_mps + 30.0) * t_s + 0.5 * acc_mps2 * t_s**2 + np.zeros((epochs, receivers, n))
    geometry_m = np.repeat(geometry_m, 2, axis=-1)
    speed_mps = np.repeat(rate_mps + 30.0 + acc_mps2 * t_s + np.zeros((epochs, receivers, n)), 2, axis=-1)
    delay_m = ionosphere_mps * t_s * (WAVELENGTH_M / L1_M) ** 2
    shape = geometry_m.shape
    return ObservationBlock(
        receivers=tuple("AB"[:receivers]),
        signals=SIGNALS,
        satellites=tuple(satellite for satellite in SATELLITES for _ in range(2)),
        epoch_ns=START_NS + NS_PER_S * np.arange(epochs),
        receive_time_ns=(START_NS + NS_PER_S * np.arange(epochs))[:, None] + np.zeros((1, receivers), dtype=np.int64),
        pseudorange_m=geometry_m + delay_m + noise * CODE_SIGMA_M * rng.standard_normal(shape),
        carrier_cycles=(geometry_m - delay_m + noise * 0.002 * rng.standard_normal(shape)) / WAVELENGTH_M + 1000.0 * np.arange(2 * n),
        doppler_hz=-(speed_mps + noise * 0.02 * rng.standard_normal(shape)) / WAVELENGTH_M,
        cn0_dbhz=np.full(shape, 45.0),
        lock_s=100.0 + t_s + np.zeros(shape),
        slip=np.zeros(shape, dtype=np.bool_),
        half_cycle=np.zeros(shape, dtype=np.bool_),
    )


def edited(block: ObservationBlock, name: str, where: Any, value: Any) -> ObservationBlock:
    """The block with other values in one of its arrays."""
    arrays: dict[str, Any] = {name: np.array(getattr(block, name))}
    arrays[name][where] = value
    return replace(block, **arrays)


def slipped(block: ObservationBlock, epoch: int, signal: int, cycles: float) -> ObservationBlock:
    """The block with a slip that lasts."""
    carrier = np.array(block.carrier_cycles)
    carrier[epoch:, :, signal] += cycles
    return replace(block, carrier_cycles=carrier)


def part(block: ObservationBlock, epochs: slice, columns: list[int]) -> ObservationBlock:
    """Some epochs and signals of a block."""
    arrays = {n: getattr(block, n)[epochs][..., columns] for n in ("pseudorange_m", "carrier_cycles", "doppler_hz", "cn0_dbhz", "lock_s")}
    arrays |= {n: getattr(block, n)[epochs][..., columns] for n in ("slip", "half_cycle")}
    return replace(
        block,
        signals=tuple(block.signals[k] for k in columns),
        satellites=tuple(block.satellites[k] for k in columns),
        epoch_ns=block.epoch_ns[epochs],
        receive_time_ns=block.receive_time_ns[epochs],
        **arrays,
    )


def wavelengths(block: ObservationBlock) -> Floats:
    """Of a block's signals, (E, S)."""
    per_signal = dict(zip(SIGNALS, WAVELENGTH_M, strict=True))
    return np.broadcast_to([per_signal[s] for s in block.signals], (len(block.epoch_ns), len(block.signals)))
