"""Whatever bytes come, and however they are cut: the framer finds every frame that nobody touched, and the decoder neither raises nor
passes on what is out of its field's range.

An untouched frame can be lost in one way only: damage before it happens to be a frame with a sound CRC that reaches into it. The tests
accept that where they find it by brute force, and only there.
"""

import re
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from integrity.gnss.ephemeris.broadcast import GlonassEphemeris, KeplerEphemeris
from integrity.gnss.gps_time import NS_PER_S, WEEK_NS, gps_from_week
from integrity.gnss.observations import ObservationRow
from integrity.gnss.rtcm.decoder import Decoded, RtcmDecoder
from integrity.gnss.rtcm.framing import MOST_PENDING_BYTES, RtcmFramer, frame_bytes
from integrity.gnss.rtcm.masks import SYSTEMS
from integrity.gnss.rtcm.msm import MSM_NUMBERS
from integrity.gnss.rtcm.msm_writer import Values, encode_msm, encode_row
from integrity.gnss.rtcm.navigation import encode_ephemeris
from integrity.gnss.rtcm.navigation_tables import EPHEMERIS_NUMBERS
from integrity.gnss.rtcm.station import STATION_NUMBERS, AntennaPosition, encode_position
from integrity.gnss.signals import carrier_hz
from tests.unit.gnss.rtcm.sets import GLONASS, GPS

FRAMES_PER_EXAMPLE = 4_000
EXAMPLES = 5
NMEA = b"$GNRMC,042500.00,A,4533.1,N,07336.9,W,0.0,,020326,,,A*5C\r\n"
NEAR_NS = gps_from_week(2310, 345_600.0)
T_MS = 345_600_000
LIGHT_MS_M = 299_792.458


class Piece(NamedTuple):
    """Bytes of the stream, and whether they are a frame that nobody touched."""

    data: bytes
    untouched: bool


def crc_by_bits(data: bytes) -> int:
    crc = 0
    for byte in data:
        crc ^= byte << 16
        for _ in range(8):
            crc = crc << 1 ^ (0x1864CFB if crc & 0x800000 else 0)
    return crc


def is_sound(data: bytes) -> bool:
    """By brute force: a frame from its preamble to its CRC."""
    return data[0] == 0xD3 and int.from_bytes(data[1:3], "big") == len(data) - 6 and crc_by_bits(data) == 0


def reference(data: bytes) -> tuple[list[bytes], int]:
    """Messages, and how many of the bytes were decided: one frame after the other by brute force."""
    messages, at = [], 0
    while at < len(data):
        if data[at] != 0xD3 or (at + 1 < len(data) and data[at + 1] > 3):
            at += 1
            continue
        end = at + 6 + int.from_bytes(data[at + 1 : at + 3], "big")
        if len(data) < at + 3 or end > len(data):
            break
        if is_sound(data[at:end]):
            messages.append(data[at + 3 : end - 3])
            at = end
        else:
            at += 1
    return messages, at


frames = st.builds(frame_bytes, st.binary(max_size=20))
bits_of_frames = st.sampled_from([b"\xd3", b"\xd3\x00", b"\xd3\x00\x05\x3e\xd0", b"\xd3\x01\x20", b"\xd3\x04", NMEA, b"\0" * 9])


@given(st.lists(st.one_of(frames, bits_of_frames, st.binary(max_size=12)), max_size=25), st.lists(st.integers(0, 600), max_size=12))
@settings(max_examples=300, deadline=None)
def test_any_cut_gives_what_brute_force_finds(pieces: list[bytes], cuts: list[int]) -> None:
    data = b"".join(pieces)
    expected, decided = reference(data)
    at_once, cut = RtcmFramer(), RtcmFramer()
    assert at_once.feed(data) == expected
    assert at_once.pending == data[decided:]
    assert at_once.skipped_bytes == decided - sum(6 + len(message) for message in expected)
    edges = [0, *sorted(cut for cut in cuts if cut < len(data)), len(data)]
    found = [message for begin, end in pairwise(edges) for message in cut.feed(data[begin:end])]
    assert found == expected
    assert (cut.pending, cut.bad_frames, cut.skipped_bytes) == (at_once.pending, at_once.bad_frames, at_once.skipped_bytes)


numbers = st.sampled_from(sorted(MSM_NUMBERS | EPHEMERIS_NUMBERS | STATION_NUMBERS))


@given(st.lists(st.tuples(numbers, st.binary(max_size=120)), max_size=12), st.one_of(st.none(), st.integers(0, 4000 * WEEK_NS)))
@settings(max_examples=300, deadline=None)
def test_any_messages_do_not_raise(messages: list[tuple[int, bytes]], near_ns: int | None) -> None:
    decoder = RtcmDecoder("A")
    for number, data in messages:
        assert_in_range(decoder.take((number << 4 | 5).to_bytes(2, "big") + data, near_ns))
        decoder = RtcmDecoder("A", decoder.memory())


cells = st.fixed_dictionaries(
    {
        "range_ms": st.one_of(st.none(), st.integers(-16383, 16383).map(lambda n: n * 2.0**-24)),
        "phase_ms": st.one_of(st.none(), st.integers(-2097151, 2097151).map(lambda n: n * 2.0**-29)),
        "lock": st.integers(0, 15),
        "half_cycle": st.integers(0, 1),
        "cn0_dbhz": st.integers(0, 63),
        "fine_rate_mps": st.one_of(st.none(), st.integers(-16383, 16383).map(lambda n: n * 1e-4)),
    }
)
satellites = st.fixed_dictionaries(
    {
        "whole_ms": st.one_of(st.none(), st.integers(33, 254)),
        "part_ms": st.integers(0, 1023).map(lambda n: n * 2.0**-10),
        "rate_mps": st.one_of(st.none(), st.integers(-8191, 8191)),
        "channel": st.integers(0, 13),
    }
)


@given(st.data(), st.sampled_from(sorted(MSM_NUMBERS)))
@settings(max_examples=200, deadline=None)
def test_what_is_written_is_read(data: st.DataObject, number: int) -> None:
    system = SYSTEMS[number - number % 10]
    codes = data.draw(st.lists(st.sampled_from(sorted(system.codes)), min_size=1, max_size=4, unique=True))
    told: dict[int, Values] = data.draw(st.dictionaries(st.integers(1, system.satellites), satellites, min_size=1, max_size=5))
    sent: dict[tuple[int, int], Values] = {(s, k): data.draw(cells) for s in told for k in codes}
    time = T_MS if system.letter != "R" else 4 << 27 | 10_782_000
    (row,) = RtcmDecoder("A").take(encode_msm(number, {"time": time}, told, sent), NEAR_NS)
    assert isinstance(row, ObservationRow)
    for (s, k), cell in sorted(sent.items()):
        signal = f"{system.letter}{system.first + s - 1:02d}.{system.codes[k]}"
        khz = (
            sum(x * y for x, y in zip(carrier_hz(system.letter, system.codes[k][0]) or (), (1, (told[s]["channel"] or 0) - 7), strict=True))
            / 1e3
        )
        expected = [pseudorange(told[s], cell) * LIGHT_MS_M, phase(told[s], cell) * khz if number % 2 or system.letter != "R" else np.nan]
        i = row.signals.index(signal) if signal in row.signals else None
        found = [np.nan, np.nan] if i is None else [row.pseudorange_m[i], row.carrier_cycles[i]]
        np.testing.assert_allclose(found, expected, rtol=1e-15)
        if i is not None:
            assert (np.nan_to_num(row.cn0_dbhz[i]), row.half_cycle[i]) == (cell["cn0_dbhz"], cell["half_cycle"])


def pseudorange(satellite: Values, cell: Values) -> float:
    return rough(satellite) + (np.nan if cell["range_ms"] is None else cell["range_ms"])


def phase(satellite: Values, cell: Values) -> float:
    return rough(satellite) + (np.nan if cell["phase_ms"] is None else cell["phase_ms"])


def rough(satellite: Values) -> float:
    whole_ms, part_ms = satellite["whole_ms"], satellite["part_ms"]
    return np.nan if whole_ms is None or part_ms is None else whole_ms + part_ms


def assert_in_range(told: list[Decoded]) -> None:
    for x in told:
        if isinstance(x, ObservationRow):
            assert_row_in_range(x)
        elif isinstance(x, KeplerEphemeris | GlonassEphemeris):
            assert x.implausibility() is None
        else:
            assert isinstance(x, AntennaPosition)
            assert max(abs(x.x_m), abs(x.y_m), abs(x.z_m)) <= 2**37 * 1e-4
            assert 0 <= x.station <= 4095
            assert x.height_m is None or 0.0 <= x.height_m <= 6.5535


SIGNAL = re.compile(r"[GJ]\d\d\.[1256][A-Z]|R\d\d\.[12][CP]|E\d\d\.[15678][A-Z]|S\d\d\.[15][CIQX]|C\d\d\.[12567][A-Z]")


def assert_row_in_range(row: ObservationRow) -> None:
    assert all(SIGNAL.fullmatch(signal) for signal in row.signals)
    bounds = {
        "pseudorange_m": (33.0 * LIGHT_MS_M - 600.0, 255.0 * LIGHT_MS_M + 600.0),
        "carrier_cycles": (3.8e7, 4.13e8),  # 33 to 255 ms of 1176 to 1606 MHz
        "doppler_hz": (-43_900.0, 43_900.0),  # 8192.64 m/s at 1606 MHz
        "cn0_dbhz": (0.06, 63.94),
        "lock_s": (0.0, 67_108.864),
    }
    for name, (least, most) in bounds.items():
        values = getattr(row, name)
        assert np.all(np.isnan(values) | ((values >= least) & (values <= most))), name
    assert np.all(np.isfinite(row.pseudorange_m) | np.isfinite(row.carrier_cycles))


def a_row(rng: np.random.Generator, time_ns: int) -> ObservationRow:
    """Of all systems, about 35 signals of 24 satellites."""
    every = [
        f"{system.letter}{system.first + s:02d}.{code}"
        for system in SYSTEMS.values()
        for s in rng.choice(system.satellites, min(4, system.satellites), replace=False)
        for code in rng.choice(sorted(system.codes.values()), min(2, len(system.codes)), replace=False)
    ]
    signals = sorted(rng.choice(sorted(set(every)), 35, replace=False).tolist())
    range_m = {signal[:3]: rng.uniform(2e7, 4e7) for signal in signals}
    ranges_m = np.array([range_m[signal[:3]] for signal in signals])
    n = len(signals)
    return ObservationRow(
        "A",
        time_ns,
        tuple(signals),
        pseudorange_m=ranges_m,
        carrier_cycles=ranges_m * 5.255,
        doppler_hz=rng.uniform(-4e3, 4e3, n),
        cn0_dbhz=rng.uniform(20.0, 50.0, n),
        lock_s=np.full(n, 9.0),
        slip=np.zeros(n, dtype=np.bool_),
        half_cycle=np.zeros(n, dtype=np.bool_),
    )


def sound_messages(rng: np.random.Generator) -> list[bytes]:
    """Of every kind."""
    messages = [encode_ephemeris(GPS), encode_ephemeris(GLONASS), encode_position(AntennaPosition(1, True, 4e6, 1e5, 5e6, 1.5))]
    for k in range(12):
        messages += encode_row(a_row(rng, NEAR_NS + k * NS_PER_S), 4 + k % 4)
    return messages


def touched(rng: np.random.Generator, message: bytes) -> Piece:
    """A frame: untouched, or with nonsense inside a sound frame, flipped bits, a wrong length, or cut."""
    frame = bytearray(frame_bytes(message))
    what = rng.choice(5, p=(0.34, 0.30, 0.14, 0.10, 0.12))
    if what == 1:
        nonsense = bytearray(message)
        for at in rng.integers(0, len(message) if rng.random() < 0.5 else min(30, len(message)), 3):
            nonsense[at] = rng.integers(0, 256)
        frame = bytearray(frame_bytes(message[:2] + bytes(nonsense[2:])))
    elif what == 2:
        for at in rng.integers(0, len(frame), 2):
            frame[at] ^= 1 << int(rng.integers(0, 8))
    elif what == 3:
        frame[1:3] = rng.bytes(2)
    elif what == 4:
        del frame[int(rng.integers(0, len(frame))) :]
    return Piece(bytes(frame), what == 0)


def a_stream(rng: np.random.Generator, n: int) -> list[Piece]:
    """Frames of every kind in any order, with noise and NMEA between."""
    messages = sound_messages(rng)
    pieces = [touched(rng, messages[k]) for k in rng.integers(0, len(messages), n)]
    pieces += [Piece(NMEA, False)] * (n // 20) + [Piece(rng.bytes(int(rng.integers(1, 30))), False) for _ in range(n // 20)]
    return [pieces[i] for i in rng.permutation(len(pieces))]


def places_of(messages: list[bytes], stream: bytes) -> dict[int, int]:
    """Where each frame begins and ends, found in order."""
    places, at = {}, 0
    for message in messages:
        begin = stream.find(frame_bytes(message), at)
        assert begin >= at, "a frame that does not stand in the stream"
        at = begin + 6 + len(message)
        places[begin] = at
    return places


def assert_nothing_untouched_is_lost(pieces: list[Piece], messages: list[bytes], stream: bytes) -> None:
    places = places_of(messages, stream)
    begins = np.array(list(places))
    at = 0
    for data, untouched in pieces:
        if untouched and places.get(at) != at + len(data):
            before = int(begins[np.searchsorted(begins, at) - 1])
            assert before < at < places[before], f"the frame at byte {at} is lost and nothing reaches into it"
            assert is_sound(stream[before : places[before]])
        at += len(data)


@given(st.integers(0, 2**63))
@settings(max_examples=EXAMPLES, deadline=None)
def test_many_frames_mutated_and_random(seed: int) -> None:
    rng = np.random.default_rng(seed)
    pieces = a_stream(rng, FRAMES_PER_EXAMPLE)
    # Zeros at the end complete whatever a corrupt length still waits for.
    stream = b"".join(piece.data for piece in pieces) + bytes(MOST_PENDING_BYTES)
    framer, at_once = RtcmFramer(), RtcmFramer()
    messages, at = [], 0
    while at < len(stream):
        size = int(rng.integers(1, 40_000))
        messages += framer.feed(stream[at : at + size])
        at += size
    assert at_once.feed(stream) == messages
    assert (framer.pending, framer.bad_frames, framer.skipped_bytes) == (b"", at_once.bad_frames, at_once.skipped_bytes)
    assert framer.skipped_bytes + sum(6 + len(message) for message in messages) == len(stream)
    assert_nothing_untouched_is_lost(pieces, messages, stream)
    decoder = RtcmDecoder("A")
    rows = 0
    for message in messages:
        told = decoder.take(message, NEAR_NS)
        assert_in_range(told)
        rows += sum(isinstance(x, ObservationRow) for x in told)
    assert rows > FRAMES_PER_EXAMPLE // 10
    assert decoder.refused > 0
