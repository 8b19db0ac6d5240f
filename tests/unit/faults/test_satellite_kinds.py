"""Faults of satellites and constellations, on every band and for every receiver."""

import numpy as np
import pytest

from recordings.faults.kinds import (
    CodeCarrierDivergence,
    ConstellationClock,
    ConstellationFrame,
    LowPower,
    SatelliteAcceleration,
    SatelliteRamp,
    SatelliteStep,
)
from tests.unit.faults.everywhere import (
    BEGIN,
    END,
    MEASURED,
    SETS,
    WAS,
    assert_only,
    deltas,
    rows_of,
    satellite_ecef_m,
    with_fault,
)
from tests.unit.many_signals import CLOCKS_M
from tests.unit.streams import POINTS

MOST_ERROR_M = 2e-8  # of a range as a double
SEEN = sorted({signal[:3] for signal in WAS["B", BEGIN].signals})
ONE_OF_EACH = [next(s for s in SEEN if s[0] == system) for system in "GECJRS"]
each_system = pytest.mark.parametrize("satellite", ONE_OF_EACH)
each_receiver = pytest.mark.parametrize("receiver", POINTS)


@each_system
def test_a_step_is_the_same_metres_on_all_bands_of_a_satellite_of_any_system(satellite: str) -> None:
    for found in deltas(SatelliteStep(satellite=satellite, size_m=10.0)).values():
        assert_only(found, lambda signal: signal[:3] == satellite)
        for signal, numbers in found.items():
            if signal[:3] == satellite:
                assert numbers == pytest.approx((10.0, 10.0, 0.0), abs=MOST_ERROR_M)


@each_system
def test_the_doppler_of_a_ramp_is_its_rate_on_every_band(satellite: str) -> None:
    for epoch, found in deltas(SatelliteRamp(satellite=satellite, rate_mps=-0.5)).items():
        for signal, numbers in found.items():
            at = (-0.5 * (epoch - BEGIN), -0.5 * (epoch - BEGIN), -0.5) if signal[:3] == satellite else (0.0, 0.0, 0.0)
            assert numbers == pytest.approx(at, abs=MOST_ERROR_M)


@each_receiver
def test_an_acceleration_grows_with_the_square_of_time_on_code_and_carrier(receiver: str) -> None:
    """Half a t^2, and a t in the Doppler."""
    for epoch, found in deltas(SatelliteAcceleration(satellite="G07", rate_mps2=0.2), receiver).items():
        t_s = epoch - BEGIN
        for signal, numbers in found.items():
            at = (0.1 * t_s**2, 0.1 * t_s**2, 0.2 * t_s) if signal[:3] == "G07" else (0.0, 0.0, 0.0)
            assert numbers == pytest.approx(at, abs=MOST_ERROR_M)


@each_system
def test_codes_that_diverge_leave_carriers_and_doppler_behind(satellite: str) -> None:
    for epoch, found in deltas(CodeCarrierDivergence(satellite=satellite, rate_mps=0.25)).items():
        for signal, numbers in found.items():
            apart_m = 0.25 * (epoch - BEGIN) if signal[:3] == satellite else 0.0
            assert numbers[0] == pytest.approx(apart_m, abs=MOST_ERROR_M)
            assert numbers[1:] == (0.0, 0.0)


@pytest.mark.parametrize(("name", "letter"), [("GPS", "G"), ("BeiDou", "C"), ("GLONASS", "R"), ("E", "E")])
def test_a_constellations_clock_moves_all_its_satellites_alike(name: str, letter: str) -> None:
    for found in deltas(ConstellationClock(system=name, size_m=-25.0), "C").values():
        assert_only(found, lambda signal: signal[0] == letter)
        for signal, numbers in found.items():
            if signal[0] == letter:
                assert numbers == pytest.approx((-25.0, -25.0, 0.0), abs=MOST_ERROR_M)


# A frame that is off


@each_receiver
@pytest.mark.parametrize("letter", ["G", "C", "R"])
def test_ranges_of_a_displaced_frame_are_those_to_satellites_elsewhere(receiver: str, letter: str) -> None:
    """They fly at what is broadcast less the offset. 5 mm for each kilometre are of the Earth's rotation, 1 um a metre of the air."""
    offset = np.array([60.0, -80.0, 45.0])
    antenna, row = np.array(POINTS[receiver]), WAS[receiver, BEGIN]
    found = deltas(ConstellationFrame(system=letter, offset_ecef_m=(60.0, -80.0, 45.0)), receiver)[BEGIN]
    assert_only(found, lambda signal: signal[0] == letter)
    for signal, (code_m, carrier_m, _) in found.items():
        if signal[0] == letter:
            where = satellite_ecef_m(SETS[signal[:3]], row, signal, CLOCKS_M[receiver])
            expected = np.linalg.norm(where - offset - antenna) - np.linalg.norm(where - antenna)
            assert abs(expected) > 1.0
            assert code_m == pytest.approx(expected, abs=1e-3)
            assert carrier_m == pytest.approx(code_m, abs=MOST_ERROR_M)


def test_the_doppler_of_a_displaced_frame_is_the_rate_of_its_carriers() -> None:
    """Of the difference from second to second, in their middle."""
    found = deltas(ConstellationFrame(system="E", offset_ecef_m=(300.0, 900.0, -300.0)))
    for before, after in zip(range(BEGIN, END - 1), range(BEGIN + 1, END), strict=True):
        for signal, (_, carrier_m, rate_mps) in found[after].items():
            grown_mps = carrier_m - found[before][signal][1]
            assert (rate_mps + found[before][signal][2]) / 2.0 == pytest.approx(grown_mps, abs=2e-6)
    assert max(abs(rate) for _, _, rate in found[BEGIN].values()) > 1e-3


# Power


def test_low_power_takes_the_drop_from_all_signals_of_the_satellite_and_nothing_from_others() -> None:
    now, was = rows_of(with_fault(MEASURED, LowPower(satellite="G07", drop_db=6.0)))["A", BEGIN], WAS["A", BEGIN]
    lost_db = dict(zip(was.signals, was.cn0_dbhz - now.cn0_dbhz, strict=True))
    assert {signal for signal, db in lost_db.items() if db} == {s for s in was.signals if s[:3] == "G07"}
    assert [db for db in lost_db.values() if db] == [6.0] * 4


def test_low_power_adds_the_noise_of_the_weaker_signal_and_leaves_the_carrier() -> None:
    """44 dB-Hz before, 32 after: 0.3 m at 45 dB-Hz, tenfold in 20 dB. 120 draws know that to 20 % at 3 sigma."""
    effect = LowPower(satellite="G07", drop_db=12.0)
    noise = [
        numbers for receiver in POINTS for found in deltas(effect, receiver).values() for s, numbers in found.items() if s[:3] == "G07"
    ]
    assert np.std([code_m for code_m, _, _ in noise]) == pytest.approx(np.sqrt((0.3 * 10**0.65) ** 2 - (0.3 * 10**0.05) ** 2), rel=0.2)
    assert {numbers[1:] for numbers in noise} == {(0.0, 0.0)}


def test_a_satellite_too_weak_to_be_tracked_is_lost_with_all_its_signals() -> None:
    now = rows_of(with_fault(MEASURED, LowPower(satellite="G07", drop_db=16.5)))["A", BEGIN]
    assert set(WAS["A", BEGIN].signals) - set(now.signals) == {f"G07.{code}" for code in ("1C", "2W", "2L", "5Q")}


def test_power_that_falls_slowly_falls_along_its_ramp() -> None:
    now = rows_of(with_fault(MEASURED, LowPower(satellite="G07", drop_db=8.0, ramp_s=8.0)))
    strength = [now["A", epoch].cn0_dbhz[now["A", epoch].signals.index("G07.1C")] for epoch in range(BEGIN, END)]
    assert strength == pytest.approx([44.0, 43.0, 42.0, 41.0, 40.0, 39.0, 38.0, 37.0, 36.0, 36.0])
