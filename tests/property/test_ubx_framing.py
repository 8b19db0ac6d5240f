"""Whatever bytes come, and however they are cut: the framer finds every frame that nobody touched, and no decoder raises or passes on
what is out of its range.

An untouched frame can be lost in one way only: damage before it happens to be a frame with a sound checksum that reaches into it.
The tests accept that where they find it by brute force, and only there.
"""

import re
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from integrity.gnss.observations import ROW_ARRAYS, ObservationRow, build_block, layout_of
from integrity.gnss.receiver_status import ReceiverStatus
from integrity.gnss.ubx.framing import MOST_PENDING_BYTES, Frame, Framer, frame_bytes
from integrity.gnss.ubx.identifiers import EVERY_CODE
from integrity.gnss.ubx.located import Located, locate
from integrity.gnss.ubx.rawx import RXM_RAWX, decode_rawx
from integrity.gnss.ubx.rawx_log import MOST_EPOCHS, rawx_blocks
from integrity.gnss.ubx.rxm_raw import RXM_RAW, decode_raw
from integrity.gnss.ubx.rxm_sfrb import RXM_SFRB, decode_sfrb
from integrity.gnss.ubx.sfrbx import RXM_SFRBX, NavigationWords, decode_sfrbx
from integrity.gnss.ubx.status import STATUS_MESSAGES, decode_status

Bytes = NDArray[np.uint8]
FRAMES_PER_EXAMPLE = 25_000
EXAMPLES = 40
DECODERS_OF_WORDS = {RXM_SFRBX: decode_sfrbx, RXM_SFRB: decode_sfrb}
NMEA = b"$GNRMC,042500.00,A,4533.1,N,07336.9,W,0.0,,020326,,,A*5C\r\n"

# Kinds of frames: class, id, start of the payload, bytes in all, share. Messages that pyubx2 parses cost a hundred times the others.
KINDS = (
    (0x02, 0x15, bytes(8) + b"\xfc\x08\x12\x04\x01\x01\0\0", 144, 0.32),
    (0x02, 0x10, bytes(4) + b"\xc9\5\3\0", 80, 0.08),
    (0x02, 0x11, b"\1\5", 42, 0.04),
    (0x02, 0x11, b"\1\x81", 42, 0.03),
    (0x02, 0x13, b"\0\5\0\0\x0a\0\2\0", 48, 0.12),
    (0x02, 0x13, b"\2\5\1\0\x08\0\2\0", 40, 0.05),
    (0x02, 0x13, b"\6\5\0\x09\x04\0\2\0", 24, 0.03),
    (0x0A, 0x99, b"", 30, 0.20),
    (0x05, 0x01, b"", 2, 0.10),
    (0x01, 0x03, b"", 16, 0.006),
    (0x01, 0x07, b"", 92, 0.006),
    (0x0A, 0x38, b"\0\2", 52, 0.006),
    (0x0A, 0x09, b"", 60, 0.004),
    (0x27, 0x09, b"\1", 12, 0.004),
    (0x27, 0x09, b"\2\0\0\1", 8, 0.002),
    (0x0A, 0x04, b"EXT CORE", 100, 0.002),
)


class Piece(NamedTuple):
    """Bytes of the stream, and whether they are a frame that nobody touched."""

    data: bytes
    untouched: bool


def is_sound(data: bytes) -> bool:
    """By brute force: a frame from its sync to its checksum."""
    a = b = 0
    for byte in data[2:-2]:
        a = (a + byte) % 256
        b = (b + a) % 256
    return data[:2] == b"\xb5\x62" and int.from_bytes(data[4:6], "little") == len(data) - 8 and data[-2:] == bytes((a, b))


def reference(data: bytes) -> tuple[list[Frame], int]:
    """Frames, and how many of the `bytes` were decided: one frame after the other by brute force. Only for unknown messages."""
    frames, at = [], 0
    while at < len(data):
        if data[at : at + 2] != b"\xb5\x62"[: len(data) - at]:
            at += 1
            continue
        length = int.from_bytes(data[at + 4 : at + 6], "little")
        end = at + 8 + length
        if len(data) < at + 6 or (length <= 8192 and end > len(data)):
            break
        if length <= 8192 and is_sound(data[at:end]):
            frames.append(Frame(data[at + 2], data[at + 3], data[at + 6 : end - 2]))
            at = end
        else:
            at += 2
    return frames, at


unknown_frames = st.builds(frame_bytes, st.just(0x0A), st.just(0x99), st.binary(max_size=20))
bits_of_frames = st.sampled_from([b"\xb5", b"\x62", b"\xb5\x62", b"\xb5\x62\x0a\x99\x05\x00", b"\xb5\x62\x0a\x99\x01\x20", NMEA, b"\0" * 9])


@given(st.lists(st.one_of(unknown_frames, bits_of_frames, st.binary(max_size=12)), max_size=25), st.lists(st.integers(0, 600), max_size=12))
@settings(max_examples=400, deadline=None)
def test_any_cut_gives_what_brute_force_finds(pieces: list[bytes], cuts: list[int]) -> None:
    data = b"".join(pieces)
    expected, decided = reference(data)
    at_once, cut = Framer(), Framer()
    assert at_once.feed(data) == expected
    assert at_once.pending == data[decided:]
    assert at_once.skipped_bytes == decided - sum(8 + len(f.payload) for f in expected)
    edges = [0, *sorted(cut for cut in cuts if cut < len(data)), len(data)]
    found = [frame for begin, end in pairwise(edges) for frame in cut.feed(data[begin:end])]
    assert found == expected
    assert (cut.pending, cut.bad_frames, cut.skipped_bytes) == (at_once.pending, at_once.bad_frames, at_once.skipped_bytes)


def assert_located_as_framed(data: bytes) -> Located:
    """That the frames and counters of a whole log are those of a framer."""
    framer, found = Framer(), locate(np.frombuffer(data, np.uint8))
    frames = [data[begin:end] for begin, end in zip(found.begin.tolist(), found.end.tolist(), strict=True)]
    assert frames == [frame_bytes(*frame) for frame in framer.feed(data)]
    counted = found.bad_frames, found.skipped_bytes, data[found.decided_bytes :]
    assert counted == (framer.bad_frames, framer.skipped_bytes, framer.pending)
    return found


known_frames = st.sampled_from([(0x02, 0x15), (0x02, 0x13), (0x02, 0x10), (0x0A, 0x38), (0x01, 0x07)]).flatmap(
    lambda message: st.binary(max_size=60).map(lambda payload: frame_bytes(*message, payload))
)


@given(st.lists(st.one_of(known_frames, known_frames.map(lambda f: f[:-3]), bits_of_frames, st.binary(max_size=12)), max_size=12))
@settings(max_examples=200, deadline=None)
def test_byte_by_byte_gives_the_same_where_lengths_are_known(pieces: list[bytes]) -> None:
    data = b"".join(pieces)
    at_once, cut = Framer(), Framer()
    assert [frame for byte in data for frame in cut.feed(bytes((byte,)))] == at_once.feed(data)
    assert (cut.pending, cut.bad_frames, cut.skipped_bytes) == (at_once.pending, at_once.bad_frames, at_once.skipped_bytes)


@given(
    st.lists(
        st.one_of(
            unknown_frames, known_frames, unknown_frames.map(lambda f: f[:-1] + b"?"), known_frames.map(lambda f: f[:-3]), bits_of_frames
        ),
        max_size=20,
    )
)
@settings(max_examples=400, deadline=None)
def test_the_frames_of_a_whole_log_are_those_of_a_framer(pieces: list[bytes]) -> None:
    # Frames within frames, of which some are damaged: what a reader meets depends on what stands before.
    assert_located_as_framed(b"".join(pieces) + frame_bytes(0x0A, 0x99, b"".join(pieces)) + b"".join(pieces[::2]))


def frames_of(rng: np.random.Generator, kind: tuple[int, int, bytes, int, float], n: int) -> list[Piece]:
    """n frames of one kind: a third untouched, the rest with nonsense inside a sound frame, flipped bits, a wrong length, or cut."""
    message_class, message_id, start, size, _ = kind
    frames = np.empty((n, size + 8), np.uint8)
    frames[:, :6] = [0xB5, 0x62, message_class, message_id, size % 256, size // 256]
    payload = frames[:, 6 : 6 + size]
    payload[:] = rng.integers(0, 256, (n, size), np.uint8)
    payload[:, : len(start)] = np.frombuffer(start, np.uint8)
    if (message_class, message_id) == RXM_RAWX:
        plausible_measurements(rng, payload)
    if (message_class, message_id) == RXM_RAW:
        plausible_measurements_before_8(rng, payload)
    what = rng.choice(5, n, p=(0.34, 0.30, 0.14, 0.10, 0.12))
    nonsense = (what == 1)[:, None] & (rng.random((n, size)) < 2.0 / size)
    payload[nonsense] = rng.integers(0, 256, int(nonsense.sum()), np.uint8)
    seal(frames)
    whole = what == 0
    flipped = (what == 2)[:, None] & (rng.random((n, size + 8)) < 2.0 / size)
    flipped[np.arange(n), rng.integers(0, size + 8, n)] |= what == 2
    frames[flipped] ^= (1 << rng.integers(0, 8, int(flipped.sum()))).astype(np.uint8)
    lengths = what == 3
    frames[lengths, 4:6] = rng.integers(0, 256, (int(lengths.sum()), 2), np.uint8)
    ends = np.where(what == 4, rng.integers(0, size + 8, n), size + 8)
    return [Piece(row.tobytes()[:end], bool(good)) for row, end, good in zip(frames, ends, whole, strict=True)]


def plausible_measurements(rng: np.random.Generator, payload: Bytes) -> None:
    """Four measurements each, of GPS, Galileo and others; the satellites of one epoch differ."""
    n = len(payload)
    payload[:, :8] = rng.uniform(0, 604_800, n).astype("<f8").view(np.uint8).reshape(n, 8)
    for i in range(4):
        m = payload[:, 16 + 32 * i : 48 + 32 * i]
        m[:, :8] = rng.uniform(2e7, 3e7, n).astype("<f8").view(np.uint8).reshape(n, 8)
        m[:, 8:16] = rng.uniform(1e8, 1.5e8, n).astype("<f8").view(np.uint8).reshape(n, 8)
        m[:, 16:20] = rng.uniform(-4e3, 4e3, n).astype("<f4").view(np.uint8).reshape(n, 4)
        m[:, 20:23] = [(0, 2, 0, 6)[i], i + 1, (0, 1, 3, 0)[i]]


def plausible_measurements_before_8(rng: np.random.Generator, payload: Bytes) -> None:
    """Three measurements each, of GPS and SBAS."""
    n = len(payload)
    payload[:, :4] = rng.integers(0, 604_800_000, n).astype("<i4").view(np.uint8).reshape(n, 4)
    for i, satellite in enumerate((5, 17, 129)):
        m = payload[:, 8 + 24 * i : 32 + 24 * i]
        m[:, :8] = rng.uniform(1e8, 1.5e8, n).astype("<f8").view(np.uint8).reshape(n, 8)
        m[:, 8:16] = rng.uniform(2e7, 3e7, n).astype("<f8").view(np.uint8).reshape(n, 8)
        m[:, 16:20] = rng.uniform(-4e3, 4e3, n).astype("<f4").view(np.uint8).reshape(n, 4)
        m[:, 20] = satellite


def seal(frames: Bytes) -> None:
    body = frames[:, 2:-2].astype(np.int64)
    frames[:, -2] = body.sum(axis=1) % 256
    frames[:, -1] = (body * np.arange(body.shape[1], 0, -1)).sum(axis=1) % 256


def a_stream(rng: np.random.Generator) -> list[Piece]:
    """Frames of every kind in any order, with noise and NMEA between."""
    pieces = [Piece(NMEA, False)] * (FRAMES_PER_EXAMPLE // 20)
    noise = rng.integers(0, 256, (FRAMES_PER_EXAMPLE // 20, 30), np.uint8)
    pieces += [Piece(row.tobytes()[: 1 + row[0] % 30], False) for row in noise]
    for kind in KINDS:
        pieces += frames_of(rng, kind, round(kind[-1] * FRAMES_PER_EXAMPLE))
    return [pieces[i] for i in rng.permutation(len(pieces))]


def places_of(frames: list[Frame], stream: bytes) -> dict[int, int]:
    """Where each frame begins and ends, found in order."""
    places, at = {}, 0
    for frame in frames:
        length = len(frame.payload)
        head = bytes((0xB5, 0x62, frame.message_class, frame.message_id, length % 256, length // 256))
        begin = stream.find(head + frame.payload, at)
        assert begin >= at, "a frame that does not stand in the stream"
        at = begin + 8 + length
        places[begin] = at
    return places


def assert_nothing_untouched_is_lost(pieces: list[Piece], frames: list[Frame], stream: bytes) -> None:
    places = places_of(frames, stream)
    begins = np.array(list(places))
    at, untouched = 0, set()
    for data, good in pieces:
        if good:
            untouched.add(at)
            if places.get(at) != at + len(data):
                before = int(begins[np.searchsorted(begins, at) - 1])
                assert before < at < places[before], f"the frame at byte {at} is lost and nothing reaches into it"
        at += len(data)
    for begin in places.keys() - untouched:
        assert is_sound(stream[begin : places[begin]])


SATELLITES = (
    r"(G(0[1-9]|[12]\d|3[0-2])|E(0[1-9]|[12]\d|3[0-6])|C(0[1-9]|[1-5]\d|6[0-3])|R(0[1-9]|[12]\d|3[0-2])|J(0[1-9]|10)|S([2-4]\d|5[0-8]))"
)


def assert_rows_in_range(rows: list[ObservationRow]) -> None:
    names = {s for row in rows for s in row.signals}
    assert all(re.fullmatch(SATELLITES, s[:3]) and s[3] == "." and s[4:] in EVERY_CODE[s[0]] for s in names)
    week_ns = 604_800 * 10**9
    assert all(1200 * week_ns <= row.receive_time_ns <= 4096 * week_ns for row in rows)
    bounds = {
        "carrier_cycles": (-1e9, 1e9),
        "doppler_hz": (-3e4, 3e4),
        "cn0_dbhz": (0, 63),
        "lock_s": (0, 64.5),
    }
    for name, (least, most) in bounds.items():
        values = np.concatenate([getattr(row, name) for row in rows])
        assert np.all(np.isnan(values) | ((values >= least) & (values <= most)))
    most_m = np.array([5.5e7 if s[0] in "CJS" else 4.0e7 for row in rows for s in row.signals])
    ranges_m = np.concatenate([row.pseudorange_m for row in rows])
    assert np.all(np.isnan(ranges_m) | ((ranges_m >= 1e7) & (ranges_m <= most_m)))
    has_any = [np.isfinite(row.pseudorange_m) | np.isfinite(row.carrier_cycles) for row in rows]
    assert np.concatenate(has_any).all()


def assert_words_in_range(words: NavigationWords) -> None:
    kinds = {"G1C": 10, "J1C": 10, "E1B": 8, "E7I": 8, "E5I": 8, "C2I": 10, "C7I": 10, "C6I": 10, "R1C": 4, "R2C": 4, "S1C": 8}
    assert len(words.words) == kinds[words.satellite[0] + words.signal]
    assert re.fullmatch(SATELLITES, words.satellite)
    assert all(0 <= word < 1 << 32 for word in words.words)
    assert words.channel is None or (words.satellite[0] == "R" and -7 <= words.channel <= 6)


def assert_status_in_range(status: ReceiverStatus) -> None:
    assert status.lat_rad is None or abs(status.lat_rad) <= np.pi / 2
    assert status.lon_rad is None or abs(status.lon_rad) <= np.pi
    assert status.height_m is None or -1000 <= status.height_m <= 80_000
    assert status.agc is None or 0 <= status.agc <= 1
    assert status.model is None or status.model.isprintable()


@given(st.integers(0, 2**63))
@settings(max_examples=EXAMPLES, deadline=None)
def test_a_million_frames_mutated_and_random(seed: int) -> None:
    rng = np.random.default_rng(seed)
    pieces = a_stream(rng)
    # Zeros at the end complete whatever a corrupt length still waits for.
    stream = b"".join(piece.data for piece in pieces) + bytes(MOST_PENDING_BYTES)
    framer = Framer()
    frames, at = [], 0
    while at < len(stream):
        size = int(rng.integers(1, 40_000))
        frames += framer.feed(stream[at : at + size])
        at += size
    at_once = Framer()
    assert at_once.feed(stream) == frames
    assert (framer.pending, framer.bad_frames, framer.skipped_bytes) == (b"", at_once.bad_frames, at_once.skipped_bytes)
    assert framer.skipped_bytes + sum(8 + len(f.payload) for f in frames) == len(stream)
    assert_nothing_untouched_is_lost(pieces, frames, stream)
    assert_located_as_framed(stream)
    rows = [row for row in decode_rawx([f.payload for f in frames if f[:2] == RXM_RAWX], "A") if row is not None]
    assert_blocks_hold(stream, rows)
    rows += [row for row in (decode_raw(f.payload, "A") for f in frames if f[:2] == RXM_RAW) if row is not None]
    assert_rows_in_range(rows)
    for frame in frames:
        if frame[:2] in DECODERS_OF_WORDS and (words := DECODERS_OF_WORDS[frame[:2]](frame.payload)) is not None:
            assert_words_in_range(words)
        elif frame[:2] in STATUS_MESSAGES and (status := decode_status(frame)) is not None:
            assert_status_in_range(status)


def assert_blocks_hold(stream: bytes, rows: list[ObservationRow]) -> None:
    """That the blocks of a log hold what its rows hold."""
    log = np.frombuffer(stream, np.uint8)
    blocks = list(rawx_blocks(log, locate(log), "A"))
    assert sum(len(block.epoch_ns) for block in blocks) == len(rows) and all(len(block.epoch_ns) <= MOST_EPOCHS for block in blocks)
    at = 0
    for block in blocks:
        some, at = rows[at : at + len(block.epoch_ns)], at + len(block.epoch_ns)
        expected = build_block(["A"], [row.receive_time_ns for row in some], [[row] for row in some], layout_of(some, codes=EVERY_CODE))
        assert block.signals == expected.signals
        for name in ("receive_time_ns", *ROW_ARRAYS):
            np.testing.assert_array_equal(getattr(block, name), getattr(expected, name))


@given(st.binary(max_size=200), st.sampled_from([RXM_RAWX, RXM_SFRBX, *sorted(STATUS_MESSAGES)]))
@settings(max_examples=300, deadline=None)
def test_payloads_that_no_framer_let_through_do_not_raise(payload: bytes, message: tuple[int, int]) -> None:
    decode_rawx([payload], "A")
    decode_raw(payload, "A")
    decode_sfrbx(payload)
    decode_sfrb(payload)
    decode_status(Frame(*message, payload))
