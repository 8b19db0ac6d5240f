"""Our RTCM 3 against pyrtcm's: the same frames, the same numbers in every field, on a reference station's log and on messages we encode.

pyrtcm multiplies a number by its unit; divided by it and rounded, it is the number as sent. Our names and pyrtcm's data fields are
matched by their order in the message, which the two tables state independently.
"""

import io
import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from integrity.gnss.navigation.bits import SEMICIRCLE_RAD, Layout
from integrity.gnss.rtcm import navigation_tables, station
from integrity.gnss.rtcm.framing import RtcmFramer, frame_bytes, message_number
from integrity.gnss.rtcm.masks import SYSTEMS
from integrity.gnss.rtcm.measurements import measured
from integrity.gnss.rtcm.msm import CELL_FIELDS, MSM_NUMBERS, SATELLITE_FIELDS, header_of, none_of, table_of
from integrity.gnss.rtcm.msm_writer import encode_msm

pyrtcm = pytest.importorskip("pyrtcm")
from pyrtcm import RTCM_DATA_FIELDS, RTCMMessage, RTCMReader  # noqa: E402 - only where it is installed
from pyrtcm.rtcmtypes_get import RTCM_PAYLOADS_GET  # noqa: E402

TABLES = {**navigation_tables.TABLES, **station.TABLES}
KM, SEMICIRCLE = 1000.0, SEMICIRCLE_RAD
UNITS = {2**-11 * KM: 2**-11, 2**-20 * KM: 2**-20, 2**-30 * KM: 2**-30, 1e-10: 0.1}  # ours, pyrtcm's: metres and km, seconds and ns

# Of MSM: the data fields of the header in order, and those of satellites and cells by our names.
HEADER_FIELDS = ["DF002", "DF003", "{}", "DF393", "DF409", "DF001_7", "DF411", "DF412", "DF417", "DF418", "DF394", "DF395", "DF396"]
TIME_FIELDS = {"G": "DF004", "E": "DF248", "S": "DF004", "J": "DF428", "C": "DF427"}
FIELDS = {"whole_ms": "DF397", "channel": "ExtSatInfo", "part_ms": "DF398", "rate_mps": "DF399", "half_cycle": "DF420"}
SHORT = FIELDS | {"range_ms": "DF400", "phase_ms": "DF401", "lock": "DF402", "cn0_dbhz": "DF403", "fine_rate_mps": "DF404"}
LONG = FIELDS | {"range_ms": "DF405", "phase_ms": "DF406", "lock": "DF407", "cn0_dbhz": "DF408", "fine_rate_mps": "DF404"}
MOST_PRN = {"G": 32, "E": 36}  # pyrtcm names what is reserved as well
LIGHT_MS_M = 299_792.458


@pytest.fixture(scope="module")
def stream(shared_data: Path) -> bytes:
    return (shared_data / "tokyo_sbas_2008/GMSD7_20121014.rtcm3").read_bytes()


@pytest.fixture(scope="module")
def messages(stream: bytes) -> list[bytes]:
    return RtcmFramer().feed(stream)


def number_sent(parsed: Any, name: str, field: str) -> int:
    """A field of pyrtcm's as the number that was sent."""
    unit = RTCM_DATA_FIELDS[field][2]
    value = getattr(parsed, name)
    return round(value / unit) if unit not in (0, 1) else int(value)


def bits(message: bytes, table: Layout) -> int:
    return int.from_bytes(message, "big") >> 8 * len(message) - table.bits


def numbers_of(message: bytes) -> list[int]:
    """Every number of a message that is no MSM, in order."""
    table = TABLES[message_number(message) or 0]
    whole = bits(message, table)
    return [table.integer(whole, name) for name in table.fields]


def their_numbers_of(message: bytes) -> list[int]:
    parsed = RTCMMessage(message)
    return [number_sent(parsed, field, field) for field in RTCM_PAYLOADS_GET[parsed.identity]]


def test_the_same_frames(stream: bytes, messages: list[bytes]) -> None:
    theirs = [raw for raw, _ in RTCMReader(io.BytesIO(stream[: stream.rindex(messages[-1]) + len(messages[-1]) + 3]), quitonerror=0)]
    assert [frame_bytes(message) for message in messages] == theirs
    assert len(theirs) > 1000


def test_every_number_of_every_ephemeris_of_the_log(messages: list[bytes]) -> None:
    found = [message for message in messages if message_number(message) in TABLES]
    assert {message_number(message) for message in found} == {1019, 1020}
    for message in found:
        assert numbers_of(message) == their_numbers_of(message)


@pytest.mark.parametrize("number", sorted(TABLES))
def test_every_number_of_random_ephemerides_and_positions(number: int) -> None:
    rng = np.random.default_rng(number)
    table = TABLES[number]
    for _ in range(50):
        size = (table.bits + 7) // 8
        random = int.from_bytes(rng.bytes(size), "big") >> 12 | number << 8 * size - 12
        message = random.to_bytes(size, "big")
        assert numbers_of(message) == their_numbers_of(message)


@pytest.mark.parametrize("number", sorted(TABLES))
def test_the_same_units(number: int) -> None:
    for (name, field), theirs in zip(TABLES[number].fields.items(), RTCM_PAYLOADS_GET[str(number)], strict=True):
        assert field.bits == RTCM_DATA_FIELDS[theirs][1], name
        unit = RTCM_DATA_FIELDS[theirs][2]
        if field.unit is not None and unit not in (0, 1):  # pyrtcm leaves out some of GLONASS
            assert unit in (field.unit, field.unit / SEMICIRCLE, UNITS.get(field.unit)), name


def assert_same_msm(message: bytes) -> None:
    """Every number of the message, and every measurement that follows from them."""
    parsed, header = RTCMMessage(message), header_of(message)
    assert header is not None
    kind = header.masks.kind
    table = table_of(header.masks.number, parsed.NSat, parsed.NSig, parsed.NCell)
    whole = bits(message, table)
    assert header_numbers(table, whole) == their_header(parsed, header.system)
    fields = (SHORT if kind < 6 else LONG) | ({"channel": "DF419"} if header.system == "R" else {})
    for named, count in ((SATELLITE_FIELDS[kind], parsed.NSat), (CELL_FIELDS[kind], parsed.NCell)):
        for name, _ in named:
            ours = [table.integer(whole, f"{name}_{i}") for i in range(count)]
            assert ours == [number_sent(parsed, f"{fields[name]}_{i + 1:02d}", fields[name]) for i in range(count)], name
    assert_same_measurements(message, parsed, fields)


def header_numbers(table: Layout, whole: int) -> list[int]:
    names = list(table.fields)
    return [table.integer(whole, name) for name in names[: names.index("cells") + 1]]


def their_header(parsed: Any, system: str) -> list[int]:
    time = parsed.DF416 << 27 | parsed.DF034 if system == "R" else getattr(parsed, TIME_FIELDS[system])
    return [time if field == "{}" else int(getattr(parsed, field)) for field in HEADER_FIELDS]


def assert_same_measurements(message: bytes, parsed: Any, fields: dict[str, str]) -> None:
    """What we make of a message, against the definitions with pyrtcm's numbers; all of it exactly but the Doppler."""
    header = header_of(message)
    assert header is not None
    found = measured([message], (header.masks,), np.full(25, np.nan))
    ours = {signal: [column[i] for column in found[1:7]] for i, signal in enumerate(found.signals)}
    theirs = dict(their_cells(parsed, header.system, header.masks.kind, fields))
    assert list(ours) == list(theirs)
    for signal, expected in theirs.items():
        pseudorange_m, carrier_cycles, doppler_hz, *rest = expected
        np.testing.assert_array_equal(ours[signal][0], pseudorange_m)
        np.testing.assert_array_equal(ours[signal][1], carrier_cycles)
        np.testing.assert_allclose(ours[signal][2], doppler_hz, rtol=1e-14)
        np.testing.assert_array_equal(ours[signal][3:], rest)


def their_cells(parsed: Any, system: str, kind: int, fields: dict[str, str]) -> Iterator[tuple[str, list[float]]]:
    prn_of_satellite = [getattr(parsed, f"PRN_{i + 1:02d}") for i in range(parsed.NSat)]
    for i in range(1, parsed.NCell + 1):
        prn, code = getattr(parsed, f"CELLPRN_{i:02d}"), getattr(parsed, f"CELLSIG_{i:02d}")
        satellite = prn_of_satellite.index(prn) + 1
        if not prn.isdecimal() or not code.isalnum() or int(prn) > MOST_PRN.get(system, 999):
            continue

        def cell(name: str, i: int = i) -> float:
            return float(getattr(parsed, f"{fields[name]}_{i:02d}"))

        def of_satellite(name: str, satellite: int = satellite) -> float:
            return float(getattr(parsed, f"{fields[name]}_{satellite:02d}"))

        yield f"{system}{rinex_number(system, int(prn)):02d}.{code}", definitions(system, code, kind, cell, of_satellite)


def rinex_number(system: str, prn: int) -> int:
    return prn - {"S": 100, "J": 192}.get(system, 0)


def definitions(system: str, code: str, kind: int, cell: Any, of_satellite: Any) -> list[float]:
    """Range, carrier, Doppler, C/N0, lock and half cycle of RTCM 10403.3, 3.5.16."""
    units = dict(SATELLITE_FIELDS[kind] + CELL_FIELDS[kind])
    khz = KHZ[system + code[0]]
    if system == "R":
        sent = of_satellite("channel") if "channel" in units else 15
        khz += (sent - 7) * (562.5 if code[0] == "1" else 437.5) if sent <= 13 else math.nan
    whole = of_satellite("whole_ms")
    rough_ms = whole + of_satellite("part_ms") if 33 <= whole < 255 else math.nan

    def told(name: str, value: float) -> float:
        return math.nan if value == none_of(units[name]) * (units[name].unit or 1) else value

    doppler_hz = math.nan
    if "fine_rate_mps" in units:
        rate_mps = told("rate_mps", of_satellite("rate_mps")) + told("fine_rate_mps", round(cell("fine_rate_mps") / 1e-4) * 1e-4)
        doppler_hz = -rate_mps * khz / LIGHT_MS_M
    return [
        (rough_ms + told("range_ms", cell("range_ms"))) * LIGHT_MS_M,
        (rough_ms + told("phase_ms", cell("phase_ms"))) * khz,
        doppler_hz,
        cell("cn0_dbhz") or math.nan,
        least_lock_s(kind, int(cell("lock"))),
        cell("half_cycle"),
    ]


KHZ = {
    **dict.fromkeys(("G1", "E1", "J1", "S1", "C1"), 1_575_420.0),
    **dict.fromkeys(("G2", "J2"), 1_227_600.0),
    **dict.fromkeys(("G5", "E5", "J5", "S5", "C5"), 1_176_450.0),
    **dict.fromkeys(("E6", "J6"), 1_278_750.0),
    **dict.fromkeys(("E7", "C7"), 1_207_140.0),
    "E8": 1_191_795.0,
    "C2": 1_561_098.0,
    "C6": 1_268_520.0,
    "R1": 1_602_000.0,
    "R2": 1_246_000.0,
}


def least_lock_s(kind: int, indicator: int) -> float:
    """DF402 and DF407 as the tables write them: coefficient times indicator plus constant."""
    if kind < 6:
        return (1 << indicator + 4) / 1000 if indicator else 0.0
    if indicator > 704:
        return math.nan
    k = max(0, indicator // 32 - 1)
    return ((1 << k) * indicator - (32 * k << k)) / 1000


def test_every_number_of_every_msm_of_the_log(messages: list[bytes]) -> None:
    found = [message for message in messages if message_number(message) in MSM_NUMBERS]
    assert {message_number(message) for message in found} == {1077, 1087, 1117, 1127}
    for message in found:
        assert_same_msm(message)


def random_msm(rng: np.random.Generator, number: int) -> bytes:
    """Any satellites, signals and cells, reserved ones as well, with any numbers in their fields."""
    n_signals = int(rng.integers(1, 8))
    satellites = sorted(rng.choice(np.arange(1, 65), int(rng.integers(1, 64 // n_signals + 1)), replace=False).tolist())
    known = sorted(SYSTEMS[number - number % 10].codes)
    signals = sorted(rng.choice(known if rng.random() < 0.8 else np.arange(1, 33), min(n_signals, len(known)), replace=False).tolist())
    pairs = [(s, k) for s in satellites for k in signals]
    cells = [pair for pair in pairs if rng.random() < 0.8] or pairs
    message = encode_msm(number, {"station": 4095, "time": 0}, {s: {} for s in satellites}, {cell: {} for cell in cells})
    empty = int.from_bytes(message, "big")
    after = table_of(number, len(satellites), len({k for _, k in cells}), len(cells)).fields["whole_ms_0"].parts[0].first
    return (empty | int.from_bytes(rng.bytes(len(message)), "big") >> after).to_bytes(len(message), "big")


@pytest.mark.parametrize("number", sorted(MSM_NUMBERS))
def test_every_number_of_random_msm(number: int) -> None:
    rng = np.random.default_rng(number)
    for _ in range(12):
        assert_same_msm(random_msm(rng, number))
