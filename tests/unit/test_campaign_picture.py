"""The picture of a campaign: whole, readable, and true to the numbers; and the words beside it."""

from typing import Any
from xml.etree import ElementTree

import pytest

from recordings.campaign.axes import ALARM, ALL_MONITORS, Scale
from recordings.campaign.campaign import Plan, Simulated, campaign, tolerance_m
from recordings.campaign.picture import PLOT_PX, TOP_PX, campaign_svg
from recordings.campaign.summary import as_json_object, explain
from recordings.campaign.theory import Effort, theory
from tests.unit.streams import SITE, START_NS

PLAN = Plan((Simulated(SITE, START_NS, 150.0, seed=3),), trials=2)
TINY = Effort(400, 20, {3652.5: 2.0, 1.0: 1.0})
Element = ElementTree.Element


@pytest.fixture(scope="module")
def found() -> dict[str, Any]:
    played = [one for piece in campaign(PLAN, 1, ("RX-BIAS", "MEAC")) for one in piece]
    return as_json_object(played, PLAN) | {"theory": theory(SITE, tolerance_m(SITE), TINY, seed=1)}


def drawn(found: dict[str, Any]) -> list[Element]:
    return list(ElementTree.fromstring(campaign_svg(found)).iter())


def texts(found: dict[str, Any]) -> list[str]:
    return [element.text or "" for element in drawn(found) if element.tag.endswith("text")]


def changed(found: dict[str, Any], **of_first: object) -> dict[str, Any]:
    """The same with the first size of the first threat changed."""
    threat = found["threats"][0]
    sizes = [threat["sizes"][0] | of_first, *threat["sizes"][1:]]
    return found | {"threats": [threat | {"sizes": sizes}, *found["threats"][1:]]}


def caught_dots(found: dict[str, Any]) -> list[tuple[float, float]]:
    dots = [e for e in drawn(found) if e.tag.endswith("circle") and e.get("fill") == ALL_MONITORS]
    at = [(float(e.get("cx", "")), float(e.get("cy", ""))) for e in dots]
    return [(x, y) for x, y in at if TOP_PX - 1 <= y <= TOP_PX + PLOT_PX + 1]


@pytest.mark.parametrize("threat", ["RX-BIAS", "MEAC"])
def test_every_threat_has_its_plot(found: dict[str, Any], threat: str) -> None:
    assert threat in texts(found)


def test_every_size_has_a_dot(found: dict[str, Any]) -> None:
    assert len(caught_dots(found)) == sum(len(threat["sizes"]) for threat in found["threats"])


def test_what_is_always_caught_stands_at_the_top_and_what_never_is_at_the_bottom(found: dict[str, Any]) -> None:
    of_bias = sorted(caught_dots(found))[:7]
    assert (of_bias[0][1], of_bias[-1][1]) == (TOP_PX + PLOT_PX, TOP_PX)


def test_wrong_names_are_in_the_colour_of_alarm(found: dict[str, Any]) -> None:
    spoiled = changed(found, named_wrongly=7)
    coloured = [e.text for e in drawn(spoiled) if e.tag.endswith("text") and e.get("fill") == ALARM]
    assert "7" in coloured


def test_a_move_beyond_the_radius_is_in_the_colour_of_alarm(found: dict[str, Any]) -> None:
    spoiled = changed(found, shift_m={"p50": 1.0, "p95": found["radius_m"] + 0.1, "max": 9.0})
    coloured = [e.text for e in drawn(spoiled) if e.tag.endswith("text") and e.get("fill") == ALARM]
    assert f"{found['radius_m'] + 0.1:.1f}" in coloured


def test_no_wrong_name_is_not(found: dict[str, Any]) -> None:
    assert not [e for e in drawn(found) if e.tag.endswith("text") and e.get("fill") == ALARM and (e.text or "").isdecimal()]


def test_nothing_is_drawn_beside_the_page(found: dict[str, Any]) -> None:
    root = ElementTree.fromstring(campaign_svg(found))
    width, height = float(root.get("width", "")), float(root.get("height", ""))
    at = [(float(e.get("x", "0")), float(e.get("y", "0"))) for e in root.iter() if e.tag.endswith("text")]
    assert all(0 <= x <= width and 0 <= y <= height for x, y in at)


def test_a_campaign_of_a_few_threats_has_no_theory(found: dict[str, Any]) -> None:
    without = {key: value for key, value in found.items() if key != "theory"}
    assert "Smallest fault caught" not in texts(without)


def test_the_same_campaign_is_the_same_picture(found: dict[str, Any]) -> None:
    assert campaign_svg(found) == campaign_svg(found)


def test_text_is_escaped(found: dict[str, Any]) -> None:
    threat = found["threats"][0] | {"title": "a < b & c"}
    assert any(text.startswith("a < b & c") for text in texts(found | {"threats": [threat]}))


@pytest.mark.parametrize(("value", "px"), [(1.0, 100.0), (1e-4, 60.0), (1e-12, 0.0), (5.0, 100.0)])
def test_a_logarithmic_scale_ends_at_its_edges(value: float, px: float) -> None:
    assert Scale(1e-10, 1.0, 0.0, 100.0, True).px(value) == pytest.approx(px)


def test_words_tell_measured_beside_stated(found: dict[str, Any]) -> None:
    line = next(line for line in explain(found).splitlines() if line.startswith("  shape "))
    assert "measured" in line and "stated" in line


def test_words_say_that_the_line_is_a_proposal(found: dict[str, Any]) -> None:
    assert "a proposal of this project" in explain(found)


def test_every_check_that_states_a_smallest_fault_by_law_is_measured(found: dict[str, Any]) -> None:
    checks = [of["check"] for of in found["theory"]["smallest_faults"]]
    assert checks == ["circle_A", "shape", "shape_3d", "common", "common_3d", "collapse", "residual", "b_value"]
