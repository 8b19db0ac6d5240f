"""Does the train ask to be stopped? Pure, and once asked for, latched: it is released from outside, and not before trust is back.

    at once       a station whose word counts here says SATELLITE_ANOMALY or NOT_CONFIRMABLE, or stations contradict each other
    after a while trust has not been NORMAL for `after_ns`, whatever the reason

A train begins with a stop that is asked for and not latched: nothing has been lost yet. That one falls with the first VALID position.
Source: train_positioning.md section 3, rules 4 and 7.
"""

from dataclasses import dataclass, replace
from enum import Enum
from typing import NamedTuple

from train_client.trust import TrustState


class StopState(Enum):
    """Whether a stop is asked for, and how it ends."""

    NONE = "NONE"
    REQUESTED = "REQUESTED"  # falls with the next VALID position
    LATCHED = "LATCHED"  # until it is released


class StopLimits(NamedTuple):
    """How long trust may be away, and whether a stop needs a release from outside."""

    after_ns: int
    latches: bool


@dataclass(frozen=True)
class Stop:
    """What is remembered. `lost_ns`: since when trust has not been NORMAL; `valid_again`: a position has been VALID since it is."""

    state: StopState = StopState.REQUESTED
    reasons: tuple[str, ...] = ("no position has been VALID yet",)
    since_ns: int | None = None
    lost_ns: int | None = None
    valid_again: bool = False


def after_moment(now: Stop, trust: TrustState, denied: str, mono_ns: int, limits: StopLimits) -> Stop:
    """With this trust at `mono_ns`; `denied` says who speaks against it, "" if nobody does."""
    if trust is TrustState.NORMAL:
        return now if now.lost_ns is None else replace(now, lost_ns=None)
    lost_ns = mono_ns if now.lost_ns is None else min(now.lost_ns, mono_ns)
    lost = replace(now, lost_ns=lost_ns, valid_again=False)
    why = denied or (f"trust has been away for {limits.after_ns / 1e9:g} s" if mono_ns - lost_ns >= limits.after_ns else "")
    if now.state is not StopState.NONE or not why:
        return lost
    return replace(lost, state=StopState.LATCHED if limits.latches else StopState.REQUESTED, reasons=(why,), since_ns=mono_ns)


def after_valid(now: Stop) -> Stop:
    """A position was VALID."""
    if now.state is StopState.REQUESTED:
        return Stop(StopState.NONE, (), valid_again=True)
    return now if now.valid_again else replace(now, valid_again=True)


def released(now: Stop) -> Stop | str:
    """After a release from outside; or in words why it does not count."""
    if now.state is not StopState.LATCHED:
        return "no stop is latched"
    if now.lost_ns is not None or not now.valid_again:
        return "the train has no VALID position yet"
    return Stop(StopState.NONE, (), valid_again=True)


def due_ns(now: Stop, limits: StopLimits) -> int | None:
    """When `after_moment` will ask for a stop if trust stays away; None: not at all."""
    return now.lost_ns + limits.after_ns if now.state is StopState.NONE and now.lost_ns is not None else None
