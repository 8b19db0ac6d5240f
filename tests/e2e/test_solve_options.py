"""`wayside solve` with its options, as a person runs it: tests and exclusion, velocity, smoothing, a table of every range."""

import csv
import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from integrity.gnss.observations import ObservationRow
from tests.e2e.commands import PRECIOUS, wayside, written
from tests.rinex_text import navigation_of, navigation_text, observation_text, rows_of
from tests.unit.sites import A_ECEF_M
from tests.unit.streams import stream

EPOCHS = 40
ROWS = rows_of(stream(EPOCHS), "A")
EPHEMERIDES, KLOBUCHAR = navigation_of(stream(EPOCHS))
POSITION = ",".join(map(str, A_ECEF_M))
FAULTY = 7
Case = Callable[[Path], list[object]]


def with_fault(row: ObservationRow, fault_m: float) -> ObservationRow:
    """On the satellite whose signal is the strongest."""
    ranges_m = row.pseudorange_m.copy()
    ranges_m[int(np.nanargmax(row.cn0_dbhz))] += fault_m
    return replace(row, pseudorange_m=ranges_m)


def without(row: ObservationRow, *names: str) -> ObservationRow:
    nothing: dict[str, Any] = {name: np.full(len(row.signals), np.nan) for name in names}
    return replace(row, **nothing)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The file of 40 epochs as it is, with a fault in one epoch, with faults everywhere in one, and without this and that."""
    here = tmp_path_factory.mktemp("options")
    rng = np.random.default_rng(1)
    bad = replace(ROWS[FAULTY], pseudorange_m=ROWS[FAULTY].pseudorange_m + rng.normal(0.0, 300.0, len(ROWS[FAULTY].signals)))
    texts = {
        "A": ROWS,
        "fault": [*ROWS[:FAULTY], with_fault(ROWS[FAULTY], 100.0), *ROWS[FAULTY + 1 :]],
        "spoiled": [*ROWS[:FAULTY], bad, *ROWS[FAULTY + 1 :]],
        "one": ROWS[:1],
        "no_doppler": [without(row, "doppler_hz") for row in ROWS],
        "no_carrier": [without(row, "carrier_cycles") for row in ROWS],
        "code": [without(row, "carrier_cycles", "doppler_hz", "cn0_dbhz") for row in ROWS],
    }
    for name, rows in texts.items():
        written(here / f"{name}.rnx", observation_text(rows))
    written(here / "nav.rnx", navigation_text(EPHEMERIDES, KLOBUCHAR))
    written(here / "none.rnx", navigation_text(()))
    return here


def solved(folder: Path, name: str, *arguments: object) -> dict[str, Any]:
    ran = wayside("solve", folder / f"{name}.rnx", "--nav", folder / "nav.rnx", *arguments, "--json")
    assert ran.code == 0, ran.err
    found: dict[str, Any] = json.loads(ran.out)
    return found


def table(path: Path) -> list[dict[str, str]]:
    with path.open(newline="") as file:
        return list(csv.DictReader(file))


# Tests and exclusion


def test_a_fault_is_excluded_and_counted(folder: Path) -> None:
    tests = solved(folder, "fault")["tests"]
    assert (tests["passed"], tests["passed_without_the_excluded"], sum(tests["excluded"].values())) == (EPOCHS - 1, 1, 1)


def test_the_row_of_the_epoch_names_the_excluded(folder: Path, tmp_path: Path) -> None:
    (name,) = solved(folder, "fault", "-o", tmp_path / "t.csv")["tests"]["excluded"]
    row = table(tmp_path / "t.csv")[FAULTY]
    assert (row["excluded"], row["fits"], row["why"]) == (name, "without the excluded", "")


def test_without_exclusion_the_fault_stays_in_the_position(folder: Path) -> None:
    worst = [solved(folder, "fault", "--position", POSITION, *asked)["errors"]["rms_enu_m"] for asked in ([], ["--no-exclude"])]
    assert np.linalg.norm(worst[1]) > 2.0 * np.linalg.norm(worst[0])


def test_an_epoch_that_does_not_fit_has_no_position(folder: Path, tmp_path: Path) -> None:
    found = solved(folder, "spoiled", "-o", tmp_path / "t.csv")
    row = table(tmp_path / "t.csv")[FAULTY]
    assert found["solved"] == EPOCHS - 1
    assert (row["x_m"], row["fits"], row["why"][:18]) == ("", "no", "ranges do not fit,")


def test_without_exclusion_every_epoch_has_a_position(folder: Path) -> None:
    assert solved(folder, "spoiled", "--no-exclude")["solved"] == EPOCHS


def test_people_are_told_what_was_excluded(folder: Path) -> None:
    lines = wayside("solve", folder / "fault.rnx", "--nav", folder / "nav.rnx").out.splitlines()
    at = lines.index("  tests of fit, false alarms 1e-05 an epoch: passed 39, after exclusion 1")
    assert lines[at + 1].startswith("    excluded: ")


def test_a_lower_false_alarm_has_a_higher_threshold(folder: Path, tmp_path: Path) -> None:
    limits = []
    for p in ("1e-3", "1e-9"):
        solved(folder, "A", "--false-alarm", p, "-o", tmp_path / "t.csv")
        limits.append(float(table(tmp_path / "t.csv")[0]["chi2_limit"]))
    assert limits[0] < limits[1]


# Velocity


def test_a_receiver_at_rest_has_no_velocity(folder: Path) -> None:
    velocity = solved(folder, "A")["velocity"]
    assert velocity["epochs"] == EPOCHS
    assert velocity["p95_3d_mps"] < 0.1  # of range rates that are wrong by 2 cm/s


def test_without_doppler_there_is_no_velocity(folder: Path, tmp_path: Path) -> None:
    assert solved(folder, "no_doppler", "-o", tmp_path / "t.csv")["velocity"]["rms_enu_mps"] is None
    assert {row["ve_mps"] for row in table(tmp_path / "t.csv")} == {""}


def test_nothing_asked_for_nothing_in_the_table(folder: Path, tmp_path: Path) -> None:
    solved(folder, "A", "--no-exclude", "--no-velocity", "-o", tmp_path / "t.csv")
    assert list(table(tmp_path / "t.csv")[0]) == ["gps_time", "x_m", "y_m", "z_m", "n_used", "why"]


# Smoothing


def test_smoothed_positions_scatter_less(folder: Path) -> None:
    scatter = [np.linalg.norm(solved(folder, "A", *asked)["scatter"]["rms_enu_m"]) for asked in ([], ["--smooth", 100])]
    assert scatter[1] < 0.7 * scatter[0]


def test_carriers_that_nothing_checks_are_spoken_of(folder: Path) -> None:
    ran = wayside("solve", folder / "no_doppler.rnx", "--nav", folder / "nav.rnx", "--smooth", "100")
    assert ran.code == 0
    assert "have neither a second frequency nor Doppler nor a lock time" in ran.err


# Every range


def test_a_row_for_every_range(folder: Path, tmp_path: Path) -> None:
    found = solved(folder, "A", "--residuals", tmp_path / "r.csv")
    rows = table(tmp_path / "r.csv")
    assert len(rows) == sum(int(np.isfinite(row.pseudorange_m).sum()) for row in ROWS)
    assert sum(row["place"] == "used" for row in rows) == round(found["satellites_used_mean"] * EPOCHS)


def test_the_excluded_range_stands_out(folder: Path, tmp_path: Path) -> None:
    (name,) = solved(folder, "fault", "--residuals", tmp_path / "r.csv")["tests"]["excluded"]
    (row,) = [row for row in table(tmp_path / "r.csv") if row["place"] == "excluded"]
    assert row["satellite"] == name
    assert float(row["residual_m"]) == pytest.approx(100.0, abs=10.0)


def test_a_failure_leaves_the_old_residuals(folder: Path, tmp_path: Path) -> None:
    old = written(tmp_path / "r.csv", PRECIOUS)
    wayside("solve", folder / "A.rnx", "--nav", folder / "none.rnx", "--residuals", old)
    assert (old.read_bytes(), [p.name for p in tmp_path.iterdir()]) == (PRECIOUS, ["r.csv"])


# Files with little in them


@pytest.mark.parametrize("name", ["one", "code", "no_doppler", "no_carrier"])
@pytest.mark.parametrize("asked", [[], ["--no-exclude"]], ids=["tested", "not tested"])
def test_little_is_enough(folder: Path, tmp_path: Path, name: str, asked: list[str]) -> None:
    found = solved(folder, name, *asked, "--residuals", tmp_path / "r.csv", "-o", tmp_path / "t.csv")
    assert found["solved"] == found["epochs"]


CASES: dict[str, tuple[Case, int, str]] = {
    "a probability beyond one": (lambda f: ["--false-alarm", "2"], 2, "--false-alarm 2: expected a probability of 1e-12 to 0.01 per epoch"),
    "a probability of nothing": (lambda f: ["--false-alarm", "nan"], 2, "--false-alarm nan: expected a probability"),
    "a probability for no test": (
        lambda f: ["--false-alarm", "1e-4", "--no-exclude"],
        2,
        "--false-alarm 0.0001 with --no-exclude: nothing is tested then; leave one of the two out",
    ),
    "no window": (lambda f: ["--smooth", "0"], 2, "--smooth 0: expected 1 to 3600 seconds"),
    "an endless window": (lambda f: ["--smooth", "inf"], 2, "--smooth inf: expected 1 to 3600 seconds"),
    "a window of words": (lambda f: ["--smooth", "long"], 2, "--smooth"),
    "both tables in one file": (lambda f: ["-o", f / "x.csv", "--residuals", f / "x.csv"], 2, "that is the file of -o; give each a name"),
    "a table over what is read": (lambda f: ["--residuals", f / "A.rnx"], 2, "that is one of the files to read; give another name"),
    "a folder for residuals": (lambda f: ["--residuals", f], 4, "Is a directory"),
    "a folder that is not there": (lambda f: ["--residuals", f / "no" / "r.csv"], 4, "no such file"),
}


@pytest.mark.parametrize("case", CASES)
def test_what_is_wrong_is_said(folder: Path, case: str) -> None:
    arguments, code, words = CASES[case]
    ran = wayside("solve", folder / "A.rnx", "--nav", folder / "nav.rnx", *arguments(folder))
    assert ran.code == code
    assert words in ran.err
    assert "Traceback" not in ran.err


def test_nothing_to_smooth_with_is_said(folder: Path) -> None:
    ran = wayside("solve", folder / "code.rnx", "--nav", folder / "nav.rnx", "--smooth", "100")
    assert ran.code == 2
    assert "--smooth 100: the first 40 epochs have no carrier phase; give files that have it" in ran.err
