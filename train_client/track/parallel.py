"""Tracks that run beside each other closer than trains fit: one of them is misplaced, or is the other surveyed twice."""

from collections.abc import Iterator

import numpy as np

from integrity.gnss.observations import Floats
from train_client.track.findings import Finding, runs
from train_client.track.track_map import Edge, TrackMap

LEAST_SPACING_M = 3.0  # between centre lines; narrow-gauge stations have 3.4 m
SAMPLE_M = 2.0  # along the track; the distance is taken across it, so that this loses nothing


def parallel_findings(track: TrackMap) -> Iterator[Finding]:
    """Warnings, one for two edges; where they come from one node they may be close."""
    low, high = (np.array([bound(edge.pos_ecef_m, axis=0) for edge in track.edges]) for bound in (np.min, np.max))
    for a, edge in enumerate(track.edges):
        near = ((low[a + 1 :] - LEAST_SPACING_M <= high[a]) & (high[a + 1 :] + LEAST_SPACING_M >= low[a])).all(axis=1)
        for other in (track.edges[a + 1 + int(i)] for i in np.flatnonzero(near)):
            yield from _beside(edge, other)


def _beside(edge: Edge, other: Edge) -> Iterator[Finding]:
    from scipy.spatial import cKDTree  # most maps have no edges beside each other

    s_m, pos_m, _ = _samples(edge)
    _, other_m, along = _samples(other)
    _, nearest = cKDTree(other_m).query(pos_m, distance_upper_bound=LEAST_SPACING_M + SAMPLE_M)
    found = nearest < len(other_m)
    apart_m = np.full(len(s_m), np.inf)
    offset_m = pos_m[found] - other_m[nearest[found]]
    length_m = np.einsum("ni,ni->n", offset_m, along[nearest[found]])
    across_m = offset_m - length_m[:, None] * along[nearest[found]]
    apart_m[found] = np.where(np.abs(length_m) <= SAMPLE_M, np.sqrt(np.einsum("ni,ni->n", across_m, across_m)), np.inf)
    shared = {edge.from_node, edge.to_node} & {other.from_node, other.to_node}
    beside = [
        run
        for run in runs(~(apart_m >= LEAST_SPACING_M), -apart_m)
        if not (run.first == 0 and edge.from_node in shared) and not (run.last == len(s_m) - 1 and edge.to_node in shared)
    ]
    if not beside:
        return
    closest = min(beside, key=lambda run: float(apart_m[run.worst]))
    value_m, at_m = float(apart_m[closest.worst]), float(s_m[closest.worst])
    stretch = f"{s_m[closest.first]:.0f} to {s_m[closest.last]:.0f} m" + f", the closest of {len(beside)} places" * (len(beside) > 1)
    message = f"edge {other.id} is {value_m:.2f} m beside it ({stretch}): expected {LEAST_SPACING_M:.0f} m or more; survey both again,"
    message += " take out the one that is there twice, or give them a node where they cross"
    yield Finding(False, "parallel", f"edge {edge.id}", at_m, value_m, LEAST_SPACING_M, "m", message)


def _samples(edge: Edge) -> tuple[Floats, Floats, Floats]:
    """s (n,), points (n, 3) at most `SAMPLE_M` apart and unit tangents there (n, 3), chord by chord."""
    chords = np.diff(edge.pos_ecef_m, axis=0)
    chord_m = np.sqrt(np.einsum("ni,ni->n", chords, chords))
    counts = np.maximum(1, np.ceil(chord_m / SAMPLE_M)).astype(np.int64)
    chord = np.repeat(np.arange(len(chords)), counts)
    share = (np.arange(len(chord)) - np.repeat(np.cumsum(counts) - counts, counts)) / counts[chord]
    s_m = edge.s_m[:-1][chord] + share * np.diff(edge.s_m)[chord]
    points = edge.pos_ecef_m[:-1][chord] + share[:, None] * chords[chord]
    along = chords / chord_m[:, None]
    return (
        np.append(s_m, edge.s_m[-1]),
        np.concatenate((points, edge.pos_ecef_m[-1:])),
        np.concatenate((along[chord], along[-1:])),
    )
