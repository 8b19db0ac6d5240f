"""Antennas of one train against each other: their distance along the line [000 4.4], and the front end that follows from them.

What the distance cannot see: errors common to all antennas (satellite clocks and orbits, ionosphere, one transmitter that lies about
time) move all of them alike. Only the ground sees those; section 1.9.
"""

from collections.abc import Sequence
from enum import Enum
from itertools import combinations
from math import hypot, isfinite, nan
from typing import NamedTuple

from train_client.limits import TrainLimits
from train_client.track.locus import Place, Unreachable, arc_between, shifted
from train_client.track.track_map import TrackMap


class Agreement(Enum):
    """What the distances say."""

    AGREE = "antennas are as far apart as they are mounted"
    DISAGREE = "antennas are not as far apart as they are mounted"
    EXCHANGED = "antennas are exchanged, or the train faces the other way"
    ONE_POINT = "all antennas solve to one point: a single transmitter"
    FACING_OPEN = "antennas are too close to each other to tell which way the train faces"
    UNCONNECTED = "no single way along the map from antenna to antenna"
    TOO_FEW = "fewer than two antennas have a place"


class AntennaPlace(NamedTuple):
    """A solved antenna: mounted `x_m` from the front end, backwards negative; place in map metres, as `Locus` has it, with its sigma."""

    x_m: float
    edge_index: int
    s_m: float
    sigma_m: float


class DistanceTest(NamedTuple):
    """The outcome; `facing` (1 or -1 under AGREE, else 0) on the edge of the first antenna; the worst pair in sigmas; words if needed."""

    agreement: Agreement
    facing: int
    statistic: float | None
    detail: str = ""


class FrontEnd(NamedTuple):
    """The front end on the map; `facing` on its edge."""

    place: Place
    facing: int
    sigma_m: float


def compare_distances(track: TrackMap, antennas: Sequence[AntennaPlace], facing: int, limits: TrainLimits) -> DistanceTest:
    """Whether solved antennas are as far apart along the line as they are mounted.

    `facing`: front end towards growing (1) or shrinking (-1) s of the edge of the first antenna; 0 finds it, if exactly one fits. The
    statistic of a pair is |measured - mounted| / sqrt(sigma_i^2 + sigma_j^2), that of the train its largest.
    """
    if len(antennas) < 2:
        return DistanceTest(Agreement.TOO_FEW, 0, None)
    line_m = _along_line(track, antennas, limits)
    if isinstance(line_m, Unreachable):
        return DistanceTest(Agreement.UNCONNECTED, 0, None, line_m.why)
    statistic = {sign: _worst(antennas, line_m, sign) for sign in (1, -1, 0)}  # 0: as if all were mounted at one point
    passed = {sign for sign, value in statistic.items() if value <= limits.distance_sigmas}
    facings = [sign for sign in ((facing,) if facing else (1, -1)) if sign in passed]
    if len(facings) == 1:
        return DistanceTest(Agreement.AGREE, facings[0], statistic[facings[0]])
    least = min(statistic[1], statistic[-1])
    if len(facings) == 2:
        return DistanceTest(Agreement.FACING_OPEN, 0, least)
    if 0 in passed:
        return DistanceTest(Agreement.ONE_POINT, 0, statistic[facing] if facing else least)
    if facing and -facing in passed:
        return DistanceTest(Agreement.EXCHANGED, 0, statistic[facing])
    return DistanceTest(Agreement.DISAGREE, 0, statistic[facing] if facing else least)


def front_end(track: TrackMap, antennas: Sequence[AntennaPlace], facing: int, limits: TrainLimits) -> FrontEnd | Unreachable:
    """The front end from one or more solved antennas: the mean of s - facing x, weighted with 1 / sigma^2.

    `facing` is that on the edge of the first antenna. Errors of antennas are largely common (satellites, ionosphere), so that the mean
    of the sigmas is given, which holds whatever the correlation. Unreachable if the map ends, or a switch is open, before the front end.
    """
    line_m = _along_line(track, antennas, limits)
    if isinstance(line_m, Unreachable):
        return line_m
    weights = [1.0 / antenna.sigma_m**2 for antenna in antennas]
    total = sum(weights)
    ahead_m = sum(w * (at_m - facing * a.x_m) for w, at_m, a in zip(weights, line_m, antennas, strict=True)) / total
    sigma_m = sum(w * a.sigma_m for w, a in zip(weights, antennas, strict=True)) / total
    start = _on_edge(track, antennas[0])
    if isinstance(start, Unreachable):
        return start
    place = shifted(track, start.edge_index, start.s_m, start.direction * ahead_m)
    if isinstance(place, Unreachable):
        return place
    turns = start.direction * place.direction
    return FrontEnd(place._replace(direction=turns), facing * turns, sigma_m)


def _along_line(track: TrackMap, antennas: Sequence[AntennaPlace], limits: TrainLimits) -> list[float] | Unreachable:
    """How far each antenna is from the first one in map metres, positive towards growing s of the first one's edge."""
    places = [_on_edge(track, antenna) for antenna in antennas]
    first = places[0]
    arcs_m = [0.0]
    for place in places[1:]:
        if isinstance(first, Unreachable):
            return first
        if isinstance(place, Unreachable):
            return place
        arc_m = arc_between(track, first, place, limits.most_train_length_m)
        if isinstance(arc_m, Unreachable):
            return arc_m
        arcs_m.append(first.direction * arc_m)
    return arcs_m


def _on_edge(track: TrackMap, antenna: AntennaPlace) -> Place | Unreachable:
    """The place of an antenna; where its chord leads a little beyond the end of an edge (a corner), on the edge that follows."""
    s_m = track.edges[antenna.edge_index].s_m
    within_m = min(max(antenna.s_m, float(s_m[0])), float(s_m[-1]))
    return shifted(track, antenna.edge_index, within_m, antenna.s_m - within_m)


def _worst(antennas: Sequence[AntennaPlace], line_m: Sequence[float], facing: int) -> float:
    """The largest statistic of all pairs; not a number where one is not."""
    pairs = combinations(zip(antennas, line_m, strict=True), 2)
    values = [abs(q - p - facing * (b.x_m - a.x_m)) / hypot(a.sigma_m, b.sigma_m) for (a, p), (b, q) in pairs]
    sound = all(isfinite(value) for value in (*values, *(antenna.sigma_m for antenna in antennas)))
    return max(values) if sound else nan
