"""RTCM 3: measurements of all systems, ephemerides and positions, with the CRC redone over damaged contents."""

import re
from collections import Counter
from collections.abc import Sequence
from functools import cache
from random import Random

import numpy as np

from integrity.gnss.ephemeris.broadcast import GeoEphemeris, GlonassEphemeris, KeplerEphemeris
from integrity.gnss.gps_time import DAY_S, NS_PER_S, WEEK_NS
from integrity.gnss.navigation.bits import Layout
from integrity.gnss.observations import ObservationRow, same_measurements
from integrity.gnss.rtcm.decoder import MOST_MESSAGES, Decoded, RtcmDecoder
from integrity.gnss.rtcm.framing import MOST_MESSAGE_BYTES, MOST_PENDING_BYTES, RtcmFramer, frame_bytes, message_number
from integrity.gnss.rtcm.masks import SYSTEMS
from integrity.gnss.rtcm.msm import HEADER, MSM_NUMBERS, header_of, table_of
from integrity.gnss.rtcm.msm_writer import encode_row
from integrity.gnss.rtcm.navigation import encode_ephemeris
from integrity.gnss.rtcm.navigation_tables import TABLES as EPHEMERIS_TABLES
from integrity.gnss.rtcm.station import TABLES as STATION_TABLES
from integrity.gnss.rtcm.station import AntennaPosition, encode_position
from tests.fuzz import bounds
from tests.fuzz.framed import assert_framed
from tests.fuzz.mutations import damaged, random_message, with_extremes
from tests.fuzz.target import Piece, Target
from tests.sent_words import START_NS, examples

EPOCHS = 40  # of a batch
MOST_SIGNALS = 400  # whatever is remembered of signals, there are not more of them
CHANNELS = {f"R{slot:02d}": slot % 14 - 7 for slot in range(1, 25)}
NOISE = (b"$GNRMC,042500.00,A,4533.1,N,07336.9,W,0.0,,020326,,,A*5C\r\n", b"\xd3", b"\xd3\x00", b"\xd3\x03\xff", b"\xb5\x62\x02\x15")
KEPT = ("number",)


@cache
def others() -> list[bytes]:
    """Sets of every system, positions, and messages that nobody reads or that are too short."""
    sets = [eph for eph in examples().values() if not isinstance(eph, GeoEphemeris)]
    found = [encode_ephemeris(eph) for eph in sets]
    found.append(encode_position(AntennaPosition(1, True, 4e6, 1e5, 5e6, 1.5)))
    found.append(encode_position(AntennaPosition(4095, False, -4e6, 1e5, -5e6, None)))
    return [*found, b"", b"\x3e", bytes.fromhex("4060aabb"), b"\x43\x50", bytes(30)]


def epoch(rng: Random, time_ns: int) -> list[bytes]:
    """Some signals of all systems as MSM 4 to 7."""
    names = []
    for system in rng.sample(sorted(SYSTEMS.values()), rng.randint(1, 6)):
        satellites = rng.sample(range(system.satellites), min(rng.randint(1, 9), system.satellites))
        codes = rng.sample(sorted(system.codes.values()), min(rng.randint(1, 3), len(system.codes)))
        names += [f"{system.letter}{system.first + s:02d}.{code}" for s in satellites for code in codes]
    n = len(names)
    of_satellite = {name[:3]: rng.uniform(2e7, 4e7) for name in names}
    range_m = np.array([of_satellite[name[:3]] for name in names])
    row = ObservationRow(
        "A",
        time_ns,
        tuple(names),
        pseudorange_m=range_m,
        carrier_cycles=range_m * 5.255,
        doppler_hz=np.array([rng.uniform(-4e3, 4e3) for _ in names]),
        cn0_dbhz=np.array([rng.uniform(20.0, 50.0) for _ in names]),
        lock_s=np.full(n, rng.uniform(0.0, 600.0)),
        slip=np.zeros(n, dtype=np.bool_),
        half_cycle=np.zeros(n, dtype=np.bool_),
    )
    return encode_row(row, rng.randint(4, 7), rng.randrange(4), CHANNELS)


def sound(rng: Random) -> list[bytes]:
    """A stream of a caster, of epochs that follow each other."""
    first, messages = rng.randrange(len(epochs()) - EPOCHS), []
    for k in range(first, first + EPOCHS):
        messages += epochs()[k] + rng.choices(others(), k=rng.randint(0, 2))
    return [frame_bytes(message) for message in messages]


@cache
def epochs() -> list[list[bytes]]:
    """Of some minutes, a second or none between them."""
    rng, found, time_ns = Random(0), [], START_NS
    for _ in range(5 * EPOCHS):
        found.append(epoch(rng, time_ns))
        time_ns += rng.choice((0, NS_PER_S, NS_PER_S, 30 * NS_PER_S))
    return found


def touch(rng: Random, frame: bytes) -> bytes:
    """Damage to the frame as it stands, or to its message with the CRC redone."""
    message = frame[3:-3]
    match rng.randrange(8):
        case 0:
            return damaged(rng, frame)
        case 1:
            return rng.choice(NOISE) + frame
        case 2:
            return frame[:1] + rng.randbytes(2) + frame[3:]
        case 3:
            return frame_bytes(damaged(rng, message)[:MOST_MESSAGE_BYTES])
        case 4:
            return frame_bytes(message[:2] + damaged(rng, message[2:])[: MOST_MESSAGE_BYTES - 2])
    return frame_bytes(with_other_fields(rng, message))


def with_other_fields(rng: Random, message: bytes) -> bytes:
    """A message whose fields are at the ends of their ranges, by the table that reads it."""
    layout = layout_of(message)
    if layout is None or 8 * len(message) < layout.bits:
        return damaged(rng, message)[:MOST_MESSAGE_BYTES]
    spare = 8 * len(message) - layout.bits
    bits = int.from_bytes(message, "big") >> spare
    changed = random_message(rng, layout, KEPT, bits) if rng.random() < 0.05 else with_extremes(rng, layout, bits, KEPT)
    return (changed << spare).to_bytes(len(message), "big")


def layout_of(message: bytes) -> Layout | None:
    number = message_number(message)
    if number is None or number not in MSM_NUMBERS:
        return EPHEMERIS_TABLES.get(number or 0) or STATION_TABLES.get(number or 0)
    header = header_of(message)
    if header is None:
        return None
    masks = header.masks
    return _msm_layout(number, masks.satellites.bit_count(), masks.signals.bit_count(), masks.cells.bit_count())


@cache
def _msm_layout(number: int, n_satellites: int, n_signals: int, n_cells: int) -> Layout:
    """Without cell and masks in the most cases: what they change is another message of which nothing fits."""
    table = table_of(number, n_satellites, n_signals, n_cells)
    often = {name: field for name, field in table.fields.items() if name in dict(HEADER) or name[-1].isdecimal()}
    return Layout(table.bits, often)


def crc_by_bits(data: bytes) -> int:
    crc = 0
    for byte in data:
        crc ^= byte << 16
        for _ in range(8):
            crc = crc << 1 ^ (0x1864CFB if crc & 0x800000 else 0)
    return crc


def is_sound(data: bytes) -> bool:
    """By brute force, a frame from its preamble to its CRC."""
    return data[0] == 0xD3 and int.from_bytes(data[1:3], "big") == len(data) - 6 and crc_by_bits(data) == 0


def examine(pieces: Sequence[Piece], rng: Random) -> Counter[str]:
    """Framer, and a decoder that is told the time or not, whose memory goes round."""
    messages: list[bytes] = assert_framed(pieces, rng, RtcmFramer, frame_bytes, is_sound, MOST_PENDING_BYTES)
    near_ns = rng.choice((None, START_NS, START_NS, START_NS + rng.randint(-WEEK_NS // 2, WEEK_NS // 2)))
    decoder, again, told = RtcmDecoder("A"), RtcmDecoder("A"), Counter(frames=len(messages))
    for message in messages:
        found, as_found = decoder.take(message, near_ns), again.take(message, near_ns)
        assert [_as_bytes(x) for x in as_found] == [_as_bytes(x) for x in found]
        assert_in_range(found, near_ns)
        told.update(type(x).__name__ for x in found)
        if rng.random() < 0.02:
            memory = again.memory()
            assert len(memory.open_messages) <= MOST_MESSAGES
            assert max(len(memory.told), len(memory.locks) / 10) <= MOST_SIGNALS
            again = RtcmDecoder("A", memory)
    return told + Counter(refused=decoder.refused, undated=decoder.undated)


def _as_bytes(found: Decoded) -> object:
    """What can be compared, to the last bit."""
    return _Row(found) if isinstance(found, ObservationRow) else found


class _Row:
    def __init__(self, row: ObservationRow) -> None:
        self.row = row

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Row) and same_measurements(self.row, other.row)

    __hash__ = None  # type: ignore[assignment]


def assert_in_range(told: Sequence[Decoded], near_ns: int | None) -> None:
    for found in told:
        match found:
            case ObservationRow():
                bounds.assert_rows_in_range((found,), bounds.RTCM)
                bounds.assert_satellites({signal[:3] for signal in found.signals})
                assert near_ns is None or abs(found.receive_time_ns - near_ns) <= WEEK_NS // 2 + DAY_S * NS_PER_S
            case KeplerEphemeris() | GlonassEphemeris():
                bounds.assert_sets_in_range((found,))
            case AntennaPosition():
                assert max(abs(found.x_m), abs(found.y_m), abs(found.z_m)) <= 13_743_895.3472 + 1e-6
                assert 0 <= found.station <= 4095
                assert found.height_m is None or 0.0 <= found.height_m <= 6.5535 + 1e-6
            case _:
                raise AssertionError(f"{found} was told by RTCM")


def split(data: bytes) -> list[bytes]:
    return re.split(rb"(?=\xd3[\x00-\x03])", data)


TARGET = Target(sound, touch, split, examine)
