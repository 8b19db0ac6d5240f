"""Checks of an edge by itself. The constants are limits of plausibility: they catch slips of unit, gaps and outliers."""

import math
from collections.abc import Iterator

import numpy as np

from integrity.gnss.frames import geodetic_from_ecef
from integrity.gnss.observations import Bools, Floats
from train_client.track.findings import Finding, runs
from train_client.track.geometry import Shape
from train_client.track.track_map import LEAST_STEP_M, Edge

HEIGHT_RANGE_M = (-500.0, 9000.0)  # ellipsoidal, of any railway and then some: the Dead Sea shore to above Tanggula
RADIUS_RANGE_M = (6.35e6, 6.39e6)  # from the Earth's centre, wider than HEIGHT_RANGE_M from pole to equator
MOST_CHORD_M = 100.0  # points are 20 m apart on straights [000 3.3]; with R = 1 km the track leaves 100 m by 1.25 m
S_TOLERANCE_M = 0.05  # of a step: survey class A
S_TOLERANCE = 5e-4  # of a whole edge: above it, s is chainage of a plan and no distance along the rail
LEAST_RADIUS_M = 50.0  # no train of a main or secondary line passes less
MOST_TURN_RAD = 0.03  # beyond what the curvature around explains; a short turnout enters with 0.02
MOST_CANT_RAD = 0.20  # about 200 mm on the 1067 mm gauge, 300 mm on 1435: more than any railway has
MOST_TWIST_RADPM = 0.005  # 1 in 180 on the 1067 mm gauge: trains derail
CANT_TOLERANCE_RAD = 0.005  # 5 mm of cant
MOST_GRADIENT = 0.09  # adhesion railways end there
GRADIENT_TOLERANCE = 0.01  # a stated gradient against the heights
MOST_SAGITTA_M = 0.05  # the whole error of survey class A
LEANING_RADIUS_M, LEANING_RAD = 1500.0, 0.02  # a tighter curve with more cant than this leans one way or the other


def position_findings(edge: Edge) -> Iterator[Finding]:
    """Points that are not on the Earth, or stand twice: with any of these, nothing else can be said of the edge."""
    radius_m = np.sqrt(np.einsum("ni,ni->n", edge.pos_ecef_m, edge.pos_ecef_m))
    near = (radius_m >= RADIUS_RANGE_M[0]) & (radius_m <= RADIUS_RANGE_M[1])
    for run in runs(~near, np.abs(radius_m - 6.37e6)):
        value_m = float(radius_m[run.worst])
        message = f"{value_m:.0f} m from the Earth's centre{run.more}: expected ECEF metres; correct the points"
        yield _at(edge, True, "earth", run.worst, value_m, RADIUS_RANGE_M[0], "m", message)
    if not near.all():
        return
    height_m = geodetic_from_ecef(edge.pos_ecef_m)[2]
    low, high = HEIGHT_RANGE_M
    for run in runs(~((height_m >= low) & (height_m <= high)), np.abs(height_m)):
        value_m = float(height_m[run.worst])
        message = f"ellipsoidal height {value_m:.0f} m{run.more}: expected {low:.0f} to {high:.0f} m; correct the points"
        yield _at(edge, True, "earth", run.worst, value_m, high, "m", message)
    chords = np.diff(edge.pos_ecef_m, axis=0)
    chord_m = np.sqrt(np.einsum("ni,ni->n", chords, chords))
    for run in runs(~(chord_m >= LEAST_STEP_M), -chord_m):
        value_m = float(chord_m[run.worst])
        message = f"the next point is the same to {value_m * 1000:.2f} mm{run.more}: take one of them out"
        yield _at(edge, True, "duplicate", run.worst, value_m, LEAST_STEP_M, "m", message)


def shape_findings(edge: Edge, shape: Shape) -> Iterator[Finding]:
    """Everything that its shape says of an edge."""
    yield from _gaps(edge, shape)
    yield from _distances(edge, shape)
    yield from _bends(edge, shape)
    yield from _cant(edge, shape)
    yield from _gradients(edge, shape)


def _gaps(edge: Edge, shape: Shape) -> Iterator[Finding]:
    for run in runs(~(shape.chord_m <= MOST_CHORD_M), shape.chord_m):
        value_m = float(shape.chord_m[run.worst])
        message = f"{value_m:.1f} m without a point{run.more}: expected {MOST_CHORD_M:.0f} m at most; survey what is missing"
        yield _at(edge, True, "gap", run.worst, value_m, MOST_CHORD_M, "m", message)


def _distances(edge: Edge, shape: Shape) -> Iterator[Finding]:
    """Running distance against the points: never shorter than the chord, never longer than the curve through its ends."""
    tightest = np.maximum(np.abs(shape.curvature_per_m[:-1]), np.abs(shape.curvature_per_m[1:]))
    arc_m = shape.chord_m * (1.0 + (shape.chord_m * tightest) ** 2 / 24.0)
    step_m = np.diff(edge.s_m)
    too_long_m = np.maximum(shape.chord_m - step_m, step_m - arc_m)
    for run in runs(~(too_long_m <= S_TOLERANCE_M), too_long_m):
        value_m, i = float(too_long_m[run.worst]), run.worst
        message = f"s grows by {step_m[i]:.3f} m to the next point, {shape.chord_m[i]:.3f} m away{run.more}: off by {value_m:.3f} m,"
        yield _at(
            edge, True, "distance", i, value_m, S_TOLERANCE_M, "m", f"{message} expected {S_TOLERANCE_M} m at most; correct s or points"
        )
    length_m, walked_m = float(edge.s_m[-1] - edge.s_m[0]), float(arc_m.sum())
    most_m = S_TOLERANCE_M + S_TOLERANCE * length_m
    if not abs(length_m - walked_m) <= most_m:
        message = f"s grows by {length_m:.2f} m over {walked_m:.2f} m of track: expected {most_m:.2f} m difference at most; s is distance"
        message += " along the rail at its own height, not chainage of a plan or a map projection: compute it from the points"
        yield _at(edge, False, "length", None, abs(length_m - walked_m), most_m, "m", message)


def _bends(edge: Edge, shape: Shape) -> Iterator[Finding]:
    curvature = np.abs(shape.curvature_per_m)
    for run in runs(~(curvature <= 1.0 / LEAST_RADIUS_M), curvature):
        value_m = 1.0 / float(curvature[run.worst])
        message = f"radius {value_m:.1f} m{run.more}: expected {LEAST_RADIUS_M:.0f} m or more; correct outliers, or smooth points of noise"
        yield _at(edge, True, "radius", run.worst, value_m, LEAST_RADIUS_M, "m", message)
    beyond_rad = kinks(shape)
    for run in runs(~(beyond_rad <= MOST_TURN_RAD), beyond_rad):
        value_rad = float(beyond_rad[run.worst])
        message = f"turns by {math.degrees(value_rad):.1f} deg more than the curve around it{run.more}: expected"
        message += f" {math.degrees(MOST_TURN_RAD):.1f} deg at most; correct the point, or survey more where the curve is"
        yield _at(edge, True, "kink", run.worst, value_rad, MOST_TURN_RAD, "rad", message)
    for run in runs(~(shape.sagitta_m <= MOST_SAGITTA_M), shape.sagitta_m):
        value_m = float(shape.sagitta_m[run.worst])
        message = f"the track leaves the chord by {value_m:.3f} m{run.more}: expected {MOST_SAGITTA_M} m at most; add points in the curve"
        yield _at(edge, False, "sagitta", run.worst, value_m, MOST_SAGITTA_M, "m", message)


def kinks(shape: Shape) -> Floats:
    """By how much each point turns more than the tighter of its neighbours explains (N,), radians."""
    turn_rad, chord_m = shape.turn_rad, shape.chord_m
    beyond_rad = np.zeros_like(turn_rad)
    if len(turn_rad) > 2:
        reach_m = 0.5 * (chord_m[:-1] + chord_m[1:])
        around = turn_rad[1:-1] / reach_m
        neighbour = np.maximum(np.concatenate(([0.0], around[:-1])), np.concatenate((around[1:], [0.0])))
        beyond_rad[1:-1] = turn_rad[1:-1] - neighbour * reach_m
    return beyond_rad


def _cant(edge: Edge, shape: Shape) -> Iterator[Finding]:
    cant_rad = np.abs(edge.cant_rad)
    for run in runs(~(cant_rad <= MOST_CANT_RAD), cant_rad):
        value_rad = float(cant_rad[run.worst])
        message = (
            f"{value_rad:.3f} rad{run.more}: expected {MOST_CANT_RAD} rad at most; cant is an angle in radians, asin(height / rail spacing)"
        )
        yield _at(edge, True, "cant", run.worst, value_rad, MOST_CANT_RAD, "rad", message)
    jump_rad = np.abs(np.diff(edge.cant_rad))
    allowed_rad = CANT_TOLERANCE_RAD + MOST_TWIST_RADPM * shape.chord_m
    for run in runs(~(jump_rad <= allowed_rad), jump_rad - allowed_rad):
        value_rad, most_rad = float(jump_rad[run.worst]), float(allowed_rad[run.worst])
        message = (
            f"cant changes by {value_rad:.4f} rad over {shape.chord_m[run.worst]:.2f} m{run.more}: expected {most_rad:.4f} rad at most;"
        )
        yield _at(edge, True, "twist", run.worst, value_rad, most_rad, "rad", f"{message} correct the cant, or its unit")
    wrong = _leaning_out(edge, shape)
    if wrong.any():
        first = int(np.flatnonzero(wrong)[0])
        message = f"{int(wrong.sum())} points lean out of their curve: cant is positive with the right rail low, in curves to the right;"
        message += " turn its sign, unless a branch leaves a canted curve to the outside here"
        yield _at(edge, False, "leaning", first, float(edge.cant_rad[first]), LEANING_RAD, "rad", message)


def _leaning_out(edge: Edge, shape: Shape) -> Bools:
    curved, canted = np.abs(shape.curvature_per_m) > 1.0 / LEANING_RADIUS_M, np.abs(edge.cant_rad) > LEANING_RAD
    out: Bools = curved & canted & (np.sign(edge.cant_rad) != np.sign(shape.curvature_per_m))
    return out


def _gradients(edge: Edge, shape: Shape) -> Iterator[Finding]:
    steep = np.abs(shape.gradient)
    for run in runs(~(steep <= MOST_GRADIENT), steep):
        value = float(steep[run.worst])
        message = f"{value * 100:.1f} %{run.more}: expected {MOST_GRADIENT * 100:.0f} % at most; correct the heights"
        yield _at(edge, True, "gradient", run.worst, value, MOST_GRADIENT, "", message)
    if edge.gradient is None:
        return
    heights = np.concatenate((shape.gradient[:1], 0.5 * (shape.gradient[:-1] + shape.gradient[1:]), shape.gradient[-1:]))
    off = np.abs(edge.gradient - heights)
    for run in runs(~(off <= GRADIENT_TOLERANCE), off):
        stated, found, value = float(edge.gradient[run.worst]), float(heights[run.worst]), float(off[run.worst])
        message = f"stated {stated * 100:.2f} %, by the heights {found * 100:.2f} %{run.more}: expected {GRADIENT_TOLERANCE * 100:.0f} %"
        message += " difference at most; correct one of them (positive where the track climbs with growing s)"
        yield _at(edge, False, "stated gradient", run.worst, value, GRADIENT_TOLERANCE, "", message)


def _at(edge: Edge, error: bool, check: str, point: int | None, value: float, threshold: float, unit: str, message: str) -> Finding:
    return Finding(error, check, f"edge {edge.id}", None if point is None else float(edge.s_m[point]), value, threshold, unit, message)
