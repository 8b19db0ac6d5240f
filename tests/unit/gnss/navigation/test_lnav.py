"""GPS subframes: what is refused, and what the fields mean. Values and rules from IS-GPS-200, sections as named."""

from dataclasses import replace

import pytest

from integrity.gnss.ephemeris.broadcast import KeplerEphemeris
from integrity.gnss.gps_time import NS_PER_S, WEEK_S, gps_from_week
from integrity.gnss.navigation import lnav
from integrity.gnss.navigation.bits import Layout
from recordings.simulate.constellation import IONOSPHERE, constellation
from recordings.simulate.navigation_words import lnav_words, subframe_words

START_NS = gps_from_week(2408, 259_200.0)
EPH = next(eph for eph in constellation(5, START_NS, START_NS) if eph.satellite[0] == "G")
AS_SENT = replace(EPH, transmission_ns=START_NS)
LAYOUTS = {1: lnav.SUBFRAME_1, 2: lnav.SUBFRAME_2, 3: lnav.SUBFRAME_3}


def subframes(eph: KeplerEphemeris = EPH, first_ns: int = START_NS) -> dict[int, int]:
    """The messages of subframes 1 to 3, six seconds apart."""
    sent = {n: lnav.subframe_of(lnav_words(eph, IONOSPHERE, n, first_ns + (n - 1) * 6 * NS_PER_S)) for n in (1, 2, 3)}
    return {n: message for n, message in sent.items() if message is not None}


def altered(layout: Layout, message: int, name: str, value: int) -> int:
    """A message with other bits in a field."""
    fields = {name: layout.fields[name]._replace(unit=None, signed=False)}
    return message & ~layout.mask(name) | Layout(layout.bits, fields).message({name: value})


def decoded(messages: dict[int, int], near_ns: int = START_NS) -> KeplerEphemeris:
    eph = lnav.ephemeris_of(EPH.satellite, messages[1], messages[2], messages[3], near_ns)
    assert eph is not None
    return eph


def with_field(number: int, name: str, value: int) -> KeplerEphemeris:
    messages = subframes()
    return decoded(messages | {number: altered(LAYOUTS[number], messages[number], name, value)})


@pytest.mark.parametrize("number", [1, 2, 3, 4, 5])
def test_one_wrong_bit_of_300_is_always_noticed(number: int) -> None:
    words = lnav_words(EPH, IONOSPHERE, number, START_NS)
    flipped = ((*words[:k], words[k] ^ 1 << bit, *words[k + 1 :]) for k in range(10) for bit in range(30))
    assert [lnav.subframe_of(wrong) for wrong in flipped] == [None] * 300


@pytest.mark.parametrize("number", [1, 2, 3, 4, 5])
def test_one_word_the_wrong_way_up_is_noticed(number: int) -> None:
    words = lnav_words(EPH, IONOSPHERE, number, START_NS)
    inverted = ((*words[:k], words[k] ^ 0x3FFFFFFF, *words[k + 1 :]) for k in range(10))
    assert [lnav.subframe_of(wrong) for wrong in inverted] == [None] * 10


def test_the_two_bits_before_a_word_are_not_looked_at() -> None:
    words = lnav_words(EPH, IONOSPHERE, 1, START_NS)
    assert lnav.subframe_of(tuple(word & 0x3FFFFFFF for word in words)) == lnav.subframe_of(words)


@pytest.mark.parametrize("count", [0, 9, 11])
def test_a_subframe_has_ten_words(count: int) -> None:
    assert lnav.subframe_of((lnav_words(EPH, IONOSPHERE, 1, START_NS) * 2)[:count]) is None


@pytest.mark.parametrize(
    ("name", "value", "sound"),
    [
        ("preamble", 0x8B, True),  # 20.3.3.1
        ("preamble", 0x74, False),
        ("subframe", 5, True),
        ("subframe", 0, False),
        ("subframe", 6, False),
        ("next_tow_count", 100_799, True),  # 20.3.3.2
        ("next_tow_count", 100_800, False),
    ],
)
def test_what_has_sound_parity_but_cannot_be_a_subframe_is_refused(name: str, value: int, sound: bool) -> None:
    message = altered(lnav.HEAD, subframes()[1], name, value)
    assert (lnav.subframe_of(subframe_words(message)) is not None) == sound


@pytest.mark.parametrize("near_weeks", [-511, 0, 511])
@pytest.mark.parametrize(
    "first_ns",
    [
        gps_from_week(2047, WEEK_S - 30.0),
        gps_from_week(2047, WEEK_S - 6.0),  # the handover word already says zero, the week is still the old one
        gps_from_week(2048, 0.0),  # 2019-04-07, the ten bits of the week begin again
        gps_from_week(2408, WEEK_S - 6.0),
        gps_from_week(2409, 0.0),
    ],
    ids=["before-rollover", "last-subframe", "rollover", "week-end", "week-begin"],
)
def test_the_week_is_the_one_within_512_of_a_known_time(first_ns: int, near_weeks: int) -> None:
    eph = decoded(subframes(first_ns=first_ns), near_ns=first_ns + near_weeks * WEEK_S * NS_PER_S)
    assert eph.transmission_ns == first_ns


@pytest.mark.parametrize("toe_ns", [gps_from_week(2409, 0.0), gps_from_week(2408, WEEK_S - 16.0)], ids=["next-week", "this-week"])
def test_reference_times_are_within_half_a_week_of_the_transmission(toe_ns: int) -> None:
    sent = replace(EPH, toe_ns=toe_ns, toc_ns=toe_ns, transmission_ns=gps_from_week(2408, WEEK_S - 7200.0))
    assert decoded(subframes(sent, sent.transmission_ns), near_ns=sent.transmission_ns) == sent


@pytest.mark.parametrize(("number", "name"), [(1, "iodc"), (2, "iode"), (3, "iode")])
def test_subframes_of_two_issues_make_no_set(number: int, name: str) -> None:
    messages = subframes()
    messages[number] = altered(LAYOUTS[number], messages[number], name, EPH.issue ^ 0x80)
    assert lnav.ephemeris_of(EPH.satellite, messages[1], messages[2], messages[3], START_NS) is None


def test_only_the_low_byte_of_iodc_is_the_issue() -> None:
    assert with_field(1, "iodc", EPH.issue | 0x300) == AS_SENT


@pytest.mark.parametrize(("index", "accuracy_m"), [(0, 2.4), (6, 24.0), (14, 6144.0), (15, None)])
def test_user_range_accuracy_is_its_upper_bound(index: int, accuracy_m: float | None) -> None:  # 20.3.3.3.1.3
    assert with_field(1, "ura_index", index).accuracy_m == accuracy_m


@pytest.mark.parametrize("health", [1, 2, 4, 8, 16, 32])
def test_any_bit_of_health_is_unhealthy(health: int) -> None:
    assert with_field(1, "health", health) == replace(AS_SENT, healthy=False)


@pytest.mark.parametrize("number", [1, 2, 3])
def test_an_alert_leaves_no_accuracy_promised(number: int) -> None:  # 20.3.3.2
    assert with_field(number, "alert", 1) == replace(AS_SENT, accuracy_m=None)


def test_the_fit_interval_flag_means_six_hours() -> None:  # 20.3.3.4.3.1
    assert with_field(2, "fit_flag", 1) == replace(AS_SENT, fit_half_s=10_800.0)


def of_qzss(number: int, name: str, value: int) -> KeplerEphemeris | None:
    messages = subframes()
    messages[number] = altered(LAYOUTS[number], messages[number], name, value)
    return lnav.ephemeris_of("J02", messages[1], messages[2], messages[3], START_NS)


@pytest.mark.parametrize(("flag", "fit_half_s"), [(0, 5400.0), (1, 7200.0)])
def test_the_fit_interval_of_qzss_is_shorter(flag: int, fit_half_s: float) -> None:  # 2 h, or more
    assert of_qzss(2, "fit_flag", flag) == replace(AS_SENT, satellite="J02", fit_half_s=fit_half_s)


# Sound satellites of March 2021 send 1.
@pytest.mark.parametrize(("health", "healthy"), [(0, True), (1, True), (2, False), (16, False), (32, False), (33, False)])
def test_the_last_bit_of_health_of_qzss_is_of_another_signal(health: int, healthy: bool) -> None:
    assert of_qzss(1, "health", health) == replace(AS_SENT, satellite="J02", healthy=healthy, fit_half_s=5400.0)


@pytest.mark.parametrize(("bits", "is_a_set"), [(0x80, False), (0x81, True), (0x7F, True)])
def test_without_a_group_delay_qzss_has_no_set(bits: int, is_a_set: bool) -> None:
    assert (of_qzss(1, "group_delay_s", bits) is not None) == is_a_set


@pytest.mark.parametrize(("number", "name"), [(1, "toc_16s"), (2, "toe_16s")])
@pytest.mark.parametrize(("steps", "is_a_set"), [(37_799, True), (37_800, False), (65_535, False)])  # a week has 37,800; table 20-III
def test_a_reference_time_beyond_the_week_makes_no_set(number: int, name: str, steps: int, is_a_set: bool) -> None:
    messages = subframes()
    messages[number] = altered(LAYOUTS[number], messages[number], name, steps)
    assert (lnav.ephemeris_of(EPH.satellite, messages[1], messages[2], messages[3], START_NS) is not None) == is_a_set
