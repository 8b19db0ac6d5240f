"""Logs of u-blox receivers: told from other files by what is in them, and cut into pieces that each end with the measurements of an epoch.

A piece is everything since the measurements before it. Thus its navigation words had arrived when its epoch was measured, and none is
known earlier than that; what came after the last measurements is the tail. No byte is left out: text, other messages and damage go
along, as they would have come over a link.

Files of one receiver are read as one stream, in order of time: a frame that two parts share is whole, what they both hold counts once.
"""

import zlib
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

import numpy as np

from integrity.errors import DecodeError
from integrity.gnss.gps_time import WEEK_NS, format_utc
from integrity.gnss.ubx.framing import FRAME_BYTES, HEADER_BYTES, Frame, Framer, frame_bytes
from integrity.gnss.ubx.located import Located, kind_of, locate
from integrity.gnss.ubx.rawx import FIRST_WEEK, RAWX_HEADER, RXM_RAWX
from integrity.gnss.ubx.rawx_log import rawx_epochs
from integrity.gnss.ubx.rxm_raw import FIRST_WEEK as FIRST_WEEK_BEFORE_8
from integrity.gnss.ubx.rxm_raw import RAW_HEADER, RXM_RAW, decode_raw
from integrity.gnss.ubx.rxm_sfrb import RXM_SFRB, decode_sfrb
from integrity.gnss.ubx.sfrbx import RXM_SFRBX, decode_sfrbx
from recordings.rinex.text import GZIP_MAGIC, broken

CHUNK_BYTES = 1 << 20
CHECKSUM_BYTES = FRAME_BYTES - HEADER_BYTES
RINEX_LABELS = (b"RINEX VERSION / TYPE", b"CRINEX VERS   / TYPE")
LABEL_COLUMNS = slice(60, 80)

TIME_JUMP_NS = WEEK_NS // 2  # within one file: the receiver learned the time, or the week, in between
NAMES = {RXM_RAW: "RXM-RAW", RXM_SFRB: "RXM-SFRB", RXM_RAWX: "RXM-RAWX", RXM_SFRBX: "RXM-SFRBX", (0x01, 0x07): "NAV-PVT"}

MEASURED = (RXM_RAWX, RXM_RAW)
DECODERS_OF_WORDS = {RXM_SFRBX: decode_sfrbx, RXM_SFRB: decode_sfrb}

Kinds = Counter[tuple[int, int]]  # frames by class and id


class Piece(NamedTuple):
    """Bytes of a log up to the end of the RXM-RAWX or RXM-RAW of `receive_time_ns` (GPS time), the last `measured_bytes` of them."""

    receive_time_ns: int
    data: bytes
    measured_bytes: int

    @property
    def measured(self) -> bytes:
        """The frame at its end."""
        return self.data[-self.measured_bytes :]


@dataclass(frozen=True)
class UbxLog:
    """The logs of one receiver: `pieces` by time, then the `tail`; `words` counts RXM-SFRBX and RXM-SFRB.

    `passed_over` counts what stands in these bytes and cannot be decoded, `dropped` what is not among them.
    """

    paths: tuple[str, ...]
    pieces: tuple[Piece, ...]
    tail: bytes
    words: int
    passed_over: dict[str, int]
    dropped: dict[str, int]
    warnings: tuple[str, ...]


def is_ubx(path: Path) -> bool:
    """Whether a file, plain or gzipped, holds sound UBX frames. What begins as RINEX, or is empty, is for the reader of RINEX.

    DecodeError for a file with neither, and for a damaged gzip stream.
    """
    framer = Framer()
    first, size = b"", 0
    for chunk in _chunks(path, Counter()):
        first = first or chunk
        if first[LABEL_COLUMNS] in RINEX_LABELS:
            return False
        if framer.feed(chunk):
            return True
        size += len(chunk)
    if not first.strip():
        return False
    line = first[:80].decode("latin-1").splitlines()[0]
    expected = "RINEX VERSION / TYPE in columns 61 to 80, or UBX frames (B5 62) with sound checksums"
    found = f"{line!r} and no sound UBX frame in {size} bytes"
    raise broken(str(path), 1, found, expected, "give a RINEX file with observation data, or the log of a u-blox receiver")


def read_ubx(paths: Sequence[Path], receiver: str) -> UbxLog:
    """Read the logs of one receiver, in any order; DecodeError for one that holds no measurements with a time, or is damaged gzip."""
    cutter = _Cutter(receiver)
    for path in sorted(paths, key=lambda path: _first_epoch_ns(path, receiver)):
        cutter.read(path)
    return cutter.log()


def words_of(pieces: Sequence[Piece]) -> bytes:
    """The frames of navigation words that can be read in pieces of a log, and nothing else."""
    frames = (frame for piece in pieces for frame in Framer().feed(piece.data))
    return b"".join(frame_bytes(*frame) for frame in frames if _holds_words(frame))


def _holds_words(frame: Frame) -> bool:
    decode = DECODERS_OF_WORDS.get((frame.message_class, frame.message_id))
    return decode is not None and decode(frame.payload) is not None


class _Cutter:
    """Cuts the files of one receiver, one after the other."""

    def __init__(self, receiver: str) -> None:
        self._receiver = receiver
        self._since = bytearray()  # the last measurements
        self._open = b""  # at its end: begins a frame, perhaps
        self._paths: list[str] = []
        self._pieces: list[Piece] = []
        self._words = 0
        self._passed_over: Counter[str] = Counter()
        self._dropped: Counter[str] = Counter()
        self._warnings: list[str] = []

    def read(self, path: Path) -> None:
        """The file that follows."""
        pieces = [piece for chunk in _chunks(path, self._dropped) for piece in self._cut(chunk)]
        self._pieces += self._after_jump(path, pieces)
        self._paths.append(str(path))

    def log(self) -> UbxLog:
        """What was read, by time."""
        pieces = self._once(sorted(self._pieces, key=lambda piece: piece.receive_time_ns))
        self._passed_over["bytes of a frame that does not end"] += len(self._open)
        return UbxLog(
            paths=tuple(self._paths),
            pieces=tuple(pieces),
            tail=bytes(self._since),
            words=self._words,
            passed_over=dict(self._passed_over),
            dropped=dict(self._dropped),
            warnings=tuple(self._warnings),
        )

    def _cut(self, chunk: bytes) -> list[Piece]:
        """The pieces that a chunk completes."""
        data = self._open + chunk
        frames = locate(np.frombuffer(data, np.uint8))
        self._since += chunk
        self._open = data[frames.decided_bytes :]
        self._words += int(np.isin(frames.kind, [kind_of(message) for message in DECODERS_OF_WORDS]).sum())
        self._passed_over["bad frames"] += frames.bad_frames
        self._passed_over["bytes that are not UBX"] += frames.skipped_bytes
        times_ns = _measured_ns(data, frames, self._receiver)
        pieces: list[Piece] = []
        known, cut = len(self._since) - len(data), 0
        for i in np.flatnonzero(np.isin(frames.kind, [kind_of(message) for message in MEASURED])).tolist():
            begin, end = int(frames.begin[i]), int(frames.end[i])
            if i in times_ns:
                pieces.append(Piece(times_ns[i], bytes(self._since[cut : known + end]), end - begin))
                cut = known + end
            else:
                self._passed_over[_why_not(data[begin:end])] += 1
        del self._since[:cut]
        return pieces

    def _after_jump(self, path: Path, pieces: list[Piece]) -> list[Piece]:
        jumps = [i for i, (a, b) in enumerate(pairwise(pieces), 1) if abs(b.receive_time_ns - a.receive_time_ns) > TIME_JUMP_NS]
        if not jumps:
            return pieces
        first = jumps[-1]
        before, after = (format_utc(piece.receive_time_ns) for piece in pieces[first - 1 : first + 1])
        self._dropped["before the receiver's time jumped"] += first
        self._warnings.append(
            f"{path}: time jumps from {before} to {after}, and the {first} epochs before are dropped: the receiver did not know the time; "
            "where it did, and the log was merely continued later, give the two parts as two files"
        )
        return pieces[first:]

    def _once(self, pieces: Sequence[Piece]) -> list[Piece]:
        """Without those whose measurements were there already; other measurements of the same time stay: they are a contradiction."""
        kept: list[Piece] = []
        now: set[bytes] = set()
        for piece in pieces:
            if not kept or piece.receive_time_ns != kept[-1].receive_time_ns:
                now.clear()
            if piece.measured in now:
                self._dropped["epoch repeated"] += 1
            else:
                kept.append(piece)
                now.add(piece.measured)
        return kept


def _measured_ns(data: bytes, frames: Located, receiver: str) -> dict[int, int]:
    """GPS time of the measurements in these frames, by number of the frame; those without one that can be used are not there."""
    epochs = rawx_epochs(np.frombuffer(data, np.uint8), frames)
    times_ns = dict(zip(epochs.frame.tolist(), epochs.receive_time_ns.tolist(), strict=True))
    for i in np.flatnonzero(frames.kind == kind_of(RXM_RAW)).tolist():
        row = decode_raw(data[int(frames.begin[i]) + HEADER_BYTES : int(frames.end[i]) - CHECKSUM_BYTES], receiver)
        if row is not None:
            times_ns[i] = row.receive_time_ns
    return times_ns


def _why_not(frame: bytes) -> str:
    """In words, why RXM-RAWX or RXM-RAW gave no row."""
    old = tuple(frame[2:4]) == RXM_RAW
    header, first_week = (RAW_HEADER, FIRST_WEEK_BEFORE_8) if old else (RAWX_HEADER, FIRST_WEEK)
    week = header.unpack_from(frame, HEADER_BYTES)[1] if len(frame) >= FRAME_BYTES + header.size else first_week
    return "measured before the time was known" if week < first_week else "measurements not readable"


def _first_epoch_ns(path: Path, receiver: str) -> int:
    """GPS time of the first measurements in a log; DecodeError where there are none."""
    kinds: Kinds = Counter()
    open_ = b""
    for chunk in _chunks(path, Counter()):
        data = open_ + chunk
        frames = locate(np.frombuffer(data, np.uint8))
        open_ = data[frames.decided_bytes :]
        times_ns = _measured_ns(data, frames, receiver)
        if times_ns:
            return times_ns[min(times_ns)]
        kinds.update((kind >> 8, kind & 0xFF) for kind in frames.kind.tolist())
    raise _nothing_measured(path, kinds)


def _nothing_measured(path: Path, kinds: Kinds) -> DecodeError:
    named = {kind: n for kind, n in sorted(kinds.items()) if kind in NAMES}
    parts = [f"{NAMES[kind]} x {n}" for kind, n in named.items()]
    others = kinds.total() - sum(named.values())
    found = ", ".join(parts + ([f"{others} other messages"] if others else [])) or "no sound UBX frame"
    if RXM_RAWX in kinds or RXM_RAW in kinds:
        why = "expected measurements with the GPS time, which the receiver never knew; record until it has a position"
    else:
        why = (
            "expected RXM-RAWX, and RXM-SFRBX for the ephemerides (before generation 8: RXM-RAW and RXM-SFRB); "
            "switch both on at the receiver and record again"
        )
    return DecodeError(f"{path}: found {found}; {why}")


def _chunks(path: Path, problems: Counter[str]) -> Iterator[bytes]:
    """Content of a plain file, or of all members of a gzipped one, which may end early: counted. Source: RFC 1952, 2.2."""
    with path.open("rb") as file:
        data = file.read(CHUNK_BYTES)
        if not data.startswith(GZIP_MAGIC):
            while data:
                yield data
                data = file.read(CHUNK_BYTES)
            return
        stream = _gunzip()
        while data:
            if stream.eof:
                if not data.startswith(GZIP_MAGIC):
                    return  # padding
                stream = _gunzip()
            try:
                content = stream.decompress(data, CHUNK_BYTES)
            except zlib.error as error:
                found = f"a damaged gzip stream ({error})"
                raise broken(str(path), 1, found, "an intact gzip file or a plain one", "fetch the file again") from error
            if content:
                yield content
            data = (stream.unused_data if stream.eof else stream.unconsumed_tail) or file.read(CHUNK_BYTES)
        if not stream.eof:
            problems["file cut off"] += 1


def _gunzip() -> "zlib._Decompress":
    return zlib.decompressobj(wbits=zlib.MAX_WBITS | 16)
