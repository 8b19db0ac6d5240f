"""Faults of one receiver: its noise, its clock, what its antenna reflects, and what it hears of another one's."""

import math
from dataclasses import replace

import numpy as np
import pytest

from integrity.errors import ConfigError
from integrity.gnss.gps_time import NS_PER_S
from integrity.gnss.observations import ROW_ARRAYS, ObservationRow, same_measurements
from recordings.faults.kinds import Meaconing, Multipath, ReceiverClockJump, ReceiverNoise
from tests.unit.faults.everywhere import (
    BEGIN,
    END,
    FIRST_NS,
    MEASURED,
    SETS,
    WAS,
    assert_only,
    delta,
    deltas,
    rows_of,
    satellite_ecef_m,
    wavelength_m,
    with_fault,
)
from tests.unit.many_signals import CLOCKS_M, nothing_more, rows
from tests.unit.streams import POINTS, rows_changed

MS_M = 299_792.458
MOST_ERROR_M = 2e-8

# Noise


def test_noise_grows_by_the_factor_on_code_carrier_and_doppler() -> None:
    """Of 0.3 m, 2 mm and 2 cm/s at 45 dB-Hz, here 44; some 700 draws know a standard deviation to 8 % at 3 sigma."""
    numbers = [n for found in deltas(ReceiverNoise(receiver="B", factor=3.0)).values() for n in found.values()]
    assert len(numbers) > 600
    of_one = math.sqrt(3.0**2 - 1.0) * 10 ** (1.0 / 20.0)
    assert np.std(numbers, axis=0) == pytest.approx(np.array([0.3, 0.002, 0.02]) * of_one, rel=0.1)


def test_noise_of_signals_is_independent() -> None:
    """Correlations of 700 draws are below 0.12 at 3 sigma."""
    numbers = np.array([n for found in deltas(ReceiverNoise(receiver="B", factor=3.0)).values() for n in found.values()])
    assert np.abs(np.corrcoef(numbers.T) - np.eye(3)).max() < 0.12


def test_noise_leaves_other_receivers_and_what_the_receiver_says_of_its_signals() -> None:
    now = rows_of(with_fault(MEASURED, ReceiverNoise(receiver="B", factor=3.0)))
    assert all(now[key] is WAS[key] for key in WAS if key[0] != "B")
    assert all(np.array_equal(now["B", e].cn0_dbhz, WAS["B", e].cn0_dbhz) and not now["B", e].slip.any() for e in range(BEGIN, END))


def test_noise_of_a_signal_does_not_depend_on_where_it_stands_in_the_row() -> None:
    """Bytes have an order of their own."""

    def backwards(row: ObservationRow) -> ObservationRow:
        return replace(row, signals=row.signals[::-1], **{name: getattr(row, name)[::-1] for name in ROW_ARRAYS})

    effect = ReceiverNoise(receiver="B", factor=3.0)
    now = rows_of(with_fault(rows_changed(MEASURED, backwards), effect))["B", BEGIN]
    assert same_measurements(backwards(now), rows_of(with_fault(MEASURED, effect))["B", BEGIN])


# Clock


def test_a_jump_by_whole_milliseconds_takes_the_time_tag_along() -> None:
    now = rows_of(with_fault(MEASURED, ReceiverClockJump(receiver="B", size_m=-2 * MS_M)))
    for epoch in range(BEGIN, END):
        row, was = now["B", epoch], WAS["B", epoch]
        assert row.receive_time_ns == was.receive_time_ns - 2_000_000
        assert row.pseudorange_m - was.pseudorange_m == pytest.approx(-2 * MS_M, abs=MOST_ERROR_M)
        assert np.array_equal(row.doppler_hz, was.doppler_hz)


def test_a_jump_by_anything_else_is_a_measurement_so_much_earlier() -> None:
    """300 km: the satellites were elsewhere 1 ms ago. Against the range to where they were, from the rate between two epochs."""
    size_m = 300_000.0
    now = rows_of(with_fault(MEASURED, ReceiverClockJump(receiver="B", size_m=size_m)))["B", BEGIN]
    was, later, before = WAS["B", BEGIN], WAS["B", BEGIN + 1], WAS["B", BEGIN - 1]
    assert now.receive_time_ns == was.receive_time_ns
    rate_mps = (later.pseudorange_m - before.pseudorange_m) / 2.0
    assert now.pseudorange_m - was.pseudorange_m == pytest.approx(size_m - rate_mps * size_m / 299_792_458.0, abs=2e-3)
    assert np.abs(rate_mps).max() > 300.0  # 30 cm in this time


def test_a_jump_moves_carriers_as_codes_on_every_band() -> None:
    for found in deltas(ReceiverClockJump(receiver="B", size_m=1234.5)).values():
        assert_only(found, lambda signal: True)
        for code_m, carrier_m, rate_mps in found.values():
            assert carrier_m == pytest.approx(code_m, abs=MOST_ERROR_M)
            assert rate_mps == 0.0


# Multipath


def test_multipath_swings_codes_of_its_satellites_a_part_of_a_turn_apart() -> None:
    effect = Multipath(receiver="B", satellites=("G07", "E11"), amplitude_m=2.0, period_s=8.0)
    for epoch, found in deltas(effect).items():
        turn = math.tau * (epoch - BEGIN) / 8.0
        for signal, (code_m, _, _) in found.items():
            expected = {"G07": 2.0 * math.sin(turn), "E11": -2.0 * math.sin(turn)}.get(signal[:3], 0.0)
            assert code_m == pytest.approx(expected, abs=1e-7)


def test_multipath_swings_the_carrier_a_quarter_of_a_turn_behind_by_a_twelfth_of_a_wavelength() -> None:
    """From rest, where the reflection of half the strength stands across: half a wavelength over two pi, and as much back."""
    found = deltas(Multipath(receiver="B", satellites=("G07",), amplitude_m=2.0, period_s=8.0))
    for epoch, by_signal in found.items():
        turn = math.tau * (epoch - BEGIN) / 8.0
        for signal in ("G07.1C", "G07.2L", "G07.5Q"):
            lever_m = wavelength_m(signal) / (4.0 * math.pi)
            assert by_signal[signal][1] == pytest.approx(lever_m * (1.0 - math.cos(turn)), abs=1e-7)
            assert by_signal[signal][2] == pytest.approx(lever_m * math.tau / 8.0 * math.sin(turn), abs=1e-9)


def test_multipath_stays_at_its_receiver() -> None:
    now = rows_of(with_fault(MEASURED, Multipath(receiver="B", satellites=("G07",), amplitude_m=2.0, period_s=8.0)))
    assert all(now[key] is WAS[key] for key in WAS if key[0] != "B")


def test_multipath_of_a_satellite_that_is_not_seen_is_refused() -> None:
    with pytest.raises(ConfigError, match="G31 is not seen then"):
        with_fault(MEASURED, Multipath(receiver="B", satellites=("G07", "G31"), amplitude_m=2.0, period_s=8.0))


# Meaconing

FROM_A = Meaconing(from_receiver="A", to_receivers=("B", "C"), delay_m=450.0)


def reflecting(receiver: str, signal: str, epoch: int) -> float | None:
    """Each satellite a few metres longer at A; E11 is not heard there."""
    if receiver != "A":
        return nothing_more(receiver, signal, epoch)
    return None if signal[:3] == "E11" else float(int(signal[1:3]) % 5)


AT_A = rows(FIRST_NS + 10 * NS_PER_S, reflecting)


@pytest.mark.parametrize("receiver", ["B", "C"])
def test_whoever_hears_the_repeater_measures_the_ranges_of_the_other_antenna(receiver: str) -> None:
    """All by one clock: its own and the delay. Ranges change by up to 1 km/s in the time by which the clocks differ."""
    now = rows_of(with_fault(MEASURED, FROM_A))
    for epoch in range(BEGIN, END):
        place = {signal: i for i, signal in enumerate(WAS["A", epoch].signals)}
        row = now[receiver, epoch]
        more_m = [row.pseudorange_m[i] - WAS["A", epoch].pseudorange_m[place[s]] for i, s in enumerate(row.signals)]
        later_s = (450.0 + CLOCKS_M[receiver] - CLOCKS_M["A"]) / 299_792_458.0
        assert np.array(more_m) == pytest.approx(450.0 + CLOCKS_M[receiver] - CLOCKS_M["A"], abs=1000.0 * abs(later_s) + 1e-3)


@pytest.mark.parametrize("receiver", ["B", "C"])
def test_satellites_are_those_of_the_time_at_which_they_were_repeated(receiver: str) -> None:
    """The geometry, from first principles, with the satellites 1.5 us of their way further back: to 2 mm (satellite_ecef_m is rounded)."""
    found = {s: n for s, n in delta(rows_of(with_fault(MEASURED, FROM_A))[receiver, BEGIN], WAS[receiver, BEGIN]).items() if s[4:] == "1C"}
    row, own, other = WAS[receiver, BEGIN], np.array(POINTS[receiver]), np.array(POINTS["A"])
    for signal, (code_m, carrier_m, _) in found.items():
        where = satellite_ecef_m(SETS[signal[:3]], row, signal, CLOCKS_M[receiver])
        expected = 450.0 + np.linalg.norm(where - other) - np.linalg.norm(where - own)
        assert code_m == pytest.approx(expected, abs=5e-3)
        assert carrier_m == pytest.approx(code_m, abs=5e-3)


def test_reflections_at_the_other_antenna_are_heard_and_what_it_does_not_hear_is_gone() -> None:
    plain, reflected = (rows_of(with_fault(events, FROM_A))["B", BEGIN] for events in (MEASURED, AT_A))
    assert {s[:3] for s in plain.signals} - {s[:3] for s in reflected.signals} == {"E11"}
    place = {signal: i for i, signal in enumerate(plain.signals)}
    for code in ("1C", "2L", "5Q", "7Q", "6I"):
        for system in "GECJR":
            mine = [(i, s) for i, s in enumerate(reflected.signals) if s[0] == system and s[4:] == code]
            more = np.array([reflected.pseudorange_m[i] - plain.pseudorange_m[place[s]] for i, s in mine])
            there = np.array([int(s[1:3]) % 5 for _, s in mine], dtype=np.float64)
            if len(mine):
                assert more - more[0] == pytest.approx(there - there[0], abs=1e-3)


def test_everything_that_is_repeated_is_acquired_anew() -> None:
    now = rows_of(with_fault(MEASURED, FROM_A))
    known = np.array([signal[:3] in SETS for signal in now["C", BEGIN].signals])
    assert now["C", BEGIN].slip[known].all() and not now["C", BEGIN + 1].slip.any()
    assert set(now["C", BEGIN + 3].lock_s[known].tolist()) == {3.0}


def test_the_antenna_that_is_repeated_measures_as_before() -> None:
    now = rows_of(with_fault(MEASURED, FROM_A))
    assert all(same_measurements(now["A", epoch], WAS["A", epoch]) for epoch in range(20))
