"""Detection and exclusion of faults in real data against RTKLIB 2.4.3's `raim_fde`, in one run: `python -m tests.benchmarks.exclusion`.

The range of the highest satellite of every epoch is made longer. Ours: blocks, from observations and ephemerides to what was left out and
the position without it. The peer: `pntpos` of `pyrtklib` with RAIM, epoch by epoch, in a process of its own; same file, satellites, mask,
models and faults. RTKLIB demo5 (`pyrtklib5`) never excludes.
"""

import json
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from integrity.gnss.detection import Checked, Finding, criteria, detect_and_exclude
from integrity.gnss.observations import Bools, Floats
from tests.benchmarks.solve import SETS, Problem, Sky, best_us_per_epoch, peer, problem_of, satellites_in, sky_of, unpacked

FAULT_M = 100.0
REPEATS = 10
AT_LEAST = 50.0
# Of false alarms one in ten million looks: at 30 s, one in ten years for sigmas that are right. The range sigmas,
# (URA / 2.4 m) sqrt(0.9^2 + (0.4 / sin el)^2) m, are no tighter than single-frequency ranges with Klobuchar's ionosphere are in the open.
CRITERIA = criteria(false_alarm=1e-7, most_excluded=3, confusable=0.85, confusion=1e-3)


def highest_of(sky: Sky) -> Bools:
    """Where in the columns (E, R, S) each receiver's highest satellite in use stands."""
    el_rad = np.where(sky.design.used, sky.prefit.el_rad, -np.inf)
    result: Bools = sky.design.used & (np.arange(el_rad.shape[-1]) == el_rad.argmax(axis=-1)[..., None])
    return result


def faulty_m(sky: Sky, fault_m: float) -> Floats:
    """Residuals before the solution with the fault on the highest satellite."""
    result: Floats = sky.prefit.residual_m + np.where(highest_of(sky), fault_m, 0.0)
    return result


def check_all(problem: Problem, fault_m: float) -> list[tuple[Sky, Checked]]:
    """The whole way of every block; that the fault is added costs us time, not the peer."""
    skies = [sky_of(problem, block) for block in problem.blocks]
    return [(sky, detect_and_exclude(sky.design, sky.prefit.los_enu, faulty_m(sky, fault_m), CRITERIA)) for sky in skies]


def ours(problem: Problem, fault_m: float, repeats: int) -> dict[str, Any]:
    """Best time, microseconds per epoch; epochs in which the faulty satellite and no other was left out; which that was; the errors."""
    n_epochs = sum(len(block.epoch_ns) for block in problem.blocks)
    us_per_epoch = best_us_per_epoch(lambda: check_all(problem, fault_m), n_epochs, repeats)
    found = check_all(problem, fault_m)
    right = sum(int((checked.excluded == highest_of(sky)).all(axis=-1).sum()) for sky, checked in found)
    error_m = np.concatenate([np.linalg.norm(checked.found.e_enu_m[:, 0], axis=1) for _, checked in found])
    return {
        "us_per_epoch": us_per_epoch,
        "epochs": n_epochs,
        "right": right,
        "excluded_something": sum(int((checked.finding == Finding.EXCLUDED).sum()) for _, checked in found),
        "p95_3d_m": float(np.percentile(error_m, 95.0)),
        "faulty": satellites_in(problem, (sky for sky, _ in found), (highest_of(sky)[:, 0] for sky, _ in found)),
    }


def run(name: str = "ESBC00DNK", fault_m: float = FAULT_M, repeats: int = REPEATS) -> dict[str, Any]:
    """One comparison; needs the data set and `pyrtklib`."""
    of = SETS[name]
    with tempfile.TemporaryDirectory() as folder:
        files = unpacked(of, Path(folder))
        theirs = peer("pyrtklib", of, files, 1, "--raim", "--fault-m", str(fault_m))
        mine = ours(problem_of(*files, of.truth_ecef_m), fault_m, repeats)
    peer_right = sum(f is not None and f not in used for f, used in zip(theirs["faulty"], theirs["satellites"], strict=True))
    return {
        "fault_m": fault_m,
        "ours_us_per_epoch": round(mine["us_per_epoch"], 2),
        "peer_us_per_epoch": round(theirs["us_per_epoch"], 2),
        "ratio": round(theirs["us_per_epoch"] / mine["us_per_epoch"], 1),
        "at_least": AT_LEAST,
        "epochs": mine["epochs"],
        "ours_right": mine["right"],
        "peer_right": peer_right,
        "same_satellite_faulty": sum([theirs_is] == ours_is for theirs_is, ours_is in zip(theirs["faulty"], mine["faulty"], strict=True)),
        "ours_p95_3d_m": round(mine["p95_3d_m"], 3),
        "peer_p95_3d_m": round(theirs["p95_3d_m"], 3),
    }


if __name__ == "__main__":
    print(json.dumps(run(), indent=2))
