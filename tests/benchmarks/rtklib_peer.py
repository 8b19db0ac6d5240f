"""RTKLIB's single-point solution of a RINEX file, timed: the peer that our own solver is measured against.

    python -m tests.benchmarks.rtklib_peer OBS NAV X Y Z --systems GE --mask-deg 10 --repeats 5
    RTKLIB_BINDING=pyrtklib python -m tests.benchmarks.rtklib_peer OBS NAV X Y Z --raim --fault-m 100

A process of its own, because RTKLIB keeps global state and its options are one global object. It prints one JSON object. Only the calls
of `pntpos` are timed, in processor time: files are read, unwanted systems dropped and each epoch's observations laid out beforehand,
results are fetched in a pass of its own afterwards, and each call starts from the last position, as RTKLIB's own programs do. What the
binding costs is measured on the same call without observations, which RTKLIB answers at once (`binding_us`; included in `us_per_epoch`).

The binding is pyrtklib5 (RTKLIB demo5), or what RTKLIB_BINDING names: pyrtklib (RTKLIB 2.4.3, whose detection and exclusion of faults,
`raim_fde`, runs where the chi-square test of a solution fails; demo5 goes on with such solutions and never runs it). A process has room
for one of them.
"""

import argparse
import importlib
import json
import math
import os
import time
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from integrity.gnss.gps_time import GPS_EPOCH_UNIX_S, NS_PER_S

rtklib = importlib.import_module(os.environ.get("RTKLIB_BINDING", "pyrtklib5"))

SYSTEMS = {"G": rtklib.SYS_GPS, "E": rtklib.SYS_GAL}
GALILEO_INAV = 0x200  # bit 9 of the RINEX data source word: clock and group delay are those of E1, E5b
EPOCH_TOLERANCE_S = 0.005
BINDING_CALLS = 20_000


class Epoch(NamedTuple):
    """One epoch: `first` points RTKLIB at the first observation of `observations`, which must outlive it."""

    observations: Any
    first: Any
    n: int
    gps_time_ns: int


class Solution(NamedTuple):
    pos_ecef_m: tuple[float, float, float] | None
    satellites: list[str]
    highest: int | None  # place of the highest satellite used among the epoch's observations


def system_and_prn(satellite_number: int) -> tuple[int, int]:
    prn = rtklib.Arr1Dint(1)
    return rtklib.satsys(satellite_number, prn), prn[0]


def name_of(satellite_number: int) -> str:
    system, prn = system_and_prn(satellite_number)
    letter = next(letter for letter, bit in SYSTEMS.items() if bit == system)
    return f"{letter}{prn:02d}"


def read_rinex(obs_path: str, nav_path: str, systems: str) -> tuple[Any, Any]:
    """Observations and broadcast navigation of the systems asked for; SystemExit where RTKLIB finds none."""
    obs, nav, station = rtklib.obs_t(), rtklib.nav_t(), rtklib.sta_t()
    option = "-SYS=" + ",".join(systems)
    for path in (obs_path, nav_path):
        if rtklib.readrnx(path, 1, option, obs, nav, station) != 1:
            raise SystemExit(f"RTKLIB cannot read {path}: expected an unzipped RINEX file")
    rtklib.sortobs(obs)
    rtklib.uniqnav(nav)
    if obs.n == 0 or nav.n == 0:
        raise SystemExit(f"{obs.n} observations in {obs_path}, {nav.n} ephemerides in {nav_path}: expected some of {systems}")
    return obs, nav


def drop_fnav(nav: Any) -> None:
    """Drop Galileo F/NAV.

    RTKLIB computes orbits and clocks from I/NAV but takes a satellite's group delay from whichever of its sets it lists first. If
    that is F/NAV, BGD(E1,E5b) reads zero: the satellite goes without a group delay.
    """
    kept = 0
    for i in range(nav.n):
        eph = nav.eph[i]
        if system_and_prn(eph.sat)[0] != rtklib.SYS_GAL or eph.code & GALILEO_INAV:
            nav.eph[kept] = eph
            kept += 1
    nav.n = kept


def epochs_of(obs: Any) -> list[Epoch]:
    """The sorted observations cut at each change of time, without Doppler: RTKLIB then estimates no velocity."""
    epochs = []
    start = 0
    while start < obs.n:
        t = obs.data[start].time
        stop = start
        while stop < obs.n and abs(rtklib.timediff(obs.data[stop].time, t)) < EPOCH_TOLERANCE_S:
            for f in range(rtklib.NFREQ):
                obs.data[stop].D[f] = 0.0
            stop += 1
        gps_time_ns = (t.time - GPS_EPOCH_UNIX_S) * NS_PER_S + round(t.sec * NS_PER_S)
        view = obs.data[start:stop]
        epochs.append(Epoch(view, view.ptr, stop - start, gps_time_ns))
        start = stop
    return epochs


def options(systems: str, mask_deg: float, raim: bool = False) -> Any:
    """Single point, L1, broadcast orbits, Klobuchar, Saastamoinen; what is not set here is RTKLIB's default."""
    opt = rtklib.prcopt_default
    opt.mode = rtklib.PMODE_SINGLE
    opt.nf = 1
    opt.navsys = sum(SYSTEMS[s] for s in systems)
    opt.elmin = math.radians(mask_deg)
    opt.sateph = rtklib.EPHOPT_BRDC
    opt.ionoopt = rtklib.IONOOPT_BRDC
    opt.tropopt = rtklib.TROPOPT_SAAS
    opt.posopt[4] = int(raim)  # RAIM FDE
    return opt


def best_s_per_epoch(epochs: Sequence[Epoch], nav: Any, opt: Any, repeats: int) -> float:
    calls = [(epoch.first, epoch.n) for epoch in epochs]
    azel, message, pntpos = rtklib.Arr1Ddouble(2 * rtklib.MAXOBS), rtklib.Arr1Dchar(128), rtklib.pntpos
    best_s = math.inf
    for _ in range(repeats):
        sol = rtklib.sol_t()
        begin_s = time.process_time()
        for first, n in calls:
            pntpos(first, n, nav, opt, sol, azel, None, message)
        best_s = min(best_s, time.process_time() - begin_s)
    return best_s / len(calls)


def binding_s(epochs: Sequence[Epoch], nav: Any, opt: Any, repeats: int) -> float:
    empty = [epochs[0]._replace(n=0)] * BINDING_CALLS
    return best_s_per_epoch(empty, nav, opt, repeats)


def solve(epochs: Sequence[Epoch], nav: Any, opt: Any) -> list[Solution]:
    sol, azel, message = rtklib.sol_t(), rtklib.Arr1Ddouble(2 * rtklib.MAXOBS), rtklib.Arr1Dchar(128)
    status = rtklib.Arr1Dssat_t(rtklib.MAXSAT)
    first_status = status.ptr
    names: dict[int, str] = {}
    solutions = []
    for epoch in epochs:
        if rtklib.pntpos(epoch.first, epoch.n, nav, opt, sol, azel, first_status, message) != 1:
            solutions.append(Solution(None, [], None))
            continue
        numbers = [epoch.observations[i].sat for i in range(epoch.n)]
        used = [n for n in numbers if status[n - 1].vs]
        satellites = sorted(names.setdefault(n, name_of(n)) for n in used)
        in_use = [i for i, n in enumerate(numbers) if status[n - 1].vs]
        highest = max(in_use, key=lambda i: status[numbers[i] - 1].azel[1])
        solutions.append(Solution((sol.rr[0], sol.rr[1], sol.rr[2]), satellites, highest))
    return solutions


def make_faulty(epochs: Sequence[Epoch], nav: Any, opt: Any, fault_m: float) -> list[str | None]:
    """Make the range of the highest satellite used in each epoch longer; which it is, None where there is no solution."""
    faulty: list[str | None] = []
    for epoch, solution in zip(epochs, solve(epochs, nav, opt), strict=True):
        if solution.highest is None:
            faulty.append(None)
            continue
        observation = epoch.observations[solution.highest]
        observation.P[0] += fault_m
        faulty.append(name_of(observation.sat))
    return faulty


def report(epochs: Sequence[Epoch], nav: Any, opt: Any, truth_ecef_m: Sequence[float], repeats: int) -> dict[str, Any]:
    """The JSON object: times in microseconds, best of the repeats; errors in metres over the solved epochs, None if there are none."""
    us_per_epoch = best_s_per_epoch(epochs, nav, opt, repeats) * 1e6
    binding_us = binding_s(epochs, nav, opt, repeats) * 1e6
    solutions = solve(epochs, nav, opt)
    errors_m = np.array([math.dist(s.pos_ecef_m, truth_ecef_m) for s in solutions if s.pos_ecef_m is not None])
    return {
        "rtklib": f"{rtklib.VER_RTKLIB} {rtklib.PATCH_LEVEL}",
        "epochs": len(epochs),
        "solved": len(errors_m),
        "us_per_epoch": us_per_epoch,
        "binding_us": binding_us,
        "p95_3d_m": float(np.percentile(errors_m, 95)) if len(errors_m) else None,
        "rms_3d_m": float(np.sqrt(np.mean(errors_m**2))) if len(errors_m) else None,
        "positions_ecef_m": [s.pos_ecef_m for s in solutions],
        "gps_time_ns": [epoch.gps_time_ns for epoch in epochs],
        "satellites": [s.satellites for s in solutions],
    }


def main() -> None:
    parser = argparse.ArgumentParser(prog="rtklib_peer", description="Time RTKLIB's single-point solution of a RINEX file.")
    parser.add_argument("obs", metavar="OBS", help="unzipped RINEX observations")
    parser.add_argument("nav", metavar="NAV", help="unzipped RINEX navigation")
    parser.add_argument("truth_ecef_m", metavar="XYZ", nargs=3, type=float, help="true ECEF position in metres: X Y Z")
    parser.add_argument("--systems", default="GE", choices=["G", "E", "GE"])
    parser.add_argument("--mask-deg", type=float, default=10.0)
    parser.add_argument("--repeats", type=int, default=5)
    parser.add_argument("--inav-only", action="store_true", help="drop Galileo F/NAV, so that RTKLIB applies BGD(E1,E5b) everywhere")
    parser.add_argument("--raim", action="store_true", help="let RTKLIB detect and exclude faults")
    parser.add_argument("--fault-m", type=float, default=0.0, help="how much longer the range of each epoch's highest satellite is made")
    arguments = parser.parse_args()
    obs, nav = read_rinex(arguments.obs, arguments.nav, arguments.systems)
    if arguments.inav_only:
        drop_fnav(nav)
    opt, epochs = options(arguments.systems, arguments.mask_deg, arguments.raim), epochs_of(obs)
    faulty = make_faulty(epochs, nav, opt, arguments.fault_m) if arguments.fault_m else []
    print(json.dumps(report(epochs, nav, opt, arguments.truth_ecef_m, arguments.repeats) | {"faulty": faulty}))


if __name__ == "__main__":
    main()
