"""One epoch of the antennas to one place of the train, or why there is none: step 4 of the main path on board."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from math import isfinite
from typing import NamedTuple

import numpy as np

from integrity.assembler import AlignedEpoch
from integrity.errors import ConfigError
from integrity.gnss.atmosphere import Klobuchar
from integrity.gnss.combination import ionosphere_free
from integrity.gnss.ephemeris.content import content_crc32
from integrity.gnss.ephemeris.states import Ephemerides, SatelliteStates, accuracy_m, satellite_states, usable
from integrity.gnss.ephemeris.store import EphemerisStore
from integrity.gnss.observations import ROW_ARRAYS, Ints, ObservationBlock, build_block, layout_of
from integrity.gnss.positioning import Expected, range_accuracy_m, range_sigma_m, state_time_ns
from integrity.gnss.signals import MONITORED_CODES, MONITORED_SYSTEMS, TIME_SCALES, is_pair, pair_codes_of, satellite_of, time_scale_index
from train_client.config import TrainConfig
from train_client.limits import TrainLimits
from train_client.outputs import AntennaFix, Fix, MapPlace
from train_client.positioning.antennas import Agreement, AntennaPlace, DistanceTest, FrontEnd, compare_distances, front_end
from train_client.positioning.constrained import OnTrack, Ranges, Why, paths_of, sight_at, solve_on_track
from train_client.positioning.sections import Located, Search, locate
from train_client.track.locus import Place, Unreachable, arc_between, locus_of, shifted
from train_client.track.track_map import TrackMap

LOST_AFTER = 10  # epochs in a row without a place: then the whole map is searched again
ELSEWHERE = (Why.AT_SWITCH, Why.OFF_MAP_END, Why.NO_CONVERGENCE)  # the way on may lead where hops do not

WORDS = {
    Why.TOO_FEW_SATELLITES: "too few satellites",
    Why.POOR_GEOMETRY: "satellites in poor geometry along the track",
    Why.OFF_MAP_END: "beyond the end of the map",
    Why.AT_SWITCH: "at a switch, and both ways may be",
    Why.NOT_ON_TRACK: "ranges fit no place on the track",
    Why.NO_CONVERGENCE: "no place found near the last one",
}
OF_PAIRS = " with the pairs of frequencies that the ground vouches for"  # what an antenna with one frequency lacks


class _Seen(NamedTuple):
    """One epoch: its ranges, whether they are of pairs, what would be seen where the antennas were last, and of the signals that may not
    be used (S,) why."""

    ranges: Ranges
    in_pairs: bool
    sight: Expected
    reasons: tuple[str, ...]


class _Wanted(NamedTuple):
    """Which sky: of these signals at an epoch, with so many ephemerides and this ionosphere known, seen from these segments."""

    signals: tuple[str, ...]
    contents: tuple[int | None, ...] | None  # CRC-32 of the ephemeris that each is to be used with, None: not at all; None: those sent last
    epoch_ns: int
    arrived: int
    klobuchar: Klobuchar | None
    segment: tuple[int, ...]


class _Sky(NamedTuple):
    """What is known of an epoch before anything is measured: ephemerides (1, S), those `sent_last` and those `chosen`, which the ground
    vouches for; states, what would be seen from the segments."""

    of: _Wanted
    ephemerides: Ephemerides
    sent_last: Ints
    chosen: Ints
    states: SatelliteStates
    sight: Expected


class _Solved(NamedTuple):
    """Antennas on their paths; in words why each (R,) has no place, "" where it has one."""

    on_track: OnTrack
    why: tuple[str, ...]


class FixMemory(NamedTuple):
    """Segments of the last places, one per antenna, or None; where the first antenna was and which way the train faced there; epochs in
    a row without a place."""

    segment: tuple[int, ...] | None = None
    before: tuple[Place, int] | None = None
    unsolved: int = 0


class FixMaker:
    """Makes fixes for one train; remembers where its antennas were and which way it faces."""

    def __init__(self, train: TrainConfig, track: TrackMap, store: EphemerisStore, limits: TrainLimits, memory: FixMemory) -> None:
        self._train = train
        self._track = track
        self._store = store
        self._limits = limits
        _refuse_turned_sides(train, track)
        loci = {facing: [locus_of(track, a.height_m, facing * a.y_m) for a in train.antennas] for facing in (1, -1)}
        self._paths = {facing: paths_of(of) for facing, of in loci.items()}
        self._single = {facing: [paths_of([locus]) for locus in of] for facing, of in loci.items()}
        self._segment = None if memory.segment is None else np.array([memory.segment], dtype=np.int64)  # (1, R)
        self._before, self._unsolved = memory.before, memory.unsolved
        self._sky: _Sky | None = None  # computed last

    def memory(self) -> FixMemory:
        """For a snapshot."""
        return FixMemory(None if self._segment is None else tuple(self._segment[0].tolist()), self._before, self._unsolved)

    def lost(self) -> None:
        """The antennas were silent: where they were before says nothing any more; which way the train faces is still so."""
        self._segment = None

    def fix(self, epoch: AlignedEpoch, signals: Mapping[str, int] | None, mismatched: Collection[str]) -> Fix:
        """The place in an epoch, solved with these `signals`, each by the ephemeris whose content has that CRC-32 (None: all that stand
        alone, by the ephemerides sent last); satellites that are `mismatched` are never used.

        Where there are pairs among them nothing else is used: ranges with and without ionosphere have no common clock.
        """
        seen = self._seen(epoch, signals, mismatched)
        solved = self._solve(seen, 1)
        facing = self._expected_facing(solved)
        if facing == -1 and any(antenna.y_m for antenna in self._train.antennas):
            solved = self._solve(seen, -1)
        places = self._places(solved)
        test = compare_distances(self._track, places, facing, self._limits)
        why = tuple(w + OF_PAIRS if seen.in_pairs and w == WORDS[Why.TOO_FEW_SATELLITES] else w for w in solved.why)
        front = self._front(places, test, facing, why)
        self._remember(solved, places, test)
        return self._result(epoch.epoch_ns, seen, solved, places, test, front)

    def look_ahead(self, epoch_ns: int) -> None:
        """Compute what the next epoch needs while there is time. It changes no bit of a fix, only how soon it is there."""
        if self._sky is not None:
            self._sky_of(self._sky.of._replace(epoch_ns=epoch_ns, segment=self._segments()))

    # ---- satellites

    def _sky_of(self, wanted: _Wanted) -> _Sky:
        """The sky computed last, if it is this one."""
        ephemerides = self._store.ephemerides
        if self._sky is None or self._sky.of != wanted or self._sky.ephemerides is not ephemerides:
            epoch_ns = np.array([wanted.epoch_ns])
            chosen = self._store.choose([satellite_of(s) for s in wanted.signals], epoch_ns, np.array([wanted.arrived]))
            sent_last = chosen.copy()
            for s, crc32 in enumerate(wanted.contents or ()):
                if crc32 is not None and (k := chosen[0, s]) >= 0 and content_crc32(ephemerides[k]) != crc32:
                    chosen[0, s] = self._store.of_content(satellite_of(wanted.signals[s]), crc32, wanted.epoch_ns, wanted.arrived)
            states = satellite_states(ephemerides, chosen, state_time_ns(epoch_ns), wanted.signals)
            sight = sight_at(self._paths[1], np.array([wanted.segment], dtype=np.int64), states, epoch_ns, wanted.klobuchar)
            self._sky = _Sky(wanted, ephemerides, sent_last, chosen, states, sight)
        return self._sky

    def _segments(self) -> tuple[int, ...]:
        """Where geometry is computed: where the antennas were last, or anywhere on the line."""
        return (0,) * len(self._train.antennas) if self._segment is None else tuple(self._segment[0].tolist())

    def _seen(self, epoch: AlignedEpoch, signals: Mapping[str, int] | None, mismatched: Collection[str]) -> _Seen:
        in_pairs = signals is not None and any(map(is_pair, signals))
        codes = pair_codes_of(MONITORED_SYSTEMS) if in_pairs else MONITORED_CODES
        heard = build_block(self._train.antenna_ids, [epoch.epoch_ns], [epoch.rows], layout_of(epoch.rows, codes=codes))
        block = ionosphere_free(heard) if in_pairs else heard
        contents = None if signals is None else tuple(signals.get(signal) for signal in block.signals)
        sky = self._sky_of(_Wanted(block.signals, contents, epoch.epoch_ns, epoch.arrived, epoch.klobuchar, self._segments()))
        train = self._train
        single, pair = (train.sigma_range_m, train.sigma_range_low_m), (train.sigma_range_pair_m, train.sigma_range_pair_low_m)
        a_m, b_m = pair if in_pairs else single
        promised_m = range_accuracy_m(sky.states, accuracy_m(sky.ephemerides, sky.chosen))
        reasons = _why_unused(block, contents, sky, mismatched)
        good = np.array([not reason for reason in reasons], dtype=np.bool_)
        ranges = Ranges(
            block,
            sky.states,
            epoch.klobuchar,
            sigma_m=range_sigma_m(sky.sight.el_rad, a_m, b_m, promised_m[:, None, :]),
            used=good & np.isfinite(block.pseudorange_m) & ~(block.cn0_dbhz < self._limits.min_cn0_dbhz),
            system_of=np.array([time_scale_index(s) for s in block.satellites], dtype=np.int64),
            n_systems=len(TIME_SCALES),
        )
        return _Seen(ranges, in_pairs, sky.sight, reasons)

    # ---- antennas

    def _solve(self, seen: _Seen, facing: int) -> _Solved:
        """From where the antennas were; over the whole map where that is not known, or where the way on may be elsewhere."""
        if self._segment is None:
            return self._search(seen.ranges, facing)
        found = solve_on_track(seen.ranges, self._paths[facing], self._segment, self._limits, seen.sight if facing == 1 else None)
        why = [Why(w) for w in found.why[0].tolist()]
        if any(w in ELSEWHERE for w in why):
            return self._search(seen.ranges, facing)
        return _Solved(found, tuple("" if w is Why.SOLVED else WORDS[w] for w in why))

    def _search(self, ranges: Ranges, facing: int) -> _Solved:
        """Each antenna over the whole map; then once more from where they were found, as from epoch to epoch."""
        segment = np.zeros((1, len(self._train.antennas)), dtype=np.int64)
        words: list[str] = []
        for r, paths in enumerate(self._single[facing]):
            located = locate(_of_antenna(ranges, r), paths, self._limits)
            if located.outcome is Search.LOCATED:
                segment[0, r] = located.hypotheses[0].segment
            words.append(self._why_not(located, facing, r))
        found = solve_on_track(ranges, self._paths[facing], segment, self._limits)
        why = [word or WORDS.get(Why(w), "") for word, w in zip(words, found.why[0].tolist(), strict=True)]
        return _Solved(found, tuple(why))

    def _why_not(self, located: Located, facing: int, r: int) -> str:
        if located.outcome is Search.LOCATED:
            return ""
        if located.outcome is Search.REFUSED:
            return WORDS[located.why]
        locus = self._paths[facing].loci[r]
        places = [f"{self._track.edges[locus.edge[h.segment]].id} {locus.s_m[h.segment]:.0f} m" for h in located.hypotheses]
        return f"{len(places)} places fit: {', '.join(places[:4])}"

    def _places(self, solved: _Solved) -> list[AntennaPlace]:
        """Of the antennas that have one."""
        found, paths = solved.on_track, self._paths[1]
        places = []
        for r, antenna in enumerate(self._train.antennas):
            if solved.why[r]:
                continue
            locus, segment, d_m = paths.loci[r], int(found.segment[0, r]), float(found.d_m[0, r])
            s_m = float(locus.s_m[segment] + d_m * locus.ds_dm[segment])
            places.append(AntennaPlace(antenna.x_m, int(locus.edge[segment]), s_m, float(found.sigma_m[0, r])))
        return places

    # ---- the train

    def _expected_facing(self, solved: _Solved) -> int:
        """On the edge where the first antenna is now: as before, carried along the way; at first as the train file says."""
        if self._before is None or solved.why[0]:
            return self._train.facing if self._before is None else self._before[1]
        then, facing = self._before
        now = self._places(solved)[0]
        if now.edge_index == then.edge_index:
            return facing
        arc_m = arc_between(self._track, then, Place(now.edge_index, now.s_m), self._limits.most_train_length_m)
        reached = arc_m if isinstance(arc_m, Unreachable) else shifted(self._track, then.edge_index, then.s_m, arc_m)
        return self._train.facing if isinstance(reached, Unreachable) else facing * reached.direction

    def _front(self, places: Sequence[AntennaPlace], test: DistanceTest, facing: int, why: tuple[str, ...]) -> FrontEnd | str:
        """The front end, or in words why there is none: every antenna must have a place, and the distances between them must be right."""
        missing = [f"{antenna.id}: {word}" for antenna, word in zip(self._train.antennas, why, strict=True) if word]
        if missing:
            return "; ".join(missing)
        if len(places) > 1 and test.agreement is not Agreement.AGREE:
            told = "" if test.statistic is None else f" ({test.statistic:.2f} sigmas, at most {self._limits.distance_sigmas:.2f})"
            return f"{test.agreement.value}{told}{': ' if test.detail else ''}{test.detail}"
        if not (test.facing or facing):
            return "one antenna alone does not tell which way the train faces: say so in the train file (facing)"
        front = front_end(self._track, places, test.facing or facing, self._limits)
        return front.why if isinstance(front, Unreachable) else front

    def _remember(self, solved: _Solved, places: Sequence[AntennaPlace], test: DistanceTest) -> None:
        if any(solved.why):
            self._unsolved += 1
            if self._unsolved >= LOST_AFTER:
                self._segment = None
            return
        self._unsolved, self._segment = 0, solved.on_track.segment
        if test.facing or len(places) == 1:
            facing = test.facing or self._expected_facing(solved)
            self._before = (Place(places[0].edge_index, places[0].s_m), facing)

    def _result(
        self, epoch_ns: int, seen: _Seen, solved: _Solved, places: Sequence[AntennaPlace], test: DistanceTest, front: FrontEnd | str
    ) -> Fix:
        signals, used = seen.ranges.block.signals, seen.ranges.used.any(axis=(0, 1))
        distance_m = self._distance_m(places)
        unplaced = Fix(
            gps_time_ns=epoch_ns,
            front=None,
            rear=None,
            sigma_m=None,
            facing=0,
            antennas=self._antenna_fixes(solved),
            distance_m=distance_m,
            distance_expected_m=None if distance_m is None else abs(self._train.antennas[-1].x_m - self._train.antennas[0].x_m),
            used=tuple(signals[s] for s in np.flatnonzero(used)),
            unused=tuple((s, why) for s, why in zip(signals, seen.reasons, strict=True) if why),
            reasons=(),
        )
        if isinstance(front, str):
            return replace(unplaced, reasons=(front,))
        rear = shifted(self._track, front.place.edge_index, front.place.s_m, -front.facing * self._train.length_m)
        if isinstance(rear, Unreachable):
            return replace(unplaced, reasons=(f"rear end: {rear.why}",))
        ends = self._map_place(front.place), self._map_place(rear)
        return replace(unplaced, front=ends[0], rear=ends[1], sigma_m=front.sigma_m, facing=front.facing)

    def _distance_m(self, places: Sequence[AntennaPlace]) -> float | None:
        """Between the first and the last antenna as solved, along the track."""
        if len(places) < max(2, len(self._train.antennas)):
            return None
        first, last = (Place(p.edge_index, p.s_m) for p in (places[0], places[-1]))
        arc_m = arc_between(self._track, first, last, self._limits.most_train_length_m)
        return None if isinstance(arc_m, Unreachable) else abs(arc_m)

    def _antenna_fixes(self, solved: _Solved) -> tuple[AntennaFix, ...]:
        found = solved.on_track
        places = iter(self._places(solved))
        fixes = []
        for r, antenna in enumerate(self._train.antennas):
            place = None if solved.why[r] else next(places)
            fixes.append(
                AntennaFix(
                    antenna.id,
                    place=None if place is None else MapPlace(self._track.edges[place.edge_index].id, place.s_m),
                    sigma_m=None if place is None else place.sigma_m,
                    tpdop=_number(found.tpdop[0, r]),
                    satellites=int(found.n_used[0, r]),
                    residual=_number(found.sse[0, r]),
                    residual_threshold=_number(float(self._limits.residual_limit(found.dof[0, r]))),
                    why=solved.why[r],
                )
            )
        return tuple(fixes)

    def _map_place(self, place: Place) -> MapPlace:
        return MapPlace(self._track.edges[place.edge_index].id, place.s_m)


def _refuse_turned_sides(train: TrainConfig, track: TrackMap) -> None:
    """Right of the track is as seen towards growing s: where edges run against each other, an antenna off the middle would change sides."""
    aside = [antenna.id for antenna in train.antennas if antenna.y_m]
    turned = [(end, other) for end, entered in track.continuations.items() for other in entered if end.last == other.last]
    if aside and turned:
        a, b = (track.edges[end.edge].id for end in turned[0])
        raise ConfigError(
            f"antenna {aside[0]} is mounted beside the track's middle (y_m), and edges {a} and {b} of map {track.id} run against each "
            "other: turn one of them round in the map"
        )


def _of_antenna(ranges: Ranges, r: int) -> Ranges:
    """Of antenna r alone, one epoch: sigmas and what may be used (S,)."""
    block = ranges.block
    arrays = {name: getattr(block, name)[:, r : r + 1] for name in ("receive_time_ns", *ROW_ARRAYS)}
    alone = replace(block, receivers=block.receivers[r : r + 1], **arrays)
    return ranges._replace(block=alone, sigma_m=ranges.sigma_m[0, r], used=ranges.used[0, r])


def _why_unused(block: ObservationBlock, contents: Sequence[int | None] | None, sky: _Sky, mismatched: Collection[str]) -> tuple[str, ...]:
    """Of each signal (S,), "" where it may be used: one signal a satellite."""
    heard, vouched_for = (sky.sent_last[0] >= 0).tolist(), (sky.chosen[0] >= 0).tolist()
    healthy = (usable(sky.ephemerides, sky.sent_last) & usable(sky.ephemerides, sky.chosen))[0].tolist()
    reasons: list[str] = []
    taken = ""
    for s, satellite in enumerate(block.satellites):
        if contents is not None and contents[s] is None:
            reasons.append("not monitored by the ground, or excluded")
        elif satellite in mismatched:
            reasons.append("ephemeris_mismatch: the antennas have heard different navigation messages")
        elif not heard[s]:
            reasons.append("no ephemeris that all antennas have heard")
        elif not vouched_for[s]:
            reasons.append("another ephemeris than the one that the ground vouches for")
        elif not healthy[s]:
            reasons.append("unhealthy by its own message")
        elif satellite == taken:
            reasons.append("another signal of the satellite is used")
        else:
            reasons.append("")
            taken = satellite
    return tuple(reasons)


def _number(value: float) -> float | None:
    return float(value) if isfinite(value) else None
