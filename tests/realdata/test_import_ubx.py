"""Logs of real receivers, imported as all three receivers of a site around the place where they were.

The three hear the same, so that the solved triangle is a point: never normal, and named a collapse. What counts is that every byte is
kept, every epoch with a time is decided, positions are those of the receiver, and a replay decides the same.
"""

import gzip
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from struct import unpack_from

import numpy as np
import pytest
from typer.testing import CliRunner

from integrity.gnss.frames import ecef_from_geodetic, enu_axes, geodetic_from_ecef
from integrity.gnss.gps_time import WEEK_NS
from integrity.gnss.observations import Floats
from integrity.gnss.ubx.framing import Frame, Framer
from integrity.gnss.ubx.rawx import RXM_RAWX, decode_rawx
from integrity.outputs import EpochReport
from integrity.states import Cause
from integrity.triangle import reference_triangle
from recordings.cli import commands
from recordings.importer import Imported, import_files, read_files
from recordings.reader import read_recording
from recordings.replay import decide
from recordings.site_file import SiteFile, parse_site

NAV_PVT = (0x01, 0x07)
OFFSETS_ENU_M = {"A": (0.0, 0.0, 0.0), "B": (100.0, 0.0, 0.0), "C": (50.0, 87.0, 0.0)}


@dataclass(frozen=True)
class Case:
    """A log; its rate; what of it cannot be decided; when its first position is there, in epochs; how far from NAV-PVT, median.

    Neither log is long enough to hold the ionosphere (subframe 4, page 18, every 750 s), hence the heights.
    """

    path: str
    interval_s: float
    epochs: int
    passed_over: dict[str, int]
    unsolved: int
    horizontal_m: float
    up_m: float


CASES = {
    # ZED-F9P with NMEA in between. Its NAV-PVT is RTK, relative to a base of unknown coordinates: the 8 m are the same in all epochs.
    "walk": Case("drive_imu/walk_gnss_1730.ubx.gz", 0.25, 536, {"bytes that are not UBX": 136_199}, 106, 9.0, 10.0),
    # Signals attenuated by 16 dB, from a cold start: the receiver learns the time after 20 s.
    "cold start": Case(
        "ubx_security_2025/16dBatt_no_interference_coldstart.ubx.gz",
        1.0,
        562,
        {"bytes of a frame that does not end": 6, "measured before the time was known": 20},
        11,
        6.0,
        12.0,
    ),
}


@cache
def content(data: Path, case: str) -> bytes:
    return gzip.decompress((data / CASES[case].path).read_bytes())


@cache
def frames(data: Path, case: str) -> list[Frame]:
    return Framer().feed(content(data, case))


def own_positions_ecef_m(data: Path, case: str) -> dict[int, Floats]:
    """What the receiver says, by time of week in ms; only three-dimensional fixes that it vouches for."""
    fixes = [f.payload for f in frames(data, case) if f[:2] == NAV_PVT and f.payload[20] == 3 and f.payload[21] & 1]
    found = {}
    for payload in fixes:
        lon, lat, height = unpack_from("<iii", payload, 24)
        found[unpack_from("<I", payload)[0]] = ecef_from_geodetic(np.radians(lat * 1e-7), np.radians(lon * 1e-7), height * 1e-3)
    return found


@cache
def site_of(data: Path, case: str) -> SiteFile:
    """Three points around the median of what the receiver says. Without BeiDou: neither log holds the terms of the ionosphere, which
    delays B3I half as much again as L1."""
    centre = np.median(list(own_positions_ecef_m(data, case).values()), axis=0)
    east_north_up = np.array(axes_at(centre))
    lines = ["[site]", 'id = "real"', 'frame = "ITRF"', f"epoch_interval_s = {CASES[case].interval_s}"]
    for name, offset in OFFSETS_ENU_M.items():
        point = centre + np.array(offset) @ east_north_up
        lines += [f"[receivers.{name}]", f'source = "file:{name}"', f"position_ecef_m = {[round(float(x), 3) for x in point]}"]
    lines += ["[integrity]", 'systems = ["GPS", "Galileo"]']
    return parse_site("\n".join(lines) + "\n", "real.toml")


def axes_at(pos_ecef_m: Floats) -> Floats:
    lat_rad, lon_rad, _ = geodetic_from_ecef(pos_ecef_m)
    return enu_axes(lat_rad, lon_rad)


@cache
def imported(data: Path, case: str) -> Imported:
    paths = [data / CASES[case].path]
    return import_files(site_of(data, case).config, {name: read_files(paths, name) for name in OFFSETS_ENU_M}, [])


@cache
def decided(data: Path, case: str) -> list[EpochReport]:
    outputs, _ = decide(site_of(data, case), imported(data, case).events)
    return [output for output in outputs if isinstance(output, EpochReport)]


each_log: Callable[[Callable[..., None]], Callable[..., None]] = pytest.mark.parametrize("case", CASES)


@each_log
def test_every_epoch_with_a_time_is_aligned(shared_data: Path, case: str) -> None:
    rows = decode_rawx([f.payload for f in frames(shared_data, case) if f[:2] == RXM_RAWX], "A")
    timed = sum(row is not None for row in rows)
    assert (imported(shared_data, case).epochs, len(decided(shared_data, case)), timed) == (CASES[case].epochs,) * 3


@each_log
def test_nothing_is_left_out_but_what_is_known(shared_data: Path, case: str) -> None:
    result = imported(shared_data, case)
    assert (result.dropped["A"], result.passed_over["A"]) == ({}, CASES[case].passed_over)


@each_log
def test_all_epochs_are_solved_once_the_ephemerides_were_received(shared_data: Path, case: str) -> None:
    solved = [bool(np.isfinite(r.e_enu_m).all()) for r in decided(shared_data, case)]
    assert solved == [False] * CASES[case].unsolved + [True] * (CASES[case].epochs - CASES[case].unsolved)


@each_log
def test_positions_are_those_of_the_receiver(shared_data: Path, case: str) -> None:
    theirs = own_positions_ecef_m(shared_data, case)
    point = reference_triangle(site_of(shared_data, case).config).pos_ecef_m[0]
    times = {round(t / 1e3 / CASES[case].interval_s): pos for t, pos in theirs.items()}
    errors = []
    for report in decided(shared_data, case):
        own = times.get(round(report.gps_time_ns % WEEK_NS / 1e9 / CASES[case].interval_s))
        if own is not None and np.isfinite(report.e_enu_m).all():
            errors.append(report.e_enu_m[0] - axes_at(point) @ (own - point))
    horizontal_m, up_m = np.hypot(*np.array(errors)[:, :2].T), np.abs(np.array(errors)[:, 2])
    within = CASES[case]
    assert (np.median(horizontal_m) <= within.horizontal_m, np.median(up_m) <= within.up_m) == (True, True)


@each_log
def test_one_antenna_is_never_taken_for_three(shared_data: Path, case: str) -> None:
    causes = {r.verdict.cause for r in decided(shared_data, case)[CASES[case].unsolved :]}
    assert causes == {Cause.SPOOFING}


@each_log
def test_the_recording_holds_the_log_and_decides_the_same_again(shared_data: Path, tmp_path: Path, case: str) -> None:
    site, recording = tmp_path / "site.toml", tmp_path / "log.mcap"
    site.write_text(site_of(shared_data, case).text, "utf-8")
    receivers = [word for name in OFFSETS_ENU_M for word in ("--receiver", f"{name}={shared_data / CASES[case].path}")]
    made = CliRunner().invoke(commands, ["import", "--site", str(site), *receivers, "-o", str(recording)])
    again = CliRunner().invoke(commands, ["replay", str(recording), "--diff", "--block-epochs", "7"])
    raw = b"".join(e.data for e in read_recording(recording).entries if e.topic == "/receiver/B/raw")
    assert (made.exit_code, again.exit_code, raw == content(shared_data, case)) == (0, 0, True)


def test_a_log_without_navigation_words_asks_for_a_navigation_file(shared_data: Path, tmp_path: Path) -> None:
    site = tmp_path / "site.toml"
    site.write_text(site_of(shared_data, "walk").text, "utf-8")
    path = shared_data / "ubx_security_2025" / "F9T-L2-5min.ubx.gz"
    receivers = [word for name in OFFSETS_ENU_M for word in ("--receiver", f"{name}={path}")]
    made = CliRunner().invoke(commands, ["import", "--site", str(site), *receivers, "-o", str(tmp_path / "log.mcap")])
    assert "the logs hold no navigation words" in str(made.exception)
