"""What the demo's two recordings tell, in seconds of the story: what was heard of the station, what the train made of it, where it was.

The station counts as heard when its health reached the train: a station that decides late, or never again, is silent for everybody.
"""

import math
from bisect import bisect_right
from collections.abc import Hashable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import groupby, pairwise
from typing import NamedTuple, TypeVar

from google.protobuf.message import DecodeError

from integrity.errors import RecordingError
from integrity.limits import derive
from integrity.messages import wayside_pb2 as pb
from integrity.messages.verification import CAUSES
from integrity.states import Cause
from integrity.triangle import ReferenceTriangle, reference_triangle
from recordings.explain import WORDS
from recordings.reader import Contents
from recordings.replay import recorded_site
from train_client.replay import started
from train_client.track.checks import load_map
from train_client.track.track_map import TrackMap

SILENT_AFTER_S = 1.0  # a station without epochs says so each second
CONFIRMED_FOR_S = 1.0
SILENT, DEAD = "SILENT", "DEAD"


class Heard(NamedTuple):
    """Health, when it reached the train, and the record of why."""

    story_s: float
    health: pb.Health
    report: pb.EpochReport


class Ridden(NamedTuple):
    """What the train said, and when."""

    story_s: float
    position: pb.TrainPosition


class Spell(NamedTuple):
    """From when to when the same was said: a word for the state, and lines that say more."""

    from_s: float
    to_s: float
    word: str
    lines: tuple[str, ...] = ()


class Episode(NamedTuple):
    """Something that happened: a name, and its numbers."""

    from_s: float
    to_s: float
    name: str
    numbers: str


@dataclass(frozen=True, eq=False)
class Told:
    """All of it. `station` and `train` cover the story from 0 to `end_s` without gaps."""

    site_id: str
    train_id: str
    triangle: ReferenceTriangle
    radius_m: float
    track: TrackMap
    end_s: float
    heard: tuple[Heard, ...]
    ridden: tuple[Ridden, ...]
    station: tuple[Spell, ...]
    train: tuple[Spell, ...]
    episodes: tuple[Episode, ...]


class _Point(NamedTuple):
    """Something said: points that follow each other with the same `key` are one spell, with the lines of the first."""

    story_s: float
    key: Hashable
    word: str
    lines: tuple[str, ...]


_Timed = TypeVar("_Timed", Heard, Ridden, Spell)


def told(station: Contents, train: Contents) -> Told:
    """RecordingError where the recordings have no epoch, or none of the station's health reached the train."""
    site, head = recorded_site(station).config, started(train)
    reports = {e.message.gps_time_ns: e.message for e in station.entries if isinstance(e.message, pb.EpochReport)}
    positions = [e.message for e in train.entries if isinstance(e.message, pb.TrainPosition)]
    start_gps_ns = min(reports, default=0)
    begun = [p.mono_ns - (p.gps_time_ns - start_gps_ns) for p in positions if p.HasField("gps_time_ns")]
    if not reports or not begun:
        raise RecordingError(f"{station.path}, {train.path}: a station and a train with epochs are needed; record a demo of 10 s and more")
    ridden = tuple(Ridden((p.mono_ns - min(begun)) / 1e9, p) for p in positions)
    heard = tuple(_heard(station, train, reports, min(begun)))
    if not heard:
        raise RecordingError(f"{train.path}: no health of {station.path} in it; give the two recordings of one demo")
    end_s = ridden[-1].story_s
    triangle = reference_triangle(site)
    said = tuple(_spells(_said(heard, end_s), end_s))
    return Told(
        site_id=site.site_id,
        train_id=head.train,
        triangle=triangle,
        radius_m=derive(site, triangle).radius_m,
        track=load_map(head.map_json, f"{train.path}: recorded map"),
        end_s=end_s,
        heard=heard,
        ridden=ridden,
        station=said,
        train=tuple(_spells(_trusted(ridden), end_s)),
        episodes=tuple(sorted([*_episodes(heard, said), *_refusals(ridden)])),
    )


def latest(of: Sequence[_Timed], story_s: float) -> _Timed:
    """The last one that had begun by then; before the first, the first."""
    return of[max(bisect_right(of, story_s, key=lambda one: one[0]) - 1, 0)]


def confirmed_now(position: pb.TrainPosition) -> bool:
    """Whether the place confirmed last is where the train is: trusted, and at most a few epochs old."""
    age_ns = position.gps_time_ns - position.last_confirmed_gps_ns if position.HasField("gps_time_ns") else 0
    return position.trust == pb.TRUST_NORMAL and position.HasField("last_confirmed") and age_ns <= CONFIRMED_FOR_S * 1e9


def off_m(vertex: pb.Vertex) -> float:
    """How far a solved vertex is from its surveyed point; infinite where there is none."""
    return math.hypot(vertex.east_m, vertex.north_m) if vertex.HasField("east_m") else math.inf


def _heard(station: Contents, train: Contents, reports: dict[int, pb.EpochReport], start_mono_ns: int) -> Iterator[Heard]:
    """What the station said, in its order: other messages, and older ones after younger, were forged or replayed."""
    last_sequence = 0
    said = {e.message.sequence: e.message for e in station.entries if isinstance(e.message, pb.Health)}
    for entry in train.entries:
        if not isinstance(entry.message, pb.HealthReceived):
            continue
        try:
            health = pb.Health.FromString(pb.SignedHealth.FromString(entry.message.data).health)
        except DecodeError:
            continue
        if health.sequence > last_sequence and said.get(health.sequence) == health and health.gps_time_ns in reports:
            last_sequence = health.sequence
            yield Heard((entry.message.mono_ns - start_mono_ns) / 1e9, health, reports[health.gps_time_ns])


def _said(heard: Sequence[Heard], end_s: float) -> Iterator[_Point]:
    """Of the station, and its silence; the last one is for ever."""
    for one, after_s in zip(heard, [*(h.story_s for h in heard[1:]), end_s], strict=True):
        health, clean = one.health, one.report.verdict_state == pb.NORMAL
        key = (health.state, health.cause, *health.subjects, *health.excluded_satellites, clean)
        yield _Point(one.story_s, key, pb.State.Name(health.state), (_why(health), _numbers(one)))
        if after_s - one.story_s > SILENT_AFTER_S:
            word, more = (DEAD, "its recording ends there") if one is heard[-1] else (SILENT, "it decides nothing")
            yield _Point(one.story_s, word, word, (f"not a word since {one.story_s:.1f} s", more))


def _why(health: pb.Health) -> str:
    cause = CAUSES[health.cause]
    if cause is not Cause.NONE:
        return WORDS[cause] + (f" ({', '.join(health.subjects)})" if health.subjects else "")
    if health.excluded_satellites:
        return f"without satellite {', '.join(health.excluded_satellites)}, which is wrong"
    return "every point inside its circle"


def _numbers(one: Heard) -> str:
    """What weighs most in the verdict, or against an excluded satellite."""
    report, health = one.report, one.health
    if report.HasField("statistic") and report.HasField("threshold") and report.check:
        return f"{report.check} {report.statistic:.4g} > {report.threshold:.4g}"
    if health.state != pb.NORMAL and report.verdict_state == pb.NORMAL and CAUSES[health.cause] is not Cause.NOT_READY:
        return "clean again: trust comes back slowly"
    return "; ".join(f"{x.check} {x.statistic:.4g} > {x.threshold:.4g}" for x in report.exclusions)


def _trusted(ridden: Iterable[Ridden]) -> Iterator[_Point]:
    """What the train made of it."""
    for one in ridden:
        word = pb.TrustState.Name(one.position.trust).removeprefix("TRUST_")
        yield _Point(one.story_s, word, word, (_TRUST_WORDS.get(word, "not confirmed by the station: GNSS is not used"),))


_TRUST_WORDS = {
    "NORMAL": "the station vouches: GNSS is used",
    "STALE": "its last message is valid no longer: GNSS is not used",
    "NO_COMMS": "nothing comes: GNSS is not used",
}


def _spells(points: Iterable[_Point], end_s: float) -> Iterator[Spell]:
    """From each change to the next; the first from the beginning of the story, the last to its end."""
    firsts = [next(some) for _, some in groupby(points, lambda point: point.key)]
    froms = [0.0, *(first.story_s for first in firsts[1:]), end_s]
    for first, (from_s, to_s) in zip(firsts, pairwise(froms), strict=True):
        yield Spell(from_s, to_s, first.word, first.lines)


def _episodes(heard: Sequence[Heard], station: Sequence[Spell]) -> Iterator[Episode]:
    """Named from changes of the station's cause, of what it excludes, and of its silence."""
    for (name, silent), some in groupby(_named(heard, station), lambda named: named[1:]):
        spells = [spell for spell, *_ in some]
        if name:
            numbers = f"since {spells[0].from_s:.1f} s" if silent else spells[0].lines[1]
            yield Episode(spells[0].from_s, spells[-1].to_s, name, numbers)


def _named(heard: Sequence[Heard], station: Sequence[Spell]) -> Iterator[tuple[Spell, str, bool]]:
    """Spells with their names. A satellite that is excluded is news until something else happens; that it stays out is none."""
    before, news = frozenset[str](), frozenset[str]()
    for spell in station:
        health = latest(heard, spell.from_s).health
        out = frozenset(health.excluded_satellites)
        news, before = (out - before) | (out & news), out
        name, silent = _name(health, spell.word, news)
        if silent or CAUSES[health.cause] is not Cause.NONE:
            news = frozenset()
        yield spell, name, silent


def _name(health: pb.Health, word: str, news: frozenset[str]) -> tuple[str, bool]:
    """A short name, empty where all is well or nothing is new; and whether the station is silent."""
    if word in (SILENT, DEAD):
        return word.lower(), True
    match CAUSES[health.cause]:
        case Cause.NONE:
            return " ".join(f"{satellite} excluded" for satellite in sorted(news)), False
        case Cause.NOT_READY:
            return "starting", False
        case Cause.RECEIVER | Cause.SATELLITE as cause:
            return f"{cause} {', '.join(health.subjects)}", False
        case cause:
            return cause.replace("_", " "), False


def _refusals(ridden: Sequence[Ridden]) -> Iterator[Episode]:
    """From the first message that was not believed to the last."""
    growing = [after for before, after in pairwise(ridden) if after.position.refused_messages > before.position.refused_messages]
    if growing:
        count = growing[-1].position.refused_messages
        yield Episode(growing[0].story_s, growing[-1].story_s, "forged", f"{count} refused")
