"""The table of solving one receiver's files: a CSV file, a row an epoch."""

import csv
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

from integrity.gnss.frames import enu_axes, geodetic_from_ecef
from integrity.gnss.observations import Floats
from recordings.solve.files import Found
from recordings.solve.results import Motion, Tested, Why, taken, written_time

WHY = {
    Why.SOLVED: "",
    Why.TOO_FEW_SATELLITES: "too few satellites",
    Why.POOR_GEOMETRY: "poor geometry",
    Why.DIVERGED: "no convergence",
    Why.UNEXPLAINED: "ranges do not fit, and none stands out",
    Why.AMBIGUOUS: "ranges do not fit, and more than one could be at fault",
    Why.TOO_MANY: "ranges do not fit, too many would have to go",
    Why.UNVERIFIED: "ranges do not fit, too few are left to check without the faulty",
}
EPOCHS_AT_ONCE = 4096
FITS = ("yes", "without the excluded", "not checkable")  # in the order of `detection.Finding`; beyond, no


def write_csv(found: Found, path: Path) -> None:
    """A row an epoch; OSError where the file cannot be written."""
    n_epochs = len(found.track.time_ns)
    with path.open("w", newline="", encoding="ascii") as file:
        writer = csv.writer(file)
        for first in range(0, n_epochs, EPOCHS_AT_ONCE):
            few = np.arange(first, min(first + EPOCHS_AT_ONCE, n_epochs))
            columns = list(_columns(replace(found, track=taken(found.track, few))))
            if not first:
                writer.writerow([name for name, _ in columns])
            writer.writerows(zip(*(cells for _, cells in columns), strict=True))


def errors_enu_m(found: Found) -> Floats:
    """East, north, up of the given position, else of the mean, (E, 3); NaN where unsolved. One epoch at least is solved, or it is given."""
    given = found.request.true_pos_ecef_m
    origin_ecef_m = found.track.pos_ecef_m[found.track.solved].mean(axis=0) if given is None else np.array(given)
    lat_rad, lon_rad, _ = geodetic_from_ecef(origin_ecef_m)
    errors: Floats = np.einsum("ij,ej->ei", enu_axes(lat_rad, lon_rad), found.track.pos_ecef_m - origin_ecef_m)
    return errors


def _columns(found: Found) -> Iterator[tuple[str, list[object]]]:
    """Names and cells, blank where there is no number."""
    track = found.track
    yield "gps_time", [written_time(t_ns) for t_ns in track.time_ns.tolist()]
    yield from _numbers(("x_m", "y_m", "z_m"), track.pos_ecef_m, "%.4f")
    yield "n_used", track.n_used.tolist()
    if found.request.true_pos_ecef_m is not None:
        yield from _numbers(("e_m", "n_m", "u_m"), errors_enu_m(found), "%.4f")
    if track.motion is not None:
        yield from _motion(track.motion)
    if track.tested is not None:
        yield from _tested(track.tested)
    yield "why", [WHY[Why(why)] for why in track.why.tolist()]


def _motion(of: Motion) -> Iterator[tuple[str, list[object]]]:
    yield from _numbers(("ve_mps", "vn_mps", "vu_mps"), of.v_enu_mps, "%.4f")
    yield from _numbers(("sigma_ve_mps", "sigma_vn_mps", "sigma_vu_mps"), of.sigma_enu_mps, "%.4f")
    yield from _numbers(("clock_drift_mps", "sigma_clock_drift_mps"), np.stack((of.drift_mps, of.drift_sigma_mps), axis=1), "%.4f")


def _tested(of: Tested) -> Iterator[tuple[str, list[object]]]:
    """`fits` says whether the position is one that was checked."""
    yield "fits", [FITS[finding] if finding < len(FITS) else "no" for finding in of.finding.tolist()]
    yield "excluded", of.excluded.tolist()
    yield "suspects", of.suspects.tolist()
    statistics = np.stack((of.chi2, of.chi2_limit, of.largest, of.largest_limit), axis=1)
    yield from _numbers(("chi2", "chi2_limit", "largest_normalised", "largest_normalised_limit"), statistics, "%.3f")


def _numbers(names: tuple[str, ...], values: Floats, form: str) -> Iterator[tuple[str, list[object]]]:
    for name, column in zip(names, values.T, strict=True):
        yield name, ["" if value != value else form % value for value in column.tolist()]
