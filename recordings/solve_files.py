"""One receiver's files solved: what a command line asks for, and which model of the ionosphere the files allow.

RINEX is solved as it is read, a few megabytes at a time; a u-blox log is heard through first, since it brings ephemerides along.
"""

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import chain
from pathlib import Path
from typing import NamedTuple

import numpy as np

from integrity.config import IntegrityConfig
from integrity.errors import ConfigError, DecodeError
from integrity.gnss.atmosphere import Ionosphere
from integrity.gnss.combination import ionosphere_free
from integrity.gnss.ephemeris.broadcast import Ephemeris
from integrity.gnss.gps_time import GPS_EPOCH_UNIX_S, NS_PER_S, format_calendar
from integrity.gnss.observations import ObservationBlock
from integrity.gnss.signals import SECOND_CODES, SYSTEM_NAMES, Codes, first_codes_of
from recordings.ground_point import ground_point_ecef_m
from recordings.rinex.navigation import NavigationFile, read_navigation
from recordings.solve import Sky, Track, Weights, solved
from recordings.solve_inputs import Heard, ObservationFiles, first_plausible

IONOSPHERES = ("klobuchar", "nequick", "free", "none")
HIGHEST_MASK_DEG = 45.0  # as of a site file


@dataclass(frozen=True)
class Request:
    """What to solve: files of one receiver, `systems` by name, `ionosphere` of IONOSPHERES or None for what the files allow."""

    observations: tuple[Path, ...]
    navigation: tuple[NavigationFile, ...]
    systems: tuple[str, ...]
    ionosphere: str | None
    mask_deg: float
    true_pos_ecef_m: tuple[float, float, float] | None


class Model(NamedTuple):
    """A model of the ionosphere of IONOSPHERES, its terms, the codes that it is for, and, where nobody asked for it, why."""

    name: str
    terms: Ionosphere | None
    codes: Codes
    why: str | None


@dataclass(frozen=True, eq=False)
class Found:
    """Positions in order of time, each epoch once. `dropped` counts what in the files could not be used; `warnings` are for people."""

    request: Request
    model: Model
    track: Track
    dropped: dict[str, int]
    warnings: tuple[str, ...]


def request_of(
    observations: Sequence[Path], nav: Sequence[Path], systems: str, ionosphere: str | None, mask_deg: float, position: str | None
) -> Request:
    """From the words of a command line; ConfigError for one that is wrong, DecodeError and OSError for navigation files."""
    if ionosphere is not None and ionosphere not in IONOSPHERES:
        raise ConfigError(f"--ionosphere {ionosphere!r}: expected one of {', '.join(IONOSPHERES)}")
    if not 0.0 <= mask_deg <= HIGHEST_MASK_DEG:
        raise ConfigError(f"--mask {mask_deg:g}: expected 0 to {HIGHEST_MASK_DEG:g} degrees")
    chosen = _systems(systems)
    true_pos_ecef_m = None if position is None else ground_point_ecef_m(position)
    navigation = tuple(read_navigation(path) for path in nav)
    return Request(tuple(observations), navigation, chosen, ionosphere, mask_deg, true_pos_ecef_m)


def solve_files(request: Request) -> Found:
    """Every epoch of the files, from a start that the measurements give.

    ConfigError where the files do not allow the ionosphere that was asked for, DecodeError where they have no epoch, or no ephemeris
    that serves one; OSError where one cannot be opened.
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
    model = _model(request, heard, held[-1])
    sky = Sky(_ephemerides(request, heard), model.terms)
    integrity = IntegrityConfig()
    weights = Weights(integrity.sigma_range_m, integrity.sigma_range_low_m, math.radians(request.mask_deg))
    every = chain(held, blocks)
    pairs_or_signals = map(ionosphere_free, every) if model.name == "free" else every
    track = _in_order(list(solved(pairs_or_signals, sky, weights, None, model.codes)), files.dropped)
    _check_served(track, sky, request)
    for file in request.navigation:
        files.dropped.update({f"navigation: {what}": n for what, n in file.problems.items()})
    dropped = {what: n for what, n in files.dropped.items() if n}
    return Found(request, model, track, dropped, tuple(files.warnings))


def written_time(gps_ns: int) -> str:
    """GPS time on its own scale, so without Z."""
    return format_calendar(gps_ns + GPS_EPOCH_UNIX_S * NS_PER_S)


def _systems(text: str) -> tuple[str, ...]:
    name_of = {name.lower(): name for name in SYSTEM_NAMES.values()}
    asked = [part.strip().lower() for part in text.split(",")]
    if not set(asked) <= name_of.keys():
        raise ConfigError(f"--systems {text!r}: expected names among {', '.join(name_of.values())}, with commas between them")
    return tuple(name for key, name in name_of.items() if key in asked)


def _ephemerides(request: Request, heard: Heard) -> list[Ephemeris]:
    letters = {letter for letter, name in SYSTEM_NAMES.items() if name in request.systems}
    every = chain(chain.from_iterable(file.ephemerides for file in request.navigation), heard.ephemerides)
    return [eph for eph in every if eph.satellite[0] in letters]


def _model(request: Request, heard: Heard, first: ObservationBlock) -> Model:
    """The ionosphere that was asked for, or the first that the files allow; ConfigError where they do not allow what was asked."""
    singles = first_codes_of(request.systems)
    pairs = {s: tuple(f"{one}+{two}" for one in singles[s] for two in SECOND_CODES[s]) for s in singles if s in SECOND_CODES}
    klobuchar = first_plausible(chain((file.klobuchar for file in request.navigation), (heard.klobuchar,)))
    galileo = next((file.galileo_ionosphere for file in request.navigation if file.galileo_ionosphere is not None), None)
    n_singles, n_pairs = _satellites(first, singles), _satellites(ionosphere_free(first), pairs)
    match request.ionosphere:
        case "klobuchar" if klobuchar is None:
            raise ConfigError(_not_there("klobuchar", "Klobuchar terms (GPSA, GPSB, or ION ALPHA and BETA in RINEX 2)"))
        case "nequick" if galileo is None:
            raise ConfigError(_not_there("nequick", "coefficients of Galileo (GAL in IONOSPHERIC CORR, or ION records of RINEX 4)"))
        case "free" if not n_pairs:
            raise ConfigError(
                f"--ionosphere free: the first {len(first.epoch_ns)} epochs have no satellite of {', '.join(request.systems)} on two "
                "frequencies; use klobuchar, nequick or none"
            )
    name, why = request.ionosphere, None
    if name is None:
        name, why = _first_allowed(klobuchar is not None, bool(n_pairs) and 2 * n_pairs >= n_singles)
    terms = {"klobuchar": klobuchar, "nequick": galileo}
    return Model(name, terms.get(name), pairs if name == "free" else singles, why)


def _first_allowed(has_klobuchar: bool, mostly_pairs: bool) -> tuple[str, str]:
    """A model where none was asked for, and why this one."""
    if has_klobuchar:
        return "klobuchar", "the navigation data have its terms"
    if mostly_pairs:
        return "free", "no Klobuchar terms, but a second frequency"
    return "none", "no Klobuchar terms, and no second frequency of most satellites"


def _not_there(model: str, terms: str) -> str:
    return (
        f"--ionosphere {model}: the navigation files have no {terms}; give one that has them with --nav, or another model: "
        f"{', '.join(name for name in IONOSPHERES if name != model)}"
    )


def _satellites(block: ObservationBlock, codes: Codes) -> int:
    """How many satellites of a block have one of these codes."""
    return len({s for s, signal in zip(block.satellites, block.signals, strict=True) if signal.partition(".")[2] in codes.get(s[0], ())})


def _in_order(tracks: Sequence[Track], dropped: Counter[str]) -> Track:
    """All of them by time; of epochs of one time the first one read."""
    whole = Track._make(np.concatenate(columns) for columns in zip(*tracks, strict=True))
    _, kept = np.unique(whole.time_ns, return_index=True)
    dropped["epoch repeated"] += len(whole.time_ns) - len(kept)
    return Track._make(column[kept] for column in whole)


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
