"""What stands in the files is read as it was written; what cannot be meant is left out and counted, or told."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from integrity.gnss.constants import SPEED_OF_LIGHT_MPS
from integrity.gnss.ephemeris.broadcast import Ephemeris, KeplerEphemeris
from integrity.gnss.ephemeris.states import satellite_states
from integrity.gnss.gps_time import NS_PER_S
from integrity.gnss.observations import ROW_FLOATS
from recordings.importer import Imported, import_files
from recordings.rinex.navigation import read_navigation
from recordings.rinex.observation import read_observations
from tests.rinex_text import LEAP_SECONDS, navigation_text, observation_text, rows_of
from tests.unit.imported import AT, EPHEMERIDES, ROWS, epochs_of, navigation_file, observation_file
from tests.unit.streams import SITE, START_NS, with_values


def imported_text(directory: Path, text: str) -> Imported:
    """The stream with other text as the file of B."""
    files = {name: [observation_file(directory, name, rows)] for name, rows in ROWS.items()}
    path = directory / "B.rnx"
    path.write_text(text, "ascii")
    return import_files(SITE, files | {"B": [read_observations(path, "B")]}, [navigation_file(directory)])


# The text that these tests are fed with


@pytest.mark.parametrize("receiver", SITE.receiver_names)
def test_rows_written_as_rinex_are_read_with_the_same_signals_at_the_same_times(tmp_path: Path, receiver: str) -> None:
    read = observation_file(tmp_path, receiver, ROWS[receiver]).rows
    assert [(r.receiver, r.receive_time_ns, r.signals) for r in read] == [
        (r.receiver, r.receive_time_ns, r.signals) for r in ROWS[receiver]
    ]


@pytest.mark.parametrize("quantity", [name for name in ROW_FLOATS if name != "lock_s"])
def test_rows_written_as_rinex_are_read_to_half_a_thousandth(tmp_path: Path, quantity: str) -> None:
    read = observation_file(tmp_path, "A", ROWS["A"]).rows
    for was, now in zip(ROWS["A"], read, strict=True):
        np.testing.assert_allclose(getattr(now, quantity), getattr(was, quantity), rtol=0.0, atol=0.51e-3)  # F14.3


def test_what_is_not_measured_stays_so(tmp_path: Path) -> None:
    (read,) = observation_file(tmp_path, "A", [with_values(ROWS["A"][0], "cn0_dbhz", np.nan, [2])]).rows
    assert np.flatnonzero(np.isnan(read.cn0_dbhz)).tolist() == [2]


def test_a_slip_and_a_half_cycle_go_through_the_loss_of_lock_indicator(tmp_path: Path) -> None:
    row = ROWS["A"][0]
    flags = np.arange(len(row.signals))
    (read,) = observation_file(tmp_path, "A", [replace(row, slip=flags % 2 == 1, half_cycle=flags % 3 == 1)]).rows
    assert (read.slip.tolist(), read.half_cycle.tolist()) == ((flags % 2 == 1).tolist(), (flags % 3 == 1).tolist())


def test_satellites_of_written_ephemerides_stand_where_they_stood_to_a_millimetre(tmp_path: Path) -> None:
    t_ns = START_NS + np.arange(0, 3600, 600) * NS_PER_S
    index = np.tile(np.arange(len(EPHEMERIDES)), (len(t_ns), 1))
    was = satellite_states(EPHEMERIDES, index, t_ns)
    now = satellite_states(navigation_file(tmp_path).ephemerides, index, t_ns)
    moved_m = np.linalg.norm(now.pos_ecef_m - was.pos_ecef_m, axis=0) + SPEED_OF_LIGHT_MPS * np.abs(now.clock_s - was.clock_s)
    assert moved_m.max() < 1e-3


def test_what_ephemerides_say_of_themselves_is_read_exactly(tmp_path: Path) -> None:
    def of_itself(e: Ephemeris) -> tuple[object, ...]:
        assert isinstance(e, KeplerEphemeris)
        return e.satellite, e.issue, e.healthy, e.accuracy_m, e.transmission_ns, e.toe_ns, e.toc_ns, e.fit_half_s

    assert [of_itself(e) for e in navigation_file(tmp_path).ephemerides] == [of_itself(e) for e in EPHEMERIDES]


# Leap seconds


def test_leap_seconds_of_a_header_that_differ_from_the_table_are_told(tmp_path: Path) -> None:
    files = {name: [observation_file(tmp_path, name, rows, 17 if name == "B" else LEAP_SECONDS)] for name, rows in ROWS.items()}
    warnings = import_files(SITE, files, [navigation_file(tmp_path)]).warnings
    assert warnings == (f"{tmp_path / 'B.rnx'}: header says 17 leap seconds, the table says 18; the table is used",)


def test_leap_seconds_of_a_navigation_file_are_checked_too(tmp_path: Path) -> None:
    files = {name: [observation_file(tmp_path, name, rows)] for name, rows in ROWS.items()}
    warnings = import_files(SITE, files, [navigation_file(tmp_path, leap_seconds=16)]).warnings
    assert [w.partition(": ")[0] for w in warnings] == [str(tmp_path / "nav.rnx")]


def test_wrong_leap_seconds_change_no_epoch(tmp_path: Path) -> None:
    files = {name: [observation_file(tmp_path, name, rows, 0)] for name, rows in ROWS.items()}
    assert epochs_of(import_files(SITE, files, [navigation_file(tmp_path)])) == AT


def test_missing_ionosphere_is_told(tmp_path: Path) -> None:
    files = {name: [observation_file(tmp_path, name, rows)] for name, rows in ROWS.items()}
    path = tmp_path / "nav.rnx"
    path.write_text(navigation_text(EPHEMERIDES), "ascii")
    (warning,) = import_files(SITE, files, [read_navigation(path)]).warnings
    assert "Klobuchar" in warning


# Everything dropped is counted


@pytest.mark.parametrize(
    ("field", "reason"),
    [
        ("           nan", "field not a number"),
        ("           inf", "field not a number"),
        ("*" * 14, "field not a number"),
        (f"{1.0:14.3f}", "absurd pseudorange"),
        (f"{-2.2e7:14.3f}", "absurd pseudorange"),
        (f"{9.9e8:14.3f}", "absurd pseudorange"),
    ],
)
def test_a_range_that_is_none_is_left_out_and_counted(tmp_path: Path, field: str, reason: str) -> None:
    lines = observation_text(ROWS["B"]).split("\n")
    first = next(k for k, line in enumerate(lines) if line.startswith(">")) + 1
    lines[first] = lines[first][:3] + field + lines[first][17:]
    result = imported_text(tmp_path, "\n".join(lines))
    assert (rows_of(result.events, "B")[0].signals, result.dropped["B"]) == (ROWS["B"][0].signals[1:], {reason: 1})


def test_an_epoch_cut_in_its_middle_is_left_out_and_counted(tmp_path: Path) -> None:
    text = observation_text(ROWS["B"])
    result = imported_text(tmp_path, text[: text.rindex(">") + 400])
    assert (epochs_of(result), result.dropped["B"]) == (AT[:-1], {"epoch cut off": 1})
