"""The verdict of one epoch: the worst of its checks, its cause, its subject. No memory.

The cause is the first that matches, in the order of `cause_of`. Nothing here can make an epoch clean that has a check at FAIL or
UNKNOWN: NORMAL is reached only where there is none.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from integrity.carrier_thresholds import MOTION_CHECKS
from integrity.config import Rule, SatelliteFaultPolicy
from integrity.exclusion import Exclusion
from integrity.gnss.observations import Bools, Floats, Ints
from integrity.gnss.signals import SYSTEM_NAMES
from integrity.limits import Limits
from integrity.states import STATE_OF_CAUSE, Cause, Outcome, State


@dataclass(frozen=True)
class Verdict:
    """What one epoch says. `check`, `statistic`, `threshold` are of the check that weighs most; `reasons` are for people."""

    state: State
    cause: Cause
    subjects: tuple[str, ...] = ()
    check: str = ""
    statistic: float = float("nan")
    threshold: float = float("nan")
    reasons: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        if self.state is not (State.NORMAL if self.cause is Cause.NONE else STATE_OF_CAUSE[self.cause]):
            raise ValueError(f"cause {self.cause!r} does not give state {self.state}")


OF_SATELLITES = ("residual", "constellation", *MOTION_CHECKS)  # what a triangle that is dragged away sets off before it has gone far
CLEAN = Verdict(State.NORMAL, Cause.NONE)


class Checks(NamedTuple):
    """The checks of a block: `names` (C,), `statistic` (E, C), `threshold` (C,), `outcome` (E, C) of `Outcome`."""

    names: tuple[str, ...]
    statistic: Floats
    threshold: Floats
    outcome: Ints


class Evidence(NamedTuple):
    """What one epoch has to say beyond its checks: needed only where it is not clean."""

    receivers: tuple[str, ...]
    repeating: Bools  # (R,)
    short: Bools  # (R,) the receiver for which there are too few common satellites, if it is one
    named: Bools  # (R,) the receiver that the naming rules name, if any
    collapsed: bool  # the solved points are one point
    captured: Bools  # (R,) receivers of pairs that hear one transmitter, by their ranges
    displaced: bool  # all ranges, or all carriers, are those of a triangle that is dragged away
    fed: Bools  # (R,) receivers that were told of several satellites otherwise than the others
    exclusions: tuple[Exclusion, ...]
    acute: tuple[Exclusion, ...]  # those of them that have not been clean for as long as whatever fails must be
    enough_without_exclusion: bool  # the common set would be large enough with the excluded satellites
    swapped: str  # a permutation of the surveyed points that fits what was solved, in words


def judge(statistics: Mapping[str, Floats], limits: Limits) -> Checks:
    """Outcomes of all checks of a block. NaN does not pass: UNKNOWN where the check is required, NOT_MONITORED where it is not."""
    names, threshold = limits.names, limits.values
    statistic = np.array([statistics[name] for name in names]).T
    failed = np.where(np.isnan(statistic), limits.without_result, int(Outcome.FAIL))
    outcome = np.where(statistic <= threshold, int(Outcome.PASS), failed)
    return Checks(names, statistic, threshold, outcome)


@lru_cache(maxsize=8)
def passed_over(names: tuple[str, ...], rule: Rule) -> Bools:
    """Which checks a rule does not look at (C,): none, or all but those of the reference triangle alone."""
    return np.array([rule == "triangle" and not (n == "shape" or n == "data" or n.startswith("circle_")) for n in names])


def clean_epochs(checks: Checks, rule: Rule) -> Bools:
    """Epochs (E,) without a FAIL or UNKNOWN among the checks of the rule."""
    fine = (checks.outcome < int(Outcome.UNKNOWN)) | passed_over(checks.names, rule)
    result: Bools = np.logical_and.reduce(fine, axis=-1)
    return result


def fails_only(checks: Checks, name: str) -> Bools:
    """Epochs (E,) in which this check fails and no other one does or is unknown."""
    bad = checks.outcome >= Outcome.UNKNOWN
    result: Bools = bad[:, checks.names.index(name)] & (bad.sum(axis=-1) == 1)
    return result


def triangle_verdict(checks: Checks, e: int) -> Verdict:
    """The source's rule, nothing else: no data or a broken shape is NOT_CONFIRMABLE, a vertex outside its circle SATELLITE_ANOMALY."""
    outcome = dict(zip(checks.names, checks.outcome[e], strict=True))
    circles = [n for n in checks.names if n.startswith("circle_")]
    if outcome["data"] != Outcome.PASS or any(outcome[n] == Outcome.UNKNOWN for n in [*circles, "shape"]):
        return _verdict(checks, e, Cause.DATA, (), ("data", *circles, "shape"))
    if outcome["shape"] != Outcome.PASS:
        return _verdict(checks, e, Cause.AMBIGUOUS, (), ("shape",))
    if any(outcome[n] != Outcome.PASS for n in circles):
        return _verdict(checks, e, Cause.SATELLITE, (), tuple(circles))
    return CLEAN


def full_verdict(checks: Checks, e: int, evidence: Evidence, policy: SatelliteFaultPolicy) -> Verdict:
    """The verdict of all monitors for epoch e."""
    outcome = {n: Outcome(int(o)) for n, o in zip(checks.names, checks.outcome[e], strict=True)}
    bad = {n for n, o in outcome.items() if o >= Outcome.UNKNOWN}
    if not bad and not (evidence.acute and policy == "stop"):
        return CLEAN
    cause, subjects, leading = cause_of(outcome, bad, evidence)
    verdict = _verdict(checks, e, cause, subjects, leading, (evidence.swapped,) if evidence.swapped else ())
    if cause not in (Cause.SATELLITE, Cause.CONSTELLATION):
        return verdict
    first = (evidence.acute or evidence.exclusions)[0]
    return replace(verdict, check=first.check, statistic=first.statistic, threshold=first.threshold)


def cause_of(outcome: Mapping[str, Outcome], bad: set[str], evidence: Evidence) -> tuple[Cause, tuple[str, ...], tuple[str, ...]]:
    """Cause, subjects, and the checks that show it; the first that matches."""
    sunk, lost = outcome["cn0"] == Outcome.FAIL, outcome["loss"] == Outcome.FAIL
    drowned = sunk or (lost and outcome["cn0"] != Outcome.PASS)  # what is left is not as strong as ever
    circles = tuple(n for n in outcome if n.startswith("circle_"))
    shape_holds = outcome["shape"] == outcome["shape_3d"] == Outcome.PASS

    if outcome["repeat"] == Outcome.FAIL:
        return Cause.DATA, _chosen(evidence.receivers, evidence.repeating), ("repeat",)
    if outcome["data"] != Outcome.PASS and not drowned:
        if evidence.exclusions and evidence.enough_without_exclusion:
            return Cause.SATELLITE, _satellites(evidence.exclusions), ("data",)
        return Cause.DATA, _chosen(evidence.receivers, evidence.short), ("data",)
    if sunk or lost:
        return Cause.JAMMING, (), ("cn0", "loss")
    unknown = tuple(n for n, o in outcome.items() if o == Outcome.UNKNOWN)
    if unknown:
        return Cause.DATA, (), unknown
    if outcome["collapse"] == Outcome.FAIL and evidence.collapsed:
        return Cause.SPOOFING, evidence.receivers, ("collapse",)
    if outcome["capture"] == Outcome.FAIL and evidence.captured.any():
        return Cause.SPOOFING, _chosen(evidence.receivers, evidence.captured), ("capture",)
    if outcome["told"] == Outcome.FAIL:
        return Cause.SPOOFING, _chosen(evidence.receivers, evidence.fed), ("told",)
    if shape_holds and Outcome.FAIL in (outcome["common"], outcome["common_3d"]):
        return Cause.SPOOFING, (), ("common", "common_3d")
    dragged = tuple(n for n in OF_SATELLITES if outcome[n] == Outcome.FAIL)
    if shape_holds and dragged and evidence.displaced:
        return Cause.SPOOFING, (), dragged
    if evidence.acute and bad <= set(circles):  # without it all fits, or the sky left is too weak
        systems = {x.satellite[0] for x in evidence.acute if x.check == "constellation"}
        if systems:
            return Cause.CONSTELLATION, tuple(name for letter, name in SYSTEM_NAMES.items() if letter in systems), ("constellation",)
        return Cause.SATELLITE, _satellites(evidence.acute), ("residual",)
    if evidence.named.any():
        return Cause.RECEIVER, _chosen(evidence.receivers, evidence.named), ("shape", "shape_3d", *circles, "b_value", "slow")
    if outcome["host_time"] == Outcome.FAIL:
        return Cause.CLOCK, (), ("host_time",)
    return Cause.AMBIGUOUS, (), ("shape", "shape_3d", "common", "common_3d", *circles, "b_value", "residual", "collapse")


def _chosen(names: tuple[str, ...], chosen: Bools) -> tuple[str, ...]:
    return tuple(n for n, c in zip(names, chosen, strict=True) if c)


def _satellites(exclusions: tuple[Exclusion, ...]) -> tuple[str, ...]:
    return tuple(x.satellite for x in exclusions)


def _verdict(
    checks: Checks, e: int, cause: Cause, subjects: tuple[str, ...], leading: tuple[str, ...], more: tuple[str, ...] = ()
) -> Verdict:
    """The verdict with the numbers of its leading check (the first of `leading` that is not PASS) and every reason."""
    failed = [i for i in range(len(checks.names)) if checks.outcome[e, i] >= Outcome.UNKNOWN]
    reasons = tuple(_reason(checks, e, i) for i in failed)
    shown = sorted(
        failed, key=lambda i: (checks.names[i] not in leading, leading.index(checks.names[i]) if checks.names[i] in leading else i)
    )
    i = shown[0] if shown else checks.names.index(leading[0])
    return Verdict(
        STATE_OF_CAUSE[cause],
        cause,
        subjects,
        checks.names[i],
        float(checks.statistic[e, i]),
        float(checks.threshold[i]),
        (*more, *reasons),
    )


def _reason(checks: Checks, e: int, i: int) -> str:
    if np.isnan(checks.statistic[e, i]):
        return f"{checks.names[i]} could not be computed"
    return f"{checks.names[i]} {checks.statistic[e, i]:.4g} > {checks.threshold[i]:.4g}"
