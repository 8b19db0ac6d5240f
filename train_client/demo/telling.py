"""The story as it is told: a line per change, with the triangle's numbers and the train's position and error."""

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

from integrity.messages import wayside_pb2 as pb
from integrity.states import Cause, State
from recordings.explain import WORDS
from train_client.demo.records import HealthSeen
from train_client.demo.watch import Watch, trust_of
from train_client.simulate.story import Phase
from train_client.trust import TrustState

REPORT_WITHIN_NS = 500_000_000  # the record of why follows health at once, unless it was dropped
SHOWN_REASONS = 1

EVENTS: Mapping[str, str] = {
    "receiver_bias": "from now on receiver {receiver} measures {distance_m:.0f} m beside its point",
    "satellite_step": "from now on satellite {satellite} is {size_m:.0f} m wrong, for ground and train alike",
    "spoofing": "from now on all three receivers hear one transmitter",
    "jamming": "from now on all signals on the ground are {drop_db:.0f} dB weaker",
    "forged_health": "somebody puts forged and replayed health at the station's endpoint",
    "frozen_decisions": "from now on the thread that decides stands; the rest of the station goes on",
    "station_killed": "the station is killed (SIGKILL)",
}


class Line(NamedTuple):
    """Who changed, when (seconds of the story), how."""

    story_s: float
    who: str
    words: str

    def __str__(self) -> str:
        return f"{self.story_s:6.1f} s  {self.who:<7}  {self.words}"


def announced(phase: Phase) -> str:
    """What begins with a phase; empty for start-up."""
    facts = dict(phase.fault)
    if "offset_enu_m" in facts:
        facts["distance_m"] = math.hypot(*facts["offset_enu_m"])
    return EVENTS.get(phase.kind, "").format(**facts)


class Teller:
    """Looks at what came since it looked last."""

    def __init__(self, watch: Watch) -> None:
        self._watch = watch
        self._health = 0  # how many have been looked at
        self._positions = 0
        self._said: tuple[State, Cause, tuple[str, ...], tuple[str, ...]] | None = None
        self._trust: TrustState | None = None

    def lines(self, now_ns: int) -> list[Line]:
        """What has changed, in order; a change of the station waits for its numbers, and what the train did later waits for that."""
        lines = [*self._of_station(now_ns)]
        held_ns = self._watch.health[self._health].arrived_ns if self._health < len(self._watch.health) else now_ns
        return sorted([*lines, *self._of_train(held_ns)], key=lambda line: (round(line.story_s, 1), line.who))  # as shown, cause first

    def _of_station(self, now_ns: int) -> Iterator[Line]:
        while self._health < len(self._watch.health):
            health = self._watch.health[self._health]
            said = (health.state, health.cause, health.subjects, health.excluded)
            if said != self._said:
                report = self._watch.reports.get(health.gps_time_ns or 0)
                if report is None and now_ns - health.arrived_ns < REPORT_WITHIN_NS:
                    return
                known = self._said[3] if self._said else ()
                yield Line(self._watch.story_s(health.arrived_ns), "station", station_words(health, report, known))
            self._said = said
            self._health += 1

    def _of_train(self, until_ns: int) -> Iterator[Line]:
        while self._positions < len(self._watch.positions):
            seen, message = self._watch.positions[self._positions], self._watch.messages[self._positions]
            if seen.arrived_ns > until_ns:
                return
            if seen.trust is not self._trust:
                yield Line(self._watch.story_s(seen.arrived_ns), "train", train_words(message, seen.error_m))
            self._trust = seen.trust
            self._positions += 1


def station_words(health: HealthSeen, report: pb.EpochReport | None, known: Sequence[str]) -> str:
    """State, cause, subjects; and the numbers of the epoch if its report came. Satellites `known` to be out are only named."""
    if health.state is State.NORMAL and not health.excluded:
        return f"{health.state}"
    parts: list[str] = []
    told: set[str] = set()
    if health.cause is not Cause.NONE:
        parts.append(WORDS[health.cause] + (f" ({', '.join(health.subjects)})" if health.subjects else ""))
    if report is not None:
        new = [x for x in report.exclusions if x.satellite not in known]
        parts += [*_vertices(health, report), *_check(report)]
        parts += [f"{x.satellite} excluded: {x.check} {x.statistic:.4g} > {x.threshold:.4g}" for x in new]
        told = {x.satellite for x in new}
    without = [satellite for satellite in health.excluded if satellite not in told]
    if without:
        parts.append(f"without {', '.join(without)}")
    return f"{health.state:<17}  {'; '.join(parts)}"


def train_words(position: pb.TrainPosition, error_m: float | None) -> str:
    """Trust, and where it is; without trust, where it was confirmed last."""
    trust = trust_of(position)
    if position.HasField("front") and trust is TrustState.NORMAL:
        return f"{trust.value:<17}  {place_words(position, error_m)}"
    last = position.last_confirmed
    where = f"last confirmed at {last.edge} {last.offset_m:.1f} m" if position.HasField("last_confirmed") else "no position confirmed yet"
    reasons = "".join(f"; {reason}" for reason in position.reasons[1 : 1 + SHOWN_REASONS])
    return f"{trust.value:<17}  {where}{reasons}"


def place_words(position: pb.TrainPosition, error_m: float | None) -> str:
    """As in `main-1 812.4 m +-0.4, 0.21 m off`."""
    off = "" if error_m is None else f", {abs(error_m):.2f} m off"
    return f"{position.front.edge} {position.front.offset_m:.1f} m +-{position.sigma_m:.1f}{off}"


def _vertices(health: HealthSeen, report: pb.EpochReport) -> list[str]:
    """How far the subjects among the receivers are from their points."""
    off = {v.receiver: math.hypot(v.east_m, v.north_m) for v in report.triangle if v.HasField("east_m")}
    named = [f"{name} {off[name]:.1f} m" for name in health.subjects if name in off]
    if not named:
        return []
    return [f"{named[0].replace(' ', ' is ', 1)} from its point" if len(named) == 1 else f"{', '.join(named)} from their points"]


def _check(report: pb.EpochReport) -> list[str]:
    if not report.check or not report.HasField("statistic") or not report.HasField("threshold"):
        return []
    return [f"{report.check} {report.statistic:.4g} > {report.threshold:.4g}"]
