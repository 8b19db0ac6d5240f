"""Compact RINEX written here line by line: what differences, changes and events come to, and what damage costs.

The worked values follow Hatanaka (2008), section 3; whole files are compared with CRX2RNX in `tests/crosscheck`.
"""

from collections import Counter
from pathlib import Path

import pytest

from integrity.errors import DecodeError
from recordings.rinex import hatanaka
from recordings.rinex.hatanaka import expanded
from recordings.rinex.observation import read_observations
from tests.unit.rinex.test_observation import header

HEADER = (
    header("     3.05           OBSERVATION DATA    M", "RINEX VERSION / TYPE")
    + header("G    3 C1C L1C S1C", "SYS / # / OBS TYPES")
    + header("R    1 C1C", "SYS / # / OBS TYPES")
    + header("", "END OF HEADER")
)
COMPACT = header("3.0                 COMPACT RINEX FORMAT", "CRINEX VERS   / TYPE") + header("by hand", "CRINEX PROG / DATE")
FIRST = "> 2010 03 18 00 00  0.0000000  0  2      G05R12\n\n3&21000000123 1&-1000 0&45500 17&&&6\n3&20000000000\n"


def text_of(body: str, head: str = COMPACT + HEADER, cut: int | None = None) -> tuple[str, dict[str, int]]:
    problems: Counter[str] = Counter()
    data = (head + body).encode("latin-1")
    lines = data.splitlines(keepends=True)
    pieces = [data] if cut is None else [b"".join(lines[:cut]), b"".join(lines[cut:])]
    text = b"".join(expanded("compact", pieces, problems)).decode("latin-1")
    return text.removeprefix("\n".join(line.rstrip() for line in HEADER.split("\n"))), dict(problems)


def later(seconds: str, *lines: str, clock: str = "") -> str:
    """An epoch line in which only the seconds change, and the lines of the epoch."""
    return " " * 20 + seconds + "\n" + clock + "\n" + "".join(line + "\n" for line in lines)


def test_an_epoch_that_begins() -> None:
    text, problems = text_of(FIRST)
    assert problems == {}
    assert text == ("> 2010 03 18 00 00  0.0000000  0  2\nG05  21000000.12317        -1.000          45.500 6\nR12  20000000.000\n")


def numbers(text: str, satellite: str, column: int) -> list[str]:
    return [line[column : column + 14].strip() for line in text.split("\n") if line.startswith(satellite)]


def test_differences_up_to_the_order_of_the_field() -> None:
    body = FIRST + "".join(
        later(f"{k}", f"{a} {b} {c}", "7") for k, a, b, c in [(1, 7, 1, 45250), (2, -2, 1, 40000), (3, 1, 1, 30000), (4, 1, 1, 999)]
    )
    text, _ = text_of(body)
    # Third order: values, then first, second and third differences in turn; checked by hand.
    assert numbers(text, "G05", 3) == ["21000000.123", "21000000.130", "21000000.135", "21000000.139", "21000000.143"]
    assert numbers(text, "G05", 19) == ["-1.000", "-.999", "-.998", "-.997", "-.996"]
    assert numbers(text, "G05", 35) == ["45.500", "45.250", "40.000", "30.000", ".999"]


def test_changes_of_digits_and_of_the_epoch_line() -> None:
    text, _ = text_of(FIRST + later("1", "1 1 1  &5", "") + later("2", "1 1 1 ", ""))
    assert [line[17:19] for line in text.split("\n") if line.startswith("G05")] == ["17", "1 ", "1 "]
    assert [line[:29] for line in text.split("\n") if line.startswith(">")] == [f"> 2010 03 18 00 00  {k}.0000000" for k in range(3)]


def test_a_satellite_that_comes_back_begins_without_digits() -> None:
    gone = " " * 20 + "1" + " " * 13 + "1" + " " * 6 + "R12&&&\n\n7\n"
    back = " " * 20 + "2" + " " * 13 + "2" + " " * 6 + "G05R12\n\n3&21000000123 1&-1000 0&45500 4\n1\n"
    text, problems = text_of(FIRST + gone + back)
    assert problems == {}
    assert text.split("\n")[2:] == [
        "R12  20000000.000",
        "> 2010 03 18 00 00  1.0000000  0  1",
        "R12  20000000.007",
        "> 2010 03 18 00 00  2.0000000  0  2",
        "G05  21000000.1234         -1.000          45.500",
        "R12  20000000.015",
        "",
    ]


def test_an_epoch_that_begins_again_begins_without_digits() -> None:
    text, _ = text_of(FIRST + FIRST.replace("  0.0", "  1.0").replace("17&&&6", ""))
    assert text.split("\n")[-3] == "G05  21000000.123          -1.000          45.500"


def test_a_clock_offset_by_differences() -> None:
    body = FIRST.replace("\n\n", "\n2&1500000000000\n", 1) + later("1", "1 1 1", "1", clock="-3") + later("2", "1 1 1", "1", clock="1")
    text, _ = text_of(body)
    assert [line[41:] for line in text.split("\n") if line.startswith(">")] == [" 1.500000000000", " 1.499999999997", " 1.499999999995"]


def test_events_and_their_header_lines_stand_as_they_are() -> None:
    event = f">{'':30}4  1\n" + header("G    1 C1C", "SYS / # / OBS TYPES")
    text, problems = text_of(FIRST + event + "> 2010 03 18 00 00  1.0000000  0  1      G05\n\n3&21000000999\n")
    assert problems == {}
    assert event + "> 2010 03 18 00 00  1.0000000  0  1\nG05  21000000.999\n" in text


def test_lines_of_rinex2_of_five_fields_and_lists_of_twelve(tmp_path: Path) -> None:
    head = header("1.0                 COMPACT RINEX FORMAT", "CRINEX VERS   / TYPE") + header("by hand", "CRINEX PROG / DATE")
    head += header("     2.11           OBSERVATION DATA    G (GPS)", "RINEX VERSION / TYPE")
    head += header("     6    C1    L1    D1    S1    P2    L2", "# / TYPES OF OBSERV") + header("", "END OF HEADER")
    names = [f"G{k:2d}" for k in range(1, 14)]
    path = tmp_path / "compact.10d"
    body = f"&10  3 18  0  0  0.0000000  0 13{''.join(names)}\n\n" + "".join(f"3&210000000{k:02d}    3&22000000000 \n" for k in range(13))
    path.write_text(head + body)
    file = read_observations(path, "A")
    assert file.problems == {}
    assert file.rows[0].pseudorange_m.tolist() == [x for k in range(13) for x in (21_000_000.0 + k / 1000, 22_000_000.0)]


@pytest.mark.parametrize("cells", [1, 10, 10_000_000])
def test_how_many_epochs_are_expanded_at_once_makes_no_difference(monkeypatch: pytest.MonkeyPatch, cells: int) -> None:
    body = FIRST + "".join(later(f"{k}", f"{k * 7919 % 100 - 50} {k} {k * 100} {'&' if k % 2 else '5'}", f"{k}") for k in range(1, 10))
    whole = text_of(body)
    monkeypatch.setattr(hatanaka, "CELLS_AT_ONCE", cells)
    assert text_of(body) == whole


@pytest.mark.parametrize("cut", range(3, 16))
def test_where_pieces_are_cut_makes_no_difference(cut: int) -> None:
    body = FIRST + later("1", "1 1 1  &5", "") + later("2", "1 1 1 ", "")
    assert text_of(body, cut=cut) == text_of(body)


@pytest.mark.parametrize("damage", ["x", "1-2", "--3", "+3", "1_0", "9" * 16, "x&5", "3&", "3&x"])
def test_a_number_that_is_none_is_missing_until_it_begins_again(damage: str) -> None:
    text, _ = text_of(FIRST + later("1", f"{damage} 1 1", "1") + later("2", "1 1 1", "1") + later("3", "0&21000000003 1 1", "1"))
    assert numbers(text, "G05", 3) == ["21000000.123", "*" * 14, "*" * 14, "21000000.003"]
    assert numbers(text, "R12", 3) == ["20000000.000", "20000000.001", "20000000.003", "20000000.007"]


def test_a_difference_without_a_beginning_is_no_number() -> None:
    text, _ = text_of(FIRST.replace("3&20000000000", "") + later("1", "1 1 1", "20000000000"))
    assert numbers(text, "R12", 3) == ["", "*" * 14]


def test_a_number_too_long_for_its_columns_is_no_number() -> None:
    text, _ = text_of(FIRST.replace("1&-1000", "1&-1000000000000"))
    assert numbers(text, "G05", 19) == ["*" * 14]


@pytest.mark.parametrize("lost", [-1, 0, 1, 2])
def test_a_line_lost_costs_the_epochs_up_to_the_next_beginning(lost: int) -> None:
    lines = later("2", "1 1 1", "1").splitlines(keepends=True)
    del lines[1 + lost]
    text, problems = text_of(FIRST + later("1", "1 1 1", "1") + "".join(lines) + later("3", "1 1 1", "1") + FIRST)
    assert problems == {"compressed epochs without a beginning": 1}
    assert [line[20] for line in text.split("\n") if line.startswith(">")] in (["0", "1", "0"], ["0", "0"])
    assert "*" not in text


def test_an_epoch_line_lost_is_noticed_where_every_line_has_one_field() -> None:
    first = "> 2010 03 18 00 00  0.0000000  0  2      R12R13\n\n1&20000000000\n1&21000000000\n"
    lines = later("1", "100", "200").split("\n", 1)[1]
    text, problems = text_of(first + later("2", "7", "7") + lines + later("3", "100", "200"))
    assert problems == {"compressed epochs without a beginning": 1}
    assert numbers(text, "R12", 3) == ["20000000.000"]


@pytest.mark.parametrize("clock", ["1 1 1", "x", "3&"])
def test_a_line_that_is_no_clock_offset_costs_the_epochs_up_to_the_next_beginning(clock: str) -> None:
    text, problems = text_of(
        FIRST + FIRST.replace("  0.0", "  1.0") + later("2", "1 1 1", "1", clock=clock) + FIRST.replace("  0.0", "  3.0")
    )
    assert [line[20] for line in text.split("\n") if line.startswith(">")] == ["0", "3"]
    assert problems == {"compressed epochs without a beginning": 1}


def test_a_record_that_is_longer_than_any_is_none() -> None:
    text, _ = text_of(FIRST + later("1", "1 1 1       7", "1"))
    assert numbers(text, "G05", 3) == ["21000000.123", "*" * 14]


def test_digits_of_crinex_1_go_with_the_number() -> None:
    head = header("1.0                 COMPACT RINEX FORMAT", "CRINEX VERS   / TYPE") + header("by hand", "CRINEX PROG / DATE")
    head += header("     2.11           OBSERVATION DATA    G (GPS)", "RINEX VERSION / TYPE")
    head += header("     2    C1    L1", "# / TYPES OF OBSERV") + header("", "END OF HEADER")
    seconds = [" " * 17 + f"{k}\n\n{line}\n" for k, line in ((1, "0 "), (2, "0 1&2000 "))]
    text, _ = text_of("&10  3 18  0  0  0.0000000  0  1G 5\n\n1&21000000000 1&1000 1718\n" + "".join(seconds), head=head)
    assert text.split("\n")[-6::2] == ["  21000000.00017         1.00018", "  21000000.00017", "  21000000.00017         2.000"]


def test_versions_that_are_not_known_are_refused() -> None:
    with pytest.raises(DecodeError, match=r"compact, line 1: found version '2\.0'"):
        text_of(FIRST, head=COMPACT.replace("3.0", "2.0") + HEADER)
