"""Damage to files of text in columns, and what must hold of their readers: a refusal, or numbers in range and every untouched record."""

import gzip
import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path
from random import Random
from typing import TypeVar

from integrity.errors import DecodeError
from tests.fuzz.mutations import damaged
from tests.fuzz.target import Piece

_File = TypeVar("_File")
LIKELY = b" 0123456789.-+DEGRECJSnaif*&>\n\r\t\x00\xff"  # what does most harm in such a file
NUMBERS = (b"          .000", b"9999999999.999", b"-999999999.999", b"20000000.0000 ", b"           nan", b"  1.000000E+09", b" " * 14)
REALS = (b" 9.999999999999D+99", b"-9.999999999999D+99", b" 0.000000000000D+00", b" 1.000000000000D-99", b"                nan", b" " * 19)


def touched_text(rng: Random, text: bytes) -> bytes:
    """A record with bytes, lines or numbers changed."""
    for _ in range(rng.choice((1, 1, 2, 4))):
        text = rng.choice((_character, _character, _character, _lines, _number, damaged))(rng, text)
    return text


def _character(rng: Random, text: bytes) -> bytes:
    place = rng.randint(0, len(text))
    found = rng.choice((b"", bytes((rng.choice(LIKELY),)), bytes((rng.choice(LIKELY),))))
    return text[:place] + found + text[place + rng.randint(0, 1) :]


def _lines(rng: Random, text: bytes) -> bytes:
    """A line lost, doubled or in another place."""
    lines = text.splitlines(keepends=True)
    if not lines:
        return text
    line = lines.pop(rng.randrange(len(lines)))
    for _ in range(rng.randrange(3)):
        lines.insert(rng.randint(0, len(lines)), line)
    return b"".join(lines)


def _number(rng: Random, text: bytes) -> bytes:
    """Another number, in the columns of one as often as not."""
    number = rng.choice((*NUMBERS, *REALS))
    lines = text.split(b"\n")
    k = rng.randrange(len(lines))
    width = 16 if len(number) == 14 else 19
    place = rng.choice((3, 0, 4)) + width * rng.randrange(5)
    if place + len(number) <= len(lines[k]):
        lines[k] = lines[k][:place] + number + lines[k][place + len(number) :]
    return b"\n".join(lines)


def of_whole_lines(pieces: Sequence[Piece]) -> list[Piece]:
    """A record is touched too where the line before it does not end."""
    before = [b"\n", *(piece.data for piece in pieces)]
    return [piece._replace(untouched=piece.untouched and last[-1:] == b"\n") for piece, last in zip(pieces, before, strict=False)]


def read(data: bytes, reader: Callable[[Path], _File], packed: bool = False) -> _File | None:
    """What a reader makes of a file with these bytes; None where it refuses them."""
    with tempfile.TemporaryDirectory() as directory:
        path = Path(directory) / "file"
        path.write_bytes(gzip.compress(data, 1) if packed else data)
        try:
            return reader(path)
        except DecodeError:
            return None
