"""What is known of a block of one receiver before it is solved: its satellites, its ranges' sigmas, and how it looks from points."""

from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from integrity.gnss.atmosphere import Ionosphere
from integrity.gnss.ephemeris.broadcast import Ephemeris
from integrity.gnss.ephemeris.states import SatelliteStates, accuracy_m, satellite_states, usable
from integrity.gnss.ephemeris.store import EphemerisStore
from integrity.gnss.least_squares import Design, design
from integrity.gnss.observations import ROW_ARRAYS, Bools, Floats, Ints, ObservationBlock
from integrity.gnss.positioning import Expected, Points, Prefit, compared, expected, range_accuracy_m, range_sigma_m, state_time_ns
from integrity.gnss.range_errors import Quality, parts_of, sigma_of_parts_m
from integrity.gnss.signals import TIME_SCALES, Codes, bands_of, time_scale_index

if TYPE_CHECKING:
    from recordings.solve.smoothing import Smoother


class Weights(NamedTuple):
    """The range sigma of one frequency that is expected, sqrt(a^2 + (b / sin el)^2) (of pairs see `range_errors`), and the elevation from
    which on satellites are used."""

    a_m: float
    b_m: float
    mask_rad: float


class Sky:
    """Broadcast data of a recording: each epoch uses what had been transmitted by then, or, where that is nothing, what came next."""

    def __init__(self, ephemerides: Iterable[Ephemeris], ionosphere: Ionosphere | None) -> None:
        in_order = sorted(dict.fromkeys(ephemerides), key=lambda eph: eph.transmission_ns)
        self.store = EphemerisStore(in_order)
        self.ionosphere = ionosphere
        self._transmission_ns = np.array([eph.transmission_ns for eph in in_order], dtype=np.int64)
        numbers: dict[str, list[int]] = {}
        for number, eph in enumerate(in_order):
            numbers.setdefault(eph.satellite, []).append(number)
        self._numbers = {satellite: np.array(mine, dtype=np.int64) for satellite, mine in numbers.items()}

    def choose(self, satellites: Sequence[str], epoch_ns: Ints) -> Ints:
        """Index (E, S) into the store's ephemerides, -1 for none; `epoch_ns` (E,) does not decrease."""
        arrived = np.searchsorted(self._transmission_ns, epoch_ns, "right").astype(np.int64)
        index = self.store.choose(satellites, epoch_ns, arrived)
        missing = index < 0
        for s in np.flatnonzero(missing.any(axis=0)).tolist():
            mine = self._numbers.get(satellites[s])
            if mine is not None:
                following = mine[np.minimum(np.searchsorted(mine, arrived), len(mine) - 1)] + 1
                for known in (following, np.full(len(epoch_ns), len(self.store))):  # one after the next, should that be another day's
                    later = self.store.choose(satellites[s : s + 1], epoch_ns, np.maximum(known, arrived))[:, 0]
                    index[:, s] = np.where(index[:, s] >= 0, index[:, s], later)
        return index


class Seen(NamedTuple):
    """A block with all that its satellites are known to do, before it is looked at from anywhere."""

    block: ObservationBlock
    ephemeris: Ints  # (E, S): index of the one that serves, -1 for none
    states: SatelliteStates
    usable: Bools  # (E, S)
    accuracy_m: Floats  # (E, S)
    quality: Quality | None
    system_of: Ints  # (S,)


class View(NamedTuple):
    """A block seen from points: residuals there, with their sigmas, and the design of the satellites above the mask."""

    points: Points
    sight: Expected
    first: Prefit
    sigma_m: Floats
    of: Design


def seen_of(block: ObservationBlock, codes: Codes, sky: Sky, smoother: "Smoother | None") -> Seen:
    """A block whose times do not decrease, with one signal of these codes of each satellite."""
    quality = None
    if smoother is not None:
        block, quality = smoother.smoothed(block)
    columns = _one_signal_each(block, codes)
    if columns is not None:
        block, quality = columns_of(block, columns), None if quality is None else Quality(*(part[..., columns] for part in quality))
    ephemerides, index = sky.store.ephemerides, sky.choose(block.satellites, block.epoch_ns)
    states = satellite_states(ephemerides, index, state_time_ns(block.epoch_ns), block.signals)
    system_of = np.array([time_scale_index(s) for s in block.satellites], dtype=np.int64)
    promised_m = range_accuracy_m(states, accuracy_m(ephemerides, index))
    return Seen(block, index, states, usable(ephemerides, index), promised_m, quality, system_of)


def _one_signal_each(block: ObservationBlock, codes: Codes) -> list[int] | None:
    """Columns of the signals of each satellite that were measured most often, the first of equals; None where that is all of them."""
    place = {signal: s for s, signal in enumerate(block.signals)}
    measured = np.isfinite(block.pseudorange_m).sum(axis=(0, 1))
    found = {}
    for satellite in dict.fromkeys(block.satellites):
        named = (f"{satellite}.{code}" for code in codes.get(satellite[0], ()))
        found[satellite] = max((place[signal] for signal in named if signal in place), key=measured.__getitem__, default=None)
    columns = [s for s in found.values() if s is not None]
    return None if len(columns) == len(block.signals) else columns


def columns_of(block: ObservationBlock, columns: list[int]) -> ObservationBlock:
    """A block of some of the signals, in the order given."""
    arrays: dict[str, Any] = {name: np.take(getattr(block, name), columns, axis=2) for name in ROW_ARRAYS}
    return replace(
        block, signals=tuple(block.signals[s] for s in columns), satellites=tuple(block.satellites[s] for s in columns), **arrays
    )


def epochs_of(seen: Seen, few: Ints | slice, sky: Sky) -> Seen:
    """Some of the epochs."""
    block = few_epochs(seen.block, few)
    states = satellite_states(sky.store.ephemerides, seen.ephemeris[few], state_time_ns(block.epoch_ns), block.signals)
    quality = None if seen.quality is None else Quality(*(part[few] for part in seen.quality))
    return Seen(block, seen.ephemeris[few], states, seen.usable[few], seen.accuracy_m[few], quality, seen.system_of)


def few_epochs(block: ObservationBlock, few: Ints | slice) -> ObservationBlock:
    """A block of some of the epochs, in the order given."""
    return replace(block, **{name: getattr(block, name)[few] for name in ("epoch_ns", "receive_time_ns", *ROW_ARRAYS)})


def view_of(seen: Seen, sky: Sky, weights: Weights, points: Points) -> View:
    """A block from points, one for all epochs or one for each."""
    sight = expected(seen.states, seen.block.epoch_ns, points, sky.ionosphere)
    first = compared(seen.block, sight)
    promised_m, signals = seen.accuracy_m[:, None], seen.block.signals
    if seen.quality is None and all(len(bands_of(signal)) == 1 for signal in signals):
        sigma_m = range_sigma_m(first.el_rad, weights.a_m, weights.b_m, promised_m)
    else:
        sigma_m = sigma_of_parts_m(first.el_rad, parts_of(signals, weights.a_m, weights.b_m), promised_m, *(seen.quality or ()))
    used = (first.el_rad >= weights.mask_rad) & seen.usable[:, None] & np.isfinite(first.residual_m)
    return View(points, sight, first, sigma_m, design(first.los_enu, sigma_m, used, seen.system_of, len(TIME_SCALES)))
