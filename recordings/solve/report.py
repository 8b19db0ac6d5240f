"""What solving one receiver's files has found, in an object and in words."""

from collections import Counter
from typing import Any, NamedTuple

import numpy as np

from integrity.gnss.frames import geodetic_from_ecef
from integrity.gnss.observations import Floats
from recordings.solve.files import Found
from recordings.solve.results import Motion, Tested, written_time
from recordings.solve.table import WHY, errors_enu_m

# `detection.Finding`, whose module takes long to import
PASSED, EXCLUDED, UNCHECKED = 0, 1, 2
LISTED = 6  # kinds of what was dropped, and satellites; a file may have hundreds
MODELS = {
    "klobuchar": "Klobuchar",
    "nequick": "NeQuick-G",
    "free": "free of it by two frequencies",
    "none": "no model, its delay stays in the ranges",
}


class Spread(NamedTuple):
    """Of errors east, north, up: mean and rms of each, m, and what their length stays below in 95 % of epochs."""

    mean_enu_m: tuple[float, ...]
    rms_enu_m: tuple[float, ...]
    p95_3d_m: float


def as_json_object(found: Found, wall_s: float) -> dict[str, Any]:
    """The object that `wayside solve --json` prints; null where nothing was solved."""
    request, track, here = found.request, found.track, found.track.solved
    mean_ecef_m = track.pos_ecef_m[here].mean(axis=0) if here.any() else None
    return {
        "observations": [str(path) for path in request.observations],
        "navigation": [file.path for file in request.navigation],
        "start_gps": written_time(int(track.time_ns[0])),
        "end_gps": written_time(int(track.time_ns[-1])),
        "epochs": len(track.time_ns),
        "solved": int(here.sum()),
        "not_solved": {why: n for of, why in WHY.items() if why and (n := int((track.why == of).sum()))},
        "satellites_used_mean": round(float(track.n_used[here].mean()), 2) if here.any() else None,
        "systems": list(request.systems),
        "mask_deg": request.mask_deg,
        "ionosphere": found.model.name,
        "ionosphere_why": found.model.why,
        "position_ecef_m": None if request.true_pos_ecef_m is None else list(request.true_pos_ecef_m),
        "mean_ecef_m": None if mean_ecef_m is None else _rounded(mean_ecef_m),
        "mean_geodetic": None if mean_ecef_m is None else _geodetic(mean_ecef_m),
        "errors" if request.true_pos_ecef_m is not None else "scatter": _spread(found)._asdict() if here.any() else None,
        "tests": None if track.tested is None else {"false_alarm": request.false_alarm, **_tests(track.tested)},
        "velocity": None if track.motion is None else _velocity(track.motion),
        "smooth_s": request.smooth_s,
        "residuals": None if request.residuals is None else str(request.residuals),
        "dropped": found.dropped,
        "wall_s": round(wall_s, 3),
    }


def explain(found: Found, wall_s: float) -> str:
    """The same in several lines for a terminal."""
    facts = as_json_object(found, wall_s)
    names = [path.name for path in found.request.observations]
    not_solved = ", ".join(f"{why} {n}" for why, n in facts["not_solved"].items())
    on_average = f", with {facts['satellites_used_mean']:.1f} satellites on average" if facts["solved"] else ""
    model = MODELS[found.model.name] + (f" ({found.model.why})" if found.model.why else "")
    smoothed = f"; ranges smoothed over {found.request.smooth_s:g} s" if found.request.smooth_s is not None else ""
    lines = [
        f"{_listed(names)}: {facts['epochs']} epochs from {facts['start_gps']} to {facts['end_gps']}, GPS time",
        f"  {', '.join(found.request.systems)} from {found.request.mask_deg:g} degrees; ionosphere: {model}{smoothed}",
        f"  solved: {facts['solved']}{on_average}" + (f"; not solved: {not_solved}" if not_solved else ""),
        *(_spread_in_words(found) if facts["solved"] else ()),
        *(_tests_in_words(facts["tests"]) if facts["solved"] or (facts["tests"] and facts["tests"]["failed"]) else ()),
        *(_velocity_in_words(facts["velocity"]) if facts["solved"] else ()),
    ]
    most = sorted(found.dropped.items(), key=lambda item: -item[1])
    lines += ["  dropped:"] if most else []
    lines += [f"    {what}: {n}" for what, n in most[:LISTED]]
    lines += [f"    and {len(most) - LISTED} other kinds, see --json"] if len(most) > LISTED else []
    return "\n".join([*lines, f"  {wall_s:.2f} s"])


def _listed(names: list[str]) -> str:
    return ", ".join(names) if len(names) < 4 else f"{len(names)} files from {names[0]} to {names[-1]}"


def _spread_in_words(found: Found) -> list[str]:
    of = _spread(found)
    mean, rms = ("{:.2f} east, {:.2f} north, {:.2f} up".format(*values) for values in (of.mean_enu_m, of.rms_enu_m))
    if found.request.true_pos_ecef_m is not None:
        return [f"  error: mean {mean} m; rms {rms} m; 3-D below {of.p95_3d_m:.2f} m in 95 % of epochs"]
    mean_ecef_m = found.track.pos_ecef_m[found.track.solved].mean(axis=0)
    at = _geodetic(mean_ecef_m)
    return [
        "  mean position: {:.3f},{:.3f},{:.3f} m ECEF; ".format(*mean_ecef_m)
        + f"latitude {at['lat_deg']:.8f}, longitude {at['lon_deg']:.8f} degrees, height {at['height_m']:.3f} m (WGS 84 ellipsoid)",
        f"  scatter about it: rms {rms} m; 3-D below {of.p95_3d_m:.2f} m in 95 % of epochs",
    ]


def _tests(of: Tested) -> dict[str, Any]:
    excluded = Counter(satellite for names in of.excluded.tolist() for satellite in names.split())
    suspects = Counter(satellite for names in of.suspects.tolist() for satellite in names.split())
    return {
        "passed": int((of.finding == PASSED).sum()),
        "passed_without_the_excluded": int((of.finding == EXCLUDED).sum()),
        "not_checkable": int((of.finding == UNCHECKED).sum()),
        "failed": int((of.finding > UNCHECKED).sum()),
        "excluded": dict(sorted(excluded.items(), key=lambda item: (-item[1], item[0]))),
        "suspects": dict(sorted(suspects.items(), key=lambda item: (-item[1], item[0]))),
    }


def _tests_in_words(of: dict[str, Any] | None) -> list[str]:
    if of is None:
        return ["  not tested, nothing excluded"]
    others = {"not checkable": of["not_checkable"], "failed": of["failed"]}
    words = "".join(f", {what} {n}" for what, n in others.items() if n)
    lines = [
        f"  tests of fit, false alarms {of['false_alarm']:g} an epoch: passed {of['passed']}, after exclusion "
        f"{of['passed_without_the_excluded']}{words}"
    ]
    return lines + [f"    {what}: {_most(of[what])}" for what in ("excluded", "suspects") if of[what]]


def _velocity(of: Motion) -> dict[str, Any]:
    here = of.n_used > 0
    v_mps, drift_mps = of.v_enu_mps[here], of.drift_mps[here]
    some = bool(here.any())
    return {
        "epochs": int(here.sum()),
        "mean_enu_mps": _rounded(v_mps.mean(axis=0)) if some else None,
        "rms_enu_mps": _rounded(np.sqrt((v_mps * v_mps).mean(axis=0))) if some else None,
        "p95_3d_mps": round(float(np.percentile(np.sqrt((v_mps * v_mps).sum(axis=1)), 95.0)), 4) if some else None,
        "mean_clock_drift_mps": round(float(drift_mps.mean()), 4) if some else None,
    }


def _velocity_in_words(of: dict[str, Any] | None) -> list[str]:
    if of is None:
        return []
    if not of["epochs"]:
        return ["  no velocity: no epoch with a position has Doppler of four satellites"]
    rms = "{:.3f} east, {:.3f} north, {:.3f} up".format(*of["rms_enu_mps"])
    return [f"  velocity in {of['epochs']} epochs: rms {rms} m/s; 3-D below {of['p95_3d_mps']:.3f} m/s in 95 %"]


def _most(counts: dict[str, int]) -> str:
    first = [f"{satellite} {n}" for satellite, n in list(counts.items())[:LISTED]]
    return ", ".join(first) + (f" and {len(counts) - LISTED} others, see --json" if len(counts) > LISTED else "")


def _spread(found: Found) -> Spread:
    """Of the epochs that were solved, one at least."""
    off_enu_m = errors_enu_m(found)[found.track.solved]
    return Spread(
        tuple(_rounded(off_enu_m.mean(axis=0))),
        tuple(_rounded(np.sqrt((off_enu_m * off_enu_m).mean(axis=0)))),
        round(float(np.percentile(np.sqrt((off_enu_m * off_enu_m).sum(axis=1)), 95.0)), 4),
    )


def _geodetic(pos_ecef_m: Floats) -> dict[str, float]:
    lat_rad, lon_rad, height_m = geodetic_from_ecef(pos_ecef_m)
    return {
        "lat_deg": round(float(np.degrees(lat_rad)), 9),
        "lon_deg": round(float(np.degrees(lon_rad)), 9),
        "height_m": round(float(height_m), 4),
    }


def _rounded(values: Floats) -> list[float]:
    return [round(float(value), 4) + 0.0 for value in values]  # no -0.0
