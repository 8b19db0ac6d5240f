"""MSM: which numbers mean that there is none, and what becomes of the others. That all of them are read right: tests/crosscheck."""

from collections.abc import Mapping

import numpy as np
import pytest

from integrity.gnss.rtcm.masks import SYSTEMS, places_of
from integrity.gnss.rtcm.measurements import Measured, measured
from integrity.gnss.rtcm.msm import CELL_FIELDS, MSM_NUMBERS, SATELLITE_FIELDS, header_of
from integrity.gnss.rtcm.msm_writer import Values, encode_msm

UNKNOWN = np.full(25, np.nan)
LIGHT_MS_M = 299_792.458
SATELLITE: Values = {"whole_ms": 70.0, "part_ms": 0.5, "rate_mps": -300.0, "channel": 0.0}
CELL: Values = {"range_ms": 2.0**-12, "phase_ms": -(2.0**-12), "lock": 0.0, "cn0_dbhz": 40.0, "fine_rate_mps": 0.25, "half_cycle": 0.0}


def one_cell(number: int, satellite: Mapping[str, float | None] = {}, cell: Mapping[str, float | None] = {}) -> bytes:
    """A message of one satellite, the fifth, with its L1 C/A, E1C or B1I, whose fields are `SATELLITE` and `CELL` but for these."""
    return encode_msm(number, {}, {5: {**SATELLITE, **satellite}}, {(5, 2): {**CELL, **cell}})


def read(message: bytes, channels: np.ndarray[tuple[int], np.dtype[np.float64]] = UNKNOWN) -> Measured:
    header = header_of(message)
    assert header is not None
    return measured([message], (header.masks,), channels)


@pytest.mark.parametrize("number", [1074, 1075, 1076, 1077])
def test_a_cell(number: int) -> None:
    found = read(one_cell(number))
    assert found.signals == ("G05.1C",)
    assert found.pseudorange_m[0] == (70.5 + 2.0**-12) * LIGHT_MS_M
    assert found.carrier_cycles[0] == (70.5 - 2.0**-12) * 1_575_420.0
    assert found.cn0_dbhz[0] == 40.0
    expected_hz = 299.75 / 299_792_458.0 * 1.57542e9 if number % 2 else np.nan  # approaching: positive
    np.testing.assert_allclose(found.doppler_hz, [expected_hz], rtol=1e-15)


@pytest.mark.parametrize(
    ("satellite", "cell", "missing"),
    [
        ({"whole_ms": None}, {}, {"pseudorange_m", "carrier_cycles"}),
        ({"whole_ms": 0.0}, {}, {"pseudorange_m", "carrier_cycles"}),
        ({"whole_ms": 32.0}, {}, {"pseudorange_m", "carrier_cycles"}),
        ({"whole_ms": 33.0}, {}, set()),
        ({"whole_ms": 254.0}, {}, set()),
        ({"rate_mps": None}, {}, {"doppler_hz"}),
        ({}, {"range_ms": None}, {"pseudorange_m"}),
        ({}, {"phase_ms": None}, {"carrier_cycles"}),
        ({}, {"fine_rate_mps": None}, {"doppler_hz"}),
        ({}, {"cn0_dbhz": None}, {"cn0_dbhz"}),
    ],
)
@pytest.mark.parametrize("number", [1075, 1077])
def test_what_could_not_be_told_is_nan(number: int, satellite: Values, cell: Values, missing: set[str]) -> None:
    found = read(one_cell(number, satellite, cell))
    names = ("pseudorange_m", "carrier_cycles", "doppler_hz", "cn0_dbhz")
    assert {name for name in names if np.isnan(getattr(found, name)[0])} == missing


@pytest.mark.parametrize(("indicator", "least_s"), [(0, 0.0), (1, 0.032), (2, 0.064), (10, 16.384), (15, 524.288)])
def test_lock_of_four_bits(indicator: int, least_s: float) -> None:
    assert read(one_cell(1074, cell={"lock": float(indicator)})).lock_s[0] == least_s


@pytest.mark.parametrize(
    ("indicator", "least_s"),
    [
        (0, 0.0),
        (63, 0.063),
        (64, 0.064),
        (65, 0.066),
        (95, 0.126),
        (96, 0.128),
        (97, 0.132),
        (128, 0.256),
        (703, 66060.288),
        (704, 67108.864),
    ],
)
def test_lock_of_ten_bits(indicator: int, least_s: float) -> None:
    assert read(one_cell(1077, cell={"lock": float(indicator)})).lock_s[0] == least_s


@pytest.mark.parametrize("indicator", [705, 1023])
def test_lock_reserved(indicator: int) -> None:
    assert np.isnan(read(one_cell(1077, cell={"lock": float(indicator)})).lock_s[0])


def test_half_cycle() -> None:
    assert [bool(read(one_cell(1074, cell={"half_cycle": flag})).half_cycle[0]) for flag in (0.0, 1.0)] == [False, True]


@pytest.mark.parametrize(("sent", "channel"), [(0, -7), (7, 0), (13, 6)])
def test_glonass_channel_in_the_message(sent: int, channel: int) -> None:
    found = read(one_cell(1087, {"channel": float(sent)}))
    assert found.carrier_cycles[0] == (70.5 - 2.0**-12) * (1_602_000.0 + 562.5 * channel)
    assert found.channel[0] == channel


@pytest.mark.parametrize("number", [1084, 1087])
def test_glonass_channel_from_elsewhere(number: int) -> None:
    channels = UNKNOWN.copy()
    channels[5] = -4.0
    found = read(one_cell(number, {"channel": None}), channels)
    assert found.carrier_cycles[0] == (70.5 - 2.0**-12) * (1_602_000.0 - 4 * 562.5)


@pytest.mark.parametrize("number", [1084, 1087])
def test_glonass_without_a_channel_has_a_range_and_no_carrier(number: int) -> None:
    found = read(one_cell(number, {"channel": 14.0}))
    assert np.isnan(found.carrier_cycles[0])
    assert np.isnan(found.doppler_hz[0])
    assert found.pseudorange_m[0] == (70.5 + 2.0**-12) * LIGHT_MS_M


def test_reserved_satellites_and_signals_are_passed_over() -> None:
    cells: dict[tuple[int, int], Values] = {(5, 2): CELL, (5, 1): {}, (64, 2): {}}
    message = encode_msm(1077, {}, {5: SATELLITE, 64: SATELLITE}, cells)
    found = read(message)
    assert found.signals == ("G05.1C",)
    assert found.pseudorange_m[0] == (70.5 + 2.0**-12) * LIGHT_MS_M


def test_a_message_of_no_satellites() -> None:
    assert read(encode_msm(1127, {}, {}, {})).signals == ()


def test_all_messages_of_an_epoch_together() -> None:
    messages = [one_cell(1074), one_cell(1087), one_cell(1097), one_cell(1125)]
    headers = [header_of(message) for message in messages]
    found = measured(messages, tuple(header.masks for header in headers if header is not None), UNKNOWN)
    assert found.signals == ("G05.1C", "R05.1C", "E05.1C", "C05.2I")
    assert found.pseudorange_m.tolist() == [(70.5 + 2.0**-12) * LIGHT_MS_M] * 4


def test_more_cells_than_a_mask_has_bits_for() -> None:
    message = one_cell(1077)
    full = int.from_bytes(message, "big") | (1 << 64) - 1 << 8 * len(message) - 137  # every satellite, and the signal twice
    full |= 3 << 8 * len(message) - 169
    assert header_of(full.to_bytes(len(message), "big")) is None
    with pytest.raises(ValueError, match="64 bits"):
        encode_msm(1077, {}, dict.fromkeys(range(1, 34), SATELLITE), {(s, k): CELL for s in range(1, 34) for k in (2, 8)})


@pytest.mark.parametrize("number", sorted(MSM_NUMBERS))
def test_a_message_cut_short_is_refused(number: int) -> None:
    message = one_cell(number)
    fields = (*SATELLITE_FIELDS[number % 10], *CELL_FIELDS[number % 10])
    assert len(message) == -(-(170 + sum(field.bits for _, field in fields)) // 8)
    assert [header_of(message[:size]) for size in range(2, len(message))] == [None] * (len(message) - 2)


@pytest.mark.parametrize(
    ("signal", "places"),
    [("G32.1X", (32, 32)), ("S29.1C", (10, 2)), ("J01.6L", (1, 10)), ("G33.1C", None), ("G05.3C", None), ("X05.1C", None)],
)
def test_where_a_signal_stands(signal: str, places: tuple[int, int] | None) -> None:
    assert places_of(signal) == places


def test_every_signal_has_a_place_of_its_own() -> None:
    names = [f"{system.letter}{system.first:02d}.{code}" for system in SYSTEMS.values() for code in system.codes.values()]
    assert [places_of(name) for name in names] == [(1, bit) for system in SYSTEMS.values() for bit in system.codes]
