"""Distances between antennas, and the front end, on a map of three edges of which one runs the other way, and a fork."""

from functools import cache
from math import inf, nan, nextafter, sqrt

import numpy as np
import pytest

from tests.unit.positioning.field import LIMITS, edge, track_of
from train_client.positioning.antennas import Agreement, AntennaPlace, FrontEnd, compare_distances, front_end
from train_client.track.locus import Place, Unreachable
from train_client.track.track_map import Edge, Switch, TrackMap

FRONT_X_M, REAR_X_M, SIGMA_M = -2.0, -20.15, 0.5
LIMIT_M = LIMITS.distance_sigmas * SIGMA_M * sqrt(2.0)


@cache
def track() -> TrackMap:
    """first 0..200, then second 300..500 entered at its end (500), then third from 0; fork at the end of third."""
    s_m = np.arange(0.0, 201.0, 20.0)
    first, second, third = edge("first", ("a", "b"), s_m), edge("x", ("c", "b"), 200.0 + s_m), edge("third", ("c", "d"), 400.0 + s_m)
    left, right = edge("left", ("d", "e"), 600.0 + s_m[:6]), edge("right", ("d", "f"), 600.0 + s_m[:6], lifted=0.5)
    turned = Edge("second", "c", "b", 300.0 + s_m, second.pos_ecef_m[::-1], second.cant_rad)
    edges = [first, turned, Edge("third", "c", "d", s_m, third.pos_ecef_m, third.cant_rad), left, right]
    return track_of(edges, [Switch("d", (("third", "left"), ("third", "right")))])


def antennas(front: tuple[int, float], rear: tuple[int, float]) -> list[AntennaPlace]:
    return [AntennaPlace(FRONT_X_M, *front, SIGMA_M), AntennaPlace(REAR_X_M, *rear, SIGMA_M)]


def said(front: tuple[int, float], rear: tuple[int, float], facing: int) -> tuple[Agreement, int]:
    found = compare_distances(track(), antennas(front, rear), facing, LIMITS)
    return found.agreement, found.facing


@pytest.mark.parametrize(
    ("front", "rear", "facing", "expected"),
    [
        ((0, 100.0), (0, 81.85), 1, (Agreement.AGREE, 1)),
        ((0, 100.0), (0, 81.85), 0, (Agreement.AGREE, 1)),
        ((0, 100.0), (0, 118.15), 0, (Agreement.AGREE, -1)),
        ((0, 100.0), (0, 118.15), 1, (Agreement.EXCHANGED, 0)),
        ((0, 100.0), (0, 75.0), 1, (Agreement.DISAGREE, 0)),
        ((0, 100.0), (0, 75.0), 0, (Agreement.DISAGREE, 0)),
        ((0, 100.0), (0, 100.4), 1, (Agreement.ONE_POINT, 0)),
        ((0, 100.0), (0, 100.4), 0, (Agreement.ONE_POINT, 0)),
        ((1, 490.0), (0, 191.85), -1, (Agreement.AGREE, -1)),  # front on the edge that runs the other way
        ((1, 490.0), (0, 191.85), 0, (Agreement.AGREE, -1)),
        ((0, 191.85), (1, 490.0), 1, (Agreement.EXCHANGED, 0)),
        ((2, 5.0), (1, 313.15), 1, (Agreement.AGREE, 1)),
        ((1, 500.05), (0, 181.8), -1, (Agreement.AGREE, -1)),  # a chord that leads 5 cm beyond its edge, onto the one before
        ((3, 605.0), (4, 605.0), 1, (Agreement.UNCONNECTED, 0)),  # one on each branch
    ],
)
def test_what_distances_say(front: tuple[int, float], rear: tuple[int, float], facing: int, expected: tuple[Agreement, int]) -> None:
    assert said(front, rear, facing) == expected


def test_the_limit_itself_passes_and_the_next_number_fails() -> None:
    """On sigmas of which the statistic is an exact multiple: 18 m mounted, sigma 3 and 4."""
    pair = [AntennaPlace(0.0, 0, 100.0, 3.0), AntennaPlace(-18.0, 0, 87.0, 4.0)]  # 5 m off in 5 m
    for limit, agreement in ((1.0, Agreement.AGREE), (nextafter(1.0, 0.0), Agreement.DISAGREE)):
        strict = type(LIMITS)(**{name: getattr(LIMITS, name) for name in LIMITS.__dataclass_fields__} | {"distance_sigmas": limit})
        assert compare_distances(track(), pair, 1, strict).agreement is agreement


def test_antennas_half_a_metre_apart_cannot_tell_the_facing() -> None:
    pair = [AntennaPlace(0.0, 0, 100.0, 0.5), AntennaPlace(-0.5, 0, 99.5, 0.5)]
    assert compare_distances(track(), pair, 0, LIMITS).agreement is Agreement.FACING_OPEN


def test_of_three_antennas_one_that_is_off_fails_all() -> None:
    three = [*antennas((0, 100.0), (0, 81.85)), AntennaPlace(-40.0, 0, 62.0 + LIMIT_M + 0.01, SIGMA_M)]
    assert compare_distances(track(), three, 1, LIMITS).agreement is Agreement.DISAGREE


@pytest.mark.parametrize("bad", [nan, inf])
def test_a_sigma_that_is_no_number_never_agrees(bad: float) -> None:
    pair = [AntennaPlace(FRONT_X_M, 0, 100.0, SIGMA_M), AntennaPlace(REAR_X_M, 0, 81.85, bad)]
    assert compare_distances(track(), pair, 1, LIMITS).agreement is not Agreement.AGREE


def test_a_place_that_is_no_number_never_agrees() -> None:
    assert said((0, 100.0), (0, nan), 1)[0] is not Agreement.AGREE


def test_one_antenna_is_no_test() -> None:
    assert compare_distances(track(), antennas((0, 1.0), (0, 1.0))[:1], 1, LIMITS).agreement is Agreement.TOO_FEW


@pytest.mark.parametrize(
    ("front", "rear", "facing", "expected"),
    [
        ((0, 100.0), (0, 81.85), 1, (Place(0, 102.0, 1), 1)),
        ((0, 100.0), (0, 118.15), -1, (Place(0, 98.0, 1), -1)),
        ((0, 199.0), (0, 180.85), 1, (Place(1, 499.0, -1), -1)),  # beyond the node, on the edge that runs the other way
        ((1, 490.0), (0, 191.85), -1, (Place(1, 488.0, 1), -1)),
        ((1, 501.0), (0, 180.85), -1, (Place(1, 499.0, 1), -1)),  # the first antenna's chord a little beyond its edge
    ],
)
def test_front_end_from_both_antennas(front: tuple[int, float], rear: tuple[int, float], facing: int, expected: tuple[Place, int]) -> None:
    found = front_end(track(), antennas(front, rear), facing, LIMITS)
    assert isinstance(found, FrontEnd)
    assert (found.place._replace(s_m=round(found.place.s_m, 9)), found.facing) == expected


def test_the_better_antenna_counts_more_and_common_errors_do_not_shrink() -> None:
    pair = [AntennaPlace(-2.0, 0, 100.0, 0.2), AntennaPlace(-20.0, 0, 83.0, 0.4)]  # 102 and 103
    found = front_end(track(), pair, 1, LIMITS)
    assert isinstance(found, FrontEnd)
    assert (found.place.s_m, found.sigma_m) == pytest.approx((102.2, 0.24))


def test_a_front_end_beyond_a_switch_is_nowhere() -> None:
    found = front_end(track(), antennas((2, 199.0), (2, 180.85)), 1, LIMITS)
    assert isinstance(found, Unreachable)
