"""SBAS protection levels at a point over a recording, as a CSV file: a row an epoch, with the satellites used and why others were not."""

import csv
import math
import sys
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from integrity.errors import ConfigError
from integrity.gnss.atmosphere import Klobuchar
from integrity.gnss.ephemeris.broadcast import Ephemeris
from integrity.gnss.ephemeris.store import EphemerisStore
from integrity.gnss.gps_time import GPS_EPOCH_UNIX_S, NS_PER_S, format_calendar, parse_utc, utc_from_gps
from integrity.gnss.observations import Floats
from integrity.gnss.sbas.airborne import AVIATION
from integrity.gnss.sbas.corrections import REASON_TEXT, Corrections, Reason, correct, rows_of
from integrity.gnss.sbas.protection import Protection, protection
from integrity.gnss.sbas.receiver import SbasReceiver
from integrity.gnss.sbas.store import NPA, PA, ROW_OF
from recordings.ground_point import ground_point_ecef_m
from recordings.rinex.navigation import read_navigation
from recordings.sbas_files import SbasFile, read_sbas

COLUMNS = ("gps_time", "hpl_m", "vpl_m", "n_used", "satellites", "not_used")
MODES = {"pa": PA, "npa": NPA}
EPOCHS_AT_ONCE = 256
_HIDDEN = (Reason.USED, Reason.NO_ORBIT, Reason.BELOW_MASK)  # satellites that are not in view need no reason


@dataclass(frozen=True)
class Request:
    """What to compute: epochs in GPS time (the last one included), `mask_rad`, PA or NPA."""

    messages: SbasFile
    ephemerides: tuple[Ephemeris, ...]
    klobuchar: Klobuchar | None
    pos_ecef_m: tuple[float, float, float]
    epochs_ns: range
    mode: int
    mask_rad: float
    problems: dict[str, int]


@dataclass(frozen=True)
class Summary:
    """What was written: `dropped` counts what of the files could not be used."""

    path: Path
    epochs: int
    levels: int
    dropped: dict[str, int]


def request_of(
    nav: Sequence[Path],
    messages: Path,
    position: str,
    start: str | None,
    end: str | None,
    interval_s: float,
    mode: str,
    mask_deg: float,
) -> Request:
    """From the words of a command line; ConfigError for one that is wrong, DecodeError and OSError for files."""
    if mode not in MODES:
        raise ConfigError(f"--mode {mode!r}: expected pa or npa")
    if not 0.0 <= mask_deg <= 90.0:
        raise ConfigError(f"--mask {mask_deg:g}: expected 0 to 90 degrees")
    if not 0.001 <= interval_s <= 86_400.0:
        raise ConfigError(f"--interval {interval_s:g}: expected 0.001 to 86400 seconds")
    pos_ecef_m = ground_point_ecef_m(position)
    file = read_sbas(messages)
    navigation = [read_navigation(path) for path in nav]
    first_ns = -(-file.messages[0].received_ns // NS_PER_S) * NS_PER_S
    last_ns = file.messages[-1].received_ns // NS_PER_S * NS_PER_S
    start_ns = first_ns if start is None else _gps_time("--start", start)
    end_ns = last_ns if end is None else _gps_time("--end", end)
    if end_ns < start_ns:
        raise ConfigError(f"--end {_written(end_ns)} is before --start {_written(start_ns)}: give a later end")
    problems = Counter({f"messages: {what}": n for what, n in file.problems.items()})
    for one in navigation:
        problems.update({f"navigation: {what}": n for what, n in one.problems.items()})
    return Request(
        messages=file,
        ephemerides=tuple(eph for one in navigation for eph in one.ephemerides),
        klobuchar=next((one.klobuchar for one in navigation if one.klobuchar is not None), None),
        pos_ecef_m=pos_ecef_m,
        epochs_ns=range(start_ns, end_ns + 1, round(interval_s * NS_PER_S)),
        mode=MODES[mode],
        mask_rad=math.radians(mask_deg),
        problems=dict(problems),
    )


def _gps_time(option: str, text: str) -> int:
    """GPS time written on its own scale; with Z it would be UTC."""
    if text.strip().endswith("Z"):
        raise ConfigError(f"{option} {text!r}: expected GPS time, without Z")
    try:
        return utc_from_gps(parse_utc(text)) - GPS_EPOCH_UNIX_S * NS_PER_S
    except ValueError as error:
        raise ConfigError(f"{option} {text!r}: {error}") from error


def _written(gps_ns: int) -> str:
    return format_calendar(gps_ns + GPS_EPOCH_UNIX_S * NS_PER_S)


def levels(request: Request) -> Iterator[tuple[Corrections, Protection]]:
    """Block by block; a message counts from the first epoch at which all of it had been received."""
    ephemerides = EphemerisStore(request.ephemerides)
    satellites = sorted({eph.satellite for eph in request.ephemerides if eph.satellite[0] == "G" and eph.satellite in ROW_OF})
    rows = rows_of(satellites)
    pos_ecef_m: Floats = np.array(request.pos_ecef_m)
    receiver = SbasReceiver(pos_ecef_m)
    waiting = iter(request.messages.messages)
    following = next(waiting, None)
    for begin in range(0, len(request.epochs_ns), EPOCHS_AT_ONCE):
        states = []
        for t_ns in request.epochs_ns[begin : begin + EPOCHS_AT_ONCE]:
            while following is not None and following.received_ns <= t_ns:
                receiver.add(following)
                following = next(waiting, None)
            states.append(receiver.at(t_ns, rows))
        corrected = correct(states, satellites, ephemerides, pos_ecef_m, request.mode, request.mask_rad, AVIATION, request.klobuchar)
        yield corrected, protection(corrected, request.mode)


def write_levels(request: Request, path: Path) -> Summary:
    """Compute and write; OSError where the file cannot be written."""
    epochs = found = 0
    with path.open("w", newline="", encoding="ascii") as file:
        writer = csv.writer(file)
        writer.writerow(COLUMNS)
        for corrected, level in levels(request):
            writer.writerows(_lines(corrected, level))
            epochs += len(corrected.t_ns)
            found += int(np.isfinite(level.hpl_m).sum())
    return Summary(path, epochs, found, request.problems)


def _lines(c: Corrections, p: Protection) -> Iterator[tuple[str, ...]]:
    for k, (t_ns, why) in enumerate(zip(c.t_ns.tolist(), c.why.tolist(), strict=True)):
        used = [satellite for satellite, reason in zip(c.satellites, why, strict=True) if reason == Reason.USED]
        others = [f"{s}: {REASON_TEXT[Reason(reason)]}" for s, reason in zip(c.satellites, why, strict=True) if reason not in _HIDDEN]
        hpl_m, vpl_m = float(p.hpl_m[k]), float(p.vpl_m[k])
        numbers = ("", "") if math.isnan(hpl_m) else (f"{hpl_m:.4f}", f"{vpl_m:.4f}")
        yield _written(t_ns), *numbers, str(len(used)), " ".join(used), "; ".join(others)


def print_summary(summary: Summary) -> None:
    """On stderr: what there is, and what was dropped."""
    dropped = ", ".join(f"{what} {n}" for what, n in summary.dropped.items())
    print(
        f"{summary.path}: {summary.epochs} epochs, {summary.levels} with protection levels" + (f"; dropped: {dropped}" if dropped else ""),
        file=sys.stderr,
    )
