"""Two frequencies of a satellite combined into one range that the ionosphere does not delay, to the first order.

A pair is a signal like any other, `G05.1C+2W`: `satellite_states` knows what group delays it has, `expected` that no ionosphere is in it.
"""

from functools import lru_cache

import numpy as np

from integrity.gnss.observations import Floats, Ints, ObservationBlock
from integrity.gnss.signals import FIRST_CODES, SECOND_CODES, bands_of, ionosphere_free_weights, satellite_of


def ionosphere_free(block: ObservationBlock) -> ObservationBlock:
    """The block of all pairs of a first and a second signal (`FIRST_CODES`, `SECOND_CODES`), of each satellite the preferred one first.

    Pseudoranges, m; noise is about three times that of one signal (GPS L1 and L2: 2.98 for equal noise), see `weights_of`. The carrier is
    combined likewise, in cycles of the first: times its wavelength it is free of ionosphere as the pseudorange is. Doppler is that of the
    first alone: the ionosphere changes it by less than 1 mm/s, a combination would have three times its noise. C/N0 and lock time are those
    of the weaker of the two, slips and half cycles of either. A satellite without a pair has no column.
    """
    pairs, first, second, weight, longer = _pairs(block.signals)

    def both(name: str) -> tuple[Floats, Floats]:
        values = getattr(block, name)
        return values[..., first], values[..., second]

    near, far = both("pseudorange_m")
    near_cycles, far_cycles = both("carrier_cycles")
    return ObservationBlock(
        receivers=block.receivers,
        signals=pairs,
        satellites=tuple(satellite_of(pair) for pair in pairs),
        epoch_ns=block.epoch_ns,
        receive_time_ns=block.receive_time_ns,
        pseudorange_m=weight[0] * near + weight[1] * far,
        carrier_cycles=weight[0] * near_cycles + weight[1] * longer * far_cycles,
        doppler_hz=block.doppler_hz[..., first],
        cn0_dbhz=np.minimum(*both("cn0_dbhz")),
        lock_s=np.minimum(*both("lock_s")),
        slip=np.logical_or(*both("slip")),
        half_cycle=np.logical_or(*both("half_cycle")),
    )


MOST_WEIGHT = 5.0  # of L1 and L2 2.5; bands closer to each other make more noise than the ionosphere is worth


def weights_of(signal: str) -> tuple[float, float]:
    """By which the ranges of its two frequencies add up, (1, 0) of one that stands alone; NaN where a band is none of the system.

    The noise of a pair is k = sqrt(w_1^2 + w_2^2) that of a signal: of GPS L1 and L2 2.98, of E1 and E5a 2.59, of B1I and B3I 3.53.
    """
    bands = bands_of(signal)
    if len(bands) == 1:
        return 1.0, 0.0
    return ionosphere_free_weights(signal[:1], *bands) or (float("nan"), float("nan"))


@lru_cache(maxsize=64)
def _pairs(signals: tuple[str, ...]) -> tuple[tuple[str, ...], Ints, Ints, Floats, Floats]:
    """Names of the pairs, (P,), where their two signals stand, the weights of these, (2, P), and how many times the second's wavelength is
    the first's, (P,); of GLONASS the channels' have one ratio."""
    place = {signal: s for s, signal in enumerate(signals)}
    found = []
    for satellite in dict.fromkeys(satellite_of(signal) for signal in signals):
        for one in FIRST_CODES.get(satellite[0], ()):
            for two in SECOND_CODES.get(satellite[0], ()):
                weights = ionosphere_free_weights(satellite[0], *bands_of(f"{satellite}.{one}+{two}"))
                if weights is not None and weights[0] <= MOST_WEIGHT and f"{satellite}.{one}" in place and f"{satellite}.{two}" in place:
                    found.append((f"{satellite}.{one}+{two}", place[f"{satellite}.{one}"], place[f"{satellite}.{two}"], weights))
    columns = np.array([(first, second) for _, first, second, _ in found], dtype=np.int64).reshape(-1, 2).T
    weight = np.array([weights for *_, weights in found]).reshape(-1, 2).T
    longer = np.sqrt(weight[0] / -weight[1])  # gamma is the square of the ratio of frequencies
    return tuple(name for name, *_ in found), columns[0], columns[1], weight, longer
