"""A day of RINEX at 1 Hz, read and solved by a whole process of ours, against RTKLIB's reading and solving of it.

    python -m tests.benchmarks.rinex [--folder FOLDER] [--runs 3]
    python -m tests.benchmarks.rinex --recorded            recorded files, read beside georinex

The files are synthetic (`synthetic_rinex`). Ours: from the start of Python to its end, every column decoded, every epoch solved, on one
core. The peer's time is what favours it most: only its calls of `readrnx`, `sortobs`, `uniqnav` and `pntpos`; cutting the observations
into epochs and fetching results are left out, and it estimates no velocity. Medians over the runs, taken in turns.

Of recorded files, megabytes of RINEX text a second (of Compact RINEX, of the text it stands for); georinex reads the first epochs only.
"""

import argparse
import gzip
import json
import os
import statistics
import subprocess
import sys
import tempfile
import time
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

DATA = Path(__file__).resolve().parents[2].parent / "shared" / "data"
RECORDED = (
    "catalonia_2010/MATA0770_00-12h.10o.gz",
    "rosalia_2025/ROSR01TUW_R_20250010600_15M_05S_AA.rnx.gz",
    "spp_truth/ESBC00DNK_2020177.crx.gz",
)
GEORINEX_BYTES = 1_000_000
MASK_DEG = 10.0
SIGMA_A_M, SIGMA_B_M = 0.9, 0.4


def read_and_solve(observations: Path, navigation: Path) -> dict[str, Any]:
    """What a process of ours does."""
    from recordings.rinex.navigation import read_navigation
    from recordings.rinex.observation import read_blocks
    from recordings.solve.sky import Sky, Weights
    from recordings.solve.track import solved

    nav = read_navigation(navigation)
    header, blocks, problems = read_blocks(observations, "A")
    sky, weights = Sky(nav.ephemerides, nav.klobuchar), Weights(SIGMA_A_M, SIGMA_B_M, float(np.deg2rad(MASK_DEG)))
    tracks = list(solved(blocks, sky, weights, header.approx_position_ecef_m))
    return {
        "problems": dict(problems),
        **_errors(np.concatenate([track.pos_ecef_m for track in tracks]), header.approx_position_ecef_m),
        **_used(),
    }


def peer(observations: Path, navigation: Path) -> dict[str, Any]:
    """What RTKLIB does, in a process of its own."""
    from recordings.rinex.observation import read_blocks
    from tests.benchmarks import rtklib_peer

    began, began_cpu = time.perf_counter(), time.process_time()
    obs, nav = rtklib_peer.read_rinex(str(observations), str(navigation), "GE")
    read_s, read_cpu_s = time.perf_counter() - began, time.process_time() - began_cpu
    epochs, opt = rtklib_peer.epochs_of(obs), rtklib_peer.options("GE", MASK_DEG)
    began_cpu = time.process_time()
    solve_s = len(epochs) * rtklib_peer.best_s_per_epoch(epochs, nav, opt, repeats=1)
    cpu_s = read_cpu_s + time.process_time() - began_cpu
    found = [solution.pos_ecef_m or (np.nan,) * 3 for solution in rtklib_peer.solve(epochs, nav, opt)]
    return {
        "read_s": read_s,
        "solve_s": solve_s,
        **_errors(np.array(found), read_blocks(observations, "A").header.approx_position_ecef_m),
        **_used(),
        "cpu_s": cpu_s,
    }


def run(folder: Path, runs: int) -> dict[str, Any]:
    """Writes the files where they are not there yet; needs pyrtklib5."""
    observations, navigation = folder / "day.rnx", folder / "day.nav"
    if not observations.exists():
        from tests.benchmarks.synthetic_rinex import write_day  # not in the processes that are timed

        write_day(observations, navigation)
    ours_s, ours, theirs = [], [], []
    for _ in range(runs):
        began = time.perf_counter()
        ours.append(_child("ours", observations, navigation))
        ours_s.append(time.perf_counter() - began)
        theirs.append(_child("peer", observations, navigation))
    peer_s = statistics.median(t["read_s"] + t["solve_s"] for t in theirs)
    return {
        "file_mb": round(observations.stat().st_size / 1e6, 1),
        "ours_s": round(statistics.median(ours_s), 3),
        "peer_s": round(peer_s, 3),
        "peer_read_s": round(statistics.median(t["read_s"] for t in theirs), 3),
        "ratio": round(peer_s / statistics.median(ours_s), 2),
        "ratio_of_processor_times": round(statistics.median(t["cpu_s"] for t in theirs) / statistics.median(o["cpu_s"] for o in ours), 2),
        "ours": ours[-1],
        "peer": {name: theirs[-1][name] for name in ("epochs", "solved", "p95_3d_m", "rms_3d_m", "cpu_s", "peak_mb")},
    }


def recorded(runs: int) -> dict[str, Any]:
    """Reading speeds of recorded files; needs the data set, georinex and hatanaka."""
    return {name: _speeds(DATA / name, runs) for name in RECORDED}


def _speeds(path: Path, runs: int) -> dict[str, Any]:
    import georinex
    import hatanaka

    from recordings.rinex.observation import read_blocks

    data = gzip.decompress(path.read_bytes())
    compact = data[60:80] == b"CRINEX VERS   / TYPE"
    text = hatanaka.crx2rnx(data) if compact else data
    with tempfile.TemporaryDirectory() as folder:
        whole, first = Path(folder) / f"whole{path.suffixes[0]}", Path(folder) / "first.rnx"
        whole.write_bytes(data)
        few = text[: text.find(b"\n>", min(GEORINEX_BYTES, len(text) - 2)) + 1] if text[5:6] != b"2" else text
        first.write_bytes(few)
        ours_s = min(_seconds(lambda: sum(len(block.epoch_ns) for block in read_blocks(whole, "A").blocks)) for _ in range(runs))
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            georinex_s = _seconds(lambda: georinex.load(first))
    return {
        "text_mb": round(len(text) / 1e6, 2),
        "ours_mb_per_s": round(len(text) / 1e6 / ours_s, 1),
        "georinex_mb_per_s": round(len(few) / 1e6 / georinex_s, 3),
    }


def _seconds(work: Callable[[], object]) -> float:
    began = time.process_time()
    work()
    return time.process_time() - began


def _errors(pos_ecef_m: Any, truth_ecef_m: Any) -> dict[str, Any]:
    error_m = np.linalg.norm(pos_ecef_m - np.array(truth_ecef_m), axis=1)
    known = error_m[np.isfinite(error_m)]
    return {
        "epochs": len(error_m),
        "solved": len(known),
        "p95_3d_m": round(float(np.percentile(known, 95.0)), 3),
        "rms_3d_m": round(float(np.sqrt(np.mean(known**2))), 3),
    }


def _used() -> dict[str, float]:
    """Processor time and most memory of this process (not of the one that started it, which `ru_maxrss` would count too)."""
    status = Path("/proc/self/status").read_text("ascii")
    return {"cpu_s": time.process_time(), "peak_mb": round(int(status.partition("VmHWM:")[2].split()[0]) * 1024 / 1e6, 1)}


def _child(what: str, observations: Path, navigation: Path) -> dict[str, Any]:
    command = [sys.executable, "-m", "tests.benchmarks.rinex", "--child", what, str(observations), str(navigation)]
    done = subprocess.run(command, check=True, capture_output=True, text=True)
    result: dict[str, Any] = json.loads(done.stdout)
    return result


def main() -> None:
    parser = argparse.ArgumentParser(prog="rinex", description="Read and solve a synthetic day of RINEX, beside RTKLIB.")
    parser.add_argument("--folder", type=Path, help="where the files are kept (by default they are made anew)")
    parser.add_argument("--runs", type=int, default=3)
    parser.add_argument("--child", nargs=3, metavar=("WHAT", "OBS", "NAV"), help=argparse.SUPPRESS)
    parser.add_argument("--recorded", action="store_true", help="read recorded files instead, beside georinex")
    arguments = parser.parse_args()
    if arguments.recorded:
        print(json.dumps(recorded(arguments.runs), indent=2))
        return
    if arguments.child:
        os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})  # one core
        work = {"ours": read_and_solve, "peer": peer}[arguments.child[0]]
        print(json.dumps(work(Path(arguments.child[1]), Path(arguments.child[2]))))
        return
    with tempfile.TemporaryDirectory() as folder:
        print(json.dumps(run(arguments.folder or Path(folder), arguments.runs), indent=2))


if __name__ == "__main__":
    main()
