"""What the demo does while the receivers play: it announces faults, forges and replays, freezes the station's decisions, kills it."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import NamedTuple

from recordings.sources.host_clock import mono_now_ns
from train_client.demo.attacks import Attacker
from train_client.demo.records import Deeds
from train_client.demo.stage import Stage
from train_client.demo.telling import Line, announced
from train_client.demo.watch import Watch
from train_client.simulate.story import Phase

STRIKES_EVERY_S = 0.15  # in a burst Zenoh would drop some itself
LAST_STRIKE_S = 0.5  # before the end of the phase, so that it is counted in it


class Act(NamedTuple):
    """Something to be done at a moment of the story."""

    story_s: float
    what: Callable[[], str]


class Acts:
    """Done one after the other; `deeds` remembers."""

    def __init__(self, phases: Sequence[Phase], stage: Stage, attacker: Attacker, watch: Watch) -> None:
        self.deeds = Deeds()
        self._stage = stage
        self._attacker = attacker
        self._watch = watch
        self._waiting = sorted((act for phase in phases for act in self._of(phase)), key=lambda act: act.story_s)

    def perform(self, story_s: float) -> list[Line]:
        """Whatever is due, and what there is to say of it."""
        lines = []
        while self._waiting and self._waiting[0].story_s <= story_s:
            act = self._waiting.pop(0)
            words = act.what()
            lines += [Line(act.story_s, "demo", words)] if words else []
        return lines

    def _of(self, phase: Phase) -> list[Act]:
        words = announced(phase)
        begin = [Act(phase.start_s, lambda: words)] if words else []
        match phase.kind:
            case "start":
                return []
            case "forged_health":
                strikes = int((phase.end_s - LAST_STRIKE_S - phase.start_s) / STRIKES_EVERY_S)
                return [*begin, *(Act(phase.start_s + k * STRIKES_EVERY_S, self._strike) for k in range(strikes))]
            case "frozen_decisions":
                return [*begin, Act(phase.start_s, self._freeze), Act(phase.end_s, self._thaw)]
            case "station_killed":
                return [*begin, Act(phase.start_s, self._kill)]
        return [*begin, Act(phase.end_s, lambda: f"the {phase.name} is over")]

    def _strike(self) -> str:
        attacked_ns = self.deeds.attacked_ns or mono_now_ns()
        counted = self._attacker.strike(self._watch.genuine) if self._watch.genuine else 0
        self.deeds = replace(self.deeds, attacks=self.deeds.attacks + counted, attacked_ns=attacked_ns)
        return ""

    def _freeze(self) -> str:
        self.deeds = replace(self.deeds, frozen_ns=mono_now_ns())
        self._stage.freeze_decisions()
        return ""

    def _thaw(self) -> str:
        self.deeds = replace(self.deeds, thawed_ns=mono_now_ns())
        self._stage.thaw_decisions()
        return "the thread that decides goes on"

    def _kill(self) -> str:
        self.deeds = replace(self.deeds, killed_ns=mono_now_ns())
        self._stage.kill_station()
        return ""
