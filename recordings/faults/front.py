"""A front in the ionosphere: where signals pierce it, and how much it delays their codes and advances their carriers."""

import math
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from integrity.gnss.constants import SPEED_OF_LIGHT_MPS
from integrity.gnss.observations import Floats
from integrity.gnss.positioning import points_at
from integrity.gnss.signals import L1_HZ
from recordings.faults.changes import Change
from recordings.faults.kinds import IonoFront
from recordings.faults.scenario import Fault
from recordings.faults.truth import RecordedRow, Tracks, Truth, runs, surveyed, tracks

SHELL_RADIUS_M = 6_371_000.0 + 350_000.0  # mean radius of the Earth, height of the thin shell of GBAS and SBAS
WAVELENGTH_L1_M = SPEED_OF_LIGHT_MPS / L1_HZ


class _Axes(NamedTuple):
    """Unit vectors in ECEF: up in the middle of the site, and where the front moves to there."""

    up: Floats
    towards: Floats


class _Pierced(NamedTuple):
    """A row, how far towards the azimuth its signals pierce the shell (n,), along it from the middle of the site, how fast that grows, and
    their elevation; NaN without ephemeris."""

    seen: RecordedRow
    at_m: Floats
    rate_mps: Floats
    el_rad: Floats


def front_changes(fault: Fault, effect: IonoFront, truth: Truth, hit: Sequence[RecordedRow]) -> Iterator[tuple[RecordedRow, Change]]:
    """What the front does to rows. The delay is one of slant, as in its threat model, and by the pierce point alone: it is the same field
    for all receivers and satellites."""
    axes = _axes(truth, effect.azimuth_deg)
    pierced = [_pierced(truth, seen, track, axes) for run in runs(hit) for seen, track in zip(run, tracks(truth, run), strict=True)]
    edge_m = _hindmost_m(truth, pierced) if effect.edge_km is None else 1e3 * effect.edge_km
    slope, width_m = 1e-6 * effect.slope_mm_per_km, 1e3 * effect.width_km
    for seen, at_m, rate_mps, _ in pierced:
        behind_m = edge_m + effect.speed_mps * fault.elapsed_s(seen.epoch_ns) - at_m
        known = np.isfinite(behind_m)
        dispersion = (truth.wavelengths_m(seen.row.signals) / WAVELENGTH_L1_M) ** 2
        delay_m = np.where(known, dispersion * slope * np.clip(behind_m, 0.0, width_m), 0.0)
        within = known & (behind_m > 0.0) & (behind_m < width_m)
        delay_mps = np.where(within, dispersion * slope * (effect.speed_mps - rate_mps), 0.0)
        yield seen, Change(delay_m, -delay_m, -delay_mps)


def _axes(truth: Truth, azimuth_deg: float) -> _Axes:
    middle = points_at(np.mean([[r.position_ecef_m] for r in truth.site.receivers], axis=0))
    east, north, up = middle.enu[0, 0]
    azimuth_rad = math.radians(azimuth_deg)
    return _Axes(up, math.sin(azimuth_rad) * east + math.cos(azimuth_rad) * north)


def _pierced(truth: Truth, seen: RecordedRow, track: Tracks, axes: _Axes) -> _Pierced:
    """From the triangle of the Earth's centre, antenna and pierce point p = r + s u, |p| being the radius of the shell; with its rate."""
    here = surveyed(truth, seen.row.receiver)
    r, R = here.pos_ecef_m[0, 0][:, None], SHELL_RADIUS_M
    to_satellite = track.pos_ecef_m - r
    distance_m = np.sqrt((to_satellite**2).sum(axis=0))
    u = to_satellite / distance_m
    u_dot = (track.vel_ecef_mps - u * (u * track.vel_ecef_mps).sum(axis=0)) / distance_m
    rising_m = (r * u).sum(axis=0)
    s = np.sqrt(rising_m**2 + R**2 - (r * r).sum()) - rising_m
    p = r + s * u
    s_dot = -s * (p * u_dot).sum(axis=0) / (p * u).sum(axis=0)
    p_dot = s_dot * u + s * u_dot
    ahead, above = (np.einsum("i,in->n", axis, p) for axis in (axes.towards, axes.up))
    ahead_dot, above_dot = (np.einsum("i,in->n", axis, p_dot) for axis in (axes.towards, axes.up))
    rate_mps: Floats = R * (ahead_dot * above - ahead * above_dot) / (ahead**2 + above**2)
    return _Pierced(seen, R * np.arctan2(ahead, above), rate_mps, np.arcsin(np.einsum("i,in->n", here.enu[0, 0, 2], u)))


def _hindmost_m(truth: Truth, pierced: Sequence[_Pierced]) -> float:
    """The least distance in the first epoch of signals above the elevation mask; NaN where there is none."""
    first_ns, mask_rad = min(seen.epoch_ns for seen, *_ in pierced), math.radians(truth.site.integrity.elevation_mask_deg)
    found = [at_m[el_rad >= mask_rad] for seen, at_m, _, el_rad in pierced if seen.epoch_ns == first_ns]
    return min((float(at_m.min()) for at_m in found if len(at_m)), default=math.nan)
