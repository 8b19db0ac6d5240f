"""The demo's table: a made-up run in which everything is as expected, and every row fails when what it is about is not so."""

from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path

import pytest

from integrity.gnss.gps_time import NS_PER_S
from integrity.states import Cause, State
from train_client.demo.records import ChallengeSeen, Deeds, HealthSeen, PositionSeen, Records
from train_client.demo.row import Row
from train_client.demo.stage import SETTINGS
from train_client.demo.summary import Summary, render
from train_client.demo.table import Contract, judge
from train_client.outputs import Status
from train_client.simulate.story import END_S, STATION_SETTINGS, TIMELINE, Phase
from train_client.trust import TrustState

CONTRACT = Contract(interval_s=0.1, recover_after_s=3.0, recover_messages=10, valid_for_s=3.0)
(STEPPED_S,) = (p.start_s for p in TIMELINE if p.kind == "satellite_step")
PHASES = tuple(replace(p, excluded=("G07",)) if p.start_s >= STEPPED_S else p for p in TIMELINE)
STEP_NS = NS_PER_S // 10
BEGAN_NS = 500 * NS_PER_S
SENT_NS = BEGAN_NS + 2 * NS_PER_S  # first epoch
GPS_NS = 1_400_000_000 * NS_PER_S
EPOCHS = round(END_S * 10)
MS = 1_000_000


def at(story_s: float) -> int:
    """Monotonic time of a moment of the story."""
    return SENT_NS + round(story_s * NS_PER_S)


def phase(kind: str) -> Phase:
    (found,) = (p for p in PHASES if p.kind == kind)
    return found


def spoken_s(k: int) -> float | None:
    """When the station speaks of epoch k: at once; not while it stands, whose epochs come all at once afterwards; not when it is killed."""
    s = k / 10
    frozen = phase("frozen_decisions")
    if frozen.start_s <= s < frozen.end_s:
        return frozen.end_s + 0.001 * k / EPOCHS
    return None if s >= phase("station_killed").start_s else s


def said(k: int) -> tuple[State, Cause, tuple[str, ...], tuple[str, ...]]:
    s = k / 10
    for p in PHASES:
        returns_s = 3.0 if p.cause is not Cause.NONE and p.kind != "start" else 0.0
        if p.start_s <= s < p.end_s + returns_s:
            return p.state, p.cause, p.subjects, p.excluded
    return State.NORMAL, Cause.NONE, (), ("G07",) if s >= STEPPED_S else ()


def trust_at(s: float) -> TrustState:
    """As the ground says, a second later up again; 3 s after it fell silent STALE, 2 s later NO_COMMS."""
    for p in (phase("frozen_decisions"), phase("station_killed")):
        back_s = p.end_s + 1.0 if p.kind == "frozen_decisions" else END_S + 1.0
        if p.start_s + 2.85 <= s < back_s:
            return TrustState.STALE if s < p.start_s + 4.85 else TrustState.NO_COMMS
    if all(said(k)[0] is State.NORMAL for k in range(max(0, round(s * 10) - 10), round(s * 10) + 1)) and s >= 4.0:
        return TrustState.NORMAL
    state = said(round(s * 10))[0]
    return TrustState.NOT_CONFIRMABLE if state is State.NORMAL else TrustState(state.value)


def health(k: int) -> list[HealthSeen]:
    spoken = spoken_s(k)
    return [] if spoken is None else [HealthSeen(at(spoken) + 3 * MS, GPS_NS + k * STEP_NS, k + 1, *said(k))]


def position(k: int) -> PositionSeen:
    s = k / 10
    trust, forged = trust_at(s), phase("forged_health")
    valid = trust is TrustState.NORMAL and spoken_s(k) == s
    refused = 0 if s < forged.start_s else 4 * min(5, 5 * round(s - forged.start_s + 0.55) // 4)
    return PositionSeen(
        at(s) + 6 * MS, GPS_NS + k * STEP_NS, Status.VALID if valid else Status.PROVISIONAL, trust, 0.3 if k % 2 else -0.3, refused
    )


@cache
def good() -> Records:
    frozen, killed = phase("frozen_decisions"), phase("station_killed")
    told = round(frozen.start_s * 10)
    return Records(
        began_ns=BEGAN_NS,
        start_gps_ns=GPS_NS,
        sent_ns={GPS_NS + k * STEP_NS: at(k / 10) for k in range(EPOCHS)},
        health=tuple(sorted((h for k in range(EPOCHS) for h in health(k)), key=lambda h: h.arrived_ns)),
        positions=tuple(position(k) for k in range(EPOCHS)),
        challenges=tuple(ChallengeSeen(at(frozen.start_s + s), told) for s in range(7)),
        deeds=Deeds(20, at(78.0), at(frozen.start_s), at(frozen.end_s), at(killed.start_s)),
    )


def rows(records: Records, duration_s: float = END_S) -> dict[str, Row]:
    return {row.name: row for row in judge(PHASES, records, CONTRACT, duration_s)}


def failed(records: Records) -> set[str]:
    return {name for name, row in rows(records).items() if row.unmet}


def healths(records: Records, from_s: float, to_s: float, change: Callable[[HealthSeen], HealthSeen | None]) -> Records:
    """Health of the epochs from one moment to another, changed or left out."""
    low, high = records.gps_ns(from_s), records.gps_ns(to_s)
    changed = [change(h) if h.gps_time_ns is not None and low <= h.gps_time_ns < high else h for h in records.health]
    return replace(records, health=tuple(h for h in changed if h is not None))


def positions(records: Records, from_s: float, to_s: float, **what: object) -> Records:
    low, high = records.gps_ns(from_s), records.gps_ns(to_s)
    changed = (
        replace(p, **what) if p.gps_time_ns is not None and low <= p.gps_time_ns < high else p  # type: ignore[arg-type]
        for p in records.positions
    )
    return replace(records, positions=tuple(changed))


def test_a_run_as_the_story_has_it_is_as_expected_in_every_row() -> None:
    found = rows(good())
    assert {name: row.unmet for name, row in found.items() if row.unmet} == {}
    assert list(found) == [*(p.name for p in PHASES), "positions"]


def late(h: HealthSeen) -> HealthSeen:
    return replace(h, arrived_ns=h.arrived_ns + 20 * NS_PER_S)


NORMAL, STALE = TrustState.NORMAL, TrustState.STALE
BROKEN: dict[str, tuple[str, Callable[[Records], Records]]] = {
    "first health late": ("start-up", lambda r: replace(r, began_ns=r.began_ns - 19 * NS_PER_S)),
    "no health at all": ("start-up", lambda r: replace(r, health=())),
    "NORMAL too early": ("start-up", lambda r: healths(r, 2.0, 3.0, lambda h: replace(h, state=State.NORMAL, cause=Cause.NONE))),
    "first NORMAL late": ("start-up", lambda r: healths(r, 3.0, 6.0, lambda h: None)),
    "train never trusts": ("start-up", lambda r: positions(r, 0.0, END_S, trust=STALE)),
    "VALID before NORMAL": ("start-up", lambda r: positions(r, 1.0, 1.1, status=Status.VALID)),
    "other receiver": ("receiver fault", lambda r: healths(r, 12.0, 12.1, lambda h: replace(h, subjects=("A",)))),
    "health lost": ("receiver fault", lambda r: healths(r, 12.0, 13.0, lambda h: None)),
    "train stops late": ("receiver fault", lambda r: positions(r, 12.0, 13.2, trust=NORMAL)),
    "train never stops": ("receiver fault", lambda r: positions(r, 12.0, 19.0, trust=NORMAL)),
    "train stops for another reason": ("receiver fault", lambda r: positions(r, 14.0, 14.1, trust=STALE)),
    "one VALID in the fault": ("receiver fault", lambda r: positions(r, 12.0, 12.1, status=Status.VALID)),
    "train comes back late": ("receiver fault", lambda r: positions(r, 19.0, 25.2, trust=TrustState.NOT_CONFIRMABLE)),
    "other satellite": ("satellite fault", lambda r: healths(r, 30.0, 30.1, lambda h: replace(h, excluded=("G08",)))),
    "train stops for a satellite": ("satellite fault", lambda r: positions(r, 28.0, 28.1, trust=TrustState.SATELLITE_ANOMALY)),
    "no positions meanwhile": ("satellite fault", lambda r: positions(r, 28.0, 30.0, status=Status.PROVISIONAL)),
    "30 m of it in positions": ("satellite fault", lambda r: positions(r, 28.0, 38.0, error_m=0.6)),
    "it comes back": ("satellite fault", lambda r: healths(r, 60.0, 60.1, lambda h: replace(h, excluded=()))),
    "it is believed again": ("jamming", lambda r: healths(r, 62.0, 62.1, lambda h: replace(h, excluded=()))),
    "spoofing not named": ("spoofing", lambda r: healths(r, 46.0, 46.1, lambda h: replace(h, cause=Cause.AMBIGUOUS))),
    "jamming not seen": ("jamming", lambda r: healths(r, 61.0, 61.1, lambda h: replace(h, state=State.NORMAL, cause=Cause.NONE))),
    "forged message believed": (
        "forged and replayed health",
        lambda r: positions(r, 80.0, 80.1, trust=TrustState.NOT_CONFIRMABLE, status=Status.UNKNOWN),
    ),
    "one not refused": ("forged and replayed health", lambda r: positions(r, 78.0, 82.0, refused=17)),
    "no attack": ("forged and replayed health", lambda r: replace(r, deeds=replace(r.deeds, attacks=0))),
    "not frozen": ("decisions frozen", lambda r: replace(r, deeds=replace(r.deeds, frozen_ns=None))),
    "health while it stood": (
        "decisions frozen",
        lambda r: replace(r, health=(*r.health, HealthSeen(at(89.0), None, 852, State.NORMAL, Cause.NONE))),
    ),
    "all of the station stood": (
        "decisions frozen",
        lambda r: replace(r, challenges=tuple(replace(c, sequence=None) for c in r.challenges)),
    ),
    "decisions went on unheard": ("decisions frozen", lambda r: replace(r, challenges=(ChallengeSeen(at(88.0), 880),))),
    "never asked": ("decisions frozen", lambda r: replace(r, challenges=())),
    "stale 0.2 s late": ("decisions frozen", lambda r: positions(r, 87.9, 88.2, trust=NORMAL)),
    "trusts again in between": ("decisions frozen", lambda r: positions(r, 90.0, 90.1, trust=NORMAL)),
    "not back": ("decisions frozen", lambda r: positions(r, 92.0, 98.2, trust=STALE)),
    "not killed": ("station killed", lambda r: replace(r, deeds=replace(r.deeds, killed_ns=None))),
    "trusts a dead station": ("station killed", lambda r: positions(r, 101.0, END_S, trust=NORMAL)),
    "dead 0.2 s longer": ("station killed", lambda r: positions(r, 103.9, 104.2, trust=NORMAL)),
    "STALE to the end": ("station killed", lambda r: positions(r, 105.0, END_S, trust=STALE)),
    "0.6 m off": ("positions", lambda r: positions(r, 0.0, END_S, error_m=0.6)),
    "3.1 m off once": ("positions", lambda r: positions(r, 40.0, 40.1, error_m=-3.1)),
    "no position": ("positions", lambda r: positions(r, 0.0, END_S, status=Status.PROVISIONAL)),
    "not a number": ("positions", lambda r: positions(r, 40.0, 40.1, error_m=float("nan"))),
}


@pytest.mark.parametrize("what", BROKEN)
def test_a_row_fails_when_what_it_is_about_is_not_so(what: str) -> None:
    name, broken = BROKEN[what]
    assert name in failed(broken(good()))


WORDS: dict[str, tuple[str, Callable[[Records], Records]]] = {
    "start-up: first NORMAL 64.0 s after the command began": ("start-up", lambda r: replace(r, began_ns=r.began_ns - 59 * NS_PER_S)),
    "start-up: first NORMAL 6.0 s after first health": ("start-up", lambda r: healths(r, 3.0, 6.0, lambda h: None)),
    "receiver fault: trust ends 1.206 s after the fault": ("receiver fault", lambda r: positions(r, 12.0, 13.2, trust=NORMAL)),
}


@pytest.mark.parametrize("words", WORDS)
def test_it_says_which_of_several_things_was_not_so(words: str) -> None:
    name, broken = WORDS[words]
    assert words in {f"{name}: {unmet}" for unmet in rows(broken(good()))[name].unmet}


@pytest.mark.parametrize("duration_s, names", [(2.0, []), (20.0, ["start-up", "receiver fault", "positions"])])
def test_phases_that_a_shorter_story_does_not_reach_have_no_row(duration_s: float, names: list[str]) -> None:
    assert list(rows(good(), duration_s)) == names


def test_a_story_that_ends_before_trust_can_be_back_does_not_ask_for_it() -> None:
    never_back = positions(good(), 19.0, END_S, trust=TrustState.NOT_CONFIRMABLE)
    assert rows(never_back, 24.0)["receiver fault"].unmet == ()


def test_the_table_names_the_rows_that_are_not_as_expected() -> None:
    bad = rows(positions(good(), 40.0, 40.1, error_m=-3.1))
    told = render(Summary(Path("/f"), "tcp/127.0.0.1:1", 0, END_S, tuple(bad.values()), (), ()))
    assert f"1 of {len(bad)} rows not as expected: positions" in told


def test_the_site_of_the_demo_is_the_one_that_the_story_reckons_with() -> None:
    assert SETTINGS == STATION_SETTINGS
