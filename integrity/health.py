"""The published state, with memory: down in the epoch that fails, up only after clean epochs. No I/O, no clock.

Theory of operation. Each epoch brings a verdict; each tick during silence brings "silent". The next memory is one row of `TABLE`,
chosen by what came. Nothing else changes the state, and only one row leads to NORMAL.

    FAILS   the epoch's verdict is not clean: publish that verdict, forget all clean epochs
    SILENT  a stream is silent: publish NOT_CONFIRMABLE/data, forget all clean epochs
    CLEAN   a clean epoch, but not enough of them yet: keep what is published, count it. Before the first NORMAL, data that was missing
            and is there now leaves not_ready: how long a station waits for its receivers makes no difference
    PROVEN  a clean epoch, and enough of them (or already NORMAL): publish NORMAL
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from enum import Enum

from integrity.limits import Limits
from integrity.states import STATE_OF_CAUSE, Cause, State
from integrity.verdict import Verdict


@dataclass(frozen=True)
class Health:
    """What is published, and the clean epochs counted towards NORMAL (`clean_since_ns` is GPS time); `started`: it has been NORMAL."""

    state: State = State.NOT_CONFIRMABLE
    cause: Cause = Cause.NOT_READY
    subjects: tuple[str, ...] = ()
    clean_since_ns: int | None = None
    clean_epochs: int = 0
    started: bool = False

    def __post_init__(self) -> None:
        if self.state is not (State.NORMAL if self.cause is Cause.NONE else STATE_OF_CAUSE[self.cause]):
            raise ValueError(f"state {self.state} cannot have cause {self.cause!r}")


class Input(Enum):
    """What an epoch or a tick means to the published state."""

    FAILS = "fails"
    SILENT = "silent"
    CLEAN = "clean"
    PROVEN = "proven"


def _fails(now: Health, verdict: Verdict, gps_ns: int) -> Health:
    return Health(verdict.state, verdict.cause, verdict.subjects, started=now.started)


def _silent(now: Health, verdict: Verdict, gps_ns: int) -> Health:
    return Health(State.NOT_CONFIRMABLE, Cause.DATA, verdict.subjects, started=now.started)


def _counts(now: Health, verdict: Verdict, gps_ns: int) -> Health:
    since_ns = gps_ns if now.clean_since_ns is None else now.clean_since_ns
    counted = replace(now, clean_since_ns=since_ns, clean_epochs=now.clean_epochs + 1)
    return replace(counted, cause=Cause.NOT_READY, subjects=()) if now.cause is Cause.DATA and not now.started else counted


def _normal(now: Health, verdict: Verdict, gps_ns: int) -> Health:
    since_ns = gps_ns if now.clean_since_ns is None else now.clean_since_ns
    return Health(State.NORMAL, Cause.NONE, (), since_ns, now.clean_epochs + 1, started=True)


TABLE: dict[Input, Callable[[Health, Verdict, int], Health]] = {
    Input.FAILS: _fails,
    Input.SILENT: _silent,
    Input.CLEAN: _counts,
    Input.PROVEN: _normal,
}


def after_epoch(now: Health, verdict: Verdict, gps_ns: int, limits: Limits) -> Health:
    """Memory after an epoch at GPS time `gps_ns`, later than all before."""
    return TABLE[_meaning(now, verdict, gps_ns, limits)](now, verdict, gps_ns)


def after_silence(now: Health, silence: Verdict) -> Health:
    """Memory after a tick during which the streams of `silence.subjects` are silent."""
    return TABLE[Input.SILENT](now, silence, 0)


def _meaning(now: Health, verdict: Verdict, gps_ns: int, limits: Limits) -> Input:
    if verdict.state is not State.NORMAL:
        return Input.FAILS
    if now.state is State.NORMAL:
        return Input.PROVEN
    since_ns = gps_ns if now.clean_since_ns is None else now.clean_since_ns
    enough = now.clean_epochs + 1 >= limits.recover_epochs and gps_ns - since_ns >= limits.recover_after_ns
    return Input.PROVEN if enough else Input.CLEAN
