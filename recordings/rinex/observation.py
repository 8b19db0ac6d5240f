"""Observation files: RINEX 2.10 to 2.12, 3.00 to 3.05 and 4.00 to 4.02, plain, gzipped or compressed after Hatanaka; all signals of the
six systems.

A damaged file gives what in it is beyond doubt: numbers must stand in their columns (F14.3), a RINEX 2 epoch must have as many lines
as it says, since there only the count tells which satellite a line belongs to. Whatever is dropped is counted.
Source: RINEX 2.11, section 5 and tables A1, A2; RINEX 3.05, section 6 and tables A2, A3.
"""

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import chain, pairwise
from pathlib import Path
from typing import NamedTuple

import numpy as np

from integrity.gnss.observations import ROW_ARRAYS, ObservationBlock, ObservationRow
from recordings.rinex.blocks import blocks_of
from recordings.rinex.columns import FIELD_BYTES
from recordings.rinex.epochs import epochs_of, leftover, segments_of, text_of
from recordings.rinex.hatanaka import expanded, is_compact
from recordings.rinex.header import Format, changed, format_of, glonass_channels
from recordings.rinex.pieces import read_pieces
from recordings.rinex.text import Header, RinexText, broken, read_header

VERSIONS = ((2.10, 2.12), (3.00, 3.05), (4.00, 4.02))
LONGEST_HEADER_BYTES = 1 << 24
LONGEST_SEGMENT_BYTES = 1 << 24  # what stands longer behind an epoch's line than any epoch is not kept
SHORTEST_BLANKS = 80


@dataclass(frozen=True)
class ObservationHeader:
    """What the header says: `interval_s`, `leap_seconds` and `approx_position_ecef_m` are None where it does not.

    `glonass_channels` are frequency numbers by satellite, as far as it has them.
    """

    path: str
    version: float
    marker: str
    interval_s: float | None
    leap_seconds: int | None
    approx_position_ecef_m: tuple[float, float, float] | None
    glonass_channels: dict[str, int]


@dataclass(frozen=True)
class ObservationFile(ObservationHeader):
    """An observation file as read: `rows` in file order, repeated and backward epochs included; `problems` counts what was dropped."""

    rows: tuple[ObservationRow, ...]
    problems: dict[str, int]


class ObservationBlocks(NamedTuple):
    """A file that is read as its blocks are taken; then `problems` is complete."""

    header: ObservationHeader
    blocks: Iterator[ObservationBlock]
    problems: Counter[str]


def read_blocks(path: Path, receiver: str) -> ObservationBlocks:
    """Read an observation file as blocks of the receiver `receiver`, at most 1,024 epochs each, a few megabytes of text at a time.

    A row of a block per epoch of the file, in its order: times need not increase, and may repeat. Signals of a block are those measured
    in it. Ranges in metres, carrier in cycles, Doppler in hertz, C/N0 in dB-Hz (from S observations; the one-digit signal strength is
    not C/N0). Blank and 0.0 are "not measured"; without a range nothing of a signal is kept. Times are the receiver's own; the clock
    offset of an epoch line is not applied. DecodeError, here or from the blocks, where nothing can be read safely; OSError where the
    file cannot be opened.
    """
    problems: Counter[str] = Counter()
    pieces = _plain(path, read_pieces(path, problems), problems)
    header, rest = _header(path, pieces)
    of = format_of(str(path), header)
    marker = header.first("MARKER NAME")
    interval_s = header.numbers("INTERVAL", range(0, 10, 10), problems)
    xyz = header.numbers("APPROX POSITION XYZ", range(0, 42, 14), problems)
    found = ObservationHeader(
        path=str(path),
        version=header.version,
        marker=marker.content.strip() if marker else "",
        interval_s=interval_s[0] if interval_s and interval_s[0] > 0.0 else None,
        leap_seconds=header.leap_seconds(problems),
        approx_position_ecef_m=(xyz[0], xyz[1], xyz[2]) if xyz and any(xyz) else None,
        glonass_channels=glonass_channels(header, problems),
    )
    return ObservationBlocks(found, _blocks(str(path), receiver, of, chain((rest,), pieces), header.body + 1, problems), problems)


def read_observations(path: Path, receiver: str) -> ObservationFile:
    """Read an observation file whole, as rows of the receiver `receiver`; see `read_blocks`."""
    header, blocks, problems = read_blocks(path, receiver)
    rows = tuple(row for block in blocks for row in rows_of(block))
    return ObservationFile(**vars(header), rows=rows, problems=dict(problems))


def rows_of(block: ObservationBlock) -> Iterator[ObservationRow]:
    """The rows of a block of one receiver, each with the signals measured in it."""
    signals = np.array(block.signals, dtype=object)
    arrays = [getattr(block, name)[:, 0] for name in ROW_ARRAYS]
    measured = np.isfinite(block.pseudorange_m[:, 0])
    for e, t_ns in enumerate(block.receive_time_ns[:, 0].tolist()):
        here = np.flatnonzero(measured[e])
        yield ObservationRow(block.receivers[0], t_ns, tuple(signals[here].tolist()), *(array[e, here] for array in arrays))


def _plain(path: Path, pieces: Iterator[bytes], problems: Counter[str]) -> Iterator[bytes]:
    """The text of a file that may be compressed after Hatanaka."""
    first = next(pieces, b"")
    every = chain((first,), pieces)
    return expanded(str(path), every, problems) if is_compact(first) else every


def _header(path: Path, pieces: Iterator[bytes]) -> tuple[Header, bytes]:
    """The header, and what came with it of the lines after it."""
    head = b""
    for piece in pieces:
        head += piece
        if head.find(b"END OF HEADER") >= 0 or len(head) > LONGEST_HEADER_BYTES:
            break
    if not head.strip():
        raise broken(str(path), 1, "an empty file", "a RINEX file", "fetch the file again")
    lines = head.decode("latin-1").split("\n")[:-1]
    header = read_header(RinexText(str(path), tuple(lines), cut=False), "O", VERSIONS)
    return header, "\n".join([*lines[header.body :], ""]).encode("latin-1")


def _blocks(
    path: str, receiver: str, of: Format, pieces: Iterator[bytes], number: int, problems: Counter[str]
) -> Iterator[ObservationBlock]:
    """The blocks of text whose first line is line `number` of the file; an epoch is read once the next one, or the end, is there."""
    held = b""
    for piece, after in pairwise(chain(pieces, (None,))):
        held += piece or b""
        complete = after is None
        begin = -1
        while begin < len(held):  # again where the header has changed
            held = held[max(0, begin) :]
            text = text_of(held, blanks=SHORTEST_BLANKS + FIELD_BYTES * max(map(len, of.types.values())), number=number)
            every = segments_of(text, of)
            segments = every if complete else every.part(slice(0, -1))
            if complete or len(every.begin):
                leftover(text, 0, int(every.begin[0]) if len(every.begin) else len(text.start), problems)
            epochs, stop, lines = epochs_of(text, segments, of, problems)
            yield from blocks_of(receiver, text, epochs, of, problems)
            line = int(every.begin[stop]) if stop < len(every.begin) else len(text.start) if complete else 0
            begin = int(text.start[line]) if line < len(text.start) else len(held)
            number += line
            if not lines:
                break
            of = changed(of, path, lines)
        held = held[begin:]
        if len(held) > LONGEST_SEGMENT_BYTES:
            held = held[: held.rindex(b"\n", 0, LONGEST_SEGMENT_BYTES) + 1]
