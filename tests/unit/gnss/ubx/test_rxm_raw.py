"""Rows of hand-made RXM-RAW payloads, with values on both sides of every bound."""

import math
import struct
from typing import Any

import numpy as np
import pytest

from integrity.gnss.observations import ROW_ARRAYS, ObservationRow
from integrity.gnss.ubx.rxm_raw import decode_raw

WEEK_NS = 604_800 * 10**9
SIGNALLING_NAN_F4, SIGNALLING_NAN_F8 = bytes.fromhex("0100807f"), bytes.fromhex("010000000000f07f")


def satellite(sv: int = 5, **fields: Any) -> bytes:
    m = {"cp": 1.1e8, "pr": 2.2e7, "do": -1234.5, "qi": 7, "cno": 45, "lli": 0} | fields
    return struct.pack("<ddfBbbB", m["cp"], m["pr"], m["do"], sv, m["qi"], m["cno"], m["lli"])


def raw(*satellites: bytes, tow_ms: int = 107_964_999, week: int = 1481) -> bytes:
    return struct.pack("<ihBB", tow_ms, week, len(satellites), 0) + b"".join(satellites)


def decoded(payload: bytes) -> ObservationRow:
    row = decode_raw(payload, "A")
    assert row is not None
    return row


def test_every_quantity_of_a_measurement() -> None:
    row = decoded(raw(satellite()))
    assert (row.receiver, row.signals, row.receive_time_ns) == ("A", ("G05.1C",), 1481 * WEEK_NS + 107_964_999_000_000)
    np.testing.assert_array_equal([getattr(row, name)[0] for name in ROW_ARRAYS], [2.2e7, 1.1e8, -1234.5, 45.0, math.nan, False, False])


def test_satellites_that_have_a_name_are_taken() -> None:
    assert decoded(raw(satellite(200), satellite(129), satellite(33), satellite(193), satellite(7))).signals == (
        "S29.1C",
        "J01.1C",
        "G07.1C",
    )


@pytest.mark.parametrize(
    ("field", "value", "name", "passed_on"),
    [
        ("pr", 1.0e7, "pseudorange_m", True),
        ("pr", math.nextafter(1.0e7, 0), "pseudorange_m", False),
        ("pr", 4.0e7, "pseudorange_m", True),
        ("pr", math.nextafter(4.0e7, 1e9), "pseudorange_m", False),
        ("pr", math.nan, "pseudorange_m", False),
        ("cp", -1.0e9, "carrier_cycles", True),
        ("cp", math.nextafter(1.0e9, 1e10), "carrier_cycles", False),
        ("cp", 0.0, "carrier_cycles", False),
        ("cp", math.inf, "carrier_cycles", False),
        ("do", 30_000.0, "doppler_hz", True),
        ("do", -30_000.01, "doppler_hz", False),
        ("cno", 0, "cn0_dbhz", True),
        ("cno", -1, "cn0_dbhz", False),
        ("cno", 63, "cn0_dbhz", True),
        ("cno", 64, "cn0_dbhz", False),
    ],
)
def test_a_value_out_of_its_range_is_not_passed_on(field: str, value: float, name: str, passed_on: bool) -> None:
    changed: dict[str, Any] = {field: value}
    row = decoded(raw(satellite(**changed), satellite(6)))
    assert np.isfinite(getattr(row, name)).tolist() == [passed_on, True]


def test_satellites_of_sbas_fly_higher() -> None:
    row = decoded(raw(satellite(129, pr=5.5e7), satellite(137, pr=math.nextafter(5.5e7, 1e9))))
    assert np.isfinite(row.pseudorange_m).tolist() == [True, False]


@pytest.mark.parametrize(
    ("qi", "range_and_doppler", "carrier", "slip"),
    [(-128, False, False, True), (3, False, False, True), (4, True, False, True), (5, True, True, True), (6, True, True, False)],
)
def test_what_the_receiver_vouches_for(qi: int, range_and_doppler: bool, carrier: bool, slip: bool) -> None:
    row = decoded(raw(satellite(qi=qi), satellite(6)))
    if not range_and_doppler:
        assert row.signals == ("G06.1C",)
        return
    found = np.isfinite(row.pseudorange_m[0]), np.isfinite(row.doppler_hz[0]), np.isfinite(row.carrier_cycles[0]), row.slip[0]
    assert found == (True, True, carrier, slip)


@pytest.mark.parametrize(
    ("lli", "slip", "half_cycle"), [(0, False, False), (1, True, False), (2, False, True), (3, True, True), (4, False, False)]
)
def test_the_loss_of_lock_indicator_is_that_of_rinex(lli: int, slip: bool, half_cycle: bool) -> None:
    row = decoded(raw(satellite(lli=lli)))
    assert (row.slip[0], row.half_cycle[0]) == (slip, half_cycle)


def test_half_a_cycle_is_open_on_a_carrier_only() -> None:
    assert not decoded(raw(satellite(lli=2, cp=0.0))).half_cycle[0]


def test_signalling_nans_neither_warn_nor_pass() -> None:
    row = decoded(
        raw(
            SIGNALLING_NAN_F8 + satellite()[8:16] + SIGNALLING_NAN_F4 + satellite()[20:],
            satellite(6)[:8] + SIGNALLING_NAN_F8 + satellite(6)[16:],
        )
    )
    found = [np.isfinite(values).tolist() for values in (row.carrier_cycles, row.pseudorange_m, row.doppler_hz)]
    assert found == [[False, True], [True, False], [False, True]]


@pytest.mark.parametrize(
    "payload",
    [
        b"",
        raw()[:7],
        raw(satellite())[:-1],
        raw(satellite()) + b"\0",
        raw(satellite(), week=0),
        raw(satellite(), week=1199),
        raw(satellite(), week=4096),
        raw(satellite(), week=-1),
        raw(satellite(), tow_ms=-1),
        raw(satellite(), tow_ms=604_800_000),
        raw(satellite(), satellite(6), satellite(qi=0)),
    ],
    ids=["empty", "no_header", "short", "long", "week_0", "before", "after", "negative_week", "negative", "tow_604800", "twice"],
)  # fmt: skip
def test_what_makes_a_whole_row_none(payload: bytes) -> None:
    assert decode_raw(payload, "A") is None


def test_a_row_without_signals_is_a_row() -> None:
    assert decoded(raw()).signals == ()
