"""Faults that change the ranges of some satellites, whatever stands between them and the receivers: payloads, clocks, reflections."""

import math

import numpy as np

from integrity.gnss.observations import Bools, Floats, ObservationRow
from integrity.gnss.signals import satellite_of
from recordings.faults.changes import Change
from recordings.faults.kinds import (
    CodeBias,
    CodeCarrierDivergence,
    ConstellationClock,
    Multipath,
    SatelliteAcceleration,
    SatelliteRamp,
    SatelliteStep,
    SignalEffect,
)

REFLECTION = 0.5  # own choice: the amplitude of a strong reflection, less than the direct signal's, or receivers would lose it


def signal_change(effect: SignalEffect, row: ObservationRow, elapsed_s: float, wavelengths_m: Floats) -> Change:
    """What becomes of a row so long after the start."""
    match effect:
        case SatelliteStep(satellite=satellite, size_m=size_m):
            return _together(_of_satellite(row, satellite), size_m, 0.0)
        case SatelliteRamp(satellite=satellite, rate_mps=rate_mps):
            return _together(_of_satellite(row, satellite), rate_mps * elapsed_s, rate_mps)
        case SatelliteAcceleration(satellite=satellite, rate_mps2=a):
            return _together(_of_satellite(row, satellite), 0.5 * a * elapsed_s**2, a * elapsed_s)
        case CodeCarrierDivergence(satellite=satellite, rate_mps=rate_mps):
            none = np.zeros(len(row.signals))
            return Change(np.where(_of_satellite(row, satellite), rate_mps * elapsed_s, 0.0), none, none)
        case CodeBias(satellite=satellite, size_m=size_m):
            none = np.zeros(len(row.signals))
            return Change(np.where(_of_satellite(row, satellite), size_m, 0.0), none, none)
        case ConstellationClock(system=system, size_m=size_m):
            return _together(of_system(row, system), size_m, 0.0)
        case Multipath():
            return _reflected(effect, row, elapsed_s, wavelengths_m)


def of_system(row: ObservationRow, system: str) -> Bools:
    """Which signals are of a system's satellites."""
    return np.array([signal[:1] == system for signal in row.signals], dtype=np.bool_)


def _of_satellite(row: ObservationRow, satellite: str) -> Bools:
    return np.array([satellite_of(signal) == satellite for signal in row.signals], dtype=np.bool_)


def _together(struck: Bools, delta_m: float, rate_mps: float) -> Change:
    change_m = np.where(struck, delta_m, 0.0)
    return Change(change_m, change_m, np.where(struck, rate_mps, 0.0))


def _reflected(effect: Multipath, row: ObservationRow, elapsed_s: float, wavelengths_m: Floats) -> Change:
    """A reflection of relative amplitude a that comes later by d, its phase psi behind: code a d cos(psi), carrier a wavelength / (2 pi)
    sin(psi), to the first order in a. psi is a quarter of a turn behind at the start, and a d the amplitude; the carrier, whose constant
    part nobody can tell, begins at 0."""
    phase_of = {satellite: math.tau * k / len(effect.satellites) for k, satellite in enumerate(effect.satellites)}
    phase = np.array([phase_of.get(satellite_of(signal), np.nan) for signal in row.signals], dtype=np.float64)
    struck = np.isfinite(phase)
    omega = math.tau / effect.period_s
    now, lever_m = phase + omega * elapsed_s, REFLECTION * wavelengths_m / math.tau
    return Change(
        np.where(struck, effect.amplitude_m * np.sin(now), 0.0),
        np.where(struck, lever_m * (np.cos(phase) - np.cos(now)), 0.0),
        np.where(struck, lever_m * omega * np.sin(now), 0.0),
    )
