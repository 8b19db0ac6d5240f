"""From outcomes to the verdict: boundaries of every check, every cause, and that a failing check never helps."""

from collections.abc import Iterable
from itertools import product

import numpy as np
import pytest

from integrity.config import SatelliteFaultPolicy
from integrity.exclusion import Exclusion
from integrity.gnss.observations import Floats
from integrity.states import Cause, Outcome, State
from integrity.verdict import CLEAN, Checks, Evidence, Verdict, clean_epochs, full_verdict, judge, triangle_verdict
from tests.unit.streams import LIMITS

NAMES = tuple(t.name for t in LIMITS.thresholds)
THRESHOLD = {t.name: t.value for t in LIMITS.thresholds}
RECEIVERS = ("A", "B", "C")
PASS, NOT_MONITORED, UNKNOWN, FAIL = Outcome.PASS, Outcome.NOT_MONITORED, Outcome.UNKNOWN, Outcome.FAIL
G21_NOW = Exclusion("G21", 50, "residual", 14.1, 5.6)
G17 = Exclusion("G17", 0, "residual", 14.1, 5.6)


def judged(name: str = "", value: float = 0.0) -> Checks:
    """The checks of one epoch in which every statistic is zero but one."""
    return judge({n: np.array([value if n == name else 0.0]) for n in NAMES}, LIMITS)


def outcome_of(name: str, value: float) -> Outcome:
    return Outcome(int(judged(name, value).outcome[0, NAMES.index(name)]))


@pytest.mark.parametrize("name", NAMES)
def test_one_ulp_below_its_threshold_a_check_passes(name: str) -> None:
    assert outcome_of(name, float(np.nextafter(THRESHOLD[name], -np.inf))) is PASS


@pytest.mark.parametrize("name", NAMES)
def test_at_its_threshold_a_check_passes(name: str) -> None:
    assert outcome_of(name, THRESHOLD[name]) is PASS


@pytest.mark.parametrize("name", NAMES)
def test_one_ulp_above_its_threshold_a_check_fails(name: str) -> None:
    assert outcome_of(name, float(np.nextafter(THRESHOLD[name], np.inf))) is FAIL


@pytest.mark.parametrize("name", NAMES)
def test_an_infinite_statistic_fails(name: str) -> None:
    assert outcome_of(name, np.inf) is FAIL


@pytest.mark.parametrize("name", NAMES)
def test_nan_is_unknown_where_required_and_not_monitored_elsewhere(name: str) -> None:
    assert outcome_of(name, np.nan) is (UNKNOWN if LIMITS.by_name[name].required else NOT_MONITORED)


@pytest.mark.parametrize("name", [t.name for t in LIMITS.thresholds if t.required])
def test_nan_in_a_required_check_is_never_normal(name: str) -> None:
    assert full_verdict(judged(name, np.nan), 0, evidence(), "stop").state is not State.NORMAL


def test_a_check_without_a_statistic_cannot_be_forgotten() -> None:
    with pytest.raises(KeyError):
        judge({n: np.zeros(1) for n in NAMES if n != "shape"}, LIMITS)


def evidence(
    repeating: Iterable[str] = (),
    named: Iterable[str] = (),
    collapsed: bool = False,
    exclusions: tuple[Exclusion, ...] = (),
    enough_without_exclusion: bool = False,
    acute: tuple[Exclusion, ...] | None = None,
    swapped: str = "",
    captured: Iterable[str] = (),
    fed: Iterable[str] = (),
    displaced: bool = False,
    short: Iterable[str] = (),
) -> Evidence:
    repeats, lacks, names, hears, told = (np.isin(RECEIVERS, list(chosen)) for chosen in (repeating, short, named, captured, fed))
    return Evidence(
        RECEIVERS,
        repeats,
        lacks,
        names,
        collapsed,
        hears,
        displaced,
        told,
        exclusions,
        exclusions if acute is None else acute,
        enough_without_exclusion,
        swapped,
    )


def checks(**outcomes: Outcome) -> Checks:
    """One epoch in which every check passes but those given; their statistics fit."""
    outcome = np.array([[outcomes.get(name, PASS) for name in NAMES]], dtype=np.int64)
    threshold = np.array([THRESHOLD[n] for n in NAMES])
    statistic: Floats = np.where(outcome == FAIL, 2.0 * threshold + 1.0, np.where(outcome == PASS, 0.0, np.nan))
    return Checks(NAMES, statistic, threshold, outcome)


def verdict(given: Evidence | None = None, policy: SatelliteFaultPolicy = "stop", /, **outcomes: Outcome) -> Verdict:
    return full_verdict(checks(**outcomes), 0, given or evidence(), policy)


def test_everything_passing_is_clean() -> None:
    assert verdict() == CLEAN


@pytest.mark.parametrize("name", [t.name for t in LIMITS.thresholds if not t.required])
def test_what_is_not_monitored_forbids_nothing(name: str) -> None:
    assert verdict(**{name: NOT_MONITORED}) == CLEAN


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("outcome", [UNKNOWN, FAIL])
def test_no_check_can_fail_unnoticed(name: str, outcome: Outcome) -> None:
    assert verdict(**{name: outcome}).state is not State.NORMAL


def said(found: Verdict) -> tuple[State, Cause, tuple[str, ...], str]:
    return found.state, found.cause, found.subjects, found.check


SA, NC = State.SATELLITE_ANOMALY, State.NOT_CONFIRMABLE


def test_cause_of_a_frozen_receiver() -> None:
    assert said(verdict(evidence(repeating="B"), repeat=FAIL)) == (NC, Cause.DATA, ("B",), "repeat")


def test_cause_of_too_few_satellites() -> None:
    assert said(verdict(data=FAIL, residual=UNKNOWN)) == (NC, Cause.DATA, (), "data")


def test_cause_of_too_few_satellites_at_one_receiver() -> None:
    assert said(verdict(evidence(short="C"), data=FAIL, residual=UNKNOWN)) == (NC, Cause.DATA, ("C",), "data")


def test_cause_of_too_few_satellites_with_evidence_in_cn0() -> None:
    assert said(verdict(data=FAIL, cn0=FAIL, residual=UNKNOWN)) == (SA, Cause.JAMMING, (), "cn0")


@pytest.mark.parametrize(("cn0", "cause"), [(NOT_MONITORED, Cause.JAMMING), (PASS, Cause.DATA)])
def test_cause_of_too_few_satellites_after_signals_are_lost_at_two_receivers(cn0: Outcome, cause: Cause) -> None:
    """Where what is left is as strong as ever, nothing was drowned: it was lost on the way."""
    assert verdict(data=FAIL, loss=FAIL, cn0=cn0, residual=UNKNOWN).cause is cause


def test_cause_of_too_few_satellites_because_of_exclusions() -> None:
    given = evidence(exclusions=(G17,), enough_without_exclusion=True)
    assert said(verdict(given, data=FAIL, residual=UNKNOWN)) == (SA, Cause.SATELLITE, ("G17",), "residual")


def test_cause_of_too_few_satellites_besides_exclusions() -> None:
    given = evidence(exclusions=(G17,), enough_without_exclusion=False)
    assert said(verdict(given, data=FAIL, residual=UNKNOWN)) == (NC, Cause.DATA, (), "data")


@pytest.mark.parametrize("name", ["cn0", "loss"])
def test_cause_of_weak_or_lost_signals(name: str) -> None:
    assert said(verdict(**{name: FAIL})) == (SA, Cause.JAMMING, (), name)


@pytest.mark.parametrize("name", ["circle_B", "common", "shape", "collapse", "residual", "b_value"])
def test_cause_of_a_required_check_that_could_not_run(name: str) -> None:
    assert said(verdict(**{name: UNKNOWN})) == (NC, Cause.DATA, (), name)


def test_cause_of_a_collapse() -> None:
    found = verdict(evidence(collapsed=True), collapse=FAIL, shape=FAIL, shape_3d=FAIL, circle_A=FAIL)
    assert said(found) == (SA, Cause.SPOOFING, RECEIVERS, "collapse")


def test_a_collapse_statistic_without_a_point_is_not_spoofing() -> None:
    assert verdict(evidence(collapsed=False), collapse=FAIL, shape=FAIL, shape_3d=FAIL).cause is Cause.AMBIGUOUS


@pytest.mark.parametrize("name", ["common", "common_3d"])
def test_cause_of_a_triangle_that_moved_whole(name: str) -> None:
    assert said(verdict(**{name: FAIL}, circle_A=FAIL)) == (SA, Cause.SPOOFING, (), name)


@pytest.mark.parametrize("shape", ["shape", "shape_3d"])
def test_a_triangle_that_changed_its_shape_did_not_move_whole(shape: str) -> None:
    assert verdict(common=FAIL, **{shape: FAIL}).cause is Cause.AMBIGUOUS


def test_cause_of_an_excluded_satellite() -> None:
    assert said(verdict(evidence(exclusions=(G17,)))) == (SA, Cause.SATELLITE, ("G17",), "residual")


def test_an_excluded_satellite_speaks_with_its_own_numbers() -> None:
    found = verdict(evidence(exclusions=(G17,)))
    assert (found.statistic, found.threshold) == (14.1, 5.6)


def test_an_excluded_satellite_leaves_normal_where_the_site_excludes() -> None:
    assert verdict(evidence(exclusions=(G17,)), "exclude") == CLEAN


def test_cause_of_a_named_receiver() -> None:
    assert said(verdict(evidence(named="B"), shape=FAIL, shape_3d=FAIL, circle_B=FAIL)) == (NC, Cause.RECEIVER, ("B",), "shape")


@pytest.mark.parametrize("name", ["shape", "shape_3d", "circle_A", "b_value", "residual", "collapse"])
def test_cause_of_what_nobody_can_be_blamed_for(name: str) -> None:
    assert said(verdict(**{name: FAIL})) == (NC, Cause.AMBIGUOUS, (), name)


def test_a_verdict_carries_the_numbers_of_its_check() -> None:
    found = verdict(shape=FAIL)
    assert (found.statistic, found.threshold) == (2.0 * THRESHOLD["shape"] + 1.0, THRESHOLD["shape"])


def test_a_hint_at_exchanged_antennas_is_the_first_reason() -> None:
    assert verdict(evidence(swapped="A and B exchanged"), shape=FAIL).reasons[0] == "A and B exchanged"


def test_every_failing_check_is_among_the_reasons() -> None:
    found = verdict(shape=FAIL, circle_B=FAIL, residual=UNKNOWN)
    assert [reason.split()[0] for reason in found.reasons] == ["circle_B", "shape", "residual"]


# ---- properties over all combinations of a reduced set of checks

REDUCED = ("data", "circle_A", "common", "shape", "shape_3d", "collapse", "residual", "b_value", "cn0", "repeat")
POSSIBLE = {name: (PASS, FAIL, UNKNOWN if LIMITS.by_name[name].required else NOT_MONITORED) for name in REDUCED}
EVIDENCE = [
    evidence(),
    evidence(repeating="A", named="B", collapsed=True, exclusions=(G17,), enough_without_exclusion=True),
]
COMBINATIONS = [dict(zip(REDUCED, outcomes, strict=True)) for outcomes in product(*POSSIBLE.values())]


@pytest.mark.parametrize("policy", ["stop", "exclude"])
@pytest.mark.parametrize("given", EVIDENCE, ids=["without evidence", "with evidence"])
def test_normal_is_exactly_where_nothing_fails_or_is_unknown(given: Evidence, policy: SatelliteFaultPolicy) -> None:
    wrong = []
    for outcomes in COMBINATIONS[::17]:
        allowed = max(outcomes.values()) < UNKNOWN and not (given.exclusions and policy == "stop")
        if (verdict(given, policy, **outcomes).state is State.NORMAL) != allowed:
            wrong.append(outcomes)
    assert wrong == []


@pytest.mark.parametrize("given", EVIDENCE, ids=["without evidence", "with evidence"])
def test_adding_a_failing_check_never_leads_to_normal(given: Evidence) -> None:
    improved = [
        (outcomes, name)
        for outcomes in COMBINATIONS[::211]
        for name in REDUCED
        if verdict(given, **outcomes).state is not State.NORMAL and verdict(given, **outcomes | {name: FAIL}).state is State.NORMAL
    ]
    assert improved == []


RANK = {State.NORMAL: 0, State.SATELLITE_ANOMALY: 1, State.NOT_CONFIRMABLE: 2}
TRIANGLE = ("data", "circle_A", "circle_B", "circle_C", "shape")


def alone(**outcomes: Outcome) -> State:
    return triangle_verdict(checks(**outcomes), 0).state


def test_adding_a_failing_check_never_improves_what_the_triangle_says() -> None:
    improved = [
        (outcomes, name)
        for values in product((PASS, FAIL, UNKNOWN), repeat=len(TRIANGLE))
        for name in TRIANGLE
        if RANK[alone(**(outcomes := dict(zip(TRIANGLE, values, strict=True))) | {name: FAIL})] < RANK[alone(**outcomes | {name: PASS})]
    ]
    assert improved == []


@pytest.mark.parametrize(
    ("outcomes", "state", "cause"),
    [
        ({}, State.NORMAL, Cause.NONE),
        ({"circle_B": FAIL}, SA, Cause.SATELLITE),
        ({"shape": FAIL}, NC, Cause.AMBIGUOUS),
        ({"shape": FAIL, "circle_B": FAIL}, NC, Cause.AMBIGUOUS),
        ({"data": FAIL}, NC, Cause.DATA),
        ({"data": FAIL, "circle_B": FAIL}, NC, Cause.DATA),
        ({"circle_B": UNKNOWN}, NC, Cause.DATA),
        ({"shape": UNKNOWN}, NC, Cause.DATA),
    ],
    ids=str,
)
def test_the_rule_of_the_source(outcomes: dict[str, Outcome], state: State, cause: Cause) -> None:
    found = triangle_verdict(checks(**outcomes), 0)
    assert (found.state, found.cause) == (state, cause)


@pytest.mark.parametrize("name", [n for n in NAMES if n not in TRIANGLE])
def test_the_rule_of_the_source_looks_at_nothing_else(name: str) -> None:
    assert alone(**{name: FAIL}) is State.NORMAL


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("outcome", [PASS, NOT_MONITORED, UNKNOWN, FAIL])
def test_clean_epochs_are_those_without_a_verdict(name: str, outcome: Outcome) -> None:
    found = checks(**{name: outcome})
    assert clean_epochs(found, "full").tolist() == [full_verdict(found, 0, evidence(), "stop") == CLEAN]


@pytest.mark.parametrize("name", TRIANGLE)
@pytest.mark.parametrize("outcome", [PASS, UNKNOWN, FAIL])
def test_clean_epochs_of_the_triangle_are_those_without_a_verdict_of_it(name: str, outcome: Outcome) -> None:
    found = checks(**{name: outcome})
    assert clean_epochs(found, "triangle").tolist() == [triangle_verdict(found, 0) == CLEAN]


LONG_CLEAN = Exclusion("G17", 0, "step", 2000.0, 6.6, clean_since_ns=10, clean_epochs=900)


def test_a_satellite_that_has_long_been_clean_stops_nothing_more() -> None:
    assert verdict(evidence(exclusions=(LONG_CLEAN,), acute=())) == CLEAN


@pytest.mark.parametrize("policy", ["stop", "exclude"])
def test_a_satellite_that_has_long_been_clean_is_not_blamed_for_a_circle(policy: SatelliteFaultPolicy) -> None:
    assert verdict(evidence(exclusions=(LONG_CLEAN,), acute=()), policy, circle_A=FAIL).cause is Cause.AMBIGUOUS


def test_one_that_fails_now_is() -> None:
    said = verdict(evidence(exclusions=(LONG_CLEAN, G21_NOW), acute=(G21_NOW,)), circle_A=FAIL)
    assert (said.cause, said.subjects, said.check) == (Cause.SATELLITE, ("G21",), "residual")


def test_a_captured_pair_is_spoofing_of_these_two() -> None:
    said = verdict(evidence(captured=("A", "C")), capture=FAIL, shape=FAIL)
    assert (said.cause, said.subjects) == (Cause.SPOOFING, ("A", "C"))


def test_a_receiver_that_is_told_otherwise_than_the_others_is_spoofed() -> None:
    said = verdict(evidence(fed=("B",)), told=FAIL)
    assert (said.cause, said.subjects) == (Cause.SPOOFING, ("B",))


def test_a_pair_that_does_not_fit_one_transmitter_is_not_called_spoofed() -> None:
    assert verdict(capture=FAIL).cause is Cause.AMBIGUOUS


def test_time_that_leaves_the_host_is_a_matter_of_clocks() -> None:
    assert verdict(host_time=FAIL).cause is Cause.CLOCK


def test_a_constellation_that_is_out_is_named_by_its_system() -> None:
    out = tuple(Exclusion(satellite, 0, "constellation", 99.0, 40.0) for satellite in ("E01", "E02"))
    said = verdict(evidence(exclusions=out))
    assert (said.cause, said.subjects, said.check) == (Cause.CONSTELLATION, ("Galileo",), "constellation")


@pytest.mark.parametrize("check", ["ephemeris", "orbit", "constellation", "slow"])
def test_what_cannot_be_excluded_is_ambiguous(check: str) -> None:
    assert verdict(**{check: FAIL}).cause is Cause.AMBIGUOUS
