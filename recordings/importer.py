"""Three receivers' files become one stream of events: epochs lined up, ephemerides entered when they were transmitted or received.

What does not line up is counted; of RINEX it is also dropped, while the bytes of a UBX log are all kept, as a station would have had
them. The host's monotonic clock of an import is GPS time: nobody recorded another one. Rows of RINEX arrive at their nominal epoch,
pieces of a log at the time tag of the measurements that end them.
"""

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple, TypeVar

from integrity.assembler import nominal_epoch_ns
from integrity.config import SiteConfig
from integrity.errors import DecodeError
from integrity.events import EphemerisReceived, Event, IonosphereReceived, ObservationsReceived, RawBytes, Tick
from integrity.gnss.gps_time import NS_PER_S, format_utc, leap_seconds_at_gps, utc_from_gps
from integrity.gnss.observations import ObservationRow
from integrity.limits import alignment_tolerance_ns
from recordings.rinex.navigation import NavigationFile
from recordings.rinex.observation import ObservationFile, read_observations
from recordings.ubx_files import Piece, UbxLog, is_ubx, read_ubx, words_of

WORDS_BEFORE_NS = 780 * NS_PER_S  # of a window: the ionosphere comes every 750 s, and older pages make no ephemeris

Counts = dict[str, dict[str, int]]  # receiver -> reason -> rows, fields, frames or bytes
File = ObservationFile | UbxLog
Row = ObservationRow | Piece
AnyRow = TypeVar("AnyRow", ObservationRow, Piece, Row)


@dataclass(frozen=True)
class Imported:
    """Events in the order in which a station would have met them, and what is not decided on, per receiver and reason.

    `dropped` is not among the events; `passed_over` stands in the bytes of a log, as they came: what cannot be decoded, and measurements
    that do not line up. `warnings` are for people.
    """

    events: tuple[Event, ...]
    epochs: int
    dropped: Counts
    passed_over: Counts
    warnings: tuple[str, ...]


class _Arrival(NamedTuple):
    """An event at its place: by time, and at one time by `rank`: navigation, receivers in their order, tick, what came after it."""

    mono_ns: int
    rank: int
    event: Event


def read_files(paths: Sequence[Path], receiver: str) -> list[File]:
    """The files of one receiver, RINEX or UBX by what is in them, plain or gzipped; all its UBX files are one log.

    DecodeError for a file that is neither, or that cannot be read safely; OSError where it cannot be opened.
    """
    ubx = [path for path in paths if is_ubx(path)]
    rinex: list[File] = [read_observations(path, receiver) for path in paths if path not in ubx]
    return [*rinex, read_ubx(ubx, receiver)] if ubx else rinex


def import_files(
    site: SiteConfig,
    observations: Mapping[str, Sequence[File]],
    navigation: Sequence[NavigationFile],
    start_ns: int | None = None,
    end_ns: int | None = None,
) -> Imported:
    """Events of the epochs between two GPS times (start included, end not); DecodeError where nothing can be decided.

    Of a UBX log the navigation words of the 13 minutes before the start are kept, which a station would have known then. They arrive
    at the start.
    """
    counters = _Counters({r: Counter() for r in site.receiver_names}, {r: Counter() for r in site.receiver_names})
    rows: dict[str, dict[int, Row]] = {}
    for receiver in site.receiver_names:
        for file in observations[receiver]:
            counters.dropped[receiver].update(file.dropped if isinstance(file, UbxLog) else file.problems)
            counters.passed_over[receiver].update(file.passed_over if isinstance(file, UbxLog) else {})
        in_window = [row for file in observations[receiver] for row in _between(_rows(file), site, start_ns, end_ns)]
        if not in_window:
            raise DecodeError(f"receiver {receiver}: no epoch between the times asked for; {_spans(observations, site)}")
        rows[receiver] = _on_grid(in_window, receiver, site, counters)

    epochs = sorted(set.intersection(*(set(by_epoch) for by_epoch in rows.values())))
    if not epochs:
        interval_s = site.epoch_interval_ns / NS_PER_S
        raise DecodeError(f"no epoch is common to all receivers at the site's interval of {interval_s:g} s: {_spans(observations, site)}")
    common = set(epochs)
    for receiver, by_epoch in rows.items():
        for epoch_ns in by_epoch.keys() - common:
            counters.of(receiver, by_epoch[epoch_ns])["no partner in the other receivers"] += 1

    first_ns = min(_arrival_ns(by_epoch[epochs[0]], site) for by_epoch in rows.values())
    ticks_ns = [max(_arrival_ns(by_epoch[epoch_ns], site) for by_epoch in rows.values()) for epoch_ns in epochs]
    arrivals = [_Arrival(event.mono_ns, 0, event) for event in _navigation_events(observations, navigation, first_ns, epochs[-1])]
    for rank, receiver in enumerate(site.receiver_names, 1):
        aligned = [rows[receiver][epoch_ns] for epoch_ns in epochs]
        arrivals += [_Arrival(e.mono_ns, rank, e) for e in (_observed(row, site) for row in aligned if isinstance(row, ObservationRow))]
        for log in observations[receiver]:
            if isinstance(log, UbxLog):
                arrivals += _bytes_of(log, receiver, rank, ticks_ns, site, start_ns, end_ns)
    arrivals += [_Arrival(t, len(rows) + 1, Tick(t, utc_from_gps(t), None)) for t in _with_silences(ticks_ns, site)]
    arrivals.sort(key=lambda arrival: (arrival.mono_ns, arrival.rank))
    return Imported(
        events=tuple(arrival.event for arrival in arrivals),
        epochs=len(epochs),
        dropped=_counts(counters.dropped),
        passed_over=_counts(counters.passed_over),
        warnings=_warnings(observations, navigation, epochs[0]),
    )


class _Counters(NamedTuple):
    """By receiver and reason."""

    dropped: dict[str, Counter[str]]
    passed_over: dict[str, Counter[str]]

    def of(self, receiver: str, row: Row) -> Counter[str]:
        """Where a row that does not line up is counted."""
        return self.dropped[receiver] if isinstance(row, ObservationRow) else self.passed_over[receiver]


def _on_grid(rows: Sequence[Row], receiver: str, site: SiteConfig, counters: _Counters) -> dict[int, Row]:
    """Rows by epoch of the site, of each the first."""
    by_epoch: dict[int, Row] = {}
    for row in rows:
        epoch_ns = _epoch_ns(row, site)
        if epoch_ns is None:
            counters.of(receiver, row)["between the site's epochs"] += 1
        elif epoch_ns in by_epoch:
            counters.of(receiver, row)["epoch repeated"] += 1
        else:
            by_epoch[epoch_ns] = row
    return by_epoch


def _observed(row: ObservationRow, site: SiteConfig) -> ObservationsReceived:
    return ObservationsReceived(_arrival_ns(row, site), row)


def _rows(file: File) -> Sequence[Row]:
    return file.pieces if isinstance(file, UbxLog) else file.rows


def _epoch_ns(row: Row, site: SiteConfig) -> int | None:
    """The site's epoch at which a row was measured, or None."""
    epoch_ns = nominal_epoch_ns(row.receive_time_ns, site.epoch_interval_ns)
    return epoch_ns if abs(row.receive_time_ns - epoch_ns) <= alignment_tolerance_ns(site.epoch_interval_ns) else None


def _arrival_ns(row: Row, site: SiteConfig) -> int:
    """When an aligned row is handed on."""
    return row.receive_time_ns if isinstance(row, Piece) else nominal_epoch_ns(row.receive_time_ns, site.epoch_interval_ns)


def _between(rows: Iterable[AnyRow], site: SiteConfig, start_ns: int | None, end_ns: int | None) -> Iterator[AnyRow]:
    """Rows of a window, of whole epochs: a tag shortly before the start belongs to the first epoch, as do those after it."""
    for row in rows:
        epoch_ns = _epoch_ns(row, site)
        gps_ns = row.receive_time_ns if epoch_ns is None else epoch_ns
        if (start_ns is None or gps_ns >= start_ns) and (end_ns is None or gps_ns < end_ns):
            yield row


def _bytes_of(
    log: UbxLog, receiver: str, rank: int, ticks_ns: Sequence[int], site: SiteConfig, start_ns: int | None, end_ns: int | None
) -> Iterator[_Arrival]:
    """The pieces of a window, the words of the time before it in front of them, and the tail of the log behind the epoch it followed."""
    pieces = list(_between(log.pieces, site, start_ns, end_ns))
    if not pieces:
        return
    first_ns, last_ns = pieces[0].receive_time_ns, pieces[-1].receive_time_ns
    before = [piece for piece in log.pieces if first_ns - WORDS_BEFORE_NS <= piece.receive_time_ns < first_ns]
    if words := words_of(before):
        yield _Arrival(first_ns, rank, RawBytes(first_ns, receiver, words))
    for piece in pieces:
        yield _Arrival(piece.receive_time_ns, rank, RawBytes(piece.receive_time_ns, receiver, piece.data))
    if log.tail and pieces[-1] is log.pieces[-1]:
        decided_ns = next((t for t in ticks_ns if t >= last_ns), last_ns)
        after_tick = len(site.receivers) + 2
        yield _Arrival(decided_ns, after_tick, RawBytes(decided_ns, receiver, log.tail))


def _navigation_events(
    observations: Mapping[str, Sequence[File]], navigation: Sequence[NavigationFile], first_ns: int, last_ns: int
) -> list[EphemerisReceived | IonosphereReceived]:
    """Ephemerides of files by time of transmission (the first epoch for those sent before it), each once; DecodeError when none can serve.

    Without files, words in the logs must serve.
    """
    if not navigation and any(isinstance(file, UbxLog) and file.words for group in observations.values() for file in group):
        return []
    ephemerides = {eph for file in navigation for eph in file.ephemerides}
    serving = [
        eph
        for eph in sorted(ephemerides, key=lambda eph: (eph.transmission_ns, eph.satellite, eph.toe_ns, eph.issue))
        if eph.transmission_ns <= last_ns and eph.toe_ns + eph.fit_half_s * NS_PER_S >= first_ns
    ]
    if not serving:
        times = sorted(eph.toe_ns for eph in ephemerides)
        span = f"{format_utc(times[0])} to {format_utc(times[-1])}" if times else "nothing"
        covered = f"the navigation files cover {span}" if navigation else "the logs hold no navigation words (RXM-SFRBX)"
        raise DecodeError(
            f"no ephemeris serves the epochs {format_utc(first_ns)} to {format_utc(last_ns)}: {covered}; "
            "give the navigation file of that day with --nav"
        )
    klobuchar = next((file.klobuchar for file in navigation if file.klobuchar is not None), None)
    events: list[EphemerisReceived | IonosphereReceived] = [] if klobuchar is None else [IonosphereReceived(first_ns, klobuchar)]
    return events + [EphemerisReceived(max(eph.transmission_ns, first_ns), eph) for eph in serving]


def _with_silences(ticks_ns: Sequence[int], site: SiteConfig) -> list[int]:
    """The tick of each epoch, and in a gap one when silence is noticed."""
    silence_ns = max(2 * site.epoch_interval_ns, 2 * NS_PER_S)
    return [*ticks_ns, *(before + silence_ns + 1 for before, after in pairwise(ticks_ns) if after - before > silence_ns)]


def _counts(counters: Mapping[str, Counter[str]]) -> Counts:
    return {receiver: {reason: n for reason, n in sorted(counter.items()) if n} for receiver, counter in counters.items()}


def _spans(observations: Mapping[str, Sequence[File]], site: SiteConfig) -> str:
    parts = []
    for receiver in site.receiver_names:
        times = sorted(row.receive_time_ns for file in observations[receiver] for row in _rows(file))
        if not times:
            parts.append(f"{receiver} has no epochs")
            continue
        steps = sorted(b - a for a, b in pairwise(times) if b > a)
        every = f" every {steps[len(steps) // 2] / NS_PER_S:g} s" if steps else ""
        parts.append(f"{receiver} has {len(times)} from {format_utc(times[0])} to {format_utc(times[-1])}{every}")
    return "; ".join(parts)


def _warnings(observations: Mapping[str, Sequence[File]], navigation: Sequence[NavigationFile], gps_ns: int) -> tuple[str, ...]:
    expected = leap_seconds_at_gps(gps_ns)
    files = [file for group in observations.values() for file in group]
    logs = [file for file in files if isinstance(file, UbxLog)]
    headed: list[ObservationFile | NavigationFile] = [*(file for file in files if isinstance(file, ObservationFile)), *navigation]
    found = [warning for log in logs for warning in log.warnings]
    found += [
        f"{f.path}: header says {f.leap_seconds} leap seconds, the table says {expected}; the table is used"
        for f in headed
        if f.leap_seconds is not None and f.leap_seconds != expected
    ]
    if all(file.klobuchar is None for file in navigation) and not any(log.words for log in logs):
        found.append("no navigation file has Klobuchar terms: the ionosphere stays in the ranges, several metres common to all receivers")
    return tuple(found)
