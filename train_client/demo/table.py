"""Expected against seen: a row per phase of the story, judged from what was recorded while it ran. Pure.

What is expected follows from the story and the contracts: the station's health epoch by epoch, by GPS time; the train's trust by the moment
at which the train said so. Where only a machine's pace matters there is `SLACK_S`.
"""

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

from integrity.states import Cause, State
from train_client.demo.records import Records
from train_client.demo.row import Row
from train_client.demo.seen import Stretch, last_covered_ns, returned_s, rms, since_s, stops, stretch
from train_client.outputs import Status
from train_client.simulate.story import Phase
from train_client.trust import TrustState

FIRST_HEALTH_S, FIRST_NORMAL_S = 5.0, 15.0  # after the command began, on a warm machine that does nothing else
BUSY = 4.0  # times as long where it is cold or busy: three processes import and compute, for a second of the processor each
STOP_S = 1.0  # from the first bytes of a fault to a train that trusts no more: ten epochs, for a busy machine
SLACK_S = 2.0  # on top of what recovery takes, for a busy machine
LATE_S = 0.1  # after the end of validity
HEARD = 0.9  # of the epochs of a phase: whatever is published may be dropped
RMS_M, MOST_M = 0.5, 3.0  # of VALID positions; six times the rms is never seen in 10,000 epochs


@dataclass(frozen=True)
class Contract:
    """What site and train file promise, in seconds."""

    interval_s: float
    recover_after_s: float
    recover_messages: int
    valid_for_s: float

    @property
    def trusts_within_s(self) -> float:
        """A train, of the station's first NORMAL."""
        return self.recover_messages * self.interval_s + SLACK_S

    @property
    def back_within_s(self) -> float:
        """A train, of the end of a fault."""
        return self.recover_after_s + self.trusts_within_s


def judge(phases: Sequence[Phase], records: Records, contract: Contract, duration_s: float) -> list[Row]:
    """The rows of all phases that ended before the story did, and one of positions."""
    rows = []
    for phase in phases:
        if phase.end_s <= duration_s:
            back = phase.end_s + contract.back_within_s <= duration_s
            rows.append(_JUDGES.get(phase.kind, _fault)(phase, records, contract, back))
    return [*rows, _positions(records)] if rows else []


def _start_up(phase: Phase, records: Records, contract: Contract, back: bool) -> Row:
    first = since_s(records.began_ns, (h.arrived_ns for h in records.health))
    normal = since_s(records.began_ns, (h.arrived_ns for h in records.health if h.state is State.NORMAL))
    trusted = since_s(records.began_ns, (p.arrived_ns for p in records.positions if p.trust is TrustState.NORMAL))
    seen = stretch(phase, records)
    unmet = [
        *_unless(first <= BUSY * FIRST_HEALTH_S, f"first health {first:.1f} s after the command began"),
        *_health_unlike(phase, seen, heard=0.0),
        *_unless(seen.valid == 0, f"{seen.valid} VALID positions before the station was NORMAL"),
    ]
    if back:
        unmet += _unless(normal <= BUSY * FIRST_NORMAL_S, f"first NORMAL {normal:.1f} s after the command began")
        unmet += _unless(normal - first <= contract.recover_after_s + SLACK_S, f"first NORMAL {normal - first:.1f} s after first health")
        unmet += _unless(normal <= trusted <= normal + contract.trusts_within_s, f"the train trusts {trusted - normal:.1f} s after that")
    return Row(
        phase.name,
        f"health within {FIRST_HEALTH_S:g} s, NORMAL within {FIRST_NORMAL_S:g} s (if cold or busy {BUSY:g} times that); "
        f"trust within {contract.trusts_within_s:g} s of it",
        f"health after {first:.2f} s, NORMAL after {normal:.2f} s; trust {trusted - normal:.2f} s later",
        tuple(unmet),
    )


def _fault(phase: Phase, records: Records, contract: Contract, back: bool) -> Row:
    """The station says what it is; the train stops, and is back soon after the end."""
    seen, told = stretch(phase, records), TrustState(phase.state.value)
    fault_ns, end_ns = records.mono_ns(phase.start_s), records.mono_ns(phase.end_s)
    stopped = since_s(fault_ns, stops(records.positions, fault_ns))
    returned = returned_s(end_ns, records)
    after = {p.trust for p in seen.positions if p.arrived_ns > fault_ns + STOP_S * 1e9 and p.arrived_ns < end_ns}
    unmet = [
        *_health_unlike(phase, seen),
        *_unless(stopped <= STOP_S, f"trust ends {stopped:.3f} s after the fault"),
        *_unless(after == {told}, f"then the train's trust is {_names(after)}"),
        *_unless(seen.valid == 0, f"{seen.valid} epochs of the fault have a VALID position"),
    ]
    if back:
        unmet += _unless(returned <= contract.back_within_s, f"trust returns {returned:.1f} s after the end of the fault")
    return Row(
        phase.name,
        f"{_said(phase)}; no VALID position; trust back within {contract.back_within_s:g} s",
        f"{len(seen.health)} of {seen.epochs} epochs; trust ends after {stopped:.3f} s, {seen.valid} VALID" + _back(returned, back),
        tuple(unmet),
    )


def _satellite(phase: Phase, records: Records, contract: Contract, back: bool) -> Row:
    """Named, excluded, and nobody stops. It stays out: what stepped back is no more to be believed than what stepped."""
    seen, whom = stretch(phase, records), ", ".join(phase.excluded)
    end_ns = records.gps_ns(phase.end_s)
    later = [h for h in records.health if h.gps_time_ns is not None and h.gps_time_ns >= end_ns]
    with_it = sum(not set(phase.excluded) <= set(h.excluded) for h in later)
    off_m = rms([p.error_m for p in seen.positions if p.status is Status.VALID and p.error_m is not None])
    unmet = [
        *_health_unlike(phase, seen),
        *_goes_on(seen),
        *_unless(off_m <= RMS_M, f"VALID positions are {off_m:.2f} m off (rms)"),
        *_unless(with_it == 0, f"{whom} is back in {with_it} later epochs"),
    ]
    return Row(
        phase.name,
        f"{_said(phase)}; the train goes on, rms <= {RMS_M:g} m; {whom} stays out until the end",
        f"{len(seen.health)} of {seen.epochs} epochs; {seen.valid} VALID, rms {off_m:.2f} m; back in {with_it} of {len(later)} later",
        tuple(unmet),
    )


def _forged(phase: Phase, records: Records, contract: Contract, back: bool) -> Row:
    """Counted and ignored."""
    seen, deeds = stretch(phase, records), records.deeds
    attacked_ns = deeds.attacked_ns or records.mono_ns(phase.start_s)
    before = max((p.refused for p in records.positions if p.arrived_ns < attacked_ns), default=0)
    grown = max((p.refused for p in seen.positions), default=0) - before
    unmet = [
        *_health_unlike(phase, seen),
        *_goes_on(seen),
        *_unless(0 < HEARD * deeds.attacks <= grown, f"{grown} messages were refused, {deeds.attacks} had to be"),
    ]
    return Row(
        phase.name,
        f"{_said(phase)}; about {deeds.attacks} messages refused, the train goes on",
        f"{len(seen.health)} of {seen.epochs} epochs; {grown} refused, {seen.valid} VALID",
        tuple(unmet),
    )


def _frozen(phase: Phase, records: Records, contract: Contract, back: bool) -> Row:
    """No decision, but the station still answers; the train stops by its own clock, and is back soon after."""
    frozen_ns, thawed_ns = records.deeds.frozen_ns, records.deeds.thawed_ns
    if frozen_ns is None or thawed_ns is None:
        return Row(phase.name, "the thread that decides stands", "it was not frozen", ("the thread was not frozen",))
    stands_ns = frozen_ns + round(1.5e9)  # its next word comes within a second
    said = sum(stands_ns <= h.arrived_ns < thawed_ns for h in records.health)
    asked = [c for c in records.challenges if stands_ns <= c.asked_ns < thawed_ns - 1e9]
    told = max((h.sequence for h in records.health if h.arrived_ns < stands_ns), default=0)
    answered = sum(c.sequence == told for c in asked)
    stopped_s, unmet = _by_its_own_clock(frozen_ns, thawed_ns, records, contract)
    returned = returned_s(thawed_ns, records)
    unmet += [
        *_unless(said == 0, f"{said} messages of health while it stood"),
        *_unless(0 < answered == len(asked), f"{answered} of {len(asked)} challenges answered, with {told} as the last sequence"),
    ]
    if back:
        unmet += _unless(returned <= contract.back_within_s, f"trust returns {returned:.1f} s after it goes on")
    return Row(
        phase.name,
        f"challenges answered, no health; trust ends {contract.valid_for_s:g} s after the last epoch covered (+{LATE_S:g})",
        f"{answered} of {len(asked)} answered, {said} messages; trust ends after {stopped_s:.3f} s" + _back(returned, back),
        tuple(unmet),
    )


def _killed(phase: Phase, records: Records, contract: Contract, back: bool) -> Row:
    """Silence: the train stops by its own clock, and in the end there are no communications."""
    killed_ns = records.deeds.killed_ns
    if killed_ns is None:
        return Row(phase.name, "the station is killed", "it was not", ("the station was not killed",))
    end_ns = 2**63 - 1
    stopped_s, unmet = _by_its_own_clock(killed_ns, end_ns, records, contract)
    last = records.positions[-1].trust
    unmet += _unless(last is TrustState.NO_COMMS, f"in the end the train's trust is {last.value}")
    return Row(
        phase.name,
        f"trust ends {contract.valid_for_s:g} s after the last epoch covered (+{LATE_S:g}), then NO_COMMS",
        f"trust ends after {stopped_s:.3f} s; then {last.value}",
        tuple(unmet),
    )


_JUDGES: dict[str, Callable[[Phase, Records, Contract, bool], Row]] = {
    "start": _start_up,
    "satellite_step": _satellite,
    "forged_health": _forged,
    "frozen_decisions": _frozen,
    "station_killed": _killed,
}


def _by_its_own_clock(silent_ns: int, until_ns: int, records: Records, contract: Contract) -> tuple[float, list[str]]:
    """Seconds from when the last epoch covered was sent to the end of trust, and what is wrong with it."""
    sent_ns = last_covered_ns(until_ns, records)
    stopped_s = since_s(sent_ns, (stop for stop in stops(records.positions, silent_ns) if stop < until_ns))
    later = {p.trust for p in records.positions if sent_ns + stopped_s * 1e9 < p.arrived_ns < until_ns}
    most_s = contract.valid_for_s + LATE_S
    return stopped_s, [
        *_unless(stopped_s <= most_s, f"trust ends {stopped_s:.3f} s after the last epoch covered"),
        *_unless(bool(later) and later <= {TrustState.STALE, TrustState.NO_COMMS}, f"afterwards the train's trust is {_names(later)}"),
    ]


def _positions(records: Records) -> Row:
    """All positions that might be used."""
    errors = [p.error_m for p in records.positions if p.status is Status.VALID and p.error_m is not None]
    rms_m, most_m = rms(errors), max(map(abs, errors), default=math.nan)
    return Row(
        "positions",
        f"VALID ones within {RMS_M:g} m (rms), none over {MOST_M:g} m",
        f"{len(errors)} VALID: rms {rms_m:.2f} m, at most {most_m:.2f} m",
        (
            *_unless(rms_m <= RMS_M, f"rms error {rms_m:.2f} m"),
            *_unless(most_m <= MOST_M, f"largest error {most_m:.2f} m"),
        ),
    )


def _health_unlike(phase: Phase, seen: Stretch, heard: float = HEARD) -> list[str]:
    """What the station said of the epochs of a phase that the story does not."""
    expected = (phase.state, phase.cause, phase.subjects, phase.excluded)
    unlike = [h for h in seen.health if (h.state, h.cause, h.subjects, h.excluded) != expected]
    enough = len(seen.health) >= heard * seen.epochs and seen.epochs > 0
    return [
        *_unless(enough, f"health of {len(seen.health)} epochs out of {seen.epochs} came"),
        *(f"{len(unlike)} epochs otherwise, the first {h.state} {h.cause} {', '.join((*h.subjects, *h.excluded))}" for h in unlike[:1]),
    ]


def _goes_on(seen: Stretch) -> list[str]:
    trusts = {p.trust for p in seen.positions}
    return [
        *_unless(trusts == {TrustState.NORMAL}, f"the train's trust is {_names(trusts)}"),
        *_unless(seen.valid >= HEARD * seen.epochs, f"{seen.valid} of {seen.epochs} epochs have a VALID position"),
    ]


def _unless(met: bool, words: str) -> list[str]:
    return [] if met else [words]


def _said(phase: Phase) -> str:
    who = f" ({', '.join(phase.subjects)})" if phase.subjects else ""
    cause = f" {phase.cause}{who}" if phase.cause is not Cause.NONE else ""
    return f"{phase.state}{cause}" + (f" without {', '.join(phase.excluded)}" if phase.excluded else "") + " in every epoch"


def _back(returned_s: float, back: bool) -> str:
    return f"; back after {returned_s:.1f} s" if back else ""


def _names(trusts: Iterable[TrustState]) -> str:
    return ", ".join(sorted(t.value for t in trusts)) or "not told"
