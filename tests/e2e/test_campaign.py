"""The campaign as a command: faults that are whole in their first epoch, faults that move nothing; what it writes, what it refuses."""

import json
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import pytest

from tests.e2e.commands import Ran, wayside

# Threats with the size from which every trial is caught in its first epoch: above what the site's limits state, for a satellite at the
# lowest elevation in use.
ABRUPT = {"SV-STEP": 100.0, "RX-BIAS": 10.0, "RX2-SAME": 20.0, "SPF-3": 0.0, "MEAC": 30.0}
HARMLESS = ("RX-CLOCK", "CONST-CLOCK")
OPTIONS = [option for threat in (*ABRUPT, *HARMLESS) for option in ("--threat", threat)]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("campaign")


@pytest.fixture(scope="module")
def ran(folder: Path) -> Ran:
    return wayside("campaign", "--jobs", 2, *OPTIONS, "-o", folder / "new", "--json")


@pytest.fixture(scope="module")
def found(ran: Ran) -> dict[str, Any]:
    assert ran.code == 0, ran.err
    result: dict[str, Any] = json.loads(ran.out)
    return result


def sizes(found: dict[str, Any], threat: str) -> list[dict[str, Any]]:
    return next(of["sizes"] for of in found["threats"] if of["id"] == threat)


def test_nobody_is_named_wrongly(found: dict[str, Any]) -> None:
    assert found["named_wrongly"]["count"] == 0


def test_nothing_beyond_the_tolerance_is_normal(found: dict[str, Any]) -> None:
    assert found["hazards"]["count"] == 0


@pytest.mark.parametrize("threat", ABRUPT)
def test_an_abrupt_fault_that_is_large_enough_is_caught_in_its_first_epoch(found: dict[str, Any], threat: str) -> None:
    large = [of for of in sizes(found, threat) if of["size"] >= ABRUPT[threat]]
    assert large and all(of["in_first_epoch"]["count"] == of["trials"] for of in large)


@pytest.mark.parametrize("threat", HARMLESS)
def test_what_moves_no_position_stops_nothing(found: dict[str, Any], threat: str) -> None:
    assert [of["detected"]["count"] for of in sizes(found, threat)] == [0] * len(sizes(found, threat))


def test_the_results_are_written(found: dict[str, Any], folder: Path) -> None:
    assert json.loads((folder / "new" / "results.json").read_text()) == found


def test_the_picture_is_written(found: dict[str, Any], folder: Path) -> None:
    shown = [e.text for e in ElementTree.parse(folder / "new" / "results.svg").iter() if e.tag.endswith("text")]
    assert set(ABRUPT) <= set(shown)


def test_the_table_is_written(found: dict[str, Any], folder: Path) -> None:
    rows = [line.split(" | ")[0] for line in (folder / "new" / "results.md").read_text().splitlines()]
    assert set(ABRUPT) <= {row.removeprefix("| ") for row in rows}


@pytest.mark.parametrize("word", ["processors", "Python", "numpy"])
def test_it_says_on_what_it_ran(found: dict[str, Any], word: str) -> None:
    assert word in found["machine"]


def test_it_says_how_long_it_took(found: dict[str, Any]) -> None:
    assert found["wall_s"] > 0.0


def test_an_unknown_threat_is_a_mistake_of_usage() -> None:
    assert wayside("campaign", "--threat", "SV-STP").code == 2
