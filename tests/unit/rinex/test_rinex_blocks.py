"""A file as blocks: their size and order, and that where it is cut for reading makes no difference."""

import gzip
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from integrity.gnss.gps_time import NS_PER_S
from integrity.gnss.observations import ObservationBlock, ObservationRow, same_measurements
from recordings.rinex import observation, pieces
from recordings.rinex.epochs import Text, text_of
from recordings.rinex.observation import read_blocks, read_observations, rows_of
from tests.unit.rinex.test_observation import E11_3, EPOCH_2, EPOCH_3, G05_2, G05_3, HEADER_2, HEADER_3, R12_2, THURSDAY_NS, header


def epochs_3(n: int) -> str:
    return "".join(
        EPOCH_3.replace("00 00  0.0000000", f"{k // 60:02d} {k % 60:02d}  0.0000000", 1).replace("0.123 7", f"{k % 10}.{k % 1000:03d} 7")
        for k in range(n)
    )


def blocks(tmp_path: Path, text: str | bytes) -> list[ObservationBlock]:
    path = tmp_path / "site.obs"
    path.write_bytes(text if isinstance(text, bytes) else text.encode("latin-1"))
    return list(read_blocks(path, "A").blocks)


def problems_of(tmp_path: Path, text: str) -> dict[str, int]:
    path = tmp_path / "site.obs"
    path.write_text(text)
    return read_observations(path, "A").problems


def rows(parts: list[ObservationBlock]) -> Iterator[ObservationRow]:
    for part in parts:
        yield from rows_of(part)


def test_shapes_of_a_block(tmp_path: Path) -> None:
    (block,) = blocks(tmp_path, HEADER_3 + epochs_3(5))
    assert (block.receivers, block.signals, block.satellites) == (("A",), ("E11.1X", "G05.1C", "G05.5Q"), ("E11", "G05", "G05"))
    assert block.pseudorange_m.shape == block.lock_s.shape == block.slip.shape == (5, 1, 3)
    assert (block.receive_time_ns == block.epoch_ns[:, None]).all()


def test_blocks_are_of_1024_epochs_at_most_and_complete(tmp_path: Path) -> None:
    parts = blocks(tmp_path, HEADER_3 + epochs_3(1030))
    assert [len(part.epoch_ns) for part in parts] == [1024, 6]
    assert np.concatenate([part.epoch_ns for part in parts]).tolist() == [THURSDAY_NS + 60 * k * NS_PER_S for k in range(1030)]


def test_blocks_have_the_signals_measured_in_them(tmp_path: Path) -> None:
    event = f">{'':30}4  1\n" + header("E    1 C5Q", "SYS / # / OBS TYPES")
    text = HEADER_3 + epochs_3(2) + event + EPOCH_3.replace(E11_3, "E11  25000000.500\n").replace(G05_3, "G05\n")
    assert [part.signals for part in blocks(tmp_path, text)] == [("E11.1X", "G05.1C", "G05.5Q"), ("E11.5Q",)]


def test_comments_between_epochs_change_nothing(tmp_path: Path) -> None:
    event = f">{'':30}4  1\n" + header("a word", "COMMENT")
    again, plain = (blocks(tmp_path, HEADER_3 + epochs_3(2) + between + epochs_3(2)) for between in (event, ""))
    assert all(same_measurements(a, b) for a, b in zip(rows(again), rows(plain), strict=True))


def test_lines_behind_special_records_are_counted(tmp_path: Path) -> None:
    event = f">{'':30}4  1\n" + header("a word", "COMMENT")
    assert problems_of(tmp_path, HEADER_3 + event + "no line of an epoch\n" + epochs_3(1)) == {"epoch line not readable": 1}


def test_repeated_and_backward_epochs_keep_their_rows(tmp_path: Path) -> None:
    (block,) = blocks(tmp_path, HEADER_3 + epochs_3(2) + epochs_3(2) + EPOCH_3.replace("21000000", "22000000"))
    assert (block.epoch_ns - THURSDAY_NS).tolist() == [0, 60 * NS_PER_S, 0, 60 * NS_PER_S, 0]
    assert block.pseudorange_m[-1, 0, 1] == 22_000_000.123


def test_an_epoch_without_satellites_is_a_row(tmp_path: Path) -> None:
    (row,) = rows(blocks(tmp_path, HEADER_3 + "> 2010 03 18 00 00  0.0000000  0  0\n"))
    assert (row.receive_time_ns, row.signals) == (THURSDAY_NS, ())


def test_a_flag_of_power_failure_marks_only_what_was_measured(tmp_path: Path) -> None:
    text = HEADER_3 + epochs_3(1) + EPOCH_3.replace("  0  2", "  1  1").replace(E11_3, "")
    (block,) = blocks(tmp_path, text)
    assert block.slip[:, 0].tolist() == [[False, False, False], [False, True, True]]


@pytest.mark.parametrize("size", [2, 7, 64, 1000])
@pytest.mark.parametrize("packed", [False, True])
@pytest.mark.parametrize("text", [HEADER_2 + (EPOCH_2 + G05_2 + R12_2) * 7, HEADER_3 + epochs_3(4) + "?\r\n\r" + epochs_3(4)])
def test_how_a_file_is_cut_for_reading_makes_no_difference(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, size: int, packed: bool, text: str
) -> None:
    path = tmp_path / "site.obs"
    path.write_bytes(gzip.compress(text.encode()) if packed else text.encode())
    whole = read_observations(path, "A")
    monkeypatch.setattr(pieces, "PIECE_BYTES", size)
    cut = read_observations(path, "A")
    assert cut.problems == whole.problems
    assert [same_measurements(a, b) for a, b in zip(cut.rows, whole.rows, strict=True)] == [True] * len(whole.rows)


@pytest.mark.parametrize("size", [1, 2, 3, 4, 100])
def test_line_ends_of_all_systems(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, size: int) -> None:
    monkeypatch.setattr(pieces, "PIECE_BYTES", size)
    path = tmp_path / "ends"
    path.write_bytes(b"a\r\nb\rc\r\r\n\nd\r")
    assert b"".join(pieces.read_pieces(path, Counter())) == b"a\nb\nc\n\n\nd\n"


def test_endless_text_between_epochs_is_not_kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(pieces, "PIECE_BYTES", 1000)
    monkeypatch.setattr(observation, "LONGEST_SEGMENT_BYTES", 5000)
    longest = 0

    def measured(piece: bytes, blanks: int, number: int) -> Text:
        nonlocal longest
        longest = max(longest, len(piece))
        return text_of(piece, blanks, number)

    monkeypatch.setattr(observation, "text_of", measured)
    path = tmp_path / "site.obs"
    path.write_text(HEADER_3 + EPOCH_3 + "no line of an epoch\n" * 2000 + EPOCH_3)
    file = read_observations(path, "A")
    assert longest < 8000
    assert (len(file.rows), file.problems) == (2, {"epoch line not readable": 1})


def test_a_line_without_end_is_not_kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(pieces, "LONGEST_LINE_BYTES", 4000)
    monkeypatch.setattr(pieces, "PIECE_BYTES", 1000)
    path = tmp_path / "site.obs"
    path.write_bytes(b"x" * 100_000 + b"\n")
    assert max(len(piece) for piece in pieces.read_pieces(path, Counter())) <= 5001
