"""What solving one receiver's files has found: a CSV file of it, an object, words."""

import csv
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from integrity.gnss.frames import enu_axes, geodetic_from_ecef
from integrity.gnss.least_squares import Unsolved
from integrity.gnss.observations import Bools, Floats
from recordings.solve_files import Found, written_time

COLUMNS = ("gps_time", "x_m", "y_m", "z_m", "n_used", "why")
ERROR_COLUMNS = ("e_m", "n_m", "u_m")
LISTED = 6  # kinds of what was dropped; a file may have hundreds
WHY = {
    Unsolved.SOLVED: "",
    Unsolved.TOO_FEW_SATELLITES: "too few satellites",
    Unsolved.POOR_GEOMETRY: "poor geometry",
    Unsolved.DIVERGED: "no convergence",
}
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


def write_csv(found: Found, path: Path) -> None:
    """A row an epoch; OSError where the file cannot be written."""
    columns = (*COLUMNS[:-1], *(ERROR_COLUMNS if found.request.true_pos_ecef_m is not None else ()), COLUMNS[-1])
    with path.open("w", newline="", encoding="ascii") as file:
        writer = csv.writer(file)
        writer.writerow(columns)
        writer.writerows(_rows(found))


def as_json_object(found: Found, wall_s: float) -> dict[str, Any]:
    """The object that `wayside solve --json` prints; null where nothing was solved."""
    request, track, here = found.request, found.track, _solved(found)
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
    lines = [
        f"{_listed(names)}: {facts['epochs']} epochs from {facts['start_gps']} to {facts['end_gps']}, GPS time",
        f"  {', '.join(found.request.systems)} from {found.request.mask_deg:g} degrees; ionosphere: {model}",
        f"  solved: {facts['solved']}{on_average}" + (f"; not solved: {not_solved}" if not_solved else ""),
        *(_spread_in_words(found) if facts["solved"] else ()),
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
    mean_ecef_m = found.track.pos_ecef_m[_solved(found)].mean(axis=0)
    at = _geodetic(mean_ecef_m)
    return [
        "  mean position: {:.3f},{:.3f},{:.3f} m ECEF; ".format(*mean_ecef_m)
        + f"latitude {at['lat_deg']:.8f}, longitude {at['lon_deg']:.8f} degrees, height {at['height_m']:.3f} m (WGS 84 ellipsoid)",
        f"  scatter about it: rms {rms} m; 3-D below {of.p95_3d_m:.2f} m in 95 % of epochs",
    ]


def _rows(found: Found) -> Iterator[tuple[object, ...]]:
    track, errors = found.track, None if found.request.true_pos_ecef_m is None else _errors_enu_m(found).tolist()
    columns = (track.time_ns.tolist(), track.pos_ecef_m.tolist(), track.n_used.tolist(), track.why.tolist())
    for e, (t_ns, pos_ecef_m, n_used, why) in enumerate(zip(*columns, strict=True)):
        numbers = [pos_ecef_m] if errors is None else [pos_ecef_m, errors[e]]
        xyz, *enu = ([("" if why else f"{value:.4f}") for value in values] for values in numbers)
        yield written_time(t_ns), *xyz, n_used, *(enu[0] if enu else ()), WHY[Unsolved(why)]


def _spread(found: Found) -> Spread:
    """Of the epochs that were solved, one at least."""
    errors_enu_m = _errors_enu_m(found)[_solved(found)]
    return Spread(
        tuple(_rounded(errors_enu_m.mean(axis=0))),
        tuple(_rounded(np.sqrt((errors_enu_m * errors_enu_m).mean(axis=0)))),
        round(float(np.percentile(np.sqrt((errors_enu_m * errors_enu_m).sum(axis=1)), 95.0)), 4),
    )


def _errors_enu_m(found: Found) -> Floats:
    """East, north, up of the given position, else of the mean, (E, 3); NaN where unsolved."""
    given = found.request.true_pos_ecef_m
    origin_ecef_m = found.track.pos_ecef_m[_solved(found)].mean(axis=0) if given is None else np.array(given)
    lat_rad, lon_rad, _ = geodetic_from_ecef(origin_ecef_m)
    errors: Floats = np.einsum("ij,ej->ei", enu_axes(lat_rad, lon_rad), found.track.pos_ecef_m - origin_ecef_m)
    return errors


def _solved(found: Found) -> Bools:
    result: Bools = found.track.why == Unsolved.SOLVED
    return result


def _geodetic(pos_ecef_m: Floats) -> dict[str, float]:
    lat_rad, lon_rad, height_m = geodetic_from_ecef(pos_ecef_m)
    return {
        "lat_deg": round(float(np.degrees(lat_rad)), 9),
        "lon_deg": round(float(np.degrees(lon_rad)), 9),
        "height_m": round(float(height_m), 4),
    }


def _rounded(values: Floats) -> list[float]:
    return [round(float(value), 4) + 0.0 for value in values]  # no -0.0
