"""Block solution of real single-frequency data against RTKLIB's, in one run: `python -m tests.benchmarks.solve`.

Ours: blocks of up to 1,024 epochs, from observations and ephemerides to positions, residuals after the solution and the position without
each satellite. The peer: RTKLIB's `pntpos`, epoch by epoch, in a process of its own: positions and residuals. Same file, satellites, mask
and models (GPS and Galileo, broadcast orbits, Klobuchar, Saastamoinen). Each version of the peer runs twice: as it comes, and with the
navigation file reduced to I/NAV, whose group delays it then applies to every Galileo satellite as the standard asks and as we do. The
better of the times of RTKLIB demo5 is what we compare our time with; our error, with the best of all of RTKLIB's, 2.4.3's too where
`pyrtklib` is installed.

An ephemeris counts as arrived when it was transmitted, the first one of a satellite from the beginning: a file has them all, and the one
sent last would otherwise serve before it was sent.
"""

import importlib.util
import json
import os
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from integrity.gnss.atmosphere import Klobuchar
from integrity.gnss.ephemeris.broadcast import Ephemeris
from integrity.gnss.ephemeris.states import accuracy_m, satellite_states, usable
from integrity.gnss.ephemeris.store import EphemerisStore
from integrity.gnss.least_squares import Design, design, postfit_m, solution
from integrity.gnss.leave_one_out import WithoutEach, shares, without_each
from integrity.gnss.observations import Bools, Floats, Ints, ObservationBlock, ObservationRow, build_block, layout_of
from integrity.gnss.packing import packed
from integrity.gnss.positioning import Points, Prefit, points_at, prefit, range_sigma_m, state_time_ns
from integrity.gnss.signals import FIRST_CODES, TIME_SCALES, time_scale_index
from recordings.rinex.hatanaka import expanded
from recordings.rinex.navigation import read_navigation
from recordings.rinex.observation import read_observations
from recordings.rinex.pieces import read_pieces

DATA = Path(__file__).resolve().parents[2].parent / "shared" / "data" / "spp_truth"
CODES = {system: FIRST_CODES[system] for system in "GE"}
MASK_DEG = 10.0
REPEATS = 40
EPOCHS_PER_BLOCK = 1024
SPARSE = 0.75  # a block less full than this is packed


class DataSet(NamedTuple):
    observations: str
    navigation: str
    truth_ecef_m: tuple[float, float, float]
    at_least: float  # times as fast as the peer


SETS = {
    "SEPT078M": DataSet("SEPT078M.21O.gz", "SEPT078M.21P.gz", (-3962108.673, 3381309.574, 3668678.638), 6.0),
    "ESBC00DNK": DataSet("ESBC00DNK_2020177.crx.gz", "ESBC00DNK_2020177_nav.rnx.gz", (3582105.2910, 532589.7313, 5232754.8054), 10.0),
}


class Problem(NamedTuple):
    """What is to be solved: blocks of one receiver at the `points`, and the sets in the order in which they were sent."""

    blocks: tuple[ObservationBlock, ...]
    store: EphemerisStore
    sent_ns: Ints
    klobuchar: Klobuchar | None
    points: Points


class Sky(NamedTuple):
    """A block before it is solved, packed where it is sparse; `column` (E, S) of the block."""

    block: ObservationBlock
    column: Ints
    prefit: Prefit
    design: Design


class Solved(NamedTuple):
    sky: Sky
    e_enu_m: Floats
    postfit_m: Floats
    without: WithoutEach


def plain(path: Path) -> bytes:
    """The RINEX text of a file that is gzipped, and perhaps compressed after Hatanaka, which RTKLIB alone does not read."""
    problems: Counter[str] = Counter()
    pieces = read_pieces(path, problems)
    return b"".join(expanded(str(path), pieces, problems) if ".crx" in path.name else pieces)


def unpacked(of: DataSet, folder: Path) -> tuple[Path, Path]:
    """Plain observation and navigation files."""
    observations, navigation = folder / "observations.rnx", folder / "navigation.rnx"
    observations.write_bytes(plain(DATA / of.observations))
    navigation.write_bytes(plain(DATA / of.navigation))
    return observations, navigation


def problem_of(observations: Path, navigation: Path, truth_ecef_m: tuple[float, float, float]) -> Problem:
    rows = read_observations(observations, "A").rows
    nav = read_navigation(navigation)
    first_of = {eph.satellite: eph for eph in sorted(nav.ephemerides, key=lambda eph: -eph.transmission_ns)}

    def arrived_ns(eph: Ephemeris) -> int:
        return 0 if eph == first_of[eph.satellite] else eph.transmission_ns

    store = EphemerisStore(sorted(nav.ephemerides, key=arrived_ns))
    sent_ns = np.array([arrived_ns(eph) for eph in store.ephemerides], dtype=np.int64)
    runs = [rows[k : k + EPOCHS_PER_BLOCK] for k in range(0, len(rows), EPOCHS_PER_BLOCK)]
    return Problem(tuple(_block(run) for run in runs), store, sent_ns, nav.klobuchar, points_at(np.array(truth_ecef_m)[None]))


def _block(rows: tuple[ObservationRow, ...]) -> ObservationBlock:
    return build_block(("A",), [row.receive_time_ns for row in rows], [[row] for row in rows], layout_of(rows, codes=CODES))


def sky_of(problem: Problem, whole: ObservationBlock) -> Sky:
    """Residuals and design of a block."""
    index = problem.store.choose(whole.satellites, whole.epoch_ns, np.searchsorted(problem.sent_ns, whole.epoch_ns, "right"))
    block, column = whole, np.broadcast_to(np.arange(len(whole.signals)), index.shape)
    if np.isfinite(whole.pseudorange_m).mean() < SPARSE:
        places = packed(whole)
        block, column, index = places.block, places.column, places.taken(index)
    sets = problem.store.ephemerides
    states = satellite_states(sets, index, state_time_ns(block.epoch_ns), block.signals)
    at_points = prefit(block, states, problem.points, problem.klobuchar)
    sigma_m = range_sigma_m(at_points.el_rad, 0.9, 0.4, accuracy_m(sets, index)[:, None])
    used = (at_points.el_rad >= np.deg2rad(MASK_DEG)) & usable(sets, index)[:, None] & np.isfinite(at_points.residual_m)
    system_of = np.array([time_scale_index(s) for s in block.satellites])
    return Sky(block, column, at_points, design(at_points.los_enu, sigma_m, used, system_of, len(TIME_SCALES)))


def solved(sky: Sky, residual_m: Floats) -> Solved:
    """Positions, residuals, and positions without each satellite."""
    of, los_enu = sky.design, sky.prefit.los_enu
    found = solution(of, residual_m)
    left_m = postfit_m(residual_m, los_enu, found, of.system_of)
    return Solved(sky, found.e_enu_m[:, 0], left_m, without_each(of, shares(of, los_enu), found, left_m))


def solve_all(problem: Problem) -> list[Solved]:
    skies = (sky_of(problem, block) for block in problem.blocks)
    return [solved(sky, sky.prefit.residual_m) for sky in skies]


def satellites_in(problem: Problem, skies: Iterable[Sky], places: Iterable[Bools]) -> list[list[str]]:
    """Names of the satellites in the places (E, S) of each block's columns, epoch by epoch."""
    names: list[list[str]] = []
    for whole, sky, chosen in zip(problem.blocks, skies, places, strict=True):
        names += [sorted(whole.satellites[k] for k in sky.column[e][chosen[e]]) for e in range(len(chosen))]
    return names


def best_us_per_epoch(work: Callable[[], object], n_epochs: int, repeats: int) -> float:
    """Processor time of one thread, the best of several."""
    best_s = np.inf
    for _ in range(repeats):
        began = time.process_time()
        work()
        best_s = min(best_s, time.process_time() - began)
    return float(best_s / n_epochs * 1e6)


def ours(problem: Problem, repeats: int) -> dict[str, Any]:
    """Best time, microseconds per epoch, and errors against the truth."""
    n_epochs = sum(len(block.epoch_ns) for block in problem.blocks)
    us_per_epoch = best_us_per_epoch(lambda: solve_all(problem), n_epochs, repeats)
    found = solve_all(problem)
    error_m = np.concatenate([np.linalg.norm(block.e_enu_m, axis=1) for block in found])
    return {
        "us_per_epoch": us_per_epoch,
        "p95_3d_m": float(np.percentile(error_m, 95.0)),
        "epochs": n_epochs,
        "satellites": satellites_in(problem, (block.sky for block in found), (block.sky.design.used[:, 0] for block in found)),
    }


def peer(binding: str, of: DataSet, files: tuple[Path, Path], repeats: int, *more: str) -> dict[str, Any]:
    """What `tests.benchmarks.rtklib_peer` prints."""
    command = [sys.executable, "-m", "tests.benchmarks.rtklib_peer", *map(str, files), *(f"{x}" for x in of.truth_ecef_m)]
    command += ["--systems", "GE", "--mask-deg", str(MASK_DEG), "--repeats", str(repeats), *more]
    done = subprocess.run(command, check=True, capture_output=True, text=True, env=os.environ | {"RTKLIB_BINDING": binding})
    result: dict[str, Any] = json.loads(done.stdout)
    return result


def run(name: str, repeats: int = REPEATS) -> dict[str, Any]:
    """One comparison; needs the data set and pyrtklib5."""
    of = SETS[name]
    bindings = ["pyrtklib5", *(["pyrtklib"] if importlib.util.find_spec("pyrtklib") else [])]
    with tempfile.TemporaryDirectory() as folder:
        files = unpacked(of, Path(folder))
        peers = {
            f"{binding} {how}".strip(): peer(binding, of, files, max(1, repeats // 4) if binding == "pyrtklib5" else 1, *how.split())
            for binding in bindings
            for how in ("", "--inav-only")
        }
        mine = ours(problem_of(*files, of.truth_ecef_m), repeats)
    peer_us = min(p["us_per_epoch"] for name, p in peers.items() if name.startswith("pyrtklib5"))
    same = np.mean([a == sorted(b) for a, b in zip(mine["satellites"], peers["pyrtklib5 --inav-only"]["satellites"], strict=True)])
    return {
        "ours_us_per_epoch": round(mine["us_per_epoch"], 2),
        "peer_us_per_epoch": round(peer_us, 2),
        "ratio": round(peer_us / mine["us_per_epoch"], 2),
        "at_least": of.at_least,
        "ours_p95_3d_m": round(mine["p95_3d_m"], 3),
        "peer_p95_3d_m": round(min(p["p95_3d_m"] for p in peers.values()), 3),
        "epochs": mine["epochs"],
        "epochs_with_the_same_satellites": round(float(same), 4),
        "peers": {name: {k: round(p[k], 3) for k in ("us_per_epoch", "p95_3d_m", "binding_us")} for name, p in peers.items()},
    }


if __name__ == "__main__":
    print(json.dumps({name: run(name) for name in SETS}, indent=2))
