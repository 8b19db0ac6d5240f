"""What the points of an edge say of its shape: chords, curvature, gradient, height."""

from dataclasses import dataclass

import numpy as np

from integrity.gnss.frames import enu_axes, geodetic_from_ecef
from integrity.gnss.observations import Floats, freeze
from train_client.track.track_map import Edge


@dataclass(frozen=True, eq=False)
class Shape:
    """Of an edge of N points. From point to point (N - 1,): `chord_m`, `gradient` (rise over run, towards growing s), `sagitta_m`, by
    which the chord is off a circle (L^2 / 8R). At points (N,): `turn_rad` between the two chords (zero at the ends), `curvature_per_m`
    in the horizontal, positive to the right (at the ends that of the next point), `height_m` above the ellipsoid.
    """

    along: Floats  # (N - 1, 3) unit vectors of the chords
    chord_m: Floats
    gradient: Floats
    sagitta_m: Floats
    turn_rad: Floats
    curvature_per_m: Floats
    height_m: Floats

    def __post_init__(self) -> None:
        freeze(self)


def shape_of(edge: Edge) -> Shape:
    """The shape of an edge on the Earth whose neighbouring points are distinct."""
    lat_rad, lon_rad, height_m = geodetic_from_ecef(edge.pos_ecef_m)
    up = enu_axes(lat_rad, lon_rad)[..., 2, :]
    chords = np.diff(edge.pos_ecef_m, axis=0)
    chord_m = np.sqrt(np.einsum("ni,ni->n", chords, chords))
    along = chords / chord_m[:, None]
    rise = np.einsum("ni,ni->n", along, up[:-1] + up[1:]) / 2.0
    run = np.sqrt(np.maximum(1.0 - rise**2, 0.0))
    turn_rad, curvature_per_m = np.zeros(len(up)), np.zeros(len(up))
    if len(up) > 2:
        turn_rad[1:-1] = angle_rad(along[:-1], along[1:])
        curvature_per_m[1:-1] = _turn_right_rad(along[:-1], along[1:], up[1:-1]) / (0.5 * (chord_m[:-1] + chord_m[1:]))
        curvature_per_m[0], curvature_per_m[-1] = curvature_per_m[1], curvature_per_m[-2]
    tightest = np.maximum(np.abs(curvature_per_m[:-1]), np.abs(curvature_per_m[1:]))
    gradient = rise / np.maximum(run, 1e-9)  # finite where a chord stands upright
    return Shape(along, chord_m, gradient, chord_m**2 * tightest / 8.0, turn_rad, curvature_per_m, height_m)


def angle_rad(a: Floats, b: Floats) -> Floats:
    """Angles between vectors (n, 3), from 0 to pi."""
    cross = np.cross(a, b)
    angles: Floats = np.arctan2(np.sqrt(np.einsum("ni,ni->n", cross, cross)), np.einsum("ni,ni->n", a, b))
    return angles


def _turn_right_rad(a: Floats, b: Floats, up: Floats) -> Floats:
    """By how much directions (n, 3) turn to the right in the horizontal, from -pi to pi."""
    level_a = a - np.einsum("ni,ni->n", a, up)[:, None] * up
    level_b = b - np.einsum("ni,ni->n", b, up)[:, None] * up
    left = np.einsum("ni,ni->n", np.cross(level_a, level_b), up)
    turns: Floats = np.arctan2(-left, np.einsum("ni,ni->n", level_a, level_b))
    return turns
