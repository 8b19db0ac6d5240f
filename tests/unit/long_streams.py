"""Streams around a given time, in each form in which a station hears its receivers, and every way of feeding them to a monitor."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cache
from typing import Literal

from integrity.config import SiteConfig
from integrity.events import EphemerisReceived, Event, RawBytes, Tick
from integrity.gnss.ephemeris.broadcast import KeplerEphemeris
from integrity.gnss.gps_time import NS_PER_S, parse_utc
from integrity.messages import wayside_pb2 as pb
from integrity.messages.snapshots import decode_snapshot, encode_snapshot
from integrity.outputs import HealthReport, Output
from integrity.station_monitor import StationMonitor
from recordings.simulate.observations import antennas_of, simulate
from recordings.simulate.receiver import as_bytes
from recordings.simulate.rtcm import as_rtcm
from tests.unit.monitored import decided
from tests.unit.streams import RECOVER_AFTER_S, SEED, a_site, health, new_monitor

Form = Literal["rows", "ubx", "rtcm3"]
FORMS: tuple[Form, ...] = ("rows", "ubx", "rtcm3")
START_UP = round(RECOVER_AFTER_S)  # epochs of 1 s until NORMAL

NEW_SETS = parse_utc("2026-03-02T02:00:00Z") // NS_PER_S // 3600 * 3600 * NS_PER_S  # of every GPS satellite
UNHEALTHY_FROM, UNHEALTHY_S = NEW_SETS - 1800 * NS_PER_S, {"G": 30, "E": 14}  # as long as all words take

Sets = Callable[[EphemerisReceived], Sequence[EphemerisReceived]]
"""What is transmitted instead of a set."""


@cache
def around(event_ns: int, before_s: int = 10, after_s: int = 10, interval_s: float = 1.0) -> tuple[Event, ...]:
    """A sound stream of the test site from some time before an event to some time after it, as rows and ephemerides."""
    return simulate(a_site(interval_s), event_ns - before_s * NS_PER_S, before_s + after_s, 1.0 / interval_s, SEED)


@cache
def site_of(form: Form, interval_s: float = 1.0) -> SiteConfig:
    """The test site, whose receivers speak RTCM 3 if the form is that."""
    site = a_site(interval_s)
    protocol: Literal["ubx", "rtcm3"] = "rtcm3" if form == "rtcm3" else "ubx"
    return replace(site, receivers=tuple(replace(receiver, protocol=protocol) for receiver in site.receivers))


@cache
def sent(events: tuple[Event, ...], form: Form) -> tuple[Event, ...]:
    """The same as the station hears it: bytes hold everything but ticks, ephemerides too."""
    if form == "rows":
        return events
    antennas = antennas_of(a_site())
    of_form = as_bytes(events, antennas) if form == "ubx" else as_rtcm(events, antennas)
    return tuple(event for event in of_form if isinstance(event, RawBytes | Tick))


def sets_changed(events: Sequence[Event], change: Sets) -> tuple[Event, ...]:
    """Each ephemeris replaced by what `change` makes of it, in the order of time."""
    changed: list[Event] = []
    for event in events:
        changed += change(event) if isinstance(event, EphemerisReceived) else [event]
    return tuple(sorted(changed, key=lambda event: (event.mono_ns, not isinstance(event, EphemerisReceived))))


def again(event: EphemerisReceived, at_ns: int, healthy: bool) -> EphemerisReceived:
    """The same set transmitted once more, with another word on the satellite's health."""
    assert isinstance(event.ephemeris, KeplerEphemeris)
    return EphemerisReceived(at_ns, replace(event.ephemeris, transmission_ns=at_ns, healthy=healthy))


def in_pieces(events: Sequence[Event]) -> tuple[Event, ...]:
    """Every burst of bytes in two, cut within a frame."""
    pieces: list[Event] = []
    for event in events:
        if isinstance(event, RawBytes):
            cut = len(event.data) - 7
            pieces += [replace(event, data=event.data[:cut]), replace(event, data=event.data[cut:])]
        else:
            pieces.append(event)
    return tuple(pieces)


def live(events: Sequence[Event], site: SiteConfig) -> list[Output]:
    """As a station lives: one piece at a time, and a look ahead whenever there is time."""
    monitor, outputs = new_monitor(site), []
    for event in in_pieces(events):
        outputs += monitor.feed([event])
        if isinstance(event, Tick):
            monitor.look_ahead()
    return outputs


def resumed(events: Sequence[Event], site: SiteConfig, at_ns: int) -> list[Output]:
    """One monitor until the first piece at or after a time, and another from its snapshot, through the message, from there on."""
    pieces = in_pieces(events)
    cut = 1 + next(i for i, event in enumerate(pieces) if event.mono_ns >= at_ns and not isinstance(event, EphemerisReceived))
    first = new_monitor(site)
    outputs = first.feed(pieces[:cut])
    message = encode_snapshot(first.snapshot(), site.receiver_names, at_ns).SerializeToString()
    second = StationMonitor(site, decode_snapshot(pb.Snapshot.FromString(message)))
    return outputs + second.feed(pieces[cut:])


def new_sets() -> tuple[Event, ...]:
    """A stream over `NEW_SETS`, long enough for all words of the new sets."""
    return around(NEW_SETS, 10, 35)


def satellite_in_use(events: Sequence[Event], system: str) -> str:
    """One of a system that is monitored from beginning to end."""
    said = [h for h in health(decided(events)) if h.monitored]
    return next(s[:3] for s in said[0].monitored if s.startswith(system) and all(s in h.monitored for h in said))


@cache
def marked_unhealthy(system: str) -> tuple[str, tuple[Event, ...]]:
    """A satellite, and a stream in which it says for a while that it is unhealthy, under its old issue."""
    events = around(UNHEALTHY_FROM, 10, 2 * UNHEALTHY_S[system])
    out = satellite_in_use(events, system)

    def change(event: EphemerisReceived) -> Sequence[EphemerisReceived]:
        if event.ephemeris.satellite != out:
            return [event]
        return [event, again(event, UNHEALTHY_FROM, False), again(event, UNHEALTHY_FROM + UNHEALTHY_S[system] * NS_PER_S, True)]

    return out, sets_changed(events, change)


def without(satellite: str, said: Sequence[HealthReport], event_ns: int) -> list[int]:
    """Seconds since an event in which a satellite is not monitored."""
    return [((h.gps_time_ns or 0) - event_ns) // NS_PER_S for h in said if not any(s.startswith(satellite) for s in h.monitored)]


def monitored(outputs: Sequence[Output]) -> list[set[str]]:
    return [set(h.monitored) for h in health(outputs)]
