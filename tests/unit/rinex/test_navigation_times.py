"""Times in navigation files: every system's own scale, weeks and days that begin anew, leap seconds; sets that change."""

from dataclasses import replace
from pathlib import Path

import pytest

from integrity.gnss.gps_time import BDT_BEHIND_GPS_NS, NS_PER_S, format_utc, gps_from_week, parse_utc
from tests import rinex_examples as example
from tests.rinex_examples import ephemeris, kepler, with_value
from tests.rinex_text import navigation_text
from tests.unit.rinex.navigation_files import HEADER_2, HEADER_2_GLONASS, read, record_2

TOE_NS = gps_from_week(1025, 409_904.0)


def gps_at(head: str, toe_s: float, transmission_s: float) -> tuple[int, int, int]:
    """Reference times of orbit and clock, and time of transmission."""
    eph = kepler(head, with_value(with_value(example.GPS, 3, 0, toe_s), 7, 0, transmission_s))
    return eph.toe_ns, eph.toc_ns, eph.transmission_ns


@pytest.mark.parametrize(
    ("written_s", "seconds_before_toe"),
    [
        (406_800.0, 3104),
        (411_000.0, -1096),  # Galileo sends a set hours after its reference time
        (-198_000.0, 3104),  # counted back from the end of the week: 406800 - 604800
        (1_011_600.0, 3104),  # counted on from the week before
        (0.9999e9, 7200),  # RINEX 2.11, 6.8: unknown
        (300_000.0, 7200),  # more than a day away
        (None, 7200),
    ],
)
def test_transmission_time_belongs_to_the_week_nearest_to_toe(written_s: float | None, seconds_before_toe: int) -> None:
    eph = kepler(example.GPS_HEAD, with_value(example.GPS, 7, 0, written_s))
    assert eph.toe_ns - eph.transmission_ns == seconds_before_toe * NS_PER_S


def test_transmission_before_midnight_of_a_toe_in_the_new_week() -> None:
    new_week = gps_from_week(1026, 0.0)
    assert gps_at("G06 1999 09 05 00 00 00", 0.0, 597_600.0) == (new_week, new_week, gps_from_week(1025, 597_600.0))


def test_orbit_of_the_week_after_that_of_the_clock() -> None:
    toe_ns, toc_ns, _ = gps_at("G06 1999 09 04 23 00 00", 7200.0, 600_000.0)
    assert (toe_ns, toc_ns) == (gps_from_week(1026, 7200.0), gps_from_week(1025, 601_200.0))


@pytest.mark.parametrize("week", [1.0, 0.0, 2049.0, None])
def test_absurd_week_is_taken_from_the_epoch(week: float | None) -> None:
    """1 is 1025 modulo 1024: what satellites send."""
    assert kepler(example.GPS_HEAD, with_value(example.GPS, 5, 2, week)).toe_ns == TOE_NS


@pytest.mark.parametrize(
    ("head", "week"),
    [("G06 1999 08 22 00 00 00", 1024), ("G06 2019 04 07 00 00 00", 2048)],  # the two times at which GPS' ten bits began anew
)
def test_when_the_weeks_of_gps_begin_anew(head: str, week: int) -> None:
    eph = kepler(head, with_value(with_value(with_value(example.GPS, 3, 0, 0.0), 5, 2, 0.0), 7, 0, 597_600.0))
    assert (eph.toe_ns, eph.transmission_ns) == (gps_from_week(week, 0.0), gps_from_week(week - 1, 597_600.0))


def test_clock_reference_time_to_a_tenth_of_a_second(tmp_path: Path) -> None:
    (eph,) = read(tmp_path, HEADER_2 + record_2(" 6", example.GPS_HEAD, example.GPS).replace("51 44.0", "51 44.3")).ephemerides
    assert getattr(eph, "toc_ns", None) == TOE_NS + 300_000_000


def test_beidou_set_of_the_first_second_of_its_week() -> None:
    """In GPS time that is 14 s into the week; its transmission may be of the old one."""
    rows = with_value(with_value(example.BEIDOU, 3, 0, 0.0), 7, 0, 604_770.0)
    eph = kepler("C01 2014 05 11 00 00 00", rows)
    assert eph.toe_ns == gps_from_week(1792, 0.0) + BDT_BEHIND_GPS_NS
    assert eph.toe_ns - eph.transmission_ns == 30 * NS_PER_S


@pytest.mark.parametrize(
    ("head", "frame_s", "toe", "sent", "issue"),
    [
        # 2006-10-01 was a Sunday. The Moscow day begins at 21 h UTC, and its issues with it.
        ("R02 2006 10 01 00 15 00", 30.0, "2006-10-01T00:15:00Z", "2006-10-01T00:00:30Z", 13),
        ("R02 2006 10 01 00 15 00", 604_770.0, "2006-10-01T00:15:00Z", "2006-09-30T23:59:30Z", 13),
        ("R02 2006 10 02 00 15 00", 86_430.0, "2006-10-02T00:15:00Z", "2006-10-02T00:00:30Z", 13),
        ("R02 2006 10 02 00 15 00", 86_370.0, "2006-10-02T00:15:00Z", "2006-10-01T23:59:30Z", 13),
        ("R02 2006 10 01 20 45 00", 73_830.0, "2006-10-01T20:45:00Z", "2006-10-01T20:30:30Z", 95),
        ("R02 2006 10 01 21 15 00", 75_630.0, "2006-10-01T21:15:00Z", "2006-10-01T21:00:30Z", 1),
        ("R02 2006 10 07 23 45 00", 603_030.0, "2006-10-07T23:45:00Z", "2006-10-07T23:30:30Z", 11),
    ],
)
def test_day_and_week_of_glonass_begin_anew(head: str, frame_s: float, toe: str, sent: str, issue: int) -> None:
    eph = ephemeris(head, with_value(example.GLONASS, 0, 2, frame_s))
    assert (format_utc(eph.toe_ns), format_utc(eph.transmission_ns), eph.issue) == (toe, sent, issue)


def test_frame_time_of_rinex_2_counts_from_the_beginning_of_the_day(tmp_path: Path) -> None:
    text = HEADER_2_GLONASS + record_2(" 2", "R02 2006 10 05 00 15 00", with_value(example.GLONASS, 0, 2, 86_370.0))
    (eph,) = read(tmp_path, text).ephemerides
    assert format_utc(eph.transmission_ns) == "2006-10-04T23:59:30Z"


def test_glonass_across_a_leap_second() -> None:
    """Between the two is a second more than the clock of UTC says: 2016 ended in 23:59:60."""
    before, after = (ephemeris(f"R02 {day} 00", example.GLONASS) for day in ("2016 12 31 23 45", "2017 01 01 00 15"))
    assert after.toe_ns - before.toe_ns == 1801 * NS_PER_S
    assert after.toe_ns == parse_utc("2017-01-01T00:15:00Z")


def test_sets_of_other_systems_know_no_leap_second() -> None:
    before, after = (
        kepler(f"G06 {day} 00", with_value(example.GPS, 3, 0, s)) for day, s in (("2016 12 31 22 00", 597_600.0), ("2017 01 01 00 00", 0.0))
    )
    assert after.toe_ns - before.toe_ns == 7200 * NS_PER_S


@pytest.mark.parametrize("kind", [kind for kind in example.EVERY_KIND if kind != "Galileo F/NAV"])
def test_what_a_satellite_says_next_is_another_set(tmp_path: Path, kind: str) -> None:
    """Health without a new issue, and a new issue: both are kept, in order."""
    first = example.EVERY_KIND[kind]
    told = [first, replace(first, healthy=False, transmission_ns=first.transmission_ns + 30 * NS_PER_S)]
    if kind != "GLONASS":  # whose issue is its time
        told.append(replace(first, issue=first.issue + 1, transmission_ns=first.transmission_ns + 60 * NS_PER_S))
    assert list(read(tmp_path, navigation_text(told)).ephemerides) == told


@pytest.mark.parametrize("kind", example.EVERY_KIND)
def test_what_is_written_is_read_again(tmp_path: Path, kind: str) -> None:
    eph = example.EVERY_KIND[kind]
    file = read(tmp_path, navigation_text([eph]))
    assert (*file.ephemerides, *file.fnav_ephemerides) == (eph,)
