"""`wayside solve`: positions of one receiver, as a person runs it; what they are worth, and a clear word on whatever is wrong."""

import csv
import gzip
import json
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pymap3d
import pytest

from integrity.events import RawBytes
from integrity.gnss.atmosphere import Klobuchar
from integrity.gnss.observations import ROW_ARRAYS, Floats, ObservationRow
from recordings.simulate.observations import antennas_of
from recordings.simulate.receiver import as_bytes
from tests.e2e.commands import PRECIOUS, Ran, wayside, written
from tests.rinex_text import navigation_of, navigation_text, observation_text, rows_of
from tests.unit.sites import A_ECEF_M
from tests.unit.streams import SITE, stream

EPOCHS = 40
ROWS = rows_of(stream(EPOCHS), "A")
EPHEMERIDES, KLOBUCHAR = navigation_of(stream(EPOCHS))
TRUTH = np.array(A_ECEF_M)
POSITION = ",".join(map(str, A_ECEF_M))
Case = Callable[[Path], list[object]]


def three_signals(row: ObservationRow) -> ObservationRow:
    return replace(row, signals=row.signals[:3], **{name: getattr(row, name)[:3] for name in ROW_ARRAYS})


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A file of 40 epochs and its parts; navigation with and without ionosphere; a second frequency; the log of a u-blox receiver."""
    here = tmp_path_factory.mktemp("solve")
    text = observation_text(ROWS)
    written(here / "A.rnx", text)
    written(here / "early.rnx", observation_text(ROWS[:25]))
    written(here / "late.rnx.gz", gzip.compress(observation_text(ROWS[20:]).encode()))
    written(here / "nothing.rnx", observation_text(()))
    written(here / "empty.rnx", "")
    written(here / "cut.rnx.gz", gzip.compress(text.encode())[:-4000])
    twice = (replace(row, carrier_cycles=row.pseudorange_m) for row in ROWS)
    written(here / "two.rnx", observation_text(twice).replace("L1C", "C2X"))  # of GPS L2C, of Galileo nothing
    written(here / "few.rnx", observation_text([*ROWS[:30], *map(three_signals, ROWS[30:])]))
    written(here / "three.rnx", observation_text(map(three_signals, ROWS)))
    written(here / "nav.rnx", navigation_text(EPHEMERIDES, KLOBUCHAR))
    written(here / "bare.rnx", navigation_text(EPHEMERIDES))
    written(here / "none.rnx", navigation_text(()))
    sent = (event for event in as_bytes(stream(EPOCHS), antennas_of(SITE)) if isinstance(event, RawBytes) and event.receiver == "A")
    written(here / "A.ubx", b"".join(event.data for event in sent))
    return here


def solved(*arguments: object) -> dict[str, Any]:
    ran = wayside("solve", *arguments, "--json")
    assert ran.code == 0, ran.err
    found: dict[str, Any] = json.loads(ran.out)
    return found


def rows_in(path: Path) -> list[dict[str, str]]:
    with path.open(newline="") as file:
        return list(csv.DictReader(file))


def positions(rows: list[dict[str, str]]) -> Floats:
    return np.array([[float(row[name]) for name in ("x_m", "y_m", "z_m")] for row in rows])


@pytest.fixture(scope="module")
def table(folder: Path) -> list[dict[str, str]]:
    ran = wayside("solve", folder / "A.rnx", "--nav", folder / "nav.rnx", "--position", POSITION, "-o", folder / "A.csv")
    assert (ran.code, ran.err) == (0, f"{folder / 'A.csv'}: {EPOCHS} epochs\n")
    return rows_in(folder / "A.csv")


# What it writes


def test_a_row_an_epoch_in_gps_time(table: list[dict[str, str]]) -> None:
    assert [row["gps_time"] for row in table[:2]] == ["2026-03-02T03:00:18", "2026-03-02T03:00:19"]
    assert len(table) == EPOCHS


def test_positions_are_where_the_antenna_is(table: list[dict[str, str]]) -> None:
    # Simulated ranges are wrong by about 0.6 m; in the position twice that.
    assert np.linalg.norm(positions(table) - TRUTH, axis=1).max() < 5.0


def test_errors_are_those_of_the_positions(table: list[dict[str, str]]) -> None:
    """East, north, up by pymap3d, to the digits of the file."""
    lat, lon, height = pymap3d.ecef2geodetic(*TRUTH)
    expected = np.transpose(pymap3d.ecef2enu(*positions(table).T, lat, lon, height))
    told = [[float(row[name]) for name in ("e_m", "n_m", "u_m")] for row in table]
    np.testing.assert_allclose(told, expected, atol=3e-4)


def test_the_object_sums_the_table_up(folder: Path, table: list[dict[str, str]]) -> None:
    found = solved(folder / "A.rnx", "--nav", folder / "nav.rnx", "--position", POSITION)
    errors = np.array([[float(row[name]) for name in ("e_m", "n_m", "u_m")] for row in table])
    told = found["errors"]
    assert (found["epochs"], found["solved"], found["not_solved"], found["dropped"]) == (EPOCHS, EPOCHS, {}, {})
    np.testing.assert_allclose(told["mean_enu_m"], errors.mean(axis=0), atol=2e-4)
    np.testing.assert_allclose(told["rms_enu_m"], np.sqrt((errors**2).mean(axis=0)), atol=2e-4)
    np.testing.assert_allclose(told["p95_3d_m"], np.percentile(np.linalg.norm(errors, axis=1), 95.0), atol=2e-4)


def test_without_a_position_people_are_told_the_mean_and_the_scatter(folder: Path) -> None:
    ran = wayside("solve", folder / "A.rnx", "--nav", folder / "nav.rnx")
    lines = ran.out.splitlines()
    assert lines[0] == "A.rnx: 40 epochs from 2026-03-02T03:00:18 to 2026-03-02T03:00:57, GPS time"
    assert lines[1] == "  GPS, Galileo, BeiDou, QZSS from 10 degrees; ionosphere: Klobuchar (the navigation data have its terms)"
    assert lines[2].startswith("  solved: 40, with ")
    mean = np.array(lines[3].removeprefix("  mean position: ").partition(" ")[0].split(","), dtype=np.float64)
    assert np.linalg.norm(mean - TRUTH) < 3.0
    assert lines[4].startswith("  scatter about it: rms ")


def test_epochs_that_are_not_solved_say_why(folder: Path, tmp_path: Path) -> None:
    found = solved(folder / "few.rnx", "--nav", folder / "nav.rnx", "-o", tmp_path / "few.csv")
    assert (found["solved"], found["not_solved"]) == (30, {"too few satellites": 10})
    assert {(row["x_m"], row["why"]) for row in rows_in(tmp_path / "few.csv")[30:]} == {("", "too few satellites")}


def test_satellites_are_those_of_the_epochs_that_are_solved(folder: Path, table: list[dict[str, str]]) -> None:
    found = solved(folder / "few.rnx", "--nav", folder / "nav.rnx")
    assert found["satellites_used_mean"] == pytest.approx(np.mean([int(row["n_used"]) for row in table[:30]]), abs=0.01)


def test_a_higher_mask_leaves_fewer_satellites(folder: Path) -> None:
    used = [solved(folder / "A.rnx", "--nav", folder / "nav.rnx", "--mask", mask)["satellites_used_mean"] for mask in (0, 10, 30)]
    assert used == sorted(set(used), reverse=True)


def test_where_nothing_is_solved_there_are_no_numbers(folder: Path) -> None:
    found = solved(folder / "three.rnx", "--nav", folder / "nav.rnx", "--position", POSITION)
    numbers = [found[name] for name in ("errors", "mean_ecef_m", "mean_geodetic", "satellites_used_mean")]
    assert (found["solved"], numbers) == (0, [None] * 4)


def test_where_nothing_is_solved_people_are_told_why(folder: Path) -> None:
    ran = wayside("solve", folder / "three.rnx", "--nav", folder / "nav.rnx")
    assert (ran.code, ran.out.splitlines()[2:-1]) == (0, ["  solved: 0; not solved: too few satellites 40"])


# What it reads


def test_parts_in_any_order_are_one_file(folder: Path, tmp_path: Path, table: list[dict[str, str]]) -> None:
    parts = [folder / "late.rnx.gz", folder / "early.rnx"]
    found = solved(*parts, "--nav", folder / "nav.rnx", "--position", POSITION, "-o", tmp_path / "parts.csv")
    assert found["dropped"] == {"epoch repeated": 5}
    # Linearised at another point, metres away: below a millimetre.
    np.testing.assert_allclose(positions(rows_in(tmp_path / "parts.csv")), positions(table), atol=1e-3)


def test_a_u_blox_log_is_solved_with_what_it_brings(folder: Path) -> None:
    """Of the epochs before the first whole ephemerides, too."""
    found = solved(folder / "A.ubx", "--position", POSITION)
    assert found["solved"] == EPOCHS
    assert found["errors"]["p95_3d_m"] < 5.0


def test_damaged_files_beside_a_good_one_are_counted(folder: Path) -> None:
    bad = [folder / "empty.rnx", folder / "nothing.rnx", folder / "cut.rnx.gz"]
    found = solved(*bad, folder / "A.rnx", "--nav", folder / "nav.rnx")
    assert (found["epochs"], found["solved"]) == (EPOCHS, EPOCHS)
    dropped = found["dropped"]
    assert (dropped["file not readable, or not to its end"], dropped["file without epochs"], dropped["file cut off"]) == (1, 1, 1)


def test_files_of_two_receivers_are_noticed(folder: Path, tmp_path: Path) -> None:
    other = written(tmp_path / "B.rnx", (folder / "A.rnx").read_text().replace("A".ljust(60) + "MARKER", "B".ljust(60) + "MARKER"))
    ran = wayside("solve", folder / "A.rnx", other, "--nav", folder / "nav.rnx")
    assert ran.err == "warning: the files name 2 markers ('A', 'B'): give the files of one receiver\n"


def test_people_are_told_of_the_commonest_damage(folder: Path, tmp_path: Path) -> None:
    """Of as many kinds as there are, the most frequent first."""
    numbers = "".join(f"R{k:02d} 2026 03 02 03 00 00" + "0".rjust(19) * 3 + "\n" for k in range(1, 3))
    bad = written(tmp_path / "bad.rnx", (folder / "nav.rnx").read_text() + numbers)
    ran = wayside("solve", folder / "late.rnx.gz", folder / "early.rnx", "--nav", bad)
    at = ran.out.splitlines().index("  dropped:")
    assert ran.out.splitlines()[at + 1] == "    epoch repeated: 5"
    assert re.fullmatch(r"    navigation: .*: 2", ran.out.splitlines()[at + 2])


@pytest.mark.parametrize(
    ("observations", "navigation", "asked", "model"),
    [
        ("A", "nav", [], "klobuchar"),
        ("two", "nav", [], "klobuchar"),
        ("two", "bare", [], "free"),
        ("A", "bare", [], "none"),
        ("two", "nav", ["--ionosphere", "none"], "none"),
    ],
)
def test_the_ionosphere_is_what_was_asked_for_or_the_first_that_the_files_allow(
    folder: Path, observations: str, navigation: str, asked: list[str], model: str
) -> None:
    systems = ["--systems", "GPS"]
    found = solved(folder / f"{observations}.rnx", "--nav", folder / f"{navigation}.rnx", *asked, *systems)
    assert found["ionosphere"] == model
    assert (found["ionosphere_why"] is None) == bool(asked)


def test_pairs_of_two_frequencies_are_solved(folder: Path) -> None:
    """The second range is the first here, so the ionosphere stays, and noise is no worse."""
    found = solved(folder / "two.rnx", "--nav", folder / "nav.rnx", "--ionosphere", "free", "--position", POSITION)
    assert found["solved"] == EPOCHS
    assert found["errors"]["p95_3d_m"] < 20.0


def test_nequick_takes_the_coefficients_of_galileo(folder: Path, tmp_path: Path) -> None:
    """Of an ionosphere that both models call small they differ, but not by much."""
    quiet = Klobuchar((0.0,) * 4, (0.0,) * 4)
    gal = "GAL    2.0000E+01  0.0000E+00  0.0000E+00".ljust(60) + "IONOSPHERIC CORR\n"
    text = navigation_text(EPHEMERIDES, quiet)
    at = text.index("GPSA")
    nav = written(tmp_path / "nav.rnx", text[:at] + gal + text[at:])
    means = [solved(folder / "A.rnx", "--nav", nav, "--ionosphere", name)["mean_ecef_m"] for name in ("klobuchar", "nequick")]
    apart_m = float(np.linalg.norm(np.subtract(*means)))
    assert 0.01 < apart_m < 5.0


# What is wrong

CASES: dict[str, tuple[Case, int, str]] = {
    "no navigation file": (lambda f: [f / "A.rnx"], 2, "no navigation file: give the broadcast ephemerides of the day with --nav"),
    "navigation without ephemerides": (lambda f: [f / "A.rnx", "--nav", f / "none.rnx"], 4, "serves the epochs 2026-03-02T03:00:18 to"),
    "ephemerides of other systems": (
        lambda f: [f / "A.rnx", "--nav", f / "nav.rnx", "--systems", "glonass"],
        4,
        "no ephemeris of GLONASS serves",
    ),
    "a file without epochs": (lambda f: [f / "nothing.rnx", "--nav", f / "nav.rnx"], 4, "nothing.rnx: no epoch of measurements; give"),
    "an empty file": (lambda f: [f / "empty.rnx", "--nav", f / "nav.rnx"], 4, "empty.rnx, line 1: found an empty file; expected"),
    "a navigation file to solve": (lambda f: [f / "nav.rnx", "--nav", f / "nav.rnx"], 4, "nav.rnx, line 1: found "),
    "a file that is not there": (lambda f: [f / "no.rnx", "--nav", f / "nav.rnx"], 4, "no.rnx: no such file"),
    "a place in space": (
        lambda f: [f / "A.rnx", "--nav", f / "nav.rnx", "--position", "1,2,3"],
        2,
        "--position '1,2,3': expected X,Y,Z in ECEF metres of a place on the ground, such as",
    ),
    "no number": (lambda f: [f / "A.rnx", "--nav", f / "nav.rnx", "--position", "here"], 2, "--position 'here': expected X,Y,Z in"),
    "no such system": (lambda f: [f / "A.rnx", "--nav", f / "nav.rnx", "--systems", "GPS,Loran"], 2, "--systems 'GPS,Loran': expected"),
    "no such model": (lambda f: [f / "A.rnx", "--nav", f / "nav.rnx", "--ionosphere", "sun"], 2, "expected one of klobuchar, nequick"),
    "a mask of the zenith": (lambda f: [f / "A.rnx", "--nav", f / "nav.rnx", "--mask", "nan"], 2, "--mask nan: expected 0 to 45 degrees"),
    "no terms": (
        lambda f: [f / "A.rnx", "--nav", f / "bare.rnx", "--ionosphere", "klobuchar"],
        2,
        "no Klobuchar terms (GPSA, GPSB, or ION ALPHA and BETA in RINEX 2); give one that has them with --nav, or another model: nequick",
    ),
    "no coefficients": (
        lambda f: [f / "A.rnx", "--nav", f / "nav.rnx", "--ionosphere", "nequick"],
        2,
        "no coefficients of Galileo (GAL in IONOSPHERIC CORR",
    ),
    "one frequency": (
        lambda f: [f / "A.rnx", "--nav", f / "nav.rnx", "--ionosphere", "free"],
        2,
        "have no satellite of GPS, Galileo, BeiDou, QZSS on two frequencies; use klobuchar, nequick or none",
    ),
    "a folder to write to": (lambda f: [f / "A.rnx", "--nav", f / "nav.rnx", "-o", f], 4, "Is a directory"),
}


@pytest.mark.parametrize("case", CASES)
def test_what_is_wrong_is_said(folder: Path, case: str) -> None:
    arguments, code, words = CASES[case]
    ran: Ran = wayside("solve", *arguments(folder))
    assert ran.code == code
    assert ran.err.startswith("wayside: ")
    assert words in ran.err
    assert "Traceback" not in ran.err


def test_a_failure_leaves_the_old_table(folder: Path, tmp_path: Path) -> None:
    table = written(tmp_path / "old.csv", PRECIOUS)
    wayside("solve", folder / "A.rnx", "--nav", folder / "none.rnx", "-o", table)
    assert table.read_bytes() == PRECIOUS
