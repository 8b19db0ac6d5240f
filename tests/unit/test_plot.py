import hashlib
import math
import os
import re
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import replace
from itertools import combinations, pairwise
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest

from integrity.config import IntegrityConfig, ReceiverConfig, SiteConfig
from integrity.exclusion import Exclusion
from integrity.gnss.gps_time import NS_PER_S, parse_utc
from integrity.limits import Limits, derive
from integrity.outputs import EpochReport
from integrity.states import STATE_OF_CAUSE, Cause, Outcome, State
from integrity.triangle import ReferenceTriangle, reference_triangle
from integrity.verdict import CLEAN
from recordings.report.charts import error_scale
from recordings.report.marks import STATE_LOOKS
from recordings.report.plot import replay_svg
from recordings.report.svg import INK, QUIET, WHITE, Box, fitted, nice_step, number, text_box, text_width_px, time_ticks
from recordings.report.time_axis import duration
from tests.unit.sites import A_ECEF_M, B_ECEF_M, C_ECEF_M

SVG = "{http://www.w3.org/2000/svg}"
START_NS = parse_utc("2026-11-22T00:00:00Z")
CAUSES = [cause for cause in Cause if cause is not Cause.NONE]
E_OF_A_CALM_EPOCH_M = np.array([[0.4, -0.3, 1.0], [0.2, -0.5, 1.2], [0.5, -0.1, 0.8]])

# UPC1, UPC2 and GARR of the Catalan network, 2010: sides of 38 m, 19.7 km and 19.7 km, the first two on one pixel of the plan.
FLAT_ECEF_M = ((4788065.1, 177215.5, 4196294.4), (4788053.0, 177184.0, 4196311.0), (4796983.6, 160309.1, 4187340.1))


def site_of(points: Sequence[tuple[float, float, float]]) -> tuple[ReferenceTriangle, Limits]:
    receivers = tuple(ReceiverConfig(name, point) for name, point in zip("ABC", points, strict=True))
    site = SiteConfig("t", "x", None, NS_PER_S, "none", receivers, IntegrityConfig(), 3000, "")
    triangle = reference_triangle(site)
    return triangle, derive(site, triangle)


TRIANGLE, LIMITS = site_of((A_ECEF_M, B_ECEF_M, C_ECEF_M))
CHECK_NAMES = tuple(t.name for t in LIMITS.thresholds)
THRESHOLD = np.array([t.value for t in LIMITS.thresholds])


def calm(second: int) -> EpochReport:
    return EpochReport(
        gps_time_ns=START_NS + second * NS_PER_S,
        mono_ns=second * NS_PER_S,
        state=State.NORMAL,
        cause=Cause.NONE,
        subjects=(),
        verdict=CLEAN,
        triangle_alone=State.NORMAL,
        exclusions=(),
        channels=(),
        receivers=("A", "B", "C"),
        e_enu_m=E_OF_A_CALM_EPOCH_M * (1.0 + 0.3 * math.sin(second)),
        unsolved=np.zeros(3, dtype=np.int64),
        satellites_used=np.array([9, 9, 9]),
        check_names=CHECK_NAMES,
        statistic=0.3 * THRESHOLD,
        threshold=THRESHOLD,
        outcome=np.full(len(THRESHOLD), Outcome.PASS),
        signals=("G01.1C",),
        used=np.array([True]),
        residual_sigmas=np.array([0.5]),
        b_m=np.array([[0.1], [0.0], [-0.1]]),
    )


def stopped(report: EpochReport, cause: Cause, *subjects: str, **more: Any) -> EpochReport:
    return replace(report, state=STATE_OF_CAUSE[cause], cause=cause, subjects=subjects, **more)


def moved(report: EpochReport, receiver: int, east_m: float) -> EpochReport:
    e_enu_m = np.array(report.e_enu_m)
    e_enu_m[receiver, 0] += east_m
    return replace(report, e_enu_m=e_enu_m)


def unsolved(second: int) -> EpochReport:
    report = calm(second)
    return stopped(replace(report, e_enu_m=np.full((3, 3), np.nan), statistic=np.full_like(report.statistic, np.nan)), Cause.DATA)


def eventful() -> list[EpochReport]:
    """Ten minutes with every state, an excluded satellite, a gap, and a receiver that is three kilometres away."""
    out = (Exclusion("G12", START_NS, "residual", 9.0, 5.6),)
    reports = [calm(second) for second in range(600) if not 300 <= second < 330]
    for i in range(60, 90):
        reports[i] = stopped(moved(reports[i], 1, 3000.0), Cause.RECEIVER, "B")
    for i in range(200, 240):
        reports[i] = stopped(reports[i], Cause.SATELLITE, "G12", exclusions=out, triangle_alone=State.SATELLITE_ANOMALY)
    return reports


def every_cause(subjects_each: int) -> list[EpochReport]:
    """Every cause in turn, each with a number of different subjects."""
    reports = [calm(second) for second in range(50 * len(CAUSES) * subjects_each)]
    for k in range(len(CAUSES) * subjects_each):
        for i in range(50 * k + 20, 50 * k + 40):
            reports[i] = stopped(reports[i], CAUSES[k % len(CAUSES)], f"G{k // len(CAUSES) + 1:02d}")
    return reports


def draw(
    reports: Sequence[EpochReport], silences: Sequence[tuple[int, int]] = (), site: tuple[ReferenceTriangle, Limits] = (TRIANGLE, LIMITS)
) -> ElementTree.Element:
    return ElementTree.fromstring(replay_svg("Test site", *site, reports, silences))


def words(svg: ElementTree.Element) -> str:
    return "\n".join(element.text or "" for element in svg.iter(f"{SVG}text"))


def boxes(svg: ElementTree.Element) -> list[tuple[str, Box]]:
    found = []
    for e in svg.iter(f"{SVG}text"):
        anchor = e.attrib["text-anchor"]
        assert anchor in ("start", "middle", "end") and e.text
        bold = e.get("font-weight") == "bold"
        box = text_box(float(e.attrib["x"]), float(e.attrib["y"]), e.text, float(e.attrib["font-size"]), anchor, bold)  # type: ignore[arg-type]
        found.append((e.text, box))
    return found


def overlaps(svg: ElementTree.Element) -> list[tuple[str, str]]:
    return [(a, b) for (a, box_a), (b, box_b) in combinations(boxes(svg), 2) if box_a.overlaps(box_b)]


def by_id(svg: ElementTree.Element, name: str) -> ElementTree.Element:
    return next(element for element in svg.iter() if element.get("id") == name)


def ys(svg: ElementTree.Element, name: str) -> list[float]:
    return [float(y) for _, y in re.findall(r"[ML]([-\d.]+) ([-\d.]+)", by_id(svg, name).attrib["d"])]


@pytest.fixture(scope="module")
def half_a_day() -> list[EpochReport]:
    """40,000 seconds of noise, every tenth epoch of them stopped and somewhere else."""
    noise_m = np.random.default_rng(5).normal(0.0, 1.5, (40_000, 3, 3))
    reports = [replace(calm(second), e_enu_m=noise_m[second]) for second in range(40_000)]
    return [stopped(moved(r, i % 3, i % 97), CAUSES[i % 7], "B") if i % 10 == 0 else r for i, r in enumerate(reports)]


STORIES = {
    "eventful": eventful(),
    "all causes": every_cause(1),
    "causes with many subjects": every_cause(4),
    "no epoch normal": [stopped(calm(second), Cause.DATA, "A") for second in range(40)],
    "no positions": [unsolved(second) for second in range(9)],
    "one epoch": [calm(0)],
    "everywhere": [moved(stopped(calm(s), Cause.RECEIVER, "ABC"[s % 3]), s % 3, 90.0 * math.sin(s)) for s in range(300)],
}


@pytest.mark.parametrize("story", STORIES)
def test_every_story_is_well_formed_and_says_how_many_epochs_were_normal(story: str) -> None:
    reports = STORIES[story]
    normal = sum(report.state is State.NORMAL for report in reports)
    assert f"NORMAL {normal} of {len(reports)} epochs" in words(draw(reports))


@pytest.mark.parametrize("site", [(TRIANGLE, LIMITS), site_of(FLAT_ECEF_M)], ids=["120 m", "flat"])
@pytest.mark.parametrize("story", STORIES)
def test_no_words_stand_on_others(story: str, site: tuple[ReferenceTriangle, Limits]) -> None:
    assert overlaps(draw(STORIES[story], site=site)) == []


@pytest.mark.parametrize("story", STORIES)
def test_all_words_are_on_the_page(story: str) -> None:
    svg = draw(STORIES[story])
    width, height = float(svg.attrib["width"]), float(svg.attrib["height"])
    assert [text for text, b in boxes(svg) if b.left < 0 or b.top < 0 or b.right > width or b.bottom > height] == []


@pytest.mark.parametrize("story", STORIES)
def test_every_state_and_cause_that_occurs_is_a_word(story: str) -> None:
    text = words(draw(STORIES[story]))
    occurring = {r.state.value for r in STORIES[story]} | {r.cause.value for r in STORIES[story]}
    assert [word for word in occurring if word not in text] == []


def test_causes_have_their_subjects() -> None:
    assert {"receiver B", "satellite G12"} <= set(words(draw(eventful())).splitlines())


def test_a_lane_says_when_and_for_how_long() -> None:
    assert "NOT_CONFIRMABLE, from 00:01:00 for 30 s" in words(draw(eventful()))


def test_an_excluded_satellite_has_a_lane() -> None:
    assert "excluded, from 00:03:20 for 40 s" in words(draw(eventful()))


def test_many_excluded_satellites_share_a_lane() -> None:
    out = tuple(Exclusion(f"G{i:02d}", START_NS, "residual", 9.0, 5.6) for i in range(1, 9))
    assert "8 satellites excluded" in words(draw([replace(calm(second), exclusions=out) for second in range(20)]))


def test_a_silence_is_a_cause() -> None:
    reports = eventful()
    assert "data, a stream was silent" in words(draw(reports, [(START_NS + 302 * NS_PER_S, START_NS + 330 * NS_PER_S)]))


def test_a_silence_after_the_last_epoch_lengthens_the_axis() -> None:
    svg = draw([calm(second) for second in range(60)], [(START_NS + 62 * NS_PER_S, START_NS + 600 * NS_PER_S)])
    assert "00:08" in words(svg).splitlines()


def test_a_silence_before_the_first_epoch_lengthens_the_axis() -> None:
    svg = draw([calm(second) for second in range(600, 660)], [(START_NS, START_NS + 598 * NS_PER_S)])
    assert "00:02" in words(svg).splitlines()


def digest() -> str:
    return hashlib.sha256(replay_svg("x", TRIANGLE, LIMITS, every_cause(4)).encode()).hexdigest()


def test_the_same_bytes_whatever_the_hash_seed() -> None:
    program = "import tests.unit.test_plot as t; print(t.digest())"
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


def test_a_check_without_values_says_so() -> None:
    reports = [replace(r, statistic=np.where(np.array(r.check_names) == "collapse", np.nan, r.statistic)) for r in map(calm, range(20))]
    assert words(draw(reports)).splitlines().count("no value") == 1


def test_the_largest_ratio_is_written() -> None:
    reports = [calm(second) for second in range(20)]
    reports[7] = replace(reports[7], statistic=np.where(np.array(reports[7].check_names) == "shape_3d", 4.5, 0.3) * reports[7].threshold)
    assert "max 4.5" in words(draw(reports)).splitlines()


def test_a_point_out_of_view_is_an_arrow_with_its_distance() -> None:
    reports = [calm(second) for second in range(20)]
    reports[3] = moved(reports[3], 0, 12_345.0)
    assert "12.3 km" in words(draw(reports)).splitlines()


def test_a_receiver_has_its_rms_and_its_largest_error() -> None:
    reports = [calm(0), moved(replace(calm(0), gps_time_ns=START_NS + NS_PER_S), 0, 0.8)]  # 0.5 m, and hypot(1.2, 0.3) = 1.24 m: rms 0.94 m
    assert "h rms 0.94 m, max 1.24 m" in words(draw(reports)).splitlines()


def test_epochs_without_solution_are_counted() -> None:
    assert "solved 2 of 3" in words(draw([calm(0), calm(1), unsolved(2)])).splitlines()


def test_sides_are_written_in_metres() -> None:
    assert {"A–B 120.0 m", "A–C 120.0 m", "B–C 120.0 m"} <= set(words(draw([calm(0)])).splitlines())


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


def test_a_title_is_escaped() -> None:
    svg = ElementTree.fromstring(replay_svg('<A> & "B" \x00', TRIANGLE, LIMITS, [calm(0)]))
    assert by_id(svg, "title").text == '<A> & "B" \ufffd'


def test_a_long_title_is_cut() -> None:
    svg = ElementTree.fromstring(replay_svg("Wayside " * 40, TRIANGLE, LIMITS, [calm(0)]))
    assert overlaps(svg) == []


def test_without_epochs_there_is_nothing_to_draw() -> None:
    with pytest.raises(ValueError, match="no epoch"):
        replay_svg("x", TRIANGLE, LIMITS, [])


def luminance(colour: str) -> float:
    """Relative luminance of WCAG 2.2."""
    channels = [int(colour[i : i + 2], 16) / 255 for i in (1, 3, 5)]
    linear = [c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in channels]
    return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]


@pytest.mark.parametrize(("text", "ground"), [(INK, WHITE), (QUIET, WHITE), *((INK, look.block) for look in STATE_LOOKS.values())])
def test_words_have_contrast(text: str, ground: str) -> None:
    assert (luminance(ground) + 0.05) / (luminance(text) + 0.05) >= 4.5


def test_states_differ_in_lightness() -> None:
    by_lightness = sorted(luminance(look.block) for look in STATE_LOOKS.values())
    assert all((lighter + 0.05) / (darker + 0.05) > 1.5 for darker, lighter in pairwise(by_lightness))


@pytest.mark.parametrize(
    ("start", "end", "labels"),
    [
        ("2026-11-22T05:00:07Z", "2026-11-22T05:00:10Z", "05:00:07 05:00:08 05:00:09 05:00:10"),
        ("2026-11-22T04:59:45Z", "2026-11-22T05:59:15Z", "05:00 05:10 05:20 05:30 05:40 05:50"),
        ("2026-11-22T00:00:00Z", "2026-11-23T00:00:00Z", "22_Nov 03:00 06:00 09:00 12:00 15:00 18:00 21:00 23_Nov"),
        ("2026-02-27T18:00:00Z", "2026-03-02T06:00:00Z", "28_Feb 12:00 1_Mar 12:00 2_Mar"),
        ("2024-02-24T00:00:00Z", "2024-03-07T00:00:00Z", "25_Feb 27_Feb 29_Feb 2_Mar 4_Mar 6_Mar"),
    ],
)
def test_time_ticks(start: str, end: str, labels: str) -> None:
    assert [label.replace(" ", "_") for _, label in time_ticks(parse_utc(start), parse_utc(end), 8)] == labels.split()


def test_a_tick_after_a_leap_second_is_a_second_later() -> None:
    ticks = time_ticks(parse_utc("2016-12-31T23:59:30Z"), parse_utc("2017-01-01T00:00:30Z"), 6)
    assert {b - a for (a, _), (b, _) in pairwise(ticks)} == {15 * NS_PER_S, 16 * NS_PER_S}


@pytest.mark.parametrize(("span", "most", "step"), [(10.0, 5, 2.0), (10.0, 4, 5.0), (11.0, 1, 20.0), (0.3, 3, 0.1), (7.0, 7, 1.0)])
def test_nice_step(span: float, most: int, step: float) -> None:
    assert nice_step(span, most) == pytest.approx(step)


@pytest.mark.parametrize("value", [math.nan, math.inf])
def test_what_is_not_a_number_is_no_coordinate(value: float) -> None:
    with pytest.raises(ValueError, match="cannot be drawn"):
        number(value)


@pytest.mark.parametrize(("value", "written"), [(1.0, "1"), (-0.04, "0"), (2.349, "2.3"), (-1.25, "-1.2"), (1e6, "1000000")])
def test_numbers_have_one_decimal(value: float, written: str) -> None:
    assert number(value) == written


def test_a_text_that_does_not_fit_is_cut_to_the_room() -> None:
    cut = fitted("receiver B and many others", 12, 80.0)
    assert cut.endswith("…") and text_width_px(cut, 12) <= 80.0


@pytest.mark.parametrize(
    ("seconds", "written"),
    [(0.5, "0.5 s"), (59, "59 s"), (90, "1 min 30 s"), (7200, "2 h"), (90_000, "1 d 1 h")],
)
def test_duration(seconds: float, written: str) -> None:
    assert duration(round(seconds * NS_PER_S)) == written


@pytest.mark.parametrize("largest_m", [0.0, 3.0, 14.9, 15.1, 900.0, 6.4e6])
def test_the_error_scale_grows_over_all_of_its_axis(largest_m: float) -> None:
    scale = error_scale(largest_m, 7.5, 100.0, 300.0)
    y = scale.y(np.linspace(0.0, max(largest_m, 7.5), 500))
    assert (np.diff(y) < 0.0).all() and y.min() >= 100.0 and y[0] == 300.0
