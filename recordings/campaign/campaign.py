"""The campaign itself: stages, threats, sizes, trials. The same seed, the same campaign, however many processes share the work."""

from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import lru_cache
from itertools import islice
from math import cos, degrees, pi, sin, sqrt
from pathlib import Path
from typing import NamedTuple

import numpy as np

from integrity.config import SiteConfig
from integrity.errors import ConfigError, RecordingError
from integrity.gnss.gps_time import NS_PER_S
from integrity.gnss.signals import satellite_of
from integrity.limits import derive
from integrity.triangle import reference_triangle
from recordings.campaign.catalogue import CATALOGUE
from recordings.campaign.stage import Stage, recorded_stage, stage_of
from recordings.campaign.threat import Draw, Guilty, Threat
from recordings.campaign.trial import EPOCHS_AFTER, Trial, play
from recordings.faults import Fault
from recordings.simulate.observations import simulate

ATTEMPTS = 5  # to draw a trial in which the fault changes something: satellites may outrun a front
LEAST_EPOCHS = 10  # that a fault lasts, on recordings of an epoch in half a minute
WATCHED_S = 60.0  # of GNSS time after the first alert: what a trial that is not played to its end still counts


@dataclass(frozen=True)
class Simulated:
    """A stage that never was: the same seed, the same stage. `start_ns` is GPS time."""

    site: SiteConfig
    start_ns: int
    duration_s: float
    seed: int


@dataclass(frozen=True)
class Recorded:
    """A stage that was recorded, and in which nothing was wrong."""

    path: Path


Source = Simulated | Recorded


@dataclass(frozen=True)
class Plan:
    """On which stages, how many trials of each size of a threat on each, and what `seed` draws the moments, satellites and receivers.

    The first trial of each size on the first stage is played to its end, the others until `WATCHED_S` after the first alert: the faults
    that last longest would cost twice as much as all others together, and what they add is the same alert again.
    """

    sources: tuple[Source, ...]
    trials: int
    seed: int = 1


class Piece(NamedTuple):
    """What one process does in one go: one threat on one stage, by their numbers."""

    source: int
    threat: int


@dataclass(frozen=True)
class Played:
    """A trial of a threat; `named_wrongly`: satellites and receivers that had nothing to do with it."""

    threat: str
    size: float
    trial: Trial
    named_wrongly: frozenset[str]


def campaign(plan: Plan, jobs: int = 1, threats: Sequence[str] = ()) -> Iterator[list[Played]]:
    """Trials piece by piece, in the order of stages and threats; `threats` by id, all where none is named."""
    numbers = [i for i, threat in enumerate(CATALOGUE) if not threats or threat.id in threats]
    pieces = [Piece(source, number) for source in range(len(plan.sources)) for number in numbers]
    if jobs == 1:
        for piece in pieces:
            yield _played(plan, piece)
        return
    with ProcessPoolExecutor(jobs) as pool:
        yield from pool.map(_played, [plan] * len(pieces), pieces)


@lru_cache(maxsize=2)
def stage_from(source: Source) -> Stage:
    """The stage itself: sound events, and what is decided on them."""
    if isinstance(source, Recorded):
        return recorded_stage(source.path)
    site = source.site
    rate_hz = NS_PER_S / site.epoch_interval_ns
    return stage_of(f"simulated, seed {source.seed}", site, simulate(site, source.start_ns, source.duration_s, rate_hz, source.seed))


def tolerance_m(site: SiteConfig) -> float:
    """What the line can tolerate; where the site does not say, what its circles promise to catch."""
    limits = derive(site, reference_triangle(site))
    promised_m = max(limits.by_name[f"circle_{name}"].smallest_fault or 0.0 for name in site.receiver_names)
    return promised_m if site.integrity.tolerance_m is None else site.integrity.tolerance_m


def _played(plan: Plan, piece: Piece) -> list[Played]:
    stage = stage_from(plan.sources[piece.source])
    threat = CATALOGUE[piece.threat]
    chance = np.random.default_rng((plan.seed, *piece))
    tolerable_m = tolerance_m(stage.site)
    found: list[Played] = []
    for size in threat.sizes:
        for number in range(plan.trials):
            watched_s = None if piece.source == number == 0 else WATCHED_S
            attempts = (_one(stage, threat, size, chance, tolerable_m, number, watched_s) for _ in range(ATTEMPTS))
            found += islice((one for one in attempts if one is not None), 1)
    return found


def _one(
    stage: Stage, threat: Threat, size: float, chance: np.random.Generator, tolerable_m: float, number: int, watched_s: float | None
) -> Played | None:
    """One trial; None where the fault would change nothing (no ephemeris of the satellite comes in time, no front reaches it)."""
    lasts_ns = max(round(threat.duration_s * NS_PER_S), LEAST_EPOCHS * stage.site.epoch_interval_ns)
    start_ns = _moment(stage, lasts_ns, chance)
    draw = _draw(stage, start_ns, chance)
    end_ns, apart_ns = start_ns + lasts_ns, round(threat.apart_s * NS_PER_S)
    faults = [Fault(start_ns + k * apart_ns, end_ns, effect) for k, effect in enumerate(threat.effects(size, draw))]
    try:
        trial = play(stage, faults, tolerable_m, number, watched_s, EPOCHS_AFTER if threat.abrupt else 0)
    except ConfigError:
        return None
    guilty: Guilty = threat.guilty(draw)
    return Played(threat.id, size, trial, frozenset(name for name in trial.named if not guilty.may_be(name)))


def _moment(stage: Stage, lasts_ns: int, chance: np.random.Generator) -> int:
    moments = stage.sound_for(lasts_ns + EPOCHS_AFTER * stage.site.epoch_interval_ns)
    if not moments:
        raise RecordingError(f"{stage.name}: no {lasts_ns / NS_PER_S:g} s of NORMAL; give a longer recording, in which nothing is wrong")
    return moments[int(chance.integers(len(moments)))]


def _draw(stage: Stage, gps_ns: int, chance: np.random.Generator) -> Draw:
    report = stage.reports[gps_ns]
    satellites = [satellite_of(s) for s, used in zip(report.signals, report.used.tolist(), strict=True) if used]
    azimuth_rad = chance.uniform(0.0, 2.0 * pi)
    x, y, z = chance.standard_normal(3).tolist()
    norm = sqrt(x * x + y * y + z * z)
    receivers = [stage.site.receivers[i] for i in chance.permutation(len(stage.site.receivers)).tolist()]
    return Draw(
        satellite=satellites[int(chance.integers(len(satellites)))],
        receivers=tuple(receiver.name for receiver in receivers),
        points_ecef_m=tuple(receiver.position_ecef_m for receiver in receivers),
        east=sin(azimuth_rad),
        north=cos(azimuth_rad),
        azimuth_deg=degrees(azimuth_rad),
        towards_ecef=(x / norm, y / norm, z / norm),
        sign=float(chance.choice((-1.0, 1.0))),
    )
