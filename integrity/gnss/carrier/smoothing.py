"""Ranges smoothed with the carrier's change (Hatch filter), with their variance and what the ionosphere may do to them.

P_s(t) = a P(t) + (1 - a) (P_s(t - dt) + Phi(t) - Phi(t - dt)), a = 1 / n for the n-th range of an arc until the window is full, then dt
over the window; a range that is 30 m off what the filter carries on begins another. Single frequency: the ionosphere delays the code and
advances the carrier; a smoothed range lags by twice the change of the delay over the mean age of the ranges in it, an error that no
variance shows, bounded by `drift_bound_m`. Two frequencies: with the carrier of `divergence_free_m` there is none.
Sources: Hatch 1982; Hwang, McGraw, Bader 1999 (divergence-free); RTCA DO-229, 2.1.4.1.1 (window of 100 s).
"""

from dataclasses import dataclass, fields

import numpy as np

from integrity.gnss.carrier.slips import Arcs, Slip
from integrity.gnss.gps_time import NS_PER_S
from integrity.gnss.observations import Bools, Floats, Ints, ObservationBlock, freeze

# Noise and multipath of a tracked code stay below; more is a jump of the receiver's clock in the code alone (1 ms is 300 km), or a slip
# that nothing showed. Own choice.
MOST_APART_M = 30.0


@dataclass(frozen=True, eq=False)
class SmoothingMemory:
    """The filters (R, N) of `signals` as the last range left them; NaN where there is none. `broken`: the phase slipped since."""

    signals: tuple[str, ...]
    time_ns: Ints
    carrier_m: Floats
    smoothed_m: Floats
    variance_m2: Floats
    age_s: Floats
    n: Floats
    broken: Bools

    def __post_init__(self) -> None:
        freeze(self)

    @staticmethod
    def empty(n_receivers: int) -> "SmoothingMemory":
        """No filter yet."""
        nothing = np.zeros((n_receivers, 0))
        return SmoothingMemory((), nothing.astype(np.int64), *(nothing,) * 5, nothing.astype(np.bool_))


@dataclass(frozen=True, eq=False)
class Smoothed:
    """Smoothed ranges (E, R, S), NaN where no range or no phase was measured; their standard deviation, noise alone; the mean age of the
    ranges in them."""

    range_m: Floats
    sigma_m: Floats
    age_s: Floats

    def __post_init__(self) -> None:
        freeze(self)

    def drift_bound_m(self, ionosphere_mps: float) -> Floats:
        """By how much single-frequency ranges may be off while the delay changes by at most `ionosphere_mps`."""
        result: Floats = 2.0 * ionosphere_mps * self.age_s
        return result


def divergence_free_m(block: ObservationBlock, wavelength_m: Floats, partner: Ints) -> Floats:
    """Phase (E, R, S), m, which the ionosphere delays as it does the code: Phi_1 + 2 / (gamma - 1) (Phi_1 - Phi_2), gamma = (f_1 / f_2)^2.

    wavelength_m (E, S); `partner` (S,): column of the same satellite's signal of another frequency. It slips where either does.
    """
    phase_m = wavelength_m[:, None] * block.carrier_cycles
    gamma = (wavelength_m[:, partner] / wavelength_m)[:, None] ** 2
    result: Floats = phase_m + 2.0 / (gamma - 1.0) * (phase_m - phase_m[..., partner])
    return result


def smooth(
    block: ObservationBlock,
    carrier_m: Floats,
    arcs: Arcs,
    sigma_m: Floats,
    carrier_sigma_m: float,
    window_s: float,
    memory: SmoothingMemory,
) -> tuple[Smoothed, SmoothingMemory]:
    """Smoothed ranges of a block, and the filters as it leaves them; however a stream is cut into blocks, they are the same to the bit.

    carrier_m (E, R, S): phase in m, `divergence_free_m` or wavelength times cycles; sigma_m broadcasts to (E, R, S): of the ranges' noise
    and multipath, taken as independent from epoch to epoch; carrier_sigma_m: of that phase. A range without a phase is passed over, a
    phase without a range carries the filter on.
    """
    shape = block.pseudorange_m.shape
    sigma = np.broadcast_to(sigma_m, shape)
    out = np.full((3, *shape), np.nan)
    state = _placed(memory, block.signals)
    for e in range(shape[0]):
        time_ns = np.broadcast_to(block.receive_time_ns[e][:, None], shape[1:])
        state = _step(state, time_ns, block.pseudorange_m[e], carrier_m[e], sigma[e] ** 2, arcs.slip[e] != Slip.NONE, window_s)
        here = np.isfinite(carrier_m[e]) & np.isfinite(block.pseudorange_m[e])
        noise_m2 = state["variance_m2"] + 2.0 * carrier_sigma_m**2
        for row, value in zip(out, (state["smoothed_m"], np.sqrt(noise_m2), state["age_s"]), strict=True):
            row[e] = np.where(here, value, np.nan)
    return Smoothed(*out), _kept(state, block.signals, memory)


def _step(
    state: dict[str, Floats], time_ns: Ints, range_m: Floats, carrier_m: Floats, variance_m2: Floats, slipped: Bools, window_s: float
) -> dict[str, Floats]:
    """The filters (R, S) after one epoch."""
    phased, ranged = np.isfinite(carrier_m), np.isfinite(range_m)
    broken = (state["broken"] > 0.0) | slipped
    dt_s = (time_ns - state["time_ns"]) / NS_PER_S
    carried_m = state["smoothed_m"] + (carrier_m - state["carrier_m"])
    goes_on = phased & ~broken & np.isfinite(state["smoothed_m"]) & (dt_s > 0.0) & ~(np.abs(range_m - carried_m) > MOST_APART_M)
    begins = phased & ranged & ~goes_on
    n = np.where(ranged, state["n"] + 1.0, state["n"])
    with np.errstate(divide="ignore", invalid="ignore"):
        a = np.where(ranged, np.minimum(np.maximum(1.0 / n, dt_s / window_s), 1.0), 0.0)
    on = {
        "smoothed_m": np.where(ranged, a * range_m + (1.0 - a) * carried_m, carried_m),
        "variance_m2": np.where(ranged, a * a * variance_m2, 0.0) + (1.0 - a) ** 2 * state["variance_m2"],
        "age_s": (1.0 - a) * (state["age_s"] + dt_s),
        "n": n,
    }
    new = {"smoothed_m": range_m, "variance_m2": variance_m2, "age_s": np.zeros_like(n), "n": np.ones_like(n)}
    kept = goes_on | begins
    after = {name: np.where(goes_on, on[name], np.where(begins, new[name], state[name])) for name in on}
    after["time_ns"] = np.where(kept, time_ns, state["time_ns"])
    after["carrier_m"] = np.where(kept, carrier_m, state["carrier_m"])
    after["broken"] = np.where(kept, False, broken)
    return after


def _placed(memory: SmoothingMemory, signals: tuple[str, ...]) -> dict[str, Floats]:
    """The filters of these signals, (R, S) each."""
    place = {signal: k for k, signal in enumerate(memory.signals)}
    known = [s for s, signal in enumerate(signals) if signal in place]
    columns = [place[signals[s]] for s in known]
    state = {}
    for name in (f.name for f in fields(memory) if f.name != "signals"):
        array = getattr(memory, name)
        state[name] = np.full((len(array), len(signals)), np.nan if array.dtype == np.float64 else 0, dtype=array.dtype)
        state[name][:, known] = array[:, columns]
    return state


def _kept(state: dict[str, Floats], signals: tuple[str, ...], memory: SmoothingMemory) -> SmoothingMemory:
    """The filters that have begun, those of signals that this block does not have included."""
    older = [k for k, signal in enumerate(memory.signals) if signal not in signals]
    names = (*signals, *(memory.signals[k] for k in older))
    merged = {name: np.concatenate((array, getattr(memory, name)[:, older]), axis=1) for name, array in state.items()}
    begun = np.flatnonzero(np.isfinite(merged["smoothed_m"]).any(axis=0)).tolist()
    kept = sorted(begun, key=lambda k: names[k])
    return SmoothingMemory(tuple(names[k] for k in kept), **{name: array[:, kept].copy() for name, array in merged.items()})
