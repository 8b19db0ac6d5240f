"""What a simulated satellite sends is what the decoders find: whole sets to the bit, and the form in which a receiver delivers words."""

from dataclasses import replace

import pytest

from integrity.gnss.ephemeris.broadcast import KeplerEphemeris
from integrity.gnss.gps_time import NS_PER_S, gps_from_week
from integrity.gnss.navigation import inav, lnav
from recordings.simulate.constellation import IONOSPHERE, constellation
from recordings.simulate.navigation_words import inav_words, lnav_words

START_NS = gps_from_week(2408, 259_200.0)
SETS = constellation(5, START_NS, START_NS + 7200 * NS_PER_S)
GPS = next(eph for eph in SETS if eph.satellite[0] == "G")
GALILEO = next(eph for eph in SETS if eph.satellite[0] == "E")


def received(eph: KeplerEphemeris) -> KeplerEphemeris | None:
    """A set sent and decoded; all pages at its time of transmission."""
    at_ns = eph.transmission_ns
    if eph.satellite[0] == "G":
        subframes = [lnav.subframe_of(lnav_words(eph, IONOSPHERE, n, at_ns)) or 0 for n in (1, 2, 3)]
        return lnav.ephemeris_of(eph.satellite, subframes[0], subframes[1], subframes[2], at_ns)
    words = [inav.word_of(inav_words(eph, IONOSPHERE, n, at_ns)) or 0 for n in (1, 2, 3, 4, 5)]
    return inav.ephemeris_of(eph.satellite, words[0], words[1], words[2], words[3], words[4], at_ns)


def test_every_set_of_a_constellation_comes_back_to_the_bit() -> None:
    assert [received(eph) for eph in SETS] == list(SETS)


@pytest.mark.parametrize("eph", [GPS, GALILEO], ids=["GPS", "Galileo"])
@pytest.mark.parametrize("change", [{"healthy": False}, {"accuracy_m": None}], ids=["unhealthy", "no-accuracy"])
def test_a_set_not_to_be_used_comes_back_as_one(eph: KeplerEphemeris, change: dict[str, bool | None]) -> None:
    changed = replace(eph, **change)  # type: ignore[arg-type]
    assert received(changed) == changed


@pytest.mark.parametrize("name", ["m0", "cuc", "crs", "af0", "af1", "group_delay_s", "i_dot", "omega_dot", "delta_n", "omega"])
@pytest.mark.parametrize("eph", [GPS, GALILEO], ids=["GPS", "Galileo"])
def test_a_value_of_either_sign_comes_back(eph: KeplerEphemeris, name: str) -> None:
    changed = replace(eph, **{name: -getattr(eph, name)})
    assert received(changed) == changed


@pytest.mark.parametrize("subframe", [1, 2, 3, 4, 5])
def test_bit_30_of_a_word_says_that_its_data_are_the_right_way_up(subframe: int) -> None:
    assert not any(word >> 30 & 1 for word in lnav_words(GPS, IONOSPHERE, subframe, START_NS))


@pytest.mark.parametrize("subframe", [1, 2, 3, 4, 5])
def test_handover_word_and_last_word_end_in_00(subframe: int) -> None:
    words = lnav_words(GPS, IONOSPHERE, subframe, START_NS)
    inverted = [False]  # whether the data of each word are inverted on the air: by the last bit sent before
    for word in words:
        inverted.append(bool(word & 1) != inverted[-1])
    assert [(word ^ (0b11 if inverted[k] else 0)) & 0b11 for k, word in enumerate(words) if k in (1, 9)] == [0b00, 0b00]


def test_page_without_content_alternates_as_on_the_air() -> None:
    # Words 3 to 10 of such pages of 2025, as receivers of generation 10 deliver them.
    assert lnav_words(GPS, IONOSPHERE, 5, START_NS)[2:] == (0x102AAAAC, *[0x2AAAAABC] * 7)


def test_the_ionosphere_comes_back_to_the_bit() -> None:
    assert lnav.klobuchar_of(lnav.subframe_of(lnav_words(GPS, IONOSPHERE, 4, START_NS)) or 0) == IONOSPHERE


@pytest.mark.parametrize("subframe", [1, 2, 3, 5])
def test_no_other_subframe_has_the_ionosphere(subframe: int) -> None:
    assert lnav.klobuchar_of(lnav.subframe_of(lnav_words(GPS, IONOSPHERE, subframe, START_NS)) or 0) is None


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"af0": 0.01}, "af0 = 0.01 does not fit its 22 bits"),
        ({"toe_ns": START_NS + 8 * NS_PER_S}, "toe_16s"),
        ({"accuracy_m": 2.0}, "accuracy_m = 2.0 cannot be sent"),
        ({"fit_half_s": 3600.0}, "fit_half_s = 3600.0 cannot be sent"),
    ],
    ids=["too-large", "between-steps", "no-URA", "no-fit-interval"],
)
def test_what_has_no_room_in_the_message_is_refused(change: dict[str, float], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        received(replace(GPS, **change))  # type: ignore[arg-type]


def test_a_subframe_begins_on_a_multiple_of_6_s() -> None:
    with pytest.raises(ValueError, match="multiple of 6 s"):
        lnav_words(GPS, IONOSPHERE, 1, START_NS + 2 * NS_PER_S)
