"""A campaign as a table: from which size on a threat is always caught, and what its numbers are there."""

from typing import Any

import pytest

from recordings.campaign.table import table_md


def size(metres: float, caught: int, at_once: int = 0, alert_s: float = 3.0, moved_m: float = 1.0, alone: int = 0) -> dict[str, Any]:
    """Of ten trials."""
    return {
        "size": metres,
        "trials": 10,
        "detected": {"count": caught, "of": 10},
        "in_first_epoch": {"count": at_once, "of": 10},
        "triangle_alone": {"count": alone, "of": 10},
        "time_to_alert_s": {"p95": alert_s} if caught else None,
        "shift_m": {"p95": moved_m},
        "named_wrongly": 0,
    }


def threat(kind: str, *sizes: dict[str, Any], within: int = 30) -> dict[str, Any]:
    return {
        "id": "T",
        "title": "a | b",
        "unit": "m",
        "kind": kind,
        "shift_within_radius": {"count": within, "of": 30},
        "sizes": list(sizes),
    }


def campaign(of: dict[str, Any]) -> dict[str, Any]:
    share = {"count": 0, "of": 30, "at_most": 0.095}
    common = {
        "trials": 30,
        "stages": ["one"],
        "seed": 1,
        "tolerance_m": 13.5,
        "radius_m": 8.02,
        "wall_s": 12.5,
        "machine": "two processors",
    }
    return common | {"named_wrongly": share, "hazards": share, "threats": [of]}


def cells(of: dict[str, Any]) -> list[str]:
    return table_md(campaign(of)).splitlines()[2].removeprefix("| ").removesuffix(" |").split(" | ")


STEP = threat("abrupt", size(1.0, 10, alone=2), size(2.0, 9), size(5.0, 10, at_once=10, alone=9), size(10.0, 10, at_once=10, alone=10))
RAMP = threat("slow", size(1.0, 3), size(2.0, 10, alert_s=197.0, moved_m=9.1), size(5.0, 10, moved_m=2.0), within=28)


def test_the_smallest_size_is_one_above_which_every_trial_is_caught() -> None:
    assert cells(STEP)[2] == "5 m"


def test_the_triangle_alone_has_its_own() -> None:
    assert cells(STEP)[-1] == "10 m"


@pytest.mark.parametrize(("of", "alert"), [(STEP, "first epoch"), (RAMP, "197 s")])
def test_the_alert_is_that_of_the_smallest_size(of: dict[str, Any], alert: str) -> None:
    assert cells(of)[3] == alert


def test_the_farthest_move_is_told_with_how_often_it_was_too_far() -> None:
    assert cells(RAMP)[4] == "9.1 m (beyond the radius in 2 of 30)"


def test_what_is_not_always_caught_says_so() -> None:
    assert cells(threat("slow", size(1.0, 10), size(2.0, 9)))[2] == "not in every"


def test_what_is_harmless_says_how_often_it_stopped_something() -> None:
    assert cells(threat("harmless", size(1.0, 0), size(2.0, 3)))[2] == "harmless: stopped in 3 of 20"


def test_a_bar_in_a_title_breaks_no_table() -> None:
    assert cells(STEP)[1] == "a / b"


def test_it_says_how_long_it_took_and_on_what() -> None:
    assert "12.5 s on two processors" in table_md(campaign(STEP))
