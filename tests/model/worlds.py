"""Which worlds are explored: what may happen in each, how often, and how deep in the tests.

Every sequence is followed; where a number of times is given, every one in which that happens at most so often. Depths are such that all
take about a minute of one core; `python -m tests.model --depth` goes deeper.
"""

from itertools import combinations
from typing import NamedTuple

from tests.model.actions import BEFORE_LAST, CHALLENGES, HELD, LAST, LONG, ORDINARY, RESTARTS, SEVEN, THREATS
from tests.model.world import Action

MEASURED = {
    "station restarts": 1,
    "train restarts": 1,
    "NORMAL held": 1,
    "challenge answered": 1,
    "ANOMALY arrives": 1,
    "NORMAL arrives": 2,
    "0.4 s pass": 3,
}
ONCE = {"station restarts": 1, "train restarts": 1}


class Setting(NamedTuple):
    actions: dict[str, Action]
    depth: int
    within: dict[str, int]


def _pair(one: str, other: str) -> Setting:
    return Setting(ORDINARY | RESTARTS | THREATS[one] | THREATS[other], 6, ONCE)


ANOMALY_HELD: dict[str, Action] = {"ANOMALY held": THREATS["deletion"]["ANOMALY held"]}
ANSWER_HELD: dict[str, Action] = {name: SEVEN[name] for name in ("answer held", "the last answer")}
ALL_SEVEN = {name: action for name, action in SEVEN.items() if name not in ANSWER_HELD}  # late answers: in settings of their own
STATION_RESTARTS: dict[str, Action] = {"station restarts": RESTARTS["station restarts"]}
SETTINGS = {
    "seven": Setting(ORDINARY | RESTARTS | ALL_SEVEN, 10, MEASURED),
    "replay": Setting(
        ORDINARY | STATION_RESTARTS | HELD | LAST | BEFORE_LAST | ANOMALY_HELD,
        7,
        {"station restarts": 1, "NORMAL held": 2, "ANOMALY held": 1},
    ),
    "late answer": Setting(ORDINARY | HELD | LAST | BEFORE_LAST | ANSWER_HELD, 7, {"answer held": 1, "NORMAL held": 2}),
    "challenges": Setting(ORDINARY | STATION_RESTARTS | CHALLENGES, 7, {"station restarts": 1}),
    "days": Setting(ORDINARY | LONG | HELD | LAST, 7, {}),
    "restarts": Setting(ORDINARY | RESTARTS, 8, ONCE),
    **{f"{one} and {other}": _pair(one, other) for one, other in combinations(THREATS, 2)},
}
