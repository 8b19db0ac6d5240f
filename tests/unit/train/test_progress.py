"""Whether a train can have moved like that, on lines laid end to end, and against each other."""

import pytest

from tests.unit.track.lines import line, straight
from train_client.config import AntennaConfig, TrainConfig
from train_client.localisation.progress import REAR_FIRST_M, SIGMAS, Progress
from train_client.outputs import Fix, MapPlace
from train_client.stop import StopLimits
from train_client.track.track_map import Switch, TrackMap
from train_client.trust import TrustLimits

NS_PER_S = 1_000_000_000
SPEED_MPS, SIGMA_M = 30.0, 0.5
NOISE_M = SIGMAS * 2 * SIGMA_M
ANTENNAS = (AntennaConfig("front", -3.0, 0.0, 3.9),)
TRAIN = TrainConfig(
    "r291", 40.0, ANTENNAS, NS_PER_S, 0, SPEED_MPS, 1.0, 0.5, 3.0, 1.5, ("k-1",), 3000, TrustLimits(3, 0), StopLimits(0, True), ""
)

# west --a--> x --b--> y <--c-- east: c runs against the others. `d` is reached from nowhere.
TRACK = line(
    straight("a", "west", "x", 0.0, 1000.0),
    straight("b", "x", "y", 1000.0, 1500.0),
    straight("c", "east", "y", 2500.0, 1500.0),
    straight("d", "u", "v", 5000.0, 6000.0),
)


def fix(edge: str, offset_m: float, at_s: float = 0.0, facing: int = 1, sigma_m: float | None = SIGMA_M) -> Fix:
    front = MapPlace(edge, offset_m)
    return Fix(round(at_s * NS_PER_S), front, MapPlace(edge, offset_m), sigma_m, facing, (), None, None, (), (), ())


def after(*fixes: Fix, track: TrackMap = TRACK) -> Progress:
    progress = Progress(TRAIN, track)
    for each in fixes:
        assert progress.objection(each) == ""
        progress.confirm(each)
    return progress


def test_any_place_can_be_the_first() -> None:
    assert Progress(TRAIN, TRACK).objection(fix("d", 700.0)) == ""


MOST_M = 2 * SPEED_MPS + NOISE_M  # in two seconds: 66 m, noise of both fixes on top of the most that it can run


@pytest.mark.parametrize("facing", [1, -1])
@pytest.mark.parametrize("step_m, allowed", [(MOST_M, True), (MOST_M + 0.01, False), (0.0, True)])
def test_a_step_is_as_long_as_it_can_be_at_the_most(facing: int, step_m: float, allowed: bool) -> None:
    objection = after(fix("a", 500.0, 0.0, facing)).objection(fix("a", 500.0 + facing * step_m, 2.0, facing))
    assert objection == ("" if allowed else "66.0 m in 2.0 s since the last confirmed place: at most 66.0 m can be")


def test_a_jump_backwards_is_a_jump() -> None:
    assert "100.0 m in 2.0 s" in after(fix("a", 500.0)).objection(fix("a", 400.0, 2.0))


def test_noise_of_either_fix_counts() -> None:
    assert after(fix("a", 500.0, sigma_m=2.0)).objection(fix("a", 514.9, 0.0)) == ""


def test_a_fix_of_nan_is_objected_to() -> None:
    assert after(fix("a", 500.0)).objection(fix("a", float("nan"), 2.0)) != ""


def test_a_sigma_of_nan_is_objected_to() -> None:
    assert after(fix("a", 500.0)).objection(fix("a", 501.0, 2.0, sigma_m=float("nan"))) != ""


def test_an_earlier_epoch_elsewhere_is_objected_to() -> None:
    assert after(fix("a", 500.0, 10.0)).objection(fix("a", 520.0, 9.0)) != ""


def test_an_objection_alone_moves_nothing() -> None:
    progress = after(fix("a", 500.0))
    progress.objection(fix("a", 900.0, 2.0))
    assert progress.objection(fix("a", 510.0, 1.0)) == ""


# Over nodes: 980 on a, to 30 on b, is 50 m; c runs the other way, so that 490 on b to 970 on c is 40 m


@pytest.mark.parametrize(
    "before, edge, offset_m, step_m",
    [
        (fix("a", 980.0), "b", 0.0, 20.0),
        (fix("a", 980.0), "b", 30.0, 50.0),
        (fix("b", 490.0), "c", 970.0, 40.0),
        (fix("c", 970.0, facing=-1), "c", 920.0, 50.0),
        (fix("a", 990.0), "c", 970.0, 540.0),
    ],
)
def test_a_step_is_measured_along_the_line_and_over_nodes(before: Fix, edge: str, offset_m: float, step_m: float) -> None:
    least_s = (step_m - NOISE_M) / SPEED_MPS
    objections = [after(before).objection(fix(edge, offset_m, at_s)) for at_s in (least_s - 0.001, least_s + 0.001)]
    assert [objection.partition(" in ")[0] for objection in objections] == [f"{step_m:.1f} m", ""]


def test_a_place_to_which_no_way_leads_is_objected_to() -> None:
    assert after(fix("a", 500.0)).objection(fix("d", 0.0, 1000.0)).startswith("no way from the last confirmed place: no allowed way")


# Rear first: each case is a train that stands, then goes backwards step by step

REAR_FIRST = {
    "on one edge": [fix("a", 500.0 - 5.0 * i, i) for i in range(6)],
    "towards growing offsets, facing shrinking ones": [fix("a", 500.0 + 5.0 * i, i, -1) for i in range(6)],
    "over a node": [fix("b", 10.0 - 5.0 * i, i) for i in range(3)] + [fix("a", 1000.0 - 5.0 * i, i + 2) for i in range(1, 4)],
    "onto an edge that runs the other way": [fix("c", 990.0 + 5.0 * i, i, -1) for i in range(3)]
    + [fix("b", 500.0 - 5.0 * i, i + 2) for i in range(1, 4)],
    "after going forwards": [fix("a", 300.0, 0), fix("a", 500.0, 10), *(fix("a", 500.0 - 5.0 * i, i + 10) for i in range(1, 6))],
}


@pytest.mark.parametrize("name", REAR_FIRST)
def test_rear_first_is_let_pass_for_twenty_metres_and_no_further(name: str) -> None:
    *allowed, last = REAR_FIRST[name]
    objection = after(*allowed).objection(last)
    assert objection.startswith("runs rear first, 25 m: antennas exchanged, or the cab at the other end?")


def test_exactly_twenty_metres_are_let_pass() -> None:
    assert after(fix("a", 500.0)).objection(fix("a", 500.0 - REAR_FIRST_M, 1.0)) == ""


def test_what_was_gone_backwards_is_made_good_by_going_forwards() -> None:
    to_and_fro = [500.0, 485.0, 500.0, 485.0, 505.0, 486.0]
    progress = after(*(fix("a", offset_m, i) for i, offset_m in enumerate(to_and_fro)))
    assert progress.objection(fix("a", 484.9, 6.0)).startswith("runs rear first, 20 m")


def test_a_train_that_stands_does_not_run_rear_first_by_its_noise() -> None:
    noise_m = (0.0, 1.5, -1.4, 0.3, -0.9)
    after(*(fix("a", 500.0 + noise_m[i % 5], i) for i in range(500)))  # which asserts that there is no objection


# Where several ways lead from place to place, it is enough that one can have been run in the time

RING = line(straight("r1", "p", "q", 0.0, 1000.0), straight("r2", "q", "r", 1000.0, 2000.0), straight("r3", "r", "p", 2000.0, 3000.0))
LOOP = line(
    straight("before", "west", "w", 0.0, 1000.0),
    straight("left", "w", "e", 1000.0, 1400.0),
    straight("right", "w", "e", 1000.0, 1400.0),
    straight("beyond", "e", "east", 1400.0, 2400.0),
    switches=(Switch("w", (("before", "left"), ("before", "right"))), Switch("e", (("left", "beyond"), ("right", "beyond")))),
)
ANY_WAY = {
    "round a ring": (RING, fix("r1", 990.0), fix("r2", 10.0, 1.0)),
    "through a station where there was no fix": (LOOP, fix("before", 990.0), fix("beyond", 10.0, 20.0)),
}


@pytest.mark.parametrize("name", ANY_WAY)
def test_a_train_may_have_come_by_any_way(name: str) -> None:
    track, before, now = ANY_WAY[name]
    assert after(before, track=track).objection(now) == ""


def test_no_way_is_short_enough() -> None:
    assert after(fix("before", 990.0), track=LOOP).objection(fix("beyond", 10.0, 1.0)) != ""
