"""What spoils measurements, as random processes: satellites, ionosphere, receiver noise, multipath, receiver clocks, signal strength.

Every process has a generator of its own, spawned from the seed by its name (`multipath/A/G05`): it is the same whatever else is asked
for, and its beginning is the same however long it lasts. Processes are stationary from the first epoch on.
"""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from integrity.gnss.constants import SPEED_OF_LIGHT_MPS
from integrity.gnss.observations import Floats, freeze
from integrity.gnss.positioning import range_sigma_m

KNOTS_PER_TAU = 10  # of slow processes; the cubic between them loses at most 2.3 % of the variance


@dataclass(frozen=True)
class ErrorModel:
    """Standard deviations of the errors, and their time constants. Zero sigmas give the ranges as the broadcast models have them.

    Errors common to receivers: `satellite_m` in the range of each satellite, and the ionosphere, which differs from the broadcast model
    by a share of the modelled delay that varies over the sky: mean, east slope and north slope each with `ionosphere`.
    Code of each receiver and satellite: white and multipath, each sqrt(a^2 + (b / sin el)^2) with `..._m` and `..._low_m`.
    Clocks: offset and drift within bounds, and white frequency noise of `clock_noise_m` over one second.
    """

    satellite_m: float
    satellite_tau_s: float
    ionosphere: float
    ionosphere_tau_s: float
    noise_m: float
    noise_low_m: float
    multipath_m: float
    multipath_low_m: float
    multipath_tau_s: tuple[float, float]  # evenly between
    carrier_m: float
    range_rate_mps: float
    cn0_db: float
    clock_offset_s: float
    clock_drift_sps: float
    clock_noise_m: float


# An open site with geodetic antennas. The range sigmas that `integrity.config` has by default are about 1.5 times larger.
NOMINAL = ErrorModel(
    satellite_m=0.55,
    satellite_tau_s=3000.0,
    ionosphere=0.06,
    ionosphere_tau_s=1800.0,
    noise_m=0.12,
    noise_low_m=0.095,
    multipath_m=0.12,
    multipath_low_m=0.095,
    multipath_tau_s=(20.0, 60.0),
    carrier_m=0.002,
    range_rate_mps=0.02,
    cn0_db=0.5,
    clock_offset_s=3e-4,
    clock_drift_sps=3e-8,
    clock_noise_m=0.03,
)

CN0_HORIZON_DBHZ, CN0_ZENITH_DBHZ = 38.0, 50.0


@dataclass(frozen=True, eq=False)
class SignalErrors:
    """To be added to what receivers measure, (E, R, S): code and carrier in metres, range rate in m/s; `cn0_dbhz` is C/N0 itself."""

    code_m: Floats
    carrier_m: Floats
    range_rate_mps: Floats
    cn0_dbhz: Floats

    def __post_init__(self) -> None:
        freeze(self)


@dataclass(frozen=True, eq=False)
class ReceiverClocks:
    """What the clocks of receivers are ahead of GPS time, (E, R), and the rate of that."""

    bias_s: Floats
    drift_sps: Floats

    def __post_init__(self) -> None:
        freeze(self)


def generator(seed: int, name: str) -> np.random.Generator:
    """The generator of a named process: independent of all others of the same seed (numpy SeedSequence)."""
    return np.random.Generator(np.random.PCG64(np.random.SeedSequence(seed, spawn_key=tuple(name.encode()))))


def signal_errors(
    model: ErrorModel,
    seed: int,
    receivers: Sequence[str],
    satellites: Sequence[str],
    step_s: float,
    az_rad: Floats,
    el_rad: Floats,
    ionosphere_m: Floats,
    signals: Sequence[str] | None = None,
) -> SignalErrors:
    """Errors of epochs `step_s` apart; azimuth, elevation and modelled slant ionospheric delay (E, R, S) belong to the signals.

    The ionosphere delays the code and advances the carrier by the same; `ionosphere_m` itself is not part of the result. What receivers
    add is told apart by the names of `signals` (S,), by default those of the satellites.
    """
    n = len(el_rad)
    channels = [f"{r}/{s}" for r in receivers for s in signals or satellites]

    def white(kind: str) -> Floats:
        return _white(seed, (f"{kind}/{c}" for c in channels), n).reshape(el_rad.shape)

    satellite_m = model.satellite_m * np.stack(
        [slow(generator(seed, f"satellite/{s}"), model.satellite_tau_s, step_s, n) for s in satellites], axis=-1
    )
    mean, east, north = (
        model.ionosphere * slow(generator(seed, f"ionosphere/{part}"), model.ionosphere_tau_s, step_s, n)[:, None, None]
        for part in ("mean", "east", "north")
    )
    ionosphere_error_m = ionosphere_m * (mean + np.cos(el_rad) * (east * np.sin(az_rad) + north * np.cos(az_rad)))

    tau_s = np.array([generator(seed, f"multipath tau/{c}").uniform(*model.multipath_tau_s) for c in channels]).reshape(el_rad.shape[1:])
    multipath_m = range_sigma_m(el_rad, model.multipath_m, model.multipath_low_m) * gauss_markov(white("multipath"), step_s / tau_s)
    noise_m = range_sigma_m(el_rad, model.noise_m, model.noise_low_m) * white("noise")
    cn0_dbhz = CN0_HORIZON_DBHZ + (CN0_ZENITH_DBHZ - CN0_HORIZON_DBHZ) * np.sin(el_rad) + model.cn0_db * white("cn0")
    return SignalErrors(
        code_m=satellite_m[:, None, :] + ionosphere_error_m + multipath_m + noise_m,
        carrier_m=satellite_m[:, None, :] - ionosphere_error_m + model.carrier_m * white("carrier"),
        range_rate_mps=model.range_rate_mps * white("range rate"),
        cn0_dbhz=cn0_dbhz,
    )


def receiver_clocks(model: ErrorModel, seed: int, clocks: Sequence[str], step_s: float, n: int) -> ReceiverClocks:
    """Clocks by name at n epochs: a straight line and a random walk. A name that stands twice is one clock."""
    start = np.array([generator(seed, f"clock/{c}").uniform(-1.0, 1.0, 2) for c in clocks]) * (
        model.clock_offset_s,
        model.clock_drift_sps,
    )
    frequency = _white(seed, (f"clock noise/{c}" for c in clocks), n) * (model.clock_noise_m / SPEED_OF_LIGHT_MPS / math.sqrt(step_s))
    walk_s = step_s * (np.cumsum(frequency, axis=0) - frequency[0])
    return ReceiverClocks(start[:, 0] + start[:, 1] * step_s * np.arange(n)[:, None] + walk_s, start[:, 1] + frequency)


def gauss_markov(white: Floats, step_over_tau: Floats | float) -> Floats:
    """First-order Gauss-Markov processes along the first axis, of unit variance, from white noise of unit variance of the same shape.

    Autocorrelation exp(-k step / tau). Source: Gelb, Applied Optimal Estimation, 1974, section 3.6.
    """
    kept, fresh = np.exp(-np.asarray(step_over_tau)), np.sqrt(-np.expm1(-2.0 * np.asarray(step_over_tau)))
    process = np.array(white)
    for k in range(1, len(process)):
        process[k] = kept * process[k - 1] + fresh * white[k]
    return process


def slow(rng: np.random.Generator, tau_s: float, step_s: float, n: int) -> Floats:
    """A Gauss-Markov process (n,) of unit variance that a carrier can follow: drawn at knots tau / 10 apart, cubic in between.

    A first-order process jitters at any step, which no satellite clock or ionosphere does: 2 cm from second to second for 0.6 m and
    1800 s. Between knots: Catmull-Rom, continuous rate.
    """
    at = np.arange(n) * (step_s * KNOTS_PER_TAU / tau_s)
    k = at.astype(np.int64)
    knots = gauss_markov(rng.standard_normal(int(k[-1]) + 4), 1.0 / KNOTS_PER_TAU)
    x = at - k
    before, left, right, after = (knots[k + i] for i in range(4))
    slope_left, slope_right, rise = 0.5 * (right - before), 0.5 * (after - left), right - left
    process: Floats = left + x * (
        slope_left + x * (3.0 * rise - 2.0 * slope_left - slope_right + x * (slope_left + slope_right - 2.0 * rise))
    )
    return process


def _white(seed: int, names: Iterable[str], n: int) -> Floats:
    """White noise (n, names), each column from its own generator."""
    return np.stack([generator(seed, name).standard_normal(n) for name in names], axis=-1)
