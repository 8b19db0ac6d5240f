"""Navigation files: broadcast ephemerides of GPS and Galileo (I/NAV) and the Klobuchar coefficients, from RINEX 2 and 3.

Source: RINEX 2.11, tables A3, A4 and section 5; RINEX 3.05, tables A5, A6, A8 and section 6; IS-GPS-200, 20.3.3; Galileo OS SIS ICD, 5.1.
"""

import math
import re
from bisect import bisect_left
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

from integrity.gnss.atmosphere import Klobuchar
from integrity.gnss.ephemeris.broadcast import Ephemeris, KeplerEphemeris
from integrity.gnss.gps_time import DAY_S, NS_PER_S, WEEK_NS, WEEK_S
from integrity.gnss.navigation import inav, lnav
from integrity.gnss.navigation.bits import nearest_ns
from recordings.rinex.text import Header, RinexText, calendar_ns, read_header, read_text, real, reals

VERSIONS = ((2.00, 2.12), (3.00, 3.05))

GPS_LONGEST_FIT_H = 146.0  # IS-GPS-200, table 20-XII
USUAL_LEAD_NS = 2 * 3600 * NS_PER_S  # a GPS set is transmitted for 2 h, which its reference time ends

GALILEO_INAV = 0b101  # data sources: I/NAV E1-B, I/NAV E5b-I. RINEX 3.05, table A8
GALILEO_E1_UNHEALTHY = 0b111  # health: data validity and signal health of E1-B. RINEX 3.05, table A8

RECORD_LINES = 8
_START_2 = re.compile(r"([ 0][1-9]|[1-9]\d) ([ \d]\d) ([ \d]\d) ([ \d]\d) ([ \d]\d) ([ \d]\d)([ \d]{3})\.(\d)", re.ASCII)
_START_3 = re.compile(r"([A-Z](?:[ 0][1-9]|[1-9]\d)) (\d{4}) ([ \d]\d) ([ \d]\d) ([ \d]\d) ([ \d]\d) ([ \d]\d)", re.ASCII)


@dataclass(frozen=True)
class NavigationFile:
    """A navigation file as read: `ephemerides` in file order, repeated ones included; `problems` counts what was dropped and why."""

    path: str
    version: float
    ephemerides: tuple[Ephemeris, ...]
    klobuchar: Klobuchar | None
    leap_seconds: int | None
    problems: dict[str, int]


def read_navigation(path: Path) -> NavigationFile:
    """Read a navigation file, plain or gzipped. Other systems than GPS and Galileo are passed over.

    DecodeError where the file is not RINEX 2 or 3 navigation data, OSError where it cannot be opened.
    """
    text = read_text(path)
    header = read_header(text, "N", VERSIONS)
    problems: Counter[str] = Counter()
    ephemerides = _read_ephemerides(text, header, problems)
    if text.cut:
        problems["file cut off"] += 1
    return NavigationFile(
        path=text.path,
        version=header.version,
        ephemerides=tuple(ephemerides),
        klobuchar=_klobuchar(header, problems),
        leap_seconds=header.leap_seconds(problems),
        problems=dict(problems),
    )


def _klobuchar(header: Header, problems: Counter[str]) -> Klobuchar | None:
    if header.version < 3:
        alpha, beta = (header.numbers(label, range(2, 50, 12), problems) for label in ("ION ALPHA", "ION BETA"))
    else:
        lines = [line for line in header.lines if line.label == "IONOSPHERIC CORR"]
        found = {line.content[:4]: reals(line.content, range(5, 53, 12)) for line in reversed(lines)}
        for name in ("GPSA", "GPSB"):
            if name in found and found[name] is None:
                problems[f"IONOSPHERIC CORR {name} not readable"] += 1
        alpha, beta = found.get("GPSA"), found.get("GPSB")
    if alpha is None or beta is None:
        return None
    return Klobuchar(alpha=(alpha[0], alpha[1], alpha[2], alpha[3]), beta=(beta[0], beta[1], beta[2], beta[3]))


def _read_ephemerides(text: RinexText, header: Header, problems: Counter[str]) -> list[Ephemeris]:
    """The records of a file: each runs to the line that begins the next one, whatever the system."""
    start_line = _START_2 if header.version < 3 else _START_3
    lines = [line for line in text.lines[header.body :] if line.strip()]
    starts = [k for k, line in enumerate(lines) if start_line.match(line)]
    if lines and starts[:1] != [0]:
        problems["line outside a record"] += starts[0] if starts else len(lines)
    ephemerides = []
    for start, stop in pairwise([*starts, len(lines)]):
        record, surplus = lines[start : min(stop, start + RECORD_LINES)], lines[start + RECORD_LINES : stop]
        if surplus:
            problems["record longer than it should be"] += 1
        if header.version >= 3 and record[0][0] not in "GE":
            continue
        if len(record) < RECORD_LINES:
            problems["record cut off"] += 1
        elif not surplus or surplus[0][:3].strip():  # else one more data line: it cannot be told which one is too many
            ephemeris = _ephemeris(record, header.version)
            if isinstance(ephemeris, Ephemeris):
                ephemerides.append(ephemeris)
            else:
                problems[ephemeris] += 1
    return ephemerides


def _ephemeris(record: Sequence[str], version: float) -> Ephemeris | str:
    """The ephemeris in the eight lines of a GPS or Galileo record, or why there is none."""
    toc_ns, values = _toc_ns(record[0], version), _values(record, version)
    if toc_ns is None:
        return "epoch not readable"
    if values is None:
        return "field not a number"
    # In the order of the file: clock, then broadcast orbits 1 to 7.
    af0, af1, af2 = values[:3]
    issue, crs, delta_n, m0 = values[3:7]
    cuc, e, cus, sqrt_a = values[7:11]
    toe_s, cic, omega0, cis = values[11:15]
    i0, crc, omega, omega_dot = values[15:19]
    i_dot, source, _week, _ = values[19:23]
    accuracy, health, first_delay_s, second = values[23:27]  # GPS: TGD, IODC; Galileo: BGD(E1,E5a), BGD(E1,E5b)
    transmission_s, fit_h = values[27:29]

    satellite = f"G{record[0][:2]}" if version < 3 else record[0][:3]
    galileo = satellite[0] == "E"
    if any(math.isnan(v) for v in (issue, toe_s, health, *([source] if galileo else []))):
        return "field missing"
    if not (0.0 <= toe_s <= WEEK_S and 0.0 <= issue < 1024.0 and issue.is_integer() and 0.0 <= health < 512.0):
        return "reference time, issue or health out of range"
    if galileo and not int(source) & GALILEO_INAV:
        return "Galileo F/NAV, not used for E1"
    # The week next to the epoch, which the week field repeats: some files have it modulo 1024, or that of the transmission.
    toe_ns = nearest_ns(round(toe_s * NS_PER_S), toc_ns, WEEK_NS)
    ephemeris = KeplerEphemeris(
        satellite=satellite.replace(" ", "0"),
        message="INAV" if galileo else "LNAV",
        issue=int(issue),
        healthy=not int(health) & GALILEO_E1_UNHEALTHY if galileo else health == 0.0,
        accuracy_m=_sisa_m(accuracy) if galileo else _ura_m(accuracy),
        transmission_ns=_transmission_ns(transmission_s, toe_ns),
        toe_ns=toe_ns,
        toc_ns=toc_ns,
        fit_half_s=inav.FIT_HALF_S if galileo else _gps_fit_half_s(fit_h),
        sqrt_a=sqrt_a,
        e=e,
        i0=i0,
        omega0=omega0,
        omega=omega,
        m0=m0,
        delta_n=delta_n,
        i_dot=i_dot,
        omega_dot=omega_dot,
        cuc=cuc,
        cus=cus,
        crc=crc,
        crs=crs,
        cic=cic,
        cis=cis,
        af0=af0,
        af1=af1,
        af2=af2,
        group_delay_s=second if galileo else first_delay_s,
        group_delay_2_s=first_delay_s if galileo else None,
    )
    return ephemeris.implausibility() or ephemeris


def _values(record: Sequence[str], version: float) -> list[float] | None:
    """The 31 numbers D19.12 of a record, NaN for blank; None if one of them is anything else or cut short."""
    start = 3 if version < 3 else 4
    texts = [record[0][start + k : start + k + 19] for k in (19, 38, 57)]
    texts += [line[start + k : start + k + 19] for line in record[1:] for k in (0, 19, 38, 57)]
    values = [math.nan if not text.strip() else real(text) if len(text) == 19 else None for text in texts]
    return None if None in values else [v for v in values if v is not None]


def _toc_ns(line: str, version: float) -> int | None:
    if match := (_START_2 if version < 3 else _START_3).match(line):
        return calendar_ns(match.groups()[1:7], int(match[8]) * NS_PER_S // 10 if version < 3 else 0)
    return None


def _transmission_ns(time_of_week_s: float, toe_ns: int) -> int:
    """When a set was transmitted; as usual before toe where the file does not say (blank, 0.9999E9) or says a time over a day from toe."""
    if -WEEK_S <= time_of_week_s <= 2 * WEEK_S:
        transmission_ns = nearest_ns(round(time_of_week_s * NS_PER_S), toe_ns, WEEK_NS)
        if abs(transmission_ns - toe_ns) <= DAY_S * NS_PER_S:
            return transmission_ns
    return toe_ns - USUAL_LEAD_NS


def _ura_m(value_m: float) -> float | None:
    """Upper bound of the accuracy that a file gives as nominal value or upper bound; None where the satellite promises none."""
    return lnav.URA_UPPER_M[bisect_left(lnav.URA_UPPER_M, value_m)] if 0.0 <= value_m <= lnav.URA_UPPER_M[-1] else None


def _sisa_m(value_m: float) -> float | None:
    """SISA as it stands; None for "no accuracy prediction available" (negative) and for blank."""
    return value_m if value_m >= 0.0 else None


def _gps_fit_half_s(fit_h: float) -> float:
    """Half of the fit interval; the file has hours, or in old ones the flag itself (RINEX 3.05, 6.11), or nothing."""
    if fit_h == 1.0:
        return lnav.FIT_HALF_S[1]
    return fit_h * 1800.0 if 4.0 < fit_h <= GPS_LONGEST_FIT_H else lnav.FIT_HALF_S[0]
