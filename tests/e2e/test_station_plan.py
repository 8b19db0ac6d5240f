"""The planner as a command."""

import json
from pathlib import Path

from tests.e2e.commands import SITE, five_mistakes, wayside, written


def test_a_site_that_the_check_refuses_gets_a_plan(tmp_path: Path) -> None:
    site = written(tmp_path / "site.toml", SITE.replace("missed_detection = 1e-5", "missed_detection = 1e-5\ntolerance_m = 5.0"))
    ran = wayside("station", "plan", site)
    assert ran.code == 0, ran.err
    assert "what the file promises cannot be kept: needs a tolerance of" in ran.out


def test_a_machine_gets_one_object(tmp_path: Path) -> None:
    ran = wayside("station", "plan", written(tmp_path / "site.toml", SITE), "--json")
    assert len(json.loads(ran.out)["promises"]) == 12


def test_without_sound_error_models_there_is_no_plan_but_every_mistake(tmp_path: Path) -> None:
    ran = wayside("station", "plan", five_mistakes(tmp_path))
    assert (ran.code, ran.out) == (2, "")
    assert "sigma_comon_m" in ran.err and "missed_detection" in ran.err
