"""Trains on a straight and in a curve, under simulated satellites, and everything that must be refused."""

from dataclasses import fields, replace

import numpy as np
import pytest

from integrity.gnss.observations import Floats, ObservationBlock
from integrity.gnss.positioning import expected, points_at
from tests.unit.positioning.field import (
    ANTENNAS,
    BEGIN,
    LIMITS,
    NO_LIMIT,
    NOISE_03,
    Heard,
    corner,
    cut,
    edge,
    heard,
    line,
    map_points,
    map_s_m,
    paths_on,
    ranges_of,
    segments_near,
    solved,
    track_of,
    whole_track,
)
from train_client.positioning.constrained import OnTrack, Paths, Why, sight_at, solve_on_track
from train_client.simulate.line import Piece, build_line
from train_client.track.track_map import Switch

LOCUS_BEGIN = line().at(np.zeros(1)).pos_ecef_m[0]


@pytest.fixture(scope="module")
def paths() -> Paths:
    return paths_on(whole_track())


@pytest.fixture(scope="module")
def silent() -> Heard:
    """From the straight into the curve, and out of it, without errors."""
    return heard(front_m=200.0, seconds=25.0)


@pytest.fixture(scope="module")
def noisy() -> Heard:
    return heard(front_m=200.0, seconds=25.0, errors=NOISE_03)


def spoilt(told: Heard, change_m: Floats) -> ObservationBlock:
    values = {f.name: getattr(told.block, f.name) for f in fields(ObservationBlock)}
    return ObservationBlock(**(values | {"pseudorange_m": told.block.pseudorange_m + change_m}))


def test_without_errors_every_antenna_is_found_to_a_centimetre(paths: Paths, silent: Heard) -> None:
    found = solved(paths, silent, segments_near(paths, silent.s_m))
    assert np.abs(map_s_m(paths, found) - silent.s_m).max() < 0.01  # NaN where unsolved fails


def test_noise_comes_through_with_sigma_times_dilution(paths: Paths, noisy: Heard) -> None:
    """500 solutions: their rms is within 10 % (three of its own sigmas) of sigma * TPDOP."""
    found = solved(paths, noisy, segments_near(paths, noisy.s_m))
    error_m = map_s_m(paths, found) - noisy.s_m
    assert np.sqrt(np.mean((error_m / (0.3 * found.tpdop)) ** 2)) == pytest.approx(1.0, abs=0.1)


def test_squares_left_have_the_mean_that_their_degrees_of_freedom_promise(paths: Paths, noisy: Heard) -> None:
    found = solved(paths, noisy, segments_near(paths, noisy.s_m))
    assert np.mean(found.sse / found.dof) == pytest.approx(1.0, abs=0.05)


@pytest.mark.parametrize("hops", [-4, 5, 15])
def test_where_it_begins_makes_less_than_two_millimetres(paths: Paths, noisy: Heard, hops: int) -> None:
    begin = segments_near(paths, noisy.s_m)
    elsewhere = np.clip(begin + hops, 0, len(paths.loci[0].s_m) - 1)
    apart_m = map_s_m(paths, solved(paths, noisy, elsewhere)) - map_s_m(paths, solved(paths, noisy, begin))
    assert np.abs(apart_m).max() < 0.002


def test_too_many_hops_are_refused(paths: Paths, silent: Heard) -> None:
    begin = segments_near(paths, silent.s_m)[-1:] - 30
    assert (solved(paths, cut(silent, slice(-1, None)), begin).why == Why.NO_CONVERGENCE).all()


def test_a_new_linearisation_buys_no_more_hops() -> None:
    """Twenty hops of 20 m lead beyond where it would be linearised again."""
    straight = build_line(BEGIN, (Piece(1000.0),))
    paths = paths_on(track_of([edge("straight", ("a", "b"), np.arange(0.0, 1001.0, 20.0), of=straight)]))
    told = heard(front_m=700.0, seconds=1.0, rate_hz=1.0, on=straight)
    begin = segments_near(paths, told.s_m)
    reached = [bool(solved(paths, told, begin - hops).solved.all()) for hops in (20, 21)]
    assert reached == [True, False]


def test_far_from_the_beginning_of_a_long_segment_it_is_linearised_again() -> None:
    """On one chord of 1 km the first order alone would be 2 cm off at its end."""
    straight = build_line(BEGIN, (Piece(1000.0),))
    long = paths_on(track_of([edge("long", ("a", "b"), np.array([0.0, 1000.0]), of=straight)]))
    told = heard(front_m=600.0, seconds=15.0, rate_hz=1.0, on=straight)
    found = solved(long, told, np.zeros(told.s_m.shape, dtype=np.int64))
    chord_m = long.length_m[0]  # the Earth is round: the chord sags by 2 cm, the middle of it is no further along
    assert np.abs(found.d_m - told.s_m * chord_m / 1000.0).max() < 0.003


@pytest.mark.parametrize("epochs", [1, 7])
def test_how_epochs_are_cut_into_blocks_changes_no_bit(paths: Paths, noisy: Heard, epochs: int) -> None:
    begin = segments_near(paths, noisy.s_m) - 2
    whole = solved(paths, noisy, begin)
    parts = [solved(paths, cut(noisy, slice(e, e + epochs)), begin[e : e + epochs]) for e in range(0, len(begin), epochs)]
    joined = {f.name: np.concatenate([getattr(part, f.name) for part in parts]).tobytes() for f in fields(OnTrack)}
    assert joined == {f.name: getattr(whole, f.name).tobytes() for f in fields(OnTrack)}


def test_a_sight_computed_ahead_changes_no_bit(paths: Paths, noisy: Heard) -> None:
    begin = segments_near(paths, noisy.s_m)
    sight = sight_at(paths, begin, noisy.states, noisy.block.epoch_ns, noisy.klobuchar)
    used, sigma = np.ones((1, 1, len(noisy.system_of)), dtype=np.bool_), np.full((1, 1, 1), 0.3)
    ahead = solve_on_track(ranges_of(noisy, sigma, used), paths, begin, LIMITS, sight)
    assert ahead.d_m.tobytes() == solved(paths, noisy, begin).d_m.tobytes()


def test_a_satellite_30_m_wrong_does_not_fit_the_track(paths: Paths, noisy: Heard) -> None:
    change_m = np.where(np.arange(len(noisy.system_of)) == 4, 30.0, 0.0)
    found = solved(paths, noisy, segments_near(paths, noisy.s_m), block=spoilt(noisy, change_m))
    assert (found.why == Why.NOT_ON_TRACK).all()


def test_a_range_that_is_no_number_is_not_used(paths: Paths, noisy: Heard) -> None:
    begin, n = segments_near(paths, noisy.s_m), np.arange(len(noisy.system_of))
    sound = solved(paths, noisy, begin)
    for bad in (np.nan, np.inf, -np.inf):
        found = solved(paths, noisy, begin, block=spoilt(noisy, np.where(n == 4, bad, 0.0)))
        assert (found.solved & (found.n_used == sound.n_used - 1)).all(), bad


def test_nothing_but_bad_ranges_is_too_few(paths: Paths, noisy: Heard) -> None:
    found = solved(paths, noisy, segments_near(paths, noisy.s_m), block=spoilt(noisy, np.array(np.nan)))
    assert (found.why == Why.TOO_FEW_SATELLITES).all()


def with_only(paths: Paths, told: Heard, names: tuple[str, ...]) -> OnTrack:
    used = np.isin(told.block.satellites, names)[None, None]
    return solve_on_track(ranges_of(told, np.full(used.shape, 0.3), used), paths, segments_near(paths, told.s_m), LIMITS)


def high(told: Heard, system: int) -> list[str]:
    """Satellites of a system that are used everywhere, by name."""
    sight = expected(told.states, told.block.epoch_ns, points_at(LOCUS_BEGIN[None]), None)
    up = (sight.el_rad > LIMITS.elevation_mask_rad).all(axis=(0, 1)) & (told.system_of == system)
    return [s for s, seen in zip(told.block.satellites, up, strict=True) if seen]


@pytest.mark.parametrize(("gps", "galileo", "refused"), [(2, 0, True), (3, 0, False), (2, 1, True), (2, 2, False)])
def test_one_satellite_more_than_unknowns_is_needed(paths: Paths, silent: Heard, gps: int, galileo: int, refused: bool) -> None:
    names = (*high(silent, 0)[:gps], *high(silent, 1)[:galileo])
    found = with_only(paths, silent, names)
    assert (found.n_used == len(names)).all()
    assert ((found.why == Why.TOO_FEW_SATELLITES) == refused).all()


def test_beyond_the_end_of_the_map_it_is_refused_with_that_reason(noisy: Heard) -> None:
    ends = paths_on(track_of([edge("short", ("a", "b"), map_points()[map_points() <= 300.0])]))
    begin = np.minimum(segments_near(ends, noisy.s_m), len(ends.loci[0].s_m) - 1)
    found = solved(ends, noisy, begin)
    beyond = noisy.s_m > 303.0
    assert (found.why[beyond] == Why.OFF_MAP_END).all()
    assert np.isnan(found.d_m[beyond]).all()
    assert found.solved[noisy.s_m < 297.0].all()


def test_before_the_beginning_of_the_map_it_is_refused(noisy: Heard) -> None:
    begins = paths_on(track_of([edge("late", ("a", "b"), map_points()[map_points() >= 300.0])]))
    found = solved(begins, cut(noisy, slice(0, 10)), np.zeros((10, 2), dtype=np.int64))
    assert (found.why == Why.OFF_MAP_END).all()


def test_beyond_a_switch_it_is_refused_with_that_reason(noisy: Heard) -> None:
    s_m = map_points()
    trunk, left = edge("trunk", ("a", "fork"), s_m[s_m <= 300.0]), edge("left", ("fork", "b"), s_m[s_m >= 300.0])
    ahead = build_line(BEGIN, (Piece(800.0),))
    right = edge("right", ("fork", "c"), np.arange(300.0, 700.0, 20.0), of=ahead)
    fork = paths_on(track_of([trunk, left, right], [Switch("fork", (("trunk", "left"), ("trunk", "right")))]))
    found = solved(fork, noisy, np.full(noisy.s_m.shape, 12))
    beyond = noisy.s_m > 303.0
    assert (found.why[beyond] == Why.AT_SWITCH).all()


def test_an_edge_that_runs_the_other_way_is_entered_at_its_end() -> None:
    s_m = map_points()
    first, rest = edge("first", ("a", "mid"), s_m[s_m <= 400.0]), edge("rest", ("mid", "b"), s_m[s_m >= 400.0])
    turned = replace(
        rest, from_node="b", to_node="mid", s_m=1000.0 - rest.s_m[::-1], pos_ecef_m=rest.pos_ecef_m[::-1], cant_rad=-rest.cant_rad[::-1]
    )
    track = track_of([first, turned])
    told = heard(front_m=385.0, seconds=2.0, antennas=[replace(a, y_m=0.0) for a in ANTENNAS])
    middle = paths_on(track, [replace(a, y_m=0.0) for a in ANTENNAS])
    found = solved(middle, told, np.full(told.s_m.shape, int(np.sum(middle.loci[0].edge == 0)) - 3))
    on_second = np.take(middle.loci[0].edge, found.segment) == 1
    s = map_s_m(middle, found)
    assert on_second.any()
    assert np.abs(np.where(on_second, 1000.0 - s, s) - told.s_m).max() < 0.01


@pytest.mark.parametrize("ulps", [0, 1])
def test_the_limit_of_dilution_itself_passes_and_less_does_not(paths: Paths, noisy: Heard, ulps: int) -> None:
    one = cut(noisy, slice(0, 1))
    begin = segments_near(paths, one.s_m)
    most = float(solved(paths, one, begin).tpdop[0, 0])
    strict = replace(LIMITS, most_tpdop=most if ulps == 0 else float(np.nextafter(most, 0.0)))
    used, sigma = np.ones((1, 1, len(one.system_of)), dtype=np.bool_), np.full((1, 1, 1), 0.3)
    found = solve_on_track(ranges_of(one, sigma, used), paths, begin, strict)
    assert found.why[0, 0] == (Why.POOR_GEOMETRY if ulps else Why.SOLVED)


def at_corner(aside_m: float, start: int) -> tuple[Paths, OnTrack]:
    """An antenna beside the corner, sought from one of its two segments; whatever squares are left."""
    paths, told = corner(aside_m)
    used, sigma = np.ones((1, 1, 1), dtype=np.bool_), np.full((1, 1, 1), 0.3)
    return paths, solve_on_track(ranges_of(told, sigma, used), paths, np.full(told.s_m.shape, start), NO_LIMIT)


def test_at_the_outside_of_a_corner_it_stays_where_it_is_least_outside() -> None:
    """Each segment refers to the other: from either one, the same place comes out, a little beyond the segment that has it."""
    paths, first = at_corner(-4.0, 0)
    _, second = at_corner(-4.0, 1)
    outside_m = np.maximum(-first.d_m, first.d_m - paths.length_m[first.segment])
    assert (first.segment == second.segment).all()
    assert ((outside_m > 0.0) & (outside_m < LIMITS.most_outside_m)).all()


def test_further_outside_than_a_corner_explains_it_does_not_converge() -> None:
    assert (at_corner(-60.0, 0)[1].why == Why.NO_CONVERGENCE).all()
