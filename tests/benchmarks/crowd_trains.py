"""Some of the trains of `crowd`, in one process: `python -m tests.benchmarks.crowd_trains FOLDER FIRST END`.

Each has its own link (`Air`), challenges and verifies for itself, and has its own trust in each of its stations (`Grounds`). One thread
decides for all of them, from one inbox, as the one of a train does for itself.
"""

import gc
import heapq
import json
import secrets
import sys
import threading
import time
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
import numpy.typing as npt

from integrity.messages import wayside_pb2 as pb
from integrity.messages.key_expressions import HEALTH, site_key
from integrity.messages.verification import NONCE_BYTES
from recordings.keys import KeyDates, TrustedKey, load_key
from recordings.sources.inbox import Inbox
from tests.benchmarks.crowd_plan import FOLLOWED, PERIOD_NS, Plan, read_plan
from tests.e2e.train_field import SAMPLES
from train_client.air import Air
from train_client.config import TrainConfig
from train_client.events import ChallengeAnswered, ChallengeSent, HealthReceived
from train_client.localisation.grounds import Grounds, Spoken
from train_client.runtime import AIR, TICK_NS
from train_client.train_file import load_train
from train_client.trust import TrustState

MAP_SHA256 = "0" * 64
CONNECTED_WITHIN_S = 120.0
LINGERS_S = 2  # after the last message is due: what is under way arrives
NEVER = -1  # of a message that has not arrived


@dataclass
class Found:
    """Of the trains of a process. By train, station and second, ns from when the message was issued until it came in, and was verified."""

    came_ns: npt.NDArray[np.int64]
    verified_ns: npt.NDArray[np.int64]
    not_normal: npt.NDArray[np.bool_]  # by train and second
    refused: Counter[str] = field(default_factory=Counter)


Words = HealthReceived | ChallengeAnswered


class Train:
    """One train; `decide` and `act` are called by the one thread."""

    def __init__(
        self, plan: Plan, config: TrainConfig, number: int, row: int, inbox: Inbox[tuple[int, Words]], up: threading.Semaphore
    ) -> None:
        self.sites = plan.followed(number)
        self.starts_ns = plan.starts_ns(number)
        self._plan = plan
        self._row = row
        self._which = {site_key(site, HEALTH): k for k, site in enumerate(self.sites)}
        keys = {site: load_key(plan.key_file(site)).public for site in self.sites}
        train_id = plan.train_ids()[number]
        own = replace(
            config, train_id=train_id, stations=tuple(self.sites), trust=config.trust._replace(recover_messages=plan.recover_messages)
        )
        self.grounds = Grounds(own, MAP_SHA256, {site: [key] for site, key in keys.items()}, {})

        def say(line: str) -> None:
            if line.startswith("connected"):
                up.release()
            else:
                print(f"{train_id}: {line}", file=sys.stderr)

        dates = {site: KeyDates([TrustedKey(key)]) for site, key in keys.items()}
        self.air = Air([plan.endpoint], plan.tls(train_id), dates, train_id, lambda event: inbox.put_event(AIR, (row, event)), say)
        self._now_ns = time.monotonic_ns()
        self._next_tick_ns = self._now_ns

    @property
    def due_ns(self) -> int:
        """When it has to be looked at, if nothing comes."""
        change_ns = self.grounds.next_change_ns
        due_ns = min(self._next_tick_ns, self.grounds.challenge_due[0])
        return due_ns if change_ns is None or change_ns < self._now_ns else min(due_ns, change_ns)

    def act(self, found: Found, base_ns: int) -> None:
        """Challenge one station, or let time pass."""
        self._let_time_pass(time.monotonic_ns(), found, base_ns)
        if self._now_ns >= self._next_tick_ns:
            self._next_tick_ns = self._now_ns + TICK_NS
        due_ns, site = self.grounds.challenge_due
        if self._now_ns >= due_ns:
            nonce = secrets.token_bytes(NONCE_BYTES)
            self.grounds.challenged(ChallengeSent(self._now_ns, site, nonce))
            self.air.challenge(site, nonce)

    def decide(self, event: Words, found: Found, base_ns: int) -> None:
        """What came from the ground."""
        self._let_time_pass(event.mono_ns, found, base_ns)
        if event.mono_ns < self._now_ns:
            event = replace(event, mono_ns=self._now_ns)
        if isinstance(event, ChallengeAnswered):
            self._note_refusal(self.grounds.answered(event), found)
        else:
            spoken = self.grounds.health(event)
            verified_mono_ns = time.monotonic_ns()
            if not self._note_refusal(spoken, found):
                self._note(event, verified_mono_ns, found)
        self._note_trust(found, base_ns)

    def _let_time_pass(self, mono_ns: int, found: Found, base_ns: int) -> None:
        before_ns, self._now_ns = self._now_ns, max(self._now_ns, mono_ns)
        self.grounds.time_passes(self._now_ns, before_ns)
        self._note_trust(found, base_ns)

    def _note_trust(self, found: Found, base_ns: int) -> None:
        second = (self._now_ns - base_ns) // PERIOD_NS - self._plan.settling_s - 1
        if 0 <= second < self._plan.seconds and self.grounds.trust(self.sites) is not TrustState.NORMAL:
            found.not_normal[self._row, second] = True

    def _note(self, event: HealthReceived, verified_mono_ns: int, found: Found) -> None:
        health = pb.Health.FromString(pb.SignedHealth.FromString(event.data).health)
        second = health.sequence - self._plan.settling_s - 1
        if 0 <= second < self._plan.seconds:
            at = self._row, self._which[event.key_expr], second
            found.came_ns[at] = event.mono_ns - health.issued_mono_ns
            found.verified_ns[at] = verified_mono_ns - health.issued_mono_ns

    def _note_refusal(self, spoken: Spoken | str | None, found: Found) -> bool:
        refusal = spoken if isinstance(spoken, str) else "" if spoken is None else spoken.said.refusal
        if refusal:
            found.refused[": ".join(refusal.split(": ")[:2])] += 1
        return bool(refusal)


def ride(plan: Plan, trains: Sequence[Train], inbox: Inbox[tuple[int, Words]], base_ns: int, found: Found) -> None:
    """Decide until the last message has come."""
    end_ns = base_ns + (plan.last + LINGERS_S) * PERIOD_NS
    alarm_ns = [base_ns + train.starts_ns for train in trains]  # of each, when it is looked at next: the entry of the heap that counts
    heap = [(at_ns, row) for row, at_ns in enumerate(alarm_ns)]
    heapq.heapify(heap)

    def set_alarm(row: int) -> None:
        alarm_ns[row] = trains[row].due_ns
        heapq.heappush(heap, (alarm_ns[row], row))

    while time.monotonic_ns() < end_ns:
        item = inbox.take(min(heap[0][0], end_ns))
        if item is not None:
            assert isinstance(item, tuple)
            row, event = item
            trains[row].decide(event, found, base_ns)
            if trains[row].due_ns < alarm_ns[row]:
                set_alarm(row)
        now_ns = time.monotonic_ns()
        while heap[0][0] <= now_ns:
            due_ns, row = heapq.heappop(heap)
            if due_ns == alarm_ns[row]:
                trains[row].act(found, base_ns)
                set_alarm(row)


def main() -> None:
    """Say `ready` when all are connected, read when the first second begins, ride, leave what was found in files and say `found`."""
    plan, first, end = read_plan(sys.argv[1]), int(sys.argv[2]), int(sys.argv[3])
    inbox, up = Inbox[tuple[int, Words]](), threading.Semaphore(0)
    config = load_train(SAMPLES / "train.toml").config
    trains = [Train(plan, config, number, number - first, inbox, up) for number in range(first, end)]
    shape = (len(trains), FOLLOWED, plan.seconds)
    found = Found(np.full(shape, NEVER), np.full(shape, NEVER), np.zeros((len(trains), plan.seconds), bool))
    for train in trains:
        train.air.start()
    for _ in trains:
        assert up.acquire(timeout=CONNECTED_WITHIN_S), "the router did not let every train in"
    print("ready", flush=True)
    base_ns = int(sys.stdin.readline())
    gc.collect()
    gc.freeze()  # and goes on collecting, as a train does
    ride(plan, trains, inbox, base_ns, found)
    reports = [report for train in trains for report in train.grounds.reports(time.monotonic_ns())]
    said = {"missed": sum(r.missed_messages for r in reports), "refused": found.refused, "dropped": sum(inbox.dropped().values())}
    folder = Path(plan.folder)
    np.savez(folder / f"trains-{first}.npz", came_ns=found.came_ns, verified_ns=found.verified_ns, not_normal=found.not_normal)
    (folder / f"trains-{first}.json").write_text(json.dumps(said))
    print("found", flush=True)
    for train in trains:
        train.air.stop()


if __name__ == "__main__":
    main()
