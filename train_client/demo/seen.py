"""What of all that was seen belongs to a phase, and the times that a row compares. Pure."""

import math
from collections.abc import Iterable, Sequence
from itertools import pairwise
from typing import NamedTuple

from integrity.states import State
from train_client.demo.records import HealthSeen, PositionSeen, Records
from train_client.outputs import Status
from train_client.simulate.story import Phase
from train_client.trust import TrustState


class Stretch(NamedTuple):
    """What was seen of the epochs of a phase."""

    epochs: int
    health: tuple[HealthSeen, ...]
    positions: tuple[PositionSeen, ...]

    @property
    def valid(self) -> int:
        """Epochs with a VALID position."""
        return len({p.gps_time_ns for p in self.positions if p.status is Status.VALID})


def stretch(phase: Phase, records: Records) -> Stretch:
    """By the GPS time of epochs."""
    from_ns, to_ns = records.gps_ns(phase.start_s), records.gps_ns(phase.end_s)
    return Stretch(
        sum(from_ns <= gps < to_ns for gps in records.sent_ns),
        tuple(h for h in records.health if h.gps_time_ns is not None and from_ns <= h.gps_time_ns < to_ns),
        tuple(p for p in records.positions if p.gps_time_ns is not None and from_ns <= p.gps_time_ns < to_ns),
    )


def rms(errors: Sequence[float]) -> float:
    """Root mean square; NaN of nothing, which passes no check."""
    return math.sqrt(sum(e * e for e in errors) / len(errors)) if errors else math.nan


def last_covered_ns(until_ns: int, records: Records) -> int:
    """When the last epoch was sent that the station had vouched for until then, as this process or as the train has heard it."""
    normals = [h.gps_time_ns for h in records.health if h.state is State.NORMAL and h.arrived_ns < until_ns]
    valids = [p.gps_time_ns for p in records.positions if p.status is Status.VALID and p.arrived_ns < until_ns]
    covered_ns = max((gps for gps in (*normals, *valids) if gps is not None), default=0)
    return records.sent_ns.get(covered_ns, 0)


def stops(positions: Sequence[PositionSeen], from_ns: int) -> Iterable[int]:
    """When the train said that it trusts no more, having trusted before."""
    for before, now in pairwise(positions):
        if now.arrived_ns >= from_ns and before.trust is TrustState.NORMAL and now.trust is not TrustState.NORMAL:
            yield now.arrived_ns


def returned_s(end_ns: int, records: Records) -> float:
    """From a moment to the first position under NORMAL trust."""
    return since_s(end_ns, (p.arrived_ns for p in records.positions if p.arrived_ns >= end_ns and p.trust is TrustState.NORMAL))


def since_s(from_ns: int, times_ns: Iterable[int]) -> float:
    """From a moment to the first of others; infinite where there is none, which passes no check."""
    return min(((t - from_ns) / 1e9 for t in times_ns), default=math.inf)
