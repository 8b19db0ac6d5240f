"""Three receivers' files become one stream of events: epochs lined up, ephemerides entered when they were transmitted.

What does not line up is dropped and counted. The host's monotonic clock of an import is GPS time: nobody recorded another one.
"""

from collections import Counter, deque
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

from integrity.assembler import nominal_epoch_ns
from integrity.config import SiteConfig
from integrity.errors import DecodeError
from integrity.events import EphemerisReceived, Event, IonosphereReceived, ObservationsReceived, Tick
from integrity.gnss.gps_time import NS_PER_S, format_utc, leap_seconds_at_gps, utc_from_gps
from integrity.gnss.observations import ObservationRow
from integrity.limits import alignment_tolerance_ns
from recordings.rinex.navigation import NavigationFile
from recordings.rinex.observation import ObservationFile

Counts = dict[str, dict[str, int]]  # receiver -> reason -> rows or fields dropped


@dataclass(frozen=True)
class Imported:
    """Events in the order in which a station would have met them; `dropped` per receiver and reason; `warnings` for people."""

    events: tuple[Event, ...]
    epochs: int
    dropped: Counts
    warnings: tuple[str, ...]


def import_files(
    site: SiteConfig,
    observations: Mapping[str, Sequence[ObservationFile]],
    navigation: Sequence[NavigationFile],
    start_ns: int | None = None,
    end_ns: int | None = None,
) -> Imported:
    """Events of the aligned epochs between two GPS times (start included, end not); DecodeError where nothing can be decided."""
    dropped: dict[str, Counter[str]] = {r: Counter() for r in site.receiver_names}
    rows: dict[str, dict[int, ObservationRow]] = {}
    for receiver in site.receiver_names:
        for file in observations[receiver]:
            dropped[receiver].update(file.problems)
        in_window = [
            row
            for file in observations[receiver]
            for row in file.rows
            if (start_ns is None or row.receive_time_ns >= start_ns) and (end_ns is None or row.receive_time_ns < end_ns)
        ]
        rows[receiver] = _on_grid(in_window, site.epoch_interval_ns, dropped[receiver])
        if not in_window:
            raise DecodeError(f"receiver {receiver}: no epoch between the times asked for; {_spans(observations, site)}")

    epochs = sorted(set.intersection(*(set(by_epoch) for by_epoch in rows.values())))
    if not epochs:
        interval_s = site.epoch_interval_ns / NS_PER_S
        raise DecodeError(f"no epoch is common to all receivers at the site's interval of {interval_s:g} s: {_spans(observations, site)}")
    for receiver, by_epoch in rows.items():
        dropped[receiver]["no partner in the other receivers"] += len(by_epoch) - len(epochs)

    before_first = _navigation_events(navigation, epochs[0], epochs[-1])
    events = _merged(site, epochs, rows, before_first)
    counts = {receiver: {reason: n for reason, n in sorted(c.items()) if n} for receiver, c in dropped.items()}
    return Imported(tuple(events), len(epochs), counts, _warnings(observations, navigation, epochs[0]))


def _on_grid(rows: Sequence[ObservationRow], interval_ns: int, dropped: Counter[str]) -> dict[int, ObservationRow]:
    tolerance_ns = alignment_tolerance_ns(interval_ns)
    by_epoch: dict[int, ObservationRow] = {}
    for row in rows:
        epoch_ns = nominal_epoch_ns(row.receive_time_ns, interval_ns)
        if abs(row.receive_time_ns - epoch_ns) > tolerance_ns:
            dropped["between the site's epochs"] += 1
        elif epoch_ns in by_epoch:
            dropped["epoch repeated"] += 1
        else:
            by_epoch[epoch_ns] = row
    return by_epoch


def _navigation_events(navigation: Sequence[NavigationFile], first_ns: int, last_ns: int) -> list[tuple[int, Event]]:
    """Ephemerides by time of transmission (the first epoch for those sent before it), each once; DecodeError when none can serve."""
    ephemerides = {eph for file in navigation for eph in file.ephemerides}
    serving = [
        eph
        for eph in sorted(ephemerides, key=lambda eph: (eph.transmission_ns, eph.satellite, eph.toe_ns, eph.issue))
        if eph.transmission_ns <= last_ns and eph.toe_ns + eph.fit_half_s * NS_PER_S >= first_ns
    ]
    if not serving:
        times = sorted(eph.toe_ns for eph in ephemerides)
        span = f"{format_utc(times[0])} to {format_utc(times[-1])}" if times else "nothing"
        raise DecodeError(
            f"no ephemeris serves the epochs {format_utc(first_ns)} to {format_utc(last_ns)}: the navigation files cover {span}; "
            "give the navigation file of that day with --nav"
        )
    klobuchar = next((file.klobuchar for file in navigation if file.klobuchar is not None), None)
    events: list[tuple[int, Event]] = [] if klobuchar is None else [(first_ns, IonosphereReceived(first_ns, klobuchar))]
    for eph in serving:
        arrival_ns = max(eph.transmission_ns, first_ns)
        events.append((arrival_ns, EphemerisReceived(arrival_ns, eph)))
    return events


def _merged(
    site: SiteConfig, epochs: Sequence[int], rows: Mapping[str, Mapping[int, ObservationRow]], navigation: Sequence[tuple[int, Event]]
) -> list[Event]:
    """Navigation before the epoch at or before which it was sent; after each epoch its tick; in a gap one tick when silence is noticed."""
    silence_ns = max(2 * site.epoch_interval_ns, 2 * NS_PER_S)
    events: list[Event] = []
    waiting = deque(navigation)
    previous_ns = epochs[0]

    def sent_until(gps_ns: int) -> None:
        while waiting and waiting[0][0] <= gps_ns:
            events.append(waiting.popleft()[1])

    for epoch_ns in epochs:
        if epoch_ns - previous_ns > silence_ns:
            noticed_ns = previous_ns + silence_ns + 1
            sent_until(noticed_ns)
            events.append(_tick(noticed_ns))
        sent_until(epoch_ns)
        events += [ObservationsReceived(epoch_ns, rows[receiver][epoch_ns]) for receiver in site.receiver_names]
        events.append(_tick(epoch_ns))
        previous_ns = epoch_ns
    return events


def _tick(gps_ns: int) -> Tick:
    return Tick(gps_ns, utc_from_gps(gps_ns), None)


def _spans(observations: Mapping[str, Sequence[ObservationFile]], site: SiteConfig) -> str:
    parts = []
    for receiver in site.receiver_names:
        times = sorted(row.receive_time_ns for file in observations[receiver] for row in file.rows)
        if not times:
            parts.append(f"{receiver} has no epochs")
            continue
        steps = sorted(b - a for a, b in pairwise(times) if b > a)
        every = f" every {steps[len(steps) // 2] / NS_PER_S:g} s" if steps else ""
        parts.append(f"{receiver} has {len(times)} from {format_utc(times[0])} to {format_utc(times[-1])}{every}")
    return "; ".join(parts)


def _warnings(observations: Mapping[str, Sequence[ObservationFile]], navigation: Sequence[NavigationFile], gps_ns: int) -> tuple[str, ...]:
    expected = leap_seconds_at_gps(gps_ns)
    files = [f for group in observations.values() for f in group] + list(navigation)
    wrong = [
        f"{f.path}: header says {f.leap_seconds} leap seconds, the table says {expected}; the table is used"
        for f in files
        if f.leap_seconds is not None and f.leap_seconds != expected
    ]
    if all(file.klobuchar is None for file in navigation):
        wrong.append("no navigation file has Klobuchar terms: the ionosphere stays in the ranges, several metres common to all receivers")
    return tuple(wrong)
