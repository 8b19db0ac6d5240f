"""The marks of the drawing of a replay: one bad epoch in many can be seen, gaps stay gaps, and nothing crosses."""

import hashlib
import math
import os
import re
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import replace
from itertools import combinations
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest

from integrity.outputs import EpochReport
from integrity.states import Cause, State
from recordings.report.marks import STATE_LOOKS
from recordings.report.plot import replay_svg
from tests.unit.sites import A_ECEF_M, B_ECEF_M, C_ECEF_M
from tests.unit.stories import CAUSES, FLAT_ECEF_M, LIMITS, SVG, TRIANGLE, by_id, calm, draw, eventful, every_cause, moved, site_of, stopped


def ys(svg: ElementTree.Element, name: str) -> list[float]:
    return [float(y) for _, y in re.findall(r"[ML]([-\d.]+) ([-\d.]+)", by_id(svg, name).attrib["d"])]


@pytest.fixture(scope="module")
def half_a_day() -> list[EpochReport]:
    """40,000 seconds of noise, every tenth epoch of them stopped and somewhere else."""
    noise_m = np.random.default_rng(5).normal(0.0, 1.5, (40_000, 3, 3))
    reports = [replace(calm(second), e_enu_m=noise_m[second]) for second in range(40_000)]
    return [stopped(moved(r, i % 3, i % 97), CAUSES[i % 7], "B") if i % 10 == 0 else r for i, r in enumerate(reports)]


def digest() -> str:
    return hashlib.sha256(replay_svg("x", TRIANGLE, LIMITS, every_cause(4)).encode()).hexdigest()


def test_the_same_bytes_whatever_the_hash_seed() -> None:
    program = "import tests.unit.test_plot_marks as t; print(t.digest())"
    root = str(Path(__file__).parents[2])
    digests = {
        subprocess.run(
            [sys.executable, "-c", program],
            env={**os.environ, "PYTHONHASHSEED": seed, "PYTHONPATH": root},
            capture_output=True,
            text=True,
            check=True,
        ).stdout.strip()
        for seed in ("1", "2")
    }
    assert digests == {digest()}


def test_one_bad_epoch_in_forty_thousand_is_above_the_radius() -> None:
    reports = [calm(second) for second in range(40_000)]
    reports[23_456] = moved(reports[23_456], 2, 12.0)
    svg = draw(reports)
    assert sum(y < float(by_id(svg, "radius").attrib["y1"]) for y in ys(svg, "error-2")) == 1


def test_one_bad_epoch_leaves_the_other_receivers_below_the_radius() -> None:
    reports = [calm(second) for second in range(4000)]
    reports[2345] = moved(reports[2345], 2, 900.0)
    svg = draw(reports)
    assert min(ys(svg, "error-0") + ys(svg, "error-1")) > float(by_id(svg, "radius").attrib["y1"])


def test_one_stopped_epoch_in_forty_thousand_has_a_mark_that_can_be_seen() -> None:
    reports = [calm(second) for second in range(40_000)]
    reports[23_456] = stopped(reports[23_456], Cause.RECEIVER, "B")
    fill = STATE_LOOKS[State.NOT_CONFIRMABLE].block
    blocks = [float(e.attrib["width"]) for e in draw(reports).iter(f"{SVG}rect") if e.get("fill") == fill]
    assert len(blocks) == 2 and min(blocks) >= 2.0  # in the strip of states, and in the lane of its cause


def test_a_busy_half_day_stays_small(half_a_day: list[EpochReport]) -> None:
    assert len(replay_svg("x", TRIANGLE, LIMITS, half_a_day).encode()) < 500_000


def test_missing_epochs_are_a_gap() -> None:
    assert by_id(draw(eventful()), "error-0").attrib["d"].count("M") == 2


def test_an_epoch_without_position_is_a_gap() -> None:
    reports = [calm(second) for second in range(100)]
    reports[50] = replace(reports[50], e_enu_m=np.full((3, 3), np.nan))
    assert by_id(draw(reports), "error-0").attrib["d"].count("M") == 2


def test_a_point_between_gaps_is_a_dot() -> None:
    svg = draw([calm(0), calm(1), calm(2), calm(60), calm(120), calm(121)])
    assert by_id(svg, "error-0-dots").attrib["d"].count("h0") == 1


@pytest.mark.parametrize("points", [(A_ECEF_M, B_ECEF_M, C_ECEF_M), FLAT_ECEF_M], ids=["120 m", "flat"])
def test_magnifiers_are_apart(points: Sequence[tuple[float, float, float]]) -> None:
    circles = [
        (float(c.attrib["cx"]), float(c.attrib["cy"]), float(c.attrib["r"]))
        for c in draw([calm(0)], site=site_of(points)).iter(f"{SVG}circle")
    ]
    rims = [c for c in circles if c[2] > 60.0]
    assert len(rims) == 3 and all(math.dist(a[:2], b[:2]) > a[2] + b[2] for a, b in combinations(rims, 2))


def cross(a: Sequence[float], b: Sequence[float]) -> bool:
    """Whether two segments (x1, y1, x2, y2) cross inside both."""

    def turn(s: Sequence[float], x: float, y: float) -> float:
        return (s[2] - s[0]) * (y - s[1]) - (s[3] - s[1]) * (x - s[0])

    return turn(a, *b[:2]) * turn(a, *b[2:]) < 0.0 and turn(b, *a[:2]) * turn(b, *a[2:]) < 0.0


@pytest.mark.parametrize("points", [(A_ECEF_M, B_ECEF_M, C_ECEF_M), FLAT_ECEF_M], ids=["120 m", "flat"])
def test_leaders_to_the_magnifiers_do_not_cross(points: Sequence[tuple[float, float, float]]) -> None:
    lines = [line for line in draw([calm(0)], site=site_of(points)).iter(f"{SVG}line") if line.get("stroke-dasharray") == "4 3"]
    leaders = [[float(line.attrib[k]) for k in ("x1", "y1", "x2", "y2")] for line in lines]
    assert len(leaders) == 3 and not any(cross(a, b) for a, b in combinations(leaders, 2))


def test_nothing_is_fetched_and_nothing_runs() -> None:
    text = replay_svg("x", TRIANGLE, LIMITS, eventful()).replace('xmlns="http://www.w3.org/2000/svg"', "")
    assert [word for word in ("http", "href", "url(", "script", "import", "style") if word in text] == []


def test_without_epochs_there_is_nothing_to_draw() -> None:
    with pytest.raises(ValueError, match="no epoch"):
        replay_svg("x", TRIANGLE, LIMITS, [])
