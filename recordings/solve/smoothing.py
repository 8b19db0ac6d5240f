"""Ranges of a recording smoothed with the carrier (`gnss.carrier`), before anything is solved.

Slips are looked for in all signals of the first and second codes, so that two frequencies watch each other; then single signals are
smoothed with their own carrier, pairs with the ionosphere-free one. That is what smoothing each frequency divergence-free and combining
afterwards gives as well: the filter is linear, and the two carriers differ by nothing but a constant (Hwang, McGraw, Bader 1999).
"""

from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from integrity.gnss.carrier.slips import Arcs, CarrierMemory, Slip, SlipLimits, find_slips
from integrity.gnss.carrier.smoothing import SmoothingMemory, smooth
from integrity.gnss.combination import ionosphere_free
from integrity.gnss.constants import SPEED_OF_LIGHT_MPS
from integrity.gnss.ephemeris.broadcast import Ephemeris, GlonassEphemeris
from integrity.gnss.gps_time import NS_PER_S
from integrity.gnss.observations import Bools, Floats, ObservationBlock
from integrity.gnss.range_errors import IONOSPHERE_MPS, Quality, noise_left
from integrity.gnss.signals import FIRST_CODES, L1_HZ, SECOND_CODES
from integrity.gnss.velocity import wavelengths_m
from recordings.solve.sky import columns_of

# Two-sided 5 sigma: 6e-7 of good pairs of epochs. In files of 30 s one epoch may lack; 5 mm covers a phase at 10 deg, 4 mm/s of L1 delay a
# disturbed ionosphere at mid latitudes, 50 mm/s the Doppler of small receivers, 0.1 m/s^3 a train. Own choice.
LIMITS = SlipLimits(
    longest_gap_ns=60 * NS_PER_S,
    lock_share=1.0,
    normal_quantile=5.0,
    carrier_sigma_m=0.005,
    ionosphere_mps=0.004,
    doppler_sigma_mps=0.05,
    jerk_mps3=0.1,
)
ONE_RECEIVER = 1


class Watched(NamedTuple):
    """Carriers so far: phases, and those of them with another measurement that shows a slip which the receiver does not mark."""

    phases: int = 0
    checkable: int = 0


class Smoother:
    """Smooths the blocks of one receiver in the order of time, over `window_s`; remembers its filters from block to block.

    However the recording is cut into blocks, ranges are the same to the bit. `pairs`: blocks come out combined, free of ionosphere.
    """

    def __init__(self, window_s: float, pairs: bool, ephemerides: Iterable[Ephemeris]) -> None:
        self.window_s = window_s
        self.pairs = pairs
        self.watched = Watched()
        self._channels: Mapping[str, int] = {eph.satellite: eph.channel for eph in ephemerides if isinstance(eph, GlonassEphemeris)}
        self._carriers = CarrierMemory.empty(ONE_RECEIVER)
        self._filters = SmoothingMemory.empty(ONE_RECEIVER)

    def smoothed(self, block: ObservationBlock) -> tuple[ObservationBlock, Quality]:
        """The block with smoothed ranges in place of measured ones, measured ones where there is no phase."""
        both = _of_codes(block, second=True)
        arcs, self._carriers = find_slips(both, self._wavelength_m(both), self._carriers, LIMITS)
        self._watch(both, arcs)
        marked = replace(both, slip=arcs.slip != Slip.NONE)
        chosen = ionosphere_free(marked) if self.pairs else _of_codes(marked, second=False)
        wavelength_m = self._wavelength_m(chosen)
        carrier_m = wavelength_m[:, None] * chosen.carrier_cycles
        slips = Arcs(np.isfinite(carrier_m), chosen.slip * np.int64(Slip.FLAGGED))
        # In units of the noise of one range; a phase has thousandths of its variance.
        one = np.ones((1, 1, 1))
        found, self._filters = smooth(chosen, carrier_m, slips, one, 0.0, self.window_s, self._filters)
        here: Bools = np.isfinite(found.range_m)
        per_l1 = 0.0 if self.pairs else (wavelength_m[:, None] * (L1_HZ / SPEED_OF_LIGHT_MPS)) ** 2
        quality = Quality(
            np.where(here, noise_left(found.sigma_m * found.sigma_m, found.age_s), 1.0),
            np.where(here, per_l1 * found.drift_bound_m(IONOSPHERE_MPS), 0.0),
        )
        return replace(chosen, pseudorange_m=np.where(here, found.range_m, chosen.pseudorange_m)), quality

    def _wavelength_m(self, block: ObservationBlock) -> Floats:
        """(E, S): of pairs that of the first."""
        channel = np.array([self._channels.get(satellite, 0) for satellite in block.satellites], dtype=np.int64)
        return np.broadcast_to(wavelengths_m(block.signals, channel[None]), (len(block.epoch_ns), len(block.signals)))

    def _watch(self, both: ObservationBlock, arcs: Arcs) -> None:
        names = np.array(both.satellites)
        on_another = np.zeros(arcs.measured.shape, dtype=np.bool_)
        for s, satellite in enumerate(both.satellites):
            on_another[..., s] = arcs.measured[..., names == satellite].sum(axis=-1) > 1
        checked = arcs.measured & (on_another | np.isfinite(both.doppler_hz) | np.isfinite(both.lock_s))
        self.watched = Watched(self.watched.phases + int(arcs.measured.sum()), self.watched.checkable + int(checked.sum()))


def _of_codes(block: ObservationBlock, second: bool) -> ObservationBlock:
    """The signals of the first codes, with those of the second."""
    columns = [
        s
        for s, signal in enumerate(block.signals)
        if (code := signal.partition(".")[2]) in FIRST_CODES.get(signal[0], ()) or (second and code in SECOND_CODES.get(signal[0], ()))
    ]
    if len(columns) == len(block.signals):
        return block
    return columns_of(block, columns)
