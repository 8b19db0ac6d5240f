"""Sights of a stream for tests of what carriers show, cut into blocks anywhere."""

from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from integrity.assembler import AlignedEpoch, Assembler, AssemblerState
from integrity.carrier_thresholds import CARRIER_CHECKS, CarrierDesign, carrier_design, carrier_thresholds
from integrity.carrier_watch import CarrierMemory, watch
from integrity.config import SiteConfig
from integrity.events import Event, RawBytes
from integrity.gnss.ephemeris.store import EphemerisStore
from integrity.gnss.observations import Floats
from integrity.gnss.positioning import points_at
from integrity.limits import NAMED_RATHER
from integrity.sight import Sight, observe
from integrity.thresholds import Promises
from integrity.triangle import reference_triangle
from tests.unit.streams import limits_of


class Shown(NamedTuple):
    """What carriers show, by check and signal (E,), after a stream; the memory then."""

    signals: dict[str, dict[str, Floats]]
    memory: CarrierMemory

    def worst(self, check: str, but: str = "", since: int = 0) -> float:
        """The largest statistic of a check, of other satellites than one, from an epoch on."""
        return float(np.nanmax([shown[since:] for signal, shown in self.signals[check].items() if not but or not signal.startswith(but)]))


def design_of(site: SiteConfig) -> CarrierDesign:
    thresholds = carrier_thresholds(Promises(site, reference_triangle(site)))
    return carrier_design(site.epoch_interval_ns / 1e9, {threshold.name: threshold.value for threshold in thresholds}, NAMED_RATHER)


def sights_of(site: SiteConfig, events: Sequence[Event], cuts: Sequence[int] = ()) -> list[Sight]:
    """Blocks that begin at the epochs `cuts` too, and where the terms of the ionosphere change."""
    store = EphemerisStore()
    limits, points = limits_of(site), points_at(reference_triangle(site).pos_ecef_m)
    assembler = Assembler(site.receiver_names, site.epoch_interval_ns, limits, AssemblerState(), store)
    epochs = [
        item for item in assembler.take(event for event in events if not isinstance(event, RawBytes)) if isinstance(item, AlignedEpoch)
    ]
    others = [e for e, (a, b) in enumerate(pairwise(epochs), 1) if a.klobuchar != b.klobuchar]
    begins = sorted({0, len(epochs), *others, *(cut for cut in cuts if cut < len(epochs))})
    return [observe(epochs[a:b], store, points, site, limits, (), None, None) for a, b in pairwise(begins)]


def watched(site: SiteConfig, sights: Sequence[Sight], memory: CarrierMemory | None = None) -> Shown:
    """What carriers show in blocks one after the other, from a memory on; NaN where a block does not list a signal."""
    design, points = design_of(site), points_at(reference_triangle(site).pos_ecef_m)
    after = memory or CarrierMemory.empty(len(site.receivers), design.motion.half_epochs)
    names = sorted({signal for sight in sights for signal in sight.block.signals})
    parts: dict[str, dict[str, list[Floats]]] = {check: {name: [] for name in names} for check in CARRIER_CHECKS}
    for sight in sights:
        after, found = watch(after, sight, points, design)
        unknown = np.full(len(sight.block.epoch_ns), np.nan)
        for of in found:
            by_signal = dict(zip(sight.block.signals, of.statistic.T, strict=True))
            for name in names:
                parts[of.check][name].append(by_signal.get(name, unknown))
    return Shown({check: {name: np.concatenate(of) for name, of in by.items()} for check, by in parts.items()}, after)
