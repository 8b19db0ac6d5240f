"""Signals received otherwise than usual, receiver by receiver: evidence of jamming, or of a transmitter that is stronger than the sky.

Nothing here stops a train: power alone moves no position, and a receiver's own word on interference is known to come in clear air and to
fail to come in bad. `streams` has the checks of what two or more receivers show; here stands what one shows, in words, and who says
nothing. The gain that a receiver sets (AGC) falls where the antenna delivers more power than noise: together with weaker signals that is
jamming, with signals as strong as ever, or stronger, it is what a spoofer does (Akos, Navigation 59, 2012).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from math import exp, isnan, nan
from typing import NamedTuple

import numpy as np

from integrity.assembler import Statuses
from integrity.gnss.gps_time import NS_PER_S
from integrity.gnss.observations import Floats, Ints, freeze
from integrity.gnss.receiver_status import ReceiverStatus

AGC_TIME_CONSTANT_S = 3600.0  # the baseline follows the temperature of amplifiers and cables
SPEAKS_OF = ("agc", "jamming", "spoofing")  # fields of `ReceiverStatus`


@dataclass(frozen=True, eq=False)
class GainMemory:
    """Usual gain of each receiver (R,), from 0 to 1, NaN before the first; GPS time of the last epoch."""

    epoch_ns: int
    usual: Floats

    def __post_init__(self) -> None:
        freeze(self)

    @staticmethod
    def empty(n_receivers: int) -> "GainMemory":
        """Before the first epoch."""
        return GainMemory(0, np.full(n_receivers, nan))


class Unusual(NamedTuple):
    """How far something is from usual before it is told: drop of C/N0, dB; share of signals lost; drop of the gain, of its range."""

    cn0_drop_db: float
    lost_share: float
    gain_drop: float


def gains(statuses: Sequence[Statuses], receivers: Sequence[str]) -> Floats:
    """The gain of each receiver (E, R) by what it said last at each epoch, NaN where it has not."""
    result = np.full((len(statuses), len(receivers)), nan)
    said: Statuses | None = None
    row = result[:0]
    for e, now in enumerate(statuses):
        if now is not said:  # rarely: once a second
            of = dict(now)
            row = np.array([_number(of.get(receiver, ReceiverStatus()).agc) for receiver in receivers])
            said = now
        result[e] = row
    return result


def _number(value: float | None) -> float:
    return nan if value is None else value


def advance(memory: GainMemory, epoch_ns: Ints, gain: Floats) -> tuple[GainMemory, Floats]:
    """The memory after a block, and by how much each receiver's gain (E, R) is below its usual one, (E, R); NaN where it does not say.

    A receiver without a usual gain begins with the one it has. The usual one follows by a low pass of an hour, whichever way.
    """
    drop = np.full(gain.shape, nan)
    if np.isnan(gain).all():
        return GainMemory(int(epoch_ns[-1]), memory.usual), drop
    before_ns, usual = memory.epoch_ns, memory.usual.tolist()
    for e, (now_ns, row) in enumerate(zip(epoch_ns.tolist(), gain.tolist(), strict=True)):
        share = 1.0 - exp((before_ns - now_ns) / NS_PER_S / AGC_TIME_CONSTANT_S)
        for r, value in enumerate(row):
            if not isnan(value):
                below = 0.0 if isnan(usual[r]) else usual[r] - value
                drop[e, r] = below
                usual[r] = value if isnan(usual[r]) else usual[r] - share * below
        before_ns = now_ns
    return GainMemory(before_ns, np.array(usual)), drop


def remarks(receivers: Sequence[str], cn0_drop_db: Floats, lost_share: Floats, gain_drop: Floats, unusual: Unusual) -> tuple[str, ...]:
    """Of one epoch, each (R,), what each receiver shows, in words for people: one sentence per receiver, in their order."""
    found = []
    for receiver, cn0_db, lost, gain in zip(receivers, cn0_drop_db.tolist(), lost_share.tolist(), gain_drop.tolist(), strict=True):
        weaker, louder = cn0_db > unusual.cn0_drop_db or lost > unusual.lost_share, gain > unusual.gain_drop
        if weaker or louder or cn0_db < -unusual.cn0_drop_db:
            said = [f"C/N0 {'fell' if cn0_db > 0.0 else 'rose'} by {abs(cn0_db):.1f} dB"] if abs(cn0_db) > unusual.cn0_drop_db else []
            said += [f"{lost:.0%} of its signals are gone"] if lost > unusual.lost_share else []
            said += [f"its gain fell by {gain:.0%} of its range"] if louder else []
            why = "interference" if weaker else "a transmitter stronger than the sky"
            found.append(f"{receiver}: {', '.join(said)}: {why}?")
    return tuple(found)


@lru_cache(maxsize=4)
def silent_on(statuses: Statuses, receivers: tuple[str, ...]) -> tuple[str, ...]:
    """What receivers do not say of themselves, as `jamming_A`: not monitored, whatever they may hear."""
    of = dict(statuses)
    quiet = ReceiverStatus()
    return tuple(f"{name}_{receiver}" for name in SPEAKS_OF for receiver in receivers if getattr(of.get(receiver, quiet), name) is None)
