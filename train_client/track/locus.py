"""The path of an antenna over the track: the line on which its positions are looked for.

r_ant = r_c + h n + y q, train_positioning.md 1.3 [000 3.3; 001 29, 38, 41]: r_c the middle between the railheads, t the tangent,
k the ellipsoid normal made orthogonal to t, q0 = t x k (to the right), phi the cant (positive with the right rail low),
n = k cos(phi) + q0 sin(phi), q = q0 cos(phi) - k sin(phi).
"""

from dataclasses import dataclass

import numpy as np

from integrity.gnss.frames import enu_axes, geodetic_from_ecef
from integrity.gnss.observations import Floats, Ints, freeze
from train_client.track.network import Place, Unreachable, arc_between, shifted
from train_client.track.track_map import EdgeEnd, TrackMap

__all__ = ["AT_SWITCH", "END_OF_MAP", "Locus", "Place", "Unreachable", "antenna_position", "arc_between", "locus_of", "shifted", "tangents"]

END_OF_MAP = -1
AT_SWITCH = -2  # several segments may follow


@dataclass(frozen=True, eq=False)
class Locus:
    """The path of one antenna as chords between the antenna's places at the map's points: G segments, edge after edge.

    `pos_ecef_m` (G, 3) where a segment begins; `along_ecef` (G, 3) its unit vector; `length_m` (G,); `edge` (G,) index into the map's
    edges; `s_m` (G,) the map's s where it begins; `ds_dm` (G,) metres of the map per metre of segment; `after`, `before` (G,) the segment
    beyond its end, beyond its beginning: an index, END_OF_MAP or AT_SWITCH. What follows across a node may belong to an edge that
    runs the other way: it is then entered at its end.
    """

    pos_ecef_m: Floats
    along_ecef: Floats
    length_m: Floats
    edge: Ints
    s_m: Floats
    ds_dm: Floats
    after: Ints
    before: Ints

    def __post_init__(self) -> None:
        freeze(self)


def locus_of(track: TrackMap, height_m: float, lateral_m: float) -> Locus:
    """The path of an antenna `height_m` above the railheads and `lateral_m` right of the middle, seen towards growing s of each edge.

    For a train that faces shrinking s, right is left: its locus is that of `-lateral_m`; segments have the same indices in both.
    Within a chord the path is straight: off by L^2 / 8R in a curve (3 m, R = 100 m: 11 mm).
    """
    tangent_of = tangents(track)
    places = [
        antenna_position(edge.pos_ecef_m, tangent, edge.cant_rad, height_m, lateral_m)
        for edge, tangent in zip(track.edges, tangent_of, strict=True)
    ]
    chord_m = np.concatenate([np.diff(place, axis=0) for place in places])
    length_m = _norm(chord_m)
    after, before = _neighbours(track)
    return Locus(
        pos_ecef_m=np.concatenate([place[:-1] for place in places]),
        along_ecef=chord_m / length_m[:, None],
        length_m=length_m,
        edge=np.repeat(np.arange(len(track.edges)), [len(edge.s_m) - 1 for edge in track.edges]),
        s_m=np.concatenate([edge.s_m[:-1] for edge in track.edges]),
        ds_dm=np.concatenate([np.diff(edge.s_m) for edge in track.edges]) / length_m,
        after=after,
        before=before,
    )


def antenna_position(pos_ecef_m: Floats, tangent: Floats, cant_rad: Floats, height_m: float, lateral_m: float) -> Floats:
    """Where an antenna is (N, 3), over points `pos_ecef_m` (N, 3) between the railheads, unit `tangent` (N, 3), `cant_rad` (N,)."""
    lat_rad, lon_rad, _ = geodetic_from_ecef(pos_ecef_m)
    normal = enu_axes(lat_rad, lon_rad)[..., 2, :]
    k = _unit(normal - np.einsum("ni,ni->n", normal, tangent)[:, None] * tangent)
    q0 = np.cross(tangent, k)
    cos_phi, sin_phi = np.cos(cant_rad)[:, None], np.sin(cant_rad)[:, None]
    up, right = k * cos_phi + q0 * sin_phi, q0 * cos_phi - k * sin_phi
    position: Floats = pos_ecef_m + height_m * up + lateral_m * right
    return position


def tangents(track: TrackMap) -> list[Floats]:
    """Unit tangents (N, 3) at the points of every edge, towards growing s: exact on a circle, to first order on a transition.

    Where two edges continue each other and nothing else does, the chord beyond the node counts like any other.
    """
    chords = [np.diff(edge.pos_ecef_m, axis=0) for edge in track.edges]
    found = [_edge_tangents(chord_m) for chord_m in chords]
    for end, entered in track.continuations.items():
        if len(entered) == 1 and track.continuations[entered[0]] == (end,):
            inside, outside = chords[end.edge][-1 if end.last else 0], chords[entered[0].edge][-1 if entered[0].last else 0]
            beyond = outside if end.last != entered[0].last else -outside
            found[end.edge][-1 if end.last else 0] = _between(inside[None], beyond[None])[0]
    return found


def _edge_tangents(chord_m: Floats) -> Floats:
    """At interior points from both chords; at the ends mirrored about the last chord, which is right on a circle."""
    unit = _unit(chord_m)
    if len(chord_m) == 1:
        return np.repeat(unit, 2, axis=0)
    inner = _between(chord_m[:-1], chord_m[1:])
    ends = [2.0 * np.einsum("i,i->", along, near) * along - near for along, near in ((unit[0], inner[0]), (unit[-1], inner[-1]))]
    return np.concatenate((ends[0][None], inner, ends[1][None]))


def _between(chord_m: Floats, next_m: Floats) -> Floats:
    """Tangents where chords (n, 3) meet the next: each direction weighted with the length of the other chord, right on a circle."""
    return _unit(_unit(chord_m) * _norm(next_m)[:, None] + _unit(next_m) * _norm(chord_m)[:, None])


def _neighbours(track: TrackMap) -> tuple[Ints, Ints]:
    """`after` and `before` of all segments."""
    counts = [len(edge.s_m) - 1 for edge in track.edges]
    first = np.concatenate(([0], np.cumsum(counts)))
    after, before = np.arange(1, first[-1] + 1), np.arange(-1, first[-1] - 1)
    for index in range(len(track.edges)):
        after[first[index + 1] - 1] = _across(track, EdgeEnd(index, True), first)
        before[first[index]] = _across(track, EdgeEnd(index, False), first)
    return after, before


def _across(track: TrackMap, end: EdgeEnd, first: Ints) -> int:
    entered = track.continuations[end]
    if len(entered) != 1:
        return AT_SWITCH if entered else END_OF_MAP
    edge, last = entered[0]
    return int(first[edge + 1]) - 1 if last else int(first[edge])


def _norm(vectors: Floats) -> Floats:
    norms: Floats = np.sqrt(np.einsum("ni,ni->n", vectors, vectors))
    return norms


def _unit(vectors: Floats) -> Floats:
    units: Floats = vectors / _norm(vectors)[:, None]
    return units
