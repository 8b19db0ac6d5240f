"""The live view: where the solved point stands against its circle, and the train on its line."""

import pytest

from train_client.demo.view import ROWS, VertexSeen, circle, label, track

RADIUS_M = 8.0


def place(vertex: VertexSeen, mark: str) -> tuple[int, int] | None:
    """Row and column of a mark; the surveyed point is in the middle."""
    return next(((k, row.index(mark)) for k, row in enumerate(circle(vertex, RADIUS_M)) if mark in row), None)


MIDDLE = place(VertexSeen("A", None, None), "+")


def test_a_point_inside_its_circle_stands_north_and_east_of_the_middle_where_it_is() -> None:
    assert MIDDLE is not None
    found = place(VertexSeen("A", 5.0, 5.0), "o")
    assert found is not None
    assert found[0] < MIDDLE[0]
    assert found[1] > MIDDLE[1]


@pytest.mark.parametrize("far_m", [12.0, 120.0, 1e7])
def test_a_point_outside_the_view_is_an_arrowhead_at_its_rim(far_m: float) -> None:
    assert place(VertexSeen("A", 0.0, -far_m), "*") == (ROWS - 1, MIDDLE[1] if MIDDLE else -1)


def test_without_a_position_there_is_no_point() -> None:
    assert place(VertexSeen("A", None, None), "o") is None
    assert label(VertexSeen("A", None, None)) == "A  no position"


def test_the_train_is_where_it_says_or_else_where_it_is() -> None:
    assert track(1500.0, 1400.0, 3000.0).index(">") == len("west |") + 30
    assert track(None, 1500.0, 3000.0).index("x") == len("west |") + 30


@pytest.mark.parametrize("at_m, column", [(-10.0, 0), (3000.0, 59), (9999.0, 59)])
def test_beyond_the_ends_of_the_line_it_stands_at_the_end(at_m: float, column: int) -> None:
    assert track(at_m, 0.0, 3000.0).index(">") == len("west |") + column
