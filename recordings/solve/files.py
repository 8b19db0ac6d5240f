"""One receiver's files solved, as they are read.

RINEX is solved a few megabytes at a time; a u-blox log is heard through first, since it brings ephemerides along.
"""

import math
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import chain

import numpy as np

from integrity.config import IntegrityConfig
from integrity.errors import ConfigError, DecodeError
from integrity.gnss.combination import ionosphere_free
from integrity.gnss.ephemeris.broadcast import Ephemeris
from integrity.gnss.gps_time import NS_PER_S
from integrity.gnss.observations import ObservationBlock
from integrity.gnss.range_errors import UNMODELLED_A_M, UNMODELLED_B_M
from integrity.gnss.signals import SYSTEM_NAMES
from recordings.solve.inputs import Heard, ObservationFiles
from recordings.solve.ionosphere import Model, model_of
from recordings.solve.request import Request
from recordings.solve.residuals import ResidualFile
from recordings.solve.results import Track, joined, taken, written_time
from recordings.solve.sky import Sky, Weights
from recordings.solve.smoothing import Smoother
from recordings.solve.track import Wanted, solved

# Of criteria that are not about false alarms: those of `tests/benchmarks/exclusion.py`.
MOST_EXCLUDED = 3
CONFUSABLE, CONFUSION = 0.85, 1e-3
FEW_BLIND = 0.05  # of phases without anything to check them by: not worth a warning


@dataclass(frozen=True, eq=False)
class Found:
    """Positions in order of time, each epoch once. `dropped` counts what in the files could not be used; `warnings` are for people."""

    request: Request
    model: Model
    track: Track
    dropped: dict[str, int]
    warnings: tuple[str, ...]


def solve_files(request: Request) -> Found:
    """Every epoch of the files, from a start that the measurements give; every range into the file of residuals, if there is to be one.

    ConfigError where the files do not allow the ionosphere or the smoothing that was asked for, DecodeError where they have no epoch, or no
    ephemeris that serves one; OSError where one cannot be opened or written.
    """
    files = ObservationFiles()
    rinex, logs = files.by_kind(request.observations)
    if rinex and not logs and not request.navigation:
        raise ConfigError("no navigation file: give the broadcast ephemerides of the day with --nav FILE; only UBX logs bring their own")
    heard = files.heard(logs)
    blocks = files.blocks(rinex, heard.rows)
    held: list[ObservationBlock] = []
    for block in blocks:
        held.append(block)
        if block.signals:  # there may be epochs before in which nothing was tracked
            break
    model = model_of(request.ionosphere, request.systems, request.navigation, heard, held[-1])
    sky = Sky(_ephemerides(request, heard), model.terms)
    wanted = _wanted(request, model, sky, held[-1])
    track = _tracked(chain(held, blocks), request, model, sky, wanted, files)
    for file in request.navigation:
        files.dropped.update({f"navigation: {what}": n for what, n in file.problems.items()})
    dropped = {what: n for what, n in files.dropped.items() if n}
    return Found(request, model, track, dropped, (*files.warnings, *_remarks(wanted.smoother)))


def _wanted(request: Request, model: Model, sky: Sky, first: ObservationBlock) -> Wanted:
    criteria, smoother = None, None
    if request.false_alarm is not None:
        from integrity.gnss.detection import criteria as criteria_of  # and with it scipy

        criteria = criteria_of(request.false_alarm, MOST_EXCLUDED, CONFUSABLE, CONFUSION)
    if request.smooth_s is not None:
        if not np.isfinite(first.carrier_cycles).any():
            raise ConfigError(
                f"--smooth {request.smooth_s:g}: the first {len(first.epoch_ns)} epochs have no carrier phase; give files that have it "
                "(L1C and the like), or leave --smooth out"
            )
        smoother = Smoother(request.smooth_s, model.name == "free", sky.store.ephemerides)
    return Wanted(criteria, request.velocity, smoother, request.residuals is not None)


def _tracked(
    blocks: Iterator[ObservationBlock], request: Request, model: Model, sky: Sky, wanted: Wanted, files: ObservationFiles
) -> Track:
    integrity = IntegrityConfig()
    modelled = integrity.sigma_range_m, integrity.sigma_range_low_m
    weights = Weights(*((UNMODELLED_A_M, UNMODELLED_B_M) if model.name == "none" else modelled), math.radians(request.mask_deg))
    combined_here = model.name == "free" and wanted.smoother is None
    tracks = solved(map(ionosphere_free, blocks) if combined_here else blocks, sky, weights, None, model.codes, wanted)
    if request.residuals is None:
        track = _in_order(list(tracks), files.dropped)
        _check_served(track, sky, request)
        return track
    with ResidualFile(request.residuals) as residuals:
        track = _in_order([residuals.written(one) for one in tracks], files.dropped)
        _check_served(track, sky, request)
    return track


def _ephemerides(request: Request, heard: Heard) -> list[Ephemeris]:
    letters = {letter for letter, name in SYSTEM_NAMES.items() if name in request.systems}
    every = chain(chain.from_iterable(file.ephemerides for file in request.navigation), heard.ephemerides)
    return [eph for eph in every if eph.satellite[0] in letters]


def _in_order(tracks: list[Track], dropped: Counter[str]) -> Track:
    """All of them by time; of epochs of one time the first one read."""
    whole = joined(tracks)
    _, kept = np.unique(whole.time_ns, return_index=True)
    dropped["epoch repeated"] += len(whole.time_ns) - len(kept)
    return taken(whole, kept)


def _check_served(track: Track, sky: Sky, request: Request) -> None:
    """DecodeError where no ephemeris serves an epoch."""
    first_ns, last_ns = int(track.time_ns[0]), int(track.time_ns[-1])
    every = sky.store.ephemerides
    if any(abs(eph.toe_ns - np.clip(eph.toe_ns, first_ns, last_ns)) <= eph.fit_half_s * NS_PER_S for eph in every):
        return
    times = sorted(eph.toe_ns for eph in every)
    covered = f"those given are from {written_time(times[0])} to {written_time(times[-1])}" if times else "the files given have none"
    raise DecodeError(
        f"no ephemeris of {', '.join(request.systems)} serves the epochs {written_time(first_ns)} to {written_time(last_ns)} (GPS time): "
        f"{covered}; give the navigation file of that day with --nav, or record UBX with RXM-SFRBX"
    )


def _remarks(smoother: Smoother | None) -> list[str]:
    """What a person should know of the smoothing."""
    if smoother is None or not smoother.watched.phases:
        return []
    blind = smoother.watched.phases - smoother.watched.checkable
    if blind <= FEW_BLIND * smoother.watched.phases:
        return []
    return [
        f"--smooth: of {smoother.watched.phases} phases {blind} have neither a second frequency nor Doppler nor a lock time: a slip that "
        "the receiver did not mark there is not seen, unless it is 30 m long"
    ]
