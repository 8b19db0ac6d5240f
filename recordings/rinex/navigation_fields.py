"""Fields of navigation records that all systems share: numbers, epochs, times of transmission, accuracies.

Sources: RINEX 2.11, tables A4, A11 and A16; RINEX 3.04, tables A6 to A16; IS-GPS-200, 20.3.3.3.1.3.
"""

import math
import re
from bisect import bisect_left
from collections.abc import Sequence

from integrity.gnss.gps_time import DAY_S, NS_PER_S, WEEK_NS, WEEK_S
from integrity.gnss.navigation.bits import nearest_ns
from integrity.gnss.navigation.lnav import URA_UPPER_M
from recordings.rinex.text import calendar_ns

# How long before its reference time a satellite begins to send a set, where the file does not say when (blank, 0.9999E9).
USUAL_LEAD_NS = {system: lead_s * NS_PER_S for system, lead_s in {"G": 7200, "J": 3600, "E": -600, "C": 0, "R": 900, "S": 0}.items()}

FIELD = 19  # D19.12
_START_2 = re.compile(r"([ 0][1-9]|[1-9]\d) ([ \d]\d) ([ \d]\d) ([ \d]\d) ([ \d]\d) ([ \d]\d)([ \d]{3})\.(\d)", re.ASCII)
_START_3 = re.compile(r"([A-Z](?:[ 0][1-9]|[1-9]\d)) (\d{4}) ([ \d]\d) ([ \d]\d) ([ \d]\d) ([ \d]\d) ([ \d]\d)", re.ASCII)
_NUMERIC = re.compile(r"[-+.0-9DdEe ]*")  # what float() takes beyond that ("nan", "1_0") is no Fortran real

Record = Sequence[str]  # the lines of a record, from the one with the epoch on


def begins_record(line: str, version: float) -> bool:
    """Whether a record begins with this line."""
    return (_START_2 if version < 3 else _START_3).match(line) is not None


def epoch_ns(line: str, version: float) -> int | None:
    """The epoch of a record's first line as it is written, in nanoseconds since 1980-01-06T00:00:00 on the scale of its system."""
    if match := (_START_2 if version < 3 else _START_3).match(line):
        return calendar_ns(match.groups()[1:7], int(match[8]) * NS_PER_S // 10 if version < 3 else 0)
    return None


def numbers(record: Record, version: float) -> list[float] | None:
    """All numbers of a record, three of its first line and four of each other, NaN for blank; None if one is not whole or not finite."""
    first = 3 if version < 3 else 4
    values = []
    for k, line in enumerate(record):
        begin = first + FIELD if k == 0 else first
        if not _NUMERIC.fullmatch(line, begin):
            return None
        real = line.replace("D", "E").replace("d", "e")
        for column in range(begin, first + 4 * FIELD, FIELD):
            text = real[column : column + FIELD]
            if not text or text.isspace():
                values.append(math.nan)
                continue
            try:
                value = float(text)
            except ValueError:
                return None
            if len(text) < FIELD or math.isinf(value):
                return None
            values.append(value)
    return values


def transmission_ns(system: str, time_of_week_s: float, toe_ns: int, behind_ns: int = 0) -> int:
    """GPS time at which a set was sent; as usual with its system where the file does not say, or says a time over a day from toe.

    The file counts on the scale of the system, which is `behind_ns` behind GPS time.
    """
    if -WEEK_S <= time_of_week_s <= 2 * WEEK_S:
        sent_ns = nearest_ns(round(time_of_week_s * NS_PER_S) + behind_ns, toe_ns, WEEK_NS)
        if abs(sent_ns - toe_ns) <= DAY_S * NS_PER_S:
            return sent_ns
    return toe_ns - USUAL_LEAD_NS[system]


def ura_m(value_m: float) -> float | None:
    """Upper bound of the accuracy that a file gives as nominal value or upper bound; None where the satellite promises none."""
    return URA_UPPER_M[bisect_left(URA_UPPER_M, value_m)] if 0.0 <= value_m <= URA_UPPER_M[-1] else None
