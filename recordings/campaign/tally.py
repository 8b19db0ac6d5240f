"""Counts of trials with their bounds: a share is never published without what it could be."""

from dataclasses import dataclass
from typing import TypedDict

from scipy.special import betaincinv

CONFIDENCE = 0.95


@dataclass(frozen=True)
class Share:
    """So many of so many."""

    count: int
    of: int

    @property
    def low(self) -> float:
        """Lower end of the two-sided 95 % interval; Clopper and Pearson 1934."""
        return 0.0 if self.count == 0 else float(betaincinv(self.count, self.of - self.count + 1, (1.0 - CONFIDENCE) / 2.0))

    @property
    def high(self) -> float:
        """Upper end of the same."""
        return 1.0 if self.count == self.of else float(betaincinv(self.count + 1, self.of - self.count, (1.0 + CONFIDENCE) / 2.0))

    @property
    def at_most(self) -> float:
        """One-sided 95 % upper bound: 3 / n where nothing was counted."""
        return 1.0 if self.count == self.of else float(betaincinv(self.count + 1, self.of - self.count, CONFIDENCE))


class BoundedShare(TypedDict):
    """A share as JSON: two-sided 95 % bounds and the one-sided upper one; None of nothing."""

    count: int
    of: int
    low: float | None
    high: float | None
    at_most: float | None


def bounded(share: Share) -> BoundedShare:
    """A share with its bounds; of nothing there is no share."""
    if not share.of:
        return {"count": 0, "of": 0, "low": None, "high": None, "at_most": None}
    low, high, at_most = (rounded(bound) for bound in (share.low, share.high, share.at_most))
    return {"count": share.count, "of": share.of, "low": low, "high": high, "at_most": at_most}


def rounded(value: float) -> float:
    """To three figures, which is more than trials can say."""
    return float(f"{value:.3g}")
