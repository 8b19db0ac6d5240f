"""Rows of hand-made RXM-RAWX payloads, with values on both sides of every bound."""

import math
import struct
from typing import Any

import numpy as np
import pytest

from integrity.gnss.observations import ROW_ARRAYS, ObservationRow
from integrity.gnss.ubx.rawx import RAWX_DTYPE, RAWX_HEADER, decode_rawx

GPS, SBAS, GALILEO, BEIDOU, QZSS, GLONASS, NAVIC = 0, 1, 2, 3, 5, 6, 7
ALL_VALID = 0b0111
SIGNALLING_NAN_F4, SIGNALLING_NAN_F8 = bytes.fromhex("0100807f"), bytes.fromhex("010000000000f07f")


def measurement(gnss: int = GPS, sv: int = 5, sig: int = 0, **fields: Any) -> bytes:
    m = {"pr": 2.2e7, "cp": 1.1e8, "do": -1234.5, "lock": 1500, "cno": 45, "trk": ALL_VALID} | fields
    return struct.pack("<ddf4BH6B", m["pr"], m["cp"], m["do"], gnss, sv, sig, 0, m["lock"], m["cno"], 1, 2, 3, m["trk"], 0)


def rawx(*measurements: bytes, tow_s: float = 100.5, week: int = 2300, version: int = 1) -> bytes:
    return struct.pack("<dHbBB3B", tow_s, week, 18, len(measurements), 1, version, 0, 0) + b"".join(measurements)


def decoded(payload: bytes) -> ObservationRow:
    (row,) = decode_rawx([payload], "A")
    assert row is not None
    return row


def test_the_layout_is_that_of_the_description() -> None:
    m = np.frombuffer(measurement(GALILEO, 36, 1, trk=15), RAWX_DTYPE)[0]
    assert (len(m.tobytes()), m["pr_m"], m["sv_id"], m["locktime_ms"], m["cno_dbhz"], m["trk_stat"]) == (32, 2.2e7, 36, 1500, 45, 15)
    assert RAWX_HEADER.unpack_from(rawx(measurement())) == (100.5, 2300, 18, 1, 1, 1)


def test_every_quantity_of_a_measurement() -> None:
    row = decoded(rawx(measurement()))
    assert (row.receiver, row.signals) == ("A", ("G05.1C",))
    assert row.receive_time_ns == 2300 * 604_800 * 10**9 + 100_500_000_000
    values = [getattr(row, name)[0] for name in ROW_ARRAYS]
    assert values == [2.2e7, 1.1e8, -1234.5, 45.0, 1.5, False, False]


def test_time_is_rounded_to_whole_nanoseconds() -> None:
    assert decoded(rawx(tow_s=604_799.9979999999)).receive_time_ns == 2300 * 604_800 * 10**9 + 604_799_998_000_000


def test_signals_of_all_systems_are_taken_in_their_order() -> None:
    payload = rawx(
        measurement(GLONASS, 3, 2), measurement(GPS, 1, 7), measurement(NAVIC, 1, 0), measurement(GPS, 1, 0), measurement(SBAS, 131, 0),
        measurement(BEIDOU, 7, 1), measurement(GLONASS, 255, 0), measurement(QZSS, 2, 1), measurement(GALILEO, 2, 6),
    )  # fmt: skip
    assert decoded(payload).signals == ("R03.2C", "G01.5Q", "G01.1C", "S31.1C", "C07.2I", "J02.1Z", "E02.7Q")


@pytest.mark.parametrize(
    ("gnss", "sv", "most_m"),
    [(GPS, 1, 4.0e7), (GALILEO, 1, 4.0e7), (GLONASS, 1, 4.0e7), (SBAS, 129, 5.5e7), (BEIDOU, 3, 5.5e7), (QZSS, 1, 5.5e7)],
)
def test_satellites_of_some_systems_fly_higher(gnss: int, sv: int, most_m: float) -> None:
    row = decoded(rawx(measurement(gnss, sv, pr=most_m), measurement(GALILEO, 9, pr=math.nextafter(4.0e7, 1e9))))
    beyond = decoded(rawx(measurement(gnss, sv, pr=math.nextafter(most_m, 1e9)), measurement(GALILEO, 9)))
    assert np.isfinite([*row.pseudorange_m, *beyond.pseudorange_m]).tolist() == [True, False, False, True]


@pytest.mark.parametrize(
    ("field", "value", "name", "passed_on"),
    [
        ("pr", 1.0e7, "pseudorange_m", True),
        ("pr", math.nextafter(1.0e7, 0), "pseudorange_m", False),
        ("pr", 4.0e7, "pseudorange_m", True),
        ("pr", math.nextafter(4.0e7, 1e9), "pseudorange_m", False),
        ("pr", -2.2e7, "pseudorange_m", False),
        ("pr", math.nan, "pseudorange_m", False),
        ("pr", math.inf, "pseudorange_m", False),
        ("cp", -1.0e9, "carrier_cycles", True),
        ("cp", math.nextafter(1.0e9, 1e10), "carrier_cycles", False),
        ("cp", -math.inf, "carrier_cycles", False),
        ("do", 30_000.0, "doppler_hz", True),
        ("do", -30_000.01, "doppler_hz", False),
        ("do", math.nan, "doppler_hz", False),
        ("cno", 63, "cn0_dbhz", True),
        ("cno", 64, "cn0_dbhz", False),
        ("lock", 64_500, "lock_s", True),
        ("lock", 64_501, "lock_s", False),
    ],
)
def test_a_value_out_of_its_range_is_not_passed_on(field: str, value: float, name: str, passed_on: bool) -> None:
    changed: dict[str, Any] = {field: value}
    row = decoded(rawx(measurement(**changed), measurement(sv=6)))
    assert np.isfinite(getattr(row, name)).tolist() == [passed_on, True]


def test_signalling_nans_neither_warn_nor_pass() -> None:
    whole = measurement()
    row = decoded(rawx(SIGNALLING_NAN_F8 + whole[8:], whole[:8] + SIGNALLING_NAN_F8 + SIGNALLING_NAN_F4 + b"\0\7" + whole[22:]))
    assert (np.isfinite(row.pseudorange_m).tolist(), np.isfinite(row.carrier_cycles).tolist()) == ([False, True], [True, False])
    assert np.isfinite(row.doppler_hz).tolist() == [True, False]


@pytest.mark.parametrize(
    ("trk", "range_", "carrier", "half_cycle"),
    [(0b0001, True, False, False), (0b0010, False, True, True), (0b0110, False, True, False), (0b1011, True, True, True),
     (0b1111, True, True, False), (0b0101, True, False, False)],
)  # fmt: skip
def test_what_the_receiver_vouches_for(trk: int, range_: bool, carrier: bool, half_cycle: bool) -> None:
    row = decoded(rawx(measurement(trk=trk)))
    found = np.isfinite(row.pseudorange_m[0]), np.isfinite(row.carrier_cycles[0]), row.half_cycle[0]
    assert found == (range_, carrier, half_cycle)


def test_without_lock_there_may_be_a_slip() -> None:
    assert decoded(rawx(measurement(lock=0), measurement(sv=6, lock=1))).slip.tolist() == [True, False]


def test_a_measurement_without_range_and_carrier_is_left_out() -> None:
    row = decoded(rawx(measurement(sv=1, trk=0, cno=10), measurement(sv=2, cno=20), measurement(sv=3, pr=1.0, trk=1, cno=30)))
    assert (row.signals, row.cn0_dbhz.tolist()) == (("G02.1C",), [20.0])


@pytest.mark.parametrize(
    "payload",
    [
        b"",
        rawx()[:15],
        rawx(measurement())[:-1],
        rawx(measurement()) + b"\0",
        rawx(measurement(), version=2),
        rawx(measurement(), week=1699),
        rawx(measurement(), week=4096),
        rawx(measurement(), tow_s=604_800.0),
        rawx(measurement(), tow_s=math.nextafter(0.0, -1.0)),
        rawx(measurement(), tow_s=math.nan),
        rawx(measurement(), measurement(GALILEO), measurement(trk=0)),
        rawx(measurement(BEIDOU, 3, 0), measurement(BEIDOU, 3, 1)),
    ],
    ids=[
        "empty",
        "no_header",
        "short",
        "long",
        "version",
        "week_before",
        "week_after",
        "tow_604800",
        "tow_negative",
        "tow_nan",
        "twice",
        "twice_by_two_numbers",
    ],
)
def test_what_makes_a_whole_row_none(payload: bytes) -> None:
    assert decode_rawx([payload], "A") == [None]


def test_a_row_without_signals_is_a_row() -> None:
    assert decoded(rawx()).signals == ()


def test_many_at_once_give_what_each_gives_alone() -> None:
    payloads = [
        rawx(measurement(sv=1), measurement(BEIDOU, 9), measurement(GALILEO, 4, 1, do=-9.5)),
        b"nonsense",
        rawx(),
        rawx(measurement(SBAS, 131), measurement(sv=7, trk=0), measurement(sv=8, trk=1), version=0),
        rawx(measurement(sv=2, cno=99), week=0),
        rawx(measurement(GALILEO, 36, cp=7.0), tow_s=101.5),
    ]
    together, alone = decode_rawx(payloads, "A"), [decode_rawx([p], "A")[0] for p in payloads]
    assert [row and (row.receive_time_ns, row.signals) for row in together] == [row and (row.receive_time_ns, row.signals) for row in alone]
    for one, other in zip(together, alone, strict=True):
        if one is not None and other is not None:
            for name in ROW_ARRAYS:
                np.testing.assert_array_equal(getattr(one, name), getattr(other, name))
