"""Rows as MSM: they come back to the resolution of the fields. What others make of the messages: tests/crosscheck."""

import numpy as np
import pytest

from integrity.gnss.gps_time import gps_from_week
from integrity.gnss.observations import ObservationRow
from integrity.gnss.rtcm.decoder import RtcmDecoder
from integrity.gnss.rtcm.masks import SYSTEMS
from integrity.gnss.rtcm.msm import MOST_CELL_BITS, header_of
from integrity.gnss.rtcm.msm_writer import encode_row
from integrity.gnss.signals import bands_of, carrier_hz

TIME_NS = gps_from_week(2310, 345_600.0)
LIGHT_MPS = 299_792_458.0
CHANNELS = {f"R{slot:02d}": slot % 14 - 7 for slot in range(1, 25)}
EVERY_SIGNAL = [
    f"{system.letter}{system.first + s:02d}.{code}"
    for system in SYSTEMS.values()
    for s in range(0, system.satellites, 5)
    for code in system.codes.values()
]
# Half a last bit of each kind, in metres of range and carrier and m/s.
RESOLUTIONS = {
    4: (2.0**-25, 2.0**-30, np.nan),
    5: (2.0**-25, 2.0**-30, 5e-5),
    6: (2.0**-30, 2.0**-32, np.nan),
    7: (2.0**-30, 2.0**-32, 5e-5),
}


def hertz(signal: str) -> float:
    first_hz, step_hz = carrier_hz(signal[0], bands_of(signal)[0]) or (np.nan, np.nan)
    return first_hz + step_hz * CHANNELS.get(signal[:3], 0)


def a_row(signals: list[str]) -> ObservationRow:
    rng = np.random.default_rng(1)
    n = len(signals)
    hz = np.array([hertz(signal) for signal in signals])
    range_m = {signal[:3]: rng.uniform(1.9e7, 4.0e7) for signal in signals}
    rate_mps = {signal[:3]: rng.uniform(-900.0, 900.0) for signal in signals}
    ranges_m = np.array([range_m[signal[:3]] for signal in signals]) + rng.uniform(-60.0, 60.0, n)
    return ObservationRow(
        "A",
        TIME_NS,
        tuple(signals),
        pseudorange_m=ranges_m,
        carrier_cycles=(ranges_m + rng.uniform(-800.0, 800.0, n)) / LIGHT_MPS * hz,
        doppler_hz=-(np.array([rate_mps[signal[:3]] for signal in signals]) + rng.uniform(-0.4, 0.4, n)) / LIGHT_MPS * hz,
        cn0_dbhz=rng.integers(20, 60, n).astype(np.float64),
        lock_s=rng.choice([0.0, 0.064, 0.512, 8.192, 524.288], n),  # both kinds of lock time have these
        slip=np.ones(n, dtype=np.bool_),
        half_cycle=rng.random(n) < 0.3,
    )


def come_back(row: ObservationRow, kind: int) -> ObservationRow:
    """Read again, in the order of the row."""
    decoder = RtcmDecoder("A")
    (found,) = [told for message in encode_row(row, kind, channels=CHANNELS) for told in decoder.take(message, row.receive_time_ns)]
    assert isinstance(found, ObservationRow)
    assert decoder.refused == 0
    return found


@pytest.mark.parametrize("kind", [4, 5, 6, 7])
def test_every_signal_comes_back(kind: int) -> None:
    sent = a_row(EVERY_SIGNAL)
    found = come_back(sent, kind)
    assert set(found.signals) == set(sent.signals)
    assert found.receive_time_ns == sent.receive_time_ns
    order = [found.signals.index(signal) for signal in sent.signals]
    hz = np.array([hertz(signal) for signal in sent.signals])
    range_ms, phase_ms, rate_mps = RESOLUTIONS[kind]
    exact = 1.0 + 1e-5  # and what float64 rounds of 4e7 m
    assert np.max(np.abs(found.pseudorange_m[order] - sent.pseudorange_m)) <= range_ms * LIGHT_MPS / 1e3 * exact + 1e-8
    # MSM 4 and 6 have no field for channels, so that GLONASS has no carrier in them.
    told = np.array([kind % 2 == 1 or signal[0] != "R" for signal in sent.signals])
    assert np.array_equal(np.isnan(found.carrier_cycles[order]), ~told)
    carrier_error_m = np.abs(found.carrier_cycles[order] - sent.carrier_cycles) / hz * LIGHT_MPS
    assert np.max(carrier_error_m[told]) <= phase_ms * LIGHT_MPS / 1e3 * exact + 1e-8
    if kind % 2:
        assert np.max(np.abs(found.doppler_hz[order] - sent.doppler_hz) / hz * LIGHT_MPS) <= rate_mps * exact
    else:
        assert np.all(np.isnan(found.doppler_hz))
    assert found.cn0_dbhz[order].tolist() == sent.cn0_dbhz.tolist()
    assert found.lock_s[order].tolist() == sent.lock_s.tolist()
    assert found.half_cycle[order].tolist() == sent.half_cycle.tolist()


def test_a_cell_mask_is_never_too_long_and_only_the_last_message_ends_the_epoch() -> None:
    headers = [header_of(message) for message in encode_row(a_row(EVERY_SIGNAL), 7, station=12)]
    assert len(headers) > len(SYSTEMS)
    told = [header for header in headers if header is not None]
    assert [header.more for header in told] == [True] * (len(headers) - 1) + [False]
    assert {header.station for header in told} == {12}
    assert max(header.masks.satellites.bit_count() * header.masks.signals.bit_count() for header in told) <= MOST_CELL_BITS


@pytest.mark.parametrize(("carrier_off_m", "told"), [(1100.0, True), (-1100.0, True), (1400.0, False), (-1400.0, False)])
def test_a_carrier_far_from_the_range_is_not_told(carrier_off_m: float, told: bool) -> None:
    row = a_row(["G05.1C"])
    cycles = (row.pseudorange_m + carrier_off_m) / LIGHT_MPS * 1_575.42e6
    far = ObservationRow("A", TIME_NS, row.signals, row.pseudorange_m, cycles, *(getattr(row, name) for name in REST))
    assert np.isfinite(come_back(far, 7).carrier_cycles[0]) == told


REST = ("doppler_hz", "cn0_dbhz", "lock_s", "slip", "half_cycle")


def test_a_lock_between_two_indicators_is_the_lesser() -> None:
    row = a_row(["G05.1C", "G06.1C", "G07.1C"])
    between = np.array([1.0, 523.0, 1e9])
    parts = {name: getattr(row, name) for name in ("pseudorange_m", "carrier_cycles", "doppler_hz", "cn0_dbhz", "slip", "half_cycle")}
    found = come_back(ObservationRow("A", TIME_NS, row.signals, lock_s=between, **parts), 4)
    assert found.lock_s.tolist() == [0.512, 262.144, 524.288]


def test_nothing_to_tell() -> None:
    assert encode_row(a_row([]), 7) == []
