"""The geometry of simulated lines against closed forms, and the sample map against the line it was sampled from."""

import math
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from scipy.special import fresnel

from integrity.gnss.frames import ecef_from_geodetic, enu_axes, geodetic_from_ecef
from integrity.gnss.observations import Floats
from recordings.simulate.scenario import load_scenario
from train_client.simulate.line import (
    SAMPLE_JOINT_M,
    STEP_M,
    Line,
    Piece,
    Start,
    build_line,
    sample_line,
    sample_map,
    sample_place,
)
from train_client.track.checks import check_map
from train_client.track.track_map import parse_map

SAMPLES = Path(__file__).parents[3] / "recordings" / "samples"
START = Start(math.radians(35.7), math.radians(139.5), 100.0, math.radians(60.0))
CURVED = (Piece(50.0), Piece(100.0, 300.0, 0.1), Piece(200.0, 300.0, 0.1))
TENTH_MM = 1e-4


@cache
def sample() -> Line:
    return sample_line()


def local(pos_ecef_m: Floats) -> Floats:
    """Points (N, 3) as metres ahead of, right of and above the beginning of a line at `START`."""
    origin = ecef_from_geodetic(START.lat_rad, START.lon_rad, START.height_m)
    east, north, up = ((pos_ecef_m - origin) @ enu_axes(np.array(START.lat_rad), np.array(START.lon_rad)).T).T
    sine, cosine = math.sin(START.azimuth_rad), math.cos(START.azimuth_rad)
    return np.stack((sine * east + cosine * north, cosine * east - sine * north, up), axis=1)


def heights_m(line: Line, s_m: list[float]) -> Floats:
    return geodetic_from_ecef(line.at(np.array(s_m)).pos_ecef_m)[2]


def test_a_transition_is_the_clothoid() -> None:
    """Fresnel's integrals, from scipy. The Earth's curvature bends 100 m by 0.8 mm, downwards only."""
    line = build_line(START, CURVED)
    s_m = np.arange(0.0, 101.0, 10.0)
    scale = math.sqrt(math.pi * 300.0 * 100.0)
    right, ahead = fresnel(s_m / scale)
    found = local(line.at(50.0 + s_m).pos_ecef_m)
    np.testing.assert_allclose(found[:, 0], 50.0 + scale * ahead, atol=TENTH_MM)
    np.testing.assert_allclose(found[:, 1], scale * right, atol=TENTH_MM)


def test_a_transition_turns_by_half_its_length_over_the_radius() -> None:
    before, after = build_line(START, CURVED).at(np.array([50.0, 150.0])).tangent
    assert math.acos(float(before @ after)) == pytest.approx(100.0 / (2.0 * 300.0), abs=1e-7)


@pytest.mark.parametrize("along_m", [10.0, 100.0, 200.0])
def test_a_circular_curve_has_the_chords_of_a_circle(along_m: float) -> None:
    a, b = build_line(START, CURVED).at(np.array([150.0, 150.0 + along_m])).pos_ecef_m
    assert np.linalg.norm(b - a) == pytest.approx(2.0 * 300.0 * math.sin(along_m / 600.0), abs=TENTH_MM)


def test_a_reverse_curve_ends_in_its_first_direction() -> None:
    """Left as far as right: parallel to the beginning, but for what meridians and verticals turn in 400 m, below 1e-4 rad."""
    pieces = (Piece(100.0, 300.0), Piece(100.0), Piece(100.0, -300.0), Piece(100.0))
    before, after = build_line(START, pieces).at(np.array([0.0, 400.0])).tangent
    assert math.acos(float(before @ after)) < 1e-4


def test_a_level_line_keeps_its_height() -> None:
    np.testing.assert_allclose(heights_m(build_line(START, (Piece(3000.0),)), [0.0, 1500.0, 3000.0]), 100.0, atol=TENTH_MM)


def test_a_gradient_climbs_by_its_sine() -> None:
    line = build_line(START, (Piece(60.0, gradient=0.015), Piece(1000.0, gradient=0.015)))
    low_m, high_m = heights_m(line, [60.0, 1060.0])
    assert high_m - low_m == pytest.approx(1000.0 * math.sin(math.atan(0.015)), abs=TENTH_MM)


def test_running_distance_is_the_length_of_the_line() -> None:
    dense = sample().at(np.arange(0.0, sample().length_m, 0.25)).pos_ecef_m
    covered_m = np.cumsum(np.linalg.norm(np.diff(dense, axis=0), axis=1))
    assert np.abs(covered_m - 0.25 * np.arange(1, len(covered_m) + 1)).max() < TENTH_MM


def test_the_sample_line_has_no_kink() -> None:
    """From one dense point to the next it turns by no more than its sharpest curve and its vertical curves of 6000 m do."""
    tangent = sample().tangent
    turn_rad = np.linalg.norm(np.diff(tangent, axis=0), axis=1)
    assert turn_rad.max() < STEP_M * math.hypot(1.0 / 300.0, 1.0 / 6000.0) * 1.001


def test_in_a_right_hand_curve_the_right_rail_is_low() -> None:
    """Curve of 400 m, cant 90 mm between rail centres 1.13 m apart."""
    places = sample().at(np.array([1000.0, 1001.0]))
    up = places.pos_ecef_m[0] / np.linalg.norm(places.pos_ecef_m[0])
    turned_left = float(np.cross(places.tangent[0], places.tangent[1]) @ up)
    assert turned_left == pytest.approx(-1.0 / 400.0, rel=0.01)
    assert places.cant_rad[0] == pytest.approx(math.asin(0.090 / 1.13))


@pytest.mark.parametrize("s_m", [-0.001, 3000.001, math.nan])
def test_there_is_no_line_beyond_its_ends(s_m: float) -> None:
    with pytest.raises(ValueError, match=r"the line goes from 0 to 3000"):
        sample().at(np.array([s_m]))


def test_the_sample_line_passes_the_sample_triangle() -> None:
    site = load_scenario(SAMPLES / "triangle.toml").site.config
    points = sample().at(np.arange(0.0, 3000.0, 5.0)).pos_ecef_m
    for receiver in site.receivers:
        assert np.linalg.norm(points - np.array(receiver.position_ecef_m), axis=1).min() < 300.0


def test_the_sample_map_is_what_the_code_makes() -> None:
    """To a unit in the last decimal: the mathematics libraries of two machines may round differently."""
    committed, made = parse_map((SAMPLES / "line.json").read_text(), "line.json"), sample_map()
    assert (committed.nodes, committed.sections) == (made.nodes, made.sections)
    assert [(e.id, e.from_node, e.to_node) for e in committed.edges] == [(e.id, e.from_node, e.to_node) for e in made.edges]
    for was, now in zip(committed.edges, made.edges, strict=True):
        assert was.gradient is not None
        assert now.gradient is not None
        np.testing.assert_allclose(was.s_m, now.s_m, rtol=0.0, atol=1.1e-4)
        np.testing.assert_allclose(was.pos_ecef_m, now.pos_ecef_m, rtol=0.0, atol=1.1e-4)
        np.testing.assert_allclose(was.cant_rad, now.cant_rad, rtol=0.0, atol=1.1e-7)
        np.testing.assert_allclose(was.gradient, now.gradient, rtol=0.0, atol=1.1e-7)


def test_the_sample_map_passes_every_check() -> None:
    found = check_map(parse_map((SAMPLES / "line.json").read_text(), "line.json"))
    assert [str(finding) for finding in (*found.errors, *found.warnings)] == []


def test_chords_of_the_sample_map_stay_within_10_mm_of_the_line() -> None:
    begins_m = {"main-1": 0.0, "main-2": SAMPLE_JOINT_M}
    for edge in sample_map().edges:
        middle_m = begins_m[edge.id] + 0.5 * (edge.s_m[1:] + edge.s_m[:-1])
        chord_m = 0.5 * (edge.pos_ecef_m[1:] + edge.pos_ecef_m[:-1])
        assert np.linalg.norm(sample().at(middle_m).pos_ecef_m - chord_m, axis=1).max() < 0.010


@pytest.mark.parametrize("running_m", [0.0, 919.0, 920.0, 921.0, 3000.0])
def test_a_running_distance_has_its_place_on_the_map(running_m: float) -> None:
    name, s_m = sample_place(running_m)
    (edge,) = (edge for edge in sample_map().edges if edge.id == name)
    there = [np.interp(s_m, edge.s_m, edge.pos_ecef_m[:, axis]) for axis in range(3)]
    assert np.linalg.norm(there - sample().at(np.array([running_m])).pos_ecef_m[0]) < 0.010
