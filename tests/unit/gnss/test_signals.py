"""Names of signals and of pairs: their order, and which band they are in."""

import pytest

from integrity.gnss.signals import is_in_lower_band, is_pair, pair_codes_of, preference

# In the order in which they are preferred.
ORDERS = [
    ["G05.1C", "G05.2L", "G05.2W"],
    ["E11.1C", "E11.1X", "E11.1B", "E11.7Q"],
    ["C22.2I", "C22.6I", "C22.1P"],
    ["G05.1C+2L", "G05.1C+2X", "G05.1C+2S", "G05.1C+2W"],
    ["E11.1C+5Q", "E11.1C+7Q", "E11.1X+5X", "E11.1X+7X"],
    ["C22.2I+6I", "C22.2I+7I"],
    ["G05.1C+2W", "G06.1C+2L"],
]


@pytest.mark.parametrize("signals", ORDERS)
def test_signals_and_pairs_in_the_order_of_preference(signals: list[str]) -> None:
    assert sorted(signals, key=preference) == signals


@pytest.mark.parametrize("signal", ["G05.2L", "G05.5Q", "E11.5Q", "E11.7Q", "E11.6C", "C22.6I", "C22.7I", "C22.5P", "R03.2C", "J02.2L"])
def test_signals_below_l1(signal: str) -> None:
    assert is_in_lower_band(signal)


@pytest.mark.parametrize("signal", ["G05.1C", "E11.1C", "C22.2I", "C22.1P", "R03.1C", "J02.1C", "S29.1C"])
def test_signals_around_l1(signal: str) -> None:
    assert not is_in_lower_band(signal)


def test_what_is_no_band_is_not_below_l1() -> None:
    assert not is_in_lower_band("G05.9Q")


@pytest.mark.parametrize(("name", "pair"), [("G05.1C", False), ("G05.1C+2L", True)])
def test_pairs_are_told_from_signals(name: str, pair: bool) -> None:
    assert is_pair(name) is pair


def test_pairs_are_made_of_systems_that_have_two_frequencies() -> None:
    assert set(pair_codes_of(("GPS", "BeiDou", "SBAS"))) == {"G", "C"}


def test_a_code_that_is_first_and_second_stands_once() -> None:
    assert sorted(pair_codes_of(("BeiDou",))["C"]) == ["2I", "6I", "7I"]
