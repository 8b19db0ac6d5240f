"""UBX: frames of every kind that is read, from the simulator and from the tables, through framer and decoders."""

import re
from collections import Counter
from collections.abc import Sequence
from functools import cache
from random import Random

import numpy as np

from integrity.events import RawBytes
from integrity.gnss.ubx.framing import COUNTED, FIXED, MOST_PENDING_BYTES, Frame, Framer, frame_bytes
from integrity.gnss.ubx.identifiers import SIGNALS
from integrity.gnss.ubx.located import locate
from integrity.gnss.ubx.rawx import RAWX_DTYPE, RAWX_HEADER, RXM_RAWX, decode_rawx
from integrity.gnss.ubx.rawx_log import rawx_blocks
from integrity.gnss.ubx.rxm_raw import RAW_DTYPE, RAW_HEADER, RXM_RAW, decode_raw
from integrity.gnss.ubx.rxm_sfrb import RXM_SFRB, decode_sfrb
from integrity.gnss.ubx.sfrbx import RXM_SFRBX, NavigationWords, decode_sfrbx
from integrity.gnss.ubx.status import STATUS_MESSAGES, decode_status
from recordings.rinex.observation import rows_of
from recordings.simulate.observations import antennas_of
from recordings.simulate.receiver import as_bytes
from tests.fuzz import bounds
from tests.fuzz.framed import assert_framed
from tests.fuzz.mutations import ODD_DOUBLES, ODD_FLOATS, damaged, filled
from tests.fuzz.target import Piece, Target
from tests.fuzz.words import payloads
from tests.unit.streams import SITE, stream

FRAMES = 400  # of a batch
WEEK, TOW_S = 2408, 259_200.0
NOISE = (
    b"$GNRMC,042500.00,A,4533.1,N,07336.9,W,0.0,,020326,,,A*5C\r\n",
    b"\xb5",
    b"\xb5\x62",
    b"\xb5\x62\x02\x15\x30\x08",
    b"\xd3\x00\x13",
)
# Messages that the simulator does not send, with bytes of which the decoders go on.
OTHERS = (
    (0x01, 0x03, b"", 16),
    (0x0A, 0x09, b"", 60),
    (0x27, 0x09, b"\1", 12),
    (0x27, 0x09, b"\2\0\0\2", 12),
    (0x0A, 0x99, b"", 30),
    (5, 1, b"", 2),
)


@cache
def simulated() -> list[bytes]:
    """Frames of a simulated receiver of generation 9, of a few seconds."""
    sent = as_bytes(stream(), antennas_of(SITE))
    bursts = [event.data for event in sent if isinstance(event, RawBytes) and event.receiver == "A"][:6]
    return [frame_bytes(*frame) for frame in Framer().feed(b"".join(bursts))]


def rawx(rng: Random) -> bytes:
    """An epoch of signals of all systems."""
    n = rng.randint(0, 40)
    names = rng.sample([(gnss, sig, sv) for (gnss, sig), s in SIGNALS.items() for sv in range(s.first, s.last + 1)], n)
    m = np.zeros(n, RAWX_DTYPE)
    for i, (gnss, sig, sv) in enumerate(names):
        values = (rng.uniform(2e7, 3.9e7), rng.uniform(1e8, 2e8), rng.uniform(-4e3, 4e3), gnss, sv, sig, rng.randrange(14))
        m[i] = (*values, rng.randrange(65536), rng.randrange(64), 3, 2, 3, rng.choice((7, 7, 3, 15)), 0)
    return frame_bytes(*RXM_RAWX, RAWX_HEADER.pack(TOW_S + rng.randrange(3600), WEEK, 18, n, 1, 1) + m.tobytes())


def raw(rng: Random) -> bytes:
    """An epoch of a receiver before generation 8."""
    satellites = rng.sample([*range(1, 33), *range(120, 159), *range(193, 198)], rng.randint(0, 16))
    m = np.zeros(len(satellites), RAW_DTYPE)
    for i, satellite in enumerate(satellites):
        m[i] = (
            rng.uniform(-2e7, 2e7),
            rng.uniform(2e7, 3.9e7),
            rng.uniform(-4e3, 4e3),
            satellite,
            rng.randint(3, 7),
            rng.randint(20, 50),
            0,
        )
    return frame_bytes(*RXM_RAW, RAW_HEADER.pack(round(TOW_S * 1000) - 1, 1490, len(satellites)) + m.tobytes())


def sfrb(rng: Random) -> bytes:
    return frame_bytes(*RXM_SFRB, bytes((rng.randrange(16), rng.choice((5, 32, 129, 193)))) + rng.randbytes(40))


def sound(rng: Random) -> list[bytes]:
    """Any order, as a log of several receivers might have it."""
    frames = rng.choices(simulated(), k=FRAMES // 2)
    frames += [rawx(rng) for _ in range(FRAMES // 6)] + [raw(rng) for _ in range(FRAMES // 20)] + [sfrb(rng) for _ in range(FRAMES // 20)]
    frames += [frame_bytes(*RXM_SFRBX, payload) for payload in rng.choices(payloads(), k=FRAMES // 6)]
    for kind, number, start, size in rng.choices(OTHERS, k=FRAMES // 20):
        frames.append(frame_bytes(kind, number, start + rng.randbytes(size - len(start))))
    rng.shuffle(frames)
    return frames


def touch(rng: Random, frame: bytes) -> bytes:
    """Damage to the frame as it stands, or to its payload with length and checksum redone."""
    if len(frame) < 8:
        return damaged(rng, frame)
    kind, payload = (frame[2], frame[3]), frame[6:-2]
    match rng.randrange(8):
        case 0 | 1:
            return damaged(rng, frame)
        case 2:
            return frame[:4] + rng.randbytes(2) + frame[6:]
        case 3:
            return rng.choice(NOISE) + frame
        case 4 | 5 if kind in (RXM_RAWX, RXM_RAW):
            return frame_bytes(*kind, odd_measurements(rng, kind, payload))
        case 6:
            return frame_bytes(*kind, fitted(rng, kind, payload))
    return frame_bytes(*kind, (damaged if rng.random() < 0.5 else filled)(rng, payload)[:8192])


def odd_measurements(rng: Random, kind: tuple[int, int], payload: bytes) -> bytes:
    """Numbers that are none, at the end of their range, or of another satellite."""
    head, dtype = (RAWX_HEADER.size, RAWX_DTYPE) if kind == RXM_RAWX else (RAW_HEADER.size, RAW_DTYPE)
    found, fields = bytearray(payload), dtype.fields
    assert fields is not None
    for _ in range(rng.randint(1, 4)):
        kind_of_number, offset = fields[rng.choice(list(fields))][:2]
        size = kind_of_number.itemsize
        places = range(head + offset, len(found) - size + 1, dtype.itemsize)
        if places:
            odd = {8: ODD_DOUBLES, 4: ODD_FLOATS}.get(size)
            value = rng.choice(odd) if odd else rng.choice((b"\0\0", b"\xff\xff", b"\x7f\x7f", rng.randbytes(2)))[:size]
            place = rng.choice(places)
            found[place : place + size] = value
    if rng.random() < 0.3:
        begin, size = rng.choice(((0, 8), (8, 2), (10, 1), (13, 1)) if kind == RXM_RAWX else ((0, 4), (4, 2)))
        found[begin : begin + size] = rng.choice(ODD_DOUBLES) if size == 8 else rng.randbytes(size)
    return bytes(found)


def fitted(rng: Random, kind: tuple[int, int], payload: bytes) -> bytes:
    """Longer or shorter in a way that the framer lets pass, filled with what there was."""
    if kind in COUNTED:
        fixed, block, count_at = COUNTED[kind]
        n = rng.choice((0, 1, 2, 64, 255))
        n = min(n, (8192 - fixed) // block)
        longer = bytearray((payload + payload[fixed:] * (n + 1)).ljust(fixed + n * block, b"\x01")[: fixed + n * block])
        longer[count_at] = n
        return bytes(longer)
    size = rng.choice((*FIXED.get(kind, ()), 0, len(payload) + rng.randint(-4, 4)))
    return payload.ljust(max(0, size), b"\x01")[: max(0, size)]


def is_sound(data: bytes) -> bool:
    """By brute force, a frame from its sync to its checksum."""
    a = b = 0
    for byte in data[2:-2]:
        a = (a + byte) % 256
        b = (b + a) % 256
    return data[:2] == b"\xb5\x62" and int.from_bytes(data[4:6], "little") == len(data) - 8 and data[-2:] == bytes((a, b))


def examine(pieces: Sequence[Piece], rng: Random) -> Counter[str]:
    """Framer, log reader, and every decoder on every payload of its kind."""
    frames: list[Frame] = assert_framed(pieces, rng, Framer, lambda frame: frame_bytes(*frame), is_sound, MOST_PENDING_BYTES)
    rows = [row for row in decode_rawx([f.payload for f in frames if f[:2] == RXM_RAWX], "A") if row is not None]
    _assert_log_holds(b"".join(piece.data for piece in pieces) + bytes(MOST_PENDING_BYTES), frames, len(rows))
    told = Counter(frames=len(frames), rawx=len(rows))
    for frame in frames:
        if frame[:2] == RXM_RAW and (row := decode_raw(frame.payload, "A")) is not None:
            rows.append(row)
            told["raw"] += 1
        words = {RXM_SFRBX: decode_sfrbx, RXM_SFRB: decode_sfrb}.get(frame[:2], lambda _: None)(frame.payload)
        if words is not None:
            _assert_words_in_range(words)
            told["words"] += 1
        if frame[:2] in STATUS_MESSAGES and rng.random() < 0.2 and (status := decode_status(frame)) is not None:
            bounds.assert_status_in_range(status)
            told["status"] += 1
    bounds.assert_rows_in_range(rows, bounds.UBX)
    bounds.assert_satellites({signal[:3] for row in rows for signal in row.signals})
    return told


def _assert_log_holds(log: bytes, frames: list[Frame], n_rows: int) -> None:
    """That a log read as arrays has the same frames and epochs."""
    array = np.frombuffer(log, np.uint8)
    found = locate(array)
    assert [log[a:b] for a, b in zip(found.begin.tolist(), found.end.tolist(), strict=True)] == [frame_bytes(*frame) for frame in frames]
    blocks = list(rawx_blocks(array, found, "A"))
    assert sum(len(block.epoch_ns) for block in blocks) == n_rows
    bounds.assert_rows_in_range((row for block in blocks for row in rows_of(block)), bounds.UBX)


def _assert_words_in_range(words: NavigationWords) -> None:
    bounds.assert_satellites((words.satellite,))
    assert all(0 <= word < 1 << 32 for word in words.words)
    assert words.channel is None or (words.satellite[0] == "R" and -7 <= words.channel <= 6)


def split(data: bytes) -> list[bytes]:
    return re.split(rb"(?=\xb5\x62)", data)


TARGET = Target(sound, touch, split, examine)
