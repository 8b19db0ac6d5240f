"""RINEX observation files of versions 2 and 3: epochs damaged, files read in pieces of any size."""

import math
import re
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from random import Random
from typing import NamedTuple

from integrity.gnss.observations import ObservationRow, same_measurements
from recordings.rinex import blocks
from recordings.rinex import pieces as rinex_pieces
from recordings.rinex.observation import ObservationFile, read_observations
from tests.fuzz import bounds
from tests.fuzz.mutations import in_other_order
from tests.fuzz.target import Piece, Target
from tests.fuzz.text import of_whole_lines, read, touched_text

EPOCHS = 120  # of a batch
TYPES_2 = ("C1", "L1", "D1", "S1", "P2", "L2", "C5")
TYPES_3 = {
    "G": ("C1C", "L1C", "D1C", "S1C", "C2W", "L2W", "S2W"),
    "R": ("C1C", "L1C", "D1C", "S1C"),
    "E": ("C1C", "L1C", "S1C", "C5Q", "L5Q"),
    "C": ("C2I", "L2I", "S2I"),
    "J": ("C1C", "S1C"),
    "S": ("C1C", "L1C", "S1C"),
}
END = b"END OF HEADER"


class Epoch(NamedTuple):
    """What is written of an epoch: seconds since the beginning, and of each satellite a number with its two digits for each type."""

    second: int
    records: dict[str, tuple[tuple[float, str], ...]]


def header(content: str, label: str) -> str:
    return f"{content:<60}{label}\n"


def header_2() -> str:
    text = header("     2.11           OBSERVATION DATA    M", "RINEX VERSION / TYPE")
    text += header(f"{len(TYPES_2):6d}" + "".join(f"    {name}" for name in TYPES_2), "# / TYPES OF OBSERV")
    return text + header("  2010     3    18     0     0    0.0000000     GPS", "TIME OF FIRST OBS") + header("", "END OF HEADER")


def header_3() -> str:
    text = header("     3.05           OBSERVATION DATA    M", "RINEX VERSION / TYPE")
    for system, types in TYPES_3.items():
        text += header(f"{system}  {len(types):3d} " + " ".join(types), "SYS / # / OBS TYPES")
    text += header("G   10  01 L2W", "SYS / SCALE FACTOR") + header("  2 R01  1 R02 -4", "GLONASS SLOT / FRQ #")
    return text + header("  2010     3    18     0     0    0.0000000     GPS", "TIME OF FIRST OBS") + header("", "END OF HEADER")


def value(rng: Random, kind: str) -> tuple[float, str]:
    """A number that was measured, and its digits; sometimes none."""
    if rng.random() < 0.1:
        return math.nan, "  "
    ranges = {"C": (2e7, 2.6e7), "P": (2e7, 2.6e7), "L": (-9e7, 2e8), "D": (-5e3, 5e3), "S": (20.0, 55.0)}
    digits = rng.choice("     1234") + rng.choice(" 456789") if kind == "L" else "  "
    return round(rng.uniform(*ranges[kind]), 3), digits


def an_epoch(rng: Random, second: int, version: int) -> Epoch:
    systems = "GRES" if version == 2 else "GRECJS"
    satellites = [f"{system}{n:02d}" for system in systems for n in rng.sample(range(1, 19), rng.choice((0, 1, 1, 2)))]
    of = {name: TYPES_2 if version == 2 else TYPES_3[name[0]] for name in satellites or ["G05"]}
    return Epoch(second, {name: tuple(value(rng, kind[0]) for kind in types) for name, types in of.items()})


def fields(record: Sequence[tuple[float, str]]) -> list[str]:
    return [" " * 16 if math.isnan(number) else f"{number:14.3f}{digits}" for number, digits in record]


def text_2(epoch: Epoch) -> str:
    names = list(epoch.records)
    head = f" 10  3 18  0 {epoch.second // 60:2d} {epoch.second % 60:2d}.0000000  0{len(names):3d}"
    text = "".join((head if k == 0 else " " * 32) + "".join(names[k : k + 12]) + "\n" for k in range(0, len(names), 12))
    for record in epoch.records.values():
        every = fields(record)
        text += "".join("".join(every[k : k + 5]).rstrip() + "\n" for k in range(0, len(every), 5))
    return text


def text_3(epoch: Epoch) -> str:
    head = f"> 2010 03 18 00 {epoch.second // 60:02d} {epoch.second % 60:2d}.0000000  0{len(epoch.records):3d}\n"
    return head + "".join((name + "".join(fields(record))).rstrip() + "\n" for name, record in epoch.records.items())


@cache
def written() -> dict[int, tuple[bytes, list[bytes]]]:
    """By version a header and many epochs."""
    rng = Random(0)
    two = [text_2(an_epoch(rng, k, 2)).encode() for k in range(600)]
    three = [text_3(an_epoch(rng, k, 3)).encode() for k in range(600)]
    return {2: (header_2().encode(), two), 3: (header_3().encode(), three)}


def sound(rng: Random) -> list[bytes]:
    """A header, and epochs that follow each other or not."""
    head, epochs = written()[rng.choice((2, 3))]
    first = rng.randrange(len(epochs) - EPOCHS)
    some = epochs[first : first + EPOCHS]
    event = b"> " + b" " * 29 + b"4  1\n" if head is written()[3][0] else b" " * 28 + b"4  1\n"
    some[5:5] = [event + header("a comment", "COMMENT").encode()]
    return [head, *in_other_order(rng, some)]


def touch(rng: Random, record: bytes) -> bytes:
    """Headers only now and then: most damage there makes no file of it."""
    return record if END in record and rng.random() < 0.9 else touched_text(rng, record)


@contextmanager
def sizes(piece_bytes: int, epochs: int) -> Iterator[None]:
    """Read in pieces of so many bytes, and blocks of so many epochs."""
    before = rinex_pieces.PIECE_BYTES, blocks.EPOCHS_PER_BLOCK
    rinex_pieces.PIECE_BYTES, blocks.EPOCHS_PER_BLOCK = piece_bytes, epochs
    try:
        yield
    finally:
        rinex_pieces.PIECE_BYTES, blocks.EPOCHS_PER_BLOCK = before


def reader(path: Path) -> ObservationFile:
    return read_observations(path, "A")


def read_twice(data: bytes, rng: Random) -> ObservationFile | None:
    """What a file gives, which is the same in pieces and blocks of other sizes, or packed."""
    file = read(data, reader)
    if rng.random() < 0.3:
        with sizes(rng.choice((200, 3000, 20_000)), rng.choice((3, 50, 1024))):
            _assert_same(file, read(data, reader, packed=rng.random() < 0.2))
    if file is not None:
        bounds.assert_rows_in_range(file.rows, bounds.RINEX)
    return file


def _assert_same(file: ObservationFile | None, again: ObservationFile | None) -> None:
    assert (file is None) == (again is None)
    if file is not None and again is not None:
        assert again.problems == file.problems
        assert len(again.rows) == len(file.rows) and all(map(same_measurements, again.rows, file.rows))


def assert_found(rows: Sequence[ObservationRow], whole: bytes, n_epochs: int) -> None:
    """That every row of a file that nobody touched, which has so many, is among these."""
    expected = read(whole, reader)
    assert expected is not None and len(expected.rows) == n_epochs and not expected.problems
    by_time: dict[int, list[ObservationRow]] = {}
    for row in rows:
        by_time.setdefault(row.receive_time_ns, []).append(row)
    for row in expected.rows:
        found = by_time.get(row.receive_time_ns, [])
        assert any(same_measurements(row, other) for other in found), f"{row} is lost"


def examine(pieces: Sequence[Piece], rng: Random) -> Counter[str]:
    """A refusal, or rows in range, among them those of untouched epochs; of RINEX 2 not of one before a touched one."""
    file = read_twice(b"".join(piece.data for piece in pieces), rng)
    if file is None:
        return Counter(refused=1)
    head, *body = of_whole_lines(pieces)
    version = next((version for version, (text, _) in written().items() if text == head.data), None)
    if version is not None and rng.random() < 0.5:
        after = (*body[1:], Piece(b"", True))
        kept = [
            piece.data for piece, following in zip(body, after, strict=False) if piece.untouched and (version == 3 or following.untouched)
        ]
        assert_found(file.rows, head.data + b"".join(kept), sum(b"COMMENT" not in record for record in kept))
    return Counter(rows=len(file.rows), problems=sum(file.problems.values()))


def split(data: bytes) -> list[bytes]:
    return re.split(rb"(?<=\n)(?=>)", data)


TARGET = Target(sound, touch, split, examine, any_order=False)
