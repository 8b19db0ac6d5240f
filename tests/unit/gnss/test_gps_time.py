"""GPS time against published dates: week rollovers, and the leap seconds of IERS Bulletin C."""

from datetime import UTC, date, datetime, timedelta

import pytest
from hypothesis import given
from hypothesis import strategies as st

from integrity.gnss.gps_time import (
    DAY_S,
    NS_PER_S,
    WEEK_NS,
    civil_from_days,
    days_from_civil,
    format_calendar,
    format_utc,
    gps_from_calendar,
    gps_from_utc,
    gps_from_week,
    leap_seconds_at_gps,
    parse_utc,
    utc_from_gps,
)

# GPS seconds at which each leap second (23:59:60 UTC) began, as tabulated by many tools from IERS Bulletin C.
LEAP_SECONDS_AT_S = (
    *(46828800, 78364801, 109900802, 173059203, 252028804, 315187205, 346723206, 393984007, 425520008),
    *(457056009, 504489610, 551750411, 599184012, 820108813, 914803214, 1025136015, 1119744016, 1167264017),
)
UNIX_EPOCH = datetime(1970, 1, 1, tzinfo=UTC)


@pytest.mark.parametrize(
    ("utc", "week"),
    [
        ("1980-01-06T00:00:00Z", 0),
        ("1999-08-21T23:59:47Z", 1024),  # first rollover of the ten-bit week; 13 leap seconds by then
        ("2019-04-06T23:59:42Z", 2048),  # second rollover; 18 leap seconds
    ],
)
def test_beginning_of_a_week(utc: str, week: int) -> None:
    assert parse_utc(utc) == week * WEEK_NS


def test_week_rollover_on_the_gps_scale() -> None:
    assert gps_from_calendar(1999, 8, 22, 0, 0, 0) == gps_from_week(1024, 0.0)


def test_time_of_week_to_the_nanosecond() -> None:
    assert gps_from_week(2048, 604_799.999999999) == 2049 * WEEK_NS - 1


@pytest.mark.parametrize(("leaps_before", "leap_s"), list(enumerate(LEAP_SECONDS_AT_S)))
def test_leap_seconds_step_after_each_leap_second(leaps_before: int, leap_s: int) -> None:
    inside, after = leap_s * NS_PER_S, (leap_s + 1) * NS_PER_S
    assert [leap_seconds_at_gps(t) for t in (inside, after - 1, after)] == [leaps_before, leaps_before, leaps_before + 1]


@pytest.mark.parametrize(
    ("gps_s", "utc"),
    [
        (1167264016, "2016-12-31T23:59:59Z"),
        (1167264017, "2017-01-01T00:00:00Z"),  # 23:59:60 reads as the second after it
        (1167264018, "2017-01-01T00:00:00Z"),
        (1167264019, "2017-01-01T00:00:01Z"),
    ],
)
def test_around_the_leap_second_of_2016(gps_s: int, utc: str) -> None:
    assert format_utc(gps_s * NS_PER_S) == utc


def test_the_last_second_before_a_leap_second_ends_two_seconds_before_the_next_day() -> None:
    assert parse_utc("2017-01-01T00:00:00Z") - parse_utc("2016-12-31T23:59:59Z") == 2 * NS_PER_S


# From the GPS epoch to beyond the year 2200.
@given(st.integers(0, 7_000_000_000 * NS_PER_S))
def test_utc_there_and_back_but_in_leap_seconds(gps_ns: int) -> None:
    in_leap_second = gps_ns // NS_PER_S in LEAP_SECONDS_AT_S
    assert gps_from_utc(utc_from_gps(gps_ns)) == gps_ns + in_leap_second * NS_PER_S


@given(st.dates())
def test_calendar_days_agree_with_datetime(day: date) -> None:
    assert days_from_civil(day.year, day.month, day.day) == day.toordinal() - UNIX_EPOCH.toordinal()


@given(st.integers(-719_162, 2_932_896))  # years 1 to 9999
def test_days_there_and_back(days: int) -> None:
    assert days_from_civil(*civil_from_days(days)) == days


@given(st.datetimes(datetime(1980, 1, 6), datetime(2200, 1, 1)))
def test_calendar_agrees_with_datetime(when: datetime) -> None:
    since = when - datetime(1980, 1, 6)
    expected_ns = (since.days * DAY_S + since.seconds) * NS_PER_S + since.microseconds * 1000
    assert gps_from_calendar(when.year, when.month, when.day, when.hour, when.minute, when.second, when.microsecond * 1000) == expected_ns


@given(st.datetimes(datetime(1970, 1, 1), datetime(2200, 1, 1), timezones=st.just(UTC)))
def test_format_reads_as_datetime_reads_it(when: datetime) -> None:
    unix_ns = (when - UNIX_EPOCH) // timedelta(microseconds=1) * 1000
    assert datetime.fromisoformat(format_calendar(unix_ns) + "+00:00") == when


@given(st.integers(0, 7_000_000_000 * NS_PER_S).filter(lambda t: t // NS_PER_S not in LEAP_SECONDS_AT_S))
def test_what_is_written_is_read_again(gps_ns: int) -> None:
    assert parse_utc(format_utc(gps_ns)) == gps_ns


@pytest.mark.parametrize(
    "text", ["2010-03-18T05:20:00Z", "2010-03-18T05:20:00", "2010-03-18 05:20:00Z", "2010-03-18T05:20Z", "2010-03-18T05:20"]
)
def test_forms_of_one_time(text: str) -> None:
    assert parse_utc(text) == 952_924_815 * NS_PER_S  # Unix 1268889600 - 315964800 + 15 leap seconds


def test_a_fraction_is_kept_to_the_nanosecond() -> None:
    assert parse_utc("2010-03-18T05:20:00.000000001Z") - parse_utc("2010-03-18T05:20:00Z") == 1


@pytest.mark.parametrize(
    "text",
    [
        "",
        "yesterday",
        "2010-03-18",
        "18.03.2010 05:20",
        "2010-02-29T00:00:00Z",  # 2010 has no such day
        "2010-13-01T00:00:00Z",
        "2010-03-18T24:00:00Z",
        "2010-03-18T05:60:00Z",
        "2016-12-31T23:59:60Z",  # has no number of its own
        "2010-03-18T05:20:00+09:00",  # another zone would be read as UTC
        "2010-03-18T05:20:00.0000000001Z",  # finer than a nanosecond
    ],
)
def test_what_is_not_a_utc_time_is_refused(text: str) -> None:
    with pytest.raises(ValueError, match=r"not a UTC time|no such"):
        parse_utc(text)


@pytest.mark.parametrize("ns", [-1, NS_PER_S])
def test_nanoseconds_outside_a_second_are_refused(ns: int) -> None:
    with pytest.raises(ValueError, match="no such time of day"):
        gps_from_calendar(2010, 3, 18, 5, 20, 0, ns)


@pytest.mark.parametrize(("year", "leap"), [(1900, False), (2000, True), (2024, True), (2100, False)])
def test_the_29th_of_february(year: int, leap: bool) -> None:
    try:
        days_from_civil(year, 2, 29)
    except ValueError:
        exists = False
    else:
        exists = True
    assert exists == leap
