"""What monitors with memory watch of receivers, once their positions and clocks are there: part of step 4 of the main path."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from integrity.assembler import AlignedEpoch
from integrity.config import HostClock
from integrity.gnss.observations import Bools, Floats, Ints
from integrity.limits import Limits
from integrity.monitors import clocks, signal, slow, told
from integrity.monitors.residuals import ClockDesign
from integrity.monitors.triangles import Variances


class ReceiverMemory(NamedTuple):
    """What is remembered of receivers: their clocks, how far they stand off, their gains."""

    clocks: clocks.ClockMemory
    slow: slow.SlowMemory
    gains: signal.GainMemory

    @staticmethod
    def empty(n_receivers: int) -> "ReceiverMemory":
        """Before the first epoch."""
        return ReceiverMemory(
            clocks.ClockMemory.empty(n_receivers), slow.SlowMemory.empty(n_receivers), signal.GainMemory.empty(n_receivers)
        )


class Heard(NamedTuple):
    """What came with the epochs of a block beside measurements: gains (E, R), by how much GNSS time and the host's differ, s (E,), and of
    how many satellites each receiver was `fed` another set than the others (E, R)."""

    gain: Floats
    host_s: Floats
    fed: Floats


class ReceiverStatistics(NamedTuple):
    """Of a block: clocks, slow shifts, drop of gains (E, R), host time in s (E,)."""

    clocks: clocks.ClockStatistics
    slow: slow.SlowStatistics
    gain_drop: Floats
    host_s: Floats


def heard_with(epochs: Sequence[AlignedEpoch], epoch_ns: Ints, receivers: Sequence[str], host_clock: HostClock) -> Heard:
    """What came with aligned epochs."""
    arrived_ns = np.array([epoch.heard_mono_ns for epoch in epochs], dtype=np.int64)
    host_s = clocks.host_disagreement_s(epoch_ns, arrived_ns, [epoch.tick for epoch in epochs], host_clock)
    fed = np.array([told.fed(epoch.disputes, receivers, epoch.epoch_ns) for epoch in epochs])
    return Heard(signal.gains([epoch.statuses for epoch in epochs], receivers), host_s, fed)


def watch_receivers(
    memory: ReceiverMemory,
    epoch_ns: Ints,
    heard: Heard,
    quiet: Bools,
    e_enu_m: Floats,
    var: Variances,
    clock_m: Floats,
    of: ClockDesign,
    limits: Limits,
) -> tuple[ReceiverMemory, ReceiverStatistics]:
    """The memory after a block, and what its receivers show: displacements (E, R, 3) with their variances, and clocks (E, R, K) by their
    design. Slow shifts are looked for in `quiet` epochs (E,), in which nothing else fails: what is seen at once is not slow."""
    sigma_m = 1.0 / np.sqrt(of.weight[..., 0].T)
    of_clocks, clock = clocks.advance(memory.clocks, epoch_ns, clock_m, sigma_m)
    stands_m = np.where(quiet[:, None, None], e_enu_m, np.nan)
    of_slow, stood_off = slow.advance(memory.slow, epoch_ns, stands_m, var.differential, limits.slow)
    of_gains, gain_drop = signal.advance(memory.gains, epoch_ns, heard.gain)
    return ReceiverMemory(of_clocks, of_slow, of_gains), ReceiverStatistics(clock, stood_off, gain_drop, heard.host_s)
