"""Whose word counts where: by sections that lie over each other, beside each other, and with gaps between them."""

from dataclasses import replace

import pytest

from tests.unit.track.lines import line, straight
from train_client.track.track_map import Section
from train_client.track.vouching import stations_at, stations_on

TRACK = line(
    straight("main", "west", "joint", 0.0, 1000.0),
    straight("more", "joint", "east", 1000.0, 1500.0),
    sections=(
        Section("main", 300.0, 700.0, station="b-1"),
        Section("main", 0.0, 500.0, station="a-1"),
        Section("main", 0.0, 1000.0, gnss=False),  # of another kind: nobody vouches by it
        Section("main", 400.0, 450.0, station="a-1"),
        Section("main", 700.0, 800.0, station="c-1"),
        Section("more", 0.0, 500.0, station="b-1"),
    ),
)


def named(*places: tuple[str, float]) -> tuple[str, ...] | str:
    return stations_at(TRACK, places)


def test_all_that_vouch_anywhere_each_once_in_the_order_of_the_map() -> None:
    assert stations_on(TRACK) == ("b-1", "a-1", "c-1")


def test_a_map_may_name_nobody() -> None:
    assert stations_on(line(straight("main", "west", "east", 0.0, 100.0))) == ()


@pytest.mark.parametrize(
    "s_m, stations",
    [
        (0.0, ("a-1",)),
        (299.999, ("a-1",)),
        (300.0, ("b-1", "a-1")),
        (425.0, ("b-1", "a-1")),  # a-1 by two sections
        (500.0, ("b-1", "a-1")),
        (500.001, ("b-1",)),
        (700.0, ("b-1", "c-1")),  # where one ends and the other begins
        (700.001, ("c-1",)),
        (800.0, ("c-1",)),
    ],
)
def test_both_ends_of_a_section_belong_to_it(s_m: float, stations: tuple[str, ...]) -> None:
    assert named(("main", s_m)) == stations


@pytest.mark.parametrize("s_m", [-0.001, 800.001, 900.0, 1000.0, float("nan")])
def test_a_place_that_nobody_vouches_for_is_named(s_m: float) -> None:
    assert named(("main", s_m)) == f"by the map no station vouches for main {s_m:.0f} m"


def test_sections_of_another_edge_do_not_count() -> None:
    assert named(("more", 100.0)) == ("b-1",)


def test_an_edge_that_is_not_on_the_map_is_vouched_for_by_nobody() -> None:
    assert named(("other", 100.0)) == "by the map no station vouches for other 100 m"


def test_a_train_in_several_places_needs_all_that_vouch_for_one_of_them() -> None:
    assert named(("main", 750.0), ("main", 100.0), ("main", 750.0)) == ("a-1", "c-1")


@pytest.mark.parametrize("first", [True, False])
def test_one_place_without_a_station_is_enough(first: bool) -> None:
    places = [("main", 900.0), ("main", 100.0)]
    assert named(*(places if first else places[::-1])) == "by the map no station vouches for main 900 m"


def test_at_a_joint_each_edge_counts_for_itself() -> None:
    assert (named(("more", 0.0)), named(("more", 0.0), ("main", 800.0))) == (("b-1",), ("b-1", "c-1"))


def test_no_place_at_all_names_nobody() -> None:
    assert named() == ()


@pytest.mark.parametrize("order", [1, -1])
def test_the_order_of_places_makes_no_difference(order: int) -> None:
    assert named(*[("main", 425.0), ("main", 750.0)][::order]) == stations_on(TRACK)


def test_the_order_is_that_of_the_map_not_of_names() -> None:
    turned = replace(TRACK, sections=TRACK.sections[::-1])
    assert stations_at(turned, [("main", 425.0), ("main", 750.0)]) == ("b-1", "c-1", "a-1")
