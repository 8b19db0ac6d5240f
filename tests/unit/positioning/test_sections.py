"""Search over the map: every place that fits, and no other."""

from dataclasses import fields, replace

import numpy as np
import pytest

from integrity.gnss.observations import Floats, ObservationBlock
from tests.unit.positioning.field import (
    ANTENNAS,
    BEGIN,
    LIMITS,
    NO_LIMIT,
    NOISE_03,
    Heard,
    corner,
    corner_points,
    cut,
    edge,
    heard,
    map_points,
    paths_on,
    ranges_of,
    track_of,
    whole_track,
)
from train_client.limits import TrainLimits
from train_client.positioning.constrained import Paths, Why
from train_client.positioning.sections import Located, Search, locate, reference_satellite_score, scores, search
from train_client.simulate.line import Piece, build_line
from train_client.track.track_map import Edge, Switch

HERE_M = 300.0  # where the front antenna is, on the first epoch


@pytest.fixture(scope="module")
def noisy() -> Heard:
    return heard(front_m=HERE_M + 2.0, seconds=12.0, rate_hz=1.0, errors=NOISE_03, antennas=ANTENNAS[:1])


def looked(
    paths: Paths,
    told: Heard,
    epoch: int = 0,
    satellites: tuple[str, ...] | None = None,
    change_m: Floats | float = 0.0,
    limits: TrainLimits = LIMITS,
) -> Located:
    one = cut(told, slice(epoch, epoch + 1))
    values = {f.name: getattr(one.block, f.name) for f in fields(ObservationBlock)}
    block = ObservationBlock(**(values | {"pseudorange_m": one.block.pseudorange_m + change_m}))
    used = np.isin(block.satellites, satellites) if satellites else np.ones(len(block.satellites), dtype=np.bool_)
    return locate(ranges_of(one, np.full(used.shape, 0.3), used, block), paths, limits)


def on_map(paths: Paths, found: Located) -> list[tuple[int, float]]:
    """(edge, s) of each hypothesis."""
    locus = paths.loci[0]
    return [(int(locus.edge[h.segment]), float(locus.s_m[h.segment] + locus.ds_dm[h.segment] * h.d_m)) for h in found.hypotheses]


def test_one_track_one_place(noisy: Heard) -> None:
    paths = paths_on(whole_track(), ANTENNAS[:1])
    for epoch in range(12):
        found = looked(paths, noisy, epoch)
        assert found.outcome is Search.LOCATED
        ((at_edge, at_m),) = on_map(paths, found)
        assert (at_edge, at_m) == pytest.approx((0, noisy.s_m[epoch, 0]), abs=5.0 * found.hypotheses[0].sigma_m)


def test_a_search_among_wrong_segments_finds_nothing_there(noisy: Heard) -> None:
    paths, one = paths_on(whole_track(), ANTENNAS[:1]), cut(noisy, slice(0, 1))
    used = np.ones(len(one.system_of), dtype=np.bool_)
    ranges = ranges_of(one, np.full(used.shape, 0.3), used)
    assert locate(ranges, paths, LIMITS, among=np.arange(100, 110)).outcome is Search.REFUSED


def test_parallel_tracks_half_a_metre_apart_are_both_told(noisy: Heard) -> None:
    s_m = map_points()
    paths = paths_on(track_of([edge("one", ("a", "b"), s_m), edge("two", ("c", "d"), s_m, lifted=0.5)]), ANTENNAS[:1])
    found = looked(paths, noisy)
    assert (found.outcome, sorted(e for e, _ in on_map(paths, found))) == (Search.AMBIGUOUS, [0, 1])


def test_of_tracks_20_m_apart_one_fits(noisy: Heard) -> None:
    s_m = map_points()
    paths = paths_on(track_of([edge("one", ("a", "b"), s_m, lifted=-20.0), edge("two", ("c", "d"), s_m)]), ANTENNAS[:1])
    found = looked(paths, noisy)
    assert (found.outcome, [e for e, _ in on_map(paths, found)]) == (Search.LOCATED, [1])


def test_just_beyond_a_switch_both_branches_are_told(noisy: Heard) -> None:
    s_m = map_points()
    ahead = build_line(BEGIN, (Piece(800.0),))
    edges = [
        edge("trunk", ("a", "fork"), s_m[s_m <= 280.0]),
        edge("left", ("fork", "b"), s_m[s_m >= 280.0]),
        edge("right", ("fork", "c"), np.arange(280.0, 700.0, 20.0), of=ahead),
    ]
    paths = paths_on(track_of(edges, [Switch("fork", (("trunk", "left"), ("trunk", "right")))]), ANTENNAS[:1])
    found = looked(paths, noisy)
    assert (found.outcome, sorted(e for e, _ in on_map(paths, found))) == (Search.AMBIGUOUS, [1, 2])


def test_where_two_edges_meet_there_is_one_place() -> None:
    s_m = map_points()
    told = heard(front_m=402.0, speed_mps=0.0, seconds=12.0, rate_hz=1.0, errors=NOISE_03, antennas=ANTENNAS[:1])
    edges = [edge("one", ("a", "mid"), s_m[s_m <= 400.0]), edge("two", ("mid", "b"), s_m[s_m >= 400.0])]
    paths = paths_on(track_of(edges), ANTENNAS[:1])
    assert [looked(paths, told, epoch).outcome for epoch in range(12)] == [Search.LOCATED] * 12


def test_off_the_map_there_is_no_place(noisy: Heard) -> None:
    s_m = map_points()
    paths = paths_on(track_of([edge("short", ("a", "b"), s_m[s_m <= 240.0])]), ANTENNAS[:1])
    found = looked(paths, noisy)
    assert (found.outcome, found.why) == (Search.REFUSED, Why.OFF_MAP_END)


def test_a_satellite_100_m_wrong_fits_nowhere(noisy: Heard) -> None:
    paths = paths_on(whole_track(), ANTENNAS[:1])
    found = looked(paths, noisy, change_m=np.where(np.arange(len(noisy.system_of)) == 4, 100.0, 0.0))
    assert (found.outcome, found.why) == (Search.REFUSED, Why.NOT_ON_TRACK)


def test_two_satellites_locate_nothing(noisy: Heard) -> None:
    high = tuple(s for s, k in zip(noisy.block.satellites, noisy.system_of, strict=True) if k == 0)[:2]
    found = looked(paths_on(whole_track(), ANTENNAS[:1]), noisy, satellites=high)
    assert (found.outcome, found.why) == (Search.REFUSED, Why.TOO_FEW_SATELLITES)


def candidates(paths: Paths, told: Heard) -> list[int]:
    one = cut(told, slice(0, 1))
    used = np.ones(len(one.system_of), dtype=np.bool_)
    found = search(ranges_of(one, np.full(used.shape, 0.3), used), paths, LIMITS)
    return [int(segment) for segment in found]


def test_the_search_begins_next_to_the_truth(noisy: Heard) -> None:
    """The first candidate's segment or a neighbour holds the antenna."""
    paths = paths_on(whole_track(), ANTENNAS[:1])
    truth = int(np.searchsorted(paths.loci[0].s_m, noisy.s_m[0, 0], side="right")) - 1
    assert abs(candidates(paths, noisy)[0] - truth) <= 1


def test_only_minima_are_sought_from(noisy: Heard) -> None:
    assert len(candidates(paths_on(whole_track(), ANTENNAS[:1]), noisy)) <= 2


def test_minima_that_cannot_reach_the_best_are_left_out(noisy: Heard) -> None:
    s_m = map_points()
    paths = paths_on(track_of([edge("one", ("a", "b"), s_m, lifted=100.0), edge("two", ("c", "d"), s_m)]), ANTENNAS[:1])
    assert {int(paths.loci[0].edge[segment]) for segment in candidates(paths, noisy)} == {1}


@pytest.fixture(scope="module")
def between() -> Heard:
    """At 210 m, on the straight."""
    return heard(front_m=212.0, speed_mps=0.0, seconds=1.0, rate_hz=1.0, errors=NOISE_03, antennas=ANTENNAS[:1])


def two_tracks(first_point_m: float) -> Paths:
    """Half a metre apart; the points of the second begin elsewhere than those of the first."""
    s_m = np.arange(0.0, 300.0, 20.0)
    edges = [edge("one", ("a", "b"), s_m), edge("two", ("c", "d"), first_point_m + s_m[:-1], lifted=0.5)]
    return paths_on(track_of(edges), ANTENNAS[:1])


def test_how_near_a_point_of_the_map_lies_decides_nothing(between: Heard) -> None:
    """The second track has a point where the antenna is; of the first, the next one is 10 m (80 sigma) away."""
    assert looked(two_tracks(10.0), between).outcome is Search.AMBIGUOUS


def test_what_exceeds_the_best_by_more_than_the_margin_is_dismissed(between: Heard) -> None:
    both = looked(two_tracks(0.0), between).hypotheses
    apart = both[1].sse - both[0].sse
    told = [len(looked(two_tracks(0.0), between, limits=replace(LIMITS, search_margin=apart * x)).hypotheses) for x in (1.001, 0.999)]
    assert told == [2, 1]


def test_inside_a_corner_between_edges_two_solutions_are_one_place() -> None:
    """From the trunk and from the branch that continues it with a corner, on both of which the antenna has a place."""
    points, (_, told) = corner_points(), corner(2.0)
    side = np.cross(points[1] - points[0], points[1])
    away = np.stack((points[1], points[1] - 150.0 * side / np.linalg.norm(side)))
    s_m = np.array([0.0, 150.0])
    chords = {"trunk": ("a", "m", points[:2]), "on": ("m", "b", points[1:]), "away": ("m", "c", away)}
    edges = [Edge(name, begins, ends, s_m, pos, np.zeros(2)) for name, (begins, ends, pos) in chords.items()]
    paths = paths_on(track_of(edges, [Switch("m", (("trunk", "on"), ("trunk", "away")))]), ANTENNAS[:1])
    assert {looked(paths, told, epoch, limits=NO_LIMIT).outcome for epoch in range(3)} == {Search.LOCATED}


def test_the_score_is_generalised_least_squares_of_single_differences() -> None:
    """Against the definition: differences d to a reference with covariance C, d' C^-1 d; whichever the reference."""
    rng = np.random.default_rng(8)
    residual_m, sigma_m = rng.normal(size=(3, 6)), rng.uniform(0.5, 2.0, 6)
    ours = scores(residual_m, sigma_m, np.ones(6, dtype=np.bool_), np.zeros(6, dtype=np.int64), 1)
    for reference in (0, 4):
        D = np.delete(np.eye(6) - np.eye(6)[reference], reference, axis=0)
        C = D @ np.diag(sigma_m**2) @ D.T
        assert ours == pytest.approx([float(D @ r @ np.linalg.inv(C) @ D @ r) for r in residual_m])


def test_each_constellation_has_a_mean_of_its_own() -> None:
    rng = np.random.default_rng(9)
    residual_m, system_of = rng.normal(size=(2, 8)), np.array([0, 0, 0, 0, 1, 1, 1, 1])
    args = np.ones(8), np.ones(8, dtype=np.bool_), system_of, 2
    assert scores(residual_m + 1e5 * system_of, *args) == pytest.approx(scores(residual_m, *args), rel=1e-6)


def test_the_thesis_score_depends_on_its_reference() -> None:
    residual_m, used = np.array([[0.0, 1.0, 3.0]]), np.ones(3, dtype=np.bool_)
    assert [reference_satellite_score(residual_m, used, k)[0] for k in range(3)] == [10.0, 5.0, 13.0]
