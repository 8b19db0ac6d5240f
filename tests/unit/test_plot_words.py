"""The words of the drawing of a replay: all that occurred is said, on the page, and none stands on another."""

import math
from dataclasses import replace
from itertools import combinations
from xml.etree import ElementTree

import numpy as np
import pytest

from integrity.exclusion import Exclusion
from integrity.gnss.gps_time import NS_PER_S
from integrity.limits import Limits
from integrity.outputs import EpochReport
from integrity.states import Cause, State
from integrity.triangle import ReferenceTriangle
from recordings.report.plot import replay_svg
from recordings.report.svg import Box, text_box
from tests.unit.stories import (
    FLAT_ECEF_M,
    LIMITS,
    START_NS,
    SVG,
    TRIANGLE,
    by_id,
    calm,
    draw,
    eventful,
    every_cause,
    moved,
    site_of,
    stopped,
)


def unsolved(second: int) -> EpochReport:
    report = calm(second)
    return stopped(replace(report, e_enu_m=np.full((3, 3), np.nan), statistic=np.full_like(report.statistic, np.nan)), Cause.DATA)


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


def test_a_title_is_escaped() -> None:
    svg = ElementTree.fromstring(replay_svg('<A> & "B" \x00', TRIANGLE, LIMITS, [calm(0)]))
    assert by_id(svg, "title").text == '<A> & "B" \ufffd'


def test_a_long_title_is_cut() -> None:
    svg = ElementTree.fromstring(replay_svg("Wayside " * 40, TRIANGLE, LIMITS, [calm(0)]))
    assert overlaps(svg) == []
