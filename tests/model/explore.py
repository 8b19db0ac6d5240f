"""Breadth first over all states, each one followed once; what breaks a rule is told as the shortest story that leads there.

Two states are one if they differ only in what the code cannot see: by when and where clocks, sequences, boots and epochs began to count
(it uses differences of each alone: `test_where_counting_begins_changes_nothing`), and in three ways that decide nothing any more: how
many more NORMAL messages came than are asked for, since when there is NO_COMMS, and by how much a message is too old ever to be fresh.
States are kept as 64 bits of hash: among the 2 million of a run the chance that any two collide is 1e-7.
"""

from collections.abc import Iterable
from typing import Any, NamedTuple

from tests.model.rules import broken, unsafe
from tests.model.world import MS, RECOVER_MESSAGES, VALID_MS, Action, Rules, World

OLD_NS = 2 * VALID_MS * MS  # too old, whatever the drift, except over days (where it is not used: see `key`)


class Explored(NamedTuple):
    states: int
    steps: int
    depth: int
    reached: frozenset[str]  # trust states
    story: str  # of the first rule broken; "": none

    def __str__(self) -> str:
        return self.story or f"{self.states} states, {self.steps} steps, depth {self.depth}, reached {', '.join(sorted(self.reached))}"


def explore(rules: Rules, actions: dict[str, Action], depth: int, within: dict[str, int] | None = None) -> Explored:
    """Every sequence of `depth` actions; those named in `within` happen at most so often."""
    budget = tuple((within or {}).items())
    names = [name for name, _ in budget]
    start, spare = rules.start(), tuple(times for _, times in budget)
    front: list[tuple[World, tuple[int, ...], Any]] = [(start, spare, None)]
    seen, steps = {hash((key(rules, start), spare))}, 0
    reached: set[str] = set()
    for _ in range(depth):
        beyond = []
        for before, left, path in front:
            for name, action in actions.items():
                k = names.index(name) if name in names else None
                if k is not None and not left[k]:
                    continue
                event = action(rules, before)
                if event is None:
                    continue
                steps += 1
                after, came = event.after, (path, name)
                why = broken(rules, before, event)
                if why:
                    return Explored(len(seen), steps, depth, frozenset(reached), _story(rules, _names(came), why))
                still = left if k is None else (*left[:k], left[k] - 1, *left[k + 1 :])
                mark = hash((key(rules, after), still))
                if mark not in seen:
                    seen.add(mark)
                    why = unsafe(rules, after)
                    if why:
                        return Explored(len(seen), steps, depth, frozenset(reached), _story(rules, _names(came), why))
                    reached.add(after.trust.state.value)
                    beyond.append((after, still, came))
        front = beyond
    return Explored(len(seen), steps, depth, frozenset(reached), "")


def key(rules: Rules, w: World) -> tuple[Any, ...]:
    """What tells a state from others."""
    tie, last, known, trust = w.verifier.tie, w.verifier.last, w.known, w.trust
    clock_ns = rules.train_clock_ns(w.now_ns)
    boot_of = w.boot

    def count(boot: int, sequence: int) -> int:
        return sequence - w.sequence if boot == boot_of else sequence

    until_ns = None if trust.valid_until_ns is None or trust.state.value == "NO_COMMS" else trust.valid_until_ns - clock_ns
    return (
        w.sequence > 0,
        tuple(
            (boot_of - m.boot, count(m.boot, m.sequence), w.epoch - m.epoch, m.state, min(w.now_ns - m.issued_ns, OLD_NS)) for m in w.heard
        ),
        tuple(w.now_ns - w.asked[n] if n in w.asked else None for n in w.queries),
        tuple(
            (
                boot_of - a.boot,
                count(a.boot, a.sequence),
                w.now_ns - a.issued_ns,
                w.now_ns - w.asked[a.nonce] if a.nonce in w.asked else None,
            )
            for a in w.answers
        ),
        tie
        and (
            boot_of - tie.boot_id[0],
            clock_ns - tie.sent_mono_ns,
            clock_ns - tie.received_mono_ns,
            rules.station_clock_ns(tie.boot_id[0], w.now_ns) - tie.issued_mono_ns,
        ),
        last
        and (
            boot_of - last.boot_id[0],
            count(last.boot_id[0], last.sequence) if last.data else None,
            count(last.boot_id[0], last.told) if last.told else None,
            last.gps_time_ns and w.epoch - last.gps_time_ns // 10**9,
        ),
        tuple(boot_of - b[0] for b in w.verifier.superseded),
        trust.state.value,
        min(trust.normals, RECOVER_MESSAGES),
        until_ns,
        known.newest and (boot_of - known.newest[0], count(*known.newest)),
        min(known.in_a_row, RECOVER_MESSAGES),
        known.end_ns and max(known.end_ns - w.now_ns, -1),
    )


def _names(path: Any) -> list[str]:
    names: list[str] = []
    while path:
        path, name = path
        names.append(name)
    return names[::-1]


def _story(rules: Rules, names: Iterable[str], why: str) -> str:
    """For people."""
    lines = [f"  {k + 1}. {name}" for k, name in enumerate(names)]
    return "\n".join([f"{why}, after:", *lines, f"  ({rules.drift})"])
