"""BeiDou's D1 and D2: what is refused, and what the fields mean. Values and rules from the BDS-SIS-ICD B1I 3.0."""

from collections.abc import Sequence
from dataclasses import replace

import pytest

from integrity.gnss.atmosphere import Klobuchar
from integrity.gnss.ephemeris.broadcast import KeplerEphemeris
from integrity.gnss.gps_time import NS_PER_S, WEEK_NS, gps_from_week
from integrity.gnss.navigation import beidou
from tests.sent_words import (
    D2_ON_THE_AIR,
    D2_ON_THE_AIR_NS,
    START_NS,
    beidou_set,
    beidou_subframes,
    beidou_words,
    d2_on_the_air,
    examples,
)

SETS = {name: eph for name in ("D1", "D2") if isinstance(eph := examples()[name], KeplerEphemeris)}
BOTH = pytest.mark.parametrize("eph", SETS.values(), ids=list(SETS))
PREAMBLE_AND_RESERVE = range(285, 300)  # bits of a subframe without parity, from the last


def subframes(eph: KeplerEphemeris, **own: int) -> list[int]:
    return list(beidou_subframes(eph, beidou_set(eph, **own)).values())


def decoded(eph: KeplerEphemeris, messages: Sequence[int], near_ns: int = START_NS) -> KeplerEphemeris | None:
    decode = beidou.d1_ephemeris_of if eph.message == "D1" else beidou.d2_ephemeris_of
    return decode(eph.satellite, messages, near_ns)


def with_field(eph: KeplerEphemeris, **own: int) -> KeplerEphemeris | None:
    return decoded(eph, subframes(eph, **own))


def flipped(words: tuple[int, ...], *bits: int) -> tuple[int, ...]:
    """With some of the 300 bits the other way, counted from the last."""
    message = sum(word << 30 * (9 - k) for k, word in enumerate(words))
    for bit in bits:
        message ^= 1 << bit
    return tuple(message >> 30 * (9 - k) & 0x3FFFFFFF for k in range(10))


@pytest.mark.parametrize("page", D2_ON_THE_AIR)
def test_pages_from_the_air_have_sound_parity(page: int) -> None:
    subframe = beidou.subframe_of(d2_on_the_air(page).words)
    assert subframe is not None
    assert beidou.d2_page(subframe) == page


@pytest.mark.parametrize("page", D2_ON_THE_AIR)
def test_one_wrong_bit_of_300_is_always_noticed_where_there_is_parity(page: int) -> None:
    words = d2_on_the_air(page).words
    protected = [bit for bit in range(300) if bit not in PREAMBLE_AND_RESERVE]
    assert [beidou.subframe_of(flipped(words, bit)) for bit in protected] == [None] * 285


def test_two_wrong_bits_of_one_code_are_always_noticed() -> None:
    words = d2_on_the_air(1).words
    code = [bit for bit in range(30) if bit < 4 or 8 <= bit < 19]  # the second one of the last word
    pairs = [(a, b) for a in code for b in code if a < b]
    assert [beidou.subframe_of(flipped(words, *pair)) for pair in pairs] == [None] * 105


def test_a_wrong_bit_of_the_preamble_is_noticed() -> None:
    words = d2_on_the_air(1).words
    assert [beidou.subframe_of(flipped(words, bit)) for bit in range(289, 300)] == [None] * 11


def test_the_two_bits_before_a_word_are_not_looked_at() -> None:
    words = d2_on_the_air(1).words
    assert beidou.subframe_of(tuple(word | 0xC0000000 for word in words)) == beidou.subframe_of(words)


@pytest.mark.parametrize("count", [0, 9, 11])
def test_a_subframe_has_ten_words(count: int) -> None:
    assert beidou.subframe_of((d2_on_the_air(1).words * 2)[:count]) is None


@pytest.mark.parametrize(
    ("name", "value", "sound"),
    [("preamble", 0x712, True), ("preamble", 0x713, False), ("subframe", 5, True), ("subframe", 0, False), ("subframe", 6, False),
     ("sow", 604_799, True), ("sow", 604_800, False)],
)  # fmt: skip
def test_what_has_sound_parity_but_cannot_be_a_subframe_is_refused(name: str, value: int, sound: bool) -> None:
    head = {"preamble": 0x712, "subframe": 1, "sow": 0} | {name: value}
    assert (beidou.subframe_of(beidou_words(beidou.HEAD.message(head))) is not None) == sound


@BOTH
def test_what_is_written_is_read(eph: KeplerEphemeris) -> None:
    read = [beidou.subframe_of(beidou_words(subframe)) for subframe in subframes(eph)]
    assert decoded(eph, [subframe for subframe in read if subframe is not None]) == eph


@BOTH
@pytest.mark.parametrize("weeks", [-4095, 0, 4095])
@pytest.mark.parametrize(
    "begun_ns",
    [gps_from_week(2408, 604_770.0), gps_from_week(2409, 0.0), gps_from_week(1356 + 8192, 0.0), gps_from_week(2408, 302_400.0)],
    ids=["week-end", "week-begin", "rollover", "mid-week"],
)
def test_the_week_is_the_one_near_a_known_time(eph: KeplerEphemeris, begun_ns: int, weeks: int) -> None:
    transmission_ns = begun_ns + 14 * NS_PER_S  # the week of BeiDou begins 14 s after that of GPS
    toe_ns = transmission_ns - begun_ns // NS_PER_S % 8 * NS_PER_S
    sent = replace(eph, transmission_ns=transmission_ns, toe_ns=toe_ns, toc_ns=toe_ns)
    assert decoded(sent, subframes(sent), transmission_ns + weeks * WEEK_NS) == sent


@BOTH
@pytest.mark.parametrize("later_s", [-3600, 3600])
def test_reference_times_are_within_half_a_week_of_the_transmission(eph: KeplerEphemeris, later_s: int) -> None:
    transmission_ns = gps_from_week(2409, 0.0) + 14 * NS_PER_S
    toe_ns = transmission_ns + later_s * NS_PER_S
    sent = replace(eph, transmission_ns=transmission_ns, toe_ns=toe_ns, toc_ns=toe_ns)
    assert decoded(sent, subframes(sent), transmission_ns) == sent


@BOTH
def test_subframes_of_two_frames_make_no_set(eph: KeplerEphemeris) -> None:
    messages, others = subframes(eph), subframes(replace(eph, transmission_ns=eph.transmission_ns + 30 * NS_PER_S))
    mixed = [[*messages[:k], others[k], *messages[k + 1 :]] for k in range(len(messages))]
    assert [decoded(eph, pages) for pages in mixed] == [None] * len(messages)


@BOTH
@pytest.mark.parametrize(("index", "accuracy_m"), [(0, 2.4), (6, 24.0), (14, 6144.0), (15, None)])
def test_user_range_accuracy_is_its_upper_bound(eph: KeplerEphemeris, index: int, accuracy_m: float | None) -> None:
    assert with_field(eph, ura_index=index) == replace(eph, accuracy_m=accuracy_m)


@BOTH
def test_one_bit_says_unhealthy(eph: KeplerEphemeris) -> None:
    assert with_field(eph, health=1) == replace(eph, healthy=False)


@BOTH
def test_the_issue_is_the_age_of_the_orbit_and_not_of_the_clock(eph: KeplerEphemeris) -> None:
    assert with_field(eph, aode=3, aodc=7) == replace(eph, issue=3)


@pytest.mark.parametrize("first", [beidou.D1_IONOSPHERE_AT, beidou.D2_IONOSPHERE_AT])
def test_ionosphere_where_each_message_has_it(first: int) -> None:
    sent = Klobuchar((12 * 2.0**-30, 2.0**-27, -(2.0**-24), -128 * 2.0**-24), (44 * 2.0**11, 2.0**15, -(2.0**17), -3 * 2.0**16))
    values = {f"{name}{k}": c for name, four in (("alpha", sent.alpha), ("beta", sent.beta)) for k, c in enumerate(four)}
    assert beidou.klobuchar_of(beidou.IONOSPHERE.message(values) << 224 - 64 - first, first) == sent


def test_page_2_from_the_air_holds_an_ionosphere() -> None:
    page = beidou.subframe_of(d2_on_the_air(beidou.D2_IONOSPHERE_PAGE).words)
    assert page is not None
    ionosphere = beidou.klobuchar_of(page, beidou.D2_IONOSPHERE_AT)
    # Coefficients of a day in July 2021: between 0 and 100 ns in the zenith, a period of about a day.
    assert 0.0 < ionosphere.alpha[0] < 1e-7 and 72_000.0 < ionosphere.beta[0] < 200_000.0


def test_the_set_from_the_air_is_geostationary() -> None:
    pages = [beidou.subframe_of(d2_on_the_air(page).words) for page in beidou.D2_PAGES]
    eph = beidou.d2_ephemeris_of("C01", [page for page in pages if page is not None], D2_ON_THE_AIR_NS)
    assert eph is not None
    assert eph.implausibility() is None
    assert eph.sqrt_a**2 == pytest.approx(42_164_000.0, abs=10_000.0)  # m: BDS-SIS-ICD B1I 3.0, 3.1


@BOTH
@pytest.mark.parametrize("name", ["toe_8s", "toc_8s"])
@pytest.mark.parametrize(("steps", "is_a_set"), [(75_599, True), (75_600, False), (131_071, False)])  # a week has 75,600
def test_a_reference_time_beyond_the_week_makes_no_set(eph: KeplerEphemeris, name: str, steps: int, is_a_set: bool) -> None:
    assert (with_field(eph, **{name: steps}) is not None) == is_a_set
