"""Recorded decisions against those of a replay, field by field; floats are not decisions and are not compared."""

from collections.abc import Sequence

from integrity.gnss.gps_time import format_utc
from integrity.messages import wayside_pb2 as pb
from integrity.messages.outputs import CAUSES, OUTCOMES, STATES
from integrity.outputs import EpochReport
from integrity.states import Outcome
from recordings.reader import Contents


def recorded_reports(contents: Contents, start_ns: int | None, end_ns: int | None) -> list[pb.EpochReport]:
    """Recorded reports of the epochs in a window of GPS times."""
    reports = [entry.message for entry in contents.entries if isinstance(entry.message, pb.EpochReport)]
    return [r for r in reports if (start_ns is None or r.gps_time_ns >= start_ns) and (end_ns is None or r.gps_time_ns < end_ns)]


def differences(recorded: Sequence[pb.EpochReport], decided: Sequence[EpochReport]) -> list[str]:
    """One line per epoch that was decided differently, or by one of the two only. An end that a cut took away is no difference."""
    lines: list[str] = []
    then = {r.gps_time_ns: r for r in recorded}
    now = {r.gps_time_ns: r for r in decided if r.gps_time_ns <= max(then, default=r.gps_time_ns)}
    for gps_ns in sorted(now.keys() | then.keys()):
        if gps_ns not in now or gps_ns not in then:
            lines.append(f"{format_utc(gps_ns)}: decided {'only in the recording' if gps_ns in then else 'only now'}")
            continue
        changes = [f"{name} {before} -> {after}" for name, (before, after) in _fields(then[gps_ns], now[gps_ns]).items() if before != after]
        if changes:
            lines.append(f"{format_utc(gps_ns)}: {'; '.join(changes)}")
    return lines


def _fields(then: pb.EpochReport, now: EpochReport) -> dict[str, tuple[object, object]]:
    """What counts as the decision of an epoch, recorded and now, in the words of the messages."""
    state, cause, outcome = pb.State.Name, pb.Cause.Name, pb.Outcome.Name
    return {
        "state": (state(then.state), state(STATES[now.state])),
        "cause": (cause(then.cause), cause(CAUSES[now.cause])),
        "subjects": (sorted(then.subjects), sorted(now.subjects)),
        "verdict": (
            (state(then.verdict_state), cause(then.verdict_cause), sorted(then.verdict_subjects)),
            (state(STATES[now.verdict.state]), cause(CAUSES[now.verdict.cause]), sorted(now.verdict.subjects)),
        ),
        "triangle alone": (state(then.triangle_alone), state(STATES[now.triangle_alone])),
        "excluded": (sorted(x.satellite for x in then.exclusions), sorted(now.excluded)),
        "left out": (sorted((c.receiver, c.satellite) for c in then.channels), sorted((c.receiver, c.satellite) for c in now.channels)),
        "checks": (
            [(c.name, outcome(c.outcome)) for c in then.checks],
            [(n, outcome(OUTCOMES[Outcome(int(o))])) for n, o in zip(now.check_names, now.outcome, strict=True)],
        ),
    }
