"""GLONASS strings: what is refused, what the fields mean; days, leap seconds and four years. Values and rules from the GLONASS ICD 5.1."""

from dataclasses import replace

import pytest

from integrity.gnss.ephemeris.broadcast import GlonassEphemeris
from integrity.gnss.gps_time import NS_PER_S, parse_utc
from integrity.gnss.navigation import glonass
from integrity.gnss.navigation.collector import NavigationCollector
from tests.sent_words import GLONASS_ON_THE_AIR_NS, examples, glonass_on_the_air, glonass_words, words_of

EPH = next(eph for eph in examples().values() if isinstance(eph, GlonassEphemeris))
NUMBERS = (1, 2, 3, 4)
FILLING = range(11)  # bits of the third word behind the string


def strings_of(eph: GlonassEphemeris, **own: int) -> list[int]:
    """As they are kept."""
    said = [words_of(eph, number, **own) for number in NUMBERS]
    read = [glonass.string_of(words.words, words.channel) for words in said]
    return [string for string in read if string is not None]


def decoded(strings: list[int], near_ns: int = EPH.transmission_ns) -> GlonassEphemeris | None:
    one, two, three, four = strings
    return glonass.ephemeris_of(EPH.satellite, one, two, three, four, near_ns)


def with_field(number: int, name: str, value: int) -> GlonassEphemeris | None:
    strings, layout = strings_of(EPH), glonass.STRINGS[number]
    strings[number - 1] = strings[number - 1] & ~layout.mask(name) | layout.message({name: value})
    return decoded(strings)


def sent_at(utc: str, t_b_utc: str) -> GlonassEphemeris:
    """A set transmitted from one UTC time on, for another."""
    toe_ns = parse_utc(t_b_utc)
    minutes = int(t_b_utc[11:13]) * 60 + int(t_b_utc[14:16]) + 180
    return replace(EPH, transmission_ns=parse_utc(utc), toe_ns=toe_ns, issue=minutes % 1440 // 15)


def test_the_set_from_the_air_is_the_one_that_it_says() -> None:
    collector = NavigationCollector()
    (eph,) = [eph for number in NUMBERS for eph in collector.take(glonass_on_the_air(number), GLONASS_ON_THE_AIR_NS)]
    assert isinstance(eph, GlonassEphemeris)
    assert (eph.transmission_ns, eph.toe_ns) == (parse_utc("2015-06-27T00:40:00Z"), parse_utc("2015-06-27T00:45:00Z"))
    assert eph.implausibility() is None


@pytest.mark.parametrize("number", NUMBERS)
def test_one_wrong_bit_of_85_is_always_noticed(number: int) -> None:
    first, second, third, frame = glonass_on_the_air(number).words
    bits = first << 64 | second << 32 | third
    wrong = [bits ^ 1 << 95 - bit for bit in range(85)]
    assert [glonass.string_of((w >> 64, w >> 32 & 0xFFFFFFFF, w & 0xFFFFFFFF, frame), 1) for w in wrong] == [None] * 85


def test_two_wrong_bits_are_always_noticed() -> None:
    first, second, third, frame = glonass_on_the_air(1).words
    bits = first << 64 | second << 32 | third
    wrong = [bits ^ 1 << a ^ 1 << b for a in range(11, 96) for b in range(11, a)]
    assert {glonass.string_of((w >> 64, w >> 32 & 0xFFFFFFFF, w & 0xFFFFFFFF, frame), 1) for w in wrong} == {None}


def test_what_fills_the_third_word_up_is_not_looked_at() -> None:
    first, second, third, frame = glonass_on_the_air(1).words
    expected = glonass.string_of((first, second, third, frame), 1)
    assert {glonass.string_of((first, second, third ^ 1 << bit, frame), 1) for bit in FILLING} == {expected}


@pytest.mark.parametrize("count", [0, 3, 5])
def test_a_string_has_four_words(count: int) -> None:
    assert glonass.string_of((glonass_on_the_air(1).words * 2)[:count], 1) is None


@pytest.mark.parametrize("channel", [None, -8, 7])
def test_without_a_channel_it_is_not_used(channel: int | None) -> None:
    assert glonass.string_of(glonass_on_the_air(1).words, channel) is None


@pytest.mark.parametrize(("number", "idle", "sound"), [(15, 0, True), (0, 0, False), (1, 1, False)], ids=["last", "zero", "idle-bit"])
def test_what_has_a_sound_code_but_cannot_be_a_string_is_refused(number: int, idle: int, sound: bool) -> None:
    string = glonass.HEAD.message({"string": number, "idle": idle})
    assert (glonass.string_of(glonass_words(string, 0x0001_0001), 0) is not None) == sound


def test_what_is_written_is_read() -> None:
    assert decoded(strings_of(EPH)) == EPH


@pytest.mark.parametrize("channel", [-7, 0, 6])
def test_the_channel_is_that_of_the_words(channel: int) -> None:
    assert decoded(strings_of(replace(EPH, channel=channel))) == replace(EPH, channel=channel)


def test_numbers_have_a_sign_and_a_magnitude() -> None:
    sent = replace(EPH, x_m=-EPH.x_m, vy_mps=-EPH.vy_mps, az_mps2=-EPH.az_mps2, tau_n_s=-EPH.tau_n_s, gamma_n=-5 * 2.0**-40)
    assert decoded(strings_of(sent)) == sent


def test_minus_zero_is_zero() -> None:
    strings, layout = strings_of(EPH), glonass.STRING_4
    magnitude = layout.message({"tau_n_s": ((1 << 21) - 1) * 2.0**-30})
    strings[3] = strings[3] & ~magnitude | layout.mask("tau_n_s") & ~magnitude
    assert decoded(strings) == replace(EPH, tau_n_s=0.0)


@pytest.mark.parametrize(
    ("number", "name", "healthy"), [(2, "unhealthy", False), (3, "unhealthy", False), (2, "b_n", True)], ids=["B_n", "l_n", "rest-of-B_n"]
)
def test_health_is_the_highest_bit_of_b_n_and_l_n(number: int, name: str, healthy: bool) -> None:
    assert with_field(number, name, 1) == replace(EPH, healthy=healthy)


@pytest.mark.parametrize(("index", "accuracy_m"), [(0, 1.0), (2, 2.5), (9, 16.0), (14, 512.0), (15, None)])
def test_accuracy(index: int, accuracy_m: float | None) -> None:
    assert with_field(4, "f_t_index", index) == replace(EPH, accuracy_m=accuracy_m)


@pytest.mark.parametrize(
    ("number", "name", "value"),
    [(1, "t_k_h", 24), (1, "t_k_min", 60), (2, "t_b_15min", 96), (4, "n_t_days", 0), (4, "n_t_days", 1462), (4, "slot", 0), (4, "slot", 2)],
)
def test_times_and_satellites_that_cannot_be_make_no_set(number: int, name: str, value: int) -> None:
    assert with_field(number, name, value) is None


@pytest.mark.parametrize("number", NUMBERS)
def test_strings_of_two_frames_make_no_set(number: int) -> None:
    assert with_field(number, "frame", 0x0002_0003) is None


@pytest.mark.parametrize(
    ("transmission", "t_b"),
    [
        ("2026-03-04T20:59:30Z", "2026-03-04T20:45:00Z"),  # 23:45 of the day, the last frame of it
        ("2026-03-04T21:00:30Z", "2026-03-04T20:45:00Z"),  # still 23:45, the day has changed
        ("2026-03-04T20:59:30Z", "2026-03-04T21:15:00Z"),  # 0:15 of the next day
        ("2026-03-04T21:00:00Z", "2026-03-04T21:15:00Z"),
        ("2023-12-31T20:59:30Z", "2023-12-31T20:45:00Z"),  # the last of four years
        ("2023-12-31T21:00:00Z", "2023-12-31T21:15:00Z"),  # day 1 of the next four
        ("2023-12-31T21:00:30Z", "2023-12-31T20:45:00Z"),
        ("2016-12-31T23:59:30Z", "2017-01-01T00:15:00Z"),  # a leap second between them
        ("2017-01-01T00:00:30Z", "2016-12-31T23:45:00Z"),
        ("2017-01-01T00:00:00Z", "2017-01-01T00:15:00Z"),
        ("2024-02-29T12:00:00Z", "2024-02-29T12:15:00Z"),
    ],
)
@pytest.mark.parametrize("near_days", [-729, 0, 729])
def test_day_wrap_four_years_and_leap_seconds(transmission: str, t_b: str, near_days: int) -> None:
    sent = sent_at(transmission, t_b)
    assert decoded(strings_of(sent), sent.transmission_ns + near_days * 86_400 * NS_PER_S) == sent


def test_the_leap_second_lies_between_a_frame_and_its_reference_time() -> None:
    sent = sent_at("2016-12-31T23:59:30Z", "2017-01-01T00:15:00Z")
    assert sent.toe_ns - sent.transmission_ns == (15 * 60 + 30 + 1) * NS_PER_S


def test_the_day_counts_from_the_first_of_a_leap_year() -> None:
    assert with_field(4, "n_t_days", 366 + 365 + 31 + 28 + 4) == EPH  # 2026-03-04, since the end of 2023
