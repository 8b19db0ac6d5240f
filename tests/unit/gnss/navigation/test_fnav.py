"""Galileo F/NAV pages of E5a-I: what is refused, and what the fields mean. Values and rules from the Galileo OS SIS ICD 2.1."""

from dataclasses import replace

import pytest

from integrity.gnss.ephemeris.broadcast import KeplerEphemeris
from integrity.gnss.gps_time import NS_PER_S, WEEK_NS, WEEK_S, gps_from_week
from integrity.gnss.navigation import fnav
from tests.sent_words import START_NS, examples, fnav_pages, fnav_words

EPH = next(eph for eph in examples().values() if isinstance(eph, KeplerEphemeris) and eph.message == "FNAV")
FREE_BITS = range(238, 256)  # tail, and what fills the numbers up


def page_bits(words: tuple[int, ...]) -> int:
    return sum(word << 224 - 32 * k for k, word in enumerate(words))


def words_of(bits: int) -> tuple[int, ...]:
    return tuple(bits >> shift & 0xFFFFFFFF for shift in range(224, -1, -32))


def decoded(pages: dict[int, int], near_ns: int = START_NS) -> KeplerEphemeris | None:
    return fnav.ephemeris_of(EPH.satellite, pages[1], pages[2], pages[3], pages[4], near_ns)


def with_field(number: int, name: str, value: int) -> KeplerEphemeris | None:
    pages, layout = fnav_pages(EPH), fnav.PAGES[number]
    pages[number] = pages[number] & ~layout.mask(name) | layout.message({name: value})
    return decoded(pages)


@pytest.mark.parametrize("number", [1, 2, 3, 4])
def test_what_is_written_is_read(number: int) -> None:
    page = fnav_pages(EPH)[number]
    assert fnav.page_of(fnav_words(page)) == page


def test_a_set_is_what_was_sent() -> None:
    assert decoded(fnav_pages(EPH)) == EPH


@pytest.mark.parametrize("number", [1, 2, 3, 4])
def test_one_wrong_bit_of_238_is_always_noticed(number: int) -> None:
    bits = page_bits(fnav_words(fnav_pages(EPH)[number]))
    assert [fnav.page_of(words_of(bits ^ 1 << 255 - bit)) for bit in range(238)] == [None] * 238


def test_other_bits_change_nothing() -> None:
    page = fnav_pages(EPH)[1]
    bits = page_bits(fnav_words(page))
    assert {fnav.page_of(words_of(bits ^ 1 << 255 - bit)) for bit in FREE_BITS} == {page}


@pytest.mark.parametrize("count", [0, 7, 9])
def test_a_page_has_eight_words(count: int) -> None:
    assert fnav.page_of((fnav_words(fnav_pages(EPH)[1]) * 2)[:count]) is None


@pytest.mark.parametrize("number", [1, 2, 3, 4])
def test_pages_of_two_issues_make_no_set(number: int) -> None:
    assert with_field(number, "issue", EPH.issue ^ 0x200) is None


def test_page_1_of_another_satellite_makes_no_set() -> None:
    assert with_field(1, "satellite", int(EPH.satellite[1:]) + 1) is None


@pytest.mark.parametrize(("name", "value"), [("e5a_health", 1), ("e5a_health", 2), ("e5a_health", 3), ("e5a_unsure", 1)])
def test_health_is_that_of_e5a(name: str, value: int) -> None:
    assert with_field(1, name, value) == replace(EPH, healthy=False)


@pytest.mark.parametrize(("index", "accuracy_m"), [(0, 0.0), (107, 3.12), (125, 6.0), (126, None), (255, None)])
def test_signal_in_space_accuracy(index: int, accuracy_m: float | None) -> None:
    assert with_field(1, "sisa_index", index) == replace(EPH, accuracy_m=accuracy_m)


@pytest.mark.parametrize("near_weeks", [-2047, 0, 2047])
@pytest.mark.parametrize(
    "at_ns",
    [gps_from_week(2408, WEEK_S - 10.0), gps_from_week(2409, 0.0), gps_from_week(1024 + 4096, 0.0)],
    ids=["week-end", "week-begin", "rollover"],
)
def test_the_week_is_the_one_near_a_known_time(at_ns: int, near_weeks: int) -> None:
    pages = fnav_pages(EPH)
    time = {"week": at_ns // WEEK_NS % 4096 - 1024 if at_ns // WEEK_NS < 5120 else 0, "tow_s": at_ns // NS_PER_S % WEEK_S}
    pages[1] = pages[1] & ~fnav.PAGE_1.mask("week", "tow_s") | fnav.PAGE_1.message(time)
    eph = decoded(pages, at_ns + near_weeks * WEEK_NS)
    assert eph is not None
    assert eph.transmission_ns == at_ns


@pytest.mark.parametrize("toe_ns", [gps_from_week(2408, WEEK_S - 600.0), gps_from_week(2409, 0.0)], ids=["last-week", "this-week"])
def test_reference_times_are_within_half_a_week_of_the_transmission(toe_ns: int) -> None:
    sent = replace(EPH, toe_ns=toe_ns, toc_ns=toe_ns, transmission_ns=gps_from_week(2409, 600.0))
    assert decoded(fnav_pages(sent), sent.transmission_ns) == sent


@pytest.mark.parametrize(("number", "name"), [(1, "toc_60s"), (3, "toe_60s")])
@pytest.mark.parametrize(("steps", "is_a_set"), [(10_079, True), (10_080, False), (16_383, False)])  # a week has 10,080
def test_a_reference_time_beyond_the_week_makes_no_set(number: int, name: str, steps: int, is_a_set: bool) -> None:
    assert (with_field(number, name, steps) is not None) == is_a_set


@pytest.mark.parametrize(("tow_s", "is_a_page"), [(WEEK_S - 1, True), (WEEK_S, False)])
def test_page_1_of_a_time_beyond_the_week_is_none(tow_s: int, is_a_page: bool) -> None:
    page = fnav_pages(EPH)[1] & ~fnav.PAGE_1.mask("tow_s") | fnav.PAGE_1.message({"tow_s": tow_s})
    assert (fnav.page_of(fnav_words(page)) is not None) == is_a_page
