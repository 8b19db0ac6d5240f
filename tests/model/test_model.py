"""On no path is GNSS trusted longer than a NORMAL message is valid, and nothing forged, changed or replayed ever raises trust."""

import random

import pytest

from tests.model.code import Code, quick, real
from tests.model.explore import explore, key
from tests.model.world import DRIFTS, Drift, Rules, World
from tests.model.worlds import SETTINGS

ALL = SETTINGS["seven"].actions | SETTINGS["challenges"].actions | SETTINGS["delay and masquerade"].actions | SETTINGS["days"].actions


@pytest.mark.parametrize("name", SETTINGS)
def test_no_rule_is_broken(name: str) -> None:
    setting = SETTINGS[name]
    assert explore(Rules(quick()), setting.actions, setting.depth, setting.within).story == ""


@pytest.mark.parametrize("drift", DRIFTS, ids=str)
def test_whichever_clock_is_fast(drift: Drift) -> None:
    setting = SETTINGS["replay"]
    assert explore(Rules(quick(), drift), setting.actions, 6, setting.within).story == ""


def test_every_state_of_trust_is_reached() -> None:
    """A world in which nothing is ever trusted would break no rule either."""
    found = explore(Rules(quick()), SETTINGS["restarts"].actions, 6, SETTINGS["restarts"].within)
    assert found.reached == {"NORMAL", "SATELLITE_ANOMALY", "NOT_CONFIRMABLE", "STALE", "NO_COMMS"}


def walked(rules: Rules, seed: int, start: World | None = None) -> list[World]:
    """The states of one walk by chance."""
    chance, world, path = random.Random(seed), start or rules.start(), []
    for _ in range(40):
        event = ALL[chance.choice(list(ALL))](rules, world)
        if event is not None:
            world = event.after
            path.append(world)
    return path


@pytest.mark.parametrize("seed", range(20))
def test_the_stand_in_judges_as_ed25519_does(seed: int) -> None:
    def told(code: Code) -> list[object]:
        rules = Rules(code)
        return [key(rules, world) for world in walked(rules, seed)]

    assert told(quick()) == told(real())


@pytest.mark.parametrize("seed", range(20))
def test_where_counting_begins_changes_nothing(seed: int) -> None:
    """Two states with one key stay so: what the key leaves out is not seen by the code."""
    rules = Rules(quick())
    far = rules.start()._replace(now_ns=400_000_000 * 10**6, boot=7, epoch=1000, drawn=50)
    keys, far_keys = ([key(rules, world) for world in walked(rules, seed, start)] for start in (rules.start(), far))
    assert keys == far_keys
