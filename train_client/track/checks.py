"""What is wrong with a map that can be read: the first checks that a surveyor wants. No train runs on a map with errors."""

import math
from dataclasses import dataclass

import numpy as np

from recordings.toml_file import ConfigProblems, Problem
from train_client.track.edge_checks import position_findings, shape_findings
from train_client.track.findings import Finding
from train_client.track.geometry import Shape, shape_of
from train_client.track.node_checks import node_findings
from train_client.track.parallel import parallel_findings
from train_client.track.track_map import TrackMap, parse_map


@dataclass(frozen=True)
class MapFacts:
    """Sizes and extremes of a map. `least_radius_m` is infinite where all is straight; `sagitta_m` bounds L^2 / 8R of chords."""

    nodes: int
    edges: int
    points: int
    length_m: float
    least_radius_m: float
    greatest_cant_rad: float
    greatest_gradient: float
    sagitta_m: float


@dataclass(frozen=True)
class MapCheck:
    """What the checks say; `facts` is None where points are not on the Earth, or stand twice."""

    errors: tuple[Finding, ...]
    warnings: tuple[Finding, ...]
    facts: MapFacts | None


def check_map(track: TrackMap) -> MapCheck:
    """Every check on every edge and node."""
    findings: list[Finding] = []
    shapes: dict[int, Shape] = {}
    for index, edge in enumerate(track.edges):
        misplaced = list(position_findings(edge))
        findings += misplaced
        if not misplaced:
            shapes[index] = shape_of(edge)
            findings += shape_findings(edge, shapes[index])
    findings += node_findings(track, shapes)
    whole = len(shapes) == len(track.edges)
    if whole:
        findings += parallel_findings(track)
    errors, warnings = (tuple(finding for finding in findings if finding.error is error) for error in (True, False))
    return MapCheck(errors, warnings, _facts(track, list(shapes.values())) if whole else None)


def load_map(text: str, file: str) -> TrackMap:
    """The map that a train runs on. Raises ConfigProblems (a ConfigError) where the text is no map, or a check finds an error."""
    track = parse_map(text, file)
    check = check_map(track)
    if check.errors:
        raise ConfigProblems(*([Problem(file, None, "", "", str(f)) for f in found] for found in (check.errors, check.warnings)))
    return track


def _facts(track: TrackMap, shapes: list[Shape]) -> MapFacts:
    curvature_per_m = max(float(np.abs(shape.curvature_per_m).max()) for shape in shapes)
    return MapFacts(
        nodes=len(track.nodes),
        edges=len(track.edges),
        points=sum(len(edge.s_m) for edge in track.edges),
        length_m=sum(float(edge.s_m[-1] - edge.s_m[0]) for edge in track.edges),
        least_radius_m=1.0 / curvature_per_m if curvature_per_m > 1e-9 else math.inf,
        greatest_cant_rad=max(float(np.abs(edge.cant_rad).max()) for edge in track.edges),
        greatest_gradient=max(float(np.abs(shape.gradient).max()) for shape in shapes),
        sagitta_m=max(float(shape.sagitta_m.max()) for shape in shapes),
    )
