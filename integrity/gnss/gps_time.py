"""GPS time as integer nanoseconds since 1980-01-06T00:00:00, and its relation to UTC.

UTC is integer nanoseconds of the Unix scale (no leap second has a number of its own: 23:59:60 reads as the second after it).
Source: IS-GPS-200, 20.3.3.5.2.4, and IERS Bulletin C for the dates of the leap seconds.
"""

import re

NS_PER_S = 1_000_000_000
DAY_S = 86_400
WEEK_S = 604_800
WEEK_NS = WEEK_S * NS_PER_S
BDT_BEHIND_GPS_NS = 14 * NS_PER_S  # BeiDou time: no leap seconds since 2006; BDS-SIS-ICD B1I 3.0, 3.3
GLONASS_AHEAD_OF_UTC_NS = 3 * 3600 * NS_PER_S  # GLONASS ICD 5.1, 3.3.3
GPS_EPOCH_UNIX_S = 315_964_800  # 1980-01-06T00:00:00 UTC

# Each date is the first day on which GPS - UTC has the given value.
_LEAP_SECOND_DATES = (
    (1980, 1, 6, 0),
    (1981, 7, 1, 1),
    (1982, 7, 1, 2),
    (1983, 7, 1, 3),
    (1985, 7, 1, 4),
    (1988, 1, 1, 5),
    (1990, 1, 1, 6),
    (1991, 1, 1, 7),
    (1992, 7, 1, 8),
    (1993, 7, 1, 9),
    (1994, 7, 1, 10),
    (1996, 1, 1, 11),
    (1997, 7, 1, 12),
    (1999, 1, 1, 13),
    (2006, 1, 1, 14),
    (2009, 1, 1, 15),
    (2012, 7, 1, 16),
    (2015, 7, 1, 17),
    (2017, 1, 1, 18),
)


def days_from_civil(year: int, month: int, day: int) -> int:
    """Days from 1970-01-01 to a date of the proleptic Gregorian calendar; raises ValueError for a date that does not exist."""
    if not (1 <= month <= 12 and 1 <= day <= _days_in_month(year, month)):
        raise ValueError(f"no such date: {year:04d}-{month:02d}-{day:02d}")
    y = year - (month <= 2)
    era, year_of_era = divmod(y, 400)
    day_of_year = (153 * ((month + 9) % 12) + 2) // 5 + day - 1
    day_of_era = year_of_era * 365 + year_of_era // 4 - year_of_era // 100 + day_of_year
    return era * 146_097 + day_of_era - 719_468


def civil_from_days(days: int) -> tuple[int, int, int]:
    """Year, month, day of a day counted from 1970-01-01; inverse of `days_from_civil`."""
    era, day_of_era = divmod(days + 719_468, 146_097)
    year_of_era = (day_of_era - day_of_era // 1460 + day_of_era // 36_524 - day_of_era // 146_096) // 365
    day_of_year = day_of_era - (365 * year_of_era + year_of_era // 4 - year_of_era // 100)
    month_index = (5 * day_of_year + 2) // 153
    month = month_index + 3 if month_index < 10 else month_index - 9
    return year_of_era + era * 400 + (month <= 2), month, day_of_year - (153 * month_index + 2) // 5 + 1


def _days_in_month(year: int, month: int) -> int:
    if month == 2:
        return 29 if year % 4 == 0 and (year % 100 != 0 or year % 400 == 0) else 28
    return 30 if month in (4, 6, 9, 11) else 31


_LEAP_STEPS = tuple((days_from_civil(y, m, d) * DAY_S, leap_s) for y, m, d, leap_s in _LEAP_SECOND_DATES)


def leap_seconds_at_gps(gps_ns: int) -> int:
    """GPS - UTC in seconds at a GPS time."""
    gps_s = gps_ns // NS_PER_S
    for utc_s, leap_s in reversed(_LEAP_STEPS):
        if gps_s >= utc_s - GPS_EPOCH_UNIX_S + leap_s:
            return leap_s
    return 0


def gps_from_utc(utc_ns: int) -> int:
    """GPS time of a Unix time, both in nanoseconds."""
    leap_s = next((leap_s for utc_s, leap_s in reversed(_LEAP_STEPS) if utc_ns >= utc_s * NS_PER_S), 0)
    return utc_ns - (GPS_EPOCH_UNIX_S - leap_s) * NS_PER_S


def utc_from_gps(gps_ns: int) -> int:
    """Unix time of a GPS time, both in nanoseconds."""
    return gps_ns + (GPS_EPOCH_UNIX_S - leap_seconds_at_gps(gps_ns)) * NS_PER_S


def gps_from_calendar(year: int, month: int, day: int, hour: int, minute: int, second: int, ns: int = 0) -> int:
    """GPS time of a calendar date *on the GPS scale* (as RINEX writes it), in nanoseconds; ValueError where there is no such time."""
    if not (0 <= hour < 24 and 0 <= minute < 60 and 0 <= second < 60 and 0 <= ns < NS_PER_S):
        raise ValueError(f"no such time of day: {hour:02d}:{minute:02d}:{second:02d}")
    days = days_from_civil(year, month, day) - GPS_EPOCH_UNIX_S // DAY_S
    return (days * DAY_S + hour * 3600 + minute * 60 + second) * NS_PER_S + ns


def gps_from_week(week: int, tow_s: float) -> int:
    """GPS time of a full week number and a time of week, in nanoseconds."""
    return week * WEEK_NS + round(tow_s * NS_PER_S)


_ISO = re.compile(r"(\d{4})-(\d\d)-(\d\d)[T ](\d\d):(\d\d)(?::(\d\d)(?:\.(\d{1,9}))?)?Z?")


def parse_utc(text: str) -> int:
    """GPS time, in nanoseconds, of a UTC time such as `2010-03-18T05:20:00Z` (seconds and fraction may be left out)."""
    match = _ISO.fullmatch(text.strip())
    if match is None:
        raise ValueError(f"not a UTC time: {text!r}; write it like 2010-03-18T05:20:00Z")
    year, month, day, hour, minute = (int(g) for g in match.groups()[:5])
    second, ns = int(match[6] or 0), int((match[7] or "0").ljust(9, "0"))
    on_gps_scale = gps_from_calendar(year, month, day, hour, minute, second, ns)
    return gps_from_utc(on_gps_scale + GPS_EPOCH_UNIX_S * NS_PER_S)


def format_calendar(unix_ns: int) -> str:
    """A time of the Unix scale as `2010-03-18T05:20:00`, with as many decimals as it needs."""
    seconds, ns = divmod(unix_ns, NS_PER_S)
    days, second_of_day = divmod(seconds, DAY_S)
    year, month, day = civil_from_days(days)
    fraction = f".{ns:09d}".rstrip("0") if ns else ""
    return f"{year:04d}-{month:02d}-{day:02d}T{second_of_day // 3600:02d}:{second_of_day // 60 % 60:02d}:{second_of_day % 60:02d}{fraction}"


def format_utc(gps_ns: int) -> str:
    """UTC of a GPS time, ISO 8601 with `Z`."""
    return format_calendar(utc_from_gps(gps_ns)) + "Z"
