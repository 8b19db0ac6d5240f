"""Each check of a map on a line with one thing wrong with it: it is found, there, with its size, and nothing else is."""

import math
from collections.abc import Callable
from dataclasses import asdict, replace

import numpy as np
import pytest

from recordings.toml_file import ConfigProblems
from tests.unit.track.lines import Floats, edge, line, straight, turning
from train_client.track.checks import check_map, load_map
from train_client.track.findings import Finding, runs
from train_client.track.track_map import Edge, Node, Switch, TrackMap, format_map

S_M = np.arange(0.0, 301.0, 2.5)
CURVATURE = np.interp((S_M[:-1] + S_M[1:]) / 2, [80, 120, 200, 240], [0.0, 1 / 160, 1 / 160, 0.0])
CANT_RAD = np.interp(S_M, [80, 120, 200, 240], [0.0, 0.08, 0.08, 0.0])
ENU_M = turning(S_M, CURVATURE, rise=0.01)


def curved(**changes: Callable[[Floats], Floats]) -> TrackMap:
    """A curve of 160 m with transitions, cant and a gradient, in one edge; `enu_m`, `s_m`, `cant_rad` changed as asked."""
    values: dict[str, Floats] = {"enu_m": ENU_M.copy(), "s_m": S_M.copy(), "cant_rad": CANT_RAD.copy()}
    for name, change in changes.items():
        values[name] = change(values[name])
    return line(edge("line", "a", "b", values["enu_m"], values["s_m"], values["cant_rad"]))


def found(track: TrackMap) -> list[tuple[bool, str, str, float | None]]:
    check = check_map(track)
    return [(f.error, f.check, f.place, f.s_m) for f in check.errors + check.warnings]


def only(track: TrackMap) -> Finding:
    (finding,) = [*check_map(track).errors, *check_map(track).warnings]
    return finding


def size(finding: Finding) -> float:
    assert finding.value is not None
    return round(finding.value, 3)


def test_a_sound_line_has_no_findings() -> None:
    assert found(curved()) == []


def test_facts_of_a_line() -> None:
    facts = check_map(curved()).facts
    assert facts is not None
    rounded = {key: round(value, 4) for key, value in asdict(facts).items() if key != "least_radius_m"}
    sizes = {"nodes": 2, "edges": 1, "points": 121, "length_m": 300.0}
    # 2.5 m chords: sagitta 6.25 / 8 / 160 m; the plane of the test leaves the ellipsoid by 7 mm in 300 m.
    assert rounded == sizes | {"greatest_cant_rad": 0.08, "greatest_gradient": 0.01, "sagitta_m": 0.0049}


def test_least_radius_of_a_line() -> None:
    facts = check_map(curved()).facts
    assert facts is not None and facts.least_radius_m == pytest.approx(160.0, rel=1e-3)


def test_a_straight_line_has_no_radius() -> None:
    facts = check_map(line(straight("line", "a", "b", 0, 400))).facts
    assert facts is not None and facts.least_radius_m == math.inf


def test_a_gap_names_the_metres_that_are_missing() -> None:
    (whole,) = line(straight("line", "a", "b", 0, 400)).edges
    kept = np.r_[0:15, 30:41]
    finding = only(line(Edge("line", "a", "b", whole.s_m[kept], whole.pos_ecef_m[kept], whole.cant_rad[kept])))
    assert (finding.error, finding.check, finding.s_m, size(finding)) == (True, "gap", 140.0, 160.0)


def test_a_gap_at_a_node_names_the_metres_that_are_missing() -> None:
    finding = only(line(straight("first", "a", "n", 0, 100), straight("second", "n", "b", 107, 207)))
    assert str(finding).startswith("node n: gap: 7.00 m missing between edge first and edge second: expected 0.05 m at most")


AT = np.arange(len(S_M))[:, None]


@pytest.mark.parametrize(
    ("track", "expected"),
    [
        (curved(enu_m=lambda v: v[np.minimum(np.r_[0:31, 30:121], 120)][:121], cant_rad=np.zeros_like), {(True, "duplicate", 75.0)}),
        (curved(s_m=lambda v: v + np.where(v > 100, 0.2, 0)), {(True, "distance", 100.0)}),
        (curved(s_m=lambda v: v * 1.004), {(False, "length", None)}),
        (
            curved(enu_m=lambda v: v + np.where(AT == 20, [0.3, 0, 0], 0)),
            {(True, "radius", 50.0), (True, "kink", 50.0), (False, "sagitta", 47.5)},
        ),
        (curved(enu_m=lambda v: v + np.where(AT == 20, [0, 0, 0.3], 0)), {(True, "gradient", 47.5), (True, "kink", 50.0)}),
        (curved(cant_rad=lambda v: v * 3), {(True, "cant", 120.0)}),
        (curved(cant_rad=lambda v: -v), {(False, "leaning", 92.5)}),
        (curved(cant_rad=lambda v: v + np.where(AT[:, 0] >= 10, 0.03, 0)), {(True, "twist", 22.5)}),
        (curved(enu_m=lambda v: v + np.array([0, 0, 9000.0])), {(True, "earth", 300.0)}),
        (curved(enu_m=lambda v: v - np.array([0, 0, 6.0e6])), {(True, "earth", 300.0)}),
    ],
)
def test_one_thing_wrong_with_an_edge(track: TrackMap, expected: set[tuple[bool, str, float | None]]) -> None:
    assert {(error, check, s_m) for error, check, _, s_m in found(track)} == expected


def test_points_too_far_apart_for_their_curve_are_a_warning_with_the_sagitta() -> None:
    s_m = np.arange(0.0, 301.0, 20.0)
    finding = only(line(edge("line", "a", "b", turning(s_m, np.full(15, 1 / 200)), s_m)))
    assert (finding.error, finding.check, size(finding)) == (False, "sagitta", 20.0**2 / 8 / 200)


def test_a_stated_gradient_against_the_heights() -> None:
    (whole,) = curved().edges
    stated = Edge("line", "a", "b", whole.s_m, whole.pos_ecef_m, whole.cant_rad, np.where(whole.s_m > 250, -0.01, 0.01))
    finding = only(line(stated))
    assert (finding.check, size(finding)) == ("stated gradient", 0.02)


def test_a_kink_where_two_edges_meet() -> None:
    slanting = np.column_stack((np.linspace(0, 5, 11), np.linspace(100, 200, 11), np.zeros(11)))
    second = edge("second", "n", "b", slanting, np.linspace(0, np.hypot(5, 100), 11))
    finding = only(line(straight("first", "a", "n", 0, 100), second))
    assert (finding.check, finding.place, size(finding)) == ("kink", "node n", round(math.atan(0.05), 3))


def test_a_node_in_a_tight_curve_is_no_kink() -> None:
    """7 m chords turn by 44 mrad each; more than a kink may, but the curve explains it."""
    s_m = np.arange(0.0, 141.0, 7.0)
    enu_m = turning(s_m, np.full(20, 1 / 160))
    halves = (edge("first", "a", "n", enu_m[:11], s_m[:11]), edge("second", "n", "b", enu_m[10:], s_m[:11]))
    assert found(line(*halves)) == []


def test_cant_changes_its_sign_where_edges_run_against_each_other() -> None:
    half = len(S_M) // 2
    first = edge("first", "a", "n", ENU_M[: half + 1], S_M[: half + 1], CANT_RAD[: half + 1])
    back = slice(None, half - 1, -1)
    second = edge("second", "b", "n", ENU_M[back], 300.0 - S_M[back], -CANT_RAD[back])
    same_sign = edge("second", "b", "n", ENU_M[back], 300.0 - S_M[back], CANT_RAD[back])
    assert (found(line(first, second)), found(line(first, same_sign))) == (
        [],
        [(True, "twist", "node n", None), (False, "leaning", "edge second", 70.0)],
    )


def three(**more: object) -> TrackMap:
    """A stem and two branches; the second leaves with 1 in 40."""
    slanting = np.column_stack((np.linspace(0, 5, 21), np.linspace(100, 300, 21), np.zeros(21)))
    right = edge("right", "n", "c", slanting, np.linspace(0, np.hypot(5, 200), 21))
    return line(straight("stem", "a", "n", 0, 100), straight("left", "n", "b", 100, 300), right, **more)


def test_three_edges_need_an_entry_in_switches() -> None:
    assert str(only(three())).startswith("node n: switch: 3 edges (stem, left, right) and no entry in switches")


def test_branches_are_close_at_their_node_without_a_warning() -> None:
    assert found(three(switches=(Switch("n", (("stem", "left"), ("stem", "right"))),))) == []


def test_a_pair_that_would_turn_the_train_round_is_a_kink() -> None:
    finding = only(three(switches=(Switch("n", (("stem", "left"), ("left", "right"))),)))
    assert (finding.check, size(finding)) == ("kink", round(math.pi - math.atan(0.025), 3))


def test_a_pair_of_an_edge_that_ends_elsewhere() -> None:
    track = line(straight("first", "a", "n", 0, 100), straight("second", "n", "m", 100, 200), straight("third", "m", "b", 200, 300))
    finding = only(replace(track, switches=(Switch("n", (("first", "second"), ("first", "third"))),)))
    assert str(finding).startswith("node n: switch: switches lets edge third pass here, but it does not end here")


def test_a_node_of_the_wrong_kind() -> None:
    track = line(straight("first", "a", "n", 0, 100), straight("second", "n", "b", 100, 200))
    wrong = replace(track, nodes=(Node("a", "end"), Node("n", "end"), Node("b", "end")))
    assert str(only(wrong)).startswith('node n: kind: 2 edge ends at a node of kind "end"')


def beside(spacing_m: float) -> TrackMap:
    """Two straight tracks, joined nowhere; the points of one lie between those of the other, also where chords of 9 m are cut in five."""
    north_m = np.linspace(0.9, 180.9, 21)
    second = np.column_stack((np.full(21, spacing_m), north_m, np.zeros(21)))
    return line(straight("first", "a", "b", 0, 180, step_m=9.0), edge("second", "c", "d", second, north_m - 0.9))


@pytest.mark.parametrize(("spacing_m", "close"), [(2.95, True), (3.05, False)])
def test_tracks_beside_each_other(spacing_m: float, close: bool) -> None:
    spacings_m = [f.value for f in check_map(beside(spacing_m)).warnings if f.check == "parallel"]
    assert spacings_m == [pytest.approx(spacing_m, abs=1e-3)] * close


def test_a_bridge_is_not_beside_what_it_crosses() -> None:
    over = np.column_stack((np.linspace(-50, 50, 11), np.full(11, 50.0), np.full(11, 6.0)))
    track = line(straight("first", "a", "b", 0, 100), edge("over", "c", "d", over, np.linspace(0, 100, 11)))
    assert [f.check for f in check_map(track).warnings] == ["orphan"]


def test_what_cannot_be_reached_is_a_warning() -> None:
    finding = only(beside(50.0))
    assert str(finding) == "edge second: orphan: second cannot be reached from the rest: correct from and to of its edges"


def test_a_node_without_edges_is_a_warning() -> None:
    track = curved()
    assert found(replace(track, nodes=(*track.nodes, Node("x", "end")))) == [(False, "orphan", "node x", None)]


def test_no_train_runs_on_a_map_with_errors() -> None:
    with pytest.raises(ConfigProblems, match=r"line\.json: node n: gap: 7\.00 m missing"):
        load_map(format_map(line(straight("first", "a", "n", 0, 100), straight("second", "n", "b", 107, 207))), "line.json")


def test_warnings_forbid_nothing() -> None:
    assert load_map(format_map(beside(2.0)), "line.json").id == "test"


def test_neighbouring_findings_are_one_with_the_worst_place() -> None:
    severity = np.array([0.0, 2.0, 5.0, 3.0, 0.0, 4.0])
    assert [tuple(run) for run in runs(severity > 1, severity)] == [(2, 1, 3), (5, 5, 5)]
