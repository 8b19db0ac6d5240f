"""Antenna paths by hand, and ways over nodes."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.unit.track.lines import ENU, Floats, edge, from_enu, line, straight, to_enu, turning
from train_client.track.locus import AT_SWITCH, END_OF_MAP, antenna_position, locus_of, tangents
from train_client.track.network import Place, Unreachable, arc_between, shifted
from train_client.track.track_map import Edge, Switch, TrackMap

HEIGHT_M, LATERAL_M, RADIUS_M, CANT_RAD = 4.0, 0.5, 160.0, 0.08
# Over 100 m the ellipsoid's normal turns against that of the origin by 100 m / 6371 km: 63 um at 4 m of height.
NORMAL_M = 7e-5


def circle(to_right: bool) -> Edge:
    s_m = np.cumsum([0.0, 2.0, 3.0, 1.0, 2.5] * 8)
    s_m = s_m[np.concatenate(([True], np.diff(s_m) > 0))]
    sign = 1.0 if to_right else -1.0
    return edge("curve", "a", "b", turning(s_m, np.full(len(s_m) - 1, sign / RADIUS_M)), s_m, sign * CANT_RAD)


def radii_m(positions_enu_m: Floats, to_right: bool) -> Floats:
    """Distances from the centre of the circle."""
    return np.hypot(positions_enu_m[:, 0] - (RADIUS_M if to_right else -RADIUS_M), positions_enu_m[:, 1])


@pytest.mark.parametrize(("to_right", "inwards"), [(True, 1.0), (False, -1.0)])
def test_radius_of_the_antenna_in_a_canted_curve(to_right: bool, inwards: float) -> None:
    """Cant leans it inwards by h sin(phi); an offset to the right is inwards only in a curve to the right."""
    found = radii_m(to_enu(locus_of(line(circle(to_right)), HEIGHT_M, LATERAL_M).pos_ecef_m), to_right)
    expected = RADIUS_M - HEIGHT_M * np.sin(CANT_RAD) - inwards * LATERAL_M * np.cos(CANT_RAD)
    assert found == pytest.approx(np.full(len(found), expected), abs=NORMAL_M)


@pytest.mark.parametrize(("to_right", "inwards"), [(True, 1.0), (False, -1.0)])
def test_height_of_the_antenna_in_a_canted_curve(to_right: bool, inwards: float) -> None:
    """The inner rail is low: what lies to the inside sinks."""
    found = to_enu(locus_of(line(circle(to_right)), HEIGHT_M, LATERAL_M).pos_ecef_m)[:, 2]
    expected = HEIGHT_M * np.cos(CANT_RAD) - inwards * LATERAL_M * np.sin(CANT_RAD)
    assert found == pytest.approx(np.full(len(found), expected), abs=NORMAL_M)


def test_map_metres_per_metre_of_locus_follow_the_radius() -> None:
    locus = locus_of(line(circle(True)), HEIGHT_M, 0.0)
    inner = RADIUS_M - HEIGHT_M * np.sin(CANT_RAD)
    # s runs along the arc, the locus along the chord: L^2 / 24 R^2 = 1.5e-5 for 3 m.
    assert locus.ds_dm == pytest.approx(np.full(len(locus.ds_dm), RADIUS_M / inner), abs=2e-5)


def test_on_a_circle_tangents_are_those_of_the_circle() -> None:
    curve = circle(True)
    (found,) = tangents(line(curve))
    heading = curve.s_m / RADIUS_M
    expected = np.column_stack((np.sin(heading), np.cos(heading), np.zeros_like(heading)))
    assert np.einsum("ni,ji->nj", found, ENU) == pytest.approx(expected, abs=1e-9)


@pytest.mark.parametrize("reverse", [False, True])
def test_a_node_on_a_transition_changes_no_tangent(reverse: bool) -> None:
    """The chord beyond the node counts, whichever way the edge beyond it runs."""
    s_m = np.arange(0.0, 81.0, 4.0)
    enu_m = turning(s_m, np.linspace(0.0, 1 / 100, 20))
    (whole,) = tangents(line(edge("whole", "a", "b", enu_m, s_m)))
    first, rest = edge("first", "a", "n", enu_m[:11], s_m[:11]), edge("rest", "n", "b", enu_m[10:], s_m[:11])
    if reverse:
        rest = edge("rest", "b", "n", enu_m[:9:-1], s_m[:11])
    before, after = tangents(line(first, rest))
    joined = np.concatenate((before, (-after[::-1] if reverse else after)[1:]))
    assert joined == pytest.approx(whole, abs=1e-12)


def test_the_antenna_stands_on_the_ellipsoid_normal_and_not_on_the_line_to_the_centre() -> None:
    """0.18 degrees differ at 36 degrees of latitude: 13 mm at 4 m."""
    point, east = from_enu(np.zeros((1, 3))), ENU[None, 0]
    offset = to_enu(antenna_position(point, east, np.zeros(1), HEIGHT_M, 0.0))[0]
    assert offset == pytest.approx([0.0, 0.0, HEIGHT_M], abs=1e-9)


def test_on_a_slope_the_antenna_stands_square_to_the_track() -> None:
    slope = np.array([[0.0, 0.8, 0.6]])
    offset = to_enu(antenna_position(from_enu(np.zeros((1, 3))), np.einsum("ni,ij->nj", slope, ENU), np.zeros(1), 1.0, 0.0))[0]
    assert offset == pytest.approx([0.0, -0.6, 0.8], abs=1e-9)


def test_segments_end_where_the_next_begins() -> None:
    locus = locus_of(line(circle(True)), HEIGHT_M, LATERAL_M)
    ends = locus.pos_ecef_m + locus.length_m[:, None] * locus.along_ecef
    assert ends[:-1] == pytest.approx(locus.pos_ecef_m[1:], abs=1e-8)


def against() -> TrackMap:
    """Two edges of 100 and 150 m that both end at the node between them."""
    return line(straight("first", "a", "n", 0, 100), straight("second", "b", "n", 250, 100))


def fork() -> TrackMap:
    """A stem of 100 m and two branches of 50 m, the second one laid out towards the fork."""
    east = np.column_stack((np.linspace(0.3, 0.0, 6), np.linspace(150.0, 100.0, 6), np.zeros(6)))
    branches = (straight("left", "n", "b", 100, 150), edge("right", "c", "n", east, np.linspace(0.0, 50.0, 6)))
    return line(straight("stem", "a", "n", 0, 100), *branches, switches=(Switch("n", (("stem", "left"), ("right", "stem"))),))


def test_neighbours_across_a_node_where_edges_run_against_each_other() -> None:
    locus = locus_of(against(), HEIGHT_M, 0.0)
    assert (locus.after[9], locus.after[24]) == (24, 9)


def test_neighbours_at_the_ends_of_the_map() -> None:
    locus = locus_of(against(), HEIGHT_M, 0.0)
    assert (locus.before[0], locus.before[10]) == (END_OF_MAP, END_OF_MAP)


def test_neighbours_within_an_edge() -> None:
    locus = locus_of(against(), HEIGHT_M, 0.0)
    assert (locus.after[3], locus.before[3], locus.after[10], locus.before[24]) == (4, 2, 11, 23)


def test_a_switch_is_passed_trailing_but_not_facing() -> None:
    locus = locus_of(fork(), HEIGHT_M, 0.0)
    stem, left, right = 9, 10, 19  # the segments at the node
    assert (locus.after[stem], locus.before[left], locus.after[right]) == (AT_SWITCH, stem, stem)


def test_shift_into_an_edge_that_runs_the_other_way() -> None:
    assert shifted(against(), 0, 90.0, 30.0) == Place(1, 130.0, -1)


def test_shift_back_from_an_edge_that_runs_the_other_way() -> None:
    assert shifted(against(), 1, 130.0, 30.0) == Place(0, 90.0, -1)


def test_shift_to_the_node_stays_on_the_edge() -> None:
    assert shifted(against(), 0, 90.0, 10.0) == Place(0, 100.0, 1)


@pytest.mark.parametrize(
    ("track", "start", "distance_m", "why"),
    [
        (against(), (0, 90.0), 170.0, "the map ends at node b of edge second: 10.000 m lie beyond"),
        (against(), (0, 5.0), -6.0, "the map ends at node a of edge first: 1.000 m lie beyond"),
        (fork(), (0, 90.0), 11.0, "2 ways go on at node n, and the switch is not known: 1.000 m lie beyond"),
        (fork(), (0, 100.5), 1.0, "s = 100.5 m is not on edge stem, which goes from 0.000 to 100.000 m"),
        (fork(), (3, 0.0), 1.0, "no edge 3: the map has 3"),
        (fork(), (0, 0.0), float("nan"), "a distance of nan m: expected a number"),
    ],
)
def test_unreachable_says_why(track: TrackMap, start: tuple[int, float], distance_m: float, why: str) -> None:
    assert shifted(track, *start, distance_m) == Unreachable(why)


def test_shift_through_a_trailing_switch() -> None:
    assert shifted(fork(), 2, 45.0, 10.0) == Place(0, 95.0, -1)


def test_a_ring_shorter_than_the_train_is_walked_around() -> None:
    s_m = np.linspace(0.0, 400.0, 81)
    ring = line(edge("ring", "n", "n", turning(s_m, np.full(80, 2 * np.pi / 400.0)), s_m))
    place = shifted(ring, 0, 390.0, 420.0)
    assert isinstance(place, Place) and place.s_m == pytest.approx(10.0)


def test_arc_to_a_branch_is_known_though_the_switch_is_facing() -> None:
    assert arc_between(fork(), Place(0, 90.0), Place(2, 45.0), 100.0) == 15.0


def test_arc_backwards_is_negative() -> None:
    assert arc_between(fork(), Place(1, 10.0), Place(0, 90.0), 100.0) == -20.0


def test_arc_between_branches_has_no_allowed_way() -> None:
    assert arc_between(fork(), Place(1, 10.0), Place(2, 45.0), 100.0) == Unreachable(
        "no allowed way from left 10.0 m to right 45.0 m within 100 m"
    )


def test_arc_on_a_ring_has_two_ways() -> None:
    s_m = np.linspace(0.0, 400.0, 81)
    ring = line(edge("ring", "n", "n", turning(s_m, np.full(80, 2 * np.pi / 400.0)), s_m))
    assert arc_between(ring, Place(0, 100.0), Place(0, 250.0), 300.0) == Unreachable(
        "2 ways, of 150.0 m, 250.0 m from ring 100.0 m to ring 250.0 m within 300 m"
    )


@given(st.floats(0.0, 100.0), st.floats(-400.0, 400.0))
def test_shift_and_arc_agree(s_m: float, distance_m: float) -> None:
    track = against()
    place = shifted(track, 0, s_m, distance_m)
    if isinstance(place, Place):
        assert arc_between(track, Place(0, s_m), place, 500.0) == pytest.approx(distance_m, abs=1e-9)
    else:
        assert not 0.0 <= s_m + distance_m <= 250.0
