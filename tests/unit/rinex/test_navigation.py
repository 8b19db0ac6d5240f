"""Navigation files: the GPS record is the example of the format itself (RINEX 2.11, table A8), the others are variations of it."""

import gzip
from pathlib import Path

import pytest

from integrity.errors import DecodeError
from integrity.gnss.gps_time import NS_PER_S, gps_from_week
from recordings.rinex.navigation import NavigationFile, read_navigation


def header(content: str, label: str) -> str:
    return f"{content:<60}{label}\n"


HEADER_2 = (
    header("     2.10           N: GPS NAV DATA", "RINEX VERSION / TYPE")
    + header("     .1676D-07   .2235D-07  -.1192D-06  -.1192D-06", "ION ALPHA")
    + header("     .1208D+06   .1310D+06  -.1310D+06  -.1966D+06", "ION BETA")
    + header("    13", "LEAP SECONDS")
    + header("", "END OF HEADER")
)
START_2 = " 6 99  9  2 17 51 44.0 -.839701388031D-03 -.165982783074D-10  .000000000000D+00\n"
ORBIT_2 = """\
     .910000000000D+02  .934062500000D+02  .116040547840D-08  .162092304801D+00
     .484101474285D-05  .626740418375D-02  .652112066746D-05  .515365489006D+04
     .409904000000D+06 -.242143869400D-07  .329237003460D+00 -.596046447754D-07
     .111541663136D+01  .326593750000D+03  .206958726335D+01 -.638312302555D-08
     .307155651409D-09  .000000000000D+00  .102500000000D+04  .000000000000D+00
     .200000000000D+01  .000000000000D+00 -.990000000000D-08  .910000000000D+02
     .406800000000D+06  .000000000000D+00
"""
TOE_NS = gps_from_week(1025, 409_904.0)  # as the record itself says: week 1025, second 409904

HEADER_3 = (
    header("     3.05           N: GNSS NAV DATA    M: MIXED", "RINEX VERSION / TYPE")
    + header("GPSA    .1676D-07   .2235D-07  -.1192D-06  -.1192D-06", "IONOSPHERIC CORR")
    + header("GPSB    .1208D+06   .1310D+06  -.1310D+06  -.1966D+06", "IONOSPHERIC CORR")
    + header("    18    19  2185     7", "LEAP SECONDS")
    + header("", "END OF HEADER")
)
GPS_3 = "G06 1999 09 02 17 51 44" + START_2[22:] + ORBIT_2.replace("     ", "      ")
GALILEO_3 = (
    GPS_3.replace("G06", "E06")
    .replace(".000000000000D+00  .102500000000D+04", ".517000000000D+03  .102500000000D+04")  # data sources: I/NAV, both signals
    .replace(".200000000000D+01  .000000000000D+00 -.990000000000D-08", ".312000000000D+01  .000000000000D+00 -.880000000000D-08")
    .replace("-.880000000000D-08  .910000000000D+02", "-.880000000000D-08 -.770000000000D-08")  # BGD to E5a, BGD to E5b
)
GLONASS_3 = "R01 1999 09 02 17 45 00" + START_2[22:] + "".join(ORBIT_2.replace("     ", "      ").splitlines(keepends=True)[:4])


def read(tmp_path: Path, text: str | bytes) -> NavigationFile:
    path = tmp_path / "site.nav"
    path.write_bytes(text if isinstance(text, bytes) else text.encode("latin-1"))
    return read_navigation(path)


def test_rinex2_header(tmp_path: Path) -> None:
    file = read(tmp_path, HEADER_2 + START_2 + ORBIT_2)
    assert (file.version, file.leap_seconds, file.problems) == (2.10, 13, {})
    assert file.klobuchar is not None
    assert file.klobuchar.alpha == (0.1676e-7, 0.2235e-7, -0.1192e-6, -0.1192e-6)
    assert file.klobuchar.beta == (0.1208e6, 0.1310e6, -0.1310e6, -0.1966e6)


@pytest.mark.parametrize("text", [HEADER_2 + START_2 + ORBIT_2, HEADER_3 + GPS_3], ids=["RINEX 2", "RINEX 3"])
def test_gps_record(tmp_path: Path, text: str) -> None:
    (eph,) = read(tmp_path, text).ephemerides
    assert (eph.satellite, eph.issue, eph.healthy, eph.accuracy_m, eph.fit_half_s) == ("G06", 91, True, 2.4, 7200.0)
    assert (eph.toe_ns, eph.toc_ns) == (TOE_NS, TOE_NS)
    assert eph.transmission_ns == gps_from_week(1025, 406_800.0)
    assert (eph.af0, eph.af1, eph.af2, eph.group_delay_s) == (-0.839701388031e-3, -0.165982783074e-10, 0.0, -0.99e-8)
    assert (eph.sqrt_a, eph.e, eph.m0, eph.delta_n) == (0.515365489006e4, 0.626740418375e-2, 0.162092304801, 0.116040547840e-8)
    assert (eph.i0, eph.i_dot, eph.omega) == (0.111541663136e1, 0.307155651409e-9, 0.206958726335e1)
    assert (eph.omega0, eph.omega_dot) == (0.329237003460, -0.638312302555e-8)
    assert (eph.cuc, eph.cus, eph.crc, eph.crs) == (0.484101474285e-5, 0.652112066746e-5, 0.326593750000e3, 0.934062500000e2)
    assert (eph.cic, eph.cis) == (-0.242143869400e-7, -0.596046447754e-7)


def test_rinex3_header(tmp_path: Path) -> None:
    file = read(tmp_path, HEADER_3 + GPS_3)
    assert (file.version, file.leap_seconds) == (3.05, 18)
    assert file.klobuchar is not None
    assert file.klobuchar.alpha[3] == -0.1192e-6
    assert file.klobuchar.beta[3] == -0.1966e6


def test_half_of_the_ionosphere_is_none(tmp_path: Path) -> None:
    assert read(tmp_path, HEADER_2.replace("ION BETA", "COMMENT ") + START_2 + ORBIT_2).klobuchar is None


def test_galileo_inav_record(tmp_path: Path) -> None:
    (eph,) = read(tmp_path, HEADER_3 + GALILEO_3).ephemerides
    assert (eph.satellite, eph.healthy, eph.accuracy_m, eph.fit_half_s) == ("E06", True, 3.12, 14_400.0)
    assert (eph.toe_ns, eph.group_delay_s) == (TOE_NS, -0.77e-8)


@pytest.mark.parametrize(("sources", "used"), [("513", True), ("516", True), ("517", True), ("258", False)])
def test_galileo_fnav_is_not_used(tmp_path: Path, sources: str, used: bool) -> None:
    file = read(tmp_path, HEADER_3 + GALILEO_3.replace(".517000000000D+03", f".{sources}000000000D+03"))
    assert len(file.ephemerides) == used
    assert file.problems == ({} if used else {"Galileo F/NAV, not used for E1": 1})


@pytest.mark.parametrize(("health", "healthy"), [(0, True), (1, False), (2, False), (4, False), (8, True), (504, True)])
def test_galileo_health_is_that_of_e1b(tmp_path: Path, health: int, healthy: bool) -> None:
    text = GALILEO_3.replace(".312000000000D+01  .000000000000D+00", f".312000000000D+01  .{health:03d}000000000D+03")
    assert read(tmp_path, HEADER_3 + text).ephemerides[0].healthy is healthy


@pytest.mark.parametrize(("sisa", "accuracy_m"), [("0.000000000000D+00", 0.0), ("1.070000000000D+00", 1.07), ("1.000000000000D+00", 1.0)])
def test_galileo_accuracy_is_taken_as_it_stands(tmp_path: Path, sisa: str, accuracy_m: float) -> None:
    assert read(tmp_path, HEADER_3 + GALILEO_3.replace(" .312000000000D+01", f" {sisa}"[-18:])).ephemerides[0].accuracy_m == accuracy_m


def test_galileo_without_accuracy_prediction(tmp_path: Path) -> None:
    assert read(tmp_path, HEADER_3 + GALILEO_3.replace(" .312000000000D+01", "-.100000000000D+01")).ephemerides[0].accuracy_m is None


@pytest.mark.parametrize("health", [1, 31, 32, 63])
def test_gps_health_other_than_zero_is_unhealthy(tmp_path: Path, health: int) -> None:
    orbit = ORBIT_2.replace(".200000000000D+01  .000000000000D+00", f".200000000000D+01  .{health:02d}0000000000D+02")
    assert read(tmp_path, HEADER_2 + START_2 + orbit).ephemerides[0].healthy is False


@pytest.mark.parametrize(
    ("written_m", "accuracy_m"),
    # Nominal values and upper bounds of IS-GPS-200, 20.3.3.3.1.3: both mean the index, whose upper bound we keep.
    [
        (0.0, 2.4), (2.0, 2.4), (2.4, 2.4), (2.8, 3.4), (3.4, 3.4), (4.0, 4.85), (4.85, 4.85), (5.7, 6.85), (8.0, 9.65), (11.3, 13.65),
        (16.0, 24.0), (24.0, 24.0), (32.0, 48.0), (64.0, 96.0), (96.0, 96.0), (4096.0, 6144.0), (6144.0, 6144.0), (6144.1, None),
        (8192.0, None), (-1.0, None),
    ],
)  # fmt: skip
def test_gps_accuracy_is_the_upper_bound_of_its_index(tmp_path: Path, written_m: float, accuracy_m: float | None) -> None:
    orbit = ORBIT_2.replace(" .200000000000D+01", f"{written_m:18.10E}")
    assert read(tmp_path, HEADER_2 + START_2 + orbit).ephemerides[0].accuracy_m == accuracy_m


@pytest.mark.parametrize(
    ("fit_h", "fit_half_s"), [(" .0", 7200.0), (" .4", 7200.0), (" .1", 10_800.0), (" .6", 10_800.0), (" .8", 14_400.0), ("   ", 7200.0)]
)
def test_gps_fit_interval_in_hours_or_as_flag_or_not_at_all(tmp_path: Path, fit_h: str, fit_half_s: float) -> None:
    field = f"{fit_h}00000000000D+01" if fit_h.strip() else ""
    orbit = ORBIT_2.replace(".406800000000D+06  .000000000000D+00", f".406800000000D+06 {field}")
    assert read(tmp_path, HEADER_2 + START_2 + orbit).ephemerides[0].fit_half_s == fit_half_s


@pytest.mark.parametrize(
    ("written", "seconds_before_toe"),
    [
        (" .406800000000D+06", 3104),
        (" .411000000000D+06", -1096),  # Galileo sends a set hours after its reference time
        ("-.198000000000D+06", 3104),  # counted back from the end of the week: 406800 - 604800
        (" .101160000000D+07", 3104),  # counted on from the week before
        (" .999900000000D+09", 7200),  # RINEX 2.11, 6.8: unknown
        (" .300000000000D+06", 7200),  # more than a day away
        (" " * 18, 7200),
    ],
)
def test_transmission_time_belongs_to_the_week_nearest_to_toe(tmp_path: Path, written: str, seconds_before_toe: int) -> None:
    (eph,) = read(tmp_path, HEADER_2 + START_2 + ORBIT_2.replace(" .406800000000D+06", written)).ephemerides
    assert eph.toe_ns - eph.transmission_ns == seconds_before_toe * NS_PER_S


def test_transmission_before_midnight_of_a_toe_in_the_new_week(tmp_path: Path) -> None:
    orbit = ORBIT_2.replace(".409904000000D+06", ".000000000000D+00").replace(".406800000000D+06", ".597600000000D+06")
    (eph,) = read(tmp_path, HEADER_2 + START_2.replace(" 2 17 51 44.0", " 5  0  0  0.0") + orbit).ephemerides
    assert eph.toe_ns == gps_from_week(1026, 0.0)
    assert eph.transmission_ns == gps_from_week(1025, 597_600.0)


def test_clock_reference_time_to_a_tenth_of_a_second(tmp_path: Path) -> None:
    (eph,) = read(tmp_path, HEADER_2 + START_2.replace("51 44.0", "51 44.3") + ORBIT_2).ephemerides
    assert eph.toc_ns == TOE_NS + 300_000_000


def test_reference_time_in_the_week_after_that_of_the_clock(tmp_path: Path) -> None:
    orbit = ORBIT_2.replace(".409904000000D+06", ".720000000000D+04").replace(".102500000000D+04", ".102600000000D+04")
    (eph,) = read(tmp_path, HEADER_2 + START_2.replace(" 2 17 51 44.0", " 4 23  0  0.0") + orbit).ephemerides
    assert eph.toe_ns == gps_from_week(1026, 7200.0)


@pytest.mark.parametrize("week", [".100000000000D+01", ".000000000000D+00", " " * 17])
def test_absurd_week_is_taken_from_the_epoch(tmp_path: Path, week: str) -> None:
    (eph,) = read(tmp_path, HEADER_2 + START_2 + ORBIT_2.replace(".102500000000D+04", week)).ephemerides
    assert eph.toe_ns == TOE_NS


def test_missing_trailing_fields(tmp_path: Path) -> None:
    """The last line may end after any field, and the spare ones may be there."""
    spare = ORBIT_2.removesuffix("\n") + "  .000000000000D+00" * 2 + "\n"
    file = read(tmp_path, HEADER_2 + START_2 + ORBIT_2.replace("D+06  .000000000000D+00\n", "D+06\n") + START_2 + spare)
    assert len(file.ephemerides) == 2
    assert file.problems == {}


def test_other_systems_are_passed_over_whatever_their_length(tmp_path: Path) -> None:
    longer = GLONASS_3.replace("R01", "R02") + "      .000000000000D+00\n"
    file = read(tmp_path, HEADER_3 + GLONASS_3 + GPS_3 + longer + GPS_3.replace("G06", "C06") + GALILEO_3)
    assert [eph.satellite for eph in file.ephemerides] == ["G06", "E06"]
    assert file.problems == {}


@pytest.mark.parametrize(
    ("old", "new", "reason"),
    [
        (".515365489006D+04", ".215365489006D+04", "sqrt_a = 2153.65, expected 5000 to 5600"),
        (".626740418375D-02", ".626740418375D+00", "e = 0.62674, expected 0 to 0.1"),
        (".515365489006D+04", "              nan", "field not a number"),
        (".515365489006D+04", "*****************", "field not a number"),
        (".515365489006D+04", ".51536548900D+999", "field not a number"),
        (".515365489006D+04", ".5153654890D+9999", "field not a number"),
        (".515365489006D+04", " " * 17, "a parameter is not a number"),
        (".910000000000D+02  .93", "                   .93", "field missing"),
        (".910000000000D+02  .93", ".915000000000D+02  .93", "reference time, issue or health out of range"),
        (".409904000000D+06", ".709904000000D+06", "reference time, issue or health out of range"),
        (".409904000000D+06", ".209904000000D+06", "clock and orbit reference times are more than a day apart"),
        (" 99  9  2", " 99  9 31", "epoch not readable"),
    ],
)
def test_a_record_that_cannot_be_right_is_dropped_with_its_reason(tmp_path: Path, old: str, new: str, reason: str) -> None:
    record = START_2 + ORBIT_2
    assert old in record
    file = read(tmp_path, HEADER_2 + record.replace(old, new) + START_2.replace(" 6", " 7", 1) + ORBIT_2)
    assert [eph.satellite for eph in file.ephemerides] == ["G07"]
    assert file.problems == {reason: 1}


@pytest.mark.parametrize("kept", [4, 5])
def test_number_cut_by_the_end_of_the_file(tmp_path: Path, kept: int) -> None:
    """Of `.406800000000D+06`, what is left would read as a time."""
    cut = ORBIT_2[: ORBIT_2.index(".406800000000D+06") + kept]
    file = read(tmp_path, HEADER_2 + START_2 + cut)
    assert file.ephemerides == ()
    assert file.problems == {"field not a number": 1}


def test_record_cut_by_the_end_of_the_file(tmp_path: Path) -> None:
    file = read(tmp_path, HEADER_2 + START_2 + ORBIT_2 + START_2 + "".join(ORBIT_2.splitlines(keepends=True)[:6]))
    assert len(file.ephemerides) == 1
    assert file.problems == {"record cut off": 1}


def test_truncated_gzip_gives_the_records_so_far(tmp_path: Path) -> None:
    records = "".join(START_2.replace("397", f"{k:03d}") + ORBIT_2.replace("340", f"{k * 7 % 1000:03d}") for k in range(200))
    whole = gzip.compress((HEADER_2 + records).encode())
    file = read(tmp_path, whole[: len(whole) * 3 // 4])
    assert 0 < len(file.ephemerides) < 200
    assert file.problems.pop("file cut off") == 1
    assert set(file.problems) <= {"record cut off"}


def test_record_with_a_line_too_many_is_dropped(tmp_path: Path) -> None:
    """Its numbers could stand for others than the line says."""
    first = ORBIT_2.splitlines(keepends=True)[0]
    file = read(tmp_path, HEADER_2 + START_2 + first + ORBIT_2 + START_2 + ORBIT_2)
    assert len(file.ephemerides) == 1
    assert file.problems == {"record longer than it should be": 1}


def test_record_whose_first_line_is_damaged_costs_no_other(tmp_path: Path) -> None:
    file = read(tmp_path, HEADER_2 + START_2 + ORBIT_2 + START_2.replace("99", "?9") + ORBIT_2 + START_2 + ORBIT_2)
    assert len(file.ephemerides) == 2
    assert file.problems == {"record longer than it should be": 1}


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "empty file"),
        ((HEADER_2 + START_2).replace("N: GPS NAV DATA ", "OBSERVATION DATA"), "navigation data"),
        ((HEADER_3 + GPS_3).replace("3.05", "4.00"), "'4.00'"),
        (HEADER_2.replace("END OF HEADER", "COMMENT"), "END OF HEADER"),
    ],
)
def test_files_that_cannot_be_read_are_refused(tmp_path: Path, text: str, words: str) -> None:
    with pytest.raises(DecodeError, match=words):
        read(tmp_path, text)
