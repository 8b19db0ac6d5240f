"""Observation files written here line by line after RINEX 2.11, table A7, and RINEX 3.05, table A4; times by week and second of week."""

import gzip
from pathlib import Path

import numpy as np
import pytest

from integrity.errors import DecodeError
from integrity.gnss.gps_time import NS_PER_S, gps_from_week
from recordings.rinex.observation import ObservationFile, read_observations

THURSDAY_NS = gps_from_week(1575, 345_600.0)  # 2010-03-18T00:00:00 GPS, as the broadcast ephemerides of that day number it


def header(content: str, label: str) -> str:
    return f"{content:<60}{label}\n"


def field(number: str, indicators: str = "  ") -> str:
    """F14.3 and the two digits after it: loss of lock, signal strength."""
    return f"{number:>14}{indicators}"


HEADER_2 = (
    header("     2.11           OBSERVATION DATA    M (MIXED)", "RINEX VERSION / TYPE")
    + header("PTS1", "MARKER NAME")
    + header("  4789013.0077   176610.1555  4195034.8091", "APPROX POSITION XYZ")
    + header("     6    L1    C1    P1    D1    S1    P2", "# / TYPES OF OBSERV")
    + header("    30.0000", "INTERVAL")
    + header("  2010     3    18     0     0    0.0000000     GPS", "TIME OF FIRST OBS")
    + header("    15", "LEAP SECONDS")
    + header("", "END OF HEADER")
)
EPOCH_2 = f"{' 10  3 18  0  0  0.0000000  0  2G 5R12':68} -.123456789\n"
G05_2 = (
    field("-1000.123", "16")
    + field("21000000.123", " 7")
    + field("21000000.456")
    + field("900.250")
    + field("45.500")
    + "\n"
    + field("21000003.789")
    + "\n"
)
R12_2 = field("2000.000", "06") + field("20000000.000") + "\n\n"

HEADER_3 = (
    header("     3.05           OBSERVATION DATA    M", "RINEX VERSION / TYPE")
    + header("PTS2", "MARKER NAME")
    + header("G    5 C1C L1C D1C S1C C5Q", "SYS / # / OBS TYPES")
    + header("E   14 C5Q L5Q D5Q S5Q C6C L6C D6C S6C C7Q L7Q D7Q S7Q C1X", "SYS / # / OBS TYPES")
    + header("       S1X", "SYS / # / OBS TYPES")
    + header("R    1 C1C", "SYS / # / OBS TYPES")
    + header("  2010     3    18     0     0    0.0000000     GPS", "TIME OF FIRST OBS")
    + header("", "END OF HEADER")
)
G05_3 = "G05" + field("21000000.123", " 7") + field("-1000.123", "26") + field("900.250") + field("45.500") + field("21000009.000") + "\n"
E11_3 = "E11" + " " * 16 * 12 + field("25000000.500") + field("38.250").rstrip() + "\n"
SIGNALS_3 = ("E11.1X", "G05.1C", "G05.5Q")
EPOCH_3 = "> 2010 03 18 00 00  0.0000000  0  2\n" + G05_3 + E11_3


def read(tmp_path: Path, text: str | bytes) -> ObservationFile:
    path = tmp_path / "site.obs"
    path.write_bytes(text if isinstance(text, bytes) else text.encode("latin-1"))
    return read_observations(path, "A")


def epoch_2(second: str, satellites: str, records: str, flag: int = 0) -> str:
    return f" 10  3 18  0  0{second}  {flag}{len(satellites) // 3:3d}{satellites[:36]}\n{records}"


def refusal(tmp_path: Path, text: str | bytes) -> str:
    with pytest.raises(DecodeError) as caught:
        read(tmp_path, text)
    return str(caught.value)


def test_rinex2_header(tmp_path: Path) -> None:
    file = read(tmp_path, HEADER_2 + EPOCH_2 + G05_2 + R12_2)
    assert (file.version, file.marker, file.interval_s, file.leap_seconds) == (2.11, "PTS1", 30.0, 15)
    assert file.approx_position_ecef_m == (4789013.0077, 176610.1555, 4195034.8091)


@pytest.mark.parametrize("interval", ["    0.0000", "     often"])
def test_header_without_a_usable_interval(tmp_path: Path, interval: str) -> None:
    assert read(tmp_path, HEADER_2.replace("   30.0000", interval) + EPOCH_2 + G05_2 + R12_2).interval_s is None


def test_position_of_zeros_is_none(tmp_path: Path) -> None:
    text = HEADER_2.replace("  4789013.0077   176610.1555  4195034.8091", f"{0.0:14.4f}" * 3)
    assert read(tmp_path, text + EPOCH_2 + G05_2 + R12_2).approx_position_ecef_m is None


def test_unreadable_header_field_is_counted(tmp_path: Path) -> None:
    assert read(tmp_path, HEADER_2.replace("    15", "    xv") + EPOCH_2 + G05_2 + R12_2).problems == {"LEAP SECONDS not readable": 1}


def test_rinex2_types_are_signals_of_each_system_with_their_quantities(tmp_path: Path) -> None:
    (row,) = read(tmp_path, HEADER_2 + EPOCH_2 + G05_2 + R12_2).rows
    assert (row.receiver, row.receive_time_ns, row.signals) == ("A", THURSDAY_NS, ("G05.1C", "G05.1W", "G05.2W", "R12.1C"))
    np.testing.assert_array_equal(row.pseudorange_m, [21_000_000.123, 21_000_000.456, 21_000_003.789, 20_000_000.0])
    np.testing.assert_array_equal(row.carrier_cycles, [-1000.123, np.nan, np.nan, 2000.0])
    np.testing.assert_array_equal(row.doppler_hz, [900.25, np.nan, np.nan, np.nan])
    np.testing.assert_array_equal(row.cn0_dbhz, [45.5, np.nan, np.nan, np.nan])
    np.testing.assert_array_equal(row.lock_s, [np.nan] * 4)


@pytest.mark.parametrize(
    ("indicator", "slip", "half_cycle"), [(" ", 0, 0), ("0", 0, 0), ("1", 1, 0), ("2", 0, 1), ("3", 1, 1), ("4", 0, 0)]
)
def test_loss_of_lock_indicator(tmp_path: Path, indicator: str, slip: int, half_cycle: int) -> None:
    (row,) = read(tmp_path, HEADER_2 + EPOCH_2 + G05_2.replace("-1000.1231", f"-1000.123{indicator}") + R12_2).rows
    assert (row.slip[0], row.half_cycle[0]) == (slip, half_cycle)


def test_rinex2_thirteen_satellites_continue_on_a_second_line(tmp_path: Path) -> None:
    names = [f"G{k:2d}" for k in range(1, 14)]
    line = f" 10  3 18  0  0  0.0000000  0 13{''.join(names[:12])}\n{'':32}{names[12]}\n"
    records = "".join(f"{'':16}  {21_000_000 + k}.000\n\n" for k in range(1, 14))
    file = read(tmp_path, HEADER_2 + line + records)
    assert file.problems == {}
    assert file.rows[0].signals == tuple(f"G{k:02d}.1C" for k in range(1, 14))
    assert file.rows[0].pseudorange_m[-1] == 21_000_013.0


@pytest.mark.parametrize(("system", "signal"), [(" ", "G05.1C"), ("G", "G05.1C"), ("E", "E05.1C"), ("M", "G05.1C")])
def test_rinex2_blank_system_letter_is_that_of_the_file(tmp_path: Path, system: str, signal: str) -> None:
    text = (HEADER_2 + EPOCH_2 + G05_2 + R12_2).replace("M (MIXED)", f"{system} (OTHER)").replace("G 5R12", "  5R12")
    assert read(tmp_path, text).rows[0].signals[0] == signal


@pytest.mark.parametrize(("year", "week"), [("80", 0), ("99", 991), ("00", 1043), ("79", 5165)])
def test_rinex2_two_digit_years(tmp_path: Path, year: str, week: int) -> None:
    # Sundays. The 1024 weeks after 1980-01-06 ended on 1999-08-21; the others follow by counting days.
    day = {"80": " 1  6", "99": " 1  3", "00": " 1  2", "79": " 1  1"}[year]
    (row,) = read(tmp_path, HEADER_2 + EPOCH_2.replace("10  3 18", f"{year} {day}") + G05_2 + R12_2).rows
    assert row.receive_time_ns == gps_from_week(week, 0.0)


def test_rinex3_signals_in_order_of_satellites_and_preference(tmp_path: Path) -> None:
    file = read(tmp_path, HEADER_3 + EPOCH_3)
    (row,) = file.rows
    assert file.problems == {}
    assert (row.receive_time_ns, row.signals) == (THURSDAY_NS, SIGNALS_3)
    np.testing.assert_array_equal(row.pseudorange_m, [25_000_000.5, 21_000_000.123, 21_000_009.0])
    np.testing.assert_array_equal(row.carrier_cycles, [np.nan, -1000.123, np.nan])
    np.testing.assert_array_equal(row.doppler_hz, [np.nan, 900.25, np.nan])
    np.testing.assert_array_equal(row.cn0_dbhz, [38.25, 45.5, np.nan])
    np.testing.assert_array_equal(row.half_cycle, [False, True, False])


@pytest.mark.parametrize("version", ["4.00", "4.01", "4.02"])
def test_rinex4_observations_read_like_rinex3(tmp_path: Path, version: str) -> None:
    assert read(tmp_path, (HEADER_3 + EPOCH_3).replace("3.05", version)).rows[0].signals == SIGNALS_3


@pytest.mark.parametrize(("written", "ns"), [("  0.0000001", 100), (" 59.9999999", 59_999_999_900), (" 12.3456789", 12_345_678_900)])
def test_seconds_are_exact_to_100_ns(tmp_path: Path, written: str, ns: int) -> None:
    (row,) = read(tmp_path, HEADER_3 + EPOCH_3.replace("  0.0000000", written, 1)).rows
    assert row.receive_time_ns == THURSDAY_NS + ns


def test_blank_and_zero_pseudoranges_are_not_measured(tmp_path: Path) -> None:
    blank, zero = G05_3.replace("  21000000.123 7", " " * 16), G05_3.replace("21000000.123", "       0.000").replace("G05", "G06")
    file = read(tmp_path, HEADER_3 + EPOCH_3.replace(G05_3 + E11_3, blank + zero))
    assert file.rows[0].signals == ("G05.5Q", "G06.5Q")
    assert file.problems == {}


@pytest.mark.parametrize("damage", ["         nan", "         inf", "************", "21_00000.123", "2100000.1234", "21000000 123"])
def test_a_field_that_is_no_number_is_missing_and_counted(tmp_path: Path, damage: str) -> None:
    file = read(tmp_path, HEADER_3 + EPOCH_3.replace("21000000.123", damage))
    assert file.rows[0].signals == ("E11.1X", "G05.5Q")
    assert file.problems == {"field not a number": 1}


def test_a_field_with_a_digit_lost_is_not_taken_for_a_smaller_number(tmp_path: Path) -> None:
    file = read(tmp_path, HEADER_3 + EPOCH_3.replace("38.250\n", "8.250\n"))
    assert np.isnan(file.rows[0].cn0_dbhz[0])
    assert file.problems == {"field not a number": 1}


def test_a_pseudorange_cut_by_the_end_of_the_file_is_not_taken_for_a_shorter_number(tmp_path: Path) -> None:
    file = read(tmp_path, (HEADER_3 + EPOCH_3).removesuffix("0          38.250\n"))
    assert file.rows[0].signals == ("G05.1C", "G05.5Q")
    assert file.problems == {"field not a number": 1}


@pytest.mark.parametrize(
    ("pseudorange", "kept"), [(" 9999999.999", False), ("10000000.000", True), ("100000000.000", True), ("100000000.001", False)]
)
def test_pseudoranges_outside_any_orbit_are_dropped_and_counted(tmp_path: Path, pseudorange: str, kept: bool) -> None:
    file = read(tmp_path, HEADER_3 + EPOCH_3.replace("  21000000.123", pseudorange.rjust(14)))
    assert ("G05.1C" in file.rows[0].signals) is kept
    assert file.problems == ({} if kept else {"absurd pseudorange": 1})


@pytest.mark.parametrize(("cn0", "kept"), [("70.000", True), ("70.001", False), ("-0.001", False)])
def test_absurd_signal_strength_is_missing_and_counted(tmp_path: Path, cn0: str, kept: bool) -> None:
    file = read(tmp_path, HEADER_3 + EPOCH_3.replace("45.500", cn0))
    assert np.isfinite(file.rows[0].cn0_dbhz[1]) == kept
    assert file.problems == ({} if kept else {"absurd C/N0": 1})


def test_power_failure_marks_every_signal_as_slipped(tmp_path: Path) -> None:
    (row,) = read(tmp_path, HEADER_3 + EPOCH_3.replace("  0  2", "  1  2")).rows
    assert row.slip.all()


def test_special_records_and_cycle_slips_are_skipped(tmp_path: Path) -> None:
    events = f"{'':28}4  1\n" + header("1234.1.2 > spliced", "COMMENT") + " 10  3 18  0  0 10.0000000  2  0\n" + f"{'':28}3  1\nNEW SITE\n"
    slips = epoch_2(" 20.0000000", "G05", G05_2, flag=6)
    file = read(tmp_path, HEADER_2 + EPOCH_2 + G05_2 + R12_2 + events + slips + epoch_2(" 30.0000000", "G05", G05_2))
    assert [row.receive_time_ns - THURSDAY_NS for row in file.rows] == [0, 30 * NS_PER_S]
    assert file.problems == {}


def test_rinex2_event_may_change_the_observation_types(tmp_path: Path) -> None:
    event = f"{'':28}4  1\n" + header("     1    C1", "# / TYPES OF OBSERV")
    file = read(tmp_path, HEADER_2 + EPOCH_2 + G05_2 + R12_2 + event + epoch_2(" 30.0000000", "G05", "  22000000.000\n"))
    assert file.problems == {}
    assert file.rows[1].pseudorange_m.tolist() == [22_000_000.0]


def test_rinex3_event_may_change_the_observation_types_of_one_system(tmp_path: Path) -> None:
    event = f">{'':30}4  1\n" + header("G    2 C5Q C1C", "SYS / # / OBS TYPES")
    again = "> 2010 03 18 00 00 30.0000000  0  2\nG05" + field("") + field("22000000.000") + "\n" + E11_3
    file = read(tmp_path, HEADER_3 + EPOCH_3 + event + again)
    assert file.problems == {}
    assert [row.signals for row in file.rows] == [SIGNALS_3, ("E11.1X", "G05.1C")]


def test_epoch_cut_by_the_end_of_the_file_is_dropped_and_counted(tmp_path: Path) -> None:
    file = read(tmp_path, HEADER_3 + EPOCH_3 + EPOCH_3.removesuffix(E11_3))
    assert len(file.rows) == 1
    assert file.problems == {"epoch cut off": 1}


def test_truncated_gzip_gives_the_lines_so_far(tmp_path: Path) -> None:
    epochs = [EPOCH_3.replace("  0.0000000", f" {k:2d}.0000000", 1).replace("0.123", f"0.{(k * 7919) % 1000:03d}") for k in range(60)]
    whole = gzip.compress((HEADER_3 + "".join(epochs)).encode())
    file = read(tmp_path, whole[: len(whole) * 3 // 4])
    assert 0 < len(file.rows) < 60
    assert file.problems.pop("file cut off") == 1
    assert set(file.problems) <= {"epoch cut off"}


def test_gzip_of_several_members_reads_as_one_file(tmp_path: Path) -> None:
    assert len(read(tmp_path, gzip.compress(HEADER_3.encode()) + gzip.compress(EPOCH_3.encode())).rows) == 1


def test_unreadable_epoch_line_costs_one_epoch(tmp_path: Path) -> None:
    third = EPOCH_3.replace("  0.0000000", " 30.0000000", 1)
    file = read(tmp_path, HEADER_3 + EPOCH_3 + EPOCH_3.replace("> 2010", "> 2o10") + third)
    assert [row.receive_time_ns - THURSDAY_NS for row in file.rows] == [0, 30 * NS_PER_S]
    assert file.problems == {"epoch line not readable": 1}


@pytest.mark.parametrize(("year", "rows"), [("1979", 0), ("1981", 1), ("2079", 1), ("2080", 0)])
def test_years_that_no_receiver_can_have_measured_in(tmp_path: Path, year: str, rows: int) -> None:
    assert len(read(tmp_path, HEADER_3 + EPOCH_3.replace("2010", year)).rows) == rows


@pytest.mark.parametrize("time", [" 02 30 00 00  0.0", " 03 18 24 00  0.0", " 03 18 00 60  0.0", " 03 18 00 00 60.0", " 03 18 00 00100.0"])
def test_impossible_time_costs_one_epoch(tmp_path: Path, time: str) -> None:
    file = read(tmp_path, HEADER_3 + EPOCH_3.replace(" 03 18 00 00  0.0", time) + EPOCH_3)
    assert len(file.rows) == 1
    assert file.problems == {"epoch time not readable": 1}


def test_rinex2_epoch_with_a_line_missing_is_dropped(tmp_path: Path) -> None:
    """Its records could belong to other satellites than the list says."""
    file = read(tmp_path, HEADER_2 + EPOCH_2 + G05_2 + "\n" + epoch_2(" 30.0000000", "G05", G05_2))
    assert [row.receive_time_ns - THURSDAY_NS for row in file.rows] == [30 * NS_PER_S]
    assert file.problems == {"epoch cut off": 1}


def test_rinex2_epoch_with_a_line_too_many_is_dropped(tmp_path: Path) -> None:
    file = read(tmp_path, HEADER_2 + EPOCH_2 + G05_2 + G05_2 + R12_2 + epoch_2(" 30.0000000", "G05", G05_2))
    assert [row.receive_time_ns - THURSDAY_NS for row in file.rows] == [30 * NS_PER_S]
    assert file.problems == {"epoch longer than it says": 1}


@pytest.mark.parametrize("listed", ["G 5   ", "G 5R12G 7", "G 512R", "   G 5R12"])
def test_rinex2_epoch_whose_list_does_not_name_as_many_satellites_as_it_says_is_dropped(tmp_path: Path, listed: str) -> None:
    file = read(
        tmp_path, HEADER_2 + EPOCH_2.replace("G 5R12", f"{listed:9}")[:68].rstrip() + "\n" + G05_2 + R12_2 + EPOCH_2 + G05_2 + R12_2
    )
    assert len(file.rows) == 1
    assert file.problems == {"satellite list not readable": 1}


def test_rinex3_record_without_a_readable_name_is_dropped_alone(tmp_path: Path) -> None:
    file = read(tmp_path, HEADER_3 + EPOCH_3.replace("G05", "?05"))
    assert file.rows[0].signals == ("E11.1X",)
    assert file.problems == {"satellite name not readable": 1}


def test_satellite_listed_twice_counts_once_with_the_first(tmp_path: Path) -> None:
    second = G05_3.replace("21000000", "22000000")
    file = read(tmp_path, HEADER_3 + EPOCH_3.replace("0  2\n", "0  3\n") + second)
    assert file.rows[0].signals == SIGNALS_3
    assert file.rows[0].pseudorange_m[1] == 21_000_000.123
    assert file.problems == {"satellite listed twice": 1}


def test_repeated_and_backward_epochs_stay_as_they_stand(tmp_path: Path) -> None:
    later = EPOCH_3.replace("  0.0000000", " 30.0000000", 1)
    file = read(tmp_path, HEADER_3 + later + EPOCH_3 + EPOCH_3)
    assert [row.receive_time_ns - THURSDAY_NS for row in file.rows] == [30 * NS_PER_S, 0, 0]


@pytest.mark.parametrize(
    ("text", "line", "words"),
    [
        ("", 1, "empty file"),
        ("\n\n", 1, "empty file"),
        (gzip.compress(HEADER_3.encode(), mtime=0)[:40] + b"\xff" * 40, 1, "gzip"),
        ("$GPGGA,123519,4807.038,N\n", 1, "RINEX VERSION / TYPE"),
        ((HEADER_3 + EPOCH_3).replace("OBSERVATION DATA", "NAVIGATION DATA "), 1, "observation data"),
        ((HEADER_3 + EPOCH_3).replace("3.05", "5.00"), 1, "'5.00'"),
        ((HEADER_2 + EPOCH_2).replace("2.11", "2.20"), 1, "'2.20'"),
        (header("2.0                 COMPACT RINEX FORMAT", "CRINEX VERS   / TYPE") + HEADER_2, 1, "CRX2RNX"),
        (HEADER_3.replace("0     GPS", "0     TAI"), 7, "TAI"),
        (HEADER_2.replace("# / TYPES OF OBSERV", "COMMENT"), 8, "no observation types"),
        (HEADER_2.replace("     6    L1", "     7    L1"), 4, "6 observation types"),
        (
            HEADER_3.replace(header("R    1 C1C", "SYS / # / OBS TYPES"), header("G   20  1 C1C", "SYS / SCALE FACTOR")),
            6,
            "scale factor '20'",
        ),
        (HEADER_3.replace("END OF HEADER", "COMMENT"), 8, "END OF HEADER"),
    ],
)
def test_files_that_cannot_be_read_are_refused_with_place_and_remedy(tmp_path: Path, text: str | bytes, line: int, words: str) -> None:
    message = refusal(tmp_path, text)
    assert f"site.obs, line {line}: found " in message
    assert words in message


@pytest.mark.parametrize("scale", ["GAL", "QZS", "   "])
def test_time_systems_equal_to_gps_time(tmp_path: Path, scale: str) -> None:
    assert read(tmp_path, (HEADER_3 + EPOCH_3).replace("0     GPS", f"0     {scale}")).rows[0].receive_time_ns == THURSDAY_NS


def test_windows_line_ends_and_a_missing_last_one(tmp_path: Path) -> None:
    text = (HEADER_3 + EPOCH_3).replace("\n", "\r\n").removesuffix("\r\n")
    assert read(tmp_path, text).rows[0].signals == SIGNALS_3


def test_missing_file_is_an_os_error(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError):
        read_observations(tmp_path / "nowhere.obs", "A")


@pytest.mark.parametrize("flag", ["7", "8", "9", " "])
def test_flags_that_do_not_exist_make_no_epoch(tmp_path: Path, flag: str) -> None:
    file = read(tmp_path, HEADER_3 + EPOCH_3.replace("  0  2\n", f"  {flag}  2\n") + EPOCH_3)
    assert (len(file.rows), file.problems) == (1, {"epoch line not readable": 1})


@pytest.mark.parametrize("second", ["d.0000000", "0.000000d", "_.0000000"])
def test_letters_are_no_digits(tmp_path: Path, second: str) -> None:
    file = read(tmp_path, HEADER_3 + EPOCH_3.replace("0.0000000", second, 1) + EPOCH_3)
    assert (len(file.rows), file.problems) == (1, {"epoch line not readable": 1})


def test_a_count_with_a_gap_in_it_is_no_count(tmp_path: Path) -> None:
    file = read(tmp_path, HEADER_3 + EPOCH_3.replace("  0  2\n", "  00 2\n") + EPOCH_3)
    assert (len(file.rows), file.problems) == (1, {"epoch line not readable": 1})
