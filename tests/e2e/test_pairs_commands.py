"""A site with two frequencies through the commands: checked, simulated, decided again; and with receivers that have one."""

import json
from pathlib import Path

import pytest

from recordings.reader import read_recording
from recordings.replay import recorded_site
from tests.e2e.commands import EPOCHS, FAULTS, SITE, replay_object, wayside

PAIRS = "".join(line for line in SITE.splitlines(keepends=True) if not line.startswith("sigma_"))
PAIRS = PAIRS.replace('rule = "full"\n', 'rule = "full"\nfrequencies = 2\n')
HEAD = f'[scenario]\nstart = "2026-03-02T03:00:00Z"\nduration_s = {EPOCHS}\nseed = 1\n'
FAULT = FAULTS.replace("[30.0, -20.0, 0.0]", "[45.0, -30.0, 0.0]")


def simulated(folder: Path, name: str, scenario: str) -> Path:
    (folder / f"{name}.toml").write_text(scenario, "utf-8")
    ran = wayside("simulate", folder / f"{name}.toml", "-o", folder / f"{name}.mcap")
    assert ran.code == 0, ran
    return folder / f"{name}.mcap"


@pytest.fixture(scope="module")
def two(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Receivers with two frequencies, since the site wants them; one is off for a while."""
    return simulated(tmp_path_factory.mktemp("two"), "two", HEAD + PAIRS + FAULT)


@pytest.fixture(scope="module")
def one(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The same site, and receivers with one."""
    return simulated(tmp_path_factory.mktemp("one"), "one", HEAD + "frequencies = 1\n" + PAIRS)


def test_check_says_on_what_a_site_decides(tmp_path: Path) -> None:
    (tmp_path / "site.toml").write_text(PAIRS, "utf-8")
    assert "frequencies    2: pairs of signals, free of the ionosphere\n" in wayside("station", "check", tmp_path / "site.toml").out


def test_check_refuses_three_frequencies(tmp_path: Path) -> None:
    (tmp_path / "site.toml").write_text(PAIRS.replace("frequencies = 2", "frequencies = 3"), "utf-8")
    ran = wayside("station", "check", tmp_path / "site.toml", "--json")
    (error,) = json.loads(ran.out)["errors"]
    assert (ran.code, error["key"]) == (2, "integrity.frequencies")


def test_the_receiver_that_was_off_is_named(two: Path) -> None:
    named = [x for x in replay_object(two)["episodes"] if x["cause"] == "receiver"]
    assert [x["subjects"] for x in named] == [["B"]]


def test_it_is_decided_again_as_recorded(two: Path) -> None:
    ran = wayside("replay", two, "--diff")
    assert (ran.code, ran.err) == (0, f"all {EPOCHS} epochs decided as recorded\n")


def test_the_recording_remembers_on_what_was_decided(two: Path) -> None:
    assert recorded_site(read_recording(two)).config.integrity.frequencies == 2


def test_it_can_be_decided_again_on_one_frequency(two: Path) -> None:
    found = replay_object(two, "--set", "frequencies=1")
    assert found["states"]["NORMAL"] > EPOCHS // 2


def test_receivers_with_one_frequency_never_make_it_normal(one: Path) -> None:
    assert replay_object(one)["states"]["NOT_CONFIRMABLE"] == EPOCHS


def test_why_they_do_not_is_among_the_reasons(one: Path) -> None:
    (episode,) = replay_object(one)["episodes"]
    assert episode["reasons"][-1].endswith("have those that lack them track a second band, or write frequencies = 1")
