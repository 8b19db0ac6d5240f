"""A text file, plain or gzipped, in pieces of a few megabytes: long files are never in memory as a whole."""

import zlib
from collections import Counter
from collections.abc import Iterable, Iterator
from pathlib import Path

from recordings.rinex.text import GZIP_MAGIC, broken

PIECE_BYTES = 2 << 20
LONGEST_LINE_BYTES = 1 << 20  # what follows in a line is no RINEX and left out


def read_pieces(path: Path, problems: Counter[str]) -> Iterator[bytes]:
    """Whole lines, each ended by a line feed, in pieces of about PIECE_BYTES.

    A gzip stream that ends early is counted in `problems`, and the line it broke off in left out. DecodeError for a damaged gzip stream,
    OSError as `open` does.
    """
    rest = b""
    for chunk in _with_line_feeds(_chunks(path, problems)):
        text = rest + chunk
        end = text.rfind(b"\n") + 1
        rest = text[end:][:LONGEST_LINE_BYTES]
        if end:
            yield text[:end]
    if rest and not problems["file cut off"]:
        yield rest + b"\n"


def _chunks(path: Path, problems: Counter[str]) -> Iterator[bytes]:
    with path.open("rb") as file:
        data = file.read(PIECE_BYTES)
        if not data.startswith(GZIP_MAGIC):
            while data:
                yield data
                data = file.read(PIECE_BYTES)
            return
        while data.startswith(GZIP_MAGIC):  # members of a gzip file. RFC 1952, 2.2
            stream = zlib.decompressobj(wbits=zlib.MAX_WBITS | 16)
            while not stream.eof and data:
                try:
                    yield stream.decompress(data, PIECE_BYTES)
                except zlib.error as error:
                    found = f"a damaged gzip stream ({error})"
                    raise broken(str(path), 1, found, "an intact gzip file or plain text", "fetch the file again") from error
                data = stream.unused_data if stream.eof else stream.unconsumed_tail or file.read(PIECE_BYTES)
            if not stream.eof:
                problems["file cut off"] += 1
                return
            if len(data) < len(GZIP_MAGIC):
                data += file.read(PIECE_BYTES)


def _with_line_feeds(chunks: Iterable[bytes]) -> Iterator[bytes]:
    """Line ends of all systems as a line feed; one of two bytes may be cut in two."""
    held = b""
    for chunk in chunks:
        text = held + chunk
        held = b"\r" if text.endswith(b"\r") else b""
        if b"\r" in text:
            text = text[: len(text) - len(held)].replace(b"\r\n", b"\n").replace(b"\r", b"\n")
        yield text
    if held:
        yield b"\n"
