"""`wayside solve` on receivers of others, with what it chooses by itself."""

import json
from pathlib import Path
from typing import Any

import numpy as np

from tests.e2e.commands import wayside


def solved(*arguments: object) -> dict[str, Any]:
    ran = wayside("solve", *arguments, "--json")
    assert ran.code == 0, ran.err
    found: dict[str, Any] = json.loads(ran.out)
    return found


def test_a_receiver_in_the_open_without_klobuchar_terms(shared_data: Path) -> None:
    """Two hours at 5 s: the ionosphere is measured, and positions scatter by a metre."""
    here = shared_data / "rosalia_2025"
    nav = [argument for path in sorted(here.glob("*.25p.gz")) for argument in ("--nav", path)]
    found = solved(*sorted(here.glob("ROSR*.rnx.gz")), *nav, "--mask", "5")
    assert (found["ionosphere"], found["epochs"], found["solved"]) == ("free", 1440, 1440)
    assert np.linalg.norm(found["scatter"]["rms_enu_m"]) <= 1.0


def test_a_receiver_at_a_known_point(shared_data: Path) -> None:
    """Of the delay that the broadcast ionosphere is wrong by, 2.5 m are left in 95 % of epochs."""
    here = shared_data / "spp_truth"
    files = [here / "SEPT078M.21O.gz", "--nav", here / "SEPT078M.21P.gz"]
    found = solved(*files, "--position", "-3962108.673,3381309.574,3668678.638")
    assert found["solved"] == 900
    assert found["errors"]["p95_3d_m"] < 2.5


def test_a_log_with_two_frequencies(shared_data: Path) -> None:
    found = solved(shared_data / "drive_imu" / "walk_gnss_1730.ubx.gz")
    assert (found["ionosphere"], found["epochs"], found["solved"]) == ("free", 536, 536)
