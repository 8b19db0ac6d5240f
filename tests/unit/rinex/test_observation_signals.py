"""Which signals the columns of a file are, and in what scale and time. Codes after RINEX 2.11, 10.1.1, and RINEX 3.05, tables 4 to 11."""

from pathlib import Path

import numpy as np
import pytest

from integrity.errors import DecodeError
from integrity.gnss.gps_time import NS_PER_S, gps_from_week
from recordings.rinex.observation import ObservationFile, read_observations
from tests.unit.rinex.test_observation import header

THURSDAY_NS = gps_from_week(1575, 345_600.0)  # 2010-03-18T00:00:00 GPS, when GPS was 15 s ahead of UTC


def read(tmp_path: Path, text: str) -> ObservationFile:
    path = tmp_path / "site.obs"
    path.write_text(text, "latin-1")
    return read_observations(path, "A")


def rinex2(types: str, satellite: str, numbers: str, scale: str = "GPS") -> str:
    count = len(types.split())
    return (
        header("     2.11           OBSERVATION DATA    M (MIXED)", "RINEX VERSION / TYPE")
        + header(f"{count:6d}" + "".join(f"{name:>6}" for name in types.split()), "# / TYPES OF OBSERV")
        + header(f"  2010     3    18     0     0    0.0000000     {scale}", "TIME OF FIRST OBS")
        + header("", "END OF HEADER")
        + f" 10  3 18  0  0  0.0000000  0  1{satellite}\n"
        + "".join(numbers[k : k + 80].rstrip() + "\n" for k in range(0, 16 * count, 80))
    )


def rinex3(types: str, record: str, *more: str, version: str = "3.05", scale: str = "GPS") -> str:
    return (
        header(f"     {version}           OBSERVATION DATA    M", "RINEX VERSION / TYPE")
        + header(f"{types[0]}{len(types.split()) - 1:5d}{types[1:]}", "SYS / # / OBS TYPES")
        + "".join(more)
        + header(f"  2010     3    18     0     0    0.0000000     {scale}", "TIME OF FIRST OBS")
        + header("", "END OF HEADER")
        + f"> 2010 03 18 00 00  0.0000000  0  1\n{record}\n"
    )


def ranges(n: int) -> str:
    return "".join(f"{21_000_000 + k:14.3f}  " for k in range(n))


@pytest.mark.parametrize(
    ("types", "satellite", "expected"),
    [
        ("C1 P1 C2 P2 C5", "G05", {"1C": 0, "1W": 1, "2X": 2, "2W": 3, "5X": 4}),
        ("P1 P2 C1 C2", "R12", {"1P": 0, "2P": 1, "1C": 2, "2C": 3}),
        ("C1 C5 C7 C8 C6 P2", "E11", {"1C": 0, "5X": 1, "7X": 2, "8X": 3, "6X": 4}),
        ("C1 C5", "S29", {"1C": 0, "5I": 1}),
        ("C1 C2 C5", "J01", {"1C": 0, "2X": 1, "5X": 2}),
        ("C2 C7 C6", "C06", {"2I": 0, "7I": 1, "6I": 2}),
        ("C1 C7", "C06", {"2I": 0, "7I": 1}),
    ],
)
def test_rinex2_codes_of_each_system(tmp_path: Path, types: str, satellite: str, expected: dict[str, int]) -> None:
    (row,) = read(tmp_path, rinex2(types, satellite, ranges(len(types.split())))).rows
    found = dict(zip(row.signals, (row.pseudorange_m - 21_000_000).tolist(), strict=True))
    assert found == {f"{satellite}.{code}": k for code, k in expected.items()}


@pytest.mark.parametrize(
    ("types", "owner"),
    [
        ("C1 P1 L1", "G05.1C"),
        ("P1 C1 L1", "G05.1C"),
        ("P1 L1", "G05.1W"),
        ("C2 P2 L2", "G05.2W"),
        ("C2 L2", "G05.2X"),
    ],
)
def test_rinex2_carrier_belongs_to_one_range_of_its_band(tmp_path: Path, types: str, owner: str) -> None:
    (row,) = read(tmp_path, rinex2(types, "G05", ranges(len(types.split())))).rows
    assert [s for s, cycles in zip(row.signals, row.carrier_cycles, strict=True) if np.isfinite(cycles)] == [owner]


@pytest.mark.parametrize(
    ("version", "types", "signals"),
    [
        ("3.02", "C C1I C7I", ("C06.2I", "C06.7I")),
        ("3.02", "C C1X C7I", ("C06.2X", "C06.7I")),
        ("3.04", "C C1X C7I", ("C06.1X", "C06.7I")),  # B1C
        ("3.04", "C C1I C2I", ("C06.2I",)),
        ("3.01", "C C2I C6I", ("C06.2I", "C06.6I")),
    ],
)
def test_beidou_b1_under_its_number_of_version_302(tmp_path: Path, version: str, types: str, signals: tuple[str, ...]) -> None:
    assert read(tmp_path, rinex3(types, "C06" + ranges(2), version=version)).rows[0].signals == signals


@pytest.mark.parametrize("types", ["C C1I C2I", "C C2I C1I"])
def test_beidou_b1_under_both_numbers_is_the_one_under_its_own(tmp_path: Path, types: str) -> None:
    (row,) = read(tmp_path, rinex3(types, "C06" + ranges(2))).rows
    assert row.pseudorange_m.tolist() == [21_000_000.0 + types.split().index("C2I") - 1]


@pytest.mark.parametrize(("system", "kept"), [("G", 1), ("R", 1), ("S", 1), ("J", 1), ("I", 0)])
def test_systems_that_are_read(tmp_path: Path, system: str, kept: int) -> None:
    file = read(
        tmp_path, rinex3(f"{system} C5X", f"{system}02" + ranges(1), header("G    1 C1C", "SYS / # / OBS TYPES") if system == "I" else "")
    )
    assert (len(file.rows[0].signals), file.problems) == (kept, {})


def test_the_receiver_channel_is_no_signal(tmp_path: Path) -> None:
    assert read(tmp_path, rinex3("G X1  C1C", "G05" + ranges(2))).rows[0].signals == ("G05.1C",)


def test_scale_factor_of_all_types_and_of_one(tmp_path: Path) -> None:
    scales = header("G   10", "SYS / SCALE FACTOR") + header("G 1000  1 L1C", "SYS / SCALE FACTOR")
    (row,) = read(tmp_path, rinex3("G C1C L1C", "G05" + f"{210_000_001.234:14.3f}  {-1_000_123.456:14.3f}  ", scales)).rows
    assert (row.pseudorange_m[0], row.carrier_cycles[0]) == (210_000_001.234 / 10, -1_000_123.456 / 1000)


def test_scale_factors_go_on_in_a_second_line_and_leave_other_systems_alone(tmp_path: Path) -> None:
    scales = (
        header("E   10", "SYS / SCALE FACTOR")
        + header("G  100  2 L1C", "SYS / SCALE FACTOR")
        + header("           D1C", "SYS / SCALE FACTOR")
    )
    (row,) = read(tmp_path, rinex3("G C1C L1C D1C", "G05" + ranges(3), scales)).rows
    assert (row.pseudorange_m[0], row.carrier_cycles[0], row.doppler_hz[0]) == (21_000_000.0, 210_000.01, 210_000.02)


def test_phase_shifts_are_read_over(tmp_path: Path) -> None:
    (row,) = read(tmp_path, rinex3("G C1C L1C", "G05" + ranges(2), header("G L1C  0.25000  02 G05 G07", "SYS / PHASE SHIFT"))).rows
    assert row.carrier_cycles[0] == 21_000_001.0


def test_glonass_channels(tmp_path: Path) -> None:
    slots = header("  3 R01  1 R 2 -4 R24  2", "GLONASS SLOT / FRQ #") + header("    R05 +1 R06-17", "GLONASS SLOT / FRQ #")
    file = read(tmp_path, rinex3("R C1C", "R02" + ranges(1), slots))
    assert file.glonass_channels == {"R01": 1, "R02": -4, "R24": 2}
    assert file.problems == {"GLONASS SLOT / FRQ # not readable": 2}


@pytest.mark.parametrize(("scale", "behind_s"), [("GPS", 0), ("GAL", 0), ("QZS", 0), ("BDT", 14), ("GLO", 15), ("UTC", 15)])
def test_times_of_other_scales_are_brought_to_gps_time(tmp_path: Path, scale: str, behind_s: int) -> None:
    assert read(tmp_path, rinex3("G C1C", "G05" + ranges(1), scale=scale)).rows[0].receive_time_ns == THURSDAY_NS + behind_s * NS_PER_S


@pytest.mark.parametrize(("system", "behind_s"), [("R", 15), ("G", 0)])
def test_a_scale_that_is_not_said_is_that_of_the_file(tmp_path: Path, system: str, behind_s: int) -> None:
    text = rinex2("C1", " 05", ranges(1), scale="   ").replace("M (MIXED)", f"{system}        ")
    (row,) = read(tmp_path, text).rows
    assert (row.receive_time_ns, row.signals) == (THURSDAY_NS + behind_s * NS_PER_S, (f"{system}05.1C",))


@pytest.mark.parametrize("letter", ["I", "\xdf", "\xff", "\xb5"])  # the last three have capitals that are no single byte
def test_satellites_without_a_letter_in_a_file_of_another_system_are_passed_over(tmp_path: Path, letter: str) -> None:
    text = rinex2("C1", " 05", ranges(1)).replace("M (MIXED)", f"{letter}        ")
    assert read(tmp_path, text).rows[0].signals == ()


def test_utc_over_a_leap_second(tmp_path: Path) -> None:
    last = rinex3("G C1C", "G05" + ranges(1), scale="GLO").replace("2010 03 18 00 00  0", "2016 12 31 23 59 59")
    first = last[last.rindex("> ") :].replace("2016 12 31 23 59 59", "2017 01 01 00 00  0")
    before, after = (row.receive_time_ns for row in read(tmp_path, last + first).rows)
    assert after - before == 2 * NS_PER_S


@pytest.mark.parametrize("factor", ["7", "x", "-10"])
def test_scale_factors_that_do_not_exist_are_refused(tmp_path: Path, factor: str) -> None:
    with pytest.raises(DecodeError, match="scale factor"):
        read(tmp_path, rinex3("G C1C", "G05" + ranges(1), header(f"G {factor:>4}", "SYS / SCALE FACTOR")))
