from dataclasses import replace

import numpy as np
import pytest

from integrity.gnss.combination import ionosphere_free, weights_of
from integrity.gnss.ephemeris.broadcast import KeplerMessage, group_delays_s
from integrity.gnss.ephemeris.states import satellite_states
from integrity.gnss.observations import ObservationBlock, ObservationRow, build_block, layout_of
from integrity.gnss.signals import FIRST_CODES, SECOND_CODES, SYSTEMS
from tests.unit.faults.made import ephemeris

ALL_CODES = {system: FIRST_CODES[system] + SECOND_CODES.get(system, ()) + ("5Q",) for system in SYSTEMS}
GPS = ephemeris(5)
T_NS = np.array([GPS.toe_ns])


def block_of(ranges_m: dict[str, float], cn0_dbhz: tuple[float, ...] = (), slip: tuple[bool, ...] = ()) -> ObservationBlock:
    n = len(ranges_m)
    nothing, no = np.full(n, np.nan), np.zeros(n, dtype=np.bool_)
    cn0, slips = np.array(cn0_dbhz or (40.0,) * n), np.array(slip or (False,) * n)
    row = ObservationRow("A", 0, tuple(ranges_m), np.array(list(ranges_m.values())), nothing, nothing, cn0, nothing, slips, no)
    return build_block(("A",), [0], [[row]], layout_of([row], codes=ALL_CODES))


# Ratios of the carrier frequencies as the interface documents have them: 154/120, 154/118, 763/590, 763/620, 9/7.
@pytest.mark.parametrize(
    ("first", "second", "ratio"),
    [
        ("G05.1C", "G05.2W", 77 / 60),
        ("J02.1C", "J02.2L", 77 / 60),
        ("E11.1C", "E11.7Q", 77 / 59),
        ("C06.2I", "C06.7I", 763 / 590),
        ("C06.2I", "C06.6I", 763 / 620),
        ("R07.1C", "R07.2C", 9 / 7),
    ],
)
def test_a_pair_does_not_see_what_grows_with_the_square_of_the_wavelength(first: str, second: str, ratio: float) -> None:
    pairs = ionosphere_free(block_of({first: 2.2e7 + 7.3, second: 2.2e7 + 7.3 * ratio**2}))
    assert pairs.pseudorange_m[0, 0, 0] == pytest.approx(2.2e7, abs=1e-6)


def test_pairs_are_named_for_both_signals_the_preferred_one_first() -> None:
    pairs = ionosphere_free(block_of({"G05.2L": 2.2e7, "G05.1C": 2.2e7, "G05.2W": 2.2e7, "G07.1C": 2.3e7, "G09.2W": 2.3e7}))
    assert (pairs.signals, pairs.satellites) == (("G05.1C+2L", "G05.1C+2W"), ("G05", "G05"))


def test_a_pair_is_as_weak_as_the_weaker_of_its_signals() -> None:
    pairs = ionosphere_free(block_of({"G05.1C": 2.2e7, "G05.2W": 2.2e7}, cn0_dbhz=(45.0, 31.0)))
    assert pairs.cn0_dbhz[0, 0, 0] == 31.0


@pytest.mark.parametrize("slip", [(True, False), (False, True)])
def test_a_slip_of_either_signal_is_one_of_the_pair(slip: tuple[bool, bool]) -> None:
    assert ionosphere_free(block_of({"G05.1C": 2.2e7, "G05.2W": 2.2e7}, slip=slip)).slip[0, 0, 0]


def test_a_block_without_second_signals_has_no_pairs() -> None:
    assert ionosphere_free(block_of({"G05.1C": 2.2e7})).pseudorange_m.shape == (1, 1, 0)


# A satellite delays its signals by 11, 23 and 31 ns in its own equipment. What it broadcasts follows from the definitions of the interface
# documents: its clock is that of two signals combined (BeiDou: of B3I), a group delay what one signal differs from it.
PHYSICAL_S = {"1": 11e-9, "7": 23e-9, "5": 31e-9}
F = {"1": 154.0, "7": 118.0, "5": 115.0}


def combined_s(one: str, two: str) -> float:
    return (F[one] ** 2 * PHYSICAL_S[one] - F[two] ** 2 * PHYSICAL_S[two]) / (F[one] ** 2 - F[two] ** 2)


def bgd_s(other: str) -> float:
    return (PHYSICAL_S["1"] - PHYSICAL_S[other]) / (1.0 - (F["1"] / F[other]) ** 2)


@pytest.mark.parametrize(("message", "clock_of", "delays"), [("INAV", "7", (bgd_s("7"), bgd_s("5"))), ("FNAV", "5", (bgd_s("5"), None))])
@pytest.mark.parametrize("band", ["1", "7", "5"])
def test_galileo_signals_leave_when_their_equipment_lets_them(
    message: KeplerMessage, clock_of: str, delays: tuple[float, float | None], band: str
) -> None:
    galileo = replace(GPS, satellite="E05", message=message, group_delay_s=delays[0], group_delay_2_s=delays[1])
    told_s = dict(zip("175", group_delays_s(galileo), strict=True))[band]
    expected_s = None if (message, band) == ("FNAV", "7") else PHYSICAL_S[band] - combined_s("1", clock_of)
    assert told_s == pytest.approx(expected_s, abs=1e-18)


@pytest.mark.parametrize(
    ("signal", "later_s"),  # than the clock says: TGD of L1, by the square of 154/120 more of L2, none of both free of the ionosphere
    [("G05.1C", 8e-9), ("G05.2W", 8e-9 * (77 / 60) ** 2), ("G05.1C+2W", 0.0)],
)
def test_the_clock_of_a_signal_has_its_group_delay_taken_out(signal: str, later_s: float) -> None:
    delayed = replace(GPS, group_delay_s=8e-9)
    clock_s = satellite_states((delayed,), np.array([[0]]), T_NS, (signal,)).clock_s[0, 0]
    undelayed_s = satellite_states((replace(GPS, group_delay_s=0.0),), np.array([[0]]), T_NS).clock_s[0, 0]
    assert undelayed_s - clock_s == pytest.approx(later_s, abs=1e-17)


def test_a_signal_whose_group_delay_nobody_sends_has_no_clock() -> None:
    assert np.isnan(satellite_states((GPS,), np.array([[0]]), T_NS, ("G05.5Q",)).clock_s[0, 0])


@pytest.mark.parametrize(("signal", "factor"), [("G05.1C", 1.0), ("G05.2W", (77 / 60) ** 2), ("G05.1C+2W", 0.0)])
def test_the_ionosphere_delays_a_signal_by_its_frequency(signal: str, factor: float) -> None:
    assert satellite_states((GPS,), np.array([[0]]), T_NS, (signal,)).ionosphere[0, 0] == pytest.approx(factor, rel=1e-12)


def phases_of(first: str, second: str, cycles: tuple[float, float], doppler_hz: tuple[float, float]) -> ObservationBlock:
    n = np.full(2, np.nan)
    no = np.zeros(2, dtype=np.bool_)
    row = ObservationRow("A", 0, (first, second), np.full(2, 2.2e7), np.array(cycles), np.array(doppler_hz), n, n, no, no)
    return ionosphere_free(build_block(("A",), [0], [[row]], layout_of([row], codes=ALL_CODES)))


# Wavelengths as the interface documents have them; of GLONASS any channel's.
@pytest.mark.parametrize(
    ("first", "second", "ratio", "first_m"),
    [
        ("G05.1C", "G05.2W", 77 / 60, 0.19029367),
        ("E11.1C", "E11.7Q", 77 / 59, 0.19029367),
        ("C06.2I", "C06.6I", 763 / 620, 0.19203949),
        ("R07.1C", "R07.2C", 9 / 7, 0.18713637),
    ],
)
def test_the_carrier_of_a_pair_is_the_range_that_the_ionosphere_does_not_advance(
    first: str, second: str, ratio: float, first_m: float
) -> None:
    range_m, ionosphere_m = 2.2e7, 7.3
    cycles = ((range_m - ionosphere_m) / first_m, (range_m - ionosphere_m * ratio**2) / (first_m * ratio))
    pairs = phases_of(first, second, cycles, (np.nan, np.nan))
    assert pairs.carrier_cycles[0, 0, 0] * first_m == pytest.approx(range_m, abs=1e-6)


def test_doppler_of_a_pair_is_that_of_the_first() -> None:
    assert phases_of("G05.1C", "G05.2W", (1.0, 1.0), (-1234.5, np.nan)).doppler_hz[0, 0, 0] == -1234.5


# 1 / (1 - (120/154)^2) and the like: RTKLIB's manual takes 3.0, for L1 and L2.
@pytest.mark.parametrize(("signal", "noise"), [("G05.1C", 1.0), ("G05.1C+2W", 2.978), ("E11.1C+5Q", 2.588), ("C06.2I+6I", 3.527)])
def test_a_pair_is_noisier_than_its_signals(signal: str, noise: float) -> None:
    assert np.hypot(*weights_of(signal)) == pytest.approx(noise, abs=1e-3)
