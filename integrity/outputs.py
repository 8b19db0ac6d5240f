"""What comes out of a `StationMonitor`: a report per epoch, health to publish, and an alert per change of state."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from integrity.exclusion import Channel, Exclusion
from integrity.gnss.observations import Bools, Floats, Ints, freeze
from integrity.states import Cause, Outcome, State
from integrity.verdict import Verdict
from integrity.vouching import MonitoredSignal


@dataclass(frozen=True, eq=False)
class EpochReport:
    """The record of why. `state, cause, subjects` are what is published after this epoch; `verdict` is of this epoch alone;
    `exclusions` are the satellites that are out, `channels` what was left out of this epoch without blame.

    Per receiver: `e_enu_m` (R, 3), solved minus surveyed, NaN where unsolved, and why, `unsolved` (R,); `satellites_used` (R,).
    Per check: `statistic`, `threshold`, `outcome` (C,). Per signal: `used` (S,), `residual_sigmas` (S,), `b_m` (R, S).
    """

    gps_time_ns: int
    mono_ns: int
    state: State
    cause: Cause
    subjects: tuple[str, ...]
    verdict: Verdict
    triangle_alone: State
    exclusions: tuple[Exclusion, ...]
    channels: tuple[Channel, ...]
    receivers: tuple[str, ...]
    e_enu_m: Floats
    unsolved: NDArray[np.int64]
    satellites_used: Ints
    check_names: tuple[str, ...]
    statistic: Floats
    threshold: Floats
    outcome: NDArray[np.int64]
    signals: tuple[str, ...]
    used: Bools
    residual_sigmas: Floats
    b_m: Floats

    def __post_init__(self) -> None:
        freeze(self)

    @property
    def not_monitored(self) -> tuple[str, ...]:
        """Checks that had no input."""
        return tuple(
            name for name, outcome in zip(self.check_names, self.outcome.tolist(), strict=True) if outcome == Outcome.NOT_MONITORED
        )

    @property
    def excluded(self) -> tuple[str, ...]:
        """Satellites on the exclusion list, sorted."""
        return tuple(x.satellite for x in self.exclusions)


@dataclass(frozen=True)
class HealthReport:
    """What is published after an epoch, or as a heartbeat while a stream is silent (`gps_time_ns` is then of the last epoch).

    `mono_ns`: when the epoch was complete, or silence seen; `issued_mono_ns`: when it was measured, from which validity runs.
    """

    sequence: int
    gps_time_ns: int | None
    mono_ns: int
    issued_mono_ns: int
    valid_for_ms: int
    state: State
    cause: Cause
    subjects: tuple[str, ...]
    reasons: tuple[str, ...]
    not_monitored: tuple[str, ...]
    vouched: tuple[MonitoredSignal, ...]
    excluded: tuple[str, ...]

    @property
    def monitored(self) -> tuple[str, ...]:
        """Signals that a train may use."""
        return tuple(of.signal for of in self.vouched)


@dataclass(frozen=True)
class Alert:
    """One change of the published state or its cause."""

    gps_time_ns: int | None
    mono_ns: int
    before: State
    state: State
    cause: Cause
    subjects: tuple[str, ...]
    reasons: tuple[str, ...]


Output = EpochReport | HealthReport | Alert
