"""Galileo I/NAV pages of E1-B and E5b-I: what is refused, and what the fields mean. Values and rules from the Galileo OS SIS ICD 2.1."""

from dataclasses import replace

import pytest

from integrity.gnss.atmosphere import GalileoIonosphere
from integrity.gnss.crc import crc24q
from integrity.gnss.ephemeris.broadcast import KeplerEphemeris
from integrity.gnss.gps_time import NS_PER_S, WEEK_S, gps_from_week
from integrity.gnss.navigation import inav
from integrity.gnss.navigation.bits import Layout
from recordings.simulate.constellation import IONOSPHERE, constellation
from recordings.simulate.navigation_words import inav_words, page_words

START_NS = gps_from_week(2408, 259_200.0)
EPH = next(eph for eph in constellation(5, START_NS, START_NS) if eph.satellite[0] == "E")
AS_SENT = replace(EPH, transmission_ns=START_NS)
LAYOUTS = (inav.WORD_1, inav.WORD_2, inav.WORD_3, inav.WORD_4, inav.WORD_5)

# Bits of the 256 that the CRC does not cover: tails, what fills the numbers up, and the reserved byte behind the CRC.
FREE_BITS = [*range(114, 128), *range(234, 256)]


def page_of(words: tuple[int, ...]) -> int:
    return sum(word << 224 - 32 * k for k, word in enumerate(words))


def words_of(page: int) -> tuple[int, ...]:
    return tuple(page >> shift & 0xFFFFFFFF for shift in range(224, -1, -32))


def sent_words(eph: KeplerEphemeris = EPH, at_ns: int = START_NS) -> list[int]:
    """Words 1 to 5, all sent at one time: only that of word 5 counts."""
    found = [inav.word_of(inav_words(eph, IONOSPHERE, n, at_ns)) for n in (1, 2, 3, 4, 5)]
    return [word for word in found if word is not None]


def altered(layout: Layout, word: int, name: str, value: int) -> int:
    """A word with other bits in an unsigned field."""
    every_bit = layout.message({name: (1 << layout.fields[name].bits) - 1})
    return word & ~every_bit | layout.message({name: value})


def decoded(words: list[int], near_ns: int = START_NS) -> KeplerEphemeris | None:
    one, two, three, four, five = words
    return inav.ephemeris_of(EPH.satellite, one, two, three, four, five, near_ns)


def with_field(number: int, name: str, value: int) -> KeplerEphemeris | None:
    words = sent_words()
    words[number - 1] = altered(LAYOUTS[number - 1], words[number - 1], name, value)
    return decoded(words)


def test_crc_has_its_published_check_value() -> None:
    assert crc24q(b"123456789") == 0xCDE703  # CRC-24/LTE-A of the CRC catalogue: same polynomial, same start


@pytest.mark.parametrize("word_type", range(7))
def test_one_wrong_bit_of_those_that_the_crc_covers_is_always_noticed(word_type: int) -> None:
    page = page_of(inav_words(EPH, IONOSPHERE, word_type, START_NS))
    protected = [bit for bit in range(256) if bit not in FREE_BITS]
    assert [inav.word_of(words_of(page ^ 1 << 255 - bit)) for bit in protected] == [None] * 220


def test_other_bits_change_nothing() -> None:
    page = page_of(inav_words(EPH, IONOSPHERE, 1, START_NS))
    assert {inav.word_of(words_of(page ^ 1 << 255 - bit)) for bit in FREE_BITS} == {sent_words()[0]}


@pytest.mark.parametrize("bits", [{"even_alert": 1}, {"odd_alert": 1}, {"even": 1}], ids=["alert-even", "alert-odd", "two-odd-parts"])
def test_another_page_with_sound_crc_is_refused(bits: dict[str, int]) -> None:
    page = page_of(inav_words(EPH, IONOSPHERE, 1, START_NS)) | inav.PAGE.message(bits)
    page = altered(inav.PAGE, page, "crc", inav.page_crc(page))
    assert inav.word_of(words_of(page)) is None


@pytest.mark.parametrize("count", [0, 7, 9])
def test_a_page_has_eight_words(count: int) -> None:
    assert inav.word_of((inav_words(EPH, IONOSPHERE, 1, START_NS) * 2)[:count]) is None


def test_a_page_is_of_all_128_bits() -> None:
    word = int.from_bytes(bytes(range(1, 17)), "big")
    assert inav.word_of(page_words(word)) == word


@pytest.mark.parametrize("number", [1, 2, 3, 4])
def test_words_of_two_issues_make_no_set(number: int) -> None:
    assert with_field(number, "issue", EPH.issue ^ 0x200) is None


def test_word_4_of_another_satellite_makes_no_set() -> None:
    assert with_field(4, "satellite", int(EPH.satellite[1:]) + 1) is None


@pytest.mark.parametrize(
    ("name", "value", "healthy"),
    [
        ("e1b_health", 1, False),  # out of service
        ("e1b_health", 2, False),  # will be out of service
        ("e1b_health", 3, False),  # in test
        ("e1b_unsure", 1, False),  # working without guarantee
        ("e5b_health", 1, True),
        ("e5b_unsure", 1, True),
    ],
)
def test_health_is_that_of_e1b(name: str, value: int, healthy: bool) -> None:
    assert with_field(5, name, value) == replace(AS_SENT, healthy=healthy)


@pytest.mark.parametrize(
    ("index", "accuracy_m"),
    [(0, 0.0), (49, 0.49), (50, 0.5), (74, 0.98), (75, 1.0), (99, 1.96), (100, 2.0), (107, 3.12), (125, 6.0), (126, None), (255, None)],
)
def test_signal_in_space_accuracy(index: int, accuracy_m: float | None) -> None:
    assert with_field(3, "sisa_index", index) == replace(AS_SENT, accuracy_m=accuracy_m)


@pytest.mark.parametrize("near_weeks", [-511, 0, 511])
@pytest.mark.parametrize(
    "at_ns",
    [gps_from_week(2408, WEEK_S - 1.0), gps_from_week(2409, 0.0), gps_from_week(1024 + 4096, 0.0)],
    ids=["week-end", "week-begin", "rollover"],
)
def test_the_week_is_the_one_near_a_known_time(at_ns: int, near_weeks: int) -> None:
    eph = decoded(sent_words(at_ns=at_ns), near_ns=at_ns + near_weeks * WEEK_S * NS_PER_S)
    assert eph is not None
    assert eph.transmission_ns == at_ns


@pytest.mark.parametrize("toe_ns", [gps_from_week(2408, WEEK_S - 600.0), gps_from_week(2409, 0.0)], ids=["last-week", "this-week"])
def test_reference_times_are_within_half_a_week_of_the_transmission(toe_ns: int) -> None:
    sent = replace(EPH, toe_ns=toe_ns, toc_ns=toe_ns, transmission_ns=gps_from_week(2409, 600.0))
    assert decoded(sent_words(sent, sent.transmission_ns), near_ns=sent.transmission_ns) == sent


def test_the_crc_covers_the_reserve_that_e5b_sends_for_osnma_and_rescue() -> None:
    page = page_of(inav_words(EPH, IONOSPHERE, 1, START_NS))
    reserve = inav.PAGE.mask("osnma", "sar", "spare")
    page = altered(inav.PAGE, page & ~reserve, "crc", inav.page_crc(page & ~reserve))
    assert inav.word_of(words_of(page)) == sent_words()[0]


@pytest.mark.parametrize(
    ("bits", "expected"),
    [
        ("00000000001" "00000000001" "00000000000001" "10000", GalileoIonosphere(0.25, 2.0**-8, 2.0**-15, 16)),
        ("11111111111" "10000000000" "10000000000000" "00001", GalileoIonosphere(511.75, -4.0, -0.25, 1)),
        ("00101000000" "11111111110" "00000001000000" "00000", GalileoIonosphere(80.0, -(2.0**-7), 2.0**-9, 0)),
    ],
)  # fmt: skip
def test_the_ionosphere_stands_in_word_5(bits: str, expected: GalileoIonosphere) -> None:  # table of the ionospheric correction
    five = sent_words()[4] & ~inav.WORD_5.mask("ionosphere") | inav.WORD_5.message({"ionosphere": int(bits, 2)})
    assert inav.nequick_of(five) == expected


@pytest.mark.parametrize(("number", "name"), [(1, "toe_60s"), (4, "toc_60s")])
@pytest.mark.parametrize(("steps", "is_a_set"), [(10_079, True), (10_080, False), (16_383, False)])  # a week has 10,080
def test_a_reference_time_beyond_the_week_makes_no_set(number: int, name: str, steps: int, is_a_set: bool) -> None:
    assert (with_field(number, name, steps) is not None) == is_a_set


@pytest.mark.parametrize(("tow_s", "is_a_word"), [(WEEK_S - 1, True), (WEEK_S, False)])
def test_word_5_of_a_time_beyond_the_week_is_none(tow_s: int, is_a_word: bool) -> None:
    word = altered(inav.WORD_5, sent_words()[4], "tow_s", tow_s)
    assert (inav.word_of(page_words(word)) is not None) == is_a_word
