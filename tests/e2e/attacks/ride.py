"""One attack on one train: how it is reached, what is done to it, what came of it."""

import re
import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, ExitStack, contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import NamedTuple

import psutil

from tests.e2e.attacks.aboard import Aboard, Said, aboard
from tests.e2e.attacks.cut import Wire
from tests.e2e.attacks.judge import ALLOWED_NS, MAX_VALID_NS, broken_rules, came, ended_after_ms, silence
from tests.e2e.attacks.relay import Relay, relaying
from tests.e2e.attacks.scene import Scene

TRUSTED_WITHIN_S = 20.0
BOUND_MS = (MAX_VALID_NS + ALLOWED_NS) / 1e6
LONG_LEASE_MS = 20_000
WRONG_CONFIGURATION = 2  # exit code
# On a machine that is very busy: an answer that overtakes a message names a later one.
MERELY_LATE = {"repeated", "older", "boot not confirmed yet", "challenge: late answer"}
MOST_NOT_VALID = 10  # epochs, for the same reason
END_SOON_S = 1.0  # after the bound: then it has not ended at all


@dataclass
class Ride:
    """What a deed can lay hands on."""

    scene: Scene
    reached: "Reached"
    began: int = 0
    aboard: Aboard | None = None

    @property
    def train(self) -> Aboard:
        assert self.aboard is not None, "no train has started yet"
        return self.aboard

    @property
    def relay(self) -> Relay:
        assert self.reached.relay is not None, "on this way there is no man in the middle"
        return self.reached.relay

    @property
    def wire(self) -> Wire:
        assert self.reached.wire is not None, "on this way there is no wire"
        return self.reached.wire

    def begin(self) -> None:
        """What the train says from now on is under attack."""
        self.began = len(self.train.said)


class Reached(NamedTuple):
    """A train file, and who sits between it and the station."""

    train_file: Path
    relay: Relay | None = None
    wire: Wire | None = None


Way = Callable[[Scene, str], AbstractContextManager[Reached]]
Deed = Callable[[Ride], AbstractContextManager[None]]


@contextmanager
def through_relay(scene: Scene, name: str) -> Iterator[Reached]:
    """The train dials the man in the middle."""
    with relaying(scene.place.endpoint) as relay:
        yield Reached(scene.train_file(name, relay.endpoint), relay)


@contextmanager
def through_wire(scene: Scene, name: str) -> Iterator[Reached]:
    """The train dials the station itself, over a wire that may fail."""
    with Wire(scene.place.endpoint) as wire:
        yield Reached(scene.train_file(name, wire.endpoint), None, wire)


@contextmanager
def through_both(scene: Scene, name: str) -> Iterator[Reached]:
    """The train dials the man in the middle, over a wire that may fail; he makes it wait longer for him than a stall lasts."""
    with relaying(scene.place.endpoint, lease_ms=LONG_LEASE_MS) as relay, Wire(relay.endpoint) as wire:
        yield Reached(scene.train_file(name, wire.endpoint), relay, wire)


class Must(NamedTuple):
    """What a train must do. `trust`: "stays" NORMAL, "ends" in time, is "never" given, "safe": may end, in time; or the
    train "refuses" to start.

    `refused`: what it must say that it does not believe (or why it does not start), of how many messages `at_least`; `believes`: it
    refuses nothing but what is merely late. After the attack trust is back `back_s` later (None: not asked). `valid`: epochs have
    VALID positions, from the first one on. Trust ends, if it does, `ended_ms` after the issue of what it had last. `growth_mb`: of the
    memory of its process, at most; `told_late_ms`: from a decision to its word.
    """

    trust: str
    refused: tuple[str, ...] = ()
    at_least: int = 0
    believes: bool = False
    back_s: float | None = None
    valid: bool = False
    ended_ms: float = BOUND_MS
    growth_mb: float | None = None
    told_late_ms: float | None = None


class Case(NamedTuple):
    """A line of the table. The deed begins when the train trusts (where it must never, before it starts), and lasts `lasts_s` at least."""

    name: str
    threat: str
    done: str
    deed: Deed
    must: Must
    way: Way = through_relay
    lasts_s: float = 1.5


@dataclass(frozen=True)
class Outcome:
    """What the train did: the states of trust that it went through and its refusals, in its own words. `wrong`: empty if it did right.

    `refused`: messages; `ended_ms`: from the issue of the last genuine NORMAL that it had to the end of trust (None: it did not end);
    `back_ms`: from the end of the attack to trust (None: it was never away); `told_late_ms`: the longest from a decision to its word;
    `alarm`: it said that somebody else speaks in the station's name, which holds trust down for ten seconds.
    """

    states: tuple[str, ...] = ()
    refusals: tuple[str, ...] = ()
    refused: int = 0
    ended_ms: float | None = None
    back_ms: float | None = None
    growth_mb: float = 0.0
    told_late_ms: float = 0.0
    alarm: bool = False
    wrong: tuple[str, ...] = ()


def ride(case: Case, scene: Scene) -> Outcome:
    """Do it, and judge what came of it."""
    with ExitStack() as stack:
        ridden = Ride(scene, stack.enter_context(case.way(scene, case.name)))
        if case.must.trust == "refuses":
            return _not_started(case.must, stack.enter_context(aboard(ridden.reached.train_file)))
        never = case.must.trust == "never"
        with ExitStack() as deed:
            if never:
                deed.enter_context(case.deed(ridden))
            train = ridden.aboard = stack.enter_context(aboard(ridden.reached.train_file))
            if train.until(lambda said: said.trusts or never, TRUSTED_WITHIN_S) is None:
                return Outcome(wrong=(f"not ready before the attack: {_end_of(train.log())}",))
            before_mb = _memory_mb(train)
            ridden.begin()
            if not never:
                deed.enter_context(case.deed(ridden))
            _hold(case, train)
            growth_mb = _memory_mb(train) - before_mb
            during = train.said[ridden.began :]
        ended_ns = time.monotonic_ns()
        back = _back(case, train, ended_ns)
        exit_code = train.end()
        everything = came(train.recorded(), scene.site_id, scene.key.public)
    found = Outcome(
        states=_states(train),
        refusals=_refusals(train.log()),
        refused=train.said[-1].refused if train.said else 0,
        ended_ms=ended_after_ms(train.said, everything),
        back_ms=None if back is None or all(said.trusts for said in during) else (back.mono_ns - ended_ns) / 1e6,
        growth_mb=growth_mb,
        told_late_ms=max(((said.told_ns - said.mono_ns) / 1e6 for said in during), default=0.0),
        alarm="SECURITY ALARM" in train.log(),
    )
    wrong = [] if exit_code == 0 else [f"the train ended with {exit_code}: {_end_of(train.log())}"]
    if case.must.back_s is not None and back is None:
        wrong.append(f"trust was not back {case.must.back_s} s after the attack: {_end_of(train.log())}")
    if case.must.valid:
        wrong += _not_valid(train.said)
    wrong += broken_rules(train.said, everything)
    return replace(found, wrong=(*wrong, *_breaches(case.must, found, during)))


def _not_started(must: Must, train: Aboard) -> Outcome:
    """Where it must say why, and end."""
    code = train.process.wait(TRUSTED_WITHIN_S)
    log = train.log()
    wrong = [f"it does not say {word!r}: {_end_of(log)}" for word in must.refused if word not in log]
    wrong += [f"it ended with {code}, expected {WRONG_CONFIGURATION}"] * (code != WRONG_CONFIGURATION) + ["it spoke"] * bool(train.said)
    return Outcome(refusals=must.refused, wrong=tuple(wrong))


def _hold(case: Case, train: Aboard) -> None:
    """As long as the attack shall last, and until trust has ended where it must."""
    time.sleep(case.lasts_s)
    if case.must.trust == "ends" and train.trusts:
        train.until(lambda said: not said.trusts, BOUND_MS / 1e3 + END_SOON_S)


def _back(case: Case, train: Aboard, ended_ns: int) -> Said | None:
    """The first position with trust since the attack has ended."""
    if case.must.back_s is None:
        return None
    return train.until(lambda said: said.trusts and said.mono_ns > ended_ns, case.must.back_s)


def _breaches(must: Must, found: Outcome, during: list[Said]) -> list[str]:
    """Of what this attack asks for, besides the rules that always hold."""
    trusts = [said.trusts for said in during]
    checks = {
        "the train said nothing during the attack": not during,
        f"it was silent: {silence(during)}": bool(silence(during)),
        "trust ended": must.trust == "stays" and not all(trusts),
        "trust did not end": must.trust == "ends" and all(trusts),
        "it trusted": must.trust == "never" and any(trusts),
        f"it refused {found.refused} messages, expected {must.at_least} at least": found.refused < must.at_least,
        f"it does not believe what is {', '.join(found.refusals)}": must.believes and not set(found.refusals) <= MERELY_LATE,
        f"trust ended after {found.ended_ms} ms": found.ended_ms is not None and not found.ended_ms <= must.ended_ms,
        f"its memory grew by {found.growth_mb:.0f} MB": must.growth_mb is not None and not found.growth_mb <= must.growth_mb,
        f"it spoke {found.told_late_ms:.0f} ms late": must.told_late_ms is not None and not found.told_late_ms <= must.told_late_ms,
    }
    unsaid = [word for word in must.refused if word not in found.refusals]
    return [what for what, is_so in checks.items() if is_so] + [f"it did not say that it does not believe {word!r}" for word in unsaid]


def _not_valid(said: list[Said]) -> list[str]:
    """Epochs without a VALID position, after the first VALID one, where they are too many."""
    valid = {s.gps_time_ns for s in said if s.status == "POSITION_VALID"}
    epochs = [s.gps_time_ns for s in said if s.gps_time_ns is not None]
    first = next((k for k, epoch in enumerate(epochs) if epoch in valid), None)
    if first is None:
        return ["no position was VALID"]
    missing = len(set(epochs[first:]) - valid)
    return [f"{missing} epochs without a VALID position"] if missing > MOST_NOT_VALID else []


def _states(train: Aboard) -> tuple[str, ...]:
    """That it went through: the one in which it began, and what it said of each change."""
    return ("NO_COMMS", *re.findall(r"^trust ([A-Z_]+)", train.log(), re.MULTILINE))


def _refusals(log: str) -> tuple[str, ...]:
    """What it did not believe, each kind once, without the names of boots."""
    said = re.findall(r"^not believed: ((?:challenge: )?[^:\n]*)", log, re.MULTILINE)
    return tuple(dict.fromkeys(re.sub(r" [0-9a-f]{32}| \(and.*| SECURITY.*", "", words).strip() for words in said))


def _memory_mb(train: Aboard) -> float:
    return float(psutil.Process(train.process.pid).memory_info().rss) / 1e6


def _end_of(log: str) -> str:
    return log[-500:]
