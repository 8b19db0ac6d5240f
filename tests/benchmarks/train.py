"""The train's positions: `python -m tests.benchmarks.train`, on one core.

Two antennas, 20 satellites each, on a line with a straight and a curve. One epoch live (median of many), with the geometry of the points
of linearisation and with one computed ahead; 10^5 epochs in blocks of 1024 from ephemerides to places; the search over 10,000 points.
"""

import time
from collections.abc import Callable
from dataclasses import replace
from statistics import median

import numpy as np

from integrity.gnss.ephemeris.states import SatelliteStates, satellite_states
from integrity.gnss.ephemeris.store import EphemerisStore
from integrity.gnss.observations import Bools, Floats, Ints, ObservationBlock
from integrity.gnss.positioning import Points, compared, expected, points_at, state_time_ns
from integrity.gnss.signals import time_scale_index
from recordings.simulate.constellation import IONOSPHERE, constellation
from tests.unit.positioning.field import ANTENNAS, BEGIN, START_NS, edge, map_s_m, paths_on, track_of, whole_track
from train_client.limits import derive
from train_client.positioning.constrained import Paths, Ranges, Why, sight_at, solve_on_track
from train_client.positioning.sections import locate, search
from train_client.simulate.line import Piece, build_line

N_SATELLITES, N_EPOCHS, EPOCHS_PER_BLOCK, SEED = 20, 100_000, 1024, 3
INTERVAL_NS = 10_000_000  # so that the same 20 satellites stay above the mask; costs nothing and saves nothing
SIGMA_M = 0.3
LIMITS = replace(derive(), elevation_mask_rad=float(np.deg2rad(5.0)))  # 20 satellites are rarely above 10 deg
Solver = Callable[[], object]


class Sky:
    """Twenty satellites above the mask for as long as the run lasts."""

    def __init__(self, place_ecef_m: Floats) -> None:
        for hour in range(24):
            self.start_ns = START_NS + hour * 3600 * 10**9
            sets = constellation(SEED, self.start_ns, self.start_ns + N_EPOCHS * INTERVAL_NS)
            self.store = EphemerisStore(eph for eph in sets if eph.transmission_ns <= self.start_ns)
            names = sorted({eph.satellite for eph in sets})
            ends_ns = self.start_ns + np.array([0, N_EPOCHS * INTERVAL_NS])
            el_rad = expected(self.states(names, ends_ns), ends_ns, points_at(place_ecef_m[None]), None).el_rad.min(axis=(0, 1))
            lowest = np.sort(np.nan_to_num(el_rad, nan=-1.0))[-N_SATELLITES]
            self.satellites = [name for name, el in zip(names, el_rad, strict=True) if el >= lowest]
            if lowest >= LIMITS.elevation_mask_rad + 1e-3:
                return
        raise RuntimeError("no hour with twenty satellites above the mask: take another seed")

    def states(self, names: list[str], epoch_ns: Ints) -> SatelliteStates:
        index = self.store.choose(names, epoch_ns, np.full(len(epoch_ns), len(self.store)))
        return satellite_states(self.store.ephemerides, index, state_time_ns(epoch_ns))


def measured(sky: Sky, place_ecef_m: Floats, epoch_ns: Ints) -> ObservationBlock:
    """What antennas at places (E, R, 3) measure: the models, a clock of 100 km, and white noise."""
    sight = expected(sky.states(sky.satellites, epoch_ns), epoch_ns, points_at(place_ecef_m), IONOSPHERE)
    wanted_m = 1e5 + np.random.default_rng(SEED).normal(0.0, SIGMA_M, sight.range_m.shape)
    rho = sight.range_m + wanted_m
    for _ in range(3):
        rho = rho + wanted_m - compared(block_of(sky, epoch_ns, rho), sight).residual_m
    return block_of(sky, epoch_ns, rho)


def block_of(sky: Sky, epoch_ns: Ints, rho: Floats) -> ObservationBlock:
    nothing = np.broadcast_to(np.nan, rho.shape)
    flags = np.broadcast_to(False, rho.shape)
    names, signals = tuple(sky.satellites), tuple(f"{s}.1C" for s in sky.satellites)
    times = epoch_ns, np.repeat(epoch_ns[:, None], rho.shape[1], axis=1)
    return ObservationBlock(("front", "rear")[: rho.shape[1]], signals, names, *times, rho, *(nothing,) * 4, flags, flags)


def seconds_of(run: Solver, repeats: int) -> float:
    taken = []
    for _ in range(repeats):
        began = time.perf_counter()
        run()
        taken.append(time.perf_counter() - began)
    return median(taken)


def said(what: str, value: float, asked: float, unit: str) -> None:
    print(f"{what:62} {value:8.3f} {unit} (asked {asked:g})  {'met' if value <= asked else 'MISSED'}")


def live(sky: Sky, paths: Paths, block: ObservationBlock, segment: Ints, sigma_m: Floats, used: Bools, system_of: Ints) -> None:
    states = sky.states(sky.satellites, block.epoch_ns)
    seen_from = paths, segment, states, block.epoch_ns, IONOSPHERE
    sight = sight_at(*seen_from)
    where = Ranges(block, states, IONOSPHERE, sigma_m, used, system_of, 2), paths, segment, LIMITS
    said("one epoch, two antennas, geometry included", 1e3 * seconds_of(lambda: solve_on_track(*where), 3000), 0.3, "ms")
    said("one epoch, two antennas, geometry computed ahead", 1e3 * seconds_of(lambda: solve_on_track(*where, sight), 3000), 0.3, "ms")
    print(f"{'  of it the geometry':62} {1e3 * seconds_of(lambda: sight_at(*seen_from), 3000):8.3f} ms")


def main() -> None:
    """Print what was measured, against what was asked."""
    paths = paths_on(whole_track())
    sky = Sky(paths.points.pos_ecef_m[0])
    epoch_ns = sky.start_ns + INTERVAL_NS * np.arange(N_EPOCHS)
    s_m = np.linspace(60.0, 760.0, N_EPOCHS)[:, None] + np.array([antenna.x_m for antenna in ANTENNAS])
    segment = np.searchsorted(paths.loci[0].s_m, s_m, side="right") - 1  # the same points for both
    through = segment + paths.begins
    d_m = (s_m - paths.loci[0].s_m[segment]) / np.stack([x.ds_dm[segment[:, r]] for r, x in enumerate(paths.loci)], axis=1)
    place_ecef_m = paths.points.pos_ecef_m[through] + d_m[..., None] * paths.along_ecef[through]
    cuts = [slice(e, e + EPOCHS_PER_BLOCK) for e in range(0, N_EPOCHS, EPOCHS_PER_BLOCK)]
    blocks = [measured(sky, place_ecef_m[cut], epoch_ns[cut]) for cut in cuts]
    system_of = np.array([time_scale_index(name) for name in sky.satellites])
    used, sigma_m = np.ones((1, 1, N_SATELLITES), dtype=np.bool_), np.full((1, 1, N_SATELLITES), SIGMA_M)

    one = measured(sky, place_ecef_m[:1], epoch_ns[:1])
    live(sky, paths, one, segment[:1], sigma_m, used, system_of)

    def all_blocks() -> tuple[int, float]:
        solved, squares = 0, 0.0
        for block, cut in zip(blocks, cuts, strict=True):
            states = sky.states(sky.satellites, block.epoch_ns)
            ranges = Ranges(block, states, IONOSPHERE, sigma_m, used, system_of, 2)
            found = solve_on_track(ranges, paths, segment[cut], LIMITS)
            solved += int(found.solved.sum())
            squares += float((((map_s_m(paths, found) - s_m[cut]) / found.sigma_m) ** 2).sum())
        return solved, squares

    said(f"{N_EPOCHS} epochs, states, geometry and solution", seconds_of(all_blocks, 5), 3.0, "s")
    solved, squares = all_blocks()
    print(f"  {solved} of {2 * N_EPOCHS} places solved, {N_SATELLITES} satellites each; rms error {np.sqrt(squares / solved):.3f} sigma")

    long = build_line(BEGIN, (Piece(20_000.0), Piece(500.0, 800.0), Piece(1000.0, 800.0), Piece(500.0), Piece(28_000.0)))
    wide = paths_on(track_of([edge("long", ("a", "b"), np.arange(0.0, 10_001.0) * 5.0, of=long)]), ANTENNAS[:1])
    at = Points(*(p[None, 6_000, None] for p in wide.points))
    there = measured(sky, at.pos_ecef_m, epoch_ns[:1])
    states = sky.states(sky.satellites, epoch_ns[:1])
    query = Ranges(there, states, IONOSPHERE, sigma_m[0, 0], used[0, 0], system_of, 2), wide, LIMITS
    said(f"search over {len(wide.length_m)} points", 1e3 * seconds_of(lambda: search(*query), 20), 100.0, "ms")
    said("search and solutions", 1e3 * seconds_of(lambda: locate(*query), 20), 100.0, "ms")
    found = locate(*query)
    print(f"  {found.outcome.value}, {Why(found.why).name}: {len(search(*query))} candidates, {len(found.hypotheses)} fit")


if __name__ == "__main__":
    main()
