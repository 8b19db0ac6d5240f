"""A line with a straight and a curve, its map, and a train whose antennas hear simulated satellites."""

from collections.abc import Sequence
from dataclasses import fields, replace
from functools import cache
from typing import NamedTuple

import numpy as np

from integrity.events import EphemerisReceived, IonosphereReceived, ObservationsReceived
from integrity.gnss.atmosphere import Klobuchar
from integrity.gnss.ephemeris.states import SatelliteStates, satellite_states
from integrity.gnss.ephemeris.store import EphemerisStore
from integrity.gnss.observations import Bools, Floats, Ints, ObservationBlock, build_block
from integrity.gnss.positioning import state_time_ns
from integrity.gnss.signals import TIME_SCALES, time_scale_index
from recordings.simulate.errors import ErrorModel
from recordings.simulate.observations import Antenna, fixed, observed
from train_client.config import AntennaConfig
from train_client.limits import derive
from train_client.positioning.constrained import OnTrack, Paths, Ranges, paths_of, solve_on_track
from train_client.simulate.line import Line, Piece, Start, build_line
from train_client.simulate.motion import Leg, Run, antennas_on, run_of
from train_client.track.locus import locus_of
from train_client.track.track_map import Edge, Node, Switch, TrackMap

LIMITS = derive()
NO_LIMIT = replace(LIMITS, residuals=np.full_like(LIMITS.residuals, np.inf))  # any squares pass
START_NS = 1_456_000_000 * 10**9
ANTENNAS = (AntennaConfig("front", -2.0, 0.0, 4.0), AntennaConfig("rear", -20.15, 0.3, 3.8))
CURVE_FROM_M, CURVE_TO_M, LENGTH_M = 300.0, 620.0, 800.0
BEGIN = Start(0.62305, 2.43327, 80.0, 1.1)
PIECES = (Piece(300.0), Piece(60.0, 300.0, 0.06, 0.01), Piece(200.0, 300.0, 0.06, 0.01), Piece(60.0), Piece(180.0))
SILENT = ErrorModel(  # no error, no clock: an antenna is where it is when the clock says so
    *(0.0, 3000.0, 0.0, 1800.0, 0.0, 0.0, 0.0, 0.0, (20.0, 60.0)),  # satellites, ionosphere, noise, multipath
    *(0.0, 0.0, 0.0, 0.0, 0.0, 0.0),  # carrier, range rate, strength, clock
)
NOISE_03 = replace(SILENT, noise_m=0.3)


@cache
def line() -> Line:
    return build_line(BEGIN, PIECES)


def map_points() -> Floats:
    """Every 20 m on the straight, 2.5 m in the curve, as the thesis had it."""
    return np.unique(
        np.concatenate(
            (np.arange(0.0, CURVE_FROM_M, 20.0), np.arange(CURVE_FROM_M, CURVE_TO_M, 2.5), np.arange(CURVE_TO_M, LENGTH_M, 20.0))
        )
    )


def edge(name: str, ends: tuple[str, str], s_m: Floats, lifted: float = 0.0, of: Line | None = None) -> Edge:
    """An edge along a line; `lifted` puts another track beside it, metres to the right."""
    at = (of or line()).at(s_m)
    right = np.cross(at.tangent, at.pos_ecef_m / np.linalg.norm(at.pos_ecef_m, axis=1, keepdims=True))
    return Edge(name, *ends, s_m, at.pos_ecef_m + lifted * right, at.cant_rad)


def track_of(edges: Sequence[Edge], switches: Sequence[Switch] = ()) -> TrackMap:
    nodes = {node for e in edges for node in (e.from_node, e.to_node)}
    return TrackMap(
        "test", 1, "ITRF2020", "2026-01-01T00:00:00Z", "", tuple(Node(n, "joint") for n in sorted(nodes)), tuple(edges), tuple(switches)
    )


@cache
def whole_track() -> TrackMap:
    return track_of([edge("whole", ("west", "east"), map_points())])


def paths_on(track: TrackMap, antennas: Sequence[AntennaConfig] = ANTENNAS) -> Paths:
    return paths_of([locus_of(track, a.height_m, a.y_m) for a in antennas])


class Heard(NamedTuple):
    """A block with its sky; `s_m` (E, R) where the antennas are on the map."""

    block: ObservationBlock
    states: SatelliteStates
    klobuchar: Klobuchar
    system_of: Ints
    s_m: Floats


def heard(
    front_m: float = 100.0,
    speed_mps: float = 20.0,
    seconds: float = 20.0,
    rate_hz: float = 5.0,
    errors: ErrorModel = SILENT,
    antennas: Sequence[AntennaConfig] = ANTENNAS,
    on: Line | None = None,
) -> Heard:
    """What a train at constant speed hears."""
    run = run_of(on or line(), START_NS - 2 * 10**9, front_m - speed_mps, [Leg(2.0, 0.5 * speed_mps), Leg(seconds + 1.0, 0.0)])
    return heard_by(antennas_on(run, antennas), run, antennas, seconds, rate_hz, errors)


def heard_by(
    receivers: Sequence[Antenna], run: Run, antennas: Sequence[AntennaConfig], seconds: float, rate_hz: float, errors: ErrorModel
) -> Heard:
    events = observed(receivers, START_NS, seconds, rate_hz, 5, errors)
    rows = [event.row for event in events if isinstance(event, ObservationsReceived)]
    names = [receiver.receiver for receiver in receivers]
    epochs = [rows[k : k + len(names)] for k in range(0, len(rows), len(names))]
    block = build_block(names, [epoch[0].receive_time_ns for epoch in epochs], epochs)
    store = EphemerisStore(event.ephemeris for event in events if isinstance(event, EphemerisReceived))
    index = store.choose(block.satellites, block.epoch_ns, np.full(len(epochs), len(store)))
    states = satellite_states(store.ephemerides, index, state_time_ns(block.epoch_ns), block.signals)
    klobuchar = next(event.klobuchar for event in events if isinstance(event, IonosphereReceived))
    system_of = np.array([time_scale_index(s) for s in block.satellites])
    front_m, _ = run.front(block.epoch_ns)
    return Heard(block, states, klobuchar, system_of, front_m[:, None] + np.array([a.x_m for a in antennas]))


def ranges_of(told: Heard, sigma_m: Floats, used: Bools, block: ObservationBlock | None = None) -> Ranges:
    return Ranges(block or told.block, told.states, told.klobuchar, sigma_m, used, told.system_of, len(TIME_SCALES))


def solved(paths: Paths, told: Heard, segment: Ints, sigma_m: float = 0.3, block: ObservationBlock | None = None) -> OnTrack:
    everywhere = np.ones((1, 1, len(told.system_of)), dtype=np.bool_)
    sigma = np.full(everywhere.shape, sigma_m)
    return solve_on_track(ranges_of(told, sigma, everywhere, block), paths, segment, LIMITS)


def segments_near(paths: Paths, s_m: Floats) -> Ints:
    """The segment whose beginning lies last before each antenna's place (E, R), on a map of one edge."""
    return np.stack([np.searchsorted(locus.s_m, s_m[:, r], side="right") - 1 for r, locus in enumerate(paths.loci)], axis=1)


def map_s_m(paths: Paths, found: OnTrack) -> Floats:
    """Solved places (E, R) as the map's s."""
    per = [locus.s_m[found.segment[:, r]] + locus.ds_dm[found.segment[:, r]] * found.d_m[:, r] for r, locus in enumerate(paths.loci)]
    return np.stack(per, axis=1)


def corner_points() -> Floats:
    """Ends and middle (3, 3) of two chords of 150 m with a corner of 0.12 rad to the right."""
    at = build_line(BEGIN, (Piece(300.0),)).at(np.array([0.0, 150.0]))
    ahead, side = at.tangent[1], np.cross(at.tangent[1], at.pos_ecef_m[1] / np.linalg.norm(at.pos_ecef_m[1]))
    return np.stack((*at.pos_ecef_m, at.pos_ecef_m[1] + 150.0 * (np.cos(0.12) * ahead + np.sin(0.12) * side)))


def corner(aside_m: float) -> tuple[Paths, Heard]:
    """The corner as a track, and an antenna that stands `aside_m` to the right of it."""
    points = corner_points()
    paths = paths_on(track_of([Edge("corner", "a", "b", np.array([0.0, 150.0, 300.0]), points, np.zeros(3))]), ANTENNAS[:1])
    side = np.cross(points[1] - points[0], points[1])
    stands = paths.points.pos_ecef_m[1] + aside_m * side / np.linalg.norm(side)
    run = run_of(build_line(BEGIN, (Piece(300.0),)), START_NS, 152.0, [])
    return paths, heard_by([Antenna("front", fixed(stands.tolist()))], run, ANTENNAS[:1], 3.0, 1.0, SILENT)


def cut(told: Heard, some: slice) -> Heard:
    """The same, of some epochs."""
    b, s = told.block, told.states
    arrays = {f.name: getattr(b, f.name)[some] for f in fields(ObservationBlock) if f.name not in ("receivers", "signals", "satellites")}
    block = ObservationBlock(b.receivers, b.signals, b.satellites, **arrays)
    vectors = (s.pos_ecef_m[:, some], s.vel_ecef_mps[:, some], s.acc_ecef_mps2[:, some])
    states = SatelliteStates(s.t_ns[some], *vectors, s.clock_s[some], s.clock_drift_sps[some], s.ionosphere[some])
    return Heard(block, states, told.klobuchar, told.system_of, told.s_m[some])
