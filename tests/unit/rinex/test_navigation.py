"""Navigation files as a whole: versions, headers, and what is left of a damaged one. What the records say is tested next to this."""

import gzip
from pathlib import Path

import pytest

from integrity.errors import DecodeError
from integrity.gnss.atmosphere import GalileoIonosphere
from tests import rinex_examples as example
from tests.unit.rinex.navigation_files import HEADER_2, HEADER_3, HEADER_3_05, header, read, record, record_2

GPS_2, GPS_3 = record_2(" 6", example.GPS_HEAD, example.GPS), record(example.GPS_HEAD, example.GPS)
INAV, FNAV = record(example.GALILEO_HEAD, example.INAV), record(example.GALILEO_HEAD, example.FNAV)
GLONASS, SBAS = record(example.GLONASS_HEAD, example.GLONASS), record(example.SBAS_HEAD, example.SBAS)
BEIDOU, QZSS = record(example.BEIDOU_HEAD, example.BEIDOU), record(example.QZSS_HEAD, example.QZSS)
FIFTH_LINE = " " * 23 + " 3.725290298462D-09 3.000000000000D+00" + "\n"


def test_rinex2_header(tmp_path: Path) -> None:
    file = read(tmp_path, HEADER_2 + GPS_2)
    assert (file.version, file.leap_seconds, file.problems) == (2.10, 13, {})
    assert file.klobuchar is not None
    assert file.klobuchar.alpha == (0.1676e-7, 0.2235e-7, -0.1192e-6, -0.1192e-6)
    assert file.klobuchar.beta == (0.1208e6, 0.1310e6, -0.1310e6, -0.1966e6)


def test_rinex3_header(tmp_path: Path) -> None:
    file = read(tmp_path, HEADER_3 + GPS_3)
    assert (file.version, file.leap_seconds) == (3.04, 18)
    assert file.klobuchar is not None
    assert file.klobuchar.alpha[3] == -0.1192e-6
    assert file.klobuchar.beta[3] == -0.1966e6
    assert file.galileo_ionosphere == GalileoIonosphere(124.8, 0.5039, 0.02377, 0)


def test_half_of_the_ionosphere_is_none(tmp_path: Path) -> None:
    assert read(tmp_path, HEADER_2.replace("ION BETA", "COMMENT ") + GPS_2).klobuchar is None


def test_an_ionosphere_that_cannot_be_read_is_counted(tmp_path: Path) -> None:
    file = read(tmp_path, HEADER_3.replace(".5039D+00", "*********") + GPS_3)
    assert file.galileo_ionosphere is None
    assert file.problems == {"IONOSPHERIC CORR GAL not readable": 1}


@pytest.mark.parametrize(("system", "scale"), [("C", ""), ("M", "BDS")])
def test_leap_seconds_of_beidou_count_from_its_own_beginning(tmp_path: Path, system: str, scale: str) -> None:
    text = header(f"     3.04           N: GNSS NAV DATA    {system}", "RINEX VERSION / TYPE")
    text += header(f"{4:6d}{'':18}{scale}", "LEAP SECONDS") + header("", "END OF HEADER") + BEIDOU
    assert read(tmp_path, text).leap_seconds == 18


def test_sets_of_all_systems_in_the_order_of_the_file(tmp_path: Path) -> None:
    file = read(tmp_path, HEADER_3 + SBAS + QZSS + GPS_3 + INAV + GLONASS + BEIDOU)
    assert [eph.satellite for eph in file.ephemerides] == ["S22", "J01", "G06", "E12", "R02", "C01"]
    assert file.problems == {}


def test_sets_of_fnav_are_kept_apart(tmp_path: Path) -> None:
    file = read(tmp_path, HEADER_3 + FNAV + INAV)
    assert file.ephemerides == (example.EVERY_KIND["Galileo I/NAV"],)
    assert file.fnav_ephemerides == (example.EVERY_KIND["Galileo F/NAV"],)


def test_a_system_that_is_not_used_is_counted(tmp_path: Path) -> None:
    file = read(tmp_path, HEADER_3 + GPS_3.replace("G06", "I06") + GPS_3 + GPS_3.replace("G06", "I07"))
    assert [eph.satellite for eph in file.ephemerides] == ["G06"]
    assert file.problems == {"system I, not used": 2}


def test_since_rinex_3_05_glonass_has_a_fifth_line(tmp_path: Path) -> None:
    file = read(tmp_path, HEADER_3_05 + GLONASS + FIFTH_LINE + GPS_3 + GLONASS + FIFTH_LINE)
    assert [eph.satellite for eph in file.ephemerides] == ["R02", "G06", "R02"]
    assert file.problems == {}


def test_since_rinex_3_05_a_glonass_record_of_four_lines_has_lost_one(tmp_path: Path) -> None:
    """The one that is missing may have been that of x: what then stands for y and z says nothing of either."""
    file = read(tmp_path, HEADER_3_05 + GLONASS + FIFTH_LINE + GLONASS)
    assert len(file.ephemerides) == 1
    assert file.problems == {"record cut off": 1}


def test_all_of_the_fifth_line_may_be_blank(tmp_path: Path) -> None:
    file = read(tmp_path, HEADER_3_05 + GLONASS + "\n" + GPS_3 + GLONASS + " " * 80 + "\n")
    assert [eph.satellite for eph in file.ephemerides] == ["R02", "G06", "R02"]
    assert file.problems == {}


@pytest.mark.parametrize("text", [HEADER_2 + GPS_2, HEADER_3 + GPS_3 + SBAS + GLONASS, HEADER_3_05 + GLONASS + FIFTH_LINE + GPS_3])
def test_blank_lines_between_all_others_change_nothing(tmp_path: Path, text: str) -> None:
    assert read(tmp_path, text.replace("\n", "\r\r\n")).ephemerides == read(tmp_path, text).ephemerides


def test_before_rinex_3_05_a_fifth_line_is_one_too_many(tmp_path: Path) -> None:
    file = read(tmp_path, HEADER_3 + GLONASS + FIFTH_LINE)
    assert file.ephemerides == ()
    assert file.problems == {"record longer than it should be": 1}


def test_missing_trailing_fields(tmp_path: Path) -> None:
    """The last line may end after any field, and the spare ones may be there."""
    short, spare = GPS_2.removesuffix("  0.000000000000D+00\n") + "\n", GPS_2.removesuffix("\n") + "  .000000000000D+00" * 2 + "\n"
    file = read(tmp_path, HEADER_2 + short + spare)
    assert len(file.ephemerides) == 2
    assert file.problems == {}


DROPPED = [
    (3, "5.153654890060D+03", "2.153654890060D+03", "sqrt_a = 2153.65, expected 5000 to 5600"),
    (3, "5.153654890060D+03", "               nan", "field not a number"),
    (3, "5.153654890060D+03", "******************", "field not a number"),
    (3, "5.153654890060D+03", "5.15365489006D+999", "field not a number"),
    (3, "5.153654890060D+03", "5.1536_4890060D+03", "field not a number"),
    (3, "5.153654890060D+03", " " * 18, "a parameter is not a number"),
    (3, "6.267404183750D-03", "6.267404183750D-01", "e = 0.62674, expected 0 to 0.2"),
    (2, "9.100000000000D+01", " " * 18, "field missing"),
    (2, "9.100000000000D+01", "9.150000000000D+01", "reference time, issue or health out of range"),
    (4, "4.099040000000D+05", "7.099040000000D+05", "reference time, issue or health out of range"),
    (4, "4.099040000000D+05", "2.099040000000D+05", "clock and orbit reference times are more than a day apart"),
    (7, "0.000000000000D+00", "5.000000000000D-01", "reference time, issue or health out of range"),
    (1, " 99 09 02", " 99 09 31", "epoch not readable"),
]


@pytest.mark.parametrize(("line", "old", "new", "reason"), DROPPED)
def test_a_record_that_cannot_be_right_is_dropped_with_its_reason(tmp_path: Path, line: int, old: str, new: str, reason: str) -> None:
    damaged = GPS_2.splitlines(keepends=True)
    assert old in damaged[line - 1]
    damaged[line - 1] = damaged[line - 1].replace(old, new, 1)
    file = read(tmp_path, HEADER_2 + "".join(damaged) + GPS_2.replace(" 6", " 7", 1))
    assert [eph.satellite for eph in file.ephemerides] == ["G07"]
    assert file.problems == {reason: 1}


@pytest.mark.parametrize("kept", [4, 5])
def test_number_cut_by_the_end_of_the_file(tmp_path: Path, kept: int) -> None:
    """Of `4.068000000000D+05`, what is left would read as a time."""
    file = read(tmp_path, HEADER_2 + GPS_2[: GPS_2.index("4.068000000000D+05") + kept])
    assert file.ephemerides == ()
    assert file.problems == {"field not a number": 1}


@pytest.mark.parametrize(("whole", "lines"), [(GPS_3, 8), (GLONASS, 4), (SBAS, 4), (INAV, 8)])
def test_record_cut_by_the_end_of_the_file(tmp_path: Path, whole: str, lines: int) -> None:
    file = read(tmp_path, HEADER_3 + whole + "".join(whole.splitlines(keepends=True)[: lines - 1]))
    assert len(file.ephemerides) == 1
    assert file.problems == {"record cut off": 1}


def test_truncated_gzip_gives_the_records_so_far(tmp_path: Path) -> None:
    records = "".join(GPS_2.replace("397", f"{k:03d}").replace("340", f"{k * 7 % 1000:03d}") for k in range(200))
    whole = gzip.compress((HEADER_2 + records).encode())
    file = read(tmp_path, whole[: len(whole) * 3 // 4])
    assert 0 < len(file.ephemerides) < 200
    assert file.problems.pop("file cut off") == 1
    assert set(file.problems) <= {"record cut off"}


@pytest.mark.parametrize("whole", [GPS_3, GLONASS, SBAS])
def test_record_with_a_line_too_many_is_dropped(tmp_path: Path, whole: str) -> None:
    """Its numbers could stand for others than the line says."""
    first, second = whole.splitlines(keepends=True)[:2]
    file = read(tmp_path, HEADER_3 + whole.replace(first, first + second) + whole)
    assert len(file.ephemerides) == 1
    assert file.problems == {"record longer than it should be": 1}


@pytest.mark.parametrize("whole", [GPS_3, GLONASS, SBAS])
def test_record_whose_first_line_is_damaged_costs_no_other(tmp_path: Path, whole: str) -> None:
    file = read(tmp_path, HEADER_3 + whole + "?" + whole[1:] + whole)
    assert len(file.ephemerides) == 2
    assert file.problems == {"record longer than it should be": 1}


def test_what_stands_before_the_first_record_is_counted(tmp_path: Path) -> None:
    file = read(tmp_path, HEADER_3 + GPS_3.split("\n", 1)[1] + GPS_3)
    assert len(file.ephemerides) == 1
    assert file.problems == {"line outside a record": 7}


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "empty file"),
        ((HEADER_2 + GPS_2).replace("N: GPS NAV DATA ", "OBSERVATION DATA"), "navigation data"),
        ((HEADER_3 + GPS_3).replace("3.04", "5.00"), "'5.00'"),
        ((HEADER_3 + GLONASS).replace("N: GNSS NAV DATA", "G: GLONASS DATA "), "'3.04'"),
        (HEADER_2.replace("END OF HEADER", "COMMENT"), "END OF HEADER"),
    ],
)
def test_files_that_cannot_be_read_are_refused(tmp_path: Path, text: str, words: str) -> None:
    with pytest.raises(DecodeError, match=words):
        read(tmp_path, text)
