"""Block solution of real single-frequency data against RTKLIB's, in one run: `python -m tests.benchmarks.solve`.

Ours: one block of all epochs, from observations and ephemerides to positions and residuals after the solution. The peer: RTKLIB's
`pntpos`, epoch by epoch, in a process of its own. Same file, satellites, mask and models (broadcast orbits, Klobuchar, Saastamoinen).
The peer runs twice: as it comes, and with the navigation file reduced to I/NAV, whose group delays it then applies to every Galileo
satellite as the standard asks and as we do. The better of its two times and of its two errors is what we compare with.
"""

import gzip
import json
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np

from integrity.gnss.ephemeris.states import accuracy_m, satellite_states, usable
from integrity.gnss.ephemeris.store import EphemerisStore
from integrity.gnss.least_squares import postfit_m
from integrity.gnss.observations import Bools, Floats, build_block
from integrity.gnss.positioning import points_at, positions, prefit, range_sigma_m, state_time_ns
from integrity.gnss.signals import TIME_SCALES, time_scale_index
from recordings.rinex.navigation import read_navigation
from recordings.rinex.observation import read_observations

DATA = Path(__file__).resolve().parents[2].parent / "shared" / "data" / "spp_truth"
TRUTH_ECEF_M = np.array([-3962108.673, 3381309.574, 3668678.638])
MASK_DEG = 10.0
REPEATS = 30


def ours(observations: Path, navigation: Path, repeats: int) -> dict[str, Any]:
    """Best time of a block solve, microseconds per epoch, and errors against the truth."""
    rows = read_observations(observations, "A").rows
    nav = read_navigation(navigation)
    block = build_block(("A",), [row.receive_time_ns for row in rows], [[row] for row in rows])
    store = EphemerisStore(nav.ephemerides)
    points = points_at(TRUTH_ECEF_M[None])
    arrived = np.full(len(rows), len(nav.ephemerides))

    def solve_block() -> tuple[Floats, Floats, Bools]:
        index = store.choose(block.satellites, block.epoch_ns, arrived)
        states = satellite_states(store.ephemerides, index, state_time_ns(block.epoch_ns))
        at_points = prefit(block, states, points, nav.klobuchar)
        sigma_m = range_sigma_m(at_points.el_rad, 0.9, 0.4, accuracy_m(store.ephemerides, index)[:, None])
        used = (at_points.el_rad >= np.deg2rad(MASK_DEG)) & usable(store.ephemerides, index)[:, None]
        system_of = np.array([time_scale_index(s) for s in block.satellites])
        solution = positions(block, states, points, nav.klobuchar, at_points, sigma_m, used, system_of, len(TIME_SCALES))
        residual_m = postfit_m(at_points.residual_m, at_points.los_enu, solution, system_of)
        return solution.e_enu_m[:, 0], residual_m, used[:, 0] & np.isfinite(block.pseudorange_m[:, 0])

    best_s = np.inf
    for _ in range(repeats):
        began = time.perf_counter()
        e_enu_m, _residual_m, used = solve_block()
        best_s = min(best_s, time.perf_counter() - began)
    error_m = np.linalg.norm(e_enu_m, axis=1)
    names = np.array(block.satellites)
    return {
        "us_per_epoch": best_s / len(rows) * 1e6,
        "p95_3d_m": float(np.percentile(error_m, 95.0)),
        "epochs": len(rows),
        "satellites": [sorted(set(names[u])) for u in used],
    }


def peer(observations: Path, navigation: Path, repeats: int, *options: str) -> dict[str, Any]:
    """What `tests.benchmarks.rtklib_peer` prints."""
    command = [sys.executable, "-m", "tests.benchmarks.rtklib_peer", str(observations), str(navigation)]
    command += [*(f"{x}" for x in TRUTH_ECEF_M), "--systems", "GE", "--mask-deg", str(MASK_DEG), "--repeats", str(repeats), *options]
    done = subprocess.run(command, check=True, capture_output=True, text=True)
    result: dict[str, Any] = json.loads(done.stdout)
    return result


def run(repeats: int = REPEATS) -> dict[str, Any]:
    """One comparison; needs the data set and pyrtklib5."""
    with tempfile.TemporaryDirectory() as folder:
        observations, navigation = Path(folder) / "SEPT078M.21O", Path(folder) / "SEPT078M.21P"
        observations.write_bytes(gzip.decompress((DATA / "SEPT078M.21O.gz").read_bytes()))
        navigation.write_bytes(gzip.decompress((DATA / "SEPT078M.21P.gz").read_bytes()))
        peers = {
            "as_it_comes": peer(observations, navigation, repeats),
            "inav_only": peer(observations, navigation, repeats, "--inav-only"),
        }
        mine = ours(observations, navigation, repeats)
    peer_us = min(p["us_per_epoch"] for p in peers.values())
    same = np.mean([a == sorted(b) for a, b in zip(mine["satellites"], peers["inav_only"]["satellites"], strict=True)])
    return {
        "ours_us_per_epoch": round(mine["us_per_epoch"], 2),
        "peer_us_per_epoch": round(peer_us, 2),
        "ratio": round(peer_us / mine["us_per_epoch"], 2),
        "ours_p95_3d_m": round(mine["p95_3d_m"], 3),
        "peer_p95_3d_m": round(min(p["p95_3d_m"] for p in peers.values()), 3),
        "epochs": mine["epochs"],
        "epochs_with_the_same_satellites": round(float(same), 4),
        "peers": {name: {k: round(p[k], 3) for k in ("us_per_epoch", "p95_3d_m", "binding_us")} for name, p in peers.items()},
    }


if __name__ == "__main__":
    print(json.dumps(run(), indent=2))
