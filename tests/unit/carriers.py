"""Made-up signals whose noise is exactly that of the error model, and the limits that tests of the carrier monitors go by."""

from typing import Any, TypeVar

import numpy as np

from integrity.carrier_thresholds import DIVERGENCE, ERRORS
from integrity.gnss.gps_time import NS_PER_S
from integrity.gnss.observations import Floats
from integrity.monitors.carrier_motion import RATES_STAY_S, MotionDesign, MotionInputs
from integrity.monitors.carrier_residuals import nature
from integrity.monitors.divergence import DivergenceInputs

CLOSE = DIVERGENCE
START_NS = 1_400_000_000 * NS_PER_S
CN0_DBHZ = 45.0
Inputs = TypeVar("Inputs", MotionInputs, DivergenceInputs)


def moving(half_epochs: int) -> MotionDesign:
    return MotionDesign(half_epochs, longest_half_s=65.0, longest_gap_s=65.0, clock_m=ERRORS.clock_m)


def gauss_markov(rng: np.random.Generator, shape: tuple[int, ...], dt_s: float, tau_s: float) -> Floats:
    """Unit variance, correlation exp(-t / tau) along the first axis."""
    a = np.exp(-dt_s / tau_s)
    x = rng.standard_normal(shape)
    x[1:] *= np.sqrt(1.0 - a * a)
    for e in range(1, len(x)):
        x[e] += a * x[e - 1]
    return x


def made(
    epochs: int, receivers: int, per_constellation: tuple[int, ...], interval_s: float = 1.0, seed: int = 1
) -> tuple[MotionInputs, DivergenceInputs]:
    """Residuals of carriers, and code minus carrier, at elevations from 10 to 80 deg; errors of receivers are independent.

    The code's noise is correlated for as long as multipath stays; each ionosphere changes at a rate of its own.
    """
    rng = np.random.default_rng(seed)
    system_of = np.repeat(np.arange(len(per_constellation)), per_constellation)
    n = len(system_of)
    shape = (epochs, receivers, n)
    sin_el = np.broadcast_to(np.sin(np.deg2rad(np.linspace(10.0, 80.0, n))), (epochs, 1, n))
    ones = np.ones((epochs, n))
    natural = nature(sin_el, np.full((epochs, 1, n), CN0_DBHZ), ones, np.ones(n), ERRORS)
    rate_mps = gauss_markov(rng, shape, interval_s, RATES_STAY_S) * np.sqrt(natural.atmosphere_m2ps2)
    clock_m = ERRORS.clock_m * np.sqrt(interval_s) * rng.standard_normal(shape)
    phase_m = np.sqrt(natural.phase_m2) * rng.standard_normal(shape)
    code_m = np.sqrt(natural.code_m2) * gauss_markov(rng, shape, interval_s, ERRORS.code_correlation_s)
    delay_m = (
        2.0 * np.sqrt(natural.ionosphere_m2ps2) * rng.standard_normal((1, receivers, n)) * interval_s * np.arange(epochs)[:, None, None]
    )
    receiver_m = np.cumsum(rng.normal(30.0, 5.0, (epochs, receivers, 1)), axis=0)  # its clock
    signals = tuple(f"{'GECJ'[k]}{i:02d}.1C" for i, k in enumerate(system_of.tolist()))
    epoch_ns = START_NS + round(interval_s * NS_PER_S) * np.arange(epochs)
    continues = np.ones(shape, dtype=np.bool_)
    residual_m = np.cumsum(rate_mps * interval_s + clock_m, axis=0) + phase_m + receiver_m
    return (
        MotionInputs(signals, epoch_ns, residual_m, continues, np.zeros((epochs, n)), natural, system_of),
        DivergenceInputs(signals, epoch_ns, code_m + delay_m, continues, natural, system_of),
    )


def part(inputs: Inputs, epochs: slice) -> Inputs:
    """Some epochs."""
    whole: dict[str, Any] = inputs._asdict()
    cut = {name: value[epochs] for name, value in whole.items() if name not in ("signals", "nature", "system_of")}
    return inputs._replace(nature=type(inputs.nature)(*(v[epochs] for v in inputs.nature)), **cut)


def since(epochs: int, begin: int) -> Floats:
    """Steps of one at an epoch, (E,)."""
    return np.where(np.arange(epochs) >= begin, 1.0, 0.0)
